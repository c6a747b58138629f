//! Regularity of Q and Q̄ on the box.

use crate::statement::{Statement, undecided};
use crate::{Check, Germani};
use lynkeus_structure::Verdict;
use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_structure::output_map::Rows;
use lynkeus_structure::regular;
use lynkeus_structure::{Extended, Matrix, Region};

use super::degrees::with_slopes;
use super::variant::Variant;
use crate::DesignError;

/// Whether a square matrix is regular on the whole region.
pub(super) fn regular(
    extended: &Extended<'_>,
    statement: Germani,
    Q: &Rows,
    region: &Region,
) -> Result<Check, DesignError> {
    let n = Q.len();
    let Q = Matrix::from_fn(extended.graph(), (n, n), |i, j| {
        Q.get(i).and_then(|row| *row.get(j)?)
    });
    Ok(Statement::from(statement).with(regular::regular(&Q, region)?))
}

/// The map where it reads inputs.
pub(super) struct Inputs<'a, 'p> {
    pub extended: &'a Extended<'p>,
    pub U: &'a [Vec<Node>],
    pub Q̄: &'a Rows,
    pub region: &'a Region,
}

impl Inputs<'_, '_> {
    /// What the observer needs of the input where r < n.
    pub fn check(&self, variant: Variant) -> Result<Check, DesignError> {
        if variant == Variant::Bounded {
            return Ok(undecided(
                Germani::SmallInput,
                "the input appears before the n-th derivative of the output and (3.1) takes no account of it: it converges for u_M ≤ β λ_min(P) only; variant = \"theoretical\" or \"practical\" does not need that",
            ));
        }
        let name = || Germani::UniformlyObservable;
        // a singular point for a constant input is the better witness
        let still = self.still();
        let mut check = regular(self.extended, name(), &self.at_rest(&still), self.region)?;
        if !matches!(check.verdict, Verdict::Refuted(_)) && !still.is_empty() {
            let wider = with_slopes(self.extended, self.U, self.region);
            check = regular(self.extended, name(), self.Q̄, &wider)?;
        }
        if !check.is_proved() {
            check.detail += "; small and slow inputs keep it regular (Theorem 2.4), the column rcond and its flag tell";
        }
        Ok(check)
    }

    /// u', u'', … ↦ 0
    fn still(&self) -> HashMap<Node, Node> {
        let zero = self.extended.graph().constant(0.0).node();
        let slopes = self.U.iter().flat_map(|jet| jet.iter().skip(1));
        slopes.map(|&symbol| (symbol, zero)).collect()
    }

    /// Q̄ for constant inputs.
    fn at_rest(&self, still: &HashMap<Node, Node>) -> Rows {
        let graph = self.extended.graph();
        let constant = |row: &Vec<Option<Node>>| {
            let entry = |e: &Option<Node>| Some(graph.substitute(&[(*e)?], still)[0]);
            row.iter().map(entry).collect()
        };
        self.Q̄.iter().map(constant).collect()
    }
}
