use super::*;

const SECOND: i128 = 1_000_000_000;

fn refusal(table: &Table, name: &str) -> String {
    table.readings(name).unwrap_err().to_string()
}

#[test]
fn infinite_and_absent_numbers_are_missing_wherever_they_come() {
    let log = Gathering::new("log");
    let values = vec![1.0, f64::NAN, f64::INFINITY, 4.0];
    let mut pieces = log.column("pieces");
    values
        .chunks(1)
        .for_each(|x| pieces.numbers(x.iter().copied()));
    let columns = vec![
        log.owned("owned", values.clone()),
        log.lent("lent", std::sync::Arc::new(values)),
        pieces,
    ];
    let table = log.table(columns).unwrap();
    for name in ["owned", "lent", "pieces"] {
        let found = table.readings(name).unwrap().to_vec();
        assert_eq!((found[0], found[3]), (1.0, 4.0));
        assert!(found[1].is_nan() && found[2].is_nan(), "{name} {found:?}");
        assert_eq!(table.missing(name), 2);
        let faults: Vec<_> = table
            .faults(name)
            .iter()
            .map(|f| (f.line, f.found.as_str()))
            .collect();
        assert_eq!(faults, [(2, "NaN"), (3, "inf")]);
    }
}

#[test]
fn numbers_without_an_infinity_are_not_copied() {
    let owner: Lent = std::sync::Arc::new(vec![1.0, f64::NAN]);
    let count = || std::sync::Arc::strong_count(&owner);
    let log = Gathering::new("log");
    let table = log.table(vec![log.lent("x", owner.clone())]).unwrap();
    assert_eq!((table.missing("x"), count()), (1, 2));
}

#[test]
fn instants_count_from_the_first_and_keep_their_kind() {
    let log = Gathering::new("log");
    let mut t = log.column("t");
    let first = 1_795_305_600 * SECOND;
    t.instants([None, Some(Instant::at(first, true))].into_iter());
    t.instants([Some(Instant::at(first + SECOND / 4, true))].into_iter());
    let mut mixed = log.column("mixed");
    let mut zones = log.column("zones");
    for (a, b) in [
        (Cell::Missing, Cell::Missing),
        (
            Cell::Instant(Instant::at(0, true)),
            Cell::Instant(Instant::at(0, true)),
        ),
        (Cell::Number(7.0), Cell::Instant(Instant::at(SECOND, false))),
    ] {
        mixed.cell(a);
        zones.cell(b);
    }
    let table = log.table(vec![t, mixed, zones]).unwrap();
    assert_eq!(table.origin("t"), Some("2026-11-22T00:00:00Z"));
    let seconds = table.times("t").unwrap().to_vec();
    assert!(seconds[0].is_nan() && seconds[1..] == [0.0, 0.25]);
    let message = refusal(&table, "mixed");
    assert!(message.starts_with("log:3: "), "{message}");
    assert!(message.contains("expected a date like \"1970-01-01T00:00:00Z\", found \"7\""));
    assert!(refusal(&table, "zones").contains("a zone in all times or in none"));
}

#[test]
fn long_columns_go_on_in_a_temporary_file() {
    let log = Gathering::new("log");
    let mut x = log.column("x");
    let number = |row: usize| (row as f64).sqrt();
    for from in (0..IN_MEMORY + 10_000).step_by(10_000) {
        x.numbers((from..from + 10_000).map(number));
    }
    let rows = x.len();
    let table = log.table(vec![x]).unwrap();
    assert!(
        table
            .readings("x")
            .unwrap()
            .iter()
            .eq((0..rows).map(number))
    );
}

#[test]
fn what_is_no_table_is_refused_and_a_refused_column_only_where_asked_for() {
    let told = |columns: fn(&Gathering) -> Vec<Gathered>| {
        let log = Gathering::new("log");
        let columns = columns(&log);
        log.table(columns)
            .map(|t| t.rows())
            .map_err(|e| e.to_string())
    };
    let text = "expected numbers, found texts";
    assert!(
        told(|_| vec![])
            .unwrap_err()
            .contains("columns, found none")
    );
    let empty = told(|log| vec![log.owned("t", vec![])]);
    assert!(
        empty
            .unwrap_err()
            .contains("log: expected rows, found none")
    );
    let ragged = told(|log| vec![log.owned("t", vec![1.0]), log.owned("y", vec![])]);
    assert!(
        ragged
            .unwrap_err()
            .contains("expected 1 rows as in \"t\", found 0 in \"y\"")
    );
    let log = Gathering::new("log");
    let columns = vec![
        log.refused("note", text, "leave it out"),
        log.owned("t", vec![1.0]),
    ];
    let table = log.table(columns).unwrap();
    assert_eq!(table.rows(), 1);
    assert_eq!(
        refusal(&table, "note")
            .lines()
            .next()
            .unwrap()
            .find("log: "),
        Some(0)
    );
}

/// A log that travels says since when its times count.
#[test]
fn seconds_since_an_instant_are_what_instants_give() {
    let log = Gathering::new("log");
    let first = 1_795_305_600 * SECOND + SECOND / 4;
    let mut given = log.column("t");
    given.instants((0..4).map(|i| (i != 2).then(|| Instant::at(first + i * SECOND / 3, true))));
    let given = log.table(vec![given]).unwrap();
    let origin = given.origin("t").unwrap();
    let seconds = given.get("t").unwrap().to_vec();
    let again = log.since("t", seconds.clone(), origin).unwrap();
    let again = log.table(vec![again]).unwrap();
    assert_eq!(again.origin("t"), Some(origin));
    let found = again.times("t").unwrap().to_vec();
    assert_eq!((found[3], again.missing("t")), (seconds[3], 1));
    assert!(log.since("t", seconds, "midnight").is_err());
}
