//! The linearised problem of a window within its bounds: a convex quadratic one.
//!
//! First by sets: bounds that are exceeded are met, those that pull inward are let go, and a set that
//! does not change is that of the minimum (Hintermüller, Ito, Kunisch, *SIAM Journal on Optimization*
//! 13 (2003) 865–888). It takes few passes, and may go round in circles. Where it does, an interior
//! point method (S. Mehrotra, *SIAM Journal on Optimization* 2 (1992) 575–601) comes as close to the
//! minimum as one likes, whatever the bounds: each of its steps is a smoother in which every bounded
//! state is drawn to a value with some variance. Sets then go on from what it ends with.

use std::borrow::Cow;
use std::sync::Arc;

use crate::filter::belief::{Belief, confine};
use crate::filter::profile::Profile;
use crate::filter::root::{Root, dot};
use crate::filter::smoother::{Adjoint, Correction, Step};
use crate::filter::transition::Stage;
use crate::noise::Limits;

/// Most changes of a set before it is taken to go round.
const CHANGES: usize = 12;

/// Most steps of the interior point method.
const STEPS: usize = 80;

/// The cost is within this of the least one.
const GAP: f64 = 1e-10;

/// Share of the way to the nearest bound that a step takes.
const SHORT: f64 = 0.995;

/// The problem.
pub(crate) struct Problem<'a> {
    pub prior: Cow<'a, Belief>,
    pub bounds: &'a [Limits],
    pub rows: Vec<Linear>,
    /// without bounds
    pub free: Vec<Pass>,
}

/// What solves it.
pub(crate) struct Solution {
    /// the states, row by row
    pub x: Vec<Vec<f64>>,
    /// the bounds that they meet
    pub met: Vec<Vec<Pin>>,
    /// the filter with these for exact readings; none where there are none
    pub passes: Option<Vec<Pass>>,
    /// whether its cost is the least one
    pub is_least: bool,
}

/// One bound of one state of one row, in units of the state's deviation.
struct Side {
    row: usize,
    state: usize,
    bound: f64,
    /// 1 of a lower bound, −1 of an upper one
    sign: f64,
    unit: f64,
    /// how far the state is from it
    room: f64,
    force: f64,
    /// what the step in view would change of the two
    room_change: f64,
    force_change: f64,
}

