//! Theorems 1 and 2: what they guarantee for a plant and a tuning.
//!
//! The hypotheses are decided on the box of the assumptions; the inequalities stand
//! in [`lynkeus_proof::chain`], with s_j = θ^{jδ} in the coordinates of Remark 2, or
//! divided by the partials where those are numbers. In ε scaled by θ^{δ_i/2} as in
//! the paper every entry of the comparison matrix beside −μ carries a power of θ:
//! −δ_i(1 + j − k) ≤ −δ_i inside a chain, at most n₂δ₂ − n₁δ₁ − (δ₁ + δ₂)/2 and
//! n₁δ₁ − (n₂ − 1)δ₂ − (δ₁ + δ₂)/2 between the chains. Both are negative exactly in
//! the window of Theorem 2 (of more than two chains each pair has one, `Window`). So its largest eigenvalue falls with θ, and from the
//! first θ0 for which it is negative on the decay is proved, θ < 1 included.
//!
//! For each chain Lemma 1 asks whether its S satisfies (17), with which ρ and η.

use lynkeus_expr::Interval;
use lynkeus_gain::lemma1::{Breaking, Kernel};
use lynkeus_gain::{Tridiagonal, lemma1};
use lynkeus_proof::chain::{Chain, Comparison, Disturbance, Slope, ultimate};
use lynkeus_proof::matrix::sum;
use lynkeus_proof::search::{first, lightest};
use lynkeus_structure::{AugmentedPlant, Region, Standing};

use super::form::{Form, Gains, Window};
use super::observer::observer;
use super::said::{Hammouri, Said};
use super::settings::Settings;
use crate::conditions::{along, at_partials, names};
use crate::design::Found;
use crate::peaking::departure;
use crate::statement::{proved, refuted, standing, sufficient, undecided};
use crate::theorem::{as_computed, conclude, is_along, slopes, state_noise, undeclared};
use crate::{Assumptions, Certificate, Check, Constant, DesignError, Reason, estimate};

pub(super) const BASIS: &str = "Theorem 2 of Hammouri, Targui and Armanet (one chain: Theorem 1)";

pub(super) fn certificate(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
    assumptions: &Assumptions,
) -> Result<Certificate, DesignError> {
    let region = &assumptions.region;
    let chains = &form.assignment.chains;
    let places = chains.iter().map(|c| &c[..]);
    let (partials, mut checks) = along(augmented, places.enumerate(), region)?;
    let bounds = partials
        .iter()
        .map(|chain| chain.iter().map(|p| p.bounds).collect());
    let bounds: Vec<Vec<(f64, f64)>> = bounds.collect();
    let skip = |a: usize, b: usize| chains.iter().any(|chain| is_along(chain, a, b));
    let (slopes, check) = slopes(augmented, region, skip)?;
    checks.push(check);
    let basis = match form.assignment.chains.len() {
        1 | 2 => BASIS,
        _ => MANY,
    };
    if let Some(check) = departure(Hammouri::Observer, settings.lmi, &settings.remedies) {
        checks.push(check);
        return Ok(Certificate::new(basis, assumptions, checks));
    }
    let unbounded = bounds.iter().flatten().any(is_open);
    let given = settings.S.is_some() || settings.divided;
    if unbounded {
        checks.extend(without_bounds(augmented, &form, &bounds, region));
    }
    if standing(&checks) == Standing::Refuted || (unbounded && !given) {
        let mut certificate = Certificate::new(basis, assumptions, checks);
        certificate.notes.push(remainder(&bounds));
        return Ok(certificate);
    }
    // the observer under study, for its refusals and its gain
    if examination.fit() == Standing::Refuted {
        return Err(DesignError::Refused(Box::new(examination)));
    }
    let gains = Gains::new(&form, settings)?;
    observer(augmented, settings, &form, &gains, examination)?;
    Study {
        augmented,
        settings,
        assumptions,
        form: &form,
        gains: &gains,
        bounds,
        slopes,
        basis,
    }
    .certificate(checks)
}

