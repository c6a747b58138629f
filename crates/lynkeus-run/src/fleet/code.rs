//! What the filters of a fleet compute, as code in lanes: the expressions of the filter's, over lanes.
//!
//! A belief is x̂, then the lower triangle of its root S, row by row. Code that reads one beside other numbers
//! takes them where they lie, and passes over what stands between.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use lynkeus_expr::{Expr, Graph, Node, Tape};
use lynkeus_native::Function;

use crate::Linearised;
use crate::classical::{Term, sum};
use crate::filter::expressions::{Flow, corrected, dot, nodes, projected};
use crate::filter::transition::SQUARES;
use crate::lanes::{Engine, have_functions};

/// Largest tape of a step or a correction.
const LARGEST: usize = 60_000;

/// Numbers of a triangle.
pub(super) fn triangle(n: usize) -> usize {
    n * (n + 1) / 2
}

/// Steps of a flow; its graph keeps them for all fleets.
#[derive(Debug)]
pub(super) struct Steps<const L: usize> {
    noisy: Vec<bool>,
    /// one step from a sample: reads a belief, so many numbers that it passes over, t, h, the unit of the
    /// noise, the densities that act in it, and u; writes a belief, then whether it is sound
    pub one: Engine<L>,
    many: OnceLock<Option<Many<L>>>,
    /// whether there is a function that lanes round in their own way
    pub has_functions: bool,
}

/// More than one step between two samples: the numbers under way are x̂ and what may not be 0 of Φ and W.
#[derive(Clone, Debug)]
pub(super) struct Many<const L: usize> {
    /// reads t, h, the densities that act, u, then x̂; writes the numbers under way
    pub first: Engine<L>,
    /// reads t, h, the densities that act, u, then the numbers under way, which it writes
    pub later: Engine<L>,
    /// reads the unit of the noise, S, then the numbers under way; writes S, then whether it is sound
    pub carry: Engine<L>,
    /// how many numbers are under way
    pub numbers: usize,
}

/// Which steps of a graph.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Which {
    noisy: Vec<bool>,
    slopes: Range<usize>,
    passed: usize,
}

impl<const L: usize> Steps<L> {
    /// Of a flow with noise on such states; none where they are too many operations.
    pub fn of(flow: &Linearised, noisy: Vec<bool>, passed: usize) -> Option<Arc<Self>> {
        let equations = flow.system().equations();
        let jacobian = &flow.jacobians().state;
        let graph = equations.graph();
        let which = Which {
            noisy,
            slopes: jacobian.outputs(),
            passed,
        };
        if let Some(known) = graph.noted(&which) {
            return known;
        }
        let made = || {
            let flow = Flow::of(&graph, equations, jacobian, &which.noisy).small()?;
            let (tape, has_functions) = one_step(&flow, passed)?;
            Some(Arc::new(Self {
                noisy: which.noisy.clone(),
                one: Engine::new(&tape, Function::compile),
                many: OnceLock::new(),
                has_functions,
            }))
        };
        let made: Option<Arc<Self>> = made();
        graph.note(which.clone(), made.clone());
        made
    }

    /// The densities of the noises that act.
    pub fn acting<'n>(&'n self, noise: &'n [f64]) -> impl Iterator<Item = f64> {
        let all = noise.iter().zip(&self.noisy);
        all.filter(|(_, acts)| **acts).map(|(density, _)| *density)
    }

    /// Several steps of the flow that these are of; none where they are too many operations.
    pub fn many(&self, flow: &Linearised) -> Option<&Many<L>> {
        let make = || {
            let equations = flow.system().equations();
            let graph = equations.graph();
            let jacobian = &flow.jacobians().state;
            many_steps(&Flow::of(&graph, equations, jacobian, &self.noisy).small()?)
        };
        self.many.get_or_init(make).as_ref()
    }
}

