//! The logarithm, and powers with real exponents.

use std::f64::consts::FRAC_1_SQRT_2;

use super::Vector;
use super::exponential::{LN_2, parts, reduced};
use super::vector::polynomial;

const TWO_52: f64 = 4_503_599_627_370_496.0;
const BIAS: u64 = 1024;

/// x = 2ᵏ·m with m from √½ to √2.
struct Split<V> {
    k: V,
    m: V,
    /// where x is positive and normal: the parts mean something
    inside: V,
}

#[inline(always)]
fn split<V: Vector>(x: V) -> Split<V> {
    let root = FRAC_1_SQRT_2.to_bits();
    let bits = |bits: u64| V::splat(f64::from_bits(bits));
    let above = x.plus_bits(bits((BIAS << 52).wrapping_sub(root)));
    let k = above.down::<52>().or(V::splat(TWO_52)) - V::splat(TWO_52 + BIAS as f64);
    let fraction = above.and(bits((1 << 52) - 1));
    let is_normal = V::splat(f64::MIN_POSITIVE).at_most(x);
    Split {
        k,
        m: fraction.plus_bits(bits(root)),
        inside: is_normal.and(x.at_most(V::splat(f64::MAX))),
    }
}

/// The natural logarithm, after fdlibm; of subnormal numbers the library's.
#[inline(always)]
pub fn ln<V: Vector>(x: V) -> V {
    let Split { k, m, inside } = split(x);
    let f = m - V::splat(1.0);
    let s = f / (V::splat(2.0) + f);
    let z = s * s;
    let rest = z * polynomial(
        z,
        [
            6.666_666_666_666_735e-1,
            2.857_142_874_366_239e-1,
            1.818_357_216_161_805e-1,
            1.479_819_860_511_658_6e-1,
        ],
        [
            3.999_999_999_940_942e-1,
            2.222_219_843_214_978_4e-1,
            1.531_383_769_920_937_3e-1,
        ],
    );
    let half = V::splat(0.5) * f * f;
    let curve = s.mul_add(half + rest, k * V::splat(LN_2[1]));
    let y = k.mul_add(V::splat(LN_2[0]), f - (half - curve));
    if inside.all() {
        return y;
    }
    y.rescued(inside, [x, x], |x, _| x.ln())
}

/// A number that is the sum of two.
#[derive(Clone, Copy)]
struct Double<V> {
    high: V,
    low: V,
}

/// The sum of two numbers, exactly, where the first one is larger or zero.
#[inline(always)]
fn sum<V: Vector>(x: V, y: V) -> Double<V> {
    let high = x + y;
    Double {
        high,
        low: (x - high) + y,
    }
}

/// A product, exactly.
#[inline(always)]
fn product<V: Vector>(x: V, y: V) -> Double<V> {
    let high = x * y;
    Double {
        high,
        low: x.mul_sub(y, high),
    }
}

impl<V: Vector> Double<V> {
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let exact = product(self.high, other.high);
        let low = self.low.mul_add(other.high, exact.low);
        Double {
            high: exact.high,
            low: self.high.mul_add(other.low, low),
        }
    }
}

/// ln x to about 2⁻⁶⁵ of itself.
#[inline(always)]
fn precise<V: Vector>(k: V, m: V) -> Double<V> {
    const THIRD: [f64; 2] = [0.333_333_333_333_333_3, 1.850_371_707_708_594e-17];
    let f = m - V::splat(1.0);
    let whole = f + V::splat(2.0);
    let missing = f - (whole - V::splat(2.0));
    // s = f/(2 + f); ln m = 2 artanh s
    let quotient = f / whole;
    // f less quotient times whole and missing, both signs turned
    let short = quotient.mul_add(missing, quotient.mul_sub(whole, f));
    let s = Double {
        high: quotient,
        low: (V::splat(0.0) - short) / whole,
    };
    let w = s.times(s);
    // ((artanh s / s − 1)/s² − ⅓)/s² for |s| ≤ 0.1716, from Chebyshev's nodes
    let tail = w.high
        * polynomial(
            w.high,
            [
                0.2,
                0.111_111_111_108_273_67,
                0.076_922_974_672_989_59,
                0.058_530_978_449_406_82,
            ],
            [
                0.142_857_142_857_146_85,
                0.090_909_091_678_270_8,
                0.066_674_031_060_503_01,
                0.058_618_018_114_527_055,
            ],
        );
    let slope = sum(V::splat(THIRD[0]), tail);
    let slope = Double {
        high: slope.high,
        low: slope.low + V::splat(THIRD[1]),
    };
    let curve = s.times(w.times(slope));
    let mut artanh = sum(s.high, curve.high);
    artanh.low = artanh.low + (curve.low + s.low);
    let two = V::splat(2.0);
    let mut ln = sum(k * V::splat(LN_2[0]), two * artanh.high);
    ln.low = ln.low + (two * artanh.low + k * V::splat(LN_2[1]));
    sum(ln.high, ln.low)
}

/// x to the power of y; where the result is no normal number, or x is none above 0, the
/// library's.
#[inline(always)]
pub fn pow<V: Vector>(x: V, y: V) -> V {
    let Split { k, m, inside } = split(x);
    let ln = precise(k, m);
    let exponent = product(y, ln.high);
    let [r, shifted] = reduced(exponent.high);
    let r = r + y.mul_add(ln.low, exponent.low);
    let power = parts([r, shifted]).value(1.0);
    let is_normal = exponent.high.abs().below(V::splat(708.0));
    let inside = inside.and(is_normal);
    if inside.all() {
        return power;
    }
    power.rescued(inside, [x, y], f64::powf)
}
