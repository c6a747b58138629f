//! The reference: an algebra of numbers with as many bits as wanted, by the `astro-float` library.

use astro_float_num::{BigFloat, Consts, RoundingMode};
use lynkeus_expr::{Algebra, Binary, Implicit, Interval, Reals, Unary};
use std::cell::RefCell;

const NEAREST: RoundingMode = RoundingMode::ToEven;

thread_local! {
    static CONSTANTS: RefCell<Consts> = RefCell::new(Consts::new().expect("memory for constants"));
}

/// Numbers of this many bits.
#[derive(Clone, Copy)]
pub struct Exact(pub usize);

/// The calls that take a precision, a rounding mode and, where needed, the cache of constants.
macro_rules! rounded {
    ($self:ident, $x:expr, $name:ident) => {
        $x.$name($self.0, NEAREST)
    };
    ($self:ident, $x:expr, $name:ident, constants) => {
        CONSTANTS.with_borrow_mut(|constants| $x.$name($self.0, NEAREST, constants))
    };
}

impl Exact {
    pub fn add(self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.add(y, self.0, NEAREST)
    }

    pub fn sub(self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.sub(y, self.0, NEAREST)
    }

    pub fn mul(self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.mul(y, self.0, NEAREST)
    }

    pub fn div(self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.div(y, self.0, NEAREST)
    }

    /// 2^k.
    pub fn power_of_two(self, k: i32) -> BigFloat {
        let mut value = self.constant(1.0);
        value.set_exponent(k + 1);
        value
    }

    fn number(self, holds: bool) -> BigFloat {
        self.constant(f64::from(u8::from(holds)))
    }

    fn sign(self, x: &BigFloat) -> BigFloat {
        match x {
            x if x.is_nan() || x.is_zero() => x.clone(),
            x if x.is_negative() => self.constant(-1.0),
            _ => self.constant(1.0),
        }
    }

    /// As `f64::powf`: also negative bases with integer exponents.
    fn pow(self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        if y.is_zero() {
            return self.constant(1.0);
        }
        if x.is_zero() {
            return self.constant(if y.is_negative() { f64::INFINITY } else { 0.0 });
        }
        if x.is_positive() {
            // asked to round correctly, the library looks for ever at some arguments
            let more = self.0 + 128;
            let power = CONSTANTS.with_borrow_mut(|c| x.pow(y, more, RoundingMode::None, c));
            return power.mul(&self.constant(1.0), self.0, NEAREST);
        }
        if !y.is_int() {
            return self.constant(f64::NAN);
        }
        let size = self.pow(&x.neg(), y);
        let half = self.mul(y, &self.constant(0.5));
        if half.is_int() { size } else { size.neg() }
    }

    fn atan2(self, y: &BigFloat, x: &BigFloat) -> BigFloat {
        let pi = CONSTANTS.with_borrow_mut(|c| c.pi(self.0, NEAREST));
        if x.is_zero() {
            let half = self.mul(&pi, &self.constant(0.5));
            return self.mul(&half, &self.sign(y));
        }
        let angle = self.unary(Unary::Atan, &self.div(y, x));
        match (x.is_negative(), y.is_negative() && !y.is_zero()) {
            (false, _) => angle,
            (true, false) => self.add(&angle, &pi),
            (true, true) => self.sub(&angle, &pi),
        }
    }
}

impl Algebra for Exact {
    type Value = BigFloat;

    fn constant(&self, value: f64) -> BigFloat {
        let mut scaled = BigFloat::from_f64(value, self.0);
        if value.is_subnormal() {
            // The library misreads subnormal numbers: convert a normal one and scale it down.
            scaled = BigFloat::from_f64(value * 2.0_f64.powi(200), self.0);
            scaled.set_exponent(scaled.exponent().unwrap_or(0) - 200);
        }
        scaled
    }

    fn unary(&self, op: Unary, x: &BigFloat) -> BigFloat {
        if x.is_nan() && op != Unary::Not {
            return x.clone();
        }
        match op {
            Unary::Neg => x.neg(),
            Unary::Abs => x.abs(),
            Unary::Sign => self.sign(x),
            Unary::Floor => x.floor(),
            Unary::Sqrt => rounded!(self, x, sqrt),
            Unary::Exp => rounded!(self, x, exp, constants),
            Unary::Ln if x.is_zero() => self.constant(f64::NAN),
            Unary::Ln => rounded!(self, x, ln, constants),
            Unary::Sin => rounded!(self, x, sin, constants),
            Unary::Cos => rounded!(self, x, cos, constants),
            Unary::Tan => rounded!(self, x, tan, constants),
            Unary::Asin => rounded!(self, x, asin, constants),
            Unary::Acos => rounded!(self, x, acos, constants),
            Unary::Atan => rounded!(self, x, atan, constants),
            Unary::Sinh => rounded!(self, x, sinh, constants),
            Unary::Cosh => rounded!(self, x, cosh, constants),
            Unary::Tanh => rounded!(self, x, tanh, constants),
            Unary::Not => self.number(x.is_zero()),
        }
    }

    fn powi(&self, x: &BigFloat, n: i32) -> BigFloat {
        let one = self.constant(1.0);
        let power = (0..n.unsigned_abs()).fold(one.clone(), |power, _| self.mul(&power, x));
        if n < 0 { self.div(&one, &power) } else { power }
    }

