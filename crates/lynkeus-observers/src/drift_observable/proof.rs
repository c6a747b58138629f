//! P for the study's gain, and hypothesis 4 of the theorems.

use crate::statement::{sufficient, undecided};
use crate::{Check, Germani};
use lynkeus_gain::vandermonde::{self, Pole};
use lynkeus_proof::magnitude::{length, plus, times};
use lynkeus_proof::riccati::Riccati;
use lynkeus_structure::Extended;

use super::form::Form;
use super::gains::{Gains, closed_loop, spread};
use super::lipschitz::Lipschitz;
use crate::Constant;
use crate::enclosure::figures;

/// Steps of a bisection on a logarithmic scale.
const STEPS: usize = 40;
/// Shares of the largest α tried for the bounds as t → ∞.
const SHARES: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 0.9];
/// α of the question whether there is any, as a share of the slowest pole.
pub(super) const SLOW: f64 = 1e-6;

/// Everything the conclusions are drawn from.
pub(super) struct Proof<'a, 'p> {
    pub extended: &'a Extended<'p>,
    pub form: &'a Form,
    pub gains: &'a Gains,
    pub lipschitz: &'a Lipschitz,
    /// A − KC
    pub A: Vec<Vec<f64>>,
    /// the slowest pole's absolute value
    pub slowest: f64,
    /// per input: the bound of the derivative that drives the filter
    pub w: Vec<f64>,
}

/// Solutions of the Riccati inequality; any of them proves something.
pub(super) struct Solutions {
    /// with the largest α
    pub fastest: Riccati,
    /// with smaller α, which may leave smaller bounds as t → ∞
    pub slower: Vec<Riccati>,
}

impl Proof<'_, '_> {
    /// P for the study's gain, and hypothesis 4 with both numbers.
    pub fn riccati(
        &self,
        u_M: f64,
        constants: &mut Vec<Constant>,
    ) -> (Option<Solutions>, Vec<Check>) {
        let mut checks = vec![];
        let drift = &self.lipschitz.drift;
        let with_input = |u: f64| -> Vec<f64> {
            let pairs = drift.iter().zip(&self.lipschitz.input);
            pairs
                .map(|(γ, H)| {
                    if *H > 0.0 {
                        plus(*γ, times(u, *H))
                    } else {
                        *γ
                    }
                })
                .collect()
        };
        let γ = length(drift);
        let limit = self.largest(|s| drift.iter().map(|g| g * s).collect()) * γ;
        let name = || Germani::Riccati;
        let holds = limit >= γ;
        if limit.is_finite() && γ.is_finite() && γ > 0.0 {
            constants.push(Constant::new("γ*", limit, "what these poles can bear"));
            let word = if holds { "≤" } else { ">" };
            let detail = format!("{} {word} {}", figures(γ), figures(limit));
            checks.push(sufficient(name(), holds, detail));
            constants.extend(self.scale());
        } else if !γ.is_finite() {
            checks.push(undecided(name(), "γ has no bound"));
        }
        if !γ.is_finite() || (γ > 0.0 && !holds) {
            return (None, checks);
        }
        if length(&self.lipschitz.input) > 0.0 {
            let limit = self.largest(with_input);
            if limit.is_finite() {
                let meaning = "the largest |u| that these poles can bear";
                constants.push(Constant::new("u_M", limit, meaning));
            }
            let word = if u_M <= limit { "≤" } else { ">" };
            let detail = format!("{} {word} {}", figures(u_M), figures(limit));
            checks.push(sufficient(Germani::Input, u_M <= limit, detail));
        }
        let g = with_input(u_M);
        if !g.iter().all(|g| g.is_finite()) {
            return (None, checks);
        }
        let E = spread(&g);
        let P = Riccati::fastest(&self.A, &E, 1.0, self.slowest).map(|fastest| {
            let at = |share: &f64| Riccati::solve(&self.A, &E, share * fastest.α, 1.0);
            Solutions {
                slower: SHARES.iter().filter_map(at).collect(),
                fastest,
            }
        });
        if P.is_none() && checks.iter().all(Check::is_proved) {
            checks.push(undecided(name(), "no P was found for these poles"));
        }
        (P, checks)
    }

    /// The largest s for which g(s) can be borne; 0 where none can, infinite
    /// where all can.
    fn largest(&self, g: impl Fn(f64) -> Vec<f64>) -> f64 {
        let bears = |s: f64| self.bears(&self.A, &g(s), self.slowest);
        edge(|s| !bears(s)).map_or(
            f64::INFINITY,
            |s| if bears(s / 1.01) { s / 1.01 } else { 0.0 },
        )
    }

    fn bears(&self, A: &[Vec<f64>], g: &[f64], slowest: f64) -> bool {
        g.iter().all(|g| g.is_finite())
            && Riccati::solve(A, &spread(g), SLOW * slowest, 1.0).is_some()
    }

    /// The smallest factor of all poles that the proof allows.
    fn scale(&self) -> Option<Constant> {
        let bears = |s: f64| {
            let scaled = |λ: &Vec<Pole>| -> Vec<f64> {
                let faster: Vec<Pole> = λ.iter().map(|λ| λ.scaled(s)).collect();
                vandermonde::place_all(&faster)
            };
            let K: Vec<Vec<f64>> = self.gains.λ.iter().map(scaled).collect();
            self.bears(&closed_loop(&K), &self.lipschitz.drift, s * self.slowest)
        };
        let s = edge(bears)?;
        let meaning = "the proof allows these poles times this factor, without input";
        Some(Constant::new("s0", s, meaning))
    }
}

/// The smallest s > 0 from which on `holds`, to a thousandth, rounded up; none up to 10⁶.
fn edge(holds: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut low, mut high) = (1e-9f64, 1.0f64);
    while !holds(high) {
        (low, high) = (high, high * 4.0);
        if high > 1e6 {
            return None;
        }
    }
    for _ in 0..STEPS {
        let middle = (low * high).sqrt();
        match holds(middle) {
            true => high = middle,
            false => low = middle,
        }
        if high < low * 1.001 {
            break;
        }
    }
    Some(high)
}
