//! No result replaces what it was made from or another result, and none is ever half-written.

#[cfg(unix)]
mod checkpoint;
mod interruption;
mod standard;

use crate::Folder;

/// What every file of a folder holds.
fn contents(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let read = |name: String| {
        let bytes = std::fs::read(folder.path.path().join(&name)).unwrap();
        (name, bytes)
    };
    folder.files().into_iter().map(read).collect()
}

/// Refused with exit code 2 and these words, and no file is changed or new.
#[track_caller]
fn refused(folder: &Folder, arguments: &[&str], words: &[&str]) {
    let before = contents(folder);
    let ended = folder.run(arguments);
    assert_eq!(ended.code, 2, "{arguments:?}: {}", ended.err);
    assert_eq!(ended.out, "", "{arguments:?}");
    assert!(contents(folder) == before, "{arguments:?} changed a file");
    for word in words {
        assert!(ended.err.contains(word), "no {word:?} in: {}", ended.err);
    }
}

#[test]
fn no_result_replaces_an_input() {
    let folder = Folder::new();
    let estimate = ["estimate", "study.toml", "log.csv"];
    for (option, file, role) in [
        ("-o", "log.csv", "the log"),
        ("-o", "./log.csv", "the log"),
        ("--plot", "study.toml", "the study"),
        ("-o", "two_tanks.mo", "the model"),
    ] {
        let arguments = [&estimate[..], &[option, file]].concat();
        refused(&folder, &arguments, &[option, role, "another name"]);
    }
    for command in ["simulate", "design", "certify"] {
        refused(
            &folder,
            &[command, "study.toml", "-o", "study.toml"],
            &["the study"],
        );
    }
    refused(
        &folder,
        &["check", "study.toml", "--singular", "two_tanks.mo"],
        &["--singular", "the model"],
    );
    refused(
        &folder,
        &["check", "study.toml", "--how-well", "-o", "study.toml"],
        &["the study"],
    );
    refused(
        &folder,
        &[
            "tune",
            "study.toml",
            "--log",
            "log.csv",
            "--plot",
            "log.csv",
        ],
        &["the log"],
    );
}

#[test]
fn no_result_replaces_another() {
    let folder = Folder::new();
    let simulate = ["simulate", "study.toml"];
    for options in [
        ["-o", "a.csv", "--plot", "a.csv"],
        ["-o", "a.csv", "--log", "./a.csv"],
        ["--log", "a", "--plot", "a"],
    ] {
        let arguments = [&simulate[..], &options].concat();
        refused(&folder, &arguments, &["would write the same file"]);
    }
    for option in ["-o", "--plot"] {
        refused(
            &folder,
            &["tune", "study.toml", "--write", option, "study.toml"],
            &["--write study.toml", "would write the same file"],
        );
    }
}

#[cfg(unix)]
#[test]
fn links_do_not_hide_that_it_is_the_same_file() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new();
    let at = |name: &str| folder.path.path().join(name);
    symlink("log.csv", at("soft.csv")).unwrap();
    std::fs::hard_link(at("log.csv"), at("hard.csv")).unwrap();
    symlink("new.csv", at("to-come.csv")).unwrap();
    symlink(".", at("here")).unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        let ended = folder.run(arguments);
        assert_eq!(ended.code, 2, "{arguments:?}");
        assert!(words.iter().all(|w| ended.err.contains(w)), "{}", ended.err);
    };
    let log = folder.read("log.csv");
    for name in ["soft.csv", "hard.csv", "here/log.csv"] {
        refused(
            &["estimate", "study.toml", "log.csv", "-o", name],
            &["log.csv", "the same file"],
        );
    }
    let simulate = ["simulate", "study.toml", "-o", "new.csv"];
    for name in ["to-come.csv", "here/new.csv", "here/to-come.csv"] {
        refused(
            &[&simulate[..], &["--log", name]].concat(),
            &["the same file"],
        );
    }
    assert_eq!(folder.read("log.csv"), log);
    assert!(!at("new.csv").exists());

    // a link is not replaced, what it leads to is
    let ended = folder.run(&["simulate", "study.toml", "-o", "here/to-come.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(at("to-come.csv").is_symlink());
    assert!(folder.read("new.csv").starts_with("t,"));
}

#[cfg(unix)]
#[test]
fn permissions_are_kept_and_obeyed() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let at = |name: &str| folder.path.path().join(name);
    let mode = |name: &str| at(name).metadata().unwrap().permissions().mode() & 0o777;
    let allow = |name: &str, mode: u32| {
        std::fs::set_permissions(at(name), std::fs::Permissions::from_mode(mode)).unwrap();
    };
    let run = |mask: &str, file: &str| {
        let lynkeus = env!("CARGO_BIN_EXE_lynkeus");
        let script = format!("umask {mask}; exec '{lynkeus}' design study.toml -o {file}");
        let mut shell = std::process::Command::new("sh");
        let status = shell
            .args(["-c", &script])
            .current_dir(&folder.path)
            .status();
        assert!(status.unwrap().success());
    };
    run("077", "private.txt");
    run("022", "public.txt");
    assert_eq!((mode("private.txt"), mode("public.txt")), (0o600, 0o644));
    allow("private.txt", 0o664);
    run("077", "private.txt");
    assert_eq!(mode("private.txt"), 0o664);

    allow("public.txt", 0o444);
    refused(
        &folder,
        &["design", "study.toml", "-o", "public.txt"],
        &["read-only"],
    );
    // the file that it is asked to change is changed where the user's rights do, and keeps its mark
    allow("study.toml", 0o444);
    let before = folder.read("study.toml");
    let may = std::fs::OpenOptions::new()
        .write(true)
        .open(at("study.toml"));
    match may {
        Ok(_) => {
            let ended = folder.run(&["tune", "study.toml", "--write"]);
            assert_eq!(ended.code, 0, "{}", ended.err);
            assert_ne!(folder.read("study.toml"), before);
        }
        Err(_) => refused(
            &folder,
            &["tune", "study.toml", "--write"],
            &["study.toml", "cannot write"],
        ),
    }
    assert_eq!(mode("study.toml"), 0o444);
}

