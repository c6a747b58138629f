//! What fails, with one clear line, the right exit code and nothing half-written.

use crate::Folder;

/// Runs `estimate` after a change and returns its message; no file may appear.
fn refused(change: impl Fn(&Folder), code: i32) -> String {
    let folder = Folder::new();
    change(&folder);
    let before = folder.files();
    let ended = folder.run(&[
        "estimate",
        "study.toml",
        "log.csv",
        "-o",
        "e.csv",
        "--plot",
        "e.svg",
    ]);
    assert_eq!(ended.code, code, "{}", ended.err);
    assert_eq!(folder.files(), before, "something was written");
    assert!(ended.out.is_empty());
    ended.err
}

#[track_caller]
fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in: {text}");
    }
}

/// The log with one of its lines replaced.
fn line(number: usize, by: &'static str) -> impl Fn(&Folder) {
    move |folder| {
        let text = folder.read("log.csv");
        let lines = text.lines().enumerate();
        let lines: Vec<&str> = lines
            .map(|(i, l)| if i + 1 == number { by } else { l })
            .collect();
        folder.write("log.csv", &lines.join("\n"));
    }
}

#[test]
fn wrong_columns() {
    let text = refused(line(1, "t,levl,pump"), 2);
    says(
        &text,
        &[
            "error: log.csv: no column \"level\"",
            "t, levl, pump",
            "\"level\" = \"levl\"",
        ],
    );
    let text = refused(line(1, "time,level,pump"), 2);
    says(
        &text,
        &["no time column \"t\"", "in [log]", "set time = \""],
    );
}

/// As [`refused`], by a study that takes no log with faults.
fn strict(change: impl Fn(&Folder)) -> String {
    let with_key = |folder: &Folder| {
        change(folder);
        folder.change("study.toml", "[estimate]", "[estimate]\nstrict = true");
    };
    refused(with_key, 2)
}

#[test]
fn cells_that_are_no_numbers() {
    // a sensor that does not report is bridged by the model; `strict` refuses it
    says(
        &strict(line(3, "4,NaN,3")),
        &["log.csv:3", "\"level\"", "found \"NaN\""],
    );
    says(&strict(line(4, "8,,3")), &["log.csv:4", "an empty cell"]);
    says(&refused(line(4, "8,5"), 2), &["log.csv:4"]);
}

#[test]
fn time_that_goes_back() {
    let text = strict(line(4, "3,5.1,3"));
    says(&text, &["log.csv:4", "found \"t\" = 3 after 4 in line 3"]);
    let text = refused(line(900, "3,5.1,3"), 2);
    says(&text, &["log.csv:900", "the clock jumps back", "`late`"]);
}

#[test]
fn missing_files() {
    says(
        &refused(
            |f| std::fs::remove_file(f.path.path().join("log.csv")).unwrap(),
            2,
        ),
        &["no log file at log.csv"],
    );
    says(
        &refused(
            |f| std::fs::remove_file(f.path.path().join("two_tanks.mo")).unwrap(),
            2,
        ),
        &["no plant file at two_tanks.mo"],
    );
    let folder = Folder::new();
    let ended = folder.run(&["check", "other.toml"]);
    assert_eq!(ended.code, 2);
    says(&ended.err, &["no study file at other.toml"]);
    let ended = folder.run(&["simulate", "study.toml", "-o", "no/such/folder/x.csv"]);
    assert_eq!(ended.code, 2);
    says(&ended.err, &["cannot write no/such/folder/x.csv"]);
}

#[test]
fn studies_that_cannot_be_read() {
    let text = refused(|f| f.change("study.toml", "theta =", "tehta ="), 2);
    says(
        &text,
        &[
            "study.toml:10:1",
            "unknown key \"tehta\"",
            "did you mean \"theta\"",
        ],
    );
    let text = refused(
        |f| f.change("study.toml", "theta = 0.09", "theta = -0.09"),
        2,
    );
    says(
        &text,
        &[
            "study.toml:10:9",
            "`theta` of [observer]",
            "expected positive numbers, found -0.09",
        ],
    );
    let text = refused(|f| f.change("study.toml", "[\"pump\"]", "[\"pmup\"]"), 2);
    says(&text, &["study.toml:5:", "no input named 'pmup'", "pump"]);
    says(
        &refused(|f| f.write("study.toml", "plant = "), 2),
        &["study.toml:1:"],
    );
}

