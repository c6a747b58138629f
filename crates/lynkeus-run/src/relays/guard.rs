//! What is watched over a step: functions that change their sign where the right-hand side jumps
//! or bends.

use std::sync::Arc;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{
    Binary, Graph, Interval, Jets, MissingInput, Node, Op, Reals, Tape, Unary, jacobian,
};

use super::path::{Path, Poly, Stretch};

/// Everything that is watched of a system, over the inputs of its code: time, states, and what
/// [`Dynamics::beside`](crate::Dynamics::beside) tells of.
#[derive(Debug, Default)]
pub struct Guards {
    /// states among the inputs, after time
    states: usize,
    /// which inputs are read, in order
    pub(super) reads: Vec<usize>,
    /// one for each surface
    pub(super) surfaces: Vec<Guard>,
    /// the surfaces that are one of two on which a `floor` jumps: at even integers and, next, at odd ones
    pub(super) counts: Vec<bool>,
    /// where something bends and does not jump
    pub(super) bends: Vec<Guard>,
}

/// Nodes to be watched.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watched {
    pub surfaces: Vec<Node>,
    pub counts: Vec<bool>,
    pub bends: Vec<Node>,
}

impl Guards {
    /// Of `watched` as functions of `inputs`, time and so many states first; none where there is
    /// nothing to watch.
    pub(crate) fn new(
        graph: &Graph,
        inputs: &[Node],
        states: usize,
        watched: &Watched,
    ) -> Result<Option<Arc<Self>>, MissingInput> {
        if watched.surfaces.is_empty() && watched.bends.is_empty() {
            return Ok(None);
        }
        let all = [&watched.surfaces[..], &watched.bends].concat();
        let symbols = graph.symbols_of(&all);
        let reads: Vec<usize> = (0..inputs.len())
            .filter(|&i| symbols.contains(&inputs[i]))
            .collect();
        let guard = |&node: &Node| Guard::new(graph, inputs, &reads, node);
        let guards = |nodes: &[Node]| nodes.iter().map(guard).collect::<Result<_, _>>();
        Ok(Some(Arc::new(Self {
            surfaces: guards(&watched.surfaces)?,
            bends: guards(&watched.bends)?,
            counts: watched.counts.clone(),
            states,
            reads,
        })))
    }

    /// What the input at a place is.
    pub(super) fn kind(&self, place: usize) -> Input {
        match place {
            0 => Input::Time,
            _ if place <= self.states => Input::State(place - 1),
            _ => Input::Beside(place - 1 - self.states),
        }
    }
}

/// An input of the code.
pub(super) enum Input {
    Time,
    State(usize),
    Beside(usize),
}

/// A function of some of the inputs that are read.
#[derive(Debug)]
pub(super) struct Guard {
    /// places among what is read
    reads: Vec<usize>,
    form: Form,
}

#[derive(Debug)]
enum Form {
    /// a constant and the weights of what is read
    Affine(f64, Vec<f64>),
    /// has slopes everywhere, but for bends
    Smooth(Tape),
    /// may jump
    Any(Tape),
}

impl Guard {
    fn new(
        graph: &Graph,
        inputs: &[Node],
        known: &[usize],
        node: Node,
    ) -> Result<Self, MissingInput> {
        let symbols = graph.symbols_of(&[node]);
        let reads: Vec<usize> = (0..known.len())
            .filter(|&i| symbols.contains(&inputs[known[i]]))
            .collect();
        let read: Vec<Node> = reads.iter().map(|&i| inputs[known[i]]).collect();
        let tape = Tape::new(graph, &read, &[node])?;
        let jumps = |op: Op| match op {
            Op::Unary(op, _) => matches!(op, Unary::Floor | Unary::Sign),
            Op::Binary(op, ..) => matches!(
                op,
                Binary::Less | Binary::LessEq | Binary::Equal | Binary::Atan2
            ),
            _ => false,
        };
        let chooses = |op: Op| {
            matches!(
                op,
                Op::Select(..)
                    | Op::Unary(Unary::Not, _)
                    | Op::Binary(Binary::And | Binary::Or, ..)
            )
        };
        let operations: Vec<Op> = graph
            .reachable(&[node])
            .iter()
            .map(|&n| graph.op(n))
            .collect();
        let form = match () {
            () if operations.iter().any(|&op| jumps(op)) => Form::Any(tape),
            () if operations.iter().any(|&op| chooses(op)) => Form::Smooth(tape),
            () => match weights(graph, &read, node) {
                Some(weights) => Form::Affine(point(&tape, &vec![0.0; read.len()]), weights),
                None => Form::Smooth(tape),
            },
        };
        Ok(Self { reads, form })
    }

