//! A study that changes while the plant runs: what has a meaning goes on, and the state before is there to go back to.

use super::process::Serving;
use super::*;

const KEPT: &str = "[estimate]\nsd = true\n[serve]\nstate = \"tank.state\"\n";

/// The files that were left beside the state.
fn aside(folder: &Folder) -> Vec<String> {
    let names = folder.files().into_iter();
    names
        .filter(|name| name.starts_with("tank.state.20"))
        .collect()
}

/// The Kalman filter of the tank, by hand: x̂ and P in variances, from row to row.
struct Filter {
    x: [f64; 2],
    p: [f64; 3],
    /// of the last row
    t: f64,
    u: f64,
}

impl Filter {
    fn new(first: &Row) -> Self {
        Self {
            x: [2.0, 0.0],
            p: [1.0, 0.0, 1.0],
            t: first.t,
            u: first.u,
        }
    }

    /// To the next row, with densities q of the process noise and variances r of the sensors.
    fn take(&mut self, row: &Row, q: [f64; 2], r: [f64; 2]) {
        let f = |x: &[f64; 5], u: f64| {
            let [level, flow, p11, p12, p22] = *x;
            [
                u - 0.2 * level + 0.1 * flow,
                0.3 * level - 0.4 * flow,
                2.0 * (-0.2 * p11 + 0.1 * p12) + q[0],
                0.3 * p11 - 0.6 * p12 + 0.1 * p22,
                2.0 * (0.3 * p12 - 0.4 * p22) + q[1],
            ]
        };
        let steps = 200.0 * (row.t - self.t);
        let h = (row.t - self.t) / steps.max(1.0);
        let mut x = [self.x[0], self.x[1], self.p[0], self.p[1], self.p[2]];
        for _ in 0..steps as usize {
            let go = |k: &[f64; 5], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
            let k1 = f(&x, self.u);
            let k2 = f(&go(&k1, h / 2.0), self.u);
            let k3 = f(&go(&k2, h / 2.0), self.u);
            let k4 = f(&go(&k3, h), self.u);
            x = std::array::from_fn(|i| {
                x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            });
        }
        let [level, flow, mut p11, mut p12, mut p22] = x;
        self.x = [level, flow];
        if let Some(y) = row.y {
            let s = p11 + r[0];
            let off = y - self.x[0];
            self.x[0] += p11 / s * off;
            self.x[1] += p12 / s * off;
            (p22, p12, p11) = (p22 - p12 * p12 / s, p12 * r[0] / s, p11 * r[0] / s);
        }
        if let Some(a) = row.a {
            let s = p22 + r[1];
            let off = a - self.x[1];
            self.x[0] += p12 / s * off;
            self.x[1] += p22 / s * off;
            (p11, p12, p22) = (p11 - p12 * p12 / s, p12 * r[1] / s, p22 * r[1] / s);
        }
        self.p = [p11, p12, p22];
        (self.t, self.u) = (row.t, row.u);
    }

    /// What a line says where it says this.
    fn agrees(&self, line: &Value) {
        let expected = [
            ("level_hat", self.x[0]),
            ("level_sd", self.p[0].sqrt()),
            ("q_hat", self.x[1]),
            ("q_sd", self.p[2].sqrt()),
        ];
        for (name, expected) in expected {
            let found = line[name].as_f64().unwrap();
            assert!((found - expected).abs() < 1e-5, "{name}: {expected} {line}");
        }
    }
}

