//! `serve`: what it answers equals what `estimate` makes of the same rows, whatever happens on the way.

mod broker;
mod browsed;
mod changed;
mod hostile;
mod kept;
mod many;
mod metrics;
mod mqtt;
mod node_red;
#[cfg(feature = "opcua")]
mod opcua;
mod order;
mod page;
mod process;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus::{Study, Table};
use serde_json::Value;

use crate::Folder;
use crate::normal::Normal;
use process::served;

/// A tank with an input; both of its outputs are measured.
const PLANT: &str = "model Tank
  input Real u;
  Real level(start = 2, min = -10, max = 20, unit = \"m\");
  Real q(start = 0, min = -10, max = 20);
  output Real y = level;
  output Real a = q;
equation
  der(level) = u - 0.2*level + 0.1*q;
  der(q) = 0.3*level - 0.4*q;
end Tank;
";

/// The study of a family, with more lines at its end.
fn folder(family: &str, more: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("tank.mo", PLANT);
    let tuning = match family {
        "ekf" | "ukf" | "mhe" => "initial_variance = { default = 1 }",
        _ => "theta = 3",
    };
    folder.write(
        "study.toml",
        &format!(
            "plant = \"tank.mo\"\nprocess_noise = {{ level = 0.01, q = 0.01 }}\n[sensors]\nnoise = {{ y = 0.1, a = 0.1 }}\n[observer]\nfamily = \"{family}\"\n{tuning}\n{more}\n"
        ),
    );
    folder
}

/// A row: its time, y, a and u, of which y and a may be missing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    t: f64,
    y: Option<f64>,
    a: Option<f64>,
    u: f64,
}

impl Row {
    fn json(&self) -> String {
        let reading = |name: &str, y: Option<f64>| match y {
            Some(y) => format!(",\"{name}\":{y:?}"),
            None => String::new(),
        };
        let (y, a) = (reading("y", self.y), reading("a", self.a));
        format!("{{\"t\":{:?}{y}{a},\"u\":{:?}}}\n", self.t, self.u)
    }
}

/// Rows in the order of their times.
fn rows(seed: u64, count: usize, has_gaps: bool) -> Vec<Row> {
    let mut random = Normal(seed);
    let mut t = 0.0;
    let rows = (0..count).map(|k| {
        t += 0.25 + (4.0 * random.uniform()).floor() / 4.0;
        let mut reading = |y: f64| {
            let y = y + 0.2 * random.uniform();
            (!has_gaps || k == 0 || random.uniform() < 0.7).then_some(y)
        };
        let (y, a) = (reading(2.0), reading(1.5));
        let u = 0.4 + 0.1 * random.uniform();
        Row { t, y, a, u }
    });
    rows.collect()
}

fn csv(rows: &[Row]) -> String {
    let cell = |y: Option<f64>| y.map_or(String::new(), |y| format!("{y:?}"));
    let lines = rows
        .iter()
        .map(|row| format!("{:?},{},{},{:?}\n", row.t, cell(row.y), cell(row.a), row.u));
    format!("t,y,a,u\n{}", lines.collect::<String>())
}

/// What is told of a row: by header, to the bit.
type Told = BTreeMap<String, u64>;

/// What `estimate` makes of rows, by their times.
fn estimated(folder: &Folder, rows: &[Row]) -> BTreeMap<u64, Told> {
    folder.write("log.csv", &csv(rows));
    let study = Study::load(folder.path.path().join("study.toml")).unwrap();
    let log = Table::load(folder.path.path().join("log.csv")).unwrap();
    let watch = &mut |_| ControlFlow::Continue(());
    let outcome = lynkeus::estimate(&study, &log, watch).unwrap();
    let mut found: BTreeMap<u64, Told> = BTreeMap::new();
    for quantity in &outcome.quantities {
        let Some(estimate) = &quantity.estimate else {
            continue;
        };
        let sd = quantity.deviation.as_ref();
        let columns = [
            (format!("{}_hat", quantity.name), Some(estimate)),
            (format!("{}_sd", quantity.name), sd),
        ];
        for (header, values) in columns {
            for (t, x) in outcome.time.iter().zip(values.into_iter().flatten()) {
                let row = found.entry(t.to_bits()).or_default();
                row.insert(header.clone(), x.to_bits());
            }
        }
    }
    assert_eq!(found.len(), rows.len());
    found
}

/// The numbers of an answer.
fn told(line: &Value) -> Told {
    let numbers = line.as_object().unwrap().iter();
    let numbers = numbers.filter(|(name, _)| name.ends_with("_hat") || name.ends_with("_sd"));
    numbers
        .map(|(name, x)| (name.clone(), x.as_f64().unwrap().to_bits()))
        .collect()
}