impl Problem<'_> {
    /// The least cost, from a first guess at the bounds that are met.
    pub fn solve(&self, met: Vec<Vec<Pin>>) -> Solution {
        let (free, _) = backward(&self.free);
        if self.are_inside(&free) {
            return Solution {
                x: free,
                met: vec![vec![]; self.rows.len()],
                passes: None,
                is_least: true,
            };
        }
        if let Some(found) = self.by_sets(met) {
            return found;
        }
        let (x, met, is_least) = self.by_interior_point(free);
        if let Some(found) = self.by_sets(met.clone()) {
            return found;
        }
        Solution {
            x,
            passes: Some(self.forward(&met)),
            met,
            is_least,
        }
    }

    /// The Kalman filter, with pins.
    pub fn forward(&self, pins: &[Vec<Pin>]) -> Vec<Pass> {
        let mut passes: Vec<Pass> = vec![];
        for ((linear, free), pins) in self.rows.iter().zip(&self.free).zip(pins) {
            let before = carried(linear.stage.as_ref(), &self.prior, passes.last());
            let free = Some(&free.before.root);
            passes.push(corrected(&linear.seen, free, pins, before));
        }
        passes
    }

    fn are_inside(&self, x: &[Vec<f64>]) -> bool {
        let mut all = x.iter().flat_map(|row| row.iter().zip(self.bounds));
        all.all(|(x, bounds)| exceeded(*x, *bounds).is_none())
    }

    /// By sets; none where they go round, or do not hold the states.
    fn by_sets(&self, mut met: Vec<Vec<Pin>>) -> Option<Solution> {
        for _ in 0..CHANGES {
            let passes = self.forward(&met);
            let (x, pushes) = backward(&passes);
            if !self.change(&mut met, &x, &pushes) {
                let holds = self.are_inside(&x);
                return holds.then_some(Solution {
                    x,
                    met,
                    passes: Some(passes),
                    is_least: true,
                });
            }
        }
        None
    }

    /// Limits that are exceeded are met from now on; those that pull inward are let go.
    fn change(&self, met: &mut [Vec<Pin>], x: &[Vec<f64>], pushes: &[Vec<f64>]) -> bool {
        let mut changed = false;
        for ((met, x), pushes) in met.iter_mut().zip(x).zip(pushes) {
            let before = met.len();
            let mut pushes = pushes.iter();
            met.retain(|pin| {
                let force = pushes.next().copied().unwrap_or(0.0);
                let Limits { low, high } = self.bounds[pin.state];
                let outward = if pin.value == low { -force } else { force };
                // a single value pushes either way
                low == high || outward <= 0.0
            });
            changed |= met.len() != before;
            for (state, (x, bounds)) in x.iter().zip(self.bounds).enumerate() {
                let Some(bound) = exceeded(*x, *bounds) else {
                    continue;
                };
                if !met.iter().any(|m| m.state == state) {
                    met.push(Pin::at(state, bound));
                    changed = true;
                }
            }
        }
        changed
    }

    /// By an interior point method: the states, the bounds that they meet, and whether the cost is
    /// the least one.
    fn by_interior_point(&self, mut x: Vec<Vec<f64>>) -> (Vec<Vec<f64>>, Vec<Vec<Pin>>, bool) {
        let mut sides = self.sides(&mut x);
        let mut off = 1.0;
        let count = sides.len().max(1) as f64;
        let mut is_least = false;
        for _ in 0..STEPS {
            let gap: f64 = sides.iter().map(|s| s.room * s.force).sum();
            is_least = gap <= GAP && off <= GAP;
            if is_least || !gap.is_finite() {
                break;
            }
            let towards = self.step(&x, &sides, |_| 0.0);
            sides.iter_mut().for_each(|s| s.aim(&x, &towards, 0.0));
            let share = longest(&sides);
            let left =
                |s: &Side| (s.room + share * s.room_change) * (s.force + share * s.force_change);
            let left: f64 = sides.iter().map(left).sum();
            let centre = (left / gap).clamp(0.0, 1.0).powi(3) * gap / count;
            let product = |s: &Side| centre - s.room_change * s.force_change;
            let towards = self.step(&x, &sides, product);
            for side in &mut sides {
                side.aim(&x, &towards, product(side));
            }
            let share = (SHORT * longest(&sides)).min(1.0);
            off *= 1.0 - share;
            for (x, towards) in x.iter_mut().flatten().zip(towards.iter().flatten()) {
                *x += share * (towards - *x);
            }
            for side in &mut sides {
                side.room += share * side.room_change;
                side.force += share * side.force_change;
            }
        }
        // what does not move may be outside
        is_least &= self.are_inside(&x);
        let mut met = self.single();
        for side in sides.iter().filter(|s| s.force > s.room) {
            met[side.row].push(Pin::at(side.state, side.bound));
            x[side.row][side.state] = side.bound;
        }
        for row in &mut x {
            confine(row, self.bounds);
        }
        (x, met, is_least)
    }

    /// The bounds of states that have one value alone.
    fn single(&self) -> Vec<Vec<Pin>> {
        let states = self.bounds.iter().enumerate();
        let single = states.filter(|(_, b)| b.low == b.high);
        let met = single.map(|(state, b)| Pin::at(state, b.low));
        vec![met.collect(); self.rows.len()]
    }

    /// All sides, each with room; the states are moved inside.
    fn sides(&self, x: &mut [Vec<f64>]) -> Vec<Side> {
        let mut sides = vec![];
        for (row, x) in x.iter_mut().enumerate() {
            for (state, (x, Limits { low, high })) in x.iter_mut().zip(self.bounds).enumerate() {
                let unit = self.free[row].before.root.deviation(state);
                // what does not move needs no bounds
                if low == high || unit <= 0.0 {
                    continue;
                }
                let margin = (0.1 * (high - low)).min(unit);
                *x = x.max(low + margin).min(high - margin);
                for (bound, sign) in [(*low, 1.0), (*high, -1.0)] {
                    if bound.is_finite() {
                        let room = sign * (*x - bound) / unit;
                        sides.push(Side {
                            row,
                            state,
                            bound,
                            sign,
                            unit,
                            room,
                            force: 1.0 / room,
                            room_change: 0.0,
                            force_change: 0.0,
                        });
                    }
                }
            }
        }
        sides
    }

    /// The states of one Newton step, after which room times force would be `product` at every side.
    fn step(
        &self,
        x: &[Vec<f64>],
        sides: &[Side],
        product: impl Fn(&Side) -> f64,
    ) -> Vec<Vec<f64>> {
        let mut all = self.single();
        // both sides of a state draw at it together
        for mine in sides.chunk_by(|a, b| (a.row, a.state) == (b.row, b.state)) {
            let (mut pull, mut weight, first) = (0.0, 0.0, &mine[0]);
            for side in mine {
                weight += side.force / side.room;
                pull += side.sign * product(side) / side.room;
            }
            all[first.row].push(Pin {
                state: first.state,
                value: x[first.row][first.state] + first.unit * pull / weight,
                variance: first.unit * first.unit / weight,
            });
        }
        backward(&self.forward(&all)).0
    }
}

