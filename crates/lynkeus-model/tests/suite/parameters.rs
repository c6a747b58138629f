//! Values of parameters: given, dependent, overridden, symbolic.

use lynkeus_model::{Diagnostic, LoadOptions, Plant};

use crate::support::{slopes, values};

const TEXT: &str = "model M
  parameter Integer n = 2;
  parameter Real k3 = 3*k2;
  parameter Real k2 = 2*k1;
  parameter Real k1 = 1;
  final parameter Real c = 7;
  constant Real g = 9.81;
  parameter Real H[n] = fill(0.5, n);
  Real x[n](each start = 4*k1, each max = 10*n);
equation
  for i in 1:n loop
    H[i]*der(x[i]) = k3*x[i] + c;
  end for;
end M;";

fn load(text: &str, parameters: &[(&str, f64)], symbolic: bool) -> Result<Plant, Diagnostic> {
    let parameters = parameters
        .iter()
        .map(|(name, value)| ((*name).to_owned(), *value))
        .collect();
    let options = LoadOptions {
        parameters,
        symbolic_parameters: symbolic,
        model: None,
        ..LoadOptions::default()
    };
    Plant::from_modelica(text, "test.mo", &options)
}

#[test]
fn dependent_parameters_follow() {
    let plant = load(TEXT, &[], false).unwrap();
    assert_eq!(slopes(&plant, &[("x[1]", 1.0)]), [26.0, 14.0]);
    let plant = load(TEXT, &[("k1", 2.0), ("H[2]", 1.0)], false).unwrap();
    assert_eq!(slopes(&plant, &[("x[1]", 1.0)]), [38.0, 7.0]);
    assert_eq!(plant.states[0].start, Some(8.0));
    let plant = load(TEXT, &[("k3", 1.0)], false).unwrap();
    assert_eq!(slopes(&plant, &[("x[1]", 1.0)]), [16.0, 14.0]);
}

#[test]
fn sizes_follow() {
    let plant = load(TEXT, &[("n", 3.0), ("H[3]", 7.0)], false).unwrap();
    assert_eq!(slopes(&plant, &[]), [14.0, 14.0, 1.0]);
    assert_eq!(plant.states[2].max, 30.0);
}

#[test]
fn parameters_of_parts_are_given_by_their_names_in_full() {
    let text = "model M
      parameter Real part[1].k = 2;
      parameter Real part[1].H[2] = {3, 4};
      Real x(start = 1);
    equation
      der(x) = part[1].k + sum(part[1].H);
    end M;";
    let given = [("part[1].k", 10.0), ("part[1].H[2]", 0.5)];
    let plant = load(text, &given, false).unwrap();
    assert_eq!(slopes(&plant, &[]), [13.5]);
    for (name, expected) in [
        ("part[1].q", "model `M` has no parameter `part[1].q`"),
        ("part[1].H[3]", "`part[1].H` [3], which has the size [2]"),
        (
            "part[1].H[2",
            "`part[1].H[2` is not the name of a parameter",
        ),
    ] {
        let found = load(text, &[(name, 1.0)], false).unwrap_err().one_line();
        assert!(found.contains(expected), "{name}: {found}");
    }
}

#[test]
fn listed_parameters() {
    for symbolic in [false, true] {
        let plant = load(TEXT, &[("H[2]", 4.0)], symbolic).unwrap();
        let found: Vec<(&str, Option<f64>, bool)> = plant
            .parameters
            .iter()
            .map(|p| (p.variable.name.as_str(), p.value, p.variable.integer))
            .collect();
        let expected = [
            ("n", Some(2.0), true),
            ("k1", Some(1.0), false),
            ("H[1]", Some(0.5), false),
            ("H[2]", Some(4.0), false),
        ];
        assert_eq!(found, expected);
    }
}

