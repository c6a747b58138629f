//! One step of a tube: proposed in floating point, proved by an inequality of Taylor models.

use std::rc::Rc;

use lynkeus_expr::{Budget, Interval, Tape};

use super::algebra::Models;
use super::model::{Model, raised};
use super::ring::{Part, Ring};
use super::zonotope::Zonotope;

/// Powers of τ: where remainders limit the steps, fewer do.
const DEGREES: std::ops::RangeInclusive<usize> = 4..=10;

/// How large the coefficient of the last power may be, as a share of the largest value so far.
const SMALL: f64 = 1e-10;

/// How much larger it may be before the step is taken again.
const TOLERATED: f64 = 30.0;

/// Largest share of a remainder that comes back from the integral over a step: without inputs, and
/// with those, where every step adds to the remainder.
const CONTRACTION: [f64; 2] = [0.4, 0.1];

/// Shortest step, as a share of the whole time.
const SHORTEST: f64 = 1e-9;

/// No remainder is zero, so that it has an inside.
const TINY: f64 = 1e-290;

/// Parts of a step whose ranges are taken apart.
const PIECES: usize = 6;

/// Tries to find a remainder that a step keeps.
const TRIES: usize = 8;

/// What is integrated: from where, with which constants and inputs.
#[derive(Clone, Debug)]
pub struct Problem {
    /// x': its inputs are the states, time, the constants, the inputs, in this order
    pub right: Tape,
    /// when it starts
    pub from: f64,
    /// x(t₀), one range per state
    pub start: Vec<Interval>,
    /// p, one range per constant: the same unknown number for all times
    pub constants: Vec<Interval>,
    /// u, one range per input: any measurable function of time within it
    pub inputs: Vec<Interval>,
}

/// The set between steps, and how the next one is tried.
pub(super) struct Stepper<'p> {
    problem: &'p Problem,
    ring: Rc<Ring>,
    constants: Vec<Model>,
    inputs: Vec<Model>,
    until: f64,
    set: Set,
    /// largest values so far
    scale: Vec<f64>,
}

/// p₀(s) + Gξ at a time, and the step that is proposed from there.
pub(super) struct Set {
    time: f64,
    polynomial: Vec<Model>,
    zonotope: Zonotope,
    step: f64,
    /// powers of τ
    degree: usize,
}

/// A part of a tube between two times.
#[derive(Debug)]
pub struct Segment {
    ring: Rc<Ring>,
    from: f64,
    to: f64,
    /// P and its remainder, of every state
    flow: Vec<Model>,
    /// the same at the end
    last: Vec<Model>,
    /// d
    reach: Vec<f64>,
    zonotope: Zonotope,
    /// the step that is proposed next, with so many powers of τ
    next: (f64, usize),
}

/// A step that is proved, and what it says about the next.
struct Proved {
    flow: Vec<Model>,
    contraction: f64,
}

impl<'p> Stepper<'p> {
    /// From the start set.
    pub fn new(problem: &'p Problem, until: f64) -> Self {
        Self::with(problem, until, problem.start.len())
    }

    /// The same with so many symbols of remainders.
    fn with(problem: &'p Problem, until: f64, remainders: usize) -> Self {
        let is_wide = |range: &&Interval| !range.is_point();
        let all = problem.start.iter().chain(&problem.constants);
        let ring = Rc::new(Ring::new(all.filter(is_wide).count(), remainders));
        let mut symbol = 0;
        let mut along = |range: &Interval| {
            if range.is_point() {
                return Model::within(&ring, *range);
            }
            symbol += 1;
            Model::along(&ring, *range, symbol - 1)
        };
        let polynomial: Vec<Model> = problem.start.iter().map(&mut along).collect();
        let constants = problem.constants.iter().map(&mut along).collect();
        let inputs = problem.inputs.iter();
        Self {
            problem,
            constants,
            inputs: inputs.map(|&range| Model::within(&ring, range)).collect(),
            until,
            scale: vec![0.0; problem.start.len()],
            set: Set {
                time: problem.from,
                zonotope: Zonotope::origin(polynomial.len()),
                polynomial,
                step: (until - problem.from) / 64.0,
                degree: *DEGREES.end(),
            },
            ring,
        }
    }

