//! The unscented Kalman filter.

use super::belief::Belief;
use super::censored::Believed;
use super::model::NoisyModel;
use super::point::Point;
use super::profile::Profile;
use super::root::{Factor, Reflector, Root, dot, substitute};
use super::sensing::Sensing;
use super::settings::{SigmaPoints, Weights};
use super::smoother::Correction;
use super::transition::Propagation;
use crate::manifold::Manifold;
use crate::runner::Sample;
use crate::{Dynamics, Integrator, Method, Result};

/// Images of two points that differ by no more than this share of their size do not differ.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A covariance of quaternions has directions without variance: what stands there is below this share of a state's.
const NOTHING: f64 = 1e-9;

/// Most steps to the mean of points that are no vectors, and the last of them.
const MEANS: usize = 30;
const LAST: f64 = 1e-13;

/// Sigma points under way.
#[derive(Clone, Debug)]
pub(crate) struct Ukf {
    pub integrator: Integrator,
    weights: Weights,
    points: Vec<f64>,
    mean: Vec<f64>,
    /// what the sensors show of each point
    shown: Vec<f64>,
    expected: Vec<f64>,
    rows: Vec<f64>,
    extra: Vec<f64>,
    reflector: Reflector,
    factor: Factor,
    manifold: Manifold,
    /// states that events alone change, without a deviation
    discrete: Vec<usize>,
    /// whether there are events
    jumps: bool,
}

impl Ukf {
    /// Of a model, by this method.
    pub fn new(model: &NoisyModel, points: SigmaPoints, method: Method) -> Result<Self> {
        let n = model.process_noise.len();
        let driven = model.flow.system().evaluation();
        let clauses = driven.clauses();
        let discrete = clauses.iter().flat_map(|clauses| clauses.discrete());
        let is_sure =
            |i: &&usize| model.initial_variance[**i] == 0.0 && model.process_noise[**i] == 0.0;
        Ok(Self {
            manifold: model.manifold.clone(),
            discrete: discrete.filter(is_sure).copied().collect(),
            jumps: clauses.is_some(),
            integrator: Integrator::new(method, n)?,
            weights: points.weights(n)?,
            points: vec![],
            mean: vec![],
            shown: vec![],
            expected: vec![],
            rows: vec![],
            extra: vec![],
            reflector: vec![],
            factor: Factor::default(),
        })
    }

    /// Points of the belief beside their mean, and what the sensors show of them. Where it was before the sample's
    /// readings says in which plane the belief of a quaternion lies.
    fn show(
        &mut self,
        sensing: &mut Sensing,
        before: &[f64],
        belief: &Belief,
        sample: &Sample<'_>,
    ) -> Result<()> {
        let weights = self.weights;
        let n = belief.x.len();
        draw(belief, weights.spread, &mut self.points);
        self.shown.clear();
        let mut m = 0;
        let mut place = vec![];
        for point in self.points.chunks_exact(n) {
            let at = match self.manifold.is_straight() {
                true => point,
                false => {
                    point.clone_into(&mut place);
                    self.manifold.retract(before, &mut place);
                    &place
                }
            };
            let shown = sensing.output_map.predict(sample.t, at, sample.inputs)?;
            m = shown.len();
            self.shown.extend_from_slice(shown);
        }
        for dial in &self.manifold.dials {
            let first = self.shown[*dial];
            for shown in self.shown.iter_mut().skip(*dial).step_by(m) {
                *shown = self.manifold.lifted(*dial, *shown, first);
            }
        }
        weights.centre(&mut self.points, n, &mut self.mean);
        self.rest(n);
        weights.centre(&mut self.shown, m, &mut self.expected);
        Ok(())
    }

    /// Points beside their mean do not differ in what has no deviation, by rounding either.
    fn rest(&mut self, n: usize) {
        for point in self.points.chunks_exact_mut(n) {
            self.discrete.iter().for_each(|&i| point[i] = 0.0);
        }
    }

