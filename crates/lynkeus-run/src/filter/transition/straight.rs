//! One step of Runge and Kutta from a sample, and what it makes of a covariance, as straight-line code.
//!
//! Operation by operation this is what the loops beside it do, so that both give the same numbers; but nothing
//! is computed of what is zero whatever happens: Φ = I and W = 0 at the sample, the entries that the plant
//! leaves out of Φ and W, and what follows of them in the reflections.

use std::ops::{Range, RangeInclusive};
use std::sync::{Arc, OnceLock};

use lynkeus_expr::{Graph, Node, Tape};
use lynkeus_native::Function;

use crate::classical::Term;
use crate::filter::expressions::{Flow, nodes};
use crate::filter::root::Root;
use crate::method::are_finite;
use crate::routine::{Engine, LARGEST_STEP};
use crate::{Evaluation, Jacobian, Linearised, System};

/// Steps by loops that take as long as compiling one does.
const PATIENCE: u32 = 1_000;

/// Largest tape of a step that carries a covariance, too: beyond it loops are as fast.
const LARGEST_CARRIED: usize = 20_000;

/// Columns with such squares are not spoilt by rounding towards zero; the loops bring others to size first.
pub(crate) const SQUARES: RangeInclusive<f64> = 1e-240..=1e240;

/// The code of a flow, made once for all that run it: its graph keeps it.
#[derive(Debug)]
struct Code {
    /// whether noise acts on a state
    noisy: Vec<bool>,
    first: OnceLock<Option<Made>>,
    later: OnceLock<Option<Function<1>>>,
}

/// What is asked of a graph: the code with noise on such states, of a flow whose F are those of its outputs.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Question {
    noisy: Vec<bool>,
    slopes: Range<usize>,
}

#[derive(Debug)]
struct Made {
    function: Function<1>,
    /// numbers of the step, x̂ and the rows of (Φ W), and all; what follows is of the covariance
    step: usize,
    outputs: usize,
}

impl Code {
    fn of(flow: &Linearised, noisy: Vec<bool>) -> Arc<Self> {
        let slopes = flow.jacobians().state.outputs();
        let question = Question { noisy, slopes };
        let graph = flow.system().equations().graph();
        graph.noted(&question).unwrap_or_else(|| {
            let code = Arc::new(Self {
                noisy: question.noisy.clone(),
                first: OnceLock::new(),
                later: OnceLock::new(),
            });
            graph.note(question, code.clone());
            code
        })
    }

    /// The densities of the noises that act.
    fn acting<'n>(&'n self, noise: &'n [f64]) -> impl Iterator<Item = &'n f64> {
        let all = noise.iter().zip(&self.noisy);
        all.filter(|(_, acts)| **acts).map(|(density, _)| density)
    }

    /// The first step from a sample, with the covariance where that is not too much.
    fn first(&self, system: &System, jacobian: &Jacobian) -> Option<Made> {
        let equations = system.equations();
        let graph = equations.graph();
        let flow = Flow::of(&graph, equations, jacobian, &self.noisy).small_at_first()?;
        let n = system.states().len();
        let (h, scale) = (graph.fresh("h"), graph.fresh("scale"));
        let next = flow.step(h, &flow.start());
        let root: Vec<Term<'_>> = (0..n * n).map(|_| Some(graph.fresh("S"))).collect();
        // what reflections of a lower triangle take at least
        let carried = match 2 * n.pow(3) / 3 <= LARGEST_CARRIED {
            true => flow.carried(&next, scale, &root),
            false => vec![],
        };
        let own = [Some(h), Some(scale)].into_iter();
        let inputs = flow.inputs_with(own.chain(flow.noise.iter().copied()).chain(root));
        let step = nodes(&graph, &next);
        let all = [&step[..], &nodes(&graph, &carried)].concat();
        let kinds = [(&all, LARGEST_CARRIED), (&step, LARGEST_STEP)];
        let mut kinds = kinds.into_iter().skip(usize::from(carried.is_empty()));
        kinds.find_map(|(outputs, most)| {
            Some(Made {
                function: compiled(&graph, &inputs, outputs, most)?,
                step: step.len(),
                outputs: outputs.len(),
            })
        })
    }

    /// A step from anywhere.
    fn later(&self, system: &System, jacobian: &Jacobian) -> Option<Function<1>> {
        let equations = system.equations();
        let graph = equations.graph();
        let flow = Flow::of(&graph, equations, jacobian, &self.noisy).small()?;
        let h = graph.fresh("h");
        let z = flow.under_way(h);
        let n = system.states().len();
        // of entries that stay zero, too: they stand in their places
        let rows = z[n..]
            .iter()
            .map(|entry| Some(entry.unwrap_or_else(|| graph.fresh("z"))));
        let own = [Some(h)].into_iter().chain(flow.noise.iter().copied());
        let inputs = flow.inputs_with(own.chain(rows));
        let next = nodes(&graph, &flow.step(h, &z));
        compiled(&graph, &inputs, &next, LARGEST_CARRIED)
    }
}

