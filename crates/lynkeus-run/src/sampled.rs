//! Observers whose sensors report when they do.

use crate::divergence::Bound;
use crate::driven::Driven;
use crate::spread::{ErrorModel, Spread};
use crate::{BetweenSamples, Dynamics, Error, Integrator, Method, System};

/// An observer z' = F(t, z, u, w) whose measurements are states of their own: w jumps to a
/// reading when the sensor reports, and in between stays (`hold`) or follows the model,
/// w' = L_f h(x̂) (the inter-sample predictor of Karafyllis and Kravaris, *From
/// continuous-time design to sampled-data design of observers*, 2009).
///
/// The system's last `sensors` states are w; its last `sensors` signals say for each sensor
/// whether w follows the model (1) or stays (0); its last `sensors` outputs are h(x̂).
#[derive(Clone, Debug)]
pub struct SampledObserver {
    /// the system
    pub system: System,
    /// number of measured outputs
    pub sensors: usize,
    /// w follows the model also after a reading, not only where one is missing
    pub predict: bool,
    /// how errors spread, where standard deviations are asked for
    pub errors: Option<ErrorModel>,
}

/// A [`SampledObserver`] that takes one sample after the other.
#[derive(Clone, Debug)]
pub struct SampledEstimator {
    driven: Driven,
    integrator: Integrator,
    x: Vec<f64>,
    outputs: Vec<f64>,
    /// known inputs, then whether each sensor's w follows the model
    signals: Vec<f64>,
    sensors: usize,
    predict: bool,
    time: Option<f64>,
    samples: usize,
    missing: Vec<usize>,
    bound: Bound,
    spread: Option<Spread>,
}

impl SampledEstimator {
    /// An estimator at the observer's start values, waiting for the first sample.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method.
    pub fn new(observer: &SampledObserver, method: Method) -> Result<Self, Error> {
        let SampledObserver {
            system,
            sensors,
            predict,
            errors,
        } = observer;
        let spread = errors.as_ref().map(|model| Spread::new(model, method));
        Ok(Self {
            driven: Driven::new(system, BetweenSamples::Hold),
            integrator: Integrator::new(method, system.states().len())?,
            x: system.start().to_vec(),
            outputs: vec![0.0; system.outputs().len()],
            signals: vec![0.0; system.signals().len()],
            sensors: *sensors,
            predict: *predict,
            time: None,
            samples: 0,
            missing: vec![0; *sensors],
            bound: Bound::new(system.start()),
            spread: spread.transpose()?,
        })
    }

    /// Takes the readings at `t` with the known inputs, and returns the estimates (and
    /// monitors). A reading that is not finite says that this sensor did not report: its w
    /// follows the model until it does. Of an input that is not finite the last value holds.
    ///
    /// # Errors
    /// [`Error::TimeOrder`], [`Error::NotANumber`] for the first value of an input,
    /// [`Error::Setting`] for wrong numbers of values; [`Error::Diverged`],
    /// [`Error::NotFinite`] and the errors of the integration.
    pub fn push(&mut self, t: f64, readings: &[f64], inputs: &[f64]) -> Result<&[f64], Error> {
        self.samples += 1;
        let next = self.checked(t, readings, inputs)?;
        match self.time {
            None => {
                self.driven.start(&next);
                if let Some(spread) = &mut self.spread {
                    spread.start(&next);
                }
                self.guess(t)?;
            }
            Some(before) => {
                self.driven.aim(before, t, &next);
                match &mut self.spread {
                    Some(spread) => spread.advance(before, t, &next, &mut self.x)?,
                    None => self
                        .integrator
                        .advance(&mut self.driven, before, t, &mut self.x)?,
                }
                self.driven.arrive();
            }
        }
        self.signals = next;
        self.time = Some(t);
        let first = self.x.len() - self.sensors;
        for (i, reading) in readings.iter().enumerate() {
            if !reading.is_finite() {
                self.missing[i] += 1;
                continue;
            }
            self.x[first + i] = *reading;
            if let Some(spread) = &mut self.spread {
                spread.reset(i, *reading);
            }
        }
        self.bound.see(&self.x[first..]);
        self.report(t)
    }

    /// Samples without a reading, by sensor.
    #[must_use]
    pub fn missing(&self) -> &[usize] {
        &self.missing
    }

    /// Standard deviations of the estimates after the last sample; none without a model of the
    /// errors.
    #[must_use]
    pub fn deviations(&self) -> Option<&[f64]> {
        self.spread.as_ref().map(|spread| &spread.deviations[..])
    }

    /// h(x̂) after the last sample, by sensor.
    #[must_use]
    pub fn expected(&self) -> &[f64] {
        &self.outputs[self.outputs.len() - self.sensors..]
    }

    /// Before a sensor's first reading the model's own output stands in for it.
    fn guess(&mut self, t: f64) -> Result<(), Error> {
        self.evaluate(t)?;
        let first = self.x.len() - self.sensors;
        let expected = self.outputs.len() - self.sensors;
        self.x[first..].copy_from_slice(&self.outputs[expected..]);
        Ok(())
    }

