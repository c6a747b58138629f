//! How often the verdict `credible` errs: right runs of every family that are called not credible, and
//! wrong logs that are.
//!
//! `cargo test --release -p lynkeus --test credibility -- --ignored --nocapture` makes the tables of
//! docs/credibility.md from 1,000 right runs and 20 of each wrong kind.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::ops::ControlFlow;

use lynkeus::{DoubtLevel, Outcome, Study, Table};

/// A plant with an observer, and logs of it.
struct Case {
    plant: &'static str,
    /// `[sensors]` without noise, and the noises
    sensors: &'static str,
    noise: &'static [(&'static str, f64)],
    /// `[process_noise]`
    wander: &'static str,
    /// `[observer]`, and that of the filter that makes the logs
    observer: &'static str,
    /// of `[simulate]`
    until: f64,
    step: f64,
    inputs: &'static str,
    /// a parameter, and what it is not
    parameter: (&'static str, f64),
}

const PENDULUM: Case = Case {
    plant: "model P parameter Real d = 0.5; input Real u(min = -3, max = 3); Real x(start = 0.3, min = -4, max = 4); Real v(start = 0, min = -8, max = 8); output Real y = x; equation der(x) = v; der(v) = -4*sin(x) - d*v + u; end P;",
    sensors: "",
    noise: &[("y", 0.02)],
    wander: "v = 1e-3",
    observer: "family = \"ekf\"\ninitial_variance = { default = 0.1 }",
    until: 20.0,
    step: 0.05,
    inputs: "inputs = { u = \"2*sin(1.3*time)\" }",
    parameter: ("d", 3.0),
};
const UKF: Case = Case {
    observer: "family = \"ukf\"\ninitial_variance = { default = 0.1 }",
    ..PENDULUM
};
const MHE: Case = Case {
    observer: "family = \"mhe\"\nhorizon = 4\ninitial_variance = { default = 0.1 }",
    until: 8.0,
    ..PENDULUM
};
const TRIANGULAR: Case = Case {
    observer: "family = \"triangular\"\ntheta = 4\ninitial = { x = 0, v = 0.5 }",
    ..PENDULUM
};
const DRIFT: Case = Case {
    observer: "family = \"drift-observable\"\npoles = [-3, -4]\ninitial = { x = 0, v = 0.5 }",
    ..PENDULUM
};
const CARTS: Case = Case {
    plant: "model C parameter Real c = 1; input Real u(min = -2, max = 2); Real a(start = 0.2, min = -3, max = 3); Real p(start = 0, min = -4, max = 4); Real b(start = -0.1, min = -3, max = 3); Real q(start = 0, min = -4, max = 4); output Real y1 = a; output Real y2 = b; equation der(a) = p; der(p) = -2*a + c*(b - a) - 0.4*p + u; der(b) = q; der(q) = -2*b + c*(a - b) - 0.4*q; end C;",
    sensors: "",
    noise: &[("y1", 0.01), ("y2", 0.01)],
    wander: "p = 1e-3\nq = 1e-3",
    observer: "family = \"block-triangular\"\ntheta = [3, 3]\ninitial = { a = 0, b = 0, p = 0.3, q = 0 }",
    until: 20.0,
    step: 0.05,
    inputs: "inputs = { u = \"1.5*sin(0.9*time)\" }",
    parameter: ("c", 6.0),
};
const KETTLE: Case = Case {
    plant: "model K parameter Real V = 100; input Real q(min = 0, max = 10); input Real Tj(min = 0, max = 120); Real T(start = 40, min = 0, max = 100); Real k(start = 0.1, min = 0, max = 0.3); output Real TT = T; equation der(T) = q/V*(15 - T) + k*(Tj - T); der(k) = 0; end K;",
    sensors: "",
    noise: &[("TT", 0.5)],
    wander: "T = 1e-4\nk = 1e-8",
    observer: "family = \"state-affine\"\ntheta = 0.1\ninitial = { T = 38, k = 0.12 }",
    until: 300.0,
    step: 0.5,
    inputs: "inputs = { q = \"3 + 2*sin(0.2*time)\", Tj = \"80 + 15*sin(0.05*time)\" }",
    parameter: ("V", 10.0),
};
const UNKNOWN: Case = Case {
    plant: "model T parameter Real c = 0.5; input Real F(min = -2, max = 2); Real h(start = 1, min = 0, max = 4); Real s(start = 1, min = 0, max = 8); Real w(start = 0.5, min = -4, max = 4); output Real y = h; output Real z = s; equation der(h) = F + w - c*h; der(s) = h - F - s; der(w) = 0.3*(h - 4*w); end T;",
    sensors: "unknown = [\"F\"]",
    noise: &[("y", 0.01), ("z", 0.01)],
    wander: "F = 2e-2\nw = 1e-4",
    observer: "family = \"unknown-input\"\ntheta = [3, 2]\ninitial = { F = 0.4, w = 0.3 }",
    until: 40.0,
    step: 0.05,
    inputs: "inputs = { F = \"0.5 + 0.3*sin(0.3*time)\" }",
    parameter: ("c", 3.0),
};

/// What is wrong with a log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    Nothing,
    Hundred,
    Fahrenheit,
    Sign,
    Swapped,
    Frozen,
    Drift,
    Noisier,
    Quieter,
    Parameter,
    Time,
}

const WRONG: [Wrong; 10] = [
    Wrong::Hundred,
    Wrong::Fahrenheit,
    Wrong::Sign,
    Wrong::Swapped,
    Wrong::Frozen,
    Wrong::Drift,
    Wrong::Noisier,
    Wrong::Quieter,
    Wrong::Parameter,
    Wrong::Time,
];

