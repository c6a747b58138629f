//! Names of models that mean something else elsewhere.

use super::{compiled, difference, estimated, has, replayed};
use crate::{Folder, skipped};

/// Names that C or Rust forbids, that the runtime has itself, or that end a comment.
pub(super) const HOSTILE: &str = "
model 'my */ model?'
  Real 'a b'(start = 1, min = 0, max = 5, unit = \"m\") \"height */ of ??/\";
  Real double(start = 0.5);
  Real x(start = 0.2);
  Real STATES(start = 0.1);
  Real s1_matrix(start = 0.3);
  Real 'fn'(start = 0.2) \"from \u{202e}right\u{202c} to left\";
  Real ESTIMATES(start = 0.1);
  Real NOISE_SHARES(start = 0.1);
  input Real sin(start = 0);
  input Real t;
  output Real 'y[1]' = 'a b';
  output Real R = x;
equation
  der('a b') = -0.5*'a b' + double;
  der(double) = -double + 0.3*sin('a b')*t;
  der(x) = STATES - x + abs(x)*0.1;
  der(STATES) = -STATES^3 + s1_matrix;
  der('fn') = ESTIMATES - 'fn';
  der(ESTIMATES) = NOISE_SHARES - ESTIMATES*'fn';
  der(NOISE_SHARES) = 0.1*x - NOISE_SHARES;
  der(s1_matrix) = -s1_matrix + sin + max(x, 0.1)^2.5 + (if x > 0.1 then 1 else 0.5);
end 'my */ model?';
";

pub(super) const HOSTILE_STUDY: &str = r#"
plant = "m.mo"
sensors = { measured = ["y[1]", "R"], noise = { "y[1]" = 0.1, R = 0.05 } }
process_noise = { "a b" = 0.01, double = 0.01, x = 0.01, STATES = 0.01, s1_matrix = 0.01, fn = 0.01, ESTIMATES = 0.01, NOISE_SHARES = 0.01 }
observer = { family = "ekf" }
estimate = { method = "rk4", step = 0.05, sd = true }
"#;

pub(super) fn hostile_log() -> String {
    let mut log = String::from("time,y[1],R,sin,t\n");
    for k in 0..40 {
        let t = 0.1 * f64::from(k);
        let (y, u) = (1.0 + 0.3 * t.sin(), 0.1 * (2.0 * t).cos());
        log += &format!("{t},{y},{u},{u},{y}\n");
    }
    log
}

#[test]
fn any_name_can_be_exported() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.write("m.mo", HOSTILE);
    folder.write("s.toml", HOSTILE_STUDY);
    folder.write("log.csv", &hostile_log());
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    assert!(made.err.contains("my____model_.h"), "{}", made.err);
    compiled(folder.path.path(), &[]);
    let expected = estimated(folder.path.path()).unwrap();
    let off = difference(&expected, &replayed(folder.path.path(), &[]), "");
    assert!(off <= 1e-12, "{off:e}");
}
