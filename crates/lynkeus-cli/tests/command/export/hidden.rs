//! Descriptions and names of somebody else's model: what a reviewer sees of the code is what a compiler reads.

use std::io::Write;
use std::process::{Command, Stdio};

use super::has;
use crate::fmu_calls::compiled;
use crate::{Folder, skipped};

const MODEL: &str = "model Tank \"\u{202e}\u{2066}// safe\u{2069} \u{2066}\"
  parameter Real k = 0.2 \"rate \u{202e} reversed\u{2028}int injected;\";
  input Real pump(start=1, min=0, max=10) \"\u{200f}\u{200e} } \u{2066}if (ok)\u{2069} \u{2067} begin\";
  Real h(start=1, min=0.1, max=10) \"level ???/ and ?????/ or ??/\u{7}\";
  output Real 'y\u{202e}\tlevel' = h \"end\u{2029}\";
equation
  der(h) = -k*h + pump;
end Tank;
";

const STUDY: &str = r#"
plant = "m.mo"
[sensors]
measured = ["y\u202e\tlevel"]
unknown = ["pump"]
noise = { "y\u202e\tlevel" = 0.01 }
[observer]
family = "triangular"
theta = 2
[simulate]
until = 5
output_step = 0.05
inputs = { pump = 1 }
"#;

fn is_hidden(c: char) -> bool {
    (c.is_control() && c != '\n')
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn texts(folder: &std::path::Path, found: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            texts(&path, found);
        } else if let Ok(text) = std::fs::read_to_string(&path) {
            found.push((path.display().to_string(), text));
        }
    }
}

#[test]
fn what_nobody_sees_is_not_in_exported_code() {
    let folder = Folder::empty();
    folder.write("m.mo", MODEL);
    folder.write("s.toml", STUDY);
    let path = folder.path.path();
    for to in ["c", "js", "rust", "st"] {
        let made = folder.run(&["export", "s.toml", "--to", to, "-o", to, "-q"]);
        assert_eq!(made.code, 0, "{to}: {}", made.err);
        let mut found = vec![];
        texts(&path.join(to), &mut found);
        assert!(!found.is_empty());
        for (file, text) in found {
            let hidden: Vec<char> = text.chars().filter(|c| is_hidden(*c)).collect();
            assert!(hidden.is_empty(), "{file}: {hidden:?}");
            // which are nothing but C's
            assert!(to != "c" || !text.contains("??/"), "{file}");
        }
    }
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    compiled(path, &["-c", "c/tank.c", "-o", "tank.o"]);
    // names are what they were
    folder.write(
        "names.c",
        "#include \"tank.h\"\n#include <stdio.h>\nint main(void)\n{\n    puts(tank_signal_names[0]);\n    return 0;\n}\n",
    );
    compiled(path, &["-Ic", "names.c", "c/tank.c", "-lm", "-o", "names"]);
    let told = Command::new(path.join("names")).output().unwrap();
    assert_eq!(
        String::from_utf8(told.stdout).unwrap(),
        "y\u{202e}\tlevel\n"
    );
    if !has("node") {
        return skipped("Node is not there");
    }
    folder.write(
        "names.mjs",
        "const { signals } = await import(`${process.cwd()}/js/tank.mjs`);\nconsole.log(signals[0]);\n",
    );
    let told = Command::new("node")
        .arg("names.mjs")
        .current_dir(path)
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(told.stdout).unwrap(),
        "y\u{202e}\tlevel\n"
    );
}

/// Rows longer than there is room for, in the middle of a log and at its head.
#[test]
fn the_bench_refuses_what_it_cannot_hold() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.write("m.mo", &MODEL.replace("'y\u{202e}\tlevel'", "level"));
    folder.write("s.toml", &STUDY.replace("y\\u202e\\tlevel", "level"));
    let path = folder.path.path();
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c", "-q"]);
    assert_eq!(made.code, 0, "{}", made.err);
    compiled(
        path,
        &["-Ic", "c/replay.c", "c/tank.c", "-lm", "-o", "bench"],
    );
    let replayed = |log: &str| {
        let mut child = Command::new(path.join("bench"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        // it may stop reading
        let _ = stdin.write_all(log.as_bytes());
        drop(stdin);
        let ended = child.wait_with_output().unwrap();
        let told = String::from_utf8(ended.stderr).unwrap();
        (
            ended.status.code(),
            told,
            String::from_utf8(ended.stdout).unwrap(),
        )
    };
    let cell = |length: usize| "1".repeat(length);
    let long = format!("t,level,other\n0,3,1\n1,3,{}7,7,1\n", cell(65_531));
    let (code, told, _) = replayed(&long);
    assert_eq!(code, Some(2), "{told}");
    assert!(
        told.contains("row 3: expected at most 65535 bytes, found more"),
        "{told}"
    );
    let (code, told, _) = replayed(&format!("t,level,{}\n0,3,1\n", cell(70_000)));
    assert_eq!((code, told.contains("row 1: ")), (Some(2), true), "{told}");
    // as long as there is room, with and without the end of its line
    for end in ["\n", ""] {
        let log = format!("t,level,other\n0,3,{}{end}", cell(65_535 - 4 - end.len()));
        let (code, told, rows) = replayed(&log);
        assert_eq!(code, Some(0), "{told}");
        assert_eq!(rows.lines().count(), 2);
    }
}
