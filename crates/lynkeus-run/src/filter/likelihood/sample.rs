//! The expressions of a sample.

use std::collections::BTreeSet;

use std::f64::consts::TAU;

use lynkeus_expr::jacobian;
use lynkeus_expr::{Expr, Node, Tape};
use lynkeus_native::Function;

use super::code::Code;
use super::plant::{ParametricLevel, ParametricPlant, ParametricSensor};
use super::stiff::Alone;
use crate::Result;
use crate::classical::Term;
use crate::filter::expressions::{Corrected, Flow, corrected, dot, projected};

pub(super) type Compile<const L: usize> = fn(&Tape) -> Option<Function<L>>;

/// Derivatives of a reflection divide by the cube of a column's length, which must stay a number: what has decayed
/// so far, without noise, is none of the uncertainty.
pub(super) const LEAST_SQUARE: f64 = 1e-180;

/// The expressions of a sample.
pub(super) struct Sample<'p, 'g> {
    plant: &'p ParametricPlant<'g>,
    /// C: row, column and entry
    views: Vec<(usize, usize, Node)>,
    h: Expr<'g>,
    reading: Expr<'g>,
    /// symbols of what is known at a row before its readings count: the estimate, then the variances of the noises
    /// that are shares of an output
    at: Vec<Node>,
    /// sensors with such noises
    shares: Vec<usize>,
    /// entries of S that are not 0 whatever happens, and their symbols
    pattern: Vec<(usize, usize)>,
    root: Vec<Node>,
}

impl<'p, 'g> Sample<'p, 'g> {
    pub fn new(plant: &'p ParametricPlant<'g>) -> Self {
        let (g, n) = (plant.graph, plant.states.len());
        let outputs: Vec<Node> = plant.sensors.iter().map(|sensor| sensor.output).collect();
        let is_share = |i: &usize| matches!(plant.sensors[*i].noise, ParametricLevel::Share(_));
        let shares: Vec<usize> = (0..outputs.len()).filter(is_share).collect();
        let at = (0..n + shares.len()).map(|i| g.fresh(format!("x{i}")).node());
        let mut sample = Self {
            plant,
            views: jacobian::forward(g, &outputs, &plant.states).entries,
            h: g.fresh("h"),
            reading: g.fresh("y"),
            at: at.collect(),
            shares,
            pattern: vec![],
            root: vec![],
        };
        sample.find_pattern();
        sample
    }

    /// With an S that is full.
    pub fn full(plant: &'p ParametricPlant<'g>) -> Self {
        let mut sample = Self::new(plant);
        let n = plant.states.len();
        let pattern = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        sample.pattern = pattern.collect();
        let fresh = sample.pattern.iter().map(|_| plant.graph.fresh("S").node());
        sample.root = fresh.collect();
        sample
    }

    /// Symbols of x̂ and of the entries of S.
    pub fn numbered(&self) -> Vec<Node> {
        [&self.plant.states[..], &self.root].concat()
    }