/// Other noises: the filter of the new study goes on from the estimate and the covariance of the old one, after a stop and
/// after a kill, where the rows since the last snapshot are the new study's.
#[test]
fn another_tuning_goes_on_from_the_estimate_and_its_covariance() {
    for (is_killed, more) in [(false, ""), (false, "wait = 5\n"), (true, "wait = 5\n")] {
        let folder = folder("ekf", &format!("{KEPT}{more}"));
        let rows = rows(61, 60, true);
        let mut serving = Serving::new(&folder, "json", "");
        serving.send(&json(&rows[..40]));
        let answers = (0..40).map(|_| serving.answer().unwrap());
        let before = lines(&answers.collect::<Vec<_>>().join("\n"));
        match is_killed {
            true => serving.kill(),
            false => drop(serving.stop()),
        }
        let old = std::fs::read(folder.path.path().join("tank.state")).unwrap();
        let study = folder.read("study.toml");
        folder.change("study.toml", "y = 0.1", "y = 0.4");
        folder.change("study.toml", "level = 0.01", "level = 0.04");
        let ended = served(&folder, "json", &json(&rows[40..]));
        assert_eq!(ended.code, 0, "{}", ended.err);
        let names = aside(&folder);
        assert_eq!(names.len(), 1, "{names:?}");
        for words in [
            "went on after row 40",
            "the study has changed: the estimates (level, q) and what is known of their errors are taken over",
            &names[0],
        ] {
            assert!(ended.err.contains(words), "{}", ended.err);
        }
        assert!(old == std::fs::read(folder.path.path().join(&names[0])).unwrap());
        let after = lines(&ended.out);
        assert_eq!(after.len(), 20);
        let mut filter = Filter::new(&rows[0]);
        // the state of a kill is that of the start; what waits is gone over again, from the row at its end on
        let is_old = |row: &Row| row.t <= rows[39].t - 5.0;
        let changed = match (is_killed, more) {
            (true, _) => 0,
            (false, "") => 40,
            (false, _) => rows[..40].iter().rposition(is_old).unwrap(),
        };
        for (k, (row, line)) in rows.iter().zip(before.iter().chain(&after)).enumerate() {
            let (q, r) = match k >= changed {
                true => ([0.04, 0.01], [0.16, 0.01]),
                false => ([0.01, 0.01], [0.01, 0.01]),
            };
            filter.take(row, q, r);
            if k < changed || k >= 40 {
                filter.agrees(line);
            }
        }
        // it knows no more of the change
        let ended = served(&folder, "json", "");
        assert!(!ended.err.contains("has changed"), "{}", ended.err);
        // back with the old study and the old state: as if nothing had been
        let path = folder.path.path();
        std::fs::rename(path.join(&names[0]), path.join("tank.state")).unwrap();
        folder.write("study.toml", &study);
        let ended = served(&folder, "json", &json(&rows[40..]));
        assert!(!ended.err.contains("has changed"), "{}", ended.err);
        let all = [before, lines(&ended.out)].concat();
        assert!(last(&all) == estimated(&folder, &rows));
    }
}

/// After a change, too, what comes late finds its place, and what comes twice changes nothing.
#[test]
fn late_rows_find_their_place_after_a_change() {
    let folder = folder("ekf", &format!("{KEPT}wait = 5\n"));
    let rows = rows(62, 40, false);
    let first = [&rows[..28], &rows[29..30]].concat();
    served(&folder, "json", &json(&first));
    folder.change("study.toml", "q = 0.01", "q = 0.02");
    let twice = [&rows[27..], &rows[27..]].concat();
    let ended = served(&folder, "json", &json(&twice));
    let answers = lines(&ended.out);
    assert!(
        answers.iter().all(|line| line["error"].is_null()),
        "{}",
        ended.out
    );
    let revised = answers.iter().filter(|line| line["revision"] == 1);
    let revised: Vec<f64> = revised.map(|line| line["t"].as_f64().unwrap()).collect();
    // that of the row after the late one, and once more where it came again
    assert!(
        revised.iter().all(|t| *t == rows[29].t) && !revised.is_empty(),
        "{revised:?}"
    );
    assert_eq!(
        last_row(&answers),
        last_row(&lines(&served(&folder, "json", &rows[39].json()).out))
    );
}

fn last_row(lines: &[Value]) -> Told {
    told(lines.last().unwrap())
}

/// The order of sensors, one more of them, names of columns, the tuning of an observer: states are known by name.
#[test]
fn what_else_may_change() {
    let rows = rows(63, 30, false);
    for (family, changes) in [
        (
            "ekf",
            vec![
                (
                    "output Real y = level;",
                    "output Real b = level + q;\n  output Real y = level;",
                ),
                ("noise = { y = 0.1", "noise = { b = 0.2, y = 0.1"),
            ],
        ),
        ("ekf", vec![("0.2*level", "0.25*level")]),
        ("ekf", vec![("\"ekf\"", "\"ukf\"")]),
        ("ukf", vec![("\"ukf\"", "\"mhe\"")]),
        ("triangular", vec![("theta = 3", "theta = 4")]),
        ("triangular", vec![("sd = true", "sd = false")]),
    ] {
        let folder = folder(family, KEPT);
        let before = lines(&served(&folder, "json", &json(&rows[..20])).out);
        for (from, to) in &changes {
            let name = if from.contains("Real") || from.contains("*level") {
                "tank.mo"
            } else {
                "study.toml"
            };
            folder.change(name, from, to);
        }
        let ended = served(&folder, "json", &json(&rows[20..]));
        assert_eq!(ended.code, 0, "{}", ended.err);
        assert!(
            ended.err.contains("are taken over"),
            "{changes:?} {}",
            ended.err
        );
        let after = lines(&ended.out);
        let level = |line: &Value| line["level_hat"].as_f64().unwrap();
        // an estimate from the start would be at 2
        assert!(
            (level(&after[0]) - level(&before[19])).abs() < 0.3,
            "{changes:?} {} {}",
            after[0],
            before[19]
        );
    }
}

