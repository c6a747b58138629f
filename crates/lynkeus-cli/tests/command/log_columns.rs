//! `[log]`: columns of a log that are expressions of its headers, and how a log is written.

use crate::{Ended, Folder};

const PLANT: &str = "model Tank
  input Real u;
  Real level(start = 2, min = 0, max = 10);
  Real temp(start = 20, min = 0, max = 100);
  output Real y = level;
  output Real T = temp;
equation
  der(level) = u - 0.2*level;
  der(temp) = 0.1*(20 - temp);
end Tank;
";

/// A tank with this in its study.
fn tank(more: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", PLANT);
    folder.write(
        "study.toml",
        &format!(
            "plant = \"plant.mo\"\nprocess_noise = {{ level = 0.5, temp = 20 }}\n[observer]\nfamily = \"ekf\"\n[sensors]\nnoise = {{ y = 0.5, T = 5 }}\n{more}\n"
        ),
    );
    folder
}

/// Readings of which all numbers are exact in both units.
const ROWS: [(f64, f64, f64, f64); 5] = [
    (0.0, 2.0, 20.0, 0.5),
    (1.0, 2.25, 20.0, 0.5),
    (2.0, 2.5, 25.0, 0.75),
    (3.0, 2.25, 20.0, 0.5),
    (4.0, 2.0, 15.0, 0.25),
];

/// The log as the plant has it.
fn plain() -> String {
    let rows = ROWS.iter();
    let rows = rows.map(|(t, y, temp, u)| format!("{t},{y},{temp},{u}\n"));
    format!("t,y,T,u\n{}", rows.collect::<String>())
}

/// The same in milliseconds, per cent of two metres, °F and in two flows.
fn other() -> String {
    let rows = ROWS.iter();
    let rows = rows.map(|(t, y, temp, u)| {
        let (ms, share, fahrenheit) = (1000.0 * t, 50.0 * y, 1.8 * temp + 32.0);
        format!("{ms},{share},{fahrenheit},{},{}\n", u + 1.0, 1.0)
    });
    format!("ms,h,T degF,in,out\n{}", rows.collect::<String>())
}

const COLUMNS: &str = "time = \"ms/1000\"\ncolumns = { y = \"h/100*sqrt(4)\", T = \"('T degF' - 32)/1.8\", u = \"'in' - out\" }";

fn estimated(folder: &Folder) -> Ended {
    folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv"])
}

/// The estimates from a log under such a study.
fn estimates(more: &str, log: &str) -> String {
    let folder = tank(more);
    folder.write("log.csv", log);
    let ended = estimated(&folder);
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder.read("out.csv")
}

#[test]
fn expressions_of_columns_are_columns() {
    let expected = estimates("", &plain());
    assert_eq!(estimates(&format!("[log]\n{COLUMNS}"), &other()), expected);
    // as [estimate] had them
    assert_eq!(
        estimates(&format!("[estimate]\n{COLUMNS}"), &other()),
        expected
    );
    let both = COLUMNS.replacen("columns", "[estimate]\ncolumns", 1);
    assert_eq!(estimates(&format!("[log]\n{both}"), &other()), expected);
}

/// A header that may be read as an expression is a header.
#[test]
fn a_header_comes_before_an_expression() {
    let log = plain().replacen("t,y,T,u", "t,y-raw,T,u", 1);
    let study = "[log]\ncolumns = { y = \"y-raw\" }";
    assert_eq!(estimates(study, &log), estimates("", &plain()));
    // with columns y and raw beside it, too
    let more: String = log
        .lines()
        .enumerate()
        .map(|(k, row)| match k {
            0 => format!("{row},y,raw\n"),
            _ => format!("{row},7,8\n"),
        })
        .collect();
    assert_eq!(estimates(study, &more), estimates("", &plain()));
}

