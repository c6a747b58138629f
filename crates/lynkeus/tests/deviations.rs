//! The standard deviations that the families and the filters report, beside the errors of many
//! runs: the plant driven by the declared noises, its sensors by theirs.
//!
//! `cargo test --release -p lynkeus --test deviations -- --ignored --nocapture` makes the table of
//! docs/ekf.md from 500 runs.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod normal;

use std::path::Path;

use lynkeus::run::{Estimator, Evaluation, Events, Rk4, System};
use lynkeus::{Study, prepare};

use normal::Normal;

/// A study beside the truth that it is tried on.
struct Case {
    /// folder and model among the examples
    model: &'static str,
    /// the study from `[sensors]` on, without noises
    observer: &'static str,
    sensors: &'static [&'static str],
    unknown: &'static [&'static str],
    disturbances: &'static [&'static str],
    /// known inputs, and where the unknown ones start
    input: fn(&str, f64) -> f64,
    /// standard deviation of every sensor
    noise: f64,
    /// densities
    wander: &'static [(&'static str, f64)],
    /// variance of every state at the start
    start: f64,
    /// the sampling interval
    step: f64,
    rows: usize,
}

const LEE: Case = Case {
    model: "lee/lee.mo",
    observer: "family = \"block-triangular\"\ntheta = [3, 9]\nk = [[2, 1], [2, 1]]\ncorrection = \"lee\"\ninitial = { x1 = 2, x2 = 1, x3 = 3, x4 = 3.5 }",
    sensors: &["y1", "y2"],
    unknown: &[],
    disturbances: &[],
    input: |_, t| 2.0 * (3.0 * t).sin(),
    noise: 0.01,
    wander: &[("x2", 1e-3), ("x4", 1e-3)],
    start: 0.0,
    step: 0.02,
    rows: 300,
};

const COLUMN: Case = Case {
    model: "column/column.mo",
    observer: "family = \"triangular\"\ntheta = 3.5\ndelta = [1, 1.2727272727272727]\nr = 1\nS = [\n{ diag = [1.5, 2, 4, 8, 10.5, 15.5, 17.5], off = [-0.5, -1.5, -2, -3, -4, -5] },\n{ diag = [1.5, 2, 4, 8, 10.5, 15.5], off = [-0.5, -1.5, -2, -3, -4] },\n]\ninitial = { default = 0.5 }",
    sensors: &["top", "bottom"],
    unknown: &["Zf"],
    disturbances: &[],
    input: |name, _| match name {
        "L" => 4.69,
        "V" => 5.94,
        _ => 0.6,
    },
    noise: 1e-6,
    wander: &[("Zf", 1e-6)],
    start: 0.0,
    step: 0.1,
    rows: 300,
};

const LTAIEF: Case = Case {
    model: "ltaief/ltaief.mo",
    observer: "family = \"state-affine\"\ntheta = 10\nS0 = 1\ninitial = { x1 = 1, x2 = 0.5, x3 = 0.5 }",
    sensors: &["y"],
    unknown: &[],
    disturbances: &["e1"],
    input: |name, t| {
        let turn = std::f64::consts::PI * t;
        match name {
            "u1" => (11.0 * turn).sin(),
            "u2" => (11.0 * turn).cos(),
            "u3" => 5.0 * (2.0 * turn).cos(),
            _ => 0.0,
        }
    },
    noise: 1e-3,
    wander: &[("x2", 1e-4), ("x3", 1e-4)],
    start: 0.0,
    step: 0.005,
    rows: 600,
};

/// Up to 7.2 s: before 4 s what is said of x5 is still the quarter of its range that it began with.
const FARZA: Case = Case {
    model: "farza/farza.mo",
    observer: "family = \"unknown-input\"\ntheta = [60, 15]\ninitial = { x1 = 1, x2 = 1, x3 = 1, x4 = 2, x5 = 10, v = 0 }",
    sensors: &["y1", "y2", "y3"],
    unknown: &["v"],
    disturbances: &[],
    input: |_, _| 0.0,
    noise: 1e-4,
    wander: &[("v", 1e-2)],
    start: 0.0,
    step: 0.004,
    rows: 1800,
};

