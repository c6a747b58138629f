//! Rows that come late, twice, or in another order.

use super::*;

const WAIT: &str = "[estimate]\nsd = true\n[serve]\nwait = 5";

/// Each row comes up to so much later than another.
fn shuffled(rows: &[Row], seed: u64, late: f64) -> Vec<Row> {
    let mut random = Normal(seed);
    let mut due: Vec<(f64, Row)> = rows
        .iter()
        .map(|row| (row.t + late * random.uniform(), *row))
        .collect();
    // the first one sets where the estimate begins
    due[0].0 = f64::NEG_INFINITY;
    due.sort_by(|a, b| a.0.total_cmp(&b.0));
    due.into_iter().map(|(_, row)| row).collect()
}

#[test]
fn rows_in_any_order_within_the_wait_give_what_estimate_gives() {
    for (seed, family) in [(1, "ekf"), (2, "ukf"), (3, "mhe"), (4, "triangular")] {
        let folder = folder(family, WAIT);
        let rows = rows(seed, 60, true);
        let late = shuffled(&rows, seed, 4.9);
        assert!(late != rows);
        let ended = served(&folder, "json", &json(&late));
        assert_eq!(ended.code, 0, "{}", ended.err);
        let lines = lines(&ended.out);
        assert!(lines.iter().any(|line| line["revision"] == 2), "{family}");
        assert!(last(&lines) == estimated(&folder, &rows), "{family}");
    }
}

/// What comes twice is answered twice, with the same revision, and changes nothing.
#[test]
fn rows_that_are_repeated_change_nothing() {
    for more in [WAIT, "[estimate]\nsd = true"] {
        let folder = folder("ekf", more);
        let rows = rows(7, 40, true);
        let twice: Vec<Row> = rows.iter().flat_map(|row| [*row, *row]).collect();
        let mut stuttered = twice.clone();
        // a sender that goes back after its connection was lost
        stuttered.splice(60..60, twice[40..60].to_vec());
        let ended = served(&folder, "json", &json(&stuttered));
        let lines = lines(&ended.out);
        assert_eq!(lines.len(), stuttered.len());
        assert!(lines.iter().all(|line| line["revision"] == 0));
        assert!(last(&lines) == estimated(&folder, &rows));
    }
}

/// Sensors whose messages are apart are one row.
#[test]
fn parts_of_a_row_are_joined() {
    let folder = folder("ekf", WAIT);
    let rows = rows(8, 30, false);
    let mut input = String::new();
    for row in &rows {
        input += &Row { a: None, ..*row }.json();
        input += &format!("{{\"t\":{:?},\"a\":{:?}}}\n", row.t, row.a.unwrap());
    }
    let ended = served(&folder, "json", &input);
    let lines = lines(&ended.out);
    assert_eq!(lines.len(), 2 * rows.len());
    assert_eq!(lines[3]["revision"], 1);
    assert!(last(&lines) == estimated(&folder, &rows));
}

#[test]
fn what_comes_too_late_is_refused_and_changes_nothing() {
    let folder = folder("ekf", WAIT);
    let rows = rows(9, 40, true);
    let mut input = json(&rows[..30]);
    let late = Row {
        t: rows[29].t - 6.0,
        ..rows[3]
    };
    input += &late.json();
    input += &json(&rows[30..]);
    let lines = lines(&served(&folder, "json", &input).out);
    assert_eq!(lines.len(), 41);
    assert_eq!(lines[30]["line"], 31);
    let error = lines[30]["error"].as_str().unwrap();
    assert!(
        error.contains("comes too late") && error.contains("`wait`"),
        "{error}"
    );
    let told: Vec<Value> = lines.into_iter().filter(|l| l["error"].is_null()).collect();
    assert!(last(&told) == estimated(&folder, &rows));
}

#[test]
fn silence_hanging_and_jumps_are_told() {
    let folder = folder("ekf", "[estimate]\nsd = true");
    let mut random = Normal(5);
    let mut row = |t: u32, y: Option<f64>, a: Option<f64>| {
        let noise = 0.1 * random.uniform();
        let y = y.map(|y| y + noise);
        Row {
            t: f64::from(t),
            y,
            a,
            u: 0.4,
        }
        .json()
    };
    let mut input: String = (0..60)
        .map(|t| row(t, Some(2.0), Some(1.5 + 1e-3 * f64::from(t % 7))))
        .collect();
    // a is silent, then y hangs, then the clock goes on
    input += &(60..75)
        .map(|t| row(t, Some(2.0), None))
        .collect::<String>();
    input += &(75..95)
        .map(|t| {
            Row {
                t: f64::from(t),
                y: Some(2.03),
                a: Some(1.5),
                u: 0.4,
            }
            .json()
        })
        .collect::<String>();
    input += &row(5000, Some(2.0), Some(1.5));
    let lines = lines(&served(&folder, "json", &input).out);
    let notes = |place: usize| lines[place]["notes"].to_string();
    assert_eq!(lines[59]["notes"], Value::Null);
    assert!(notes(74).contains("a: no reading for 15"), "{}", notes(74));
    assert!(
        notes(94).contains("y is frozen: 20 equal readings"),
        "{}",
        notes(94)
    );
    assert_eq!(lines[94]["credible"], false);
    assert!(notes(95).contains("no row for 4906"), "{}", notes(95));
}

/// A sensor's screens see its readings in the order of their samples, whenever they came: a reading that is none because
/// of one that came late is taken back, and one that is one after all counts.
#[test]
fn screens_look_at_the_samples_in_their_order() {
    for (seed, more) in [
        (21, "repeats = { y = \"missing\" }"),
        (22, "frozen = { y = 2, a = 3 }"),
        (
            23,
            "repeats = { y = \"missing\" }\nplausible = { y = [0, 2.15] }\ndelay = { a = 1 }",
        ),
    ] {
        let folder = folder("ekf", WAIT);
        folder.change("study.toml", "[sensors]", &format!("[sensors]\n{more}"));
        let mut random = Normal(seed);
        let mut rows = rows(seed, 60, true);
        // a value holds now and then, as a historian sends it
        for k in 1..rows.len() {
            if random.uniform() < 0.6 {
                (rows[k].y, rows[k].a) = (rows[k - 1].y, rows[k - 1].a);
            }
        }
        let late = shuffled(&rows, seed, 3.5);
        // parts of a row apart, too
        let mut input = String::new();
        for row in &late {
            match random.uniform() < 0.3 && row.t > rows[0].t {
                true => {
                    input += &Row { a: None, ..*row }.json();
                    input += &Row { y: None, ..*row }.json();
                }
                false => input += &row.json(),
            }
        }
        let ended = served(&folder, "json", &input);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let lines = lines(&ended.out);
        assert!(
            lines.iter().all(|line| line["error"].is_null()),
            "{}",
            ended.out
        );
        assert!(last(&lines) == estimated(&folder, &rows), "{more}");
    }
}
