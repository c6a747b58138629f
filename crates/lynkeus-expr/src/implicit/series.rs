//! Taylor series of implicit functions.

use super::Implicit;
use crate::{Algebra, Jet, Jets, Unary};

impl Implicit {
    /// The coefficients of z from those of p, order by order. With z known below order k, the
    /// k-th coefficient of g(z, p) lacks only g_z·z_k, whose matrix is that of the base point:
    /// g_z z_k = −(what is there).
    pub(crate) fn series<A: Algebra>(
        &self,
        jets: &Jets<'_, A>,
        p: &[Jet<A::Value>],
    ) -> Vec<Jet<A::Value>> {
        let inner = jets.inner;
        let base: Vec<A::Value> = p.iter().map(|jet| jet[0].clone()).collect();
        let z = inner.implicit(self, &base);
        let mut at: Vec<Jet<A::Value>> = z.iter().map(|z| vec![z.clone()]).collect();
        if jets.is_spent() || p.iter().all(|jet| jet.len() == 1) {
            return at;
        }
        let matrix = self.matrix(inner, &[z, base].concat());
        at.extend(p.iter().cloned());
        for order in 1..=jets.order {
            for (short, jet) in at[self.size()..].iter_mut().zip(p) {
                *short = jet[..jet.len().min(order + 1)].to_vec();
            }
            let g = self.residual(&Jets { inner, order }, &at);
            let right: Vec<A::Value> = g.iter().map(|g| negative(inner, g.get(order))).collect();
            let (next, _) = inner.solve(&matrix, &right);
            for (jet, value) in at.iter_mut().zip(next) {
                jet.push(value);
            }
        }
        at.truncate(self.size());
        at
    }
}

fn negative<A: Algebra>(algebra: &A, value: Option<&A::Value>) -> A::Value {
    match value {
        Some(value) => algebra.unary(Unary::Neg, value),
        None => algebra.constant(0.0),
    }
}
