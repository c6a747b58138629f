//! How far samples may be apart: Lyapunov functions of the time since the last one, found by
//! linear matrix inequalities and accepted by [`holds_between_samples`].
//!
//! Between samples the measurements follow the model, so that an innovation changes by nothing
//! but its own correction. In (e, σ), σ the innovations as the observer reads them, a model is
//! the plant's own error system with the gains as columns of σ; a sample sets σ to the errors
//! of the states that are shown.

use lynkeus_expr::{Budget, Interval};
use nalgebra::{DMatrix, DVector};

use super::analysis::inequality;
use super::check::holds_between_samples;
use super::frame::{Frame, Seen};
use super::{ErrorModel, SampledProof, between_errors};
use crate::lmi::{Affine, Problem};
use crate::lyapunov::symmetric;

/// The longest interval is found to this relative accuracy.
const ACCURACY: f64 = 0.05;
/// Intervals are tried from this share of the fastest motion's time on,
const SHORTEST: f64 = 1e-4;
/// up to this many times it.
const LONGEST: f64 = 1e3;

/// Pieces of P(τ): more follow a longer interval, with unknowns that the solver pays for.
fn pieces(size: usize) -> usize {
    match size {
        0..=3 => 16,
        4 => 12,
        5..=8 => 8,
        9..=12 => 6,
        13..=16 => 5,
        17..=24 => 2,
        _ => 1,
    }
}

/// A proof of decay at `rate` for samples up to `interval` apart; none where there is none of this form or it cannot be
/// found. The models are in (e, σ), σ as in [`holds_between_samples`]; `scale` is the size of each entry of e that
/// counts as one.
pub fn prove_between_samples(
    models: &[ErrorModel],
    shown: &[usize],
    scale: &[f64],
    (interval, rate): (f64, f64),
    budget: &Budget,
) -> Option<SampledProof> {
    let search = Search::new(models, shown, scale, budget)?;
    search.proof(interval, rate)
}

/// The proof with the longest interval at which decay at `rate` is proved, and no longer than a thousand times the
/// fastest motion takes. Where the budget ends it is the longest found by then.
pub fn longest(
    models: &[ErrorModel],
    shown: &[usize],
    scale: &[f64],
    rate: f64,
    budget: &Budget,
) -> Option<SampledProof> {
    let search = Search::new(models, shown, scale, budget)?;
    let proved = |interval: f64| search.proof(interval, rate);
    longest_by(search.frame.unit, None, budget, proved)
}

/// The time that the fastest motion of the models takes; none of models that are not in (e, σ).
pub(super) fn unit(models: &[ErrorModel], shown: &[usize], scale: &[f64]) -> Option<f64> {
    let budget = Budget::default();
    let search = Search::new(models, shown, scale, &budget)?;
    Some(search.frame.unit)
}

/// The longest interval that is proved: from one that is, or else about a unit of time.
pub(super) fn longest_by(
    unit: f64,
    first: Option<SampledProof>,
    budget: &Budget,
    mut proved: impl FnMut(f64) -> Option<SampledProof>,
) -> Option<SampledProof> {
    let start = first.as_ref().map_or(unit, |proof| proof.interval);
    let (mut low, mut high) = (start, start);
    let mut best = first.or_else(|| proved(start));
    if best.is_some() {
        while let Some(found) = proved(high * 2.0) {
            (low, high, best) = (high * 2.0, high * 2.0, Some(found));
            if high > LONGEST * unit {
                return best;
            }
        }
        high = low * 2.0;
    }
    while best.is_none() {
        (low, high) = (high / 4.0, high);
        best = proved(low);
        if best.is_none() {
            high = low;
            if high < SHORTEST * unit || budget.spent().is_some() {
                return None;
            }
        }
    }
    while high > low * (1.0 + ACCURACY) && budget.spent().is_none() {
        let middle = (low * high).sqrt();
        match proved(middle) {
            Some(found) => (low, best) = (middle, Some(found)),
            None => high = middle,
        }
    }
    best
}

struct Search<'a> {
    models: &'a [ErrorModel],
    shown: &'a [usize],
    frame: Frame,
    budget: &'a Budget,
}

impl<'a> Search<'a> {
    /// None of models that are not in (e, σ), or have no bounds.
    fn new(
        models: &'a [ErrorModel],
        shown: &'a [usize],
        scale: &[f64],
        budget: &'a Budget,
    ) -> Option<Self> {
        let n = scale.len();
        let size = n + shown.len();
        let fits = |m: &ErrorModel| m.size() == size && m.is_bounded();
        if models.is_empty() || !models.iter().all(fits) || !shown.iter().all(|&s| s < n) {
            return None;
        }
        let read_always: Vec<ErrorModel> = models.iter().map(|m| continuous(m, shown)).collect();
        let natural = Frame::natural(&read_always, scale);
        Some(Self {
            models,
            shown,
            frame: natural.unwrap_or_else(|| Frame::plain(&read_always, scale)),
            budget,
        })
    }

