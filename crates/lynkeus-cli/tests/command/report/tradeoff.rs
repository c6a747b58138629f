//! The trade-off of a page: the figures of `tune`, and for filters what replays of samples give.

use serde_json::Value;

use super::browser::{browsed, sound};
use super::{data, estimated, example, page, scaled_noise, unproved};
use crate::{Folder, csv};

/// The figures that a page draws, by name.
fn figures(data: &Value) -> &serde_json::Map<String, Value> {
    data["tradeoff"]["figures"].as_object().unwrap()
}

fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().unwrap().iter();
    values.map(|x| x.as_f64().unwrap()).collect()
}

/// A position of the slider is a value of `tune`: of θ, of a list of them, in simulation and on a log.
#[test]
fn its_figures_are_those_of_tune() {
    for (name, log) in [
        ("two-tanks", None),
        ("two-tanks", Some("log.csv")),
        ("lee", None),
    ] {
        let folder = example(name, "study.toml");
        let page = page(&folder, &[&["study.toml"], log.as_slice()].concat());
        let data = data(&page);
        let found = &data["tradeoff"];
        let values = numbers(&found["values"]);
        assert_eq!(values.len(), 11);
        let text = folder.read("study.toml");
        folder.write(
            "study.toml",
            &format!("{text}\n[tune]\nkeys = {{ theta = {values:?} }}\n"),
        );
        let on = log.map_or(vec![], |log| vec!["--log", log]);
        let ended = folder.run(&[&["tune", "study.toml", "--json"], &on[..]].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        let expected = ended.json();
        let rows = expected["rows"].as_array().unwrap();
        let drawn = figures(&data);
        assert_eq!(drawn.len(), if log.is_some() { 2 } else { 3 }, "{name}");
        for (figure, column) in drawn {
            let of_tune: Value = rows.iter().map(|row| row[figure].clone()).collect();
            assert_eq!(*column, of_tune, "{name}, {log:?}: {figure}");
        }
        let knee = found["knee"].as_u64().unwrap() as usize;
        assert_eq!(
            rows[knee]["keys"], expected["knee"]["keys"],
            "{name}, {log:?}"
        );
        assert_eq!(found["good"], expected["nearly_as_good"]);
        // the slider stands where the table says
        let positions = data["knob"]["positions"].as_array().unwrap();
        let own = data["knob"]["own"].as_u64().unwrap() as usize;
        assert_eq!(positions[own]["place"], found["own"]);
        let places: Vec<u64> = positions
            .iter()
            .filter_map(|p| p["place"].as_u64())
            .collect();
        assert_eq!(places, (0..11).collect::<Vec<_>>());
        // what tune notes of the ground stands in the page
        let notes = expected["notes"].as_array().unwrap().iter();
        for note in notes.filter(|note| note.as_str().unwrap().contains("states no noise")) {
            assert!(page.contains(note.as_str().unwrap()), "{note}");
        }
        assert_eq!(
            name == "lee",
            page.contains("the study states no noise: 1 % of")
        );
    }
}

/// A figure for which there is nothing is no column.
#[test]
fn on_a_log_it_has_what_a_log_can_tell() {
    let folder = unproved();
    let page = page(&folder, &["study.toml", "log.csv"]);
    let table = page.split("<section id=\"tradeoff\">").nth(1).unwrap();
    let table = table.split("</section>").next().unwrap();
    for head in ["error on held-out samples", "Ljung–Box statistic per lag"] {
        assert!(table.contains(head), "{head}");
    }
    assert!(!table.contains("settling time") && table.contains("A log has no truth"));
    assert_eq!(table.matches("<tr>").count(), 12);
    // too short to hold anything out
    let short: Vec<String> = folder
        .read("log.csv")
        .lines()
        .take(30)
        .map(str::to_owned)
        .collect();
    folder.write("log.csv", &(short.join("\n") + "\n"));
    let page = super::page(&folder, &["study.toml", "log.csv"]);
    assert!(page.contains("It cannot be told: "), "{page}");
    assert!(data(&page)["tradeoff"].is_null());
}

/// The mean error of `estimate` of a study on the folder's log, of all that the page knows the truth of,
/// in shares of these ranges.
fn mean_error(folder: &Folder, study: &str, data: &Value, ranges: &[(&str, f64)]) -> f64 {
    let run = estimated(folder, study);
    let quantities = data["quantities"].as_array().unwrap();
    assert_eq!(quantities.len(), ranges.len());
    let means = quantities.iter().map(|quantity| {
        let name = quantity["name"].as_str().unwrap();
        let range = ranges.iter().find(|(n, _)| *n == name).unwrap().1;
        let header = quantity["header"].as_str().unwrap();
        let hat = run.0.iter().position(|h| h == header).unwrap();
        let rows = run.1.iter().zip(numbers(&quantity["truth"]));
        let errors: Vec<f64> = rows.map(|(x, y)| (x[hat] - y).abs() / range).collect();
        // equal steps: the trapezoidal rule
        let inner: f64 = errors[1..errors.len() - 1].iter().sum();
        (inner + (errors[0] + errors[errors.len() - 1]) / 2.0) / (errors.len() - 1) as f64
    });
    means.sum::<f64>() / ranges.len() as f64
}

/// Widths of the ranges that the two tanks declare.
const TANKS: [(&str, f64); 3] = [("upper", 9.95), ("lower", 9.95), ("pump", 10.0)];

/// The mean error of a filter is that of `estimate` on samples of the simulation.
#[test]
fn a_filter_is_judged_on_samples() {
    let folder = example("two-tanks", "smoothed.toml");
    let text = folder.read("study.toml").replace("smooth = true", "");
    folder.write("study.toml", &text);
    let logged = folder.run(&["simulate", "study.toml", "--log", "log.csv", "-q"]);
    assert_eq!(logged.code, 0, "{}", logged.err);
    let data = data(&page(&folder, &["study.toml"]));
    let factors = numbers(&data["tradeoff"]["values"]);
    let found = numbers(&figures(&data)["mean_error"]);
    for place in [0, 5, 8] {
        let expected = mean_error(&folder, &scaled_noise(&text, factors[place]), &data, &TANKS);
        let off = (found[place] / expected - 1.0).abs();
        assert!(off <= 1e-6, "{place}: {} {expected}", found[place]);
    }
    // without noise in the readings a livelier filter is the better, with it there is a middle
    let exact = numbers(&figures(&data)["mean_error_exact"]);
    let noise = numbers(&figures(&data)["mean_error_noise"]);
    assert!(exact[0] > 2.0 * exact[10] && noise[10] > 2.0 * noise[0]);
    let knee = data["tradeoff"]["knee"].as_u64().unwrap() as usize;
    assert!((1..10).contains(&knee), "{knee}");
}

/// A filter on a log is not shown the samples that are held out.
#[test]
fn a_filter_on_a_log_foretells_what_it_is_not_shown() {
    let folder = example("two-tanks", "smoothed.toml");
    let text = folder.read("study.toml").replace("smooth = true", "");
    folder.write("study.toml", &text);
    let data = data(&page(&folder, &["study.toml", "log.csv"]));
    let found = numbers(&figures(&data)["held_out_error"]);
    assert_eq!(figures(&data).len(), 2);
    // a position multiplies all densities, as a value of `tune` does
    let factors = numbers(&data["tradeoff"]["values"]);
    folder.write(
        "tune.toml",
        &format!("{text}\n[tune]\nkeys = {{ process_noise = {factors:?} }}\n"),
    );
    let tuned = folder.run(&["tune", "tune.toml", "--log", "log.csv", "--json"]);
    assert_eq!(tuned.code, 0, "{}", tuned.err);
    let tuned = tuned.json();
    let rows = tuned["rows"].as_array().unwrap();
    for (row, found) in rows.iter().zip(&found) {
        let expected = row["held_out_error"].as_f64().unwrap();
        assert!((found / expected - 1.0).abs() <= 1e-4, "{found} {expected}");
    }
    let knee = data["tradeoff"]["knee"].as_u64().unwrap() as usize;
    assert_eq!(rows[knee]["keys"], tuned["knee"]["keys"]);
    let whole = folder.read("log.csv");
    let (header, rows) = csv(&whole);
    let level = header.iter().position(|h| h == "level").unwrap();
    let count = rows.len();
    let is_out = |row: usize| {
        let block = (0..20).rfind(|b| b * count / 20 <= row).unwrap();
        let (from, to) = (block * count / 20, (block + 1) * count / 20);
        let out = (0.25 * (to - from) as f64).round() as usize;
        row >= to - out
    };
    let lines = rows.iter().enumerate().map(|(k, row)| {
        let cells = row
            .iter()
            .enumerate()
            .map(|(i, x)| match i == level && is_out(k) {
                true => String::new(),
                false => x.to_string(),
            });
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    folder.write(
        "log.csv",
        &(header.join(",") + "\n" + &lines.collect::<String>()),
    );
    let run = estimated(&folder, &text);
    let hat = run.0.iter().position(|h| h == "lower_hat").unwrap();
    let scored = (count / 20..count).filter(|row| is_out(*row));
    let errors: Vec<f64> = scored.map(|k| run.1[k][hat] - rows[k][level]).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let readings = || rows.iter().map(|row| row[level]);
    let span = readings().fold(f64::MIN, f64::max) - readings().fold(f64::MAX, f64::min);
    assert!(
        (found[5] / (rms / span) - 1.0).abs() <= 1e-9,
        "{} {}",
        found[5],
        rms / span
    );
}

/// What a filter of x' = −a x + u + d, x measured every `H`, ends off by where it knows u but not
/// the constant d: with its steady gain K, e⁺ = (1 − K)(φ e⁺ + (1 − φ) d/a), φ = exp(−a H).
fn steady_error(q: f64) -> f64 {
    const A: f64 = 0.5;
    const H: f64 = 0.2;
    let phi = (-A * H).exp();
    let added = q * (1.0 - phi * phi) / (2.0 * A);
    let gain = |variance: f64| variance / (variance + 0.01);
    let prior = |p: f64| phi * phi * p + added;
    let p = (0..10_000).fold(0.01, |p, _| (1.0 - gain(prior(p))) * prior(p));
    let left = 1.0 - gain(prior(p));
    left * (1.0 - phi) / A * 0.3 / (1.0 - left * phi)
}

/// The bound of a filter counts what acts on its plant unseen, as that of an observer does.
#[test]
fn a_disturbance_counts_in_the_bound_of_a_filter() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model Lag input Real u(min = 0, max = 2); Real x(start = 1, min = -5, max = 5); output Real y = x; equation der(x) = u - 0.5*x; end Lag;",
    );
    let study = "plant = \"m.mo\"\nobserver = { family = \"ekf\", initial = { x = 1 }, initial_variance = { x = 0.01 } }\nsensors = { noise = { y = 0.1 } }\nprocess_noise = { x = 0.02 }\nsimulate = { until = 80, sample_step = 0.2, output_step = 0.2, inputs = { u = \"0.5\" } }\ntune = { disturbance = { u = \"0.3\" } }\n";
    for family in ["ekf", "ukf"] {
        folder.write("study.toml", &study.replace("ekf", family));
        let page = page(&folder, &["study.toml"]);
        let table = page.split("<section id=\"tradeoff\">").nth(1).unwrap();
        let rows = table.split("<tr>").skip(2).take(11);
        let mut seen = 0;
        for row in rows {
            let cells = row.split("</td>").map(|c| c.rsplit('>').next().unwrap());
            let cells: Vec<f64> = cells.filter_map(|c| c.parse().ok()).collect();
            let expected = steady_error(0.02 * cells[0]) / 10.0;
            // the last: with process noise the gain of noise is empty
            let off = (cells[cells.len() - 1] / expected - 1.0).abs();
            // three digits
            assert!(off < 0.006, "{family}: {row} {expected}");
            seen += 1;
        }
        assert_eq!(seen, 11);
    }
    folder.change("study.toml", "disturbance = { u", "disturbance = { v");
    let ended = folder.run(&["report", "study.toml", "-o", "r.html"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("no input named \"v\""), "{}", ended.err);
}

#[test]
fn in_a_browser_the_slider_marks_its_row() {
    for arguments in [&["study.toml"][..], &["study.toml", "log.csv"]] {
        let folder = example("two-tanks", "study.toml");
        page(&folder, arguments);
        let Some(seen) = browsed(&folder) else { return };
        sound(&seen);
        let drawn = numbers(&seen["compromise"]);
        assert_eq!(drawn.len(), 3 - arguments.len());
        assert!(drawn.iter().all(|count| *count > 50.0), "{drawn:?}");
        assert_eq!(seen["row"]["first"], serde_json::json!([5]));
        assert_eq!(seen["row"]["slow"], serde_json::json!([0]));
        assert_ne!(seen["row"]["picture"], seen["row"]["slow_picture"]);
    }
}
