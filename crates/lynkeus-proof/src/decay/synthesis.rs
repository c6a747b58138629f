//! Gains with a proof: K and P together, by the change of variables Y = PK.

use lynkeus_expr::{Budget, Spent};
use nalgebra::{DMatrix, DVector};

use super::analysis::{Extent, inequality, is_large, prove};
use super::frame::Frame;
use super::{ErrorModel, Proof, unit_rows};
use crate::lmi::{Affine, Failure, Problem};
use crate::lyapunov::symmetric;
use crate::spectrum;

/// Rounds of the alternation between K and P.
const ROUNDS: usize = 6;
/// A share of the noise where the peak is the objective: it keeps the gain finite.
const SHARE: f64 = 0.1;
/// Bound of P relative to the first point's.
const CEILING: f64 = 10.0;
/// A gain is sought for a rate larger by this share, so that its proof has room.
const RESERVE: f64 = 0.01;
/// A round has to lower the largest entry by this share to be worth another.
const PROGRESS: f64 = 0.02;

/// What to make small for the required decay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Aim {
    /// tr(W KᵀPK) with P ≥ I: a bound of how measurement noise reaches the estimate
    #[default]
    Noise,
    /// cond(P): |e(t)| ≤ √cond(P)·e^(−rate·t)·|e(0)|, the bound of the transient's peak
    Peak,
    /// the largest entry of K
    Gain,
}

/// What is asked of a gain.
#[derive(Clone, Debug)]
pub struct Request {
    /// required decay, 1/time unit
    pub rate: f64,
    /// per output: the state it shows
    pub measured: Vec<usize>,
    /// per output: |c| > 0 of y = c·x + d, x being the state that it shows
    pub slopes: Vec<f64>,
    /// per output: the size of its measurement error, in its own unit, for [`Aim::Noise`]
    pub noise: Vec<f64>,
    /// per state: the size that counts as one
    pub scale: Vec<f64>,
    /// what to make small
    pub aim: Aim,
    /// largest entry allowed, of a gain on the errors of the outputs
    pub limit: Option<f64>,
    /// when to end the search
    pub budget: Budget,
}

impl Request {
    /// The largest entry that a gain on the errors of the states has on those of the outputs.
    #[must_use]
    pub fn largest(&self, K: &DMatrix<f64>) -> f64 {
        let columns = K.column_iter().zip(&self.slopes);
        columns.map(|(k, c)| k.amax() / c).fold(0.0, f64::max)
    }
}

/// A gain with the proof of its decay.
#[derive(Clone, Debug)]
pub struct Gain {
    /// K on the errors of the states that the outputs show: one row per state, one column per
    /// output
    pub K: DMatrix<f64>,
    /// the proof, accepted by [`super::holds`] for the models corrected by K
    pub proof: Proof,
}

/// Why there is no gain.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoGain {
    /// no gain is proved to reach the rate
    #[error("no gain is proved to reach the rate")]
    Unproved,
    /// gains reach the rate, but with larger entries on the outputs' errors than allowed
    #[error("the smallest largest entry found is {0:.4}")]
    Limit(f64),
    /// a limit ended the search
    #[error("undecided: {0}")]
    Spent(Spent),
}

/// A gain that is proved to reach the rate.
///
/// # Errors
/// [`NoGain`].
pub fn design(models: &[ErrorModel], request: &Request) -> Result<Gain, NoGain> {
    let scaled = Scaled::new(models, request).ok_or(NoGain::Unproved)?;
    let mut K = scaled.direct().map_err(|failure| match failure {
        Failure::Spent(spent) => NoGain::Spent(spent),
        _ => NoGain::Unproved,
    })?;
    let over = |K: &DMatrix<f64>| {
        let limit = request.limit;
        limit.is_some_and(|limit| request.largest(K) > limit)
    };
    if request.aim == Aim::Gain || over(&K) {
        K = scaled.alternated(K);
    }
    if over(&K) {
        return Err(NoGain::Limit(request.largest(&K)));
    }
    let corrected: Vec<ErrorModel> = models
        .iter()
        .map(|m| m.corrected(&K, &request.measured))
        .collect();
    let proof = prove(&corrected, &request.scale, request.rate, &request.budget);
    let spent = request.budget.marked();
    let proof = proof.ok_or(spent.map_or(NoGain::Unproved, NoGain::Spent))?;
    Ok(Gain { K, proof })
}

/// Whether some gain is seen to reach the rate, whatever its size: cheaper than the gain
/// itself. A `quick` look at a large system tries Lyapunov matrices without entries between
/// states that are far from each other, and no others.
pub fn is_reachable(models: &[ErrorModel], request: &Request, quick: bool) -> bool {
    let Some(scaled) = Scaled::new(models, request) else {
        return false;
    };
    let exists = |extent| {
        let all = scaled.inequalities(extent).bounded(WIDEST);
        all.has_inside().is_ok()
    };
    match is_large(scaled.size()) {
        true => exists(Extent::Near) || !quick && exists(Extent::Full),
        false => exists(Extent::Full),
    }
}

struct Scaled<'a> {
    models: Vec<ErrorModel>,
    rate: f64,
    request: &'a Request,
    frame: Frame,
}

