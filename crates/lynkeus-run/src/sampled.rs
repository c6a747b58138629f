//! Observers whose sensors report when they do.

use crate::Evaluation;
use crate::blueprint::Tuned;
use crate::divergence::{Bound, check_deviations};
use crate::filter::{Health, Innovation, NoisyModel};
use crate::method::are_finite;
use crate::runner::{Runner, Sample};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::spread::Spread;
use crate::standing::{Errors, Stand, Standing};
use crate::{Blueprint, Dynamics, Error, Events, Integrator, Result, StepAdvice};

/// An observer whose readings [jump](crate::Updates::Jumps), under way.
#[derive(Clone, Debug)]
pub(crate) struct Sampled {
    driven: Evaluation,
    integrator: Integrator,
    x: Vec<f64>,
    outputs: Vec<f64>,
    /// known inputs, then whether each sensor's w follows the model, then what is tuned
    signals: Vec<f64>,
    sensors: usize,
    predict: bool,
    bound: Bound,
    spread: Option<Spread>,
    health: Health,
}

impl Sampled {
    /// Of a blueprint whose readings jump, with these parts.
    pub fn new(blueprint: &Blueprint, predict: bool, errors: Option<&NoisyModel>) -> Result<Self> {
        let (system, run) = (&blueprint.flow, blueprint.run);
        let count = blueprint.sensors.len();
        let tuned = blueprint.tuned().map(Tuned::signals).unwrap_or_default();
        let signals = system.signals().len().saturating_sub(tuned.len());
        for (what, found) in [
            ("states", system.states().len()),
            ("signals", signals),
            ("outputs", system.outputs().len()),
        ] {
            if found < count {
                let expected = format!("{count} at least, one per sensor");
                return Err(Error::setting(what, expected, found));
            }
        }
        let spread = errors.map(|model| Spread::new(model, blueprint.judges, run));
        Ok(Self {
            driven: system.driven(run.between),
            integrator: Integrator::new(run.method, system.states().len())?,
            x: system.start().to_vec(),
            outputs: vec![0.0; system.estimates().len()],
            signals: [vec![0.0; signals], tuned].concat(),
            sensors: count,
            predict,
            bound: Bound::new(system.start()),
            spread: spread.transpose()?,
            health: Health::of(count),
        })
    }

    /// The signals from a sample on: a sensor's w follows the model where it did not report.
    fn start(&mut self, sample: &Sample<'_>) {
        let (inputs, follow) = self.signals.split_at_mut(sample.inputs.len());
        inputs.copy_from_slice(sample.inputs);
        for (follows, reading) in follow.iter_mut().zip(sample.readings) {
            *follows = f64::from(u8::from(self.predict || !reading.is_finite()));
        }
        self.driven.start(&self.signals);
        if let Some(spread) = &mut self.spread {
            spread.propagation.driven.start(&self.signals);
        }
    }

    fn evaluate(&mut self, t: f64) -> Result<()> {
        let evaluation = &mut self.driven;
        evaluation.enter(t);
        evaluation.estimates(t, &self.x, &mut self.outputs);
        match are_finite(&self.outputs) {
            true => Ok(()),
            false => Err(evaluation.not_finite(t, &self.x)),
        }
    }

    /// States that are neither readings nor there for the errors alone.
    fn own(&self) -> usize {
        let all = self.x.len() - self.sensors;
        self.spread.as_ref().map_or(all, |spread| spread.own)
    }

    fn told(&self) -> usize {
        self.outputs.len() - self.sensors
    }
}

impl Runner for Sampled {
    /// Before a sensor's first reading the model's own output stands in for it.
    fn begin(&mut self, sample: &Sample<'_>) -> Result<()> {
        self.start(sample);
        self.evaluate(sample.t)?;
        let (first, expected) = (self.x.len() - self.sensors, self.told());
        self.x[first..].copy_from_slice(&self.outputs[expected..]);
        Ok(())
    }

    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<()> {
        self.driven.aim(from, sample.t, sample.inputs);
        let done = match &mut self.spread {
            Some(spread) => spread.advance(from, sample, &mut self.x),
            None => {
                let (driven, x) = (&mut self.driven, &mut self.x);
                self.integrator.advance(driven, from, sample.t, x)
            }
        };
        let scale = self.bound.scale;
        let evaluation = &mut self.driven;
        done.map_err(|error| evaluation.explained(error, &self.x, scale))?;
        self.driven.arrive();
        Ok(())
    }

