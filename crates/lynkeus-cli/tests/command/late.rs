//! Readings that come later than their samples are taken: `delay` and `taken_at` of `[sensors]`.

use crate::Folder;
use crate::normal::Normal;

const PLANT: &str = "model Tank
  input Real u;
  Real level(start = 2, min = -10, max = 20);
  Real q(start = 0, min = -10, max = 20);
  output Real y = level;
  output Real a = q;
equation
  der(level) = u - 0.2*level + 0.1*q;
  der(q) = 0.3*level - 0.4*q;
end Tank;
";

/// A study of the tank.
fn study(family: &str, sensors: &str, estimate: &str) -> String {
    let tuning = match family {
        "ekf" | "ukf" | "mhe" => "initial_variance = { default = 1 }",
        _ => "theta = 3",
    };
    format!(
        "plant = \"plant.mo\"\nprocess_noise = {{ level = 0.01, q = 0.01 }}\n[observer]\nfamily = \"{family}\"\n{tuning}\n[sensors]\nnoise = {{ y = 0.1, a = 0.1 }}\n{sensors}\n[estimate]\n{estimate}\n"
    )
}

/// A row of a log: its time, a reading of y, an assay with the time of its sample, an input.
#[derive(Clone, Copy, Default)]
struct Row {
    t: f64,
    y: Option<f64>,
    a: Option<(f64, f64)>,
    u: Option<f64>,
}

fn cell(x: Option<f64>) -> String {
    x.map_or(String::new(), |x| format!("{x:?}"))
}

/// Assays that are told in any later row, and the same log in the order of their samples.
fn logs(seed: u64) -> (String, String) {
    let mut random = Normal(seed);
    let mut t = 0.0;
    let mut rows: Vec<Row> = vec![];
    for _ in 0..60 {
        t += 0.25 + (4.0 * random.uniform()).floor() / 4.0;
        let y = (random.uniform() < 0.7).then(|| 2.0 + 0.3 * random.uniform());
        let u = Some(0.4 + 0.1 * random.uniform());
        rows.push(Row { t, y, u, a: None });
    }
    for _ in 0..20 {
        let place = (59.0 * random.uniform()) as usize;
        let taken = match random.uniform() < 0.5 {
            true => rows[place].t,
            false => rows[place].t + 0.2 * random.uniform(),
        };
        let later = place + 1 + ((59 - place) as f64 * random.uniform()) as usize;
        rows[later.min(59)].a = Some((taken, 1.5 + random.uniform()));
    }
    let mut sorted: Vec<Row> = rows.iter().map(|row| Row { a: None, ..*row }).collect();
    for (taken, a) in rows.iter().filter_map(|row| row.a) {
        match sorted.iter_mut().find(|row| row.t == taken) {
            Some(row) => row.a = Some((taken, a)),
            None => sorted.push(Row {
                t: taken,
                a: Some((taken, a)),
                ..Row::default()
            }),
        }
    }
    sorted.sort_by(|a, b| a.t.total_cmp(&b.t));
    let mut late = "t,y,a,sampled,u\n".to_owned();
    for Row { t, y, a, u } in rows {
        let (taken, a) = a.unzip();
        late += &format!(
            "{t:?},{},{},{},{}\n",
            cell(y),
            cell(a),
            cell(taken),
            cell(u)
        );
    }
    let mut resorted = "t,y,a,u\n".to_owned();
    for Row { t, y, a, u } in sorted {
        resorted += &format!("{t:?},{},{},{}\n", cell(y), cell(a.map(|a| a.1)), cell(u));
    }
    (late, resorted)
}

fn estimates(folder: &Folder, study: &str, log: &str) -> (Vec<String>, String) {
    folder.write("study.toml", study);
    folder.write("log.csv", log);
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert!(ended.code < 2, "{}", ended.err);
    let out = folder.read("out.csv");
    (out.lines().map(str::to_owned).collect(), ended.err)
}

/// Whatever the order in which assays are told, the estimates are those of the log in the order of their samples.
#[test]
fn late_assays_equal_the_sorted_log_to_the_bit() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    for seed in 0..3 {
        let (late, sorted) = logs(seed);
        for (family, keys) in [
            ("ekf", "sd = true\nsmooth = true"),
            ("ekf", "lag = 3"),
            ("ukf", "sd = true"),
            ("mhe", ""),
            ("triangular", ""),
            ("triangular", "between_samples = \"predict\"\nsd = true"),
        ] {
            let stamped = study(family, "taken_at = { a = \"sampled\" }", keys);
            let (found, told) = estimates(&folder, &stamped, &late);
            let (expected, _) = estimates(&folder, &study(family, "", keys), &sorted);
            assert!(
                told.contains("count at the times of their samples"),
                "{told}"
            );
            assert_eq!(found.len(), 61, "{family} {keys}");
            for row in &found {
                assert!(expected.contains(row), "{seed} {family} {keys}: {row}");
            }
        }
    }
}

