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

mod decide;
mod extract;
mod slide;

use lynkeus_expr::Tape;

pub(crate) use extract::{Taken, take};

use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Slopes};

/// A margin this small beside those at the ends of a step may be negative where a cubic is not.
const CLOSE: f64 = 0.05;

/// A surface passed so often in a run is named where the steps run out.
const OFTEN: usize = 1000;

/// One operation that jumps on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relay {
    surface: usize,
    /// its own argument has the other sign
    is_reversed: bool,
    /// its value is −1 or 1 instead of 0 or 1
    is_sign: bool,
    /// its value on the surface
    at_zero: f64,
}

/// The jumps of a system and the surfaces on which they happen.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    relays: Vec<Relay>,
    /// functions that vanish on the surfaces, of the inputs of the system and the modes
    pub surfaces: Tape,
    /// how the surfaces read
    pub names: Vec<String>,
}

impl Held {
    /// Writes the values of the operations on the given sides of the surfaces.
    pub fn modes(&self, sides: &[f64], modes: &mut [f64]) {
        for (mode, relay) in modes.iter_mut().zip(&self.relays) {
            let side = match relay.is_reversed {
                true => -sides[relay.surface],
                false => sides[relay.surface],
            };
            *mode = match relay.is_sign {
                _ if side == 0.0 => relay.at_zero,
                true => side,
                false => f64::from(u8::from(side > 0.0)),
            };
        }
    }
}

/// What is remembered of the surfaces from one interval to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sides {
    /// −1 or 1; 0 on a surface on which the state stays
    sides: Vec<f64>,
    sliding: Vec<bool>,
    /// the largest values seen of their functions
    largest: Vec<f64>,
    /// how often they were reached
    passes: Vec<usize>,
}

impl Sides {
    /// Room for so many surfaces.
    fn fit(&mut self, count: usize) {
        self.sides.resize(count, 1.0);
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
}

impl<'a, D: Dynamics> Switched<'a, D> {
    /// At the start of an interval of the given length; decides on which sides it starts.
    pub fn new(inner: &'a mut D, at: &'a mut Sides, (t, x): (f64, &[f64]), length: f64) -> Self {
        let count = inner.surfaces();
        at.fit(count);
        let mut switched = Self {
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

    /// Tells the system on which sides it is.
    fn hold(&mut self) {
        self.inner.hold(Some(&self.at.sides));
    }

    /// Reads the functions of the surfaces.
    fn look(&mut self, t: f64, x: &[f64]) {
        self.inner.read_surfaces(t, x, &mut self.values);
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

    /// Where between two points the margin of a surface may be negative although it is not at
    /// either.
    pub fn dip(&mut self, from: (f64, &[f64]), to: (f64, &[f64])) -> Option<f64> {
        let [(before, falls), (after, rises)] = [from, to].map(|(t, x)| {
            let mut dx = vec![0.0; x.len()];
            self.derivatives(t, x, &mut dx);
            let speeds = self.speeds(t, x, &dx);
            self.look(t, x);
            (self.values.clone(), speeds)
        });
        let step = to.0 - from.0;
        let free = (0..self.values.len()).filter(|&i| !self.at.sliding[i]);
        let lowest = free.filter_map(|i| {
            let side = self.at.sides[i];
            let (a, b) = (side * before[i], side * after[i]);
            let (p, q) = (side * falls[i] * step, side * rises[i] * step);
            let dips = p < 0.0 && q > 0.0;
            dips.then(|| least_of_cubic([a, p], [b, q])).flatten()
        });
        lowest.reduce(f64::min)
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

/// The part of the way at which the cubic through two values with their slopes is least, where it
/// is negative there, or so close to it that only a look tells.
fn least_of_cubic([a, p]: [f64; 2], [b, q]: [f64; 2]) -> Option<f64> {
    let third = 2.0 * (a - b) + p + q;
    let second = 3.0 * (b - a) - 2.0 * p - q;
    // of the two roots of 3·third·s² + 2·second·s + p the one that is a minimum
    let root = (second * second - 3.0 * third * p).max(0.0).sqrt();
    let least = -p / (second + root);
    let value = a + least * (p + least * (second + least * third));
    (least > 0.0 && least < 1.0 && value < CLOSE * (a + b)).then_some(least)
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