/// Up to 1.5 s: later x3 passes through zero, where the output hides it and nothing linear holds.
const GERMANI: Case = Case {
    model: "germani-manes/germani_manes.mo",
    observer: "family = \"drift-observable\"\nvariant = \"practical\"\npoles = [-8, -9.6, -11.52]\nfilter_poles = [-80, -96]\nfilter_initial = [5, 12.566370614359172]\ninitial = { x1 = 0.5, x2 = 0.5, x3 = 0.5 }",
    sensors: &["y"],
    unknown: &[],
    disturbances: &[],
    input: |_, t| 5.0 + 2.0 * (2.0 * std::f64::consts::PI * t).sin(),
    noise: 1e-3,
    wander: &[("x2", 1e-3)],
    start: 0.0,
    step: 0.005,
    rows: 300,
};

/// Lee's plant from an uncertain start, for a filter.
const fn filter(observer: &'static str) -> Case {
    Case {
        observer,
        noise: 0.02,
        wander: &[("x2", 1e-2), ("x4", 1e-2)],
        start: 0.01,
        step: 0.05,
        rows: 120,
        ..LEE
    }
}

const EKF: Case = filter(
    "family = \"ekf\"\ninitial_variance = { default = 0.01 }\ninitial = { x1 = 2, x2 = 1, x3 = 3, x4 = 3.5 }",
);
const UKF: Case = filter(
    "family = \"ukf\"\ninitial_variance = { default = 0.01 }\ninitial = { x1 = 2, x2 = 1, x3 = 3, x4 = 3.5 }",
);
const MHE: Case = filter(
    "family = \"mhe\"\nhorizon = 4\ninitial_variance = { default = 0.01 }\ninitial = { x1 = 2, x2 = 1, x3 = 3, x4 = 3.5 }",
);

/// The plant with its unknown inputs as states, and what the study says of it.
struct Truth {
    plant: Evaluation,
    /// names of the states, unknown inputs last
    states: Vec<String>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    start: Vec<f64>,
    densities: Vec<f64>,
}

impl Truth {
    fn new(case: &Case, study: &Study) -> Self {
        let plant = prepare::plant(study).unwrap();
        let (unknown, known): (Vec<_>, Vec<_>) = plant
            .inputs
            .iter()
            .partition(|input| case.unknown.contains(&input.name.as_str()));
        let own = plant
            .states
            .iter()
            .map(|s| (s.name.clone(), s.node, s.start.unwrap()));
        let wandering = unknown
            .iter()
            .map(|u| (u.name.clone(), u.node, (case.input)(&u.name, 0.0)));
        let states: Vec<_> = own.chain(wandering).collect();
        let zero = plant.graph.constant(0.0).node();
        let rates = plant.derivatives.iter().copied();
        let rates: Vec<_> = rates.chain(unknown.iter().map(|_| zero)).collect();
        let signals: Vec<_> = known.iter().map(|k| (k.name.clone(), k.node)).collect();
        let measured = plant.outputs.iter();
        let measured = measured.filter(|o| case.sensors.contains(&o.name.as_str()));
        let outputs: Vec<_> = measured.map(|o| (o.name.clone(), o.node)).collect();
        let system = System::new(
            &plant.graph,
            plant.time,
            &states,
            &signals,
            &rates,
            &outputs,
        )
        .unwrap();
        let density = |name: &String| {
            case.wander
                .iter()
                .find(|w| w.0 == name)
                .map_or(0.0, |w| w.1)
        };
        Self {
            plant: system.evaluation(),
            densities: states.iter().map(|s| density(&s.0)).collect(),
            start: states.iter().map(|s| s.2).collect(),
            states: states.into_iter().map(|s| s.0).collect(),
            inputs: signals.into_iter().map(|s| s.0).collect(),
            outputs: outputs.into_iter().map(|o| o.0).collect(),
        }
    }

