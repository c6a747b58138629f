//! The implicit method, driven step by step.

use super::crossing::Reach;
use super::{Adaptive, Leg, Point, Radau, Ran};
use crate::relays::{Ahead, Span, Switched};
use crate::{Dynamics, Error};

impl Adaptive {
    pub(super) fn run_implicit(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
    ) -> Result<Ran, Error> {
        if leg.at_the_end() || leg.x.is_empty() {
            return Ok(Ran::ToTheEnd);
        }
        let n = leg.x.len();
        let mut radau = self.radau.take().unwrap_or_else(|| Radau::new(n));
        radau.restart(f, leg.t, leg.x);
        let ran = self.steps(f, leg, &mut radau);
        self.radau = Some(radau);
        ran
    }

    fn steps(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
        radau: &mut Radau,
    ) -> Result<Ran, Error> {
        if self.pace.next <= 0.0 {
            self.pace.next = radau.first_step(leg, &self.tolerances);
        }
        let mut rejected = true;
        loop {
            let proposed = self.pace.next;
            let step = leg.step(proposed);
            leg.check_step(f, step, radau.bad.as_ref())?;
            leg.spend(f)?;
            let start = leg.x.to_vec();
            let (accepted, next) = radau.attempt(f, leg, step, rejected, &self.tolerances);
            self.pace.next = next;
            if !accepted {
                rejected = true;
                continue;
            }
            // after a rejection the step must not grow at once
            if rejected {
                self.pace.next = next.min(step);
            }
            // a step cut short by a stop says nothing about the next one
            if step < proposed {
                self.pace.next = self.pace.next.max(proposed);
            }
            rejected = false;
            let step = match f.is_unwatched() {
                true => step,
                false => self.up_to_meeting(f, leg, radau, &start, step)?,
            };
            leg.t = if step == leg.to - leg.t {
                leg.to
            } else {
                leg.t + step
            };
            if leg.at_the_end() {
                return Ok(Ran::ToTheEnd);
            }
            radau.bad = None;
            if self.should_change(f, leg.t, leg.x, step) {
                return Ok(Ran::ToTheChange);
            }
        }
    }

    /// Where the step that was just taken meets a surface or a bend, goes back to the first: the
    /// step up to there.
    fn up_to_meeting(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        leg: &mut Leg<'_>,
        radau: &mut Radau,
        start: &[f64],
        step: f64,
    ) -> Result<f64, Error> {
        let (reached, t, to, tolerances) = (leg.x.to_vec(), leg.t, leg.to, self.tolerances);
        let span = Span {
            from: (t, start),
            step,
            to: &reached,
        };
        let ahead = f.ahead(&span, |state| radau.between(state, start[state]));
        if ahead == Ahead::Nothing && !f.has_bound() {
            return Ok(step);
        }
        let purse = leg.purse;
        let mut has_tried = false;
        let attempt = |f: &mut Switched<'_, _>, step: f64, _: &mut Option<Point>| {
            has_tried = true;
            let mut x = start.to_vec();
            let mut again = Leg {
                t,
                to,
                x: &mut x,
                purse,
            };
            radau.restart(f, t, again.x);
            let (accepted, _) = radau.attempt(f, &mut again, step, true, &tolerances);
            accepted.then_some(x)
        };
        let crossing = self.crossing(f, leg, &span, ahead, attempt)?;
        let Some(Reach { step, x, margins }) = crossing else {
            if has_tried {
                // what it keeps is of the steps tried
                radau.restart(f, t + step, leg.x);
            }
            return Ok(step);
        };
        leg.x.copy_from_slice(&x);
        f.pass(t + step, &x, &margins);
        radau.restart(f, t + step, &x);
        Ok(step)
    }
}
