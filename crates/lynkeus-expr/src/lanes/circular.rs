//! sin, cos and tan and their inverses, after fdlibm (Sun Microsystems, 1993). Of the argument
//! k·π/2 is taken away, then two polynomials serve on [−π/4, π/4].

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

use super::Vector;
use super::exponential::MAGIC;
use super::vector::{horner, polynomial};

/// π/2 in two parts.
const HALF_TURN: [f64; 2] = [FRAC_PI_2, 6.123_233_995_736_766e-17];

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
    let s = k.mul_add(V::splat(-HALF_TURN[0]), x);
    let r = k.mul_add(V::splat(-HALF_TURN[1]), s);
    // r is to s − k·low what rounding left of it, unless nearly all of s was cancelled
    let resolved = (k * V::splat(2e-16)).abs().at_most(r.abs());
    Reduced {
        over: k.mul_add(V::splat(HALF_TURN[1]), r - s),
        inside: x.abs().at_most(V::splat(LARGE)).and(resolved),
        r,
        shifted,
    }
}

impl<V: Vector> Reduced<V> {
    /// Whether k is odd, as a mask's sign, and the sign of the quadrant; k counted from `first`.
    #[inline(always)]
    fn quadrant(&self, first: u64) -> [V; 2] {
        let quadrant = self.shifted.plus_bits(V::splat(f64::from_bits(first)));
        [quadrant.up::<63>(), quadrant.up::<62>().signs()]
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

/// The sine, begun at that quarter of a turn.
#[inline(always)]
fn wave<V: Vector>(x: V, first: u64, library: fn(f64, f64) -> f64) -> V {
    let reduced = reduced(x);
    let [odd, sign] = reduced.quadrant(first);
    let y = V::choose(odd, reduced.cos(), reduced.sin()).xor(sign);
    y.rescued(reduced.inside, [x, x], library)
}

/// The sine; of huge arguments, and next to its zeros, the library's.
#[inline(always)]
pub fn sin<V: Vector>(x: V) -> V {
    wave(x, 0, |x, _| x.sin())
}

/// The cosine; of huge arguments, and next to its zeros, the library's.
#[inline(always)]
pub fn cos<V: Vector>(x: V) -> V {
    wave(x, 1, |x, _| x.cos())
}

/// The tangent; of huge arguments, and next to its zeros and poles, the library's.
#[inline(always)]
pub fn tan<V: Vector>(x: V) -> V {
    let reduced = reduced(x);
    let (sin, cos) = (reduced.sin(), reduced.cos());
    let [odd, _] = reduced.quadrant(0);
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
    let large = den.at_most(V::splat(1e300));
    let ratio = (den * V::splat(1e-300)).at_most(num);
    let inside = V::splat(1e-150).at_most(den).and(large).and(ratio);
    let inside = inside.or(V::splat(0.0)
        .below(x)
        .and(large)
        .and(V::splat(1e-150).at_most(den)));
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
