//! eˣ, the hyperbolic functions, the logarithm and powers with real exponents.

use std::f64::consts::{FRAC_1_SQRT_2, LOG2_E};

use super::Vector;
use super::vector::polynomial;

/// Adding 1.5·2⁵² leaves the nearest whole number in the lowest bits.
pub(super) const MAGIC: f64 = 6_755_399_441_055_744.0;

/// ln 2 in two parts, the first of 33 bits (W. J. Cody, W. Waite: Software Manual for the
/// Elementary Functions, 1980).
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// Beyond, 2ᵏ may be no normal number.
const LARGE: f64 = 708.0;

/// x − k ln 2, and k + [`MAGIC`], for |x| below 10⁶.
#[inline(always)]
fn reduced<V: Vector>(x: V) -> [V; 2] {
    let shifted = x.mul_add(V::splat(LOG2_E), V::splat(MAGIC));
    let k = shifted - V::splat(MAGIC);
    let r = k.mul_add(V::splat(-LN_2[1]), k.mul_add(V::splat(-LN_2[0]), x));
    [r, shifted]
}

/// eʳ for r of at most ½ ln 2: from √½ to √2.
#[inline(always)]
fn mantissa<V: Vector>(r: V) -> V {
    // (eʳ − 1 − r)/r² for |r| ≤ ½ ln 2, from Chebyshev's nodes
    let rest = polynomial(
        r,
        [
            0.5,
            0.041_666_666_666_624_164,
            0.001_388_888_891_719_720_9,
            2.480_152_132_160_664_7e-5,
            2.762_007_624_252_725_4e-7,
        ],
        [
            0.166_666_666_666_666_69,
            0.008_333_333_333_330_065,
            0.000_198_412_698_630_409_22,
            2.755_726_847_972_400_4e-6,
            2.510_037_611_136_142e-8,
        ],
    );
    V::splat(1.0) + rest.mul_add(r * r, r)
}

/// 2ᵏ·unit, from k + [`MAGIC`].
#[inline(always)]
fn power<V: Vector>(shifted: V, unit: f64) -> V {
    shifted.up::<52>().plus_bits(V::splat(unit))
}

/// eʳ·2ᵏ·unit where that is normal, from r and k + [`MAGIC`].
#[inline(always)]
fn joined<V: Vector>([r, shifted]: [V; 2], unit: f64) -> V {
    mantissa(r) * power(shifted, unit)
}

/// eˣ·unit for a unit of 1 or ½.
#[inline(always)]
fn scaled<V: Vector>(x: V, unit: f64) -> V {
    if x.abs().below(V::splat(LARGE)).all() {
        return joined(reduced(x), unit);
    }
    extreme(x, unit)
}

/// As [`scaled`] also where the result is subnormal, zero or infinite; the same elsewhere.
#[inline(always)]
fn extreme<V: Vector>(x: V, unit: f64) -> V {
    let x = V::splat(760.0).smaller(x);
    let x = V::choose(x.below(V::splat(-760.0)), V::splat(-760.0), x);
    let [r, shifted] = reduced(x);
    let k = shifted - V::splat(MAGIC);
    let half = k.mul_add(V::splat(0.5), V::splat(MAGIC));
    let rest = (k - (half - V::splat(MAGIC))) + V::splat(MAGIC);
    mantissa(r) * power(half, 1.0) * power(rest, unit)
}

/// eˣ.
#[inline(always)]
pub fn exp<V: Vector>(x: V) -> V {
    scaled(x, 1.0)
}

/// ½ e^|x| and ½ e^−|x|.
#[inline(always)]
fn halves<V: Vector>(x: V) -> [V; 2] {
    let growing = scaled(x.abs(), 0.5);
    [growing, V::splat(0.25) / growing]
}

/// The hyperbolic sine.
#[inline(always)]
pub fn sinh<V: Vector>(x: V) -> V {
    let a = x.abs();
    let [growing, fading] = halves(x);
    let z = a * a;
    // (sinh a / a − 1)/a² for a ≤ 1, from Chebyshev's nodes
    let rest = polynomial(
        z,
        [
            0.166_666_666_666_666_66,
            0.000_198_412_698_412_697_73,
            2.505_210_836_405_804e-8,
            7.646_625_361_656_657e-13,
        ],
        [
            0.008_333_333_333_333_333,
            2.755_731_922_404_034e-6,
            1.605_904_839_635_056_2e-10,
            2.844_526_416_989_528_5e-15,
        ],
    );
    let small = rest.mul_add(a * z, a);
    let y = V::choose(a.below(V::splat(1.0)), small, growing - fading);
    y.or(x.signs())
}

/// The hyperbolic cosine.
#[inline(always)]
pub fn cosh<V: Vector>(x: V) -> V {
    let [growing, fading] = halves(x);
    growing + fading
}

/// The hyperbolic tangent.
#[inline(always)]
pub fn tanh<V: Vector>(x: V) -> V {
    let a = V::splat(22.0).smaller(x.abs());
    let z = a * a;
    // (tanh a / a − 1)/a² for a ≤ 0.55, from Chebyshev's nodes
    let rest = polynomial(
        z,
        [
            -0.333_333_333_333_333_3,
            -0.053_968_253_967_434_016,
            -0.008_863_234_397_814_355,
            -0.001_455_661_830_100_716,
            -0.000_234_634_741_088_723_7,
            -2.060_276_537_636_634e-5,
        ],
        [
            0.133_333_333_333_327_14,
            0.021_869_488_493_666_944,
            0.003_592_110_378_689_024,
            0.000_588_936_052_007_405_7,
            8.511_313_685_577_672e-5,
        ],
    );
    let small = rest.mul_add(a * z, a);
    let square = joined(reduced(a + a), 1.0);
    let large = V::splat(1.0) - V::splat(2.0) / (square + V::splat(1.0));
    V::choose(a.below(V::splat(0.55)), small, large).or(x.signs())
}

const TWO_52: f64 = 4_503_599_627_370_496.0;
const BIAS: u64 = 1024;

/// [k, m, inside] of x = 2ᵏ·m with m from √½ to √2; `inside` where x is positive and normal: the parts
/// mean something there.
#[inline(always)]
fn split<V: Vector>(x: V) -> [V; 3] {
    let root = FRAC_1_SQRT_2.to_bits();
    let bits = |bits: u64| V::splat(f64::from_bits(bits));
    let above = x.plus_bits(bits((BIAS << 52).wrapping_sub(root)));
    let k = above.down::<52>().or(V::splat(TWO_52)) - V::splat(TWO_52 + BIAS as f64);
    let fraction = above.and(bits((1 << 52) - 1));
    let is_normal = V::splat(f64::MIN_POSITIVE).at_most(x);
    let inside = is_normal.and(x.at_most(V::splat(f64::MAX)));
    [k, fraction.plus_bits(bits(root)), inside]
}

/// The natural logarithm, after fdlibm; of subnormal numbers the library's.
#[inline(always)]
pub fn ln<V: Vector>(x: V) -> V {
    let [k, m, inside] = split(x);
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
    let [k, m, inside] = split(x);
    let ln = precise(k, m);
    let exponent = product(y, ln.high);
    let [r, shifted] = reduced(exponent.high);
    let r = r + y.mul_add(ln.low, exponent.low);
    let power = joined([r, shifted], 1.0);
    let is_normal = exponent.high.abs().below(V::splat(708.0));
    let inside = inside.and(is_normal);
    power.rescued(inside, [x, y], f64::powf)
}
