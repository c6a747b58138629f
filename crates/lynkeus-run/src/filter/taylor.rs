//! Series of the variational equation.

use super::spanned::{Entry, Spanned};

/// Terms after which a series is given up.
const MOST_TERMS: usize = 60;

/// Terms may exceed the result so many times: what cancels then is lost in rounding.
const MOST_CANCELLED: f64 = 1e4;

/// Φ and W, or a term of their series; no W where nothing disturbs the states.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    pub transition: Spanned,
    pub noise: Option<Spanned>,
}

impl Moments {
    pub fn start(n: usize, noisy: bool) -> Self {
        Self {
            transition: Spanned::identity(n),
            noise: noisy.then(|| Spanned::zero(n)),
        }
    }

    fn like(other: &Self, n: usize) -> Self {
        Self {
            transition: Spanned::zero(n),
            noise: other.noise.as_ref().map(|_| Spanned::zero(n)),
        }
    }

    fn both(&self) -> impl Iterator<Item = &Spanned> {
        std::iter::once(&self.transition).chain(&self.noise)
    }

    fn both_mut(&mut self) -> impl Iterator<Item = &mut Spanned> {
        std::iter::once(&mut self.transition).chain(&mut self.noise)
    }

    /// The larger of both norms; not a number where one is none.
    fn norm(&self) -> f64 {
        let norms = self.both().map(Spanned::norm);
        norms.fold(0.0, |m: f64, s| if s <= m { m } else { s })
    }

    fn copy_from(&mut self, other: &Self) {
        self.both_mut()
            .zip(other.both())
            .for_each(|(a, b)| a.copy_from(b));
    }

    fn add(&mut self, other: &Self) {
        self.both_mut()
            .zip(other.both())
            .for_each(|(a, b)| a.add(b));
    }
}

/// Φ' = G(s)Φ, W' = G(s)W + WG(s)ᵀ + V over s in [0, 1] for G = G₀ + G₁s + … with sparse
/// coefficients and a diagonal V, by the recursion of their Taylor series:
/// (k+1)Φₖ₊₁ = G₀Φₖ + G₁Φₖ₋₁ + …
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    /// the newest terms, the newest first
    recent: Vec<Moments>,
    spare: Vec<Moments>,
}

impl Series {
    /// Takes `moments` from s = 0 to 1; false, and unchanged, where the series is too long or
    /// cancels too much.
    pub fn advance(
        &mut self,
        polynomial: &[Vec<Entry>],
        drive: &[f64],
        moments: &mut Moments,
        n: usize,
        tolerance: f64,
    ) -> bool {
        let size = moments.norm().max(1.0);
        let mut sum = self.empty(moments, n);
        sum.copy_from(moments);
        let mut first = self.empty(moments, n);
        first.copy_from(moments);
        self.recent.push(first);
        let mut small = 0;
        let mut converged = false;
        for k in 0..MOST_TERMS {
            let mut next = self.empty(moments, n);
            self.term(k, polynomial, drive, &mut next);
            let term = next.norm();
            if term.is_nan() || term > MOST_CANCELLED * size {
                self.spare.push(next);
                break;
            }
            sum.add(&next);
            small = if term <= tolerance * size {
                small + 1
            } else {
                0
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
            std::mem::swap(moments, &mut sum);
        }
        self.spare.push(sum);
        converged
    }

    fn empty(&mut self, like: &Moments, n: usize) -> Moments {
        match self.spare.pop() {
            Some(mut moments) => {
                moments.both_mut().for_each(Spanned::clear);
                moments
            }
            None => Moments::like(like, n),
        }
    }

    /// The term after the k-th.
    fn term(&self, k: usize, polynomial: &[Vec<Entry>], drive: &[f64], next: &mut Moments) {
        let share = 1.0 / (k + 1) as f64;
        for (sparse, earlier) in polynomial.iter().zip(&self.recent) {
            for (into, from) in next.both_mut().zip(earlier.both()) {
                into.add_product(share, sparse, from);
            }
        }
        if let Some(noise) = &mut next.noise {
            noise.add_transpose();
            if k == 0 {
                drive
                    .iter()
                    .enumerate()
                    .for_each(|(i, v)| noise.add_at(i, i, *v));
            }
        }
    }
}