impl<'a> Scaled<'a> {
    /// None of models of which no gain can be sought: without any, or without bounds.
    fn new(models: &[ErrorModel], request: &'a Request) -> Option<Self> {
        let is_sound = !models.is_empty() && models.iter().all(ErrorModel::is_bounded);
        let frame = is_sound.then(|| Frame::plain(models, &request.scale))?;
        let scaled = |m: &ErrorModel| m.scaled(&frame.sizes, frame.unit);
        Some(Self {
            models: models.iter().map(scaled).collect(),
            rate: request.rate * frame.unit * (1.0 + RESERVE),
            request,
            frame,
        })
    }

    fn size(&self) -> usize {
        self.frame.sizes.len()
    }

    /// C, one row per output.
    fn selector(&self) -> DMatrix<f64> {
        unit_rows(self.request.measured.iter().copied(), self.size())
    }

    /// One factor per entry of K: from scaled to the user's units.
    fn unit(&self, i: usize, j: usize) -> f64 {
        let s = &self.frame.sizes;
        s[i] / (s[self.request.measured[j]] * self.frame.unit)
    }

    fn in_units(&self, K: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(K.nrows(), K.ncols(), |i, j| K[(i, j)] * self.unit(i, j))
    }

    /// The inequality of every model, where its middle matrix makes PA; its multipliers.
    fn constrain(
        &self,
        problem: &mut Problem,
        P: &Affine,
        PA: impl Fn(&DMatrix<f64>) -> Affine,
    ) -> Vec<Affine> {
        let one = |model: &ErrorModel| {
            let uncertain = (&model.spread(), &model.reads());
            inequality(problem, P, &PA(&model.nominal()), uncertain, self.rate)
        };
        self.models.iter().map(one).collect()
    }

    /// P > 0 and the inequality of every model in P and Y = PK.
    fn inequalities(&self, extent: Extent) -> Inequalities {
        let mut problem = Problem::new(&self.request.budget);
        let P = extent.lyapunov(&mut problem, &self.models);
        let Y = problem.matrix(self.size(), self.request.measured.len());
        problem.positive(P.clone());
        let YC = Y.times(&self.selector());
        let T = self.constrain(&mut problem, &P, |A| P.times(A).minus(&YC));
        Inequalities { problem, P, Y, T }
    }

    /// A point inside `all`, P being of full extent. In large systems one with few unknowns
    /// is looked for first, and then whether there is one at all.
    fn first(&self, all: &Inequalities) -> Result<DVector<f64>, Failure> {
        if is_large(self.size()) {
            let near = self.inequalities(Extent::Near);
            if near.bounded(WIDEST).has_inside().is_ok()
                && let Ok(found) = near.normalised()
            {
                return Ok(all.like(&near, &found));
            }
            // what the arithmetic did not decide may be decided with other bounds
            match all.bounded(WIDEST).has_inside() {
                Ok(()) | Err(Failure::Numerical) => {}
                Err(decided) => return Err(decided),
            }
        }
        all.normalised()
    }

    /// The convex problem in P and Y = PK.
    fn direct(&self) -> Result<DMatrix<f64>, Failure> {
        let (n, p) = (self.size(), self.request.measured.len());
        let all = self.inequalities(Extent::Full);
        let first = self.first(&all)?;
        let Inequalities {
            mut problem, P, Y, ..
        } = all;
        // Z ≥ YᵀP⁻¹Y = KᵀPK and β ≥ |P|
        let (Z, β) = (problem.symmetric(p), problem.matrix(1, 1));
        problem.positive(Affine::symmetric_blocks(&Z, &Y.transposed(), &P));
        problem.positive(Affine::multiple_of_identity(&β, n).minus(&P));
        let (start, largest) = roomy(&first, &P, &Y)?;
        let ceiling = Affine::identity(1).scaled(CEILING * largest);
        problem.positive(ceiling.minus(&β));
        problem.positive(P.minus(&Affine::identity(n)));
        let noise = Z.times(&self.weights()).trace();
        problem.minimise(&match self.request.aim {
            Aim::Noise | Aim::Gain => noise,
            Aim::Peak => β.plus(&noise.scaled(SHARE)),
        });
        let solution = problem.solve_from(&start)?;
        let factor = symmetric(&P.at(&solution)).cholesky();
        let P = factor.ok_or(Failure::Numerical)?;
        Ok(self.in_units(&P.solve(&Y.at(&solution))))
    }

    /// Squares of the outputs' errors in scaled units, the largest as one.
    fn weights(&self) -> DMatrix<f64> {
        let states = &self.frame.sizes;
        let request = self.request;
        let relative =
            |j: usize, noise: f64| noise / (request.slopes[j] * states[request.measured[j]]);
        let sizes = DVector::from_column_slice(&request.noise);
        let sizes = sizes.map_with_location(|j, _, noise| relative(j, noise));
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        DMatrix::from_diagonal(&sizes.map(|size| match largest > 0.0 {
            true => (size / largest).powi(2).max(1e-4),
            false => 1.0,
        }))
    }

