//! Columns to CSV text.

use std::io::{self, Write};

/// A number with 12 significant digits, written as briefly as that allows.
pub fn significant(x: f64) -> String {
    let rounded: f64 = format!("{x:.11e}").parse().unwrap_or(x);
    let text = format!("{rounded:?}");
    match text.strip_suffix(".0") {
        Some(whole) => whole.to_owned(),
        None => text,
    }
}

/// Writes named columns as CSV: a header row, then one row per index, 12 significant digits.
///
/// # Errors
/// What the writer reports.
pub fn write_csv(to: &mut dyn Write, columns: &[(&str, &[f64])]) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record(columns.iter().map(|(name, _)| name))?;
    let rows = columns.iter().map(|(_, v)| v.len()).min().unwrap_or(0);
    for row in 0..rows {
        let cells = columns.iter().filter_map(|(_, values)| values.get(row));
        writer.write_record(cells.map(|x| significant(*x)))?;
    }
    writer.flush()
}