/// A log that a simulation writes is read under the same study.
#[test]
fn a_simulated_log_is_read_back() {
    let study =
        format!("[simulate]\nuntil = 4\noutput_step = 1\ninputs = {{ u = 0.5 }}\n[log]\n{COLUMNS}");
    let folder = tank(&study);
    let made = folder.run(&["simulate", "study.toml", "--log", "log.csv", "-q"]);
    assert_eq!(made.code, 0, "{}", made.err);
    assert!(folder.read("log.csv").starts_with("ms/1000,h/100*sqrt(4)"));
    let ended = estimated(&folder);
    assert_eq!(ended.code, 0, "{}", ended.err);
}

#[test]
fn a_cell_that_is_missing_or_has_no_value_makes_a_missing_one() {
    let log = "t,a,T,u\n0,4,20,0.5\n1,NA,20,0.5\n2,-1,20,0.5\n3,4,20,0.5\n";
    let folder = tank("[log]\ncolumns = { y = \"sqrt(a)\" }");
    folder.write("log.csv", log);
    let ended = estimated(&folder);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let told =
        "column \"sqrt(a)\": 2 of 4 cells are missing, first \"NA\" in line 3, \"NaN\" in line 4";
    assert!(ended.err.contains(told), "{}", ended.err);
    let gaps = "t,y,T,u\n0,2,20,0.5\n1,,20,0.5\n2,,20,0.5\n3,2,20,0.5\n";
    assert_eq!(folder.read("out.csv"), estimates("", gaps));
}

/// What is known of a state is an expression, too.
#[test]
fn truth_is_an_expression() {
    let log: String = plain()
        .lines()
        .enumerate()
        .map(|(k, row)| match k {
            0 => format!("{row},lab\n"),
            _ => format!("{row},{}\n", 36 + k),
        })
        .collect();
    let folder = tank("[log]\ncolumns = { temp = \"lab - 17\" }");
    folder.write("log.csv", &log);
    let ended = estimated(&folder);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let errors = |folder: &Folder| {
        let found = folder.run(&["estimate", "study.toml", "log.csv", "--json", "-o", "o.csv"]);
        found.json()["errors"].to_string()
    };
    let expected = tank("");
    expected.write(
        "log.csv",
        &plain()
            .lines()
            .enumerate()
            .map(|(k, row)| match k {
                0 => format!("{row},temp\n"),
                _ => format!("{row},{}\n", 19 + k),
            })
            .collect::<String>(),
    );
    assert!(errors(&folder).contains("temp"), "{}", errors(&folder));
    assert_eq!(errors(&folder), errors(&expected));
    // a log without it is one without truth, and says so
    folder.write("log.csv", &plain());
    let ended = estimated(&folder);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended.err.contains("no column \"lab - 17\""),
        "{}",
        ended.err
    );
}

/// Every command that reads a log reads it so.
#[test]
fn commands_agree_on_a_log_with_expressions() {
    for command in [
        &["tune", "study.toml", "--log", "log.csv", "--json"][..],
        &["compare", "study.toml", "log.csv", "--json"],
        &["fit", "study.toml", "log.csv", "--json"],
        &["report", "study.toml", "log.csv", "-o", "page.html"],
    ] {
        let sections = "[tune]\nkeys = { \"noise.y\" = [0.4, 0.6] }\nblocks = 2\n[fit]\nparameters = []\nnoise = [\"y\"]\n[compare]\nfamilies = [\"ekf\"]\n";
        let long = |log: String, scale: f64| -> String {
            // the rows again and again
            let (head, rows) = log.split_once('\n').unwrap();
            let mut text = format!("{head}\n");
            for k in 0..8 {
                for row in rows.lines() {
                    let (t, rest) = row.split_once(',').unwrap();
                    let t: f64 = t.parse().unwrap();
                    text += &format!("{},{rest}\n", t + scale * 5.0 * f64::from(k));
                }
            }
            text
        };
        let of = |more: &str, log: String| {
            let folder = tank(&format!("{sections}{more}"));
            folder.write("log.csv", &log);
            folder.run(command)
        };
        let found = of(&format!("[log]\n{COLUMNS}"), long(other(), 1000.0));
        let expected = of("", long(plain(), 1.0));
        assert!(expected.code < 2, "{command:?}: {}", expected.err);
        assert_eq!(found.code, expected.code, "{command:?}: {}", found.err);
        for (name, key) in [("tune", "rows"), ("fit", "nll")] {
            if command.contains(&name) {
                let [found, expected] = [found.json(), expected.json()];
                assert!(!expected[key].is_null(), "{expected}");
                assert_eq!(found[key], expected[key], "{command:?}");
            }
        }
    }
}

