//! What holds in the row of an event: what was before it, however the event came and whoever looks.

use super::column;
use crate::Folder;

/// A ramp that is taken down at rows, by its own level, by the clock twice, and at an instant.
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

fn folder(method: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", RAMP);
    folder.write(
        "s.toml",
        &format!(
            "plant = \"m.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 0.05 }}\n[process_noise]\nx = 1e-6\n[observer]\nfamily = \"ekf\"\ninitial_variance = {{ default = 0, x = 1e-9 }}\n[simulate]\nuntil = 3\noutput_step = 0.25\nsample_step = 0.25\n{method}\n[estimate]\nsd = true\n{method}\n"
        ),
    );
    let rows = (0..=12).map(|k| format!("{},{}\n", 0.25 * f64::from(k), before(k)[0]));
    folder.write("log.csv", &("t,y\n".to_owned() + &rows.collect::<String>()));
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
    for method in [
        "method = \"adaptive\"",
        "method = \"stiff\"",
        "method = \"rk4\"\nstep = 0.05",
        "method = \"rk4\"",
    ] {
        let folder = folder(method);
        let run = folder.run(&["simulate", "s.toml", "-q", "-o", "sim.csv"]);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        let sim = folder.read("sim.csv");
        check(&sim, "", 1e-9);
        check(&sim, "_hat", 1e-3);
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-q", "-o", "out.csv"]);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        check(&folder.read("out.csv"), "_hat", 1e-3);
        let run = folder.run(&[
            "simulate", "s.toml", "--inputs", "log.csv", "-q", "-o", "open.csv",
        ]);
        assert_eq!(run.code, 0, "{method}: {}", run.err);
        check(&folder.read("open.csv"), "", 1e-9);
    }
}