    /// Smaller largest entries: P for K, then K for that P, while it helps.
    fn alternated(&self, start: DMatrix<f64>) -> DMatrix<f64> {
        let largest = |K: &DMatrix<f64>| self.request.largest(K);
        let mut best = start;
        for _ in 0..ROUNDS {
            let Some(P) = self.central(&best) else { break };
            let Some(K) = self.smallest(&P) else { break };
            let gained = largest(&K) < largest(&best) * (1.0 - PROGRESS);
            if largest(&K) < largest(&best) && self.central(&K).is_some() {
                best = K;
            }
            if !gained {
                break;
            }
        }
        best
    }

    /// P with the inequality for a given K satisfied by the largest margin.
    fn central(&self, K: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let n = self.size();
        let K = DMatrix::from_fn(n, K.ncols(), |i, j| K[(i, j)] / self.unit(i, j));
        let KC = K * self.selector();
        let mut problem = Problem::new(&self.request.budget);
        let P = problem.symmetric(n);
        problem.positive(P.clone());
        problem.positive(Affine::identity(n).minus(&P));
        self.constrain(&mut problem, &P, |A| P.times(&(A - &KC)));
        let solution = problem.inside().ok()?;
        Some(symmetric(&P.at(&solution)))
    }

    /// K with the smallest largest entry for a given P.
    fn smallest(&self, P: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (n, p) = (self.size(), self.request.measured.len());
        let mut problem = Problem::new(&self.request.budget);
        let K = problem.matrix(n, p);
        let g = problem.matrix(1, 1);
        for i in 0..n {
            for j in 0..p {
                let entry = self.unit(i, j) / self.request.slopes[j];
                let entry = K.at_entry(i, j).scaled(entry);
                problem.positive(g.minus(&entry));
                problem.positive(g.plus(&entry));
            }
        }
        let PKC = K.after(P).times(&self.selector());
        let constant = Affine::constant(P);
        self.constrain(&mut problem, &constant, |A| constant.times(A).minus(&PKC));
        problem.minimise(&g);
        let solution = problem.solve().ok()?;
        Some(self.in_units(&K.at(&solution)))
    }
}

/// Bound of Y in the first phase, where P ≤ I.
const WIDE: f64 = 30.0;
/// The bound that is tried where that one leaves no gain.
const WIDEST: f64 = 3e3;

/// A problem in P and Y = PK.
struct Inequalities {
    pub problem: Problem,
    pub P: Affine,
    pub Y: Affine,
    /// multipliers, per model
    pub T: Vec<Affine>,
}

impl Inequalities {
    /// With P ≤ I and |Y| ≤ `large`.
    pub fn bounded(&self, large: f64) -> Problem {
        let mut bounded = self.problem.clone();
        bounded.positive(Affine::identity(self.P.rows()).minus(&self.P));
        let wide = |n: usize| Affine::identity(n).scaled(large);
        let (rows, columns) = (wide(self.Y.rows()), wide(self.Y.columns()));
        bounded.positive(Affine::symmetric_blocks(&rows, &self.Y, &columns));
        bounded
    }

    /// A point inside, from the same problem with P and Y bounded above, scaled so that
    /// P > I: the inequalities are homogeneous.
    pub fn normalised(&self) -> Result<DVector<f64>, Failure> {
        let inside = |large: f64| self.bounded(large).inside();
        let inside = inside(WIDE).or_else(|_| inside(WIDEST))?;
        let eigen = spectrum::symmetric(symmetric(&self.P.at(&inside)));
        let smallest = eigen.ok_or(Failure::Numerical)?.eigenvalues.min();
        if smallest <= 0.0 {
            return Err(Failure::Numerical);
        }
        Ok(inside * (1.1 / smallest))
    }

    /// The point of the same problem with fewer unknowns.
    pub fn like(&self, other: &Inequalities, point: &DVector<f64>) -> DVector<f64> {
        let mut pairs = vec![(&self.P, &other.P), (&self.Y, &other.Y)];
        pairs.extend(self.T.iter().zip(&other.T));
        let parts = pairs.into_iter().map(|(own, its)| (own, its.at(point)));
        self.problem.point(&parts.collect::<Vec<_>>())
    }
}

/// Values for Z and β with room to spare, and |P|.
fn roomy(first: &DVector<f64>, P: &Affine, Y: &Affine) -> Result<(DVector<f64>, f64), Failure> {
    let (P, Y) = (symmetric(&P.at(first)), Y.at(first));
    let eigen = spectrum::symmetric(P.clone()).ok_or(Failure::Numerical)?;
    let largest = eigen.eigenvalues.max();
    let factor = P.cholesky().ok_or(Failure::Numerical)?;
    let Z = symmetric(&(Y.transpose() * factor.solve(&Y))) * 2.0;
    let room = 1.0 + Z.trace() * 1e-3;
    let mut start = first.clone();
    for j in 0..Z.ncols() {
        for i in 0..=j {
            start.extend([Z[(i, j)] + if i == j { room } else { 0.0 }]);
        }
    }
    start.extend([2.0 * largest]);
    Ok((start, largest))
}

#[cfg(test)]
mod tests;
