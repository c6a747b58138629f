//! `lynkeus check --how-well`.

use crate::said::said;
use crate::{Folder, examples};

fn column() -> String {
    let study = examples().join("column").join("study.toml");
    study.to_string_lossy().into_owned()
}

#[test]
fn two_inner_trays_tell_more_of_the_column_than_its_ends() {
    let folder = Folder::empty();
    let study = column();
    let asked = [
        "check",
        &study,
        "--how-well",
        "--sensors",
        "all",
        "--horizon",
        "10",
        "--json",
        "--plot",
        "errors.svg",
        "-o",
        "errors.csv",
    ];
    let ended = folder.run(&asked);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["rank"]["of"], 13);
    let advice = &answer["advice"];
    assert_eq!(advice["same_size"].as_array().unwrap().len(), 66);
    let mean = |set: &serde_json::Value| set["mean_share"].as_f64().unwrap();
    assert!(mean(&advice["same_size"][0]) < 0.5 * mean(&advice["present"]));
    assert!(mean(&advice["additions"][0]) < mean(&advice["present"]));
    assert!(folder.read("errors.svg").contains("measuring top, bottom"));
    let table = folder.read("errors.csv");
    assert!(table.starts_with("horizon,x[1],"), "{table}");
    assert!(
        table.contains("inf"),
        "two samples cannot tell thirteen numbers"
    );
}

/// A run of hours: what is known at the horizons that were reached is the answer.
#[test]
fn a_limit_ends_the_run_in_time() {
    let folder = Folder::new();
    folder.change("study.toml", "until = ", "until = 1e7 #");
    let steps = "sample_step = 0.1\noutput_step = 1e4 #";
    folder.change("study.toml", "output_step = ", steps);
    let begun = std::time::Instant::now();
    let ended = folder.run(&["check", "study.toml", "--how-well", "--time-limit", "2"]);
    // twice its time, or more where the machine is busy: not hours
    assert!(
        begun.elapsed().as_secs_f64() < 20.0,
        "{:?}",
        begun.elapsed()
    );
    let told = format!("{}{}", ended.out, ended.err);
    let partial = ended.out.contains("a limit ended the run after");
    assert!(
        partial || ended.err.contains("the limit of 2 s ended it"),
        "{told}"
    );
    assert!(!told.contains("not seen"), "{told}");
}

#[test]
fn what_is_not_seen_is_an_answer_of_no() {
    let study = column();
    let ended = Folder::empty().run(&["check", &study, "--horizon", "0.1"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    assert!(ended.out.contains("not seen"), "{}", ended.out);
}

#[test]
fn a_bare_model_has_no_run_to_judge() {
    let model = examples().join("column").join("column.mo");
    let ended = Folder::empty().run(&["check", &model.to_string_lossy(), "--how-well"]);
    assert_eq!(ended.code, 2);
    assert!(ended.err.contains("[simulate]"), "{}", ended.err);
}

/// The standard errors of a plant at the end of a run.
fn standard_errors(model: &str, noise: &str, run: &str) -> serde_json::Value {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    let sensors =
        format!("plant = \"m.mo\"\n[sensors]\nnoise = {{ y = {noise} }}\n[simulate]\n{run}");
    folder.write("s.toml", &sensors);
    folder
        .run(&["check", "s.toml", "--how-well", "--json"])
        .json()
}

fn near(found: &serde_json::Value, expected: f64) {
    let found = found.as_f64().unwrap_or(f64::NAN);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}

/// Beside what grows by e^40 the rest is not lost (F in a hundred digits gives these numbers); what nothing shows stays unseen.
#[test]
fn what_hardly_moves_is_seen_beside_what_grows() {
    let found = standard_errors(
        "model M Real x0(start = 0.1, min = -5, max = 5); Real x1(start = 0.1, min = -5, max = 5); Real x2(start = 0.3, min = -5, max = 5);
         output Real y = 0.76*x0 + 0.87*x1; equation der(x0) = 5*x0 - 0.74*x1; der(x1) = -0.01*x1; der(x2) = 0.3*x1 - 0.2*x2; end M;",
        "0.01",
        "until = 8\noutput_step = 0.2",
    );
    near(&found["standard_error"]["x1"], 0.001_565_4);
    near(&found["standard_error_of_start"]["x1"], 0.001_695_8);
    assert!(found["standard_error"]["x2"].is_null(), "{found}");
}

/// The same plant in smaller units: errors scale with them.
#[test]
fn small_units_are_seen_as_well() {
    let at = |unit: &str| {
        standard_errors(
            &format!(
                "model M Real x(start = {unit}, min = -5*{unit}, max = 5*{unit}); Real v(start = 0, min = -5*{unit}, max = 5*{unit});
                 output Real y = x; equation der(x) = v; der(v) = -x - 0.1*v; end M;"
            ),
            &format!("{}", 0.05 * unit.parse::<f64>().unwrap()),
            "until = 5\noutput_step = 0.1",
        )
    };
    let (own, small) = (at("1.0"), at("1e-13"));
    for name in ["x", "v"] {
        let expected = 1e-13 * own["standard_error"][name].as_f64().unwrap();
        near(&small["standard_error"][name], expected);
    }
}

/// They may be of any size, and are in no figure.
#[test]
fn disturbances_that_are_not_counted_are_named() {
    let folder = Folder::empty();
    folder.write("m.mo", "model M Real x(start = 1, min = -2, max = 2); input Real d(min = -1, max = 1); output Real y = x + d; equation der(x) = 0; end M;");
    folder.write("s.toml", "plant = \"m.mo\"\n[sensors]\ndisturbances = [\"d\"]\nnoise = { y = 0.01 }\n[simulate]\nuntil = 1\noutput_step = 0.1");
    said(
        &folder,
        "how-well-disturbances",
        &["check", "s.toml", "--how-well"],
    );
}

/// Through the switchings of a thermostat: its own mode is known, its temperature better than a reading, and the heater is
/// told by how soon they come.
#[test]
fn what_is_known_goes_through_events() {
    let folder = Folder::empty();
    folder.write("m.mo", crate::events::THERMOSTAT);
    let study = "plant = \"m.mo\"\nsensors = { noise = { y = 0.3 } }\n[simulate]\nuntil = 5\noutput_step = 0.05\n";
    folder.write("s.toml", study);
    let ended = folder.run(&["check", "s.toml", "--how-well", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let json = ended.json();
    let of = |name: &str| json["standard_error"][name].as_f64().unwrap();
    assert_eq!(of("on"), 0.0, "{json}");
    assert!(of("T") < 0.1 && of("heat") < 0.3, "{json}");
}
