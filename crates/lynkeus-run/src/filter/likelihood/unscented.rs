//! The unscented filter's sample: points through the flow, and what the sensors show of them.
//!
//! x̂ and the outputs ŷ are one belief with one root S: the points are shown to the sensors before a row's readings,
//! and a reading then corrects as one of a state does, which one after the other come to what the filter does with
//! all of them together ([`super::super::ukf`]).

use lynkeus_expr::{Expr, Node, jacobian};

use super::code::{Bundle, Code};
use super::interval::Interval;
use super::plant::{ParametricPlant, ParametricSensor};
use super::sample::{Compile, LEAST_SQUARE, Sample};
use crate::Result;
use crate::classical::{Term, sum};
use crate::filter::Weights;
use crate::filter::expressions::{Flow, factor, reflected};
use crate::noise::Limits;

/// The plant with its outputs as states, whose values are shown to them.
pub(super) fn shown<'g>(plant: &ParametricPlant<'g>) -> ParametricPlant<'g> {
    let g = plant.graph;
    let nothing = g.constant(0.0).node();
    let mut own = plant.clone();
    for sensor in &plant.sensors {
        let z = g.fresh("z").node();
        own.states.push(z);
        own.derivatives.push(nothing);
        own.process_noise.push(nothing);
        own.start.push((nothing, nothing));
        if !own.ranges.is_empty() {
            let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
            own.ranges.push(Limits { low, high });
        }
        let place = own.states.len() - plant.states.len() - 1;
        own.sensors[place] = ParametricSensor {
            output: z,
            ..sensor.clone()
        };
    }
    own
}

/// A share of a column's square below which it is rounding.
const ROUNDING: f64 = 1e-26;

/// Points of a belief, and what they come to.
pub(super) struct Unscented<'p, 'g> {
    pub plant: &'p ParametricPlant<'g>,
    /// of [`shown`]
    pub sample: &'p Sample<'p, 'g>,
    pub weights: Weights,
}

/// The code of a prediction.
#[derive(Clone, Debug)]
pub(super) struct Points<const L: usize> {
    /// of x̂ and S: the points, and 0 for the root of W
    draw: Code<L>,
    /// of t, h, u, the points, that root and θ: both a step later
    step: Code<L>,
    /// of both: x̂ and S
    gather: Code<L>,
    under_way: Bundle<L>,
}

impl<const L: usize> Points<L> {
    pub fn place(&mut self, parameters: &[f64]) {
        for code in [&mut self.draw, &mut self.step, &mut self.gather] {
            code.place(parameters);
        }
    }

    pub fn run(&mut self, interval: &Interval<'_>, belief: &mut [Bundle<L>]) {
        for (pass, belief) in belief.iter_mut().enumerate() {
            self.under_way
                .copy_from_slice(self.draw.run(pass, [], &[belief]));
            for i in 0..interval.steps {
                let [t, h] = interval.step(i);
                let known: [&[f64]; 2] = [&[t, h], interval.inputs];
                let next = self.step.run(pass, known, &[&self.under_way]);
                self.under_way.copy_from_slice(next);
            }
            belief.copy_from_slice(self.gather.run(pass, [], &[&self.under_way]));
        }
    }
}

