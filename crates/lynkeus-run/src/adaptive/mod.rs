//! Error-controlled integration that chooses between an explicit and an
//! implicit method.

mod crossing;
mod dop853;
mod explicit;
mod implicit;
mod radau;

use crate::error::state_text;
use crate::relays::Switched;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Tolerances, spectral_radius};

use dop853::Dop853;
use radau::Radau;

/// Which methods may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Choice {
    Auto,
    Explicit,
    Stiff,
}

/// Accepted steps between two looks at the spectral radius.
const LOOK_EVERY: usize = 40;

/// Looks in a row that must agree before the method changes.
const LOOKS: usize = 2;

/// Products of step and spectral radius: above the first the explicit method
/// (stable to about 6) is held back by stability; below the second the implicit
/// one is not worth its linear algebra.
const STIFF_ABOVE: f64 = 3.0;
const STIFF_BELOW: f64 = 1.0;

/// Steps granted for each stop at a switch, beyond the budget of the interval.
const STEPS_PER_STOP: usize = 20;

/// Steps granted for a whole run, and for each of its intervals beside them: what is
/// harder from row to row than the budget of a row shows ends within seconds.
const STEPS_PER_RUN: usize = 300_000;
const STEPS_PER_INTERVAL: usize = 200;

/// Error-controlled integrator; remembers its step and method between calls.
#[derive(Clone, Debug)]
pub(crate) struct Adaptive {
    choice: Choice,
    tolerances: Tolerances,
    implicit: bool,
    explicit: Option<Box<Dop853>>,
    radau: Option<Radau>,
    pace: Pace,
    purse: Purse,
    run: Run,
}

/// Steps of the interval under way.
#[derive(Clone, Copy, Debug, Default)]
struct Purse {
    granted: usize,
    left: usize,
    /// steps of the run before this interval, where its end is what ends the budget
    before: usize,
}

/// Steps of the run.
#[derive(Clone, Copy, Debug)]
struct Run {
    granted: usize,
    spent: usize,
}

/// What is known about the steps that the solution wants.
#[derive(Clone, Copy, Debug, Default)]
struct Pace {
    /// step proposed for the next step; 0 before the first
    next: f64,
    /// accepted steps since the last look
    since_look: usize,
    /// looks in a row that spoke for a change
    agreeing: usize,
}

/// A time and a state.
type Point = (f64, Vec<f64>);

/// Why a method returned without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ran {
    ToTheEnd,
    /// the other method fits better from here
    ToTheChange,
}

/// Progress of one call: where it is and what it may still spend.
#[derive(Debug)]
struct Leg<'a> {
    t: f64,
    to: f64,
    x: &'a mut [f64],
    purse: Purse,
}

impl Adaptive {
    pub(crate) fn new(choice: Choice, tolerances: Tolerances) -> Self {
        Self {
            choice,
            tolerances,
            implicit: choice == Choice::Stiff,
            explicit: None,
            radau: None,
            pace: Pace::default(),
            purse: Purse::default(),
            run: Run {
                granted: STEPS_PER_RUN,
                spent: 0,
            },
        }
    }

    /// Grants the budget of an interval with `stops` switches in it.
    pub(crate) fn grant(&mut self, stops: usize) {
        self.run.spent += self.purse.granted.saturating_sub(self.purse.left);
        let for_stops = stops.saturating_mul(STEPS_PER_STOP);
        let more = for_stops.saturating_add(STEPS_PER_INTERVAL);
        self.run.granted = self.run.granted.saturating_add(more);
        let left = self.run.granted.saturating_sub(self.run.spent);
        let own = for_stops.saturating_add(self.tolerances.budget);
        let granted = own.min(left);
        self.purse = Purse {
            granted,
            left: granted,
            before: if left < own { self.run.spent } else { 0 },
        };
    }