    fn proof(&self, interval: f64, rate: f64) -> Option<SampledProof> {
        let found = self.candidate(interval, rate)?;
        holds_between_samples(self.models, self.shown, &found).then_some(found)
    }

    /// What the solver says, unchecked.
    fn candidate(&self, interval: f64, rate: f64) -> Option<SampledProof> {
        let frame = &self.frame;
        let (W, inverse) = frame.widened(self.shown);
        let size = W.nrows();
        let n = size - self.shown.len();
        let seen: Vec<Seen> = self
            .models
            .iter()
            .map(|model| self.seen(model, frame.unit, &W, &inverse))
            .collect();
        let pieces = pieces(size);
        let mut problem = Problem::new(self.budget);
        let unit = Affine::identity(size);
        let mut of_e = DMatrix::zeros(size, size);
        of_e.fill_diagonal(1.0);
        (n..size).for_each(|j| of_e[(j, j)] = 0.0);
        let length = interval / (frame.unit * pieces as f64);
        // from the last on, so that an unknown comes after those that it is coupled with, but for a few: P(0), which is
        // coupled with all, comes last
        let (mut forms, mut multipliers) = (vec![problem.symmetric(size)], vec![]);
        for piece in (0..pieces).rev() {
            let from = match piece {
                0 => problem.symmetric_where(size, |i, j| (i < n) == (j < n)),
                _ => problem.symmetric(size),
            };
            let to = &forms[forms.len() - 1];
            let change = to.minus(&from).scaled(0.5 / length);
            let mut at = |P: &Affine| {
                let each = seen.iter().map(|model| {
                    let PA = P.times(&model.A).plus(&change);
                    let uncertain = (&model.B, &model.C);
                    inequality(&mut problem, P, &PA, uncertain, rate * frame.unit)
                });
                each.collect::<Vec<Affine>>()
            };
            multipliers.push([at(&from), at(to)]);
            forms.push(from);
        }
        forms.reverse();
        multipliers.reverse();
        let kept = forms[0].after(&of_e).times(&of_e);
        problem.positive(forms[0].clone());
        for (k, P) in forms.iter().enumerate() {
            problem.positive(unit.minus(P));
            if k > 0 {
                problem.positive(P.minus(&kept));
            }
        }
        let point = problem.inside_soon().ok()?;
        let restored = |(T, model): (&Affine, &Seen)| -> DVector<f64> {
            let diagonal = T.at(&point).diagonal();
            diagonal.component_div(&model.weights) / frame.unit
        };
        let of_end = |all: &Vec<Affine>| all.iter().zip(&seen).map(restored).collect();
        let form = |P: &Affine| symmetric(&(inverse.transpose() * P.at(&point) * &inverse));
        Some(SampledProof {
            interval,
            rate,
            P: forms.iter().map(form).collect(),
            multipliers: multipliers
                .iter()
                .map(|[from, to]| [of_end(from), of_end(to)])
                .collect(),
        })
    }

    /// A model over (e, ε) in the axes of a frame, time in units.
    fn seen(
        &self,
        model: &ErrorModel,
        unit: f64,
        W: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
    ) -> Seen {
        let S = between_errors(model.size(), self.shown);
        let (back, forth) = (inverse * &S, &S * W);
        Seen::of(
            &back * model.nominal() * &forth * unit,
            &back * model.spread() * unit,
            model.reads() * &forth,
        )
    }
}

