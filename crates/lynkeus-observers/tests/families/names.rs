//! Names that read like the labels of the observers' own symbols.

use lynkeus_expr::Expr;
use lynkeus_model::{Model, Plant, Variable};
use lynkeus_observers::{
    Family, Tuning, Value, block_triangular::BLOCK_TRIANGULAR, drift_observable::DRIFT_OBSERVABLE,
    state_affine::STATE_AFFINE, triangular::TRIANGULAR,
};

use crate::common::{Guaranteed, design_with, slope};

/// Names of a, b, u and y; the first ones meet nothing.
const NAMES: &[[&str; 4]] = &[
    ["a", "b", "u", "y"],
    ["a", "estimate of a", "u", "y"],
    ["estimate of b", "b", "measured y", "y"],
    ["error of b", "b", "derivative 1 of u", "y"],
    ["a", "error of a", "variation of a", "y"],
    ["a", "filter of u", "u", "y"],
    ["a", "slope of a", "a as measured", "y"],
    ["a", "[a in row 1]", "factor ln d(a)", "y"],
];

/// a' = b (1 + u/10) − a, b' = −sin(b) + u, y = a.
fn plant([a, b, u, y]: [&str; 4]) -> Plant {
    let within = |min: f64, max: f64| move |of: &mut Variable| (of.min, of.max) = (min, max);
    let model = Model::new("named");
    let (a_, b_) = (
        model.state(a, within(-1.0, 1.0)),
        model.state(b, within(-1.0, 1.0)),
    );
    let u_ = model.input(u, within(-0.5, 0.5));
    let der = |x: Expr<'_>, value: Expr<'_>| model.der(x, value);
    der(a_, b_ * (u_ * 0.1 + 1.0) - a_);
    der(b_, u_ - b_.sin());
    model.output(y, a_, |_| ());
    model.finish().unwrap()
}

fn families() -> [(&'static dyn Family, Tuning); 4] {
    let mut poles = Tuning::default();
    let list = [-3.0, -4.0].map(Value::Number).to_vec();
    poles.values.insert("poles".to_owned(), Value::List(list));
    let theta = || Tuning::from([("theta", 3.0)]);
    [
        (TRIANGULAR, theta()),
        (BLOCK_TRIANGULAR, theta()),
        (STATE_AFFINE, theta()),
        (DRIFT_OBSERVABLE, poles),
    ]
}

/// What is designed and what is proved does not depend on what things are called.
#[test]
fn no_name_meets_a_symbol_of_the_observer() {
    for (family, tuning) in families() {
        let told: Vec<_> = NAMES
            .iter()
            .map(|&names| told(family, &tuning, names))
            .collect();
        for (names, other) in NAMES.iter().zip(&told) {
            assert_eq!(other, &told[0], "{} {names:?}", family.name());
        }
    }
}

/// x̂' at a point, then the verdict and the constants of the theorem.
fn told(
    family: &'static dyn Family,
    tuning: &Tuning,
    names: [&str; 4],
) -> (Vec<f64>, Option<f64>, Vec<f64>) {
    let plant = plant(names);
    let design = design_with(family, &plant, &[], tuning).unwrap();
    let states: Vec<f64> = (0..design.observer.states.len())
        .map(|i| 0.3 / (i + 1) as f64)
        .collect();
    let moved = match design.observer.input_derivatives.is_empty() {
        true => slope(&plant, &design, &states, &[0.2], &[0.1]),
        false => vec![],
    };
    let certificate = Guaranteed {
        family,
        plant: &plant,
        unknown: &[],
        tuning: tuning.clone(),
        drift: vec![0.0; 2],
        noise: vec![0.0],
    }
    .certificate();
    let constants = certificate.constants.iter().map(|c| c.value);
    (moved, certificate.rate, constants.collect())
}