#[test]
fn what_cannot_be_taken_over_is_refused_with_what_to_do() {
    let rows = rows(64, 20, false);
    for (from, to, words) in [
        (
            "Real q(start = 0, min = -10",
            "Real p(start = 1, min = -10",
            "this study estimates p, and there are level in m, q",
        ),
        (
            "unit = \"m\"",
            "unit = \"cm\"",
            "this study estimates level in cm, and there are level in m, q",
        ),
    ] {
        let folder = folder("ekf", KEPT);
        served(&folder, "json", &json(&rows));
        folder.change("tank.mo", from, to);
        if to.contains("Real p") {
            folder.change("tank.mo", "= q;", "= p;");
            folder.change("tank.mo", "0.1*q", "0.1*p");
            folder.change(
                "tank.mo",
                "der(q) = 0.3*level - 0.4*q",
                "der(p) = 0.3*level - 0.4*p",
            );
            folder.change("study.toml", "q = 0.01", "p = 0.01");
        }
        if to.contains("cm") {
            // the same equations with another label would be the same plant
            folder.change("tank.mo", "0.2*level", "0.25*level");
        }
        let before = std::fs::read(folder.path.path().join("tank.state")).unwrap();
        let ended = served(&folder, "json", "");
        assert_eq!(ended.code, 2, "{}", ended.err);
        for words in [
            words,
            "cannot be taken over",
            "move the file away to begin from the start",
        ] {
            assert!(ended.err.contains(words), "{}", ended.err);
        }
        assert!(before == std::fs::read(folder.path.path().join("tank.state")).unwrap());
        assert!(aside(&folder).is_empty());
    }
}

/// Every line of the files of a history, but for their headers; by file.
fn history(folder: &Folder) -> Vec<(String, Vec<String>)> {
    let names = folder.files().into_iter();
    let mut names: Vec<String> = names.filter(|name| name.starts_with("tank-2")).collect();
    names.sort();
    let lines = |name: String| {
        let text = folder.read(&name);
        (name, text.lines().skip(1).map(str::to_owned).collect())
    };
    names.into_iter().map(lines).collect()
}

/// What was told stays in the history: through a change, and through the way back to the state before.
#[test]
fn the_history_keeps_what_was_told() {
    let more = format!("{KEPT}history = \"tank-%Y-%m-%d.csv\"\n");
    let told = |folder: &Folder| -> Vec<String> {
        let files = history(folder).into_iter();
        files.flat_map(|(_, lines)| lines).collect()
    };
    let folder = folder("ekf", &more);
    let rows = rows(65, 40, false);
    served(&folder, "json", &json(&rows[..20]));
    let study = folder.read("study.toml");
    folder.change("study.toml", "y = 0.1", "y = 0.3");
    served(&folder, "json", &json(&rows[20..30]));
    let before = told(&folder);
    assert_eq!(before.len(), 30);
    let path = folder.path.path();
    std::fs::rename(path.join(&aside(&folder)[0]), path.join("tank.state")).unwrap();
    folder.write("study.toml", &study);
    served(&folder, "json", &json(&rows[20..]));
    let after = told(&folder);
    assert_eq!(after.len(), 50);
    assert_eq!(after[..30], before);
}

#[test]
fn a_history_of_other_columns_has_a_file_of_its_own() {
    let more = format!("{KEPT}history = \"tank-%Y-%m-%d.csv\"\n");
    let folder = folder("triangular", &more);
    let rows = rows(66, 12, false);
    served(&folder, "json", &json(&rows[..5]));
    folder.change("study.toml", "sd = true", "sd = false");
    served(&folder, "json", &json(&rows[5..]));
    let files = history(&folder);
    let cells = |lines: &[String]| lines.iter().map(|line| line.split(',').count()).max();
    let found = files.iter().map(|(_, lines)| (lines.len(), cells(lines)));
    // t, two estimates with their deviations or without, credible, revision; the test may run over midnight
    let mut found: Vec<_> = found.filter(|(count, _)| *count > 0).collect();
    found.sort();
    assert_eq!(found, [(5, Some(7)), (7, Some(5))], "{files:?}");
}
