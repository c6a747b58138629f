//! How often the error is beyond a bound with a probability, counted over runs with random noise.

use lynkeus::observers::Bounds;
use lynkeus::proof::noise::PROBABILITY;

use super::attack::{Attack, Plan};
use super::integrate::{Flow, Limits, follow};
use super::pair::Pair;
use super::signals::Signal;
use crate::numbers::Numbers;

/// Plans, and runs of each, of which the worst is looked at again with other numbers.
const PLANS: usize = 5;
const RUNS: usize = 120;
/// Runs of the second look, in parts: where no part makes it doubtful the next is left out.
const PARTS: [usize; 3] = [800, 3_000, 12_000];
/// What a true bound is called false with, at most, however many quantities and parts a case has.
const ALARM: f64 = 1e-8;
/// Pieces of a run in which process noise is one number.
const PIECES: usize = 120;
/// Of the integration, and its steps.
const TOLERANCE: f64 = 1e-5;
const STEPS: usize = 3_000;

/// What Gaussian readings do over time: every one of them is normal at every time.
#[derive(Clone, Copy, Debug)]
enum Manner {
    /// one number for all of the run
    Held,
    /// another one in every piece
    Fresh,
    /// with a memory of some pieces
    Slow(f64),
}

/// What the adversary chooses; all else is drawn.
#[derive(Debug)]
struct Choice {
    plan: Plan,
    manner: Manner,
    /// whether one number moves all readings, and to which side each
    together: bool,
    sides: Vec<f64>,
    /// how long, in time constants of the proof
    length: f64,
}

pub struct Counted {
    /// what is wrong with the bound
    pub evidence: Option<String>,
}

/// Counts for one claim; none where the observer has states beside the estimate, or inputs that it differentiates.
pub fn count(
    attack: &mut Attack<'_>,
    bounds: &Bounds,
    rate: f64,
    densities: &[f64],
    numbers: &mut Numbers,
) -> Option<Counted> {
    let n = attack.pair.estimates();
    let is_whole = attack.pair.held.iter().all(Option::is_some) && attack.pair.start.len() == n;
    let limits: Vec<f64> = bounds
        .states
        .iter()
        .map(|b| b.value)
        .chain([bounds.norm])
        .collect();
    if !is_whole || rate <= 0.0 || limits.len() != n + 1 || !attack.guards.is_empty() {
        return None;
    }
    let mut counter = Counter {
        attack,
        limits: &limits,
        rate,
        densities,
    };
    let mut worst: Option<(usize, Choice)> = None;
    let mut ended = 0;
    for _ in 0..PLANS {
        let choice = counter.choice(numbers);
        let (counts, whole) = counter.beyond(&choice, RUNS, numbers);
        ended += whole;
        let most = counts.into_iter().max()?;
        if worst.as_ref().is_none_or(|(count, _)| most > *count) {
            worst = Some((most, choice));
        }
    }
    // runs that leave the box, or need too many steps, say nothing
    if ended < PLANS * RUNS / 2 {
        return None;
    }
    let (most, choice) = worst?;
    let share = 1.0 - PROBABILITY;
    let evidence = match most as f64 > 0.7 * share * RUNS as f64 {
        true => counter.again(&choice, share, numbers),
        false => None,
    };
    Some(Counted { evidence })
}

struct Counter<'a, 'b> {
    attack: &'a mut Attack<'b>,
    /// of each quantity, then of the norm
    limits: &'a [f64],
    rate: f64,
    /// of process noise, by what is estimated
    densities: &'a [f64],
}

impl Counter<'_, '_> {
    fn choice(&self, numbers: &mut Numbers) -> Choice {
        let plan = self.attack.noisy(numbers);
        let manner = match numbers.below(4) {
            0 | 1 => Manner::Held,
            2 => Manner::Slow(numbers.size(2.0, 60.0)),
            _ => Manner::Fresh,
        };
        let sides = plan.noise.iter();
        Choice {
            sides: sides
                .map(|_| if numbers.chance(0.5) { 1.0 } else { -1.0 })
                .collect(),
            together: numbers.chance(0.7),
            length: numbers.size(4.0, 10.0),
            plan,
            manner,
        }
    }

