//! Particle filters: what is known of the state as a cloud of weighted points, of whatever shape.
//!
//! Between samples each particle runs along the plant's flow under noise of its own; at a sample its weight is multiplied
//! by how likely the readings are where it is. Where the effective number of particles, (Σw)²/Σw², falls below a share
//! of their number, they are drawn anew from the weights, systematically (N. J. Gordon, D. J. Salmond and A. F. M. Smith,
//! *IEE Proceedings F* 140 (1993) 107–113; G. Kitagawa, *Journal of Computational and Graphical Statistics* 5 (1996) 1–25).
//! With a look ahead particles are drawn before they run, by how likely the readings are where the flow without noise
//! takes them (half of them; the others as they are), and weighed by what that did not know (M. K. Pitt and N. Shephard, *Journal of the American Statistical
//! Association* 94 (1999) 590–599). Or all of them move together, as an ensemble ([`ensemble`]).

mod code;
mod ensemble;
mod likelihood;
mod moments;
mod way;

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

use super::censored::Believed;
use super::health::{Health, Innovation, ParticleHealth};
use super::model::{NoisyModel, Sensor};
use super::record::Record;
use super::sensing::Sensing;
use super::settings::{FilterSettings, Particles};
use crate::divergence::{Bound, check_deviations};
use crate::error::state_text;
use crate::manifold::Manifold;
use crate::method::are_finite;
use crate::noise::Level;
use crate::runner::{Runner, Sample};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::standing::{self, Errors, Stand, Standing};
use crate::{Error, EstimatorSettings, Result};
use code::BLOCK;
use ensemble::Ensemble;
use likelihood::Likelihood;
use moments::Moments;
use way::{Cloud, Interval, Way, shares, stream};

/// The logarithm of the likelihood of readings that no particle explains: the least that a number has.
const NO_CHANCE: f64 = -708.0;

/// Fewer effective particles are one.
const ALONE: f64 = 2.0;

/// A particle filter under way.
#[derive(Clone, Debug)]
pub(crate) struct ParticleFilter {
    settings: Particles,
    way: Way,
    sensing: Sensing,
    sensors: Vec<Sensor>,
    manifold: Manifold,
    cloud: Cloud,
    /// where the particles were before the last way, where a look ahead begins
    earlier: Option<(Cloud, Interval)>,
    /// rounds of random numbers so far
    round: u64,
    /// known inputs from the last sample on
    inputs: Vec<f64>,
    /// of all states
    estimate: Vec<f64>,
    /// without those that every row draws anew and nobody estimates
    deviations: Vec<f64>,
    /// the estimate is that of another cloud
    is_stale: bool,
    /// (Σw)²/Σw² after the last update, before particles were drawn anew
    effective: f64,
    bound: Bound,
    moments: Moments,
    shown: Vec<f64>,
}

impl ParticleFilter {
    /// Particles drawn from what is known of the plant's start.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers, for a smoother or bounds, and for a sensor without noise.
    pub fn new(
        model: &NoisyModel,
        settings: &FilterSettings,
        particles: &Particles,
        run: EstimatorSettings,
    ) -> Result<Self> {
        let flow = model.flow.system();
        let n = flow.states().len();
        settings.check(n, model.ranges.len())?;
        particles.check(&model.sensors)?;
        if particles.inflation.is_some() && flow.has_clauses() {
            return Err(Error::setting("event", "none in an ensemble", "`when`"));
        }
        let (start, root) = model.start();
        let mut own = Self {
            settings: particles.clone(),
            way: Way::new(model, run)?,
            sensing: Sensing::new(model, settings),
            sensors: model.sensors.clone(),
            manifold: model.manifold.clone(),
            cloud: Cloud {
                x: vec![0.0; particles.count * n],
                memories: match flow.has_clauses() {
                    true => vec![Default::default(); particles.count],
                    false => vec![],
                },
                ..Cloud::even(particles.count)
            },
            earlier: None,
            round: 0,
            inputs: vec![0.0; flow.signals().len()],
            estimate: start.clone(),
            deviations: model.initial_variance[..n - model.drawn]
                .iter()
                .map(|v| v.sqrt())
                .collect(),
            is_stale: true,
            effective: particles.count as f64,
            bound: Bound::new(flow.start()),
            moments: Moments::default(),
            shown: vec![],
        };
        own.sensing.health.particles = Some(ParticleHealth::default());
        for (block, cloud) in own.cloud.x.chunks_mut(BLOCK * n).enumerate() {
            let mut random = stream(particles.seed, 0, block);
            for x in cloud.chunks_exact_mut(n) {
                draw(&start, &root, x, &mut random);
                own.manifold.retract(&start, x);
            }
        }
        Ok(own)
    }

