//! The attack sees what must not be, lets pass what may be, and finds nothing in a short search.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::commands::{Command, Form};
use super::oracle::Class;
use super::run::Desk;
use super::{Case, Options, shape};

fn folder(name: &str) -> PathBuf {
    let id = std::process::id();
    let folder = std::env::temp_dir().join(format!("lynkeus-attack-{name}-{id}"));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// What is found where the command is this shell script.
#[cfg(unix)]
fn found(name: &str, script: &str) -> Option<Class> {
    let folder = folder(name);
    let case = Case {
        files: vec![("study.toml".to_owned(), b"a = 1\n".to_vec())],
        commands: vec![Command {
            arguments: ["-c", script].map(str::to_owned).to_vec(),
            inputs: vec!["study.toml".to_owned()],
            results: vec![("r.csv".to_owned(), Form::Csv)],
            printed: Form::Text,
            rewritten: None,
        }],
    };
    let limit = Duration::from_millis(1500);
    let desk = Desk::new(&folder, 0, Path::new("/bin/sh"), limit).unwrap();
    let (_, finding) = desk.attack(&case).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    finding.map(|f| f.class)
}

#[cfg(unix)]
#[test]
fn what_must_not_be_is_seen() {
    let good = "printf 't,x\\n0,1\\n' > r.csv";
    let cases = [
        (good.to_owned(), None),
        ("echo 'error: no' >&2; exit 2".to_owned(), None),
        (
            "echo \"thread 'main' panicked at x.rs\" >&2; exit 101".to_owned(),
            Some(Class::Panic),
        ),
        ("kill -SEGV $$".to_owned(), Some(Class::Signal)),
        ("exec sleep 9".to_owned(), Some(Class::Hang)),
        ("exit 3".to_owned(), Some(Class::ExitCode)),
        ("exit 2".to_owned(), Some(Class::Silent)),
        (
            "printf 'a\\033[2J' >&2; exit 2".to_owned(),
            Some(Class::Terminal),
        ),
        (format!("{good}; echo > .lynkeus-x"), Some(Class::FileLeft)),
        (
            format!("{good}; echo >> study.toml"),
            Some(Class::InputChanged),
        ),
        (format!("{good}; rm study.toml"), Some(Class::InputChanged)),
        (format!("{good}; echo no >&2; exit 2"), Some(Class::Result)),
        ("exit 0".to_owned(), Some(Class::Result)),
        (
            "printf 't,x\\n0,1,2\\n' > r.csv".to_owned(),
            Some(Class::Shape),
        ),
        (
            "printf 't,x\\n0,NaN\\n' > r.csv".to_owned(),
            Some(Class::NotANumber),
        ),
        (
            "printf 't,x\\n0,inf\\n' > r.csv".to_owned(),
            Some(Class::NotANumber),
        ),
        (
            "printf 't,x,x\\n0,1,2\\n' > r.csv".to_owned(),
            Some(Class::HeaderTwice),
        ),
    ];
    for (i, (script, expected)) in cases.iter().enumerate() {
        assert_eq!(found(&i.to_string(), script), *expected, "{script}");
    }
}

#[test]
fn pictures_and_objects_are_read() {
    let class = |form, text: &str| shape::judge(form, text.as_bytes()).map(|f| f.class);
    let good = "<svg a=\"1\">\n<title>a &lt; b</title><path d=\"M1\"/></svg>\n";
    assert_eq!(class(Form::Svg, good), None);
    for bad in [
        good.replace("&lt;", "\u{7}"),
        good.replace("&lt;", "&"),
        good.replace("</title>", ""),
        good.replace("</svg>", ""),
    ] {
        assert_eq!(class(Form::Svg, &bad), Some(Class::Shape), "{bad}");
    }
    let bad = good.replace("M1", "NaN");
    assert_eq!(class(Form::Svg, &bad), Some(Class::NotANumber));
    assert_eq!(class(Form::Json, "{}"), None);
    assert_eq!(class(Form::Json, "{\"a\": NaN}"), Some(Class::Shape));
}

/// The same search as `cargo xtask attack`, short.
#[test]
fn a_short_attack_finds_nothing() {
    let folder = folder("short");
    let options = Options {
        folder: folder.clone(),
        count: 400,
        ..Options::read(&[]).unwrap()
    };
    let report = super::search(&options).unwrap();
    let kept = folder.display();
    assert!(report.is_empty(), "kept under {kept}:\n{}", report.text());
    assert!(report.runs() > 40, "{}", report.text());
    std::fs::remove_dir_all(folder).unwrap();
}