#[test]
fn what_is_no_column_is_told_with_its_place() {
    for (study, told, hint) in [
        (
            "columns = { T = \"(degF - 32)/1.8\" }",
            "study.toml:8:17: log.csv: no column \"(degF - 32)/1.8\", and as an expression it reads \"degF\", which is no column either; the columns found are: ms, h, deg_F, in, out",
            "did you mean \"deg_F\"?",
        ),
        (
            "columns = { T = \"(deg_F - 32/1.8\" }",
            "no column \"(deg_F - 32/1.8\", and it is no expression of columns: expression:1:16: ",
            "single quotes",
        ),
        (
            "columns = { T = \"4 + 5\" }",
            "as an expression it reads no column",
            "single quotes",
        ),
        (
            "time = \"ms\"\ncolumns = { y = \"h\", T = \"celsius\", u = \"in\" }",
            "log.csv: no column \"celsius\"; the columns found are",
            "",
        ),
        (
            "time = \"msec/1000\"\ncolumns = { T = \"deg_F\" }",
            "no column \"msec/1000\", and as an expression it reads \"msec\"",
            "did you mean \"ms\"?",
        ),
        (
            "columns = { z = \"deg_F\" }",
            "the plant 'Tank' has no output, input or state named \"z\"",
            "choose from",
        ),
        (
            "time = \"ms\"\n[estimate]\ntime = \"t\"",
            "study.toml:10:8: `time` is given in [log] (study.toml:8:8) and in [estimate]",
            "keep the one in [log]",
        ),
        (
            "columns = { T = \"a\" }\n[estimate]\ncolumns = { T = \"b\" }",
            "study.toml:10:13: \"T\" of `columns` is given in [log] (study.toml:8:13) and in [estimate]",
            "keep the one in [log]",
        ),
    ] {
        let folder = tank(&format!("[log]\n{study}"));
        folder.write("log.csv", &other().replacen("T degF", "deg_F", 1));
        let ended = estimated(&folder);
        assert_eq!(ended.code, 2, "{study}: {}", ended.err);
        for words in [told, hint] {
            assert!(ended.err.contains(words), "{study}: {}", ended.err);
        }
    }
}

/// Dates are times and no numbers.
#[test]
fn an_expression_of_dates_is_refused() {
    let folder = tank("[log]\ncolumns = { y = \"2*day\" }");
    folder.write(
        "log.csv",
        "t,day,T,u\n0,2026-01-01,20,1\n1,2026-01-02,20,1\n",
    );
    let ended = estimated(&folder);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("column \"day\" must hold numbers, found dates"),
        "{}",
        ended.err
    );
}