    fn count(&self) -> usize {
        self.settings.count
    }

    fn told(&mut self) -> &mut ParticleHealth {
        self.sensing.health.particles.get_or_insert_default()
    }

    /// An ensemble's sample covariances are those of what it is drawn from; weights are probabilities.
    fn unbiased(&self) -> f64 {
        let count = self.count() as f64;
        match self.settings.inflation {
            Some(_) => count / (count - 1.0),
            None => 1.0,
        }
    }

    /// Moves all particles together by these readings.
    fn move_together(&mut self, taken: &[Believed], inflation: f64) -> f64 {
        self.round += 1;
        let mut random = stream(self.settings.seed, self.round, 0);
        let n = self.estimate.len();
        // sums of rotations are told in the plane at their mean
        let about = (!self.manifold.is_straight()).then(|| {
            let Cloud { x, share, .. } = &self.cloud;
            self.moments.condense(x, share, &self.manifold, n);
            self.moments.mean.clone()
        });
        let particles = self.cloud.x.chunks_exact_mut(n);
        if let Some(about) = &about {
            particles.for_each(|x| self.manifold.flatten(about, x));
        }
        let mut ensemble = Ensemble {
            x: &mut self.cloud.x,
            n,
            shown: &mut self.shown,
            m: self.sensors.len(),
        };
        let log_likelihood = ensemble.take(taken, &self.moments.expected);
        ensemble.spread(inflation, &mut random);
        let particles = self.cloud.x.chunks_exact_mut(n);
        if let Some(about) = &about {
            particles.for_each(|x| self.manifold.retract(about, x));
        }
        log_likelihood
    }

    /// What the sensors show at a sample, and what becomes of its readings.
    fn judge(&mut self, sample: &Sample<'_>) -> Result<Vec<Believed>> {
        self.way
            .show(&self.cloud, sample.t, sample.inputs, &mut self.shown);
        let m = sample.readings.len();
        self.moments
            .show(&self.cloud.share, &mut self.shown, m, &self.manifold);
        let expected = &self.moments.expected;
        if let Some(i) = expected.iter().position(|y| !y.is_finite()) {
            // what the sensors say of it at the estimate, where that has a name
            let map = &mut self.sensing.output_map;
            map.predict(sample.t, &self.estimate, sample.inputs)?;
            return Err(Error::NotFinite {
                time: sample.t,
                operation: format!("'{}' has no value at any particle", self.sensors[i].name),
                state: state_text(self.way.system().states(), &self.estimate),
            });
        }
        let readings = self.manifold.signed(sample.readings, expected);
        let mut taken = vec![];
        let unbiased = self.unbiased();
        for (i, reading) in readings.iter().enumerate() {
            let spread = unbiased * self.moments.spread(&self.shown, i, i);
            let believed = self.sensing.judge(i, *reading, expected[i], spread);
            taken.extend(believed);
            let Innovation {
                value, deviation, ..
            } = self.sensing.innovations[i];
            if !(value / deviation).powi(2).is_finite() {
                let name = &self.sensors[i].name;
                return Err(Error::NotFinite {
                    time: sample.t,
                    operation: format!(
                        "the reading {reading:e} of '{name}' is too far off for numbers"
                    ),
                    state: state_text(self.way.system().states(), &self.estimate),
                });
            }
        }
        if let Some(record) = &mut self.sensing.record {
            record.spread(|i, j| unbiased * self.moments.spread(&self.shown, i, j));
        }
        Ok(taken)
    }