    fn checked(&self, t: f64, readings: &[f64], inputs: &[f64]) -> Result<Vec<f64>, Error> {
        let known = self.signals.len() - self.sensors;
        for (what, expected, found) in [
            ("number of readings", self.sensors, readings.len()),
            ("number of known inputs", known, inputs.len()),
        ] {
            if expected != found {
                return Err(Error::setting(what, expected.to_string(), found));
            }
        }
        let not_a_number = |column: String, value| Error::NotANumber {
            row: self.samples,
            column,
            value,
        };
        if !t.is_finite() {
            return Err(not_a_number("t".to_owned(), t));
        }
        if let Some(previous) = self.time.filter(|previous| t <= *previous) {
            return Err(Error::TimeOrder {
                row: self.samples,
                previous,
                time: t,
            });
        }
        let mut next = inputs.to_vec();
        for (i, u) in next.iter_mut().enumerate().filter(|(_, u)| !u.is_finite()) {
            if self.time.is_none() {
                let name = self.driven.evaluation.system().signals()[i].clone();
                return Err(not_a_number(name, *u));
            }
            *u = self.signals[i];
        }
        let follows = |reading: &f64| f64::from(u8::from(self.predict || !reading.is_finite()));
        next.extend(readings.iter().map(follows));
        Ok(next)
    }

    fn report(&mut self, t: f64) -> Result<&[f64], Error> {
        let own = self.x.len() - self.sensors;
        let names = self.driven.evaluation.system().states();
        self.bound
            .check(t, names, &self.x[..own], || self.integrator.hint())?;
        self.evaluate(t)?;
        if let Some(spread) = &mut self.spread {
            spread.measure(t, &self.x);
        }
        Ok(&self.outputs[..self.outputs.len() - self.sensors])
    }

    fn evaluate(&mut self, t: f64) -> Result<(), Error> {
        let evaluation = &mut self.driven.evaluation;
        evaluation.enter(t);
        evaluation.outputs(t, &self.x, &mut self.outputs);
        match self.outputs.iter().all(|v| v.is_finite()) {
            true => Ok(()),
            false => Err(evaluation.not_finite(t, &self.x)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Step, Tolerances};
    use lynkeus_expr::Graph;

    /// x' = −x, x̂' = −x̂ + 2(w − x̂), w' = s·(−x̂).
    fn observer(predict: bool) -> SampledObserver {
        let g = Graph::new();
        let [time, x, w, s] = ["time", "x", "w", "s"].map(|name| g.symbol(name));
        let states = [
            ("x".to_string(), x.node(), 3.0),
            ("w".to_string(), w.node(), 0.0),
        ];
        let derivatives = [(-x + (w - x) * 2.0).node(), (s * -x).node()];
        let outputs = [("x_hat".to_string(), x.node()), ("y".to_string(), x.node())];
        let signals = [("s".to_string(), s.node())];
        let system =
            System::new(&g, time.node(), &states, &signals, &derivatives, &outputs).unwrap();
        SampledObserver {
            system,
            sensors: 1,
            predict,
            errors: None,
        }
    }

    fn method() -> Method {
        Method::Explicit(Tolerances {
            relative: 1e-11,
            absolute: 1e-13,
            ..Tolerances::default()
        })
    }

    /// Right from the start the predictor stays right between samples, and holding does not.
    #[test]
    fn the_predictor_leaves_a_right_estimate_alone() {
        let error = |predict: bool| {
            let mut estimator = SampledEstimator::new(&observer(predict), method()).unwrap();
            let mut worst = 0.0_f64;
            for k in 0..20 {
                let t = 0.5 * f64::from(k);
                let y = if k % 3 == 2 {
                    f64::NAN
                } else {
                    3.0 * (-t).exp()
                };
                let x = estimator.push(t, &[y], &[]).unwrap()[0];
                worst = worst.max((x - 3.0 * (-t).exp()).abs());
            }
            assert_eq!(estimator.missing(), [6]);
            worst
        };
        assert!(error(true) < 1e-10, "{}", error(true));
        assert!(error(false) > 1e-2);
    }

    #[test]
    fn before_the_first_reading_the_model_runs_alone() {
        let mut estimator =
            SampledEstimator::new(&observer(false), Method::Rk4(Step::Substeps(50))).unwrap();
        for k in 0..4 {
            let x = estimator.push(f64::from(k), &[f64::NAN], &[]).unwrap()[0];
            assert!((x - 3.0 * (-f64::from(k)).exp()).abs() < 1e-6);
        }
        assert!(matches!(
            estimator.push(3.0, &[1.0], &[]),
            Err(Error::TimeOrder { .. })
        ));
        assert!(matches!(
            estimator.push(4.0, &[], &[]),
            Err(Error::Setting { .. })
        ));
    }
}
