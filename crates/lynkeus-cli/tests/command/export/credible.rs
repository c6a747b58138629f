//! The verdict of an exported estimator: that of `estimate` on right and wrong logs, in every language.

use std::fmt::Write as _;
use std::process::Command;

use super::{has, structured};
use crate::fmu_calls::compiled;
use crate::{Folder, csv, skipped};

const PENDULUM: &str = "model P parameter Real d = 0.5; input Real u(min = -3, max = 3); Real x(start = 0.3, min = -4, max = 4); Real v(start = 0, min = -8, max = 8); output Real y = x; equation der(x) = v; der(v) = -4*sin(x) - d*v + u; end P;";

const EKF: &str = "family = \"ekf\"\ninitial_variance = { default = 0.1 }";
const GATED: &str = "family = \"ekf\"\ngate = 5\ninitial_variance = { default = 0.1 }";
const UKF: &str = "family = \"ukf\"\ninitial_variance = { default = 0.1 }";
const TRIANGULAR: &str = "family = \"triangular\"\ntheta = 4";

fn study(observer: &str) -> String {
    format!(
        "plant = \"m.mo\"\n[sensors]\nmeasured = [\"y\"]\nnoise = {{ y = 0.02 }}\n[process_noise]\nv = 1e-3\n\
         [observer]\n{observer}\n[estimate]\nmethod = \"rk4\"\nstep = 0.05\nsd = true\n\
         [simulate]\nuntil = 20\noutput_step = 0.05\nseed = 7\ninputs = {{ u = \"2*sin(1.3*time)\" }}\n"
    )
}

/// What is wrong with a log: what a reading becomes in its row.
type Wrong = fn(usize, f64, f64) -> f64;

/// In their order: the row, the reading, and that of row 200.
const WRONG: [(&str, Wrong); 3] = [
    ("sign", |_, y, _| -y),
    ("unit", |_, y, _| 100.0 * y),
    ("frozen", |row, y, kept| if row < 200 { y } else { kept }),
];

/// A log of the plant, t, y and u, in files `right.csv` and one for each that is wrong.
fn logs(folder: &Folder) {
    folder.write("m.mo", PENDULUM);
    folder.write("s.toml", &study(EKF));
    let made = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-o", "run.csv"]);
    assert!(made.code < 2, "{}", made.err);
    let (header, rows) = csv(&folder.read("log.csv"));
    let place = |name: &str| header.iter().position(|own| own == name).unwrap();
    let (t, y, u) = (place("t"), place("y"), place("u"));
    let right: (&str, Wrong) = ("right", |_, y, _| y);
    for (name, wrong) in WRONG.into_iter().chain([right]) {
        let mut log = "t,y,u\n".to_owned();
        for (k, row) in rows.iter().enumerate() {
            let reading = wrong(k, row[y], rows[200][y]);
            writeln!(log, "{},{reading},{}", row[t], row[u]).unwrap();
        }
        folder.write(&format!("{name}.csv"), &log);
    }
}

const BENCH: &str = r#"
#include "p.h"
#include <stdio.h>

int main(void)
{
    p_state s;
    double t, signals[P_SIGNALS], estimates[P_ESTIMATES];
    p_init(&s);
    printf("%d\n", p_credible(&s));
    scanf("%*s");
    while (scanf("%lf,%lf,%lf", &t, &signals[0], &signals[1]) == 3) {
        p_push(&s, t, signals, estimates);
        printf("%d\n", p_credible(&s));
    }
    return 0;
}
"#;

const MODULE: &str = r#"
import { readFileSync } from "node:fs";
const { estimates, init, push, credible } = await import(`${process.cwd()}/js/p.mjs`);
const s = init();
const found = new Float64Array(estimates.length);
console.log(Number(credible(s)));
for (const row of readFileSync(0, "utf8").trim().split("\n").slice(1)) {
    const [t, ...signals] = row.split(",").map(Number);
    push(s, t, signals, found);
    console.log(Number(credible(s)));
}
"#;

const CONTROLLER: &str = r#"
int main(void)
{
    double cells[1 + SIGNALS];
    puts("0");
    scanf("%*s");
    while (scanf("%lf,%lf,%lf", &cells[0], &cells[1], &cells[2]) == 3) {
        give(cells);
        block(&it);
        printf("%d\n", (int)it.v_credible);
    }
    return 0;
}
"#;

