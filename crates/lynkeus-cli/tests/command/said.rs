//! Whole texts and pages, beside files in `said/`. `SNAPSHOTS=overwrite` before `cargo test` writes them anew; what
//! has changed in them is then for a reader to judge.

use std::path::Path;

use crate::Folder;

/// The significant digits that are compared: what more there are may be another machine's.
const DIGITS: usize = 5;

/// The code, the words and the complaints of a command are those of `said/NAME.txt`.
#[track_caller]
pub fn said(folder: &Folder, name: &str, arguments: &[&str]) {
    let ended = folder.run(arguments);
    let mut text = format!("$ lynkeus {}\n{}", arguments.join(" "), ended.out);
    // progress is of a machine that is slow today
    let said = ended.err.split_inclusive('\n');
    let said: String = said.filter(|line| !line.ends_with(" s so far\n")).collect();
    if !said.is_empty() {
        text += &format!("--- standard error\n{said}");
    }
    if ended.code != 0 {
        text += &format!("--- exit code {}\n", ended.code);
    }
    same(&format!("{name}.txt"), &text);
}

/// The text is that of the file in `said/`, but for digits, times and versions.
#[track_caller]
pub fn same(file: &str, text: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/command/said");
    let (path, found) = (folder.join(file), redacted(text));
    if std::env::var_os("SNAPSHOTS").is_some_and(|asked| asked == "overwrite") {
        std::fs::write(&path, &found).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    // a line more on both sides, so that one that is missing differs
    let lines = |text: &str| -> Vec<String> {
        let lines = text.lines().map(str::to_owned);
        lines.chain(["(the end)".to_owned()]).collect()
    };
    let (expected, found) = (lines(&expected), lines(&found));
    let mut pairs = expected.iter().zip(&found).enumerate();
    if let Some((number, (expected, found))) = pairs.find(|(_, (a, b))| a != b) {
        panic!(
            "{}:{}\nexpected {expected}\nfound    {found}\n`SNAPSHOTS=overwrite` writes it anew: see then what has changed",
            path.display(),
            number + 1,
        );
    }
}

fn redacted(text: &str) -> String {
    let version = concat!("lynkeus ", env!("CARGO_PKG_VERSION"));
    let mut out = String::new();
    let mut has_times = false;
    let text = text.replace(version, "lynkeus [VERSION]");
    for line in text.lines() {
        has_times = !line.is_empty() && (has_times || line.ends_with("µs/sample"));
        // the last column, which is of this machine
        let line = match line.rsplit_once(' ') {
            Some((before, time)) if has_times && time.parse::<f64>().is_ok() => {
                format!("{} [TIME]", before.trim_end())
            }
            _ => line.to_owned(),
        };
        out += &rounded(&line);
        out.push('\n');
    }
    out
}

/// The line with its numbers rounded.
fn rounded(line: &str) -> String {
    let mut out = String::new();
    let mut rest = line;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, from) = rest.split_at(start);
        let is_name = before.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let end = from.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, after) = from.split_at(end.unwrap_or(from.len()));
        let digits = number.trim_start_matches(['0', '.']);
        let is_long = digits.chars().filter(char::is_ascii_digit).count() > DIGITS;
        out += before;
        match number.parse::<f64>() {
            Ok(value) if is_long && !is_name && number.contains('.') => {
                let short = format!("{value:.*e}", DIGITS - 1);
                out += &short.parse().unwrap_or(value).to_string();
            }
            _ => out += number,
        }
        rest = after;
    }
    out + rest
}

#[test]
fn digits_beyond_the_fifth_are_no_text() {
    for (line, expected) in [
        ("gain 0.14810506044125527 at", "gain 0.14811 at"),
        ("[0.0115154, 0.162853]", "[0.011515, 0.16285]"),
        ("0.09000000000000002, 12345678", "0.09, 12345678"),
        ("x1.2345678 and 5.", "x1.2345678 and 5."),
        ("2.7000000000000001e-5", "2.7e-5"),
    ] {
        assert_eq!(rounded(line), expected);
    }
    let table = "family  µs/sample\nekf  1.5       83\n\nekf 83\n";
    assert_eq!(
        redacted(table),
        "family  µs/sample\nekf  1.5 [TIME]\n\nekf 83\n"
    );
}
