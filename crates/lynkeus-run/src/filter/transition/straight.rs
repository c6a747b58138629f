//! One step of Runge and Kutta from a sample, and what it makes of a covariance, as straight-line code.
//!
//! Operation by operation this is what the loops beside it do, so that both give the same numbers; but nothing
//! is computed of what is zero whatever happens: Φ = I and W = 0 at the sample, the entries that the plant
//! leaves out of Φ and W, and what follows of them in the reflections.

use std::ops::{Range, RangeInclusive};
use std::sync::{Arc, OnceLock};

use lynkeus_expr::{Expr, Graph, Node, Tape};
use lynkeus_native::Function;

use crate::classical::{Term, classical_step, sum};
use crate::filter::root::Root;
use crate::method::are_finite;
use crate::routine::{Engine, LARGEST_STEP};
use crate::{Evaluation, Jacobian, System};

/// Steps by loops that take as long as compiling one does.
const PATIENCE: u32 = 1_000;

/// Largest tape of a step that carries a covariance, too: beyond it loops are as fast.
const LARGEST_CARRIED: usize = 20_000;

/// Columns with such squares are not spoilt by rounding towards zero; the loops bring others to size first.
const SQUARES: RangeInclusive<f64> = 1e-240..=1e240;

/// The code of a flow, made once for all that run it.
#[derive(Debug)]
pub(crate) struct Code {
    flow: System,
    /// F, among the outputs of the flow
    jacobian: Jacobian,
    /// whether noise acts on a state
    noisy: Vec<bool>,
    made: OnceLock<Option<Made>>,
}

#[derive(Debug)]
struct Made {
    function: Function<1>,
    /// numbers of the step, x̂ and the rows of (Φ W), and all; what follows is of the covariance
    step: usize,
    outputs: usize,
}

impl Code {
    pub fn new(flow: &System, jacobian: &Jacobian, noisy: Vec<bool>) -> Self {
        Self {
            flow: flow.clone(),
            jacobian: jacobian.clone(),
            noisy,
            made: OnceLock::new(),
        }
    }

    /// Whether noise acts on these states.
    pub fn is_for(&self, noisy: &[bool]) -> bool {
        self.noisy == noisy
    }

    fn made(&self) -> Option<&Made> {
        self.made.get_or_init(|| self.make()).as_ref()
    }

    fn make(&self) -> Option<Made> {
        let n = self.flow.states().len();
        // if Φ and W were full
        if 16 * n * self.jacobian.places().len() > LARGEST_STEP {
            return None;
        }
        let equations = self.flow.equations();
        let graph = equations.graph();
        let free = &equations.roots.free;
        let noise = self.noisy.iter();
        let noise: Vec<Term<'_>> = noise.map(|n| n.then(|| graph.fresh("q"))).collect();
        let flow = Flow {
            graph: &graph,
            inputs: &equations.inputs[..equations.smooth_inputs()],
            derivatives: &free.derivatives,
            slopes: &free.outputs[self.jacobian.outputs()],
            places: self.jacobian.places(),
            noise,
        };
        let (h, scale) = (graph.fresh("h"), graph.fresh("scale"));
        let next = flow.step(h);
        let root: Vec<Expr<'_>> = (0..n * n).map(|_| graph.fresh("S")).collect();
        let carried = flow.carried(&next, scale, &root);
        let own = [h, scale]
            .into_iter()
            .chain(flow.noise.iter().copied().flatten());
        let own = own.chain(root).map(Expr::node);
        let inputs: Vec<Node> = flow.inputs.iter().copied().chain(own).collect();
        let nothing = graph.constant(0.0);
        let nodes = |terms: &[Term<'_>]| -> Vec<Node> {
            terms
                .iter()
                .map(|term| term.unwrap_or(nothing).node())
                .collect()
        };
        let step = nodes(&next);
        let all = [&step[..], &nodes(&carried)].concat();
        [(all, LARGEST_CARRIED), (step.clone(), LARGEST_STEP)]
            .into_iter()
            .find_map(|(outputs, most)| {
                let tape = Tape::new(&graph, &inputs, &outputs).ok()?;
                let function = (tape.len() <= most).then(|| Function::compile(&tape))??;
                Some(Made {
                    function,
                    step: step.len(),
                    outputs: outputs.len(),
                })
            })
    }
}

