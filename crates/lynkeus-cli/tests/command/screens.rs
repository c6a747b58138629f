//! Cells of a log that are no readings: `plausible`, `repeats` and `frozen` of `[sensors]`.

use crate::Folder;

const PLANT: &str = "model Tank
  input Real u;
  Real level(start = 2, min = 0, max = 10);
  output Real y = level;
equation
  der(level) = u - 0.2*level;
end Tank;
";

/// A log of these readings, one a second.
fn log(readings: &[&str]) -> String {
    let rows = readings.iter().enumerate();
    let rows = rows.map(|(t, y)| format!("{t},{y},0.5\n"));
    format!("t,y,u\n{}", rows.collect::<String>())
}

/// The estimates from a log under such a study, and what is told.
fn estimate(sensors: &str, readings: &[&str]) -> (String, String) {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    folder.write(
        "study.toml",
        &format!(
            "plant = \"plant.mo\"\nprocess_noise = {{ level = 0.01 }}\n[observer]\nfamily = \"ekf\"\n[sensors]\nnoise = {{ y = 0.1 }}\n{sensors}\n"
        ),
    );
    folder.write("log.csv", &log(readings));
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    (folder.read("out.csv"), ended.err)
}

/// Estimates with the key are those of a log without these cells.
#[test]
fn cells_that_are_no_readings_are_as_missing_ones() {
    for (key, given, left, told) in [
        (
            "plausible = { y = [0, 10] }",
            ["2.0", "2.1", "850", "2.2", "-4", "2.3", "2.3", "2.3"],
            ["2.0", "2.1", "", "2.2", "", "2.3", "2.3", "2.3"],
            "y: 2 of 8 cells are outside of [0, 10] and count as no readings",
        ),
        (
            "repeats = { y = \"missing\" }",
            ["2.0", "2.0", "2.0", "2.2", "2.2", "2.1", "2.2", "2.2"],
            ["2.0", "", "", "2.2", "", "2.1", "2.2", ""],
            "y: 4 of 8 cells repeat the one before and count as no readings",
        ),
        (
            "frozen = { y = 3 }",
            ["2.0", "2.1", "2.1", "2.1", "2.1", "2.1", "2.2", "2.1"],
            ["2.0", "2.1", "2.1", "2.1", "", "", "2.2", "2.1"],
            "y: 2 of 8 cells come after 3 equal ones and count as no readings",
        ),
    ] {
        let (with, err) = estimate(key, &given);
        assert!(err.contains(told), "{key}: {err}");
        assert!(!err.contains("declared box"), "{key}: {err}");
        assert_eq!(with, estimate("", &left).0, "{key}");
    }
}

#[test]
fn what_is_said_of_no_output_is_refused() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    for (key, told) in [
        (
            "plausible = { z = [0, 1] }",
            "`plausible` of [sensors]: no output is called \"z\"; choose from: y",
        ),
        ("plausible = { y = [1, 0] }", "[lowest, highest reading]"),
        ("repeats = { y = \"held\" }", "one of \"missing\""),
        ("frozen = { y = 0 }", "a whole number of at least 1"),
    ] {
        folder.write(
            "study.toml",
            &format!("plant = \"plant.mo\"\n[sensors]\n{key}\n"),
        );
        let ended = folder.run(&["check", "study.toml"]);
        assert_eq!(ended.code, 2, "{key}: {}", ended.err);
        assert!(ended.err.contains(told), "{key}: {}", ended.err);
    }
}