impl Side {
    /// What a step to the states `towards` changes, after which its room times its force is `product`.
    fn aim(&mut self, x: &[Vec<f64>], towards: &[Vec<f64>], product: f64) {
        let (row, state) = (self.row, self.state);
        let room = self.sign * (towards[row][state] - x[row][state]) / self.unit;
        let force = (product - self.force * room) / self.room;
        (self.room_change, self.force_change) = (room, force - self.force);
    }
}

/// The share of a step up to which all room and forces stay positive; 1 at most.
fn longest(sides: &[Side]) -> f64 {
    let mut share = 1.0_f64;
    for s in sides {
        for (value, change) in [(s.room, s.room_change), (s.force, s.force_change)] {
            if change < 0.0 {
                share = share.min(-value / change);
            }
        }
    }
    share
}

/// The bound that a state is beyond, by more than rounding.
fn exceeded(x: f64, Limits { low, high }: Limits) -> Option<f64> {
    let slack = 1e-9 * (high - low).min(x.abs().max(1e-3));
    match (x < low - slack, x > high + slack) {
        (true, _) => Some(low),
        (_, true) => Some(high),
        _ => None,
    }
}

/// What is left of a state's deviation where the window holds it by other means: another reading of it
/// says nothing, and its gain would be rounding.
const HELD: f64 = 1e-9;

/// A row of the linearised problem.
pub(crate) struct Linear {
    /// the way from the row before; none to the first, and to one at the same instant
    pub stage: Option<Arc<Stage>>,
    pub seen: Vec<Seen>,
}

/// A reading: cᵀx = value, with noise.
pub(crate) struct Seen {
    pub slopes: Vec<f64>,
    pub value: f64,
    pub variance: f64,
}

/// A state that is drawn to a value.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pin {
    pub state: usize,
    pub value: f64,
    /// 0 where it is held there
    pub variance: f64,
}

impl Pin {
    /// Held at a bound.
    pub fn at(state: usize, bound: f64) -> Self {
        Self {
            state,
            value: bound,
            variance: 0.0,
        }
    }
}

/// One row of a forward pass.
pub(crate) struct Pass {
    pub before: Belief,
    pub after: Belief,
    /// the root before the pins, where there are any
    pub by_readings: Option<Root>,
    /// Φ from the row before; none of the first
    pub transition: Option<Arc<Profile>>,
    pub readings: Vec<Correction>,
    /// what each pin did; none of a state that is held by other means
    pub pins: Vec<Option<Correction>>,
}

impl Pass {
    /// The state with its pins, the root by the readings alone.
    pub fn unpinned(&self) -> Belief {
        let root = self.by_readings.as_ref().unwrap_or(&self.after.root);
        Belief {
            x: self.after.x.clone(),
            root: root.clone(),
        }
    }

