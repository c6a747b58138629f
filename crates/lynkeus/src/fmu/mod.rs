//! A study's estimator as a functional mock-up unit: an archive with sources, a description and, where a
//! compiler is at hand, a library for this machine.

mod archive;
mod library;

use std::collections::BTreeSet;

use lynkeus_export::Refusal;
use lynkeus_export::curly::c::Precision;
use lynkeus_export::curly::fmu::{self, Base, Component, Quantity, Unit, Version};
use lynkeus_export::curly::{Device, Entry};
use lynkeus_model::{BaseUnit, Variable};
use lynkeus_observers::Design;
use lynkeus_run::Blueprint;

use crate::export::{Artifact, typical};
use crate::prepare::Prepared;

/// A study's estimator, ready to be written.
pub(crate) struct Made<'a> {
    pub device: &'a Device<'a>,
    pub prepared: &'a Prepared<'a>,
    pub design: &'a Design,
}

/// The archive of an estimator. The system's C compiler makes a library of its C; where there is none, the
/// archive has sources only, and a note says so.
///
/// # Errors
/// What cannot run elsewhere.
pub(crate) fn archive(
    made: &Made<'_>,
    version: Version,
    precision: Precision,
    notes: &mut Vec<String>,
) -> Result<Artifact, Refusal> {
    let described = Described::of(made);
    let component = described.component(made);
    let identifier = component.identifier();
    let files = fmu::files(&component, version, precision)?.into_iter();
    let mut entries: Vec<(String, Vec<u8>)> = files
        .map(|file| (file.name, file.text.into_bytes()))
        .collect();
    match library::compile(&identifier, &entries) {
        Ok(library) => entries.push((library::place(&identifier, version), library)),
        Err(why) => notes.push(format!(
            "sources only, which not every tool takes: {why}. Where there is a C compiler, export again"
        )),
    }
    Ok(Artifact {
        name: format!("{identifier}.fmu"),
        bytes: archive::stored(&entries),
    })
}

/// What the description says of the variables.
struct Described {
    signals: Vec<Quantity>,
    estimates: Vec<Quantity>,
    starts: Vec<Quantity>,
    tunables: Vec<Quantity>,
    units: Vec<Unit>,
    time: String,
}

impl Described {
    fn of(made: &Made<'_>) -> Self {
        let plant = made.prepared.plant();
        let known = |name: &str| -> Option<&Variable> {
            let all = plant.inputs.iter().chain(&plant.outputs);
            all.chain(&plant.states).find(|known| known.name == name)
        };
        let inputs = plant.inputs.iter();
        let inputs: Vec<&Variable> = inputs.collect();
        let measured = made.design.observer.measured.len();
        let signals = made
            .device
            .signals
            .iter()
            .enumerate()
            .map(|(place, entry)| {
                let variable = known(&entry.name);
                let input = inputs.iter().find(|input| input.name == entry.name);
                let start = match (place < measured, input) {
                    // nothing is measured until it is given
                    (true, _) => f64::NAN,
                    (false, input) => input.map_or(0.0, |input| typical(input)),
                };
                quantity(entry.name.clone(), variable, start)
            });
        let signals: Vec<Quantity> = signals.collect();
        let estimates = estimates(made);
        let mut taken: BTreeSet<String> = ["time".to_owned()].into();
        taken.extend(signals.iter().chain(&estimates).map(|q| q.name.clone()));
        let mut free = |mut name: String| {
            while !taken.insert(name.clone()) {
                name.push('_');
            }
            name
        };
        let starts = starts(made).into_iter().map(|(state, start)| Quantity {
            description: format!("where the estimator begins with {state}"),
            ..quantity(free(format!("{state}_start")), known(&state), start)
        });
        let starts: Vec<Quantity> = starts.collect();
        let tunables = made.device.tunables.iter().map(|tunable| Quantity {
            description: format!(
                "{}; what is guaranteed holds for the value at the start only",
                tunable.entry.about
            ),
            ..quantity(free(tunable.entry.name.clone()), None, tunable.start)
        });
        let tunables = tunables.collect();
        let named = signals.iter().chain(&estimates).chain(&starts);
        let named: BTreeSet<&String> = named.filter_map(|q| q.unit.as_ref()).collect();
        let unit = made.prepared.study().time_unit.as_deref();
        Self {
            units: named.into_iter().map(|name| unit_of(name)).collect(),
            signals,
            estimates,
            starts,
            tunables,
            time: unit.map_or_else(
                || "in the model's unit of time".to_owned(),
                |unit| format!("in {unit}"),
            ),
        }
    }

    fn component<'a>(&'a self, made: &Made<'a>) -> Component<'a> {
        Component {
            device: made.device,
            signals: &self.signals,
            estimates: &self.estimates,
            starts: &self.starts,
            tunables: &self.tunables,
            units: &self.units,
            time: &self.time,
        }
    }
}

/// Estimates, their standard deviations where there are any, monitors.
fn estimates(made: &Made<'_>) -> Vec<Quantity> {
    let observer = &made.design.observer;
    let count = observer.estimates.len();
    let of = |place: usize| observer.estimates.get(place).map(|e| &e.variable);
    let each = |(place, entry): (usize, &Entry)| {
        let name = entry.name.clone();
        match (place < count, place < 2 * count && made.device.deviations) {
            (true, _) => quantity(name, of(place), 0.0),
            (false, true) => Quantity {
                is_difference: true,
                description: entry.about.clone(),
                ..quantity(name, of(place - count), 0.0)
            },
            (false, false) => Quantity {
                description: entry.about.clone(),
                ..quantity(name, None, 0.0)
            },
        }
    };
    made.device.estimates.iter().enumerate().map(each).collect()
}

/// States and where they start; what is held of the measurements is none.
fn starts(made: &Made<'_>) -> Vec<(String, f64)> {
    let (names, values, own) = match made.device.blueprint {
        Blueprint::Sampled { observer, .. } => {
            let states = observer.system.states();
            let own = states.len().saturating_sub(observer.sensors.len());
            (states, observer.system.start(), own)
        }
        Blueprint::Filter { model, .. } => {
            (model.states(), model.flow().start(), model.states().len())
        }
    };
    let pairs = names.iter().cloned().zip(values.iter().copied());
    pairs.take(own).collect()
}

fn quantity(name: String, variable: Option<&Variable>, start: f64) -> Quantity {
    Quantity {
        name,
        description: variable
            .and_then(|v| v.description.clone())
            .unwrap_or_default(),
        unit: variable
            .and_then(|v| v.unit.clone())
            .filter(|u| !u.trim().is_empty()),
        is_difference: false,
        start,
    }
}

fn unit_of(name: &str) -> Unit {
    let base = BaseUnit::of(name).map(|unit| Base {
        powers: unit.powers,
        factor: unit.factor,
        offset: unit.offset,
    });
    Unit {
        name: name.to_owned(),
        base,
    }
}