    /// The logarithm of how likely these readings are at each particle, by what the sensors show there.
    fn likelihoods(&self, taken: &[Believed], shown: &[f64]) -> Vec<f64> {
        let m = self.sensors.len();
        let own: Vec<(usize, Likelihood)> = taken
            .iter()
            .map(|believed| {
                let i = believed.sensor;
                let size = self.moments.expected[i].abs();
                let (reading, end) = (believed.reading, believed.end);
                (i, Likelihood::of(&self.sensors[i], reading, end, size))
            })
            .collect();
        let rows = shown.chunks_exact(m.max(1));
        let of = |row: &[f64]| own.iter().map(|(i, one)| one.log_density(row[*i])).sum();
        rows.map(of).collect()
    }

    /// Weighs the particles by these readings. What no particle explains leaves them as they are.
    fn weigh(&mut self, taken: &[Believed], sample: &Sample<'_>) -> f64 {
        let ahead = match self.earlier.take() {
            Some((cloud, interval)) if interval.to == sample.t => {
                self.look_ahead(cloud, &interval, taken, sample)
            }
            _ => None,
        };
        if let Some(log_likelihood) = ahead {
            return log_likelihood;
        }
        let own = self.likelihoods(taken, &self.shown);
        let joint = sums(&self.cloud.log, &own);
        let log_likelihood = self.cloud.give(joint);
        if !log_likelihood.is_finite() {
            self.told().starved += 1;
            return NO_CHANCE;
        }
        log_likelihood
    }

    /// The cloud of the auxiliary filter in the place of the present one, from where the particles were; none where
    /// it has none.
    fn look_ahead(
        &mut self,
        before: Cloud,
        interval: &Interval,
        taken: &[Believed],
        sample: &Sample<'_>,
    ) -> Option<f64> {
        let n = self.estimate.len();
        let mut places = before.clone();
        let seed = self.settings.seed;
        self.way.advance(&mut places, interval, seed, None).ok()?;
        let first = self.likelihoods_of(&places, taken, sample);
        let (_, foreseen) = shares(&sums(&before.log, &first))?;
        // half of them as they are: what the flow without noise misses is drawn, too, and no weight is beyond all others
        let pairs = foreseen.iter().zip(&before.share);
        let drawn: Vec<f64> = pairs.map(|(f, w)| 0.5 * (f + w)).collect();
        let ancestors = self.ancestors(&drawn);
        let mut cloud = before.of(&ancestors, n);
        let round = Some(&mut self.round);
        let put_back = self.way.advance(&mut cloud, interval, seed, round).ok()?;
        self.normalise(&mut cloud);
        let second = self.likelihoods_of(&cloud, taken, sample);
        let pairs = second.iter().zip(&ancestors);
        let rest = pairs.map(|(l, a)| l + (before.share[*a] / drawn[*a]).ln());
        let chance = cloud.give(rest.collect());
        if !chance.is_finite() {
            return None;
        }
        self.cloud = cloud;
        let told = self.told();
        told.put_back += put_back;
        told.resampled += 1;
        Some(chance - (ancestors.len() as f64).ln())
    }

    /// The same of another cloud.
    fn likelihoods_of(
        &mut self,
        cloud: &Cloud,
        taken: &[Believed],
        sample: &Sample<'_>,
    ) -> Vec<f64> {
        let mut shown = vec![];
        self.way.show(cloud, sample.t, sample.inputs, &mut shown);
        self.lift(&mut shown);
        self.likelihoods(taken, &shown)
    }

    /// Angles as the nearest ones to what was expected.
    fn lift(&self, shown: &mut [f64]) {
        let m = self.sensors.len();
        for dial in &self.manifold.dials {
            let expected = self.moments.expected[*dial];
            for shown in shown.iter_mut().skip(*dial).step_by(m) {
                *shown = self.manifold.lifted(*dial, *shown, expected);
            }
        }
    }

