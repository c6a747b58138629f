//! The modes of what the outputs do not show, linearised about one point.
//!
//! V is the largest subspace in which the state can be kept, by some unknown input, without a trace in the
//! outputs (Basile and Marro 1992): V₀ = ℝⁿ, V_{k+1} = {x : Fx + Gv ∈ V_k and Cx + Dv = 0 for some v}.
//! On it δx' = (F + GK) δx, δv = K δx. Where more than one v will do, R ⊂ V is reached by them, and
//! what moves along R can do anything.

use std::collections::HashSet;

use lynkeus_expr::{MissingInput, Node, Tape, jacobian};
use lynkeus_proof::spectrum;
use nalgebra::DMatrix;

use super::exact::{self, Shows};
use super::modes::Modes;
use super::rest::Rest;
use super::subspace::{image, null_space, reached};
use super::{Fate, Hidden, Told, clock, coupled};
use crate::{Coordinate, Dimension, Region};

/// States beyond which no modes are looked for.
const STATES: usize = 60;
/// What counts as zero beside one.
const ZERO: f64 = 1e-8;

/// What the linearisation shows.
#[derive(Debug)]
pub(super) struct Local {
    pub of: Vec<Fate>,
    pub point: Vec<Coordinate>,
}

/// At the first of a few points whose linearisation hides exactly what is hidden, those at which nothing moves that it
/// reads before the others; none where there is no such point. Of what reads something that moves on no rate is told.
pub(super) fn fates(hidden: &Hidden<'_, '_>) -> Result<Option<Local>, MissingInput> {
    let extended = hidden.extended;
    if extended.states.len() > STATES {
        return Ok(None);
    }
    let region = extended.region();
    let symbols: Vec<Node> = extended.states.iter().map(|s| s.node).collect();
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let functions: Vec<Node> = extended
        .derivatives
        .iter()
        .copied()
        .chain(outputs)
        .collect();
    let slopes = jacobian::forward(extended.graph(), &functions, &symbols);
    let nodes: Vec<Node> = slopes.entries.iter().map(|e| e.2).collect();
    let tape = Tape::new(extended.graph(), &region.symbols(), &nodes)?;
    let mut evaluator = tape.evaluator();
    let clock = HashSet::from([extended.plant.time]);
    let timed = clock::moved(hidden, &slopes, &clock);
    let is_asked = |i: usize| hidden.told[i] == Told::Hidden;
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
        let found = J
            .iter()
            .all(|x| x.is_finite())
            .then(|| Linear::new(hidden, &J).fates(hidden));
        if let Some(found) = found.flatten() {
            let states = (0..symbols.len()).filter(|&i| !hidden.is_signal(i)).count();
            let exact = exact::shows(&J, states);
            let sure = exact.map_or(vec![false; symbols.len()], |exact| {
                found
                    .iter()
                    .zip(exact)
                    .map(|((_, shown), exact)| *shown == exact)
                    .collect()
            });
            let mut of: Vec<Fate> = found.into_iter().map(|(fate, _)| fate).collect();
            for (fate, _) in of.iter_mut().zip(&timed).filter(|(_, timed)| **timed) {
                *fate = Fate::Undecided;
            }
            coupled::weaken(hidden, &slopes, &sure, &mut of);
            let moved = clock::moved(hidden, &slopes, &rest.moving(&point));
            for (fate, _) in of.iter_mut().zip(moved).filter(|(_, moved)| *moved) {
                if matches!(fate, Fate::Decays { .. } | Fate::Grows { .. }) {
                    *fate = Fate::Undecided;
                }
            }
            let sides = || region.dimensions.iter().zip(&point);
            let is_time = |d: &Dimension| d.symbol == extended.plant.time;
            let is_read = clock::is_read(extended, &nodes);
            // first, as long points are told in part
            let time = sides().filter(|(d, _)| is_read && is_time(d));
            let named = time.chain(sides().filter(|(d, _)| !is_time(d)));
            let point = named.map(|(d, &x)| (d.name.clone(), x).into()).collect();
            return Ok(Some(Local { of, point }));
        }
    }
    Ok(None)
}