impl<'g> Flow<'_, 'g> {
    fn count(&self) -> usize {
        self.derivatives.len()
    }

    /// Symbols of the lower triangle of S, and S.
    fn root(&self) -> (Vec<Node>, Vec<Term<'g>>) {
        root(self.graph, self.count())
    }

    /// Symbols of the states, and of the known inputs.
    fn known(&self) -> (&[Node], &[Node]) {
        self.inputs[1..].split_at(self.count())
    }

    fn densities(&self) -> Vec<Node> {
        let acting = self.noise.iter().flatten();
        acting.map(|density| density.node()).collect()
    }

    /// A root as it was carried: its lower triangle, then whether no column was spoilt by rounding towards zero.
    fn lower(&self, carried: &[Term<'g>]) -> Vec<Node> {
        let n = self.count();
        let (root, squares) = carried.split_at(n * n);
        let [least, most] = [SQUARES.start(), SQUARES.end()].map(|s| self.graph.constant(*s));
        let squares = squares.iter().flatten();
        let inside = squares.flat_map(|&s| [least.less(s), s.less(most)]);
        let [nothing, sound] = [0.0, 1.0].map(|truth| self.graph.constant(truth));
        let sound = all(nothing, sound, inside);
        [nodes(self.graph, &triangle_of(root, n)), vec![sound.node()]].concat()
    }
}

/// `sound` where all of these hold, else nothing.
fn all<'g>(nothing: Expr<'g>, sound: Expr<'g>, hold: impl Iterator<Item = Expr<'g>>) -> Expr<'g> {
    hold.fold(sound, |all, holds| holds.select(all, nothing))
}

fn root(graph: &Graph, n: usize) -> (Vec<Node>, Vec<Term<'_>>) {
    let mut symbols = vec![];
    let mut root = vec![None; n * n];
    for i in 0..n {
        for j in 0..=i {
            let entry = graph.fresh("S");
            symbols.push(entry.node());
            root[i * n + j] = Some(entry);
        }
    }
    (symbols, root)
}

fn triangle_of<'g>(root: &[Term<'g>], n: usize) -> Vec<Term<'g>> {
    let rows = root.chunks_exact(n.max(1)).enumerate();
    rows.flat_map(|(i, row)| &row[..=i]).copied().collect()
}

fn symbols(graph: &Graph, count: usize) -> Vec<Node> {
    (0..count).map(|_| graph.fresh("z").node()).collect()
}

fn tape(graph: &Graph, inputs: &[Node], outputs: &[Node]) -> Option<Tape> {
    let tape = Tape::new(graph, inputs, outputs).ok()?;
    (tape.len() <= LARGEST).then_some(tape)
}

fn one_step(flow: &Flow<'_, '_>, passed: usize) -> Option<(Tape, bool)> {
    let (graph, n) = (flow.graph, flow.count());
    let (h, scale) = (graph.fresh("h"), graph.fresh("scale"));
    let (symbols_of_root, root) = flow.root();
    let next = flow.step(h, &flow.start());
    let carried = flow.lower(&flow.carried(&next, scale, &root));
    let (x, u) = flow.known();
    let inputs = [
        x,
        &symbols_of_root,
        &symbols(graph, passed),
        &[flow.inputs[0], h.node(), scale.node()],
        &flow.densities(),
        u,
    ]
    .concat();
    let outputs = [nodes(graph, &next[..n]), carried].concat();
    let has_functions = have_functions(graph, &outputs);
    Some((tape(graph, &inputs, &outputs)?, has_functions))
}

