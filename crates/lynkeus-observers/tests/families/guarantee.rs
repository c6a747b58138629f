//! What is certified of an observer as a system, whatever its family.

use crate::common::{design_with, plant};
use lynkeus_observers::{Assumptions, Certificate, Claim, Tuning, certify, triangular::TRIANGULAR};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing};
use lynkeus_words::Words;

/// The certificate of x̂' = −x̂ − f(x̂) − θ(x̂ − y) on x in [0, 2].
fn certified(f: &str) -> Certificate {
    let plant = plant(&format!(
        "model P Real x(start = 0.1, min = 0, max = 2); output Real y = x; equation der(x) = -x - {f}; end P;"
    ));
    let design = design_with(TRIANGULAR, &plant, &[], &Tuning::from([("theta", 3.0)])).unwrap();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region()).unwrap();
    certify(&augmented, &design.observer, &assumptions, Claim::Fastest).unwrap()
}

/// Beyond x = 1.77 the slope of exp(400 x) is no number: nothing is said of every point.
#[test]
fn points_without_eigenvalues_are_not_called_stable() {
    let found = certified("exp(400*x)");
    assert_eq!(found.verdict(), Standing::Undecided);
    let said: Vec<String> = found.notes.iter().map(Words::words).collect();
    let said = said.join("\n");
    assert!(
        !said.contains("at every point") && !said.contains("inf"),
        "{said}"
    );
    // all of them are seen, and more than that is proved
    assert_eq!(certified("exp(x)").verdict(), Standing::Proved);
}
