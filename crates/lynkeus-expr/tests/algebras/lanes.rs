//! The functions in lanes beside multiple precision: greatest errors, special values, and that no
//! lane sees another.

use crate::exact::Exact;
use crate::library::units;
use lynkeus_expr::lanes::Lanes;
use lynkeus_expr::{Algebra, Binary, Reals, Unary};

/// A function, where its arguments lie, and the greatest error that is documented.
struct Subject {
    op: Op,
    ulp: f64,
    /// ranges of the argument, with those of the second one for functions of two
    ranges: Vec<[(f64, f64); 2]>,
}

#[derive(Clone, Copy, Debug)]
enum Op {
    One(Unary),
    Two(Binary),
}

impl Op {
    fn over<A: Algebra>(self, algebra: &A, x: f64, y: f64) -> A::Value {
        let [x, y] = [x, y].map(|x| algebra.constant(x));
        match self {
            Op::One(op) => algebra.unary(op, &x),
            Op::Two(op) => algebra.binary(op, &x, &y),
        }
    }

    fn lane(self, x: f64, y: f64) -> f64 {
        self.over(&Lanes::<1>, x, y)[0]
    }

    fn together(self, x: [f64; 4], y: [f64; 4]) -> [f64; 4] {
        match self {
            Op::One(op) => Lanes::<4>.unary(op, &x),
            Op::Two(op) => Lanes::<4>.binary(op, &x, &y),
        }
    }
}

fn subjects() -> Vec<Subject> {
    let one = |op: Unary, ulp: f64, ranges: &[(f64, f64)]| Subject {
        op: Op::One(op),
        ulp,
        ranges: ranges.iter().map(|&range| [range, (0.0, 0.0)]).collect(),
    };
    let two = |op: Binary, ulp: f64, ranges: &[[(f64, f64); 2]]| Subject {
        op: Op::Two(op),
        ulp,
        ranges: ranges.to_vec(),
    };
    let circle = [(-4.0, 4.0), (-1e3, 1e3), (-1.6e6, 1.6e6), (-1e-3, 1e-3)];
    let wave = [(-4.0, 4.0), (-1e3, 1e3), (-1e9, 1e9), (-1e-3, 1e-3)];
    let unit = [(-1.0, 1.0), (-0.01, 0.01), (0.45, 0.55), (0.99, 1.0)];
    let hyperbola = [(-1.0, 1.0), (-5.0, 5.0), (-710.0, 710.0), (0.9, 1.1)];
    vec![
        one(
            Unary::Exp,
            1.1,
            &[
                (-0.4, 0.4),
                (-30.0, 30.0),
                (-708.0, 709.7),
                (-745.0, -707.0),
            ],
        ),
        one(
            Unary::Ln,
            0.8,
            &[
                (0.5, 2.0),
                (0.99, 1.01),
                (1e-3, 1e3),
                (1e-300, 1e-290),
                (1.0, 1e300),
            ],
        ),
        one(Unary::Sin, 2.0, &wave),
        one(Unary::Cos, 2.0, &wave),
        one(Unary::Tan, 1.8, &circle),
        one(Unary::Asin, 1.8, &unit),
        one(Unary::Acos, 1.8, &unit),
        one(
            Unary::Atan,
            1.8,
            &[
                (-1.0, 1.0),
                (-10.0, 10.0),
                (0.4, 0.45),
                (2.3, 2.5),
                (1e3, 1e10),
            ],
        ),
        one(Unary::Sinh, 1.6, &hyperbola),
        one(Unary::Cosh, 1.6, &hyperbola),
        one(
            Unary::Tanh,
            1.6,
            &[(-0.6, 0.6), (-3.0, 3.0), (-25.0, 25.0), (0.5, 0.6)],
        ),
        two(
            Binary::Pow,
            1.2,
            &[
                [(0.5, 2.0), (-3.0, 3.0)],
                [(0.5, 2.0), (-1000.0, 1000.0)],
                [(0.0, 10.0), (-300.0, 300.0)],
                [(0.999, 1.001), (-5e5, 5e5)],
                [(1e-300, 1e-290), (-1.02, 1.02)],
            ],
        ),
        two(
            Binary::Atan2,
            1.8,
            &[
                [(-1.0, 1.0), (-1.0, 1.0)],
                [(-10.0, 10.0), (-0.1, 0.1)],
                [(-1e10, 1e10), (-1.0, 1.0)],
            ],
        ),
    ]
}