/// What is there already is not waited for.
fn patience<T>(code: &OnceLock<Option<T>>) -> u32 {
    match code.get() {
        Some(_) => 0,
        None => PATIENCE,
    }
}

fn compiled(graph: &Graph, inputs: &[Node], outputs: &[Node], most: usize) -> Option<Function<1>> {
    let tape = Tape::new(graph, inputs, outputs).ok()?;
    (tape.len() <= most).then(|| Function::compile(&tape))?
}

/// A step in use.
#[derive(Clone, Debug)]
pub(crate) struct Straight {
    code: Arc<Code>,
    /// F, among the outputs of the flow
    slopes: Jacobian,
    first: Engine,
    later: Engine,
    outputs: Vec<f64>,
    /// how many of them are those of the step
    step: usize,
    /// which are the squares of the covariance, after its root; none where the last step carried none
    carried: Option<Range<usize>>,
}

impl Straight {
    /// Of a flow with noise on such states.
    pub fn new(flow: &Linearised, noisy: Vec<bool>) -> Self {
        Self {
            code: Code::of(flow, noisy),
            slopes: flow.jacobians().state.clone(),
            first: Engine::default(),
            later: Engine::default(),
            outputs: vec![],
            step: 0,
            carried: None,
        }
    }

    /// Takes x̂ at `t` to `t + h` with Φ, W and the root of the covariance; `noise` are the densities in units
    /// of `scale`. Where that is not done at once it is false.
    pub fn run(
        &mut self,
        flow: &mut Evaluation,
        (t, h): (f64, f64),
        x: &[f64],
        (noise, scale): (&[f64], f64),
        root: &Root,
    ) -> bool {
        self.carried = None;
        let code = &*self.code;
        let patience = patience(&code.first);
        let made = || {
            code.first
                .get_or_init(|| code.first(flow.system(), &self.slopes))
        };
        let ready = self
            .first
            .ready(patience, || Some(&made().as_ref()?.function));
        let made = code.first.get().and_then(Option::as_ref);
        let (Some(function), Some(made)) = (ready, made) else {
            return false;
        };
        let Some(inputs) = flow.free_inputs(t, x) else {
            return false;
        };
        let before = inputs.len();
        inputs.extend([h, scale]);
        inputs.extend(code.acting(noise));
        inputs.extend_from_slice(&root.entries);
        self.outputs.resize(made.outputs, 0.0);
        function.eval(inputs.as_chunks().0, self.outputs.as_chunks_mut().0);
        inputs.truncate(before);
        self.step = made.step;
        let squares = made.step + root.entries.len()..made.outputs;
        self.carried = (made.outputs > made.step).then_some(squares);
        true
    }

    /// Takes x̂ and the rows of (Φ W) from anywhere at `t` to `next` at `t + h`. Where that is not done at once
    /// it is false.
    pub fn go_on(
        &mut self,
        flow: &mut Evaluation,
        (t, h): (f64, f64),
        z: &[f64],
        noise: &[f64],
        next: &mut [f64],
    ) -> bool {
        self.carried = None;
        let code = &*self.code;
        let patience = patience(&code.later);
        let make = || {
            code.later
                .get_or_init(|| code.later(flow.system(), &self.slopes))
        };
        let ready = self.later.ready(patience, || make().as_ref());
        let (x, rows) = z.split_at(code.noisy.len());
        let Some(function) = ready else {
            return false;
        };
        let Some(inputs) = flow.free_inputs(t, x) else {
            return false;
        };
        let before = inputs.len();
        inputs.push(h);
        inputs.extend(code.acting(noise));
        inputs.extend_from_slice(rows);
        function.eval(inputs.as_chunks().0, next.as_chunks_mut().0);
        inputs.truncate(before);
        true
    }

    /// x̂ after the step, then the rows of (Φ W).
    pub fn next(&self) -> &[f64] {
        &self.outputs[..self.step]
    }

    /// What there was is of no use.
    pub fn forget(&mut self) {
        self.carried = None;
    }

