//! The modes of what the outputs do not show, linearised about one point.
//!
//! V is the largest subspace in which the state can be kept, by some unknown input, without a trace in the
//! outputs (Basile and Marro 1992): V₀ = ℝⁿ, V_{k+1} = {x : Fx + Gv ∈ V_k and Cx + Dv = 0 for some v}.
//! On it δx' = (F + GK) δx, δv = K δx. Where more than one v will do, R ⊂ V is reached by them, and
//! what moves along R can do anything.

use std::collections::HashSet;

use lynkeus_expr::{Evaluator, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::spectrum;
use nalgebra::{DMatrix, DVector};

use crate::Region;
use crate::detectability::exact::{self, Shows};
use crate::detectability::hidden::{Detectability, Hidden, HiddenErrors, Observability};
use crate::detectability::modes::{Modes, beside, image, null_space, reached};

/// States beyond which no modes are looked for.
const STATES: usize = 60;
/// What counts as zero beside one.
const ZERO: f64 = 1e-8;

/// At the first of a few points whose linearisation hides exactly what is hidden, those at which nothing moves that it
/// reads before the others; none where there is no such point. Of what reads something that moves on no rate is given.
pub(super) fn hidden_errors(hidden: &Hidden<'_, '_>) -> Result<Option<HiddenErrors>, MissingInput> {
    let augmented = hidden.augmented;
    if augmented.states.len() > STATES {
        return Ok(None);
    }
    let region = augmented.region();
    let symbols = augmented.symbols();
    let functions = [augmented.derivatives.clone(), augmented.output_nodes()].concat();
    let slopes = jacobian::forward(augmented.graph(), &functions, &symbols);
    let nodes: Vec<Node> = slopes.entries.iter().map(|e| e.2).collect();
    let tape = Tape::new(augmented.graph(), &region.symbols(), &nodes)?;
    let mut evaluator = tape.evaluator();
    let clock = HashSet::from([augmented.plant.time]);
    let timed = moved(hidden, &slopes, &clock);
    let is_asked = |i: usize| hidden.observability[i] == Observability::Hidden;
    if (0..timed.len()).all(|i| timed[i] || !is_asked(i)) {
        return Ok(None);
    }
    let mut rest = Rest::new(hidden, &slopes, &region)?;
    let starts = points(hidden, &region);
    let near: Vec<_> = starts.iter().filter_map(|point| rest.near(point)).collect();
    for point in near.into_iter().chain(starts) {
        let mut values = vec![0.0; nodes.len()];
        evaluator.eval(&point, &mut values);
        let mut J = DMatrix::zeros(functions.len(), symbols.len());
        for (entry, value) in slopes.entries.iter().zip(&values) {
            J[(entry.0, entry.1)] = *value;
        }
        if !J.iter().all(|x| x.is_finite()) {
            continue;
        }
        let Some(found) = Linear::new(hidden, &J).hidden_errors(hidden) else {
            continue;
        };
        let (mut of, shown): (Vec<Detectability>, Vec<Shows>) = found.into_iter().unzip();
        for (detectability, _) in of.iter_mut().zip(&timed).filter(|(_, timed)| **timed) {
            *detectability = Detectability::Undecided;
        }
        let states = (0..symbols.len()).filter(|&i| !hidden.is_signal(i)).count();
        let sure = exact::shows(&J, states).map_or(vec![false; symbols.len()], |exact| {
            shown.iter().zip(exact).map(|(a, b)| *a == b).collect()
        });
        weaken(hidden, &slopes, &sure, &mut of);
        let moved = moved(hidden, &slopes, &rest.moving(&point));
        for (detectability, _) in of.iter_mut().zip(moved).filter(|(_, moved)| *moved) {
            if let Detectability::Decays { .. } | Detectability::Grows { .. } = detectability {
                *detectability = Detectability::Undecided;
            }
        }
        let mut at = region.coordinates(&point);
        let time = at.pop();
        let read = augmented.graph().symbols_of(&nodes);
        if read.contains(&augmented.plant.time) {
            // first, as long points are shown in part
            at.splice(0..0, time);
        }
        return Ok(Some(HiddenErrors {
            of: of.into_iter().map(Some).collect(),
            point: at,
        }));
    }
    Ok(None)
}

/// The start, then points inside the ranges.
fn points(hidden: &Hidden<'_, '_>, region: &Region) -> Vec<Vec<f64>> {
    let augmented = hidden.augmented;
    let variables = || augmented.states.iter().chain(&augmented.inputs);
    let of_share = |share: f64, starts: bool| -> Vec<f64> {
        // time comes last
        let start = variables().map(|v| v.start).chain([None]);
        let sides = region.dimensions.iter().zip(start);
        sides
            .map(|(d, start)| {
                let inside = match (d.min.is_finite(), d.max.is_finite()) {
                    (true, true) => d.min + share * (d.max - d.min),
                    (true, false) => d.min.max(0.0),
                    (false, true) => d.max.min(0.0),
                    (false, false) => 0.0,
                };
                let inside = if d.integer { inside.round() } else { inside };
                start.filter(|_| starts).unwrap_or(inside)
            })
            .collect()
    };
    vec![
        of_share(0.5, true),
        of_share(0.5, false),
        of_share(0.382, false),
    ]
}

/// x' = Fx + Gv, y = Cx + Dv in widths of the ranges.
struct Linear {
    F: DMatrix<f64>,
    G: DMatrix<f64>,
    /// [C D]
    outputs: DMatrix<f64>,
}

impl Linear {
    fn new(hidden: &Hidden<'_, '_>, J: &DMatrix<f64>) -> Self {
        let states = &hidden.augmented.states;
        let signals = (0..states.len()).filter(|&i| hidden.is_signal(i)).count();
        let n = states.len() - signals;
        let scale = |i: usize| {
            let width = states[i].max - states[i].min;
            let size = states[i].start.unwrap_or(0.0).abs();
            match width.is_finite() && width > 0.0 {
                true => width,
                false if size > 0.0 => size,
                false => 1.0,
            }
        };
        let of_state = |i: usize, j: usize| J[(i, j)] * scale(j) / scale(i);
        let first = states.len();
        Self {
            F: DMatrix::from_fn(n, n, of_state),
            G: DMatrix::from_fn(n, signals, |i, j| of_state(i, n + j)),
            outputs: DMatrix::from_fn(J.nrows() - first, first, |i, j| {
                J[(first + i, j)] * scale(j)
            }),
        }
    }

    /// What can move without a trace: pairs (x, v), one per column, and an orthonormal basis of V. None where no
    /// decomposition is found.
    fn traceless(&self) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let n = self.F.nrows();
        let flow = beside(&self.F, &self.G);
        let seen = equilibrated(&self.outputs, 0.0);
        let mut V = DMatrix::identity(n, n);
        loop {
            // (Fx + Gv) has no part across V
            let across = null_space(&V.transpose(), ZERO)?;
            let stays = equilibrated(&(across.transpose() * &flow), ZERO * flow.amax());
            let all = beside(&stays.transpose(), &seen.transpose()).transpose();
            let pairs = null_space(&all, ZERO)?;
            // of columns of length one: where no state moves, rounding moves none
            let pairs = pairs.map(|x| if x.abs() > ZERO { x } else { 0.0 });
            let next = image(&pairs.rows(0, n).into_owned(), ZERO)?;
            // it never grows, but by rounding
            if next.ncols() >= V.ncols() {
                return Some((pairs, V));
            }
            V = next;
        }
    }

    /// What becomes of hidden errors, with what that rests on, where the linearisation hides what is hidden and nothing else.
    fn hidden_errors(&self, hidden: &Hidden<'_, '_>) -> Option<Vec<(Detectability, Shows)>> {
        let (pairs, V) = self.traceless()?;
        let n = self.F.nrows();
        if pairs.ncols() == 0 {
            // frozen at the point, everything is seen
            return None;
        }
        let (x, v) = (
            pairs.rows(0, n).into_owned(),
            pairs.rows(n, pairs.nrows() - n).into_owned(),
        );
        let solver = spectrum::singular(x.clone(), true, true)?;
        let K = &v * solver.solve(&V, ZERO).ok()?;
        let free = &v * null_space(&x, ZERO)?;
        let A = V.transpose() * (&self.F * &V + &self.G * &K);
        let R = reached(&A, &(V.transpose() * &self.G * &free), ZERO)?;
        let S = null_space(&R.transpose(), ZERO)?;
        let modes = Modes {
            A: S.transpose() * &A * &S,
            gross: self.F.norm() + (&self.G * &K).norm(),
        };
        let of = (0..hidden.observability.len()).map(|i| {
            let (row, alone) = match i < n {
                true => (V.row(i).into_owned(), 0.0),
                false => (K.row(i - n).into_owned(), free.row(i - n).amax()),
            };
            if alone > ZERO || (&row * &R).amax() > ZERO {
                return Some((Detectability::Moved, Shows::Moved));
            }
            let row = &row * &S;
            if row.norm() <= ZERO {
                return Some((Detectability::Undecided, Shows::Nothing));
            }
            let row = DMatrix::from_fn(1, row.ncols(), |_, j| row[j]);
            let (detectability, count) = modes.detectability(&row)?;
            Some((detectability, Shows::Modes(count)))
        });
        let of: Vec<(Detectability, Shows)> = of.collect::<Option<_>>()?;
        let agrees = of
            .iter()
            .zip(&hidden.observability)
            .all(|((_, shown), observability)| match observability {
                Observability::Determined => *shown == Shows::Nothing,
                Observability::Hidden => *shown != Shows::Nothing,
                Observability::Open => true,
            });
        let is_open = hidden.observability.contains(&Observability::Open);
        let counts = is_open || hidden.directions == pairs.ncols();
        (agrees && counts).then_some(of)
    }
}

