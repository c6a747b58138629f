//! What `check` says of a bare model.

use serde_json::Value;

use crate::Folder;
use crate::said::said;

const MODELS: &str = "model Decay
  parameter Real k;
  parameter Real c;
  Real x;
  output Real y = c*x;
equation
  der(x) = -k*x;
end Decay;

model Silent
  Real x;
equation
  der(x) = -x;
end Silent;";

fn folder() -> Folder {
    let folder = Folder::empty();
    folder.write("models.mo", MODELS);
    folder
}

/// Exit code, standard output and standard error of `check models.mo …`.
fn check(folder: &Folder, arguments: &[&str]) -> (i32, String, String) {
    let ended = folder.run(&[&["check", "models.mo"], arguments].concat());
    (ended.code, ended.out, ended.err)
}

#[test]
fn parameters_and_expressions_in_words() {
    let arguments = [
        "check",
        "models.mo",
        "--model",
        "Decay",
        "--parameters",
        "--about",
        "c*x",
        "--about",
        "c",
    ];
    said(&folder(), "check-parameters", &arguments);
}

#[test]
fn one_object_for_machines() {
    let arguments = [
        "--model",
        "Decay",
        "--parameters",
        "--about",
        "c*x",
        "--json",
    ];
    let (_, text, _) = check(&folder(), &arguments);
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["observability"]["k"], "observable");
    assert_eq!(report["observability"]["c"], "unobservable");
    assert_eq!(report["about"]["c*x"], "observable");
    let symmetry = &report["symmetries"][0];
    assert_eq!(symmetry["moves"], serde_json::json!(["x", "c"]));
    assert_eq!(symmetry["invariants"], serde_json::json!(["c*x"]));
    assert_eq!(symmetry["directions"], 1);
    assert!(
        report["observability_notes"][0]
            .as_str()
            .unwrap()
            .contains("prime field")
    );
}

/// Parameters without values are known numbers, whichever, unless they are asked for.
#[test]
fn a_parameter_without_value_is_known() {
    let arguments = ["check", "models.mo", "--model", "Decay"];
    said(&folder(), "check-known-parameters", &arguments);
}

#[test]
fn several_models_and_a_missing_output_are_told() {
    for (name, more) in [
        ("which-model", &[][..]),
        ("no-output", &["--model", "Silent"]),
        ("no-such-name", &["--model", "Decay", "--about", "q + 1"]),
    ] {
        let arguments = [&["check", "models.mo"], more].concat();
        said(&folder(), &format!("check-{name}"), &arguments);
    }
}

#[test]
fn a_limit_leaves_the_rest_undecided() {
    let arguments = ["--model", "Decay", "--parameters", "--memory-limit", "0"];
    let (code, _, complaint) = check(&folder(), &arguments);
    assert_eq!(code, 3, "{complaint}");
    let expected = "undecided: the limit of 0 MiB ended it";
    assert!(complaint.contains(expected), "{complaint}");
    let (code, _, complaint) = check(&folder(), &["--model", "Decay", "--time-limit", "-1"]);
    assert_eq!(code, 2, "{complaint}");
}

/// A hundred states with two hundred unknown parameters.
#[test]
fn a_large_model_stays_within_a_screen() {
    let folder = Folder::empty();
    folder.write(
        "models.mo",
        "model Chain
  parameter Real a[100]; parameter Real b[100]; Real x[100]; output Real y = x[1];
equation
  for i in 1:99 loop der(x[i]) = a[i]*x[i+1] - b[i]*x[i]; end for;
  der(x[100]) = -a[100]*x[100] - b[100]*x[1];
end Chain;",
    );
    let (_, text, _) = check(&folder, &["--parameters", "--time-limit", "3"]);
    assert!(text.lines().count() < 40 && text.len() < 4000, "{text}");
}

/// Each of the papers' examples has an observer, so that everything in it can be known.
#[test]
fn the_papers_examples_are_observable() {
    for (folder, study) in [
        ("farza", "study.toml"),
        ("germani-manes", "theoretical.toml"),
        ("lee", "study.toml"),
        ("ltaief", "study.toml"),
        ("column", "study.toml"),
    ] {
        let path = super::examples().join(folder);
        let report = super::run(&path, &["check", study, "--json"]).json();
        let verdicts = report["observability"].as_object().unwrap();
        assert!(!verdicts.is_empty());
        for (name, verdict) in verdicts {
            assert_eq!(verdict, "observable", "{folder}: {name}");
        }
    }
}

#[test]
fn a_known_start_is_listed_as_such() {
    let folder = folder();
    folder.change(
        "models.mo",
        "Real x;\n  output",
        "Real x(start = 2, fixed = true);\n  output",
    );
    let arguments = ["check", "models.mo", "--model", "Decay", "--parameters"];
    said(&folder, "check-known-start", &arguments);
}

const CIRCLE: &str = "model Circle
  Real a(min = -2, max = 2);
  Real b(min = -2, max = 2);
  output Real y = a;
equation
  der(a) = b^3/3 + b*(a^2 - 1);
  der(b) = -a;
end Circle;";