    /// Systematic draws: particle k has the place at (k + u)/N of the sum of the weights.
    fn ancestors(&mut self, weights: &[f64]) -> Vec<usize> {
        self.round += 1;
        let mut random = stream(self.settings.seed, self.round, 0);
        let first: f64 = StandardUniform.sample(&mut random);
        systematic(weights, first)
    }

    /// Particles in the place of those with little weight, where few count.
    fn resample(&mut self) {
        let few = self.settings.resample_below * self.count() as f64;
        if self.effective >= few || self.settings.inflation.is_some() {
            return;
        }
        let weights = std::mem::take(&mut self.cloud.share);
        let ancestors = self.ancestors(&weights);
        self.cloud = self.cloud.of(&ancestors, self.estimate.len());
        self.told().resampled += 1;
    }

    /// Estimate and deviations of the cloud.
    fn condense(&mut self) {
        let (Cloud { x, share, .. }, moments) = (&self.cloud, &mut self.moments);
        moments.condense(x, share, &self.manifold, self.estimate.len());
        self.estimate.copy_from_slice(&moments.mean);
        let told = self.deviations.len();
        self.deviations.copy_from_slice(&moments.deviations[..told]);
        let unbiased = self.unbiased().sqrt();
        self.deviations.iter_mut().for_each(|d| *d *= unbiased);
        self.is_stale = false;
    }

    fn normalise(&self, cloud: &mut Cloud) {
        for x in cloud.x.chunks_exact_mut(self.estimate.len()) {
            self.manifold.normalise(x);
        }
    }

    fn count_effective(&mut self) {
        let squares: f64 = self.cloud.share.iter().map(|w| w * w).sum();
        let effective = squares.recip();
        self.effective = effective;
        self.told().see(effective, ALONE);
    }
}

impl Runner for ParticleFilter {
    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<()> {
        self.bound.see(&self.inputs);
        let interval = Interval {
            from,
            to: sample.t,
            begin: self.inputs.clone(),
            end: sample.inputs.to_vec(),
        };
        let before = (self.settings.looks_ahead).then(|| self.cloud.clone());
        let mut cloud = std::mem::take(&mut self.cloud);
        let (seed, round) = (self.settings.seed, Some(&mut self.round));
        let done = self.way.advance(&mut cloud, &interval, seed, round);
        self.normalise(&mut cloud);
        self.cloud = cloud;
        self.told().put_back += done?;
        let n = self.estimate.len();
        // a particle without a value is none from here on
        let particles = self.cloud.x.chunks_exact(n).zip(&self.cloud.log);
        let alive = |(x, log): (&[f64], &f64)| match are_finite(x) {
            true => *log,
            false => f64::NEG_INFINITY,
        };
        if !are_finite(&self.cloud.x)
            && (self.settings.inflation.is_some()
                || !self.cloud.give(particles.map(alive).collect()).is_finite())
        {
            let memory = self.cloud.memories.first();
            return Err(self.way.why(&self.estimate, memory, &interval));
        }
        self.inputs.copy_from_slice(sample.inputs);
        self.earlier = before.map(|before| (before, interval));
        self.is_stale = true;
        Ok(())
    }

    fn update(&mut self, sample: &Sample<'_>) -> Result<()> {
        self.sensing.health.inputs_held += sample.held;
        self.inputs.copy_from_slice(sample.inputs);
        if let Some(record) = &mut self.sensing.record {
            record.clear(false);
        }
        let taken = self.judge(sample)?;
        let mut log_likelihood = 0.0;
        if !taken.is_empty() {
            log_likelihood = match self.settings.inflation {
                Some(inflation) => self.move_together(&taken, inflation),
                None => self.weigh(&taken, sample),
            };
            self.count_effective();
        }
        self.condense();
        let unbiased = self.unbiased();
        if let Some(record) = &mut self.sensing.record {
            record.log_likelihood = log_likelihood;
            self.moments.write_covariance(
                &self.cloud.x,
                self.deviations.len(),
                &mut record.covariance,
            );
            record
                .covariance
                .iter_mut()
                .for_each(|entry| *entry *= unbiased);
        }
        self.resample();
        Ok(())
    }

