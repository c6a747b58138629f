//! Where a linearisation tells what becomes of an error: where what its slopes read does not move. An error that
//! obeys δb' = −e^(−2t) δb decays at the rate 1 at the start and keeps 61 % of itself for ever.

use std::collections::HashSet;

use lynkeus_expr::{Evaluator, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::spectrum;
use nalgebra::{DMatrix, DVector};

use super::{Hidden, Told};
use crate::Region;

/// Newton's steps.
const STEPS: usize = 40;
/// Derivatives below this share of their terms are zero.
const ZERO: f64 = 1e-10;
/// Singular values below this share of the largest are not divided by.
const SMALL: f64 = 1e-9;

/// The states that the slopes of the hidden read, and those that these read.
pub(super) struct Rest {
    /// their symbols
    states: Vec<Node>,
    /// places in the region of the states, then of the unknown inputs: these may be what keeps the states at rest
    places: Vec<usize>,
    /// ends of their ranges
    sides: Vec<(f64, f64)>,
    /// per state what its derivative reads
    reads: Vec<Vec<Node>>,
    /// time, and the states that it drives
    driven: HashSet<Node>,
    /// their derivatives, then these by states and unknown inputs, row by row
    evaluator: Evaluator,
}

impl Rest {
    /// `slopes` are those of the equations, then the outputs, by the extended states.
    pub fn new(
        hidden: &Hidden<'_, '_>,
        slopes: &jacobian::Jacobian,
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let extended = hidden.extended;
        let graph = extended.graph();
        let is_free = |entry: &&(usize, usize, Node)| hidden.told[entry.1] != Told::Determined;
        let entries = slopes.entries.iter().filter(is_free);
        let mut open: Vec<Node> = entries.map(|entry| entry.2).collect();
        let mut found: Vec<usize> = vec![];
        loop {
            let read: HashSet<Node> = graph.symbols_of(&open).into_iter().collect();
            let is_new = |place: &usize| {
                read.contains(&extended.states[*place].node) && !found.contains(place)
            };
            let new: Vec<usize> = (0..extended.plant_states()).filter(is_new).collect();
            if new.is_empty() {
                break;
            }
            open.extend(new.iter().map(|&place| extended.derivatives[place]));
            found.extend(new);
        }
        let states: Vec<Node> = found.iter().map(|&i| extended.states[i].node).collect();
        let mut nodes: Vec<Node> = found.iter().map(|&i| extended.derivatives[i]).collect();
        let reads: Vec<Vec<Node>> = nodes.iter().map(|f| graph.symbols_of(&[*f])).collect();
        let signals = (0..extended.states.len()).filter(|&i| hidden.is_signal(i));
        let free: Vec<usize> = found.iter().copied().chain(signals).collect();
        let unknowns: Vec<Node> = free.iter().map(|&i| extended.states[i].node).collect();
        let own = jacobian::forward(graph, &nodes, &unknowns);
        let zero = graph.constant(0.0).node();
        for i in 0..states.len() {
            nodes.extend((0..unknowns.len()).map(|j| own.get(i, j).unwrap_or(zero)));
        }
        let symbols = region.symbols();
        let place = |unknown: &Node| symbols.iter().position(|symbol| symbol == unknown);
        let sides = free
            .iter()
            .map(|&i| (extended.states[i].min, extended.states[i].max));
        Ok(Self {
            places: unknowns.iter().filter_map(place).collect(),
            sides: sides.collect(),
            driven: behind(&states, &reads, HashSet::from([extended.plant.time])),
            evaluator: Tape::new(graph, &symbols, &nodes)?.evaluator(),
            states,
            reads,
        })
    }

    fn at(&mut self, point: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let (n, wide) = (self.states.len(), self.places.len());
        let mut values = vec![0.0; n + n * wide];
        self.evaluator.eval(point, &mut values);
        (
            DVector::from_column_slice(&values[..n]),
            DMatrix::from_row_slice(n, wide, &values[n..]),
        )
    }

    /// Time, and the states that move at this point, unknown inputs being constant, or are driven by some that do.
    pub fn moving(&mut self, point: &[f64]) -> HashSet<Node> {
        let (f, J) = self.at(point);
        let width = |k: usize| {
            let (min, max) = self.sides[k];
            let width = max - min;
            match width.is_finite() && width > 0.0 {
                true => width,
                false => point[self.places[k]].abs().max(1.0),
            }
        };
        let is_moving = |&i: &usize| {
            let terms = (0..J.ncols()).map(|j| J[(i, j)].abs() * width(j));
            let rests = f[i].abs() <= ZERO * terms.fold(0.0, f64::max);
            !rests
        };
        let own = (0..f.len()).filter(is_moving).map(|i| self.states[i]);
        let own = own.chain(self.driven.iter().copied()).collect();
        behind(&self.states, &self.reads, own)
    }

    /// Whether nothing moves at this point but what time drives.
    pub fn holds(&mut self, point: &[f64]) -> bool {
        self.moving(point) == self.driven
    }

    /// This point or the nearest in the box where that holds, by unknown inputs alone where they can keep the states at
    /// rest, else by moving both; none where Newton's method finds none.
    pub fn near(&mut self, point: &[f64]) -> Option<Vec<f64>> {
        if self.holds(point) {
            return Some(point.to_vec());
        }
        let first = self.states.len();
        self.solved(point, first).or_else(|| self.solved(point, 0))
    }

    /// Moves the unknowns from number `first` on.
    fn solved(&mut self, point: &[f64], first: usize) -> Option<Vec<f64>> {
        let mut point = point.to_vec();
        if first == self.places.len() {
            return None;
        }
        for _ in 0..STEPS {
            if self.holds(&point) {
                return Some(point);
            }
            let (mut f, J) = self.at(&point);
            let mut J = J.columns(first, J.ncols() - first).into_owned();
            for i in (0..f.len()).filter(|&i| self.driven.contains(&self.states[i])) {
                f[i] = 0.0;
                J.row_mut(i).fill(0.0);
            }
            let least = SMALL * J.amax();
            let step = spectrum::singular(J, true, true)?.solve(&f, least).ok()?;
            for (k, &place) in self.places.iter().enumerate().skip(first) {
                let (min, max) = self.sides[k];
                point[place] = (point[place] - step[k - first]).clamp(min, max);
            }
        }
        self.holds(&point).then_some(point)
    }
}

/// These symbols, and the states whose derivatives read one of them.
fn behind(states: &[Node], reads: &[Vec<Node>], mut found: HashSet<Node>) -> HashSet<Node> {
    loop {
        let is_new = |k: &usize| {
            !found.contains(&states[*k]) && reads[*k].iter().any(|symbol| found.contains(symbol))
        };
        match (0..states.len()).find(is_new) {
            Some(k) => found.insert(states[k]),
            None => return found,
        };
    }
}
