//! Regularity of Q and Q̄ on the box.

use crate::statement::{Statement, undecided};
use crate::{Check, Germani};
use lynkeus_structure::Verdict;
use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_structure::output_map::Rows;
use lynkeus_structure::{Extended, Matrix, Region};
use lynkeus_structure::{one_to_one, rank};

use super::degrees::with_slopes;
use super::derivative_name;
use super::variant::Variant;
use crate::DesignError;
use crate::enclosure::figures;

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
    Ok(Statement::from(statement).with(rank::regular(&Q, region)?))
}

/// Whether Φ, whose Jacobian was found `regular` or not, is one-to-one on the whole region.
pub(super) fn one_to_one(
    extended: &Extended<'_>,
    Φ: &[Node],
    regular: &Check,
    region: &Region,
) -> Result<Check, DesignError> {
    let states = extended.symbols();
    let map = one_to_one::Map {
        graph: extended.graph(),
        functions: Φ,
        states: &states,
        region,
    };
    let found = map.one_to_one(&vec![false; states.len()], regular.is_proved())?;
    Ok(Statement::from(Germani::OneToOne).with(found.finding))
}

/// The map where it reads inputs.
pub(super) struct Inputs<'a, 'p> {
    pub extended: &'a Extended<'p>,
    pub U: &'a [Vec<Node>],
    /// bounds of |u'|, |u''|, … per input, as far as they are declared
    pub slopes: &'a [Vec<f64>],
    pub Q̄: &'a Rows,
    pub region: &'a Region,
}

/// Halvings, on a logarithmic scale, of the search for Ū.
const HALVINGS: usize = 14;
/// Ū beyond which inputs are taken for as large as one likes.
const ANY: f64 = 1e6;

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
            let wider = with_slopes(self.extended, self.U, self.slopes, self.region);
            let declared = self.declared();
            let statement = match declared.is_empty() {
                true => name(),
                false => Germani::RegularWithin,
            };
            check = regular(self.extended, statement, self.Q̄, &wider)?;
            if !declared.is_empty() {
                check.detail += &format!("; for {declared}, as `input_derivatives` bounds them");
            }
        }
        if !check.is_proved() {
            check.detail += "; small and slow inputs keep it regular (Theorem 2.4), the column rcond and its flag tell";
        }
        Ok(check)
    }

    /// The bounds of the derivatives that Q̄ reads, in words.
    fn declared(&self) -> String {
        let jets = self.extended.inputs.iter().zip(self.U).zip(self.slopes);
        let each = jets.flat_map(|((input, jet), bounds)| {
            let read = jet.len().saturating_sub(1);
            let each = bounds.iter().take(read).enumerate();
            each.map(|(k, bound)| {
                format!(
                    "|{}| ≤ {}",
                    derivative_name(&input.name, k + 1),
                    figures(*bound)
                )
            })
        });
        each.collect::<Vec<_>>().join(", ")
    }

    /// Ū of Theorem 2.4: the largest radius, to a few thousandths of its size, for which Q̄ is proved regular on
    /// the box of the states for all |u|, |u'|, … ≤ Ū; none where even the smallest inputs leave it undecided.
    pub fn largest(&self) -> Result<Option<f64>, DesignError> {
        let holds = |radius: f64| -> Result<bool, DesignError> {
            let mut region = self.region.clone();
            let is_input = |symbol: Node| self.extended.inputs.iter().any(|u| u.node == symbol);
            for side in region
                .dimensions
                .iter_mut()
                .filter(|side| is_input(side.symbol))
            {
                (side.min, side.max) = (-radius, radius);
            }
            let orders = self.U.iter().map(|jet| vec![radius; jet.len()]);
            let region = with_slopes(self.extended, self.U, &orders.collect::<Vec<_>>(), &region);
            Ok(regular(self.extended, Germani::RegularWithin, self.Q̄, &region)?.is_proved())
        };
        let (mut low, mut high) = (1e-6, ANY);
        if !holds(low)? {
            return Ok(None);
        }
        if holds(high)? {
            return Ok(Some(f64::INFINITY));
        }
        for _ in 0..HALVINGS {
            let middle = f64::sqrt(low * high);
            match holds(middle)? {
                true => low = middle,
                false => high = middle,
            }
        }
        Ok(Some(low))
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