    /// An enclosure for what is read in such boxes (centre and radius of each).
    pub fn over(&self, boxes: &[[f64; 2]]) -> Option<[f64; 2]> {
        match &self.form {
            Form::Affine(constant, weights) => {
                let (mut middle, mut radius, mut size) = (*constant, 0.0, constant.abs());
                for (&i, weight) in self.reads.iter().zip(weights) {
                    let [centre, reach] = boxes[i];
                    middle += weight * centre;
                    radius += weight.abs() * reach;
                    size += (weight * centre).abs();
                }
                let radius = radius + 8.0 * f64::EPSILON * size;
                Some([middle - radius, middle + radius])
            }
            Form::Smooth(tape) | Form::Any(tape) => {
                let read = self.reads.iter().map(|&i| {
                    let [centre, reach] = boxes[i];
                    interval(centre - reach, centre + reach)
                });
                let read: Vec<Interval> = read.collect();
                bounds(tape.eval_in(&Intervals, &read)[0])
            }
        }
    }

    /// The function along a path.
    pub fn along<'a>(&'a self, path: &'a Path) -> Along<'a> {
        match &self.form {
            Form::Affine(constant, weights) => {
                let parts = self.reads.iter().map(|&i| &path.read[i]).zip(weights);
                Along::Polynomial(Poly::combined(*constant, parts))
            }
            Form::Smooth(tape) => Along::Code(self, tape, path, true),
            Form::Any(tape) => Along::Code(self, tape, path, false),
        }
    }
}

/// The derivatives by what is read, where all of them are constants.
fn weights(graph: &Graph, read: &[Node], node: Node) -> Option<Vec<f64>> {
    let mut weights = vec![0.0; read.len()];
    for (_, column, entry) in jacobian::forward(graph, &[node], read).entries {
        weights[column] = graph.constant_value(entry)?;
    }
    Some(weights)
}

fn point(tape: &Tape, read: &[f64]) -> f64 {
    tape.eval_in(&Reals, read)[0]
}

/// [a, b], or every number where that is none.
fn interval(a: f64, b: f64) -> Interval {
    Interval::new(a, b).unwrap_or(Interval::ENTIRE)
}

/// The ends of an enclosure of the values that there are; none where there is no value.
fn bounds(value: Interval) -> Option<[f64; 2]> {
    (!value.is_empty()).then(|| [value.lo(), value.hi()])
}

/// A function along a path, of the part of it that is done.
pub(super) enum Along<'a> {
    Polynomial(Poly),
    /// the last: slopes are those of the function
    Code(&'a Guard, &'a Tape, &'a Path, bool),
}

impl Along<'_> {
    /// The value where a part of the path is done.
    pub fn at(&self, part: f64) -> f64 {
        match self {
            Self::Polynomial(p) => p.at(part),
            Self::Code(guard, tape, path, _) => {
                let read: Vec<f64> = guard.reads.iter().map(|&i| path.read[i].at(part)).collect();
                point(tape, &read)
            }
        }
    }

    /// An enclosure of the values over a stretch.
    pub fn range(&self, stretch: Stretch) -> Option<[f64; 2]> {
        match self {
            Self::Polynomial(p) => Some(p.range(stretch)),
            Self::Code(guard, tape, path, _) => {
                let read = guard.reads.iter().map(|&i| path.read[i].range(stretch));
                let read: Vec<Interval> = read.map(|[a, b]| interval(a, b)).collect();
                bounds(tape.eval_in(&Intervals, &read)[0])
            }
        }
    }

    /// An enclosure of the slopes over a stretch, where there are some.
    pub fn slope(&self, stretch: Stretch) -> Option<[f64; 2]> {
        match self {
            Self::Polynomial(p) => Some(p.slope(stretch)),
            Self::Code(_, _, _, false) => None,
            Self::Code(guard, tape, path, true) => {
                let jet = |&i: &usize| {
                    let (value, slope) = (path.read[i].range(stretch), path.read[i].slope(stretch));
                    [value, slope].map(|[a, b]| interval(a, b)).to_vec()
                };
                let read: Vec<Vec<Interval>> = guard.reads.iter().map(jet).collect();
                let jets = Jets {
                    inner: &Intervals,
                    order: 1,
                };
                let series = tape.eval_in(&jets, &read).swap_remove(0);
                let slope = series.get(1).copied().unwrap_or(Interval::ZERO);
                // one end of it where the function has no value everywhere
                slope.is_defined().then(|| [slope.lo(), slope.hi()])
            }
        }
    }
}
