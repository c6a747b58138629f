//! Particles in lanes: a step under noise, and what the sensors show, as one function each for a group of particles.

use std::cell::Cell;
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::Arc;

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_native::Buffer;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::batch::Divided;
use crate::classical::{Term, classical_step};
use crate::equations::Equations;
use crate::routine::LARGEST_STEP;
use crate::{Linearised, System};

/// Particles that go side by side and share a stream of random numbers, so that no digit depends on the number of
/// threads or lanes.
pub(super) const BLOCK: usize = 256;

/// One step of all particles.
#[derive(Clone, Debug)]
pub(super) struct Stride {
    pub t: f64,
    pub h: f64,
    /// what jumps with time alone
    pub modes: Vec<f64>,
    /// known inputs at its beginning and its end, between which they are a line
    pub begin: Vec<f64>,
    pub end: Vec<f64>,
}

/// Two numbers by which white noise of density 1 acts over a step of length h: at its beginning and its end, a line in
/// between. It is what is left of the noise's expansion in Legendre's polynomials after two of them: its integral, and
/// that integral's, have the variances and the covariance of Wiener's process.
pub(super) fn line(random: &mut ChaCha8Rng, h: f64) -> [f64; 2] {
    let [mean, slope]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(random));
    let size = h.sqrt().recip();
    let slope = slope * 3.0_f64.sqrt();
    [size * (mean - slope), size * (mean + slope)]
}

/// Steps and sensors of a plant, whatever the number of lanes; each thread has its own.
pub(super) trait Code: Debug + Send + Sync {
    /// What the steps to come share.
    fn aim(&mut self, strides: &[Stride]);

    /// Takes particles of a block, one after the other in `x`, through these steps; without random numbers there is no
    /// noise.
    fn advance(&mut self, x: &mut [f64], random: Option<&mut ChaCha8Rng>);

    /// Writes what the sensors show of particles of a block at `t`.
    fn show(&mut self, t: f64, inputs: &[f64], modes: &[f64], x: &[f64], shown: &mut [f64]);

    fn copied(&self) -> Box<dyn Code>;
}

impl Clone for Box<dyn Code> {
    fn clone(&self) -> Self {
        (**self).copied()
    }
}

/// The code of a flow with noise of such densities, and of its sensors; none where a step is too large for one
/// function. The flow's graph keeps it.
pub(super) fn code(flow: &System, sensors: &Linearised, noise: &[f64]) -> Option<Box<dyn Code>> {
    match lynkeus_native::widest() {
        8 => Some(Box::new(known::<8>(flow, sensors, noise)?)),
        _ => Some(Box::new(known::<4>(flow, sensors, noise)?)),
    }
}

/// Which code of a graph.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Which {
    lanes: usize,
    noisy: Vec<usize>,
    outputs: Vec<Node>,
}

fn known<const L: usize>(flow: &System, sensors: &Linearised, noise: &[f64]) -> Option<Lanes<L>> {
    let noisy = noise.iter().enumerate().filter(|(_, q)| **q > 0.0);
    let noisy: Vec<usize> = noisy.map(|(i, _)| i).collect();
    let shown = sensors.system().equations();
    let which = Which {
        lanes: L,
        noisy: noisy.clone(),
        outputs: shown.roots.free.outputs.clone(),
    };
    let equations = flow.equations();
    let graph = equations.graph();
    let found: Option<Arc<Lanes<L>>> = graph.noted(&which);
    let made = match found {
        Some(known) => (*known).clone(),
        None => {
            let made = Lanes::new(&graph, flow, sensors, noisy)?;
            graph.note(which, Arc::new(made.clone()));
            made
        }
    };
    let sizes = noise.iter().filter(|q| **q > 0.0).map(|q| q.sqrt());
    Some(Lanes {
        sizes: sizes.collect(),
        ..made
    })
}

#[derive(Clone, Debug)]
struct Lanes<const L: usize> {
    /// reads states, what noise does at the step's two ends, then what is shared
    step: Divided<L>,
    /// reads states, then what is shared
    sensors: Divided<L>,
    states: usize,
    outputs: usize,
    noisy: usize,
    /// roots of the densities
    sizes: Vec<f64>,
    /// lengths of the steps to come, and what they share
    lengths: Vec<f64>,
    table: Vec<[f64; L]>,
    now: Buffer<L>,
    next: Buffer<L>,
    seen: Buffer<L>,
    shown: Buffer<L>,
    arguments: Vec<[f64; L]>,
}