    /// The symbol of a step's length.
    pub fn length(&self) -> Expr<'g> {
        self.h
    }

    /// Every entry of S that a start, a step or a reading makes, or one of them after the others.
    fn find_pattern(&mut self) {
        let n = self.plant.states.len();
        let deviations = self.plant.start.iter().enumerate();
        let first = deviations.filter(|(_, start)| self.term(start.1).is_some());
        let mut pattern: BTreeSet<(usize, usize)> = first.map(|(i, _)| (i, i)).collect();
        loop {
            self.pattern = pattern.iter().copied().collect();
            let fresh = self
                .pattern
                .iter()
                .map(|_| self.plant.graph.fresh("S").node());
            self.root = fresh.collect();
            let (_, predicted) = self.predicted(&self.plant.derivatives);
            let corrected =
                (0..self.plant.sensors.len()).map(|sensor| self.corrected(sensor, None).root);
            let roots: Vec<Vec<Term<'g>>> = corrected.chain([predicted]).collect();
            let places = (0..n * n).filter(|&at| roots.iter().any(|root| root[at].is_some()));
            let before = pattern.len();
            pattern.extend(places.map(|at| (at / n, at % n)));
            if pattern.len() == before {
                return;
            }
        }
    }

    pub fn term(&self, node: Node) -> Term<'g> {
        let is_nothing = self.plant.graph.constant_value(node) == Some(0.0);
        (!is_nothing).then(|| self.plant.graph.expr(node))
    }

    pub fn belief(&self) -> (Vec<Term<'g>>, Vec<Term<'g>>) {
        let (g, n) = (self.plant.graph, self.plant.states.len());
        let x = self.plant.states.iter().map(|&x| Some(g.expr(x))).collect();
        let mut root = vec![None; n * n];
        for (&(i, j), &entry) in self.pattern.iter().zip(&self.root) {
            root[i * n + j] = Some(g.expr(entry));
        }
        (x, root)
    }

    pub fn nodes(&self, (x, root): (&[Term<'g>], &[Term<'g>])) -> Vec<Node> {
        let n = self.plant.states.len();
        let entries = self.pattern.iter().map(|&(i, j)| root[i * n + j]);
        let all = x.iter().copied().chain(entries);
        let nothing = self.plant.graph.constant(0.0);
        all.map(|term| term.unwrap_or(nothing).node()).collect()
    }

    /// x̂ and the entries of S.
    pub fn numbers(&self) -> usize {
        self.plant.states.len() + self.pattern.len()
    }

    /// The places of the numbers of what is drawn anew in every row, the last of so many states, with what they are
    /// then.
    pub fn drawn(&self, states: usize) -> Vec<(usize, f64)> {
        let last = states - self.plant.drawn..states;
        let means = last.clone().map(|i| (i, 0.0));
        let entries = (self.plant.states.len()..).zip(&self.pattern);
        let entries = entries.filter(|(_, (i, _))| last.contains(i));
        let entries = entries.map(|(place, (i, j))| (place, f64::from(u8::from(i == j))));
        means.chain(entries).collect()
    }

    pub fn plant(&self) -> &'p ParametricPlant<'g> {
        self.plant
    }

    pub fn code<const L: usize>(
        &self,
        (known, moves): (&[Node], &[Node]),
        outputs: &[Node],
        compile: Compile<L>,
    ) -> Result<Code<L>> {
        let plant = self.plant;
        Code::new(
            plant.graph,
            known,
            moves,
            &plant.parameters,
            outputs,
            compile,
        )
    }

    pub fn begin<const L: usize>(&self, compile: Compile<L>) -> Result<Code<L>> {
        let n = self.plant.states.len();
        let x = self.plant.start.iter().map(|start| self.term(start.0));
        let mut root = vec![None; n * n];
        for (i, start) in self.plant.start.iter().enumerate() {
            root[i * n + i] = self.term(start.1);
        }
        let outputs = self.nodes((&x.collect::<Vec<_>>(), &root));
        self.code((&[], &[]), &outputs, compile)
    }

    /// x̂ and S after a step.
    fn predicted(&self, derivatives: &[Node]) -> (Vec<Term<'g>>, Vec<Term<'g>>) {
        let (plant, n) = (self.plant, self.plant.states.len());
        let rest = plant.inputs.iter().chain(&plant.parameters);
        let inputs = [plant.time].into_iter().chain(plant.states.iter().copied());
        let inputs: Vec<Node> = inputs.chain(rest.copied()).collect();
        let f = jacobian::forward(plant.graph, derivatives, &plant.states).entries;
        let places: Vec<(usize, usize)> = f.iter().map(|s| (s.0, s.1)).collect();
        let slopes: Vec<Node> = f.iter().map(|s| s.2).collect();
        let flow = Flow {
            graph: plant.graph,
            inputs: &inputs,
            derivatives,
            slopes: &slopes,
            places: &places,
            noise: plant.process_noise.iter().map(|&q| self.term(q)).collect(),
            least_square: LEAST_SQUARE,
        };
        let next = flow.step(self.h, &flow.start());
        let mut root = flow.carried(&next, plant.graph.constant(1.0), &self.belief().1);
        root.truncate(n * n);
        (next[..n].to_vec(), root)
    }

    pub fn predict<const L: usize>(&self, compile: Compile<L>) -> Result<Code<L>> {
        self.predict_by(&self.plant.derivatives, compile)
    }

    /// Which inputs move the states.
    pub fn drives(&self) -> Vec<bool> {
        let symbols = self.plant.graph.symbols_of(&self.plant.derivatives);
        let inputs = self.plant.inputs.iter();
        inputs.map(|input| symbols.contains(input)).collect()
    }

    /// The same of a plant alone by a step for stiff equations.
    pub fn implicit<const L: usize>(&self, compile: Compile<L>) -> Result<Option<Code<L>>> {
        let plant = self.plant;
        if !self.pattern.is_empty() {
            return Ok(None);
        }
        let alone = Alone {
            graph: plant.graph,
            time: plant.time,
            states: &plant.states,
            derivatives: &plant.derivatives,
        };
        let Some(x) = alone.step(self.h) else {
            return Ok(None);
        };
        let known = [&[plant.time, self.h.node()][..], &plant.inputs].concat();
        let x: Vec<Node> = x.into_iter().map(Expr::node).collect();
        self.code((&known, &plant.states), &x, compile).map(Some)
    }

    /// The same with the states limited to their ranges.
    pub fn confined<const L: usize>(&self, compile: Compile<L>) -> Result<Code<L>> {
        self.predict_by(&self.plant.limited(), compile)
    }

    fn predict_by<const L: usize>(
        &self,
        derivatives: &[Node],
        compile: Compile<L>,
    ) -> Result<Code<L>> {
        let plant = self.plant;
        let (x, root) = self.predicted(derivatives);
        let known = [&[plant.time, self.h.node()][..], &plant.inputs].concat();
        self.code(
            (&known, &self.numbered()),
            &self.nodes((&x, &root)),
            compile,
        )
    }

    /// By a reading, or by one of this innovation and variance of the noise.
    fn corrected(&self, sensor: usize, weighed: Option<[Expr<'g>; 2]>) -> Corrected<'g> {
        let (g, n) = (self.plant.graph, self.plant.states.len());
        let output = self.plant.sensors[sensor].output;
        let views = self.views_of(sensor);
        // as they are at the estimate before the row's readings
        let noise = match self.plant.sensors[sensor].noise {
            ParametricLevel::Variance(level) => level,
            ParametricLevel::Share(_) => {
                let before = self.shares.iter().take_while(|other| **other < sensor);
                self.at[n + before.count()]
            }
        };
        let all: Vec<Node> = [output, noise]
            .into_iter()
            .chain(views.iter().map(|v| v.1))
            .collect();
        let moved = self
            .plant
            .states
            .iter()
            .copied()
            .zip(self.at.iter().copied());
        let all = g.substitute(&all, &moved.collect());
        let mut slopes: Vec<Term<'g>> = vec![None; n];
        for ((column, _), &slope) in views.iter().zip(&all[2..]) {
            slopes[*column] = self.term(slope);
        }
        let (x, root) = self.belief();
        let off = slopes.iter().zip(&self.plant.states).zip(&self.at);
        let terms = off.filter_map(|((c, &x), &at)| c.map(|c| c * (g.expr(x) - g.expr(at))));
        let predicted = terms.fold(g.expr(all[0]), |sum, term| sum + term);
        let [innovation, noise] = match weighed {
            Some(weighed) => weighed,
            None => {
                let off = self.reading - predicted;
                let innovation = match self.plant.sensors[sensor].is_dial {
                    true => off + (0.5 - off / TAU).floor() * TAU,
                    false => off,
                };
                [innovation, g.expr(all[1])]
            }
        };
        corrected((&x, &root), &slopes, innovation, noise)
    }

    /// The entries of the row of C of a sensor.
    fn views_of(&self, sensor: usize) -> Vec<(usize, Node)> {
        let own = self.views.iter().filter(|view| view.0 == sensor);
        own.map(|view| (view.1, view.2)).collect()
    }

    /// Of t, u, x̂, S and θ: the variances of the noises that are shares of an output, p²E\[h²\], as the filter has
    /// them before the first reading of the row counts; none where there are no such noises.
    pub fn levels<const L: usize>(&self, compile: Compile<L>) -> Result<Option<Code<L>>> {
        let (plant, g, n) = (self.plant, self.plant.graph, self.plant.states.len());
        let (_, root) = self.belief();
        let levels = self.shares.iter().map(|&sensor| {
            let ParametricSensor { output, noise, .. } = &plant.sensors[sensor];
            let mut slopes: Vec<Term<'g>> = vec![None; n];
            for (column, slope) in self.views_of(sensor) {
                slopes[column] = self.term(slope);
            }
            let projected = projected(&root, &slopes);
            let spread = dot(&projected, &projected);
            let square = g.expr(*output).powi(2);
            let share = match noise {
                ParametricLevel::Share(level) | ParametricLevel::Variance(level) => g.expr(*level),
            };
            share.powi(2) * spread.map_or(square, |spread| square + spread)
        });
        let levels: Vec<Node> = levels.map(Expr::node).collect();
        if levels.is_empty() {
            return Ok(None);
        }
        let known = [&[plant.time][..], &plant.inputs].concat();
        self.code((&known, &self.numbered()), &levels, compile)
            .map(Some)
    }

    /// Numbers of what is known at a row before its readings count.
    pub fn known_before(&self) -> usize {
        self.at.len()
    }

    /// What the code of a sensor reads: t, y and u; what was known before the row's readings, x̂ and S.
    fn read(&self) -> (Vec<Node>, Vec<Node>) {
        let plant = self.plant;
        let known = [&[plant.time, self.reading.node()][..], &plant.inputs].concat();
        let moves = [&self.at[..], &plant.states, &self.root].concat();
        (known, moves)
    }

    pub fn correct<const L: usize>(&self, sensor: usize, compile: Compile<L>) -> Result<Code<L>> {
        let found = self.corrected(sensor, None);
        let belief = self.nodes((&found.x, &found.root));
        let seen = [found.innovation.node(), found.variance.node()];
        let (known, moves) = self.read();
        self.code((&known, &moves), &[&belief[..], &seen].concat(), compile)
    }

    /// ν, σ² and the variance of the noise.
    pub fn view<const L: usize>(&self, sensor: usize, compile: Compile<L>) -> Result<Code<L>> {
        let found = self.corrected(sensor, None);
        let seen = [found.innovation, found.variance, found.noise].map(Expr::node);
        let (known, moves) = self.read();
        self.code((&known, &moves), &seen, compile)
    }

    /// x̂ and S after a reading whose innovation and variance of the noise are given with their tangents.
    pub fn weigh<const L: usize>(&self, sensor: usize, compile: Compile<L>) -> Result<Code<L>> {
        let g = self.plant.graph;
        let weighed = ["innovation", "noise"].map(|name| g.fresh(name));
        let found = self.corrected(sensor, Some(weighed));
        let (known, mut moves) = self.read();
        moves.extend(weighed.map(Expr::node));
        self.code(
            (&known, &moves),
            &self.nodes((&found.x, &found.root)),
            compile,
        )
    }
}
