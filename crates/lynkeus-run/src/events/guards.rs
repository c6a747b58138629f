//! Guards: the functions that change their sign where a right-hand side jumps or bends with the
//! state, enclosed along a step.
//!
//! Whether a step crosses a surface is not asked of its ends alone: the function is enclosed by
//! interval arithmetic along the polynomial that the method has between them, stretch by stretch,
//! so that a pulse is found however short it is beside the step.

use std::sync::Arc;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{
    Binary, Graph, Interval, Jets, MissingInput, Node, Op, Reals, Tape, Unary, jacobian,
};

/// Stretches that are looked at for one function in a step.
const LOOKS: usize = 2000;

/// What they have to cover of the way for the step to end there; else the rest is sampled.
const USEFUL: f64 = 1e-3;
const SAMPLES: usize = 64;

/// Stretches shorter than this part of a step are not cut any more.
pub(super) const SHORTEST: f64 = 1e-13;

/// A bend this near to an end of a step is at the end.
const AT_THE_END: f64 = 1e-9;

/// A surface on which a right-hand side jumps.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// what vanishes there
    pub node: Node,
    /// how it reads
    pub name: String,
    /// whether it is one of two on which a `floor` jumps: at even integers and, next, at odd ones
    pub counts: bool,
    /// it is a relation of a clause that is decided there, and f does not jump
    pub is_watched: bool,
}

/// Everything that is watched of a system, over the inputs of its code: time, states, and what
/// [`Events::beside`](crate::Events::beside) tells of.
#[derive(Debug, Default)]
pub struct Guards {
    /// states among the inputs, after time
    states: usize,
    /// which inputs are read, in order
    reads: Vec<usize>,
    pub(super) surfaces: Vec<Surface>,
    /// one for each surface
    pub(super) at_surfaces: Vec<Guard>,
    /// where something bends and does not jump
    pub(super) bends: Vec<Guard>,
    /// those that are sampled, together, over all that is read: a loop is searched once for all
    sampled: Option<Tape>,
}

impl Guards {
    /// Of surfaces, and of nodes that vanish where something bends, as functions of `inputs`, time
    /// and so many states first; none where there is nothing to watch.
    pub(crate) fn new(
        graph: &Graph,
        inputs: &[Node],
        states: usize,
        surfaces: &[Surface],
        bends: &[Node],
    ) -> Result<Option<Arc<Self>>, MissingInput> {
        let at_surfaces: Vec<Node> = surfaces.iter().map(|surface| surface.node).collect();
        let all = [&at_surfaces, bends].concat();
        if all.is_empty() {
            return Ok(None);
        }
        let symbols = graph.symbols_of(&all);
        let reads: Vec<usize> = (0..inputs.len())
            .filter(|&i| symbols.contains(&inputs[i]))
            .collect();
        let mut sampled = vec![];
        let mut guard = |&node: &Node| {
            let mut guard = Guard::new(graph, inputs, &reads, node)?;
            if is_sampled(graph, node) {
                guard.sampled = Some(sampled.len());
                sampled.push(node);
            }
            Ok(guard)
        };
        let mut guards = |nodes: &[Node]| nodes.iter().map(&mut guard).collect::<Result<_, _>>();
        let (at_surfaces, bends) = (guards(&at_surfaces)?, guards(bends)?);
        let read: Vec<Node> = reads.iter().map(|&i| inputs[i]).collect();
        let tape = || Tape::new(graph, &read, &sampled);
        Ok(Some(Arc::new(Self {
            sampled: (!sampled.is_empty()).then(tape).transpose()?,
            at_surfaces,
            surfaces: surfaces.to_vec(),
            bends,
            states,
            reads,
        })))
    }

