//! Conditions of families and hypotheses of theorems, with what was found of them.

use crate::short;
use lynkeus_expr::Interval;
use lynkeus_observers::{Check, Constant, DesignError, Examination, Reason, Statement};

use crate::Words;

impl Words for Statement {
    fn words(&self) -> String {
        match self {
            Self::PlantIsRegular => {
                "f and h have values on the whole box and do not jump".to_owned()
            }
            Self::WhatActs => "disturbances and measurement errors are bounded".to_owned(),
            Self::ReadingsAreShown => "no reading is beyond its sensor's range".to_owned(),
            Self::Finished => "everything was examined".to_owned(),
            Self::PartialKeepsSign { of, by } => format!("∂f({of})/∂{by} keeps its sign"),
            Self::OutputKeepsSign { output, state } => format!("∂{output}/∂{state} keeps its sign"),
            Self::Lipschitz => "∂f/∂x is bounded on the box".to_owned(),
            Self::SlopesOfTheProof => "every ∂f/∂x of the proof has a bound on the box".to_owned(),
            Self::FilterConverges => "the filter's error decays".to_owned(),
            Self::Inequality(part) => part.words(),
            Self::Hammouri(part) => part.words(),
            Self::Lee(part) => part.words(),
            Self::Ltaief(part) => part.words(),
            Self::Farza(part) => part.words(),
            Self::Germani(part) => part.words(),
        }
    }
}

impl Words for Reason {
    fn words(&self) -> String {
        match self {
            Self::Structure(reason) => reason.words(),
            Self::AtMost { found, limit } => {
                let sign = if found <= limit { "≤" } else { ">" };
                format!("{} {sign} {}", short(*found), short(*limit))
            }
            Self::AtLeast { found, least } => {
                let sign = if found >= least { "≥" } else { "<" };
                format!("{} {sign} {}", short(*found), short(*least))
            }
            Self::Spent(spent) => spent.to_string(),
            Self::Ended(spent) => format!("undecided: {spent}"),
            Self::Enclosed(count) => format!("{count} entries enclosed"),
            Self::Unbounded { of, by, slope, undeclared } => {
                let entry = format!("∂f({of})/∂{by} = {slope}");
                match undeclared.as_deref() {
                    None => format!("{entry} is not known to be bounded; declare min and max, and mind divisions and roots at the edges of the box"),
                    Some([]) => format!("{entry} has no bound on the box: mind divisions and roots at its edges"),
                    Some(names) => format!("{entry} has no bound: declare min and max of {}", names.join(", ")),
                }
            }
            Self::Switches { of, with } => format!("f({of}) switches with {with}, so no Lipschitz constant is known for it"),
            Self::WhereNothingIs { found, of } => format!("{}, but where f({of}) has no value", found.words()),
            Self::Assumed => "assumed, by the declared ranges and deviations".to_owned(),
            Self::ActsWithoutBound(names) => format!("no bound of what acts on {}: declare min and max of the disturbances and of the states that they meet", names.join(", ")),
            Self::ReadingsOnTheBox => "h on the box, with the measurement errors".to_owned(),
            Self::BeyondSensors(outputs) => {
                let range = |of: &Interval| format!("[{}, {}]", short(of.lo()), short(of.hi()));
                let one = |(name, reading, sensor): &(String, Interval, Interval)| format!("{name} lies in {} and its sensor shows {}", range(reading), range(sensor));
                let all: Vec<String> = outputs.iter().map(one).collect();
                format!("{}: at an end of the range a reading is no value of h; narrow the box, or take family = \"ekf\", which counts it as a bound", all.join("; "))
            }
            Self::Moved { states, in_mean_square } => {
                let kept = match in_mean_square {
                    true => "what ends within a bound is its mean square, for a plant that goes on outside of the box with the same slopes",
                    false => "of its mean square no bound is known here either",
                };
                format!("the process noise of {} is Gaussian, so that no bound holds of the error for certain and plant and estimate leave any box now and then: {kept}", states.join(", "))
            }
            Self::WithoutNoise { norm, states } => {
                let each = states.iter().map(|(name, value)| format!("{} of {name}", short(*value)));
                let within = match states.is_empty() {
                    true => format!("{} (Euclidean norm)", short(*norm)),
                    false => each.collect::<Vec<_>>().join(", "),
                };
                format!("without the process noise the error would end within {within}")
            }
            Self::NoUltimateBound => "no ultimate bound: the assumed drift or noise has no bound, or S⁻¹ could not be enclosed".to_owned(),
            Self::EveryStart => "The guarantee holds for every start of the estimate, while the plant stays in the box: outside of it the functions are prolonged with the same bounds of their slopes ('prolong').".to_owned(),
            Self::PartOfTheBox => "The guarantee holds while plant and estimate stay in the box, which is smaller than the declared one that the functions are prolonged from ('prolong'): on the declared box it would hold for every start of the estimate.".to_owned(),
            Self::InTheBox { clamp: true } => "The guarantee holds while plant and estimate stay in the box. Limiting what the functions see ('clamp') is no prolongation as the paper's: where an estimate is outside of its range, the functions do not react to it any more and the proof does not cover that time.".to_owned(),
            Self::InTheBox { clamp: false } => "The guarantee holds while plant and estimate stay in the box, or the functions are prolonged outside of it with the same bounds of their partial derivatives.".to_owned(),
            Self::AnotherObserver { key } => format!("the key '{key}' makes another observer, which the theorem does not cover"),
            Self::PartialsVary { output } => format!("form: in the chain of {output} the partials vary more than the stability of M is proved for; narrower min and max help, and for the family triangular partials = true, which makes M constant"),
            Self::AnyPlant(filter) => format!("the {filter} runs on any plant; no theorem bounds its error"),
            Self::GainOfTheRun => "its gain depends on the run: no theorem holds on the whole box, however good it is on a log".to_owned(),
            Self::Guarantee(said) => said.words(),
            Self::Triangular(said) => said.words(),
            Self::BlockTriangular(said) => said.words(),
            Self::StateAffine(said) => said.words(),
            Self::UnknownInput(said) => said.words(),
            Self::DriftObservable(said) => said.words(),
        }
    }
}

impl Words for Constant {
    fn words(&self) -> String {
        let numbers: Vec<String> = self.numbers.iter().map(|x| short(*x)).collect();
        self.meaning.replace("{}", &numbers.join(", "))
    }
}

impl Words for Check {
    fn words(&self) -> String {
        let (statement, reason) = (self.statement.words(), self.reason.words());
        format!("{statement}: {} ({reason})", self.verdict.words())
    }
}

impl Words for DesignError {
    fn words(&self) -> String {
        match self {
            DesignError::Refused(examination) => refusal(examination),
            DesignError::NoGain { reason, .. } => reason.words(),
            error => error.to_string(),
        }
    }
}

fn refusal(examination: &Examination) -> String {
    let (family, summary) = (examination.family, examination.summary.words());
    let mut text = match examination.spent() {
        Some(_) => format!("whether the family '{family}' fits is {summary}"),
        None => format!("the family '{family}' does not fit: {summary}"),
    };
    if let Some(check) = examination.refuted() {
        text += &format!("\n  {}", check.words());
    }
    text
}