/// What one sensor shows 0.75 late is moved back; a log that is simulated has it late.
#[test]
fn a_delay_is_undone() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    let simulate =
        "[simulate]\nuntil = 20\nsample_step = 0.25\ninputs = { u = \"1 + sin(time)\" }\n";
    let with = |sensors: &str| study("ekf", sensors, "innovations = true") + simulate;
    folder.write("late.toml", &with("delay = { a = 0.75 }"));
    folder.write("at-once.toml", &with(""));
    for name in ["late", "at-once"] {
        let (study, log, out) = (
            format!("{name}.toml"),
            format!("{name}.csv"),
            format!("{name}-out.csv"),
        );
        let ended = folder.run(&["simulate", &study, "--log", &log, "-o", &out]);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    // every reading has come
    assert_eq!(folder.read("late-out.csv"), folder.read("at-once-out.csv"));
    let column = |file: &str, header: &str| -> Vec<String> {
        let text = folder.read(file);
        let mut rows = text
            .lines()
            .map(|row| row.split(',').map(str::to_owned).collect::<Vec<_>>());
        let place = rows
            .next()
            .unwrap()
            .iter()
            .position(|h| h == header)
            .unwrap();
        rows.map(|row| row[place].clone()).collect()
    };
    let (late, at_once) = (column("late.csv", "a"), column("at-once.csv", "a"));
    assert!(late[..3].iter().all(String::is_empty), "{late:?}");
    assert_eq!(late[3..], at_once[..at_once.len() - 3]);
    for name in ["late", "at-once"] {
        let (study, log, out) = (
            format!("{name}.toml"),
            format!("{name}.csv"),
            format!("{name}-out.csv"),
        );
        let ended = folder.run(&["estimate", &study, &log, "-o", &out]);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    // the last three samples have not come
    let (late, at_once) = (folder.read("late-out.csv"), folder.read("at-once-out.csv"));
    let both = late.lines().zip(at_once.lines());
    assert_eq!(both.take_while(|(a, b)| a == b).count(), 1 + 81 - 3);
    folder.write("late.toml", &with("delay = { a = 0.6 }"));
    let ended = folder.run(&["simulate", "late.toml", "--log", "late.csv"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("expected a delay of some whole rows"),
        "{}",
        ended.err
    );
}

/// A vehicle whose accelerometer is read at once and whose GPS 0.6 s late: at 2.3 m/s the delay is 1.4 m.
#[test]
fn a_late_gps_no_longer_shifts_a_vehicle() {
    let folder = Folder::empty();
    folder.write(
        "plant.mo",
        "model Vehicle
  input Real a;
  Real s(start = 0);
  Real v(start = 0);
  output Real gps = s;
equation
  der(s) = v;
  der(v) = a;
end Vehicle;
",
    );
    let study = |sensors: &str| {
        format!(
            "plant = \"plant.mo\"\nprocess_noise = {{ v = 1e-3 }}\n[sensors]\nnoise = {{ gps = 0.3 }}\n{sensors}\n[observer]\nfamily = \"ekf\"\n"
        )
    };
    let mut random = Normal(3);
    let (mut s, mut v) = (vec![], 0.0);
    let mut text = "t,gps,a\n".to_owned();
    let mut at = 0.0;
    for k in 0..600 {
        let t = f64::from(k) / 10.0;
        let a = if t < 2.3 { 1.0 } else { 0.0 };
        s.push(at);
        // a fix a second, of 0.6 s ago
        let fix = match k >= 6 && k % 10 == 0 {
            true => format!("{}", s[k as usize - 6] + 0.3 * random.next()),
            false => String::new(),
        };
        text += &format!("{t},{fix},{a}\n");
        at += 0.1 * v + 0.005 * a;
        v += 0.1 * a;
    }
    folder.write("log.csv", &text);
    let shift = |sensors: &str| -> f64 {
        folder.write("study.toml", &study(sensors));
        let ended = folder.run(&["estimate", "study.toml", "log.csv"]);
        assert!(ended.code < 2, "{}", ended.err);
        let (header, rows) = crate::csv(&ended.out);
        let place = header.iter().position(|name| name == "s_hat").unwrap();
        let late = rows.iter().zip(&s).skip(200);
        late.map(|(row, s)| row[place] - s).sum::<f64>() / 400.0
    };
    let as_it_came = shift("");
    let undone = shift("delay = { gps = 0.6 }");
    // what is left is the noise of 40 fixes
    assert!(undone.abs() < 0.2, "{undone}");
    assert!(
        (undone - as_it_came - 1.38).abs() < 0.1,
        "{as_it_came} {undone}"
    );
}

/// The tables of every command are over the rows of the log, with the readings at their own times.
#[test]
fn every_command_moves_late_readings() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    let (late, sorted) = logs(7);
    let fit = "[fit]\nnoise = [\"a\"]\n";
    folder.write("late.csv", &late);
    folder.write("sorted.csv", &sorted);
    folder.write(
        "late.toml",
        &(study("ekf", "taken_at = { a = \"sampled\" }", "") + fit),
    );
    folder.write("sorted.toml", &(study("ekf", "", "") + fit));
    for command in [&["fit", "--json"][..], &["simulate", "--json"]] {
        let answer = |name: &str| {
            let (study, log) = (format!("{name}.toml"), format!("{name}.csv"));
            let mut words = vec![command[0], study.as_str()];
            if command[0] == "simulate" {
                words.push("--inputs");
            }
            words.push(log.as_str());
            words.extend(&command[1..]);
            let ended = folder.run(&words);
            assert!(ended.code < 2, "{command:?}: {}", ended.err);
            let found: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
            found
        };
        let (found, expected) = (answer("late"), answer("sorted"));
        match command[0] {
            "fit" => assert_eq!(found["nll"], expected["nll"]),
            _ => {
                let errors = |answer: &serde_json::Value| answer["errors"]["a"]["rms"].clone();
                assert!(errors(&found).is_number(), "{found}");
                assert_eq!(errors(&found), errors(&expected));
            }
        }
    }
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    let plain = "t,y,a,sampled,u\n0,2,,,1\n1,2,1.5,0.5,1\n2,2,,,1\n";
    let log = |cell: &str| plain.replace("0.5", cell);
    for (sensors, log, told) in [
        (
            "delay = { b = 1 }",
            plain.to_owned(),
            "`delay` of [sensors]: no output is called \"b\"",
        ),
        (
            "taken_at = { b = \"sampled\" }",
            plain.to_owned(),
            "`taken_at` of [sensors]: no output is called \"b\"",
        ),
        (
            "delay = { a = -1 }",
            plain.to_owned(),
            "must be a time >= 0",
        ),
        (
            "delay = { a = nan }",
            plain.to_owned(),
            "must be a time >= 0",
        ),
        (
            "delay = { y = 3 }",
            plain.to_owned(),
            "y = 3 is longer than the log, which spans 2",
        ),
        (
            "delay = { a = 1 }\ntaken_at = { a = \"sampled\" }",
            plain.to_owned(),
            "both say when the samples of a are taken",
        ),
        (
            "taken_at = { a = \"sample\" }",
            plain.to_owned(),
            "has no column \"sample\"",
        ),
        (
            "taken_at = { a = \"sampled\" }",
            log("1.5"),
            "log.csv:3: the sample of a was taken after its result came: \"sampled\" = 1.5 and \"t\" = 1",
        ),
        (
            "taken_at = { a = \"sampled\" }",
            log(""),
            "log.csv:3: a = 1.5 has no time of its sample",
        ),
        (
            "taken_at = { a = \"sampled\" }",
            log("2026-01-01T00:00:00Z"),
            "column \"sampled\": expected numbers as in \"t\", found dates",
        ),
    ] {
        folder.write("study.toml", &study("ekf", sensors, ""));
        folder.write("log.csv", &log);
        let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
        assert_eq!(ended.code, 2, "{sensors}: {}", ended.err);
        assert!(ended.err.contains(told), "{sensors}: {}", ended.err);
    }
}

/// Dates are converted as the log's own times are.
#[test]
fn samples_may_have_dates() {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    let dated = "t,y,a,sampled,u
01.02.2026 06:00,2,,,1
01.02.2026 07:00,2.1,1.5,01.02.2026 06:30,1
01.02.2026 08:00,2.2,1.4,01.02.2026 05:00,1
";
    let hours = "t,y,a,u\n-1,,1.4,1\n0,2,,1\n0.5,,1.5,1\n1,2.1,,1\n2,2.2,,1\n";
    let log = "[log]\ntime_unit = \"h\"\ntime_format = \"%d.%m.%Y %H:%M\"\n";
    let stamped = study("ekf", "taken_at = { a = \"sampled\" }", "sd = true") + log;
    let (found, told) = estimates(&folder, &stamped, dated);
    assert!(told.contains("up to 3 before they came"), "{told}");
    assert!(told.contains("the estimate begins at -1"), "{told}");
    let (expected, _) = estimates(&folder, &study("ekf", "", "sd = true"), hours);
    assert_eq!(
        found[1..],
        [&expected[2], &expected[4], &expected[5]].map(String::clone)
    );
}
