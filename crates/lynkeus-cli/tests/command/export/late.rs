//! Sensors with a delay in exported C: what is known when a row comes is what `estimate` makes of the log up to it.

use std::fmt::Write;

use super::{compiled, has, replayed};
use crate::normal::Normal;
use crate::{Folder, skipped};

const PLANT: &str = "model Tank
  input Real u;
  Real level(start = 2, min = -10, max = 20);
  Real q(start = 0, min = -10, max = 20);
  output Real y = level;
  output Real a = q;
equation
  der(level) = u - 0.2*level + 0.1*q;
  der(q) = 0.3*level - 0.4*q^2;
end Tank;
";

fn study(family: &str, delays: &str) -> String {
    let tuning = match family {
        "ekf" | "ukf" => "initial_variance = { default = 1 }\ngate = 6",
        _ => "theta = 3",
    };
    format!(
        "plant = \"tank.mo\"\nprocess_noise = {{ level = 0.01, q = 0.01 }}\n[observer]\nfamily = \"{family}\"\n{tuning}\n[sensors]\nnoise = {{ y = 0.1, a = 0.1 }}\n{delays}\n[estimate]\nmethod = \"rk4\"\nsubsteps = 3\nsd = true\n"
    )
}

/// Rows at any times, of which some readings are missing, and inputs but in the first rows, too.
fn log(random: &mut Normal) -> Vec<String> {
    let mut t: f64 = 0.0;
    let rows = (0..120).map(|k| {
        let mut maybe = |share: f64, value: f64| match random.uniform() < share {
            true => format!("{value:?}"),
            false => String::new(),
        };
        let y = maybe(0.7, 2.0 + (0.3 * t).sin());
        let a = maybe(0.4, 1.0 + (0.2 * t).cos());
        let u = maybe(if k < 20 { 1.0 } else { 0.6 }, 0.5 + 0.2 * t.sin());
        let row = format!("{t:?},{y},{a},{u}");
        t += match random.uniform() < 0.5 {
            true => 0.1,
            false => 0.05 + 0.2 * random.uniform(),
        };
        row
    });
    rows.collect()
}

/// What compiled C knows at some rows of a log is what `estimate` makes of the log up to there; whether both reached
/// its end.
pub(super) fn compared(folder: &Folder, log: &[String], whose: &str) -> bool {
    let rows = log.len() - 1;
    let write = |count: usize| {
        let mut text = String::new();
        for line in &log[..=count] {
            writeln!(text, "{line}").unwrap();
        }
        folder.write("log.csv", &text);
    };
    write(rows);
    let (header, found, is_whole) = replayed(folder.path.path(), &[]);
    assert!(found.len() == rows || !is_whole, "{whose}");
    for count in (8..rows).step_by(14).chain([rows]) {
        write(count);
        let ended = folder.run(&["estimate", "s.toml", "log.csv", "-o", "o.parquet"]);
        assert!(ended.code < 2 || !is_whole, "{whose}: {}", ended.err);
        if count > found.len() || ended.code == 2 {
            continue;
        }
        let table = lynkeus::Table::load(folder.path.path().join("o.parquet")).unwrap();
        for (own, name) in found[count - 1].iter().zip(&header) {
            let expected = table.get(name).unwrap().last().unwrap();
            let off = (own - expected).abs() / (1.0 + expected.abs());
            assert!(off < 1e-12, "{whose} {count} {name}: {own} {expected}");
        }
    }
    is_whole
}

#[test]
fn late_readings_find_their_place_on_a_device() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    let path = folder.path.path();
    folder.write("tank.mo", PLANT);
    for (place, family) in ["ekf", "ukf", "triangular"].into_iter().enumerate() {
        folder.write("s.toml", &study(family, "delay = { a = 0.6, y = 0.1 }"));
        let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c", "--force"]);
        assert_eq!(made.code, 0, "{}", made.err);
        compiled(path, &["-fsanitize=address,undefined"]);
        for seed in 0..3 {
            let rows = log(&mut Normal(10 * place as u64 + seed));
            let whole = [vec!["t,y,a,u".to_owned()], rows].concat();
            let is_whole = compared(&folder, &whole, &format!("{family} {seed}"));
            assert!(is_whole, "{family} {seed}");
        }
    }
}

/// Fewer rows than the delay has: what is late is refused, and nothing else changes.
#[test]
fn a_device_without_room_says_so() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.write("tank.mo", PLANT);
    folder.write("s.toml", &study("ekf", "delay = { a = 1 }"));
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    compiled(folder.path.path(), &["-DTANK_ROWS=6"]);
    let rows = (0..40).map(|k| {
        format!(
            "{},2,{},1\n",
            f64::from(k) / 10.0,
            if k == 30 { "1" } else { "" }
        )
    });
    folder.write("log.csv", &format!("t,y,a,u\n{}", rows.collect::<String>()));
    let (_, found, is_whole) = replayed(folder.path.path(), &[]);
    assert!(!is_whole);
    assert!(found.len() < 40, "{}", found.len());
}

#[test]
fn what_exported_code_cannot_go_back_to_is_refused() {
    let folder = Folder::empty();
    folder.write("tank.mo", PLANT);
    for (sensors, to, told) in [
        (
            "taken_at = { a = \"sampled\" }",
            &["c"][..],
            "no exported code has a column for that",
        ),
        (
            "delay = { a = 1 }",
            &["rust"],
            "only C goes back to them, and not rust",
        ),
        (
            "delay = { a = 1 }",
            &["fmu"],
            "only C goes back to them, and not fmu",
        ),
        (
            "delay = { a = 1 }",
            &["c", "--tunable"],
            "what is tunable does not go back",
        ),
    ] {
        folder.write("s.toml", &study("ekf", sensors));
        let mut words = vec!["export", "s.toml", "-o", "out", "--to"];
        words.extend(to);
        let ended = folder.run(&words);
        assert_eq!(ended.code, 1, "{}", ended.err);
        assert!(ended.err.contains(told), "{}", ended.err);
        assert!(!folder.path.path().join("out").exists());
    }
}
