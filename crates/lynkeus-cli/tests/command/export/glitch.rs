//! One absurd reading that is taken, and good ones after it: an estimator finds back by itself.

use std::process::Command;

use super::has;
use crate::fmu_calls::compiled;
use crate::{Folder, examples, skipped};

const BENCH: &str = r#"
#include "lee.h"
#include <stdio.h>

int main(void)
{
    const double glitches[] = {1.0, 1e3, 1e6, 1e200};
    for (int g = 0; g < 4; g++) {
        lee_state s;
        double signals[LEE_SIGNALS], estimates[LEE_ESTIMATES];
        int refused = 0, late = 0;
        lee_init(&s);
        for (int k = 0; k < 2000; k++) {
            for (int i = 0; i < LEE_SIGNALS; i++) {
                signals[i] = 1.0;
            }
            if (k == 100 || k == 700) {
                signals[0] = glitches[g];
            }
            const int code = lee_push(&s, 0.01 * k, signals, estimates);
            refused += code != 0;
            late += code != 0 && k > 720;
        }
        printf("%d %d %.3f %.3f\n", refused, late, estimates[0], estimates[2]);
    }
    return 0;
}
"#;

const MODULE: &str = r#"
import { readdirSync } from "node:fs";
const file = readdirSync("js").find((name) => name.endsWith(".mjs"));
const { signals, estimates, init, push } = await import(`${process.cwd()}/js/${file}`);
for (const glitch of [1.0, 1e3, 1e6, 1e200]) {
    const s = init();
    const found = new Float64Array(estimates.length);
    let refused = 0, late = 0;
    for (let k = 0; k < 2000; k++) {
        const sample = signals.map(() => 1.0);
        if (k === 100 || k === 700) {
            sample[0] = glitch;
        }
        const code = push(s, 0.01 * k, sample, found);
        refused += code !== 0;
        late += code !== 0 && k > 720;
    }
    console.log(`${refused} ${late} ${found[0].toFixed(3)} ${found[2].toFixed(3)}`);
}
"#;

#[test]
fn one_absurd_reading_does_not_end_an_estimator() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.copy_models("lee");
    let study = std::fs::read_to_string(examples().join("lee/study.toml")).unwrap();
    folder.write("s.toml", &study);
    let path = folder.path.path();
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    folder.write("bench.c", BENCH);
    compiled(path, &["-Ic", "bench.c", "c/lee.c", "-lm", "-o", "bench"]);
    let ran = Command::new(path.join("bench")).output().unwrap();
    let told = String::from_utf8(ran.stdout).unwrap();
    let rows: Vec<Vec<f64>> = told
        .lines()
        .map(|row| row.split(' ').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    // five refusals after each of the two, or none
    assert_eq!(rows[0][0], 0.0, "{told}");
    for row in &rows {
        assert!(row[0] <= 10.0 && row[1] == 0.0, "{told}");
        assert!(
            (row[2] - rows[0][2]).abs() < 0.01 && (row[3] - rows[0][3]).abs() < 0.01,
            "{told}"
        );
    }
    assert!(rows[2][0] > 0.0, "{told}");
    for file in ["c/lee.h", "c/lee.c"] {
        assert!(folder.read(file).contains("refused"), "{file}");
    }
    if !has("node") {
        return skipped("Node is not there");
    }
    let made = folder.run(&["export", "s.toml", "--to", "js", "-o", "js", "-q"]);
    assert_eq!(made.code, 0, "{}", made.err);
    folder.write("bench.mjs", MODULE);
    let ran = Command::new("node")
        .arg("bench.mjs")
        .current_dir(path)
        .output()
        .unwrap();
    assert_eq!(String::from_utf8(ran.stdout).unwrap(), told);
}
