//! One step of a tube: proposed in floating point, proved by an inequality of Taylor models.

use std::rc::Rc;

use lynkeus_expr::{Interval, Tape};

use super::algebra::Models;
use super::model::{Model, raised};
use super::ring::{Part, Ring};
use super::zonotope::Zonotope;

/// Powers of τ.
const DEGREE: usize = 10;

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
    next: f64,
}

/// A step that is proved, and what it says about the next.
struct Proved {
    flow: Vec<Model>,
    contraction: f64,
}

impl<'p> Stepper<'p> {
    pub fn new(problem: &'p Problem, until: f64) -> Self {
        let n = problem.start.len();
        let is_wide = |range: &&Interval| !range.is_point();
        let all = problem.start.iter().chain(&problem.constants);
        let ring = Rc::new(Ring::new(all.filter(is_wide).count(), n));
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
            scale: vec![0.0; n],
            set: Set {
                time: problem.from,
                polynomial,
                zonotope: Zonotope::origin(n),
                step: (until - problem.from) / 64.0,
            },
            ring,
        }
    }

    /// Where the tube has come to.
    pub fn time(&self) -> f64 {
        self.set.time
    }

    /// Goes on from the end of a segment.
    pub fn take(&mut self, set: Set) {
        self.set = set;
    }

    /// The longest next part that is proved, if there is one.
    pub fn step(&mut self) -> Option<Segment> {
        let span = self.until - self.problem.from;
        let reach = self.set.zonotope.reach();
        let start = self.start(&reach)?;
        let is_driven = self.inputs.iter().any(|u| u.rest > 0.0);
        let most = CONTRACTION[usize::from(is_driven)];
        let mut step = self.set.step;
        while step >= SHORTEST * span {
            let left = self.until - self.set.time;
            let to = match step >= 0.99 * left {
                true => self.until,
                false => self.set.time + step,
            };
            let length = Interval::point(to) - Interval::point(self.set.time);
            let proposal = self.proposed(&start, length);
            let last = self.last_power(&proposal);
            let longer = (0.9 * (SMALL / last).powf(1.0 / DEGREE as f64)).clamp(0.2, 2.0);
            if last.is_nan() || last > TOLERATED * SMALL {
                step *= if last.is_nan() { 0.2 } else { longer.min(0.9) };
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
                next: step * longer.min(slower),
            });
        }
        None
    }

    /// x₀ = p₀(s) + d ∘ q
    fn start(&self, reach: &[f64]) -> Option<Vec<Model>> {
        let n = reach.len();
        let symbols = self.ring.exponents(0).len();
        let state = |j: usize| {
            let mut model = self.set.polynomial[j].clone();
            let place = self.ring.symbol(symbols - n + j)?;
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
            x.plus(&f.integral(&self.ring).times(&length, &self.ring, DEGREE))
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
        for degree in 0..DEGREE {
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
            let last: f64 = match x.rows(&self.ring) > DEGREE {
                true => x.coefficients[DEGREE * self.ring.len()..]
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

    /// The largest remainder as a share of the largest value so far.
    fn relative(&self, remainder: &[f64]) -> f64 {
        let shares = remainder.iter().zip(&self.scale);
        shares
            .map(|(e, scale)| e / scale.max(TINY))
            .fold(TINY, f64::max)
    }

    /// A remainder that the integral maps into its inside, and what that proves of the step.
    fn proved(&self, start: &[Model], proposal: &[Model], length: Interval) -> Option<Proved> {
        let mapped = |remainder: &[f64]| {
            let with = |(x, &rest): (&Model, &f64)| Model { rest, ..x.clone() };
            let x: Vec<Model> = proposal.iter().zip(remainder).map(with).collect();
            let f = self.right(&x, length, DEGREE - 1);
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
    /// ranges, those of the start first, then of the constants, have these values between −1 and 1.
    pub fn end_from(&self, symbols: &[f64]) -> Vec<Interval> {
        self.last
            .iter()
            .map(|x| x.range_at(&self.ring, symbols))
            .collect()
    }

    /// The set where it ends: what is linear in the symbols of the remainder goes through the
    /// zonotope, what is mixed becomes a box.
    pub(super) fn into_end(self) -> Set {
        let n = self.last.len();
        let mut polynomial = vec![];
        let (mut L, mut around) = (vec![vec![0.0; n]; n], vec![0.0; n]);
        for (k, mut model) in self.last.into_iter().enumerate() {
            let mut mixed = 0.0;
            for (i, c) in model.coefficients.iter_mut().enumerate() {
                match self.ring.part(i) {
                    Part::Start => continue,
                    Part::Remainder(j) => L[k][j] = *c,
                    Part::Mixed => mixed += c.abs(),
                }
                *c = 0.0;
            }
            around[k] = raised(raised(mixed, self.ring.len()) + model.rest, 2);
            model.rest = 0.0;
            polynomial.push(model);
        }
        Set {
            time: self.to,
            polynomial,
            zonotope: self.zonotope.through(&L, &self.reach, &around),
            step: self.next,
        }
    }
}
