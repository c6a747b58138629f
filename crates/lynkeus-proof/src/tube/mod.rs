//! Verified reach tubes: where every solution of x' = f(t, x, p, u) is, from a start set.
//!
//! x(t₀) lies in a box, p are unknown *constants* in ranges, u are *inputs* that vary measurably
//! within ranges, as fast as they like. A step from t₀ to t₀ + h writes, with τ = (t − t₀)/h,
//!
//! x(τ) = P(s, q, τ) + e(τ), |e| ≤ I,
//!
//! where s ∈ [−1, 1] are symbols of the start set and of p, and q ∈ [−1, 1]ⁿ those of a remainder,
//! one per state. The proof of a step is one inequality, by Taylor models (Makino and Berz): if
//!
//! x₀(s, q) + h ∫₀^τ f(t, P + [−I, I], p(s), u) dτ is within P + [−I', I'] with I' < I,
//!
//! then every solution is, for all of the step. For it starts in P + [−I, I], and where it came to
//! the border it would be within I' by the integral itself. That needs neither a unique solution nor
//! a smooth f: what bends is enclosed, and where f jumps, so are all values between both sides, and
//! with them the solutions of Filippov. What proposes P, I and h is free to be wrong.
//!
//! Between steps the set is p₀(s) + G ξ, a polynomial and a zonotope, ξ ∈ [−1, 1]ᵐ. A step takes
//! d ∘ q for Gξ, with d the sums of G's rows; what comes back linear in q is multiplied to G, all
//! else becomes new columns (`zonotope.rs`). [`Sampled`] jumps between flows.

mod algebra;
mod model;
mod ring;
mod sampled;
mod step;
#[cfg(test)]
mod tests;
mod zonotope;

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Spent};

pub use sampled::{Sampled, See};
use step::Stepper;
pub use step::{Problem, Segment};

/// Why a tube ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// at the time that was asked for
    Reached,
    /// no step from here could be proved
    Stuck,
    /// whoever looked at the segments wanted no more
    Stopped,
    /// by a limit
    Spent(Spent),
}

/// Integrates until a time, shows every segment, and says where and why it ended.
///
/// Everything that it shows is proved: up to the end of a segment every solution from the start set
/// exists and lies in the segments.
///
/// ```
/// use std::ops::ControlFlow;
/// use lynkeus_expr::{Budget, Graph, Interval, Tape};
/// use lynkeus_proof::tube::{End, Problem, reach};
///
/// // x' = −x + u with x(0) in [1, 2] and |u(t)| ≤ 0.1
/// let g = Graph::new();
/// let [x, t, u] = ["x", "t", "u"].map(|name| g.symbol(name));
/// let inputs = [x, t, u].map(|symbol| symbol.node());
/// let problem = Problem {
///     right: Tape::new(&g, &inputs, &[(u - x).node()])?,
///     from: 0.0,
///     start: vec![Interval::new(1.0, 2.0).unwrap()],
///     constants: vec![],
///     inputs: vec![Interval::new(-0.1, 0.1).unwrap()],
/// };
/// let mut last = None;
/// let (end, time) = reach(&problem, 1.0, &Budget::default(), &mut |segment| {
///     last = Some(segment.end()[0]);
///     ControlFlow::Continue(())
/// });
/// assert_eq!((end, time), (End::Reached, 1.0));
/// // between e⁻¹ − 0.1(1 − e⁻¹) and 2e⁻¹ + 0.1(1 − e⁻¹)
/// let last = last.unwrap();
/// assert!(last.lo() > 0.29 && last.lo() < 0.3046 && last.hi() > 0.7990 && last.hi() < 0.81);
/// # Ok::<(), lynkeus_expr::MissingInput>(())
/// ```
pub fn reach(
    problem: &Problem,
    until: f64,
    budget: &Budget,
    see: &mut dyn FnMut(&Segment) -> ControlFlow<()>,
) -> (End, f64) {
    let mut stepper = Stepper::new(problem, until);
    while stepper.time() < until {
        let found = stepper.step(budget);
        if let Some(spent) = budget.spent() {
            return (End::Spent(spent), stepper.time());
        }
        let Some(segment) = found else {
            return (End::Stuck, stepper.time());
        };
        let stop = see(&segment).is_break();
        stepper.take(segment.into_end());
        if stop {
            return (End::Stopped, stepper.time());
        }
    }
    (End::Reached, stepper.time())
}
