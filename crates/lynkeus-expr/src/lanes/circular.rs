//! sin, cos and tan, after fdlibm (Sun Microsystems, 1993): the argument less k·π/2, then two
//! polynomials on [−π/4, π/4].

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use super::Vector;
use super::exponential::MAGIC;
use super::vector::polynomial;

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
    /// Whether k is odd, as a mask's sign.
    #[inline(always)]
    fn is_odd(&self) -> V {
        self.shifted.up::<63>()
    }

    /// The sign of the quadrant, counted from `first`.
    #[inline(always)]
    fn sign(&self, first: u64) -> V {
        let quadrant = self.shifted.plus_bits(V::splat(f64::from_bits(first)));
        quadrant.up::<62>().signs()
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

/// The sine; of huge arguments, and next to its zeros, the library's.
#[inline(always)]
pub fn sin<V: Vector>(x: V) -> V {
    let reduced = reduced(x);
    let y = V::choose(reduced.is_odd(), reduced.cos(), reduced.sin()).xor(reduced.sign(0));
    if reduced.inside.all() {
        return y;
    }
    y.rescued(reduced.inside, [x, x], |x, _| x.sin())
}

/// The cosine; of huge arguments, and next to its zeros, the library's.
#[inline(always)]
pub fn cos<V: Vector>(x: V) -> V {
    let reduced = reduced(x);
    let y = V::choose(reduced.is_odd(), reduced.sin(), reduced.cos()).xor(reduced.sign(1));
    if reduced.inside.all() {
        return y;
    }
    y.rescued(reduced.inside, [x, x], |x, _| x.cos())
}

/// The tangent; of huge arguments, and next to its zeros and poles, the library's.
#[inline(always)]
pub fn tan<V: Vector>(x: V) -> V {
    let reduced = reduced(x);
    let (sin, cos) = (reduced.sin(), reduced.cos());
    let odd = reduced.is_odd();
    let quotient = V::choose(odd, cos, sin) / V::choose(odd, sin, cos);
    let y = quotient.xor(odd.signs());
    if reduced.inside.all() {
        return y;
    }
    y.rescued(reduced.inside, [x, x], |x, _| x.tan())
}
