//! How far samples may be apart where slopes count as they come together: the same Lyapunov functions of the time since
//! the last sample ([`SampledProof`]), for an error system over (e, ε) that is known at every ξ of a box ([`Field`]).
//!
//! A mean of 𝒜(ξ) over the box is all that an error system by the mean value theorem has, and the inequality
//! P' + He(P 𝒜) + 2·rate·P < 0 holds of a mean if it holds of everything that the mean is of. P goes along a line on each
//! piece, so that its ends decide.

use lynkeus_expr::{Budget, Interval};

use super::check::falls_at_samples;
use super::sampled::{longest_by, unit};
use super::together::{Cover, Covered, FIRST_PARTS, Field, Form, PARTS, first_points};
use super::{ErrorModel, SampledProof, between_errors, prove_between_samples};
use crate::matrix::{points, product, square};

/// Parts that may be examined in all of a search.
const ALL_PARTS: usize = 40_000;
/// Points of the box that a proposal is for at first.
const POINTS: usize = 17;
/// Points that are added for one interval, at most.
const ADDED: usize = 12;
/// Proposals are for rates faster by these shares of the continuous one, so that they have a margin.
const MARGINS: [f64; 3] = [0.3, 0.1, 0.03];

/// Proofs that may be proposed in a search: the solver takes longer for more of (e, ε).
fn proposals(size: usize) -> usize {
    match size {
        0..=5 => 100,
        _ => 50,
    }
}

/// Parts and proposals after which it is given up that an interval can be longer than one that is known.
fn first(size: usize) -> (usize, usize) {
    match size {
        0..=6 => (ALL_PARTS, 15),
        _ => (FIRST_PARTS, 8),
    }
}

/// Whether a proof holds at samples and between them, at every ξ of the box, for errors (e, ε) of which the last entries
/// are those of so many predictions. Nothing but P, the interval, the rate and interval arithmetic decides.
pub fn holds_between_samples_together(
    field: &Field<'_>,
    sensors: usize,
    proof: &SampledProof,
    budget: &Budget,
) -> Covered {
    let mut left = PARTS;
    all_covered(field, sensors, proof, &mut left, budget)
}

fn all_covered(
    field: &Field<'_>,
    sensors: usize,
    proof: &SampledProof,
    left: &mut usize,
    budget: &Budget,
) -> Covered {
    if !falls_at_samples(proof, sensors) {
        return Covered::Unknown;
    }
    let count = proof.P.len() - 1;
    let length = Interval::point(proof.interval) / Interval::point(count as f64);
    let mut parts = 0;
    // the forms are alike, and so are the parts that they need
    let mut cover = Cover::new(field);
    for ends in proof.P.windows(2) {
        let [from, to] = [&ends[0], &ends[1]].map(points);
        let change = square(from.len(), |i, j| (to[i][j] - from[i][j]) / length);
        for P in ends {
            let form = Form::changing(P, &change, proof.rate);
            match cover.by(form, left, budget) {
                Covered::By(more) => parts += more,
                other => return other,
            }
        }
    }
    Covered::By(parts)
}

/// A search for proofs for a field over (e, ε) from the points that earlier ones failed at.
pub struct Samples<'a> {
    field: &'a Field<'a>,
    /// per sensor the state that it shows
    shown: &'a [usize],
    scale: &'a [f64],
    /// the fastest rate that is proved of sensors read continuously
    continuous: f64,
    budget: &'a Budget,
    /// 𝒜 over (e, σ) at points of the box
    models: Vec<ErrorModel>,
    /// parts that may still be examined, and proofs proposed
    left: usize,
    proposals: usize,
}

impl<'a> Samples<'a> {
    /// A search for a field that is over (e, ε), `scale` the size of each entry of e that counts as one.
    pub fn new(
        field: &'a Field<'a>,
        (shown, scale): (&'a [usize], &'a [f64]),
        continuous: f64,
        budget: &'a Budget,
    ) -> Self {
        let mut samples = Self {
            field,
            shown,
            scale,
            continuous,
            budget,
            models: vec![],
            left: ALL_PARTS,
            proposals: proposals(scale.len() + shown.len()),
        };
        for point in first_points(&field.sides, POINTS) {
            samples.add(&point);
        }
        samples
    }

    /// 𝒜 over (e, σ) at the points that counted.
    pub fn models(&self) -> &[ErrorModel] {
        &self.models
    }

    /// Lets a further search take as long as the first.
    pub fn replenish(&mut self) {
        self.left = ALL_PARTS;
        self.proposals = proposals(self.scale.len() + self.shown.len());
    }

    /// Whether the point is new and 𝒜 has a value there.
    fn add(&mut self, point: &[f64]) -> bool {
        let part: Vec<Interval> = point.iter().map(|&x| Interval::point(x)).collect();
        let A = (self.field.on)(&part);
        let S = points(&between_errors(A.len(), self.shown));
        let model = ErrorModel {
            constant: product(&product(&S, &A), &S),
            sectors: vec![],
        };
        let is_new = model.is_bounded() && !self.models.contains(&model);
        if is_new {
            self.models.push(model);
        }
        is_new
    }

    /// The longest interval with decay at a rate, if it is longer than the least one.
    pub fn longest(&mut self, rate: f64, least: Option<f64>) -> Option<SampledProof> {
        let unit = unit(&self.models, self.shown, self.scale)?;
        let budget = self.budget;
        match least {
            None => longest_by(unit, None, budget, |interval| self.prove(interval, rate)),
            Some(least) => {
                (self.left, self.proposals) = first(self.scale.len() + self.shown.len());
                let first = self.prove(least, rate)?;
                self.replenish();
                longest_by(unit, Some(first), budget, |interval| {
                    self.prove(interval, rate)
                })
            }
        }
    }