    /// Writes the root of the covariance after the step, where it is known.
    pub fn take(&mut self, root: &mut Root) -> bool {
        let Some(squares) = self.carried.take() else {
            return false;
        };
        let entries = &self.outputs[self.step..squares.start];
        let is_sound = self.outputs[squares].iter().all(|s| SQUARES.contains(s));
        if !is_sound || !are_finite(entries) {
            return false;
        }
        root.entries.copy_from_slice(entries);
        true
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Expr;

    use super::super::{Propagation, Scheme};
    use super::*;
    use crate::filter::Belief;
    use crate::filter::belief::tests::Random;
    use crate::{EstimatorSettings, Linearised, Method, Step};

    fn is(random: &mut Random, share: f64) -> bool {
        random.next() < 2.0 * share - 1.0
    }

    /// A stable plant whose states read some of each other, under a signal.
    fn plant(random: &mut Random, n: usize) -> Linearised {
        let g = Graph::new();
        let [time, u] = ["time", "u"].map(|name| g.symbol(name));
        let x: Vec<Expr<'_>> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let derivative = |i: usize| {
            // some states are parameters
            if i > 0 && is(random, 0.1) {
                return g.constant(0.0);
            }
            let own = x[i] * (-0.5 - random.next().abs());
            let others = (0..n)
                .filter(|j| *j != i)
                .fold(own, |sum, j| match is(random, 0.4) {
                    true => sum + (x[j] * (1.0 + random.next())).sin() * random.next(),
                    false => sum,
                });
            others + u * random.next() + (time * random.next()).cos()
        };
        let derivatives: Vec<Node> = (0..n).map(derivative).map(Expr::node).collect();
        let states = x.iter().enumerate();
        let states: Vec<_> = states
            .map(|(i, x)| (format!("x{i}"), x.node(), 0.3))
            .collect();
        let signals = [("u".to_owned(), u.node())];
        Linearised::flow(
            &g,
            time.node(),
            &states,
            &signals,
            &derivatives,
            &Default::default(),
        )
        .unwrap()
    }

    /// The same bits with machine code and without, over plants of every structure, with noise on some states or
    /// none, states that are known exactly, or up to next to nothing, and one step from sample to sample or two.
    #[test]
    fn the_numbers_are_those_of_the_loops() {
        let mut random = Random(5);
        let (mut leaps, mut steps, mut made) = (0, 0, [0, 0]);
        for trial in 0..60 {
            let n = 1 + trial % 7;
            let flow = plant(&mut random, n);
            let noise: Vec<f64> = (0..n)
                .map(|_| {
                    if is(&mut random, 0.7) {
                        random.next().abs()
                    } else {
                        0.0
                    }
                })
                .collect();
            let variances: Vec<f64> = (0..n)
                .map(|_| match random.next().abs() {
                    s if s < 0.1 => 0.0,
                    s if s < 0.2 => 1e-290 * s,
                    s => s,
                })
                .collect();
            let run = EstimatorSettings {
                method: Method::Rk4(Step::Substeps(1 + trial % 3 / 2)),
                ..EstimatorSettings::default()
            };
            let new = || Propagation::new(&flow, &noise, run).unwrap();
            let (mut ours, mut loops) = (new(), new());
            let Scheme::Joint(joint) = &mut loops.scheme else {
                unreachable!("steps are given");
            };
            joint.forget_code();
            let mut beliefs = [(); 2].map(|()| Belief::new(&vec![0.3; n], &variances));
            let seen: Vec<f64> = (0..n).map(|_| random.next()).collect();
            for k in 0..PATIENCE + 100 {
                let (from, to) = (0.1 * f64::from(k), 0.1 * f64::from(k + 1));
                for (propagation, belief) in [&mut ours, &mut loops].into_iter().zip(&mut beliefs) {
                    propagation.driven.start(&[(0.3 * from).sin()]);
                    propagation.predict(belief, from, to).unwrap();
                    let mut projected = vec![0.0; n];
                    belief.root.transposed_times(&seen, &mut projected);
                    belief.take(&projected, 0.01, 0.5, &mut vec![]);
                }
                let [one, other] = &beliefs;
                let bits = |belief: &Belief| -> Vec<u64> {
                    let all = belief.x.iter().chain(&belief.root.entries);
                    // of zeros the sign may differ
                    all.map(|x| (x + 0.0).to_bits()).collect()
                };
                assert_eq!(bits(one), bits(other), "trial {trial}, sample {k}");
                if ours.is_behind {
                    leaps += 1;
                }
                steps += usize::from(k >= PATIENCE);
            }
            let code = Code::of(&flow, noise.iter().map(|q| *q > 0.0).collect());
            made[0] += usize::from(matches!(code.first.get(), Some(Some(_))));
            made[1] += usize::from(matches!(code.later.get(), Some(Some(_))));
            let own: Vec<f64> = ours.transition().entries().to_vec();
            assert_eq!(own, loops.transition().entries(), "trial {trial}");
        }
        // where machine code can be made it was used: every third trial has two steps from sample to sample
        if made[0] > 0 {
            assert!(made == [60, 20], "{made:?}");
            assert!(4 * leaps > steps, "{leaps} of {steps}");
        }
    }
}
