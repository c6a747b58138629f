//! Expressions evaluated with as many digits as are asked for.

use std::cell::RefCell;

use astro_float_num::{BigFloat, Consts, INF_NEG, INF_POS, NAN, RoundingMode};
use lynkeus::expr::{Algebra, Binary, Implicit, Reals, Unary};

const ROUNDING: RoundingMode = RoundingMode::ToEven;

/// Numbers of so many bits with infinities and NaN, with the meaning that `f64` gives to
/// every operation. The condition estimate of a linear system is that of `f64`.
pub struct Precise {
    bits: usize,
    constants: RefCell<Consts>,
}

impl Precise {
    pub fn new(bits: usize) -> Result<Self, String> {
        let constants = Consts::new().map_err(|e| format!("multiple precision: {e:?}"))?;
        Ok(Self {
            bits,
            constants: RefCell::new(constants),
        })
    }

    pub fn number(&self, x: f64) -> BigFloat {
        BigFloat::from_f64(x, self.bits)
    }

    pub fn add(&self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.add(y, self.bits, ROUNDING)
    }

    pub fn sub(&self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.sub(y, self.bits, ROUNDING)
    }

    pub fn mul(&self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        x.mul(y, self.bits, ROUNDING)
    }

    pub fn div(&self, x: &BigFloat, y: &BigFloat) -> BigFloat {
        match y.is_zero() {
            // as IEEE has it, signed zeros aside
            true if x.is_zero() || x.is_nan() => NAN,
            true if x.is_negative() => INF_NEG,
            true => INF_POS,
            false => x.div(y, self.bits, ROUNDING),
        }
    }

    /// The nearest `f64`, as far as a comparison of sizes needs it.
    pub fn rounded(x: &BigFloat) -> f64 {
        if x.is_nan() {
            return f64::NAN;
        }
        if x.is_inf() {
            return if x.is_negative() {
                f64::NEG_INFINITY
            } else {
                f64::INFINITY
            };
        }
        let (Some(words), Some(exponent)) = (x.mantissa_digits(), x.exponent()) else {
            return 0.0;
        };
        if x.is_zero() {
            return 0.0;
        }
        // the most significant word is the last; the mantissa lies in [½, 1)
        let top = words.last().map_or(0.0, |w| *w as f64 / 2f64.powi(63));
        let size = top * 2f64.powi(exponent.saturating_sub(1));
        if x.is_negative() { -size } else { size }
    }

    fn compare(
        &self,
        x: &BigFloat,
        y: &BigFloat,
        holds: fn(std::cmp::Ordering) -> bool,
    ) -> BigFloat {
        match x.cmp(y) {
            Some(order) => self.number(f64::from(u8::from(holds(order.cmp(&0))))),
            None => self.number(0.0),
        }
    }

    fn within_one(&self, x: &BigFloat) -> bool {
        let one = self.number(1.0);
        x.abs().cmp(&one).is_some_and(|order| order <= 0)
    }

    fn atan2(&self, y: &BigFloat, x: &BigFloat) -> BigFloat {
        let constants = &mut *self.constants.borrow_mut();
        let pi = constants.pi(self.bits, ROUNDING);
        if x.is_zero() {
            let half = self.div(&pi, &self.number(2.0));
            return match (y.is_zero(), y.is_negative()) {
                (true, _) => self.number(0.0),
                (false, true) => half.neg(),
                (false, false) => half,
            };
        }
        let angle = self.div(y, x).atan(self.bits, ROUNDING, constants);
        match (x.is_negative(), y.is_negative() && !y.is_zero()) {
            (false, _) => angle,
            (true, true) => self.sub(&angle, &pi),
            (true, false) => self.add(&angle, &pi),
        }
    }
}

impl Algebra for Precise {
    type Value = BigFloat;

    fn constant(&self, value: f64) -> BigFloat {
        self.number(value)
    }