/// A generator of random numbers (xorshift64*, S. Vigna 2016).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn between(&mut self, (low, high): (f64, f64)) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / 2_f64.powi(53))
    }
}

const SPECIAL: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    2.0,
    3.0,
    -3.0,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    1e-310,
    f64::MAX,
    f64::MIN,
    1e22,
    -1e300,
    1.6e6,
    710.0,
    -745.2,
    1e-20,
];

/// At `count` points of each range, every other one of a grid and the rest random.
fn check(count: usize) {
    let (space, mut random) = (Exact(192), Random(0x9E37_79B9_7F4A_7C15));
    for Subject { op, ulp, ranges } in subjects() {
        let (mut worst, mut at) = (0.0, [0.0; 2]);
        for [range, second] in ranges {
            for k in 0..count {
                let grid = range.0 + (range.1 - range.0) * (k as f64 + 0.5) / count as f64;
                let x = if k % 2 == 0 {
                    grid
                } else {
                    random.between(range)
                };
                let y = random.between(second);
                let (found, library) = (op.lane(x, y), op.over(&Reals, x, y));
                // what is no number has no units
                if !library.is_finite() || library == 0.0 {
                    assert!(same(found, library), "{op:?} of {x}, {y} is {found}");
                    continue;
                }
                assert!(found.is_finite(), "{op:?} of {x}, {y} is {found}");
                let error = units(found, &op.over(&space, x, y));
                if error > worst {
                    (worst, at) = (error, [x, y]);
                }
            }
        }
        eprintln!("{op:?}: {worst:.3} ulp at {at:?}");
        assert!(worst <= ulp, "{op:?}: {worst} units at {at:?}");
    }
}

#[test]
fn errors_of_lanes_are_as_stated() {
    check(500);
}

#[test]
#[ignore = "a minute"]
fn errors_of_lanes_are_as_stated_at_very_many_points() {
    check(5_000);
}

fn same(x: f64, y: f64) -> bool {
    x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan())
}

/// Zeros with their signs, infinities and NaN are the library's, and everything else is near it.
#[test]
fn special_arguments_in_lanes_give_what_the_library_gives() {
    for Subject { op, .. } in subjects() {
        for x in SPECIAL {
            for y in SPECIAL {
                let (found, expected) = (op.lane(x, y), op.over(&Reals, x, y));
                let holds = is_near(found, expected);
                assert!(holds, "{op:?} of {x}, {y} is {found} and not {expected}");
            }
        }
    }
}

/// A few units from the library's; the same where that is zero or no number.
fn is_near(found: f64, expected: f64) -> bool {
    let is_special = expected == 0.0 || !expected.is_finite();
    let distance = (found - expected).abs();
    let is_near = distance <= 4.0 * f64::EPSILON * expected.abs() || distance < 1e-323;
    same(found, expected) || (!is_special && is_near)
}

/// Where the functions go over from one formula to another, or to the library's.
const SEAMS: [f64; 22] = [
    f64::MIN_POSITIVE,
    1e-150,
    1e-8,
    0.414_213_562_373_095_03,
    0.5,
    0.55,
    std::f64::consts::FRAC_1_SQRT_2,
    std::f64::consts::FRAC_PI_4,
    1.0,
    std::f64::consts::SQRT_2,
    std::f64::consts::FRAC_PI_2,
    2.414_213_562_373_095,
    22.0,
    354.5,
    708.0,
    709.782_712_893_384,
    710.475_860_073_943_9,
    745.133_219_101_941_1,
    1.6e6,
    1e150,
    1e300,
    f64::MAX,
];

