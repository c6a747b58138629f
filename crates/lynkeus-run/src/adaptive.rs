//! Error-controlled integration that chooses between an explicit and an implicit method, and ends
//! steps at the surfaces on which the right-hand side jumps or bends.

mod dop853;
mod factors;
mod one_step;
mod radau;

use crate::error::state_text;
use crate::events::{Ahead, Filippov, Span};
use crate::method::{are_finite, resolution};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Method, Result, Tolerances, spectral_radius};

use dop853::Dop853;
use one_step::OneStep;
use radau::Radau;

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

/// Steps tried to find a crossing.
const TRIES: usize = 60;

/// How often a step that is not accurate is halved on the way to a crossing.
const HALVINGS: usize = 8;

/// Error-controlled integrator; remembers its step and method between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Adaptive {
    tolerances: Tolerances,
    /// both methods may be used
    may_change: bool,
    is_implicit: bool,
    explicit: Option<Box<Dop853>>,
    implicit: Option<Box<Radau>>,
    /// step proposed for the next step; 0 before the first
    next: f64,
    /// accepted steps since the last look
    since_look: usize,
    /// looks in a row that spoke for a change
    agreeing: usize,
    /// steps granted for the interval under way, and left of them
    granted: usize,
    left: usize,
    /// steps of the run before this interval, where its end is what ends the budget
    before: usize,
    /// granted for the run so far
    of_run: usize,
    /// spent in the run before this interval
    spent: usize,
}

/// Progress of one call.
struct Leg<'a, 'f> {
    f: &'a mut Filippov<'f>,
    t: f64,
    to: f64,
    x: &'a mut [f64],
}

/// A step, where it ends, and how far the surfaces are there.
struct Reach {
    step: f64,
    x: Vec<f64>,
    margins: Vec<f64>,
}

impl Adaptive {
    /// With the methods that `method` allows.
    pub(crate) fn new(method: Method, tolerances: Tolerances) -> Self {
        Self {
            tolerances,
            may_change: matches!(method, Method::Adaptive(_)),
            is_implicit: matches!(method, Method::Stiff(_)),
            of_run: STEPS_PER_RUN,
            ..Self::default()
        }
    }

    /// Grants the budget of an interval with `stops` switches in it.
    pub(crate) fn grant(&mut self, stops: usize) {
        self.spent += self.granted.saturating_sub(self.left);
        let for_stops = stops.saturating_mul(STEPS_PER_STOP);
        let more = for_stops.saturating_add(STEPS_PER_INTERVAL);
        self.of_run = self.of_run.saturating_add(more);
        let left = self.of_run.saturating_sub(self.spent);
        let own = for_stops.saturating_add(self.tolerances.budget);
        self.granted = own.min(left);
        self.left = self.granted;
        self.before = if left < own { self.spent } else { 0 };
    }

    /// Takes `x` from `from` to `to`, over which `f` is smooth, on what is left of
    /// the budget. Where an error ends it early, `x` is the last state reached.
    pub(crate) fn advance(
        &mut self,
        f: &mut Filippov<'_>,
        from: f64,
        to: f64,
        x: &mut [f64],
    ) -> Result<()> {
        let mut leg = Leg { f, t: from, to, x };
        if leg.at_the_end() || leg.x.is_empty() {
            return leg.check_start();
        }
        loop {
            let is_done = match self.is_implicit {
                true => self.run(&mut leg, |own| &mut own.implicit)?,
                false => self.run(&mut leg, |own| &mut own.explicit)?,
            };
            if is_done {
                return Ok(());
            }
            self.is_implicit = !self.is_implicit;
        }
    }

    /// True every so often, where the other method is the better one.
    fn should_change(&mut self, leg: &mut Leg<'_, '_>, step: f64) -> bool {
        self.since_look += 1;
        if !self.may_change || self.since_look < LOOK_EVERY {
            return false;
        }
        self.since_look = 0;
        let product = spectral_radius(leg.f, leg.t, leg.x) * step;
        self.agreeing = match self.is_implicit {
            true if product < STIFF_BELOW => self.agreeing + 1,
            false if product > STIFF_ABOVE => self.agreeing + 1,
            _ => 0,
        };
        let changes = self.agreeing >= LOOKS;
        self.agreeing %= LOOKS;
        changes
    }

    /// Steps of one of the methods; false where the other one fits better from there.
    fn run<M: OneStep>(
        &mut self,
        leg: &mut Leg<'_, '_>,
        of: fn(&mut Self) -> &mut Option<Box<M>>,
    ) -> Result<bool> {
        let new = || Box::new(M::new(leg.x.len()));
        let mut method = of(self).take().unwrap_or_else(new);
        method.restart(true);
        let is_done = self.steps(&mut *method, leg);
        *of(self) = Some(method);
        is_done
    }

