use nalgebra::{DMatrix, DVector};

use super::*;
use crate::{Blueprint, Level, Method, System, Tolerances, Updates};
use lynkeus_expr::Graph;

/// x' = A x + b + ξ, y = C x + v with two states and one output, and x̂' = A x̂ + b + K (w − C x̂).
#[derive(Clone, Copy)]
struct Plant {
    A: [[f64; 2]; 2],
    b: [f64; 2],
    C: [f64; 2],
    K: [f64; 2],
    /// densities
    q: [f64; 2],
    /// variances of the start
    p: [f64; 2],
    noise: f64,
    predict: bool,
}

const OSCILLATOR: Plant = Plant {
    A: [[0.0, 1.0], [-2.0, -0.3]],
    b: [0.0, 0.0],
    C: [1.7, 0.4],
    K: [1.2, 0.9],
    q: [0.02, 0.3],
    p: [0.5, 0.1],
    noise: 0.05,
    predict: true,
};

/// It moves by itself, and by noise, in a way that does not depend on where it is.
const DRIFT: Plant = Plant {
    A: [[0.0, 0.0], [0.0, 0.0]],
    b: [0.7, -0.2],
    C: [1.0, 0.5],
    K: [1.5, 0.2],
    q: [0.04, 0.01],
    p: [0.3, 0.0],
    noise: 0.01,
    predict: false,
};

impl Plant {
    fn observer(&self, method: Method) -> Blueprint {
        let g = Graph::new();
        let [time, x1, x2, w, s, lag] = ["t", "x1", "x2", "w", "s", "lag"].map(|n| g.symbol(n));
        let Self { A, b, C, K, .. } = *self;
        let f = |i: usize| x1 * A[i][0] + x2 * A[i][1] + b[i];
        let h = x1 * C[0] + x2 * C[1];
        let rate = f(0) * C[0] + f(1) * C[1];
        let own = [0, 1].map(|i| (f(i) + (w - h) * K[i]).node());
        let follow = s.select(rate, g.constant(0.0)).node();
        let still = g.constant(0.0).node();
        let derivatives = [own[0], own[1], still, follow];
        let states = [("x1", x1), ("x2", x2), ("lag", lag), ("y", w)];
        let states = states.map(|(name, symbol)| (name.to_owned(), symbol.node(), 0.0));
        let signals = [("s".to_owned(), s.node())];
        let outputs = [("x1", x1), ("x2", x2), ("y", h)];
        let outputs = outputs.map(|(name, value)| (name.to_owned(), value.node()));
        let observer = NoisyPlant {
            graph: &g,
            time: time.node(),
            states: states.to_vec(),
            derivatives: derivatives.to_vec(),
            inputs: signals.to_vec(),
            sensors: vec![Sensor {
                name: "y".to_owned(),
                output: h.node(),
                noise: Level::Absolute(self.noise),
                limits: None,
            }],
            process_noise: vec![self.q[0], self.q[1], 0.0, 0.0],
            initial_variance: vec![self.p[0], self.p[1], 1.0, 0.0],
            ranges: vec![],
            confined: None,
            whens: Default::default(),
        };
        let lag = Lag {
            state: 2,
            rates: &[rate.node()],
        };
        let errors =
            NoisyModel::of_observer(&observer, &[x1.node(), x2.node()], Some(lag)).unwrap();
        let system = System::new(&g, time.node(), &states, &signals, &derivatives, &outputs);
        let run = EstimatorSettings {
            method,
            ..EstimatorSettings::default()
        };
        Blueprint {
            sensors: vec!["y".to_owned()],
            updates: Updates::Jumps {
                predict: self.predict,
                errors: Some(Box::new(errors)),
                tuned: None,
            },
            ..Blueprint::new(&system.unwrap(), run)
        }
    }

