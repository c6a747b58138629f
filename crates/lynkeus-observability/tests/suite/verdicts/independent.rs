//! Random polynomial models with unknown inputs, against Lie derivatives written out by a
//! computer algebra system (SymPy): the outputs' derivatives along the flow of states and
//! of the unknown inputs' derivatives, two orders more than there are unknowns, and the rank of
//! their Jacobian at a random point modulo 2³¹ − 1.

use super::{expect, plant, question};
use lynkeus_observability::Question;
use serde_json::Value;

#[test]
fn unknown_inputs_agree_with_derivatives_written_out() {
    let cases: Value = serde_json::from_str(include_str!("independent.json")).unwrap();
    let cases = cases.as_array().unwrap();
    assert!(cases.len() >= 40);
    for case in cases {
        let text = |key: &str| case[key].as_str().unwrap();
        let names = |key: &str| -> String {
            let names = case[key].as_array().unwrap().iter();
            names
                .map(|n| n.as_str().unwrap())
                .collect::<Vec<_>>()
                .join(" ")
        };
        let model = plant(text("declarations"), text("equations"));
        let asking = Question {
            unknown: model.inputs.iter().map(|i| i.name.clone()).collect(),
            ..question()
        };
        expect(&model, &asking, &names("observable"), &names("hidden"));
    }
}