    /// A proof for samples up to an interval apart; none where none is found.
    pub fn prove(&mut self, interval: f64, rate: f64) -> Option<SampledProof> {
        let faster = MARGINS.map(|share| rate + share * self.continuous);
        faster
            .into_iter()
            .find_map(|faster| self.prove_by(interval, rate, faster))
    }

    fn prove_by(&mut self, interval: f64, rate: f64, faster: f64) -> Option<SampledProof> {
        for _ in 0..ADDED {
            if self.left == 0 {
                return None;
            }
            self.proposals = self.proposals.checked_sub(1)?;
            let claim = (interval, faster);
            let found =
                prove_between_samples(&self.models, self.shown, self.scale, claim, self.budget)?;
            let proof = SampledProof {
                rate,
                multipliers: vec![],
                ..found
            };
            let sensors = self.shown.len();
            match all_covered(self.field, sensors, &proof, &mut self.left, self.budget) {
                Covered::By(_) => return Some(proof),
                Covered::Not(point) if self.add(&point) => {}
                _ => return None,
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::matrix::IntervalMatrix;

    /// e₁' = x e₂ − 4 σ, e₂' = −x e₁ + 0.3 e₂ − 2 σ with σ = e₁ − ε read between samples, over (e, ε).
    fn turning(part: &[Interval]) -> IntervalMatrix {
        let (x, zero) = (part[0], Interval::ZERO);
        let [two, four, growth] = [2.0, 4.0, 0.3].map(Interval::point);
        vec![
            vec![-four, x, four],
            vec![-x - two, growth, two],
            vec![zero, x, zero],
        ]
    }

    fn sides() -> Vec<Interval> {
        vec![Interval::new(1.0, 6.0).unwrap()]
    }

    fn found(field: &Field<'_>) -> SampledProof {
        let budget = Budget::default();
        let mut samples = Samples::new(field, (&[0], &[1.0, 1.0]), 1.0, &budget);
        samples.longest(0.01, None).unwrap()
    }

    /// Whatever x does and whenever samples come, eᵀP(0)e stays below what it was, fading at the rate.
    #[test]
    fn no_sequence_of_points_and_samples_raises_a_proved_function() {
        let field = Field {
            on: &turning,
            slopes: None,
            sides: sides(),
        };
        let proof = found(&field);
        let P = proof.P[0].view((0, 0), (2, 2)).into_owned();
        let number = |x: f64| {
            let A = turning(&[Interval::point(x)]);
            DMatrix::from_fn(3, 3, |i, j| A[i][j].midpoint())
        };
        let mut seed = 1_u64;
        let mut unit = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        for _ in 0..300 {
            let e = DVector::from_fn(2, |_, _| unit() - 0.5);
            let first = e.dot(&(&P * &e));
            let mut z = DVector::from_column_slice(&[e[0], e[1], 0.0]);
            let mut t = 0.0;
            for _ in 0..30 {
                z[2] = 0.0;
                let gap = proof.interval * if unit() < 0.5 { 1.0 } else { unit() };
                for _ in 0..4 {
                    let x = if unit() < 0.6 {
                        6.0
                    } else {
                        1.0 + 5.0 * unit()
                    };
                    z = (number(x) * (gap / 4.0)).exp() * z;
                    t += gap / 4.0;
                    let e = z.rows(0, 2).into_owned();
                    let now = e.dot(&(&P * &e));
                    assert!(now <= first * (-2.0 * proof.rate * t).exp() * (1.0 + 1e-9));
                }
            }
        }
        // where a half turn of x = 6 is between samples, e₂ is never seen, and grows
        assert!(proof.interval > 0.05 && proof.interval < std::f64::consts::PI / 6.0);
    }

    /// A proof is of its numbers, and of the field.
    #[test]
    fn a_proof_that_is_touched_is_none() {
        let wide = |half: f64| vec![Interval::new(-half, half).unwrap()];
        let field = |sides: Vec<Interval>| Field {
            on: &turning,
            slopes: None,
            sides,
        };
        let proof = found(&field(sides()));
        let budget = Budget::default();
        let holds = |change: &dyn Fn(&mut SampledProof)| {
            let mut touched = proof.clone();
            change(&mut touched);
            let found = holds_between_samples_together(&field(sides()), 1, &touched, &budget);
            matches!(found, Covered::By(_))
        };
        assert!(holds(&|_| ()));
        assert!(!holds(&|p| p.interval *= 2.0));
        assert!(!holds(&|p| p.interval = f64::NAN));
        assert!(!holds(&|p| p.rate = 1.0));
        assert!(!holds(&|p| p.rate = f64::NAN));
        assert!(!holds(&|p| p.P[0][(0, 0)] *= 2.0));
        assert!(!holds(&|p| (p.P[0][(0, 2)], p.P[0][(2, 0)]) = (1e-9, 1e-9)));
        assert!(!holds(&|p| p.P[2] *= 3.0));
        assert!(!holds(&|p| p.P[1] *= 0.5));
        assert!(!holds(&|p| p.P.truncate(1)));
        for (sides, sensors) in [(wide(8.0), 1), (sides(), 0), (sides(), 2)] {
            let found = holds_between_samples_together(&field(sides), sensors, &proof, &budget);
            assert!(!matches!(found, Covered::By(_)));
        }
    }
}