    /// Corrects by readings of `m` sensors, together.
    fn take(&mut self, sensing: &mut Sensing, belief: &mut Belief, m: usize, taken: &[Believed]) {
        let weights = self.weights;
        let (n, count, share) = (belief.x.len(), taken.len(), self.share());
        let mut variance = vec![0.0; count * count];
        for (a, one) in taken.iter().enumerate() {
            for (b, other) in taken.iter().enumerate() {
                variance[a * count + b] = weights.moment(&self.shown, m, one.sensor, other.sensor);
            }
            variance[a * count + a] += one.variance;
        }
        let lower = self.factor.of(&variance, count);
        let gain: Vec<Vec<f64>> = (0..n)
            .map(|s| {
                let cross = taken.iter().map(|b| {
                    let states = self.points.iter().skip(s).step_by(n);
                    let shown = self.shown.iter().skip(b.sensor).step_by(m);
                    weights.sum(states.zip(shown))
                });
                solved(lower, count, cross.collect())
            })
            .collect();
        let column = |a: usize| gain.iter().map(|k| k[a]).collect();
        let unit = |a: usize| (0..count).map(|b| f64::from(u8::from(a == b))).collect();
        let units = (0..count).map(unit);
        if let Some(corrections) = &mut sensing.corrections {
            let row = |b: &Believed| weights.row(&belief.root, &self.shown, m, b.sensor, share);
            corrections.push(Correction {
                slopes: taken.iter().map(row).collect(),
                gains: (0..count).map(column).collect(),
                information: units.flat_map(|unit| solved(lower, count, unit)).collect(),
                weighed: solved(lower, count, taken.iter().map(|b| b.innovation).collect()),
            });
        }
        if let Some(record) = &mut sensing.record {
            for (a, believed) in taken.iter().enumerate() {
                let column = gain.iter().map(|k| k[a]);
                record.correct(believed.sensor, believed.innovation, column);
            }
        }
        for (x, k) in belief.x.iter_mut().zip(&gain) {
            let parts = taken.iter().zip(k).map(|(b, k)| k * b.innovation);
            *x += parts.sum::<f64>();
        }
        // P⁺ = Σ W (dx − K dz)(…)ᵀ + K R Kᵀ, which is P⁻ − K P_zz Kᵀ
        let mut dz = vec![0.0; count];
        let points = self.points.chunks_exact_mut(n);
        for (dx, shown) in points.zip(self.shown.chunks_exact(m)) {
            for (dz, b) in dz.iter_mut().zip(taken) {
                *dz = shown[b.sensor];
            }
            for (dx, gain) in dx.iter_mut().zip(&gain) {
                *dx -= dot(gain, &dz);
            }
        }
        self.extra.clear();
        for (a, b) in taken.iter().enumerate() {
            let column = gain.iter().map(|k| k[a] * b.variance.sqrt());
            self.extra.extend(column);
        }
        self.spread(&mut belief.root);
    }

    /// The lower root of Σ W d dᵀ + Σ e eᵀ over points and extra rows. Where the first weight is
    /// negative the sum is formed, and what it lacks of being definite taken as nothing.
    fn spread(&mut self, root: &mut Root) {
        let (n, rows) = (root.n, &mut self.rows);
        let points = self.points.chunks_exact(n).enumerate();
        let points = points.map(|(k, d)| (self.weights.of(k), d));
        rows.clear();
        if self.weights.centre >= 0.0 {
            for (weight, d) in points {
                let weight = weight.sqrt();
                rows.extend(d.iter().map(|x| weight * x));
            }
            rows.extend_from_slice(&self.extra);
            match self.jumps {
                true => root_of_moving(rows, &mut self.reflector, root),
                false => root.of_rows(rows, &mut self.reflector),
            }
            return;
        }
        rows.resize(n * n, 0.0);
        for (w, d) in points.chain(self.extra.chunks_exact(n).map(|e| (1.0, e))) {
            for (k, entry) in rows.iter_mut().enumerate() {
                *entry += w * d[k / n] * d[k % n];
            }
        }
        root.entries.copy_from_slice(self.factor.of(rows, n));
    }

