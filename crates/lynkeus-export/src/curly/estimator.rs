//! Estimators as drafts: observers and Kalman filters whose sensors report when they do.

use lynkeus_run::credible::{By, CHANCE, CLIP, ENOUGH, FEW};
use lynkeus_run::filter::{FilterKind, FilterSettings, Limits, NoisyModel, Sensor, SigmaPoints};
use lynkeus_run::{BetweenSamples, Jacobians, Level, Manifold, Tuned, Updates};

use super::device::{Device, Entry, FirstReading};
use super::draft::{Arguments, Target, draft, number, places, table};
use super::machine::{FIELD, Linear, Machine, Which, code, refuse_jumps};
use super::pass::{discrete, integrated_point, remembering};
use super::syntax::Type;
use super::template::{chosen, exchanged};
use crate::Refusal;

const PUSH: &str = include_str!("runtime/push.c");
const SPREAD: &str = include_str!("runtime/spread.c");
const SAMPLED: &str = include_str!("runtime/sampled.c");

/// The estimator of a device as a draft.
///
/// # Errors
/// [`Refusal`]: what solves an optimisation, looks ahead, has no fixed step or jumps with time,
/// and operations that no language has.
pub(super) fn drafted(device: &Device<'_>) -> Result<Machine, Refusal> {
    let mut machine = Machine::default();
    let sensors = device.sensors();
    machine.size("SENSORS", sensors);
    machine.size("INPUTS", device.signals.len().saturating_sub(sensors));
    machine.size("SIGNALS", device.signals.len());
    machine.size("REPORTED", device.estimates.len());
    machine.single("time", Type::Double, "of the last sample", 0.0);
    machine.single("started", Type::Truth, "whether there was one", 0.0);
    machine.single(
        "scale",
        Type::Real,
        "the largest start, reading or input so far",
        1.0,
    );
    let about = "samples in a row for which the equations had no value or an estimate ran away";
    machine.single("refused", Type::Int, about, 0.0);
    machine.steps(device.blueprint.run.method)?;
    let mut holds = vec![];
    match &device.blueprint.updates {
        Updates::Jumps { .. } => {
            holds.push("sampled");
            machine.sampled(device)?;
        }
        Updates::Filter { .. } => machine.filter(device)?,
    }
    if !device.first_readings.is_empty() {
        holds.push("first");
    }
    if !device.tunables.is_empty() {
        holds.push("tunable");
    }
    let first: Vec<String> = device.first_readings.iter().map(first_reading).collect();
    machine.add(&chosen(PUSH, &holds).replace("        FIRST_READINGS\n", &first.concat()));
    Ok(machine)
}

fn first_reading(first: &FirstReading) -> String {
    let FirstReading {
        sensor,
        state,
        slope,
        offset,
    } = first;
    let (slope, offset) = (number(*slope), number(*offset));
    format!(
        "        if (isfinite(signals[{sensor}])) {{\n            s->x[{state}] = (signals[{sensor}] - ({offset})) / ({slope});\n        }}\n"
    )
}

/// States and signals with what the device knows of them.
fn arguments(states: &[String], signals: &[String], device: &Device<'_>) -> Arguments {
    let known = |name: &String| device.words.iter().find(|entry| entry.name == *name);
    let entry = |name: &String| known(name).cloned().unwrap_or_else(|| Entry::named(name));
    Arguments {
        x: states.iter().map(entry).collect(),
        w: signals.iter().map(entry).collect(),
    }
}

