//! What a correction is made of, for those who ask for it.

use super::belief::Belief;
use super::censored::{Believed, End};
use super::root::{Factor, Root, dot, substitute};

/// What a filter made of its last sample, kept where
/// [`Estimator::keep_record`](crate::Estimator::keep_record) asked for it. Matrices are row by row.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// ŷ by sensor, whether it reported or not
    pub predicted: Vec<f64>,
    /// ν = y − ŷ by sensor; NaN where it did not report. Of a reading at a limit of its sensor that of the
    /// ordinary reading for which it stands
    pub innovation: Vec<f64>,
    /// S = CP⁻Cᵀ + R before any of the readings counts; NaN where one of the two sensors did not report
    pub innovation_covariance: Vec<f64>,
    /// K, states × sensors: x̂⁺ = x̂⁻ + Kν. 0 for a reading that did not correct; NaN for a moving horizon, which
    /// has none
    pub gain: Vec<f64>,
    /// −½(log det 2πS + νᵀS⁻¹ν) over the readings that corrected; of one at a limit of its sensor the logarithm
    /// of how likely it is that y is there or beyond
    pub log_likelihood: f64,
    /// P⁺
    pub covariance: Vec<f64>,
    /// R by sensor
    noise: Vec<f64>,
    /// Sᵀc by sensor, S the root of P⁻
    projected: Vec<f64>,
    factor: Factor,
    /// the readings that corrected, one after the other
    pub(crate) independent: Vec<Independent>,
}

/// A reading given those of the same row before it: what is left of its innovation, with its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Independent {
    pub sensor: usize,
    pub innovation: f64,
    pub variance: f64,
    /// of the sensor's range, where it is at one
    pub end: Option<End>,
}

impl Record {
    /// Of so many states and sensors.
    pub(crate) fn new(n: usize, m: usize) -> Self {
        Self {
            predicted: vec![f64::NAN; m],
            innovation: vec![f64::NAN; m],
            innovation_covariance: vec![f64::NAN; m * m],
            gain: vec![f64::NAN; n * m],
            covariance: vec![f64::NAN; n * n],
            noise: vec![f64::NAN; m],
            ..Self::default()
        }
    }

    /// Before a sample; `has_gain` says whether there will be one.
    pub(crate) fn clear(&mut self, has_gain: bool) {
        self.gain.fill(if has_gain { 0.0 } else { f64::NAN });
        self.log_likelihood = 0.0;
        self.projected.clear();
        self.independent.clear();
    }

    /// A sensor's reading beside what was predicted; NaN where there is none.
    pub(crate) fn see(&mut self, sensor: usize, predicted: f64, innovation: f64, noise: f64) {
        self.predicted[sensor] = predicted;
        self.innovation[sensor] = innovation;
        self.noise[sensor] = noise;
    }

    /// Keeps what the belief makes of the slopes of the next sensor.
    pub(crate) fn project(&mut self, projected: &[f64]) {
        self.projected.extend_from_slice(projected);
    }

    /// S, of what the outputs of two sensors have in common.
    pub(crate) fn spread(&mut self, common: impl Fn(usize, usize) -> f64) {
        let m = self.innovation.len();
        for i in 0..m {
            for j in 0..m {
                let reported = self.innovation[i] + self.innovation[j];
                let noise = if i == j { self.noise[i] } else { 0.0 };
                self.innovation_covariance[i * m + j] = match reported.is_nan() {
                    true => f64::NAN,
                    false => common(i, j) + noise,
                };
            }
        }
    }

    /// The same where the outputs are linear in the state, as the slopes that were projected say.
    pub(crate) fn spread_projected(&mut self) {
        let projected = std::mem::take(&mut self.projected);
        let n = projected.len() / self.innovation.len().max(1);
        let of = |i: usize| &projected[i * n..(i + 1) * n];
        self.spread(|i, j| dot(of(i), of(j)));
        self.projected = projected;
    }

