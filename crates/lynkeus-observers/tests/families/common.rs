//! What the families' tests share.

use lynkeus_expr::Tape;
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Design, DesignError, Examination, Family, Tuning};
use lynkeus_structure::{Extended, Sensors};

/// A plant from its text.
pub fn plant(text: &str) -> Plant {
    Plant::from_modelica(text, "plant.mo", &LoadOptions::default()).unwrap()
}

/// The design of a family with every output measured.
pub fn design_with(
    family: &dyn Family,
    plant: &Plant,
    unknown: &[&str],
    tuning: &Tuning,
) -> Result<Design, DesignError> {
    let unknown = unknown.iter().map(|s| s.to_string()).collect();
    let sensors = Sensors {
        unknown,
        ..Sensors::default()
    };
    family.design(&Extended::new(plant, &sensors).unwrap(), tuning)
}

/// The examination that a refusal carries.
pub fn refused(family: &dyn Family, plant: &Plant, tuning: &Tuning) -> Examination {
    match design_with(family, plant, &[], tuning) {
        Err(DesignError::Refused(examination)) => *examination,
        other => panic!("expected a refusal, found {other:?}"),
    }
}

/// The derivative of the observer's states at a state, inputs and measurements.
pub fn slope(plant: &Plant, design: &Design, state: &[f64], u: &[f64], y: &[f64]) -> Vec<f64> {
    let observer = &design.observer;
    let mut inputs = vec![observer.time];
    inputs.extend(observer.states.iter().map(|(s, _)| s.symbol));
    inputs.extend(observer.inputs.iter().map(|s| s.symbol));
    inputs.extend(observer.measured.iter().map(|s| s.symbol));
    let tape = Tape::new(&plant.graph, &inputs, &observer.derivatives).unwrap();
    let mut out = vec![0.0; state.len()];
    tape.evaluator()
        .eval(&[&[0.0], state, u, y].concat(), &mut out);
    out
}

/// Equal to the last few bits.
pub fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let scale = expected.abs().max(1e-3);
        assert!(
            (found - expected).abs() < 1e-13 * scale,
            "{found} against {expected}"
        );
    }
}
