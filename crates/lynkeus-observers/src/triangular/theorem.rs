//! Theorems 1 and 2: what they guarantee for a plant and a tuning.
//!
//! The hypotheses are decided on the box of the assumptions; the inequalities stand
//! in [`proof`](crate::proof), with s_j = θ^{jδ} in the coordinates of Remark 2, or
//! divided by the partials where those are numbers. In ε scaled by θ^{δ_i/2} as in
//! the paper every entry of the comparison matrix beside −μ carries a power of θ:
//! −δ_i(1 + j − k) ≤ −δ_i inside a chain, at most n₂δ₂ − n₁δ₁ − (δ₁ + δ₂)/2 and
//! n₁δ₁ − (n₂ − 1)δ₂ − (δ₁ + δ₂)/2 between the chains. Both are negative exactly in
//! the window of Theorem 2 (of more than two chains each pair has one, `Window`). So its largest eigenvalue falls with θ, and from the
//! first θ0 for which it is negative on the decay is proved, θ < 1 included.

use crate::statement::{proved, standing, undecided};
use crate::{Check, Hammouri};
use lynkeus_expr::Interval;
use lynkeus_proof::chain::{Chain, Comparison, Disturbance, ultimate};
use lynkeus_proof::search::{first, lightest};
use lynkeus_structure::Extended;
use lynkeus_structure::Standing;

use super::facts::{Facts, remainder, without_bounds};
use super::form::Form;
use super::gains::{Gains, Window};
use super::lemma::verify;
use super::settings::Settings;
use super::{BASIS, observer};
use crate::conditions::names;
use crate::peaking::Departure;
use crate::prolongation;
use crate::proof::threshold::reached;
use crate::proof::words::{conclude, shown, state_noise};
use crate::stages::Found;
use crate::{Assumptions, Certificate, Constant, DesignError};

/// How much the gain may differ from the computed one, relatively: rounding of
/// the powers of θ in the observer.
const GAIN_ERROR: f64 = 1e-12;

pub(super) fn certificate(
    extended: &Extended<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let region = &assumptions.region;
    let facts = Facts::new(extended, &form, region)?;
    let mut checks = facts.checks.clone();
    let basis = match form.assignment.chains.len() {
        1 | 2 => BASIS,
        _ => MANY,
    };
    if let Some(departure) = Departure::of(settings.lmi.as_ref(), &settings.remedies) {
        checks.push(departure.check(Hammouri::Observer));
        return Ok(Certificate::new(basis, assumptions, checks));
    }
    let unbounded = facts
        .bounds
        .iter()
        .flatten()
        .any(|&(low, high)| !(low > 0.0 && high.is_finite()));
    let given = settings.S.is_some() || settings.divided;
    if unbounded {
        checks.extend(without_bounds(extended, &form, &facts, region));
    }
    if standing(&checks) == Standing::Refuted || (unbounded && !given) {
        let mut certificate = Certificate::new(basis, assumptions, checks);
        certificate.notes.push(remainder(&facts));
        return Ok(certificate);
    }
    // the observer under study, for its refusals and its gain
    if examination.fit() == Standing::Refuted {
        return Err(DesignError::Refused(Box::new(examination)));
    }
    let gains = Gains::new(&form, settings)?;
    observer(extended, settings, &form, &gains, examination)?;
    Study {
        extended,
        settings,
        assumptions,
        form: &form,
        facts: &facts,
        gains: &gains,
        basis,
    }
    .certificate(checks)
}

struct Study<'a> {
    extended: &'a Extended<'a>,
    settings: &'a Settings,
    assumptions: &'a Assumptions,
    form: &'a Form,
    facts: &'a Facts,
    gains: &'a Gains<'a>,
    basis: &'static str,
}

