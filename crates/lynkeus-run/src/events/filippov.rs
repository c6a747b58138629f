//! State events: a right-hand side on known sides of the surfaces on which it jumps with the state.
//!
//! Between two events the right-hand side is that of one side, held. Where a step ends on
//! another side, the instant of the crossing is located, and what follows decided by the
//! velocities on both sides (A. F. Filippov, *Differential Equations with Discontinuous
//! Righthand Sides*, § 4): if the other side carries the state on, it is crossed; if both push
//! the state back, it slides along the surface with the combination of both right-hand sides
//! that keeps it there, until one of them ceases to push. Without that an integrator creeps
//! from one side to the other in steps as short as time resolves. What is on a surface and stays
//! there by the equations as they are written (an input that is held at a threshold) is on
//! neither side: operations have the value then that they have at zero. A `floor` jumps on two
//! surfaces that move along with it: the next even integer and the next odd one.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::guards::{Ahead, Guard, Guards, Poly, SHORTEST};
use super::memory::Memory;
use super::occur::occur;
use super::when::{Cause, Clauses, Seen};
use crate::method::{are_finite, resolution};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Result, Slopes};

/// A surface counts as reached this close to it, against the largest value of its function.
const REACHED: f64 = 1e-10;

/// What a clause watches has passed its surface so far beyond it.
const ROUNDED: f64 = 1e-16;

/// A surface passed so often in a run is named where the steps run out.
const OFTEN: usize = 1000;

/// The argument of a `floor` may be so far beyond the whole numbers that it was between.
const AROUND: f64 = 1e-6;

/// How much faster than at all its stages a state may move somewhere in a step.
const FASTER: f64 = 1.5;

/// One operation that jumps on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jump {
    surface: usize,
    /// its values where the function of the surface is negative, zero and positive; none for a
    /// `floor`, whose value is held
    values: Option<[f64; 3]>,
}

impl Jump {
    /// On a surface whose function may have the other sign than what decides the operation, with
    /// these values below, on and above it.
    pub fn new((surface, is_reversed): (usize, bool), mut values: Option<[f64; 3]>) -> Self {
        if let Some(values) = values.as_mut().filter(|_| is_reversed) {
            values.reverse();
        }
        Self { surface, values }
    }

    /// The same where its surfaces come after so many others.
    pub fn after(self, surfaces: usize) -> Self {
        let surface = self.surface + surfaces;
        Self { surface, ..self }
    }

    /// Its value on the given sides of the surfaces; of a `floor` its value stands for the side.
    pub fn value(&self, sides: &[f64]) -> f64 {
        let side = sides[self.surface];
        match self.values {
            None => side,
            Some([below, ..]) if side < 0.0 => below,
            Some([.., above]) if side > 0.0 => above,
            Some([_, on, _]) => on,
        }
    }
}

/// What is remembered of the surfaces from one interval to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sides {
    /// −1 or 1; 0 on a surface on which the state stays
    sides: Vec<f64>,
    /// the values of their functions on them: 0, but for a `floor`
    levels: Vec<f64>,
    sliding: Vec<bool>,
    /// the largest values seen of their functions
    largest: Vec<f64>,
    /// how often they were reached
    passes: Vec<usize>,
    /// of clauses
    pub memory: Memory,
    /// what is read beside time and states, each with its speed: room for it
    beside: Vec<[f64; 2]>,
    /// what the guards read over a step, the middle and how far it may be from there: room for it
    boxes: Vec<[f64; 2]>,
}

impl Sides {
    /// Room for so many surfaces.
    fn fit(&mut self, count: usize) {
        self.sides.resize(count, 1.0);
        self.levels.resize(count, 0.0);
        self.sliding.resize(count, false);
        self.largest.resize(count, 0.0);
        self.passes.resize(count, 0);
    }
}

impl Persist for Sides {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        // none before the first interval
        let count = walk.length(self.sides.len())?;
        self.fit(count);
        if count == 0 {
            return Ok(());
        }
        walk.numbers(&mut self.sides)?;
        walk.numbers(&mut self.levels)?;
        walk.numbers(&mut self.largest)?;
        self.sliding.iter_mut().try_for_each(|s| walk.flag(s))?;
        self.passes.iter_mut().try_for_each(|p| walk.count(p))
    }
}

/// The solution between two points, as the step found it.
pub(crate) struct Span<'a> {
    /// time and state at the start
    pub from: (f64, &'a [f64]),
    pub step: f64,
    /// the state at the end
    pub to: &'a [f64],
}

