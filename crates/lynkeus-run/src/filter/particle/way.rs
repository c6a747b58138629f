//! From one sample to the next: every particle along the plant's flow, under noise of its own.

use std::sync::{Arc, OnceLock};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::code::{self, BLOCK, Code, Stride, line};
use crate::events::{Clauses, Memory, Seen};
use crate::filter::belief::confine;
use crate::filter::model::NoisyModel;
use crate::integrator::{APART, AUTO_PRODUCT, check_interval, fixed_steps, instant, pieces};
use crate::method::are_finite;
use crate::noise::Limits;
use crate::{
    Dynamics, Error, EstimatorSettings, Evaluation, Events, Integrator, Linearised, Method, Result,
    Slopes, Step, System, spectral_radius,
};

/// Steps whose shared values are found ahead.
const AHEAD: usize = 64;

/// Most steps from one sample to the next where the study does not give them.
const MOST: usize = 100_000;

/// Steps of particles that are worth another thread.
const WORTHWHILE: usize = 16_384;

/// States of which the outermost particles are looked at for a step that is short enough.
const AXES: usize = 8;

/// Particles under way.
#[derive(Clone, Debug, Default)]
pub(super) struct Cloud {
    /// particle by particle
    pub x: Vec<f64>,
    /// logarithms of their weights
    pub log: Vec<f64>,
    /// their weights, which sum to 1
    pub share: Vec<f64>,
    /// what each remembers of the clauses by which the state jumps; empty where it never does
    pub memories: Vec<Memory>,
}

impl Cloud {
    /// The particles of these places, all with the same weight.
    pub fn of(&self, ancestors: &[usize], n: usize) -> Self {
        let x = ancestors.iter().flat_map(|&a| &self.x[a * n..][..n]);
        let memories = match self.memories.is_empty() {
            true => vec![],
            false => ancestors
                .iter()
                .map(|&a| self.memories[a].clone())
                .collect(),
        };
        Self {
            x: x.copied().collect(),
            memories,
            ..Self::even(ancestors.len())
        }
    }

    /// So many particles with the same weight, which are nowhere yet.
    pub fn even(count: usize) -> Self {
        let share = (count as f64).recip();
        Self {
            log: vec![share.ln(); count],
            share: vec![share; count],
            ..Self::default()
        }
    }

    /// Gives the particles weights in proportion to those with these logarithms; the logarithm of their sum. Where none
    /// has any, they stay as they are.
    pub fn give(&mut self, mut logarithms: Vec<f64>) -> f64 {
        let Some((whole, share)) = shares(&logarithms) else {
            return f64::NEG_INFINITY;
        };
        logarithms.iter_mut().for_each(|l| *l -= whole);
        (self.log, self.share) = (logarithms, share);
        whole
    }
}

/// The logarithm of the sum of what has these logarithms, and its shares in it; none where it is 0.
pub(super) fn shares(logarithms: &[f64]) -> Option<(f64, Vec<f64>)> {
    let most = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return None;
    }
    let mut shares: Vec<f64> = logarithms.iter().map(|l| (l - most).exp()).collect();
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|share| *share /= sum);
    Some((most + sum.ln(), shares))
}

/// The random numbers of a block in a round.
pub(super) fn stream(seed: u64, round: u64, block: usize) -> ChaCha8Rng {
    let mut stream = ChaCha8Rng::seed_from_u64(seed);
    stream.set_stream((round << 24) | block as u64);
    stream
}

/// Where a way begins and ends, and the known inputs there.
#[derive(Clone, Debug, Default)]
pub(super) struct Interval {
    pub from: f64,
    pub to: f64,
    pub begin: Vec<f64>,
    pub end: Vec<f64>,
}

