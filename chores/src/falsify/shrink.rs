//! A false claim made small: terms, inputs and keys are dropped as long as a claim of
//! the same kind stays false.

use super::case::Case;
use super::judge::{Desk, Effort, Violation, judge};
use crate::numbers::Numbers;

/// Cases tried at most.
const TRIALS: usize = 60;

/// The smallest case found with a violation of the same kind.
pub fn smallest(case: &Case, desk: &Desk, first: &Violation, effort: Effort) -> (Case, Violation) {
    let mut best = (case.clone(), first.clone());
    let mut trials = 0;
    loop {
        let smaller = simpler(&best.0).into_iter().find_map(|case| {
            trials += 1;
            if trials > TRIALS {
                return None;
            }
            let violation = again(&case, desk, first, effort)?;
            Some((case, violation))
        });
        match smaller {
            Some(smaller) => best = smaller,
            None => return best,
        }
    }
}

/// The violation of the same kind, if there is one.
fn again(case: &Case, desk: &Desk, like: &Violation, effort: Effort) -> Option<Violation> {
    let mut numbers = Numbers::new(7, 7);
    let judged = std::panic::AssertUnwindSafe(|| judge(case, desk, &mut numbers, effort, false));
    let judgement = std::panic::catch_unwind(judged).ok()?.ok()?;
    judgement
        .violations
        .into_iter()
        .find(|v| v.flaw == like.flaw)
}

/// Cases with one thing less.
fn simpler(case: &Case) -> Vec<Case> {
    let mut cases = vec![];
    for i in 0..case.equations.len() {
        for j in 0..case.equations[i].len() {
            let mut less = case.clone();
            less.equations[i].remove(j);
            cases.push(less);
        }
    }
    for i in 0..case.couplings.len() {
        let mut less = case.clone();
        less.couplings.remove(i);
        cases.push(less);
    }
    for i in 0..case.outputs.len() {
        for j in 0..case.outputs[i].len() {
            if case.outputs[i].len() > 1 {
                let mut less = case.clone();
                less.outputs[i].remove(j);
                cases.push(less);
            }
        }
        if case.noise[i].size > 0.0 {
            let mut less = case.clone();
            less.noise[i].size = 0.0;
            cases.push(less);
        }
    }
    for i in 0..case.inputs.len() {
        let name = &case.inputs[i].side.name;
        let terms = case.equations.iter().chain(&case.outputs).flatten();
        let factors = case.couplings.iter().map(|c| &c.factor);
        if !terms
            .chain(factors)
            .any(|term| term.contains(name.as_str()))
        {
            let mut less = case.clone();
            less.inputs.remove(i);
            cases.push(less);
        }
    }
    for i in 0..case.process.len() {
        let mut less = case.clone();
        less.process[i].1 = 0.0;
        cases.extend((case.process[i].1 > 0.0).then_some(less));
    }
    if let Some(tube) = &case.tube {
        let mut less = case.clone();
        less.tube = None;
        cases.extend(case.course.is_none().then_some(less));
        for i in 0..tube.start.len() {
            let mut less = case.clone();
            if let Some(tube) = &mut less.tube {
                tube.start.remove(i);
            }
            cases.push(less);
        }
    }
    for (key, _) in &case.observer {
        if !["family", "theta", "poles", "gain", "rate", "initial"].contains(&key.as_str()) {
            let mut less = case.clone();
            less.observer.retain(|(k, _)| k != key);
            cases.push(less);
        }
    }
    cases
}
