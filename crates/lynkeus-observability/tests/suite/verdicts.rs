//! Verdicts judged against answers from elsewhere: by hand, planted, or from another method.

mod branches;
mod independent;
mod limits;
mod nonrational;
mod planted;
mod starts;
mod traps;

use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observability::{Answer, Question, Verdict, analyse};

/// A model of these declarations and equations.
fn plant(declarations: &str, equations: &str) -> Plant {
    let text = format!("model M\n{declarations}\nequation\n{equations}\nend M;");
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    Plant::from_modelica(&text, "m.mo", &options).unwrap_or_else(|e| panic!("{e:?}\n{text}"))
}

/// A question that takes parameters as unknown.
fn question() -> Question {
    Question {
        parameters: true,
        ..Question::default()
    }
}

/// The names of what is observable, and of what is not; nothing may be undecided.
fn split(answer: &Answer) -> (String, String) {
    let of = |verdict: Verdict| {
        let quantities = answer.quantities.iter();
        let names = quantities.filter(|(asked, _)| asked.verdict == verdict);
        let names: Vec<&str> = names.map(|(asked, _)| asked.name.as_str()).collect();
        names.join(" ")
    };
    assert_eq!(of(Verdict::Undecided), "", "{:?}", answer.notes);
    (of(Verdict::Observable), of(Verdict::Unobservable))
}

#[track_caller]
fn expect(plant: &Plant, question: &Question, observable: &str, hidden: &str) -> Answer {
    let answer = analyse(plant, question).unwrap();
    let (found, lost) = split(&answer);
    assert_eq!((&found[..], &lost[..]), (observable, hidden), "{answer:?}");
    answer
}
