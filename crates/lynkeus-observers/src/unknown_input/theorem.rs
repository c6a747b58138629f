//! What Theorem 1 guarantees, with the constants of its proof.
//!
//! V = V₁ + V₂ obeys, for θ₂ ≥ 1,
//!
//! V̇ ≤ −(θ₁ − c₁) V₁ − (θ₂ − c₄) V₂ + (c₂ + c₅) θ₂ √V₁ √V₂ + 2 (δ₁ √V₁ + δ₂ √V₂)
//!
//! where δ₁ and δ₂ hold what the observer does not know: v', disturbances, noise. The
//! quadratic form is at most −λ V, λ > 0 where θ₂ > c₄ and
//! θ₁ > c₁ + (c₂ + c₅)²θ₂²/(4(θ₂ − c₄)), so √V falls at the rate λ/2 down to 2|δ|/λ.

use lynkeus_expr::Interval;
use lynkeus_gain::integrators::Chain;
use lynkeus_proof::magnitude::{length, plus, size, times, total};
use lynkeus_proof::matrix::sum;
use lynkeus_structure::AugmentedPlant;

use super::constants::{Norms, in_S};
use super::form::Form;
use super::said::Said;
use super::settings::Settings;
use super::{constants, observer};
use crate::design::Found;
use crate::statement::{sufficient, undecided};
use crate::theorem::Enclosure;
use crate::{Assumptions, Certificate, Check, Constant, DesignError, Farza, Reason, UltimateBound};

pub(super) const BASIS: &str = "Theorem 1 of Farza, M'Saad, Liu and Targui";

/// Numbers that have to be exceeded are by this factor at least.
const CLEAR: f64 = 1.0 + 1e-9;

pub(super) fn certificate(
    _: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form<'_, '_>>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let (form, given) = (&form, settings.thetas()?);
    let norms = constants::norms(form, assumptions)?;
    let c = norms.constants();
    let chosen = || observer::thetas(form).ok().map(|(thetas, _)| thetas);
    let thetas = given.or_else(chosen);
    let proof = Proof { form, norms, c };
    let mut hypotheses = examination.checks;
    hypotheses.extend(proof.norms.checks.clone());
    hypotheses.extend([proof.finite(), proof.slow(assumptions)]);
    hypotheses.extend(proof.gains(thetas));
    let mut found = Certificate::new(BASIS, assumptions, hypotheses);
    proof.print_constants(thetas, &mut found.constants);
    if proof.norms.γ.iter().any(|&γ| γ > 0.0) {
        found.notes.push(Said::Tilde.into());
    }
    let proved = found.weakest().is_none();
    if let Some(θ) = thetas.filter(|_| proved) {
        proof.conclude(θ, assumptions, &mut found)?;
    }
    Ok(found)
}

/// A form with the constants of its proof.
struct Proof<'f, 'e, 'p> {
    form: &'f Form<'e, 'p>,
    norms: Norms,
    /// c₁, c₂, c₄ and c₅ of (24)
    c: [f64; 4],
}