    /// From what `first` makes of the start set, with symbols for so many errors of a sample.
    pub fn lifted(flow: &'p Problem, first: &Tape, errors: usize, until: f64) -> Option<Self> {
        let n = first.outputs();
        let mut stepper = Self::with(flow, until, n + errors);
        stepper.scale = vec![0.0; n];
        let seeds = &stepper.set.polynomial;
        let models = first.eval_in(&stepper.samples(), seeds);
        let (zonotope, reach) = (Zonotope::origin(n), vec![0.0; n]);
        stepper.set = stepper
            .set
            .next(&stepper.ring, known(models)?, &zonotope, &reach);
        Some(stepper)
    }

    /// The algebra of a sample, which takes no time.
    fn samples(&self) -> Models<'_> {
        Models {
            ring: &self.ring,
            degree: 0,
        }
    }

    /// Until when to go on.
    pub fn aim(&mut self, until: f64) {
        self.until = until;
    }

    /// Where the states are.
    pub fn ranges(&self) -> Vec<Interval> {
        let reach = self.set.zonotope.reach();
        let start = self.start(&reach).unwrap_or_default();
        start.iter().map(|x| x.range(&self.ring)).collect()
    }

    /// Jumps to what `map` makes of the states, the time, and errors of at most these sizes; the ranges then,
    /// none where they have no bounds.
    pub fn jump(&mut self, map: &Tape, errors: &[f64]) -> Option<Vec<Interval>> {
        let reach = self.set.zonotope.reach();
        let start = self.start(&reach)?;
        let error = |(j, size): (usize, &f64)| {
            let range = Interval::new(-size, *size).ok()?;
            let symbol = self.ring.start() + start.len() + j;
            Some(Model::along(&self.ring, range, symbol))
        };
        let errors: Option<Vec<Model>> = errors.iter().enumerate().map(error).collect();
        let time = Model::constant(&self.ring, self.set.time);
        let arguments: Vec<Model> = start.into_iter().chain([time]).chain(errors?).collect();
        let models = known(map.eval_in(&self.samples(), &arguments))?;
        let ranges = models.iter().map(|x| x.range(&self.ring)).collect();
        let zonotope = self.set.zonotope.clone();
        self.set = self.set.next(&self.ring, models, &zonotope, &reach);
        Some(ranges)
    }

    /// Where the tube has come to.
    pub fn time(&self) -> f64 {
        self.set.time
    }

    /// Goes on from the end of a segment.
    pub fn take(&mut self, set: Set) {
        self.set = set;
    }

    /// The longest next part that is proved, if there is one that is found within the budget.
    pub fn step(&mut self, budget: &Budget) -> Option<Segment> {
        let span = self.until - self.problem.from;
        if !span.is_finite() {
            return None;
        }
        let reach = self.set.zonotope.reach();
        let start = self.start(&reach)?;
        let is_driven = self.inputs.iter().any(|u| u.rest > 0.0);
        let most = CONTRACTION[usize::from(is_driven)];
        let mut step = self.set.step;
        while step >= SHORTEST * span && budget.spent().is_none() {
            let left = self.until - self.set.time;
            let to = match step >= 0.99 * left {
                true => self.until,
                false => self.set.time + step,
            };
            let length = Interval::point(to) - Interval::point(self.set.time);
            let proposal = self.proposed(&start, length);
            let last_power = self.last_power(&proposal);
            let longer =
                (0.9 * (SMALL / last_power).powf(1.0 / self.set.degree as f64)).clamp(0.2, 2.0);
            if last_power.is_nan() || last_power > TOLERATED * SMALL {
                step *= if last_power.is_nan() {
                    0.2
                } else {
                    longer.min(0.9)
                };
                continue;
            }
            let Some(found) = self.proved(&start, &proposal, length) else {
                step *= 0.4;
                continue;
            };
            let slower = most / found.contraction.max(1e-300);
            if slower < 0.5 {
                step *= slower.max(0.1);
                continue;
            }
            let last = found.flow.iter().map(|x| x.at_end(&self.ring)).collect();
            return Some(Segment {
                ring: Rc::clone(&self.ring),
                from: self.set.time,
                to,
                flow: found.flow,
                last,
                reach,
                zonotope: self.set.zonotope.clone(),
                next: (
                    step.min(4.0 * left) * longer.min(slower),
                    self.degree(last_power, longer, slower),
                ),
            });
        }
        None
    }

    /// How many powers of τ a step needs that is so many times as long as one with such a last power: their coefficients
    /// fall geometrically. One more where the last power limits the steps.
    fn degree(&self, last_power: f64, longer: f64, slower: f64) -> usize {
        let ratio = last_power.powf(1.0 / self.set.degree as f64) * longer.min(slower);
        let needed = (SMALL.ln() / ratio.ln()).ceil() as usize;
        let more = usize::from(longer < slower && ratio < 1.0);
        (needed + more).clamp(*DEGREES.start(), *DEGREES.end())
    }

    /// x₀ = p₀(s) + d ∘ q
    fn start(&self, reach: &[f64]) -> Option<Vec<Model>> {
        let n = reach.len();
        let state = |j: usize| {
            let mut model = self.set.polynomial[j].clone();
            let place = self.ring.symbol(self.ring.start() + j)?;
            model.coefficients[place] = reach[j];
            (reach[j].is_finite() && model.rest.is_finite()).then_some(model)
        };
        (0..n).map(state).collect()
    }

    /// f along what is known of x, with powers of τ up to `degree`.
    fn right(&self, x: &[Model], length: Interval, degree: usize) -> Vec<Model> {
        let models = Models {
            ring: &self.ring,
            degree,
        };
        let one = Model::constant(&self.ring, 1.0);
        let elapsed = one
            .integral(&self.ring)
            .times(&self.within(length), &self.ring, 1);
        let time = Model::constant(&self.ring, self.set.time).plus(&elapsed);
        let arguments: Vec<Model> = x
            .iter()
            .chain([&time])
            .chain(&self.constants)
            .chain(&self.inputs)
            .cloned()
            .collect();
        self.problem.right.eval_in(&models, &arguments)
    }

    fn within(&self, range: Interval) -> Model {
        Model::within(&self.ring, range)
    }

    /// x₀ + h ∫₀^τ f
    fn integral(&self, start: &[Model], f: &[Model], length: Interval) -> Vec<Model> {
        let length = self.within(length);
        let added = |(x, f): (&Model, &Model)| {
            x.plus(
                &f.integral(&self.ring)
                    .times(&length, &self.ring, self.set.degree),
            )
        };
        start.iter().zip(f).map(added).collect()
    }

    /// P: the integral again and again, each time with one power of τ more. No proof.
    fn proposed(&self, start: &[Model], length: Interval) -> Vec<Model> {
        let bare = |models: &[Model], degree: usize| -> Vec<Model> {
            models
                .iter()
                .map(|x| x.polynomial(&self.ring, degree))
                .collect()
        };
        let mut x = bare(start, 0);
        for degree in 0..self.set.degree {
            let f = bare(&self.right(&x, length, degree), degree);
            x = bare(&self.integral(start, &f, length), degree + 1);
        }
        x
    }

    /// The coefficients of the last power of τ, as a share of the largest values so far.
    fn last_power(&mut self, proposal: &[Model]) -> f64 {
        let mut largest = 0.0_f64;
        for (x, scale) in proposal.iter().zip(&mut self.scale) {
            let size = x.norm();
            if !size.is_finite() {
                return f64::NAN;
            }
            let last: f64 = match x.rows(&self.ring) > self.set.degree {
                true => x.coefficients[self.set.degree * self.ring.len()..]
                    .iter()
                    .map(|c| c.abs())
                    .sum(),
                false => 0.0,
            };
            let largest_so_far = scale.max(
                x.coefficients[..self.ring.len()]
                    .iter()
                    .map(|c| c.abs())
                    .sum(),
            );
            if last <= TOLERATED * SMALL * largest_so_far {
                *scale = largest_so_far;
            }
            if last > 0.0 {
                largest = largest.max(last / largest_so_far.max(0.1 * size));
            }
        }
        largest
    }

    /// The largest remainder as a share of the largest value so far; of what is zero all the time rounding leaves none.
    fn relative(&self, remainder: &[f64]) -> f64 {
        let shares = remainder.iter().zip(&self.scale);
        let shares = shares.filter(|(e, _)| **e > TINY);
        shares
            .map(|(e, scale)| e / scale.max(TINY))
            .fold(TINY, f64::max)
    }

    /// A remainder that the integral maps into its inside, and what that proves of the step.
    fn proved(&self, start: &[Model], proposal: &[Model], length: Interval) -> Option<Proved> {
        let mapped = |remainder: &[f64]| {
            let with = |(x, &rest): (&Model, &f64)| Model { rest, ..x.clone() };
            let x: Vec<Model> = proposal.iter().zip(remainder).map(with).collect();
            let f = self.right(&x, length, self.set.degree - 1);
            let image = self.integral(start, &f, length);
            let distance = |(x, p): (&Model, &Model)| {
                let difference = x.minus(p);
                raised(difference.norm() + difference.rest, 2)
            };
            let distances: Vec<f64> = image.iter().zip(proposal).map(distance).collect();
            (image, distances)
        };
        let (_, first) = mapped(&vec![0.0; proposal.len()]);
        let mut remainder: Vec<f64> = first.iter().map(|e| 1.5 * e + TINY).collect();
        for _ in 0..TRIES {
            if remainder.iter().any(|rest| !rest.is_finite()) {
                return None;
            }
            let (_, image) = mapped(&remainder);
            if image.iter().zip(&remainder).all(|(e, rest)| e < rest) {
                let (flow, last) = mapped(&image);
                let known = flow.iter().all(|x| x.rest.is_finite());
                // 1 + κ + κ² + … of the geometric series that the remainders are
                let grown = self.relative(&last) / self.relative(&first);
                return known.then_some(Proved {
                    flow,
                    contraction: 1.0 - 1.0 / grown,
                });
            }
            remainder = image.iter().map(|e| 1.3 * e + TINY).collect();
        }
        None
    }
}

