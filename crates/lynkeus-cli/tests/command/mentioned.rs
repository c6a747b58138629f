//! Names in a study that the plant does not have: refused by every command, in the same words.

use crate::Folder;

const PLANT: &str = "model M
  input Real u(start=0,min=-1,max=1);
  parameter Real k = 1;
  Real p(start=1,min=-5,max=5);
  Real v(start=0,min=-5,max=5);
  output Real y = p;
equation
  der(p) = v;
  der(v) = -k*p - 0.5*v + u;
end M;
";

const COMMANDS: [&[&str]; 7] = [
    &["check", "s.toml"],
    &["certify", "s.toml"],
    &["design", "s.toml"],
    &["simulate", "s.toml"],
    &["tune", "s.toml"],
    &["compare", "s.toml"],
    &["estimate", "s.toml", "log.csv"],
];

/// A study with a line in one of its sections.
fn folder(section: &str, line: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", PLANT);
    folder.write("log.csv", "t,y,u\n0,1,0\n0.1,1,0\n0.2,1,0\n");
    let mut study = "plant = \"m.mo\"\n[sensors]\nnoise = { y = 0.01 }\n[observer]\nfamily = \"triangular\"\ntheta = 3\n[simulate]\nuntil = 0.5\n".to_owned();
    match study.contains(section) {
        true => study = study.replace(section, &format!("{section}\n{line}")),
        false => study += &format!("{section}\n{line}\n"),
    }
    folder.write("s.toml", &study);
    folder
}

#[track_caller]
fn refused_by_all(section: &str, line: &str, words: &str) {
    let folder = folder(section, line);
    for command in COMMANDS {
        let ended = folder.run(command);
        assert_eq!(ended.code, 2, "{command:?}: {}", ended.err);
        assert!(ended.err.contains(words), "{command:?}: {}", ended.err);
    }
}

#[test]
fn every_command_refuses_a_stranger_in_any_section() {
    let cases = [
        (
            "[plot]",
            "show = [\"p\", \"nope\"]",
            "s.toml:10:14: `show` of [plot]: nothing is called \"nope\"; choose from: p, v, u",
        ),
        (
            "[simulate]",
            "inputs = { nope = 1 }",
            "s.toml:8:12: the plant 'M' has no input named \"nope\"; choose from: u",
        ),
        (
            "[simulate]",
            "inputs = { u = \"sin(tim)\" }",
            "s.toml:8:16: expression:1:5: unknown name `tim`",
        ),
        (
            "[simulate]",
            "initial = { nope = 1 }",
            "s.toml:8:13: the plant 'M' has no state named \"nope\"; choose from: p, v",
        ),
        (
            "[simulate]",
            "spread = { nope = 1 }",
            "s.toml:8:12: `spread` of [simulate]: the plant 'M' has no state and no parameter named \"nope\"",
        ),
        (
            "[estimate]",
            "columns = { nope = \"a\" }",
            "columns: the plant 'M' has no output, input or state named \"nope\"",
        ),
        (
            "[estimate]",
            "columns = { time = \"t / s\" }",
            "if it is the column of time, set time = \"t / s\" in [log]",
        ),
        (
            "[compare]",
            "families = [\"nope\"]",
            "s.toml:10:13: families of [compare]: no family is called \"nope\"",
        ),
        (
            "[tune]",
            "keys = { nope = [1.0] }",
            "s.toml:10:10: `keys` of [tune]: no family has a key \"nope\"",
        ),
        (
            "[tune]",
            "disturbance = { nope = \"1\" }",
            "s.toml:10:17: the plant 'M' has no input named \"nope\"; choose from: u",
        ),
        (
            "[sensors]",
            "unknown = [\"v\"]",
            "s.toml:3:12: unknown: expected inputs and parameters, found \"v\", a state of the plant 'M': every state is estimated without being listed; leave it out; inputs and parameters are: u, k",
        ),
    ];
    for (section, line, words) in cases {
        refused_by_all(section, line, words);
    }
}

#[test]
fn check_refuses_a_key_to_sweep_of_another_family() {
    let folder = folder("[tune]", "keys = { horizon = [1.0] }");
    let words = "`keys` of [tune]: \"horizon\" belongs to another family than the study's";
    for command in [&["check", "s.toml"], &["tune", "s.toml"]] {
        let ended = folder.run(command);
        assert_eq!(ended.code, 2, "{}", ended.err);
        assert!(ended.err.contains(words), "{}", ended.err);
    }
    // another observer in its place is none that is tuned
    assert_eq!(folder.run(&["simulate", "s.toml"]).code, 0);
}

#[test]
fn what_every_section_may_name_is_taken() {
    let folder = folder("[plot]", "show = [\"p\", \"v\", \"u\"]");
    assert_eq!(folder.run(&["check", "s.toml"]).code, 0);
    folder.change("s.toml", "noise =", "unknown = [\"u\", \"k\"]\nnoise =");
    folder.change("s.toml", "\"u\"]\n", "\"u\", \"k\"]\n");
    folder.change(
        "s.toml",
        "family = \"triangular\"\ntheta = 3",
        "family = \"ekf\"",
    );
    folder.change(
        "s.toml",
        "until = 0.5",
        "until = 0.5\nspread = { k = 0.1, p = 0.1 }",
    );
    let ended = folder.run(&["check", "s.toml"]);
    // one sensor does not show all of these, which is another answer
    assert!(ended.code < 2 && ended.err.is_empty(), "{}", ended.err);
}
