//! Angles and rotations in every language.

use super::{has, look, rust};
use crate::manifold::{ROTOR, attitude, rotor, tracked};
use crate::skipped;

/// Turning many times, from far off, with gaps, a gate and steps within the rows; an angle with a declared turn and
/// without.
#[test]
fn angles_and_rotations_are_those_of_estimate() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let mut looked = vec![];
    // each plant in other languages by each filter
    for (family, more, mut seeds) in [("ekf", "gate = 6", 0..), ("ukf", "", 4..)] {
        for folder in [rotor(family, more), attitude(family, more), tracked(family)] {
            let log = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
            assert!(log.code <= 1, "{}", log.err);
            let seed = seeds.next().unwrap();
            looked.push(look(seed, folder).unwrap());
        }
    }
    let folder = rotor("ekf", "");
    let run = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
    assert!(run.code <= 1, "{}", run.err);
    folder.write(
        "m.mo",
        &ROTOR.replace("min = -3.14159, max = 3.14159, ", ""),
    );
    looked.push(look(8, folder).unwrap());
    let code = looked[1].folder.read("c/body.h");
    assert!(code.contains("q_sd") && !code.contains("q[1]_sd"), "{code}");
    rust::check(&looked);
}
