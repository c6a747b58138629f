//! What a graph does when the time or the memory of the work on it ends.

use super::{Graph, Inner, Key, Node};
use crate::{Budget, Op, Spent};

/// Nodes between two looks at the clock.
const OFTEN: u32 = 64;
/// Bytes that a node takes, in the arena and in the table that finds it.
const NODE: usize = size_of::<Op>() + 2 * (size_of::<Key>() + size_of::<Node>());

impl Inner {
    /// Whether no more nodes are made.
    pub(super) fn is_spent(&mut self) -> bool {
        self.made = self.made.wrapping_add(1);
        // the arena and its table double when they are full
        if self.ops.len() == self.ops.capacity() {
            return !self.budget.affords(self.ops.len() * NODE);
        }
        match self.made.is_multiple_of(OFTEN) {
            true => self.budget.spent().is_some(),
            false => self.budget.marked().is_some(),
        }
    }

    /// What stands for every node that is not made any more. Its value is none.
    pub(super) fn nothing(&mut self) -> Node {
        let none = f64::NAN;
        self.intern(Key::Constant(none.to_bits()), Op::Constant(none))
    }
}

impl Graph {
    /// Puts the work on this graph, and on clones made from now on, under a budget.
    pub fn set_budget(&self, budget: Budget) {
        self.inner.borrow_mut().budget = budget;
    }

    /// The budget of the work on this graph.
    pub fn budget(&self) -> Budget {
        self.inner.borrow().budget.clone()
    }

    /// Whether the budget is spent, looking at the clock: ask it in every long loop. After
    /// that no nodes are made, nothing is [noted](Graph::note), and results do not count.
    pub fn spent(&self) -> Option<Spent> {
        self.inner.borrow().budget.spent()
    }

    /// Whether somebody noticed that the budget is spent.
    pub(crate) fn is_spent(&self) -> bool {
        self.inner.borrow().budget.marked().is_some()
    }

    /// Works under a budget of its own. What was found counts only where the budget lasted:
    /// a graph whose budget is spent makes no more nodes, and something else stands for them.
    ///
    /// # Errors
    /// What ended the work.
    pub fn budgeted<T>(&self, budget: Budget, work: impl FnOnce() -> T) -> Result<T, Spent> {
        let before = self.budget();
        self.set_budget(budget.clone());
        let done = match budget.spent() {
            Some(spent) => Err(spent),
            None => Ok(work()),
        };
        self.set_budget(before);
        match budget.marked() {
            Some(spent) => Err(spent),
            None => done,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn nothing_is_made_or_noted_after_the_end_and_everything_again_later() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sum = (x + 1.0).node();
        let budget = Budget::new(Some(Duration::from_secs(60)), None);
        let found = g.budgeted(budget.clone(), || {
            budget.cancel();
            let made = (x * 3.0).sin().node();
            g.note(sum, 1.0_f64);
            assert!(g.constant_value(made).is_some_and(f64::is_nan));
            assert_eq!((x + 1.0).node(), sum);
            let b = (x * 7.0).node();
            let solved = g.solve(&[b], &[b]);
            assert_eq!(solved.x, [solved.rcond]);
        });
        assert_eq!(found, Err(Spent::Cancelled));
        assert_eq!(g.noted::<Node, f64>(&sum), None);
        assert!(matches!(g.op((x * 3.0).node()), Op::Binary(..)));
    }

    #[test]
    fn a_graph_that_grows_ends_in_time() {
        let g = Graph::new();
        let started = std::time::Instant::now();
        let grown = g.budgeted(Budget::default().within(Duration::from_millis(20)), || {
            let mut sum = g.symbol("x");
            while g.spent().is_none() {
                for _ in 0..10_000 {
                    sum = (sum + 1.5).sin();
                }
            }
        });
        assert!(grown.is_err());
        assert!(started.elapsed() < Duration::from_secs(5));
    }

    #[test]
    fn a_clone_shares_the_budget() {
        let g = Graph::new();
        let budget = Budget::new(None, None);
        g.set_budget(budget.clone());
        let copy = g.clone();
        budget.cancel();
        assert_eq!(copy.spent(), Some(Spent::Cancelled));
    }
}