    fn steps(&mut self, method: &mut impl OneStep, leg: &mut Leg<'_, '_>) -> Result<bool> {
        let tolerances = self.tolerances;
        if !self.is_implicit {
            self.next = self.next.min(leg.to - leg.t);
        }
        loop {
            if !method.begin(leg.f, leg.t, leg.x) {
                return Err(leg.f.not_finite(leg.t, leg.x));
            }
            if self.next == 0.0 {
                let span = leg.to - leg.t;
                self.next = method.first_step(leg.f, (leg.t, leg.x), span, &tolerances);
            }
            let mut step = self.accepted_step(method, leg)?;
            match leg.f.is_unwatched() {
                true => leg.x.copy_from_slice(method.reached()),
                false => step = self.up_to_event(method, leg, step)?,
            }
            leg.pass(step);
            if leg.f.has_event() && leg.f.event(leg.t, leg.x)? {
                method.restart(true);
            }
            if leg.at_the_end() {
                return Ok(true);
            }
            if self.should_change(leg, step) {
                return Ok(false);
            }
        }
    }

    /// Shortens the proposed step until it is accepted, and proposes the next one.
    fn accepted_step(&mut self, method: &mut impl OneStep, leg: &mut Leg<'_, '_>) -> Result<f64> {
        loop {
            let proposed = self.next;
            let step = leg.step(proposed);
            leg.check_step(step, method.bad())?;
            self.spend(leg)?;
            match method.attempt(leg.f, (leg.t, &*leg.x), step, &self.tolerances) {
                Err(shorter) => self.next = shorter,
                Ok(next) => {
                    // a step cut short by a stop says nothing about the next one
                    self.next = match step < proposed {
                        true => proposed.max(next),
                        false => next,
                    };
                    return Ok(step);
                }
            }
        }
    }

    /// Takes the step that was just accepted, or a shorter one up to the first surface or bend in it:
    /// the step up to there.
    fn up_to_event(
        &mut self,
        method: &mut impl OneStep,
        leg: &mut Leg<'_, '_>,
        step: f64,
    ) -> Result<f64> {
        let (t, start, reached) = (leg.t, leg.x.to_vec(), method.reached().to_vec());
        let span = Span {
            from: (t, &start),
            step,
            to: &reached,
        };
        let ahead = method.ahead(leg.f, &span);
        let (tolerances, mut has_tried) = (self.tolerances, false);
        let attempt = |f: &mut Filippov<'_>, step: f64| {
            has_tried = true;
            method.restart(true);
            let tried = method.begin(f, t, &start)
                && method.attempt(f, (t, &start), step, &tolerances).is_ok();
            tried.then(|| method.reached().to_vec())
        };
        let event = match ahead.is_some() || leg.f.has_bound() {
            true => self.crossing(leg, &span, ahead.unwrap_or(Ahead::Nothing), attempt)?,
            false => None,
        };
        if has_tried || event.is_some() {
            // what it keeps is of the steps tried, or of the other side
            method.restart(false);
        }
        let Some(event) = event else {
            leg.x.copy_from_slice(&reached);
            return Ok(step);
        };
        leg.x.copy_from_slice(&event.x);
        leg.f.pass(t + event.step, &event.x, &event.margins);
        Ok(event.step)
    }

    /// Pays for one step.
    fn spend(&mut self, leg: &mut Leg<'_, '_>) -> Result<()> {
        if leg.f.is_over() {
            return Err(Error::Cancelled { time: leg.t });
        }
        if self.left == 0 {
            return Err(Error::StepBudget {
                time: leg.t,
                until: leg.to,
                steps: self.before + self.granted,
                chatters: leg.f.busiest().unwrap_or_default(),
                state: state_text(&leg.f.names(), leg.x),
            });
        }
        self.left -= 1;
        Ok(())
    }

    /// The shortest step found that crosses a surface, where the step taken does; `attempt`
    /// makes a step of another length from the same start, and `ahead` is what comes first in it.
    /// None where nothing comes. A step that leads up to it where something bends, or where none
    /// across the surface is accurate.
    fn crossing(
        &mut self,
        leg: &mut Leg<'_, '_>,
        span: &Span<'_>,
        ahead: Ahead,
        mut attempt: impl FnMut(&mut Filippov<'_>, f64) -> Option<Vec<f64>>,
    ) -> Result<Option<Reach>> {
        let (t, step) = (span.from.0, span.step);
        let reach = |f: &mut Filippov<'_>, step: f64, x: Vec<f64>| {
            let margins = f.margins(t + step, &x);
            Reach { step, x, margins }
        };
        let fine = 4.0 * resolution(t + step).max(1e-14 * step);
        let mut end = reach(leg.f, step, span.to.to_vec());
        // the end of the step is across; or another one before it is, or leads up to what comes
        let shorter = match ahead {
            Ahead::Nothing if !end.crosses() => return Ok(None),
            Ahead::Jump { beyond, .. } if beyond < 1.0 || !end.crosses() => Some(beyond),
            Ahead::Stop { at } => Some(at),
            Ahead::Nothing | Ahead::Jump { .. } => None,
        };
        if let Some(part) = shorter {
            let mut shorter = (part * step).max(fine);
            for _ in 0..HALVINGS {
                self.spend(leg)?;
                if let Some(x) = attempt(leg.f, shorter) {
                    end = reach(leg.f, shorter, x);
                    break;
                }
                shorter *= 0.5;
            }
            if !end.crosses() {
                return Ok((end.step < step).then_some(end));
            }
        }
        let mut told = match ahead {
            Ahead::Jump { at, .. } => Some(at * step + 0.5 * fine),
            Ahead::Nothing | Ahead::Stop { .. } => None,
        };
        let mut begin = reach(leg.f, 0.0, span.from.1.to_vec());
        let mut rejected = None;
        for turn in 0..TRIES {
            let width = end.step - begin.step;
            if width <= fine {
                break;
            }
            let guess = match turn % 3 {
                _ if let Some(longest) = rejected => begin.step + 0.5 * (longest - begin.step),
                0 if let Some(told) = told.take().filter(|told| *told < end.step) => told,
                2 => begin.step + 0.5 * width,
                _ => between(&begin, &end, fine),
            };
            self.spend(leg)?;
            let Some(x) = attempt(leg.f, guess) else {
                // the step that crosses may be accurate and this one not, where what is not
                // held bends on the surface: shorter ones lead up to it
                rejected = Some(guess);
                continue;
            };
            let tried = reach(leg.f, guess, x);
            match tried.crosses() {
                true => (end, rejected) = (tried, None),
                false => begin = tried,
            }
            if rejected.is_some() && begin.step > fine {
                return Ok(Some(begin));
            }
        }
        Ok(Some(end))
    }
}

