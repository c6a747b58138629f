//! How often the truth is within two standard deviations of an estimate: 95.4 % where these are what
//! they are called.
//!
//! `cargo test -p lynkeus-run --test suite coverage -- --ignored --nocapture` makes the table of
//! docs/ekf.md from 500 runs of each filter and smoother.

use lynkeus_expr::Graph;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor, SigmaPoints,
};
use lynkeus_run::{Blueprint, Estimator, EstimatorSettings, Level, Method, Step};

/// A damped swing, x' = v, v' = −2 sin x − 0.3v + w, driven by noise: nearly linear for |x| < 0.5.
const DENSITY: f64 = 0.01;
const START: [f64; 2] = [0.2, 0.0];
const SPREAD: f64 = 0.04;

/// What is measured of x, and when.
struct Case {
    name: &'static str,
    /// what is added to x
    offset: f64,
    noise: Level,
    limits: Option<Limits>,
    interval: f64,
    rows: usize,
}

const PLAIN: Case = Case {
    name: "dense samples",
    offset: 0.0,
    noise: Level::Absolute(0.05),
    limits: None,
    interval: 0.1,
    rows: 90,
};

const CASES: [Case; 4] = [
    PLAIN,
    Case {
        name: "coarse samples",
        interval: 1.5,
        rows: 45,
        ..PLAIN
    },
    Case {
        name: "noise of 5 % of y = 2 + x",
        offset: 2.0,
        noise: Level::Relative(0.05),
        ..PLAIN
    },
    Case {
        name: "limits: half of the readings at an end",
        limits: Some(Limits {
            low: -5.0,
            high: 0.0,
        }),
        ..PLAIN
    },
];

impl Case {
    fn filter(&self, kind: FilterKind) -> Estimator {
        let g = Graph::new();
        let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: vec![
                ("x".into(), x.node(), START[0]),
                ("v".into(), v.node(), START[1]),
            ],
            derivatives: vec![v.node(), (x.sin() * -2.0 - v * 0.3).node()],
            inputs: vec![],
            sensors: vec![Sensor {
                name: "y".into(),
                output: (x + self.offset).node(),
                noise: self.noise,
                limits: self.limits,
            }],
            process_noise: vec![0.0, DENSITY],
            initial_variance: vec![SPREAD; 2],
            ranges: vec![
                Limits {
                    low: -50.0,
                    high: 50.0,
                };
                2
            ],
            confined: None,
            whens: Default::default(),
        });
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let run = EstimatorSettings {
            method: Method::Rk4(Step::AtMost(0.05)),
            ..EstimatorSettings::default()
        };
        Blueprint::filter(model.unwrap(), settings, run)
            .estimator()
            .unwrap()
    }

    /// True states and readings of a run.
    fn drawn(&self, seed: u64) -> Vec<([f64; 2], f64)> {
        let mut normal = Normal(seed);
        let mut x = START.map(|x| x + SPREAD.sqrt() * normal.next());
        let mut rows = vec![];
        let parts = (self.interval / 0.002).round() as usize;
        let h = self.interval / parts as f64;
        for _ in 0..self.rows {
            let shown = self.offset + x[0];
            let reading = shown + self.noise.variance(shown).sqrt() * normal.next();
            rows.push((x, self.limits.map_or(reading, |l| l.shown(reading))));
            for _ in 0..parts {
                let dv = -2.0 * x[0].sin() - 0.3 * x[1];
                // symplectic: the energy of the swing does not drift
                x[1] += h * dv + (DENSITY * h).sqrt() * normal.next();
                x[0] += h * x[1];
            }
        }
        rows
    }

    /// The share of the truth within two deviations of filter and smoother, over the last two thirds of
    /// the rows.
    fn coverage(&self, kind: &FilterKind, runs: u64) -> [f64; 2] {
        let fresh = self.filter(kind.clone());
        let (mut inside, mut all) = ([0.0, 0.0], 0.0);
        let first = self.rows / 3;
        for seed in 0..runs {
            let mut filter = fresh.clone();
            let rows = self.drawn(seed);
            let within = |truth: &[f64; 2], x: &[f64], sd: &[f64]| {
                let pairs = truth.iter().zip(x).zip(sd);
                pairs
                    .filter(|((t, x), sd)| (*t - *x).abs() <= 2.0 * **sd)
                    .count() as f64
            };
            for (k, (truth, y)) in rows.iter().enumerate() {
                filter.push(self.interval * k as f64, &[*y]).unwrap();
                if k >= first {
                    inside[0] += within(truth, filter.estimate(), filter.deviations().unwrap());
                    all += 2.0;
                }
            }
            let smoothed = filter.smoothed(None, true).unwrap();
            for ((truth, _), row) in rows.iter().zip(smoothed).skip(first) {
                inside[1] += within(truth, &row.estimate, &row.deviations);
            }
        }
        inside.map(|count| count / all)
    }
}

/// Standard normal numbers by Box and Muller, of a counter's hash.
pub struct Normal(pub u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0.wrapping_mul(0xd134_2543_de82_ef95) ^ self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    pub fn next(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

fn kinds() -> [(&'static str, FilterKind); 3] {
    [
        ("ekf", FilterKind::Extended),
        ("ukf", FilterKind::Unscented(SigmaPoints::default())),
        ("mhe", FilterKind::MovingHorizon(5)),
    ]
}

/// 40 runs of the filters that are quick; seeds are fixed, the bound is that of 500.
#[test]
fn two_deviations_hold_the_truth() {
    for case in &CASES {
        for (name, kind) in &kinds()[..2] {
            for found in case.coverage(kind, 60) {
                let what = format!("{name}, {}: {found}", case.name);
                assert!((0.92..0.98).contains(&found), "{what}");
            }
        }
    }
}

#[test]
#[ignore = "a minute"]
fn table() {
    println!("| filter | plant | filter, 2 sd hold | smoother, 2 sd hold |\n|---|---|---|---|");
    let mut wrong = vec![];
    for case in &CASES {
        for (name, kind) in &kinds() {
            let found = case.coverage(kind, 500);
            let [filter, smoother] = found.map(|share| 100.0 * share);
            println!(
                "| `{name}` | {} | {filter:.1} % | {smoother:.1} % |",
                case.name
            );
            if found.iter().any(|share| !(0.93..0.97).contains(share)) {
                wrong.push(format!("{name}, {}: {found:?}", case.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