/// A system on known sides of its surfaces.
pub(crate) struct Filippov<'a> {
    inner: &'a mut dyn Dynamics,
    at: &'a mut Sides,
    /// length of the interval
    length: f64,
    /// parts of the other side's right-hand side, of each surface that is slid along
    parts: Vec<f64>,
    values: Vec<f64>,
    /// the first of the two surfaces of each `floor`
    pairs: Vec<usize>,
    /// what is watched over a step
    guards: Option<Arc<Guards>>,
    /// how many surfaces f jumps on; those that clauses watch follow
    plain: usize,
    /// relations of clauses that the last step has changed
    flipped: Vec<usize>,
    seen: Vec<Seen>,
}

impl<'a> Filippov<'a> {
    /// At the start of an interval of the given length; decides on which sides it starts.
    pub fn new(
        inner: &'a mut dyn Dynamics,
        at: &'a mut Sides,
        (t, x): (f64, &[f64]),
        length: f64,
    ) -> Self {
        let guards = inner.events().and_then(|events| events.guards());
        let surfaces = guards.iter().flat_map(|guards| &guards.surfaces);
        let counting = surfaces.clone().enumerate().filter(|(_, s)| s.counts);
        let plain = surfaces.clone().filter(|s| !s.is_watched).count();
        let count = surfaces.count();
        at.fit(count);
        let mut system = Self {
            plain,
            flipped: vec![],
            seen: vec![],
            pairs: counting.map(|(i, _)| i).step_by(2).collect(),
            guards,
            inner,
            at,
            length,
            parts: vec![0.0; count],
            values: vec![0.0; count],
        };
        if count > 0 {
            system.start(t, x);
        }
        system
    }

    /// Whether nothing jumps with the state.
    pub fn is_plain(&self) -> bool {
        self.values.is_empty()
    }

    /// What a `floor` is on the sides of its two surfaces.
    fn floor(&self, first: usize) -> f64 {
        let passed = |i: usize| f64::from(u8::from(self.at.sides[i] >= 0.0));
        let low = self.at.levels[first].min(self.at.levels[first + 1]);
        low - 1.0 + passed(first) + passed(first + 1)
    }

    /// Puts both surfaces of a `floor` around the value of its argument.
    fn surround(&mut self, first: usize, value: f64) {
        let low = value.floor();
        let is_even = 0.5 * low == (0.5 * low).floor();
        let (even, odd) = match is_even {
            true => (low, low + 1.0),
            false => (low + 1.0, low),
        };
        for (i, level) in [(first, even), (first + 1, odd)] {
            self.at.levels[i] = level;
            self.at.sides[i] = if level == low { 1.0 } else { -1.0 };
        }
    }

    /// Carries the surfaces of a `floor` along where both were passed.
    fn carry(&mut self) {
        for first in self.pairs.clone() {
            let (levels, sides) = (&mut self.at.levels, &mut self.at.sides);
            let (low, high) = match levels[first] < levels[first + 1] {
                true => (first, first + 1),
                false => (first + 1, first),
            };
            if sides[high] > 0.0 && !self.at.sliding[low] {
                (levels[low], sides[low]) = (levels[low] + 2.0, -1.0);
            } else if sides[low] < 0.0 && !self.at.sliding[high] {
                (levels[high], sides[high]) = (levels[high] - 2.0, 1.0);
            }
        }
    }

    /// Tells the system on which sides it is.
    fn hold(&mut self) {
        if self.pairs.is_empty() {
            return tell(self.inner, Some(&self.at.sides));
        }
        let mut sides = self.at.sides.clone();
        for &first in &self.pairs {
            sides[first..first + 2].fill(self.floor(first));
        }
        tell(self.inner, Some(&sides));
    }

