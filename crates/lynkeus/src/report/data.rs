//! What the script of a page works on.

use lynkeus_model::Plant;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::knob::Knob;
use super::tradeoff::{Drawn, Tradeoff};
use crate::{Error, Outcome, Quantity, Series};
use lynkeus_experiment::course::Samples;
use lynkeus_experiment::prepare::Prepared;

/// Rows that a page holds.
pub(super) const ROWS: usize = 20_000;

/// Samples, curves and sliders.
#[derive(Debug, Serialize)]
struct Data<'a> {
    time: Column<'a>,
    time_unit: Option<String>,
    signals: Vec<Signal<'a>>,
    quantities: Vec<Curves<'a>>,
    watches: Vec<Watched<'a>>,
    knob: Option<Slider<'a>>,
    tradeoff: Option<Drawn>,
}

/// What an observer reads.
#[derive(Debug, Serialize)]
struct Signal<'a> {
    name: &'a str,
    shown: String,
    unit: Option<String>,
    measured: bool,
    values: Column<'a>,
}

/// What is estimated.
#[derive(Debug, Serialize)]
struct Curves<'a> {
    name: String,
    unit: Option<String>,
    description: Option<String>,
    sensor: Option<usize>,
    header: Option<&'a str>,
    deviation_header: Option<&'a str>,
    truth: Option<Column<'a>>,
    estimate: Option<Column<'a>>,
    deviation: Option<Column<'a>>,
}

/// A monitor.
#[derive(Debug, Serialize)]
struct Watched<'a> {
    name: String,
    header: &'a str,
    meaning: String,
    alarm_below: f64,
    estimate: Column<'a>,
}

/// The estimators of the page, with their places among the positions.
#[derive(Debug, Serialize)]
struct Slider<'a> {
    label: Option<&'a str>,
    own: usize,
    positions: Vec<Place>,
}

#[derive(Debug, Serialize)]
struct Place {
    place: Option<usize>,
    factor: f64,
    value: Option<f64>,
    steps: String,
}

/// The rows that a page holds.
#[derive(Debug)]
struct Column<'a>(&'a Series);

impl Serialize for Column<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.0.iter().take(ROWS))
    }
}

pub(super) fn json(
    prepared: &Prepared<'_>,
    outcome: &Outcome,
    samples: &Samples,
    moving: &Result<Knob, Error>,
    tradeoff: Option<&Tradeoff>,
) -> Value {
    let augmented = prepared.augmented();
    let sensors = augmented.outputs.iter().map(|o| &o.variable);
    let signals = sensors.clone().chain(&augmented.inputs);
    let signals = signals.zip(samples.columns()).enumerate();
    let signals = signals.map(|(place, (variable, values))| Signal {
        name: &variable.name,
        shown: shown(&variable.name),
        unit: unit(variable.unit.as_deref()),
        measured: place < augmented.outputs.len(),
        values: Column(values),
    });
    let names: Vec<&str> = sensors.map(|variable| &*variable.name).collect();
    let quantities = outcome.quantities.iter();
    let quantities = quantities.filter(|q| q.estimate.is_some() || q.expected.is_some());
    let quantities = ordered(quantities.collect()).into_iter();
    let watches = outcome.watches.iter().map(|watch| Watched {
        name: shown(&watch.header),
        header: &watch.header,
        meaning: shown(&watch.monitor.meaning),
        alarm_below: watch.monitor.alarm_below,
        estimate: Column(&watch.values),
    });
    json!(Data {
        time: Column(&samples.time),
        time_unit: prepared.study().time_unit.as_deref().map(shown),
        signals: signals.collect(),
        quantities: quantities
            .map(|q| curves(q, prepared.plant(), &names))
            .collect(),
        watches: watches.collect(),
        knob: moving.as_ref().ok().map(|knob| slider(knob, tradeoff)),
        tradeoff: tradeoff.and_then(Tradeoff::drawn),
    })
}

fn slider<'a>(knob: &Knob, tradeoff: Option<&'a Tradeoff>) -> Slider<'a> {
    let positions = tradeoff.map(|tradeoff| &tradeoff.positions);
    let variants = knob.variants.iter().map(|variant| {
        let place = positions.and_then(|p| p.all.iter().position(|p| p.factor == variant.factor));
        let position = place.and_then(|place| positions?.all.get(place));
        Place {
            place,
            factor: variant.factor,
            value: position.and_then(|p| p.value),
            steps: variant.steps.clone(),
        }
    });
    Slider {
        label: positions.map(|p| &*p.label),
        own: knob.own,
        positions: variants.collect(),
    }
}

/// Unknown inputs and hidden states before what is measured.
fn ordered(mut quantities: Vec<&Quantity>) -> Vec<&Quantity> {
    quantities.sort_by_key(|q| (q.measured.is_some(), !q.unknown_input));
    quantities
}

fn curves<'a>(quantity: &'a Quantity, plant: &Plant, sensors: &[&str]) -> Curves<'a> {
    let state = plant.states.iter().find(|s| s.name == quantity.name);
    let shows = |sensor: &&str| {
        let output = plant.outputs.iter().find(|o| o.name == **sensor);
        let is_own = **sensor == quantity.name;
        is_own || output.is_some_and(|o| state.is_some_and(|s| s.node == o.node))
    };
    let sensor = sensors.iter().position(shows);
    let is_estimated = quantity.estimate.is_some();
    let estimate = quantity.estimate.as_ref().or(quantity.expected.as_ref());
    let header = |header: &'a str, series: &Option<Series>| {
        let is_there = is_estimated && series.is_some();
        is_there.then_some(header)
    };
    Curves {
        name: shown(&quantity.name),
        unit: unit(quantity.unit.as_deref()),
        description: quantity.description.as_deref().map(shown),
        sensor: sensor.filter(|_| quantity.measured.is_some()),
        header: header(&quantity.estimate_header, &quantity.estimate),
        deviation_header: header(&quantity.deviation_header, &quantity.deviation),
        truth: quantity.truth.as_ref().map(Column),
        estimate: estimate.map(Column),
        deviation: quantity.deviation.as_ref().map(Column),
    }
}

/// A unit that says something: "1" is Modelica's of numbers without one.
fn unit(unit: Option<&str>) -> Option<String> {
    unit.filter(|unit| !unit.is_empty() && *unit != "1")
        .map(shown)
}

/// JSON that no script ends with.
pub(super) fn in_a_script(value: &Value) -> String {
    let text = value.to_string();
    let each = |c: char| match c {
        '<' => "\\u003c".to_owned(),
        // a reader of the page sees it; there is none beyond 16 bits
        c if lynkeus_answer::visible::is_hidden(c) => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    };
    text.chars().map(each).collect()
}

/// Names of others as they can be shown.
fn shown(text: &str) -> String {
    crate::visible::lines(text).into_owned()
}
