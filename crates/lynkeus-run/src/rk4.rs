//! The classical Runge–Kutta method with fixed steps.

use crate::{Dynamics, Error};

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

/// Where step `i` of `steps` equal ones begins.
pub(crate) fn instant(from: f64, to: f64, steps: usize, i: usize) -> f64 {
    from + (to - from) * (i as f64 / steps as f64)
}

/// Without a branch for each value.
fn are_finite(values: &[f64]) -> bool {
    values.iter().fold(true, |all, v| all & v.is_finite())
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
    pub fn step(
        &mut self,
        f: &mut impl Dynamics,
        t: f64,
        h: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        if f.step(t, h, x, &mut self.stage) && are_finite(&self.stage) {
            x.copy_from_slice(&self.stage);
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
        f: &mut impl Dynamics,
        from: f64,
        to: f64,
        steps: usize,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let mut t = from;
        for i in 0..steps {
            let next = instant(from, to, steps, i + 1);
            if f.is_over() {
                return Err(Error::Cancelled { time: t });
            }
            self.step(f, t, next - t, x)?;
            t = next;
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
    fn blame(&mut self, f: &mut impl Dynamics, t: f64, h: f64, x: &[f64]) -> Error {
        let bad = |k: &Vec<f64>| k.iter().any(|v| !v.is_finite());
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
