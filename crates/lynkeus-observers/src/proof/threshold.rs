//! θ0: from where on the decay is proved.

use super::words::shown;
use crate::statement::{proved, undecided};
use crate::{Check, Hammouri};

/// The hypothesis θ ≥ θ0; `holds`: the inequality is proved at θ itself.
pub(crate) fn reached(θ: f64, θ0: Option<f64>, holds: bool) -> Check {
    let name = Hammouri::Theta { θ };
    match (θ0, holds) {
        (Some(θ0), true) => proved(name, format!("θ0 = {}", shown(θ0))),
        (Some(θ0), false) => undecided(
            name,
            format!(
                "θ0 = {}: the theorem proves the decay from there on and says nothing below; it is sufficient, not necessary",
                shown(θ0)
            ),
        ),
        (None, true) => proved(name, "no θ0 was found, but the inequality holds at this θ"),
        (None, false) => undecided(name, "no θ0 was found up to 1e12 times the study's θ"),
    }
}

/// The least θ from which on a test that is passed by every larger θ holds, up to
/// a relative 1e-9 and on the side where it holds; 0 where it never fails.
pub(crate) fn first(start: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut high = start;
    let mut doublings = 0;
    while !holds(high) {
        high *= 2.0;
        doublings += 1;
        if doublings > 40 {
            return None;
        }
    }
    let mut low = high;
    for _ in 0..80 {
        low /= 2.0;
        if !holds(low) {
            break;
        }
    }
    if holds(low) {
        return Some(0.0);
    }
    while high - low > 1e-9 * high {
        let middle = 0.5 * (low + high);
        match holds(middle) {
            true => high = middle,
            false => low = middle,
        }
    }
    Some(high)
}

/// A weight further from 1 makes the overshoot larger: it has to lower θ0 by this.
const WORTHWHILE: f64 = 0.999;

/// Weights c_2, c_3, … of the chains beside c_1 = 1 for which θ0 is least, of those
/// tried, one chain after the other. Any positive weights make a proof: S and the
/// inequality it satisfies scale together.
pub(crate) fn lightest(
    chains: usize,
    at: impl Fn(&[f64]) -> Option<f64>,
) -> (Vec<f64>, Option<f64>) {
    let mut c = vec![1.0; chains];
    let mut best = at(&c);
    for step in [4.0, 1.0, 0.25, 0.0625] {
        for i in 1..chains {
            let centre = c[i];
            for k in [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0] {
                let mut trial = c.clone();
                trial[i] = centre * 10f64.powf(k * step);
                let found = at(&trial);
                if let Some(θ0) = found
                    && best.is_none_or(|b| θ0 < WORTHWHILE * b)
                {
                    (c, best) = (trial, found);
                }
            }
        }
    }
    (c, best)
}