impl Machine {
    /// Nothing for a filter.
    fn sampled(&mut self, device: &Device<'_>) -> Result<(), Refusal> {
        let Updates::Jumps {
            predict,
            errors,
            tuned: made,
        } = &device.blueprint.updates
        else {
            return Ok(());
        };
        let system = &device.blueprint.flow;
        refuse_jumps(system)?;
        let (n, m) = (system.states().len(), device.sensors());
        let told = system.outputs().len().saturating_sub(m);
        self.size("STATES", n);
        self.size("OWN", n - m);
        self.size("OUTPUTS", system.outputs().len());
        self.size("TOLD", told);
        self.size("ESTIMATED", told.saturating_sub(device.monitors));
        let about = system.states().join(", ");
        self.field("x", Type::Real, &about, system.start().to_vec());
        let (tuned, behind) = match made {
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
            Type::Real,
            &about,
            vec![0.0; system.signals().len()],
        );
        let arguments = arguments(system.states(), system.signals(), device);
        let own = system.expressions();
        let outputs = draft(
            "What the observer reports, then what it expects of each sensor.",
            "outputs",
            &code(&own, &[own.outputs])?,
            &arguments,
            &[Target::all("y", system.outputs().len())],
        )?;
        self.add(&outputs);
        let mut holds = vec![];
        let field = match errors {
            None => {
                self.flow(system, &arguments)?;
                self.integrate(system);
                "flow"
            }
            Some(errors) => {
                self.spread(errors, &arguments)?;
                holds.push("deviations");
                if self.drawn(errors) {
                    holds.push("drawn");
                }
                "linearised"
            }
        };
        let is_declared = device.noises.iter().any(Option::is_some);
        match errors {
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
        self.tuned(device, made.as_ref())?;
        let follows = if *predict { "R(1.0)" } else { "R(0.0)" };
        let text = chosen(SAMPLED, &holds).replace("FIELD", field);
        self.add(&text.replace("FOLLOWS", follows));
        Ok(())
    }

    /// The verdict by the noise of the sensors, those without one aside.
    fn followed(&mut self, noises: &[Option<Level>]) {
        let expected = vec![0.0; noises.len()];
        let about = "what was expected of each sensor at the last sample";
        self.field("expected", Type::Real, about, expected);
        let unknown = Level::Absolute(f64::INFINITY);
        self.noises(noises.iter().map(|noise| noise.unwrap_or(unknown)));
        self.credible(noises.len(), By::Noise, false);
    }

    /// The covariance of an observer's error.
    fn spread(&mut self, model: &NoisyModel, arguments: &Arguments) -> Result<(), Refusal> {
        let flow = &model.flow;
        let n = flow.system().states().len();
        self.root(&model.initial_variance);
        self.noises(model.sensors.iter().map(|s| s.noise));
        self.size("LARGER", n);
        let linear = Linear {
            flow,
            noise: &model.process_noise,
            is_tuned: false,
        };
        self.linear(Which::Free, &linear, arguments)?;
        self.carried(Which::Free, &linear);
        let own = flow.system().expressions();
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
            let code = code(&own, &[&own.outputs[jacobian.outputs()]])?;
            self.add(&draft(about, name, &code, arguments, &[target])?);
        }
        self.add(SPREAD);
        Ok(())
    }
}

const JUDGE: &str = include_str!("runtime/judge.c");
const EXTENDED: &str = include_str!("runtime/extended.c");
const UNSCENTED: &str = include_str!("runtime/unscented.c");
const FILTER: &str = include_str!("runtime/filter.c");

