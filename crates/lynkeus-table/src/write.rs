//! Columns to CSV text.

use std::io::{self, Write};

use super::number::{write_exact, write_significant};
use crate::Series;
use crate::series::Iter;

/// Bytes that are gathered before they are written.
const BLOCK: usize = 1 << 16;

/// Writes named columns as CSV: a header row, then one row per index.
///
/// The first column, the time, has as many digits as it takes to read the same number back; the
/// others have 12 significant digits. A NaN is an empty cell. Rows are written as they are made,
/// so a table takes no room but its own.
///
/// # Errors
/// What the writer reports; a column that cannot be read again.
pub fn write_csv(to: &mut dyn Write, columns: &[(&str, &Series)]) -> io::Result<()> {
    let mut text = Vec::with_capacity(2 * BLOCK);
    for (place, (name, _)) in columns.iter().enumerate() {
        if place > 0 {
            text.push(b',');
        }
        write_name(&mut text, name);
    }
    text.push(b'\n');
    let rows = columns.iter().map(|(_, v)| v.len()).min().unwrap_or(0);
    let mut rest: Vec<Iter<'_>> = columns.iter().map(|(_, values)| values.iter()).collect();
    for _ in 0..rows {
        for (place, values) in rest.iter_mut().enumerate() {
            let value = values.next().unwrap_or(f64::NAN);
            match place {
                0 => write_exact(&mut text, value),
                _ => {
                    text.push(b',');
                    if !value.is_nan() {
                        write_significant(&mut text, value);
                    }
                }
            }
        }
        text.push(b'\n');
        if text.len() >= BLOCK {
            to.write_all(&text)?;
            text.clear();
        }
    }
    let checked = columns.iter().try_for_each(|(_, values)| values.check());
    checked.map_err(io::Error::other)?;
    to.write_all(&text)?;
    to.flush()
}

/// A header, in quotes where it needs them.
fn write_name(text: &mut Vec<u8>, name: &str) {
    let is_plain = !name.contains(['"', ',', ';', '\t', '\n', '\r']) && name.trim() == name;
    if is_plain && !name.is_empty() {
        return text.extend_from_slice(name.as_bytes());
    }
    text.push(b'"');
    text.extend_from_slice(name.replace('"', "\"\"").as_bytes());
    text.push(b'"');
}