    /// The functions of the surfaces, against what they are there.
    fn read(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.parts.len()];
        if let Some(events) = self.inner.events() {
            events.indicators(t, x, &mut values);
        }
        for (value, level) in values.iter_mut().zip(&self.at.levels) {
            *value -= level;
        }
        values
    }

    /// Reads the functions of the surfaces, and remembers how large they were.
    fn look(&mut self, t: f64, x: &[f64]) {
        self.values = self.read(t, x);
        for (largest, value) in self.at.largest.iter_mut().zip(&self.values) {
            *largest = largest.max(value.abs());
        }
    }

    /// How far each surface is from changing what holds; negative beyond.
    pub fn margins(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        if self.at.sliding.contains(&true) {
            let mut dx = vec![0.0; x.len()];
            self.derivatives(t, x, &mut dx);
        }
        self.look(t, x);
        let margin = |(i, value): (usize, &f64)| match self.at.sliding[i] {
            true => self.parts[i].min(1.0 - self.parts[i]),
            false if self.at.sides[i] == 0.0 => -value.abs(),
            false => self.at.sides[i] * value,
        };
        self.values.iter().enumerate().map(margin).collect()
    }

    /// f on the sides that are held. A branch need have no value beyond its side: as the state says,
    /// then.
    fn on_sides(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.inner.derivatives(t, x, dx);
        if !self.is_plain() && !are_finite(dx) {
            tell(self.inner, None);
            self.inner.derivatives(t, x, dx);
            self.hold();
        }
    }

    /// The surface that was reached most often, where that is often.
    pub fn busiest(&self) -> Option<String> {
        let passes = self.at.passes.iter().enumerate();
        let (i, count) = passes.max_by_key(|(_, count)| **count)?;
        let name = &self.guards.as_ref()?.surfaces.get(i)?.name;
        (*count >= OFTEN).then(|| format!("{name} was passed {count} times; "))
    }

    /// Decides on which sides an interval starts.
    fn start(&mut self, t: f64, x: &[f64]) {
        self.encounter(t, x);
        self.align(t, x, &[]);
        let reached = self.reached(t, x);
        let at_hand: Vec<usize> = (0..self.plain).filter(|&i| reached[i]).collect();
        for &i in &at_hand {
            self.decide(i, t, x);
        }
        self.align(t, x, &at_hand);
        self.settle(t, x, &at_hand);
    }

    /// Decides on what has come to lie on a surface exactly, as a whole number does that another one makes,
    /// and carries the surfaces of each `floor` along.
    fn settle(&mut self, t: f64, x: &[f64], at_hand: &[usize]) {
        let mut done = at_hand.to_vec();
        for _ in 0..self.values.len() {
            self.look(t, x);
            let is_new = |i: &usize| {
                let is_held = self.at.sides[*i] != 0.0 && !self.at.sliding[*i];
                is_held && self.values[*i] == 0.0 && !done.contains(i)
            };
            let Some(i) = (0..self.plain).find(is_new) else {
                break;
            };
            self.decide(i, t, x);
            done.push(i);
            self.align(t, x, &done);
        }
        self.carry();
        self.hold();
        self.see(t, x);
    }

    /// Reads which relations of clauses hold: the values themselves tell.
    fn see(&mut self, t: f64, x: &[f64]) {
        if self.plain == self.values.len() {
            return;
        }
        self.inner.watch(t, x, &mut self.seen);
        let sides = self.at.sides[self.plain..].iter_mut();
        for (relation, (side, seen)) in sides.zip(&self.seen).enumerate() {
            let now = if seen.holds { 1.0 } else { -1.0 };
            if *side != now {
                self.flipped.push(relation);
            }
            *side = now;
        }
    }

    /// Lets clauses take effect that are due at the start of an interval.
    pub fn begin(&mut self, t: f64, x: &mut [f64]) -> Result<()> {
        self.flipped.clear();
        if self.inner.clauses().is_some() {
            self.event(t, x)?;
        }
        Ok(())
    }

    /// Keeps for the next interval which relations of clauses are others at the end of this one: on a surface, no step
    /// has gone beyond it.
    pub fn end(&mut self, t: f64, x: &[f64]) {
        self.flipped.clear();
        self.see(t, x);
        let flipped = std::mem::take(&mut self.flipped);
        self.at.memory.keep(&flipped, &self.seen);
    }

    /// Whether relations of clauses have changed, or something has to be looked after.
    pub fn has_event(&self) -> bool {
        !self.flipped.is_empty() || self.at.memory.suspects()
    }

    /// Lets clauses take effect whose relations have changed: whether the state has jumped.
    pub fn event(&mut self, t: f64, x: &mut [f64]) -> Result<bool> {
        let flipped = std::mem::take(&mut self.flipped);
        let mut memory = std::mem::take(&mut self.at.memory);
        let done = self.event_with(&mut memory, t, x, &flipped);
        self.at.memory = memory;
        self.flipped.clear();
        done
    }

    fn event_with(
        &mut self,
        memory: &mut Memory,
        t: f64,
        x: &mut [f64],
        flipped: &[usize],
    ) -> Result<bool> {
        let length = self.length;
        let jumped = occur(self, memory, (t, length), x, flipped)?;
        if let (false, true, Some(clauses)) = (jumped, memory.suspects(), self.inner.clauses()) {
            self.inner.watch(t, x, &mut self.seen);
            let largest = |relation: usize| self.at.largest[self.plain + relation];
            memory.check(&clauses, t, &self.seen, largest)?;
        }
        Ok(jumped)
    }

    /// Puts the surfaces of each `floor` around where the state is: one may be within another.
    fn encounter(&mut self, t: f64, x: &[f64]) {
        for first in self.pairs.clone() {
            self.hold();
            self.look(t, x);
            let value = self.values[first] + self.at.levels[first];
            let [a, b] = [first, first + 1].map(|i| self.at.levels[i]);
            let around = a.min(b) - AROUND..=a.max(b) + AROUND;
            if a == b || !around.contains(&value) {
                self.surround(first, value);
            }
        }
    }

    /// Goes on where margins have become negative: across, along, or off the surface.
    pub fn pass(&mut self, t: f64, x: &[f64], margins: &[f64]) {
        let at_hand: Vec<usize> = (0..self.plain).filter(|&i| margins[i] < 0.0).collect();
        self.look(t, x);
        for &i in &at_hand {
            self.at.passes[i] += 1;
            match self.at.sliding[i] {
                true => {
                    self.at.sliding[i] = false;
                    if self.parts[i] > 0.5 {
                        self.at.sides[i] = -self.at.sides[i];
                    }
                }
                false => self.decide(i, t, x),
            }
        }
        self.align(t, x, &at_hand);
        self.settle(t, x, &at_hand);
    }

    /// Takes every surface but those at hand by the sign of its function, where it is not
    /// reached. A function may jump with the sides of other surfaces: again, then.
    fn align(&mut self, t: f64, x: &[f64], at_hand: &[usize]) {
        self.hold();
        let count = self.plain;
        if at_hand.len() == count {
            return;
        }
        for _ in 0..count {
            self.look(t, x);
            let off = |i: &usize| !at_hand.contains(i) && self.is_off(*i);
            let off: Vec<usize> = (0..count).filter(off).collect();
            if off.is_empty() {
                return;
            }
            let reached = self.reached(t, x);
            let mut changed = false;
            for i in off.into_iter().filter(|&i| !reached[i]) {
                self.at.sliding[i] = false;
                let mut pairs = self.pairs.iter().copied();
                match pairs.find(|&first| i == first || i == first + 1) {
                    Some(first) => {
                        let value = self.values[i] + self.at.levels[i];
                        self.surround(first, value);
                    }
                    None => self.at.sides[i] = side_of(self.values[i]),
                }
                changed = true;
            }
            if !changed {
                return;
            }
            self.hold();
        }
    }

    /// Whether the sign of a function says another side than the one that is held.
    fn is_off(&self, i: usize) -> bool {
        let value = self.values[i];
        value != 0.0 && (self.at.sliding[i] || self.at.sides[i] != side_of(value))
    }

    /// Which surfaces are so close that velocities decide.
    fn reached(&mut self, t: f64, x: &[f64]) -> Vec<bool> {
        self.look(t, x);
        let speeds = self.speeds_here(t, x);
        let functions = self.values.iter().zip(&self.at.largest).zip(&speeds);
        let is_reached = |((value, largest), speed): ((&f64, &f64), &f64)| {
            value.abs() <= REACHED * largest.max(speed.abs() * self.length)
        };
        functions.map(is_reached).collect()
    }

    /// Which side of a surface that is reached carries the state away from it: that one
    /// holds; or neither, and the state slides. On neither side is what stays exactly there.
    fn decide(&mut self, i: usize, t: f64, x: &[f64]) {
        let value = self.values[i];
        let (sides, sliding) = (self.at.sides.clone(), self.at.sliding.clone());
        let mut speed_on = |side: f64| {
            self.at.sides.copy_from_slice(&sides);
            self.at.sliding.copy_from_slice(&sliding);
            self.at.sides[i] = side;
            self.at.sliding[i] = false;
            self.align(t, x, &[i]);
            self.speeds_here(t, x)[i]
        };
        // exactly on the surface the equations say where it goes, if both sides let it go
        let tends = if value == 0.0 { speed_on(0.0) } else { value };
        if tends == 0.0 {
            return;
        }
        let first = side_of(tends);
        // a side that does not push back is not left for the one that was
        if first * speed_on(first) >= 0.0 || -first * speed_on(-first) > 0.0 {
            return;
        }
        self.at.sliding[i] = true;
        self.hold();
    }

    /// Whether there is nothing to watch.
    pub fn is_unwatched(&self) -> bool {
        self.guards.is_none()
    }

    /// A first look: whether a step that nowhere was faster than `fastest` may have met a bend, or a
    /// surface that is left by passing it.
    pub fn is_near(&mut self, span: &Span<'_>, fastest: impl Fn(usize) -> f64) -> bool {
        let Some(guards) = self.guards.clone() else {
            return false;
        };
        let (t, h) = (span.from.0, span.step);
        self.look_beside(t);
        let half = 0.5 * h;
        let state = |k: usize| {
            let (a, b) = (span.from.1[k], span.to[k]);
            let reach = (FASTER * half * fastest(k)).max(0.5 * (b - a).abs());
            [0.5 * (a + b), reach]
        };
        let beside = |[value, speed]: [f64; 2]| [value + speed * half, (speed * half).abs()];
        self.at.boxes.clear();
        let boxes = guards.inputs([t + half, half], state, &self.at.beside, beside);
        self.at.boxes.extend(boxes);
        let boxes = &self.at.boxes;
        let passes = |(i, guard): (usize, &Guard)| {
            let (side, level) = (self.at.sides[i], self.at.levels[i]);
            let lowest = guard.over(boxes).map(|[low, high]| match side > 0.0 {
                true => low - level,
                false => level - high,
            });
            lowest.is_some_and(|lowest| lowest.is_nan() || lowest < 0.0)
        };
        let bends = |guard: &Guard| {
            let over = guard.over(boxes);
            over.is_some_and(|[low, high]| !(low > 0.0 || high < 0.0))
        };
        let surfaces = guards.at_surfaces.iter().enumerate();
        let mut free = surfaces.filter(|(i, _)| !self.is_bound(*i));
        free.any(passes) || guards.bends.iter().any(bends)
    }

    /// What comes first between the ends of a step whose states are these polynomials.
    pub fn ahead(&mut self, span: &Span<'_>, states: impl Fn(usize) -> Poly) -> Ahead {
        let Some(guards) = self.guards.clone() else {
            return Ahead::Nothing;
        };
        let (t, h) = (span.from.0, span.step);
        self.look_beside(t);
        let beside = |[value, speed]: [f64; 2]| Poly::line(value, speed * h);
        let path = guards.inputs(Poly::line(t, h), states, &self.at.beside, beside);
        let path: Vec<Poly> = path.collect();
        let shortest = SHORTEST.max(resolution(t + h) / h);
        let samples = guards.samples(&path);
        let along = (&path[..], &samples[..]);
        let mut first = Ahead::Nothing;
        for (i, guard) in guards.at_surfaces.iter().enumerate() {
            if self.is_bound(i) {
                continue;
            }
            let side = (self.at.sides[i], self.at.levels[i]);
            let band = match i < self.plain {
                true => REACHED * self.at.largest[i],
                false => ROUNDED * self.at.largest[i] + f64::MIN_POSITIVE,
            };
            match guard.passage(along, side, band, shortest, first.at()) {
                Ahead::Nothing => {}
                found => first = found,
            }
        }
        for guard in &guards.bends {
            if let Some(at) = guard.bend(along, shortest, first.at()) {
                first = Ahead::Stop { at };
            }
        }
        first
    }

    /// Whether the ends of a step have to be looked at, too.
    pub fn has_bound(&self) -> bool {
        (0..self.plain).any(|i| self.is_bound(i))
    }

    /// Whether a surface is not left by passing it: the state slides along it, or stays there.
    fn is_bound(&self, i: usize) -> bool {
        self.at.sliding[i] || self.at.sides[i] == 0.0
    }

    /// Reads what the guards read beside time and states.
    fn look_beside(&mut self, t: f64) {
        if let Some(events) = self.inner.events() {
            events.beside(t, &mut self.at.beside);
        }
    }

    /// How fast the functions of the surfaces change.
    fn speeds_here(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let mut dx = vec![0.0; x.len()];
        self.derivatives(t, x, &mut dx);
        self.speeds(t, x, &dx)
    }

    /// How fast the functions of the surfaces change as the state moves with dx: a central
    /// difference, exact for what is affine.
    fn speeds(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let stays = (1e-5 * size(x).max(1e-3)) / size(dx).max(f64::MIN_POSITIVE);
        let step = (1e-5 * self.length).min(stays);
        let mut at = |step: f64| {
            let moved: Vec<f64> = x.iter().zip(dx).map(|(x, dx)| x + step * dx).collect();
            self.read(t + step, &moved)
        };
        let (after, before) = (at(step), at(-step));
        let speed = |(after, before): (&f64, &f64)| (after - before) / (2.0 * step);
        after.iter().zip(&before).map(speed).collect()
    }

    /// f + Σ part·(f on the other side − f), with the parts that keep the state on every
    /// surface it slides along.
    fn slide(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        let along: Vec<usize> = (0..self.parts.len())
            .filter(|&i| self.at.sliding[i])
            .collect();
        self.on_sides(t, x, dx);
        let here = self.speeds(t, x, dx);
        let mut others = vec![];
        let mut matrix = DMatrix::zeros(along.len(), along.len());
        for (column, &i) in along.iter().enumerate() {
            let mut other = vec![0.0; x.len()];
            let sides = self.at.sides.clone();
            self.turn(i, t, x);
            self.on_sides(t, x, &mut other);
            let there = self.speeds(t, x, &other);
            self.at.sides.copy_from_slice(&sides);
            self.hold();
            for (row, &j) in along.iter().enumerate() {
                matrix[(row, column)] = there[j] - here[j];
            }
            others.push(other);
        }
        let right = DVector::from_iterator(along.len(), along.iter().map(|&j| -here[j]));
        // where both sides move alike nothing decides between them
        let parts = matrix.lu().solve(&right);
        let parts = parts.unwrap_or_else(|| DVector::repeat(along.len(), 0.5));
        let f = dx.to_vec();
        for ((&i, part), other) in along.iter().zip(parts.iter()).zip(&others) {
            self.parts[i] = *part;
            let part = part.clamp(0.0, 1.0);
            for ((dx, f), other) in dx.iter_mut().zip(&f).zip(other) {
                *dx += part * (other - f);
            }
        }
    }

    /// The other side of a surface that is slid along, and of those that jump with it.
    fn turn(&mut self, i: usize, t: f64, x: &[f64]) {
        let count = self.parts.len();
        // surfaces jump with another one only where there is one
        let before = (count > 1).then(|| self.read(t, x));
        self.at.sides[i] = -self.at.sides[i];
        self.hold();
        let Some(before) = before else {
            return;
        };
        let after = self.read(t, x);
        for j in (0..count).filter(|&j| !self.at.sliding[j]) {
            if before[j] * after[j] < 0.0 {
                self.at.sides[j] = -self.at.sides[j];
            }
        }
        self.hold();
    }
}

