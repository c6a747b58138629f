//! A module of `export --to js` in Node.

use std::process::Command;

use super::{AMPLIFIES, Looked, Run, estimated, filter, has};
use crate::normal::Normal;
use crate::{Folder, skipped};

/// A log through a module.
const REPLAY: &str = r#"
import { readFileSync, readdirSync } from "node:fs";
const file = readdirSync("js").find((name) => name.endsWith(".mjs"));
const { signals, estimates, tunables, init, push } = await import(`${process.cwd()}/js/${file}`);
const [header, ...rows] = readFileSync("log.csv", "utf8").trim().split("\n").map((row) => row.split(","));
const places = signals.map((name) => header.indexOf(name));
const time = header.indexOf("t");
const number = (cell) => (cell === undefined || cell === "" ? NaN : Number(cell));
const state = init();
const found = new Float64Array(estimates.length);
console.log(["t", ...estimates].join(","));
for (const row of rows) {
    const t = Number(row[time]);
    if (push(state, t, places.map((place) => number(row[place])), found) !== 0) {
        process.exit(1);
    }
    console.log([t, ...found].join(","));
}
"#;

/// Whether an exported module calls functions that no standard defines to the last digit.
fn calls_functions(folder: &Folder) -> bool {
    let file = std::fs::read_dir(folder.path.path().join("js"));
    let text = std::fs::read_to_string(file.unwrap().next().unwrap().unwrap().path()).unwrap();
    let exact = ["sqrt", "abs", "floor", "ceil", "min", "max", "log2"];
    text.split("Math.").skip(1).any(|call| {
        !exact
            .iter()
            .any(|name| call.starts_with(&format!("{name}(")))
    })
}

fn replayed(folder: &Folder) -> Run {
    let made = folder.run(&["export", "s.toml", "--to", "js", "-o", "js", "-q"]);
    assert_eq!(made.code, 0, "{}", made.err);
    replayed_by(folder, "")
}

/// By the module in `js`, once more is done with its state at the start.
pub(crate) fn replayed_by(folder: &Folder, more: &str) -> Run {
    let text = REPLAY.replace("const found", &format!("{more}\nconst found"));
    folder.write("replay.mjs", &text);
    let mut node = Command::new("node");
    let ended = node
        .arg("replay.mjs")
        .current_dir(folder.path.path())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(told.is_empty(), "{told}");
    let (header, rows) = crate::csv(&String::from_utf8(ended.stdout).unwrap());
    (header, rows, ended.status.success())
}

/// Against what `estimate` gives.
pub(super) fn check(looked: &Looked) {
    let found = replayed(&looked.folder);
    looked.compare(found, "JavaScript", calls_functions(&looked.folder));
}

/// A sine that is wrong in its twelfth digit is no rounding, however much a study makes of that.
#[test]
fn a_wrong_function_is_found_where_a_study_amplifies() {
    if !has("node") {
        return skipped("node is not there");
    }
    let folder = Folder::empty();
    filter(&mut Normal(1000 + AMPLIFIES), &folder);
    let expected = estimated(folder.path.path()).unwrap();
    let looked = Looked {
        seed: AMPLIFIES,
        folder,
        expected,
    };
    assert_eq!(looked.compared(replayed(&looked.folder), true), Ok(()));
    let wrong = "const sine = Math.sin; Math.sin = (x) => sine(x) * (1 + 1e-12);";
    let found = replayed_by(&looked.folder, wrong);
    let off = looked.compared(found, true).unwrap_err();
    assert!(off.contains("up to row"), "{off}");
}