/// Both methods start anew on every leg: between two of them only pace and budget stay.
impl Persist for Adaptive {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.flag(&mut self.is_implicit)?;
        walk.number(&mut self.next)?;
        walk.count(&mut self.since_look)?;
        walk.count(&mut self.agreeing)?;
        walk.count(&mut self.granted)?;
        walk.count(&mut self.left)?;
        walk.count(&mut self.before)?;
        walk.count(&mut self.of_run)?;
        walk.count(&mut self.spent)
    }
}

impl Leg<'_, '_> {
    /// Steps end here: what is left is below the resolution of time.
    fn at_the_end(&self) -> bool {
        self.to - self.t <= resolution(self.to)
    }

    /// The step to take: the proposed one, or what ends the leg without a
    /// tiny step at its end.
    fn step(&self, proposed: f64) -> f64 {
        match self.to - self.t {
            left if proposed >= left => left,
            left if proposed > 0.5 * left => 0.5 * left,
            _ => proposed,
        }
    }

    /// Time goes on by a step.
    fn pass(&mut self, step: f64) {
        self.t = match step == self.to - self.t {
            true => self.to,
            false => self.t + step,
        };
    }

    fn check_start(&mut self) -> Result<()> {
        let mut dx = vec![0.0; self.x.len()];
        self.f.derivatives(self.t, self.x, &mut dx);
        if are_finite(&dx) {
            return Ok(());
        }
        Err(self.f.not_finite(self.t, self.x))
    }

    fn check_step(&mut self, step: f64, bad: Option<&(f64, Vec<f64>)>) -> Result<()> {
        if step > resolution(self.t) {
            return Ok(());
        }
        Err(match bad {
            Some((t, x)) => self.f.not_finite(*t, x),
            None => Error::StepUnderflow {
                time: self.t,
                step,
                state: state_text(&self.f.names(), self.x),
            },
        })
    }
}

impl Reach {
    fn crosses(&self) -> bool {
        self.margins.iter().any(|&margin| margin < 0.0)
    }
}

/// Where the first of the surfaces is crossed if their margins change evenly, a little beyond.
fn between(begin: &Reach, end: &Reach, fine: f64) -> f64 {
    let width = end.step - begin.step;
    let zero = |(a, b): (&f64, &f64)| match *b < 0.0 {
        true if *a > 0.0 => a / (a - b),
        true => 0.0,
        false => 1.0,
    };
    let pairs = begin.margins.iter().zip(&end.margins);
    let first = pairs.map(zero).fold(1.0, f64::min);
    let at = begin.step + first * width + 0.5 * fine;
    at.clamp(begin.step + 0.25 * fine, end.step - 0.25 * fine)
}