impl Drop for Filippov<'_> {
    fn drop(&mut self) {
        if !self.is_plain() {
            tell(self.inner, None);
        }
    }
}

impl Dynamics for Filippov<'_> {
    fn dimension(&self) -> usize {
        self.inner.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        if self.at.sliding.contains(&true) {
            return self.slide(t, x, dx);
        }
        self.on_sides(t, x, dx);
    }

    /// How the parts of both sides change along a surface is not known.
    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        !self.at.sliding.contains(&true) && self.inner.slopes(t, x, slopes)
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.inner.clauses()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        self.inner.watch(t, x, seen);
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        self.inner.rates(t, x, dx)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>> {
        self.inner.truths(t, x)
    }

    fn happen(&mut self, t: f64, x: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        self.inner.happen(t, x, memory)
    }

    fn restart(&mut self, t: f64, x: &[f64]) {
        self.start(t, x);
    }

    fn settle(
        &mut self,
        at: (f64, &[f64]),
        jumped: &mut [f64],
        rates: [&[f64]; 2],
        cause: Option<Cause>,
        line: usize,
    ) -> Result<()> {
        self.inner.settle(at, jumped, rates, cause, line)
    }

    fn is_over(&mut self) -> bool {
        self.inner.is_over()
    }

    fn names(&self) -> Vec<String> {
        self.inner.names()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.inner.not_finite(t, x)
    }
}

fn side_of(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Tells a system on which sides of its surfaces it is; with none that it is where the state says.
fn tell(system: &mut dyn Dynamics, sides: Option<&[f64]>) {
    if let Some(events) = system.events() {
        events.hold(sides);
    }
}
