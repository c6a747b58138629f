//! InfluxDB's line protocol, as Telegraf's `execd` processor speaks it: metrics on standard input and output, each in a
//! line, whatever a person should know on standard error.

use super::*;

/// A metric as `influx.Serializer` of Telegraf writes it: tags sorted, times in nanoseconds.
fn metric(row: &Row) -> String {
    let nanoseconds = 1_795_000_000_000_000_000_i64 + (row.t * 1e9) as i64;
    let reading =
        |name: &str, y: Option<f64>| y.map_or(String::new(), |y| format!("{name}={y:?},"));
    let (y, a) = (reading("y", row.y), reading("a", row.a));
    format!(
        "tank\\ farm,host=plc1,site=a\\,b {y}{a}u={:?},state=\"on, \\\"auto\\\"\" {nanoseconds}",
        row.u
    )
}

/// The fields of a metric by their names; no test has marks in them but in a last text.
fn fields(line: &str) -> BTreeMap<String, String> {
    let (_, rest) = line
        .split_once(" y=")
        .or_else(|| line.split_once(" level_hat="))
        .unwrap_or(("", line));
    let numbers = rest.split(',').filter_map(|pair| pair.split_once('='));
    numbers
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect()
}

#[test]
fn metrics_are_passed_on_with_estimates() {
    let folder = folder("ekf", "[estimate]\nsd = true");
    let rows = rows(31, 30, true);
    // 2⁵³ ns are 104 days: the times are exact
    let mut input = String::new();
    for row in &rows {
        input += &metric(row);
        input += "\ncpu,host=plc1 usage=3i 1795000000000000000\n";
    }
    let ended = served(&folder, "influx", &input);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let lines: Vec<&str> = ended.out.lines().collect();
    assert_eq!(lines.len(), 2 * rows.len());
    let expected = estimated(&folder, &shifted(&rows));
    let expected: Vec<&Told> = expected.values().collect();
    for (place, (row, pair)) in rows.iter().zip(lines.chunks(2)).enumerate() {
        let own = metric(row);
        let (came, time) = own.rsplit_once(' ').unwrap();
        assert!(
            pair[0].starts_with(&format!("{came},level_hat=")),
            "{}",
            pair[0]
        );
        assert!(
            pair[0].ends_with(&format!(",credible=true,revision=0i {time}")),
            "{}",
            pair[0]
        );
        assert_eq!(pair[1], "cpu,host=plc1 usage=3i 1795000000000000000");
        let found = fields(pair[0]);
        for (header, bits) in expected[place] {
            assert_eq!(
                found[header].parse::<f64>().unwrap().to_bits(),
                *bits,
                "{header}"
            );
        }
    }
}

/// Times as dates count from the first.
fn shifted(rows: &[Row]) -> Vec<Row> {
    let first = rows[0].t;
    rows.iter()
        .map(|row| Row {
            t: row.t - first,
            ..*row
        })
        .collect()
}

/// A correction has the series and the time of the metric that it corrects, so that it takes its place.
#[test]
fn a_correction_is_a_metric_at_the_time_of_what_it_corrects() {
    let folder = folder("ekf", "[estimate]\nsd = true\n[serve]\nwait = 10");
    let rows = rows(32, 3, false);
    let order = [rows[0], rows[2], rows[1]];
    let input: String = order.iter().map(|row| metric(row) + "\n").collect();
    let ended = served(&folder, "influx", &input);
    let lines: Vec<&str> = ended.out.lines().collect();
    assert_eq!(lines.len(), 4);
    let time = |line: &str| line.rsplit_once(' ').unwrap().1.to_owned();
    assert_eq!(time(lines[3]), time(lines[1]));
    assert!(
        lines[3].starts_with("tank\\ farm,host=plc1,site=a\\,b level_hat="),
        "{}",
        lines[3]
    );
    assert!(lines[3].contains(",revision=1i "));
}

/// What cannot be used is passed on as it came, and told on standard error.
#[test]
fn a_metric_that_cannot_be_used_is_passed_on() {
    let folder = folder("ekf", "[estimate]\nsd = true");
    let input =
        "tank y=1,u=2\ntank y=oops 3\ntank\n# a comment\ntank y=1.0,u=2u 1795000000000000000\n";
    let ended = served(&folder, "influx", input);
    let lines: Vec<&str> = ended.out.lines().collect();
    assert_eq!(lines[..3], ["tank y=1,u=2", "tank y=oops 3", "tank"]);
    assert!(lines[3].contains("level_hat="), "{}", lines[3]);
    assert!(
        ended.err.contains("line 1: expected a time in nanoseconds"),
        "{}",
        ended.err
    );
}
