//! The rank of the outputs' coefficients at one start, order by order.

use lynkeus_expr::Budget;

use crate::echelon::Echelon;
use crate::expansion::{Columns, Expansion};
use crate::field::Modular;
use crate::model::Model;
use crate::series::Stop;
use crate::start::Start;

/// The rows of sensitivities so far.
pub(crate) struct Search<'a> {
    model: &'a Model,
    expansion: Expansion<'a>,
    rows: Echelon,
    /// the rows' part in the columns of unknown inputs
    signals: Echelon,
    /// gradients of the expressions asked about, at the start
    about: Vec<Vec<Modular>>,
    /// coefficients taken so far
    taken: usize,
}

impl<'a> Search<'a> {
    pub fn new(model: &'a Model, start: &'a Start, columns: Columns, budget: &Budget) -> Self {
        let width = columns.width();
        Self {
            expansion: Expansion::new(model, start, columns, budget),
            rows: Echelon::new(width),
            signals: Echelon::new(width),
            about: vec![],
            taken: 0,
            model,
        }
    }

    /// Adds the next order.
    pub fn advance(&mut self) -> Result<(), Stop> {
        self.expansion.advance()?;
        self.taken += 1;
        self.add_outputs();
        if self.taken == 1 {
            let expressions = 0..self.model.about;
            self.about = expressions.map(|i| self.expansion.about(i)).collect();
        }
        Ok(())
    }

    /// Adds orders at a generic start until none can bring anything new.
    pub fn run_out(&mut self) -> Result<(), Stop> {
        // the number of states and parameters, and one more for unknown inputs, is enough
        for k in 0..=self.model.depth {
            let before = self.settled();
            self.advance()?;
            if self.is_complete() || k > 0 && self.settled() == before {
                break;
            }
        }
        Ok(())
    }

    /// Adds orders until the rank is reached, everything is observable or `last` was taken.
    pub fn until(&mut self, rank: Option<usize>, last: usize) -> Result<(), Stop> {
        let reached = |search: &Self| rank.is_some_and(|rank| search.rank() >= rank);
        while self.taken <= last {
            self.advance()?;
            if reached(self) || self.is_complete() {
                break;
            }
        }
        Ok(())
    }

    /// Derivatives of the outputs that were taken.
    pub fn order(&self) -> usize {
        self.taken.saturating_sub(1)
    }

    pub fn rank(&self) -> usize {
        self.rows.rank()
    }

    pub fn columns(&self) -> &Columns {
        &self.expansion.columns
    }

    /// Values of the named quantities at the start.
    pub fn point(&self) -> &[Modular] {
        &self.expansion.point
    }

    /// Gradients of the expressions asked about; fewer where not even the first
    /// coefficients were reached.
    pub fn about(&self) -> &[Vec<Modular>] {
        &self.about
    }

    /// Whether a combination of the unknowns is seen.
    pub fn sees(&self, row: &[Modular]) -> bool {
        self.rows.contains(row)
    }

    /// The rank of what is seen of states and parameters whatever the unknown inputs do.
    /// Derivatives of it, with those of the outputs, give all of the next order's: at a
    /// generic point, what did not grow once never grows.
    pub fn settled(&self) -> usize {
        self.rows.rank() - self.signals.rank()
    }

    fn add_outputs(&mut self) {
        let inputs = self.columns().inputs();
        for output in 0..self.model.outputs {
            let mut row = self.expansion.output(output);
            self.rows.add(&row);
            if self.model.unknown_inputs > 0 {
                let columns = row.iter_mut().enumerate();
                let others = columns.filter(|(column, _)| !inputs.contains(column));
                others.for_each(|(_, x)| *x = Modular::ZERO);
                self.signals.add(&row);
            }
        }
    }

    /// Whether everything is observable: then nothing more can be learnt.
    pub fn is_complete(&self) -> bool {
        let named = self.columns().named;
        self.rows.rank() >= named
            && (self.model.unknown_inputs == 0
                || (0..named).all(|column| self.rows.contains(&self.columns().unit(column))))
    }

    /// Directions of the named quantities that no row so far sees, each with the
    /// column that moves in no other of them.
    pub fn unseen(&self) -> Vec<(usize, Vec<Modular>)> {
        let named = self.columns().named;
        let mut unseen = Echelon::new(named);
        for direction in self.rows.kernel() {
            unseen.add(&direction[..named]);
        }
        unseen.reduced_rows()
    }

    /// The rows in some of the columns alone.
    pub fn restricted(&self, columns: &[usize]) -> Echelon {
        let mut restricted = Echelon::new(columns.len());
        for row in self.rows.rows() {
            let row: Vec<Modular> = columns.iter().map(|&column| row[column]).collect();
            restricted.add(&row);
        }
        restricted
    }
}