#[test]
fn symbolic_parameters() {
    let plant = load(TEXT, &[], true).unwrap();
    let given = [("x[1]", 1.0), ("k1", 2.0), ("H[1]", 0.5), ("H[2]", 1.0)];
    assert_eq!(slopes(&plant, &given), [38.0, 7.0]);
    // Attributes use the values.
    assert_eq!(plant.states[0].start, Some(4.0));
}

#[test]
fn symbolic_parameters_without_value() {
    let text = "model M
      parameter Real k;
      parameter Real q = 2*k;
      parameter Real w[2];
      Real x(start = k, max = 1);
      output Real y = k*x;
    equation
      der(x) = q*x + w[1] + w[2];
    end M;";
    let plant = load(text, &[], true).unwrap();
    assert_eq!((plant.states[0].start, plant.states[0].max), (None, 1.0));
    let names: Vec<&str> = plant
        .parameters
        .iter()
        .map(|p| p.variable.name.as_str())
        .collect();
    assert_eq!(names, ["k", "w[1]", "w[2]"]);
    let given = [("k", 3.0), ("x", 2.0), ("w[1]", 10.0), ("w[2]", 20.0)];
    assert_eq!(slopes(&plant, &given), [42.0]);
    assert_eq!(values(&plant, &[plant.outputs[0].node], &given), [6.0]);
    let refused = load(text, &[], false).unwrap_err();
    assert_eq!(
        (refused.line, refused.message.as_str()),
        (2, "parameter `k` has no value")
    );
    let with_values = load(text, &[("k", 3.0), ("w[1]", 10.0), ("w[2]", 20.0)], false).unwrap();
    assert_eq!(slopes(&with_values, &[("x", 2.0)]), [42.0]);
    assert_eq!(with_values.states[0].start, Some(3.0));
}

#[test]
fn a_size_without_value() {
    let text = "model M parameter Integer n; Real x[n]; equation der(x) = -x; end M;";
    let refused = load(text, &[], true).unwrap_err();
    assert!(
        refused
            .message
            .contains("parameter `n` has no value, but one is needed")
    );
    assert_eq!(load(text, &[("n", 4.0)], true).unwrap().states.len(), 4);
}

#[test]
fn symbolic_exponents_and_conditions() {
    let text = "model M
      parameter Real p = 2; parameter Integer n = 3; Real x;
    equation
      der(x) = x^p + x^n + (if p > 1 then 1 else 2);
    end M;";
    let plant = load(text, &[], true).unwrap();
    assert_eq!(slopes(&plant, &[("x", 2.0), ("p", 1.0)]), [12.0]);
    let plant = load(text, &[], false).unwrap();
    assert_eq!(slopes(&plant, &[("x", -2.0)]), [-3.0]);
}

#[test]
fn refused_overrides() {
    for (name, value, expected) in [
        (
            "k4",
            1.0,
            "test.mo:1:7: model `M` has no parameter `k4` (did you mean `k1` or `k2` or",
        ),
        ("zzz", 1.0, "(its parameters are n, k3, k2, k1, H)"),
        (
            "c",
            1.0,
            "`c` is a final parameter; its value cannot be set from outside",
        ),
        (
            "g",
            1.0,
            "`g` is a constant; its value cannot be set from outside",
        ),
        (
            "x",
            1.0,
            "`x` is a variable; its value cannot be set from outside",
        ),
        (
            "H",
            1.0,
            "a value is given for `H` a scalar, which has the size [2]",
        ),
        (
            "H[3]",
            1.0,
            "a value is given for `H` [3], which has the size [2]",
        ),
        (
            "k1[1]",
            1.0,
            "a value is given for `k1` [1], which has the size a scalar",
        ),
        ("H[", 1.0, "`H[` is not the name of a parameter"),
        ("n", 2.5, "`n` is an Integer and is given the value 2.5"),
        ("k1", f64::NAN, "parameter `k1` is given the value NaN"),
    ] {
        let found = load(TEXT, &[(name, value)], false).unwrap_err().one_line();
        assert!(found.contains(expected), "{name}: {found}");
    }
}