    /// Follows the plant from a start of its own, and hands on every row.
    fn run(&mut self, case: &Case, seed: u64, mut take: impl FnMut(usize, Row<'_>)) {
        const SUBSTEPS: usize = 8;
        let mut normal = Normal(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1));
        // neighbouring seeds part after some steps
        for _ in 0..10 {
            normal.uniform();
        }
        let mut x = self.start.clone();
        for (x, name) in x.iter_mut().zip(&self.states) {
            if !case.unknown.contains(&name.as_str()) {
                *x += case.start.sqrt() * normal.next();
            }
        }
        let mut rk4 = Rk4::new(x.len());
        let mut y = vec![0.0; self.outputs.len()];
        for k in 0..case.rows {
            let t = case.step * k as f64;
            let inputs = self.inputs.iter().map(|name| (case.input)(name, t));
            let inputs: Vec<f64> = inputs.collect();
            self.plant.signals_mut().copy_from_slice(&inputs);
            self.plant.enter(t);
            self.plant.outputs(t, &x, &mut y);
            y.iter_mut().for_each(|y| *y += case.noise * normal.next());
            let row = Row {
                t,
                y: &y,
                inputs: &inputs,
                x: &x,
            };
            take(k, row);
            // inputs are held from sample to sample, as the estimate takes them
            let h = case.step / SUBSTEPS as f64;
            for i in 0..SUBSTEPS {
                let step = rk4.step(&mut self.plant, t + h * i as f64, h, &mut x);
                step.unwrap();
                for (x, q) in x.iter_mut().zip(&self.densities) {
                    *x += (q * h).sqrt() * normal.next();
                }
            }
        }
    }
}

/// A sample, and the truth.
struct Row<'a> {
    t: f64,
    y: &'a [f64],
    inputs: &'a [f64],
    x: &'a [f64],
}

/// The case as a study, with the noises that its truth has.
fn study(case: &Case, folder: &Path) -> Study {
    let model = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples")
        .join(case.model);
    let wander = case.wander.iter();
    let wander: Vec<String> = wander.map(|(n, q)| format!("\"{n}\" = {q:e}")).collect();
    let noise = case.sensors.iter();
    let noise = noise.map(|s| format!("{s} = {:e}", case.noise));
    let noise: Vec<String> = noise.collect();
    let text = format!(
        "plant = {:?}\n[sensors]\nunknown = {:?}\ndisturbances = {:?}\nnoise = {{ {} }}\n[process_noise]\n{}\n[observer]\n{}\n[estimate]\nsd = true\nbetween_samples = {:?}\n",
        model.canonicalize().unwrap(),
        case.unknown,
        case.disturbances,
        noise.join(", "),
        wander.join("\n"),
        case.observer,
        if case.start > 0.0 { "hold" } else { "predict" },
    );
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    Study::load(&path).unwrap()
}

/// How far each quantity's errors scatter in the last third of many runs, as a share of what is said.
fn ratios(case: &Case, runs: u64) -> Vec<(String, f64)> {
    let folder = tempfile::tempdir().unwrap();
    let study = study(case, folder.path());
    let mut truth = Truth::new(case, &study);
    // made once: equations and linearisation are compiled in it
    let mut estimator = lynkeus::estimator(&study).unwrap();
    let start = estimator.snapshot();
    let (sensors, known) = estimator.signals().split_at(estimator.sensors());
    assert_eq!(sensors, truth.outputs);
    // without the disturbances
    let place = |name: &String| truth.inputs.iter().position(|input| input == name);
    let known: Vec<usize> = known.iter().map(|name| place(name).unwrap()).collect();
    let mut all = Scatter::of_each(case, &estimator, &truth.states);
    for seed in 0..runs {
        estimator.restore(&start).unwrap();
        truth.run(case, seed, |k, row| {
            let inputs = known.iter().map(|&place| row.inputs[place]);
            let signals: Vec<f64> = row.y.iter().copied().chain(inputs).collect();
            estimator.push(row.t, &signals).unwrap();
            let late = k.checked_sub(2 * case.rows / 3);
            late.into_iter().for_each(|late| {
                all.iter_mut().for_each(|s| s.add(late, &estimator, row.x));
            });
        });
    }
    all.iter()
        .map(|s| (s.name.clone(), s.ratio(runs)))
        .collect()
}

