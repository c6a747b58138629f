//! One integrator for every method, stopping at every event of time; and the classical Runge–Kutta
//! method with fixed steps.

use crate::adaptive::Adaptive;
use crate::divergence::{diverged, largest};
use crate::events::{Filippov, Memory, Seen, Sides, occur};
use crate::method::{are_finite, resolution};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Method, Result, Step, spectral_radius};

/// Most fixed steps in one interval.
const MOST_STEPS: usize = 1_000_000;

/// |λ|·h of automatic fixed steps; the method is stable up to about 2.7.
pub(crate) const AUTO_PRODUCT: f64 = 0.5;

/// Intervals after which the automatic fixed step looks at the Jacobian again.
const LOOK_EVERY: usize = 32;

/// How often an interval that fails is tried again with a quarter of the step.
const RETRIES: usize = 3;

/// A fixed step beside the one that the fastest mode needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepAdvice {
    /// spectral radius of the Jacobian, 1/(unit of time)
    pub spectral_radius: f64,
    /// the largest step with |λ|·h ≤ ½; infinite for a system at rest
    pub needed: f64,
    /// the step in use
    pub used: f64,
}

impl StepAdvice {
    /// True where the step in use exceeds what Runge–Kutta is stable for
    /// (|λ|·h about 2.7).
    pub fn is_unstable(&self) -> bool {
        self.spectral_radius * self.used > 2.7
    }
}

/// Integrates [`Dynamics`] by any [`Method`] and stops at every switching
/// instant, so that no step spans a jump.
///
/// ```
/// use lynkeus_run::{Function, Integrator, Method};
///
/// let mut logistic = Function::new(1, |_t, x: &[f64], dx: &mut [f64]| dx[0] = x[0] * (1.0 - x[0]));
/// let mut x = [0.5];
/// Integrator::new(Method::default(), 1)?.advance(&mut logistic, 0.0, 2.0, &mut x)?;
/// assert!((x[0] - 1.0 / (1.0 + (-2.0_f64).exp())).abs() < 1e-8);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Integrator {
    stepper: Stepper,
    instants: Vec<f64>,
    /// of the surfaces on which the system jumps with its state
    sides: Sides,
}

#[derive(Clone, Debug)]
enum Stepper {
    Adaptive(Box<Adaptive>),
    Fixed(Fixed),
}

/// Runge–Kutta with equal steps between stops.
#[derive(Clone, Debug)]
struct Fixed {
    step: Step,
    rk4: Rk4,
    advice: Option<StepAdvice>,
    /// intervals since the last look, for automatic steps
    since_look: usize,
    /// state at the start of the interval
    begin: Vec<f64>,
}

impl Integrator {
    /// For systems of `dimension` states.
    ///
    /// # Errors
    /// [`Error::Setting`] if a number of the method is impossible.
    pub fn new(method: Method, dimension: usize) -> Result<Self> {
        method.check()?;
        let stepper = match method {
            Method::Adaptive(tolerances)
            | Method::Explicit(tolerances)
            | Method::Stiff(tolerances) => {
                Stepper::Adaptive(Box::new(Adaptive::new(method, tolerances)))
            }
            Method::Rk4(step) => Stepper::Fixed(Fixed {
                step,
                rk4: Rk4::new(dimension),
                advice: None,
                since_look: 0,
                begin: vec![0.0; dimension],
            }),
        };
        Ok(Self {
            stepper,
            instants: vec![],
            sides: Sides::default(),
        })
    }

    /// Takes `x` from `from` to `to` > `from`. Where an error ends it early, `x`
    /// is the last state reached.
    ///
    /// # Errors
    /// [`Error::Setting`] for an interval that is empty or too short for the
    /// resolution of time; [`Error::NotFinite`], [`Error::StepUnderflow`], [`Error::StepBudget`],
    /// [`Error::TooStiff`], [`Error::TooManySwitches`], [`Error::UnresolvedSwitches`];
    /// [`Error::Diverged`] where a fixed step is too large.
    pub fn advance(
        &mut self,
        f: &mut dyn Dynamics,
        from: f64,
        to: f64,
        x: &mut [f64],
    ) -> Result<()> {
        check_interval(from, to)?;
        let done = self.segments(f, from, to, x);
        done.map_err(|error| self.explained(error, f, x))
    }

