//! Jumps of the right-hand side that the state decides: relays, thresholds, dry friction.
//!
//! Between two of them the right-hand side is that of one side, held. Where a step ends on
//! another side, the instant of the crossing is located, and what follows decided by the
//! velocities on both sides (A. F. Filippov, *Differential Equations with Discontinuous
//! Righthand Sides*, § 4): if the other side carries the state on, it is crossed; if both push
//! the state back, it slides along the surface with the combination of both right-hand sides
//! that keeps it there, until one of them ceases to push. Without that an integrator creeps
//! from one side to the other in steps as short as time resolves. What is on a surface and stays
//! there by the equations as they are written (an input that is held at a threshold) is on
//! neither side: operations have the value then that they have at zero.
//!
//! Whether a step crosses a surface is not asked of its ends alone: the function is enclosed by
//! interval arithmetic along the polynomial that the method has between them, stretch by stretch,
//! so that a pulse is found however short it is beside the step. Where `abs`, `min`, `max` and tables
//! bend, steps end as well. A `floor` jumps on two surfaces that move along with it: the next even
//! integer and the next odd one.

mod ahead;
mod decide;
mod extract;
mod guard;
mod path;
mod slide;

use std::sync::Arc;

pub(crate) use ahead::{Ahead, Glance, Span};
pub use extract::first_jump;
pub(crate) use extract::{bends, take};
pub use guard::Guards;
pub(crate) use guard::Watched;
pub(crate) use path::{COEFFICIENTS, Poly};

use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Slopes};

/// A surface counts as reached this close to it, against the largest value of its function.
const REACHED: f64 = 1e-10;

/// A surface passed so often in a run is named where the steps run out.
const OFTEN: usize = 1000;

/// One operation that jumps on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relay {
    surface: usize,
    /// its own argument has the other sign
    is_reversed: bool,
    kind: Kind,
    /// its value on the surface
    at_zero: f64,
}

/// What an operation is on a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// −1 or 1
    Sign,
    /// 0 or 1
    Truth,
    /// the integer that is held
    Floor,
}

/// The jumps of a system and the surfaces on which they happen.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    relays: Vec<Relay>,
    /// how the surfaces read
    pub names: Vec<String>,
    /// the surfaces that are one of two of a `floor`, even ones first
    pub counts: Vec<bool>,
}

impl Held {
    /// Writes the values of the operations on the given sides of the surfaces; of a `floor` its value
    /// stands for the side. Returns the modes that are not theirs.
    pub fn modes<'m>(&self, sides: &[f64], modes: &'m mut [f64]) -> &'m mut [f64] {
        let (own, others) = modes.split_at_mut(self.relays.len());
        for (mode, relay) in own.iter_mut().zip(&self.relays) {
            let side = match relay.is_reversed {
                true => -sides[relay.surface],
                false => sides[relay.surface],
            };
            *mode = match relay.kind {
                Kind::Floor => side,
                _ if side == 0.0 => relay.at_zero,
                Kind::Sign => side,
                Kind::Truth => f64::from(u8::from(side > 0.0)),
            };
        }
        others
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
        walk.numbers(&mut self.sides)?;
        walk.numbers(&mut self.levels)?;
        walk.numbers(&mut self.largest)?;
        self.sliding.iter_mut().try_for_each(|s| walk.flag(s))?;
        self.passes.iter_mut().try_for_each(|p| walk.count(p))
    }
}

/// A system on known sides of its surfaces.
pub(crate) struct Switched<'a, D: Dynamics> {
    inner: &'a mut D,
    at: &'a mut Sides,
    /// length of the interval
    length: f64,
    /// parts of the other side's right-hand side, of each surface that is slid along
    parts: Vec<f64>,
    values: Vec<f64>,
    /// what is watched over a step
    guards: Option<Arc<Guards>>,
}

impl<'a, D: Dynamics> Switched<'a, D> {
    /// At the start of an interval of the given length; decides on which sides it starts.
    pub fn new(inner: &'a mut D, at: &'a mut Sides, (t, x): (f64, &[f64]), length: f64) -> Self {
        let count = inner.surfaces();
        at.fit(count);
        let mut switched = Self {
            guards: inner.guards(),
            inner,
            at,
            length,
            parts: vec![0.0; count],
            values: vec![0.0; count],
        };
        if count > 0 {
            switched.start(t, x);
        }
        switched
    }