    /// The root mean square errors at every sample, by the second moments of (x, x̂, w, 1) from
    /// sample to sample (C. Van Loan, *IEEE Transactions on Automatic Control* 23 (1978) 395–404).
    /// `reports` says whether the sensor does.
    fn exact(&self, step: f64, rows: usize, reports: impl Fn(usize) -> bool) -> Vec<[f64; 2]> {
        let Self { A, b, C, K, .. } = *self;
        let mut found = vec![];
        let transition = |follows: bool| {
            let mut M = DMatrix::zeros(6, 6);
            for i in 0..2 {
                for j in 0..2 {
                    M[(i, j)] = A[i][j];
                    M[(2 + i, 2 + j)] = A[i][j] - K[i] * C[j];
                    M[(4, 2 + j)] += f64::from(u8::from(follows)) * C[i] * A[i][j];
                }
                M[(2 + i, 4)] = K[i];
                M[(i, 5)] = b[i];
                M[(2 + i, 5)] = b[i];
                M[(4, 5)] += f64::from(u8::from(follows)) * C[i] * b[i];
            }
            let mut both = DMatrix::zeros(12, 12);
            both.view_mut((0, 0), (6, 6)).copy_from(&(-&M * step));
            both.view_mut((6, 6), (6, 6))
                .copy_from(&(M.transpose() * step));
            for i in 0..2 {
                both[(i, 6 + i)] = self.q[i] * step;
            }
            let both = both.exp();
            let phi = both.view((6, 6), (6, 6)).transpose();
            let noise = &phi * both.view((0, 6), (6, 6));
            (phi, noise)
        };
        let (phi, noise) = transition(self.predict);
        let (free, free_noise) = transition(true);
        // x is off from x̂ = 0 by its variance, w expects what x̂ says
        let start = DVector::from_vec(vec![self.p[0], self.p[1], 0.0, 0.0, 0.0, 1.0]);
        let mut moments = DMatrix::from_diagonal(&start);
        let mut follows = true;
        for row in 0..rows {
            if row > 0 {
                let (phi, noise) = if follows {
                    (&free, &free_noise)
                } else {
                    (&phi, &noise)
                };
                moments = phi * moments * phi.transpose() + noise;
            }
            let variance =
                |i: usize| moments[(i, i)] + moments[(2 + i, 2 + i)] - 2.0 * moments[(i, 2 + i)];
            found.push([0, 1].map(|i| variance(i).sqrt()));
            follows = !reports(row);
            if !follows {
                let mut read = DMatrix::identity(6, 6);
                for i in 0..6 {
                    read[(4, i)] = C.get(i).copied().unwrap_or(0.0);
                }
                moments = &read * moments * read.transpose();
                moments[(4, 4)] += self.noise.powi(2);
            }
        }
        found
    }

    fn agrees(&self, step: f64, reports: impl Fn(usize) -> bool) {
        const ROWS: usize = 40;
        let method = Method::Explicit(Tolerances {
            relative: 1e-11,
            absolute: 1e-13,
            ..Tolerances::default()
        });
        let mut estimator = self.observer(method).estimator().unwrap();
        let exact = self.exact(step, ROWS, &reports);
        for (row, exact) in exact.iter().enumerate() {
            let t = step * row as f64;
            // what is read is what it expects: deviations of a linear plant do not depend on it
            let read = match reports(row) {
                true => self.b[0] * self.C[0] * t + self.b[1] * self.C[1] * t,
                false => f64::NAN,
            };
            estimator.push(t, &[read]).unwrap();
            let found = estimator.deviations().unwrap();
            for (found, exact) in found.iter().zip(exact) {
                let off = (found - exact).abs();
                assert!(off <= 1e-6 * exact, "row {row}: {found} for {exact}");
            }
        }
    }
}

/// Process noise between the samples, dense and coarse, every sample and with gaps.
#[test]
fn deviations_are_those_of_the_exact_recursion() {
    for step in [0.02, 0.3, 1.5] {
        OSCILLATOR.agrees(step, |_| true);
        OSCILLATOR.agrees(step, |row| row % 3 == 1);
        DRIFT.agrees(step, |_| true);
        DRIFT.agrees(step, |row| row % 3 == 0);
    }
}

/// A random walk that is held, by hand: P = a²P + (1 − a)²r + qΔ with a = exp(−kΔ).
#[test]
fn what_the_plant_did_since_the_reading_counts() {
    let walk = Plant {
        b: [0.0; 2],
        C: [1.0, 0.0],
        K: [1.9, 0.0],
        q: [0.04, 0.0],
        noise: 0.001,
        ..DRIFT
    };
    let mut estimator = walk.observer(Method::default()).estimator().unwrap();
    for k in 0..60 {
        estimator.push(f64::from(k), &[0.0]).unwrap();
    }
    let a = (-1.9_f64).exp();
    let exact = (((1.0 - a).powi(2) * 1e-6 + 0.04) / (1.0 - a * a)).sqrt();
    let found = estimator.deviations().unwrap()[0];
    assert!((found / exact - 1.0).abs() < 1e-4, "{found} for {exact}");
}