const EXAMPLE: &str = r#"
fn main() {
    let mut state = p_estimator::State::new();
    let mut estimates = [0.0; p_estimator::ESTIMATES];
    println!("{}", u8::from(state.is_credible()));
    for line in std::io::stdin().lines().skip(1) {
        let line = line.unwrap();
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let _ = state.push(cells[0], &[cells[1], cells[2]], &mut estimates);
        println!("{}", u8::from(state.is_credible()));
    }
}
"#;

fn exported(folder: &Folder, to: &str) {
    let made = folder.run(&["export", "s.toml", "--to", to, "-o", to, "-q", "--force"]);
    assert_eq!(made.code, 0, "{}", made.err);
}

/// What a program says of a log, row by row, and before the first.
fn told(folder: &Folder, program: &mut Command, log: &str) -> String {
    let path = folder.path.path();
    let log = std::fs::File::open(path.join(format!("{log}.csv"))).unwrap();
    let ran = program.current_dir(path).stdin(log).output().unwrap();
    let errors = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{errors}");
    String::from_utf8(ran.stdout).unwrap()
}

#[test]
fn the_verdict_on_a_device_is_that_of_estimate() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    logs(&folder);
    folder.write("bench.c", BENCH);
    folder.write("bench.mjs", MODULE);
    for (place, observer) in [EKF, GATED, UKF, TRIANGULAR].into_iter().enumerate() {
        folder.write("s.toml", &study(observer));
        exported(&folder, "c");
        compiled(
            folder.path.path(),
            &["-Ic", "bench.c", "c/p.c", "-lm", "-o", "bench"],
        );
        let bench = folder.path.path().join("bench");
        let mut others = others(&folder, place == 0);
        for name in ["right", "sign", "unit", "frozen"] {
            let verdicts = told(&folder, &mut Command::new(&bench), name);
            let (first, rest) = verdicts.split_once('\n').unwrap();
            assert_eq!(first, "0", "no estimate yet");
            let log = format!("{name}.csv");
            let ended = folder.run(&["estimate", "s.toml", &log, "--json", "-o", "o.csv"]);
            let is_credible = ended.json()["credible"].as_bool().unwrap();
            assert_eq!(is_credible, name == "right", "{observer} {name}");
            // a sensor that hangs is told by its readings alone, which a device does not keep: there
            // it is as good as what the model makes of it
            if (observer, name) != (TRIANGULAR, "frozen") {
                let is_right = rest.lines().last() == Some("1");
                assert_eq!(is_right, is_credible, "{observer} {name}");
            }
            if name == "right" {
                assert!(!rest.contains('0'), "{observer}: {rest}");
            }
            for (language, other) in &mut others {
                let found = told(&folder, other, name);
                assert_eq!(found, verdicts, "{language}: {observer} {name}");
            }
        }
    }
}

/// Programs in other languages that say the same.
fn others(folder: &Folder, with_rust: bool) -> Vec<(&'static str, Command)> {
    let path = folder.path.path();
    let mut all = vec![];
    std::fs::remove_dir_all(path.join("st")).unwrap_or_default();
    structured::program(folder, CONTROLLER);
    all.push(("Structured Text", Command::new(path.join("st_replay"))));
    if has("node") {
        exported(folder, "js");
        let mut node = Command::new("node");
        node.arg("bench.mjs");
        all.push(("JavaScript", node));
    }
    if with_rust {
        exported(folder, "rust");
        folder.write("rust/examples/verdict.rs", EXAMPLE);
        let mut cargo = Command::new(env!("CARGO"));
        cargo.env("CARGO_TARGET_DIR", path.join("target"));
        cargo.args(["run", "--offline", "--quiet", "--example", "verdict"]);
        cargo.args(["--manifest-path", "rust/Cargo.toml"]);
        all.push(("Rust", cargo));
    }
    all
}

/// Without a declared noise nobody can say how far off a reading may be.
#[test]
fn without_a_noise_there_is_no_verdict() {
    let folder = Folder::empty();
    folder.write("m.mo", PENDULUM);
    let bare = study(TRIANGULAR).replace("noise = { y = 0.02 }\n", "");
    let bare = bare.replace("sd = true\n", "");
    folder.write("s.toml", &bare);
    exported(&folder, "c");
    let header = folder.read("c/p.h");
    assert!(!header.contains("p_credible"), "{header}");
    assert!(
        header.contains("no noise is declared for any sensor"),
        "{header}"
    );
    exported(&folder, "st");
    assert!(!folder.read("st/p.st").contains("credible"));
}
