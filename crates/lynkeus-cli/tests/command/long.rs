//! Logs that are longer than memory should have to be.

use std::fmt::Write as _;
use std::process::{Command, Stdio};

use crate::Folder;

/// A log of the two tanks: a slow wave with noise, so that no two rows are alike.
fn log(rows: usize) -> String {
    let mut text = "t,level,pump\n".to_owned();
    let mut state = 7_u64;
    for k in 0..rows {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let noise = (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
        let wave = (k as f64 * 4.0 / 900.0).sin();
        let (level, pump) = (5.0 + 1.2 * wave + 0.05 * noise, 3.0 + 0.5 * wave);
        writeln!(text, "{},{level:.6},{pump:.4}", 4 * k).unwrap();
    }
    text
}

/// The tanks with steps as long as the readings allow: rows are looked at here, not digits.
fn tanks() -> Folder {
    let folder = Folder::new();
    folder.change("study.toml", "substeps = 16", "substeps = 2");
    folder
}

/// The most memory that a run held, in KiB, as far as looking at it every few milliseconds tells.
#[cfg(target_os = "linux")]
fn peak(folder: &Folder, arguments: &[&str]) -> u64 {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .current_dir(folder.path.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let size = line.and_then(|line| line.trim().strip_suffix("kB"));
        peak = size.map_or(peak, |size| size.trim().parse().unwrap());
        if let Some(status) = child.try_wait().unwrap() {
            assert_eq!(status.code(), Some(0), "{arguments:?}");
            return peak;
        }
        std::thread::sleep(std::time::Duration::from_millis(3));
    }
}

/// The result has 56 bytes a row, and the log 24: none of it is held.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_rows() {
    const SHORT: usize = 70_000;
    const LONG: usize = 240_000;
    let folder = tanks();
    let columns = ["t", "level", "pump"];
    let peaks = |rows: usize| {
        folder.write("log.csv", &log(rows));
        let table = lynkeus::Table::load(folder.path.path().join("log.csv")).unwrap();
        let of = |name| (name, table.readings(name).unwrap());
        let mut file = std::fs::File::create(folder.path.path().join("log.parquet")).unwrap();
        lynkeus::table::write_parquet(&mut file, &columns.map(of)).unwrap();
        [
            ["log.csv", "out.csv"],
            ["log.parquet", "out.parquet"],
            ["log.csv", "-"],
        ]
        .map(|[log, out]| peak(&folder, &["estimate", "study.toml", log, "-o", out]))
    };
    let (short, long) = (peaks(SHORT), peaks(LONG));
    assert_eq!(folder.read("out.csv").lines().count(), LONG + 1);
    for (short, long) in short.into_iter().zip(long) {
        // 9 MiB more where the result were held
        assert!(long < short + 6 * 1024, "{short} KiB and {long} KiB");
    }
}

#[test]
fn a_long_log_from_a_pipe_gives_the_same() {
    let folder = tanks();
    folder.write("log.csv", &log(70_000));
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-q", "-o", "out.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let piped = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(["estimate", "study.toml", "-", "-q", "-o", "-"])
        .current_dir(folder.path.path())
        .stdin(std::fs::File::open(folder.path.path().join("log.csv")).unwrap())
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    assert!(piped.status.success());
    assert!(piped.stdout == folder.read("out.csv").into_bytes());
    // the rows of a long log that is cut are those of the whole
    let cut = folder
        .read("log.csv")
        .lines()
        .take(40_001)
        .fold(String::new(), |text, line| text + line + "\n");
    folder.write("log.csv", &cut);
    folder.change("study.toml", "\"linear\"", "\"hold\"");
    let hold = |name: &str| {
        let ended = folder.run(&["estimate", "study.toml", "log.csv", "-q", "-o", name]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        folder.read(name)
    };
    let part = hold("part.csv");
    folder.write("log.csv", &log(70_000));
    assert!(hold("whole.csv").starts_with(&part));
}

#[test]
fn a_fault_far_down_is_told_by_its_line_and_nothing_is_written() {
    let folder = tanks();
    let mut text = log(150_000);
    text.push_str("600000,5.1\n600004,5.1,3\n");
    folder.write("log.csv", &text);
    let before = folder.files();
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 2);
    assert_eq!(
        ended.err.trim_end(),
        "error: log.csv:150002: expected 3 cells as in the header, found 2"
    );
    assert_eq!(folder.files(), before);
    // a time that repeats, where the study is strict
    folder.write("log.csv", &(log(100_000) + "399996,5,3\n"));
    folder.change("study.toml", "[estimate]", "[estimate]\nstrict = true");
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended
            .err
            .starts_with("error: log.csv:100002: time must increase")
            && ended.err.contains("= 399996 after 399996 in line 100001"),
        "{}",
        ended.err
    );
    assert_eq!(folder.files(), before);
}

/// What comes late in a log, and what is missing, over the ends of what is read at a time.
#[test]
fn late_rows_and_gaps_far_down_find_their_places() {
    let folder = tanks();
    let text = log(70_000);
    let mut rows: Vec<&str> = text.lines().collect();
    rows.swap(32_768, 32_770);
    rows.swap(65_536, 65_537);
    let silent = |(k, row): (usize, &&str)| match (k % 11, row.split_once(',')) {
        (3, Some((t, rest))) if k > 0 => {
            let pump = rest.split_once(',').map_or("", |(_, pump)| pump);
            format!("{t},,{pump}\n")
        }
        _ => format!("{row}\n"),
    };
    let faulty: String = rows.iter().enumerate().map(silent).collect();
    folder.write("faulty.csv", &faulty);
    let mut rows: Vec<&str> = faulty.lines().collect();
    rows[1..].sort_by_key(|row| row.split(',').next().unwrap().parse::<u64>().unwrap());
    folder.write("sorted.csv", &(rows.join("\n") + "\n"));
    let estimated = |log: &str| {
        let ended = folder.run(&["estimate", "study.toml", log, "-o", "out.csv"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        (folder.read("out.csv"), ended.err)
    };
    let (faulty, told) = estimated("faulty.csv");
    let late = "rows of the log that came late and were put in their place: 3";
    assert!(told.contains(late), "{told}");
    assert!(faulty == estimated("sorted.csv").0);
}
