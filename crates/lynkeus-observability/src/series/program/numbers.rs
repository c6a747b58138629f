//! Numbers, some of which have a name.

use std::f64::consts::{E, LN_2, LN_10, PI};

use super::{Builder, Step, Unsupported};
use crate::field::Modular;

/// Parts of a right angle's multiples that are looked for.
const PARTS: [f64; 7] = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 180.0];

impl Builder<'_> {
    /// A number: e and the logarithms of 2 and 10 by what they are, fractions of π as such.
    pub(super) fn number(&mut self, x: f64) -> Result<usize, Unsupported> {
        let natural = [(LN_2, 2.0), (LN_10, 10.0)];
        if let Some((_, of)) = natural.into_iter().find(|(logarithm, _)| *logarithm == x) {
            let of = self.number(of)?;
            return self.logarithm(of);
        }
        if x == E {
            let one = self.number(1.0)?;
            return Ok(self.push(Step::Exp(one)));
        }
        let value = fraction_of_pi(x).or_else(|| Modular::from_f64(x));
        let value = value.ok_or_else(|| Unsupported(format!("the number {x}")))?;
        Ok(self.push(Step::Constant(value)))
    }
}

fn fraction_of_pi(x: f64) -> Option<Modular> {
    PARTS.into_iter().find_map(|part| {
        let times = (x * part / PI).round();
        if times == 0.0
            || times.abs() > 1000.0
            || (times * PI / part != x && times / part * PI != x)
        {
            return None;
        }
        let part = Modular::from_f64(part)?.inverse()?;
        Some(Modular::from_f64(PI)? * Modular::from_f64(times)? * part)
    })
}
