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

/// Van der Pol's oscillator, its position measured, at a θ.
fn oscillator(θ: f64) -> Certificate {
    let plant = plant(
        "model P
          Real x(start = 1, min = -6, max = 6); Real v(start = 0, min = -8, max = 8);
          output Real y = x;
        equation
          der(x) = v; der(v) = (1 - x^2)*v - x;
        end P;",
    );
    let design = design_with(TRIANGULAR, &plant, &[], &Tuning::from([("theta", θ)])).unwrap();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region()).unwrap();
    certify(&augmented, &design.observer, &assumptions, Claim::Fastest).unwrap()
}

/// The slopes 1 − x² and −2xv − 1 are at their ends together nowhere: at x = 0, where the first one drives, the other one
/// is −1.
#[test]
fn slopes_count_as_they_are_together() {
    let words = |found: &Certificate| {
        let checks = found.hypotheses.iter().map(|check| check.words());
        checks.collect::<Vec<_>>().join("\n")
    };
    let together = oscillator(6.0);
    assert_eq!(together.verdict(), Standing::Proved, "{}", words(&together));
    assert!(
        words(&together).contains("together"),
        "{}",
        words(&together)
    );
    let rate = together.rate.unwrap();
    assert!(rate > 0.3, "{rate}");
    // where apart they are not too many, they stay apart
    let apart = oscillator(16.0);
    assert_eq!(apart.verdict(), Standing::Proved);
    assert!(!words(&apart).contains("together"), "{}", words(&apart));
    // at x = 1, v = -8 the Jacobian has an eigenvalue to the right: no P serves
    assert_eq!(oscillator(3.0).verdict(), Standing::Undecided);
}
