//! Bad input, and questions too large for their limits.

use std::time::{Duration, Instant};

use super::{plant, question};
use lynkeus_expr::{Budget, Memory};
use lynkeus_observability::{Note, Question, QuestionError, Verdict, analyse};

#[test]
fn a_model_without_output_is_told_so() {
    let error = analyse(&plant("Real x;", "der(x) = -x;"), &question()).unwrap_err();
    assert_eq!(error, QuestionError::NothingMeasured("M".into()));
    assert!(error.to_string().contains("output Real y = x"), "{error}");
}

#[test]
fn unknown_names_are_told_with_those_there_are() {
    let model = plant(
        "input Real u; Real x; output Real y = x;",
        "der(x) = u - x;",
    );
    let asking = Question {
        known_starts: vec!["z".into()],
        ..question()
    };
    let error = analyse(&model, &asking).unwrap_err().to_string();
    assert_eq!(error, "the plant has no state named 'z'; it has x");
    let asking = Question {
        about: vec!["x +".into()],
        ..question()
    };
    assert!(analyse(&model, &asking).is_err());
}

#[test]
fn what_is_defined_nowhere_is_undecided_in_words() {
    for equation in [
        "der(x) = 1/(x - x*z/z);",
        "der(x) = x/(z - z);",
        "der(x) = 1/sin(x - z*x/z);",
    ] {
        let model = plant(
            "parameter Real z = 3; Real x(start = 1); output Real y = x;",
            equation,
        );
        let answer = analyse(&model, &question()).unwrap();
        assert_eq!(answer.verdict("x"), Some(Verdict::Undecided), "{equation}");
        assert!(
            matches!(
                answer.notes[..],
                [Note::Singular | Note::NotDefined(_) | Note::SingularSystem]
            ),
            "{:?}",
            answer.notes
        );
    }
}

/// Roots of x − 1, and of 1 − x, are never both real; the analysis does not mind.
#[test]
fn roots_that_exclude_each_other_have_a_point() {
    let model = plant(
        "Real x(start = 1); output Real y = sqrt(x) + sqrt(3*x);",
        "der(x) = -sqrt(x - 1) - sqrt(1 - x);",
    );
    let answer = analyse(&model, &Question::default()).unwrap();
    assert_eq!(answer.verdict("x"), Some(Verdict::Observable));
}

/// A chain with two parameters per state, all unknown.
fn large(n: usize) -> lynkeus_model::Plant {
    plant(
        &format!(
            "parameter Real a[{n}]; parameter Real b[{n}]; Real x[{n}]; output Real y = x[1];"
        ),
        &format!(
            "for i in 1:{} loop der(x[i]) = a[i]*x[i+1] - b[i]*x[i]^2; end for; der(x[{n}]) = -a[{n}]*x[{n}] - b[{n}]*x[1];",
            n - 1
        ),
    )
}

#[test]
fn two_thousand_parameters_end_at_the_limit_of_time() {
    let model = large(1000);
    let asking = Question {
        budget: Budget::new(Some(Duration::from_secs(2)), None),
        ..question()
    };
    let begun = Instant::now();
    let answer = analyse(&model, &asking).unwrap();
    let taken = begun.elapsed();
    assert!(taken < Duration::from_secs(20), "{taken:?}");
    assert_eq!(answer.verdict("x[1]"), Some(Verdict::Observable));
    assert_eq!(answer.verdict("a[900]"), Some(Verdict::Undecided));
    let is_struck = |note: &Note| matches!(note, Note::Struck("time", _));
    assert!(answer.notes.iter().any(is_struck), "{:?}", answer.notes);
}

#[test]
fn memory_ends_it_as_well() {
    let asking = Question {
        budget: Budget::new(
            None,
            Some(Memory {
                limit: 1 << 20,
                used: || 0,
                before: 0,
            }),
        ),
        ..question()
    };
    let answer = analyse(&large(60), &asking).unwrap();
    assert_eq!(answer.verdict("x[1]"), Some(Verdict::Observable));
    assert_eq!(answer.verdict("b[60]"), Some(Verdict::Undecided));
    let is_struck = |note: &Note| matches!(note, Note::Struck("memory", _));
    assert!(answer.notes.iter().any(is_struck), "{:?}", answer.notes);
}
