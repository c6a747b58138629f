//! The operations over `f64`: the meaning every other algebra has to agree with.

use crate::{Algebra, Binary, Fused, Implicit, Unary, linear};

/// −1, 0 or 1 by the sign of `x`; NaN stays NaN, and ±0 gives ±0.
pub fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

/// The number with so many significant digits that is nearest to `x`, for text.
///
/// ```
/// use lynkeus_expr::real::rounded;
/// assert_eq!(rounded(0.1 + 0.2, 6), 0.3);
/// assert_eq!(rounded(31_415.9, 2), 31_000.0);
/// ```
pub fn rounded(x: f64, digits: usize) -> f64 {
    let text = format!("{x:.*e}", digits.saturating_sub(1));
    text.parse().unwrap_or(x)
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// −0 counts as below 0, so that exchanging the arguments changes no bit.
fn min(x: f64, y: f64) -> f64 {
    if x.is_nan() || y.is_nan() {
        f64::NAN
    } else if x < y || (x == y && x.is_sign_negative()) {
        x
    } else {
        y
    }
}

fn max(x: f64, y: f64) -> f64 {
    -min(-x, -y)
}

/// The numbers: `f64`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reals;

impl Algebra for Reals {
    type Value = f64;

    fn constant(&self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn unary(&self, op: Unary, &x: &f64) -> f64 {
        match op {
            Unary::Neg => -x,
            Unary::Abs => x.abs(),
            Unary::Sign => sign(x),
            Unary::Floor => x.floor(),
            Unary::Sqrt => x.sqrt(),
            Unary::Exp => x.exp(),
            Unary::Ln => x.ln(),
            Unary::Sin => x.sin(),
            Unary::Cos => x.cos(),
            Unary::Tan => x.tan(),
            Unary::Asin => x.asin(),
            Unary::Acos => x.acos(),
            Unary::Atan => x.atan(),
            Unary::Sinh => x.sinh(),
            Unary::Cosh => x.cosh(),
            Unary::Tanh => x.tanh(),
            Unary::Not => truth(x == 0.0),
        }
    }

    #[inline(always)]
    fn powi(&self, x: &f64, n: i32) -> f64 {
        // the square is the power that models are made of
        if n == 2 { x * x } else { x.powi(n) }
    }

    #[inline(always)]
    fn binary(&self, op: Binary, &x: &f64, &y: &f64) -> f64 {
        match op {
            Binary::Add => x + y,
            Binary::Sub => x - y,
            Binary::Mul => x * y,
            Binary::Div => x / y,
            Binary::Pow => x.powf(y),
            Binary::Atan2 => x.atan2(y),
            Binary::Min => min(x, y),
            Binary::Max => max(x, y),
            Binary::Less => truth(x < y),
            Binary::LessEq => truth(x <= y),
            Binary::Equal => truth(x == y),
            Binary::And => truth(x != 0.0 && y != 0.0),
            Binary::Or => truth(x != 0.0 || y != 0.0),
        }
    }

    fn fused(&self, op: Fused, &x: &f64, &y: &f64, &z: &f64) -> f64 {
        match op {
            Fused::Add => x.mul_add(y, z),
            Fused::Sub => x.mul_add(y, -z),
            Fused::From => (-x).mul_add(y, z),
        }
    }

    /// `if` with a truth value as condition; an unknown (NaN) condition gives NaN.
    #[inline(always)]
    fn select(&self, &condition: &f64, &x: &f64, &y: &f64) -> f64 {
        if condition.is_nan() {
            f64::NAN
        } else if condition != 0.0 {
            x
        } else {
            y
        }
    }

    fn solve(&self, a: &[f64], b: &[f64]) -> (Vec<f64>, f64) {
        let mut x = b.to_vec();
        let rcond = linear::solve(&mut a.to_vec(), &mut x);
        (x, rcond)
    }

    fn solve_in_place(&self, a: &mut [f64], b: &mut [f64]) -> f64 {
        linear::solve(a, b)
    }

    /// NaN where no root is found.
    fn implicit(&self, function: &Implicit, p: &[f64]) -> Vec<f64> {
        match function.root(p) {
            Ok(z) => z,
            Err(_) => vec![f64::NAN; function.size()],
        }
    }
}
