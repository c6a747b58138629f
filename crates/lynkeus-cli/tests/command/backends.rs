//! Machine code and the interpreter through the command: the same bytes.

use std::fs::{read_dir, read_to_string};

use crate::{Folder, examples};

/// Every example, its plant with its observer and its noise; and one with fixed steps, which are
/// one function.
#[test]
fn both_backends_write_the_same() {
    let mut compared = 0;
    for example in read_dir(examples()).unwrap() {
        let Ok(files) = read_dir(example.unwrap().path()) else {
            continue;
        };
        for path in files.map(|file| file.unwrap().path()) {
            let is_study = path.extension().is_some_and(|e| e == "toml");
            if is_study && read_to_string(&path).unwrap().contains("[simulate]") {
                compare(&Folder::empty(), path.to_str().unwrap(), &[]);
                compared += 1;
            }
        }
    }
    assert!(compared > 20);
    let folder = Folder::empty();
    for file in ["lee.mo", "study.toml"] {
        let text = read_to_string(examples().join("lee").join(file)).unwrap();
        folder.write(file, &text);
    }
    folder.change(
        "study.toml",
        "until = 10",
        "until = 10\nmethod = \"rk4\"\nstep = 1e-3",
    );
    let apart = compare(&folder, "study.toml", &[]);
    let fused = compare(&folder, "study.toml", &["--fuse"]);
    assert!(apart != fused && apart.lines().count() == fused.lines().count());
}

fn compare(folder: &Folder, study: &str, options: &[&str]) -> String {
    let [interpreted, native] = ["interpreter", "native"].map(|backend| {
        let command = ["simulate", study, "-o", "o.csv", "-q", "--backend", backend];
        let done = folder.run(&[&command, options].concat());
        // one of the papers' observers does not work at all, and its table is written all the same
        assert!(done.code < 2, "{study}: {}", done.err);
        folder.read("o.csv")
    });
    assert!(interpreted == native, "{study} differs");
    native
}