/// The model of e where σ is what it shows at every time: that of sensors read continuously.
fn continuous(model: &ErrorModel, shown: &[usize]) -> ErrorModel {
    let n = model.size() - shown.len();
    let mut of_e = model.clone();
    of_e.constant.truncate(n);
    for row in &mut of_e.constant {
        let read: Vec<Interval> = row.split_off(n);
        for (&state, entry) in shown.iter().zip(read) {
            row[state] = row[state] + entry;
        }
    }
    for sector in &mut of_e.sectors {
        sector.direction.truncate(n);
        if let Some(sensor) = sector.column.checked_sub(n) {
            sector.column = shown[sensor];
        }
    }
    of_e
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decay::Sector;

    /// e' = A e + K σ, σ' = C K σ.
    fn linear(A: &[&[f64]], K: &[f64]) -> ErrorModel {
        let n = K.len();
        let mut constant = vec![vec![Interval::ZERO; n + 1]; n + 1];
        for i in 0..n {
            for j in 0..n {
                constant[i][j] = Interval::point(A[i][j]);
            }
            constant[i][n] = Interval::point(K[i]);
        }
        constant[n][n] = Interval::point(K[0]);
        let sectors = vec![];
        ErrorModel { constant, sectors }
    }

    fn found(model: &ErrorModel, rate: f64) -> f64 {
        let n = model.size() - 1;
        let proof = longest(
            std::slice::from_ref(model),
            &[0],
            &vec![1.0; n],
            rate,
            &Budget::default(),
        );
        let proof = proof.expect("decays with short intervals");
        assert!(holds_between_samples(
            std::slice::from_ref(model),
            &[0],
            &proof
        ));
        proof.interval
    }

    /// x' = x/2 with gain 3: SciPy's limit is 3.896, the same for every sequence of shorter intervals.
    #[test]
    fn one_state_is_proved_to_two_thirds_of_its_limit() {
        let interval = found(&linear(&[&[0.5]], &[-3.0]), 1e-6);
        assert!((2.6..3.896).contains(&interval), "{interval}");
    }

    /// Two integrators with both poles at −θ stand equal intervals of 5.001/θ.
    #[test]
    fn a_chain_stands_intervals_inversely_to_its_gain() {
        for θ in [1.0, 30.0] {
            let chain = linear(&[&[0.0, 1.0], &[0.0, 0.0]], &[-2.0 * θ, -θ * θ]);
            let interval = θ * found(&chain, 1e-6);
            assert!((2.5..5.0).contains(&interval), "{interval}");
        }
    }

    /// Two states, x₂' = θ x₁ + …, with a slope θ in [−1, 1] and both poles at −4: whatever θ does and whenever samples
    /// come, eᵀP(0)e stays below what it was, fading at the rate.
    #[test]
    fn no_sequence_of_slopes_and_samples_raises_a_proved_function() {
        let mut model = linear(&[&[0.0, 1.0], &[0.0, 0.0]], &[-8.0, -16.0]);
        let weights = [0.0, 1.0, 0.0].map(Interval::point);
        let slope = |column, weights: &[Interval]| Sector {
            column,
            direction: weights.to_vec(),
            range: Interval::new(-1.0, 1.0).unwrap(),
        };
        model.sectors = vec![slope(0, &weights), slope(1, &weights)];
        let budget = Budget::default();
        let proof = longest(
            std::slice::from_ref(&model),
            &[0],
            &[1.0, 1.0],
            0.2,
            &budget,
        )
        .unwrap();
        assert!(holds_between_samples(
            std::slice::from_ref(&model),
            &[0],
            &proof
        ));
        assert!(proof.interval > 0.2, "{}", proof.interval);
        let P = proof.P[0].view((0, 0), (2, 2)).into_owned();
        let mut seed = 1_u64;
        let mut unit = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..200 {
            let e = DVector::from_fn(2, |_, _| unit() - 0.5);
            let first = e.dot(&(&P * &e));
            let mut z = DVector::from_column_slice(&[e[0], e[1], e[0]]);
            let mut t = 0.0;
            for _ in 0..30 {
                z[2] = z[0];
                let gap = proof.interval * if unit() < 0.5 { 1.0 } else { unit() };
                for _ in 0..4 {
                    let θ = [(); 2].map(|()| if unit() < 0.5 { -1.0 } else { 1.0 });
                    z = (model.at(&θ) * (gap / 4.0)).exp() * z;
                    t += gap / 4.0;
                    let e = z.rows(0, 2).into_owned();
                    let now = e.dot(&(&P * &e));
                    assert!(now <= first * (-2.0 * proof.rate * t).exp() * (1.0 + 1e-9));
                }
            }
        }
    }

    /// A proof is of its numbers: with any of them changed for a worse one nothing holds.
    #[test]
    fn a_proof_that_is_touched_is_none() {
        let model = linear(&[&[0.5]], &[-3.0]);
        let models = [model];
        let proof = longest(&models, &[0], &[1.0], 0.01, &Budget::default()).unwrap();
        let holds = |change: &dyn Fn(&mut SampledProof)| {
            let mut touched = proof.clone();
            change(&mut touched);
            holds_between_samples(&models, &[0], &touched)
        };
        assert!(holds(&|_| ()));
        assert!(!holds(&|p| p.interval *= 2.0));
        assert!(!holds(&|p| p.interval = f64::NAN));
        assert!(!holds(&|p| p.rate = 1.0));
        assert!(!holds(&|p| p.P[0][(0, 0)] *= 2.0));
        assert!(!holds(&|p| (p.P[0][(0, 1)], p.P[0][(1, 0)]) = (1e-9, 1e-9)));
        assert!(!holds(&|p| p.P.truncate(3)));
        assert!(!holds(&|p| p.P.truncate(1)));
        assert!(!holds(&|p| p.multipliers.clear()));
        assert!(!holds_between_samples(&models, &[1], &proof));
        assert!(!holds_between_samples(&models, &[], &proof));
        // the limit of equal intervals (SciPy) is beyond every proof
        assert!(proof.interval < 3.896);
    }
}
