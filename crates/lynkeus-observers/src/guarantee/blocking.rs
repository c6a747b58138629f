//! Why there is no proof, or no gain: which range stands in the way.

use std::time::Duration;

use lynkeus_expr::Budget;
use lynkeus_proof::decay::{self, ErrorModel, Request};
use lynkeus_structure::{Slopes, short};

use super::error_system::ErrorSystem;
use super::expanded;

/// Bisections of the share of the ranges.
const HALVINGS: usize = 6;
/// The smallest share tried.
const LEAST: f64 = 0.01;
/// Slopes up to which each is tried alone.
const SINGLES: usize = 12;
/// What an explanation may take.
const EXPLAINING: Duration = Duration::from_secs(15);

/// The models with every slope's range cut by a factor that may depend on the slope.
fn cut(slopes: &Slopes, factor: impl Fn(usize) -> f64 + Copy) -> Vec<ErrorModel> {
    let cut: Vec<ErrorModel> = slopes.models.iter().map(|m| m.shrunk(factor)).collect();
    expanded(&cut)
}

/// The largest share of every range, about its middle, for which `works`; none where
/// not even a hundredth works.
fn share(slopes: &Slopes, works: impl Fn(&[ErrorModel]) -> bool) -> Option<f64> {
    let at = |share: f64| works(&cut(slopes, |_| share));
    let (mut low, mut high) = (LEAST, 1.0);
    if !at(low) {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        match at(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(low)
}

/// The share of the ranges for which some decay of the observer is proved.
///
/// None where the budget ends.
pub(super) fn provable_share(system: &ErrorSystem, budget: &Budget) -> Option<f64> {
    let share = share(&system.slopes, |models| {
        decay::prove(models, &system.scale, 0.0, budget).is_some()
    });
    share.filter(|_| budget.marked().is_none())
}

/// In words: what keeps every gain from a proof of the requested rate.
pub(super) fn reason(system: &ErrorSystem, request: &Request) -> String {
    let slopes = &system.slopes;
    let request = &Request {
        budget: request.budget.within(EXPLAINING),
        ..request.clone()
    };
    let works = |models: &[ErrorModel]| decay::is_reachable(models, request, true);
    // that there is none at all is said of a thorough look only
    let least = || decay::is_reachable(&cut(slopes, |_| LEAST), request, false);
    let share = share(slopes, works).or_else(|| least().then_some(LEAST));
    if request.budget.marked().is_some() {
        return "which range stands in the way takes longer to find out: narrow the box or lower the rate".into();
    }
    let Some(share) = share else {
        return "not even the linearisation in the middle of the box reaches it: a state leaves too weak a trace in the outputs, or the rate is beyond what they allow".into();
    };
    let range = |k: usize| {
        let slope = &slopes.slopes[k];
        format!(
            "the slope of {} in [{}, {}]{}",
            slope.term,
            short(slope.range.lo()),
            short(slope.range.hi()),
            match slope.variables.is_empty() {
                true => String::new(),
                false => format!(" (over the range of {})", slope.variables.join(", ")),
            }
        )
    };
    // one inequality per slope is affordable only for few
    let tried = match slopes.slopes.len() {
        few if few <= SINGLES => few,
        _ => 0,
    };
    let mut blocking =
        (0..tried).filter(|&only| works(&cut(slopes, |k| if k == only { 0.0 } else { 1.0 })));
    let blocked = match blocking.next() {
        Some(k) => format!("{} alone blocks it; ", range(k)),
        None => String::new(),
    };
    format!(
        "{blocked}with every slope's range cut to {:.0} % about its middle there is a gain: narrow the box",
        100.0 * share
    )
}