/// The plant between samples.
#[derive(Clone, Debug)]
pub(super) struct Way {
    /// in lanes; none where the state jumps by clauses, or a step is too large for one function
    code: Option<Box<dyn Code>>,
    /// the same inside the declared ranges, for particles that come to where the plant has no value; made when one does
    spare: Arc<OnceLock<Option<Box<dyn Code>>>>,
    confined: Option<Linearised>,
    output_map: Linearised,
    sensors: Evaluation,
    ranges: Vec<Limits>,
    noise: Vec<f64>,
    /// so many last states are drawn anew in every row
    drawn: usize,
    pub evaluation: Evaluation,
    integrator: Integrator,
    /// signals are lines between samples
    follows: bool,
    step: Option<Step>,
    /// most threads
    threads: usize,
}

impl Way {
    /// Of a plant, run like this.
    pub fn new(model: &NoisyModel, run: EstimatorSettings) -> Result<Self> {
        run.method.check()?;
        let flow = model.flow.system();
        let is_smooth = !flow.has_clauses();
        let code = || code::code(flow, &model.output_map, &model.process_noise);
        Ok(Self {
            code: is_smooth.then(code).flatten(),
            spare: Arc::default(),
            confined: model.confined.clone(),
            output_map: model.output_map.clone(),
            sensors: model.output_map.system().evaluation(),
            ranges: model.ranges.clone(),
            noise: model.process_noise.clone(),
            drawn: model.drawn,
            evaluation: flow.driven(run.between),
            integrator: Integrator::new(Method::Rk4(Step::Substeps(1)), flow.states().len())?,
            follows: run.between == crate::BetweenSamples::Linear,
            step: match run.method {
                Method::Rk4(step @ (Step::AtMost(_) | Step::Substeps(_))) => Some(step),
                _ => None,
            },
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        })
    }

    pub fn system(&self) -> &System {
        self.evaluation.system()
    }

    /// Takes all particles along an interval, in rounds of random numbers from `round` on, which is moved, or without
    /// noise. Those that come to where the plant has no value are no numbers afterwards; how often one was put back into
    /// the declared ranges instead.
    ///
    /// # Errors
    /// [`Error::TooStiff`], [`Error::Setting`] for an interval that is too short, and those of [`Events::instants`].
    pub fn advance(
        &mut self,
        cloud: &mut Cloud,
        interval: &Interval,
        seed: u64,
        round: Option<&mut u64>,
    ) -> Result<usize> {
        check_interval(interval.from, interval.to)?;
        let strides = self.strides(cloud, interval)?;
        let mut put_back = 0;
        let mut round = round;
        for strides in strides.chunks(AHEAD) {
            let own = round.as_mut().map(|round| {
                **round += 1;
                (seed, **round)
            });
            if let Some(code) = &mut self.code {
                code.aim(strides);
            }
            put_back += self.chunk(cloud, interval, strides, own);
        }
        if self.drawn > 0 {
            let own = round.map(|round| {
                *round += 1;
                (seed, *round)
            });
            self.renew(cloud, own);
        }
        Ok(put_back)
    }

    /// What the row at the end draws anew, of every particle; nothing of it without noise.
    fn renew(&self, cloud: &mut Cloud, random: Option<(u64, u64)>) {
        let n = self.system().states().len();
        for (block, x) in cloud.x.chunks_mut(BLOCK * n).enumerate() {
            let mut random = random.map(|(seed, round)| stream(seed, round, block));
            for drawn in x.chunks_exact_mut(n).flat_map(|x| &mut x[n - self.drawn..]) {
                *drawn = random.as_mut().map_or(0.0, |r| StandardNormal.sample(r));
            }
        }
    }