impl Segment {
    /// When it begins.
    pub fn from(&self) -> f64 {
        self.from
    }

    /// When it ends.
    pub fn to(&self) -> f64 {
        self.to
    }

    /// Where the states are in all of it.
    pub fn range(&self) -> Vec<Interval> {
        let share = |k: usize| Interval::point(k as f64) / Interval::point(PIECES as f64);
        let piece = |k: usize| share(k).hull(share(k + 1));
        let range = |x: &Model| {
            let pieces = (0..PIECES).map(|k| x.range_over(&self.ring, piece(k)));
            pieces.reduce(Interval::hull).unwrap_or(Interval::UNKNOWN)
        };
        self.flow.iter().map(range).collect()
    }

    /// Where the states are when it ends.
    pub fn end(&self) -> Vec<Interval> {
        self.last.iter().map(|x| x.range(&self.ring)).collect()
    }

    /// Where the states of the solutions are when it ends that started where the symbols of the wide
    /// ranges, those of the start first, then of the constants, have these values between −1 and 1; values beyond these symbols
    /// stand for nothing.
    pub fn end_from(&self, symbols: &[f64]) -> Vec<Interval> {
        self.last
            .iter()
            .map(|x| x.range_at(&self.ring, symbols))
            .collect()
    }

    /// The set where it ends.
    pub(super) fn into_end(self) -> Set {
        let set = Set {
            time: self.to,
            polynomial: vec![],
            zonotope: Zonotope::origin(0),
            step: self.next.0,
            degree: self.next.1,
        };
        set.next(&self.ring, self.last, &self.zonotope, &self.reach)
    }
}

