//! The Jacobian of a right-hand side, sparse.

use std::sync::Arc;

use lynkeus_expr::{Graph, Node, Nodes, Tape, jacobian};
use nalgebra::DMatrix;

use crate::Dynamics;
use crate::routine::Routine;

/// Derivatives that are written down without asking whether they pay.
const FEW: usize = 50_000;

/// More than these are written down where differences would take so many times as many operations.
const SAVED: usize = 20;

/// A place in a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// counted from 0
    pub row: usize,
    /// counted from 0
    pub column: usize,
}

/// ∂f/∂x at a point: zero but for the entries at known places, the same ones at every point.
#[derive(Clone, Debug)]
pub struct Slopes {
    places: Arc<[Place]>,
    values: Vec<f64>,
}

impl Default for Slopes {
    fn default() -> Self {
        Self {
            places: Arc::new([]),
            values: vec![],
        }
    }
}

impl Slopes {
    /// The values at these places, to be written; places that are shared mean the same matrix.
    pub fn at(&mut self, places: &Arc<[Place]>) -> &mut [f64] {
        if !Arc::ptr_eq(&self.places, places) {
            self.places = places.clone();
        }
        self.values.resize(places.len(), 0.0);
        &mut self.values
    }

    /// Where entries can be.
    pub fn places(&self) -> &Arc<[Place]> {
        &self.places
    }

    /// The entries, in the order of the places.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Each entry with its place.
    pub fn entries(&self) -> impl Iterator<Item = (Place, f64)> {
        self.places.iter().copied().zip(self.values.iter().copied())
    }

    /// Whether every entry is a finite number.
    pub(crate) fn are_finite(&self) -> bool {
        self.values.iter().all(|v| v.is_finite())
    }

    /// The whole matrix of n rows and columns.
    pub(crate) fn dense(&self, n: usize) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(n, n);
        for (at, value) in self.entries() {
            matrix[(at.row, at.column)] += value;
        }
        matrix
    }

    /// The product with v.
    pub(crate) fn times(&self, v: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        for (at, value) in self.entries() {
            product[at.row] += value * v[at.column];
        }
    }

    /// Looks at f: at its own derivatives where it knows them and they have values, else at
    /// differences. Not finite where f is not.
    pub(crate) fn look(&mut self, f: &mut impl Dynamics, t: f64, x: &[f64]) {
        if !(f.slopes(t, x, self) && self.are_finite()) {
            let size = |k: usize| f64::EPSILON.sqrt() * x[k].abs().max(1e-3);
            self.differences(f, t, x, size);
        }
    }

    /// One-sided differences over such a size of each state, every entry: forward, or backward where f
    /// has no value ahead.
    pub(crate) fn differences(
        &mut self,
        f: &mut impl Dynamics,
        t: f64,
        x: &[f64],
        size: impl Fn(usize) -> f64,
    ) {
        let n = x.len();
        // as many places as there are in all are all of them
        let places = match self.places.len() == n * n {
            true => self.places.clone(),
            false => (0..n)
                .flat_map(|column| (0..n).map(move |row| Place { row, column }))
                .collect(),
        };
        let mut base = vec![0.0; n];
        f.derivatives(t, x, &mut base);
        let mut moved = x.to_vec();
        let mut image = vec![0.0; n];
        let mut columns = DMatrix::zeros(n, n);
        for (k, mut column) in columns.column_iter_mut().enumerate() {
            let size = size(k);
            for ahead in [size, -size] {
                moved[k] = x[k] + ahead;
                // the difference that the rounded sum really makes
                let step = moved[k] - x[k];
                f.derivatives(t, &moved, &mut image);
                for (entry, (moved, base)) in column.iter_mut().zip(image.iter().zip(&base)) {
                    *entry = (moved - base) / step;
                }
                if column.iter().all(|entry| entry.is_finite()) {
                    break;
                }
            }
            moved[k] = x[k];
        }
        let values = self.at(&places);
        for (value, at) in values.iter_mut().zip(&*places) {
            *value = columns[(at.row, at.column)];
        }
    }
}

/// The derivatives of a routine by its states.
#[derive(Debug)]
pub(crate) struct Differentiated {
    pub places: Arc<[Place]>,
    /// of the same inputs, the values at the places
    pub routine: Arc<Routine>,
}