    /// Blames a fixed step that is too large for a value that is not finite.
    fn explained(&self, error: Error, f: &dyn Dynamics, x: &[f64]) -> Error {
        match (error, self.hint()) {
            (Error::NotFinite { time, .. }, hint) if !hint.is_empty() => {
                diverged(time, &f.names(), x, largest(x), hint)
            }
            (error, _) => error,
        }
    }

    fn segments(&mut self, f: &mut dyn Dynamics, from: f64, to: f64, x: &mut [f64]) -> Result<()> {
        self.instants.clear();
        if let Some(events) = f.events() {
            events.instants(from, to, &mut self.instants)?;
        }
        if let Stepper::Adaptive(adaptive) = &mut self.stepper {
            adaptive.grant(self.instants.len());
        }
        let whole = to - from;
        self.sides.memory.enter(from, to);
        for (start, end) in pieces(from, to, &mut self.instants, APART) {
            if let Some(events) = f.events() {
                events.enter(start + 0.5 * (end - start));
            }
            match &mut self.stepper {
                Stepper::Adaptive(adaptive) => {
                    let at = (start, &*x);
                    let mut system = Filippov::new(f, &mut self.sides, at, end - start);
                    system.begin(start, x)?;
                    adaptive.advance(&mut system, start, end, x)?;
                    system.end(end, x);
                }
                Stepper::Fixed(fixed) => {
                    let memory = &mut self.sides.memory;
                    let left = memory.left();
                    let jumped = occur(f, memory, (start, end - start), x, &[])?;
                    let behind = jumped.then(|| sent_back(f, start, x, &left)).flatten();
                    fixed.advance(f, memory, (start, end), (whole, behind), x)?;
                }
            }
        }
        if let Some(clauses) = f.clauses() {
            self.sides.memory.leave(&x[..clauses.states()]);
        }
        Ok(())
    }

    /// Takes `x` at `t` through the event ahead of it, as if that had come by then; by single steps of the classical
    /// Runge–Kutta method. Whether there is one within a time.
    pub(crate) fn anticipate(
        &mut self,
        f: &mut dyn Dynamics,
        (t, within): (f64, f64),
        x: &mut [f64],
    ) -> Result<bool> {
        Rk4::new(x.len()).anticipate(f, &mut self.sides.memory, (t, within), x)
    }

    /// What is remembered of clauses.
    pub(crate) fn memory(&mut self) -> &mut Memory {
        &mut self.sides.memory
    }

    /// For [`Method::Rk4`]: the step in use beside the step that the Jacobian asks
    /// for, at the last look at it (before the first interval and, for automatic
    /// steps, every so often).
    pub fn advice(&self) -> Option<StepAdvice> {
        match &self.stepper {
            Stepper::Adaptive(_) => None,
            Stepper::Fixed(fixed) => fixed.advice,
        }
    }

    /// What to say of a divergence: that the step is too large, if it is.
    pub(crate) fn hint(&self) -> String {
        match self.advice() {
            Some(advice) if advice.is_unstable() => format!(
                "; the step {:.3e} is too large for the fastest mode, try {:.1e} or less",
                advice.used, advice.needed
            ),
            _ => String::new(),
        }
    }
}

/// From one interval to the next the step and what is known of it stay, and the sides of the
/// surfaces on which the system jumps.
impl Persist for Integrator {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.sides.walk(walk)?;
        match &mut self.stepper {
            Stepper::Adaptive(adaptive) => adaptive.walk(walk),
            Stepper::Fixed(fixed) => {
                walk.optional(&mut fixed.advice, |walk, advice| {
                    walk.number(&mut advice.spectral_radius)?;
                    walk.number(&mut advice.needed)?;
                    walk.number(&mut advice.used)
                })?;
                walk.count(&mut fixed.since_look)
            }
        }
    }
}

impl Fixed {
    fn advance(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        (from, to): (f64, f64),
        (whole, behind): (f64, Option<usize>),
        x: &mut [f64],
    ) -> Result<()> {
        let Some(used) = self.step.length(whole) else {
            return self.auto(f, memory, (from, to), behind, x);
        };
        if self.advice.is_none() {
            self.advice = Some(advice(f, from, x, used));
        }
        let steps = fixed_steps(from, to, used)?;
        self.begin.copy_from_slice(x);
        let result = self.steps(f, memory, (from, to), (steps, behind), x);
        if let Err(Error::NotFinite { .. }) = result {
            self.advice = Some(advice(f, from, &self.begin, used));
        }
        result
    }