    fn report(&mut self, t: f64) -> Result<()> {
        if self.is_stale {
            self.condense();
        }
        let names = self.way.system().states();
        self.bound.check(t, names, &self.estimate, String::new)?;
        check_deviations(t, names, &self.deviations)
    }

    fn estimate(&self) -> &[f64] {
        &self.estimate[..self.deviations.len()]
    }

    fn deviations(&self) -> Option<&[f64]> {
        Some(&self.deviations)
    }

    fn innovations(&self) -> &[Innovation] {
        &self.sensing.innovations
    }

    fn health(&self) -> &Health {
        &self.sensing.health
    }

    fn keep_record(&mut self) {
        let (states, sensors) = (self.deviations.len(), self.sensors.len());
        self.sensing.record = Some(Record::new(states, sensors));
    }

    fn record(&self) -> Option<&Record> {
        self.sensing.record.as_ref()
    }

    fn effective(&self) -> Option<f64> {
        Some(self.effective)
    }

    fn particles(&self) -> Option<(&[f64], &[f64])> {
        Some((&self.cloud.x, &self.cloud.share))
    }

    /// What every row draws anew is left out.
    fn stand(&self) -> Stand<'_> {
        let (n, own) = (self.estimate.len(), self.deviations.len());
        let particles = self.cloud.x.chunks_exact(n.max(1));
        Stand {
            names: &self.way.system().states()[..own],
            own,
            x: &self.estimate[..own],
            errors: Errors::Particles {
                x: particles.flat_map(|x| &x[..own]).copied().collect(),
                log: self.cloud.log.clone(),
                round: self.round,
            },
        }
    }

    fn resume(&mut self, sample: &Sample<'_>, standing: &Standing) -> Result<()> {
        let n = self.estimate.len();
        let places = standing.places(self.way.system().states(), self.deviations.len())?;
        let (expected, m) = (format!("{} particles", self.count()), standing.states.len());
        let Errors::Particles { x, log, round } = &standing.errors else {
            return Err(standing::other_errors(&expected, "none"));
        };
        if log.len() != self.count() || x.len() != m * log.len() {
            let found = format!("{} particles", log.len());
            return Err(standing::other_errors(&expected, &found));
        }
        let pairs = x
            .chunks_exact(m.max(1))
            .zip(self.cloud.x.chunks_exact_mut(n));
        for (from, to) in pairs {
            for (to, place) in to.iter_mut().zip(&places) {
                *to = place
                    .and_then(|place| from.get(place))
                    .copied()
                    .unwrap_or(*to);
            }
        }
        self.cloud.give(log.clone());
        self.round = *round;
        self.inputs.copy_from_slice(sample.inputs);
        self.condense();
        self.bound.see(&self.estimate);
        Ok(())
    }

    fn copied(&self) -> Box<dyn Runner> {
        Box::new(self.clone())
    }
}

impl Persist for ParticleFilter {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.cloud.walk(walk)?;
        walk.word(&mut self.round)?;
        let (states, count) = (self.estimate.len(), self.settings.count);
        let inputs = self.inputs.len();
        let has_memory = !self.cloud.memories.is_empty();
        walk.optional(&mut self.earlier, |walk, (cloud, interval)| {
            cloud.x.resize(states * count, 0.0);
            cloud.log.resize(count, 0.0);
            cloud.share.resize(count, 0.0);
            let memories = if has_memory { count } else { 0 };
            cloud.memories.resize(memories, Default::default());
            interval.begin.resize(inputs, 0.0);
            interval.end.resize(inputs, 0.0);
            cloud.walk(walk)?;
            walk.number(&mut interval.from)?;
            walk.number(&mut interval.to)?;
            walk.numbers(&mut interval.begin)?;
            walk.numbers(&mut interval.end)
        })?;
        walk.numbers(&mut self.inputs)?;
        self.sensing.walk(walk)?;
        walk.numbers(&mut self.estimate)?;
        walk.numbers(&mut self.deviations)?;
        walk.flag(&mut self.is_stale)?;
        walk.number(&mut self.effective)?;
        walk.number(&mut self.bound.scale)
    }
}

