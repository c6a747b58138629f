//! What a report says is what the equations are: gains, bounds and what is taken for
//! granted.

use serde_json::Value;

use crate::Folder;

/// The report on a plant and a study, for machines.
fn certified(plant: &str, study: &str) -> Value {
    let folder = Folder::empty();
    folder.write("m.mo", plant);
    folder.write("m.toml", &format!("plant = \"m.mo\"\n{study}"));
    let ended = folder.run(&["certify", "m.toml", "--json"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.json()
}

const HIGH_GAIN: &str = "[observer]\nfamily = \"triangular\"\ntheta = 2\n";

fn notes(report: &Value) -> String {
    report["certificate"]["notes"].to_string()
}

/// e' = −(0.1 + k)e + k(y − a): the error ends within sup|y − a|·k/(k + 0.1).
#[test]
fn what_disturbs_an_output_counts() {
    for (output, noise, off) in [
        ("a + d", "", 1.0),
        ("a*(1 + 0.1*d)", "", 0.5),
        ("a + 2*d - d", "noise = { y = 0.1 }", 1.3),
        // three times 5 % of what is read, up to 6
        ("a + d", "noise = { y = \"5%\" }", 1.9),
    ] {
        let plant = format!(
            "model M input Real d(min = -1, max = 1); Real a(min = -5, max = 5, start = 0);
             output Real y = {output}; equation der(a) = -0.1*a; end M;"
        );
        let study = format!("[sensors]\ndisturbances = [\"d\"]\n{noise}\n{HIGH_GAIN}");
        let report = certified(&plant, &study);
        let k = report["gain"]["a"]["y"].as_f64().unwrap();
        let least = off * k / (k + 0.1);
        for bound in [
            &report["certificate"]["ultimate_bound"],
            &report["certificate"]["theorem"]["ultimate_bound"],
        ] {
            let bound = bound.as_f64().unwrap();
            assert!(
                (least..1.2 * least).contains(&bound),
                "{output}: {bound} {least}"
            );
        }
    }
}

#[test]
fn a_disturbance_without_range_leaves_no_bound_and_a_word() {
    for (state, output) in [("-0.1*a + d", "a"), ("-0.1*a", "a + d")] {
        let plant = format!(
            "model M input Real d; Real a(min = -5, max = 5, start = 0);
             output Real y = {output}; equation der(a) = {state}; end M;"
        );
        let study = format!("[sensors]\ndisturbances = [\"d\"]\n{HIGH_GAIN}");
        let report = certified(&plant, &study);
        assert!(
            report["certificate"]["ultimate_bound"].is_null(),
            "{report}"
        );
        assert!(notes(&report).contains("declare min and max"), "{report}");
    }
}

/// v' = 0 is what every family and every inequality assumes of an unknown input.
#[test]
fn an_unknown_input_is_said_to_be_constant() {
    let plant = "model M input Real v(min = -1, max = 1); Real a(min = -5, max = 5, start = 0);
                 output Real y = a; equation der(a) = -a + v; end M;";
    for family in ["", "gain = \"lmi\"\nrate = 1\n"] {
        let theta = if family.is_empty() { "theta = 2\n" } else { "" };
        let study = format!(
            "[sensors]\nunknown = [\"v\"]\n[observer]\nfamily = \"triangular\"\n{theta}{family}"
        );
        let report = certified(plant, &study);
        assert!(
            notes(&report).contains("v is taken as constant"),
            "{report}"
        );
        let slow = certified(plant, &format!("{study}[certify]\nslew = {{ v = 0.1 }}\n"));
        assert!(!notes(&slow).contains("constant"), "{slow}");
        assert!(slow["certificate"]["ultimate_bound"].as_f64().unwrap() > 0.0);
    }
}

/// The slope of the chain is 1 + b², so the second gain is k/(1 + b̂²), which is no number.
#[test]
fn a_gain_that_moves_is_an_expression() {
    let plant =
        "model M Real a(min = -2, max = 2, start = 0); Real b(min = -2, max = 2, start = 1);
                 output Real y = 2*a; equation der(a) = b + b^3/3; der(b) = -b; end M;";
    let fixed = certified(plant, HIGH_GAIN);
    assert!(fixed["injection"].is_null(), "{fixed}");
    assert!(fixed["gain"]["b"]["y"].is_number(), "{fixed}");
    let moving = |b: f64| {
        let study = format!("{HIGH_GAIN}partials = true\ninitial = {{ b = {b} }}\n");
        let report = certified(plant, &study);
        assert!(report["gain"].is_null(), "{report}");
        let entry = |state: &str| report["injection"][state]["y"].clone();
        assert!(entry("b")["expression"].as_str().unwrap().contains('b'));
        let start = |state: &str| entry(state)["at_start"].as_f64().unwrap();
        [start("a"), start("b")]
    };
    let [still, bent] = [moving(0.0), moving(1.0)];
    assert!((still[0] / bent[0] - 1.0).abs() < 1e-12);
    assert!(
        (still[1] / bent[1] - 2.0).abs() < 1e-12,
        "{still:?} {bent:?}"
    );
}

/// Constant slopes leave a constant gain, with the slopes in it: here k/(2·6) at x3.
#[test]
fn constant_partials_are_in_the_gain() {
    let plant =
        "model M Real x1(min = -2, max = 2, start = 0); Real x2(min = -2, max = 2, start = 0);
                 Real x3(min = -2, max = 2, start = 0); output Real y = x1;
                 equation der(x1) = 2*x2; der(x2) = 6*x3; der(x3) = 0; end M;";
    let report = certified(
        plant,
        "[observer]\nfamily = \"triangular\"\ntheta = 3\npartials = true\n",
    );
    let k = |state: &str| report["gain"][state]["y"].as_f64().unwrap();
    // Routh: s³ + k1 s² + 2 k2 s + 12 k3
    assert!(k("x1") * 2.0 * k("x2") > 12.0 * k("x3"), "{report}");
    assert!(k("x1") > 0.0 && k("x3") > 0.0, "{report}");
}

/// Coordinates of the output's derivatives, and Lee's (7) with its M(x̂): no constant K.
#[test]
fn other_corrections_are_no_gain() {
    let pendulum = "model M Real a(min = -1, max = 1, start = 0.1); Real b(min = -2, max = 2, start = 0);
                    output Real y = a; equation der(a) = b + 0.2*b*a; der(b) = -sin(a) - 0.1*b; end M;";
    for observer in [
        "family = \"drift-observable\"\npoles = [-2, -3]\n",
        "family = \"block-triangular\"\ntheta = 4\n",
    ] {
        let report = certified(pendulum, &format!("[observer]\n{observer}"));
        assert!(report["gain"].is_null(), "{report}");
        assert!(
            report["injection"]["b"]["y"]["at_start"].is_number(),
            "{report}"
        );
    }
}

/// The error polynomial is (s + 1)ⁿ, whose computed roots may lie right of the axis.
#[test]
fn a_multiple_pole_is_not_refuted_by_rounding() {
    for n in 6..=8 {
        let (mut states, mut equations) = (String::new(), String::new());
        for i in 1..=n {
            states += &format!("Real x{i}(min = -1, max = 1, start = 0); ");
            let number = |j: usize| 1.7 * ((i * 3 + j * 5) % 11) as f64 - 9.3;
            let below: Vec<String> = (1..=i).map(|j| format!("({})*x{j}", number(j))).collect();
            let next = match i < n {
                true => format!(" + x{}", i + 1),
                false => String::new(),
            };
            equations += &format!("der(x{i}) = {}{next}; ", below.join(" + "));
        }
        let plant = format!("model M {states} output Real y = x1; equation {equations} end M;");
        // whichever the words, the theorem does not speak with this key
        let study = "[observer]\nfamily = \"block-triangular\"\ntheta = 1\ntransient = { theta = 1, until = 1 }\n";
        let report = certified(&plant, study);
        assert_ne!(report["certificate"]["verdict"], "refuted", "{n}: {report}");
    }
}

/// In z = (x1, (1 + x1²)x2) the error is linear and decays from everywhere, though at many
/// points its Jacobian in x is not stable.
#[test]
fn an_observer_that_is_linear_in_other_coordinates_is_not_refuted() {
    for power in [2, 4] {
        let bend = format!("{power}*x1^{}", power - 1);
        let plant = format!(
            "model M Real x1(min = -2, max = 2, start = 1); Real x2(min = -2, max = 2, start = -0.5);
             output Real y = x1; equation der(x1) = (1 + x1^{power})*x2;
             der(x2) = (-x1 - (1 + x1^{power})*x2 - {bend}*x2*(1 + x1^{power})*x2)/(1 + x1^{power}); end M;"
        );
        let report = certified(
            &plant,
            "[observer]\nfamily = \"drift-observable\"\npoles = [-1, -1.5]\n",
        );
        assert_ne!(report["certificate"]["verdict"], "refuted", "{report}");
    }
}