    /// With a step from the spectral radius; a failed interval is tried again
    /// with smaller steps, since the Jacobian may have grown meanwhile.
    fn auto(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        (from, to): (f64, f64),
        behind: Option<usize>,
        x: &mut [f64],
    ) -> Result<()> {
        let known = self.advice.filter(|_| self.since_look > 0);
        let mut seen = known.unwrap_or_else(|| advice(f, from, x, to - from));
        let needed = seen.needed;
        seen.used = seen.used.min(needed);
        self.advice = Some(seen);
        self.since_look = (self.since_look + 1) % LOOK_EVERY;
        let mut steps = count(from, to, needed).ok_or(Error::TooStiff {
            time: from,
            needed,
            substeps: (to - from) / needed,
            limit: MOST_STEPS,
        })?;
        self.begin.copy_from_slice(x);
        let remembered = memory.clone();
        for _ in 0..RETRIES {
            match self.steps(f, memory, (from, to), (steps, behind), x) {
                Ok(()) => return Ok(()),
                Err(error @ (Error::EndlessEvents { .. } | Error::Grazing { .. })) => {
                    return Err(error);
                }
                Err(_) => {}
            }
            x.copy_from_slice(&self.begin);
            memory.clone_from(&remembered);
            steps = steps.saturating_mul(4).min(MOST_STEPS);
            self.since_look = 0;
        }
        self.steps(f, memory, (from, to), (steps, behind), x)
    }

    /// So many equal steps, with events where there are clauses, after one that has sent the state back perhaps.
    fn steps(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        (from, to): (f64, f64),
        (steps, mut behind): (usize, Option<usize>),
        x: &mut [f64],
    ) -> Result<()> {
        if f.clauses().is_none() {
            return self.rk4.advance(f, from, to, steps, x);
        }
        for i in 0..steps {
            let [t, next] = [i, i + 1].map(|i| instant(from, to, steps, i));
            if f.is_over() {
                return Err(Error::Cancelled { time: t });
            }
            self.rk4
                .step_with_events(f, memory, (t, next), behind.take(), x)?;
        }
        Ok(())
    }
}

/// A step beside the fastest mode at (t, x).
fn advice(f: &mut dyn Dynamics, t: f64, x: &[f64], used: f64) -> StepAdvice {
    let spectral_radius = spectral_radius(f, t, x);
    let needed = AUTO_PRODUCT / spectral_radius;
    StepAdvice {
        spectral_radius,
        // where the Jacobian is not defined there is nothing to go by
        needed: if needed.is_nan() {
            f64::INFINITY
        } else {
            needed
        },
        used,
    }
}

/// # Errors
/// [`Error::Setting`] for an interval that is empty or too short for the resolution of time.
pub(crate) fn check_interval(from: f64, to: f64) -> Result<()> {
    let shortest = 4.0 * resolution(to);
    let length = to - from;
    if length.is_finite() && length > shortest {
        return Ok(());
    }
    let what = format!("interval from t = {from} to {to}");
    let expected = format!("more than {shortest:e}, which time resolves (shift its origin)");
    Err(Error::setting(what, expected, length))
}

/// Two detectors may find one switch, so many shares of its time apart by rounding.
pub(crate) const APART: f64 = 4.0 * f64::EPSILON;

/// The pieces of an interval between switching instants, which are put in order; those that are no such
/// share of their time `apart` are one.
pub(crate) fn pieces(
    from: f64,
    to: f64,
    instants: &mut Vec<f64>,
    apart: f64,
) -> impl Iterator<Item = (f64, f64)> {
    instants.sort_unstable_by(f64::total_cmp);
    instants.push(to);
    let mut start = from;
    instants.iter().filter_map(move |&end| {
        let is_same = end - start <= apart * end.abs() && end < to;
        (!is_same).then(|| (std::mem::replace(&mut start, end), end))
    })
}

/// How many equal steps of at most `h` make the interval.
///
/// # Errors
/// [`Error::Setting`] if too many.
pub(crate) fn fixed_steps(from: f64, to: f64, h: f64) -> Result<usize> {
    count(from, to, h).ok_or_else(|| {
        let least = (to - from) / MOST_STEPS as f64;
        let expected = format!("at least {least:e} for the interval from {from} to {to}");
        Error::setting("step", expected, h)
    })
}

