//! What another tuning would have told of the last rows: a copy of the estimator, beside the one that runs.

use std::sync::Arc;

use lynkeus::stream::Stream;
use lynkeus::{Error, tune};
use serde_json::{Map, Value, json};

use crate::asset::{Asset, Line};
use crate::row::Stamp;

/// Both estimators over these rows, from their beginning: the times, the estimates under their headers, and in how many
/// rows each is credible.
///
/// # Errors
/// The study has no such key, or no observer there.
pub(crate) fn tried(
    stream: &Arc<Stream>,
    mut rows: Vec<(Stamp, Vec<f64>)>,
    (key, value): (&str, f64),
) -> Result<Value, Error> {
    let study = tune::changed(stream.study(), key, value)?;
    let other = Arc::new(Stream::new(&study)?);
    rows.sort_by(|(a, _), (b, _)| match (a.is_before(*b), b.is_before(*a)) {
        (true, _) => std::cmp::Ordering::Less,
        (_, true) => std::cmp::Ordering::Greater,
        _ => std::cmp::Ordering::Equal,
    });
    let present = told(stream, &rows);
    let tried = told(&other, &rows);
    Ok(json!({
        "key": key,
        "value": value,
        "present": columns(&present, stream),
        "tried": columns(&tried, &other),
    }))
}

/// What is told of rows in the order of their times.
fn told(stream: &Arc<Stream>, rows: &[(Stamp, Vec<f64>)]) -> Vec<Line> {
    let mut asset = Asset::new(Arc::clone(stream));
    let mut lines: Vec<Line> = vec![];
    for (place, (stamp, values)) in (1..).zip(rows) {
        // what the estimator that runs refused is not among them, and what this one refuses it does not tell
        for line in asset.take(*stamp, values, (place, 0)).unwrap_or_default() {
            match lines.last_mut() {
                Some(last) if last.stamp == line.stamp => *last = line,
                _ => lines.push(line),
            }
        }
    }
    lines
}

fn columns(lines: &[Line], stream: &Stream) -> Value {
    let mut columns = Map::new();
    let time = lines.iter().map(|line| match line.stamp {
        Stamp::Number(t) => json!(t),
        date @ Stamp::Date(_) => json!(date.to_string()),
    });
    columns.insert("time".to_owned(), time.collect());
    for (place, told) in stream.estimates.iter().enumerate() {
        let estimates = lines.iter().map(|line| json!(line.estimate.get(place)));
        columns.insert(told.header.clone(), estimates.collect());
        if let Some(header) = &told.deviation {
            let deviations = lines.iter().map(|line| json!(line.deviations.get(place)));
            columns.insert(header.clone(), deviations.collect());
        }
    }
    let credible = lines.iter().filter(|line| line.is_credible).count();
    columns.insert("credible".to_owned(), json!(credible));
    Value::Object(columns)
}