impl Machine {
    /// Nothing for an observer that is no filter.
    fn filter(&mut self, device: &Device<'_>) -> Result<(), Refusal> {
        let Updates::Filter { model, settings } = &device.blueprint.updates else {
            return Ok(());
        };
        if device.blueprint.run.between == BetweenSamples::Linear {
            return Err(Refusal::LooksAhead);
        }
        if settings.projects {
            return Err(Refusal::Projection);
        }
        let flow = model.flow.system();
        let (states, inputs) = (flow.states(), flow.signals());
        let arguments = arguments(states, inputs, device);
        let room = inputs.len() + device.tunables.len();
        let room = vec![0.0; room.max(1)];
        self.size("STATES", states.len());
        let (start, root) = model.start();
        self.field("x", Type::Real, &states.join(", "), start);
        self.field("inputs", Type::Real, &inputs.join(", "), room);
        self.lower_root(root);
        // also a polynomial has no value once it has run away
        let mut ranges = model.ranges.iter();
        let is_bounded = ranges.any(|b| b.low.is_finite() || b.high.is_finite());
        let confined = model.confined.as_ref().filter(|_| is_bounded);
        let has_limits = model.sensors.iter().any(|sensor| sensor.limits.is_some());
        let is_share = |sensor: &Sensor| matches!(sensor.noise, Level::Relative(_));
        let is_relative = model.sensors.iter().any(is_share);
        let has_rotations = !model.manifold.rotations.is_empty();
        let has_dials = !model.manifold.dials.is_empty();
        let has_events = flow.has_clauses();
        let discrete = match settings.kind {
            FilterKind::Unscented(_) => discrete(model),
            _ => vec![],
        };
        if !discrete.is_empty() {
            self.size("DISCRETE", discrete.len());
            self.tables += &places("discrete_states", discrete.iter().copied());
        }
        let facts = [
            (confined.is_some(), "confined"),
            (has_events, "events"),
            (!discrete.is_empty(), "discrete"),
            (has_rotations, "rotations"),
            (has_dials, "dials"),
            (!model.manifold.mirrors.is_empty(), "mirrors"),
            (has_rotations && confined.is_some(), "curved_inside"),
            (!device.turns.is_empty(), "turns"),
            (device.deviations && !has_rotations, "each"),
            (device.deviations && has_rotations, "one"),
            (settings.gate.is_some(), "gate"),
            (has_limits, "limits"),
            (is_relative, "relative"),
            (
                settings.gate.is_some() || has_limits || is_relative,
                "deviation",
            ),
        ];
        let mut holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        if settings.iterations > 1 && settings.kind == FilterKind::Extended {
            self.size("ITERATIONS", settings.iterations);
            holds.push("iterated");
            holds.extend(has_rotations.then_some("iterated_rotations"));
            holds.extend(has_limits.then_some("iterated_limits"));
        }
        let is_drawn = self.drawn(model);
        if is_drawn {
            self.size("SHOWN", states.len() - model.drawn());
            holds.push("drawn");
        }
        self.curved(device, model);
        self.measure(model, &arguments, &settings.kind)?;
        let sensors = model.sensors.len();
        self.credible(sensors, By::Filter, settings.gate.is_some());
        self.judge(model, settings, &holds);
        let free = Linear {
            flow: &model.flow,
            noise: &model.process_noise,
            is_tuned: !device.tunables.is_empty(),
        };
        self.tuned(device, None)?;
        self.events(flow, &arguments, device.blueprint.run.method)?;
        let field = self.engine(&settings.kind, &free, &arguments, &holds)?;
        let is_extended = settings.kind == FilterKind::Extended;
        let which_inside = Which::Inside {
            is_shared: is_extended || free.is_noisy(),
            is_carried: is_extended,
        };
        if let Some(confined) = confined {
            let inside = Linear {
                flow: confined,
                noise: &model.process_noise,
                is_tuned: free.is_tuned,
            };
            self.linear(which_inside, &inside, &arguments)?;
            self.carried(which_inside, &inside);
            let ends =
                |end: fn(&Limits) -> f64| -> Vec<f64> { model.ranges.iter().map(end).collect() };
            self.tables += &table("range_from", &ends(|b| b.low));
            self.tables += &table("range_to", &ends(|b| b.high));
        }
        let text = remembering(&chosen(FILTER, &holds), has_events)
            .replace("FIELD_INSIDE", "linearised_inside")
            .replace("predict_inside", &which_inside.renamed("predict"));
        let text = text.replace("FIELD", field);
        self.add(&match is_drawn {
            true => text,
            false => text.replace("SHOWN", "STATES"),
        });
        Ok(())
    }

