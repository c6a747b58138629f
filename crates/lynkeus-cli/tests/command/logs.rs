//! Logs as they are, and limits of a run.

use std::time::{Duration, Instant};

use crate::{Ended, Folder, csv};

const PLANT: &str = "model M
  input Real u(start=0,min=-1,max=1);
  Real p(start=1,min=-5,max=5);
  Real v(start=0,min=-5,max=5);
  output Real y = p;
equation
  der(p) = v;
  der(v) = -p - 0.5*v + u;
end M;
";

/// An oscillator with a study whose simulation has the input `u`.
fn oscillator(u: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", PLANT);
    let study = format!(
        "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 3\n[simulate]\nuntil = 5\noutput_step = 0.05\ninputs = {{ u = \"{u}\" }}\n"
    );
    folder.write("s.toml", &study);
    folder
}

fn estimated(folder: &Folder, log: &str) -> Ended {
    folder.write("log.csv", log);
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    // numbers of a thousand are no estimates of this oscillator, and are read all the same
    assert!(
        ended.code == 0 || ended.err.contains("not credible"),
        "{}",
        ended.err
    );
    ended
}

#[test]
fn epoch_times_stay_apart_and_are_read_back() {
    for (origin, step) in [("1700000000.", 1), ("1700000000", 1), ("17000000000", 7)] {
        let folder = oscillator("sin(time)");
        let times: Vec<String> = (0..40)
            .map(|i| format!("{origin}{:03}", i * step))
            .collect();
        let rows: String = times.iter().map(|t| format!("{t},1.0,0.1\n")).collect();
        let ended = estimated(&folder, &format!("t,y,u\n{rows}"));
        let cells = |line: &str| line.split(',').next().unwrap().parse::<f64>().unwrap();
        let found: Vec<f64> = ended.out.lines().skip(1).map(cells).collect();
        let expected: Vec<f64> = times.iter().map(|t| t.parse().unwrap()).collect();
        assert_eq!(found, expected);
        // the tool's own table as a log
        let mapped =
            folder.read("s.toml") + "[estimate]\ncolumns = { y = \"p_hat\", u = \"v_hat\" }\n";
        folder.write("s.toml", &mapped);
        estimated(&folder, &ended.out);
    }
}

#[test]
fn thousands_are_no_fractions() {
    let folder = oscillator("0");
    let marked = estimated(
        &folder,
        "t;y;u\n0;998;0\n0.05;999;0\n0.1;1,000;0\n0.15;1,001;0\n",
    );
    let plain = estimated(
        &folder,
        "t;y;u\n0;998;0\n0.05;999;0\n0.1;1000;0\n0.15;1001;0\n",
    );
    assert_eq!(marked.out, plain.out);
    folder.write("log.csv", "t;y;u\n0;998;0\n1;999;0\n2;1,000;0\n");
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .err
            .contains("log.csv:4: column \"y\": \"1,000\" may have"),
        "{}",
        ended.err
    );
}

#[test]
fn inputs_hold_their_last_value_unless_the_study_is_strict() {
    let folder = oscillator("0");
    let gaps = "t,y,u\n2026-11-22T00:00:00Z,1,0.5\n2026-11-22T00:00:00.1Z,1,\n2026-11-22T00:00:00.2Z,1,NA\n";
    let held = estimated(&folder, gaps);
    assert!(
        held.err
            .contains("column \"u\": 2 of 3 cells are missing, first an empty cell in line 3")
    );
    assert!(
        held.err
            .contains("times are seconds since 2026-11-22T00:00:00Z"),
        "{}",
        held.err
    );
    let full = estimated(&folder, "t,y,u\n0,1,0.5\n0.1,1,0.5\n0.2,1,0.5\n");
    assert_eq!(held.out, full.out);
    let strict = folder.read("s.toml") + "[estimate]\nstrict = true\n";
    folder.write("s.toml", &strict);
    folder.write("log.csv", gaps);
    let ended = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .err
            .contains("log.csv:3: column \"u\" must hold a finite number"),
        "{}",
        ended.err
    );
}

#[test]
fn simulated_times_are_decimal_numbers() {
    let ended = oscillator("0").run(&["simulate", "s.toml"]);
    let times: Vec<String> = ended
        .out
        .lines()
        .skip(1)
        .map(|l| l.split(',').next().unwrap().to_owned())
        .collect();
    assert_eq!(times.len(), 101);
    assert!(times.iter().all(|t| t.len() <= 4), "{times:?}");
    assert_eq!(csv(&ended.out).1.len(), 101);
}