/// The errors of a quantity over the last third of many runs, row by row.
struct Scatter {
    name: String,
    /// its place among the estimates, and among the true states
    estimate: usize,
    truth: usize,
    rows: Vec<Moments>,
}

/// Sums over the runs.
#[derive(Clone, Default)]
struct Moments {
    error: f64,
    square: f64,
    /// of the deviations said
    variance: f64,
}

impl Scatter {
    fn of_each(case: &Case, estimator: &Estimator, states: &[String]) -> Vec<Self> {
        let names = estimator.names().iter().enumerate();
        let quantities = names.filter_map(|(estimate, name)| {
            let truth = states.iter().position(|state| state == name)?;
            Some(Self {
                name: name.clone(),
                estimate,
                truth,
                rows: vec![Moments::default(); case.rows - 2 * case.rows / 3],
            })
        });
        quantities.collect()
    }

    fn add(&mut self, row: usize, estimator: &Estimator, x: &[f64]) {
        let error = estimator.estimate()[self.estimate] - x[self.truth];
        let deviation = estimator.deviations().unwrap()[self.estimate];
        let moments = &mut self.rows[row];
        moments.error += error;
        moments.square += error * error;
        moments.variance += deviation * deviation;
    }

    /// √(variance of the errors/variance said), averaged over the rows. Errors are taken about
    /// their mean: what the sampling shifts every run by is no noise.
    fn ratio(&self, runs: u64) -> f64 {
        let runs = runs as f64;
        let shares = self.rows.iter().map(|m| {
            let variance = (m.square - m.error * m.error / runs) / (runs - 1.0);
            variance / (m.variance / runs)
        });
        (shares.sum::<f64>() / self.rows.len() as f64).sqrt()
    }
}

/// Within what a chi-square of so many runs would leave in 999 of 1000 cases.
fn agree(case: &Case) {
    const RUNS: u64 = 24;
    // Wilson and Hilferty's quantiles
    let part = 2.0 / (9.0 * RUNS as f64);
    let bound = |z: f64| (1.0 - part + z * part.sqrt()).powi(3).sqrt();
    let (low, high) = (bound(-3.29), bound(3.29));
    let ratios = ratios(case, RUNS);
    assert!(!ratios.is_empty());
    for (name, ratio) in ratios {
        assert!(
            (low..high).contains(&ratio),
            "{name}: {ratio} outside {low} … {high}"
        );
    }
}

/// 500 runs, within 15 %.
fn hold(name: &str, case: &Case) {
    let ratios = ratios(case, 500);
    for (quantity, ratio) in &ratios {
        println!("{name:>16} {quantity:>6} {ratio:.3}");
    }
    for (quantity, ratio) in ratios {
        assert!((0.85..1.15).contains(&ratio), "{name}, {quantity}: {ratio}");
    }
}

macro_rules! agreements {
    ($($name:ident: $case:ident;)*) => {
        $(#[test] fn $name() { agree(&$case); })*

        mod five_hundred_runs {
            $(
                #[test]
                #[ignore = "minutes"]
                fn $name() {
                    super::hold(stringify!($name), &super::$case);
                }
            )*
        }
    };
}

agreements! {
    block_triangular: LEE;
    triangular: COLUMN;
    state_affine: LTAIEF;
    unknown_input: FARZA;
    drift_observable: GERMANI;
    ekf: EKF;
    ukf: UKF;
    mhe: MHE;
}