impl Case {
    fn study(&self, observer: &str, seed: u64, scale: f64, parameters: &str) -> Study {
        let noise = self.noise.iter();
        let noise = noise.map(|(name, sd)| format!("{name} = {:e}", sd * scale));
        let noise: Vec<String> = noise.collect();
        let text = format!(
            "plant = \"plant.mo\"\n[parameters]\n{parameters}\n[sensors]\n{}\nnoise = {{ {} }}\n[process_noise]\n{}\n[observer]\n{observer}\n[simulate]\nuntil = {}\noutput_step = {}\nseed = {seed}\n{}\n",
            self.sensors,
            noise.join(", "),
            self.wander,
            self.until,
            self.step,
            self.inputs
        );
        let mut study = Study::parse(&text, "study.toml").unwrap();
        study.plant_text = Some(self.plant.into());
        study
    }

    /// A log of the plant, and what is wrong with it.
    fn log(&self, seed: u64, wrong: Wrong) -> Table {
        let scale = match wrong {
            Wrong::Noisier => 10.0,
            Wrong::Quieter => 0.1,
            _ => 1.0,
        };
        let parameter = match wrong {
            Wrong::Parameter => format!("{} = {}", self.parameter.0, self.parameter.1),
            _ => String::new(),
        };
        let study = self.study("family = \"ekf\"", seed, scale, &parameter);
        let run = lynkeus::simulate(&study, &mut |_| ControlFlow::Continue(())).unwrap();
        let columns = run.log().unwrap();
        let owned = columns
            .into_iter()
            .map(|(name, column)| (name, column.to_vec()));
        let mut columns: Vec<(String, Vec<f64>)> = owned.collect();
        let sd = self.noise[0].1;
        if wrong == Wrong::Time {
            columns[0].1.iter_mut().for_each(|t| *t /= 60.0);
        }
        let y = &mut columns[1].1;
        let rows = y.len();
        match wrong {
            Wrong::Hundred => y.iter_mut().for_each(|y| *y *= 100.0),
            Wrong::Fahrenheit => y.iter_mut().for_each(|y| *y = 1.8 * *y + 32.0),
            Wrong::Sign => y.iter_mut().for_each(|y| *y = -*y),
            Wrong::Frozen => {
                let held = y[rows / 2];
                y[rows / 2..rows / 2 + rows / 3].fill(held);
            }
            Wrong::Drift => {
                let drift = |k: usize| 100.0 * sd * (k as f64 / rows as f64 - 1.0 / 3.0).max(0.0);
                y.iter_mut().enumerate().for_each(|(k, y)| *y += drift(k));
            }
            // where there is one sensor, with what is known
            Wrong::Swapped => {
                let other = std::mem::take(&mut columns[2].1);
                columns[2].1 = std::mem::replace(&mut columns[1].1, other);
            }
            _ => {}
        }
        Table::from_columns(columns).unwrap()
    }

    fn judged(&self, seed: u64, wrong: Wrong) -> Outcome {
        let study = self.study(self.observer, seed, 1.0, "");
        let log = self.log(seed, wrong);
        lynkeus::estimate(&study, &log, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    /// How many right runs are called not credible.
    fn false_alarms(&self, runs: u64) -> usize {
        let alarms = (0..runs).filter(|seed| {
            let run = self.judged(*seed, Wrong::Nothing);
            run.doubts.iter().for_each(|doubt| {
                if doubt.level == DoubtLevel::Refusal {
                    println!("seed {seed}: {}", doubt.text);
                }
            });
            !run.is_credible()
        });
        alarms.count()
    }

    /// Of wrong logs, the shares that are refused and that are warned of at least.
    fn power(&self, runs: u64, wrong: Wrong) -> [f64; 2] {
        let mut found = [0.0; 2];
        for seed in 0..runs {
            let run = self.judged(seed, wrong);
            let worst = run.doubts.iter().map(|d| d.level).max();
            found[0] += f64::from(u8::from(!run.is_credible()));
            found[1] += f64::from(u8::from(worst >= Some(DoubtLevel::Warning)));
        }
        found.map(|count| count / runs as f64)
    }
}

/// Less than 1 % of false alarms, and a table of what is found.
fn calibrate(name: &str, case: &Case) {
    let alarms = case.false_alarms(1000);
    println!("{name}: {alarms} of 1000 right runs are not credible");
    for wrong in WRONG {
        if wrong == Wrong::Swapped && case.noise.len() + case.inputs.matches('=').count() < 3 {
            continue;
        }
        let [refused, warned] = case.power(20, wrong);
        println!(
            "{name} | {wrong:?} | {:.0} % | {:.0} %",
            100.0 * refused,
            100.0 * warned
        );
    }
    assert!(alarms < 10, "{name}: {alarms}");
}

macro_rules! calibrations {
    ($($name:ident: $case:ident;)*) => {
        $(
            /// Ten right runs, and one of each kind that no observer can miss.
            #[test]
            fn $name() {
                assert_eq!($case.false_alarms(10), 0);
                for wrong in [Wrong::Hundred, Wrong::Fahrenheit, Wrong::Sign] {
                    assert!(!$case.judged(1, wrong).is_credible(), "{wrong:?}");
                }
            }
        )*

        mod a_thousand_runs {
            $(
                #[test]
                #[ignore = "minutes"]
                fn $name() {
                    super::calibrate(stringify!($name), &super::$case);
                }
            )*
        }
    };
}

calibrations! {
    ekf: PENDULUM;
    ukf: UKF;
    mhe: MHE;
    triangular: TRIANGULAR;
    block_triangular: CARTS;
    state_affine: KETTLE;
    drift_observable: DRIFT;
    unknown_input: UNKNOWN;
}