    fn update(&mut self, sample: &Sample<'_>) -> Result<()> {
        self.health.inputs_held += sample.held;
        self.start(sample);
        if let Some(spread) = &mut self.spread {
            spread.renew();
            spread.judge(sample, &self.x, &self.signals);
        }
        let first = self.x.len() - self.sensors;
        let innovations = self.spread.as_ref().map_or(&[][..], |s| &s.innovations);
        for (i, reading) in sample.readings.iter().enumerate() {
            let sensor = &mut self.health.sensors[i];
            if !reading.is_finite() {
                sensor.missing += 1;
                continue;
            }
            match innovations.get(i) {
                Some(innovation) if innovation.deviation > 0.0 => sensor.count(innovation),
                _ => sensor.taken += 1,
            }
            self.x[first + i] = *reading;
        }
        if let Some(spread) = &mut self.spread {
            spread.reset(sample.t, &self.x, sample.readings);
        }
        self.bound.see(&self.x[first..]);
        self.bound.see(sample.inputs);
        Ok(())
    }

    fn report(&mut self, t: f64) -> Result<()> {
        let own = self.x.len() - self.sensors;
        let names = self.driven.system().states();
        let (bound, hint) = (self.bound, || self.integrator.hint());
        let inside = bound.check(t, names, &self.x[..own], hint);
        let scale = bound.scale;
        let evaluation = &mut self.driven;
        inside.map_err(|error| evaluation.explained(error, &self.x, scale))?;
        self.evaluate(t)?;
        let Some(spread) = &mut self.spread else {
            return Ok(());
        };
        spread.measure(t, &self.x);
        let told = self.driven.system().outputs();
        check_deviations(t, told, &spread.deviations)
    }

    fn estimate(&self) -> &[f64] {
        &self.outputs[..self.told()]
    }

    fn deviations(&self) -> Option<&[f64]> {
        self.spread.as_ref().map(|spread| &spread.deviations[..])
    }

    fn innovations(&self) -> &[Innovation] {
        self.spread.as_ref().map_or(&[], |s| &s.innovations)
    }

    fn health(&self) -> &Health {
        &self.health
    }

    fn state(&self) -> &[f64] {
        &self.x
    }

    fn advice(&self) -> Option<StepAdvice> {
        self.integrator.advice()
    }

    fn stand(&self) -> Stand<'_> {
        Stand {
            names: self.driven.system().states(),
            own: self.own(),
            x: &self.x,
            errors: match &self.spread {
                Some(spread) => Errors::Root(spread.belief.root.entries.clone()),
                None => Errors::Unknown,
            },
        }
    }

    /// A sensor that was none before has what the model says of it.
    fn resume(&mut self, sample: &Sample<'_>, standing: &Standing) -> Result<()> {
        let places = standing.places(self.driven.system().states(), self.own())?;
        standing.fill(&places, &mut self.x);
        self.bound.see(&self.x);
        self.start(sample);
        match &mut self.spread {
            Some(spread) => standing.fill_root(&places, &mut spread.belief.root),
            None => Ok(()),
        }
    }

    fn copied(&self) -> Box<dyn Runner> {
        Box::new(self.clone())
    }
}

impl Persist for Sampled {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.integrator.walk(walk)?;
        if self.driven.system().has_clauses() {
            self.integrator.memory().walk(walk)?;
        }
        walk.numbers(&mut self.x)?;
        walk.numbers(&mut self.outputs)?;
        walk.number(&mut self.bound.scale)?;
        if let Some(spread) = &mut self.spread {
            spread.walk(walk)?;
        }
        self.health.walk(walk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EstimatorSettings, Method, Step, System, Tolerances, Updates};
    use lynkeus_expr::Graph;

