//! Which parameters of a plant a functional mock-up unit takes while it runs, and typos beside them.

use crate::Folder;
use crate::fmu::variables;
use crate::fmu_equations::export;

/// Two wheels on a shaft and a gear: with a ratio that may be 0 one speed follows from the other, but not
/// the other way round.
const GEAR: &str = "model Gear
  parameter Real J1 = 1, J2 = 2, r = 3;
  Real w1(start = 1, fixed = true, stateSelect = StateSelect.always, min = -5, max = 5);
  Real w2, t;
  output Real y = J1*w1 - (J1 - 1)*w2;
equation
  J1*der(w1) = t - w1;
  J2*der(w2) = -r*t;
  w1 = r*w2;
end Gear;
";

const STUDY: &str = "plant = \"gear.mo\"
[sensors]
measured = [\"y\"]
[observer]
family = \"triangular\"
[simulate]
until = 1
";

fn settable(description: &str) -> Vec<String> {
    let found = variables(description).into_iter();
    let found = found.filter(|(_, told)| told.contains("causality=\"parameter\""));
    found.map(|(name, _)| name).collect()
}

/// The first row of what `simulate` writes.
fn first_row(folder: &Folder, study: &str) -> Vec<(String, f64)> {
    let ran = folder.run(&["simulate", study, "-q", "-o", "run.csv"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let table = folder.read("run.csv");
    let mut lines = table.lines();
    let (head, first) = (lines.next().unwrap(), lines.next().unwrap());
    let values = first.split(',').map(|v| v.parse().unwrap());
    head.split(',').map(str::to_owned).zip(values).collect()
}

#[test]
fn parameters_that_would_choose_other_states_are_numbers() {
    let folder = Folder::empty();
    folder.write("gear.mo", GEAR);
    folder.write("gear.toml", STUDY);
    let more = ["--system", "plant"];
    let (description, notes) = export(&folder, "gear.toml", "gear_plant", &more);
    assert!(
        notes.contains(
            "r is a number, not to be set: as a symbol it meets this: w2 would be a state instead of w1"
        ),
        "{notes}"
    );
    assert_eq!(settable(&description), ["J1", "J2"]);
    let found = variables(&description);
    let row = first_row(&folder, "gear.toml");
    let states: Vec<_> = found
        .iter()
        .filter(|(_, told)| told.contains("initial=\"exact\""))
        .collect();
    assert!(!states.is_empty());
    for (name, told) in states {
        let (_, start) = row.iter().find(|(own, _)| own == name).unwrap();
        assert!(told.contains(&format!("start=\"{start:?}\"")), "{told}");
    }
}

/// A loop that is linear for its number, and has to be searched where that is not known.
#[test]
fn a_parameter_that_cannot_be_a_symbol_leaves_the_others_alone() {
    let folder = Folder::empty();
    folder.write(
        "loop.mo",
        "model Loop
  parameter Real k = 2, a = -1, b = -2, last = 3;
  Real x(start = 1), v, w;
  output Real y = last*v;
equation
  der(x) = -k*v;
  v + (if a > 0 then exp(v) else v) = x;
  w + (if b > 0 then exp(w) else w) = v;
end Loop;
",
    );
    let (description, notes) = export(&folder, "loop.mo", "loop_plant", &[]);
    assert_eq!(settable(&description), ["k", "last"], "{notes}");
    let told =
        "a is a number, not to be set: as a symbol it meets this: the algebraic loop for v cannot";
    assert!(notes.contains(told), "{notes}");
}

/// That its points increase is looked at once; its values are free.
#[test]
fn points_of_tables_are_numbers() {
    let folder = Folder::empty();
    let table = "model Tab
  parameter Real xs[3] = {0, 1, 2};
  parameter Real ys[3] = {0, 3, s};
  parameter Real s = 1, a = 4, free = 5;
  parameter Real us[2] = {a, 2*a};
  Real x(start = 0.5);
  output Real y = Modelica.Math.Vectors.interpolate(xs, ys, x);
  output Real z = free*a*Modelica.Math.Vectors.interpolate(us, {1, 2}, x);
equation
  der(x) = 1 - y;
end Tab;
";
    folder.write("tab.mo", table);
    let (description, notes) = export(&folder, "tab.mo", "tab_plant", &[]);
    assert_eq!(settable(&description), ["s", "free"], "{notes}");
    assert!(
        notes.contains(
            "points of tables are numbers, not to be set, so that they increase: a, xs[1], xs[2], xs[3]"
        ),
        "{notes}"
    );
}

/// As `simulate` refuses them.
#[test]
fn inputs_of_a_study_are_looked_through() {
    let folder = Folder::new();
    for (from, to) in [
        ("pump = ", "pumpp = "),
        ("= \"", "= \"2 + + "),
        ("sin(2", "0/0*sin(2"),
    ] {
        let study = folder.read("study.toml");
        let (head, simulate) = study.split_once("[simulate]").unwrap();
        let (before, inputs) = simulate.split_once("inputs").unwrap();
        assert!(inputs.contains(from), "{inputs}");
        let typo = format!(
            "{head}[simulate]{before}inputs{}",
            inputs.replacen(from, to, 1)
        );
        folder.write("typo.toml", &typo);
        let refused = folder.run(&["simulate", "typo.toml", "-q", "-o", "run.csv"]);
        assert_eq!(refused.code, 2, "{}", refused.err);
        for more in [&[][..], &["--system", "plant"], &["--system", "observer"]] {
            let arguments = ["export", "typo.toml", "--to", "fmu", "-o", "out"];
            let made = folder.run(&[&arguments, more].concat());
            assert_eq!((made.code, &made.err), (2, &refused.err), "{more:?}");
        }
    }
}

/// A Boolean that depends on a parameter follows it.
#[test]
fn parameters_behind_a_boolean_can_be_set() {
    let folder = Folder::empty();
    folder.write(
        "sign.mo",
        "model Sign
  parameter Real a = 2;
  parameter Boolean big = a > 1;
  Real x(start = 1);
  output Real y = if big then x else -x;
equation
  der(x) = -x;
end Sign;
",
    );
    let (description, notes) = export(&folder, "sign.mo", "sign_plant", &[]);
    assert_eq!(settable(&description), ["a"], "{notes}");
    assert!(!notes.contains("number"), "{notes}");
}