struct Study<'a> {
    augmented: &'a AugmentedPlant<'a>,
    settings: &'a Settings,
    assumptions: &'a Assumptions,
    form: &'a Form,
    gains: &'a Gains<'a>,
    /// per chain (α₁, α₂) of every partial
    bounds: Vec<Vec<(f64, f64)>>,
    slopes: Vec<Slope>,
    basis: &'static str,
}

impl Study<'_> {
    fn certificate(&self, mut checks: Vec<Check>) -> Result<Certificate, DesignError> {
        let (mut constants, mut μ) = (vec![], vec![]);
        checks.extend(self.constant_gain());
        let count = self.form.assignment.chains.len();
        for i in 0..count {
            let states = names(self.augmented, &self.form.assignment.chains[i]);
            let suffix = match count {
                1 => String::new(),
                _ => format!(" of chain {}", i + 1),
            };
            let chain = self.chain(i, self.gains.θ[i], 1.0);
            let (S, r) = (&self.gains.S[i], self.gains.r[i]);
            let (check, decay) = verify(&chain, S, r, &states, &suffix, &mut constants);
            checks.push(check);
            μ.extend(decay);
        }
        let broken = standing(&checks) == Standing::Refuted;
        let windows = Window::of(&self.form.assignment, &self.gains.δ);
        checks.extend(windows.iter().map(|w| windowed(w, count, &mut constants)));
        let steepest = self.slopes.iter().fold(0.0, |m: f64, s| m.max(s.size));
        constants.push(Constant::new(
            "c",
            steepest,
            "upper bound of every |∂f/∂x| beside the chains' own partials",
        ));
        let ready = steepest.is_finite() && μ.len() == count && !broken;
        let rate = match ready {
            true => self.rate(&μ, &windows, &mut checks, &mut constants),
            false => None,
        };
        let mut certificate = Certificate::new(self.basis, self.assumptions, checks);
        certificate.constants = constants;
        let place = estimate::note(
            &self.settings.common,
            self.augmented,
            &self.assumptions.region,
        );
        certificate.notes.push(place);
        let said = broken.then(|| Said::LemmaRefuted.into());
        certificate.notes.extend(said);
        if let Some((σ, c)) = rate {
            self.conclude(&mut certificate, σ, &c)?;
        }
        Ok(certificate)
    }

    /// Chain i at θ, in the coordinates x̃ = T x; c weighs its V.
    fn chain(&self, i: usize, θ: f64, c: f64) -> Chain {
        let states = self.form.assignment.chains[i].clone();
        let gains = self.gains;
        let speed = Interval::point(θ).pow(Interval::point(gains.δ[i]));
        let bounds = &self.bounds[i];
        let mut T = Interval::ONE;
        let mut scales = vec![speed];
        for (j, &(low, high)) in bounds.iter().enumerate() {
            if gains.divided {
                T = T * Interval::new(low, high).unwrap_or(Interval::ENTIRE);
            }
            scales.push(speed.powi(j as i32 + 2) / T);
        }
        let S = &gains.S[i];
        let weight = Interval::point(c);
        let entry = |j: usize| {
            (0..S.size())
                .map(move |k| weight * Interval::point(S.get(j, k)))
                .collect()
        };
        let partials = match gains.divided {
            true => vec![(1.0, 1.0).into(); bounds.len()],
            false => bounds.iter().map(|&range| range.into()).collect(),
        };
        Chain {
            states,
            speed,
            scales,
            S: (0..S.size()).map(entry).collect(),
            g: as_computed(S.gain().into_iter().map(|s| gains.r[i] * s)),
            partials,
        }
    }

    fn comparison(&self, μ: &[f64], θ: impl Fn(usize) -> f64, c: &[f64]) -> Comparison {
        let chains: Vec<Chain> = (0..μ.len()).map(|i| self.chain(i, θ(i), c[i])).collect();
        Comparison::new(&chains, μ, &self.slopes)
    }

    /// (c, θ0) for V = V1 + c2·V2 + …; the paper has c2 = 1.
    fn least(&self, μ: &[f64], θ: f64) -> (Vec<f64>, Option<f64>) {
        let at = |c: &[f64]| first(θ, |θ| self.comparison(μ, |_| θ, c).holds());
        lightest(μ.len(), at)
    }

    /// `partials = true` divides by the partials at the estimate.
    fn constant_gain(&self) -> Option<Check> {
        let varies = self.bounds.iter().flatten().any(|(low, high)| low != high);
        (self.gains.divided && varies).then(|| undecided(Hammouri::ConstantGain, Said::GainVaries))
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
            true => {
                let holds = σ.is_some();
                let reason = Said::Threshold { θ0, holds };
                sufficient(Hammouri::Theta { θ: θ[0] }, holds, reason)
            }
            // one θ per chain: there is no common θ0
            false => {
                let holds = σ.is_some();
                sufficient(Hammouri::Comparison, holds, Said::AtTheseThetas { holds })
            }
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
            self.augmented,
            &self.assumptions.region,
            &self.assumptions.noise,
        )?;
        let count = self.form.assignment.chains.len();
        let chain = |i: usize| self.chain(i, self.gains.θ[i], c[i]);
        let chains: Vec<Chain> = (0..count).map(chain).collect();
        conclude(
            certificate,
            self.augmented,
            σ,
            self.assumptions,
            |process| {
                let outside = Disturbance {
                    drift: &self.assumptions.drift,
                    noise: &noise,
                    process,
                };
                Ok(ultimate(&chains, σ, &outside))
            },
        )
    }
}