/// The map (y, y') is singular where a² + b² = 1.
#[test]
fn the_singular_set_is_enclosed_and_drawn() {
    let folder = Folder::empty();
    folder.write("circle.mo", CIRCLE);
    let ended = folder.run(&["check", "circle.mo", "--json", "--singular", "s.svg"]);
    let json: Value = serde_json::from_str(&ended.out).unwrap();
    assert_eq!(json["uniform"]["verdict"], "refuted");
    assert!(json["uniform"]["share"].as_f64().unwrap() < 0.03);
    let square = |side: &Value| {
        let (low, high) = (side[0].as_f64().unwrap(), side[1].as_f64().unwrap());
        let nearest = if low <= 0.0 && high >= 0.0 {
            0.0
        } else {
            low.abs().min(high.abs())
        };
        (nearest.powi(2), low.abs().max(high.abs()).powi(2))
    };
    for part in json["uniform"]["singular"].as_array().unwrap() {
        let ((a, A), (b, B)) = (square(&part["a"]), square(&part["b"]));
        assert!(a + b < 1.3 && A + B > 0.7, "{part}");
    }
    assert!(folder.read("s.svg").contains("<svg"));
}

#[test]
fn a_picture_of_the_singular_set_needs_two_states() {
    let folder = Folder::empty();
    let three = CIRCLE
        .replace("Real b(", "Real c(start = 1); Real b(")
        .replace("equation", "equation der(c) = b;")
        .replace("= a;\n", "= a; output Real z = c;\n");
    folder.write("three.mo", &three);
    let ended = folder.run(&["check", "three.mo", "--singular", "s.svg"]);
    // the report is told all the same
    assert_eq!(ended.code, 1, "{}", ended.out);
    assert!(ended.out.contains("states observable"), "{}", ended.out);
    assert!(ended.err.contains("needs two"), "{}", ended.err);
}

const MOTOR: &str = "model Motor
  input Real u(min = -24, max = 24); input Real TL(min = -0.2, max = 0.2);
  Real th(min = -100, max = 100); Real w(min = -500, max = 500); Real i(min = -20, max = 20);
  output Real encoder = th; output Real current = i;
equation
  der(th) = w; 1e-4*der(w) = 0.05*i - 1e-5*w - TL; 2e-3*der(i) = u - 1.2*i - 0.05*w;
end Motor;";

/// Of current and load torque a sum alone shows in the angle, unless the torque is constant.
#[test]
fn the_box_and_the_verdicts_do_not_contradict_each_other() {
    let folder = Folder::empty();
    folder.write("motor.mo", MOTOR);
    let examined = |measured: &str| {
        let study = format!(
            "plant = \"motor.mo\"\n[sensors]\nmeasured = [{measured}]\nunknown = [\"TL\"]\n[observer]\nfamily = \"auto\"\n"
        );
        folder.write("study.toml", &study);
        let text = folder.run(&["check", "study.toml"]).out;
        let json = folder.run(&["check", "study.toml", "--json"]).json();
        (text, json["uniform"].clone())
    };
    let (text, uniform) = examined("\"encoder\"");
    assert!(text.contains("states not observable: i\n"), "{text}");
    assert!(
        !text.contains("everywhere on the box") && uniform.is_null(),
        "{text}"
    );
    assert!(!text.contains("can be estimated: th, w, i"), "{text}");
    let (text, uniform) = examined("\"encoder\", \"current\"");
    assert!(
        text.contains("for every constant input (while TL stays constant too) and everywhere on the box: proved"),
        "{text}"
    );
    assert_eq!(uniform["verdict"], "proved");
}

/// Without ranges no point is worth printing: they are asked for.
#[test]
fn missing_ranges_are_asked_for() {
    let folder = Folder::empty();
    folder.write(
        "open.mo",
        "model Open Real a; Real b; output Real y = a; equation der(a) = b^3 - b; der(b) = -b; end Open;",
    );
    said(&folder, "check-no-ranges", &["check", "open.mo"]);
    let machine = folder.run(&["check", "open.mo", "--json"]).out;
    assert!(
        !machine.contains("e307") && !machine.contains("e308"),
        "{machine}"
    );
}

/// What `check` says of a loop, a + a³/2 = z, with that equation of x.
fn with_a_loop(x: &str) -> Folder {
    let folder = Folder::empty();
    let text = format!(
        "model M
  Real x(start = 1, min = -4, max = 4); Real z(start = 0.5, min = -4, max = 4); Real a(start = 0, min = -10, max = 10);
  output Real y = x;
equation
  a + 0.5*a^3 = z; der(x) = {x}; der(z) = -z;
end M;"
    );
    folder.write("models.mo", &text);
    folder
}

/// No series is made of a loop; that the map (y, y') is regular on the box is proved all the same.
#[test]
fn what_is_proved_on_the_box_is_not_undecided() {
    said(&with_a_loop("a - x"), "check-loop", &["check", "models.mo"]);
}

/// At z = 0 nothing of z shows, so that the box proves nothing of it; x is measured.
#[test]
fn what_is_not_decided_is_not_called_hidden() {
    let folder = with_a_loop("a^2 - x");
    said(&folder, "check-loop-undecided", &["check", "models.mo"]);
    let (_, text, _) = check(&folder, &["--json"]);
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        report["visible"],
        serde_json::json!({ "x": true, "z": false })
    );
}
