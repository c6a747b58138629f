//! Every shipped model against an independent Modelica compiler: the same free trajectories.
//!
//! Needs the environment variable `LYNKEUS_PYTHON`: a Python with the package `rumoca`.

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

/// The models of `examples/flattened`: the flat file, the text of parts it is made from, the
/// model in it, and the compiler's name for what it writes.
const FLATTENED: [[&str; 4]; 10] = [
    ["filter", "electrical", "Electrical.Filter", "base-modelica"],
    ["bridge", "electrical", "Electrical.Bridge", "flat-modelica"],
    [
        "rectifier",
        "electrical",
        "Electrical.Rectifier",
        "base-modelica",
    ],
    ["house", "thermofluid", "Thermofluid.House", "dae-modelica"],
    ["tanks", "thermofluid", "Thermofluid.Tanks", "dae-modelica"],
    [
        "exchanger",
        "thermofluid",
        "Thermofluid.Exchanger",
        "base-modelica",
    ],
    [
        "drive_train",
        "mechanics",
        "Mechanics.DriveTrain",
        "base-modelica",
    ],
    ["coupled", "mechanics", "Mechanics.Coupled", "flat-modelica"],
    ["train", "mechanics", "Mechanics.Train", "dae-modelica"],
    [
        "double_pendulum",
        "mechanics",
        "Mechanics.DoublePendulum",
        "base-modelica",
    ],
];

fn python() -> Option<String> {
    let found = std::env::var("LYNKEUS_PYTHON").ok();
    if found.is_none() {
        // past the capture of passing tests, so that a skip is seen
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: LYNKEUS_PYTHON names no Python with rumoca\n"),
        );
    }
    found
}

#[test]
fn flattened_models_agree() {
    let Some(python) = python() else {
        return;
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/flattened");
    for [file, source, model, rendering] in FLATTENED {
        let path = folder.join(file).with_extension("mo");
        let text = std::fs::read_to_string(&path).unwrap();
        let plant = Plant::load(&path, &LoadOptions::default()).unwrap();
        let held = |input: &Variable| input.start.unwrap();
        let inputs = plant.inputs.iter();
        let inputs = inputs.map(|input| format!("{}={}", input.name, held(input)));
        let output = Command::new(&python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rumoca_flattened.py"))
            .arg(folder.join("source").join(source).with_extension("mo"))
            .args([model, rendering, &STEP.to_string(), &COUNT.to_string()])
            .args(inputs)
            .output()
            .unwrap();
        let output = succeeded(&path, output);
        let (flat, table) = output.split_once("====\n").unwrap();
        assert_eq!(
            flat.trim(),
            text.trim(),
            "{file} is not what the compiler writes"
        );
        let theirs = table_of(table);
        let ours = our_trajectory(&plant, &held);
        agree(&path, &plant, &ours, &theirs);
    }
}

#[test]
fn free_trajectories_agree() {
    let Some(python) = python() else {
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
        // flat files are compared with the text they are made from
        if path.ends_with("flattened") {
            continue;
        }
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
    let theirs = their_trajectory(python, path, &plant);
    let ours = our_trajectory(&plant, &held);
    agree(path, &plant, &ours, &theirs);
}

fn agree(path: &Path, plant: &Plant, ours: &[Vec<f64>], theirs: &(Vec<String>, Vec<Vec<f64>>)) {
    let (names, theirs) = theirs;
    for (i, state) in plant.states.iter().enumerate() {
        let column = names.iter().position(|name| *name == state.name).unwrap();
        let size = ours.iter().map(|row| row[i].abs()).fold(1e-9, f64::max);
        for (ours, theirs) in ours.iter().zip(theirs) {
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
    table_of(&succeeded(path, output))
}

fn succeeded(path: &Path, output: std::process::Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", path.display());
    String::from_utf8(output.stdout).unwrap()
}

/// Names of the columns, and the rows.
fn table_of(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
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
fn our_trajectory(plant: &Plant, held: &dyn Fn(&Variable) -> f64) -> Vec<Vec<f64>> {
    let mut slope = Slope::new(plant, held);
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
    fn new(plant: &Plant, held: &dyn Fn(&Variable) -> f64) -> Self {
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
