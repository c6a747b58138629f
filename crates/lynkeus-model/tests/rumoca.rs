//! Every shipped model against an independent Modelica compiler: the same free trajectories.
//!
//! Needs the environment variable `LYNKEUS_PYTHON`: a Python with the package `rumoca`.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;

use lynkeus_expr::{Evaluator, Node, Tape};
use lynkeus_model::{LoadOptions, Plant, Variable};

/// Largest deviation, relative to the size of the state.
const TOLERANCE: f64 = 1e-6;
/// Time between compared points, in the time unit of the model.
const STEP: f64 = 2.0;
const COUNT: usize = 10;
/// Runge–Kutta steps between compared points.
const SUBSTEPS: usize = 2000;

#[test]
fn free_trajectories_agree() {
    let Ok(python) = std::env::var("LYNKEUS_PYTHON") else {
        // past the capture of passing tests, so that a skip is seen
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: LYNKEUS_PYTHON names no Python with rumoca\n"),
        );
        return;
    };
    for folder in ["tests/models", "../../examples"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        let models = models_below(&folder);
        assert!(!models.is_empty(), "no model in {}", folder.display());
        for path in models {
            compare(&python, &path);
        }
    }
}

fn models_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(models_below(&path));
        } else if path.extension().is_some_and(|extension| extension == "mo") {
            found.push(path);
        }
    }
    found
}

fn compare(python: &str, path: &Path) {
    let plant =
        Plant::load(path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let (names, theirs) = their_trajectory(python, path, &plant);
    let ours = our_trajectory(&plant);
    for (i, state) in plant.states.iter().enumerate() {
        let column = names.iter().position(|name| *name == state.name).unwrap();
        let size = ours.iter().map(|row| row[i].abs()).fold(1e-9, f64::max);
        for (ours, theirs) in ours.iter().zip(&theirs) {
            let deviation = (ours[i] - theirs[column]).abs() / size;
            let time = theirs[0];
            assert!(
                deviation <= TOLERANCE,
                "{}: {} at {time}: {deviation}",
                path.display(),
                state.name
            );
        }
    }
}

/// The value an input is held at: off its start, so that something happens.
fn held(input: &Variable) -> f64 {
    let middle = 0.5 * (input.min + input.max);
    match middle.is_finite() {
        true => middle,
        false => input.start.unwrap_or(1.0),
    }
}

/// `u=1`, and `u={1,2}` for an array.
fn arguments(plant: &Plant) -> Vec<String> {
    let mut arguments: Vec<(String, Vec<String>)> = vec![];
    for input in &plant.inputs {
        let base = input.name.split('[').next().unwrap().to_owned();
        match arguments.last_mut() {
            Some((last, values)) if *last == base => values.push(held(input).to_string()),
            _ => arguments.push((base, vec![held(input).to_string()])),
        }
    }
    let is_array = |base: &str| {
        plant
            .inputs
            .iter()
            .any(|input| input.name.starts_with(&format!("{base}[")))
    };
    arguments
        .into_iter()
        .map(|(base, values)| match is_array(&base) {
            true => format!("{base}={{{}}}", values.join(",")),
            false => format!("{base}={}", values.join(",")),
        })
        .collect()
}

fn their_trajectory(python: &str, path: &Path, plant: &Plant) -> (Vec<String>, Vec<Vec<f64>>) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rumoca_crosscheck.py");
    let output = Command::new(python)
        .arg(script)
        .arg(path)
        .arg(&plant.name)
        .args([STEP.to_string(), COUNT.to_string()])
        .args(arguments(plant))
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", path.display());
    let text = String::from_utf8(output.stdout).unwrap();
    let mut lines = text.lines();
    let names = lines
        .next()
        .unwrap()
        .split(';')
        .map(str::to_owned)
        .collect();
    let row = |line: &str| line.split(';').map(|cell| cell.parse().unwrap()).collect();
    let rows: Vec<Vec<f64>> = lines.map(row).collect();
    assert_eq!(rows.len(), COUNT + 1);
    (names, rows)
}

/// The classical Runge–Kutta method with small steps.
fn our_trajectory(plant: &Plant) -> Vec<Vec<f64>> {
    let mut slope = Slope::new(plant);
    let mut x: Vec<f64> = plant
        .states
        .iter()
        .map(|state| state.start.unwrap_or(0.0))
        .collect();
    let h = STEP / SUBSTEPS as f64;
    let mut rows = vec![x.clone()];
    for point in 0..COUNT {
        for step in 0..SUBSTEPS {
            let t = STEP * point as f64 + h * step as f64;
            x = runge_kutta(&mut slope, t, &x, h);
        }
        rows.push(x.clone());
    }
    rows
}

fn runge_kutta(slope: &mut Slope, t: f64, x: &[f64], h: f64) -> Vec<f64> {
    let moved =
        |k: &[f64], h: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + h * k).collect() };
    let k1 = slope.at(t, x);
    let k2 = slope.at(t + 0.5 * h, &moved(&k1, 0.5 * h));
    let k3 = slope.at(t + 0.5 * h, &moved(&k2, 0.5 * h));
    let k4 = slope.at(t + h, &moved(&k3, h));
    let mean = |i: usize| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0;
    x.iter().enumerate().map(|(i, x)| x + h * mean(i)).collect()
}

/// x′ with the inputs held.
struct Slope {
    evaluator: Evaluator,
    held: Vec<f64>,
    count: usize,
}

impl Slope {
    fn new(plant: &Plant) -> Self {
        let variables = plant
            .states
            .iter()
            .chain(&plant.inputs)
            .map(|variable| variable.node);
        let inputs: Vec<Node> = std::iter::once(plant.time).chain(variables).collect();
        let tape = Tape::new(&plant.graph, &inputs, &plant.derivatives).unwrap();
        let held = plant.inputs.iter().map(held).collect();
        Self {
            evaluator: tape.evaluator(),
            held,
            count: plant.states.len(),
        }
    }

    fn at(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let arguments: Vec<f64> = [&[t], x, &self.held].concat();
        let mut slope = vec![0.0; self.count];
        self.evaluator.eval(&arguments, &mut slope);
        slope
    }
}