    /// Some steps of all particles, block by block.
    fn chunk(
        &mut self,
        cloud: &mut Cloud,
        interval: &Interval,
        strides: &[Stride],
        random: Option<(u64, u64)>,
    ) -> usize {
        let n = self.system().states().len();
        let mut memories: Vec<&mut [Memory]> = cloud.memories.chunks_mut(BLOCK).collect();
        memories.resize_with(cloud.x.len().div_ceil(BLOCK * n), Default::default);
        let mut blocks: Vec<_> = cloud.x.chunks_mut(BLOCK * n).zip(memories).collect();
        let work = blocks.len() * BLOCK * strides.len();
        let threads = self.threads.min(work / WORTHWHILE);
        let threads = threads.clamp(1, blocks.len().max(1));
        let size = blocks.len().div_ceil(threads).max(1);
        let go = |own: &mut Self, first: usize, blocks: &mut [(&mut [f64], &mut [Memory])]| {
            let blocks = blocks.iter_mut().enumerate();
            let gone = blocks.map(|(place, (x, memories))| {
                let random = random.map(|(seed, round)| stream(seed, round, first + place));
                own.block(x, memories, interval, strides, random)
            });
            gone.sum::<usize>()
        };
        if threads == 1 {
            return go(self, 0, &mut blocks);
        }
        std::thread::scope(|scope| {
            let mut shares: Vec<_> = blocks.chunks_mut(size).enumerate().collect();
            let last = shares.pop();
            let handles: Vec<_> = shares
                .into_iter()
                .map(|(place, blocks)| {
                    let mut own = self.clone();
                    scope.spawn(move || go(&mut own, place * size, blocks))
                })
                .collect();
            let own = last.map_or(0, |(place, blocks)| go(self, place * size, blocks));
            // a thread that panics has panicked on
            own + handles
                .into_iter()
                .map(|handle| handle.join().unwrap_or_default())
                .sum::<usize>()
        })
    }

    /// One block through some steps.
    fn block(
        &mut self,
        x: &mut [f64],
        memories: &mut [Memory],
        interval: &Interval,
        strides: &[Stride],
        mut random: Option<ChaCha8Rng>,
    ) -> usize {
        let n = self.system().states().len();
        let Some(code) = &mut self.code else {
            for (k, x) in x.chunks_exact_mut(n).enumerate() {
                let mut none = Memory::default();
                let memory = memories.get_mut(k).unwrap_or(&mut none);
                self.one(x, memory, interval, strides, random.as_mut());
            }
            return 0;
        };
        let before = self.confined.is_some().then(|| x.to_vec());
        code.advance(x, random.as_mut());
        match before {
            Some(before) if !are_finite(x) => self.put_back(x, before, strides, random),
            _ => 0,
        }
    }

    /// Those that came to where the plant has no value once more, inside the declared ranges.
    fn put_back(
        &self,
        x: &mut [f64],
        mut before: Vec<f64>,
        strides: &[Stride],
        mut random: Option<ChaCha8Rng>,
    ) -> usize {
        let n = self.system().states().len();
        let make = || {
            let flow = self.confined.as_ref()?.system();
            code::code(flow, &self.output_map, &self.noise)
        };
        let Some(mut code) = self.spare.get_or_init(make).clone() else {
            return 0;
        };
        for (own, before) in x.chunks_exact(n).zip(before.chunks_exact_mut(n)) {
            if !are_finite(own) {
                confine(before, &self.ranges);
            }
        }
        code.aim(strides);
        code.advance(&mut before, random.as_mut());
        let mut count = 0;
        for (own, before) in x.chunks_exact_mut(n).zip(before.chunks_exact(n)) {
            if !are_finite(own) {
                own.copy_from_slice(before);
                count += 1;
            }
        }
        count
    }

    /// Why no particle came to the end of an interval: what ends the one at `x`, without noise.
    pub fn why(&mut self, x: &[f64], memory: Option<&Memory>, interval: &Interval) -> Error {
        let mut x = x.to_vec();
        self.evaluation.start(&interval.begin);
        self.evaluation
            .aim(interval.from, interval.to, &interval.end);
        let method = Method::Rk4(self.step.unwrap_or_default());
        let done = Integrator::new(method, x.len()).and_then(|mut integrator| {
            *integrator.memory() = memory.cloned().unwrap_or_default();
            integrator.advance(&mut self.evaluation, interval.from, interval.to, &mut x)
        });
        done.err().unwrap_or_else(|| Error::NotFinite {
            time: interval.to,
            operation: "the plant has no value where noise takes the particles".to_owned(),
            state: crate::error::state_text(self.system().states(), &x),
        })
    }