    /// Other runs of a plan, and what is wrong if too many of them are beyond.
    fn again(&mut self, choice: &Choice, share: f64, numbers: &mut Numbers) -> Option<String> {
        let looks = (PARTS.len() * self.limits.len()) as f64;
        let (mut runs, mut counts) = (0, vec![0; self.limits.len()]);
        for part in PARTS {
            let (more, _) = self.beyond(choice, part - runs, numbers);
            counts
                .iter_mut()
                .zip(more)
                .for_each(|(all, more)| *all += more);
            runs = part;
            let (i, &most) = counts.iter().enumerate().max_by_key(|(_, count)| **count)?;
            if tail(runs, most, share) < ALARM / looks {
                return Some(format!(
                    "in probability: {most} of {runs} runs are beyond {:e}, the bound of quantity {i}\n{choice:#?}",
                    self.limits[i]
                ));
            }
            if (most as f64) < 1.15 * share * runs as f64 {
                return None;
            }
        }
        None
    }

    /// In how many of so many runs each quantity is beyond its bound at their end. One that leaves the box, where
    /// nothing is claimed of slopes, counts for none.
    fn beyond(
        &mut self,
        choice: &Choice,
        runs: usize,
        numbers: &mut Numbers,
    ) -> (Vec<usize>, usize) {
        let mut counts = vec![0; self.limits.len()];
        let mut ended = 0;
        for _ in 0..runs {
            let Some(error) = self.run(choice, numbers) else {
                continue;
            };
            ended += 1;
            let norm = error.iter().map(|e| e * e).sum::<f64>().sqrt();
            let sizes = error.iter().map(|e| e.abs()).chain([norm]);
            for ((count, size), limit) in counts.iter_mut().zip(sizes).zip(self.limits) {
                *count += usize::from(size > limit * (1.0 + 1e-6));
            }
        }
        (counts, ended)
    }

    /// The error at the end of a run that starts without one.
    fn run(&mut self, choice: &Choice, numbers: &mut Numbers) -> Option<Vec<f64>> {
        let n = self.attack.pair.estimates();
        let sides = self.attack.sides.clone();
        let place = |(share, side): (&f64, &[f64; 2])| side[0] + share * (side[1] - side[0]);
        let start = choice.plan.plant.iter().zip(&sides).map(place);
        let mut state: Vec<f64> = start.take(self.attack.pair.states).collect();
        let inputs = choice.plan.inputs.iter();
        let u: Vec<f64> = inputs.map(|u| u.value(choice.plan.start, &[])).collect();
        let mut truth = vec![];
        self.attack.pair.truth(&state, &u, &mut truth);
        if truth.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let mut z = vec![0.0; n];
        for (held, x) in self.attack.pair.held.iter().zip(&truth) {
            z[(*held)?] = *x;
        }
        state.extend(z);
        let from = choice.plan.start;
        let piece = choice.length / self.rate / PIECES as f64;
        let states = self.attack.pair.states;
        let width = |side: &[f64; 2]| 1e-2 * (side[1] - side[0]);
        let mut scale: Vec<f64> = sides[..states].iter().map(width).collect();
        scale.resize(states + n, 0.0);
        for (held, side) in self.attack.pair.held.iter().zip(&sides) {
            scale[states + (*held)?] = width(side);
        }
        let mut way = Way {
            is_gaussian: self.attack.gaussian(),
            choice,
            pair: self.attack.pair,
            sides: &sides,
            pushed: vec![0.0; n],
            random: vec![0.0; choice.plan.noise.len()],
            u: vec![0.0; choice.plan.inputs.len()],
            ν: vec![0.0; choice.plan.noise.len()],
            truth: vec![],
            error: vec![],
        };
        let limits = Limits {
            tolerance: TOLERANCE,
            scale: &scale,
            budget: STEPS / PIECES * 4,
        };
        for k in 0..PIECES {
            way.draw(k, numbers);
            for (push, density) in way.pushed.iter_mut().zip(self.densities) {
                *push = (density / piece).sqrt() * numbers.normal();
            }
            let span = [k, k + 1].map(|k| from + k as f64 * piece);
            state = follow(&mut way, &state, span, &limits)?;
        }
        Some(way.error)
    }
}

/// Plant and observer in one piece.
struct Way<'a> {
    choice: &'a Choice,
    pair: &'a mut Pair,
    sides: &'a [[f64; 2]],
    is_gaussian: Vec<f64>,
    /// process noise on what is estimated; only plant states are moved
    pushed: Vec<f64>,
    /// the readings' normal numbers
    random: Vec<f64>,
    u: Vec<f64>,
    ν: Vec<f64>,
    truth: Vec<f64>,
    error: Vec<f64>,
}

