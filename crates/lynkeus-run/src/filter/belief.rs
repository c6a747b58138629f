//! What is believed of the state, and the ranges in which it is kept.

use super::root::{Factor, Root, dot, substitute};
use crate::manifold::Manifold;
use crate::noise::Limits;
use crate::snapshot::{Damaged, Persist, Walk};

/// What is believed of the state: its mean and a root of its covariance.
#[derive(Clone, Debug)]
pub(crate) struct Belief {
    pub x: Vec<f64>,
    pub root: Root,
}

impl Belief {
    /// Of independent states.
    pub fn new(x: &[f64], variances: &[f64]) -> Self {
        Self {
            x: x.to_vec(),
            root: Root::diagonal(variances),
        }
    }

    /// The same of states that live elsewhere: quaternions of length 1, of whose numbers those variances count that
    /// are along the sphere.
    pub fn on(manifold: &Manifold, x: &[f64], variances: &[f64]) -> Self {
        let mut own = Self::new(x, variances);
        if !manifold.rotations.is_empty() {
            manifold.normalise(&mut own.x);
            manifold.project(&own.x, &mut own.root.entries, x.len());
            own.root.restore();
        }
        own
    }

    /// Its last states are drawn anew: nothing is known of them but that they are standard normal.
    pub fn renew(&mut self, count: usize) {
        let first = self.x.len() - count;
        self.x[first..].fill(0.0);
        self.root.renew(count);
    }

    /// x̂, then the lower triangle of S, row by row.
    pub fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let n = self.root.n;
        let rows = self.root.entries.chunks_exact_mut(n.max(1)).enumerate();
        let entries = rows.flat_map(|(i, row)| &mut row[..=i]);
        self.x.iter_mut().chain(entries)
    }

    /// Corrects by a reading, as [`Root::update`], that is `innovation` off.
    pub fn take(
        &mut self,
        projected: &[f64],
        innovation: f64,
        noise: f64,
        gain: &mut Vec<f64>,
    ) -> bool {
        let has_gain = self.root.update(projected, noise, gain);
        if has_gain {
            let places = self.x.iter_mut().zip(gain);
            places.for_each(|(x, k)| *x += *k * innovation);
        }
        has_gain
    }
}

impl Persist for Belief {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(&mut self.x)?;
        walk.numbers(&mut self.root.entries)
    }
}

/// The nearest place inside, state by state.
pub(crate) fn confine(x: &mut [f64], bounds: &[Limits]) {
    for (x, bounds) in x.iter_mut().zip(bounds) {
        *x = x.max(bounds.low).min(bounds.high);
    }
}

/// A bound that is exceeded by less than this share of a deviation is met.
const SLACK: f64 = 1e-12;

/// Keeps an estimate in its declared ranges, by the covariance's metric.
///
/// min (x − x̂)ᵀP⁻¹(x − x̂) with low ≤ x ≤ high: what is correlated with a state at its bound moves
/// along. With multipliers μ that vanish but at bounds the solution is x = x̂ + Pμ, so that P, which may be
/// singular, is never inverted (D. Simon, *IET Control Theory & Applications* 4 (2010) 1303–1318, section 2.4). The
/// bounds that are met are found as C. L. Lawson and R. J. Hanson do (*Solving Least Squares Problems*,
/// 1974, chapter 23), on the multipliers: one at a time, those that would pull inward let go.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projection {
    bounds: Vec<Limits>,
    /// P, row by row
    covariance: Vec<f64>,
    before: Vec<f64>,
    /// 1 at an upper bound, −1 at a lower one, else 0
    sides: Vec<i8>,
    multipliers: Vec<f64>,
    /// states at bounds
    met: Vec<usize>,
    matrix: Vec<f64>,
    wanted: Vec<f64>,
    factor: Factor,
}

impl Projection {
    pub fn new(bounds: Vec<Limits>) -> Self {
        Self {
            bounds,
            ..Self::default()
        }
    }

    /// The estimate in its ranges, where it is not; whether it was moved. A state without variance that
    /// is outside is put to its bound alone.
    pub fn project(&mut self, x: &mut [f64], root: &Root) -> bool {
        let outside = |(x, b): (&f64, &Limits)| *x < b.low || *x > b.high;
        if !x.iter().zip(&self.bounds).any(outside) {
            return false;
        }
        self.prepare(x, root);
        // each round meets one bound more, or ends; some bounds are let go again
        for _ in 0..3 * x.len() {
            let Some((state, side)) = self.worst(x) else {
                break;
            };
            self.sides[state] = side;
            self.meet();
            self.place(x);
        }
        confine(x, &self.bounds);
        true
    }

    fn prepare(&mut self, x: &[f64], root: &Root) {
        let n = x.len();
        x.clone_into(&mut self.before);
        self.sides.clear();
        self.sides.resize(n, 0);
        self.multipliers.clear();
        self.multipliers.resize(n, 0.0);
        self.covariance.clear();
        for i in 0..n {
            let row = (0..n).map(|j| dot(root.row(i), root.row(j)));
            self.covariance.extend(row);
        }
    }

    /// The state that is furthest beyond a bound, in its deviations; none where all are inside.
    fn worst(&self, x: &[f64]) -> Option<(usize, i8)> {
        let n = x.len();
        let mut worst = None;
        let mut most = SLACK;
        for (i, (x, bounds)) in x.iter().zip(&self.bounds).enumerate() {
            let variance = self.covariance[i * n + i];
            let (away, side) = match *x > bounds.high {
                true => (x - bounds.high, 1),
                false => (bounds.low - x, -1),
            };
            let away = away / variance.sqrt();
            if variance > 0.0 && self.sides[i] == 0 && away > most {
                most = away;
                worst = Some((i, side));
            }
        }
        worst
    }