impl Persist for Cloud {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(&mut self.x)?;
        walk.numbers(&mut self.log)?;
        walk.numbers(&mut self.share)?;
        self.memories.iter_mut().try_for_each(|m| m.walk(walk))
    }
}

impl Particles {
    /// That they can be, with these sensors.
    fn check(&self, sensors: &[Sensor]) -> Result<()> {
        if !(2..=Self::MOST).contains(&self.count) {
            let expected = format!("a number from 2 to {}", Self::MOST);
            return Err(Error::setting("particles", expected, self.count));
        }
        let share = self.resample_below;
        if !(0.0..=1.0).contains(&share) {
            let expected = "a share of the particles, from 0 to 1";
            return Err(Error::setting("resample_below", expected, share));
        }
        if let Some(inflation) = self.inflation
            && !(inflation >= 1.0 && inflation.is_finite())
        {
            let expected = "a number of 1 at least";
            return Err(Error::setting("inflation", expected, inflation));
        }
        let is_exact = |sensor: &&Sensor| {
            let (Level::Absolute(size) | Level::Relative(size) | Level::Uniform(size)) =
                sensor.noise;
            size == 0.0
        };
        match sensors.iter().find(is_exact) {
            None => Ok(()),
            Some(sensor) => {
                let what = format!("noise of '{}'", sensor.name);
                let expected =
                    "more than 0: particles are weighed by it, and none explains a reading exactly";
                Err(Error::setting(what, expected, 0))
            }
        }
    }
}

/// x = start + Lξ.
fn draw(start: &[f64], root: &[f64], x: &mut [f64], random: &mut ChaCha8Rng) {
    let n = x.len();
    let ξ: Vec<f64> = (0..n).map(|_| StandardNormal.sample(random)).collect();
    for (i, x) in x.iter_mut().enumerate() {
        let moved = root[i * n..][..n].iter().zip(&ξ).map(|(l, ξ)| l * ξ);
        *x = start[i] + moved.sum::<f64>();
    }
}

/// One by one.
fn sums(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// The places at (k + first)/N of these weights one after the other, which sum to 1.
fn systematic(weights: &[f64], first: f64) -> Vec<usize> {
    let count = weights.len();
    let mut places = Vec::with_capacity(count);
    let (mut sum, mut last) = (0.0, 0);
    for (place, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        (sum, last) = (sum + weight * count as f64, place);
        while places.len() < count && places.len() as f64 + first < sum {
            places.push(place);
        }
    }
    // what rounding has left
    places.resize(count, last);
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_are_drawn_in_proportion_to_their_weights() {
        let weights = [0.1, 0.0, 0.5, 0.4].map(|w| w / 100.0);
        let many: Vec<f64> = weights.iter().flat_map(|w| [*w; 100]).collect();
        for first in [0.0, 0.3, 0.999] {
            let places = systematic(&many, first);
            assert_eq!(places.len(), 400);
            let count = |own: usize| places.iter().filter(|p| *p / 100 == own).count();
            assert_eq!(count(1), 0);
            for (own, expected) in [(0, 40), (2, 200), (3, 160)] {
                assert!(count(own).abs_diff(expected) <= 1, "{own} {}", count(own));
            }
            assert!(places.is_sorted());
        }
    }

    #[test]
    fn weights_too_small_for_numbers_are_weights() {
        let mut cloud = Cloud::even(3);
        let whole = cloud.give(vec![-2000.0, -2000.0, f64::NEG_INFINITY]);
        assert!((whole - (2.0_f64.ln() - 2000.0)).abs() < 1e-12);
        assert_eq!(cloud.share, [0.5, 0.5, 0.0]);
        assert_eq!(cloud.give(vec![f64::NEG_INFINITY; 3]), f64::NEG_INFINITY);
        assert_eq!(cloud.share, [0.5, 0.5, 0.0]);
    }
}