impl Study<'_> {
    fn certificate(&self, mut checks: Vec<Check>) -> Result<Certificate, DesignError> {
        let (mut constants, mut μ, mut broken) = (vec![], vec![], false);
        checks.extend(self.constant_gain());
        let count = self.form.assignment.chains.len();
        for i in 0..count {
            let states = names(self.extended, &self.form.assignment.chains[i].states);
            let suffix = match count {
                1 => String::new(),
                _ => format!(" of chain {}", i + 1),
            };
            let chain = self.chain(i, self.gains.θ[i], 1.0);
            let found = verify(&chain, &self.gains.S[i], self.gains.r[i], &states, &suffix);
            checks.push(found.check);
            broken |= found.broken;
            constants.extend(found.constants);
            μ.extend(found.μ);
        }
        let windows = Window::of(&self.form.assignment, &self.gains.δ);
        checks.extend(windows.iter().map(|w| windowed(w, count, &mut constants)));
        let (lipschitz, known) = self.steepest();
        constants.push(Constant::new(
            "c",
            lipschitz,
            "upper bound of every |∂f/∂x| beside the chains' own partials",
        ));
        let ready = known && μ.len() == count && standing(&checks) != Standing::Refuted;
        let rate = if ready {
            self.rate(&μ, &windows, &mut checks, &mut constants)
        } else {
            None
        };
        let mut certificate = Certificate::new(self.basis, self.assumptions, checks);
        certificate.constants = constants;
        let place = prolongation::note(
            &self.settings.common,
            self.extended,
            &self.assumptions.region,
        );
        certificate.notes.push(place);
        certificate.notes.extend(broken.then(|| BROKEN.to_owned()));
        if let Some((σ, c)) = rate {
            self.conclude(&mut certificate, σ, &c)?;
        }
        Ok(certificate)
    }

    /// Chain i at θ, in the coordinates x̃ = T x; c weighs its V.
    fn chain(&self, i: usize, θ: f64, c: f64) -> Chain {
        let states = self.form.assignment.chains[i].states.clone();
        let gains = self.gains;
        let speed = Interval::point(θ).pow(Interval::point(gains.δ[i]));
        let bounds = &self.facts.bounds[i];
        let mut T = Interval::ONE;
        let mut scales = vec![speed];
        for (j, &(low, high)) in bounds.iter().enumerate() {
            if gains.divided {
                T = T * Interval::new(low, high).unwrap_or(Interval::ENTIRE);
            }
            scales.push(speed.powi(j as i32 + 2) / T);
        }
        let error = Interval::new(1.0 - GAIN_ERROR, 1.0 + GAIN_ERROR).unwrap_or(Interval::ONE);
        let S = &gains.S[i];
        let weight = Interval::point(c);
        let entry = |j: usize| {
            (0..S.size())
                .map(move |k| weight * Interval::point(S.get(j, k)))
                .collect()
        };
        let g = S
            .gain()
            .into_iter()
            .map(|s| Interval::point(gains.r[i] * s) * error);
        let partials = match gains.divided {
            true => vec![(1.0, 1.0).into(); bounds.len()],
            false => bounds.iter().map(|&range| range.into()).collect(),
        };
        Chain {
            states,
            speed,
            scales,
            S: (0..S.size()).map(entry).collect(),
            g: g.collect(),
            partials,
        }
    }

    fn comparison(&self, μ: &[f64], θ: impl Fn(usize) -> f64, c: &[f64]) -> Comparison {
        let chains: Vec<Chain> = (0..μ.len()).map(|i| self.chain(i, θ(i), c[i])).collect();
        Comparison::new(&chains, μ, &self.facts.slopes)
    }

    /// (c, θ0) for V = V1 + c2·V2 + …; the paper has c2 = 1.
    fn least(&self, μ: &[f64], θ: f64) -> (Vec<f64>, Option<f64>) {
        let at = |c: &[f64]| first(θ, |θ| self.comparison(μ, |_| θ, c).holds());
        lightest(μ.len(), at)
    }

    /// `partials = true` divides by the partials at the estimate.
    fn constant_gain(&self) -> Option<Check> {
        let varies = self
            .facts
            .bounds
            .iter()
            .flatten()
            .any(|(low, high)| low != high);
        (self.gains.divided && varies).then(|| {
            undecided(
                Hammouri::ConstantGain,
                "partials = true divides it by the partials at the estimate, which vary on the box, and the theorem covers a constant gain only: missing is a bound of how fast they change and of how much they differ from the plant's",
            )
        })
    }

    /// (largest |∂f/∂x| beside the chains, whether all are known)
    fn steepest(&self) -> (f64, bool) {
        let largest = self
            .facts
            .slopes
            .iter()
            .fold(0.0, |m: f64, s| m.max(s.size));
        (largest, largest.is_finite())
    }

    /// (σ, c) at the study's θ, with the hypothesis θ ≥ θ0; c has a weight for each chain.
    fn rate(
        &self,
        μ: &[f64],
        windows: &[Window],
        checks: &mut Vec<Check>,
        constants: &mut Vec<Constant>,
    ) -> Option<(f64, Vec<f64>)> {
        let θ = &self.gains.θ;
        let alike = θ.iter().all(|x| *x == θ[0]);
        let inside = windows.iter().all(Window::holds);
        let (c, θ0) = match alike && inside {
            true => self.least(μ, θ[0]),
            false => (vec![1.0; μ.len()], None),
        };
        let σ = self.comparison(μ, |i| θ[i], &c).rate();
        for (i, &weight) in c.iter().enumerate().skip(1) {
            constants.push(match c.len() {
                2 => {
                    let meaning = "weight of the second chain in V = V1 + c·V2";
                    Constant::new("c of V", weight, meaning)
                }
                _ => {
                    let meaning = format!("weight of chain {} in V = V1 + c2·V2 + …", i + 1);
                    Constant::new(format!("c{}", i + 1), weight, meaning)
                }
            });
        }
        if let Some(θ0) = θ0 {
            constants.push(Constant::new(
                "θ0",
                θ0,
                "the decay is proved for every θ from here on",
            ));
        }
        checks.push(match alike {
            true => reached(θ[0], θ0, σ.is_some()),
            false => at_these(σ.is_some()),
        });
        σ.map(|σ| (σ, c))
    }

    fn conclude(
        &self,
        certificate: &mut Certificate,
        σ: f64,
        c: &[f64],
    ) -> Result<(), DesignError> {
        let noise = state_noise(
            self.extended,
            &self.assumptions.region,
            &self.assumptions.noise,
        )?;
        let count = self.form.assignment.chains.len();
        let chain = |i: usize| self.chain(i, self.gains.θ[i], c[i]);
        let chains: Vec<Chain> = (0..count).map(chain).collect();
        conclude(certificate, self.extended, σ, self.assumptions, |process| {
            let outside = Disturbance {
                drift: &self.assumptions.drift,
                noise: &noise,
                process,
            };
            Ok(ultimate(&chains, σ, &outside))
        })
    }
}

