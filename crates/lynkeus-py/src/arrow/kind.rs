//! What the values of a column are, by its format.

use lynkeus::table::{Gathered, Instant};

use super::ffi::{Bits, Schema, View};

/// What the values of a column mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// numbers in words of so many bytes
    Float(usize),
    Signed(usize),
    Unsigned(usize),
    Boolean,
    /// nothing in any row
    Null,
    /// counts of so many nanoseconds since 1970, in words of so many bytes
    Time {
        width: usize,
        unit: i64,
        zoned: bool,
    },
    /// counts of so many in a second
    Duration(f64),
}

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

impl Kind {
    /// Of a column.
    ///
    /// # Errors
    /// What it holds instead of numbers or instants.
    pub fn of(schema: &Schema) -> Result<Self, &'static str> {
        if schema.is_dictionary() {
            return Err("categories");
        }
        let format = schema.format();
        let unit = |letter: Option<char>| match letter {
            Some('s') => Some(1_000_000_000),
            Some('m') => Some(1_000_000),
            Some('u') => Some(1000),
            Some('n') => Some(1),
            _ => None,
        };
        let kind = match format {
            "e" => Self::Float(2),
            "f" => Self::Float(4),
            "g" => Self::Float(8),
            "c" => Self::Signed(1),
            "s" => Self::Signed(2),
            "i" => Self::Signed(4),
            "l" => Self::Signed(8),
            "C" => Self::Unsigned(1),
            "S" => Self::Unsigned(2),
            "I" => Self::Unsigned(4),
            "L" => Self::Unsigned(8),
            "b" => Self::Boolean,
            "n" => Self::Null,
            "tdD" => Self::Time {
                width: 4,
                unit: DAY,
                zoned: false,
            },
            "tdm" => Self::Time {
                width: 8,
                unit: 1_000_000,
                zoned: false,
            },
            "u" | "U" | "vu" => return Err("texts"),
            "z" | "Z" | "vz" => return Err("bytes"),
            _ if format.starts_with("ts") => {
                let rest = format.get(2..).unwrap_or_default();
                Self::Time {
                    width: 8,
                    unit: unit(rest.chars().next()).ok_or("times of an unknown unit")?,
                    zoned: rest
                        .split_once(':')
                        .is_some_and(|(_, zone)| !zone.is_empty()),
                }
            }
            _ if format.starts_with("tD") => {
                let unit = unit(format.chars().nth(2)).ok_or("durations of an unknown unit")?;
                Self::Duration(1_000_000_000.0 / unit as f64)
            }
            _ if format.starts_with("tt") => return Err("times of a day"),
            _ if format.starts_with("d:") => return Err("decimals"),
            _ if format.starts_with('+') => return Err("lists or structs"),
            _ => return Err("something else"),
        };
        Ok(kind)
    }

    /// Adds a column's rows; those of which `parent` says so are missing.
    ///
    /// # Errors
    /// The array lacks a buffer.
    pub fn read(
        self,
        view: &View,
        parent: Option<Bits<'_>>,
        to: &mut Gathered,
    ) -> Result<(), String> {
        let mut rows = Rows { view, parent, to };
        match self {
            Self::Float(2) => rows.numbers(|x| half(u16::from_ne_bytes(x))),
            Self::Float(4) => rows.numbers(|x| f64::from(f32::from_ne_bytes(x))),
            Self::Float(_) => rows.numbers(f64::from_ne_bytes),
            Self::Signed(1) => rows.numbers(|x| f64::from(i8::from_ne_bytes(x))),
            Self::Signed(2) => rows.numbers(|x| f64::from(i16::from_ne_bytes(x))),
            Self::Signed(4) => rows.numbers(|x| f64::from(i32::from_ne_bytes(x))),
            Self::Signed(_) => rows.numbers(|x| i64::from_ne_bytes(x) as f64),
            Self::Unsigned(1) => rows.numbers(|x| f64::from(u8::from_ne_bytes(x))),
            Self::Unsigned(2) => rows.numbers(|x| f64::from(u16::from_ne_bytes(x))),
            Self::Unsigned(4) => rows.numbers(|x| f64::from(u32::from_ne_bytes(x))),
            Self::Unsigned(_) => rows.numbers(|x| u64::from_ne_bytes(x) as f64),
            Self::Duration(per_second) => {
                rows.numbers(|x| i64::from_ne_bytes(x) as f64 / per_second)
            }
            Self::Time {
                width: 4,
                unit,
                zoned,
            } => rows.instants(unit, zoned, |x| i64::from(i32::from_ne_bytes(x))),
            Self::Time { unit, zoned, .. } => rows.instants(unit, zoned, i64::from_ne_bytes),
            Self::Boolean => {
                let bits = view.bits()?;
                let values = (0..view.rows()).map(|row| f64::from(u8::from(bits.get(row))));
                rows.put(values);
                Ok(())
            }
            Self::Null => {
                rows.put(std::iter::repeat_n(f64::NAN, view.rows()));
                Ok(())
            }
        }
    }
}

/// Rows on their way.
struct Rows<'a> {
    view: &'a View,
    parent: Option<Bits<'a>>,
    to: &'a mut Gathered,
}

impl<'a> Rows<'a> {
    /// Whether a row is there; none where all are.
    fn present(&self) -> Option<impl Fn(usize) -> bool + use<'a>> {
        let (own, parent) = (self.view.validity(), self.parent);
        let is = |bits: Option<Bits<'_>>, row| bits.is_none_or(|bits| bits.get(row));
        (own.is_some() || parent.is_some()).then_some(move |row| is(own, row) && is(parent, row))
    }

    fn words<const W: usize>(&self) -> Result<&'a [[u8; W]], String> {
        Ok(self.view.values(W)?.as_chunks().0)
    }

    fn put(&mut self, values: impl Iterator<Item = f64>) {
        match self.present() {
            None => self.to.numbers(values),
            Some(present) => {
                let values = values.enumerate();
                self.to
                    .numbers(values.map(|(row, x)| if present(row) { x } else { f64::NAN }));
            }
        }
    }

    fn numbers<const W: usize>(&mut self, number: impl Fn([u8; W]) -> f64) -> Result<(), String> {
        let words = self.words()?;
        self.put(words.iter().map(|word| number(*word)));
        Ok(())
    }

    fn instants<const W: usize>(
        &mut self,
        unit: i64,
        zoned: bool,
        count: impl Fn([u8; W]) -> i64,
    ) -> Result<(), String> {
        let words = self.words()?;
        let present = self.present();
        let instants = words.iter().enumerate().map(|(row, word)| {
            let is_present = present.as_ref().is_none_or(|present| present(row));
            let nanoseconds = i128::from(count(*word)) * i128::from(unit);
            is_present.then(|| Instant::at(nanoseconds, zoned))
        });
        self.to.instants(instants);
        Ok(())
    }
}

/// A number in half precision (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let fraction = f64::from(bits & 0x3ff);
    let size = match bits >> 10 & 0x1f {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1024.0 + fraction) * 2_f64.powi(i32::from(exponent) - 25),
    };
    sign * size
}
