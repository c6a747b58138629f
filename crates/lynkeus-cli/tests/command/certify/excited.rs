//! α(θ) of Ltaief et al., measured along the study's run.

use crate::csv;
use crate::families::copied;

/// Figures of docs/state-affine.md, of an observer programmed apart: for t to 3 λ_min(S)·θ² goes to 59.5, and
/// σ_s·L/θ to 86, so that (12) fails; and they are those of the study's own column at its θ.
#[test]
fn the_example_of_the_paper_violates_its_condition_12() {
    let (folder, file) = copied("ltaief/study.toml");
    folder.change(&file, "until = 10", "until = 3");
    folder.change(&file, "output_step = 0.05", "output_step = 0.01");
    let ended = folder.run(&["certify", &file, "--json"]);
    let certificate = &ended.json()["certificate"];
    assert_eq!(certificate["verdict"], "undecided");
    let found = &certificate["excitation"];
    assert_eq!(
        (found["from"].as_f64(), found["until"].as_f64()),
        (Some(1.5), Some(3.0))
    );
    let rows = found["rows"].as_array().unwrap();
    let expected = [
        (2, 10.0, 0.0088, 707.0),
        (4, 100.0, 0.0039, 106.0),
        (6, 1000.0, 5.95e-5, 86.1),
    ];
    for (place, theta, excitation, condition) in expected {
        let row = &rows[place];
        let near = |name: &str, expected: f64| {
            let found = row[name].as_f64().unwrap();
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{name}: {found} against {expected}"
            );
        };
        near("theta", theta);
        near("excitation", excitation);
        near("condition", condition);
        assert!(row["failure"].is_null());
    }
    let exponent = found["exponent"].as_f64().unwrap();
    assert!((exponent - 1.96).abs() < 0.01, "{exponent}");
    assert_eq!(found["vanishes"], false);
    assert_eq!(found["best"].as_f64().unwrap().round(), 100.0);
    let run = folder.run(&["simulate", &file, "-q", "-o", "o.csv"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let (header, table) = csv(&folder.read("o.csv"));
    let column = header.iter().position(|name| name == "excitation").unwrap();
    let late = table.iter().skip(table.len() / 2);
    let least = late.fold(f64::INFINITY, |least, row| least.min(row[column]));
    let own = rows[2]["excitation"].as_f64().unwrap();
    assert!((own / least - 1.0).abs() < 1e-6, "{own} against {least}");
    let told = folder.run(&["certify", &file]).out;
    for words in [
        "t from 1.5 to 3: measured, no part of any proof",
        "α(θ)/θ² does not vanish as far as measured",
        "holds at none of these θ",
        "smallest at θ = 100 (the study has 10)",
    ] {
        assert!(told.contains(words), "no {words:?} in {told}");
    }
}

/// With the noise of section 5 smaller values are better; other families have no such table.
#[test]
fn noise_counts_and_other_families_have_none() {
    let (folder, file) = copied("ltaief/study-noise.toml");
    let found = folder.run(&["certify", &file, "--json"]).json();
    let best = found["certificate"]["excitation"]["best"].as_f64().unwrap();
    assert!((0.09..1.1).contains(&best), "{best}");
    let (folder, file) = copied("two-tanks/study.toml");
    let found = folder.run(&["certify", &file, "--json"]).json();
    assert!(found["certificate"]["excitation"].is_null());
}
