//! A moving input and the practical observer of Germani and Manes; bounds of inputs' derivatives
//! and of time from the study.

use crate::Folder;

use super::{refused, says};

const RAMP: &str = "model Ramp
  input Real u(min = -2, max = 2, start = 0);
  Real x1(start = 0, min = -20, max = 20);
  Real x2(start = 0, min = -5, max = 5);
  output Real y = x1;
equation
  der(x1) = x2 + u;
  der(x2) = -0.1*x2;
end Ramp;
";

fn ramp(rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("ramp.mo", RAMP);
    let observer = "family = \"drift-observable\"\nvariant = \"practical\"\npoles = [-1, -2]\nfilter_poles = -1000";
    folder.write(
        "ramp.toml",
        &format!("plant = \"ramp.mo\"\n[observer]\n{observer}\n{rest}"),
    );
    folder
}

/// u = 2 sin 0.1t leaves 0.2596 of x2 for ever.
#[test]
fn a_moving_input_stays_in_the_ultimate_bound() {
    for rest in [
        "input_derivatives = [0.2]\n",
        "[certify]\ninput_derivatives = { u = [0.2, 0.02] }\n[box]\ntime = [0, 60]\n",
    ] {
        let ended = ramp(rest).run(&["certify", "ramp.toml", "--json"]);
        let certificate = &ended.json()["certificate"];
        assert_eq!(certificate["verdict"], "proved", "{certificate}");
        let bound = certificate["ultimate_bound"].as_f64().unwrap();
        assert!((0.2596..1.5).contains(&bound), "{bound}");
    }
}

#[test]
fn bounds_of_other_inputs_and_negative_ones_are_refused() {
    let other = ramp("[certify]\ninput_derivatives = { v = 1 }\n").run(&["certify", "ramp.toml"]);
    refused(
        &other,
        2,
        &["no known input is called \"v\"", "choose from: u"],
    );
    let negative = ramp("[certify]\ninput_derivatives = { u = [-1] }\n");
    refused(
        &negative.run(&["certify", "ramp.toml"]),
        2,
        &["a bound, a number ≥ 0"],
    );
    let none = ramp("").run(&["certify", "ramp.toml"]);
    says(
        &none.out,
        &["no bound of the derivatives of u", "[certify]"],
    );
}
