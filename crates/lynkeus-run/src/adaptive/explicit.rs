//! The explicit method, step by step to the end of a leg.

use super::crossing::Reach;
use super::dop853::{Dop853, Tried};
use super::{Adaptive, Leg, Point, Ran, resolution};
use crate::relays::Switched;
use crate::{Dynamics, Error};

impl Adaptive {
    pub(super) fn run_explicit(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
    ) -> Result<Ran, Error> {
        if leg.at_the_end() || leg.x.is_empty() {
            leg.check_start(f)?;
            return Ok(Ran::ToTheEnd);
        }
        let mut method = match self.explicit.take() {
            Some(method) => method,
            None => Box::new(Dop853::new(leg.x.len())),
        };
        let ran = self.run_with(&mut method, f, leg);
        self.explicit = Some(method);
        ran
    }

    fn run_with(
        &mut self,
        method: &mut Dop853,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
    ) -> Result<Ran, Error> {
        let tolerances = self.tolerances;
        // the last point at which the derivative is not finite
        let mut bad: Option<Point> = None;
        self.pace.next = self.pace.next.min(leg.to - leg.t);
        loop {
            if !method.begin(f, leg.t, leg.x) {
                return Err(f.not_finite(leg.t, leg.x));
            }
            if self.pace.next == 0.0 {
                let span = leg.to - leg.t;
                let first = method.first_step(f, (leg.t, leg.x), span, &tolerances);
                // a guess that time does not resolve is too careful: it may be longer all the same
                self.pace.next = first.max(2.0 * resolution(leg.t)).min(span);
            }
            let mut step = self.accepted_step(method, f, leg, &mut bad)?;
            let (start, reached) = (leg.x.to_vec(), method.reached().to_vec());
            let (t, tolerances) = (leg.t, self.tolerances);
            let attempt = |f: &mut Switched<'_, _>, step: f64, bad: &mut Option<Point>| {
                let tried = method.attempt(f, (t, &start), step, &tolerances, bad);
                matches!(tried, Tried::Accepted(_)).then(|| method.reached().to_vec())
            };
            let crossing = self.crossing(f, leg, &start, (step, &reached), attempt)?;
            leg.x
                .copy_from_slice(crossing.as_ref().map_or(&reached, |crossing| &crossing.x));
            if let Some(Reach {
                step: shorter,
                x,
                margins,
            }) = &crossing
            {
                step = *shorter;
                f.pass(leg.t + step, x, margins);
            }
            leg.t = if step == leg.to - leg.t {
                leg.to
            } else {
                leg.t + step
            };
            bad = None;
            if leg.at_the_end() {
                return Ok(Ran::ToTheEnd);
            }
            if self.should_change(f, leg.t, leg.x, step) {
                return Ok(Ran::ToTheChange);
            }
        }
    }

    /// Shortens the proposed step until it is accepted, and proposes the next one.
    fn accepted_step(
        &mut self,
        method: &mut Dop853,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
        bad: &mut Option<Point>,
    ) -> Result<f64, Error> {
        loop {
            let proposed = self.pace.next;
            let step = leg.step(proposed);
            leg.check_step(f, step, bad.as_ref())?;
            leg.spend(f)?;
            let start = (leg.t, &*leg.x);
            match method.attempt(f, start, step, &self.tolerances, bad) {
                Tried::Rejected(factor) => self.pace.next = step * factor,
                Tried::Accepted(factor) => {
                    let next = step * factor;
                    // a step cut short by a stop says nothing about the next one
                    self.pace.next = if step < proposed {
                        proposed.max(next)
                    } else {
                        next
                    };
                    return Ok(step);
                }
            }
        }
    }
}
