//! The durations of Arrow's own schema: an encapsulated message (`Message.fbs`, `Schema.fbs`) in base64.

use std::collections::HashMap;

use super::flatbuffer::Table;

/// Structs within structs, at most.
const DEEPEST: usize = 32;

/// What precedes the length of a message, since Arrow 0.15.
const CONTINUED: [u8; 4] = [0xff; 4];

/// `MessageHeader.Schema`
const SCHEMA: u8 = 1;

/// `Type.Duration`
const DURATION: u8 = 18;

/// Nanoseconds of `TimeUnit`, and its place in that enumeration where nothing is said.
const UNITS: [i64; 4] = [1_000_000_000, 1_000_000, 1000, 1];
const MILLISECONDS: u16 = 1;

/// The columns that are durations, by path, with the nanoseconds of their units; none where the text is no schema.
pub(super) fn durations(text: &str) -> Option<HashMap<String, i64>> {
    let bytes = base64(text)?;
    let message = match bytes.strip_prefix(&CONTINUED) {
        Some(rest) => rest,
        None => &bytes,
    };
    let message = Table::root(message.get(4..)?)?;
    if message.byte(1)? != SCHEMA {
        return None;
    }
    let mut walk = Walk {
        found: HashMap::new(),
        path: vec![],
        // parts of a damaged schema may be one another
        left: bytes.len().saturating_mul(DEEPEST),
    };
    walk.fields(message.table(2)?, 1)?;
    Some(walk.found)
}

/// A way through the fields of a schema.
struct Walk<'b> {
    found: HashMap<String, i64>,
    path: Vec<&'b str>,
    /// bytes of paths that may still be looked at
    left: usize,
}

impl<'b> Walk<'b> {
    /// The fields in this slot of a table, and theirs; none where that takes more than a schema can have.
    fn fields(&mut self, of: Table<'b>, slot: usize) -> Option<()> {
        if self.path.len() == DEEPEST {
            return None;
        }
        for field in of.tables(slot) {
            self.path.push(field.text(0).unwrap_or_default());
            let length: usize = self.path.iter().map(|name| name.len() + 1).sum();
            self.left = self.left.checked_sub(length)?;
            if field.byte(2) == Some(DURATION) {
                let unit = field.table(3)?.short(0).unwrap_or(MILLISECONDS);
                let unit = *UNITS.get(usize::from(unit))?;
                self.found.insert(self.path.join("."), unit);
            }
            self.fields(field, 5)?;
            self.path.pop();
        }
        Some(())
    }
}

/// The bytes that a text in base64 stands for.
fn base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').bytes();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut held, mut bits) = (0_u32, 0);
    for digit in digits {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        (held, bits) = (held << 6 | u32::from(value), bits + 6);
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits & 0xff) as u8);
            held &= (1 << bits) - 1;
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests;