/// Dates beside a plant in hours are converted where `[log]` says so, as numbers in hours are read.
#[test]
fn dates_are_in_the_unit_of_the_plant() {
    let dated = |rows: &str| -> String {
        let rows = rows.lines().enumerate();
        let rows = rows.map(|(k, row)| match (k, row.split_once(',')) {
            (0, _) | (_, None) => format!("{row}\n"),
            (k, Some((_, rest))) => format!("2026-11-22T{:02}:00:00Z,{rest}\n", 5 + k),
        });
        rows.collect()
    };
    let expected = estimates("", &plain());
    for unit in ["h", "hours", "Hour"] {
        let folder = tank(&format!("[log]\ntime_unit = \"{unit}\""));
        folder.write("log.csv", &dated(&plain()));
        let ended = estimated(&folder);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let told = format!("times are in {unit} since 2026-11-22T06:00:00Z");
        assert!(ended.err.contains(&told), "{}", ended.err);
        assert_eq!(folder.read("out.csv"), expected);
        // numbers are in the plant's unit already
        folder.write("log.csv", &plain());
        assert_eq!(estimated(&folder).code, 0);
        assert_eq!(folder.read("out.csv"), expected);
    }
    let both = "[log]\ntime_unit = \"h\"\n[plot]\ntime_unit = \"hours\"";
    assert_eq!(estimates(both, &dated(&plain())), expected);
    // a row may be as late as `late` says in hours
    let mut rows: Vec<String> = dated(&plain()).lines().map(str::to_owned).collect();
    rows.swap(3, 4);
    let late = "[log]\ntime_unit = \"h\"\n[estimate]\nlate = 1.5";
    assert_eq!(estimates(late, &(rows.join("\n") + "\n")), expected);
}

#[test]
fn two_units_of_one_plant_are_refused() {
    for (study, told) in [
        (
            "[log]\ntime_unit = \"h\"\n[plot]\ntime_unit = \"min\"",
            "study.toml:8:13: `time_unit` of [log] says that the plant's time is in h, and that of [plot] in min",
        ),
        (
            "[log]\ntime_unit = \"fortnight\"",
            "must be a unit of time: ns, us, ms, s, min, h, d, week, year, found the text \"fortnight\"",
        ),
    ] {
        let folder = tank(study);
        folder.write("log.csv", &plain());
        let ended = estimated(&folder);
        assert_eq!(ended.code, 2, "{study}: {}", ended.err);
        assert!(ended.err.contains(told), "{study}: {}", ended.err);
    }
}

/// The log as a logger in Germany writes it.
const GERMAN: &str = "Anlage 7
erstellt: heute; von Hand

Zeit|y|T|u
22.11.2026 01:00:00|2,000|20|0,500
22.11.2026 01:00:01|2,250|20|0,500
22.11.2026 01:00:02|2,500|25|0,750
22.11.2026 01:00:03|2,250|20|0,500
22.11.2026 01:00:04|2,000|15|0,250
";

const WRITTEN: &str = "[log]\ntime = \"Zeit\"\ntime_format = \"%d.%m.%Y %H:%M:%S\"\ndecimal = \",\"\ndelimiter = \"|\"\nskip = 3";

#[test]
fn a_log_is_read_as_the_study_says_that_it_is_written() {
    let expected = estimates("", &plain());
    assert_eq!(estimates(WRITTEN, GERMAN), expected);
    // from standard input, too
    let folder = tank(WRITTEN);
    folder.write("log.csv", GERMAN);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lynkeus"));
    let ended = command
        .current_dir(folder.path.path())
        .args(["estimate", "study.toml", "-", "-o", "out.csv"])
        .stdin(std::fs::File::open(folder.path.path().join("log.csv")).unwrap())
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{err}");
    assert_eq!(folder.read("out.csv"), expected);
    let told = "times are seconds since 22.11.2026 01:00:00";
    assert!(err.contains(told), "{err}");
}

