//! The variational equation over a piece of an interval: by its Taylor series, and by doubling where the flow
//! is stiff.

use nalgebra::DMatrix;

use crate::filter::profile::{Entry, Profile};
use crate::filter::root::largest;

/// Terms after which a series is given up.
const MOST_TERMS: usize = 60;

/// Terms may exceed the result so many times: what cancels then is lost in rounding.
const MOST_CANCELLED: f64 = 1e4;

/// The state-transition matrix Φ of an interval and the covariance W of what noise comes to over it, or
/// a term of their series.
#[derive(Clone, Debug)]
pub(crate) struct Transition<M> {
    /// Φ
    pub matrix: M,
    /// W; none where nothing disturbs the states
    pub noise: Option<M>,
}

impl Transition<Profile> {
    pub fn start(n: usize, noisy: bool) -> Self {
        Self {
            matrix: Profile::identity(n),
            noise: noisy.then(|| Profile::zero(n)),
        }
    }

    fn like(other: &Self, n: usize) -> Self {
        Self {
            matrix: Profile::zero(n),
            noise: other.noise.as_ref().map(|_| Profile::zero(n)),
        }
    }

    fn both(&self) -> impl Iterator<Item = &Profile> {
        std::iter::once(&self.matrix).chain(&self.noise)
    }

    fn both_mut(&mut self) -> impl Iterator<Item = &mut Profile> {
        std::iter::once(&mut self.matrix).chain(&mut self.noise)
    }

    /// The larger of both norms; not a number where one is none.
    fn norm(&self) -> f64 {
        largest(self.both().map(Profile::norm))
    }

    fn add(&mut self, other: &Self) {
        let pairs = self.both_mut().zip(other.both());
        pairs.for_each(|(a, b)| a.add(b));
    }
}

/// Φ' = G(s)Φ, W' = G(s)W + WG(s)ᵀ + V over s in [0, 1] for G = G₀ + G₁s + … with sparse
/// coefficients and a diagonal V, by the recursion of their Taylor series:
/// (k+1)Φₖ₊₁ = G₀Φₖ + G₁Φₖ₋₁ + …
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    /// the newest terms, the newest first
    recent: Vec<Transition<Profile>>,
    spare: Vec<Transition<Profile>>,
}

impl Series {
    /// Takes `transition` from s = 0 to 1; false, and unchanged, where the series is too long or
    /// cancels too much.
    pub fn advance(
        &mut self,
        polynomial: &[Vec<Entry>],
        drive: &[f64],
        transition: &mut Transition<Profile>,
        n: usize,
        tolerance: f64,
    ) -> bool {
        let size = transition.norm().max(1.0);
        let [mut sum, mut first] = [0, 1].map(|_| self.empty(transition, n));
        sum.add(transition);
        first.add(transition);
        self.recent.push(first);
        let mut small = 0;
        let mut converged = false;
        for k in 0..MOST_TERMS {
            let mut next = self.empty(transition, n);
            self.term(k, polynomial, drive, &mut next);
            let term = next.norm();
            if term.is_nan() || term > MOST_CANCELLED * size {
                self.spare.push(next);
                break;
            }
            sum.add(&next);
            small = match term <= tolerance * size {
                true => small + 1,
                false => 0,
            };
            converged = small >= polynomial.len();
            self.recent.insert(0, next);
            let kept = polynomial.len().min(self.recent.len());
            self.spare.extend(self.recent.drain(kept..));
            if converged {
                break;
            }
        }
        self.spare.append(&mut self.recent);
        if converged {
            std::mem::swap(transition, &mut sum);
        }
        self.spare.push(sum);
        converged
    }

    fn empty(&mut self, like: &Transition<Profile>, n: usize) -> Transition<Profile> {
        match self.spare.pop() {
            Some(mut transition) => {
                transition.both_mut().for_each(Profile::clear);
                transition
            }
            None => Transition::like(like, n),
        }
    }

