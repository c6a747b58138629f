//! The explicit method, step by step to the end of a leg.

use super::dop853::{Dop853, Tried};
use super::{Adaptive, Leg, Point, Ran, resolution};
use crate::relays::{Ahead, Glance, Span, Switched};
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
            if f.is_unwatched() {
                leg.x.copy_from_slice(method.reached());
            } else {
                step = self.up_to_event(method, f, leg, step)?;
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

    /// Takes the step that was just accepted, or a shorter one up to the first surface or bend in it: the
    /// step up to there.
    fn up_to_event(
        &mut self,
        method: &mut Dop853,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
        step: f64,
    ) -> Result<f64, Error> {
        let glance = f.glance(
            &Span {
                from: (leg.t, leg.x),
                step,
                to: method.reached(),
            },
            |state| method.fastest(state),
        );
        if glance == Glance::Clear {
            leg.x.copy_from_slice(method.reached());
            return Ok(step);
        }
        let (start, reached) = (leg.x.to_vec(), method.reached().to_vec());
        let (t, tolerances) = (leg.t, self.tolerances);
        let span = Span {
            from: (t, &start),
            step,
            to: &reached,
        };
        let ahead = match glance {
            Glance::Near if method.look_inside(f, (t, &start), step) => {
                f.ahead(&span, |state| method.between(state, start[state], step))
            }
            _ => Ahead::Nothing,
        };
        let attempt = |f: &mut Switched<'_, _>, step: f64, bad: &mut Option<Point>| {
            let tried = method.attempt(f, (t, &start), step, &tolerances, bad);
            matches!(tried, Tried::Accepted(_)).then(|| method.reached().to_vec())
        };
        let Some(event) = self.crossing(f, leg, &span, ahead, attempt)? else {
            leg.x.copy_from_slice(&reached);
            return Ok(step);
        };
        leg.x.copy_from_slice(&event.x);
        f.pass(t + event.step, &event.x, &event.margins);
        Ok(event.step)
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