fn many_steps<const L: usize>(flow: &Flow<'_, '_>) -> Option<Many<L>> {
    let (graph, n) = (flow.graph, flow.count());
    let (h, scale) = (graph.fresh("h"), graph.fresh("scale"));
    let z = flow.under_way(h);
    let own = |terms: &[Term<'_>]| -> Vec<Node> {
        let all = terms.iter().zip(&z);
        let own: Vec<Term<'_>> = all.filter(|(_, z)| z.is_some()).map(|(t, _)| *t).collect();
        nodes(graph, &own)
    };
    let under_way = own(&z);
    let (x, u) = flow.known();
    let head = [&[flow.inputs[0], h.node()], &flow.densities()[..], u].concat();
    let engine = |inputs: &[&[Node]], outputs: &[Node]| {
        let tape = tape(graph, &inputs.concat(), outputs)?;
        Some(Engine::new(&tape, Function::compile))
    };
    let (symbols_of_root, root) = flow.root();
    let carried = flow.lower(&flow.carried(&z, scale, &root));
    debug_assert_eq!(under_way[..n], *x);
    Some(Many {
        first: engine(&[&head, x], &own(&flow.step(h, &flow.start())))?,
        later: engine(&[&head, &under_way], &own(&flow.step(h, &z)))?,
        carry: engine(&[&[scale.node()], &symbols_of_root, &under_way], &carried)?,
        numbers: under_way.len(),
    })
}

/// Numbers of a sensor's reading that a correction writes: ŷ, y − ŷ and its deviation.
pub(super) const OF_READING: usize = 3;
/// Numbers of a sensor that it reads: y, 1 where it reported, and how strong its noise is.
pub(super) const OF_SENSOR: usize = 3;

/// The correction by the readings of a sample; the graph of the sensors keeps it for all fleets.
#[derive(Debug)]
pub(super) struct Correction<const L: usize> {
    /// reads a belief, whether it is sound, what no estimate exceeds, t, u, and of each sensor [`OF_SENSOR`] numbers; writes a
    /// belief, of each sensor [`OF_READING`] numbers, the deviations of the states, and whether all of it is sound: there
    /// are no NaN and no infinities, nor is an estimate out of bounds
    pub code: Engine<L>,
    /// whether there is a function that lanes round in their own way
    pub has_functions: bool,
}

/// Which correction of a graph.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Whose {
    states: usize,
    relative: Vec<bool>,
}

impl<const L: usize> Correction<L> {
    /// By an output map of so many states, of whose sensors some have a noise that is a share of the value;
    /// none where there are too many operations.
    pub fn of(map: &Linearised, states: usize, relative: Vec<bool>) -> Option<Arc<Self>> {
        let graph = map.system().equations().graph();
        let whose = Whose { states, relative };
        if let Some(known) = graph.noted(&whose) {
            return known;
        }
        let made = Correcting::new(&graph, map, states).code(&whose.relative);
        let made = made.map(|(tape, has_functions)| {
            Arc::new(Self {
                code: Engine::new(&tape, Function::compile),
                has_functions,
            })
        });
        graph.note(whose, made.clone());
        made
    }
}

/// h and C over expressions.
struct Correcting<'g> {
    graph: &'g Graph,
    time: Node,
    states: Vec<Node>,
    inputs: Vec<Node>,
    outputs: Vec<Expr<'g>>,
    /// the rows of C
    slopes: Vec<Vec<Term<'g>>>,
    /// entries of C that may not be finite
    watched: Vec<Node>,
}

impl<'g> Correcting<'g> {
    fn new(graph: &'g Graph, map: &Linearised, n: usize) -> Self {
        let equations = map.system().equations();
        let jacobian = &map.jacobians().output;
        let inputs = &equations.inputs[..equations.smooth_inputs()];
        let all = &equations.roots.free.outputs;
        let (states, known) = inputs[1..].split_at(n);
        let outputs = &all[..jacobian.outputs().start];
        let mut slopes = vec![vec![None; n]; outputs.len()];
        let mut watched = vec![];
        for (&(i, j), &entry) in jacobian.places().iter().zip(&all[jacobian.outputs()]) {
            let value = graph.constant_value(entry);
            slopes[i][j] = (value != Some(0.0)).then(|| graph.expr(entry));
            if value.is_none_or(|value| !value.is_finite()) {
                watched.push(entry);
            }
        }
        Self {
            graph,
            time: inputs[0],
            states: states.to_vec(),
            inputs: known.to_vec(),
            outputs: outputs.iter().map(|&h| graph.expr(h)).collect(),
            slopes,
            watched,
        }
    }

