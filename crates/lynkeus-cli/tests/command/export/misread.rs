//! Inputs that are read with errors and sensors whose noises go together, in every language.

use super::{has, look, rust};
use crate::misread::kettle;
use crate::skipped;

#[test]
fn errors_of_inputs_and_common_noises_are_those_of_estimate() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let mut looked = vec![];
    let cases = [
        ("ekf", "gate = 6"),
        ("ekf", "iterations = 4"),
        ("ukf", ""),
        ("triangular", "theta = 1"),
    ];
    for (seed, (family, more)) in cases.into_iter().enumerate() {
        let folder = kettle(family, more);
        if family == "triangular" {
            let only = "measured = [\"lid\"]\nnoise = { lid = 0.2, wall = 0.3 }";
            folder.change("s.toml", "noise = { lid = 0.2, wall = 0.3 }", only);
        }
        let log = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
        assert!(log.code <= 1, "{}", log.err);
        looked.push(look(seed as u64, folder).unwrap());
    }
    rust::check(&looked);
}
