//! Random numbers and intervals of every kind.

use lynkeus_expr::Interval;
use proptest::prelude::*;

pub const POWERS: [i32; 12] = [-9, -4, -3, -2, -1, 0, 1, 2, 3, 4, 7, 12];

/// Numbers of ordinary size, special ones, and of every magnitude including subnormal.
pub fn number() -> impl Strategy<Value = f64> {
    let special = prop::sample::select(vec![
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        2.0,
        -3.0,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        f64::from_bits(1),
        -f64::from_bits(1),
        std::f64::consts::PI,
        -std::f64::consts::FRAC_PI_2,
        1.0_f64.next_down(),
    ]);
    prop_oneof![
        6 => -10.0..10.0,
        2 => (-20_i32..20).prop_map(|n| f64::from(n) / 2.0),
        2 => special,
        1 => -1e6..1e6,
        1 => prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL,
    ]
}

/// An interval and a member of it.
pub fn interval_and_member() -> impl Strategy<Value = (Interval, f64)> {
    let width = prop_oneof![
        1 => Just(0.0),
        2 => 0.0..1e-9,
        3 => 0.0..10.0,
        1 => number().prop_map(f64::abs),
        1 => Just(f64::INFINITY),
    ];
    (number(), width, 0.0..=1.0, any::<bool>()).prop_map(|(end, width, place, upwards)| {
        let other = if upwards { end + width } else { end - width };
        let x = Interval::new(end.min(other), end.max(other)).unwrap_or(Interval::point(end));
        (x, member(x, place))
    })
}

/// The member at a place between 0 (the lower bound) and 1 (the upper bound).
pub fn member(x: Interval, place: f64) -> f64 {
    let lo = x.lo().max(f64::MIN);
    let hi = x.hi().min(f64::MAX);
    match place {
        p if p < 0.15 => lo,
        p if p > 0.85 => hi,
        p => ((1.0 - p) * lo + p * hi).clamp(lo, hi),
    }
}

/// A bounded interval of moderate size.
pub fn moderate() -> impl Strategy<Value = Interval> {
    let width = prop_oneof![Just(0.0), 0.0..1e-6, 0.0..1.0];
    (-4.0..4.0, width)
        .prop_map(|(lo, width)| Interval::new(lo, lo + width).expect("a width is not negative"))
}