    /// The tape, and whether there are functions.
    fn code(&self, relative: &[bool]) -> Option<(Tape, bool)> {
        let (graph, n) = (self.graph, self.states.len());
        let nothing = graph.constant(0.0);
        let (symbols_of_root, mut root) = root(graph, n);
        let before: Vec<Term<'g>> = self.states.iter().map(|&x| Some(graph.expr(x))).collect();
        let mut x = before.clone();
        let (mut of_sensors, mut readings, mut hold) = (vec![], vec![], vec![]);
        let infinity = graph.constant(f64::INFINITY);
        let [sound, most] = ["sound", "most"].map(|name| graph.fresh(name));
        let sensors = self.outputs.iter().zip(&self.slopes).zip(relative);
        // what is expected of all of them, before the first of them corrects
        let expected: Vec<_> = sensors
            .map(|((&h, c), is_share)| {
                let [y, reported, noise] = ["y", "reported", "r"].map(|name| graph.fresh(name));
                of_sensors.extend([y, reported, noise].map(Expr::node));
                let seen = projected(&root, c);
                let spread = dot(&seen, &seen);
                let variance = match is_share {
                    true => {
                        let square = h.powi(2);
                        noise * spread.map_or(square, |spread| square + spread)
                    }
                    false => noise,
                };
                let whole = spread.map_or(variance, |spread| spread + variance);
                let innovation = y - h;
                readings.extend([h, innovation, whole.sqrt()].map(Expr::node));
                // of a reading of which all are certain
                hold.extend([h.abs().less(infinity), nothing.less(whole)]);
                (c, innovation, variance, nothing.less(reported))
            })
            .collect();
        for (place, (c, innovation, variance, reported)) in expected.into_iter().enumerate() {
            let moves = c.iter().zip(x.iter().zip(&before));
            let moved = moves.map(|(c, (x, x0))| {
                let moved = x.zip(*x0).map(|(x, x0)| x - x0);
                c.zip(moved).map(|(c, moved)| c * moved)
            });
            // the first of them has moved nothing
            let moved = moved.fold(None, sum).filter(|_| place > 0);
            let rest = moved.map_or(innovation, |moved| innovation - moved);
            let found = corrected((&x, &root), c, rest, variance);
            let chosen = |(new, old): (&Term<'g>, &Term<'g>)| match (*new, *old) {
                (None, None) => None,
                (new, old) => {
                    let [new, old] = [new, old].map(|term| term.unwrap_or(nothing));
                    Some(reported.select(new, old))
                }
            };
            x = found.x.iter().zip(&x).map(chosen).collect();
            root = found.root.iter().zip(&root).map(chosen).collect();
        }
        let deviations = (0..n).map(|i| {
            let squares = root[i * n..=i * n + i].iter();
            let squares = squares.map(|s| s.map(|s| s * s));
            squares.fold(None, sum).map(Expr::sqrt)
        });
        let deviations: Vec<Term<'g>> = deviations.collect();
        hold.extend(x.iter().flatten().map(|x| x.abs().less(most)));
        hold.extend(deviations.iter().flatten().map(|d| d.less(infinity)));
        let watched = self.watched.iter().map(|&c| graph.expr(c));
        hold.extend(watched.map(|c| c.abs().less(infinity)));
        let belief = [x, triangle_of(&root, n)].concat();
        let outputs = [
            nodes(graph, &belief),
            readings,
            nodes(graph, &deviations),
            vec![all(nothing, sound, hold.into_iter()).node()],
        ]
        .concat();
        let inputs = [
            &self.states[..],
            &symbols_of_root,
            &[sound.node(), most.node(), self.time],
            &self.inputs,
            &of_sensors,
        ]
        .concat();
        let has_functions = have_functions(graph, &outputs);
        let tape = tape(graph, &inputs, &outputs)?;
        Some((tape, has_functions))
    }
}