    /// Each point through the flow; P⁻ = Σ W(…)(…)ᵀ + W, W what the process noise comes to along
    /// the estimate ([`Propagation`]), which is exact on linear plants. Where it is to be kept, the transition
    /// of the linear flow that carries the points best is returned: Φ = DᵀP⁻¹ with the covariance D
    /// of the points before and after (S. Särkkä, "Unscented Rauch–Tung–Striebel smoother", *IEEE
    /// Transactions on Automatic Control* 53 (2008) 845–849).
    pub fn predict(
        &mut self,
        propagation: &mut Propagation,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Option<Profile>> {
        let weights = self.weights;
        let n = belief.x.len();
        draw(belief, weights.spread, &mut self.points);
        for point in self.points.chunks_exact_mut(n) {
            self.manifold.retract(&belief.x, point);
        }
        match self.jumps {
            false => self.flow(propagation, belief, from, to)?,
            true => self.jump(propagation, belief, from, to)?,
        }
        let at_rest: Vec<f64> = self.discrete.iter().map(|&i| self.points[i]).collect();
        let straight = self.manifold.is_straight();
        if !straight {
            let mut points = std::mem::take(&mut self.points);
            self.gather(&mut points, n, &mut belief.x);
            self.points = points;
        }
        let share = self.share();
        let transition = keep.then(|| {
            let row = |i| weights.row(&belief.root, &self.points, n, i, share);
            Profile::dense(n, (0..n).flat_map(row).collect())
        });
        if straight {
            weights.centre(&mut self.points, n, &mut belief.x);
        }
        for (&i, value) in self.discrete.iter().zip(at_rest) {
            belief.x[i] = value;
        }
        self.rest(n);
        self.extra.clear();
        propagation.push_root(&mut self.extra);
        self.spread(&mut belief.root);
        Ok(transition)
    }

    /// Each point to its image.
    fn flow(
        &mut self,
        propagation: &mut Propagation,
        belief: &Belief,
        from: f64,
        to: f64,
    ) -> Result<()> {
        let mut points = self.points.chunks_exact_mut(belief.x.len());
        if propagation.is_noisy()
            && let Some(centre) = points.next()
        {
            propagation.advance(belief, from, to)?;
            centre.copy_from_slice(&propagation.end);
        }
        for point in points {
            self.integrator
                .advance(&mut propagation.driven, from, to, point)?;
        }
        Ok(())
    }

    /// The same through events, at its own instants for each point. All of one belief end on one side of an event: a
    /// point that has not met what the estimate has is taken through it as if it had, and one that meets more goes on as
    /// if it did not. Each remembers what the estimate does, beside which it was drawn; what has no deviation is at the
    /// end what it is of the estimate.
    fn jump(
        &mut self,
        propagation: &mut Propagation,
        belief: &Belief,
        from: f64,
        to: f64,
    ) -> Result<()> {
        let n = belief.x.len();
        let (centre, others) = self.points.split_at_mut(n);
        let is_noisy = propagation.is_noisy();
        let along = propagation.memory().filter(|_| is_noisy);
        let memory = along.unwrap_or_else(|| self.integrator.memory());
        memory.count(None);
        let remembered = memory.clone();
        let own = match is_noisy {
            true => {
                propagation.advance(belief, from, to)?;
                centre.copy_from_slice(&propagation.end);
                propagation.memory().cloned().unwrap_or_default()
            }
            false => {
                let mut point = Point::new(&mut propagation.driven);
                self.integrator.advance(&mut point, from, to, centre)?;
                self.integrator.memory().clone()
            }
        };
        let happened = own.happened();
        for image in others.chunks_exact_mut(n) {
            self.integrator.memory().clone_from(&remembered);
            self.integrator.memory().count(Some(happened));
            let mut point = Point::new(&mut propagation.driven);
            self.integrator.advance(&mut point, from, to, image)?;
            for _ in self.integrator.memory().happened()..happened {
                self.integrator
                    .anticipate(&mut point, (to, to - from), image)?;
            }
            for &i in &self.discrete {
                image[i] = centre[i];
            }
        }
        *self.integrator.memory() = own;
        Ok(())
    }

    /// The mean of points of which some numbers are those of quaternions, and the points beside it, in the plane that
    /// touches there.
    fn gather(&self, points: &mut [f64], n: usize, mean: &mut Vec<f64>) {
        for point in points.chunks_exact_mut(n) {
            self.manifold.normalise(point);
        }
        let images = points.to_vec();
        let mut about = images[..n].to_vec();
        for _ in 0..MEANS {
            points.copy_from_slice(&images);
            for point in points.chunks_exact_mut(n) {
                self.manifold.flatten(&about, point);
            }
            self.weights.centre(points, n, mean);
            let moved = mean.iter().zip(&about).map(|(m, x)| (m - x).abs());
            let quaternions = self.manifold.rotations.iter().flat_map(|r| *r..r + 4);
            let moved: Vec<f64> = moved.collect();
            let moved = quaternions.map(|i| moved[i]).fold(0.0, f64::max);
            self.manifold.retract(&about, mean);
            about.clone_from(mean);
            if moved < LAST {
                break;
            }
        }
    }

    /// What counts as no variance.
    fn share(&self) -> f64 {
        match self.manifold.is_straight() {
            true => 0.0,
            false => NOTHING,
        }
    }

    /// The points drawn again from x̂⁻, P⁻; K = P_xz P_zz⁻¹ over the readings that are believed. For
    /// each of those at an end of their sensor's range they are drawn once more.
    pub fn correct(
        &mut self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        sample: &Sample<'_>,
    ) -> Result<()> {
        let before = match self.manifold.is_straight() {
            true => vec![],
            false => belief.x.clone(),
        };
        self.show(sensing, &before, belief, sample)?;
        let m = sample.readings.len();
        let (mut inside, mut at_ends) = (vec![], vec![]);
        let readings = self.manifold.signed(sample.readings, &self.expected);
        for (i, reading) in readings.iter().enumerate() {
            let spread = self.weights.moment(&self.shown, m, i, i);
            let believed = sensing.judge(i, *reading, self.expected[i], spread);
            if let Some(believed) = believed.filter(|b| spread + b.variance > 0.0) {
                match believed.end {
                    None => inside.push(believed),
                    Some(_) => at_ends.push((believed, self.expected[i])),
                }
            }
        }
        if let Some(record) = &mut sensing.record {
            record.spread(|i, j| self.weights.moment(&self.shown, m, i, j));
            record.count(&inside);
        }
        let mut is_moved = false;
        if !inside.is_empty() {
            self.take(sensing, belief, m, &inside);
            is_moved = true;
        }
        for (mut believed, expected) in at_ends {
            if is_moved && self.show(sensing, &before, belief, sample).is_err() {
                // the sensors' model has no value about the estimate as it is now: the others count
                break;
            }
            let i = believed.sensor;
            let spread = self.weights.moment(&self.shown, m, i, i);
            let moved = self.expected[i] - expected;
            if let Some(record) = &mut sensing.record {
                record.count_at_end(&believed, moved, spread);
            }
            if let Some((innovation, noise)) = believed.weighed(moved, spread) {
                (believed.innovation, believed.variance) = (innovation, noise);
                self.take(sensing, belief, m, &[believed]);
                is_moved = true;
            }
        }
        Ok(())
    }
}

/// The lower root of AᵀA for rows A, without a column for states that do not differ: what stands there else depends on
/// rounding, and so would the points.
fn root_of_moving(rows: &mut [f64], room: &mut Reflector, root: &mut Root) {
    let n = root.n;
    let moves = |i: &usize| rows.iter().skip(*i).step_by(n).any(|x| *x != 0.0);
    let moving: Vec<usize> = (0..n).filter(moves).collect();
    if moving.len() == n {
        return root.of_rows(rows, room);
    }
    for row in rows.chunks_exact_mut(n) {
        for (place, &i) in moving.iter().enumerate() {
            row[place] = row[i];
        }
        row[moving.len()..].fill(0.0);
    }
    root.of_rows(rows, room);
    let packed = root.entries.clone();
    root.entries.fill(0.0);
    for (a, i) in moving.iter().enumerate() {
        for (b, j) in moving[..=a].iter().enumerate() {
            root.entries[i * n + j] = packed[a * n + b];
        }
    }
}

/// x̂ and x̂ ± columns of √(n+λ) L, L the lower factor of P, point by point.
fn draw(belief: &Belief, spread: f64, points: &mut Vec<f64>) {
    let n = belief.x.len();
    points.clear();
    points.extend_from_slice(&belief.x);
    for sign in [1.0, -1.0] {
        for k in 0..n {
            let column = (0..n).map(|i| belief.root.row(i)[k]);
            let moved = belief.x.iter().zip(column);
            points.extend(moved.map(|(x, l)| x + sign * spread * l));
        }
    }
}

impl Weights {
    fn of(&self, k: usize) -> f64 {
        match k {
            0 => self.centre,
            _ => self.other,
        }
    }