/// Before anything is computed: the study cannot be run, and that is not what is told.
#[test]
fn what_cannot_be_written_is_told_first() {
    let folder = Folder::new();
    folder.change("two_tanks.mo", "der(", "no_such_function(");
    let design = |file: &str, words: &[&str]| {
        refused(&folder, &["design", "study.toml", "-o", file], words);
    };
    design(
        "missing/a.txt",
        &["error: cannot write missing/a.txt: there is no folder missing"],
    );
    std::fs::create_dir(folder.path.path().join("b")).unwrap();
    let ended = folder.run(&["design", "study.toml", "-o", "b"]);
    assert!(ended.err.contains("it is a folder"), "{}", ended.err);
    let ended = folder.run(&["design", "study.toml", "-o", "b/"]);
    assert!(ended.err.contains("it is a folder"), "{}", ended.err);
}

/// One result fails, so none is there.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing() {
    let folder = Folder::new();
    folder.write("old.csv", "old");
    let before = contents(&folder);
    let lynkeus = env!("CARGO_BIN_EXE_lynkeus");
    let script =
        format!("ulimit -f 8; exec '{lynkeus}' simulate study.toml --log new.csv -o old.csv");
    let mut shell = std::process::Command::new("bash");
    let output = shell
        .args(["-c", &script])
        .current_dir(&folder.path)
        .output();
    let ended = crate::Ended::new(&output.unwrap());
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.starts_with("error: cannot write "),
        "{}",
        ended.err
    );
    assert_eq!(ended.err.lines().count(), 1, "{}", ended.err);
    assert!(!ended.err.contains(".lynkeus-"), "{}", ended.err);
    assert!(contents(&folder) == before);
}

#[test]
fn a_study_keeps_its_line_ends() {
    let folder = Folder::new();
    let text = folder.read("study.toml");
    let text = format!("\u{feff}{}", text.replace('\n', "\r\n"));
    folder.write("study.toml", &text);
    let ended = folder.run(&["tune", "study.toml", "--write", "-q"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let new = folder.read("study.toml");
    let changed: Vec<_> = text
        .split('\n')
        .zip(new.split('\n'))
        .filter(|(a, b)| a != b)
        .collect();
    assert_eq!(text.split('\n').count(), new.split('\n').count());
    assert_eq!(changed.len(), 1, "{changed:?}");
    assert!(
        changed[0].1.contains("theta") && changed[0].1.ends_with('\r'),
        "{changed:?}"
    );
}

/// A picture is SVG whatever it is called, and a checkpoint is no stream.
#[test]
fn names_that_say_something_else_are_refused() {
    let folder = Folder::new();
    for name in ["a.png", "a.svg.pdf"] {
        for command in [
            &["estimate", "study.toml", "log.csv", "--plot", name][..],
            &["check", "study.toml", "--singular", name],
            &["check", "study.toml", "--plot", name],
        ] {
            refused(&folder, command, &["pictures are SVG", name]);
        }
    }
    let stream = [
        "estimate",
        "study.toml",
        "log.csv",
        "-o",
        "e.csv",
        "--checkpoint",
        "-",
    ];
    refused(&folder, &stream, &["--checkpoint needs a file"]);
    refused(
        &folder,
        &["simulate", "two_tanks.mo"],
        &[
            "expected a study (TOML), found a model",
            "lynkeus check two_tanks.mo",
        ],
    );
    for name in ["picture", "A.SVG"] {
        let ended = folder.run(&["estimate", "study.toml", "log.csv", "--plot", name]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        assert!(folder.read(name).starts_with("<svg"));
    }
}
