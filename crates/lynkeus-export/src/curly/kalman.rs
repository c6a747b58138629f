//! Kalman filters.

use lynkeus_run::credible::By;
use lynkeus_run::filter::{FilterKind, FilterModel, FilterSettings, Limits, Sensor, SigmaPoints};
use lynkeus_run::{BetweenSamples, Blueprint, Level};

use super::device::Device;
use super::function::{Arguments, Target, draft};
use super::linear::{Linear, Which};
use super::machine::{FIELD, Kind, Machine, arguments, code, refuse_jumps};
use super::tables::{number, table};
use super::template::{chosen, exchanged};
use crate::Refusal;
use crate::code::Part;

const INTEGRATE: &str = include_str!("runtime/integrate.c");
const JUDGE: &str = include_str!("runtime/judge.c");
const EXTENDED: &str = include_str!("runtime/extended.c");
const UNSCENTED: &str = include_str!("runtime/unscented.c");
const FILTER: &str = include_str!("runtime/filter.c");

impl Machine {
    /// Nothing for an observer that is no filter.
    pub fn filter(&mut self, device: &Device<'_>) -> Result<(), Refusal> {
        let Blueprint::Filter {
            model,
            settings,
            run,
        } = device.blueprint
        else {
            return Ok(());
        };
        if run.between == BetweenSamples::Linear {
            return Err(Refusal::LooksAhead);
        }
        if settings.bounds.is_some() {
            return Err(Refusal::Projection);
        }
        let (states, inputs) = (model.states(), model.inputs());
        let arguments = arguments(states, inputs, device);
        let room = inputs.len() + device.tunables.len();
        let room = vec![0.0; room.max(1)];
        self.size("STATES", states.len());
        self.field(
            "x",
            Kind::Real,
            &states.join(", "),
            model.flow().system().start().to_vec(),
        );
        self.field("inputs", Kind::Real, &inputs.join(", "), room);
        self.root(model.initial_variance());
        // also a polynomial has no value once it has run away
        let confined = model.confined().filter(|confined| {
            let mut bounds = confined.bounds.iter();
            bounds.any(|b| b.low.is_finite() || b.high.is_finite())
        });
        let has_limits = model.sensors().iter().any(|sensor| sensor.limits.is_some());
        let is_share = |sensor: &Sensor| matches!(sensor.noise, Level::Relative(_));
        let is_relative = model.sensors().iter().any(is_share);
        let facts = [
            (confined.is_some(), "confined"),
            (device.deviations, "deviations"),
            (settings.gate.is_some(), "gate"),
            (has_limits, "limits"),
            (is_relative, "relative"),
            (
                settings.gate.is_some() || has_limits || is_relative,
                "deviation",
            ),
        ];
        let holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        self.measure(model, &arguments, &settings.kind)?;
        let sensors = model.sensors().len();
        self.credible(sensors, By::Filter, settings.gate.is_some());
        self.judge(model, settings, &holds);
        let free = Linear {
            flow: model.flow(),
            noise: model.process_noise(),
            is_tuned: !device.tunables.is_empty(),
        };
        self.tuned(device, None)?;
        let field = self.engine(&settings.kind, &free, &arguments, &holds)?;
        let is_extended = settings.kind == FilterKind::Extended;
        let which_inside = Which::Inside {
            is_shared: is_extended || free.is_noisy(),
            is_carried: is_extended,
        };
        if let Some(confined) = confined {
            let inside = Linear {
                flow: &confined.flow,
                noise: model.process_noise(),
                is_tuned: free.is_tuned,
            };
            self.linear(which_inside, &inside, &arguments)?;
            self.carried(which_inside, &inside);
            let ends = |end: fn(&lynkeus_run::filter::Bounds) -> f64| -> Vec<f64> {
                confined.bounds.iter().map(end).collect()
            };
            self.tables += &table("range_from", &ends(|b| b.low));
            self.tables += &table("range_to", &ends(|b| b.high));
        }
        let text = chosen(FILTER, &holds)
            .replace("FIELD_INSIDE", "linearised_inside")
            .replace("predict_inside", &which_inside.renamed("predict"));
        self.add(&text.replace("FIELD", field));
        Ok(())
    }