impl Differentiated {
    /// Of a tape whose inputs are time, so many states, and what is constant. None where the
    /// derivatives written down would be too many for what they save.
    pub fn new(tape: &Tape, states: usize) -> Option<Self> {
        let g = Graph::new();
        let inputs: Vec<Node> = (0..tape.inputs()).map(|_| g.fresh("w").node()).collect();
        let outputs = tape.eval_in(&Nodes(&g), &inputs);
        let x = &inputs[1..=states];
        let most = FEW.max(tape.len().saturating_mul(states) / SAVED);
        jacobian::size(&g, &outputs, x, most)?;
        let entries = jacobian::forward(&g, &outputs, x).entries;
        let nodes: Vec<Node> = entries.iter().map(|&(.., node)| node).collect();
        let places = entries
            .iter()
            .map(|&(row, column, _)| Place { row, column });
        Some(Self {
            places: places.collect(),
            routine: Routine::new(Tape::new(&g, &inputs, &nodes).ok()?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Function, System};

    /// x₁' = sin(w x₁) + x₂², x₂' = √x₃, x₃' = −x₃: the entries of the graph against the formulas
    /// by hand, and against differences where a root has no slope.
    #[test]
    fn a_system_knows_its_slopes() {
        let g = Graph::new();
        let [time, w, x1, x2, x3] = ["time", "w", "x1", "x2", "x3"].map(|name| g.symbol(name));
        let states = [("x1", x1), ("x2", x2), ("x3", x3)].map(|(s, x)| (s.into(), x.node(), 1.0));
        let dx = [(w * x1).sin() + x2.powi(2), x3.sqrt(), -x3].map(|dx| dx.node());
        let signals = [("w".to_owned(), w.node())];
        let system = System::new(&g, time.node(), &states, &signals, &dx, &[]).unwrap();
        let mut f = system.evaluation();
        f.signals_mut()[0] = 3.0;
        let mut slopes = Slopes::default();
        assert!(f.slopes(0.0, &[0.2, 0.7, 0.25], &mut slopes));
        let expected = DMatrix::from_row_slice(
            3,
            3,
            &[3.0 * 0.6f64.cos(), 1.4, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0],
        );
        assert_eq!(slopes.values().len(), 4);
        assert!((slopes.dense(3) - expected).norm() < 1e-15);
        // at 0 the root is as steep as differences say
        slopes.look(&mut f, 0.0, &[0.2, 0.7, 0.0]);
        assert_eq!(slopes.values().len(), 9);
        assert!(slopes.are_finite() && slopes.dense(3)[(1, 2)] > 1e3);
    }

    /// √(1 − x₁) has no value ahead of x₁ = 1, where its slope is −∞; the column of x₂ is as ever.
    #[test]
    fn where_nothing_is_ahead_differences_look_back() {
        let mut f = Function::new(2, |_, x: &[f64], dx: &mut [f64]| {
            dx[0] = (1.0 - x[0]).sqrt() + 3.0 * x[1];
            dx[1] = -x[0];
        });
        let mut slopes = Slopes::default();
        slopes.look(&mut f, 0.0, &[1.0, 0.5]);
        let found = slopes.dense(2);
        // √h/h for the step h = √ε
        assert!(
            (found[(0, 0)] / -f64::EPSILON.powf(-0.25) - 1.0).abs() < 1e-6,
            "{found}"
        );
        assert!((found[(1, 0)] + 1.0).abs() < 1e-7);
        assert!((found[(0, 1)] - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_knows_no_slopes_is_looked_at_by_differences() {
        let mut f = Function::new(2, |_, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * x[1];
            dx[1] = -3.0 * x[0];
        });
        let mut slopes = Slopes::default();
        slopes.look(&mut f, 0.0, &[2.0, 5.0]);
        let expected = DMatrix::from_row_slice(2, 2, &[5.0, 2.0, -3.0, 0.0]);
        assert!((slopes.dense(2) - expected).norm() < 1e-6);
        let mut product = [0.0; 2];
        slopes.times(&[1.0, -1.0], &mut product);
        assert!((product[0] - 3.0).abs() < 1e-6 && (product[1] + 3.0).abs() < 1e-6);
    }

    /// A state that all others read is one column; a dense right-hand side of many operations is
    /// left to differences.
    #[test]
    fn derivatives_are_not_written_down_at_any_price() {
        let tape = |n: usize, dense: bool| {
            let g = Graph::new();
            let t = g.symbol("t").node();
            let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
            let sum = x.iter().copied().reduce(|a, b| a + b.sin()).unwrap();
            let read = if dense { sum } else { x[0] };
            let dx: Vec<Node> = (0..n)
                .map(|i| (x[i] * read + i as f64).exp().node())
                .collect();
            let inputs: Vec<Node> = [t].into_iter().chain(x.iter().map(|x| x.node())).collect();
            Tape::new(&g, &inputs, &dx).unwrap()
        };
        let sparse = Differentiated::new(&tape(400, false), 400).unwrap();
        assert_eq!(sparse.places.len(), 799);
        assert!(Differentiated::new(&tape(400, true), 400).is_none());
        assert!(Differentiated::new(&tape(40, true), 40).is_some());
    }
}
