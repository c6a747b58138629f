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

/// The export with such a main function, as the program `st_replay`.
pub(super) fn program(folder: &Folder, main: &str) {
    made(folder.path.path(), &exported(folder, &[]), main);
}

/// The text as a program with such a main function.
fn made(path: &Path, text: &str, main: &str) {
    std::fs::write(path.join("st.c"), compiled(text) + main).unwrap();
    let mut gcc = Command::new("gcc");
    gcc.args(["-O0", "-std=c11", "-ffp-contract=off"]);
    gcc.args(["-fsanitize=undefined", "-o", "st_replay", "st.c", "-lm"]);
    let ended = gcc.current_dir(path).output().unwrap();
    assert!(
        ended.status.success(),
        "{}",
        String::from_utf8_lossy(&ended.stderr)
    );
}

/// What that prints.
fn ran(path: &Path, text: &str, main: &str, arguments: &[&str]) -> (String, bool) {
    made(path, text, main);
    let mut program = Command::new(path.join("st_replay"));
    let ended = program.args(arguments).current_dir(path).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(told.is_empty() && ended.status.code() != Some(2), "{told}");
    (
        String::from_utf8(ended.stdout).unwrap(),
        ended.status.success(),
    )
}

/// The log through the block; where the header is that of what is expected.
fn replayed(path: &Path, text: &str, header: &[String]) -> Run {
    let log = std::fs::read_to_string(path.join("log.csv")).unwrap();
    std::fs::write(path.join("st.csv"), ordered(&log, text)).unwrap();
    let (found, is_whole) = ran(path, text, REPLAY, &["st.csv"]);
    let (_, rows) = crate::csv(&format!("{}\n{found}", header.join(",")));
    (header.to_vec(), rows, is_whole)
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

/// A study of a small plant.
fn small(folder: &Folder, model: &str) {
    folder.write(
        "m.mo",
        &format!(
            "model {model}\n  Real m_reals_2(start = 1, max = 1e60);\n  Real m_solve_2(start = 0.5);\n  Real bit;\n  \
             Real m_counts_3;\n  output Real m_undefined = m_reals_2;\n  output Real m_take = m_solve_2;\nequation\n  \
             der(m_reals_2) = m_solve_2 - m_reals_2;\n  der(m_solve_2) = bit - m_solve_2;\n  2*bit + m_counts_3 = 1e-40;\n  \
             bit - m_reals_2*m_counts_3 = 0.1;\nend {model};\n"
        ),
    );
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\nsensors = { measured = [\"m_undefined\", \"m_take\"], noise = { m_undefined = 1e-20, m_take = 0.1 } }\n\
         process_noise = { m_reals_2 = 0.01, m_solve_2 = 0.01 }\nobserver = { family = \"ekf\" }\n\
         estimate = { method = \"rk4\", step = 0.05 }\n",
    );
}

#[test]
fn a_model_may_be_called_like_anything_in_its_block() {
    let folder = Folder::empty();
    for model in [
        "M",
        "S",
        "T",
        "Signals",
        "Estimates",
        "Estimator",
        "Cycle",
        "Code",
        "Example",
        "Step",
        "Var",
    ] {
        small(&folder, model);
        for more in [&[][..], &["--tunable", "--precision", "f32"]] {
            std::fs::remove_dir_all(folder.path.path().join("st")).unwrap_or_default();
            let _ = exported(&folder, more);
        }
    }
}

/// What is printed: the code and the first estimate of each call.
const CALLS: &str = r#"
static void call(double t, double reading, int restart)
{
    double cells[3] = {t, reading, 0.2};
    give(cells);
    it.v_restart = restart;
    block(&it);
    printf("%d,%.17g\n", (int)it.v_code, (double)it.v_m_reals_2_hat);
}

int main(void)
{
    call(NAN, 1.0, 0);
    call(0.0, 1.0, 0);
    call(1.0, 0.9, 0);
    call(5.0, 0.8, 0);
    call(NAN, 0.8, 1);
    call(2.0, 0.8, 0);
    call(6.0, NAN, 0);
    call(0.0, 1.0, 1);
    call(1.0, 0.9, 1);
    call(5.0, 0.8, 0);
    return 0;
}
"#;

#[test]
fn a_restart_is_one_and_a_refused_one_is_none() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    small(&folder, "Tank");
    let text = exported(&folder, &[]);
    let (told, _) = ran(folder.path.path(), &text, CALLS, &[]);
    let calls: Vec<(&str, &str)> = told
        .lines()
        .map(|call| call.split_once(',').unwrap())
        .collect();
    let codes: Vec<&str> = calls.iter().map(|call| call.0).collect();
    assert_eq!(codes, ["1", "0", "0", "0", "1", "1", "0", "0", "0", "0"]);
    let [_, first, second, third, refused, back, missing, again @ ..] = &calls[..] else {
        panic!("{told}");
    };
    assert!(refused.1 == third.1 && back.1 == third.1 && missing.1 != third.1);
    assert_eq!(again, [*first, *second, *third]);
}