    /// The way from sample to sample, and the correction; the name of the flow.
    fn engine(
        &mut self,
        kind: &FilterKind,
        free: &Linear<'_>,
        arguments: &Arguments,
        holds: &[&str],
    ) -> Result<&'static str, Refusal> {
        let n = free.flow.system().states().len();
        match kind {
            FilterKind::MovingHorizon(..) => Err(Refusal::Window),
            FilterKind::Extended => {
                self.size("LARGER", n);
                self.linear(Which::Free, free, arguments)?;
                self.carried(Which::Free, free);
                self.add(&chosen(EXTENDED, holds));
                Ok("linearised")
            }
            FilterKind::Unscented(points) => {
                self.unscented(points, free, arguments, holds)?;
                Ok("flow")
            }
        }
    }

    /// h, and for the extended filter the entries of C.
    fn measure(
        &mut self,
        model: &FilterModel,
        arguments: &Arguments,
        kind: &FilterKind,
    ) -> Result<(), Refusal> {
        let (n, m) = (model.dimension(), model.sensors().len());
        let output_map = model.output_map();
        refuse_jumps(output_map.system())?;
        let tape = output_map.system().output_tape();
        let mut targets = vec![Target::all("h", m)];
        let mut outputs = 0..m;
        if *kind == FilterKind::Extended {
            let entries = output_map.jacobians().output.places();
            let places = entries.iter().map(|(i, j)| i * n + j);
            targets.push(Target {
                name: "c",
                places: places.collect(),
            });
            outputs = 0..tape.outputs();
        }
        let text = draft(
            "What the sensors show (c: the derivatives by x, row by row).",
            "measure",
            &code(&[Part { tape, outputs }])?,
            arguments,
            &targets,
        )?;
        self.add(&text);
        Ok(())
    }

    fn judge(&mut self, model: &FilterModel, settings: &FilterSettings, holds: &[&str]) {
        let m = model.sensors().len();
        let mut kept = |name, kind, about: &str| self.field(name, kind, about, vec![0.0; m]);
        kept("readings", Kind::Real, "of the last sample");
        kept("became", Kind::Int, "what became of each reading");
        kept("rejected", Kind::Int, "readings rejected in a row");
        kept(
            "moved",
            Kind::Int,
            "of these, how many differ from the one before",
        );
        kept("last", Kind::Real, "the reading before");
        self.noises(model.sensors().iter().map(|s| s.noise));
        if holds.contains(&"limits") {
            let ends = |end: f64, pick: fn(Limits) -> f64| -> Vec<f64> {
                let sensors = model.sensors().iter();
                sensors.map(|s| s.limits.map_or(end, pick)).collect()
            };
            self.tables += &table("lowest", &ends(f64::NEG_INFINITY, |l| l.low));
            self.tables += &table("highest", &ends(f64::INFINITY, |l| l.high));
        }
        let gate = number(settings.gate.unwrap_or_default());
        let [shown, surprise] = match holds.contains(&"limits") {
            true => [
                "shown_of(i, reading)",
                "end == R(0.0) ? reading - predicted : R(0.0)",
            ],
            false => ["reading", "reading - predicted"],
        };
        let text = chosen(JUDGE, holds).replace("GATE", &gate);
        let text = text.replace("SHOWN_READING", shown);
        self.add(&text.replace("SURPRISE", surprise));
    }

    fn unscented(
        &mut self,
        points: &SigmaPoints,
        free: &Linear<'_>,
        arguments: &Arguments,
        about: &[&str],
    ) -> Result<(), Refusal> {
        let n = free.flow.system().states().len();
        let has_limits = about.contains(&"limits");
        let sensors = self.sizes.iter().find(|size| size.0 == "SENSORS");
        self.size("LARGER", sensors.map_or(n, |size| size.1.max(n)));
        let weights = points.weights(n).map_err(|error| Refusal::Setting {
            error: error.to_string(),
        })?;
        self.size("POINTS", 2 * n + 1);
        match free.is_noisy() {
            true => self.linear(Which::Free, free, arguments)?,
            false => self.add(FIELD),
        }
        self.flow(free.flow.system(), arguments)?;
        self.add(&exchanged(INTEGRATE, |word| match word {
            "integrate" => Some("integrate_point".to_owned()),
            "DIMENSION" => Some("STATES".to_owned()),
            _ => None,
        }));
        let facts = [
            (weights.centre >= 0.0, "definite"),
            (free.is_noisy(), "noisy"),
            (has_limits, "limits"),
        ];
        let holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        let first = u8::from(free.is_noisy());
        let rounds = if has_limits { "SENSORS + 1" } else { "1" };
        let text = exchanged(&chosen(UNSCENTED, &holds), |word| {
            Some(number(match word {
                "FIRST" => return Some(first.to_string()),
                "ROUNDS" => return Some(rounds.to_owned()),
                "SPREAD" => weights.spread,
                "WEIGHT_OF_CENTRE" => weights.centre,
                "WEIGHT_OF_OTHERS" => weights.other,
                "WEIGHT_OF_MEAN" => weights.mean_of_centre,
                _ => return None,
            }))
        });
        self.add(&text);
        Ok(())
    }
}
