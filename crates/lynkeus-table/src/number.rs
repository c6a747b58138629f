//! Numbers to text.

/// Digits of an estimate in a table.
const DIGITS: usize = 12;

/// Decimal digits of a number x = ±0.d₁d₂d₃… · 10^point.
struct Decimal {
    negative: bool,
    digits: [u8; 20],
    count: usize,
    point: i32,
}

/// A number with as many digits as it takes to read the same number back.
pub fn exact(x: f64) -> String {
    text(x, usize::MAX)
}

/// A number with 12 significant digits, written as briefly as that allows: the shortest decimal
/// number that stands for it, rounded.
pub fn significant(x: f64) -> String {
    text(x, DIGITS)
}

fn text(x: f64, digits: usize) -> String {
    let mut bytes = Vec::with_capacity(24);
    write(&mut bytes, x, digits);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Appends a number with all its digits.
pub(super) fn write_exact(to: &mut Vec<u8>, x: f64) {
    write(to, x, usize::MAX);
}

/// Appends a number with [`DIGITS`] significant digits.
pub(super) fn write_significant(to: &mut Vec<u8>, x: f64) {
    write(to, x, DIGITS);
}

fn write(to: &mut Vec<u8>, x: f64, digits: usize) {
    if !x.is_finite() {
        let name: &[u8] = match x {
            _ if x.is_nan() => b"NaN",
            _ if x > 0.0 => b"inf",
            _ => b"-inf",
        };
        return to.extend_from_slice(name);
    }
    let mut buffer = zmij::Buffer::new();
    let mut decimal = Decimal::read(buffer.format_finite(x));
    decimal.round(digits);
    decimal.write(to);
}

impl Decimal {
    /// From `-12.5e-3`.
    fn read(text: &str) -> Self {
        let text = text.as_bytes();
        let unsigned = text.strip_prefix(b"-").unwrap_or(text);
        // the letter of an exponent has a sign and three digits after it at most
        let tail = unsigned.len().saturating_sub(5);
        let letter = unsigned[tail..].iter().position(|byte| *byte == b'e');
        let (mantissa, exponent) = match letter {
            Some(at) => unsigned.split_at(tail + at),
            None => (unsigned, &b""[..]),
        };
        let exponent = str::from_utf8(exponent.get(1..).unwrap_or_default());
        let exponent: i32 = exponent.ok().and_then(|e| e.parse().ok()).unwrap_or(0);
        let dot = mantissa.iter().position(|byte| *byte == b'.');
        let (whole, part) = match dot {
            Some(dot) => (&mantissa[..dot], &mantissa[dot + 1..]),
            None => (mantissa, &b""[..]),
        };
        // zeros before the first digit only move the point
        let first = |part: &[u8]| part.iter().position(|byte| *byte != b'0');
        let (skipped, zeros) = match first(whole) {
            Some(at) => (at, 0),
            None => (whole.len(), first(part).unwrap_or(part.len())),
        };
        let mut decimal = Self {
            negative: unsigned.len() < text.len(),
            digits: [b'0'; 20],
            count: 0,
            point: exponent + (whole.len() - skipped) as i32 - zeros as i32,
        };
        for part in [&whole[skipped..], &part[zeros..]] {
            let places = &mut decimal.digits[decimal.count..];
            let count = part.len().min(places.len());
            places[..count].copy_from_slice(&part[..count]);
            decimal.count += count;
        }
        decimal.trim();
        decimal
    }

    fn trim(&mut self) {
        while self.count > 0 && self.digits[self.count - 1] == b'0' {
            self.count -= 1;
        }
    }

    /// To at most so many digits, halves away from zero.
    fn round(&mut self, digits: usize) {
        if self.count <= digits {
            return;
        }
        let up = self.digits[digits] >= b'5';
        self.count = digits;
        if up {
            while self.count > 0 && self.digits[self.count - 1] == b'9' {
                self.count -= 1;
            }
            match self.count.checked_sub(1) {
                Some(last) => self.digits[last] += 1,
                None => {
                    self.digits[0] = b'1';
                    self.count = 1;
                    self.point += 1;
                }
            }
        }
        self.trim();
    }

    /// Plain from 10⁻⁴ up to 10¹⁶, beyond with an exponent.
    fn write(&self, to: &mut Vec<u8>) {
        if self.negative {
            to.push(b'-');
        }
        let digits = self.digits.get(..self.count).unwrap_or_default();
        let zeros = |count: i32| std::iter::repeat_n(b'0', usize::try_from(count).unwrap_or(0));
        let count = i32::try_from(self.count).unwrap_or(0);
        match self.point {
            _ if count == 0 => to.push(b'0'),
            point @ -3..=0 => {
                to.extend_from_slice(b"0.");
                to.extend(zeros(-point));
                to.extend_from_slice(digits);
            }
            point @ 1..=16 if count <= point => {
                to.extend_from_slice(digits);
                to.extend(zeros(point - count));
            }
            point @ 1..=16 => {
                let (whole, part) = digits.split_at(usize::try_from(point).unwrap_or(0));
                to.extend_from_slice(whole);
                to.push(b'.');
                to.extend_from_slice(part);
            }
            point => {
                let (first, rest) = digits.split_at(1);
                to.extend_from_slice(first);
                if !rest.is_empty() {
                    to.push(b'.');
                    to.extend_from_slice(rest);
                }
                to.push(b'e');
                to.extend_from_slice((point - 1).to_string().as_bytes());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn twelve_digits() {
        let shown = [
            (1.0 / 3.0, "0.333333333333"),
            (120.0, "120"),
            (-1.5e-9, "-1.5e-9"),
            (0.1 + 0.2, "0.3"),
            (0.999_999_999_999_9, "1"),
            (-99_999.999_999_999, "-100000"),
            (9.999_999_999_999_9e15, "1e16"),
            (9.999_999_999_999_9e99, "1e100"),
            (0.0, "0"),
            (-0.0, "-0"),
            (1e-4, "0.0001"),
            (1e-5, "1e-5"),
            (1e16, "1e16"),
            (123_456_789_012_345.0, "123456789012000"),
            (5e-324, "5e-324"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ];
        for (x, text) in shown {
            assert_eq!(significant(x), text);
        }
    }

    #[test]
    fn exact_numbers_are_as_short_as_they_can_be() {
        let shown = [
            (1_700_000_000.001, "1700000000.001"),
            (1_700_000_000_001.0, "1700000000001"),
            (0.1 + 0.2, "0.30000000000000004"),
            (1e15 + 0.125, "1000000000000000.1"),
            (f64::MAX, "1.7976931348623157e308"),
        ];
        for (x, text) in shown {
            assert_eq!(exact(x), text);
        }
    }

    proptest! {
        #[test]
        fn exact_reads_back(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            prop_assert_eq!(exact(x).parse::<f64>().unwrap().to_bits(), bits);
        }

        #[test]
        fn significant_is_the_rounded_number_and_stays(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_normal());
            let text = significant(x);
            let read: f64 = text.parse().unwrap();
            // half a unit of the twelfth digit, and what f64 loses
            prop_assert!((read / x - 1.0).abs() <= 5.01e-12, "{} {}", x, text);
            prop_assert_eq!(significant(read), text);
        }
    }
}