    /// Values of what is sampled along a path, each at all places.
    pub(super) fn samples(&self, path: &[Poly]) -> Vec<Vec<f64>> {
        let Some(tape) = &self.sampled else {
            return vec![];
        };
        let mut columns = vec![vec![]; tape.outputs()];
        for place in places() {
            let read: Vec<f64> = path.iter().map(|poly| poly.at(place)).collect();
            let values = tape.eval_in(&Reals, &read);
            for (column, value) in columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
        columns
    }

    /// What there is for each input that is read: for time, for a state, or for what is read beside
    /// them.
    pub(super) fn inputs<T: Copy>(
        &self,
        time: T,
        state: impl Fn(usize) -> T,
        values: &[[f64; 2]],
        beside: impl Fn([f64; 2]) -> T,
    ) -> impl Iterator<Item = T> {
        self.reads.iter().map(move |&place| match place {
            0 => time,
            _ if place <= self.states => state(place - 1),
            _ => beside(values[place - 1 - self.states]),
        })
    }
}

/// Where a step is sampled.
fn places() -> impl Iterator<Item = f64> {
    (1..=SAMPLES).map(|k| k as f64 / SAMPLES as f64)
}

/// Whether the node reads an algebraic loop with conditions.
fn is_sampled(graph: &Graph, node: Node) -> bool {
    let mut nodes = graph.reachable(&[node]).into_iter();
    nodes.any(|node| matches!(graph.op(node), Op::System(_)) && graph.jumps(node))
}

/// A function of some of the inputs that are read.
#[derive(Debug)]
pub(super) struct Guard {
    /// places among what is read
    reads: Vec<usize>,
    tape: Tape,
    /// a constant and the weights of what is read, where that is all
    affine: Option<(f64, Vec<f64>)>,
    /// nothing in it jumps: it has slopes everywhere, but for bends
    has_slopes: bool,
    /// its place among what is sampled, where it reads an algebraic loop with conditions: over a
    /// stretch the roots of such a loop are not enclosed
    sampled: Option<usize>,
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
        let (mut has_slopes, mut chooses) = (true, false);
        for node in graph.reachable(&[node]) {
            match graph.op(node) {
                Op::Unary(Unary::Floor | Unary::Sign, _) => has_slopes = false,
                Op::Binary(Binary::Less | Binary::LessEq, ..) => has_slopes = false,
                Op::Binary(Binary::Equal | Binary::Atan2, ..) => has_slopes = false,
                Op::Select(..) | Op::Unary(Unary::Not, _) => chooses = true,
                Op::Binary(Binary::And | Binary::Or, ..) => chooses = true,
                _ => {}
            }
        }
        let is_plain = has_slopes && !chooses;
        let weights = is_plain.then(|| weights(graph, &read, node)).flatten();
        Ok(Self {
            affine: weights.map(|weights| (point(&tape, &vec![0.0; read.len()]), weights)),
            reads,
            tape,
            has_slopes,
            sampled: None,
        })
    }

    /// An enclosure for what is read in such boxes (centre and radius of each).
    pub fn over(&self, boxes: &[[f64; 2]]) -> Option<[f64; 2]> {
        if self.sampled.is_some() {
            return Some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        let Some((constant, weights)) = &self.affine else {
            return self.enclosed(|i| {
                let [centre, reach] = boxes[i];
                [centre - reach, centre + reach]
            });
        };
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

    /// The ends of an enclosure of the values that there are where what is read has such ends; none
    /// where there is no value.
    fn enclosed(&self, ends: impl Fn(usize) -> [f64; 2]) -> Option<[f64; 2]> {
        let read = self.reads.iter().map(|&i| ends(i));
        let read: Vec<Interval> = read.map(|[a, b]| interval(a, b)).collect();
        let value = self.tape.eval_in(&Intervals, &read)[0];
        (!value.is_empty()).then(|| [value.lo(), value.hi()])
    }

    /// The function along a path, what the guards read as polynomials: for the search for where it
    /// leaves a side.
    fn along<'a>(&'a self, path: &'a [Poly], samples: &'a [Vec<f64>], shortest: f64) -> Search<'a> {
        let polynomial = self.affine.as_ref().map(|(constant, weights)| {
            let parts = self.reads.iter().map(|&i| &path[i]).zip(weights);
            Poly::combined(*constant, parts)
        });
        Search {
            guard: self,
            path,
            polynomial,
            samples: self.sampled.map(|place| &samples[place][..]),
            side: 1.0,
            level: 0.0,
            band: 0.0,
            shortest,
        }
    }