    /// Takes `x` from `from` to `to`, over which `f` is smooth, on what is left of
    /// the budget. Where an error ends it early, `x` is the last state reached.
    pub(crate) fn advance(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        from: f64,
        to: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let mut leg = Leg {
            t: from,
            to,
            x,
            purse: self.purse,
        };
        loop {
            let ran = if self.implicit {
                leg.check_start(f)?;
                self.run_implicit(f, &mut leg)?
            } else {
                self.run_explicit(f, &mut leg)?
            };
            self.purse = leg.purse;
            if ran == Ran::ToTheEnd {
                return Ok(());
            }
            self.implicit = !self.implicit;
        }
    }

    /// True every so often, where the other method is the better one.
    fn should_change(
        &mut self,
        f: &mut Switched<'_, impl Dynamics>,
        t: f64,
        x: &[f64],
        step: f64,
    ) -> bool {
        self.pace.since_look += 1;
        if self.choice != Choice::Auto || self.pace.since_look < LOOK_EVERY {
            return false;
        }
        self.pace.since_look = 0;
        let product = spectral_radius(f, t, x) * step;
        let speaks_for_change = if self.implicit {
            product < STIFF_BELOW
        } else {
            product > STIFF_ABOVE
        };
        self.pace.agreeing = if speaks_for_change {
            self.pace.agreeing + 1
        } else {
            0
        };
        let change = self.pace.agreeing >= LOOKS;
        if change {
            self.pace.agreeing = 0;
        }
        change
    }
}

/// Both methods start anew on every leg: between two of them only pace and budget stay.
impl Persist for Adaptive {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.flag(&mut self.implicit)?;
        walk.number(&mut self.pace.next)?;
        walk.count(&mut self.pace.since_look)?;
        walk.count(&mut self.pace.agreeing)?;
        walk.count(&mut self.purse.granted)?;
        walk.count(&mut self.purse.left)?;
        walk.count(&mut self.purse.before)?;
        walk.count(&mut self.run.granted)?;
        walk.count(&mut self.run.spent)
    }
}

impl Leg<'_> {
    /// Steps end here: what is left is below the resolution of time.
    fn at_the_end(&self) -> bool {
        self.to - self.t <= resolution(self.to)
    }

    /// The step to take: the proposed one, or what ends the leg without a
    /// tiny step at its end.
    fn step(&self, proposed: f64) -> f64 {
        let left = self.to - self.t;
        if proposed >= left {
            left
        } else if proposed > 0.5 * left {
            0.5 * left
        } else {
            proposed
        }
    }

    fn check_start(&self, f: &mut Switched<'_, impl Dynamics>) -> Result<(), Error> {
        let mut dx = vec![0.0; self.x.len()];
        f.derivatives(self.t, self.x, &mut dx);
        if dx.iter().all(|v| v.is_finite()) {
            return Ok(());
        }
        Err(f.not_finite(self.t, self.x))
    }

    /// Pays for one step.
    fn spend(&mut self, f: &mut Switched<'_, impl Dynamics>) -> Result<(), Error> {
        if f.is_over() {
            return Err(Error::Cancelled { time: self.t });
        }
        if self.purse.left == 0 {
            return Err(Error::StepBudget {
                time: self.t,
                until: self.to,
                steps: self.purse.before + self.purse.granted,
                chatters: f.busiest().unwrap_or_default(),
                state: state_text(&f.names(), self.x),
            });
        }
        self.purse.left -= 1;
        Ok(())
    }

    fn check_step(
        &self,
        f: &mut Switched<'_, impl Dynamics>,
        step: f64,
        bad: Option<&Point>,
    ) -> Result<(), Error> {
        if step > resolution(self.t) {
            return Ok(());
        }
        Err(match bad {
            Some((t, x)) => f.not_finite(*t, x),
            None => Error::StepUnderflow {
                time: self.t,
                step,
                state: state_text(&f.names(), self.x),
            },
        })
    }
}

/// Steps shorter than this do not move time reliably.
pub(crate) fn resolution(t: f64) -> f64 {
    (16.0 * f64::EPSILON * t.abs()).max(f64::MIN_POSITIVE)
}
