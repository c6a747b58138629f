//! An extended filter as textbooks have it: covariances, no roots, no graph, over any numbers.

use super::number::{Dual, Number};
use super::plant::{Level, Plant, Record, STEP, VARIANCE};

type Matrix<N> = Vec<Vec<N>>;

fn zeros<N: Number>(n: usize) -> Matrix<N> {
    vec![vec![N::of(0.0); n]; n]
}

fn identity<N: Number>(n: usize) -> Matrix<N> {
    let mut all = zeros(n);
    (0..n).for_each(|i| all[i][i] = N::of(1.0));
    all
}

fn sum<N: Number>(terms: impl Iterator<Item = N>) -> N {
    terms.fold(N::of(0.0), |sum, term| sum + term)
}

fn product<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let n = a.len();
    let entry = |i: usize, j: usize| sum((0..n).map(|k| a[i][k].clone() * b[k][j].clone()));
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

fn transposed<N: Number>(a: &Matrix<N>) -> Matrix<N> {
    let n = a.len();
    (0..n)
        .map(|i| (0..n).map(|j| a[j][i].clone()).collect())
        .collect()
}

fn plus<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let rows = a.iter().zip(b);
    rows.map(|(a, b)| {
        a.iter()
            .zip(b)
            .map(|(a, b)| a.clone() + b.clone())
            .collect()
    })
    .collect()
}

/// x̂, Φ and W, or their derivatives.
#[derive(Clone)]
struct Variation<N> {
    x: Vec<N>,
    phi: Matrix<N>,
    w: Matrix<N>,
}

impl<N: Number> Variation<N> {
    /// These and so much of others.
    fn and(&self, share: &N, other: &Self) -> Self {
        let add = |(a, b): (&N, &N)| a.clone() + share.clone() * b.clone();
        let rows = |a: &Matrix<N>, b: &Matrix<N>| -> Matrix<N> {
            let rows = a.iter().zip(b);
            rows.map(|(a, b)| a.iter().zip(b).map(add).collect())
                .collect()
        };
        Self {
            x: self.x.iter().zip(&other.x).map(add).collect(),
            phi: rows(&self.phi, &other.phi),
            w: rows(&self.w, &other.w),
        }
    }
}

/// The belief of the filter.
struct Filter<'p, N> {
    plant: &'p Plant,
    /// θ by its parts
    parameters: Vec<N>,
    noises: Vec<N>,
    densities: Vec<N>,
    x: Vec<N>,
    p: Matrix<N>,
    nll: N,
}

/// −log L at θ.
pub fn nll<N: Number>(plant: &Plant, theta: &[N]) -> N {
    let (parameters, rest) = theta.split_at(plant.parameters);
    let (noises, rest) = rest.split_at(plant.sensors.len());
    let (given, start) = rest.split_at(plant.noisy.len());
    let n = plant.states();
    let mut densities = vec![N::of(0.0); n];
    for (state, q) in plant.noisy.iter().zip(given) {
        densities[*state] = q.clone();
    }
    let mut filter = Filter {
        plant,
        parameters: parameters.to_vec(),
        noises: noises.to_vec(),
        densities,
        x: plant.starts.iter().map(|x| N::of(*x)).collect(),
        p: identity(n),
        nll: N::of(0.0),
    };
    (0..n).for_each(|i| filter.p[i][i] = N::of(VARIANCE));
    if let Some(start) = start.first() {
        filter.x[0] = start.clone();
        filter.p[0][0] = N::of(0.0);
    }
    let mut before: Option<&Record> = None;
    for record in &plant.log {
        if let Some(before) = before {
            filter.predict(before, record.t);
        }
        filter.take(&record.readings);
        before = Some(record);
    }
    filter.nll
}

/// A row of C, ŷ and R.
struct Seen<N> {
    c: Vec<N>,
    h: N,
    r: N,
}