    /// Where the function leaves a side first, before `limit`; nobody asks which side it is so close
    /// to its level as `band`.
    pub fn passage(
        &self,
        (path, samples): (&[Poly], &[Vec<f64>]),
        (side, level): (f64, f64),
        band: f64,
        shortest: f64,
        limit: f64,
    ) -> Ahead {
        let search = Search {
            side,
            level,
            band,
            ..self.along(path, samples, shortest)
        };
        search.first(0.0, limit)
    }

    /// Where something bends first, before `limit`.
    pub fn bend(
        &self,
        (path, samples): (&[Poly], &[Vec<f64>]),
        shortest: f64,
        limit: f64,
    ) -> Option<f64> {
        let along = self.along(path, samples, shortest);
        let [a, b] = [0.0, 1.0].map(|s| along.value(s).abs());
        let band = 1e-13 * a.max(b);
        // where a step begins at a bend what follows tells the side
        let from = match a <= 1e-10 * a.max(b) {
            true => AT_THE_END,
            false => 0.0,
        };
        let side = if along.value(from) < 0.0 { -1.0 } else { 1.0 };
        let search = Search {
            side,
            band,
            ..along
        };
        let at = search.first(from, limit).at();
        (at > AT_THE_END && at < 1.0 - AT_THE_END).then_some(at)
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
pub(super) fn interval(a: f64, b: f64) -> Interval {
    Interval::new(a, b).unwrap_or(Interval::ENTIRE)
}

/// What comes first in a step, in parts of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ahead {
    Nothing,
    /// a surface is crossed, and the state certainly on the other side at `beyond`
    Jump {
        at: f64,
        beyond: f64,
    },
    /// something bends there; or what comes after that is too much to be looked at
    Stop {
        at: f64,
    },
}

impl Ahead {
    pub(super) fn at(self) -> f64 {
        match self {
            Self::Nothing => 1.0,
            Self::Jump { at, .. } | Self::Stop { at } => at,
        }
    }
}

/// A function along a path, of the part of it that is done, and the search for where it leaves its side.
struct Search<'a> {
    guard: &'a Guard,
    path: &'a [Poly],
    /// the function, where it is affine
    polynomial: Option<Poly>,
    /// its values at some places, where they are all that is known of it
    samples: Option<&'a [f64]>,
    side: f64,
    level: f64,
    /// nobody asks which side it is so close
    band: f64,
    shortest: f64,
}