/// How many equal steps of at most `h` make the interval; none if too many.
fn count(from: f64, to: f64, h: f64) -> Option<usize> {
    // a step that divides the interval up to rounding must not take one more
    let steps = ((to - from) / h * (1.0 - 1e-12)).ceil().max(1.0);
    (steps <= MOST_STEPS as f64).then_some(steps as usize)
}

/// The classical Runge–Kutta method of order 4; owns its stages, so a step does
/// not allocate.
///
/// ```
/// use lynkeus_run::{Function, Rk4};
///
/// let mut decay = Function::new(1, |_t, x: &[f64], dx: &mut [f64]| dx[0] = -x[0]);
/// let mut x = [1.0];
/// Rk4::new(1).step(&mut decay, 0.0, 0.1, &mut x)?;
/// assert!((x[0] - (-0.1_f64).exp()).abs() < 1e-7);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Rk4 {
    k: [Vec<f64>; 4],
    stage: Vec<f64>,
}

/// Most steps that are taken before somebody is asked whether to go on.
const TOGETHER: usize = 64;

/// Where step `i` of `steps` equal ones begins.
pub(crate) fn instant(from: f64, to: f64, steps: usize, i: usize) -> f64 {
    from + (to - from) * (i as f64 / steps as f64)
}

/// How often a step is halved on the way to an event.
const HALVINGS: usize = 50;

/// The relation that still holds behind an event and is left from there.
fn sent_back(f: &mut dyn Dynamics, t: f64, x: &[f64], flipped: &[usize]) -> Option<usize> {
    let mut slope = vec![0.0; x.len()];
    f.derivatives(t, x, &mut slope);
    let rates = f.rates(t, x, &slope);
    let mut seen = vec![];
    f.watch(t, x, &mut seen);
    let leaves = |relation: &&usize| match (seen.get(**relation), rates.get(**relation)) {
        (Some(seen), Some(rate)) => {
            if seen.holds {
                *rate < 0.0
            } else {
                *rate > 0.0
            }
        }
        _ => false,
    };
    flipped.iter().find(leaves).copied()
}

/// Most parts of a step with events in it.
const MOST_PARTS: usize = 10_000;

/// Relations change all along a step.
fn endless(f: &dyn Dynamics, time: f64) -> Error {
    Error::EndlessEvents {
        time,
        line: f.clauses().map_or(0, |clauses| clauses.first_line()),
        how: format!("its conditions change {MOST_PARTS} times in one step"),
    }
}

/// The relations that differ.
fn changed(a: &[Seen], b: &[Seen]) -> impl Iterator<Item = usize> {
    let pairs = a.iter().zip(b).enumerate();
    pairs.filter_map(|(relation, (a, b))| (a.holds != b.holds).then_some(relation))
}

/// (time of the stage as a fraction of the step, factor of the stage before)
const STAGES: [(f64, f64); 4] = [(0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)];

impl Rk4 {
    /// For systems of `dimension` states.
    pub fn new(dimension: usize) -> Self {
        Self {
            k: std::array::from_fn(|_| vec![0.0; dimension]),
            stage: vec![0.0; dimension],
        }
    }