    /// Multipliers with which every bound of the set is met, those that pull inward taken out of it.
    fn meet(&mut self) {
        let n = self.before.len();
        loop {
            let sides = self.sides.iter().enumerate();
            let met = sides.filter(|(_, side)| **side != 0).map(|(i, _)| i);
            self.met.clear();
            self.met.extend(met);
            let m = self.met.len();
            if m == 0 {
                return;
            }
            self.matrix.clear();
            self.wanted.clear();
            for &i in &self.met {
                let row = self.met.iter().map(|j| self.covariance[i * n + j]);
                self.matrix.extend(row);
                let Limits { low, high } = self.bounds[i];
                let bound = if self.sides[i] > 0 { high } else { low };
                self.wanted.push(bound - self.before[i]);
            }
            substitute(self.factor.of(&self.matrix, m), m, &mut self.wanted);
            let all = || self.met.iter().copied().zip(self.wanted.iter().copied());
            // a multiplier at an upper bound pushes down
            let is_inward = |side: i8, wanted: f64| f64::from(side) * wanted >= 0.0;
            // the share of the way to what is wanted at which a multiplier vanishes
            let end = |own: f64, wanted: f64| match own - wanted {
                0.0 => 0.0,
                step => own / step,
            };
            let inward = all().filter(|&(i, wanted)| is_inward(self.sides[i], wanted));
            let ends = inward.map(|(i, wanted)| end(self.multipliers[i], wanted));
            let share = ends.fold(1.0, f64::min);
            let mut let_go = 0;
            for (i, wanted) in all() {
                let own = self.multipliers[i];
                self.multipliers[i] -= share * (own - wanted);
                if is_inward(self.sides[i], wanted) && end(own, wanted) <= share {
                    (self.multipliers[i], self.sides[i]) = (0.0, 0);
                    let_go += 1;
                }
            }
            if let_go == 0 {
                return;
            }
        }
    }

    /// x̂ + Pμ, at the bounds exactly.
    fn place(&self, x: &mut [f64]) {
        let n = x.len();
        for (i, x) in x.iter_mut().enumerate() {
            let row = &self.covariance[i * n..(i + 1) * n];
            let Limits { low, high } = self.bounds[i];
            *x = match self.sides[i] {
                0 => self.before[i] + dot(row, &self.multipliers),
                1 => high,
                _ => low,
            };
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Numbers in [−1, 1).
    pub(crate) struct Random(pub u64);

    impl Random {
        pub fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// What the problem asks of its solution: inside, and P⁻¹(x − x̂) = μ of the right sign at bounds
    /// and zero elsewhere; for that P is Σ over random rows, and a multiplier is known as the
    /// least change of all states together. Checked by x − x̂ = Pμ.
    #[test]
    fn projections_meet_the_conditions_of_the_minimum() {
        let mut random = Random(3);
        let mut several = 0;
        for trial in 0..2000 {
            let n = 1 + trial % 6;
            let mut root = Root::diagonal(&vec![0.0; n]);
            // every third covariance is singular
            let count = if trial % 3 == 0 { n.div_ceil(2) } else { n + 2 };
            let mut rows: Vec<f64> = (0..count * n).map(|_| random.next()).collect();
            root.of_rows(&mut rows, &mut vec![]);
            let before: Vec<f64> = (0..n).map(|_| 2.0 * random.next()).collect();
            let bounds: Vec<Limits> = (0..n)
                .map(|_| Limits {
                    low: -1.0 - random.next().abs(),
                    high: 0.5 * random.next().abs(),
                })
                .collect();
            let mut x = before.clone();
            let mut projection = Projection::new(bounds.clone());
            let moved = projection.project(&mut x, &root);
            let inside = |(x, b): (&f64, &Limits)| b.low <= *x && *x <= b.high;
            assert!(x.iter().zip(&bounds).all(inside), "{x:?}");
            assert_eq!(moved, x != before);
            if trial % 3 == 0 || !moved {
                continue;
            }
            several += usize::from(projection.met.len() > 1);
            for i in 0..n {
                let push: f64 = (0..n)
                    .map(|j| dot(root.row(i), root.row(j)) * projection.multipliers[j])
                    .sum();
                let μ = projection.multipliers[i];
                assert!((x[i] - before[i] - push).abs() < 1e-9, "{trial}: {x:?}");
                let Limits { low, high } = bounds[i];
                let allowed = (μ <= 0.0 || x[i] == low) && (μ >= 0.0 || x[i] == high);
                assert!(allowed, "{trial}: {μ} at {}", x[i]);
            }
        }
        assert!(several > 100, "{several}");
    }

    /// P = [[1, 0.8], [0.8, 1]], x̂ = (2, 0), x₁ ≤ 1: x₂ moves along, by −0.8.
    #[test]
    fn what_is_correlated_moves_along() {
        let mut root = Root::diagonal(&[0.0; 2]);
        root.of_rows(&mut [1.0, 0.8, 0.0, 0.6], &mut vec![]);
        let wide = Limits {
            low: -9.0,
            high: 9.0,
        };
        let mut projection = Projection::new(vec![Limits { high: 1.0, ..wide }, wide]);
        let mut x = [2.0, 0.0];
        assert!(projection.project(&mut x, &root));
        assert!(
            (x[0] - 1.0).abs() < 1e-15 && (x[1] + 0.8).abs() < 1e-15,
            "{x:?}"
        );
        assert!(!projection.project(&mut x, &root));
        // nothing is known to move along with a state that has no variance
        let mut certain = [2.0, 0.5];
        assert!(projection.project(&mut certain, &Root::diagonal(&[0.0, 1.0])));
        assert_eq!(certain, [1.0, 0.5]);
    }
}