impl Set {
    /// The set of such models at this time: what is linear in the symbols of the remainder goes through the
    /// zonotope that these stood for, what is linear in those of errors beside it; what is mixed becomes a box.
    fn next(&self, ring: &Ring, models: Vec<Model>, zonotope: &Zonotope, reach: &[f64]) -> Self {
        let n = models.len();
        let mut polynomial = vec![];
        let (mut L, mut around) = (vec![vec![0.0; n]; n], vec![0.0; n]);
        let mut errors = vec![vec![0.0; n]; ring.remainders().saturating_sub(n)];
        for (k, mut model) in models.into_iter().enumerate() {
            let mut mixed = 0.0;
            for (i, c) in model.coefficients.iter_mut().enumerate() {
                match ring.part(i) {
                    Part::Start => continue,
                    Part::Remainder(j) if j < n => L[k][j] = *c,
                    Part::Remainder(j) => errors[j - n][k] = *c,
                    Part::Mixed => mixed += c.abs(),
                }
                *c = 0.0;
            }
            around[k] = raised(raised(mixed, ring.len()) + model.rest, 2);
            model.rest = 0.0;
            polynomial.push(model);
        }
        Self {
            time: self.time,
            polynomial,
            zonotope: zonotope.through(&L, reach, &around).beside(errors),
            step: self.step,
            degree: self.degree,
        }
    }
}