    /// What a smoother keeps of a row that stays in the window: the bounds that it meets are
    /// exact readings. It is told in planes that touch there, where there are any.
    pub fn kept(self, touched: Option<Vec<f64>>) -> Step {
        let pins = self.pins.into_iter().flatten();
        Step {
            transition: self.transition.map(Arc::unwrap_or_clone),
            touched,
            belief: self.after,
            corrections: self.readings.into_iter().chain(pins).collect(),
        }
    }

    /// The same of a row that leaves the window: the bounds that it met have moved the estimate,
    /// and told no more than that.
    pub fn leaving(&self, touched: Option<Vec<f64>>) -> Step {
        Step {
            transition: self.transition.as_deref().cloned(),
            touched,
            belief: self.unpinned(),
            corrections: self.readings.clone(),
        }
    }
}

/// What is believed at a row before its readings, and Φ. No stage leads over to the first row, where it is
/// the prior, and to one at the instant of the row before.
pub(crate) fn carried(
    stage: Option<&Arc<Stage>>,
    prior: &Belief,
    last: Option<&Pass>,
) -> (Belief, Option<Arc<Profile>>) {
    match (stage, last) {
        (Some(stage), Some(last)) => {
            let transition = Arc::clone(&stage.transition);
            (stage.carry(&last.after), Some(transition))
        }
        (None, Some(last)) => {
            let after = last.after.clone();
            let identity = Profile::identity(after.x.len());
            (after, Some(Arc::new(identity)))
        }
        (_, None) => (prior.clone(), None),
    }
}

/// A row by its readings, then by its pins, if any; `free` is the root before it without bounds.
pub(crate) fn corrected(
    seen: &[Seen],
    free: Option<&Root>,
    pins: &[Pin],
    (before, transition): (Belief, Option<Arc<Profile>>),
) -> Pass {
    let mut after = before.clone();
    let mut readings = Vec::with_capacity(seen.len());
    for s in seen {
        readings.extend(take(&mut after, &s.slopes, s.value, s.variance, 0.0));
    }
    let by_readings = (!pins.is_empty()).then(|| after.root.clone());
    let mut at = vec![];
    for pin in pins {
        let mut c = vec![0.0; after.x.len()];
        c[pin.state] = 1.0;
        let least = free.map_or(0.0, |root| HELD * root.deviation(pin.state));
        at.push(take(&mut after, &c, pin.value, pin.variance, least));
    }
    Pass {
        before,
        after,
        by_readings,
        transition,
        readings,
        pins: at,
    }
}

/// Corrects by cᵀx = y with noise of variance r; not where what is predicted has a deviation of no more
/// than `least`.
fn take(belief: &mut Belief, c: &[f64], y: f64, r: f64, least: f64) -> Option<Correction> {
    let mut projected = vec![0.0; c.len()];
    belief.root.transposed_times(c, &mut projected);
    let own = dot(&projected, &projected);
    if own <= least * least && least > 0.0 {
        return None;
    }
    let innovation = y - dot(c, &belief.x);
    let mut gain = vec![];
    if !belief.take(&projected, innovation, r, &mut gain) {
        return None;
    }
    Some(Correction::single(c.to_vec(), innovation, own + r, gain))
}

/// The states of the window's rows given all of it, and how hard each pin of a row pushes its state upward.
pub(crate) fn backward(passes: &[Pass]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let n = passes.first().map_or(0, |p| p.after.x.len());
    let mut adjoint = Adjoint::nothing(n, false);
    let (mut states, mut pushes) = (vec![vec![]; passes.len()], vec![vec![]; passes.len()]);
    for (row, pass) in passes.iter().enumerate().rev() {
        let shift = pass.after.root.covariance_times(&adjoint.vector);
        let x = pass.after.x.iter().zip(&shift).map(|(x, s)| x - s);
        states[row] = x.collect();
        pushes[row] = vec![0.0; pass.pins.len()];
        for (push, pin) in pushes[row].iter_mut().zip(&pass.pins).rev() {
            if let Some(correction) = pin {
                *push = adjoint.over_vector(correction).iter().sum();
            }
        }
        for reading in pass.readings.iter().rev() {
            adjoint.over_vector(reading);
        }
        if let Some(transition) = &pass.transition {
            adjoint.vector_through(transition);
        }
    }
    (states, pushes)
}