impl<const L: usize> Lanes<L> {
    fn new(graph: &Graph, flow: &System, sensors: &Linearised, noisy: Vec<usize>) -> Option<Self> {
        if flow.derivatives_at().tape().len() > LARGEST_STEP {
            return None;
        }
        let equations = flow.equations();
        let (n, k) = (equations.states.len(), noisy.len());
        let (inputs, next) = step(graph, equations, &noisy);
        let own = n + 2 * k;
        let map = sensors.system().equations();
        let outputs = sensors.jacobians().output.outputs().start;
        // the output map's states are its first signals
        let read = &map.inputs[..map.smooth_inputs()];
        let shown = &map.roots.free.outputs[..outputs];
        // one graph at a time: both may be the same
        let is_shared = std::ptr::eq(&map.graph, &equations.graph);
        let sensors = match is_shared {
            true => Divided::new(graph, read, shown, 1..1 + n, outputs),
            false => Divided::new(&map.graph(), read, shown, 1..1 + n, outputs),
        };
        let groups = BLOCK.div_ceil(L);
        Some(Self {
            step: Divided::new(graph, &inputs, &next, 1..1 + own, own).ok()?,
            sensors: sensors.ok()?,
            states: n,
            outputs,
            noisy: k,
            sizes: vec![],
            lengths: vec![],
            table: vec![],
            now: Buffer::new(groups * own),
            next: Buffer::new(groups * own),
            seen: Buffer::new(groups * n),
            shown: Buffer::new(groups * outputs),
            arguments: vec![],
        })
    }

    fn own(&self) -> usize {
        self.states + 2 * self.noisy
    }
}

/// A step of Runge and Kutta: the symbols that it reads (time; states, what noise does at the beginning and at the end;
/// inputs at both, modes, the length), and the states at its end.
fn step(graph: &Graph, equations: &Equations, noisy: &[usize]) -> (Vec<Node>, Vec<Node>) {
    let (n, inputs) = (
        equations.states.len(),
        &equations.inputs[..equations.smooth_inputs()],
    );
    let (x, rest) = inputs[1..].split_at(n);
    let (signals, modes) = rest.split_at(equations.signals.len());
    let fresh = |count: usize| -> Vec<Expr<'_>> { (0..count).map(|_| graph.fresh("w")).collect() };
    let [w, u] = [noisy.len(), signals.len()].map(|count| [fresh(count), fresh(count)]);
    let h = graph.fresh("h");
    let stage = Cell::new(0);
    let slope = |t: Expr<'_>, z: &[Term<'_>]| {
        let own = stage.replace(stage.get() + 1);
        let mut places = HashMap::from([(inputs[0], t.node())]);
        places.extend(
            x.iter()
                .zip(z.iter().flatten())
                .map(|(x, z)| (*x, z.node())),
        );
        let signals = signals.iter().enumerate();
        places.extend(signals.map(|(i, signal)| (*signal, during(own, &u, i).node())));
        let found = graph.substitute(&equations.roots.free.derivatives, &places);
        let mut slopes: Vec<Expr<'_>> = found.into_iter().map(|k| graph.expr(k)).collect();
        for (i, state) in noisy.iter().enumerate() {
            slopes[*state] = slopes[*state] + during(own, &w, i);
        }
        slopes.into_iter().map(Some).collect()
    };
    let z: Vec<Term<'_>> = x.iter().map(|&x| Some(graph.expr(x))).collect();
    let next = classical_step(graph.expr(inputs[0]), h, &z, slope);
    let nodes = |lists: &[Vec<Expr<'_>>; 2]| -> Vec<Node> {
        lists.iter().flatten().map(|e| e.node()).collect()
    };
    let read = [&inputs[..1], x, &nodes(&w), &nodes(&u), modes, &[h.node()]].concat();
    // a state is never nothing
    let next = next.into_iter().flatten().map(Expr::node).collect();
    (read, next)
}

/// What is a line over a step at one of its four stages.
fn during<'g>(stage: usize, [begin, end]: &[Vec<Expr<'g>>; 2], i: usize) -> Expr<'g> {
    match stage {
        0 => begin[i],
        3 => end[i],
        _ => (begin[i] + end[i]) * 0.5,
    }
}