    fn unary(&self, op: Unary, x: &BigFloat) -> BigFloat {
        let constants = &mut *self.constants.borrow_mut();
        let (p, r) = (self.bits, ROUNDING);
        if x.is_nan() {
            return NAN;
        }
        match op {
            Unary::Neg => x.neg(),
            Unary::Abs => x.abs(),
            Unary::Sign if x.is_zero() => self.number(0.0),
            Unary::Sign => x.signum(),
            Unary::Floor => x.floor(),
            Unary::Sqrt => x.sqrt(p, r),
            Unary::Exp => x.exp(p, r, constants),
            Unary::Ln if x.is_zero() => INF_NEG,
            Unary::Ln => x.ln(p, r, constants),
            Unary::Sin => x.sin(p, r, constants),
            Unary::Cos => x.cos(p, r, constants),
            Unary::Tan => x.tan(p, r, constants),
            Unary::Asin if !self.within_one(x) => NAN,
            Unary::Asin => x.asin(p, r, constants),
            Unary::Acos if !self.within_one(x) => NAN,
            Unary::Acos => x.acos(p, r, constants),
            Unary::Atan => x.atan(p, r, constants),
            Unary::Sinh => x.sinh(p, r, constants),
            Unary::Cosh => x.cosh(p, r, constants),
            Unary::Tanh => x.tanh(p, r, constants),
            Unary::Not => self.number(f64::from(u8::from(x.is_zero()))),
        }
    }

    fn powi(&self, x: &BigFloat, n: i32) -> BigFloat {
        let power = x.powi(n.unsigned_abs() as usize, self.bits, ROUNDING);
        match n < 0 {
            true => self.div(&self.number(1.0), &power),
            false => power,
        }
    }

    fn binary(&self, op: Binary, x: &BigFloat, y: &BigFloat) -> BigFloat {
        if x.is_nan() || y.is_nan() {
            return NAN;
        }
        let truth = |holds: bool| self.number(f64::from(u8::from(holds)));
        match op {
            Binary::Add => self.add(x, y),
            Binary::Sub => self.sub(x, y),
            Binary::Mul => self.mul(x, y),
            Binary::Div => self.div(x, y),
            Binary::Pow if x.is_negative() && !x.is_zero() => match y.is_int() {
                true => x.pow(y, self.bits, ROUNDING, &mut self.constants.borrow_mut()),
                false => NAN,
            },
            Binary::Pow if x.is_zero() && y.is_negative() => INF_POS,
            Binary::Pow => x.pow(y, self.bits, ROUNDING, &mut self.constants.borrow_mut()),
            Binary::Atan2 => self.atan2(x, y),
            Binary::Min => x.min(y),
            Binary::Max => x.max(y),
            Binary::Less => self.compare(x, y, std::cmp::Ordering::is_lt),
            Binary::LessEq => self.compare(x, y, std::cmp::Ordering::is_le),
            Binary::Equal => self.compare(x, y, std::cmp::Ordering::is_eq),
            Binary::And => truth(!x.is_zero() && !y.is_zero()),
            Binary::Or => truth(!x.is_zero() || !y.is_zero()),
        }
    }

    fn select(&self, condition: &BigFloat, x: &BigFloat, y: &BigFloat) -> BigFloat {
        match (condition.is_nan(), condition.is_zero()) {
            (true, _) => NAN,
            (false, true) => y.clone(),
            (false, false) => x.clone(),
        }
    }