impl Search<'_> {
    /// The value where a part of the path is done.
    fn value(&self, part: f64) -> f64 {
        if let Some(polynomial) = &self.polynomial {
            return polynomial.at(part);
        }
        let read = self.guard.reads.iter().map(|&i| self.path[i].at(part));
        point(&self.guard.tape, &read.collect::<Vec<f64>>())
    }

    /// An enclosure of the values over a stretch.
    fn range(&self, from: f64, to: f64) -> Option<[f64; 2]> {
        if let Some(polynomial) = &self.polynomial {
            return Some(polynomial.range(from, to));
        }
        self.guard.enclosed(|i| self.path[i].range(from, to))
    }

    /// An enclosure of the slopes over a stretch, where there are some.
    fn slope(&self, from: f64, to: f64) -> Option<[f64; 2]> {
        if let Some(polynomial) = &self.polynomial {
            return Some(polynomial.slope(from, to));
        }
        if !self.guard.has_slopes {
            return None;
        }
        let jet = |&i: &usize| {
            let state = &self.path[i];
            [state.range(from, to), state.slope(from, to)]
                .map(|[a, b]| interval(a, b))
                .to_vec()
        };
        let read: Vec<Vec<Interval>> = self.guard.reads.iter().map(jet).collect();
        let jets = Jets {
            inner: &Intervals,
            order: 1,
        };
        let series = self.guard.tape.eval_in(&jets, &read).swap_remove(0);
        let slope = series.get(1).copied().unwrap_or(Interval::ZERO);
        // one end of it where the function has no value everywhere
        slope.is_defined().then(|| [slope.lo(), slope.hi()])
    }

    fn margin(&self, s: f64) -> f64 {
        self.side * (self.value(s) - self.level)
    }

    /// Bounds of the margin, from those of the function.
    fn margins(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        match self.side > 0.0 {
            true => [low - self.level, high - self.level],
            false => [self.level - high, self.level - low],
        }
    }

    /// The first passage in [from, limit], stretch by stretch from left to right.
    fn first(mut self, from: f64, limit: f64) -> Ahead {
        // what velocities have put on a side may have to go some way to it
        let begins = self.margin(from);
        if begins < 0.0 {
            self.band = self.band.max(-2.0 * begins);
        }
        if let Some(samples) = self.samples {
            return self.among(samples, limit);
        }
        let mut left = vec![(from, limit)];
        for _ in 0..LOOKS {
            let Some((from, to)) = left.pop() else {
                return Ahead::Nothing;
            };
            match self.look(from, to) {
                Some(Ahead::Nothing) => {}
                Some(found) => return found,
                None => {
                    let middle = 0.5 * (from + to);
                    left.extend([(middle, to), (from, middle)]);
                }
            }
        }
        match left.pop() {
            None => Ahead::Nothing,
            // so far nothing is passed: the next step goes on from there
            Some((at, _)) if at - from > USEFUL * (limit - from) => Ahead::Stop { at },
            Some((from, _)) => self.sampled(from, limit),
        }
    }

    /// Of what cannot be enclosed, as an algebraic loop that is searched, samples tell.
    fn sampled(&self, from: f64, to: f64) -> Ahead {
        let samples = (1..=SAMPLES).map(|k| from + (to - from) * k as f64 / SAMPLES as f64);
        self.at(samples)
    }

    /// What the values of a step tell, the first such thing before `limit`, at which something else may come.
    fn among(&self, samples: &[f64], limit: f64) -> Ahead {
        let margins = samples.iter().map(|value| self.side * (value - self.level));
        let before = places()
            .zip(margins)
            .take_while(|(place, _)| *place <= limit);
        // it may be passed between the last sample and what comes there
        let last = (limit < 1.0).then_some(limit).into_iter();
        let last = last.map(|limit| (limit, self.margin(limit)));
        let passed = before.chain(last).find(|(_, margin)| *margin < -self.band);
        passed.map_or(Ahead::Nothing, |(place, _)| self.jump(place))
    }

    /// What the values at some places tell, the first such thing.
    fn at(&self, mut places: impl Iterator<Item = f64>) -> Ahead {
        let passed = places.find(|s| self.margin(*s) < -self.band);
        passed.map_or(Ahead::Nothing, |s| self.jump(s))
    }

    /// The passage before `beyond`.
    fn jump(&self, beyond: f64) -> Ahead {
        let at = self.root(0.0, beyond);
        Ahead::Jump { at, beyond }
    }

    /// What is passed over a stretch, the first such thing; none where that is open.
    fn look(&self, from: f64, to: f64) -> Option<Ahead> {
        let (middle, radius) = around(from, to);
        let is_short = to - from <= self.shortest;
        match self.range(from, to).map(|r| self.margins(r)) {
            // no value anywhere
            None => return Some(Ahead::Nothing),
            Some([low, _]) if low >= -self.band => return Some(Ahead::Nothing),
            Some([_, high]) if high < -self.band => return Some(self.jump(to)),
            _ if is_short => return Some(self.at([middle].into_iter())),
            _ => {}
        }
        let [least, most] = self.slope(from, to)?;
        if least >= 0.0 || most <= 0.0 {
            return Some(self.at([from, to].into_iter()));
        }
        let reach = least.abs().max(most.abs()) * radius;
        (self.margin(middle) - reach >= -self.band).then_some(Ahead::Nothing)
    }

    /// Where the margin ends before `beyond`, at which it is negative and up to which it ends once.
    fn root(&self, mut from: f64, mut beyond: f64) -> f64 {
        if self.margin(from) < 0.0 {
            return from;
        }
        while beyond - from > self.shortest {
            let middle = 0.5 * (from + beyond);
            match self.margin(middle) < 0.0 {
                true => beyond = middle,
                false => from = middle,
            }
        }
        beyond
    }
}

/// Coefficients of the polynomials: the interpolant of the explicit method has degree 7.
pub(crate) const COEFFICIENTS: usize = 8;

/// A polynomial in the part of a step that is done, 0 … 1, lowest power first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Poly(pub [f64; COEFFICIENTS]);