    /// x' = −x, x̂' = −x̂ + 2(w − x̂), w' = s·(−x̂).
    fn observer(predict: bool) -> Blueprint {
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
        Blueprint {
            sensors: vec!["y".to_string()],
            updates: Updates::Jumps {
                predict,
                errors: None,
                tuned: None,
            },
            ..Blueprint::new(&system, run())
        }
    }

    /// The gain 2 as the square of a number.
    fn tuned(value: f64) -> Blueprint {
        let g = Graph::new();
        let [time, x, w, s, k, root] = ["time", "x", "w", "s", "k", "root"].map(|n| g.symbol(n));
        let plain = observer(true);
        let states = [("x", x, 3.0), ("w", w, 0.0)];
        let states = states.map(|(name, symbol, start)| (name.to_string(), symbol.node(), start));
        let derivatives = [(-x + (w - x) * k).node(), (s * -x).node()];
        let outputs = ["x_hat", "y"].map(|name| (name.to_string(), x.node()));
        let signals = [("s".to_string(), s.node()), ("k".to_string(), k.node())];
        let system = System::new(&g, time.node(), &states, &signals, &derivatives, &outputs);
        let made = [("k".to_string(), root.powi(2).node())];
        let number = [("root".to_string(), root.node())];
        let gains = System::new(&g, time.node(), &[], &number, &[], &made).unwrap();
        Blueprint {
            flow: system.unwrap(),
            updates: Updates::Jumps {
                predict: true,
                errors: None,
                tuned: Some(Tuned {
                    system: gains,
                    values: vec![value],
                }),
            },
            ..plain
        }
    }

    #[test]
    fn numbers_stand_where_constants_stood() {
        let fixed = observer(true);
        let tuned = tuned(2.0_f64.sqrt());
        let mut pair = [&fixed, &tuned].map(|o| o.estimator().unwrap());
        assert_eq!(pair[0].signals(), pair[1].signals());
        for k in 0..10 {
            let [a, b] = &mut pair;
            let t = f64::from(k);
            let (a, b) = (a.push(t, &[1.0]).unwrap()[0], b.push(t, &[1.0]).unwrap()[0]);
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
        // a snapshot is of these numbers
        let mut other = self::tuned(3.0).estimator().unwrap();
        assert!(other.restore(&pair[1].snapshot()).is_err());
        let step = |of: &Blueprint| crate::fastest_mode(of, &[], &[]).unwrap().step();
        assert!((step(&fixed) - step(&tuned)).abs() < 1e-12 * step(&fixed));
    }

    fn run() -> EstimatorSettings {
        EstimatorSettings {
            method: Method::Explicit(Tolerances {
                relative: 1e-11,
                absolute: 1e-13,
                ..Tolerances::default()
            }),
            ..EstimatorSettings::default()
        }
    }

    /// Right from the start the predictor stays right between samples, and holding does not.
    #[test]
    fn the_predictor_leaves_a_right_estimate_alone() {
        let error = |predict: bool| {
            let mut estimator = observer(predict).estimator().unwrap();
            let mut worst = 0.0_f64;
            for k in 0..20 {
                let t = 0.5 * f64::from(k);
                let y = if k % 3 == 2 {
                    f64::NAN
                } else {
                    3.0 * (-t).exp()
                };
                let x = estimator.push(t, &[y]).unwrap()[0];
                worst = worst.max((x - 3.0 * (-t).exp()).abs());
            }
            assert_eq!(estimator.health().sensors[0].missing, 6);
            worst
        };
        assert!(error(true) < 1e-10, "{}", error(true));
        assert!(error(false) > 1e-2);
    }

    #[test]
    fn before_the_first_reading_the_model_runs_alone() {
        let mut observer = observer(false);
        observer.run.method = Method::Rk4(Step::Substeps(50));
        let mut estimator = observer.estimator().unwrap();
        for k in 0..4 {
            let x = estimator.push(f64::from(k), &[f64::NAN]).unwrap()[0];
            assert!((x - 3.0 * (-f64::from(k)).exp()).abs() < 1e-6);
        }
        assert!(matches!(
            estimator.push(2.9, &[1.0]),
            Err(Error::TimeBefore { .. })
        ));
        assert!(matches!(
            estimator.push(4.0, &[]),
            Err(Error::Setting { .. })
        ));
    }
}
