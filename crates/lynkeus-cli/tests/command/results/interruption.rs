//! A run that is ended from outside, at any moment, leaves the old file or the new one.
#![cfg(unix)]

use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::Folder;

const SIGNALS: [&str; 4] = ["INT", "TERM", "HUP", "KILL"];

fn start(folder: &Folder, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .current_dir(&folder.path)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn kill(child: &Child, signal: &str) {
    let id = child.id().to_string();
    let status = Command::new("kill").args(["-s", signal, &id]).status();
    // it may have ended by itself
    let _ = status.unwrap();
}

fn left_over(folder: &Folder) -> Vec<String> {
    let files = folder.files().into_iter();
    files.filter(|name| name.starts_with(".lynkeus-")).collect()
}

/// Kills the command at `times` moments spread over its run; `file` is what it writes over `old`.
fn never_a_mixture(folder: &Folder, arguments: &[&str], file: &str, old: &str, times: u32) {
    folder.write(file, old);
    let since = Instant::now();
    assert!(start(folder, arguments).wait().unwrap().success());
    let whole = since.elapsed();
    let new = folder.read(file);
    assert_ne!(new, old);
    for i in 0..times {
        folder.write(file, old);
        let signal = SIGNALS[i as usize % SIGNALS.len()];
        let before = left_over(folder);
        let mut child = start(folder, arguments);
        // Weyl's sequence: spread evenly, in no order
        let share = (f64::from(i) * 0.618_034).fract();
        std::thread::sleep(whole.mul_f64(1.1 * share));
        kill(&child, signal);
        child.wait().unwrap();
        let found = folder.read(file);
        assert!(
            found == old || found == new,
            "{signal} after {share}: a mixture"
        );
        let left = left_over(folder);
        let new_ones = left.iter().filter(|name| !before.contains(name)).count();
        let most = usize::from(signal == "KILL");
        assert!(new_ones <= most, "{signal} after {share}: {left:?}");
    }
    folder.write(file, old);
    assert!(start(folder, arguments).wait().unwrap().success());
    assert_eq!(left_over(folder), Vec::<String>::new());
}

fn at_any_moment(times: u32) {
    let folder = Folder::new();
    let estimate = ["estimate", "study.toml", "log.csv", "-o", "e.csv"];
    never_a_mixture(&folder, &estimate, "e.csv", "old\n", times);
    let study = folder.read("study.toml");
    let tune = ["tune", "study.toml", "--write", "-q"];
    never_a_mixture(&folder, &tune, "study.toml", &study, times);
}

#[test]
fn a_killed_run_leaves_the_old_file_or_the_new_one() {
    at_any_moment(16);
}

/// `cargo test -p lynkeus --test command -- --ignored`
#[test]
#[ignore = "takes minutes"]
fn two_hundred_killed_runs_leave_the_old_file_or_the_new_one() {
    at_any_moment(200);
}

#[test]
fn what_a_killed_run_left_is_removed_by_the_next() {
    let folder = Folder::new();
    folder.write(".lynkeus-0123456789.part", "left");
    // not ours: another pattern, and one that is being written
    folder.write(".lynkeus-notes", "mine");
    folder.write(".lynkeus-abcdefghij.part", "another run's");
    let path = folder.path.path().join(".lynkeus-abcdefghij.part");
    let other = std::fs::File::open(path).unwrap();
    other.try_lock().unwrap();
    let ended = folder.run(&["design", "study.toml", "-o", "d.txt"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(
        left_over(&folder),
        [".lynkeus-abcdefghij.part", ".lynkeus-notes"]
    );
}

/// A computation that looks at no flag, and one that does: both end within a second, by the signal.
#[test]
fn a_signal_ends_a_long_run_within_a_second() {
    use std::os::unix::process::ExitStatusExt;
    let folder = Folder::new();
    let text = folder
        .read("study.toml")
        .replace("output_step = ", "output_step = 1e-4 # ");
    folder.write("study.toml", &text);
    let simulate = ["simulate", "study.toml", "-o", "s.csv"];
    // its input never comes
    let waiting = ["check", "-"];
    for (signal, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        if is_ignored(number) {
            println!("skipped: {signal} is ignored here, as under nohup");
            continue;
        }
        for arguments in [&simulate[..], &waiting] {
            in_time(|| {
                let mut child = start(&folder, arguments);
                std::thread::sleep(Duration::from_millis(300));
                kill(&child, signal);
                let since = Instant::now();
                let status = ended(&mut child);
                assert_eq!(status.signal(), Some(number), "{status:?}");
                since.elapsed()
            });
        }
    }
    assert_eq!(folder.files(), ["log.csv", "study.toml", "two_tanks.mo"]);
}

/// Within a second, at least once of a few times: the machine may be busy.
#[track_caller]
fn in_time(mut attempt: impl FnMut() -> Duration) {
    let took: Vec<_> = (0..4)
        .map(|_| attempt())
        .take_while(|time| *time >= Duration::from_secs(1))
        .collect();
    assert!(took.len() < 4, "{took:?}");
}

/// What this process ignores its children do, too.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Waits with standard input open: `wait` would close it.
fn ended(child: &mut Child) -> ExitStatus {
    loop {
        match child.try_wait().unwrap() {
            Some(status) => return status,
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// What was being done, and for how long, is told; no file is written.
#[test]
fn an_interrupt_is_told_with_what_was_being_done() {
    use std::os::unix::process::ExitStatusExt;
    let folder = Folder::empty();
    folder.write("m.mo", &crate::limits::dense(60));
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\n[observer]\nfamily = \"drift-observable\"\n",
    );
    let cases = [
        (&["check", "s.toml"][..], "examining"),
        (&["design", "s.toml", "-o", "d.txt"], "designing"),
        (&["certify", "s.toml", "-o", "c.txt"], "certifying"),
    ];
    for (arguments, what) in cases {
        in_time(|| {
            let child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
                .args(arguments)
                .args(["--time-limit", "1e6", "--memory-limit", "1000000"])
                .current_dir(folder.path.path())
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(400));
            kill(&child, "INT");
            let since = Instant::now();
            let output = child.wait_with_output().unwrap();
            let took = since.elapsed();
            assert_eq!(output.status.signal(), Some(2), "{what}");
            let told = String::from_utf8(output.stderr).unwrap();
            let expected = format!("interrupted by SIGINT after {what} for ");
            assert!(told.starts_with(&expected), "{told}");
            assert!(told.contains("no file was written"), "{told}");
            took
        });
    }
    assert_eq!(folder.files(), ["m.mo", "s.toml"]);
}