impl Way<'_> {
    fn draw(&mut self, k: usize, numbers: &mut Numbers) {
        let keep = match self.choice.manner {
            _ if k == 0 => 0.0,
            Manner::Held => return,
            Manner::Fresh => 0.0,
            Manner::Slow(pieces) => (-1.0 / pieces).exp(),
        };
        let fresh = (1.0 - keep * keep).sqrt();
        let shared = numbers.normal();
        for (own, side) in self.random.iter_mut().zip(&self.choice.sides) {
            let new = match self.choice.together {
                true => shared * side,
                false => numbers.normal(),
            };
            *own = keep * *own + fresh * new;
        }
    }
}

impl Flow for Way<'_> {
    fn slope(&mut self, t: f64, state: &[f64], out: &mut [f64]) {
        let (plan, n) = (&self.choice.plan, self.pair.states);
        for (u, signal) in self.u.iter_mut().zip(&plan.inputs) {
            *u = signal.value(t, &self.error);
        }
        self.pair.truth(&state[..n], &self.u, &mut self.truth);
        self.error.clear();
        for (truth, held) in self.truth.iter().zip(&self.pair.held) {
            self.error
                .push(held.map_or(0.0, |held| state[n + held] - truth));
        }
        for (u, signal) in self.u.iter_mut().zip(&plan.inputs) {
            if matches!(signal, Signal::Feedback { .. }) {
                *u = signal.value(t, &self.error);
            }
        }
        for (i, (ν, signal)) in self.ν.iter_mut().zip(&plan.noise).enumerate() {
            *ν = match self.is_gaussian[i] {
                0.0 => signal.value(t, &self.error),
                deviation => deviation * self.random[i],
            };
        }
        self.pair
            .slope(t, state, &self.u, &plan.inputs, &self.ν, out);
        for (out, push) in out[..n].iter_mut().zip(&self.pushed) {
            *out += push;
        }
    }

    fn next_break(&self, t: f64) -> f64 {
        let signals = self
            .choice
            .plan
            .inputs
            .iter()
            .chain(&self.choice.plan.noise);
        signals.fold(f64::INFINITY, |next, signal| next.min(signal.next_break(t)))
    }

    fn seen(&mut self, _: f64, state: &[f64]) -> bool {
        let n = self.pair.states;
        self.pair.truth(&state[..n], &self.u, &mut self.truth);
        self.error.clear();
        let mut is_inside = true;
        for ((truth, held), side) in self.truth.iter().zip(&self.pair.held).zip(self.sides) {
            let hat = held.map_or(*truth, |held| state[n + held]);
            self.error.push(hat - truth);
            let holds = |x: f64| side[0] <= x && x <= side[1];
            is_inside &= holds(*truth) && holds(hat);
        }
        is_inside
    }
}

/// The probability of so many or more of `runs` where each has the share p.
fn tail(runs: usize, least: usize, p: f64) -> f64 {
    // each term from the one before, the first by logarithms
    let n = runs as f64;
    let factorial = |k: usize| (1..=k).map(|i| (i as f64).ln()).sum::<f64>();
    let ways = factorial(runs) - factorial(least) - factorial(runs - least);
    let mut term = (ways + least as f64 * p.ln() + (n - least as f64) * (-p).ln_1p()).exp();
    let mut sum = 0.0;
    for k in least..=runs {
        sum += term;
        term *= (n - k as f64) / (k as f64 + 1.0) * p / (1.0 - p);
        if term < 1e-18 * sum {
            break;
        }
    }
    f64::min(sum, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_of_a_binomial_law() {
        let near = |found: f64, exact: f64| (found / exact - 1.0).abs() < 1e-9;
        assert!(near(tail(3, 2, 0.5), 0.5));
        assert!(near(tail(4, 0, 0.3), 1.0));
        // 1 − 0.99^100 − 100·0.01·0.99^99
        let exact = 1.0 - 0.99_f64.powi(100) - 0.99_f64.powi(99);
        assert!(near(tail(100, 2, 0.01), exact));
        assert!(tail(12_000, 120, 0.01) > 0.4 && tail(12_000, 200, 0.01) < 1e-10);
    }
}