/// What a certificate of more than two chains rests on.
const MANY: &str =
    "Theorem 2 of Hammouri, Targui and Armanet, its proof with every two chains' window";

const BROKEN: &str = "A refuted Lemma 1 ends this proof, whatever θ is. It does not say that the estimate diverges: a plant that is damped by itself may carry the observer. Lemma 1's own S (leave the key S out) satisfies it.";

/// Theorem 2's window for two of so many chains; of two, the paper's first one leads.
fn windowed(window: &Window, count: usize, constants: &mut Vec<Constant>) -> Check {
    let Window {
        pair,
        leads,
        low,
        high,
        ratio,
    } = *window;
    let [i, k] = match count {
        2 => [1, 2],
        _ => pair.map(|chain| chain + 1),
    };
    let beside = if leads { '−' } else { '+' };
    let lower = format!("lower end of Theorem 2's window for δ{k}/δ{i}");
    constants.extend([
        Constant::new(format!("(2n{i}−1)/(2n{k}{beside}1)"), low, lower),
        Constant::new(format!("δ{k}/δ{i}"), ratio, "ratio of the exponents"),
        Constant::new(
            format!("(2n{i}+1)/(2n{k}−1)"),
            high,
            "upper end of the window",
        ),
    ]);
    let name = Hammouri::Window;
    let text = format!("{} in ({}, {})", shown(ratio), shown(low), shown(high));
    match window.holds() {
        true => proved(name, text),
        false => undecided(
            name,
            format!(
                "not {text}: no θ0 is known, the couplings between the chains grow faster than the decay"
            ),
        ),
    }
}

/// One θ per chain: there is no common θ0.
fn at_these(holds: bool) -> Check {
    let name = Hammouri::Comparison;
    match holds {
        true => proved(name, "one θ per chain has no common θ0: checked at these"),
        false => undecided(
            name,
            "it is not; the theorem is sufficient, not necessary: try a larger θ, the same for all chains",
        ),
    }
}
