//! The modes of what the outputs do not show, linearised about one point.
//!
//! V is the largest subspace in which the state can be kept, by some unknown input, without a trace in the
//! outputs (Basile and Marro 1992): V₀ = ℝⁿ, V_{k+1} = {x : Fx + Gv ∈ V_k and Cx + Dv = 0 for some v}.
//! On it δx' = (F + GK) δx, δv = K δx. Where more than one v will do, R ⊂ V is reached by them, and
//! what moves along R can do anything.

use lynkeus_expr::{MissingInput, Node, Tape, jacobian};
use lynkeus_proof::spectrum;
use nalgebra::{Complex, DMatrix, DVector};

use super::{Fate, Ground, Hidden, Told};
use crate::{Coordinate, Region};

/// States beyond which no modes are looked for.
const STATES: usize = 60;
/// What counts as zero beside one.
const ZERO: f64 = 1e-8;
/// Real parts within this share of the largest entry count as none: multiple eigenvalues on the
/// imaginary axis are computed with a few digits only.
const AXIS: f64 = 1e-5;
/// The rounding of entries that computed eigenvalues stand for.
const EIGENVALUES: f64 = 10.0 * f64::EPSILON;
/// Entries within this share of those of the plant may be rounding alone.
const ROUNDING: f64 = 1e-8;

/// What the linearisation shows.
#[derive(Debug)]
pub(super) struct Local {
    pub of: Vec<Fate>,
    pub point: Vec<Coordinate>,
}

/// At the first of a few points whose linearisation hides exactly what is hidden; none where
/// there is no such point.
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
    for point in points(hidden, &region) {
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
        if let Some(of) = found.flatten() {
            let names = region.dimensions.iter().zip(&point);
            let named = names.filter(|(d, _)| d.name != "time");
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
            let across = null_space(&V.transpose())?;
            let stays = equilibrated(&(across.transpose() * &flow), ZERO * flow.amax());
            let pairs = null_space(&stacked(&stays, &seen))?;
            // of columns of length one: where no state moves, rounding moves none
            let pairs = pairs.map(|x| if x.abs() > ZERO { x } else { 0.0 });
            let next = image(&pairs.rows(0, n).into_owned())?;
            // it never grows, but by rounding
            if next.ncols() >= V.ncols() {
                return Some(Traceless { pairs, V });
            }
            V = next;
        }
    }

    /// The fates, where the linearisation hides what is hidden and nothing else.
    fn fates(&self, hidden: &Hidden<'_, '_>) -> Option<Vec<Fate>> {
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
        let free = &v * null_space(&x)?;
        let A = V.transpose() * (&self.F * &V + &self.G * &K);
        let R = reached(&A, &(V.transpose() * &self.G * &free))?;
        let S = null_space(&R.transpose())?;
        let quotient = S.transpose() * &A * &S;
        let gross = self.F.amax() + (&self.G * &K).amax();
        let scale = A.amax().max(ROUNDING * gross);
        let of = (0..hidden.told.len()).map(|i| {
            let (row, alone) = match i < n {
                true => (V.row(i).into_owned(), 0.0),
                false => (K.row(i - n).into_owned(), free.row(i - n).amax()),
            };
            if alone > ZERO || (&row * &R).amax() > ZERO {
                return Some(Some(Fate::Moved));
            }
            let row = &row * &S;
            if row.norm() <= ZERO {
                return Some(None);
            }
            let row = DMatrix::from_fn(1, row.ncols(), |_, j| row[j]);
            fate(&quotient, row, scale).map(Some)
        });
        let of: Vec<Option<Fate>> = of.collect::<Option<_>>()?;
        let agrees = of.iter().zip(&hidden.told).all(|(fate, told)| match told {
            Told::Determined => fate.is_none(),
            Told::Hidden => fate.is_some(),
            Told::Open => true,
        });
        let is_open = hidden.told.contains(&Told::Open);
        let counts = is_open || hidden.directions == pairs.ncols();
        (agrees && counts).then(|| {
            of.into_iter()
                .map(|fate| fate.unwrap_or(Fate::Undecided))
                .collect()
        })
    }
}

/// The slowest mode of x' = Ax that shows in a row, undecided where rounding may carry it across
/// the imaginary axis; none where its eigenvalues are not found.
fn fate(A: &DMatrix<f64>, row: DMatrix<f64>, scale: f64) -> Option<Fate> {
    let shown = reached(&A.transpose(), &row.transpose())?;
    let modes = spectrum::eigenvalues(shown.transpose() * A * &shown)?;
    let slowest = modes.iter().max_by(|a, b| a.re.total_cmp(&b.re))?;
    let blur = AXIS.max(blur(&modes, *slowest, scale)) * scale;
    Some(match slowest.re {
        x if x < -blur => Fate::Decays {
            rate: -x,
            ground: Ground::Point,
        },
        x if x > blur => Fate::Grows { rate: x },
        x if x.abs() <= AXIS * scale => Fate::Stays,
        _ => Fate::Undecided,
    })
}

