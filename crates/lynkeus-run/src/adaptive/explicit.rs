//! The explicit Dormand–Prince method of order 8 of the `differential-equations`
//! crate, driven step by step.

use std::cell::RefCell;

use differential_equations::error::Error as StepError;
use differential_equations::methods::{DormandPrince, ExplicitRungeKutta, Ordinary};
use differential_equations::ode::{ODE, OrdinaryNumericalMethod};
use differential_equations::status::Status;

use super::{Adaptive, Leg, Point, Ran};
use crate::{Dynamics, Error, Tolerances};

type Dop853 = ExplicitRungeKutta<Ordinary, DormandPrince, f64, Vec<f64>, 8, 12, 16>;

/// Dynamics as the crate wants them: shared, without errors. The last point
/// whose derivative is not finite is kept.
struct Watched<'a, D> {
    f: RefCell<&'a mut D>,
    bad: RefCell<Option<Point>>,
}

impl<D: Dynamics> ODE<f64, Vec<f64>> for Watched<'_, D> {
    fn diff(&self, t: f64, x: &Vec<f64>, dx: &mut Vec<f64>) {
        self.f.borrow_mut().derivatives(t, x, dx);
        if dx.iter().any(|v| !v.is_finite()) {
            self.bad.replace(Some((t, x.clone())));
        }
    }
}

impl Adaptive {
    pub(super) fn run_explicit(
        &mut self,
        f: &mut impl Dynamics,
        leg: &mut Leg<'_>,
    ) -> Result<Ran, Error> {
        if leg.at_the_end() || leg.x.is_empty() {
            return Ok(Ran::ToTheEnd);
        }
        let watched = Watched {
            f: RefCell::new(f),
            bad: RefCell::new(None),
        };
        let mut method = self.started(&watched, leg)?;
        loop {
            let proposed = method.h();
            let step = leg.step(proposed);
            leg.check_step(*watched.f.borrow_mut(), step, watched.bad.borrow().as_ref())?;
            leg.spend(*watched.f.borrow_mut())?;
            method.set_h(step);
            let failed = match method.step(&watched) {
                Ok(_) => false,
                // its own alarm, raised once and before the step is taken; ours decides
                Err(StepError::Stiffness { .. }) => continue,
                Err(_) => true,
            };
            let accepted = !failed && !matches!(method.status(), Status::RejectedStep);
            if failed || (accepted && method.y().iter().any(|v| !v.is_finite())) {
                self.pace.next = 0.25 * step;
                method = self.started(&watched, leg)?;
                continue;
            }
            if !accepted {
                continue;
            }
            leg.x.copy_from_slice(method.y());
            leg.t = if step == leg.to - leg.t {
                leg.to
            } else {
                method.t()
            };
            // a step cut short by a stop says nothing about the next one
            let next = if step < proposed {
                proposed.max(method.h())
            } else {
                method.h()
            };
            method.set_h(next);
            self.pace.next = next;
            watched.bad.replace(None);
            if leg.at_the_end() {
                return Ok(Ran::ToTheEnd);
            }
            if self.should_change(*watched.f.borrow_mut(), leg.t, leg.x, step) {
                return Ok(Ran::ToTheChange);
            }
        }
    }

    /// The method at the start of what is left of the leg.
    fn started<D: Dynamics>(
        &self,
        watched: &Watched<'_, D>,
        leg: &Leg<'_>,
    ) -> Result<Dop853, Error> {
        let Tolerances {
            relative, absolute, ..
        } = self.tolerances;
        let first = self.pace.next.min(leg.to - leg.t);
        let mut method = ExplicitRungeKutta::dop853()
            .rtol(relative)
            .atol(absolute)
            .h0(first)
            .max_steps(usize::MAX);
        let x = leg.x.to_vec();
        match method.init(watched, leg.t, leg.to, &x) {
            Ok(_) => Ok(method),
            Err(_) => {
                leg.check_step(*watched.f.borrow_mut(), 0.0, watched.bad.borrow().as_ref())?;
                Ok(method)
            }
        }
    }
}