/// On both sides of every seam, and as powers of what is nearly 1.
#[test]
fn no_seam_shows() {
    let beside = |x: f64| [x, x.next_up(), x.next_down()].map(|x| [x, -x]);
    let arguments = SEAMS.map(beside);
    let arguments: Vec<f64> = arguments.as_flattened().as_flattened().to_vec();
    for Subject { op, .. } in subjects() {
        for &x in &arguments {
            for &y in &arguments {
                let (found, expected) = (op.lane(x, y), op.over(&Reals, x, y));
                let holds = is_near(found, expected);
                assert!(
                    holds,
                    "{op:?} of {x:e}, {y:e} is {found:e} and not {expected:e}"
                );
            }
        }
    }
    let power = Op::Two(Binary::Pow);
    for base in [1.0_f64.next_up(), 1.0_f64.next_down(), 1.0 + 1e-12] {
        for exponent in [1e12, -3.7e15, 1.5e17, 3e18, -1e19, 1e300, 5e-324] {
            let (found, expected) = (power.lane(base, exponent), base.powf(exponent));
            assert!(
                is_near(found, expected),
                "{base:e}^{exponent:e}: {found:e} {expected:e}"
            );
        }
    }
}

/// The results of bounded functions stay within the bounds of the exact ones.
fn bound(op: Op) -> f64 {
    match op {
        Op::One(Unary::Sin | Unary::Cos | Unary::Tanh) => 1.0,
        Op::One(Unary::Asin | Unary::Atan) => std::f64::consts::FRAC_PI_2,
        Op::One(Unary::Acos) | Op::Two(Binary::Atan2) => std::f64::consts::PI,
        _ => f64::INFINITY,
    }
}

/// Of random numbers, half of them of any size.
#[test]
fn lanes_do_not_see_each_other_and_are_near_the_library() {
    let mut random = Random(42);
    for Subject { op, .. } in subjects() {
        for _ in 0..5_000 {
            let mut draw = |is_wild: bool| match is_wild {
                true => f64::from_bits(random.bits()),
                false => random.between((-3.0, 3.0)),
            };
            let x = [draw(true), draw(false), draw(true), draw(false)];
            let y = [draw(false), draw(false), draw(true), draw(true)];
            for (lane, found) in op.together(x, y).into_iter().enumerate() {
                let alone = op.lane(x[lane], y[lane]);
                assert!(
                    same(alone, found),
                    "{op:?} of {x:?}, {y:?}: {alone} {found}"
                );
                let library = op.over(&Reals, x[lane], y[lane]);
                assert!(
                    is_near(alone, library),
                    "{op:?} of {:e}, {:e} is {alone:e} and not {library:e}",
                    x[lane],
                    y[lane]
                );
                let is_inside = alone.is_nan() || alone.abs() <= bound(op);
                assert!(is_inside, "{op:?} of {} is {alone}", x[lane]);
            }
        }
    }
}

/// The numbers nearest to k·π/2, whose functions have only the digits beyond the 53rd of π.
#[test]
fn next_to_zeros_every_digit_is_kept() {
    let space = Exact(256);
    let mut worst = 0.0_f64;
    for k in (1..1_000_000_u32)
        .step_by(997)
        .chain([2, 3, 4, 710, 1_000_000])
    {
        let x = f64::from(k) * std::f64::consts::FRAC_PI_2;
        for x in [x, -x, x.next_up(), x.next_down()] {
            for op in [Unary::Sin, Unary::Cos, Unary::Tan].map(Op::One) {
                worst = worst.max(units(op.lane(x, 0.0), &op.over(&space, x, 0.0)));
            }
        }
    }
    assert!(worst < 1.8, "{worst}");
}