    /// Counts readings inside of their sensors' ranges.
    pub(crate) fn count(&mut self, taken: &[Believed]) {
        let (block, size) = self.block(taken);
        let lower = self.factor.of(&block, size);
        let mut unit: Vec<f64> = vec![];
        for (a, believed) in taken.iter().enumerate() {
            let (row, pivot) = (&lower[a * size..a * size + a], lower[a * size + a]);
            let left = believed.innovation - dot(row, &unit);
            unit.push(if pivot > 0.0 { left / pivot } else { 0.0 });
            self.independent.push(Independent {
                sensor: believed.sensor,
                innovation: left,
                variance: pivot * pivot,
                end: None,
            });
        }
        let mut weighed: Vec<f64> = taken.iter().map(|b| b.innovation).collect();
        substitute(lower, size, &mut weighed);
        for (a, believed) in taken.iter().enumerate() {
            let pivot = lower[a * size + a];
            // a reading of which model and sensor are certain has no density
            if pivot > 0.0 {
                let whole = std::f64::consts::TAU.ln() + 2.0 * pivot.ln();
                self.log_likelihood -= 0.5 * (whole + believed.innovation * weighed[a]);
            }
        }
    }

    /// Counts a reading at an end of its sensor's range, where the output is known with a variance `spread`
    /// and has `moved` since it was predicted.
    pub(crate) fn count_at_end(&mut self, believed: &Believed, moved: f64, spread: f64) {
        self.log_likelihood += believed.log_likelihood(moved, spread);
        if believed.end.is_some() {
            self.independent.push(Independent {
                sensor: believed.sensor,
                innovation: believed.innovation - moved,
                variance: spread + believed.variance,
                end: believed.end,
            });
        }
    }

    /// K = P⁻CᵀS⁻¹ over readings that correct together, from the slopes that were projected.
    pub(crate) fn join(&mut self, taken: &[Believed], root: &Root) {
        let n = root.n;
        let (block, size) = self.block(taken);
        let lower = self.factor.of(&block, size).to_vec();
        for state in 0..n {
            let of = |b: &Believed| &self.projected[b.sensor * n..(b.sensor + 1) * n];
            let cross = taken.iter().map(|b| dot(root.row(state), of(b)));
            let mut gain: Vec<f64> = cross.collect();
            substitute(&lower, size, &mut gain);
            for (b, gain) in taken.iter().zip(gain) {
                self.give(state, b.sensor, gain);
            }
        }
    }

    /// The gain of a reading with the innovation that it is for.
    pub(crate) fn correct(
        &mut self,
        sensor: usize,
        innovation: f64,
        gain: impl Iterator<Item = f64>,
    ) {
        self.innovation[sensor] = innovation;
        for (state, gain) in gain.enumerate() {
            self.give(state, sensor, gain);
        }
    }

    fn give(&mut self, state: usize, sensor: usize, gain: f64) {
        let place = state * self.innovation.len() + sensor;
        // what is drawn anew in every row is nobody's estimate
        if let Some(own) = self.gain.get_mut(place) {
            *own = gain;
        }
    }

    /// That of a sensor's reading.
    pub(crate) fn variance(&self, sensor: usize) -> f64 {
        self.innovation_covariance[sensor * (self.innovation.len() + 1)]
    }

    /// S of some readings.
    fn block(&self, taken: &[Believed]) -> (Vec<f64>, usize) {
        let m = self.innovation.len();
        let row = |a: &Believed| {
            let a = a.sensor;
            taken
                .iter()
                .map(move |b| self.innovation_covariance[a * m + b.sensor])
        };
        (taken.iter().flat_map(row).collect(), taken.len())
    }

    /// What is known after the correction.
    pub(crate) fn end(&mut self, belief: &Belief) {
        let (n, root) = (self.covariance.len().isqrt(), &belief.root);
        for i in 0..n {
            for j in 0..=i {
                let entry = dot(root.row(i), root.row(j));
                self.covariance[i * n + j] = entry;
                self.covariance[j * n + i] = entry;
            }
        }
    }
}