/// What a certificate of more than two chains rests on.
const MANY: &str =
    "Theorem 2 of Hammouri, Targui and Armanet, its proof with every two chains' window";

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
    let inside = window.holds();
    let said = Said::Ratio {
        ratio,
        low,
        high,
        inside,
    };
    sufficient(Hammouri::Window, inside, said)
}

/// Partials without bounds: Lemma 1 has nothing to start from.
fn without_bounds(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    bounds: &[Vec<(f64, f64)>],
    region: &Region,
) -> Option<Check> {
    let partials = form.partials.iter().flatten();
    let open = partials.zip(bounds.iter().flatten());
    let open = open.filter(|(_, bounds)| is_open(bounds));
    let nodes: Vec<_> = open.map(|(partial, _)| partial.node).collect();
    let said = Said::NoBounds {
        partial: augmented.graph().render(*nodes.first()?, 60),
        undeclared: undeclared(augmented, &nodes, region),
    };
    Some(undecided(Hammouri::PartialsAreBounded, said))
}

/// Whether Lemma 1 has nothing to start from.
fn is_open((low, high): &(f64, f64)) -> bool {
    !(*low > 0.0 && high.is_finite())
}

fn remainder(bounds: &[Vec<(f64, f64)>]) -> Reason {
    let all = bounds.iter().flatten().count();
    let open = bounds.iter().flatten().filter(|bounds| is_open(bounds));
    let known = all - open.count();
    Said::BoundsKnown { known, all }.into()
}

/// Lemma 1's (17) with ρ = 2r, refuted where S satisfies it for no ρ, and μ of
/// AᵀS + SA − ρCᵀC ≤ −μ·diag(S) where that is proved. `names`: the states of the chain; `suffix` tells
/// the constants of several chains apart.
fn verify(
    chain: &Chain,
    S: &Tridiagonal,
    r: f64,
    names: &[String],
    suffix: &str,
    constants: &mut Vec<Constant>,
) -> (Check, Option<f64>) {
    let title = Hammouri::Lemma1 {
        states: names.to_vec(),
        ρ: 2.0 * r,
    };
    let least = match lemma1::kernel(S, &chain.partials) {
        Ok(Kernel::Holds { ρ }) => ρ,
        Ok(Kernel::Breaks(found)) => return (breaks(title, S, &found, names), None),
        Err(error) => return (undecided(title, Said::NoKernel(error)), None),
    };
    let Some(μ) = chain.decay() else {
        let said = match 2.0 * r > least {
            true => Said::LemmaBarely,
            false => Said::LemmaAbove { least },
        };
        return (undecided(title, said), None);
    };
    let smallest = S.diagonal().iter().copied().fold(f64::INFINITY, f64::min);
    let η = (Interval::point(μ) * Interval::point(smallest)).lo();
    constants.extend(of_lemma(chain, suffix, [least, 2.0 * r, η, μ]));
    (proved(title, Said::LemmaHolds { η, least }), Some(μ))
}

