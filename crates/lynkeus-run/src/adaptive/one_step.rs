//! What the explicit and the implicit method have in common.

use crate::events::{Ahead, Filippov, Span};
use crate::{Dynamics, Tolerances};

/// A one-step method at work.
pub(super) trait OneStep {
    /// For systems of so many states.
    fn new(dimension: usize) -> Self;

    /// Forgets what it keeps from step to step; `careful` where nothing tells how long the next one
    /// may be.
    fn restart(&mut self, careful: bool);

    /// Takes the derivative at the start of a step; false where it is not finite.
    fn begin(&mut self, f: &mut dyn Dynamics, t: f64, x: &[f64]) -> bool;

    /// A first step for an interval of length `span`, after [`OneStep::begin`].
    fn first_step(
        &mut self,
        f: &mut dyn Dynamics,
        at: (f64, &[f64]),
        span: f64,
        tolerances: &Tolerances,
    ) -> f64;

    /// Tries a step from where [`OneStep::begin`] was called. Where it is accepted the new state is
    /// [`OneStep::reached`].
    ///
    /// # Errors
    /// The step to retry with, for a step with too large an error or a stage without finite
    /// derivative; else the step to go on with.
    fn attempt(
        &mut self,
        f: &mut dyn Dynamics,
        at: (f64, &[f64]),
        h: f64,
        tolerances: &Tolerances,
    ) -> Result<f64, f64>;

    /// The state after an accepted step.
    fn reached(&self) -> &[f64];

    /// The last point of the step under way at which a derivative was not finite.
    fn bad(&self) -> Option<&(f64, Vec<f64>)>;

    /// What comes first in the step tried last; none where a first look shows that it does not
    /// matter.
    fn ahead(&mut self, f: &mut Filippov<'_>, span: &Span<'_>) -> Option<Ahead>;
}