    /// Takes `x` from `t` to `t + h`. Where the result is not finite, `x` stays.
    ///
    /// # Errors
    /// [`Error::NotFinite`] names the stage where the derivative is undefined.
    ///
    /// # Panics
    /// If `f` or `x` has another dimension.
    pub fn step(&mut self, f: &mut dyn Dynamics, t: f64, h: f64, x: &mut [f64]) -> Result<()> {
        if self.steps_at_once(f, &[[t, h]], x) {
            return Ok(());
        }
        for (stage, (c, _)) in STAGES.iter().enumerate() {
            self.place(stage, h, x);
            f.derivatives(t + c * h, &self.stage, &mut self.k[stage]);
        }
        let [k1, k2, k3, k4] = &self.k;
        for (i, &x) in x.iter().enumerate() {
            self.stage[i] = x + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        if are_finite(&self.stage) {
            x.copy_from_slice(&self.stage);
            return Ok(());
        }
        Err(self.blame(f, t, h, x))
    }

    /// Takes `x` from `from` to `to` in `steps` equal steps; `x` is the state at
    /// the last good step where an error ends it early.
    ///
    /// # Errors
    /// As [`Rk4::step`].
    pub fn advance(
        &mut self,
        f: &mut dyn Dynamics,
        from: f64,
        to: f64,
        steps: usize,
        x: &mut [f64],
    ) -> Result<()> {
        let (mut time, mut some) = (from, [[0.0; 2]; TOGETHER]);
        for first in (0..steps).step_by(TOGETHER) {
            let some = &mut some[..TOGETHER.min(steps - first)];
            for (i, step) in (first + 1..).zip(&mut *some) {
                let next = instant(from, to, steps, i);
                *step = [time, next - time];
                time = next;
            }
            if f.is_over() {
                return Err(Error::Cancelled { time: some[0][0] });
            }
            if !self.steps_at_once(f, some, x) {
                self.one_by_one(f, some, x)?;
            }
        }
        Ok(())
    }

    /// As [`Rk4::advance`] over steps, the time and the length of each.
    fn one_by_one(
        &mut self,
        f: &mut dyn Dynamics,
        steps: &[[f64; 2]],
        x: &mut [f64],
    ) -> Result<()> {
        for &[time, length] in steps {
            if f.is_over() {
                return Err(Error::Cancelled { time });
            }
            self.step(f, time, length, x)?;
        }
        Ok(())
    }

    /// Steps that f has as one function. What is not finite stays so from step to step, each of which adds to a
    /// state: then `x` stays, and false is said.
    fn steps_at_once(&mut self, f: &mut dyn Dynamics, steps: &[[f64; 2]], x: &mut [f64]) -> bool {
        let are_made = f.steps(steps, x, &mut self.stage) && are_finite(&self.stage);
        if are_made {
            x.copy_from_slice(&self.stage);
        }
        are_made
    }

    /// One step with events in it. Where a relation of a clause is another one at the end of it, steps of
    /// the same method from the same start, their lengths halved [`HALVINGS`] times, find the first
    /// that ends beyond the change; the clauses take effect there, and another step leads to the end. A
    /// state that a jump has sent back, beyond a relation, is followed by shorter steps until it has left.
    fn step_with_events(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        (from, to): (f64, f64),
        mut behind: Option<usize>,
        x: &mut [f64],
    ) -> Result<()> {
        let (mut t, mut was, mut now) = (from, vec![], vec![]);
        let mut start = x.to_vec();
        let mut count = 0;
        while to - t > resolution(to) {
            count += 1;
            if count > MOST_PARTS {
                return Err(endless(f, t));
            }
            let whole = to - t;
            start.copy_from_slice(x);
            f.watch(t, x, &mut was);
            let mut h = whole;
            self.step(f, t, h, x)?;
            f.watch(t + h, x, &mut now);
            // there and back within one step
            if let Some(relation) = behind.take() {
                for _ in 0..HALVINGS {
                    if now[relation].holds != was[relation].holds {
                        break;
                    }
                    h *= 0.5;
                    x.copy_from_slice(&start);
                    self.step(f, t, h, x)?;
                    f.watch(t + h, x, &mut now);
                }
                if now[relation].holds == was[relation].holds {
                    h = whole;
                    x.copy_from_slice(&start);
                    self.step(f, t, h, x)?;
                    f.watch(t + h, x, &mut now);
                }
            }
            if changed(&was, &now).next().is_none() {
                t = if h == whole { to } else { t + h };
                self.check(f, memory, t, x, &now)?;
                continue;
            }
            let (length, flipped) = self.first_change(f, (t, h), &start, &was, x)?;
            t = if length == whole { to } else { t + length };
            if occur(f, memory, (t, to - from), x, &flipped)? {
                behind = sent_back(f, t, x, &flipped);
            }
        }
        Ok(())
    }

    /// Of steps from `start` at `t`, their lengths halved from `h` on, at whose end `x` relations are no more what they
    /// `were`, about the shortest: its length, with `x` at its end and the relations that have changed.
    fn first_change(
        &mut self,
        f: &mut dyn Dynamics,
        (t, h): (f64, f64),
        start: &[f64],
        were: &[Seen],
        x: &mut [f64],
    ) -> Result<(f64, Vec<usize>)> {
        let (mut low, mut high) = (0.0, h);
        let mut end = x.to_vec();
        let mut there = vec![];
        for _ in 0..HALVINGS {
            if high - low <= resolution(t + high) {
                break;
            }
            let middle = low + 0.5 * (high - low);
            x.copy_from_slice(start);
            self.step(f, t, middle, x)?;
            f.watch(t + middle, x, &mut there);
            match changed(were, &there).next() {
                Some(_) => {
                    high = middle;
                    end.copy_from_slice(x);
                }
                None => low = middle,
            }
        }
        x.copy_from_slice(&end);
        f.watch(t + high, x, &mut there);
        Ok((high, changed(were, &there).collect()))
    }

    /// The event that lies ahead of `x` at `t`, as if it had come by then: there, through it, and back again. Whether
    /// there is one within a time.
    fn anticipate(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        (t, within): (f64, f64),
        x: &mut [f64],
    ) -> Result<bool> {
        // what was at the end of the interval lies at no distance
        if !memory.left().is_empty() {
            return occur(f, memory, (t, within), x, &[]);
        }
        let start = x.to_vec();
        let (mut were, mut now) = (vec![], vec![]);
        f.watch(t, x, &mut were);
        for share in [0.125, 0.25, 0.5, 1.0] {
            let h = share * within;
            x.copy_from_slice(&start);
            self.step(f, t, h, x)?;
            f.watch(t + h, x, &mut now);
            if changed(&were, &now).next().is_none() {
                continue;
            }
            let (length, flipped) = self.first_change(f, (t, h), &start, &were, x)?;
            if !occur(f, memory, (t + length, within), x, &flipped)? {
                break;
            }
            self.step(f, t + length, -length, x)?;
            return Ok(true);
        }
        x.copy_from_slice(&start);
        Ok(false)
    }

    /// That clauses which came ever sooner still hold.
    fn check(
        &mut self,
        f: &mut dyn Dynamics,
        memory: &mut Memory,
        t: f64,
        x: &[f64],
        seen: &[Seen],
    ) -> Result<()> {
        if let (true, Some(clauses)) = (memory.suspects(), f.clauses()) {
            let size = x.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            memory.check(&clauses, t, seen, |_| size)?;
        }
        Ok(())
    }

    /// The state at which a stage is evaluated.
    fn place(&mut self, stage: usize, h: f64, x: &[f64]) {
        let factor = h * STAGES[stage].1;
        let before = &self.k[stage.saturating_sub(1)];
        for ((s, &x), &k) in self.stage.iter_mut().zip(x).zip(before) {
            // the first stage must not read what an earlier step left in k
            *s = if stage == 0 { x } else { x + factor * k };
        }
    }

    /// Finds the stage whose derivative is not finite.
    fn blame(&mut self, f: &mut dyn Dynamics, t: f64, h: f64, x: &[f64]) -> Error {
        let bad = |k: &Vec<f64>| !are_finite(k);
        let stage = self.k.iter().position(bad).unwrap_or(0);
        self.place(stage, h, x);
        f.not_finite(t + STAGES[stage].0 * h, &self.stage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Function;

    fn error_with(steps: usize) -> f64 {
        let mut f = Function::new(2, |t, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[1];
            dx[1] = -x[0] + t;
        });
        let mut x = [1.0, 0.0];
        Rk4::new(2)
            .advance(&mut f, 0.0, 2.0, steps, &mut x)
            .unwrap();
        // x = cos t − sin t + t
        (x[0] - (2.0_f64.cos() - 2.0_f64.sin() + 2.0)).abs()
    }

    #[test]
    fn halving_the_step_divides_the_error_by_sixteen() {
        for steps in [20, 40, 80] {
            let order = (error_with(steps) / error_with(2 * steps)).log2();
            assert!((order - 4.0).abs() < 0.15, "order {order} at {steps} steps");
        }
    }

    #[test]
    fn an_undefined_stage_is_found_and_the_state_kept() {
        let mut f = Function::new(1, |_t, x: &[f64], dx: &mut [f64]| {
            dx[0] = -x[0].sqrt() * 4.0
        });
        let mut x = [1.0];
        let error = Rk4::new(1).step(&mut f, 2.0, 1.0, &mut x).unwrap_err();
        let Error::NotFinite { time, state, .. } = error else {
            panic!("{error}");
        };
        assert_eq!((time, state.as_str(), x[0]), (2.5, "x[1] = -1", 1.0));
    }
}