/// None where a value has no bounds.
fn known(models: Vec<Model>) -> Option<Vec<Model>> {
    let is_known = |x: &Model| x.rest.is_finite() && x.norm().is_finite();
    models.iter().all(is_known).then_some(models)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use lynkeus_expr::{Expr, Graph, Node};

    use super::super::{End, reach};
    use super::*;

    type Right = dyn for<'g> Fn(&'g Graph, &[Expr<'g>]) -> Vec<Expr<'g>>;

    fn interval(low: f64, high: f64) -> Interval {
        Interval::new(low, high).unwrap()
    }

    /// A plant of states, time and inputs from t = 0.
    fn plant(right: &Right, start: &[(f64, f64)], inputs: &[(f64, f64)]) -> Problem {
        let g = Graph::new();
        let count = start.len() + 1 + inputs.len();
        let v: Vec<Expr<'_>> = (0..count).map(|i| g.symbol(&format!("v{i}"))).collect();
        let nodes = |all: &[Expr<'_>]| all.iter().map(|e| e.node()).collect::<Vec<Node>>();
        let ranges = |all: &[(f64, f64)]| all.iter().map(|&(a, b)| interval(a, b)).collect();
        Problem {
            right: Tape::new(&g, &nodes(&v), &nodes(&right(&g, &v))).unwrap(),
            from: 0.0,
            start: ranges(start),
            constants: vec![],
            inputs: ranges(inputs),
        }
    }

    /// Every segment holds what the exact solution x(s, t) does, s in [−1, 1] being where the first
    /// state starts; where the tube ends.
    fn followed(problem: &Problem, until: f64, x: &dyn Fn(f64, f64) -> f64) -> Vec<Interval> {
        let mut last = vec![];
        let (end, _) = reach(problem, until, &Budget::default(), &mut |segment| {
            for k in 0..=10 {
                let s = f64::from(k) / 5.0 - 1.0;
                for share in [0.01, 0.3, 0.7, 1.0] {
                    let t = segment.from + share * (segment.to - segment.from);
                    let (value, range) = (x(s, t), segment.range()[0].inflate(1e-12));
                    assert!(range.contains(value), "{t}: {value} is not in {range}");
                }
                let (value, t) = (x(s, segment.to), segment.to);
                for range in [segment.end()[0], segment.end_from(&[s])[0]] {
                    let range = range.inflate(1e-12);
                    assert!(range.contains(value), "{t}: {value} is not in {range}");
                }
            }
            last = segment.end();
            ControlFlow::Continue(())
        });
        assert_eq!(end, End::Reached);
        last
    }

    /// x' = 10x + u: over a whole second the integral makes every remainder larger.
    #[test]
    fn no_remainder_is_taken_that_the_integral_does_not_keep_inside() {
        let right: &Right = &|_, v| vec![10.0 * v[0] + v[2]];
        let problem = plant(right, &[(0.0, 0.0)], &[(-0.1, 0.1)]);
        let stepper = Stepper::new(&problem, 1.0);
        let start = stepper.start(&[0.0]).unwrap();
        for (length, is_proved) in [(1.0, false), (0.2, false), (0.02, true)] {
            let length = Interval::point(length);
            let proposal = stepper.proposed(&start, length);
            let found = stepper.proved(&start, &proposal, length);
            assert_eq!(found.is_some(), is_proved, "{length}");
        }
    }

    /// An unstable state whose remainder is small beside that of another one, which does not grow.
    #[test]
    fn a_remainder_that_grows_beside_a_large_one() {
        let right: &Right = &|_, v| vec![512.0 * (v[0] - 1.0) + v[3], v[4]];
        let inputs = [(-1e-9, 1e-9), (-1.0, 1.0)];
        let problem = plant(right, &[(1.0, 1.0), (0.0, 0.0)], &inputs);
        let grown = |_: f64, t: f64| 1.0 + 1e-9 * (512.0 * t).exp_m1() / 512.0;
        followed(&problem, 0.04, &grown);
    }

    /// x' = 2x above one and −1 below, from both sides of it.
    #[test]
    fn starts_on_both_sides_of_a_jump() {
        let right: &Right = &|g, v| {
            let above = g.constant(1.0).less(v[0]);
            vec![above.select(2.0 * v[0], g.constant(-1.0))]
        };
        let problem = plant(right, &[(0.9, 1.1)], &[]);
        let solution = |s: f64, t: f64| match 1.0 + 0.1 * s {
            x if x > 1.0 => x * (2.0 * t).exp(),
            x => x - t,
        };
        let last = followed(&problem, 0.3, &solution);
        assert!(last[0].width() < 3.0, "{last:?}");
    }

    /// x' = 1 − 2·(x > 0) comes to zero and slides along it.
    #[test]
    fn sliding_along_a_jump() {
        let right: &Right = &|g, v| {
            let above = g.constant(0.0).less(v[0]);
            vec![above.select(g.constant(-1.0), g.constant(1.0))]
        };
        let problem = plant(right, &[(0.1, 0.3)], &[]);
        let slides = |s: f64, t: f64| (0.2 + 0.1 * s - t).max(0.0);
        followed(&problem, 0.5, &slides);
        let rises = |s: f64, t: f64| (0.1 * s - 0.2 + t).min(0.0);
        followed(&plant(right, &[(-0.3, -0.1)], &[]), 0.5, &rises);
    }

    /// Monomials of both kinds of symbols, powers of the remainder's and the rest become a box.
    #[test]
    fn what_is_mixed_at_the_end_of_a_step_counts() {
        let ring = Rc::new(Ring::of_order(1, 1, 2));
        let zonotope = Zonotope::origin(1).through(&[vec![0.0]], &[0.0], &[0.5]);
        for i in 0..ring.len() {
            let mut model = Model::constant(&ring, 0.0);
            model.coefficients[i] = 1.0;
            model.rest = 0.25;
            let set = Segment {
                ring: Rc::clone(&ring),
                from: 0.0,
                to: 1.0,
                flow: vec![model.clone()],
                last: vec![model],
                reach: zonotope.reach(),
                zonotope: zonotope.clone(),
                next: (1.0, 10),
            }
            .into_end();
            let polynomial = set.polynomial[0].norm();
            let beside = set.zonotope.reach()[0];
            let is_of_the_start = ring.part(i) == Part::Start;
            assert_eq!(polynomial > 0.0, is_of_the_start);
            let needed = if is_of_the_start { 0.25 } else { 1.25 };
            assert!(beside >= needed && beside < needed + 1e-12, "{beside}");
        }
    }

    /// Time itself, from a time that is not zero, to the very end.
    #[test]
    fn time_goes_on_from_the_start() {
        let right: &Right = &|_, v| vec![v[1].cos() + 0.0 * v[0]];
        let mut problem = plant(right, &[(-0.1, 0.1)], &[]);
        problem.from = 2.3;
        let solution = |s: f64, t: f64| 0.1 * s + t.sin() - 2.3_f64.sin();
        let last = followed(&problem, 7.7, &solution);
        assert!(last[0].width() < 0.2 + 1e-7, "{last:?}");
    }

    #[test]
    fn limits_end_a_tube() {
        let right: &Right = &|_, v| vec![-v[0]];
        let problem = plant(right, &[(1.0, 2.0)], &[]);
        let budget = Budget::new(Some(std::time::Duration::from_secs(10)), None);
        let forever = reach(&problem, f64::INFINITY, &budget, &mut |_| {
            ControlFlow::Continue(())
        });
        assert_eq!(forever, (End::Stuck, 0.0));
        let budget = Budget::new(None, None);
        budget.cancel();
        let cancelled = reach(&problem, 1.0, &budget, &mut |_| ControlFlow::Continue(()));
        assert_eq!(cancelled, (End::Spent(lynkeus_expr::Spent::Cancelled), 0.0));
    }
}
