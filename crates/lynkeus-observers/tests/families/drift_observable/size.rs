//! Plants that are too large, or too long for floating point.

use std::time::Duration;

use lynkeus_expr::{Budget, Spent};
use lynkeus_observers::{Examination, Tuning, drift_observable::DRIFT_OBSERVABLE};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing};
use lynkeus_words::Words;

use crate::common::plant;

/// Heat along n cells, the first measured, with more equations and states.
fn examined(n: usize, declared: &str, equations: &str, seconds: u64) -> Examination {
    let text = format!(
        "model H Real x[{n}](each min = -1, each max = 1); {declared} output Real y = x[1];
         equation der(x[1]) = x[2] - x[1];
         for i in 2:{n}-1 loop der(x[i]) = x[i+1] - 2*x[i] + x[i-1]; end for;
         der(x[{n}]) = x[{n}-1] - x[{n}]^3; {equations} end H;"
    );
    let plant = plant(&text);
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let budget = Budget::new(Some(Duration::from_secs(seconds)), None);
    augmented.graph().set_budget(budget);
    DRIFT_OBSERVABLE
        .examine(&augmented, &Tuning::default())
        .unwrap()
}

/// Thirty derivatives tell thirty cells, but not in sixteen digits.
#[test]
fn what_rounding_hides_is_undecided() {
    let found = examined(30, "", "", 100);
    assert_eq!(
        found.spent(),
        Some(Spent::Digits),
        "{}",
        found.summary.words()
    );
    assert_eq!(found.fit(), Standing::Undecided);
}

#[test]
fn what_is_hidden_is_told_exactly_in_a_long_chain() {
    let found = examined(25, "Real h(min = -1, max = 1);", "der(h) = -h + x[3];", 100);
    assert_eq!(found.fit(), Standing::Refuted);
    let told =
        "determine 25 of 26 combinations of states: no measured output feels h; measure more";
    assert!(
        found.summary.words().ends_with(told),
        "{}",
        found.summary.words()
    );
}

#[test]
fn a_map_that_is_too_large_is_not_begun() {
    let begun = std::time::Instant::now();
    let found = examined(400, "", "", 10);
    let Some(Spent::Size(operations)) = found.spent() else {
        panic!("{}", found.summary.words())
    };
    // n² products of the cube's series alone, with n slopes each
    assert!(operations > 400 * 400 * 400, "{operations}");
    assert!(
        begun.elapsed() < Duration::from_secs(20),
        "{:?}",
        begun.elapsed()
    );
}