    /// One particle by itself: its state jumps at instants of its own.
    fn one(
        &mut self,
        x: &mut [f64],
        memory: &mut Memory,
        interval: &Interval,
        strides: &[Stride],
        mut random: Option<&mut ChaCha8Rng>,
    ) {
        self.evaluation.start(&interval.begin);
        self.evaluation
            .aim(interval.from, interval.to, &interval.end);
        std::mem::swap(self.integrator.memory(), memory);
        for stride in strides {
            let Some(noise) = noise_of(&self.noise, stride.h, random.as_deref_mut()) else {
                break;
            };
            let mut plant = Disturbed {
                plant: &mut self.evaluation,
                noise: &noise,
                from: stride.t,
                length: stride.h,
            };
            let to = stride.t + stride.h;
            if self
                .integrator
                .advance(&mut plant, stride.t, to, x)
                .is_err()
            {
                x.fill(f64::NAN);
                break;
            }
        }
        std::mem::swap(self.integrator.memory(), memory);
    }

    /// Equal steps in which nothing jumps with time.
    fn strides(&mut self, cloud: &Cloud, interval: &Interval) -> Result<Vec<Stride>> {
        let Interval {
            from,
            to,
            begin,
            end,
        } = interval;
        let plant = &mut self.evaluation;
        plant.start(begin);
        let length = match self.step.and_then(|step| step.length(to - from)) {
            Some(length) => length,
            None => needed(plant, cloud, *from, *to)?,
        };
        let mut instants = vec![];
        // a particle by itself stops at its instants, wherever they are
        if self.code.is_some() {
            plant.instants(*from, *to, &mut instants)?;
        }
        let share = |t: f64| (t - from) / (to - from);
        let at = |t: f64| -> Vec<f64> {
            let line = begin.iter().zip(end);
            match self.follows {
                true => line.map(|(a, b)| a + share(t) * (b - a)).collect(),
                false => begin.clone(),
            }
        };
        let mut strides = vec![];
        for (first, last) in pieces(*from, *to, &mut instants, APART) {
            plant.enter(first + 0.5 * (last - first));
            let steps = fixed_steps(first, last, length)?;
            for i in 0..steps {
                let [t, next] = [i, i + 1].map(|i| instant(first, last, steps, i));
                strides.push(Stride {
                    t,
                    h: next - t,
                    modes: plant.modes().to_vec(),
                    begin: at(t),
                    end: at(next),
                });
            }
        }
        Ok(strides)
    }

    /// Writes what the sensors show of all particles at `t`, particle by particle; no numbers where they have no value.
    pub fn show(&mut self, cloud: &Cloud, t: f64, inputs: &[f64], shown: &mut Vec<f64>) {
        let n = self.system().states().len();
        let m = self.output_map.jacobians().output.outputs().start;
        shown.clear();
        shown.resize(cloud.x.len() / n * m, f64::NAN);
        let sensors = &mut self.sensors;
        sensors.enter(t);
        if let Some(code) = &mut self.code {
            let modes = sensors.modes().to_vec();
            let blocks = cloud.x.chunks(BLOCK * n);
            for (x, shown) in blocks.zip(shown.chunks_mut((BLOCK * m).max(1))) {
                code.show(t, inputs, &modes, x, shown);
            }
            return;
        }
        let mut values = vec![0.0; sensors.system().outputs().len()];
        let places = cloud.x.chunks_exact(n);
        for (x, shown) in places.zip(shown.chunks_exact_mut(m.max(1))) {
            let signals = sensors.signals_mut();
            signals[..n].copy_from_slice(x);
            signals[n..].copy_from_slice(inputs);
            sensors.outputs(t, &[], &mut values);
            shown.copy_from_slice(&values[..m]);
        }
    }
}

/// What noise of such densities does to each state at the beginning and at the end of a step.
fn noise_of(densities: &[f64], h: f64, random: Option<&mut ChaCha8Rng>) -> Option<Vec<[f64; 2]>> {
    let Some(random) = random else {
        return Some(vec![[0.0; 2]; densities.len()]);
    };
    let of = |q: &f64| match *q > 0.0 {
        true => line(random, h).map(|w| q.sqrt() * w),
        false => [0.0; 2],
    };
    Some(densities.iter().map(of).collect())
}