/// x' = f with F, and the noise on its states in units of its largest density.
struct Flow<'g> {
    graph: &'g Graph,
    /// time, the states and what is constant over a step
    inputs: &'g [Node],
    derivatives: &'g [Node],
    /// entries of F
    slopes: &'g [Node],
    places: &'g [(usize, usize)],
    noise: Vec<Term<'g>>,
}

impl<'g> Flow<'g> {
    fn states(&self) -> usize {
        self.derivatives.len()
    }

    /// Numbers in a row of (Φ W).
    fn width(&self) -> usize {
        match self.is_noisy() {
            true => 2 * self.states(),
            false => self.states(),
        }
    }

    fn is_noisy(&self) -> bool {
        self.noise.iter().any(Option::is_some)
    }

    fn term(&self, node: Node) -> Term<'g> {
        let is_nothing = self.graph.constant_value(node) == Some(0.0);
        (!is_nothing).then(|| self.graph.expr(node))
    }

    /// x̂ and the rows of (Φ W) after a step of length h.
    fn step(&self, h: Expr<'g>) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let x = self.inputs[1..=n].iter().map(|&x| Some(self.graph.expr(x)));
        let mut z: Vec<Term<'g>> = x.collect();
        z.resize(n + n * width, None);
        (0..n).for_each(|i| z[n + i * width + i] = Some(self.graph.constant(1.0)));
        let t = self.graph.expr(self.inputs[0]);
        classical_step(t, h, &z, |t, z| self.variation(t, z))
    }

    /// x̂', Φ' = FΦ and W' = FW + WFᵀ + Q.
    fn variation(&self, t: Expr<'g>, z: &[Term<'g>]) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let (x, rows) = z.split_at(n);
        let at = [Some(t)].into_iter().chain(x.iter().copied());
        let nothing = self.graph.constant(0.0);
        let at = at.map(|value| value.unwrap_or(nothing).node());
        let places = self.inputs.iter().copied().zip(at).collect();
        let all = [self.derivatives, self.slopes].concat();
        let all = self.graph.substitute(&all, &places);
        let (dx, slopes) = all.split_at(n);
        let mut dz: Vec<Term<'g>> = dx.iter().map(|&dx| self.term(dx)).collect();
        dz.resize(z.len(), None);
        let drows = &mut dz[n..];
        for (&(i, j), &slope) in self.places.iter().zip(slopes) {
            let Some(slope) = self.term(slope) else {
                continue;
            };
            for c in 0..width {
                let into = &mut drows[i * width + c];
                *into = sum(*into, rows[j * width + c].map(|from| slope * from));
            }
        }
        for (i, q) in self.noise.iter().enumerate().filter(|_| width > n) {
            for j in 0..i {
                let (a, b) = (i * width + n + j, j * width + n + i);
                let both = sum(drows[a], drows[b]);
                (drows[a], drows[b]) = (both, both);
            }
            let diagonal = &mut drows[i * width + n + i];
            *diagonal = sum(diagonal.map(|d| 2.0 * d), *q);
        }
        dz
    }

    /// The lower root of ΦPΦᵀ + W after a step, row by row, from that of P; then the squares of the columns
    /// that were reflected.
    fn carried(&self, next: &[Term<'g>], scale: Expr<'g>, root: &[Expr<'g>]) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let row = |i: usize| &next[n + i * width..n + (i + 1) * width];
        let mut rows = vec![];
        if width > n {
            let noise = (0..n).flat_map(|i| &row(i)[n..]);
            let noise: Vec<Term<'g>> = noise.map(|w| w.map(|w| scale * w)).collect();
            let factor = self.factor(&noise);
            rows.extend((0..n * n).map(|at| factor[at % n * n + at / n]));
        }
        let begin = rows.len();
        rows.resize(begin + n * n, None);
        for i in 0..n {
            for (j, phi) in row(i)[..n].iter().enumerate() {
                for (k, &s) in root[j * n..=j * n + j].iter().enumerate() {
                    let into = &mut rows[begin + k * n + i];
                    *into = sum(*into, phi.map(|phi| phi * s));
                }
            }
        }
        self.reflected(&mut rows)
    }

    /// As [`Factor`](crate::filter::root::Factor).
    fn factor(&self, matrix: &[Term<'g>]) -> Vec<Term<'g>> {
        let n = self.states();
        let nothing = self.graph.constant(0.0);
        let mut lower: Vec<Term<'g>> = vec![None; n * n];
        for j in 0..n {
            let Some(diagonal) = matrix[j * n + j] else {
                continue;
            };
            let known = |lower: &[Term<'g>], i: usize| {
                dot(&lower[i * n..i * n + j], &lower[j * n..j * n + j])
            };
            let pivot = match known(&lower, j) {
                Some(known) => diagonal - known,
                None => diagonal,
            };
            let noise = n as f64 * f64::EPSILON * diagonal.abs();
            let is_there = noise.less(pivot);
            let root = is_there.select(pivot.sqrt(), nothing);
            lower[j * n + j] = Some(root);
            for i in j + 1..n {
                let rest = match (matrix[i * n + j], known(&lower, i)) {
                    (Some(entry), Some(known)) => Some(entry - known),
                    (None, Some(known)) => Some(-known),
                    (entry, None) => entry,
                };
                lower[i * n + j] = rest.map(|rest| is_there.select(rest / root, nothing));
            }
        }
        lower
    }

    /// As [`Root::of_rows`], without units.
    fn reflected(&self, rows: &mut [Term<'g>]) -> Vec<Term<'g>> {
        let n = self.states();
        let count = rows.len() / n;
        let nothing = self.graph.constant(0.0);
        let mut root = vec![None; n * n];
        let mut squares = vec![];
        for k in 0..n {
            let column = |rows: &[Term<'g>]| -> Vec<(usize, Expr<'g>)> {
                let all = (k..count).map(|r| (r, rows[r * n + k]));
                all.filter_map(|(r, entry)| entry.map(|entry| (r, entry)))
                    .collect()
            };
            let own = column(rows);
            let square = own.iter().map(|(_, entry)| entry.powi(2));
            let Some(square) = square.reduce(|all, one| all + one) else {
                continue;
            };
            squares.push(Some(square));
            let norm = square.sqrt();
            let pivot = rows[k * n + k];
            let is_above = pivot.map(|pivot| nothing.less(pivot));
            let turned = |is: Expr<'g>, value: Expr<'g>| is.select(-value, value);
            let head = is_above.map_or(norm, |is| turned(is, norm));
            let first = pivot.map_or(-head, |pivot| pivot - head);
            let beta = -head * first;
            rows[k * n + k] = Some(first);
            let reflector = column(rows);
            let sums: Vec<Term<'g>> = (k + 1..n)
                .map(|j| {
                    let products = reflector.iter();
                    let products = products.map(|(r, v)| rows[r * n + j].map(|a| *v * a));
                    products.fold(None, sum)
                })
                .collect();
            for (r, v) in reflector {
                let factor = v / beta;
                for (j, part) in (k + 1..n).zip(&sums) {
                    let Some(part) = part.map(|part| factor * part) else {
                        continue;
                    };
                    let entry = &mut rows[r * n + j];
                    *entry = Some(entry.map_or(-part, |entry| entry - part));
                }
            }
            root[k * n + k] = Some(norm);
            for j in k + 1..n {
                let entry = rows[k * n + j];
                root[j * n + k] = entry.map(|a| is_above.map_or(a, |is| turned(is, a)));
            }
        }
        root.extend(squares);
        root
    }
}

/// As [`dot`](crate::filter::root::dot).
fn dot<'g>(a: &[Term<'g>], b: &[Term<'g>]) -> Term<'g> {
    let whole = a.len() / 4 * 4;
    let mut sums = [None; 5];
    for (at, (a, b)) in a.iter().zip(b).enumerate() {
        let into = &mut sums[if at < whole { at % 4 } else { 4 }];
        *into = sum(*into, a.zip(*b).map(|(a, b)| a * b));
    }
    sums.into_iter().fold(None, sum)
}

/// A step in use.
#[derive(Clone, Debug)]
pub(crate) struct Straight {
    code: Arc<Code>,
    engine: Engine,
    outputs: Vec<f64>,
    /// how many of them are those of the step
    step: usize,
    /// which are the squares of the covariance, after its root; none where the last step carried none
    carried: Option<Range<usize>>,
}

impl Straight {
    pub fn new(code: Arc<Code>) -> Self {
        Self {
            code,
            engine: Engine::default(),
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
        let make = || code.made().map(|made| &made.function);
        let Some(function) = self.engine.ready(PATIENCE, make) else {
            return false;
        };
        let (Some(made), Some(inputs)) = (code.made(), flow.free_inputs(t, x)) else {
            return false;
        };
        let before = inputs.len();
        inputs.extend([h, scale]);
        let own = noise.iter().zip(&code.noisy).filter(|(_, is)| **is);
        inputs.extend(own.map(|(q, _)| q));
        inputs.extend_from_slice(&root.entries);
        self.outputs.resize(made.outputs, 0.0);
        function.eval(inputs.as_chunks().0, self.outputs.as_chunks_mut().0);
        inputs.truncate(before);
        self.step = made.step;
        let squares = made.step + root.entries.len()..made.outputs;
        self.carried = (made.outputs > made.step).then_some(squares);
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
    use super::super::{Propagation, Scheme};
    use super::*;
    use crate::filter::Belief;
    use crate::{EstimatorSettings, Linearised, Method, Step};

    struct Random(u64);

    impl Random {
        /// In [−1, 1).
        fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }

        fn is(&mut self, share: f64) -> bool {
            self.next() < 2.0 * share - 1.0
        }
    }

    /// A stable plant whose states read some of each other, under a signal.
    fn plant(random: &mut Random, n: usize) -> Linearised {
        let g = Graph::new();
        let [time, u] = ["time", "u"].map(|name| g.symbol(name));
        let x: Vec<Expr<'_>> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let derivative = |i: usize| {
            // some states are parameters
            if i > 0 && random.is(0.1) {
                return g.constant(0.0);
            }
            let own = x[i] * (-0.5 - random.next().abs());
            let others = (0..n)
                .filter(|j| *j != i)
                .fold(own, |sum, j| match random.is(0.4) {
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
        Linearised::flow(&g, time.node(), &states, &signals, &derivatives).unwrap()
    }

    /// The same bits with machine code and without, over plants of every structure, with noise on some states or
    /// none, states that are known exactly, or up to next to nothing, and one step from sample to sample or two.
    #[test]
    fn the_numbers_are_those_of_the_loops() {
        let mut random = Random(5);
        let (mut leaps, mut steps) = (0, 0);
        for trial in 0..60 {
            let n = 1 + trial % 7;
            let flow = plant(&mut random, n);
            let noise: Vec<f64> = (0..n)
                .map(|_| {
                    if random.is(0.7) {
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
            let own: Vec<f64> = ours.transition().entries().to_vec();
            assert_eq!(own, loops.transition().entries(), "trial {trial}");
        }
        assert!(4 * leaps > steps, "{leaps} of {steps}");
    }
}