/// Particles into lanes; the last group is filled up with copies.
fn enter<const L: usize>(x: &[f64], n: usize, lanes: &mut [[f64; L]], spacing: usize) -> usize {
    let count = x.len() / n.max(1);
    let groups = count.div_ceil(L);
    for place in 0..groups * L {
        let own = &x[place.min(count - 1) * n..][..n];
        let group = &mut lanes[place / L * spacing..][..n];
        for (into, x) in group.iter_mut().zip(own) {
            into[place % L] = *x;
        }
    }
    groups
}

/// And back.
fn leave<const L: usize>(lanes: &[[f64; L]], spacing: usize, x: &mut [f64], n: usize) {
    for (place, own) in x.chunks_exact_mut(n.max(1)).enumerate() {
        let group = &lanes[place / L * spacing..][..n];
        for (x, from) in own.iter_mut().zip(group) {
            *x = from[place % L];
        }
    }
}

impl<const L: usize> Code for Lanes<L> {
    fn aim(&mut self, strides: &[Stride]) {
        let shared = self.step.shared;
        self.table.clear();
        self.table
            .resize(strides.len().next_multiple_of(L) * shared, [0.0; L]);
        self.lengths.clear();
        self.lengths.extend(strides.iter().map(|s| s.h));
        let tables = self.table.chunks_exact_mut(L * shared.max(1));
        for (strides, table) in strides.chunks(L).zip(tables) {
            // lanes without a step of their own do the last one again
            let of = |value: &dyn Fn(&Stride) -> f64| -> [f64; L] {
                std::array::from_fn(|lane| value(&strides[lane.min(strides.len() - 1)]))
            };
            let first = &strides[0];
            self.arguments.clear();
            self.arguments.push(of(&|s| s.t));
            let u = 0..first.begin.len();
            self.arguments
                .extend(u.clone().map(|i| of(&|s| s.begin[i])));
            self.arguments.extend(u.map(|i| of(&|s| s.end[i])));
            let modes = 0..first.modes.len();
            self.arguments.extend(modes.map(|i| of(&|s| s.modes[i])));
            self.arguments.push(of(&|s| s.h));
            self.step.share(&self.arguments, table);
        }
    }

    fn advance(&mut self, x: &mut [f64], mut random: Option<&mut ChaCha8Rng>) {
        let (n, k, own) = (self.states, self.noisy, self.own());
        let (count, shared) = (x.len() / n, self.step.shared);
        if random.is_none() {
            self.now.values_mut().fill([0.0; L]);
            self.next.values_mut().fill([0.0; L]);
        }
        let groups = enter(x, n, self.now.values_mut(), own);
        for (place, h) in self.lengths.iter().enumerate() {
            if let Some(random) = &mut random {
                let lanes = self.now.values_mut();
                for particle in 0..count {
                    let (first, lane) = (particle / L * own + n, particle % L);
                    for (i, size) in self.sizes.iter().enumerate() {
                        let [begin, end] = line(random, *h);
                        lanes[first + i][lane] = size * begin;
                        lanes[first + k + i][lane] = size * end;
                    }
                }
            }
            let table = &self.table[place * shared..][..shared];
            let next = self.next.values_mut();
            self.step.sweep(groups, table, self.now.values(), next);
            std::mem::swap(&mut self.now, &mut self.next);
        }
        leave(self.now.values(), own, x, n);
    }

    fn show(&mut self, t: f64, inputs: &[f64], modes: &[f64], x: &[f64], shown: &mut [f64]) {
        let (n, m) = (self.states, self.outputs);
        let groups = enter(x, n, self.seen.values_mut(), n);
        self.arguments.clear();
        self.arguments.push([t; L]);
        let known = inputs.iter().chain(modes);
        self.arguments.extend(known.map(|value| [*value; L]));
        let size = self.sensors.shared;
        self.table.clear();
        self.table.resize(L * size, [0.0; L]);
        self.sensors.share(&self.arguments, &mut self.table);
        let into = self.shown.values_mut();
        self.sensors
            .sweep(groups, &self.table[..size], self.seen.values(), into);
        leave(self.shown.values(), m, shown, m);
    }

    fn copied(&self) -> Box<dyn Code> {
        Box::new(self.clone())
    }
}
