use proptest::prelude::*;

use super::*;

fn refusal(text: &str, ask: impl Fn(&Table) -> Result<(), Error>) -> String {
    Table::parse(text, "log.csv")
        .and_then(|table| ask(&table))
        .unwrap_err()
        .to_string()
}

fn level(table: &Table) -> Result<(), Error> {
    table.column("level").map(drop)
}

#[test]
fn headers_are_trimmed_and_delimiters_found() {
    for text in [
        "t, level \n0, 1.5\n",
        "t;level\n0;1,5\n",
        "t\tlevel\n0\t1.5\n",
        "t,level\r\n0,1.5\r\n",
    ] {
        let table = Table::parse(text, "log.csv").unwrap();
        assert_eq!(table.column("level").unwrap().to_vec(), [1.5], "{text:?}");
    }
}

#[test]
fn a_missing_column_lists_those_found_and_the_near_one() {
    let message = refusal("t,Level\n0,1\n", level);
    assert!(message.contains("no column \"level\"; the columns found are: t, Level"));
    assert!(message.contains("\"level\" = \"Level\""), "{message}");
}

#[test]
fn a_bad_cell_is_named_by_its_line_only_when_asked_for() {
    let text = "t,level,note\n0,1,ok\n\n1,NaN,\n2,,\n";
    let message = refusal(text, level);
    assert!(
        message.starts_with("log.csv:4: column \"level\""),
        "{message}"
    );
    assert!(message.contains("\"NaN\""), "{message}");
    assert!(Table::parse(text, "log.csv").unwrap().column("t").is_ok());
    assert!(refusal("t,level\n0,\n", level).contains("an empty cell"));
    assert!(refusal("t,level\n0,inf\n", level).contains("\"inf\""));
}

#[test]
fn ragged_empty_and_headless_files_are_refused() {
    assert!(refusal("t,level\n0,1\n1\n", level).starts_with("log.csv:3: expected 2 cells"));
    assert!(refusal("", level).contains("empty file"));
    assert!(refusal("t,level\n", level).contains("found none"));
    assert!(refusal("t,level,level\n0,1,1\n", level).contains("two columns"));
}

#[test]
fn time_must_increase_and_both_lines_are_given() {
    let message = refusal("t,level\n0,1\n2,1\n2,1\n", |t| t.time("t").map(drop));
    assert!(
        message.starts_with("log.csv:4: time must increase"),
        "{message}"
    );
    assert!(message.contains("after 2 in line 3"), "{message}");
}

#[test]
fn columns_of_different_length_are_refused() {
    let columns = vec![("t".to_owned(), vec![0.0]), ("y".to_owned(), vec![])];
    assert!(Table::from_columns(columns).is_err());
}

#[test]
fn missing_cells_are_nan_counted_and_named() {
    let text = "t,level\n0,1.5\n1,\n2,NaN\n3,-inf\n4,null\n5,n/a\n6,Bad Input\n7,1e999\n8,2\n";
    let table = Table::parse(text, "log.csv").unwrap();
    let level = table.readings("level").unwrap();
    let present: Vec<usize> = (0..9)
        .filter(|row| level.get(*row).unwrap().is_finite())
        .collect();
    assert_eq!((present, level.last()), (vec![0, 8], Some(2.0)));
    assert_eq!((table.missing("level"), table.missing("t")), (7, 0));
    let named: Vec<(u64, String)> = table
        .faults("level")
        .iter()
        .map(|fault| (fault.line, fault.to_string()))
        .collect();
    let quoted = |line: u64, text: &str| (line, format!("\"{text}\""));
    assert_eq!(named[0], (3, "an empty cell".to_owned()));
    assert_eq!(
        named[1..4],
        [quoted(4, "NaN"), quoted(5, "-inf"), quoted(6, "null")]
    );
    let strict = table.column("level").unwrap_err().to_string();
    assert!(
        strict.starts_with("log.csv:3: ") && strict.contains("6 more"),
        "{strict}"
    );
    assert_eq!(
        table.held("level").unwrap().to_vec(),
        [1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 2.0]
    );
}

#[test]
fn a_held_column_starts_with_its_first_number() {
    let table = Table::parse("t,u\n0,\n1,7\n2,\n", "log.csv").unwrap();
    assert_eq!(table.held("u").unwrap().to_vec(), [7.0, 7.0, 7.0]);
}

#[test]
fn broken_numbers_and_columns_without_numbers_are_refused() {
    let readings = |table: &Table| table.readings("level").map(drop);
    let message = refusal("t,level\n0,1\n1,12 V\n", readings);
    assert!(message.starts_with("log.csv:3: "), "{message}");
    assert!(
        message.contains("expected a number, found \"12 V\""),
        "{message}"
    );
    let message = refusal("t,level\n0,off\n1,\n", readings);
    assert!(
        message.contains("has no number, found \"off\""),
        "{message}"
    );
}

#[test]
fn dates_become_seconds_since_the_first() {
    let text =
        "t,y\n2026-11-22T01:00:00+01:00,1\n2026-11-22T00:00:00.25Z,2\n2026-11-22T00:00:01Z,3\n";
    let table = Table::parse(text, "log.csv").unwrap();
    assert_eq!(table.time("t").unwrap().to_vec(), [0.0, 0.25, 1.0]);
    assert_eq!(table.origin("t"), Some("2026-11-22T01:00:00+01:00"));
    assert_eq!(table.origin("y"), None);
    let time = |table: &Table| table.time("t").map(drop);
    let message = refusal("t,y\n2026-11-22,1\n7,2\n", time);
    assert!(
        message.contains("expected a date like \"2026-11-22\", found \"7\""),
        "{message}"
    );
    let message = refusal("t,y\n2026-11-22,1\n2026-11-23T00:00:00Z,2\n", time);
    assert!(
        message.contains("a zone in all times or in none"),
        "{message}"
    );
    let message = refusal("t,y\n22.11.2026 01:00,1\n", time);
    assert!(message.contains("2026-11-22T01:02:03Z"), "{message}");
}

