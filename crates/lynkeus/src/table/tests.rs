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
        assert_eq!(table.column("level").unwrap(), [1.5], "{text:?}");
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
fn twelve_digits() {
    assert_eq!(significant(1.0 / 3.0), "0.333333333333");
    assert_eq!(significant(120.0), "120");
    assert_eq!(significant(-1.5e-9), "-1.5e-9");
    assert_eq!(significant(0.1 + 0.2), "0.3");
}

proptest! {
    #[test]
    fn what_is_written_reads_back_to_twelve_digits(values in prop::collection::vec(-1e30..1e30f64, 1..20)) {
        let mut text = Vec::new();
        write_csv(&mut text, &[("t", &values)]).unwrap();
        let table = Table::parse(std::str::from_utf8(&text).unwrap(), "x").unwrap();
        for (wrote, read) in values.iter().zip(table.column("t").unwrap()) {
            prop_assert!((wrote - read).abs() <= 1e-11 * wrote.abs());
        }
    }

    #[test]
    fn no_text_makes_it_panic(text in "[ \\PC\n\t,;\"]{0,200}") {
        if let Ok(table) = Table::parse(&text, "x") {
            for name in table.names() { let _ = table.time(name); }
        }
    }
}