    /// Points of `size` numbers beside their weighed mean.
    fn centre(&self, points: &mut [f64], size: usize, mean: &mut Vec<f64>) {
        mean.clear();
        mean.resize(size, 0.0);
        for (k, point) in points.chunks_exact(size.max(1)).enumerate() {
            let weight = if k > 0 {
                self.other
            } else {
                self.mean_of_centre
            };
            for (m, x) in mean.iter_mut().zip(point) {
                *m += weight * x;
            }
        }
        for point in points.chunks_exact_mut(size.max(1)) {
            point.iter_mut().zip(&*mean).for_each(|(x, m)| *x -= m);
        }
    }

    /// Σ W ab over the points.
    fn sum<'p>(&self, pairs: impl Iterator<Item = (&'p f64, &'p f64)>) -> f64 {
        let weighed = pairs.enumerate().map(|(k, (a, b))| self.of(k) * a * b);
        weighed.sum()
    }

    /// Σ W ab of components i and j of points of `size` numbers.
    fn moment(&self, points: &[f64], size: usize, i: usize, j: usize) -> f64 {
        let component = |i: usize| points.iter().skip(i).step_by(size);
        self.sum(component(i).zip(component(j)))
    }

    /// The linear map that takes the points drawn from `root` best to component i of their images
    /// of `size` numbers; `share` is that of a state's variance which counts as none.
    fn row(&self, root: &Root, images: &[f64], size: usize, i: usize, share: f64) -> Vec<f64> {
        let n = root.n;
        let of = |k: usize| images[k * size + i];
        let apart = (0..n).map(|k| {
            let (one, other) = (of(1 + k), of(1 + n + k));
            // what is left of a direction without variance is rounding, and would be divided by nothing
            let rounding = ROUNDING * one.abs().max(other.abs());
            let apart = one - other;
            if apart.abs() > rounding { apart } else { 0.0 }
        });
        let halves: Vec<f64> = apart.map(|d| 0.5 * d / self.spread).collect();
        root.against(&halves, share)
    }
}

/// x with L Lᵀ x = b.
fn solved(lower: &[f64], m: usize, mut b: Vec<f64>) -> Vec<f64> {
    substitute(lower, m, &mut b);
    b
}