    /// By elimination with pivots.
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
            let size = |row: &Vec<BigFloat>| Self::rounded(&row[k]).abs();
            let largest = (k..n).max_by(|&i, &j| size(&rows[i]).total_cmp(&size(&rows[j])));
            rows.swap(k, largest.unwrap_or(k));
            for i in 0..n {
                if i == k {
                    continue;
                }
                let factor = self.div(&rows[i][k], &rows[k][k]);
                let pivot = rows[k].clone();
                for (entry, above) in rows[i].iter_mut().zip(&pivot).skip(k) {
                    *entry = self.sub(entry, &self.mul(&factor, above));
                }
            }
        }
        let x = (0..n).map(|k| self.div(&rows[k][n], &rows[k][k])).collect();
        // its meaning is that of the factorisation that is used at run time
        let near = |values: &[BigFloat]| values.iter().map(Self::rounded).collect::<Vec<f64>>();
        let (_, rcond) = Reals.solve(&near(a), &near(b));
        (x, self.number(rcond))
    }

    /// The root that is found at run time, with more digits.
    fn implicit(&self, function: &Implicit, p: &[BigFloat]) -> Vec<BigFloat> {
        let near: Vec<f64> = p.iter().map(Self::rounded).collect();
        let z = Reals.implicit(function, &near);
        let z = z.iter().map(|&z| self.number(z)).collect();
        let steps = self.bits.max(2).ilog2() as usize;
        function.refined(self, z, p, steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus::expr::{Graph, Tape};

    /// At many points the nearest number is what `f64` computes, up to its rounding.
    #[test]
    fn every_operation_means_what_it_means_in_f64() {
        let precise = Precise::new(256).unwrap();
        let unary = [
            Unary::Neg,
            Unary::Abs,
            Unary::Sign,
            Unary::Floor,
            Unary::Sqrt,
            Unary::Exp,
            Unary::Ln,
            Unary::Sin,
            Unary::Cos,
            Unary::Tan,
            Unary::Asin,
            Unary::Acos,
            Unary::Atan,
            Unary::Sinh,
            Unary::Cosh,
            Unary::Tanh,
            Unary::Not,
        ];
        let binary = [
            Binary::Add,
            Binary::Sub,
            Binary::Mul,
            Binary::Div,
            Binary::Pow,
            Binary::Atan2,
            Binary::Min,
            Binary::Max,
            Binary::Less,
            Binary::LessEq,
            Binary::Equal,
            Binary::And,
            Binary::Or,
        ];
        let points = [-2.5, -1.0, -0.3, 0.0, 0.2, 1.0, 1.7, 3.0];
        let agree = |what: String, x: &BigFloat, y: f64| {
            let x = Precise::rounded(x);
            let same = x == y || (x.is_nan() && y.is_nan()) || (x - y).abs() <= 1e-14 * y.abs();
            assert!(same, "{what}: {x} against {y}");
        };
        for x in points {
            let big = precise.number(x);
            for op in unary {
                agree(
                    format!("{op:?} {x}"),
                    &precise.unary(op, &big),
                    Reals.unary(op, &x),
                );
            }
            for n in [-3, 0, 2, 5] {
                agree(
                    format!("{x}^{n}"),
                    &precise.powi(&big, n),
                    Reals.powi(&x, n),
                );
            }
            for y in points {
                for op in binary {
                    let found = precise.binary(op, &big, &precise.number(y));
                    agree(format!("{op:?} {x} {y}"), &found, Reals.binary(op, &x, &y));
                }
            }
        }
    }

    #[test]
    fn a_linear_system_is_solved() {
        let precise = Precise::new(256).unwrap();
        let a = [0.0, 2.0, 1.0, 1.0].map(|x| precise.number(x));
        let (x, _) = precise.solve(&a, &[4.0, 3.0].map(|x| precise.number(x)));
        let x: Vec<f64> = x.iter().map(Precise::rounded).collect();
        assert_eq!(x, [1.0, 2.0]);
    }

    /// (1 + h) − 1 − h with h = 1e-30 is nothing here, where `f64` has −1e-30.
    #[test]
    fn the_digits_asked_for_are_kept() {
        let graph = Graph::new();
        let h = graph.symbol("h");
        let f = (h + 1.0) - 1.0 - h;
        let tape = Tape::new(&graph, &[h.node()], &[f.node()]).unwrap();
        let precise = Precise::new(256).unwrap();
        let found = Precise::rounded(&tape.eval_in(&precise, &[precise.number(1e-30)])[0]);
        assert!(found.abs() < 1e-60, "{found}");
        assert_eq!(tape.eval_in(&Reals, &[1e-30])[0], -1e-30);
    }
}
