//! Functions of one argument.

use lynkeus_expr::{Binary, Node, Op, Unary};

use super::{Builder, Inverse, Step, Unsupported};
use crate::series::functions::Arc;

/// What stands for all inverse functions of angles in the list of functions.
const ARCS: &str = "asin";

impl Builder<'_> {
    /// The slots of (sin, cos).
    fn pair(&mut self, a: usize) -> (usize, usize) {
        if let Some(&slot) = self.pairs.get(&a) {
            return (slot, slot + 1);
        }
        self.cosines_of_tangents(a);
        let slot = self.push(Step::Sin(a));
        self.push(Step::Cos);
        self.pairs.insert(a, slot);
        (slot, slot + 1)
    }

    /// The sine of an inverse tangent takes the root of 1 + a²: the point has to have one.
    fn cosines_of_tangents(&mut self, a: usize) {
        if !self.program.functions.contains(&ARCS) {
            return;
        }
        for slot in self.program.below(a) {
            let Step::Integral { h, of, .. } = self.program.steps[slot] else {
                continue;
            };
            if let (Inverse::Arc(Arc::Tangent), Step::Div(_, sum)) = (of, self.program.steps[h])
                && self.rooted.insert(sum)
            {
                self.push(Step::Sqrt(sum));
            }
        }
    }

    /// The angle of a point (a above b): what b/a's inverse tangent leaves out is a half turn.
    pub(super) fn angle_of(
        &mut self,
        a: usize,
        b: usize,
        node: Node,
    ) -> Result<usize, Unsupported> {
        self.function(ARCS);
        let ratio = self.push(Step::Div(a, b));
        let arc = self.arc_tangent(ratio)?;
        let angle = self.value_at_reference(node)?;
        if angle.abs() <= std::f64::consts::FRAC_PI_2 {
            return Ok(arc);
        }
        let half = self.number(std::f64::consts::PI.copysign(angle))?;
        Ok(self.push(Step::Add(arc, half)))
    }

    /// f⁻¹(f(z)) and √z², which are z up to sign and shift: as they are at the reference point.
    fn undone(
        &mut self,
        op: Unary,
        node: Node,
        argument: Node,
    ) -> Result<Option<usize>, Unsupported> {
        let inner = match (op, self.graph.op(argument)) {
            (Unary::Asin, Op::Unary(Unary::Sin, z))
            | (Unary::Acos, Op::Unary(Unary::Cos, z))
            | (Unary::Atan, Op::Unary(Unary::Tan, z))
            | (Unary::Sqrt, Op::Powi(z, 2)) => z,
            (Unary::Sqrt, Op::Binary(Binary::Mul, z, other)) if z == other => z,
            _ => return Ok(None),
        };
        let Some(&slot) = self.slots.get(&inner) else {
            return Ok(None);
        };
        let (outer, z) = (
            self.value_at_reference(node)?,
            self.value_at_reference(inner)?,
        );
        let rising = match op {
            Unary::Asin => z.cos() > 0.0,
            Unary::Acos => z.sin() > 0.0,
            Unary::Sqrt => z > 0.0,
            _ => true,
        };
        let signed = if rising {
            slot
        } else {
            self.push(Step::Neg(slot))
        };
        let shift = if rising { outer - z } else { outer + z };
        let turns = (shift / std::f64::consts::PI).round();
        if turns == 0.0 {
            return Ok(Some(signed));
        }
        let shift = self.number(turns * std::f64::consts::PI)?;
        Ok(Some(self.push(Step::Add(signed, shift))))
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
        let of = Inverse::Arc(Arc::Sine);
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
            Unary::Asin | Unary::Acos | Unary::Atan => ARCS,
            Unary::Sinh | Unary::Cosh | Unary::Tanh => "sinh",
            Unary::Sqrt => "sqrt",
            _ => "",
        };
        if !name.is_empty() {
            self.function(name);
        }
        if let Some(slot) = self.undone(op, node, argument)? {
            return Ok(slot);
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
        let of = Inverse::Arc(Arc::Tangent);
        Ok(self.push(Step::Integral { a, h, of }))
    }
}