#[test]
fn what_never_ends_is_refused_in_time() {
    for u in [
        "floor(1e15*(time+10))",
        "floor(1e300*time)",
        "mod(time, 1e-12)",
        "floor(1e6*time)",
    ] {
        let before = Instant::now();
        let ended = oscillator(u).run(&["simulate", "s.toml"]);
        assert_eq!(ended.code, 2, "{u}: {}", ended.err);
        assert!(
            ended.err.contains("switches more than"),
            "{u}: {}",
            ended.err
        );
        assert!(before.elapsed() < Duration::from_secs(30), "{u}");
    }
}

#[test]
fn a_grid_that_overflows_is_refused_with_its_size() {
    let folder = oscillator("0");
    let ones = vec!["1"; 65_536].join(",");
    let keys = ["theta", "delta", "r", "innovation_limit"].map(|key| format!("{key} = [{ones}]"));
    let study = folder.read("s.toml") + &format!("[tune]\nkeys = {{ {} }}\n", keys.join(", "));
    folder.write("s.toml", &study);
    let ended = folder.run(&["tune", "s.toml"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.err.contains("found 18446744073709551616"),
        "{}",
        ended.err
    );
}

/// The interval beyond which the predictor's error grows is estimated, and lies where runs change
/// from good to not credible; a log that is too coarse is told.
#[test]
fn a_log_that_is_too_coarse_for_the_gain_is_told() {
    let folder = crate::Folder::new();
    folder.change(
        "study.toml",
        "between_samples = \"linear\"",
        "between_samples = \"predict\"",
    );
    let of = |step: &str| {
        let text = folder.read("study.toml");
        let text = text.replace("output_step = 4", &format!("output_step = {step}"));
        folder.write("s.toml", &text);
        let made = folder.run(&["simulate", "s.toml", "--log", "l.csv", "-o", "r.csv", "-q"]);
        assert_eq!(made.code, 0, "{}", made.err);
        folder.run(&["estimate", "s.toml", "l.csv", "--json", "-o", "e.csv"])
    };
    let limit = |ended: &crate::Ended| ended.json()["sampling"]["largest_predict"].as_f64();
    let fine = of("20");
    assert_eq!(fine.code, 0, "{}", fine.err);
    assert!(!fine.err.contains("apart"), "{}", fine.err);
    let coarse = of("40");
    assert_eq!(coarse.code, 1);
    for words in ["readings are 40 apart", "no proof", "a smaller theta"] {
        assert!(coarse.err.contains(words), "{words}: {}", coarse.err);
    }
    for ended in [fine, coarse] {
        let limit = limit(&ended).unwrap();
        assert!(20.0 < limit && limit < 40.0, "{limit}");
    }
}

/// Dates count in seconds: a plant in minutes would run sixty times too fast.
#[test]
fn dates_beside_a_plant_in_minutes_are_refused() {
    let folder = oscillator("0");
    let row = |k: usize| format!("2026-11-22T01:00:{k:02}Z,1,0\n");
    folder.write(
        "log.csv",
        &format!("t,y,u\n{}", (0..30).map(row).collect::<String>()),
    );
    let seconds = folder.run(&["estimate", "s.toml", "log.csv"]);
    assert_eq!(seconds.code, 0, "{}", seconds.err);
    let study = folder.read("s.toml");
    folder.write("s.toml", &format!("{study}[plot]\ntime_unit = \"s\"\n"));
    assert_eq!(
        folder.run(&["estimate", "s.toml", "log.csv"]).out,
        seconds.out
    );
    folder.write("s.toml", &format!("{study}[plot]\ntime_unit = \"min\"\n"));
    for command in [
        &["estimate", "s.toml", "log.csv"][..],
        &["tune", "s.toml", "--log", "log.csv"],
    ] {
        let ended = folder.run(command);
        let text = format!("{}{}", ended.out, ended.err);
        assert!(
            ended.code > 0 && text.contains("says that the plant's are in min"),
            "{text}"
        );
        let hint = "add time_unit = \"min\" under [log]";
        assert!(text.contains(hint), "{text}");
    }
}
