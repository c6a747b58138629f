//! What the families' tests share.

use std::collections::HashMap;

use lynkeus_expr::{Node, Tape};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{
    Assumptions, Certificate, Check, Design, DesignError, Examination, Family, Tuning,
};
use lynkeus_structure::{AugmentedPlant, Sensors};
use lynkeus_words::Words;

/// A plant from its text.
pub fn plant(text: &str) -> Plant {
    Plant::from_modelica(text, "plant.mo", &LoadOptions::default()).unwrap()
}

/// The design of a family with every output measured.
pub fn design_with(
    family: &'static dyn Family,
    plant: &Plant,
    unknown: &[&str],
    tuning: &Tuning,
) -> Result<Design, DesignError> {
    let unknown = unknown.iter().map(|s| s.to_string()).collect();
    let sensors = Sensors {
        unknown,
        ..Sensors::default()
    };
    family.design(&AugmentedPlant::new(plant, &sensors).unwrap(), tuning)
}

/// The examination that a refusal carries.
pub fn refused(family: &'static dyn Family, plant: &Plant, tuning: &Tuning) -> Examination {
    match design_with(family, plant, &[], tuning) {
        Err(DesignError::Refused(examination)) => *examination,
        other => panic!("expected a refusal, found {other:?}"),
    }
}

/// The derivative of the observer's states at a state, inputs and measurements.
pub fn slope(plant: &Plant, design: &Design, state: &[f64], u: &[f64], y: &[f64]) -> Vec<f64> {
    let observer = &design.observer;
    let mut inputs = vec![observer.time];
    inputs.extend(observer.states.iter().map(|(s, _)| s.symbol));
    inputs.extend(observer.inputs.iter().map(|s| s.symbol));
    inputs.extend(observer.measured.iter().map(|s| s.symbol));
    let tape = Tape::new(&plant.graph, &inputs, &observer.derivatives).unwrap();
    let mut out = vec![0.0; state.len()];
    tape.evaluator()
        .eval(&[&[0.0], state, u, y].concat(), &mut out);
    out
}

/// Equal to the last few bits.
pub fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let scale = expected.abs().max(1e-3);
        assert!(
            (found - expected).abs() < 1e-13 * scale,
            "{found} against {expected}"
        );
    }
}

/// The file of that name among the independent reference trajectories, as rows of
/// numbers below a header; none, with a message, where they are not at hand.
pub fn reference(name: &str) -> Option<(Vec<String>, Vec<Vec<f64>>)> {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/reference/");
    let Ok(text) = std::fs::read_to_string(format!("{shared}{name}")) else {
        // past the capture of passing tests, so that a skip is seen
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {shared}{name} is not at hand\n"),
        );
        return None;
    };
    let mut lines = text.lines();
    let header = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_owned)
        .collect();
    let row = |line: &str| line.split(',').map(|x| x.parse().unwrap()).collect();
    Some((header, lines.map(row).collect()))
}

/// Every number within 1e-6 of the reference, relative to its size or to a
/// thousandth of the column's largest.
pub fn assert_follows(found: &[Vec<f64>], reference: &[Vec<f64>]) {
    assert_eq!(found.len(), reference.len());
    for column in 0..reference[0].len() {
        let largest = reference
            .iter()
            .fold(0.0, |m: f64, r| m.max(r[column].abs()));
        for (found, expected) in found.iter().zip(reference) {
            let scale = expected[column].abs().max(1e-3 * largest);
            let error = (found[column] - expected[column]).abs();
            assert!(
                error <= 1e-6 * scale,
                "column {column} at t = {}: {} against {}",
                expected[0],
                found[column],
                expected[column]
            );
        }
    }
}

/// What [`run`] returns: one entry per row.
pub struct Run {
    /// t, the plant's states, the observer's states
    pub rows: Vec<Vec<f64>>,
    /// the smallest value that each monitor took at any step
    pub monitors: Vec<f64>,
}

