//! Structured Text of `export --to st`: read by a grammar of others, checked for what controllers are strict
//! about, made C and run.

mod compiler;

use std::path::Path;
use std::process::Command;

use self::compiler::compiled;
use super::names::{HOSTILE, HOSTILE_STUDY, hostile_log};
use super::{Looked, Run, difference, estimated, has};
use crate::{Folder, skipped};

/// A log through the block: time first, then the signals in their order.
const REPLAY: &str = r#"
int main(int count, char **arguments)
{
    static char line[65536];
    (void)count;
    FILE *log = fopen(arguments[1], "r");
    if (log == NULL || fgets(line, sizeof line, log) == NULL) {
        return 2;
    }
    while (fgets(line, sizeof line, log) != NULL) {
        char *rest = line;
        double cells[1 + SIGNALS];
        for (int i = 0; i <= SIGNALS; i++) {
            const size_t length = strcspn(rest, ",\n");
            cells[i] = length == 0 ? NAN : strtod(rest, NULL);
            rest += length + (rest[length] == ',' ? 1 : 0);
        }
        give(cells);
        block(&it);
        if (it.v_code != 0) {
            return 1;
        }
        tell(cells[0]);
    }
    return 0;
}
"#;

/// Whether functions of the library are called that are computed otherwise than in C's.
fn calls_functions(text: &str) -> bool {
    ["_sinh(", "_cosh(", "_tanh(", "_atan2("]
        .iter()
        .any(|call| text.contains(call))
}

/// What is exported to `st`, and how it is compiled.
fn exported(folder: &Folder, more: &[&str]) -> String {
    let arguments = [
        &[
            "export", "s.toml", "--to", "st", "-o", "st", "-q", "--force",
        ],
        more,
    ]
    .concat();
    let made = folder.run(&arguments);
    assert_eq!(made.code, 0, "{}", made.err);
    let files = std::fs::read_dir(folder.path.path().join("st")).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    let name = names
        .filter(|name| name != "example.st")
        .collect::<Vec<_>>();
    assert_eq!(name.len(), 1, "{name:?}");
    let text = folder.read(&format!("st/{}", name[0]));
    // the example must be a program of the same language
    let example = folder.read("st/example.st");
    let _ = compiled(&format!("{text}\n{example}"));
    text
}

/// The log with its columns in the order of the block's signals, where these are called like columns.
fn ordered(log: &str, text: &str) -> String {
    let words = text
        .lines()
        .filter_map(|line| line.trim().split_once("_valid : BOOL"));
    let signals: Vec<&str> = words.map(|words| words.0).collect();
    let header: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let place = |signal: &&str| header.iter().position(|name| name == signal);
    let places: Option<Vec<usize>> = signals.iter().map(place).collect();
    let Some(places) = places else {
        assert_eq!(header.len(), 1 + signals.len(), "{header:?} {signals:?}");
        return log.to_owned();
    };
    let rows = log.lines().map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        let cells = std::iter::once(cells[0]).chain(places.iter().map(|place| cells[*place]));
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    rows.collect()
}

/// The log through the block; where the header is that of what is expected.
fn replayed(path: &Path, text: &str, header: &[String]) -> Run {
    let code = compiled(text) + REPLAY;
    std::fs::write(path.join("st.c"), code).unwrap();
    let mut gcc = Command::new("gcc");
    gcc.args(["-O0", "-std=c11", "-ffp-contract=off"]);
    gcc.args(["-fsanitize=undefined", "-o", "st_replay", "st.c", "-lm"]);
    let ended = gcc.current_dir(path).output().unwrap();
    assert!(
        ended.status.success(),
        "{}",
        String::from_utf8_lossy(&ended.stderr)
    );
    let log = std::fs::read_to_string(path.join("log.csv")).unwrap();
    std::fs::write(path.join("st.csv"), ordered(&log, text)).unwrap();
    let mut replay = Command::new(path.join("st_replay"));
    let ended = replay.arg(path.join("st.csv")).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(told.is_empty() && ended.status.code() != Some(2), "{told}");
    let found = String::from_utf8(ended.stdout).unwrap();
    let (_, rows) = crate::csv(&format!("{}\n{found}", header.join(",")));
    (header.to_vec(), rows, ended.status.success())
}

/// Against what `estimate` gives.
pub(super) fn check(looked: &Looked) {
    let text = exported(&looked.folder, &[]);
    let found = replayed(looked.folder.path.path(), &text, &looked.expected.0);
    looked.compare(found, "Structured Text", calls_functions(&text));
}

#[test]
fn any_name_can_stand_in_a_controller() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.write("m.mo", HOSTILE);
    folder.write("s.toml", HOSTILE_STUDY);
    folder.write("log.csv", &hostile_log());
    let expected = estimated(folder.path.path()).unwrap();
    let text = exported(&folder, &[]);
    let off = difference(
        &expected,
        &replayed(folder.path.path(), &text, &expected.0),
        "",
    );
    assert!(off <= 1e-12, "{off:e}");
    // what is tunable, and numbers of another type
    let text = exported(&folder, &["--tunable", "--precision", "f32"]);
    let off = difference(
        &expected,
        &replayed(folder.path.path(), &text, &expected.0),
        "",
    );
    assert!(off <= 1e-4, "{off:e}");
}
