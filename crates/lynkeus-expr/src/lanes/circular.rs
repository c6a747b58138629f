//! sin, cos and tan and their inverses. For sin and cos k·π is taken away, then one polynomial serves on
//! [−π/2, π/2]; the others are after fdlibm (Sun Microsystems, 1993), tan with π/2.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

use super::Vector;
use super::exponential::MAGIC;
use super::vector::{horner, polynomial};

/// π in three parts, the second and third with the sign of the first: 0 keeps its own sign then.
const HALF_TURN: [f64; 3] = [PI, 1.224_646_799_147_353e-16, 2.165_713_347_843_828e-32];
/// Up to here k has all its digits.
const HUGE: f64 = 1e9;

/// The sine of x, or the cosine, which is the sine of x + π/2, π/2 being `quarter` of π: with k·π taken away
/// it is that of −π/2 to π/2, but for the sign where k is odd.
#[inline(always)]
fn wave<V: Vector>(x: V, quarter: Option<f64>, library: fn(f64, f64) -> f64) -> V {
    let by_pi = V::splat(FRAC_1_PI);
    let (shifted, turns) = match quarter {
        None => {
            let shifted = x.mul_add(by_pi, V::splat(MAGIC));
            (shifted, shifted - V::splat(MAGIC))
        }
        Some(quarter) => {
            let quarter = V::splat(quarter);
            let shifted = x.mul_add(by_pi, quarter) + V::splat(MAGIC);
            (shifted, (shifted - V::splat(MAGIC)) - quarter)
        }
    };
    let less = |rest: V, part: f64| turns.mul_add(V::splat(-part), rest);
    let r = HALF_TURN.into_iter().fold(x, less);
    let (a, z) = (r.abs(), r * r);
    // (sin √z / √z − 1)/z, within 2⁻⁶⁰ of the sine
    let bent = polynomial(
        z,
        [
            -1.666_666_666_666_666_6e-1,
            -1.984_126_984_122_165_4e-4,
            -2.505_210_698_017_568e-8,
            -7.643_057_638_606_719e-13,
        ],
        [
            8.333_333_333_333_24e-3,
            2.755_731_921_273_418_6e-6,
            1.605_894_353_020_852e-10,
            2.721_582_092_018_794e-15,
        ],
    );
    let y = (a * z).mul_add(bent, a).smaller(V::splat(1.0));
    let signed = y.or(r.signs()).xor(shifted.up::<63>());
    let inside = x.abs().at_most(V::splat(HUGE));
    signed.rescued(inside, [x, x], library)
}

/// The sine; of huge arguments the library's.
#[inline(always)]
pub fn sin<V: Vector>(x: V) -> V {
    wave(x, None, |x, _| x.sin())
}

/// The cosine; of huge arguments the library's.
#[inline(always)]
pub fn cos<V: Vector>(x: V) -> V {
    wave(x, Some(0.5), |x, _| x.cos())
}

/// π/2 in two parts.
const QUARTER_TURN: [f64; 2] = [FRAC_PI_2, 6.123_233_995_736_766e-17];

/// Up to here x less k times the first part is exact.
const LARGE: f64 = 1.6e6;

/// x − k·π/2 = r − over.
struct Reduced<V> {
    r: V,
    over: V,
    /// k + [`MAGIC`]
    shifted: V,
    /// where r has all its digits
    inside: V,
}

#[inline(always)]
fn reduced<V: Vector>(x: V) -> Reduced<V> {
    let shifted = x.mul_add(V::splat(FRAC_2_PI), V::splat(MAGIC));
    let k = shifted - V::splat(MAGIC);
    let s = k.mul_add(V::splat(-QUARTER_TURN[0]), x);
    let r = k.mul_add(V::splat(-QUARTER_TURN[1]), s);
    // r is to s − k·low what rounding left of it, unless nearly all of s was cancelled
    let resolved = (k * V::splat(2e-16)).abs().at_most(r.abs());
    Reduced {
        over: k.mul_add(V::splat(QUARTER_TURN[1]), r - s),
        inside: x.abs().at_most(V::splat(LARGE)).and(resolved),
        r,
        shifted,
    }
}

