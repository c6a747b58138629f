//! What the script of a page works on.

use lynkeus_model::Plant;
use serde_json::{Value, json};

use super::knob::Knob;
use super::tradeoff::Tradeoff;
use crate::course::Samples;
use crate::prepare::Prepared;
use crate::{Error, Outcome, Quantity, Series};

/// Rows that a page holds.
pub(super) const ROWS: usize = 20_000;

/// Samples, curves and sliders.
pub(super) fn json(
    prepared: &Prepared<'_>,
    outcome: &Outcome,
    samples: &Samples,
    moving: &Result<Knob, Error>,
    tradeoff: Option<&Tradeoff>,
) -> Value {
    let augmented = prepared.augmented();
    let outputs = augmented.outputs.iter().map(|o| &o.variable);
    let signals = outputs.chain(&augmented.inputs).zip(samples.columns());
    let signals: Vec<Value> = signals
        .enumerate()
        .map(|(place, (variable, values))| {
            json!({
                "name": variable.name,
                "shown": shown(&variable.name),
                "unit": unit(variable.unit.as_deref()),
                "measured": place < augmented.outputs.len(),
                "values": column(values),
            })
        })
        .collect();
    let names: Vec<&str> = augmented
        .outputs
        .iter()
        .map(|o| o.variable.name.as_str())
        .collect();
    let quantities = outcome.quantities.iter();
    let quantities = quantities.filter(|q| q.estimate.is_some() || q.expected.is_some());
    let quantities = ordered(quantities.collect());
    let quantities = quantities
        .into_iter()
        .map(|q| quantity(q, prepared.plant(), &names));
    let watches = outcome.watches.iter().map(|watch| {
        json!({
            "name": shown(&watch.header),
            "header": watch.header,
            "meaning": shown(&watch.monitor.meaning),
            "alarm_below": watch.monitor.alarm_below,
            "estimate": column(&watch.values),
        })
    });
    let time_unit = prepared.study().time_unit.as_deref();
    json!({
        "time": column(&samples.time),
        "time_unit": time_unit.map(shown),
        "signals": signals,
        "quantities": quantities.collect::<Vec<_>>(),
        "watches": watches.collect::<Vec<_>>(),
        "knob": moving.as_ref().ok().map(|knob| slider(knob, tradeoff)),
        "tradeoff": tradeoff.and_then(Tradeoff::json),
    })
}

/// The estimators of the page, with their places among the positions.
fn slider(knob: &Knob, tradeoff: Option<&Tradeoff>) -> Value {
    let positions = tradeoff.map(|tradeoff| &tradeoff.positions);
    let variants = knob.variants.iter().map(|variant| {
        let place = positions.and_then(|p| p.all.iter().position(|p| p.factor == variant.factor));
        let position = place.and_then(|place| positions?.all.get(place));
        json!({
            "place": place,
            "factor": variant.factor,
            "value": position.and_then(|p| p.value),
            "steps": variant.steps,
        })
    });
    json!({
        "label": positions.map(|p| &p.label),
        "own": knob.own,
        "positions": variants.collect::<Vec<_>>(),
    })
}

/// Unknown inputs and hidden states before what is measured.
fn ordered(mut quantities: Vec<&Quantity>) -> Vec<&Quantity> {
    quantities.sort_by_key(|q| (q.measured.is_some(), !q.unknown_input));
    quantities
}

fn quantity(quantity: &Quantity, plant: &Plant, sensors: &[&str]) -> Value {
    let state = plant.states.iter().find(|s| s.name == quantity.name);
    let shows = |sensor: &&str| {
        let output = plant.outputs.iter().find(|o| o.name == **sensor);
        let is_own = **sensor == quantity.name;
        is_own || output.is_some_and(|o| state.is_some_and(|s| s.node == o.node))
    };
    let sensor = sensors.iter().position(shows);
    let is_estimated = quantity.estimate.is_some();
    let estimate = quantity.estimate.as_ref().or(quantity.expected.as_ref());
    let header = |header: &str, series: &Option<Series>| {
        let is_there = is_estimated && series.is_some();
        is_there.then(|| header.to_owned())
    };
    json!({
        "name": shown(&quantity.name),
        "unit": unit(quantity.unit.as_deref()),
        "description": quantity.description.as_deref().map(shown),
        "sensor": sensor.filter(|_| quantity.measured.is_some()),
        "header": header(&quantity.estimate_header, &quantity.estimate),
        "deviation_header": header(&quantity.deviation_header, &quantity.deviation),
        "truth": quantity.truth.as_ref().map(column),
        "estimate": estimate.map(column),
        "deviation": quantity.deviation.as_ref().map(column),
    })
}

/// A unit that says something: "1" is Modelica's of numbers without one.
fn unit(unit: Option<&str>) -> Option<String> {
    unit.filter(|unit| !unit.is_empty() && *unit != "1")
        .map(shown)
}

fn column(values: &Series) -> Value {
    let rows = values.iter().take(ROWS);
    rows.collect::<Vec<f64>>().into()
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
