//! One integrator for every method, stopping at every switch.

use crate::adaptive::{Adaptive, Choice};
use crate::{Dynamics, Error, Method, Rk4, Step, spectral_radius};

/// Most fixed steps in one interval.
const MOST_STEPS: usize = 1_000_000;

/// |λ|·h of automatic fixed steps; the method is stable up to about 2.7.
const AUTO_PRODUCT: f64 = 0.5;

/// Intervals after which the automatic fixed step looks at the Jacobian again.
const LOOK_EVERY: usize = 32;

/// How often an interval that fails is tried again with a quarter of the step.
const RETRIES: usize = 3;

/// A fixed step beside the one that the fastest mode needs.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// automatic step; not known before the first interval
    auto: Option<f64>,
    since_look: usize,
    retry: Vec<f64>,
}

impl Integrator {
    /// For systems of `dimension` states.
    ///
    /// # Errors
    /// [`Error::Setting`] if a number of the method is impossible.
    pub fn new(method: Method, dimension: usize) -> Result<Self, Error> {
        method.check()?;
        let adaptive =
            |choice, tolerances| Stepper::Adaptive(Box::new(Adaptive::new(choice, tolerances)));
        let stepper = match method {
            Method::Adaptive(tolerances) => adaptive(Choice::Auto, tolerances),
            Method::Explicit(tolerances) => adaptive(Choice::Explicit, tolerances),
            Method::Stiff(tolerances) => adaptive(Choice::Stiff, tolerances),
            Method::Rk4(step) => Stepper::Fixed(Fixed {
                step,
                rk4: Rk4::new(dimension),
                auto: None,
                since_look: 0,
                retry: vec![0.0; dimension],
            }),
        };
        Ok(Self {
            stepper,
            instants: vec![],
        })
    }

    /// Takes `x` from `from` to `to` > `from`. Where an error ends it early, `x`
    /// is the last state reached.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::StepUnderflow`], [`Error::StepBudget`],
    /// [`Error::TooStiff`] and [`Error::TooManySwitches`].
    pub fn advance(
        &mut self,
        f: &mut impl Dynamics,
        from: f64,
        to: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let mut instants = std::mem::take(&mut self.instants);
        instants.clear();
        let result = f
            .switches(from, to, &mut instants)
            .and_then(|()| self.segments(f, from, to, &mut instants, x));
        self.instants = instants;
        result
    }

    fn segments(
        &mut self,
        f: &mut impl Dynamics,
        from: f64,
        to: f64,
        instants: &mut Vec<f64>,
        x: &mut [f64],
    ) -> Result<(), Error> {
        instants.sort_unstable_by(f64::total_cmp);
        instants.push(to);
        let whole = to - from;
        let mut start = from;
        for &end in instants.iter() {
            // two detectors may find one switch, a rounding error apart
            if end - start <= 4.0 * f64::EPSILON * end.abs() && end < to {
                continue;
            }
            f.enter(start + 0.5 * (end - start));
            match &mut self.stepper {
                Stepper::Adaptive(adaptive) => adaptive.advance(f, start, end, x)?,
                Stepper::Fixed(fixed) => fixed.advance(f, start, end, whole, x)?,
            }
            start = end;
        }
        Ok(())
    }

    /// For [`Method::Rk4`]: the step in use over an interval of this length
    /// beside the step that the Jacobian at (t, x) asks for.
    pub fn advice(
        &self,
        f: &mut impl Dynamics,
        t: f64,
        x: &[f64],
        interval: f64,
    ) -> Option<StepAdvice> {
        let Stepper::Fixed(fixed) = &self.stepper else {
            return None;
        };
        let spectral_radius = spectral_radius(f, t, x);
        let needed = AUTO_PRODUCT / spectral_radius;
        let used = match fixed.step {
            Step::Auto => needed.min(interval),
            Step::AtMost(h) => h.min(interval),
            Step::Substeps(n) => interval / n as f64,
        };
        Some(StepAdvice {
            spectral_radius,
            needed,
            used,
        })
    }
}

impl Fixed {
    fn advance(
        &mut self,
        f: &mut impl Dynamics,
        from: f64,
        to: f64,
        whole: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let h = match self.step {
            Step::AtMost(h) => h,
            Step::Substeps(n) => whole / n as f64,
            Step::Auto => return self.auto(f, from, to, x),
        };
        let steps = count(from, to, h)?;
        self.rk4.advance(f, from, to, steps, x)
    }

    /// With a step from the spectral radius; a failed interval is tried again
    /// with smaller steps, since the Jacobian may have grown meanwhile.
    fn auto(
        &mut self,
        f: &mut impl Dynamics,
        from: f64,
        to: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        if self.auto.is_none() || self.since_look >= LOOK_EVERY {
            let needed = AUTO_PRODUCT / spectral_radius(f, from, x);
            self.auto = Some(if needed.is_nan() {
                f64::INFINITY
            } else {
                needed
            });
            self.since_look = 0;
        }
        self.since_look += 1;
        let h = self.auto.unwrap_or(f64::INFINITY);
        self.retry.copy_from_slice(x);
        let mut steps = count(from, to, h)?;
        for _ in 0..RETRIES {
            if self.rk4.advance(f, from, to, steps, x).is_ok() {
                return Ok(());
            }
            x.copy_from_slice(&self.retry);
            steps = steps.saturating_mul(4).min(MOST_STEPS);
            // look again at the next interval
            self.auto = None;
        }
        self.rk4.advance(f, from, to, steps, x)
    }
}

/// How many equal steps of at most `h` make the interval.
fn count(from: f64, to: f64, h: f64) -> Result<usize, Error> {
    // a step that divides the interval up to rounding must not take one more
    let steps = ((to - from) / h * (1.0 - 1e-12)).ceil().max(1.0);
    if steps <= MOST_STEPS as f64 {
        return Ok(steps as usize);
    }
    Err(Error::TooStiff {
        time: from,
        needed: h,
        substeps: steps,
        limit: MOST_STEPS,
    })
}