impl<V: Vector> Reduced<V> {
    /// Whether k is odd, as a mask's sign.
    #[inline(always)]
    fn is_odd(&self) -> V {
        self.shifted.up::<63>()
    }

    /// sin(r − over).
    #[inline(always)]
    fn sin(&self) -> V {
        let Self { r, over, .. } = *self;
        let z = r * r;
        let slope = polynomial(
            z,
            [
                1.666_666_666_666_663_2e-1,
                1.984_126_982_985_795e-4,
                2.505_076_025_340_686_3e-8,
            ],
            [
                -8.333_333_333_322_49e-3,
                -2.755_731_370_707_006_8e-6,
                -1.589_690_995_211_55e-10,
            ],
        );
        // over times cos r
        let turned = over * z.mul_add(V::splat(-0.5), V::splat(1.0));
        r - slope.mul_add(z * r, turned)
    }

    /// cos(r − over).
    #[inline(always)]
    fn cos(&self) -> V {
        let Self { r, over, .. } = *self;
        let z = r * r;
        let rest = polynomial(
            z,
            [
                4.166_666_666_666_66e-2,
                2.480_158_728_947_673e-5,
                2.087_572_321_298_175e-9,
            ],
            [
                -1.388_888_888_887_411e-3,
                -2.755_731_435_139_066_3e-7,
                -1.135_964_755_778_819_5e-11,
            ],
        );
        let half = V::splat(0.5) * z;
        let w = V::splat(1.0) - half;
        let lost = (V::splat(1.0) - w) - half;
        w + rest.mul_add(z * z, r.mul_add(over, lost))
    }
}

/// The tangent; of huge arguments, and next to its zeros and poles, the library's.
#[inline(always)]
pub fn tan<V: Vector>(x: V) -> V {
    let reduced = reduced(x);
    let (sin, cos) = (reduced.sin(), reduced.cos());
    let odd = reduced.is_odd();
    let quotient = V::choose(odd, cos, sin) / V::choose(odd, sin, cos);
    let y = quotient.xor(odd.signs());
    y.rescued(reduced.inside, [x, x], |x, _| x.tan())
}

/// What π/4 is more than its `f64`.
const QUARTER_LOW: f64 = 3.061_616_997_868_383e-17;
/// tan(π/8)
const STEEP: f64 = 0.414_213_562_373_095_03;

/// q·π/4 ± arctan of a ratio.
struct Angle<V> {
    quarters: V,
    /// arctan(t), odd in t
    t: V,
    /// t − arctan(t)
    curve: V,
}

/// The angle whose tangent is num/den, from numbers 0 ≤ num ≤ den.
#[inline(always)]
fn angle<V: Vector>(num: V, den: V) -> Angle<V> {
    let steep = (den * V::splat(STEEP)).below(num);
    let t = V::choose(steep, num - den, num) / V::choose(steep, num + den, den);
    let z = t * t;
    let rest = polynomial(
        z,
        [
            3.333_333_333_333_293e-1,
            1.428_571_427_250_346_6e-1,
            9.090_887_133_436_507e-2,
            6.661_073_137_387_531e-2,
            4.976_877_994_615_932e-2,
            1.628_582_011_536_578_2e-2,
        ],
        [
            -1.999_999_999_987_648_3e-1,
            -1.111_111_040_546_235_6e-1,
            -7.691_876_205_044_83e-2,
            -5.833_570_133_790_573_5e-2,
            -3.653_157_274_421_691_6e-2,
        ],
    );
    Angle {
        quarters: steep.and(V::splat(1.0)),
        t,
        curve: t * (z * rest),
    }
}

