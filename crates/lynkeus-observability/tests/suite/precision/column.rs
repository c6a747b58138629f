//! Which two trays of the distillation column to measure: the order of pairs, computed and by brute
//! force.

use std::collections::HashMap;
use std::path::Path;

use lynkeus_expr::Node;
use lynkeus_model::{LoadOptions, Plant, parse_expression};
use lynkeus_observability::precision::{
    Deviation, Experiment, Precision, Quantity, Sensor, Window,
};
use lynkeus_run::System;

use super::fits::{Bench, Random};

const NOISE: f64 = 0.01;

/// What is known beforehand: far less than ten minutes of samples tell of the present.
const PRIOR: f64 = 0.05;
const STEP: f64 = 0.1;
const SAMPLES: usize = 100;
const START: f64 = 15.0;

/// The feed's composition falls in the middle of the window, as in the example's study.
const FEED: &str = "if time < 20 then 0.75 else 0.38";

fn column() -> Plant {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/column/column.mo");
    Plant::load(&file, &LoadOptions::default()).unwrap()
}

fn feed(plant: &Plant) -> Node {
    let names = |name: &str| (name == "time").then_some(plant.time);
    parse_expression(FEED, &plant.graph, &names).unwrap()
}

/// Every input as an expression of time.
fn courses(plant: &Plant) -> Vec<(Node, Node)> {
    let course = |name: &str, start: Option<f64>| match name {
        "Zf" => feed(plant),
        _ => plant.graph.constant(start.unwrap()).node(),
    };
    let inputs = plant.inputs.iter();
    inputs.map(|i| (i.node, course(&i.name, i.start))).collect()
}

fn computed(plant: &Plant) -> Precision {
    let quantity = |v: &lynkeus_model::Variable| Quantity {
        name: v.name.clone(),
        node: v.node,
        start: v.start.unwrap_or(0.0),
        scale: 1.0,
        is_known: false,
    };
    let unknown = plant.inputs.iter().filter(|i| i.name == "Zf");
    let window = Window {
        start: START,
        step: STEP,
        horizons: vec![SAMPLES],
    };
    let experiment = Experiment {
        states: plant.states.iter().map(quantity).collect(),
        derivatives: plant.derivatives.clone(),
        unknown: unknown.map(quantity).collect(),
        inputs: courses(plant),
        sensors: plant
            .states
            .iter()
            .map(|s| Sensor {
                name: s.name.clone(),
                node: s.node,
                noise: Deviation::Absolute(NOISE),
                limits: None,
            })
            .collect(),
        ..Experiment::new(&plant.graph, plant.time, window)
    };
    experiment.run().unwrap()
}

/// The column with an offset of its feed's composition as a thirteenth state.
fn bench(plant: &Plant) -> Bench {
    let g = &plant.graph;
    let offset = g.symbol("offset of the feed");
    let mut inputs: HashMap<Node, Node> = courses(plant).into_iter().collect();
    for (input, course) in &mut inputs {
        if g.symbol_name(*input).as_deref() == Some("Zf") {
            *course = (g.expr(*course) + offset).node();
        }
    }
    let mut states: Vec<(String, Node, f64)> = plant
        .states
        .iter()
        .map(|s| (s.name.clone(), s.node, s.start.unwrap()))
        .collect();
    let outputs: Vec<(String, Node)> = states.iter().map(|s| (s.0.clone(), s.1)).collect();
    states.push(("offset".into(), offset.node(), 0.0));
    let mut slopes = g.substitute(&plant.derivatives, &inputs);
    slopes.push(g.constant(0.0).node());
    Bench {
        system: System::new(g, plant.time, &states, &[], &slopes, &outputs).unwrap(),
        start: START,
        step: STEP,
        samples: SAMPLES,
        substeps: 2,
        noise: NOISE,
        prior: Some(PRIOR),
    }
}

/// Ranks of values, the smallest first.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |x: &f64| values.iter().filter(|y| *y < x).count() as f64;
    values.iter().map(rank).collect()
}

/// Spearman's rank correlation of values without ties.
fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let pairs = ranks(a).into_iter().zip(ranks(b));
    let sum: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    1.0 - 6.0 * sum / (n * (n * n - 1.0))
}

#[test]
fn two_trays_rank_as_brute_force_says() {
    let plant = column();
    assert_eq!(
        plant.graph.symbol_name(plant.inputs[2].node).as_deref(),
        Some("Zf")
    );
    let precision = computed(&plant);
    let candidates: Vec<usize> = (0..plant.states.len()).collect();
    let advice = precision.advise(&[0, 11], &candidates);
    let all = &advice.pairs;
    assert_eq!(all.len(), 66);
    // eight of them, from the best to the worst
    let chosen: Vec<_> = (0..8).map(|i| &all[i * (all.len() - 1) / 7]).collect();
    let bench = bench(&plant);
    let mut random = Random::new(7);
    let brute: Vec<f64> = chosen
        .iter()
        .map(|set| {
            let (_, end) = bench.errors(&set.sensors, 5, 300, &mut random);
            end.iter().map(|e| e.ln()).sum::<f64>() / end.len() as f64
        })
        .collect();
    let scores: Vec<f64> = chosen.iter().map(|set| set.score).collect();
    assert!(spearman(&scores, &brute) > 0.9, "{scores:?} {brute:?}");
    assert!(brute[1..].iter().all(|b| *b > brute[0]), "{brute:?}");
    for (set, brute) in chosen.iter().zip(&brute) {
        // what is known beforehand can only help, and helps only where the samples tell less
        let worst = set.deviations.present.iter().copied().fold(0.0, f64::max);
        assert!(*brute < set.score + 0.1, "{scores:?} {brute:?}");
        assert!(
            *brute > set.score - 0.1 || worst > 0.2 * PRIOR,
            "{set:?} {brute}"
        );
    }
}