/// Plant and observer together from `x0` and the observer's start, without noise,
/// by the classical Runge–Kutta method with steps of at most `step` between the
/// times of `rows`. `inputs` are every input of the plant as a Modelica expression
/// of time.
pub fn run(
    plant: &Plant,
    design: &Design,
    inputs: &[(&str, &str)],
    x0: &[f64],
    rows: &[f64],
    step: f64,
) -> Run {
    let observer = &design.observer;
    let graph = &plant.graph;
    let time_only = |name: &str| (name == "time").then_some(plant.time);
    let inputs: Vec<(String, Node)> = inputs
        .iter()
        .map(|(name, text)| {
            let node = lynkeus_model::parse_expression(text, graph, &time_only).unwrap();
            (name.to_string(), node)
        })
        .collect();
    let named = |name: &String| plant.outputs.iter().find(|o| o.name == *name).unwrap().node;
    let measured = observer.measured.iter();
    let y: HashMap<Node, Node> = measured.map(|s| (s.symbol, named(&s.name))).collect();
    let slopes = observer
        .input_derivative_expressions(graph, &inputs)
        .unwrap();
    let find = |list: &[(String, Node)], name: &str| {
        list.iter()
            .find(|(n, _)| n == name)
            .map(|(_, node)| *node)
            .unwrap()
    };
    let mut u: HashMap<Node, Node> = plant
        .inputs
        .iter()
        .map(|v| (v.node, find(&inputs, &v.name)))
        .collect();
    let derivatives = observer.input_derivatives.iter();
    u.extend(derivatives.map(|d| (d.signal.symbol, find(&slopes, &d.signal.name))));
    let monitors: Vec<Node> = observer.monitors.iter().map(|m| m.node).collect();
    let outputs = [&plant.derivatives[..], &observer.derivatives, &monitors].concat();
    let outputs = graph.substitute(&graph.substitute(&outputs, &y), &u);
    let mut symbols = vec![plant.time];
    symbols.extend(plant.states.iter().map(|s| s.node));
    symbols.extend(observer.states.iter().map(|(s, _)| s.symbol));
    let mut evaluator = Tape::new(graph, &symbols, &outputs).unwrap().evaluator();
    let mut x = x0.to_vec();
    x.extend(observer.states.iter().map(|(_, start)| start));
    let n = x.len();
    let mut lowest = vec![f64::INFINITY; monitors.len()];
    let mut slope = |t: f64, x: &[f64]| {
        let mut out = vec![0.0; outputs.len()];
        evaluator.eval(&[&[t], x].concat(), &mut out);
        for (lowest, value) in lowest.iter_mut().zip(out.split_off(n)) {
            *lowest = lowest.min(value);
        }
        out
    };
    let moved = |x: &[f64], h: f64, k: &[f64]| -> Vec<f64> {
        x.iter().zip(k).map(|(x, k)| x + h * k).collect()
    };
    let mut found: Vec<Vec<f64>> = vec![[&rows[..1], &x].concat()];
    for pair in rows.windows(2) {
        let steps = ((pair[1] - pair[0]) / step - 1e-9).ceil();
        let h = (pair[1] - pair[0]) / steps;
        for k in 0..steps as usize {
            let t = pair[0] + k as f64 * h;
            let a = slope(t, &x);
            let b = slope(t + h / 2.0, &moved(&x, h / 2.0, &a));
            let c = slope(t + h / 2.0, &moved(&x, h / 2.0, &b));
            let d = slope(t + h, &moved(&x, h, &c));
            for i in 0..n {
                x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
            }
        }
        found.push([&pair[1..], &x].concat());
    }
    Run {
        rows: found,
        monitors: lowest,
    }
}

/// A plant measured by all of its outputs, a tuning, and bounds of what acts on it.
pub struct Guaranteed<'a> {
    pub family: &'a dyn Family,
    pub plant: &'a Plant,
    pub unknown: &'a [&'a str],
    pub tuning: Tuning,
    pub drift: Vec<f64>,
    pub noise: Vec<f64>,
}

impl Guaranteed<'_> {
    /// What the family's theorem guarantees on the declared box.
    pub fn certificate(&self) -> Certificate {
        let sensors = Sensors {
            unknown: self.unknown.iter().map(|s| s.to_string()).collect(),
            ..Sensors::default()
        };
        let augmented = AugmentedPlant::new(self.plant, &sensors).unwrap();
        let assumptions = Assumptions::new(&augmented, augmented.region())
            .unwrap()
            .with_drift(self.drift.clone())
            .with_noise(self.noise.clone());
        self.family
            .theorem(&augmented, &self.tuning, &assumptions)
            .unwrap()
    }
}

/// The constant of that name.
pub fn constant(certificate: &Certificate, name: &str) -> f64 {
    let found = certificate.constants.iter().find(|c| c.name == name);
    found
        .unwrap_or_else(|| panic!("no {name} in {:?}", certificate.constants))
        .value
}

/// The hypothesis whose name holds `part`.
pub fn hypothesis<'c>(certificate: &'c Certificate, part: &str) -> &'c Check {
    let found = certificate
        .hypotheses
        .iter()
        .find(|c| c.statement.words().contains(part));
    found.unwrap_or_else(|| panic!("no {part} in {:?}", certificate.hypotheses))
}

/// On the safe side of `exact` and no further from it than rounding explains.
pub fn assert_safely(found: f64, exact: f64, above: bool) {
    let excess = (found - exact) / exact.abs();
    let excess = if above { excess } else { -excess };
    assert!((-1e-14..1e-8).contains(&excess), "{found} against {exact}");
}

/// Deterministic numbers in (0, 1).
pub fn numbers(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    }
}
