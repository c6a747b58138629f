//! Functions of one argument.

use lynkeus_expr::{Node, Unary};

use super::{Builder, Inverse, Step, Unsupported};
use crate::series::functions::Odd;

impl Builder<'_> {
    /// The slots of (sin, cos).
    fn pair(&mut self, a: usize) -> (usize, usize) {
        if let Some(&slot) = self.pairs.get(&a) {
            return (slot, slot + 1);
        }
        let slot = self.push(Step::Sin(a));
        self.push(Step::Cos);
        self.pairs.insert(a, slot);
        (slot, slot + 1)
    }

    /// e^a + e^−a and e^a − e^−a
    fn hyperbolic(&mut self, a: usize) -> Result<(usize, usize), Unsupported> {
        let one = self.number(1.0)?;
        let up = self.push(Step::Exp(a));
        let down = self.push(Step::Div(one, up));
        Ok((
            self.push(Step::Add(up, down)),
            self.push(Step::Sub(up, down)),
        ))
    }

    fn half(&mut self, a: usize) -> Result<usize, Unsupported> {
        let half = self.number(0.5)?;
        Ok(self.push(Step::Mul(half, a)))
    }

    pub(super) fn logarithm(&mut self, a: usize) -> Result<usize, Unsupported> {
        let one = self.number(1.0)?;
        let h = self.push(Step::Div(one, a));
        let of = Inverse::Logarithm;
        Ok(self.push(Step::Integral { a, h, of }))
    }

    fn arc_sine(&mut self, a: usize) -> Result<usize, Unsupported> {
        let one = self.number(1.0)?;
        let square = self.push(Step::Mul(a, a));
        let rest = self.push(Step::Sub(one, square));
        let root = self.push(Step::Sqrt(rest));
        let h = self.push(Step::Div(one, root));
        let of = Inverse::Odd(Odd::ArcSine);
        Ok(self.push(Step::Integral { a, h, of }))
    }

    pub(super) fn unary(
        &mut self,
        op: Unary,
        a: usize,
        node: Node,
        argument: Node,
    ) -> Result<usize, Unsupported> {
        let name = match op {
            Unary::Exp => "exp",
            Unary::Ln => "log",
            Unary::Sin | Unary::Cos | Unary::Tan => "sin",
            Unary::Asin | Unary::Acos | Unary::Atan => "asin",
            Unary::Sinh | Unary::Cosh | Unary::Tanh => "sinh",
            Unary::Sqrt => "sqrt",
            _ => "",
        };
        if !name.is_empty() {
            self.function(name);
        }
        Ok(match op {
            Unary::Neg => self.push(Step::Neg(a)),
            Unary::Abs => match self.value_at_reference(argument)? < 0.0 {
                true => self.push(Step::Neg(a)),
                false => a,
            },
            Unary::Sign | Unary::Floor | Unary::Not => {
                let x = self.value_at_reference(node)?;
                self.number(x)?
            }
            Unary::Sqrt => self.push(Step::Sqrt(a)),
            Unary::Exp => self.push(Step::Exp(a)),
            Unary::Ln => self.logarithm(a)?,
            Unary::Sin => self.pair(a).0,
            Unary::Cos => self.pair(a).1,
            Unary::Tan => {
                let (sin, cos) = self.pair(a);
                self.push(Step::Div(sin, cos))
            }
            Unary::Cosh | Unary::Sinh => {
                let (sum, difference) = self.hyperbolic(a)?;
                self.half(if op == Unary::Cosh { sum } else { difference })?
            }
            Unary::Tanh => {
                let (sum, difference) = self.hyperbolic(a)?;
                self.push(Step::Div(difference, sum))
            }
            Unary::Atan => self.arc_tangent(a)?,
            Unary::Asin => self.arc_sine(a)?,
            // a right angle less the inverse sine
            Unary::Acos => {
                let right = self.number(std::f64::consts::FRAC_PI_2)?;
                let sine = self.arc_sine(a)?;
                self.push(Step::Sub(right, sine))
            }
        })
    }

    pub(super) fn arc_tangent(&mut self, a: usize) -> Result<usize, Unsupported> {
        let one = self.number(1.0)?;
        let square = self.push(Step::Mul(a, a));
        let sum = self.push(Step::Add(one, square));
        let h = self.push(Step::Div(one, sum));
        let of = Inverse::Odd(Odd::ArcTangent);
        Ok(self.push(Step::Integral { a, h, of }))
    }
}
