//! How far what `check` calls known is known: for points far apart, within the sensors' limits, up to disturbances, in
//! which branch.

use super::Folder;
use serde_json::Value;

/// The report on a model with these sensors.
fn check(model: &str, sensors: &str) -> (Value, String) {
    let folder = Folder::empty();
    folder.write("m.mo", &format!("model M {model} end M;"));
    folder.write("s.toml", &format!("plant = \"m.mo\"\n[sensors]\n{sensors}"));
    let machines = folder.run(&["check", "s.toml", "--json"]);
    let people = folder.run(&["check", "s.toml"]);
    let report = serde_json::from_str(&machines.out);
    (
        report.unwrap_or_else(|_| panic!("{}", machines.err)),
        people.out,
    )
}

fn known<'r>(report: &'r Value, name: &str) -> &'r Value {
    &report["knowledge"][0]["quantities"][name]
}

fn fit(report: &Value, family: &str) -> String {
    let families = report["families"].as_array().unwrap();
    let found = families.iter().find(|f| f["family"] == family).unwrap();
    found["fit"].as_str().unwrap().to_owned()
}

/// y = e^a cos b, b' = −1: b and b + 2π look alike for ever.
#[test]
fn a_full_turn_is_known_locally() {
    let turn = |high: f64| {
        check(
            &format!(
                "Real a(start = 0.1, min = -1, max = 1); Real b(start = 0.5, min = {}, max = {high});
                 output Real y = exp(a)*cos(b); equation der(a) = 0; der(b) = -1;",
                -high
            ),
            "",
        )
    };
    let (report, text) = turn(4.0);
    for name in ["a", "b"] {
        assert_eq!(
            known(&report, name)["known"],
            "locally everywhere",
            "{report}"
        );
    }
    assert_eq!(fit(&report, "drift-observable"), "does not fit");
    assert_eq!(
        report["uniform"]["one_to_one"]["alike"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    assert!(
        text.contains("give the same outputs and first 1 derivatives"),
        "{text}"
    );
    let (report, _) = turn(3.0);
    for name in ["a", "b"] {
        assert_eq!(known(&report, name)["known"], "everywhere", "{report}");
    }
    assert_eq!(fit(&report, "drift-observable"), "fits");
}

/// Each sensor alone wraps the angle, both together do not.
#[test]
fn two_sensors_tell_an_angle() {
    let angle = |sensors: &str| {
        check(
            "Real a(start = 0.3, min = -3, max = 3); output Real c = cos(a); output Real s = sin(a); equation der(a) = 0.1*sin(a);",
            sensors,
        )
        .0
    };
    assert_eq!(known(&angle(""), "a")["known"], "everywhere");
    assert_ne!(
        known(&angle("measured = [\"c\"]"), "a")["known"],
        "everywhere"
    );
}

/// Beyond its limit the sensor of x shows 1; z tells x where it has no limits, and its range keeps w within them.
#[test]
fn limits_hide_what_lies_beyond() {
    let model = "Real x(start = 0.5, min = 0, max = 2); Real w(start = 0.5, min = 0, max = 1); output Real y = x; output Real v = w; output Real z = 2*x;
      equation der(x) = -x; der(w) = -w;";
    let (report, text) = check(
        model,
        "measured = [\"y\", \"v\"]\nlimits = { y = [0, 1], v = [0, 1] }",
    );
    assert_eq!(known(&report, "x")["known"], "within limits");
    assert_eq!(known(&report, "x")["sensors"], serde_json::json!(["y"]));
    assert_eq!(known(&report, "x")["otherwise"]["known"], "everywhere");
    assert_eq!(known(&report, "w")["known"], "everywhere");
    assert!(text.contains("where y is within its limits"), "{text}");
    let (report, _) = check(model, "limits = { y = [0, 1] }");
    assert_eq!(known(&report, "x")["known"], "everywhere");
}

/// |d| ≤ 1 in y = 2a + d: a is known to ½, and b, which a' shows, not at all. c is measured itself.
#[test]
fn a_disturbance_in_an_output_is_an_error_there() {
    let model = "Real a(start = 0, min = -2, max = 2); Real b(start = 0, min = -2, max = 2); Real c(start = 0, min = -2, max = 2);
      input Real d(min = -1, max = 0.5); output Real y = 2*a + d; output Real z = c;
      equation der(a) = b; der(b) = -a; der(c) = -c + d;";
    let (report, text) = check(model, "disturbances = [\"d\"]");
    // z' tells d, and so y tells a
    assert_eq!(known(&report, "a")["known"], "everywhere", "{report}");
    let (report, text_without) = check(
        &model.replace("der(c) = -c + d", "der(c) = -c"),
        "disturbances = [\"d\"]",
    );
    assert_eq!(
        known(&report, "a")["known"],
        "up to disturbances",
        "{report}\n{text}"
    );
    assert_eq!(known(&report, "a")["bound"], 0.5);
    assert_eq!(known(&report, "b")["known"], "up to disturbances");
    assert_eq!(known(&report, "b")["bound"], Value::Null);
    assert_eq!(known(&report, "c")["known"], "everywhere");
    assert!(
        text_without.contains("up to the disturbance d, within 0.5"),
        "{text_without}"
    );
}

/// In the dynamics it hides what it enters with: b of a' = b + d, to what d can be.
#[test]
fn a_disturbance_in_an_equation_is_an_error_behind_it() {
    let (report, _) = check(
        "Real a(start = 0, min = -2, max = 2); Real b(start = 0, min = -2, max = 2); input Real d(min = -1, max = 1);
         output Real y = a; equation der(a) = 4*b + d; der(b) = -b;",
        "disturbances = [\"d\"]",
    );
    assert_eq!(known(&report, "a")["known"], "everywhere");
    assert_eq!(known(&report, "b")["known"], "up to disturbances");
    assert_eq!(known(&report, "b")["bound"], 0.25);
}

/// y = max(a, 0) is flat on nine tenths of the box; so is the same written as `if`, and the start may lie on either side.
#[test]
fn a_branch_that_is_flat_is_told() {
    for start in ["0.5", "-3"] {
        for output in ["max(a, 0)", "if a > 0 then a else 0"] {
            let model = format!(
                "Real a(start = {start}, min = -9, max = 1); output Real y = {output}; equation der(a) = -0.1*a;"
            );
            let (report, text) = check(&model, "");
            let found = known(&report, "a");
            assert_eq!(
                found["known"], "in part of the box",
                "{start} {output} {report}"
            );
            let share = found["hidden_share"].as_f64().unwrap();
            assert!((share - 0.9).abs() < 0.06, "{share}");
            assert!(text.contains("the branch at a = -"), "{text}");
        }
    }
}

/// Each step of the reading tells x, no branch does; what no output feels is hidden in all of them.
#[test]
fn what_a_step_may_show_is_not_called_unobservable() {
    let (report, text) = check(
        "Real x(start = 0.52, min = 0, max = 10); Real b(start = 0, min = -1, max = 1); output Real y = floor(10*x)/10;
         equation der(x) = 0.01; der(b) = abs(b) + max(x, 5);",
        "",
    );
    assert_eq!(report["observability"]["x"], "undecided", "{text}");
    assert_eq!(report["observability"]["b"], "unobservable");
    assert!(!text.contains("x can have any value"), "{text}");
}

/// Each branch tells one sum of a and b, and a run through both tells a and b: hidden in each branch is not hidden.
#[test]
fn what_two_branches_tell_together_is_not_called_unobservable() {
    let (report, text) = check(
        "Real x(start = 1, min = -2, max = 2); Real a(start = 1, min = 0, max = 2); Real b(start = 1, min = 0, max = 2); output Real y = x;
         equation der(x) = -x + (if sin(time) < 0 then a + b else a - b); der(a) = 0; der(b) = 0;",
        "",
    );
    for name in ["a", "b"] {
        assert_eq!(report["observability"][name], "undecided", "{text}");
        assert_eq!(known(&report, name)["known"], "undecided");
    }
    assert_eq!(report["symmetries"], serde_json::json!([]));
    assert!(
        text.contains("what several branches tell together"),
        "{text}"
    );
}

/// b' = −b + a: the error of b decays once a is known, and while a < 0 it is not: proved it is without a alone.
#[test]
fn decay_that_rests_on_a_branch_is_not_proved() {
    let detectability = |b: &str| {
        let model = format!(
            "Real a(start = 1, min = -2, max = 2); Real b(start = 0, min = -4, max = 4); output Real y = max(a, 0);
             equation der(a) = 0; der(b) = {b};"
        );
        let (report, _) = check(&model, "");
        assert_eq!(known(&report, "a")["known"], "in part of the box");
        known(&report, "b")["proved"].clone()
    };
    assert_eq!(detectability("-b + a"), false);
    assert_eq!(detectability("-b"), true);
}

/// z acts from the tenth second on: it is known then, and the point where it is hidden has its time.
#[test]
fn what_a_later_branch_shows_is_known_in_part() {
    let (report, text) = check(
        "Real x(start = 1, min = -2, max = 2); Real z(start = 1, min = 0, max = 2); output Real y = x;
         equation der(x) = -x + (if time > 10 then z else 0); der(z) = 0;",
        "",
    );
    assert_eq!(report["observability"]["z"], "observable", "{text}");
    let z = known(&report, "z");
    assert_eq!(z["known"], "in part of the box", "{text}");
    assert!(z["hidden_at"]["time"].as_f64().unwrap() < 10.0, "{z}");
    assert!(text.contains("known at some times"), "{text}");
}

/// Beyond the limits of one sensor the other is all there is, and a disturbance acts on that.
#[test]
fn limits_and_disturbances_count_together() {
    let outputs = |z: &str, b: &str| {
        let model = format!(
            "input Real d(min = -1, max = 1); Real a(start = 1, min = 0, max = 10); Real b(start = 0, min = -1, max = 1);
             output Real y = a; output Real z = {z}; equation der(a) = {b}; der(b) = -b;"
        );
        check(&model, "disturbances = [\"d\"]\nlimits = { y = [0, 5] }")
    };
    let (report, text) = outputs("a + d", "b");
    for name in ["a", "b"] {
        assert_eq!(known(&report, name)["known"], "within limits", "{text}");
    }
    // what both sensors tell together is told by neither alone
    let (report, text) = outputs("b + d", "b");
    assert_eq!(known(&report, "b")["known"], "within limits", "{text}");
    let (report, text) = outputs("b", "b");
    assert_eq!(known(&report, "b")["known"], "everywhere", "{text}");
    // the bound for the disturbance holds within the limits only
    let (report, text) = check(
        "input Real d(min = -1, max = 1); Real a(start = 1, min = 0, max = 10);
         output Real y = a + d; equation der(a) = 0;",
        "disturbances = [\"d\"]\nlimits = { y = [0, 5] }",
    );
    let a = known(&report, "a");
    assert_eq!(
        (&a["known"], &a["otherwise"]["known"]),
        (&"within limits".into(), &"up to disturbances".into()),
        "{text}"
    );
}

/// b' = −b + a: the error of b decays once a is known, which it is within the limits only.
#[test]
fn decay_that_rests_on_a_limited_sensor_is_not_told() {
    let detectability = |b: &str| {
        let model = format!(
            "Real a(start = 1, min = 0, max = 2); Real b(start = 0, min = -2, max = 2); output Real y = a;
             equation der(a) = 0; der(b) = {b};"
        );
        let (report, _) = check(&model, "limits = { y = [0, 1] }");
        known(&report, "b")["known"].clone()
    };
    assert_eq!(detectability("-b + a"), "no");
    assert_eq!(detectability("-b"), "decays");
}