/// The longest step that is short enough for all particles: for those in the middle and at the ends of each axis.
///
/// # Errors
/// [`Error::TooStiff`].
fn needed(plant: &mut Evaluation, cloud: &Cloud, from: f64, to: f64) -> Result<f64> {
    let n = plant.dimension();
    let count = cloud.x.len() / n;
    let mut places = vec![0, count / 2];
    for axis in 0..n.min(AXES) {
        let at = |place: usize| cloud.x[place * n + axis];
        let alive = |place: &usize| at(*place).is_finite();
        let by = |a: &usize, b: &usize| at(*a).total_cmp(&at(*b));
        places.extend((0..count).filter(alive).min_by(by));
        places.extend((0..count).filter(alive).max_by(by));
    }
    places.sort_unstable();
    places.dedup();
    plant.enter(from);
    let radii = places.iter().map(|place| {
        let x = &cloud.x[place * n..][..n];
        spectral_radius(plant, from, x)
    });
    // where the slopes are not defined there is nothing to go by
    let radius = radii.filter(|r| r.is_finite()).fold(0.0, f64::max);
    let needed = AUTO_PRODUCT / radius;
    let substeps = (to - from) / needed;
    match substeps > MOST as f64 {
        true => Err(Error::TooStiff {
            time: from,
            needed,
            substeps,
            limit: MOST,
        }),
        false => Ok(needed.min(to - from)),
    }
}

/// A plant with noise on its derivatives: a line over each step.
struct Disturbed<'a> {
    plant: &'a mut Evaluation,
    /// by state
    noise: &'a [[f64; 2]],
    from: f64,
    length: f64,
}

impl Dynamics for Disturbed<'_> {
    fn dimension(&self) -> usize {
        self.plant.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.plant.derivatives(t, x, dx);
        let share = (t - self.from) / self.length;
        for (dx, [begin, end]) in dx.iter_mut().zip(self.noise) {
            *dx += begin + share * (end - begin);
        }
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.plant.slopes(t, x, slopes)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.plant.events()
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.plant.clauses()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        self.plant.watch(t, x, seen);
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        self.plant.rates(t, x, dx)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>> {
        self.plant.truths(t, x)
    }

    fn happen(&mut self, t: f64, x: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        self.plant.happen(t, x, memory)
    }

    fn names(&self) -> Vec<String> {
        self.plant.names()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.plant.not_finite(t, x)
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Graph;

    use super::*;
    use crate::filter::NoisyPlant;

    /// Blocks have streams of their own: what a particle does depends on no thread.
    #[test]
    fn more_threads_give_the_same_digits() {
        let g = Graph::new();
        let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: vec![("x".into(), x.node(), 0.5), ("v".into(), v.node(), 0.0)],
            derivatives: vec![v.node(), (-x.sin()).node()],
            inputs: vec![],
            sensors: vec![],
            process_noise: vec![0.0, 0.2],
            initial_variance: vec![0.0; 2],
            ranges: vec![],
            confined: None,
            whens: Default::default(),
        });
        let model = model.unwrap();
        let interval = Interval {
            from: 0.0,
            to: 1.0,
            ..Interval::default()
        };
        let gone = |threads: usize| {
            let mut way = Way::new(&model, EstimatorSettings::default()).unwrap();
            way.threads = threads;
            let count = 20_001;
            let mut cloud = Cloud {
                x: [0.5, 0.0].repeat(count),
                ..Cloud::even(count)
            };
            let mut round = 7;
            way.advance(&mut cloud, &interval, 1, Some(&mut round))
                .unwrap();
            cloud.x
        };
        let one = gone(1);
        assert_eq!(one, gone(3));
        let mean = one.iter().step_by(2).sum::<f64>() / 20_001.0;
        let square = one.iter().skip(1).step_by(2).map(|v| v * v).sum::<f64>() / 20_001.0;
        assert!(
            (mean - 0.27).abs() < 0.03 && square > 0.1,
            "{mean} {square}"
        );
    }
}
