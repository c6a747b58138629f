//! Numbers to text.

/// Digits of an estimate in a table.
const DIGITS: usize = 12;

/// Digits that any two numbers of so many differ in, as numbers do: what has so many digits at most, and is read as
/// x, is the shortest that is.
const TELLING: usize = 15;

/// Powers of ten that a number holds as they are: a product with one, or a quotient by one, is rounded once.
pub(super) const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

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
    let (quick, count) = match digits {
        ..=DIGITS => (rounded(x.abs(), digits), digits),
        _ => (told(x.abs()), TELLING),
    };
    let decimal = match quick {
        Some((whole, point)) => Decimal::of(x.is_sign_negative(), whole, count, point),
        None => Decimal::any(x, digits),
    };
    decimal.write(to);
}

/// x·10^k with so many digits before its point, 10^k, and the point of x = 0.d₁d₂… · 10^point; none where 10^k is
/// none of [`POWERS`].
fn scaled(x: f64, digits: usize) -> Option<(f64, f64, i32)> {
    // 1233/4096 is log₁₀ 2: the point, or one less
    let binary = (x.to_bits() >> 52) as i32 - 1023;
    let point = ((binary * 1233) >> 12) + 1;
    let power = |point: i32| {
        let k = usize::try_from(digits as i32 - point).ok()?;
        POWERS.get(k).copied()
    };
    let (least, most) = (POWERS[digits - 1], POWERS[digits]);
    let (scaled, power, point) = match power(point) {
        Some(first) if x * first < most => (x * first, first, point),
        _ => {
            let second = power(point + 1)?;
            (x * second, second, point + 1)
        }
    };
    (least <= scaled && scaled < most).then_some((scaled, power, point))
}

/// x = 0.whole · 10^point to so many digits, at most [`DIGITS`]; none where x is out of reach or so close to the middle
/// of two such numbers that the shortest decimal number for x may be on its other side.
fn rounded(x: f64, digits: usize) -> Option<(i64, i32)> {
    let (scaled, _, point) = scaled(x, digits)?;
    let whole = scaled as i64;
    let part = scaled - whole as f64;
    // x is rounded, and so is the product: by 2⁻⁵³ of 10¹² each, far less than this
    let is_clear = (part - 0.5).abs() > 1e-3;
    is_clear.then(|| (whole + i64::from(part > 0.5), point))
}

/// x = 0.whole · 10^point with all digits that tell x from other numbers, where [these](TELLING) are enough.
fn told(x: f64) -> Option<(i64, i32)> {
    let (scaled, power, point) = scaled(x, TELLING)?;
    let whole = (scaled + 0.5) as i64;
    (whole as f64 / power == x).then_some((whole, point))
}

/// The eight digits of a number below 10⁸, a byte each, the first one the lowest: two numbers below 10⁴ side by side,
/// then four below 10², then eight. A product and a shift are a quotient, which is exact for so small numbers.
fn eight(x: u64) -> u64 {
    let fours = (x / 10_000) | ((x % 10_000) << 32);
    let hundreds = ((fours * 10_486) >> 20) & 0x7f_0000_007f;
    let twos = hundreds | ((fours - 100 * hundreds) << 16);
    let tens = ((twos * 103) >> 10) & 0x000f_000f_000f_000f;
    tens | ((twos - 10 * tens) << 8)
}

impl Decimal {
    /// 0.whole · 10^point, where `whole` has so many digits, or is 1 and so many zeros.
    fn of(negative: bool, mut whole: i64, count: usize, mut point: i32) -> Self {
        if whole as f64 >= POWERS[count] {
            whole /= 10;
            point += 1;
        }
        let sixteen = whole.unsigned_abs() * 10_u64.pow(16 - count as u32);
        let halves = [sixteen / 100_000_000, sixteen % 100_000_000];
        let mut digits = [b'0'; 20];
        for (place, half) in digits.chunks_exact_mut(8).zip(halves) {
            place.copy_from_slice(&(eight(half) + u64::from_ne_bytes([b'0'; 8])).to_le_bytes());
        }
        let mut decimal = Self {
            negative,
            digits,
            count,
            point,
        };
        decimal.trim();
        decimal
    }

    /// To at most so many digits, of any finite number.
    fn any(x: f64, digits: usize) -> Self {
        let mut buffer = zmij::Buffer::new();
        let mut decimal = Self::read(buffer.format_finite(x));
        decimal.round(digits);
        decimal
    }

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

    /// What the quick ways make is what any number becomes.
    fn is_the_same(x: f64) {
        let any = |digits| {
            let mut bytes = vec![];
            Decimal::any(x, digits).write(&mut bytes);
            String::from_utf8(bytes).unwrap()
        };
        assert_eq!(significant(x), any(DIGITS), "{x:e}");
        assert_eq!(exact(x), any(usize::MAX), "{x:e}");
    }

    #[test]
    fn eight_digits_are_those_of_the_number() {
        let told = |x: u64| x.to_string().bytes().map(|b| b - b'0').collect::<Vec<u8>>();
        for x in (0..10_000).flat_map(|x| [x, 10_000 * x, 9_999 * 10_000 + x, 10_001 * x]) {
            let digits = eight(x).to_le_bytes();
            let (zeros, own) = digits.split_at(8 - told(x).len());
            assert!(zeros.iter().all(|d| *d == 0) && own == told(x), "{x}");
        }
    }

    #[test]
    fn quick_numbers_at_the_ends_of_their_reach() {
        for power in -25..25 {
            let ten = 10_f64.powi(power);
            let mut below = ten;
            let mut above = ten;
            for _ in 0..200 {
                (below, above) = (below.next_down(), above.next_up());
                [below, -above, 0.5 * below, 1.5 * above]
                    .into_iter()
                    .for_each(is_the_same);
            }
            // at 12 digits these are rounded, the one up, the other down
            [1.0 - 4e-13, 1.0 - 6e-13, 1.0 + 4e-12, 1.0 + 6e-12]
                .into_iter()
                .for_each(|x| is_the_same(x * ten));
        }
    }

    proptest! {
        #[test]
        fn quick_numbers_of_few_digits(whole in any::<u64>(), digits in 1_u32..20, k in 0..40, off in -3_i64..4) {
            let x = (whole % 10_u64.pow(digits)) as f64 / 10_f64.powi(k);
            is_the_same(x);
            is_the_same(f64::from_bits(x.to_bits().saturating_add_signed(off)));
            // halves of the twelfth digit
            is_the_same((whole % 1_000_000_000_000) as f64 / 10_f64.powi(k - 20) + 5.0 / 10_f64.powi(k - 19));
        }

        #[test]
        fn quick_numbers_of_any_digits(x in -1e13..1e13, k in 0..25) {
            is_the_same(x / 10_f64.powi(k));
        }

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
