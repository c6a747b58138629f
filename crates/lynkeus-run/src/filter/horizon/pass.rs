//! The problem of a window, linearised about its guesses: forward a Kalman filter, backward its
//! smoother.

use std::sync::Arc;

use super::row::{Met, Row};
use crate::Error;
use crate::filter::Belief;
use crate::filter::root::{Packed, Root, dot};
use crate::filter::sensing::{Believed, Sensing};
use crate::filter::smooth::{Adjoint, Correction, Step};
use crate::filter::spanned::Rows;
use crate::filter::stage::Stage;

/// What is left of a state's deviation where the window holds it by other means: another reading of it
/// says nothing, and its gain would be rounding.
const HELD: f64 = 1e-9;

/// A row given the whole window.
pub(super) struct Smooth {
    pub x: Vec<f64>,
    pub forces: Vec<Force>,
}

/// How hard a pin pushes its state upward.
pub(super) struct Force {
    /// its place among the pins of the row
    pub place: usize,
    pub push: f64,
}

/// A row of the linearised problem.
pub(super) struct Linear {
    pub way: Way,
    pub seen: Vec<Seen>,
    /// deviations of the states by all readings up to the row before, without bounds
    pub spread: Vec<f64>,
}

/// From the row before.
pub(super) enum Way {
    /// there is none
    First,
    /// it is at the same instant
    Same,
    Over(Arc<Stage>),
}

/// A reading: cᵀx = value, with noise.
pub(super) struct Seen {
    pub slopes: Vec<f64>,
    pub value: f64,
    pub variance: f64,
}

/// A state that is drawn to a value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pin {
    pub state: usize,
    pub value: f64,
    /// 0 where it is held there
    pub variance: f64,
}

impl From<Met> for Pin {
    fn from(Met { state, bound }: Met) -> Self {
        Self {
            state,
            value: bound,
            variance: 0.0,
        }
    }
}

/// One row of a forward pass.
pub(super) struct Pass {
    pub before: Belief,
    pub after: Belief,
    /// the root before the pins, where there are any
    pub by_readings: Option<Root>,
    /// Φ from the row before; none of the first
    pub transition: Option<Arc<Rows>>,
    pub readings: Vec<Correction>,
    pub pins: Vec<AtPin>,
}

/// What a pin did.
pub(super) struct AtPin {
    /// its place among the pins of the row
    place: usize,
    correction: Correction,
}

impl Pass {
    /// The root by the readings alone.
    pub fn by_readings(&self) -> &Root {
        self.by_readings.as_ref().unwrap_or(&self.after.root)
    }

    /// What a smoother keeps of a row that stays in the window: the bounds that it meets are
    /// exact readings.
    pub fn kept(self) -> Step {
        let pins = self.pins.into_iter().map(|b| b.correction);
        Step {
            transition: self.transition.map(Arc::unwrap_or_clone),
            x: self.after.x,
            root: Packed::of(&self.after.root),
            corrections: self.readings.into_iter().chain(pins).collect(),
        }
    }

    /// The same of a row that leaves the window: the bounds that it met have moved the estimate,
    /// and told no more than that.
    pub fn leaving(&self) -> Step {
        Step {
            transition: self.transition.as_deref().cloned(),
            x: self.after.x.clone(),
            root: Packed::of(self.by_readings()),
            corrections: self.readings.clone(),
        }
    }
}

/// Readings of a new sample that are believed.
pub(super) fn judged(
    sensing: &mut Sensing,
    belief: &Belief,
    t: f64,
    readings: &[f64],
    inputs: &[f64],
) -> Result<Vec<Believed>, Error> {
    let h = sensing.evaluate(t, &belief.x, inputs)?.to_vec();
    let mut projected = vec![0.0; belief.x.len()];
    let mut taken = vec![];
    for (sensor, reading) in readings.iter().enumerate() {
        belief
            .root
            .transposed_times(&sensing.slopes(sensor), &mut projected);
        let spread = dot(&projected, &projected);
        taken.extend(sensing.judge(sensor, *reading, h[sensor], spread));
    }
    Ok(taken)
}

/// The readings of a row, h linearised at its guess.
pub(super) fn seen(sensing: &mut Sensing, row: &Row) -> Result<Vec<Seen>, Error> {
    let h = sensing.evaluate(row.t, &row.guess, &row.inputs)?.to_vec();
    let seen = |believed: &Believed| {
        let slopes = sensing.slopes(believed.sensor);
        let offset = h[believed.sensor] - dot(&slopes, &row.guess);
        let (value, variance) = believed.about(h[believed.sensor])?;
        Some(Seen {
            value: value - offset,
            variance,
            slopes,
        })
    };
    Ok(row.readings.iter().filter_map(seen).collect())
}

impl Way {
    /// What leads over to a row.
    pub fn stage(&self) -> Option<Arc<Stage>> {
        match self {
            Self::Over(stage) => Some(Arc::clone(stage)),
            _ => None,
        }
    }

    /// What is believed at a row before its readings, and Φ.
    pub fn carry(&self, prior: &Belief, last: Option<&Pass>) -> (Belief, Option<Arc<Rows>>) {
        match (self, last) {
            (Self::Over(stage), Some(last)) => {
                let transition = Arc::clone(&stage.transition);
                (stage.carry(&last.after), Some(transition))
            }
            (Self::Same, Some(last)) => {
                let after = last.after.clone();
                let identity = Rows::identity(after.x.len());
                (after, Some(Arc::new(identity)))
            }
            _ => (prior.clone(), None),
        }
    }
}

/// A row by its readings, then by its pins.
pub(super) fn corrected(
    seen: &[Seen],
    spread: &[f64],
    pins: &[Pin],
    (before, transition): (Belief, Option<Arc<Rows>>),
) -> Pass {
    let mut after = before.clone();
    let mut readings = Vec::with_capacity(seen.len());
    for s in seen {
        readings.extend(take(&mut after, &s.slopes, s.value, s.variance, 0.0));
    }
    let by_readings = (!pins.is_empty()).then(|| after.root.clone());
    let mut at = vec![];
    for (place, pin) in pins.iter().enumerate() {
        let mut c = vec![0.0; after.x.len()];
        c[pin.state] = 1.0;
        let least = HELD * spread[pin.state];
        let correction = take(&mut after, &c, pin.value, pin.variance, least);
        at.extend(correction.map(|correction| AtPin { place, correction }));
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
    let gain = belief.root.update(&projected, r)?;
    for (x, k) in belief.x.iter_mut().zip(&gain) {
        *x += k * innovation;
    }
    Some(Correction::single(c.to_vec(), innovation, own + r, gain))
}

/// The window's rows given all of it.
pub(super) fn backward(passes: &[Pass]) -> Vec<Smooth> {
    let n = passes.first().map_or(0, |p| p.after.x.len());
    let mut adjoint = Adjoint::nothing(n);
    let mut rows = Vec::with_capacity(passes.len());
    for pass in passes.iter().rev() {
        let shift = pass.after.root.covariance_times(&adjoint.vector);
        let x = pass.after.x.iter().zip(&shift).map(|(x, s)| x - s);
        let x = x.collect();
        let forces = pass.pins.iter().rev().map(|at| Force {
            place: at.place,
            push: adjoint.over_vector(&at.correction).iter().sum(),
        });
        let forces = forces.collect();
        rows.push(Smooth { x, forces });
        for reading in pass.readings.iter().rev() {
            adjoint.over_vector(reading);
        }
        if let Some(transition) = &pass.transition {
            adjoint.vector_through(transition);
        }
    }
    rows.reverse();
    rows
}