impl<V: Vector> Angle<V> {
    /// q quarters less this angle, where the mask's sign is set.
    #[inline(always)]
    fn turned(self, mask: V, q: f64) -> Self {
        let sign = mask.signs();
        Self {
            quarters: V::choose(mask, V::splat(q) - self.quarters, self.quarters),
            t: self.t.xor(sign),
            curve: self.curve.xor(sign),
        }
    }

    #[inline(always)]
    fn value(self) -> V {
        let low = self.quarters * V::splat(QUARTER_LOW);
        let own = self.t - (self.curve - low);
        self.quarters.mul_add(V::splat(FRAC_PI_4), own)
    }
}

/// The inverse tangent.
#[inline(always)]
pub fn atan<V: Vector>(x: V) -> V {
    let (a, one) = (x.abs(), V::splat(1.0));
    let inverted = one.below(a);
    let num = V::choose(inverted, one, a);
    let den = V::choose(inverted, a, one);
    angle(num, den).turned(inverted, 2.0).value().or(x.signs())
}

/// The angle of the point (x, y); where a coordinate or their ratio is extreme, the library's.
#[inline(always)]
pub fn atan2<V: Vector>(y: V, x: V) -> V {
    let (a, b) = (y.abs(), x.abs());
    let inverted = b.below(a);
    let num = V::choose(inverted, b, a);
    let den = V::choose(inverted, a, b);
    let found = angle(num, den).turned(inverted, 2.0).turned(x, 4.0);
    let angle = found.value().or(y.signs());
    // to the left the ratio must not underflow, to the right it may
    let least = V::choose(x, num, den);
    let inside = V::splat(1e-150)
        .at_most(least)
        .and(den.at_most(V::splat(1e300)));
    angle.rescued(inside, [y, x], f64::atan2)
}

/// (arcsin √z / √z − 1) for z ≤ ¼.
#[inline(always)]
fn excess<V: Vector>(z: V) -> V {
    let above = polynomial(
        z,
        [
            1.666_666_666_666_666_6e-1,
            2.012_125_321_348_629_3e-1,
            7.915_349_942_898_145e-4,
        ],
        [
            -3.255_658_186_224_009e-1,
            -4.005_553_450_067_941e-2,
            3.479_331_075_960_212e-5,
        ],
    );
    let below = horner(
        z,
        [
            1.0,
            -2.403_394_911_734_414,
            2.020_945_760_233_505_7,
            -6.882_839_716_054_533e-1,
            7.703_815_055_590_194e-2,
        ],
    );
    z * above / below
}

/// [is_far, s, arcsin s − s]: where |x| ≥ ½ the angle is found from s = √((1 − |x|)/2), else from
/// |x| itself.
#[inline(always)]
fn chord<V: Vector>(a: V) -> [V; 3] {
    let is_far = V::splat(0.5).at_most(a);
    let z = V::choose(is_far, (V::splat(1.0) - a) * V::splat(0.5), a * a);
    let s = V::choose(is_far, z.sqrt(), a);
    [is_far, s, s * excess(z)]
}

/// The inverse sine.
#[inline(always)]
pub fn asin<V: Vector>(x: V) -> V {
    let [is_far, s, curve] = chord(x.abs());
    let two = V::splat(2.0);
    let far = (V::splat(FRAC_PI_2) - two * s) - (two * curve - V::splat(2.0 * QUARTER_LOW));
    V::choose(is_far, far, s + curve).or(x.signs())
}

/// The inverse cosine.
#[inline(always)]
pub fn acos<V: Vector>(x: V) -> V {
    let [is_far, s, curve] = chord(x.abs());
    let two = V::splat(2.0);
    let low = V::splat(2.0 * QUARTER_LOW);
    let (signed, bent) = (s.xor(x.signs()), curve.xor(x.signs()));
    let near = V::splat(FRAC_PI_2) - (signed - (low - bent));
    let right = two * (s + curve);
    let left = V::splat(PI) - two * (s + (curve - low));
    V::choose(is_far, V::choose(x, left, right), near)
}