/// Answers in lines.
fn lines(text: &str) -> Vec<Value> {
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}")))
        .collect()
}

/// What the last answers say of each row, by its time; revisions of one count without a gap.
fn last(lines: &[Value]) -> BTreeMap<u64, Told> {
    let mut found = BTreeMap::new();
    let mut revisions: BTreeMap<u64, u64> = BTreeMap::new();
    for line in lines {
        let t = line["t"]
            .as_f64()
            .unwrap_or_else(|| panic!("{line}"))
            .to_bits();
        let revision = line["revision"].as_u64().unwrap();
        match revisions.get(&t) {
            None => assert_eq!(revision, 0, "{line}"),
            Some(before) => assert!(revision == before + 1 || revision == *before, "{line}"),
        }
        revisions.insert(t, revision);
        found.insert(t, told(line));
    }
    found
}

fn json(rows: &[Row]) -> String {
    rows.iter().map(Row::json).collect()
}

#[test]
fn rows_in_order_give_what_estimate_gives() {
    for (seed, family, more) in [
        (1, "ekf", "[estimate]\nsd = true"),
        (2, "ukf", "[estimate]\nsd = true"),
        (3, "mhe", "[estimate]\nsd = true"),
        (4, "triangular", "[estimate]\nsd = true"),
        (5, "triangular", "[estimate]\nmethod = \"rk4\""),
        (6, "triangular", "[estimate]\nbetween_samples = \"predict\""),
    ] {
        for has_gaps in [false, true] {
            let folder = folder(family, more);
            let rows = rows(seed, 40, has_gaps);
            let ended = served(&folder, "json", &json(&rows));
            assert_eq!(ended.code, 0, "{}", ended.err);
            let lines = lines(&ended.out);
            assert_eq!(lines.len(), rows.len(), "{family}");
            assert!(lines.iter().all(|line| line["credible"] == true));
            let (expected, mut found) = (estimated(&folder, &rows), last(&lines));
            // a filter tells its deviations in any case
            let is_asked = |header: &str| expected.values().any(|row| row.contains_key(header));
            found
                .values_mut()
                .for_each(|row| row.retain(|header, _| is_asked(header)));
            assert!(expected == found, "{family} {more} {has_gaps}");
        }
    }
}

/// As from a historian: dates, names of its own, another unit.
#[test]
fn columns_of_the_log_are_those_of_a_message() {
    let folder = folder(
        "ekf",
        "[estimate]\nsd = true\n[log]\ntime = \"time\"\ntime_unit = \"min\"\ncolumns = { y = \"(L_cm + 5)/100\", a = \"assay\" }",
    );
    let (mut messages, mut log) = (String::new(), "time,L_cm,assay,u\n".to_owned());
    for k in 0..20 {
        let time = format!("2026-11-27T12:{k:02}:30.25+01:00");
        let level = 200 + k % 3;
        messages += &format!("{{\"time\":\"{time}\",\"L_cm\":{level},\"assay\":1.5,\"u\":0.4}}\n");
        log += &format!("{time},{level},1.5,0.4\n");
    }
    folder.write("log.csv", &log);
    let ended = served(&folder, "json", &messages);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let lines = lines(&ended.out);
    assert_eq!(lines.len(), 20);
    assert_eq!(lines[1]["t"], "2026-11-27T11:01:30.25Z");
    let study = Study::load(folder.path.path().join("study.toml")).unwrap();
    let table = lynkeus::log(&study, folder.path.path().join("log.csv")).unwrap();
    let outcome = lynkeus::estimate(&study, &table, &mut |_| ControlFlow::Continue(())).unwrap();
    for quantity in outcome.quantities.iter().filter(|q| q.estimate.is_some()) {
        let header = format!("{}_hat", quantity.name);
        let estimates = quantity.estimate.as_ref().unwrap();
        for (line, x) in lines.iter().zip(estimates) {
            assert_eq!(line[&header].as_f64().map(f64::to_bits), Some(x.to_bits()));
        }
    }
}

#[test]
fn what_looks_ahead_is_refused() {
    for (more, word) in [
        ("[estimate]\nsmooth = true", "looks ahead"),
        ("[estimate]\nbetween_samples = \"linear\"", "looks ahead"),
        ("[serve]\nwait = -1", "a time >= 0"),
        (
            "[serve]\nwait = 2\n[log]\ntime = \"a + b\"",
            "the expression a + b",
        ),
    ] {
        let folder = folder("ekf", more);
        let ended = served(&folder, "json", "");
        assert_eq!(ended.code, 2);
        assert!(ended.err.contains(word), "{}", ended.err);
    }
}