    /// The term after the k-th.
    fn term(
        &self,
        k: usize,
        polynomial: &[Vec<Entry>],
        drive: &[f64],
        next: &mut Transition<Profile>,
    ) {
        let share = 1.0 / (k + 1) as f64;
        for (sparse, earlier) in polynomial.iter().zip(&self.recent) {
            for (into, from) in next.both_mut().zip(earlier.both()) {
                into.add_product(share, sparse, from);
            }
        }
        if let Some(noise) = &mut next.noise {
            noise.add_transpose();
            if k == 0 {
                let diagonal = drive.iter().enumerate();
                diagonal.for_each(|(i, v)| noise.add_at(i, i, *v));
            }
        }
    }
}

/// The largest sum of absolute values of a row.
pub(crate) fn largest_row(n: usize, g: &[Entry]) -> f64 {
    let mut sums = vec![0.0; n];
    for (at, value) in g {
        sums[at.row] += value.abs();
    }
    sums.into_iter().fold(0.0, f64::max)
}

/// Most doublings: rates of 2⁶⁰ per interval are no rates.
const MOST_DOUBLINGS: u32 = 60;

/// Terms of the series from which the doublings start are wrong by less than this.
const START_TOLERANCE: f64 = 1e-15;

impl Transition<DMatrix<f64>> {
    /// Over one time unit of Φ' = GΦ, W' = GW + WGᵀ + V with constant G: the series over 2⁻ᵏ of
    /// it, then k times Φ ← ΦΦ, W ← W + ΦWΦᵀ. Sums of what is not negative: decay does not
    /// cancel. None where G is too fast to double up from.
    pub fn constant(n: usize, g: &[Entry], drive: &[f64], series: &mut Series) -> Option<Self> {
        let doublings = largest_row(n, g).max(1.0).log2().ceil() as u32;
        if doublings > MOST_DOUBLINGS {
            return None;
        }
        let share = 0.5_f64.powi(doublings as i32);
        let small = g.iter().map(|(at, value)| (*at, share * value)).collect();
        let drive: Vec<f64> = drive.iter().map(|v| share * v).collect();
        let mut transition = Transition::start(n, !drive.is_empty());
        if !series.advance(&[small], &drive, &mut transition, n, START_TOLERANCE) {
            return None;
        }
        let mut result = Self::dense(&transition, n);
        for _ in 0..doublings {
            result = result.then(&result);
        }
        Some(result)
    }

    /// This and then another.
    pub fn then(&self, next: &Self) -> Self {
        let noise = self.noise.as_ref().zip(next.noise.as_ref());
        Self {
            matrix: &next.matrix * &self.matrix,
            noise: noise.map(|(w, v)| v + &next.matrix * w * next.matrix.transpose()),
        }
    }

    /// How far two results are apart, as a share of their largest entry.
    pub fn distance(&self, other: &Self) -> f64 {
        let apart = |a: &DMatrix<f64>, b: &DMatrix<f64>| match a.amax() {
            0.0 => 0.0,
            size => (a - b).amax() / size,
        };
        let noises = self.noise.as_ref().zip(other.noise.as_ref());
        let noise = noises.map_or(0.0, |(a, b)| apart(a, b));
        apart(&self.matrix, &other.matrix).max(noise)
    }

    /// The same as profile matrices.
    pub fn into_profiles(self, n: usize) -> Transition<Profile> {
        let spanned = |m: DMatrix<f64>| Profile::dense(n, m.transpose().as_slice().to_vec());
        Transition {
            matrix: spanned(self.matrix),
            noise: self.noise.map(spanned),
        }
    }

    /// Of profile matrices.
    pub fn dense(transition: &Transition<Profile>, n: usize) -> Self {
        let dense = |m: &Profile| DMatrix::from_row_slice(n, n, m.entries());
        Self {
            matrix: dense(&transition.matrix),
            noise: transition.noise.as_ref().map(dense),
        }
    }
}