/// Rows of length one, those up to `least` left out.
fn equilibrated(rows: &DMatrix<f64>, least: f64) -> DMatrix<f64> {
    let kept: Vec<_> = rows
        .row_iter()
        .filter(|row| row.norm() > least)
        .map(|row| row / row.norm())
        .collect();
    DMatrix::from_fn(kept.len(), rows.ncols(), |i, j| kept[i][j])
}

/// Newton's steps.
const STEPS: usize = 40;
/// Derivatives below this share of their terms are zero.
const STILL: f64 = 1e-10;
/// Singular values below this share of the largest are not divided by.
const SMALL: f64 = 1e-9;

/// The states that the slopes of the hidden read, and those that these read.
struct Rest {
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
    /// `slopes` are those of the equations, then the outputs, by the augmented states.
    fn new(
        hidden: &Hidden<'_, '_>,
        slopes: &jacobian::Jacobian,
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let augmented = hidden.augmented;
        let graph = augmented.graph();
        let entries = slopes.entries.iter();
        let entries = entries.filter(|entry| hidden.is_free(entry.1));
        let mut open: Vec<Node> = entries.map(|entry| entry.2).collect();
        let mut found: Vec<usize> = vec![];
        loop {
            let read: HashSet<Node> = graph.symbols_of(&open).into_iter().collect();
            let is_new = |place: &usize| {
                read.contains(&augmented.states[*place].node) && !found.contains(place)
            };
            let new: Vec<usize> = (0..augmented.plant_states()).filter(is_new).collect();
            if new.is_empty() {
                break;
            }
            open.extend(new.iter().map(|&place| augmented.derivatives[place]));
            found.extend(new);
        }
        let states: Vec<Node> = found.iter().map(|&i| augmented.states[i].node).collect();
        let mut nodes: Vec<Node> = found.iter().map(|&i| augmented.derivatives[i]).collect();
        let reads: Vec<Vec<Node>> = nodes.iter().map(|f| graph.symbols_of(&[*f])).collect();
        let signals = (0..augmented.states.len()).filter(|&i| hidden.is_signal(i));
        let free: Vec<usize> = found.iter().copied().chain(signals).collect();
        let unknowns: Vec<Node> = free.iter().map(|&i| augmented.states[i].node).collect();
        let own = jacobian::forward(graph, &nodes, &unknowns);
        let zero = graph.constant(0.0).node();
        for i in 0..states.len() {
            nodes.extend((0..unknowns.len()).map(|j| own.get(i, j).unwrap_or(zero)));
        }
        let side = |&i: &usize| (augmented.states[i].min, augmented.states[i].max);
        Ok(Self {
            sides: free.iter().map(side).collect(),
            // the augmented states come first
            places: free,
            driven: behind(&states, &reads, HashSet::from([augmented.plant.time])),
            evaluator: Tape::new(graph, &region.symbols(), &nodes)?.evaluator(),
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
    fn moving(&mut self, point: &[f64]) -> HashSet<Node> {
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
            let rests = f[i].abs() <= STILL * terms.fold(0.0, f64::max);
            !rests
        };
        let own = (0..f.len()).filter(is_moving).map(|i| self.states[i]);
        let own = own.chain(self.driven.iter().copied()).collect();
        behind(&self.states, &self.reads, own)
    }

    /// Whether nothing moves at this point but what time drives.
    fn holds(&mut self, point: &[f64]) -> bool {
        self.moving(point) == self.driven
    }

    /// This point or the nearest in the box where that holds, by unknown inputs alone where they can keep the states at
    /// rest, else by moving both; none where Newton's method finds none.
    fn near(&mut self, point: &[f64]) -> Option<Vec<f64>> {
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

/// Per augmented state whether the error in it, if it is hidden, obeys an equation that reads one of these
/// symbols. `slopes` are those of the equations, then the outputs, by the augmented states.
fn moved(
    hidden: &Hidden<'_, '_>,
    slopes: &jacobian::Jacobian,
    moving: &HashSet<Node>,
) -> Vec<bool> {
    let graph = hidden.augmented.graph();
    let reads = |slope: Node| {
        graph
            .symbols_of(&[slope])
            .iter()
            .any(|s| moving.contains(s))
    };
    let count = hidden.observability.len();
    let entries = slopes.entries.iter();
    let entries = entries.filter(|entry| hidden.is_free(entry.1));
    let entries: Vec<(usize, usize, bool)> = entries
        .map(|(i, j, slope)| (*i, *j, reads(*slope)))
        .collect();
    let is_driven = !hidden.free().1.is_empty();
    let mut moved = vec![false; count];
    loop {
        let is_new = |i: usize| !hidden.is_free(i) || !moved[i];
        let next = entries
            .iter()
            .find(|&&(i, j, own)| is_new(i) && (own || moved[j]));
        match next {
            // what the outputs and the equations of what is known say couples all that is
            // hidden, as do unknown inputs
            Some(&(i, ..)) if is_driven || !hidden.is_free(i) => return vec![true; count],
            Some(&(i, ..)) => moved[i] = true,
            None => return moved,
        }
    }
}

/// Undecides what decays or stays, but reads what does not. `slopes` are those of the equations by the
/// augmented states; that the outputs may cancel what is read is not looked for. What is `sure` rests on no threshold.
fn weaken(
    hidden: &Hidden<'_, '_>,
    slopes: &jacobian::Jacobian,
    sure: &[bool],
    of: &mut [Detectability],
) {
    let is_coupled = |i: usize, j: usize| hidden.is_free(i) && hidden.is_free(j) && !sure[i];
    let couplings = slopes.entries.iter();
    let couplings = couplings.filter(|entry| is_coupled(entry.0, entry.1));
    let couplings: Vec<(usize, usize)> = couplings.map(|(i, j, _)| (*i, *j)).collect();
    loop {
        let doubted = couplings.iter().find(|(i, j)| match of[*i] {
            Detectability::Decays { .. } => !matches!(of[*j], Detectability::Decays { .. }),
            Detectability::Stays => {
                !matches!(of[*j], Detectability::Decays { .. } | Detectability::Stays)
            }
            _ => false,
        });
        match doubted {
            Some((i, _)) => of[*i] = Detectability::Undecided,
            None => return,
        }
    }
}
