//! What a column's values mean, by its physical and its logical type.

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use ::parquet::schema::types::ColumnDescriptor;

use super::super::column::Column;
use super::super::instant::{self, Instant};

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

/// Most bytes of a decimal: far more than any format writes.
const LONGEST: usize = 64;

/// Whole numbers up to here are exact in double precision.
const EXACT: u128 = 1 << 53;

/// What a column's values mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    Number,
    Unsigned,
    /// a whole number with so many digits behind the point
    Decimal(i32),
    /// two bytes of IEEE 754
    Half,
    /// a count of so many nanoseconds since 1970
    Time {
        unit: i64,
        zoned: bool,
    },
    /// a count of so many nanoseconds
    Duration {
        unit: i64,
    },
    Text,
    /// neither numbers nor dates; what they are
    Other(&'static str),
}

impl Meaning {
    pub fn of(described: &ColumnDescriptor) -> Self {
        let physical = described.physical_type();
        let own = match described.logical_type_ref() {
            Some(logical) => Self::of_logical(logical),
            None => Self::of_converted(described),
        };
        let is_bytes = matches!(
            physical,
            Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY
        );
        match (own, physical) {
            (Self::Number, Physical::BYTE_ARRAY) => Self::Text,
            (Self::Number, Physical::FIXED_LEN_BYTE_ARRAY) => Self::Other("bytes"),
            (Self::Half, _) if described.type_length() != 2 => {
                Self::Other("half-precision numbers of another length")
            }
            // an annotation that its bytes cannot have
            (Self::Unsigned | Self::Time { .. }, _) if is_bytes => Self::Other("bytes"),
            (Self::Half | Self::Text, _) if !is_bytes => Self::Number,
            (own, _) => own,
        }
    }

    fn of_logical(logical: &LogicalType) -> Self {
        match logical {
            LogicalType::Timestamp(t) => Self::Time {
                unit: nanoseconds(&t.unit),
                zoned: t.is_adjusted_to_u_t_c,
            },
            LogicalType::Date => Self::Time {
                unit: DAY,
                zoned: false,
            },
            LogicalType::Time(_) => Self::Other(OF_DAY),
            LogicalType::Decimal(d) => Self::Decimal(d.scale),
            LogicalType::Integer(i) if !i.is_signed => Self::Unsigned,
            LogicalType::Float16 => Self::Half,
            LogicalType::Integer(_) | LogicalType::Unknown => Self::Number,
            LogicalType::String | LogicalType::Enum | LogicalType::Json => Self::Text,
            LogicalType::Uuid => Self::Other("UUIDs"),
            LogicalType::Bson => Self::Other("BSON"),
            _ => Self::Other("values of another kind"),
        }
    }

    fn of_converted(described: &ColumnDescriptor) -> Self {
        let time = |unit, zoned| Self::Time { unit, zoned };
        match described.converted_type() {
            ConvertedType::TIMESTAMP_MILLIS => time(1_000_000, true),
            ConvertedType::TIMESTAMP_MICROS => time(1000, true),
            ConvertedType::DATE => time(DAY, false),
            ConvertedType::TIME_MILLIS | ConvertedType::TIME_MICROS => Self::Other(OF_DAY),
            ConvertedType::DECIMAL => Self::Decimal(described.type_scale()),
            ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64 => Self::Unsigned,
            ConvertedType::UTF8 | ConvertedType::ENUM | ConvertedType::JSON => Self::Text,
            ConvertedType::BSON => Self::Other("BSON"),
            ConvertedType::INTERVAL => Self::Other("intervals"),
            _ => Self::Number,
        }
    }

    /// Takes a whole number of so many bits.
    pub fn whole(self, column: &mut Column, value: i64, bits: u32) {
        match self {
            Self::Time { unit, zoned } => {
                let nanoseconds = i128::from(value) * i128::from(unit);
                column.put_instant(Instant::at(nanoseconds, zoned));
            }
            Self::Duration { unit } => {
                let nanoseconds = i128::from(value) * i128::from(unit);
                column.put_duration(instant::seconds(nanoseconds));
            }
            Self::Decimal(scale) => {
                column.put(decimal(value.unsigned_abs().into(), value < 0, scale))
            }
            Self::Unsigned if bits == 32 => column.put((value & 0xffff_ffff) as f64),
            Self::Unsigned => column.put(value.cast_unsigned() as f64),
            _ => column.put(value as f64),
        }
    }

    /// Takes the bytes of a value.
    pub fn bytes(self, column: &mut Column, bytes: &[u8]) {
        match (self, bytes) {
            (Self::Decimal(scale), _) => match of_bytes(bytes, scale) {
                Some(value) => column.put(value),
                None => column.put_nothing(),
            },
            (Self::Half, [low, high]) => column.put(half(u16::from_le_bytes([*low, *high]))),
            (Self::Half, _) => column.put_nothing(),
            _ => {
                let line = column.values.len() as u64 + 1;
                let text = std::str::from_utf8(bytes).unwrap_or("bytes");
                column.push(text.trim(), line);
            }
        }
    }
}

