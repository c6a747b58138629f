//! The variational equation of a stiff flow over an interval on which it hardly changes.

use nalgebra::DMatrix;

use super::spanned::{Entry, Spanned};
use super::taylor::{Moments, Series};

/// Most doublings: rates of 2⁶⁰ per interval are no rates.
const MOST: u32 = 60;

/// Terms of the series from which the doublings start are wrong by less than this.
const TOLERANCE: f64 = 1e-15;

/// Φ and W, dense.
#[derive(Clone, Debug)]
pub(super) struct Dense {
    pub transition: DMatrix<f64>,
    /// empty where nothing disturbs the states
    pub noise: Option<DMatrix<f64>>,
}

impl Dense {
    /// Over one time unit of Φ' = GΦ, W' = GW + WGᵀ + V with constant G: the series over 2⁻ᵏ of
    /// it, then k times Φ ← ΦΦ, W ← W + ΦWΦᵀ. Sums of what is not negative: decay does not
    /// cancel. None where G is too fast to double up from.
    pub fn constant(n: usize, g: &[Entry], drive: &[f64], series: &mut Series) -> Option<Self> {
        let mut sums = vec![0.0; n];
        for entry in g {
            sums[entry.row] += entry.value.abs();
        }
        let norm = sums.into_iter().fold(0.0, f64::max);
        let doublings = norm.max(1.0).log2().ceil() as u32;
        if doublings > MOST {
            return None;
        }
        let share = 0.5_f64.powi(doublings as i32);
        let shared = |e: &Entry| Entry {
            value: share * e.value,
            ..*e
        };
        let small: Vec<Entry> = g.iter().map(shared).collect();
        let drive: Vec<f64> = drive.iter().map(|v| share * v).collect();
        let mut moments = Moments::start(n, !drive.is_empty());
        if !series.advance(&[small], &drive, &mut moments, n, TOLERANCE) {
            return None;
        }
        let dense = |m: &Spanned| DMatrix::from_row_slice(n, n, m.entries());
        let mut result = Self {
            transition: dense(&moments.transition),
            noise: moments.noise.as_ref().map(dense),
        };
        for _ in 0..doublings {
            result = result.then(&result);
        }
        Some(result)
    }

    /// This and then another.
    pub fn then(&self, next: &Self) -> Self {
        let noise = self.noise.as_ref().zip(next.noise.as_ref());
        Self {
            transition: &next.transition * &self.transition,
            noise: noise.map(|(w, v)| v + &next.transition * w * next.transition.transpose()),
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
        apart(&self.transition, &other.transition).max(noise)
    }

    pub fn into_moments(self, n: usize) -> Moments {
        let spanned = |m: DMatrix<f64>| Spanned::dense(n, m.transpose().as_slice().to_vec());
        Moments {
            transition: spanned(self.transition),
            noise: self.noise.map(spanned),
        }
    }

    pub fn of(moments: &Moments, n: usize) -> Self {
        let dense = |m: &Spanned| DMatrix::from_row_slice(n, n, m.entries());
        Self {
            transition: dense(&moments.transition),
            noise: moments.noise.as_ref().map(dense),
        }
    }
}