impl<N: Number> Filter<'_, N> {
    /// By equal steps of Runge and Kutta.
    fn predict(&mut self, from: &Record, to: f64) {
        let span = to - from.t;
        let steps = (span / STEP).ceil().max(1.0);
        for i in 0..steps as usize {
            self.step(from.t + span * i as f64 / steps, span / steps, from.input);
        }
    }

    /// x̂' = f, Φ' = FΦ, W' = FW + WFᵀ + Q; then P becomes ΦPΦᵀ + W.
    fn step(&mut self, t: f64, h: f64, input: f64) {
        let n = self.x.len();
        let begin = Variation {
            x: self.x.clone(),
            phi: identity(n),
            w: zeros(n),
        };
        let mut stage = begin.clone();
        let mut end = begin.clone();
        for (at, next, weight) in [
            (0.0, 0.5, 1.0),
            (0.5, 0.5, 2.0),
            (0.5, 1.0, 2.0),
            (1.0, 0.0, 1.0),
        ] {
            let slope = self.variation(t + at * h, &stage, input);
            end = end.and(&N::of(weight * h / 6.0), &slope);
            stage = begin.and(&N::of(next * h), &slope);
        }
        self.p = plus(
            &product(&product(&end.phi, &self.p), &transposed(&end.phi)),
            &end.w,
        );
        self.x = end.x;
    }

    fn variation(&self, t: f64, at: &Variation<N>, input: f64) -> Variation<N> {
        let n = self.x.len();
        let constant = |value: &N| Dual(value.clone(), N::of(0.0));
        let parameters: Vec<Dual<N>> = self.parameters.iter().map(constant).collect();
        let [t, input] = [t, input].map(Dual::<N>::of);
        let mut slopes = zeros(n);
        let mut x = vec![];
        for j in 0..n {
            let along = (0..n).map(|i| Dual(at.x[i].clone(), N::of(f64::from(u8::from(i == j)))));
            let along: Vec<Dual<N>> = along.collect();
            let found = self.plant.derivatives(&t, &along, &input, &parameters);
            found
                .iter()
                .zip(&mut slopes)
                .for_each(|(dx, row)| row[j] = dx.1.clone());
            x = found.into_iter().map(|dx| dx.0).collect();
        }
        let half = product(&slopes, &at.w);
        let mut w = plus(&half, &transposed(&half));
        for (i, q) in self.densities.iter().enumerate() {
            w[i][i] = w[i][i].clone() + q.clone();
        }
        Variation {
            x,
            phi: product(&slopes, &at.phi),
            w,
        }
    }

    /// The readings of a row, one after the other; h, its slopes and the noises are those before them.
    fn take(&mut self, readings: &[Option<f64>]) {
        let n = self.x.len();
        let at = self.x.clone();
        let reported = readings.iter().enumerate();
        let reported = reported.filter_map(|(sensor, reading)| Some((sensor, (*reading)?)));
        let seen = reported.map(|(sensor, reading)| (sensor, reading, self.seen(sensor)));
        for (sensor, reading, Seen { c, h, r }) in seen.collect::<Vec<_>>() {
            let moved = (0..n).map(|i| c[i].clone() * (self.x[i].clone() - at[i].clone()));
            let (pc, spread) = self.spread(&c);
            let s = spread + r;
            let limit = self.plant.sensors[sensor].limit;
            let off = N::of(reading) - h - sum(moved);
            match limit.is_some_and(|limit| reading >= limit) {
                true => self.beyond(&pc, off, s),
                false => self.correct(&pc, off, s),
            }
        }
    }

    fn seen(&self, sensor: usize) -> Seen<N> {
        let n = self.x.len();
        let mut c = vec![];
        let mut h = N::of(0.0);
        for j in 0..n {
            let along = (0..n).map(|i| {
                let is_own = f64::from(u8::from(i == j));
                Dual(self.x[i].clone(), N::of(is_own))
            });
            let found = self.plant.output(sensor, &along.collect::<Vec<_>>());
            c.push(found.1);
            h = found.0;
        }
        let size = self.noises[sensor].clone();
        let square = size.clone() * size;
        let r = match self.plant.sensors[sensor].level {
            Level::Deviation => square,
            Level::Uniform => square / N::of(3.0),
            Level::Share => square * (h.clone() * h.clone() + self.spread(&c).1),
        };
        Seen { c, h, r }
    }

    /// Pc and cᵀPc.
    fn spread(&self, c: &[N]) -> (Vec<N>, N) {
        let n = self.x.len();
        let row = |i: usize| sum((0..n).map(|j| self.p[i][j].clone() * c[j].clone()));
        let pc: Vec<N> = (0..n).map(row).collect();
        let spread = sum((0..n).map(|i| c[i].clone() * pc[i].clone()));
        (pc, spread)
    }

    fn correct(&mut self, pc: &[N], off: N, s: N) {
        let square = off.clone() * off.clone() / s.clone();
        let tau = N::of(std::f64::consts::TAU);
        self.nll = self.nll.clone() + N::of(0.5) * ((tau * s.clone()).ln() + square);
        self.moved(pc, off / s.clone(), N::of(1.0) / s);
    }

    /// A reading that says "there or beyond": mean and variance of what is cut off (J. Tobin, *Econometrica* 26 (1958)
    /// 24–36).
    fn beyond(&mut self, pc: &[N], off: N, s: N) {
        let sigma = s.clone().sqrt();
        let a = off / sigma.clone();
        let (log, lambda) = tail(&a);
        self.nll = self.nll.clone() - log;
        let delta = lambda.clone() * (lambda.clone() - a);
        self.moved(pc, lambda / sigma, delta / s);
    }

    /// x̂ + PCᵀm and P − PCᵀCPv.
    fn moved(&mut self, pc: &[N], m: N, v: N) {
        for (i, own) in pc.iter().enumerate() {
            self.x[i] = self.x[i].clone() + own.clone() * m.clone();
            for (j, other) in pc.iter().enumerate() {
                let less = own.clone() * other.clone() * v.clone();
                self.p[i][j] = self.p[i][j].clone() - less;
            }
        }
    }
}

/// log Φ(−a) and λ = φ(a)/Φ(−a), from the integral of exp(−(t + a)²/2) over t > 0, by Gauss's rule of five points on
/// panels; without its exp(−a²/2) where a is above 0.
fn tail<N: Number>(a: &N) -> (N, N) {
    const POINTS: [(f64, f64); 5] = [
        (0.0, 0.568_888_888_888_888_9),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    let at = a.real();
    let square = N::of(0.5) * a.clone() * a.clone();
    let (outside, inside) = match at > 0.0 {
        true => (square.clone(), N::of(0.0)),
        false => (N::of(0.0), square.clone()),
    };
    // where what is left is less than 10⁻²⁰ of it
    let until = if at > 4.0 {
        46.0 / at
    } else {
        10.0 - at.min(0.0)
    };
    let width = 0.1 / (1.0 + at.max(0.0));
    let panels = (until / width).ceil() as usize;
    let mut all = N::of(0.0);
    for panel in 0..panels {
        for (place, weight) in POINTS {
            let t = width * (panel as f64 + 0.5 + 0.5 * place);
            let exponent = N::of(-0.5 * t * t) - a.clone() * N::of(t) - inside.clone();
            all = all + N::of(0.5 * width * weight) * exponent.exp();
        }
    }
    let log = all.clone().ln() - outside.clone() - N::of(0.5 * std::f64::consts::TAU.ln());
    (log, (outside - square).exp() / all)
}