/// Clocks without a day.
const OF_DAY: &str = "times of a day";

/// The number nearest to ±magnitude·10^−scale.
fn decimal(magnitude: u128, is_negative: bool, scale: i32) -> f64 {
    let value = match scale {
        // both are exact, so their ratio is rounded once
        0..=22 if magnitude <= EXACT => magnitude as f64 / 10_f64.powi(scale),
        _ => rounded(&magnitude.to_string(), scale),
    };
    if is_negative { -value } else { value }
}

/// The number nearest to these digits times 10^−scale.
fn rounded(digits: &str, scale: i32) -> f64 {
    let text = format!("{digits}e{}", -i64::from(scale));
    // digits with an exponent are a number
    text.parse().unwrap_or(f64::NAN)
}

/// A decimal in two's complement, its most significant byte first; none where it has no bytes or far too many.
fn of_bytes(bytes: &[u8], scale: i32) -> Option<f64> {
    let is_negative = bytes.first()? & 0x80 != 0;
    if bytes.len() > LONGEST {
        return None;
    }
    let mut magnitude: Vec<u8> = bytes.to_vec();
    if is_negative {
        negate(&mut magnitude);
    }
    let first = magnitude.iter().position(|b| *b != 0);
    let magnitude = first.map_or(&[][..], |first| &magnitude[first..]);
    if magnitude.len() <= size_of::<u128>() {
        let whole = magnitude.iter();
        let whole = whole.fold(0, |whole: u128, b| whole << 8 | u128::from(*b));
        return Some(decimal(whole, is_negative, scale));
    }
    let value = rounded(&digits(magnitude.to_vec()), scale);
    Some(if is_negative { -value } else { value })
}

/// The two's complement.
fn negate(bytes: &mut [u8]) {
    let mut carry = true;
    for byte in bytes.iter_mut().rev() {
        (*byte, carry) = (!*byte).overflowing_add(u8::from(carry));
    }
}

/// The decimal digits of a large whole number.
fn digits(mut number: Vec<u8>) -> String {
    let mut digits = vec![];
    while number.iter().any(|b| *b != 0) {
        let mut rest = 0_u32;
        for byte in &mut number {
            let part = rest << 8 | u32::from(*byte);
            *byte = u8::try_from(part / 10).unwrap_or(u8::MAX);
            rest = part % 10;
        }
        digits.push(char::from_digit(rest, 10).unwrap_or('0'));
    }
    digits.iter().rev().collect()
}

/// A number of half precision: a sign, 5 bits of the exponent, 10 of the fraction.
fn half(bits: u16) -> f64 {
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    let magnitude = match bits >> 10 & 0x1f {
        0 => fraction * 2_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        exponent => (1.0 + fraction) * 2_f64.powi(i32::from(exponent) - 15),
    };
    if bits & 0x8000 != 0 {
        -magnitude
    } else {
        magnitude
    }
}

/// Nanoseconds of a unit.
pub(super) fn nanoseconds(unit: &TimeUnit) -> i64 {
    match unit {
        TimeUnit::MILLIS => 1_000_000,
        TimeUnit::MICROS => 1000,
        TimeUnit::NANOS => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_the_nearest_numbers() {
        assert_eq!(of_bytes(&[0x34], 1), Some(5.2));
        assert_eq!(of_bytes(&[0xff], 2), Some(-0.01));
        assert_eq!(of_bytes(&[0x80, 0], 2), Some(-327.68));
        assert_eq!(of_bytes(&[0; 5], 2), Some(0.0));
        assert_eq!((of_bytes(&[], 2), of_bytes(&[1; 65], 2)), (None, None));
        let long = 123_456_789_012_345_678_901_234_567_890_i128;
        for (value, scale) in [(long, 10), (-long, 29), (9_007_199_254_740_993, 3)] {
            let expected: f64 = format!("{value}e-{scale}").parse().unwrap();
            assert_eq!(of_bytes(&value.to_be_bytes(), scale), Some(expected));
        }
        // 2^200 and its negative, of which no whole number of this language has the bits
        let mut large = vec![0; 32];
        large[6] = 1;
        assert_eq!(of_bytes(&large, 0), Some(2_f64.powi(200)));
        negate(&mut large);
        assert_eq!(of_bytes(&large, 0), Some(-(2_f64.powi(200))));
    }

    #[test]
    fn halves_are_those_of_ieee() {
        let known = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_953_125),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_477_539_063e-8),
            (0x03ff, 6.097_555_160_522_461e-5),
            (0x0400, 6.103_515_625e-5),
            (0xfc00, f64::NEG_INFINITY),
            (0x8000, -0.0),
        ];
        for (bits, value) in known {
            assert_eq!(half(bits), value, "{bits:#x}");
        }
        assert!(half(0x7e00).is_nan());
    }
}
