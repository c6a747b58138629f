//! Ultimate bounds: what acts on the plant, and measurement errors, within their bounds
//! and always in the worst direction.

use lynkeus_observers::{Certificate, Claim as Sought};
use lynkeus_structure::Standing;
use nalgebra::{DMatrix, DVector};

use crate::gains::{self, Middle};
use crate::judge::{Claim, Sides};
use crate::numbers::Numbers;
use crate::pair::{self, Pair};
use crate::plants;
use crate::simulate::{difference, pace, shrunk};
use crate::{Context, certificate};

/// Proved systems to look at.
const SYSTEMS: usize = 60;
const STEPS: usize = 3000;
/// Error of the method and of disturbances that are constant over a step.
const INTEGRATION: f64 = 1e-3;

/// The guarantee of a certificate from a start: per state, and of the norm.
struct Bound<'c> {
    certificate: &'c Certificate,
    claim: Claim,
    /// √(P⁻¹)_ii
    widths: Vec<f64>,
    spread: f64,
}

impl<'c> Bound<'c> {
    fn new(certificate: &'c Certificate) -> Self {
        let claim = Claim::new(certificate);
        let inverse = claim.P.clone().try_inverse().unwrap();
        let spread = certificate.constants.iter().find(|c| c.name == "√cond(P)");
        Self {
            certificate,
            widths: inverse.diagonal().iter().map(|x| x.sqrt()).collect(),
            spread: spread.unwrap().value,
            claim,
        }
    }

    /// The part of the transient in the bound of the norm, at least as it is now.
    fn holds(&self, t: f64, start: &DVector<f64>, e: &DVector<f64>) -> bool {
        let fading = (-self.claim.rate * t).exp();
        let norm = self.spread * fading * start.norm();
        let last = self.certificate.ultimate_bound.unwrap();
        let slack = 1.0 + INTEGRATION;
        assert!(
            e.norm() <= (norm + last) * slack,
            "|e| = {} at t = {t}, allowed {norm} + {last}",
            e.norm()
        );
        let root = self.claim.V(start).sqrt();
        for (i, bound) in self.certificate.ultimate.iter().enumerate() {
            let (name, last) = (&bound.name, bound.value);
            let fading = fading * root * self.widths[i];
            assert!(
                e[i].abs() <= (fading + last) * slack,
                "{name}: {} at t = {t}, allowed {fading} + {last}",
                e[i]
            );
        }
        norm < 0.1 * last
    }
}

/// Whether the system is proved and was followed until the transient was gone.
fn followed(seed: u64) -> Option<bool> {
    let mut numbers = Numbers(seed.wrapping_mul(0x9FB2_1C65_1E98_DF25));
    let random = plants::random(&mut numbers).at_rest();
    let plant = pair::plant(&random.text());
    let augmented = pair::augmented(&plant);
    let (n, p) = (random.states.len(), random.outputs.len());
    let copy = pair::observer(&augmented, &DMatrix::zeros(n, p));
    let mut copy = Pair::new(&augmented, &copy);
    let K = gains::random(
        &mut numbers,
        &Middle::new(&mut copy, &random.states, &random.inputs),
    );
    let width = |(low, high): &(f64, f64)| high - low;
    let drift: Vec<f64> = random.states.iter().map(width).collect();
    let drift: Vec<f64> = drift.iter().map(|w| w * numbers.size(1e-5, 1e-2)).collect();
    let noise: Vec<f64> = (0..p).map(|_| numbers.size(1e-6, 1e-3)).collect();
    let observer = pair::observer(&augmented, &K);
    let certificate = certificate(&augmented, &observer, [&drift, &noise], Sought::Fastest);
    if certificate.verdict() != Standing::Proved {
        return None;
    }
    let context = Context(format!("system {seed}\n{}K = {K}", random.text()));
    let sides = Sides::new(&certificate, n);
    let bound = Bound::new(&certificate);
    let mut pair = Pair::new(&augmented, &observer);
    let h = 0.1 / pace(&mut pair, &sides, &mut numbers);
    let inner: Vec<(f64, f64)> = sides.states.iter().map(|s| shrunk(s, 0.2)).collect();
    let u: Vec<f64> = sides
        .inputs
        .iter()
        .map(|(a, b)| f64::midpoint(*a, *b))
        .collect();
    let (mut x, mut hat) = (numbers.inside(&inner), numbers.inside(&inner));
    let start = difference(&x, &hat);
    let mut settled = false;
    for step in 0..STEPS {
        let t = step as f64 * h;
        let worst = &bound.claim.P * difference(&x, &hat);
        let through = K.transpose() * &worst;
        let w: Vec<f64> = drift
            .iter()
            .zip(worst.iter())
            .map(|(d, e)| -d * e.signum())
            .collect();
        let ν: Vec<f64> = noise
            .iter()
            .zip(through.iter())
            .map(|(d, e)| d * e.signum())
            .collect();
        // the midpoint rule, as accurate as disturbances that jump allow
        let moved = |x: &[f64], k: &DVector<f64>, h: f64| -> Vec<f64> {
            x.iter().zip(k.iter()).map(|(x, k)| x + h * k).collect()
        };
        let mut slopes = |t: f64, x: &[f64], hat: &[f64]| {
            let y = pair.outputs(t, x, &u);
            let y: Vec<f64> = y.iter().zip(&ν).map(|(y, ν)| y + ν).collect();
            let w = DVector::from_column_slice(&w);
            (pair.plant(t, x, &u) + w, pair.observer(t, hat, &u, &y))
        };
        let (k, k_hat) = slopes(t, &x, &hat);
        let (mid, mid_hat) = (moved(&x, &k, h / 2.0), moved(&hat, &k_hat, h / 2.0));
        let (k, k_hat) = slopes(t + h / 2.0, &mid, &mid_hat);
        (x, hat) = (moved(&x, &k, h), moved(&hat, &k_hat, h));
        if !(sides.hold(&x) && sides.hold(&hat)) {
            break;
        }
        settled = bound.holds(t + h, &start, &difference(&x, &hat));
    }
    drop(context);
    Some(settled)
}

#[test]
fn disturbed_errors_end_within_the_ultimate_bound() {
    let proved: Vec<bool> = (1..).filter_map(followed).take(SYSTEMS).collect();
    let settled = proved.iter().filter(|settled| **settled).count();
    assert!(3 * settled >= SYSTEMS, "{settled} of {SYSTEMS}");
}
