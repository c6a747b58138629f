//! What holds in the row of an event: what was before it, however the event came and whoever looks.

use super::column;
use crate::Folder;

/// A ramp that is taken down at rows by its own level, by the clock twice, and at an instant.
const RAMP: &str = "model Ramp
  Real x(start = 0);
  Integer laps(start = 0);
  Integer beats(start = 0);
  Boolean is_late(start = false);
  output Real y = x;
  output Real seen = laps;
equation
  der(x) = 1;
  when x >= 0.75 then
    reinit(x, 0);
    laps = pre(laps) + 1;
  end when;
  when sample(0, 0.5) then
    beats = pre(beats) + 1;
  end when;
  when time >= 1 then
    is_late = true;
  end when;
end Ramp;
";

const METHODS: [&str; 4] = [
    "method = \"adaptive\"",
    "method = \"stiff\"",
    "method = \"rk4\"\nstep = 0.05",
    "method = \"rk4\"",
];

fn folder(family: &str, variance: f64, method: &str, readings: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", RAMP);
    folder.write(
        "s.toml",
        &format!(
            "plant = \"m.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 0.05 }}\n[observer]\nfamily = \"{family}\"\ninitial_variance = {{ default = 0, x = {variance} }}\n[simulate]\nuntil = 3\noutput_step = 0.25\nsample_step = 0.25\n{method}\n[estimate]\nsd = true\n{method}\n"
        ),
    );
    folder.write("log.csv", readings);
    folder
}

/// x, laps, beats and is_late before what happens at the row.
fn before(row: u32) -> [f64; 4] {
    let t = 0.25 * f64::from(row);
    let laps = f64::from(row.saturating_sub(1) / 3);
    let beats = f64::from(row.div_ceil(2));
    [t - 0.75 * laps, laps, beats, f64::from(u8::from(t > 1.0))]
}

const NAMES: [&str; 4] = ["x", "laps", "beats", "is_late"];

fn check(table: &str, suffix: &str, most: f64) {
    for (place, name) in NAMES.into_iter().enumerate() {
        let found = column(table, &format!("{name}{suffix}"));
        for (row, found) in (0..).zip(found) {
            let expected = before(row)[place];
            assert!(
                (found - expected).abs() < most,
                "{name}{suffix} in row {row}: {found} for {expected}\n{table}"
            );
        }
    }
}

#[test]
fn the_row_of_an_event_shows_what_was_before() {
    let rows = (0..=12).map(|k| format!("{},{}\n", 0.25 * f64::from(k), before(k)[0]));
    let readings = "t,y\n".to_owned() + &rows.collect::<String>();
    for method in METHODS {
        let folder = folder("ekf", 1e-4, method, &readings);
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-q", "-o", "out.csv"]);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        let table = folder.read("out.csv");
        check(&table, "_hat", 1e-8);
        // the level that is passed later is as uncertain behind the event: x goes on at the same rate
        let (mut variance, noise) = (1e-4, 0.0025);
        for (row, sd) in column(&table, "x_sd").into_iter().enumerate() {
            variance = variance * noise / (variance + noise);
            let expected = f64::sqrt(variance);
            assert!(
                (sd / expected - 1.0).abs() < 1e-6,
                "{method} row {row}: {sd} for {expected}"
            );
        }
        let open = [
            "simulate", "s.toml", "--inputs", "log.csv", "-q", "-o", "open.csv",
        ];
        let run = folder.run(&open);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        check(&folder.read("open.csv"), "", 1e-8);
        folder.change("s.toml", "x = 0.0001", "x = 0");
        let run = folder.run(&["simulate", "s.toml", "-q", "-o", "sim.csv"]);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        let table = folder.read("sim.csv");
        check(&table, "", 1e-8);
        check(&table, "_hat", 1e-8);
    }
}

/// A reading in the row of an event corrects what was before, up or down; then the event comes, at once or as much later.
#[test]
fn a_reading_in_the_row_of_an_event_corrects_what_was_before() {
    for (family, method) in [
        ("ekf", METHODS[0]),
        ("ekf", METHODS[1]),
        ("ekf", METHODS[2]),
        ("ukf", METHODS[2]),
    ] {
        for reading in [0.65, 0.85] {
            let readings = format!("t,y\n0,\n0.25,\n0.5,\n0.75,{reading}\n1,\n1.25,\n");
            let folder = folder(family, 0.0025, method, &readings);
            let run = folder.run(&["estimate", "s.toml", "log.csv", "-q", "-o", "out.csv"]);
            assert_eq!(run.code, 0, "{family} {method}: {}", run.err);
            let table = folder.read("out.csv");
            // the reading is as certain as the start
            let corrected = 0.5 * (0.75 + reading);
            let expected = [0.0, 0.25, 0.5, corrected, corrected - 0.5, corrected - 0.25];
            let found = column(&table, "x_hat");
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-8,
                    "{family} {method} {reading}:\n{table}"
                );
            }
            assert_eq!(column(&table, "laps_hat"), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
        }
    }
}
