//! Observers whose sensors report when they do.

use lynkeus_run::credible::By;
use lynkeus_run::{ErrorModel, Jacobians, Level, SampledObserver};

use super::device::Device;
use super::function::{Arguments, Target, draft};
use super::linear::{Linear, Which};
use super::machine::{Kind, Machine, arguments, code, refuse_jumps};
use super::template::chosen;
use crate::Refusal;
use crate::code::Part;

const SPREAD: &str = include_str!("runtime/spread.c");
const SAMPLED: &str = include_str!("runtime/sampled.c");

impl Machine {
    pub fn sampled(
        &mut self,
        device: &Device<'_>,
        observer: &SampledObserver,
    ) -> Result<(), Refusal> {
        let system = &observer.system;
        refuse_jumps(system)?;
        let (n, m) = (system.states().len(), observer.sensors.len());
        let told = system.outputs().len().saturating_sub(m);
        self.size("STATES", n);
        self.size("OWN", n - m);
        self.size("OUTPUTS", system.outputs().len());
        self.size("TOLD", told);
        self.size("ESTIMATED", told.saturating_sub(device.monitors));
        let about = system.states().join(", ");
        self.field("x", Kind::Real, &about, system.start().to_vec());
        let (tuned, behind) = match &observer.tuned {
            Some(tuned) => (
                tuned.system.outputs().len(),
                ", then what follows from tuning",
            ),
            None => (0, ""),
        };
        let own = system.signals().len().saturating_sub(tuned);
        let own = &system.signals()[..own];
        let about = format!(
            "{}; the last {m} say whether a measurement follows the model{behind}",
            own.join(", ")
        );
        self.field(
            "inputs",
            Kind::Real,
            &about,
            vec![0.0; system.signals().len()],
        );
        let arguments = arguments(system.states(), system.signals(), device);
        let outputs = draft(
            "What the observer reports, then what it expects of each sensor.",
            "outputs",
            &code(&[Part::all(system.output_tape())])?,
            &arguments,
            &[Target::all("y", system.outputs().len())],
        )?;
        self.add(&outputs);
        let mut holds = vec![];
        let field = match &observer.errors {
            None => {
                self.flow(system, &arguments)?;
                self.integrate(n);
                "flow"
            }
            Some(errors) => {
                self.spread(errors, &arguments)?;
                holds.push("deviations");
                "linearised"
            }
        };
        let is_declared = device.noises.iter().any(Option::is_some);
        match &observer.errors {
            _ if !is_declared => {}
            Some(_) => {
                self.credible(m, By::ErrorSystem, false);
                holds.push("weighed");
            }
            None => {
                self.followed(device.noises);
                holds.push("judged");
            }
        }
        self.tuned(device, observer.tuned.as_ref())?;
        let follows = if observer.predict { "R(1.0)" } else { "R(0.0)" };
        let text = chosen(SAMPLED, &holds).replace("FIELD", field);
        self.add(&text.replace("FOLLOWS", follows));
        Ok(())
    }

    /// The verdict by the noise of the sensors, those without one aside.
    fn followed(&mut self, noises: &[Option<Level>]) {
        let expected = vec![0.0; noises.len()];
        let about = "what was expected of each sensor at the last sample";
        self.field("expected", Kind::Real, about, expected);
        let unknown = Level::Absolute(f64::INFINITY);
        self.noises(noises.iter().map(|noise| noise.unwrap_or(unknown)));
        self.credible(noises.len(), By::Noise, false);
    }

    /// The covariance of an observer's error.
    fn spread(&mut self, errors: &ErrorModel, arguments: &Arguments) -> Result<(), Refusal> {
        let noise = errors.noise();
        let flow = errors.flow();
        let n = flow.system().states().len();
        self.root(&noise.initial);
        self.noises(noise.sensors.iter().copied());
        self.size("LARGER", n);
        let linear = Linear {
            flow,
            noise: &noise.process,
            is_tuned: false,
        };
        self.linear(Which::Free, &linear, arguments)?;
        self.carried(Which::Free, &linear);
        let tape = flow.system().output_tape();
        let Jacobians {
            estimate, output, ..
        } = flow.jacobians();
        for (about, name, jacobian) in [
            (
                "The derivatives of the estimates by x, row by row.",
                "estimate_slopes",
                estimate,
            ),
            (
                "The derivatives of what is expected of the sensors by x, row by row.",
                "reading_slopes",
                output,
            ),
        ] {
            let places = jacobian.places().iter().map(|(i, j)| i * n + j);
            let target = Target {
                name: "c",
                places: places.collect(),
            };
            let outputs = jacobian.outputs();
            let code = code(&[Part { tape, outputs }])?;
            self.add(&draft(about, name, &code, arguments, &[target])?);
        }
        self.add(SPREAD);
        Ok(())
    }
}