#[test]
fn epoch_milliseconds_stay_apart() {
    let rows: String = (0..50)
        .map(|i| format!("{},{}\n", 1_700_000_000_000_u64 + i, i))
        .collect();
    let table = Table::parse(&format!("t,y\n{rows}"), "log.csv").unwrap();
    let mut text = Vec::new();
    write_csv(
        &mut text,
        &[
            ("t", table.time("t").unwrap()),
            ("y", table.column("y").unwrap()),
        ],
    )
    .unwrap();
    assert_eq!(String::from_utf8(text).unwrap(), format!("t,y\n{rows}"));
}

#[test]
fn a_missing_value_is_written_as_an_empty_cell() {
    let mut text = Vec::new();
    write_csv(
        &mut text,
        &[
            ("t", &vec![0.5, 1.0].into()),
            ("a \"b\", c", &vec![f64::NAN, 2.0].into()),
        ],
    )
    .unwrap();
    let text = String::from_utf8(text).unwrap();
    assert_eq!(text, "t,\"a \"\"b\"\", c\"\n0.5,\n1,2\n");
    let table = Table::parse(&text, "log.csv").unwrap();
    assert_eq!(table.missing("a \"b\", c"), 1);
}

#[test]
fn folders_and_devices_are_no_logs() {
    let folder = std::env::temp_dir();
    let message = Table::load(folder).unwrap_err().to_string();
    assert!(message.contains("found the folder"), "{message}");
    #[cfg(target_os = "linux")]
    for device in ["/dev/zero", "/dev/urandom", "/dev/null"] {
        let message = Table::load(device).unwrap_err().to_string();
        assert!(message.starts_with(device), "{message}");
    }
}

/// Another reader's numbers: the cells of a faulty log, by the crate `csv`.
fn by_hand(text: &str, delimiter: u8) -> Vec<(String, Vec<Option<f64>>)> {
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .from_reader(text.as_bytes());
    let names: Vec<String> = reader
        .headers()
        .unwrap()
        .iter()
        .map(str::to_owned)
        .collect();
    let mut columns: Vec<_> = names.into_iter().map(|name| (name, vec![])).collect();
    for record in reader.records() {
        for ((_, values), cell) in columns.iter_mut().zip(&record.unwrap()) {
            let number = match delimiter {
                b';' => cell.replace(',', "."),
                _ => cell.to_owned(),
            };
            values.push(number.parse().ok().filter(|x: &f64| x.is_finite()));
        }
    }
    columns
}

#[test]
fn the_faulty_logs_of_the_field_trials_load_with_every_cell_right() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/trials");
    let Ok(trials) = std::fs::read_dir(&folder) else {
        println!("skipped: no field trials at {}", folder.display());
        return;
    };
    let logs = trials.filter_map(|trial| Some(trial.ok()?.path().join("log_faulty.csv")));
    for log in logs.filter(|log| log.exists()) {
        let text = std::fs::read_to_string(&log).unwrap();
        let delimiter = if text.starts_with("t;") { b';' } else { b',' };
        let table = Table::load(&log).unwrap();
        assert!(table.time("t").is_ok(), "{}", log.display());
        for (name, expected) in by_hand(&text, delimiter) {
            let missing = expected.iter().filter(|x| x.is_none()).count();
            assert_eq!(table.missing(&name), missing, "{} {name}", log.display());
            if missing == expected.len() {
                continue;
            }
            let found = table.readings(&name).unwrap();
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                assert!(match expected {
                    Some(x) => found == x,
                    None => found.is_nan(),
                });
            }
        }
    }
}

proptest! {
    #[test]
    fn what_is_written_reads_back_to_twelve_digits(values in prop::collection::vec(-1e30..1e30f64, 1..20)) {
        let mut text = Vec::new();
        let column = Series::from(values.clone());
        write_csv(&mut text, &[("t", &column), ("y", &column)]).unwrap();
        let table = Table::parse(std::str::from_utf8(&text).unwrap(), "x").unwrap();
        for (wrote, read) in values.iter().zip(table.column("y").unwrap()) {
            prop_assert!((wrote - read).abs() <= 5.01e-12 * wrote.abs());
        }
        prop_assert_eq!(table.column("t").unwrap(), &column);
        let mut again = Vec::new();
        write_csv(&mut again, &[("t", table.get("t").unwrap()), ("y", table.get("y").unwrap())]).unwrap();
        prop_assert_eq!(text, again);
    }

    #[test]
    fn no_text_makes_it_panic(text in "[ \\PC\n\t,;\"]{0,200}") {
        if let Ok(table) = Table::parse(&text, "x") {
            for name in table.names() { let _ = table.time(name); }
        }
    }
}

#[test]
fn a_table_made_in_rust_has_rows_and_no_file() {
    let column = |name: &str, values: &[f64]| (name.to_owned(), values.to_vec());
    let columns = vec![
        column("t", &[0.0, 2.0, 1.0]),
        column("y", &[1.0, f64::NAN, 1.0]),
    ];
    let table = Table::from_columns(columns).unwrap();
    let told = |error: Error| error.to_string();
    let time = told(table.time("t").unwrap_err());
    assert!(
        time.starts_with("row 3 of the table: time must increase"),
        "{time}"
    );
    let cell = told(table.column("y").unwrap_err());
    assert!(cell.starts_with("row 2 of the table: "), "{cell}");
    let absent = told(table.readings("level").unwrap_err());
    assert!(absent.starts_with("the table: no column"), "{absent}");
}