/// Middle and radius of a stretch of the step.
fn around(from: f64, to: f64) -> (f64, f64) {
    (0.5 * (from + to), 0.5 * (to - from))
}

impl Poly {
    /// a + b·s
    pub fn line(a: f64, b: f64) -> Self {
        let mut poly = Self::default();
        [poly.0[0], poly.0[1]] = [a, b];
        poly
    }

    /// A constant and weighted polynomials.
    fn combined<'a>(constant: f64, parts: impl Iterator<Item = (&'a Self, &'a f64)>) -> Self {
        let mut sum = Self::line(constant, 0.0);
        for (part, weight) in parts {
            for (sum, c) in sum.0.iter_mut().zip(part.0) {
                *sum += weight * c;
            }
        }
        sum
    }

    pub fn at(&self, s: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |value, c| value * s + c)
    }

    /// The coefficients about another point.
    fn about(&self, middle: f64) -> [f64; COEFFICIENTS] {
        let mut c = self.0;
        for first in 0..COEFFICIENTS - 1 {
            for k in (first..COEFFICIENTS - 1).rev() {
                c[k] += middle * c[k + 1];
            }
        }
        c
    }

    /// What rounding may have changed of what moves.
    fn rounding(&self) -> f64 {
        32.0 * f64::EPSILON * self.0[1..].iter().map(|c| c.abs()).sum::<f64>()
    }

    /// An enclosure over a stretch.
    fn range(&self, from: f64, to: f64) -> [f64; 2] {
        let (middle, r) = around(from, to);
        let c = self.about(middle);
        let spread = c[1..].iter().rev().fold(0.0, |sum, c| (sum + c.abs()) * r);
        let spread = spread + self.rounding() + 4.0 * f64::EPSILON * c[0].abs();
        [c[0] - spread, c[0] + spread]
    }

    /// An enclosure of the slope over a stretch.
    fn slope(&self, from: f64, to: f64) -> [f64; 2] {
        let (middle, r) = around(from, to);
        let c = self.about(middle);
        let mut spread = 0.0;
        for k in (2..COEFFICIENTS).rev() {
            spread = (spread + k as f64 * c[k].abs()) * r;
        }
        let spread = spread + COEFFICIENTS as f64 * self.rounding();
        [c[1] - spread, c[1] + spread]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is sampled is passed between two samples, and before something else is: that one comes first.
    #[test]
    fn samples_reach_to_what_comes_first() {
        let g = Graph::new();
        let s = g.symbol("s");
        let node = (g.constant(0.5078) - s).node();
        let mut guard = Guard::new(&g, &[s.node()], &[0], node).unwrap();
        guard.sampled = Some(0);
        let path = [Poly::line(0.0, 1.0)];
        let samples = [places().map(|place| 0.5078 - place).collect()];
        let until = |limit| guard.passage((&path, &samples), (1.0, 0.0), 0.0, SHORTEST, limit);
        let Ahead::Jump { at, beyond } = until(0.51) else {
            panic!("nothing is passed before 0.51");
        };
        assert!(
            (at - 0.5078).abs() < 1e-12 && beyond == 0.51,
            "{at} {beyond}"
        );
        assert_eq!(until(0.507), Ahead::Nothing);
        assert!(matches!(until(1.0), Ahead::Jump { .. }));
    }

    #[test]
    fn enclosures_hold_what_they_are_of() {
        let p = Poly([0.3, -2.0, 5.0, -1.5, 0.2, 3.0, -4.0, 1.0]);
        let derivative = |s: f64| (p.at(s + 1e-6) - p.at(s - 1e-6)) / 2e-6;
        for i in 0..10 {
            for j in i + 1..=10 {
                let (from, to) = (0.1 * f64::from(i), 0.1 * f64::from(j));
                let ([low, high], [least, most]) = (p.range(from, to), p.slope(from, to));
                for k in 0..=20 {
                    let s = from + f64::from(k) / 20.0 * (to - from);
                    assert!((low..=high).contains(&p.at(s)));
                    assert!((least - 1e-6..=most + 1e-6).contains(&derivative(s)));
                }
            }
        }
        let [low, high] = p.range(0.499, 0.501);
        assert!(high - low < 0.01, "{low} {high}");
    }
}