impl Proof<'_, '_, '_> {
    fn finite(&self) -> Check {
        let finite = self.c.iter().all(|c| c.is_finite());
        let said = match finite {
            true => Said::Constants,
            false => Said::NoConstants {
                open: self.norms.open.clone(),
                left: !self.norms.checks[0].is_proved(),
            },
        };
        sufficient(Farza::Constants, finite, said)
    }

    /// (H5)
    fn slow(&self, assumptions: &Assumptions) -> Check {
        let ε = self.unknown_drift(assumptions);
        let constant = assumptions.constant(self.form.augmented.plant_states());
        let are_constant = !constant.is_empty();
        sufficient(Farza::H5, ε.is_finite(), Said::Slow { ε, are_constant })
    }

    /// θ₂ and θ₁ against what they have to exceed.
    fn gains(&self, thetas: Option<[f64; 2]>) -> Vec<Check> {
        let Some([θ1, θ2]) = thetas else {
            let (first, second) = self.smallest();
            let like = first.is_finite().then_some([first * 1.1, second]);
            return vec![sufficient(Farza::ThetaGiven, false, Said::NoTheta(like))];
        };
        let [_, _, c4, _] = self.c;
        if !c4.is_finite() {
            return vec![undecided(Farza::Theta2, Said::NoC4)];
        }
        let second = c4.max(1.0) * CLEAR;
        let first = self.first(θ2) * CLEAR;
        let at_least = |found: f64, least: f64| Reason::AtLeast { found, least };
        let holds = θ2 >= second;
        let mut checks = vec![sufficient(Farza::Theta2, holds, at_least(θ2, second))];
        if holds {
            let reason = at_least(θ1, first);
            checks.push(sufficient(Farza::Theta1, θ1 >= first, reason));
        }
        checks
    }

    /// What θ₁ has to exceed for this θ₂ > c₄.
    fn first(&self, θ2: f64) -> f64 {
        let [c1, c2, c4, c5] = self.c;
        if !c4.is_finite() {
            return f64::INFINITY;
        }
        let θ2 = Interval::point(θ2);
        let c = (size(c2) + size(c5)) * θ2;
        let room = Interval::point(4.0) * (θ2 - size(c4));
        (size(c1) + c.powi(2) / room).hi()
    }

    /// (θ₁*, θ₂) with the smallest θ₁* of all θ₂.
    fn smallest(&self) -> (f64, f64) {
        let [_, _, c4, _] = self.c;
        let θ2 = (2.0 * c4).max(1.0) * CLEAR;
        (self.first(θ2), θ2)
    }

    fn print_constants(&self, thetas: Option<[f64; 2]>, constants: &mut Vec<Constant>) {
        let [c1, c2, c4, c5] = self.c;
        let c3 = (Interval::point(8.0).sqrt() * size(self.norms.G11)).hi();
        let (first, second) = self.smallest();
        let mut list = vec![
            ("c1", c1, "what f̃₁¹ and the turning of G₁¹ take from θ₁"),
            ("c2", c2, "from V₂ to V₁ in (24), times θ₂"),
            ("c3", c3, "of |v'|, divided by θ₁, in (24)"),
            ("c4", c4, "what the nonlinearities of X² take from θ₂"),
            ("c5", c5, "from V₁ to V₂ in (24), times θ₂"),
            ("θ2*", c4.max(1.0), "θ₂ has to exceed it"),
        ];
        if let Some([_, θ2]) = thetas.filter(|[_, θ2]| *θ2 > c4) {
            list.push(("θ1*", self.first(θ2), "θ₁ has to exceed it, with this θ₂"));
        }
        list.push(("θ1,0", first, "the smallest θ₁* of all θ₂"));
        list.push(("θ2,0", second, "the θ₂ that allows it"));
        let finite = list.into_iter().filter(|c| c.1.is_finite());
        constants.extend(finite.map(|(name, value, meaning)| Constant::new(name, value, meaning)));
    }

    fn unknown_drift(&self, assumptions: &Assumptions) -> f64 {
        let n = self.form.augmented.plant_states();
        length(assumptions.drift.get(n..).unwrap_or_default())
    }

    /// Rate, peak and ultimate bounds for gains that meet the hypotheses.
    fn conclude(
        &self,
        θ: [f64; 2],
        assumptions: &Assumptions,
        found: &mut Certificate,
    ) -> Result<(), DesignError> {
        let λ = self.λ(θ);
        if λ.is_nan() || λ <= 0.0 {
            // θ₁ exceeds θ₁* by less than rounding
            found.hypotheses.push(undecided(Farza::Rate, Said::Rate(λ)));
            return Ok(());
        }
        found.rate = Some(λ / 2.0);
        let peak = times(self.root_V_of(θ), length(&self.out_of_V(θ)));
        let rate = "guaranteed decay rate of the error";
        let factor = "the factor by which the error may peak";
        found.constants.push(Constant::new("μ", λ / 2.0, rate));
        found.constants.push(Constant::new("λθ1", peak, factor));
        let Some(δ) = self.unknown_forces(θ, assumptions)? else {
            found.notes.push(Said::NoiseInSignals.into());
            return Ok(());
        };
        if !δ.is_finite() {
            found.notes.push(Said::NoUltimateBound.into());
            return Ok(());
        }
        let root_V = (Interval::point(2.0) * size(δ) / Interval::point(λ)).hi();
        let out = self.out_of_V(θ).into_iter();
        let sizes: Vec<f64> = out.map(|s| times(s, root_V)).collect();
        found.ultimate_bound = Some(length(&sizes));
        found.ultimate = self.per_state(&sizes);
        Ok(())
    }

    /// The smallest eigenvalue of −V̇ as a form in √V₁ and √V₂, rounded down.
    fn λ(&self, θ: [f64; 2]) -> f64 {
        let [c1, c2, c4, c5] = self.c;
        let [c1, c2, c4, c5, θ1, θ2] = [c1, c2, c4, c5, θ[0], θ[1]].map(Interval::point);
        let two = Interval::point(2.0);
        let (a, b, half) = (θ1 - c1, θ2 - c4, (c2 + c5) * θ2 / two);
        let root = (((a - b) / two).powi(2) + half.powi(2)).sqrt();
        // the determinant over the larger eigenvalue: no cancellation of the two roots
        ((a * b - half.powi(2)) / ((a + b) / two + root)).lo()
    }

    /// |e₁|, |v̂ − v| and the |X̂² − X²| of each block for √V = 1.
    fn out_of_V(&self, [θ1, θ2]: [f64; 2]) -> Vec<f64> {
        let S2 = Chain::new(self.form.q());
        let root2 = Interval::point(2.0).sqrt();
        let mut sizes = vec![root2.hi(), times(self.norms.left, θ1)];
        for (row, &γ) in self.norms.W.iter().zip(&self.norms.γ) {
            let term = |(i, &W): (usize, &f64)| {
                let root = Interval::point(S2.inverse_diagonal[i]).sqrt();
                size(W) * Interval::point(θ2).powi(i as i32) * root
            };
            let η = sum(row.iter().enumerate().map(term));
            sizes.push((η + size(γ) * root2).hi());
        }
        sizes
    }

    /// √V for an error of length one.
    fn root_V_of(&self, [θ1, θ2]: [f64; 2]) -> f64 {
        let (S1, S2) = (Chain::new(2), Chain::new(self.form.q()));
        let largest = |S: &Chain| Interval::point(S.largest).sqrt();
        let first = (size(self.norms.G11) / Interval::point(θ1)).max(Interval::ONE);
        let γ = size(plus(1.0, length(&self.norms.γ)));
        let row = |(k, row): (usize, &Vec<f64>)| over(length(row), θ2, k);
        let rows: Vec<f64> = self.norms.Z.iter().enumerate().map(row).collect();
        let second = largest(&S2) * size(length(&rows)) * γ;
        length(&[(largest(&S1) * first).hi(), second.hi()])
    }

    /// |(δ₁, δ₂)|; none where noise gets where the proof does not follow it.
    fn unknown_forces(
        &self,
        [θ1, θ2]: [f64; 2],
        assumptions: &Assumptions,
    ) -> Result<Option<f64>, DesignError> {
        let of = |states: &[usize]| {
            let drifts = states
                .iter()
                .map(|&i| assumptions.drift.get(i).copied().unwrap_or(0.0));
            length(&drifts.collect::<Vec<_>>())
        };
        let (S2, q) = (Chain::new(self.form.q()), self.form.q());
        let first = of(&self.form.x11());
        let ε = self.unknown_drift(assumptions);
        let root2 = Interval::point(2.0).sqrt();
        let driven = root2 * size(self.norms.G11) * size(ε) / Interval::point(θ1);
        let mut δ1 = plus(first, driven.hi());
        let pushed = |k: usize| -> f64 {
            let force = |j| plus(of(&self.form.block(j + 1)), times(self.norms.γ[j], first));
            let forces = (0..=k).map(|j| times(self.norms.Z[k][j], force(j)));
            over(total(forces), θ2, k)
        };
        let mut δ2 = in_S(&S2, &(0..q).map(pushed).collect::<Vec<_>>());
        let [n1, n2] = self.noise(assumptions)?;
        if n1 > 0.0 || n2 > 0.0 {
            if self.reads_states() {
                return Ok(None);
            }
            let square = self.form.first.len() == self.form.layers.factors.columns;
            // 2I − Π is I for a square G₁¹
            let n1 = size(if square { n1 } else { 2.0 * n1 });
            δ1 = plus(δ1, (Interval::point(θ1) * root2 * n1).hi());
            let back: Vec<f64> = (0..q).map(|k| times(self.norms.back(&S2, k), n2)).collect();
            let pushed = times(times(θ2, self.norms.push(&S2)), n2);
            δ2 = plus(δ2, plus(pushed, in_S(&S2, &back)));
        }
        Ok(Some(length(&[δ1, δ2])))
    }

    /// Whether G or Λ₂ changes with the states.
    fn reads_states(&self) -> bool {
        let graph = self.form.augmented.graph();
        let mut nodes = self.form.layers.factors.nonzero();
        nodes.extend(self.form.Λ2().iter().flat_map(|block| block.nonzero()));
        let used = graph.symbols_of(&nodes);
        self.form
            .augmented
            .symbols()
            .iter()
            .any(|x| used.contains(x))
    }

    /// Lengths of the errors of y₁ and y₂, in units of the states they show.
    fn noise(&self, assumptions: &Assumptions) -> Result<[f64; 2], DesignError> {
        let augmented = self.form.augmented;
        let graph = augmented.graph();
        let box_ = Enclosure::new(augmented, &assumptions.region);
        let one = |i: &usize| -> Result<f64, DesignError> {
            let noise = assumptions.noise.get(*i).copied().unwrap_or(0.0);
            let Some((_, slope, _)) = augmented.outputs[*i].state.filter(|_| noise > 0.0) else {
                return Ok(0.0);
            };
            let inverse = (1.0 / graph.expr(slope)).node();
            Ok(times(noise, box_.magnitude(inverse)?))
        };
        let of = |outputs: &[usize]| -> Result<f64, DesignError> {
            let sizes: Vec<f64> = outputs.iter().map(one).collect::<Result<_, _>>()?;
            Ok(length(&sizes))
        };
        Ok([of(&self.form.first)?, of(&self.form.second)?])
    }

    fn per_state(&self, sizes: &[f64]) -> Vec<UltimateBound> {
        let (form, augmented) = (self.form, self.form.augmented);
        let n = augmented.plant_states();
        let unknown: Vec<usize> = (n..augmented.states.len()).collect();
        let mut groups = vec![form.x11(), unknown];
        groups.extend((1..=form.q()).map(|k| form.block(k)));
        let place = |i: usize| groups.iter().position(|g| g.contains(&i));
        let states = augmented.states.iter().enumerate();
        states
            .filter_map(|(i, s)| Some((s.name.clone(), *sizes.get(place(i)?)?).into()))
            .collect()
    }
}

/// A bound divided by θᵏ.
fn over(bound: f64, θ: f64, k: usize) -> f64 {
    (size(bound) / Interval::point(θ).powi(k as i32)).hi()
}