#[test]
fn models_that_cannot_be_read() {
    let text = refused(
        |f| f.change("two_tanks.mo", "k3*sqrt(lower)", "k3*sqrt(lowr)"),
        2,
    );
    says(&text, &["two_tanks.mo:12", "lowr", "lower", "^"]);
    let text = refused(
        |f| {
            f.change(
                "two_tanks.mo",
                "  der(lower) = k2*sqrt(upper) - k3*sqrt(lower);\n",
                "",
            )
        },
        2,
    );
    says(&text, &["lower"]);
}

#[test]
fn a_refuted_condition_ends_with_one_and_its_witness() {
    let folder = Folder::new();
    folder.write(
        "square.mo",
        "model Square\n  Real x1(start = 1);\n  Real x2(start = 0.5, min = -1, max = 1);\n  output Real y = x1;\nequation\n  der(x1) = x2^2;\n  der(x2) = 0;\nend Square;\n",
    );
    folder.write("square.toml", "plant = \"square.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 1\n[simulate]\nuntil = 1\n");
    for command in ["check", "simulate"] {
        let ended = folder.run(&[command, "square.toml"]);
        assert_eq!(ended.code, 1, "{}", ended.err);
        says(
            &(ended.out + &ended.err),
            &["∂f(x1)/∂x2 keeps its sign", "it is 0 at x2 = 0"],
        );
    }
}

/// The counter-example of the paper: u ∈ {−1, +1}, never zero and of both signs.
#[test]
fn the_counter_example_is_refused_with_its_witness() {
    let folder = Folder::new();
    folder.write(
        "counter.mo",
        "model CounterExample\n  input Integer s(min = 0, max = 1) \"u = 2 s - 1 is -1 or +1\";\n  Real u = 2*s - 1;\n  Real x1;\n  Real x2;\n  output Real y = x1;\nequation\n  der(x1) = u*x2;\n  der(x2) = 0;\nend CounterExample;\n",
    );
    folder.write(
        "counter.toml",
        "plant = \"counter.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 1\n",
    );
    let ended = folder.run(&["check", "counter.toml"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    says(&ended.out, &["it is -1 at s = 0 and 1 at s = 1"]);
}

#[test]
fn a_divergence_ends_with_one() {
    let folder = Folder::new();
    folder.write(
        "escape.mo",
        "model Escape\n  Real x(start = 1);\n  output Real y = x;\nequation\n  der(x) = x^2;\nend Escape;\n",
    );
    folder.write("escape.toml", "plant = \"escape.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = 1\n[simulate]\nuntil = 2\n");
    let ended = folder.run(&["simulate", "escape.toml", "-o", "x.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    says(&ended.err, &["escape.toml", "t = ", "x = "]);
    // the rows before are worth having
    says(&ended.err, &["rows before are written"]);
    assert!(folder.read("x.csv").lines().count() > 100);
}

#[test]
fn a_state_that_nothing_shows_is_named() {
    let folder = Folder::new();
    folder.write(
        "blind.mo",
        "model Blind\n  Real a(start = 1);\n  Real b(start = 1);\n  output Real y = a;\nequation\n  der(a) = -a;\n  der(b) = a - b;\nend Blind;\n",
    );
    folder.write(
        "blind.toml",
        "plant = \"blind.mo\"\n[observer]\ntheta = 1\n",
    );
    let ended = folder.run(&["check", "blind.toml"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    says(&ended.out, &["states not observable: b", "measure"]);
}

#[test]
fn an_input_that_blinds_the_sensor_is_named() {
    let folder = Folder::empty();
    folder.write(
        "blind.mo",
        "model Blind\n  input Real u(min = -1, max = 1);\n  Real a(min = -1, max = 1);\n  Real b(min = -1, max = 1);\n  output Real y = a;\nequation\n  der(a) = u*b;\n  der(b) = -b;\nend Blind;\n",
    );
    let ended = folder.run(&["check", "blind.mo"]);
    says(
        &ended.out,
        &[
            "states observable: a, b",
            "constant input u = 0",
            "differ only in b",
        ],
    );
    let ended = folder.run(&["check", "blind.mo", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
    assert_eq!(json["uniform"]["verdict"], "refuted");
    assert_eq!(json["uniform"]["blind"][0]["hidden"][0], "b");
    assert_eq!(json["observability"]["b"], "observable");
}
