//! Runs of tunings that may be worth nothing.

use lynkeus_run::{Method, Tolerances};

/// Most steps of an adaptive method from one row to the next: so many over the whole run, in equal
/// parts, but never fewer than the second number.
const STEPS: f64 = 5e5;
const STEPS_PER_ROW: f64 = 500.0;

/// The method with fewer steps than it would take: an estimate on its way to infinity is then
/// given up in time. What is left is enough for any observer worth having.
pub fn thrifty(method: Method, rows: f64) -> Method {
    let most = (STEPS / rows.max(1.0)).max(STEPS_PER_ROW) as usize;
    let fewer = |t: Tolerances| Tolerances {
        budget: t.budget.min(most),
        ..t
    };
    match method {
        Method::Adaptive(t) => Method::Adaptive(fewer(t)),
        Method::Explicit(t) => Method::Explicit(fewer(t)),
        Method::Stiff(t) => Method::Stiff(fewer(t)),
        fixed => fixed,
    }
}
