//! The implicit method, driven step by step.

use super::{Adaptive, Leg, Radau, Ran};
use crate::{Dynamics, Error};

impl Adaptive {
    pub(super) fn run_implicit(
        &mut self,
        f: &mut impl Dynamics,
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
        f: &mut impl Dynamics,
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
}