    /// Whether nothing jumps with the state.
    pub fn is_plain(&self) -> bool {
        self.values.is_empty()
    }

    /// Whether the surface is one of two of a `floor`: the first one of them.
    fn pair(&self, i: usize) -> Option<usize> {
        let counts = &self.guards.as_ref()?.counts;
        let is_second = |i: usize| counts[..i].iter().filter(|&&c| c).count() % 2 == 1;
        counts.get(i)?.then(|| i - usize::from(is_second(i)))
    }

    /// The first surface of each `floor`.
    fn pairs(&self) -> Vec<usize> {
        (0..self.values.len())
            .filter(|&i| self.pair(i) == Some(i))
            .collect()
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
        let (even, odd) = if is_even {
            (low, low + 1.0)
        } else {
            (low + 1.0, low)
        };
        for (i, level) in [(first, even), (first + 1, odd)] {
            self.at.levels[i] = level;
            self.at.sides[i] = if level == low { 1.0 } else { -1.0 };
        }
    }

    /// Carries the surfaces of a `floor` along where both were passed.
    fn carry(&mut self) {
        for first in self.pairs() {
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
        let pairs = self.pairs();
        if pairs.is_empty() {
            return self.inner.hold(Some(&self.at.sides));
        }
        let mut sides = self.at.sides.clone();
        for first in pairs {
            sides[first..first + 2].fill(self.floor(first));
        }
        self.inner.hold(Some(&sides));
    }

    /// Reads the functions of the surfaces, against what they are there.
    fn read(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.inner.read_surfaces(t, x, values);
        for (value, level) in values.iter_mut().zip(&self.at.levels) {
            *value -= level;
        }
    }

    /// Reads the functions of the surfaces, and remembers how large they were.
    fn look(&mut self, t: f64, x: &[f64]) {
        let mut values = std::mem::take(&mut self.values);
        self.read(t, x, &mut values);
        self.values = values;
        for (largest, value) in self.at.largest.iter_mut().zip(&self.values) {
            *largest = largest.max(value.abs());
        }
    }

    /// How far each surface is from changing what holds; negative beyond.
    pub fn margins(&mut self, t: f64, x: &[f64], margins: &mut Vec<f64>) {
        margins.clear();
        if self.is_plain() {
            return;
        }
        if self.at.sliding.contains(&true) {
            let mut dx = vec![0.0; x.len()];
            self.derivatives(t, x, &mut dx);
        }
        self.look(t, x);
        for (i, value) in self.values.iter().enumerate() {
            margins.push(match self.at.sliding[i] {
                true => self.parts[i].min(1.0 - self.parts[i]),
                false if self.at.sides[i] == 0.0 => -value.abs(),
                false => self.at.sides[i] * value,
            });
        }
    }

    /// A branch need have no value beyond its side: f as the state says, then.
    fn mend(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        if !self.is_plain() && !dx.iter().all(|v| v.is_finite()) {
            self.inner.hold(None);
            self.inner.derivatives(t, x, dx);
            self.hold();
        }
    }

    /// The surface that was reached most often, where that is often.
    pub fn busiest(&self) -> Option<String> {
        let passes = self.at.passes.iter().enumerate();
        let (i, count) = passes.max_by_key(|(_, count)| **count)?;
        let name = self.inner.surface_names().into_iter().nth(i)?;
        (*count >= OFTEN).then(|| format!("{name} was passed {count} times; "))
    }
}

impl<D: Dynamics> Drop for Switched<'_, D> {
    fn drop(&mut self) {
        if !self.is_plain() {
            self.inner.hold(None);
        }
    }
}

impl<D: Dynamics> Dynamics for Switched<'_, D> {
    fn dimension(&self) -> usize {
        self.inner.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        if self.at.sliding.contains(&true) {
            return self.slide(t, x, dx);
        }
        self.inner.derivatives(t, x, dx);
        self.mend(t, x, dx);
    }

    /// How the parts of both sides change along a surface is not known.
    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        !self.at.sliding.contains(&true) && self.inner.slopes(t, x, slopes)
    }

    fn enter(&mut self, t: f64) {
        self.inner.enter(t);
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