/// How far a mode may be from where it is computed, in units of `scale`: a k-fold one, which
/// rounding spreads over a circle, by the k-th root of the rounding.
fn blur(modes: &DVector<Complex<f64>>, mode: Complex<f64>, scale: f64) -> f64 {
    let radius = |k: usize| EIGENVALUES.powf(1.0 / k as f64);
    let near = |k: usize| {
        let across = 2.0 * radius(k) * scale;
        modes
            .iter()
            .filter(|λ| (**λ - mode).norm() <= across)
            .count()
    };
    let folds = (1..=modes.len()).rev().find(|&k| near(k) >= k);
    folds.map_or(0.0, radius)
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

/// An orthonormal basis of the null space; a matrix without rows has all of it. None where no
/// decomposition is found, as here below.
fn null_space(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = a.ncols();
    if n == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    // rows of zeros, so that every direction is listed
    let square = DMatrix::from_fn(a.nrows().max(n), n, |i, j| {
        if i < a.nrows() { a[(i, j)] } else { 0.0 }
    });
    let svd = spectrum::singular(square, false, true)?;
    let right = svd.v_t.as_ref()?;
    let unseen: Vec<usize> = (0..n)
        .filter(|&k| {
            svd.singular_values[k] <= ZERO * svd.singular_values.max().max(f64::MIN_POSITIVE)
        })
        .collect();
    Some(DMatrix::from_fn(n, unseen.len(), |i, k| {
        right[(unseen[k], i)]
    }))
}

/// An orthonormal basis of the space that the columns span.
fn image(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let across = null_space(&a.transpose())?;
    null_space(&across.transpose())
}

/// An orthonormal basis of the smallest A-invariant space that holds the columns of B.
fn reached(A: &DMatrix<f64>, B: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = A.nrows();
    let scale = A.amax().max(f64::MIN_POSITIVE);
    let columns: Vec<_> = B
        .column_iter()
        .filter(|c| c.norm() > ZERO)
        .map(|c| c.normalize())
        .collect();
    let mut space = image(&DMatrix::from_fn(n, columns.len(), |i, k| columns[k][i]))?;
    loop {
        let moved = A * &space / scale;
        let both = DMatrix::from_fn(n, 2 * space.ncols(), |i, k| {
            match k.checked_sub(space.ncols()) {
                None => space[(i, k)],
                Some(k) => moved[(i, k)],
            }
        });
        let next = image(&both)?;
        // it never shrinks, but by rounding
        if next.ncols() <= space.ncols() {
            return Some(space);
        }
        space = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fate of what `row` shows of x' = Ax, in coordinates that leave no entry of A as it is.
    fn mirrored(A: &DMatrix<f64>, row: &[f64]) -> Fate {
        let n = A.nrows();
        let v = DMatrix::from_fn(n, 1, |i, _| 1.0 + (i as f64).sin());
        let Q = DMatrix::identity(n, n) - &v * v.transpose() * (2.0 / v.norm_squared());
        let row = DMatrix::from_row_slice(1, n, row) * &Q;
        fate(&(&Q * A * &Q), row, 1.0).unwrap()
    }

    fn first(n: usize) -> Vec<f64> {
        (0..n).map(|i| f64::from(u8::from(i == 0))).collect()
    }

    /// x_i' = x_{i+1} + r x_i
    fn chain(n: usize, r: f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| match j.checked_sub(i) {
            Some(0) => r,
            Some(1) => 1.0,
            _ => 0.0,
        })
    }

    /// An n-fold mode is computed with an error of the n-th root of the rounding: of ten states,
    /// 0.03.
    #[test]
    fn a_multiple_mode_near_the_axis_is_undecided() {
        for r in [-0.01, 0.01, -1e-4] {
            let fate = mirrored(&chain(10, r), &first(10));
            assert!(matches!(fate, Fate::Undecided), "{fate:?}");
        }
        let fate = mirrored(&chain(10, -0.5), &first(10));
        assert!(
            matches!(fate, Fate::Decays { rate, .. } if rate > 0.3),
            "{fate:?}"
        );
        let fate = mirrored(&chain(10, 0.5), &first(10));
        assert!(matches!(fate, Fate::Grows { .. }), "{fate:?}");
    }

    /// Ten modes that are apart are computed to all digits, however slow the slowest is.
    #[test]
    fn modes_that_are_apart_are_decided() {
        for slowest in [-1e-3, 1e-3] {
            let mut A = chain(10, 0.0);
            for i in 0..10 {
                A[(i, i)] = if i == 6 {
                    slowest
                } else {
                    -0.2 - 0.3 * i as f64
                };
            }
            let fate = mirrored(&A, &first(10));
            let found = match fate {
                Fate::Decays { rate, .. } => -rate,
                Fate::Grows { rate } => rate,
                other => panic!("{other:?}"),
            };
            assert!((found - slowest).abs() < 1e-9, "{found}");
        }
    }
}