/// The start, then points inside the ranges.
fn points(hidden: &Hidden<'_, '_>, region: &Region) -> Vec<Vec<f64>> {
    let extended = hidden.extended;
    let start = |symbol: Node| {
        let mut variables = extended.states.iter().chain(&extended.inputs);
        variables.find(|v| v.node == symbol).and_then(|v| v.start)
    };
    let of_share = |share: f64, starts: bool| -> Vec<f64> {
        let sides = region.dimensions.iter();
        sides
            .map(|d| {
                let inside = match (d.min.is_finite(), d.max.is_finite()) {
                    (true, true) => d.min + share * (d.max - d.min),
                    (true, false) => d.min.max(0.0),
                    (false, true) => d.max.min(0.0),
                    (false, false) => 0.0,
                };
                let inside = if d.integer { inside.round() } else { inside };
                start(d.symbol).filter(|_| starts).unwrap_or(inside)
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

/// What can move without a trace.
struct Traceless {
    /// pairs (x, v), one per column
    pairs: DMatrix<f64>,
    /// an orthonormal basis of V
    V: DMatrix<f64>,
}

impl Linear {
    fn new(hidden: &Hidden<'_, '_>, J: &DMatrix<f64>) -> Self {
        let states = &hidden.extended.states;
        let signals = (0..states.len()).filter(|&i| hidden.is_signal(i)).count();
        let n = states.len() - signals;
        let scale = |i: usize| {
            let width = states[i].max - states[i].min;
            let size = states[i].start.unwrap_or(0.0).abs();
            match width.is_finite() && width > 0.0 {
                true => width,
                false => {
                    if size > 0.0 {
                        size
                    } else {
                        1.0
                    }
                }
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

    /// None where no decomposition is found.
    fn traceless(&self) -> Option<Traceless> {
        let (n, m) = (self.F.nrows(), self.G.ncols());
        let flow = DMatrix::from_fn(n, n + m, |i, j| match j < n {
            true => self.F[(i, j)],
            false => self.G[(i, j - n)],
        });
        let seen = equilibrated(&self.outputs, 0.0);
        let mut V = DMatrix::identity(n, n);
        loop {
            // (Fx + Gv) has no part across V
            let across = null_space(&V.transpose(), ZERO)?;
            let stays = equilibrated(&(across.transpose() * &flow), ZERO * flow.amax());
            let pairs = null_space(&stacked(&stays, &seen), ZERO)?;
            // of columns of length one: where no state moves, rounding moves none
            let pairs = pairs.map(|x| if x.abs() > ZERO { x } else { 0.0 });
            let next = image(&pairs.rows(0, n).into_owned(), ZERO)?;
            // it never grows, but by rounding
            if next.ncols() >= V.ncols() {
                return Some(Traceless { pairs, V });
            }
            V = next;
        }
    }

    /// The fates, with what they rest on, where the linearisation hides what is hidden and nothing else.
    fn fates(&self, hidden: &Hidden<'_, '_>) -> Option<Vec<(Fate, Shows)>> {
        let Traceless { pairs, V } = self.traceless()?;
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
        let of = (0..hidden.told.len()).map(|i| {
            let (row, alone) = match i < n {
                true => (V.row(i).into_owned(), 0.0),
                false => (K.row(i - n).into_owned(), free.row(i - n).amax()),
            };
            if alone > ZERO || (&row * &R).amax() > ZERO {
                return Some((Fate::Moved, Shows::Moved));
            }
            let row = &row * &S;
            if row.norm() <= ZERO {
                return Some((Fate::Undecided, Shows::Nothing));
            }
            let row = DMatrix::from_fn(1, row.ncols(), |_, j| row[j]);
            let (fate, count) = modes.fate(&row)?;
            Some((fate, Shows::Modes(count)))
        });
        let of: Vec<(Fate, Shows)> = of.collect::<Option<_>>()?;
        let agrees = of
            .iter()
            .zip(&hidden.told)
            .all(|((_, shown), told)| match told {
                Told::Determined => *shown == Shows::Nothing,
                Told::Hidden => *shown != Shows::Nothing,
                Told::Open => true,
            });
        let is_open = hidden.told.contains(&Told::Open);
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

fn stacked(above: &DMatrix<f64>, below: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(above.nrows() + below.nrows(), below.ncols(), |i, j| match i
        .checked_sub(above.nrows())
    {
        None => above[(i, j)],
        Some(i) => below[(i, j)],
    })
}
