//! Estimators that read derivatives of inputs: as signals of their own, or from a filter in the device.

use super::{Looked, compiled, difference, estimated, has, javascript, replayed, rust, structured};
use crate::generated::{OBSERVER, STEP, logged};
use crate::{Folder, skipped};

/// With slopes in columns of the log, and with a filter of the command.
const ORIGINS: [(&str, &[&str]); 2] = [
    (
        "input_derivatives = { u = [\"du\", \"ddu\"] }",
        &["y", "u", "du", "ddu"],
    ),
    (
        "generator = { u = { poles = [-2, -3, -4] } }",
        &["y", "u_command"],
    ),
];

fn folder() -> Folder {
    let folder = Folder::empty();
    let [du, ddu] = [1, 2].map(|order| {
        move |t: f64| {
            let of = |a: f64, pole: f64| a * pole.powi(order) * (pole * t).exp();
            of(-6.0, -2.0) + of(8.0, -3.0) + of(-3.0, -4.0)
        }
    });
    let command = |t: f64| (0.7 * t).sin();
    logged(
        &folder,
        STEP,
        (0.05, 5.0),
        &[("du", &du), ("ddu", &ddu), ("u_command", &command)],
    );
    folder
}

/// A text with single blanks.
fn spaced(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn exported_slopes_of_inputs_are_signals() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let mut kept = vec![];
    for (seed, (origin, signals)) in ORIGINS.into_iter().enumerate() {
        let folder = folder();
        let settings = format!("[estimate]\nmethod = \"rk4\"\nsubsteps = 4\n{origin}\n");
        folder.write("s.toml", &format!("{OBSERVER}{settings}"));
        let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
        assert_eq!(made.code, 0, "{}", made.err);
        let names: Vec<String> = signals.iter().map(|name| format!("\"{name}\"")).collect();
        let source = spaced(&folder.read("c/chain.c"));
        assert!(source.contains(&names.join(", ")), "{signals:?}");
        let path = folder.path.path();
        compiled(path, &[]);
        let expected = estimated(path).unwrap();
        let off = difference(&expected, &replayed(path, &[]), origin);
        assert!(off <= 1e-12, "{origin}: {off:e}");
        let looked = Looked {
            seed: seed as u64,
            folder,
            expected,
        };
        if has("node") {
            javascript::check(&looked);
        }
        structured::check(&looked);
        kept.push(looked);
    }
    rust::check(&kept);
}

/// A study that names no columns has them under the names of the derivatives.
#[test]
fn slopes_without_columns_have_names_of_their_own() {
    let folder = folder();
    folder.write("s.toml", OBSERVER);
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    let source = spaced(&folder.read("c/chain.c"));
    assert!(source.contains("\"y\", \"u\", \"u'\", \"u''\""), "{source}");
}