#[test]
fn what_is_written_otherwise_is_told_with_its_line() {
    for (from, to, told) in [
        (
            "22.11.2026 01:00:02",
            "2026-11-22 01:00:02",
            "log.csv:7: column \"Zeit\": expected a time like %d.%m.%Y %H:%M:%S, found \"2026-11-22 01:00:02\"",
        ),
        (
            "2,500",
            "2.5",
            "log.csv:7: column \"y\": expected a number, found \"2.5\"",
        ),
        (
            "25|0,750",
            "25;0,750",
            "log.csv:7: expected 4 cells as in the header, found 3",
        ),
    ] {
        let folder = tank(WRITTEN);
        folder.write("log.csv", &GERMAN.replacen(from, to, 1));
        let ended = estimated(&folder);
        assert_eq!(ended.code, 2, "{to}: {}", ended.err);
        assert!(ended.err.contains(told), "{to}: {}", ended.err);
    }
    for (key, told) in [
        ("time_format = \"%d.%Q\"", "a time in directives such as"),
        ("decimal = \"·\"", "must be one of \".\", \",\""),
        ("delimiter = \"ab\"", "one character between cells"),
        ("skip = -1", "a whole number of at least 0"),
    ] {
        let folder = tank(&format!("[log]\n{key}"));
        folder.write("log.csv", GERMAN);
        let ended = estimated(&folder);
        assert_eq!(ended.code, 2, "{key}: {}", ended.err);
        assert!(ended.err.contains(told), "{key}: {}", ended.err);
    }
}

/// `1,234` is a thousand and more where the point is decimal.
#[test]
fn the_decimal_mark_decides_what_nothing_else_does() {
    let log = |cell: &str| format!("t;y;T;u\n0;2;20;0\n1;2;20;0\n2;{cell};20;0\n");
    let plain = |cell: &str| estimates("", &log(cell));
    let with =
        |mark: &str, cell: &str| estimates(&format!("[log]\ndecimal = \"{mark}\""), &log(cell));
    assert_eq!(with(",", "2,125"), plain("2.125"));
    assert_eq!(with(".", "2.125"), plain("2.125"));
    assert_eq!(with(".", "2.5e0"), plain("2.5"));
}

/// Of a Parquet file the columns are read that expressions read; how a CSV file is written does not hold for it.
#[test]
fn a_parquet_file_has_what_expressions_read() {
    let simulate = "[simulate]\nuntil = 4\noutput_step = 1\ninputs = { u = 0.5 }\n";
    let folder = tank(simulate);
    let made = folder.run(&["simulate", "study.toml", "--log", "log.parquet", "-q"]);
    assert_eq!(made.code, 0, "{}", made.err);
    let of = |more: &str| {
        let other = tank(more);
        let log = folder.path.path().join("log.parquet");
        std::fs::copy(log, other.path.path().join("log.parquet")).unwrap();
        let ended = other.run(&["estimate", "study.toml", "log.parquet"]);
        (ended.code, ended.out, ended.err)
    };
    // y has its readings of T, so that T is not asked for under its own name alone
    let turned = "[log]\ntime = \"t*1\"\ncolumns = { y = \"T + 0\", T = \"y/1\" }";
    let plain = "[log]\ncolumns = { y = \"T\", T = \"y\" }";
    let (found, expected) = (of(turned), of(plain));
    assert_eq!(
        (found.0, &found.1),
        (expected.0, &expected.1),
        "{}",
        found.2
    );
    let (code, _, err) = of("[log]\nskip = 1");
    assert_eq!(code, 2);
    assert!(err.contains("found a Parquet file"), "{err}");
}

#[test]
fn a_first_column_without_a_name_is_time() {
    let expected = estimates("", &plain());
    for header in ["", "Unnamed: 0"] {
        let log = plain().replacen('t', header, 1);
        let folder = tank("");
        folder.write("log.csv", &log);
        let ended = estimated(&folder);
        assert_eq!(ended.code, 0, "{}", ended.err);
        assert!(ended.err.contains("column without a name"), "{}", ended.err);
        assert_eq!(folder.read("out.csv"), expected);
        // not where the study says which it is, nor where there is one
        let folder = tank("[log]\ntime = \"clock\"");
        folder.write("log.csv", &log);
        let ended = estimated(&folder);
        assert!(
            ended.err.contains("no time column \"clock\""),
            "{}",
            ended.err
        );
    }
    let log = plain();
    let indexed: String = log
        .lines()
        .enumerate()
        .map(|(k, row)| match k {
            0 => format!(",{row}\n"),
            _ => format!("{},{row}\n", 7 * k),
        })
        .collect();
    assert_eq!(estimates("", &indexed), expected);
}