    fn binary(&self, op: Binary, x: &BigFloat, y: &BigFloat) -> BigFloat {
        let truth = |x: &BigFloat| !x.is_zero();
        if (x.is_nan() || y.is_nan()) && !matches!(op, Binary::And | Binary::Or) {
            let relation = matches!(op, Binary::Less | Binary::LessEq | Binary::Equal);
            return self.constant(if relation { 0.0 } else { f64::NAN });
        }
        match op {
            Binary::Add => self.add(x, y),
            Binary::Sub => self.sub(x, y),
            Binary::Mul => self.mul(x, y),
            Binary::Div => self.div(x, y),
            Binary::Pow => self.pow(x, y),
            Binary::Atan2 => self.atan2(x, y),
            Binary::Min => if x <= y { x } else { y }.clone(),
            Binary::Max => if x <= y { y } else { x }.clone(),
            Binary::Less => self.number(x < y),
            Binary::LessEq => self.number(x <= y),
            Binary::Equal => self.number(x == y),
            Binary::And => self.number(truth(x) && truth(y)),
            Binary::Or => self.number(truth(x) || truth(y)),
        }
    }

    fn select(&self, condition: &BigFloat, x: &BigFloat, y: &BigFloat) -> BigFloat {
        match condition {
            c if c.is_nan() => c.clone(),
            c if c.is_zero() => y.clone(),
            _ => x.clone(),
        }
    }

    /// Gauss–Jordan elimination with row pivoting. The condition estimate has no independent value: it is NaN.
    fn solve(&self, a: &[BigFloat], b: &[BigFloat]) -> (Vec<BigFloat>, BigFloat) {
        let n = b.len();
        let mut rows: Vec<Vec<BigFloat>> = (0..n)
            .map(|i| {
                a[i * n..(i + 1) * n]
                    .iter()
                    .chain([&b[i]])
                    .cloned()
                    .collect()
            })
            .collect();
        for k in 0..n {
            let larger = |&i: &usize, &j: &usize| {
                let order = rows[i][k].abs_cmp(&rows[j][k]).unwrap_or(0);
                order.cmp(&0)
            };
            let pivot = (k..n).max_by(larger).unwrap_or(k);
            rows.swap(k, pivot);
            let top = rows[k].clone();
            for (_, row) in rows.iter_mut().enumerate().filter(|&(i, _)| i != k) {
                let factor = self.div(&row[k], &top[k]);
                for (entry, above) in row.iter_mut().zip(&top) {
                    *entry = self.sub(entry, &self.mul(&factor, above));
                }
            }
        }
        let x = (0..n).map(|i| self.div(&rows[i][n], &rows[i][i]));
        (x.collect(), self.constant(f64::NAN))
    }

    /// Newton's method from the root over `f64`, which is within reach of the exact one.
    fn implicit(&self, function: &Implicit, p: &[BigFloat]) -> Vec<BigFloat> {
        let near: Vec<f64> = p.iter().map(to_f64).collect();
        let z = Reals.implicit(function, &near);
        let z = z.iter().map(|&z| self.constant(z)).collect();
        function.refined(self, z, p, 8)
    }
}

/// Whether an interval holds a number; numbers beyond the range of `f64` are held by infinite bounds.
pub fn holds(interval: Interval, value: &BigFloat) -> bool {
    let bound = |x: f64| Exact(64).constant(x);
    bound(interval.lo()) <= *value && *value <= bound(interval.hi())
}

/// The number rounded to (almost) the nearest `f64`.
pub fn to_f64(value: &BigFloat) -> f64 {
    let Some((words, _, sign, exponent, _)) = value.as_raw_parts() else {
        return match value {
            value if value.is_inf_pos() => f64::INFINITY,
            value if value.is_inf_neg() => f64::NEG_INFINITY,
            _ => f64::NAN,
        };
    };
    // The mantissa is a fraction in [1/2, 1), its most significant word comes last.
    let fraction = words.last().map_or(0.0, |&word| word as f64) / 2.0_f64.powi(64);
    let half = exponent / 2;
    let size = fraction * 2.0_f64.powi(half) * 2.0_f64.powi(exponent - half);
    if sign == astro_float_num::Sign::Neg {
        -size
    } else {
        size
    }
}

/// |found − exact| relative to the larger of |exact| and `floor`.
pub fn error(found: f64, exact: &BigFloat, floor: f64) -> f64 {
    let space = Exact(256);
    let difference = space.sub(&space.constant(found), exact).abs();
    let scale = to_f64(exact).abs().max(floor);
    to_f64(&difference) / scale
}

#[test]
fn the_reference_knows_textbook_values() {
    let space = Exact(192);
    let two = space.constant(2.0);
    let digits = |x: &BigFloat, expected: &str| {
        let shown = x.to_string();
        assert!(shown.starts_with(expected), "{shown}");
    };
    digits(
        &space.unary(Unary::Sqrt, &two),
        "1.4142135623730950488016887242096980785696",
    );
    digits(
        &space.unary(Unary::Exp, &two),
        "7.3890560989306502272304274605750078131803",
    );
    digits(
        &space.unary(Unary::Ln, &two),
        "6.931471805599453094172321214581765680755",
    );
    digits(
        &space.binary(Binary::Atan2, &two, &two.neg()),
        "2.356194490192344928846982537459627163147",
    );
    assert_eq!(
        to_f64(&space.unary(Unary::Sinh, &two)),
        3.626_860_407_847_018_6
    );
    assert_eq!(
        to_f64(&space.constant(f64::from_bits(3))),
        f64::from_bits(3)
    );
    assert_eq!(to_f64(&space.power_of_two(-3)), 0.125);
}