    /// Whether some states are drawn anew in every sample, and their number.
    fn drawn(&mut self, model: &NoisyModel) -> bool {
        let count = model.drawn();
        if count > 0 {
            self.size("DRAWN", count);
        }
        count > 0
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
            FilterKind::Particles(..) => Err(Refusal::Particles),
            FilterKind::Extended => {
                self.size("LARGER", n);
                self.linear(Which::Free, free, arguments)?;
                self.carried(Which::Free, free);
                let reading = match holds.contains(&"dials") {
                    true => "lifted(i, s->readings[i], predicted)",
                    false => "s->readings[i]",
                };
                let ordinary = match holds.contains(&"limits") {
                    true => "believed[i] != 0 && end_of(i, s->readings[i]) == R(0.0)",
                    false => "believed[i] != 0",
                };
                let text = chosen(EXTENDED, holds).replace("ORDINARY", ordinary);
                self.add(&text.replace("READING_HERE", reading));
                Ok("linearised")
            }
            FilterKind::Unscented(points) => {
                self.unscented(points, free, arguments, holds)?;
                Ok("flow")
            }
        }
    }

    /// Which states and sensors are angles or rotations.
    fn curved(&mut self, device: &Device<'_>, model: &NoisyModel) {
        let Manifold {
            rotations,
            dials,
            mirrors,
            ..
        } = &model.manifold;
        let (n, m) = (model.process_noise.len(), model.sensors.len());
        if !rotations.is_empty() {
            self.size("ROTATIONS", rotations.len());
            self.tables += &places("rotation_places", rotations.iter().copied());
            if device.deviations {
                let element = |i: usize| {
                    let own = rotations.iter().find(|r| (**r..**r + 4).contains(&i));
                    own.map_or(4, |first| i - first)
                };
                self.tables += &places("elements", (0..n).map(element));
            }
        }
        if !dials.is_empty() {
            let is_dial = |i: usize| usize::from(dials.contains(&i));
            self.tables += &places("dials", (0..m).map(is_dial));
        }
        if !mirrors.is_empty() {
            self.size("MIRRORS", mirrors.len());
            let mirror = |i: usize| {
                let own = mirrors.iter().position(|mirror| mirror.contains(&i));
                own.unwrap_or(mirrors.len())
            };
            self.tables += &places("mirror_of", (0..m).map(mirror));
        }
        if !device.turns.is_empty() {
            self.size("TURNS", device.turns.len());
            self.tables += &places("turn_states", device.turns.iter().map(|turn| turn.0));
            let from: Vec<f64> = device.turns.iter().map(|turn| turn.1).collect();
            self.tables += &table("turns_from", &from);
        }
    }

    /// h, and for the extended filter the entries of C.
    fn measure(
        &mut self,
        model: &NoisyModel,
        arguments: &Arguments,
        kind: &FilterKind,
    ) -> Result<(), Refusal> {
        let (n, m) = (model.process_noise.len(), model.sensors.len());
        let output_map = &model.output_map;
        refuse_jumps(output_map.system())?;
        let own = output_map.system().expressions();
        let mut targets = vec![Target::all("h", m)];
        let mut outputs = &own.outputs[..m];
        if *kind == FilterKind::Extended {
            let entries = output_map.jacobians().output.places();
            let places = entries.iter().map(|(i, j)| i * n + j);
            targets.push(Target {
                name: "c",
                places: places.collect(),
            });
            outputs = own.outputs;
        }
        let text = draft(
            "What the sensors show (c: the derivatives by x, row by row).",
            "measure",
            &code(&own, &[outputs])?,
            arguments,
            &targets,
        )?;
        self.add(&text);
        Ok(())
    }

    fn judge(&mut self, model: &NoisyModel, settings: &FilterSettings, holds: &[&str]) {
        let m = model.sensors.len();
        let mut kept = |name, kind, about: &str| self.field(name, kind, about, vec![0.0; m]);
        kept("readings", Type::Real, "of the last sample");
        kept("became", Type::Int, "what became of each reading");
        kept("rejected", Type::Int, "readings rejected in a row");
        kept(
            "moved",
            Type::Int,
            "of these, how many differ from the one before",
        );
        kept("last", Type::Real, "the reading before");
        self.noises(model.sensors.iter().map(|s| s.noise));
        if holds.contains(&"limits") {
            let ends = |end: f64, pick: fn(Limits) -> f64| -> Vec<f64> {
                let sensors = model.sensors.iter();
                sensors.map(|s| s.limits.map_or(end, pick)).collect()
            };
            self.tables += &table("lowest", &ends(f64::NEG_INFINITY, |l| l.low));
            self.tables += &table("highest", &ends(f64::INFINITY, |l| l.high));
        }
        let gate = number(settings.gate.unwrap_or_default());
        let reading = match holds.contains(&"dials") {
            true => "lifted(i, reading, predicted)",
            false => "reading",
        };
        let [shown, surprise] = match holds.contains(&"limits") {
            true => [
                format!("shown_of(i, {reading})"),
                format!("end == R(0.0) ? {reading} - predicted : R(0.0)"),
            ],
            false => [reading.to_owned(), format!("{reading} - predicted")],
        };
        let text = chosen(JUDGE, holds).replace("GATE", &gate);
        let text = text.replace("LOCKED_OUT", &settings.patience.to_string());
        let text = text.replace("MOVED_OF_THEM", &settings.patience.div_ceil(2).to_string());
        let text = text.replace("SHOWN_READING", &shown);
        self.add(&text.replace("SURPRISE", &surprise));
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
        self.add(&integrated_point(free.flow.system()));
        let facts = [
            (weights.centre >= 0.0, "definite"),
            (free.is_noisy(), "noisy"),
            (has_limits, "limits"),
            (about.contains(&"events"), "events"),
            (about.contains(&"events") && weights.centre >= 0.0, "moving"),
            (about.contains(&"discrete"), "discrete"),
            (about.contains(&"rotations"), "rotations"),
            (about.contains(&"dials"), "dials"),
            (about.contains(&"mirrors"), "mirrors"),
        ];
        let holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        let [parameter, argument] = match about.contains(&"rotations") {
            true => ["const real *before, ", "before, "],
            false => ["", ""],
        };
        let reading = match about.contains(&"dials") {
            true => "lifted(i, s->readings[i], h[i])",
            false => "s->readings[i]",
        };
        let root = match about.contains(&"events") {
            true => "root_of_moving",
            false => "root_of_rows",
        };
        let text = remembering(&chosen(UNSCENTED, &holds), about.contains(&"events"))
            .replace("BEFORE_PARAMETER", parameter)
            .replace("BEFORE_ARGUMENT", argument)
            .replace("READING_SHOWN", reading)
            .replace("ROOT_OF_ROWS", root);
        let first = u8::from(free.is_noisy());
        let rounds = if has_limits { "SENSORS + 1" } else { "1" };
        let text = exchanged(&text, |word| {
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

const CREDIBLE: &str = include_str!("runtime/credible.c");

/// Readings of a block once there were that many; two blocks are judged together.
const LONGEST_BLOCK: usize = 128;

impl Machine {
    /// What is kept of each sensor's readings, and the verdict on them.
    fn credible(&mut self, sensors: usize, by: By, has_gate: bool) {
        let both = || vec![0.0; 2 * sensors];
        let about =
            "of each sensor, in this block and in the one before: Σ z², z how many deviations off";
        self.field("squares", Type::Real, about, both());
        self.field("largest", Type::Real, "of these z²", both());
        self.field("taken", Type::Int, "readings with such a z", both());
        if has_gate {
            let about = "readings that the gate kept out, likewise";
            self.field("kept_out", Type::Int, about, both());
        }
        let about = "readings of a full block";
        self.field("block", Type::Int, about, vec![1.0; sensors]);
        let allowed = by.limit().powi(2);
        // P(χ² of n degrees > n + 2√(nx) + 2x) < exp(-x) (Laurent and Massart), and 2√(nx) is n + x at most
        let chance = 3.0 * -CHANCE.ln();
        let facts = [
            (has_gate, "gate"),
            // of one reading the limit says it, too
            (allowed < 2.0 + chance, "chance"),
        ];
        let holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        let text = exchanged(&chosen(CREDIBLE, &holds), |word| {
            Some(match word {
                "MOST_OFF" => number(CLIP * CLIP),
                "ALLOWED" => number(allowed),
                "CHANCE" => number(chance),
                "ENOUGH" => ENOUGH.to_string(),
                "FEW" => FEW.to_string(),
                "LONGEST_BLOCK" => LONGEST_BLOCK.to_string(),
                _ => return None,
            })
        });
        self.add(&text);
    }
}

const TUNED: &str = include_str!("runtime/tuned.c");

impl Machine {
    /// The numbers with what follows from them: `gains` of an observer; the factor on its process
    /// noise of a filter. What is made of them lies behind the known inputs, and what an observer
    /// reads besides.
    fn tuned(&mut self, device: &Device<'_>, gains: Option<&Tuned>) -> Result<(), Refusal> {
        let tunables = device.tunables;
        if tunables.is_empty() {
            return Ok(());
        }
        self.size("TUNABLES", tunables.len());
        let names: Vec<&str> = tunables.iter().map(|t| t.entry.name.as_str()).collect();
        let starts = tunables.iter().map(|tunable| tunable.start).collect();
        let about = format!("may be changed at any time: {}", names.join(", "));
        self.field("tuning", Type::Real, &about, starts);
        let holds: &[&str] = match gains {
            None => &[],
            Some(gains) => {
                let count = gains.system.outputs().len();
                self.size("TUNED", count);
                let about = "the numbers for which the last inputs hold";
                self.field("tuned_for", Type::Real, about, vec![0.0; tunables.len()]);
                let arguments = Arguments {
                    x: vec![],
                    w: names.iter().map(|name| Entry::named(*name)).collect(),
                };
                let own = gains.system.expressions();
                let text = draft(
                    "What the equations make of the numbers that may be changed.",
                    "tune",
                    &code(&own, &[own.outputs])?,
                    &arguments,
                    &[Target::all("gains", count)],
                )?;
                self.add(&text);
                &["gains"]
            }
        };
        self.add(&chosen(TUNED, holds));
        Ok(())
    }
}
