//! Unknowns of a loop that follow from the others with a constant factor are taken out of it:
//! what is left is the core of the loop.

use std::collections::BTreeSet;

use lynkeus_expr::{Binary, Graph, Node, Unary};

use super::rows::Row;
use crate::limits::Budget;
use crate::syntax::{Result, Span};

/// A factor smaller than this part of the largest of its row is no pivot.
const THRESHOLD: f64 = 0.01;
/// What is left of a difference relative to its terms counts as zero below this.
const CANCELLED: f64 = 1e-13;

/// An unknown that a row gives, in the order of elimination.
pub(super) struct Given {
    pub column: usize,
    /// of the row, before it is divided by `factor`
    pub row: Row,
    pub factor: f64,
}

/// What is left of a block.
pub(super) struct Core {
    pub given: Vec<Given>,
    /// rows that are left, by their place in the block
    pub rows: Vec<(usize, Row)>,
    pub columns: Vec<usize>,
}

/// Takes out what can be taken out, short rows first.
pub(super) fn core(graph: &Graph, budget: &Budget, span: Span, rows: Vec<Row>) -> Result<Core> {
    let count = rows.len();
    let mut elimination = Elimination::new(graph, budget, span, rows);
    elimination.run()?;
    let mut left: BTreeSet<usize> = (0..count).collect();
    for given in &elimination.given {
        left.remove(&given.column);
    }
    let rows = elimination.rows.into_iter().enumerate();
    Ok(Core {
        given: elimination.given,
        rows: rows
            .filter_map(|(place, row)| Some((place, row?)))
            .collect(),
        columns: left.into_iter().collect(),
    })
}

struct Elimination<'a> {
    graph: &'a Graph,
    budget: &'a Budget,
    span: Span,
    /// `None` once a row gives its unknown
    rows: Vec<Option<Row>>,
    /// rows that hold each unknown
    holding: Vec<BTreeSet<usize>>,
    queue: BTreeSet<(usize, usize)>,
    given: Vec<Given>,
}

impl<'a> Elimination<'a> {
    fn new(graph: &'a Graph, budget: &'a Budget, span: Span, rows: Vec<Row>) -> Self {
        let mut holding = vec![BTreeSet::new(); rows.len()];
        let mut queue = BTreeSet::new();
        for (place, row) in rows.iter().enumerate() {
            queue.insert((row.len(), place));
            for &column in row.coefficients.keys() {
                holding[column].insert(place);
            }
        }
        Self {
            graph,
            budget,
            span,
            rows: rows.into_iter().map(Some).collect(),
            holding,
            queue,
            given: vec![],
        }
    }

    fn run(&mut self) -> Result<()> {
        while let Some((_, place)) = self.queue.pop_first() {
            let Some(row) = &self.rows[place] else {
                continue;
            };
            let Some((column, factor)) = self.pivot(row) else {
                continue;
            };
            if let Some(row) = self.rows[place].take() {
                self.take_out(place, column, factor, row)?;
            }
        }
        Ok(())
    }

    /// The unknown with a constant factor that stands in the fewest rows.
    fn pivot(&self, row: &Row) -> Option<(usize, f64)> {
        let factors = row.coefficients.iter().filter_map(|(&column, &node)| {
            let value = self.graph.constant_value(node)?;
            (value != 0.0).then_some((column, value))
        });
        let factors: Vec<(usize, f64)> = factors.collect();
        let largest = factors
            .iter()
            .map(|(_, value)| value.abs())
            .fold(0.0, f64::max);
        let sound = factors
            .into_iter()
            .filter(|(_, value)| value.abs() >= THRESHOLD * largest);
        sound.min_by_key(|(column, _)| self.holding[*column].len())
    }

    fn take_out(&mut self, place: usize, column: usize, factor: f64, row: Row) -> Result<()> {
        for &other in row.coefficients.keys() {
            self.holding[other].remove(&place);
        }
        let others: Vec<usize> = self.holding[column].iter().copied().collect();
        for other in others {
            self.budget.charge(row.len() as u64, self.span)?;
            let Some(mut changed) = self.rows[other].take() else {
                continue;
            };
            self.queue.remove(&(changed.len(), other));
            self.substitute(&mut changed, column, factor, &row);
            for &now in changed.coefficients.keys() {
                self.holding[now].insert(other);
            }
            for &before in row.coefficients.keys() {
                if !changed.coefficients.contains_key(&before) {
                    self.holding[before].remove(&other);
                }
            }
            self.holding[column].remove(&other);
            self.queue.insert((changed.len(), other));
            self.rows[other] = Some(changed);
        }
        self.given.push(Given {
            column,
            row,
            factor,
        });
        Ok(())
    }

    /// Puts what a row gives for an unknown into another row.
    fn substitute(&self, into: &mut Row, column: usize, factor: f64, row: &Row) {
        let Some(own) = into.coefficients.remove(&column) else {
            return;
        };
        let graph = self.graph;
        let ratio = graph.binary(Binary::Div, own, graph.constant(factor).node());
        for (&other, &coefficient) in &row.coefficients {
            if other == column {
                continue;
            }
            let term = graph.binary(Binary::Mul, ratio, coefficient);
            match self.difference(into.coefficients.get(&other).copied(), term) {
                Some(node) => into.coefficients.insert(other, node),
                None => into.coefficients.remove(&other),
            };
        }
        if let Some(rest) = row.rest {
            let term = graph.binary(Binary::Mul, ratio, rest);
            into.rest = self.difference(into.rest, term);
        }
    }

    /// a − b; `None` where nothing is left but rounding.
    fn difference(&self, a: Option<Node>, b: Node) -> Option<Node> {
        let graph = self.graph;
        let Some(a) = a else {
            return Some(graph.unary(Unary::Neg, b));
        };
        let node = graph.binary(Binary::Sub, a, b);
        let value = graph.constant_value(node);
        let (Some(value), Some(a), Some(b)) =
            (value, graph.constant_value(a), graph.constant_value(b))
        else {
            return (value != Some(0.0)).then_some(node);
        };
        (value.abs() > CANCELLED * (a.abs() + b.abs())).then_some(node)
    }
}