impl<'g> Unscented<'_, 'g> {
    fn states(&self) -> usize {
        self.plant.states.len()
    }

    /// x̂ and x̂ ± columns of √(n+λ) S.
    fn drawn(&self) -> Vec<Vec<Expr<'g>>> {
        let (g, n) = (self.plant.graph, self.states());
        let (x, root) = self.sample.belief();
        let all = root.len().isqrt();
        let centre: Vec<Expr<'g>> = x[..n].iter().flatten().copied().collect();
        let mut points = vec![centre.clone()];
        for sign in [1.0, -1.0] {
            points.extend((0..n).map(|k| {
                let entries = (0..n).map(|i| root[i * all + k]);
                let moved = centre.iter().zip(entries).map(|(x, entry)| match entry {
                    Some(entry) => *x + g.constant(sign * self.weights.spread) * entry,
                    None => *x,
                });
                moved.collect()
            }));
        }
        points
    }

    /// Weight of a point in covariances.
    fn weight(&self, k: usize) -> f64 {
        match k {
            0 => self.weights.centre,
            _ => self.weights.other,
        }
    }

    /// The root of Σ W d dᵀ + Σ e eᵀ over deviations and extra rows of n entries.
    fn spread(
        &self,
        deviations: &[Vec<Term<'g>>],
        extra: Vec<Term<'g>>,
        n: usize,
    ) -> Vec<Term<'g>> {
        let g = self.plant.graph;
        let scaled = |scale: f64, d: &Term<'g>| d.map(|d| g.constant(scale) * d);
        if self.weights.centre >= 0.0 {
            let rows = deviations.iter().enumerate();
            let rows = rows.flat_map(|(k, d)| {
                let weight = self.weight(k).sqrt();
                d.iter().map(move |d| scaled(weight, d))
            });
            let mut rows: Vec<Term<'g>> = rows.chain(extra).collect();
            // what is left of a column that the others make is rounding, which has no derivative
            let least = (0..n).map(|k| {
                let squares = rows.iter().skip(k).step_by(n).flatten();
                let squares = squares.map(|entry| entry.powi(2));
                let whole = squares.reduce(|sum, one| sum + one);
                whole.map_or(g.constant(LEAST_SQUARE), |whole| {
                    (ROUNDING * whole).max(g.constant(LEAST_SQUARE))
                })
            });
            let least: Vec<Expr<'g>> = least.collect();
            return reflected(g, &mut rows, n, |k| least[k]);
        }
        let weighed = deviations.iter().enumerate();
        let weighed = weighed.map(|(k, d)| (self.weight(k), &d[..]));
        let mut matrix = vec![None; n * n];
        for (weight, d) in weighed.chain(extra.chunks_exact(n).map(|e| (1.0, e))) {
            for (place, entry) in matrix.iter_mut().enumerate() {
                let product = d[place / n].zip(d[place % n]).map(|(a, b)| a * b);
                *entry = sum(*entry, scaled(weight, &product));
            }
        }
        factor(g, &matrix, n)
    }

    /// S of the whole belief with this root of its first numbers.
    fn nodes(&self, x: Vec<Term<'g>>, own: &[Term<'g>], count: usize) -> Vec<Node> {
        let all = self.sample.plant().states.len();
        let mut root = vec![None; all * all];
        for i in 0..count {
            root[i * all..i * all + count].copy_from_slice(&own[i * count..(i + 1) * count]);
        }
        let mut x = x;
        x.resize(all, None);
        self.sample.nodes((&x, &root))
    }

    /// Of x̂, S and the sensors: ŷ beside it.
    pub fn show<const L: usize>(&self, compile: Compile<L>) -> Result<Code<L>> {
        let (plant, g, n) = (self.plant, self.plant.graph, self.states());
        let outputs: Vec<Node> = plant.sensors.iter().map(|s| s.output).collect();
        let points = self.drawn();
        let images = points.iter().map(|point| {
            let states = plant.states.iter().copied();
            let places = states.zip(point.iter().map(|x| x.node())).collect();
            let images = g.substitute(&outputs, &places).into_iter();
            images.map(|image| g.expr(image)).collect()
        });
        let images: Vec<Vec<Expr<'g>>> = images.collect();
        let expected = self.means(&images);
        let all = n + outputs.len();
        let deviations = points.iter().zip(&images).enumerate();
        let deviations = deviations.map(|(k, (point, image))| {
            // the centre is the mean of the points, whatever rounding says
            let own = point
                .iter()
                .zip(&points[0])
                .map(|(x, mean)| (k > 0).then(|| *x - *mean));
            let shown = image
                .iter()
                .zip(&expected)
                .map(|(z, mean)| Some(*z - *mean));
            own.chain(shown).collect()
        });
        let deviations: Vec<Vec<Term<'g>>> = deviations.collect();
        let root = self.spread(&deviations, vec![], all);
        let x = points[0].iter().chain(&expected).map(|x| Some(*x));
        let known = [&[plant.time][..], &plant.inputs].concat();
        let belief = self.nodes(x.collect(), &root, all);
        self.sample
            .code((&known, &self.sample.numbered()), &belief, compile)
    }

    fn means(&self, points: &[Vec<Expr<'g>>]) -> Vec<Expr<'g>> {
        let g = self.plant.graph;
        let count = points[0].len();
        let of = |i: usize| {
            let parts = points.iter().enumerate().map(|(k, point)| {
                let weight = match k {
                    0 => self.weights.mean_of_centre,
                    _ => self.weights.other,
                };
                g.constant(weight) * point[i]
            });
            parts
                .reduce(|sum, part| sum + part)
                .unwrap_or(g.constant(0.0))
        };
        (0..count).map(of).collect()
    }

    /// By the plant's derivatives, or by others.
    pub fn predict<const L: usize>(
        &self,
        derivatives: &[Node],
        compile: Compile<L>,
    ) -> Result<Points<L>> {
        let (plant, g, n) = (self.plant, self.plant.graph, self.states());
        let rest = plant.inputs.iter().chain(&plant.parameters);
        let inputs = [plant.time].into_iter().chain(plant.states.iter().copied());
        let inputs: Vec<Node> = inputs.chain(rest.copied()).collect();
        let f = jacobian::forward(g, derivatives, &plant.states).entries;
        let places: Vec<(usize, usize)> = f.iter().map(|s| (s.0, s.1)).collect();
        let slopes: Vec<Node> = f.iter().map(|s| s.2).collect();
        let noise = plant.process_noise.iter();
        let noise: Vec<Term<'g>> = noise.map(|&q| self.sample.term(q)).collect();
        let is_noisy = noise.iter().any(Option::is_some);
        let flow = Flow {
            graph: g,
            inputs: &inputs,
            derivatives,
            slopes: &slopes,
            places: &places,
            noise,
            least_square: LEAST_SQUARE,
        };
        let still = Flow {
            noise: vec![None; n],
            ..flow
        };
        let h = self.sample.length();
        let points: Vec<Vec<Expr<'g>>> = (0..=2 * n)
            .map(|_| (0..n).map(|_| g.fresh("p")).collect())
            .collect();
        let begin = |point: &[Expr<'g>], width: usize| {
            let mut z: Vec<Term<'g>> = point.iter().copied().map(Some).collect();
            z.resize(n + n * width, None);
            z
        };
        // W is carried as its root, step by step: a factor of a W whose columns nearly agree is none
        let centre = |w: &[Term<'g>]| match is_noisy {
            false => (still.step(h, &begin(&points[0], n)), vec![None; n * n]),
            true => {
                let mut z = flow.start();
                z[..n].copy_from_slice(&begin(&points[0], 0));
                let next = flow.step(h, &z);
                let root = flow.carried(&next, g.constant(1.0), w);
                (next, root)
            }
        };
        let mut w: Vec<Term<'g>> = vec![None; n * n];
        let (next, root) = loop {
            let (next, root) = centre(&w);
            let grows = |at: &usize| root[*at].is_some() && w[*at].is_none();
            let more: Vec<usize> = (0..n * n).filter(grows).collect();
            if more.is_empty() {
                break (next, root);
            }
            more.into_iter().for_each(|at| w[at] = Some(g.fresh("w")));
        };
        let places: Vec<usize> = (0..n * n).filter(|&at| w[at].is_some()).collect();
        let moved = points[1..].iter();
        let moved = moved.flat_map(|point| still.step(h, &begin(point, n)).into_iter().take(n));
        let nothing = g.constant(0.0);
        let node = |term: Term<'g>| term.unwrap_or(nothing).node();
        let stepped: Vec<Node> = (next[..n].iter().copied().chain(moved))
            .chain(places.iter().map(|&at| root[at]))
            .map(node)
            .collect();
        let own = w.iter().flatten().copied();
        let under_way: Vec<Node> = points
            .iter()
            .flatten()
            .copied()
            .chain(own)
            .map(Expr::node)
            .collect();
        let drawn: Vec<Node> = (self.drawn().concat().into_iter())
            .chain(places.iter().map(|_| nothing))
            .map(Expr::node)
            .collect();
        let mean = self.means(&points);
        let deviations = points.iter().map(|point| {
            let parts = point.iter().zip(&mean);
            parts.map(|(x, mean)| Some(*x - *mean)).collect()
        });
        let deviations: Vec<Vec<Term<'g>>> = deviations.collect();
        let mut extra = vec![None; if is_noisy { n * n } else { 0 }];
        for (place, entry) in extra.iter_mut().enumerate() {
            *entry = w[place % n * n + place / n];
        }
        let root = self.spread(&deviations, extra, n);
        let gathered = self.nodes(mean.into_iter().map(Some).collect(), &root, n);
        let known = [&[plant.time, h.node()][..], &plant.inputs].concat();
        let sample = self.sample;
        Ok(Points {
            under_way: vec![[0.0; L]; 2 * under_way.len()],
            draw: sample.code((&[], &sample.numbered()), &drawn, compile)?,
            step: sample.code((&known, &under_way), &stepped, compile)?,
            gather: sample.code((&[], &under_way), &gathered, compile)?,
        })
    }
}