fn of_lemma(chain: &Chain, suffix: &str, [least, ρ, η, μ]: [f64; 4]) -> Vec<Constant> {
    let (lower, upper) = chain
        .partials
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(l, u), b| {
            (l.min(b.lower), u.max(b.upper))
        });
    let mut list = vec![];
    let mut add = |name: &str, value: f64, meaning: &str| {
        list.push(Constant::new(format!("{name}{suffix}"), value, meaning));
    };
    if upper > 0.0 {
        add("α1", lower, "lower bound of the partials along the chain");
        add("α2", upper, "upper bound of the partials along the chain");
    }
    add(
        "ρ_min",
        least,
        "Lemma 1 holds for every ρ above it (floating point)",
    );
    add("ρ", ρ, "2r, the ρ of the proof");
    add("η", η, "Lemma 1: AᵀS + SA − ρCᵀC ≤ −ηI");
    add(
        "μ",
        μ,
        "the same weighed by S: AᵀS + SA − ρCᵀC ≤ −μ·diag(S)",
    );
    list
}

/// At a vertex of the bounds, in a direction that C does not see: a refutation where its sign is certain.
fn breaks(title: Hammouri, S: &Tridiagonal, found: &Breaking, names: &[String]) -> Check {
    let certain = quotient(S, found).is_positive();
    let said = Said::LemmaBreaks {
        direction: names
            .iter()
            .cloned()
            .zip(found.direction.iter().copied())
            .collect(),
        eigenvalue: found.eigenvalue,
        certain,
    };
    if !certain {
        return undecided(title, said);
    }
    refuted(title, at_partials(&found.a, found.eigenvalue), said)
}

/// vᵀ(AᵀS + SA)v, rounding included: a proof that the form is positive somewhere.
fn quotient(S: &Tridiagonal, found: &Breaking) -> Interval {
    let v = |i: usize| Interval::point(found.direction[i]);
    let n = S.size();
    let pairs = (0..n).flat_map(|i| (1..n).map(move |j| (i, j)));
    let terms = pairs.map(|(i, j)| {
        let SA = Interval::point(S.get(i, j - 1)) * Interval::point(found.a[j - 1]);
        Interval::point(2.0) * v(i) * SA * v(j)
    });
    sum(terms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_structure::Verdict;

    fn title() -> Hammouri {
        Hammouri::Lemma1 {
            states: vec!["x".into(), "z".into()],
            ρ: 2.0,
        }
    }

    #[test]
    fn a_matrix_that_overflows_is_no_refutation() {
        let S = Tridiagonal::new(vec![1.0, 1e300], vec![-1e100]).unwrap();
        let chain = Chain {
            states: vec![0, 1],
            speed: Interval::ONE,
            scales: vec![Interval::ONE; 2],
            S: vec![
                vec![Interval::ONE, Interval::point(-1e100)],
                vec![Interval::point(-1e100), Interval::point(1e300)],
            ],
            g: vec![Interval::ONE; 2],
            partials: vec![(1e250, 1e250).into()],
        };
        let names = ["x".into(), "z".into()];
        let (check, μ) = verify(&chain, &S, 1.0, &names, "", &mut vec![]);
        assert!(μ.is_none() && matches!(check.verdict, Verdict::Undecided(_)));
        let said = Reason::from(Said::NoKernel(lemma1::Error::Overflow));
        assert_eq!(check.reason, said);
    }

    /// AᵀS + SA = 0 on the kernel of C: that rounding does not tell its sign says nothing of ρ.
    #[test]
    fn what_rounding_hides_is_no_refutation() {
        let S = Tridiagonal::new(vec![1.0, 3.0], vec![0.0]).unwrap();
        for eigenvalue in [0.0, -1e-17] {
            let found = Breaking {
                a: vec![1.0],
                eigenvalue,
                direction: vec![0.0, 1.0],
            };
            let check = breaks(title(), &S, &found, &["x".into(), "z".into()]);
            assert!(matches!(check.verdict, Verdict::Undecided(_)));
            let is_certain = |said: &Reason| {
                matches!(
                    said,
                    Reason::Triangular(Said::LemmaBreaks { certain: true, .. })
                )
            };
            assert!(!is_certain(&check.reason));
        }
    }
}
