//! `lynkeus tune`.

use crate::{Folder, examples};

/// The column with these lines added, its text as shipped otherwise.
fn column(study: &str, tune: &str) -> Folder {
    let folder = Folder::empty();
    for file in ["column.mo", study] {
        let text = std::fs::read_to_string(examples().join("column").join(file)).unwrap();
        folder.write(if file == study { "study.toml" } else { file }, &text);
    }
    let text = folder.read("study.toml");
    folder.write("study.toml", &format!("{text}\n[tune]\n{tune}\n"));
    folder
}

/// What the paper says of θ: 3.5 is good, 4.2 sensitive to noise, 4.8 peaks.
#[test]
fn the_column_is_judged_as_the_paper_does() {
    for study in ["study.toml", "study-noise.toml"] {
        let folder = column(study, "keys = { theta = [2.1, 2.8, 3.5, 4.2, 4.8] }");
        let ended = folder.run(&[
            "tune",
            "study.toml",
            "--json",
            "-o",
            "t.csv",
            "--plot",
            "t.svg",
        ]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let answer = ended.json();
        assert_eq!(answer["knee"]["keys"]["theta"], 3.5, "{study}");
        let figure = |row: usize, name: &str| answer["rows"][row][name].as_f64().unwrap();
        assert!(answer["rows"][0]["settling_time"].is_null(), "too slow");
        assert!(figure(3, "noise_gain") > 2.0 * figure(2, "noise_gain"));
        assert!(figure(4, "peak_error") > 15.0 && figure(2, "peak_error") < 3.0);
        let peak = &answer["rows"][4]["peak"];
        assert_eq!(peak["name"], "Zf");
        assert!(peak["estimate"].as_f64().unwrap() < -14.0, "{peak}");
        assert!(folder.read("t.svg").contains("knee, and the study: 3.5"));
        assert_eq!(folder.read("t.csv").lines().count(), 6);
    }
}

#[test]
fn the_chosen_value_is_written_and_nothing_else() {
    let folder = Folder::new();
    let text = folder.read("study.toml") + "[tune]  # coarse\nkeys = { theta = [0.03, 0.08] }\n";
    folder.write("study.toml", &text);
    let ended = folder.run(&["tune", "study.toml", "--write"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended.out.contains("study.toml: theta: 0.09 becomes 0.08"),
        "{}",
        ended.out
    );
    let expected = text.replace("theta = 0.09 ", "theta = 0.08 ");
    assert_eq!(folder.read("study.toml"), expected);
}

#[test]
fn a_log_is_judged_by_what_it_holds_out() {
    let folder = Folder::new();
    let text = folder.read("study.toml") + "[tune]\nkeys = { theta = [0.01, 0.08, 0.4] }\n";
    folder.write("study.toml", &text);
    let ended = folder.run(&["tune", "study.toml", "--log", "log.csv", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert_eq!(answer["knee"]["keys"]["theta"], 0.08, "{answer:#}");
    let white = |row: usize| answer["rows"][row]["ljung_box"].as_f64().unwrap();
    assert!(white(0) > 5.0 * white(1));
}

/// The sweep of a study on a log, as JSON.
fn swept(folder: &Folder, study: &str, log: &str) -> serde_json::Value {
    let ended = folder.run(&["tune", study, "--log", log, "--json"]);
    assert_eq!(ended.code, 0, "{log}: {}", ended.err);
    ended.json()
}

/// A log with those cells of a column empty, by data row.
fn emptied(text: &str, header: &str, is_empty: impl Fn(usize) -> bool) -> String {
    let mut lines = text.lines();
    let head = lines.next().unwrap();
    let place = head.split(',').position(|h| h == header).unwrap();
    let row = |(row, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if is_empty(row) {
            cells[place] = "";
        }
        cells.join(",") + "\n"
    };
    format!("{head}\n") + &lines.enumerate().map(row).collect::<String>()
}

/// About three of ten, without a pattern.
fn is_unlucky(row: usize) -> bool {
    (row as u64 + 1).wrapping_mul(6_364_136_223_846_793_005) >> 33 & 0xffff < 0x4ccd
}

/// Two sensors, one of which loses three of ten readings or reports ten times more seldom.
#[test]
fn gaps_and_a_slow_sensor_leave_the_knee_where_it_is() {
    let folder = column("study-noise.toml", "keys = { theta = [2, 3, 3.5, 4.2] }");
    let recorded = folder.run(&["simulate", "study.toml", "--log", "full.csv", "-o", "o.csv"]);
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let full = folder.read("full.csv");
    let rows = full.lines().count() - 1;
    let lost = (0..rows).filter(|row| is_unlucky(*row)).count() as f64 / rows as f64;
    assert!((0.25..0.35).contains(&lost), "{lost}");
    folder.write("missing.csv", &emptied(&full, "bottom", is_unlucky));
    let is_between = |row: usize| !row.is_multiple_of(10);
    folder.write("slow.csv", &emptied(&full, "bottom", is_between));
    let study = folder.read("study.toml");
    for between in ["hold", "predict", "linear"] {
        let estimate = format!("{study}[estimate]\nbetween_samples = \"{between}\"\n");
        folder.write("study.toml", &estimate);
        for log in ["full.csv", "missing.csv", "slow.csv"] {
            let answer = swept(&folder, "study.toml", log);
            let good = answer["nearly_as_good"].as_array().unwrap();
            let ends = [0, 1].map(|i| good[i].as_f64().unwrap());
            assert!(
                (ends[0]..=ends[1]).contains(&3.5),
                "{between} {log}: {answer:#}"
            );
            let innovation = |row: usize| answer["rows"][row]["innovation"].as_f64().unwrap();
            assert!(innovation(0) > 1.2 * innovation(2), "{between} {log}");
        }
    }
}

/// Rows without readings change nothing but how the way is cut into steps.
#[test]
fn a_slow_sensor_is_judged_as_the_log_of_its_readings() {
    let folder = Folder::new();
    folder.change("study.toml", "\"linear\"", "\"predict\"");
    let keys = "[tune]\nkeys = { theta = [0.02, 0.03, 0.04, 0.05] }\n";
    folder.write("study.toml", &(folder.read("study.toml") + keys));
    let log = folder.read("log.csv");
    folder.write(
        "slow.csv",
        &emptied(&log, "level", |row| !row.is_multiple_of(10)),
    );
    let is_reading = |(line, _): &(usize, &str)| *line == 0 || (line - 1).is_multiple_of(10);
    let lines = log.lines().enumerate().filter(is_reading);
    let kept: String = lines.map(|(_, line)| line.to_owned() + "\n").collect();
    folder.write("kept.csv", &kept);
    let slow = swept(&folder, "study.toml", "slow.csv");
    let kept = swept(&folder, "study.toml", "kept.csv");
    for row in 0..4 {
        for figure in ["held_out_error", "innovation", "ljung_box", "outside_band"] {
            let [a, b] = [&slow, &kept].map(|sweep| sweep["rows"][row][figure].as_f64().unwrap());
            assert!((a - b).abs() <= 1e-4 * b, "{figure}: {a} is not {b}");
        }
    }
}

#[test]
fn late_repeated_and_timeless_rows_change_no_figure() {
    let folder = Folder::new();
    let keys = "[tune]\nkeys = { theta = [0.03, 0.08] }\n";
    folder.write("study.toml", &(folder.read("study.toml") + keys));
    let log = folder.read("log.csv");
    let mut lines: Vec<&str> = log.lines().collect();
    for row in (20..900).step_by(37) {
        lines.swap(row, row + 3);
    }
    lines.insert(500, ",5.0,3");
    lines.insert(100, lines[100]);
    folder.write("late.csv", &(lines.join("\n") + "\n"));
    let (whole, late) = (
        swept(&folder, "study.toml", "log.csv"),
        swept(&folder, "study.toml", "late.csv"),
    );
    assert_eq!(whole["rows"], late["rows"]);
    let notes = late["notes"].to_string();
    for told in ["came late", "repeat a time", "have no time"] {
        assert!(notes.contains(told), "{notes}");
    }
    // a study that is strict takes none of it
    let strict = folder
        .read("study.toml")
        .replace("[estimate]", "[estimate]\nstrict = true");
    folder.write("study.toml", &strict);
    let ended = folder.run(&["tune", "study.toml", "--log", "late.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("must hold a finite number"),
        "{}",
        ended.err
    );
}

/// A laboratory's two values, both in the first block, judge nothing, and are told of.
#[test]
fn a_sensor_that_is_not_scored_is_told_of() {
    let folder = column("study-noise.toml", "keys = { theta = [3, 3.5] }");
    let recorded = folder.run(&["simulate", "study.toml", "--log", "full.csv", "-o", "o.csv"]);
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let few = emptied(&folder.read("full.csv"), "bottom", |row| row > 1);
    folder.write("few.csv", &few);
    let answer = swept(&folder, "study.toml", "few.csv");
    let notes = answer["notes"].to_string();
    assert!(
        notes.contains("no reading of bottom is held out after the first block"),
        "{notes}"
    );
    assert!(answer["rows"][0]["held_out_error"].as_f64().unwrap() > 0.0);
    let none_left = emptied(&folder.read("full.csv"), "bottom", |row| row != 59);
    folder.write("none.csv", &none_left);
    let ended = folder.run(&["tune", "study.toml", "--log", "none.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.out);
    assert!(
        ended.err.contains("every reading of bottom is held out"),
        "{}",
        ended.err
    );
}

/// x' = 0.5 − 0.5 x of two sensors, the second twice the first and seldom there.
const LAG: &str = "model Lag input Real u(min = 0, max = 2); Real x(start = 1, min = -5, max = 5); output Real y = x; output Real z = 2*x; equation der(x) = u - 0.5*x; end Lag;";

const LAG_STUDY: &str = "plant = \"m.mo\"
[sensors]
measured = [\"y\", \"z\"]
noise = { y = 0.1, z = 0.3 } # of the data sheet
[observer]
family = \"ekf\"
initial_variance = { x = 0.04 }
[process_noise]
x = 0.02
[simulate]
until = 100
output_step = 0.2
inputs = { u = \"0.5\" }
";

/// The plant with a log of its simulation, in which z has a reading in every third row.
fn lag(tune: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", LAG);
    folder.write("s.toml", &format!("{LAG_STUDY}{tune}"));
    let ended = folder.run(&[
        "simulate", "s.toml", "-q", "-o", "o.csv", "--log", "log.csv",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let log = emptied(&folder.read("log.csv"), "z", |row| !row.is_multiple_of(3));
    folder.write("log.csv", &log);
    folder
}

/// Readings of y and z, row by row; NaN where there is none.
fn readings(folder: &Folder) -> Vec<[f64; 2]> {
    let log = folder.read("log.csv");
    let header: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let place = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let (y, z) = (place("y"), place("z"));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        [y, z].map(|at| cells[at].parse().unwrap_or(f64::NAN))
    };
    log.lines().skip(1).map(row).collect()
}

/// The Kalman filter of the lag, one sensor after the other, which is as likely as both at once: what it
/// expects of each row, and −log of the likelihood of all readings.
fn kalman(rows: &[[f64; 2]], density: f64, noises: [f64; 2]) -> (Vec<[f64; 2]>, f64) {
    const A: f64 = 0.5;
    const H: f64 = 0.2;
    let phi = (-A * H).exp();
    let (mut x, mut p, mut nll) = (1.0, 0.04, 0.0);
    let mut expected = vec![];
    for (k, readings) in rows.iter().enumerate() {
        if k > 0 {
            x = phi * x + (1.0 - phi) / A * 0.5;
            p = phi * phi * p + density * (1.0 - phi * phi) / (2.0 * A);
        }
        expected.push([x, 2.0 * x]);
        for ((slope, y), noise) in [1.0, 2.0].into_iter().zip(readings).zip(noises) {
            if y.is_finite() {
                let s = slope * slope * p + noise * noise;
                let off = y - slope * x;
                nll += 0.5 * ((std::f64::consts::TAU * s).ln() + off * off / s);
                x += p * slope / s * off;
                p *= noise * noise / s;
            }
        }
    }
    (expected, nll)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|x| x * x).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The root mean square over the sensors of that of y − ŷ in such rows, over the span of each.
fn error(rows: &[[f64; 2]], expected: &[[f64; 2]], counts: impl Fn(usize) -> bool) -> f64 {
    let each = [0, 1].map(|sensor| {
        let all = || rows.iter().map(|row| row[sensor]).filter(|y| y.is_finite());
        let span = all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min);
        let pairs = rows.iter().zip(expected).enumerate();
        let off = pairs.filter(|(k, (y, _))| counts(*k) && y[sensor].is_finite());
        rms(off.map(|(_, (y, hat))| (y[sensor] - hat[sensor]) / span))
    });
    rms(each.into_iter())
}

fn near(found: &serde_json::Value, expected: f64) {
    let found = found.as_f64().unwrap();
    let off = (found - expected).abs();
    assert!(off <= 1e-6 * expected.abs(), "{found} is not {expected}");
}

/// Densities and noises on a log: the likelihood, the error on held-out samples and the innovation are those
/// of a Kalman filter that is written out here, and the most likely one is written into the study.
#[test]
fn noises_of_a_filter_are_judged_by_their_likelihood() {
    let folder = lag(
        "[tune]\nkeys = { process_noise.x = [0.0002, 0.002, 0.02, 0.2], \"noise.y\" = { from = 0.05, to = 0.2, points = 3 } }\n",
    );
    let rows = readings(&folder);
    let count = rows.len();
    let answer = swept(&folder, "s.toml", "log.csv");
    // the last quarter of each of 20 blocks
    let block = |row: usize| (0..20).rfind(|b| b * count / 20 <= row).unwrap();
    let is_out = |row: usize| {
        let (from, to) = (block(row) * count / 20, (block(row) + 1) * count / 20);
        row >= to - (0.25 * (to - from) as f64).round() as usize
    };
    let left = rows.iter().enumerate();
    let left: Vec<[f64; 2]> = left
        .map(|(k, row)| if is_out(k) { [f64::NAN; 2] } else { *row })
        .collect();
    let total = rows.iter().flatten().filter(|y| y.is_finite()).count();
    let swept_rows = answer["rows"].as_array().unwrap();
    assert_eq!(swept_rows.len(), 12);
    for row in swept_rows {
        let key = |name: &str| row["keys"][name].as_f64().unwrap();
        let (density, noises) = (key("process_noise.x"), [key("noise.y"), 0.3]);
        let (expected, nll) = kalman(&rows, density, noises);
        near(&row["nll_per_reading"], nll / total as f64);
        assert_eq!(row["readings"], total);
        near(
            &row["innovation"],
            error(&rows, &expected, |k| k >= count / 20),
        );
        let (foretold, _) = kalman(&left, density, noises);
        let scored = |k: usize| k >= count / 20 && is_out(k);
        near(&row["held_out_error"], error(&rows, &foretold, scored));
        assert!(row["ljung_box"].is_number() && row.get("sampling_margin").is_none());
    }
    let nll = |row: &serde_json::Value| row["nll_per_reading"].as_f64().unwrap();
    let least = swept_rows.iter().min_by(|a, b| nll(a).total_cmp(&nll(b)));
    let knee = &answer["knee"];
    assert_eq!(knee, least.unwrap());
    assert_eq!(
        knee["keys"]["process_noise.x"], 0.02,
        "that of the simulation"
    );
    assert_eq!(knee["keys"]["noise.y"], 0.1);
    // what counts of the study's declarations
    let counted = answer["declared"].to_string();
    assert!(counted.contains("process noise"), "{counted}");
    let text = folder.run(&["tune", "s.toml", "--log", "log.csv", "--plot", "t.svg"]);
    assert!(
        text.out.contains(
            "knee: process_noise.x = 0.02, noise.y = 0.1 (\u{2212}log likelihood per reading"
        ),
        "{}",
        text.out
    );
    let picture = folder.read("t.svg");
    assert!(picture.contains("log likelihood per reading"));
    assert!(picture.contains("knee, and the study: 0.02"));

    let before = folder.read("s.toml");
    let other = before
        .replace("x = 0.02", "x = 1e-5")
        .replace("y = 0.1,", "y = 1,");
    folder.write("s.toml", &other);
    let ended = folder.run(&["tune", "s.toml", "--log", "log.csv", "--write", "-q"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.read("s.toml"), before);
}

/// What is as likely within 95 %: the logarithm of the likelihood is at most 1.92 less.
#[test]
fn what_is_nearly_as_likely_is_told() {
    let folder = lag("[tune]\nkeys = { process_noise = { from = 0.25, to = 4, points = 41 } }\n");
    let answer = swept(&folder, "s.toml", "log.csv");
    let rows = answer["rows"].as_array().unwrap();
    let total = answer["knee"]["readings"].as_f64().unwrap();
    let nll = |row: &serde_json::Value| total * row["nll_per_reading"].as_f64().unwrap();
    let least = nll(&answer["knee"]);
    let good = rows.iter().filter(|row| nll(row) <= least + 1.92);
    let good: Vec<f64> = good
        .map(|row| row["keys"]["process_noise"].as_f64().unwrap())
        .collect();
    assert!((3..41).contains(&good.len()), "{good:?}");
    let ends = answer["nearly_as_good"].as_array().unwrap();
    assert_eq!(ends[0], good[0]);
    assert_eq!(ends[1], good[good.len() - 1]);
    let told = folder
        .run(&["tune", "s.toml", "--log", "log.csv", "-q"])
        .out;
    assert!(
        told.contains("; as likely within 95 % from process_noise \u{d7} = "),
        "{told}"
    );
}

/// A gate that keeps readings out has a likelihood of fewer readings, which is no likelihood of the same.
#[test]
fn a_gate_is_judged_by_what_is_held_out() {
    let folder = lag("[tune]\nkeys = { gate = [0.5, 1, 3, 6] }\n");
    let answer = swept(&folder, "s.toml", "log.csv");
    let rows = answer["rows"].as_array().unwrap();
    let figure = |row: &serde_json::Value, name: &str| row[name].as_f64().unwrap();
    assert!(figure(&rows[0], "readings") < figure(&rows[3], "readings"));
    assert!(figure(&rows[0], "nll_per_reading") < figure(&rows[3], "nll_per_reading"));
    let least = rows
        .iter()
        .min_by(|a, b| figure(a, "held_out_error").total_cmp(&figure(b, "held_out_error")));
    assert_eq!(&answer["knee"], least.unwrap());
    let notes = answer["notes"].to_string();
    assert!(notes.contains("likelihoods cannot be compared"), "{notes}");
}

/// Every filter has a likelihood, and settings of its own; a linear plant knows no difference.
#[test]
fn settings_of_every_filter_are_swept() {
    let folder = lag("[tune]\nkeys = { process_noise.x = [0.02] }\n");
    let nll = |folder: &Folder| {
        let answer = swept(folder, "s.toml", "log.csv");
        answer["knee"]["nll_per_reading"].as_f64().unwrap()
    };
    let extended = nll(&folder);
    for (family, keys) in [("ukf", "alpha = [0.5, 1]"), ("mhe", "horizon = [5]")] {
        let text = folder
            .read("s.toml")
            .replace("\"ekf\"", &format!("\"{family}\""));
        let text = text.replace("process_noise.x = [0.02]", keys);
        let other = Folder::empty();
        other.write("m.mo", LAG);
        other.write("s.toml", &text);
        other.write("log.csv", &folder.read("log.csv"));
        let found = nll(&other);
        assert!(
            (found / extended - 1.0).abs() < 1e-6,
            "{family}: {found} {extended}"
        );
    }
}

/// In simulation a filter has the figures of observers, on samples. The noises that are swept are the
/// filter's: the simulation keeps the study's.
#[test]
fn a_filter_is_judged_in_simulation() {
    let folder = lag("[tune]\nkeys = { process_noise.x = [0.0002, 0.02, 2] }\n");
    let sweep = |folder: &Folder| {
        let ended = folder.run(&["tune", "s.toml", "--json"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        ended.json()
    };
    let answer = sweep(&folder);
    assert_eq!(
        answer["knee"]["keys"]["process_noise.x"], 0.02,
        "{answer:#}"
    );
    // as `simulate` has it: every row is a sample
    let run = folder.run(&["simulate", "s.toml", "-q", "-o", "run.csv"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let (header, rows) = crate::csv(&folder.read("run.csv"));
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (x, hat) = (at("x"), at("x_hat"));
    let errors: Vec<f64> = rows
        .iter()
        .map(|row| (row[hat] - row[x]).abs() / 10.0)
        .collect();
    let inner: f64 = errors[1..errors.len() - 1].iter().sum();
    let mean = (inner + (errors[0] + errors[errors.len() - 1]) / 2.0) / (errors.len() - 1) as f64;
    near(&answer["knee"]["mean_error"], mean);
    assert!(answer["knee"].get("sampling_margin").is_none());
    let drawn = folder.run(&["tune", "s.toml", "-q", "--plot", "t.svg"]);
    assert_eq!(drawn.code, 0, "{}", drawn.err);
    let picture = folder.read("t.svg");
    assert!(picture.contains("made by the noise") && !picture.contains("stable step"));
    // whatever stands in the study of the family: where no other has the key it is a filter
    folder.change("s.toml", "family = \"ekf\"", "");
    folder.change("s.toml", "initial_variance = { x = 0.04 }", "");
    let found = folder.run(&["tune", "s.toml", "--json"]);
    assert_eq!(found.code, 0, "{}", found.err);
    assert!(
        found.json()["notes"]
            .to_string()
            .contains("one of the family ekf")
    );
    // without keys it is all of [process_noise]
    folder.write(
        "m.mo",
        &LAG.replace("y = x;", "y = x^2;")
            .replace("z = 2*x;", "z = x^2;"),
    );
    folder.change(
        "s.toml",
        "[tune]\nkeys = { process_noise.x = [0.0002, 0.02, 2] }\n",
        "",
    );
    let found = sweep(&folder);
    assert_eq!(found["keys"][0]["key"], "process_noise");
    assert_eq!(found["rows"].as_array().unwrap().len(), 21);
    folder.change("s.toml", "[process_noise]\nx = 0.02\n", "");
    let ended = folder.run(&["tune", "s.toml"]);
    assert_eq!(ended.code, 2, "{}", ended.out);
    assert!(
        ended
            .err
            .contains("nothing to sweep: the study has no [process_noise]"),
        "{}",
        ended.err
    );
}

#[test]
fn noises_that_cannot_be_swept_are_refused() {
    let keys = |keys: &str| format!("{LAG_STUDY}[tune]\nkeys = {{ {keys} }}\n");
    let folder = lag("");
    for (study, words) in [
        (
            keys("process_noise.x = [0.1, -0.1]"),
            "expected numbers >= 0, found -0.1",
        ),
        (
            keys("noise.y = { from = -1, to = 1, scale = \"linear\" }"),
            "expected numbers >= 0, found -1",
        ),
        (
            keys("process_noise.w = [1]"),
            "no estimated quantity is called \"w\"",
        ),
        (keys("noise.x = [1]"), "no output is called \"x\""),
        (keys("alpha = [1]"), "\"alpha\" belongs to another family"),
        (
            keys("noise = [1], gate = [-3]"),
            "`gate` of [observer]: expected",
        ),
        (
            keys("noise.y = [1]").replace(
                "\"ekf\"\ninitial_variance = { x = 0.04 }",
                "\"triangular\"\ntheta = 2",
            ),
            "\"noise.y\" is swept for filters, which weigh readings by it, and the study's family is \"triangular\"",
        ),
    ] {
        folder.write("s.toml", &study);
        for log in [&["--log", "log.csv"][..], &[]] {
            let ended = folder.run(&[&["tune", "s.toml"], log].concat());
            assert_eq!(ended.code, 2, "{study}: {}", ended.out);
            assert!(ended.err.contains(words), "{}", ended.err);
            assert!(ended.err.contains("s.toml:"), "{}", ended.err);
        }
    }
    // whichever command reads the study
    folder.write("s.toml", &keys("process_noise.w = [1]"));
    let ended = folder.run(&["check", "s.toml"]);
    assert!(
        ended.err.contains("no estimated quantity is called \"w\""),
        "{}",
        ended.err
    );
}

/// The study has no θ: the picture must not say that it has.
#[test]
fn a_value_that_is_proposed_is_not_the_studys() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M input Real u(min = 0, max = 2, start = 1); Real x(start = 1, min = -9, max = 9); Real z(start = 1, min = -9, max = 9); output Real y = x; equation der(x) = z - x; der(z) = u - z; end M;",
    );
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nsimulate = { until = 9, output_step = 0.1 }\n",
    );
    let ended = folder.run(&["tune", "s.toml", "--json", "--plot", "t.svg"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.json()["present"]["theta"].is_null(), "{}", ended.out);
    assert!(!folder.read("t.svg").contains("study"));
    let proposed = ended.json()["notes"][0].as_str().unwrap().to_owned();
    assert!(proposed.starts_with("theta = "), "{proposed}");
    let value = proposed.split_whitespace().nth(2).unwrap();
    folder.change(
        "s.toml",
        "sensors",
        &format!("observer = {{ theta = {value} }}\nsensors"),
    );
    let ended = folder.run(&["tune", "s.toml", "--json", "--plot", "t.svg"]);
    assert_eq!(ended.json()["present"]["theta"].to_string(), value);
    assert!(folder.read("t.svg").contains("study"));
}

#[test]
fn what_diverges_is_a_row_and_all_of_it_the_answer_no() {
    let folder = column("study.toml", "keys = { theta = [3.5, 40] }");
    let ended = folder.run(&["tune", "study.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let answer = ended.json();
    assert!(answer["rows"][1]["failure"].is_string() && answer["rows"][1]["mean_error"].is_null());
    folder.change("study.toml", "[3.5, 40]", "[40]");
    let ended = folder.run(&["tune", "study.toml"]);
    assert_eq!(ended.code, 1);
    assert!(
        ended.err.contains("no value of theta gives an estimate"),
        "{}",
        ended.err
    );
}

#[test]
fn a_disturbance_raises_the_bound_and_wrong_keys_are_refused() {
    let folder = column(
        "study.toml",
        "keys = { theta = [3.5] }\ndisturbance = { Zf = \"0.1*sin(2*time)\" }",
    );
    let ended = folder.run(&["tune", "study.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let bound = ended.json()["knee"]["ultimate_bound"].as_f64().unwrap();
    assert!((0.01..0.5).contains(&bound), "{bound}");
    for (from, to, words) in [
        ("Zf = \"0.1*", "Zg = \"0.1*", "no input named \"Zg\""),
        (
            "theta = [3.5] }",
            "tehta = [3.5] }",
            "no family has a key \"tehta\"",
        ),
        (
            "tehta = [3.5] }",
            "theta = 3 }",
            "a list of values, or a range",
        ),
        ("keys = {", "kyes = {", "unknown key \"kyes\" in [tune]"),
    ] {
        folder.change("study.toml", from, to);
        let ended = folder.run(&["tune", "study.toml"]);
        assert_eq!(ended.code, 2, "{}", ended.err);
        if words.contains("Zg") {
            folder.change("study.toml", "Zg = \"0.1*", "Zf = \"0.1*");
        }
        assert!(ended.err.contains(words), "{}", ended.err);
        assert!(ended.err.contains("study.toml:"), "{}", ended.err);
    }
}

/// θ = 0.05 is too slow for the triangular family and for a run of 40, and not so four times of it: the
/// family that is taken for the study is that of every value.
#[test]
fn a_sweep_is_of_one_family() {
    let model = "model M input Real u(min = -1, max = 1); Real x(start = 0, min = -9, max = 9); Real v(start = 0, min = -9, max = 9);
      output Real y = x; equation der(x) = v; der(v) = u; end M;";
    let study = "plant = \"m.mo\"\nobserver = { theta = 0.05, initial = { x = 1 } }\nsensors = { noise = { y = 0.01 } }\nsimulate = { until = 40, output_step = 0.2, inputs = { u = \"sin(time)\" } }\n";
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("auto.toml", study);
    let ended = folder.run(&["tune", "auto.toml", "-o", "auto.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let taken = folder.run(&["check", "auto.toml", "--json"]).json();
    let taken = taken["recommended"].as_str().unwrap().to_owned();
    assert_ne!(taken, "triangular", "nothing is shown");
    assert!(
        ended
            .err
            .contains(&format!("every value is one of the family {taken}")),
        "{}",
        ended.err
    );
    let named = study.replace("theta =", &format!("family = \"{taken}\", theta ="));
    folder.write("named.toml", &named);
    let ended = folder.run(&["tune", "named.toml", "-o", "named.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.read("auto.csv"), folder.read("named.csv"));
}
