//! The problem of a window, linearised about its guesses: forward a Kalman filter, backward its
//! smoother.

use super::row::{Believed, Met, Row};
use crate::Error;
use crate::filter::Belief;
use crate::filter::extended::Extended;
use crate::filter::health::Reading;
use crate::filter::root::{Packed, Root, dot};
use crate::filter::sensing::Sensing;
use crate::filter::smooth::{Adjoint, Correction, Step};
use crate::filter::spanned::Rows;

/// A row given the whole window.
pub(super) struct Smooth {
    pub x: Vec<f64>,
    pub forces: Vec<Force>,
}

/// How hard a bound that is met pushes its state upward.
pub(super) struct Force {
    /// its place among `met`
    pub place: usize,
    pub push: f64,
}

/// One row of a forward pass.
pub(super) struct Pass {
    pub before: Belief,
    pub after: Belief,
    /// the root before the bounds
    pub by_readings: Root,
    /// Φ from the row before; none of the first
    pub transition: Option<Rows>,
    pub readings: Vec<Correction>,
    pub bounds: Vec<AtBound>,
}

/// What a bound did that is met.
pub(super) struct AtBound {
    /// its place among `met`
    place: usize,
    correction: Correction,
}

impl Pass {
    /// What a smoother keeps of a row that stays in the window: the bounds that it meets are
    /// exact readings.
    pub fn kept(self) -> Step {
        let bounds = self.bounds.into_iter().map(|b| b.correction);
        Step {
            transition: self.transition,
            x: self.after.x,
            root: Packed::of(&self.after.root),
            corrections: self.readings.into_iter().chain(bounds).collect(),
        }
    }

    /// The same of a row that leaves the window: the bounds that it met have moved the estimate,
    /// and told no more than that.
    pub fn leaving(&self) -> Step {
        Step {
            transition: self.transition.clone(),
            x: self.after.x.clone(),
            root: Packed::of(&self.by_readings),
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
        let noise = sensing.noise(sensor, h[sensor]);
        let variance = dot(&projected, &projected) + noise;
        let innovation = sensing.judge(sensor, *reading, h[sensor], variance);
        if innovation.reading == Reading::Taken {
            taken.push(Believed {
                sensor,
                reading: *reading,
                variance: noise,
            });
        }
    }
    Ok(taken)
}

/// x⁻ = φ(x̃) + Φ(x − x̃), P⁻ = ΦPΦᵀ + W, linearised at the guess x̃.
pub(super) fn predicted(
    engine: &mut Extended,
    after: &Belief,
    from: &Row,
    to: &Row,
) -> Result<(Belief, Rows), Error> {
    let mut belief = Belief {
        x: from.guess.clone(),
        root: after.root.clone(),
    };
    if to.t <= from.t {
        // the same instant again
        return Ok((after.clone(), Rows::identity(belief.x.len())));
    }
    engine.driven.start(&from.inputs);
    engine.driven.aim(from.t, to.t, &to.inputs);
    let transition = engine.predict(&mut belief, from.t, to.t, true)?;
    let off: Vec<f64> = after
        .x
        .iter()
        .zip(&from.guess)
        .map(|(x, g)| x - g)
        .collect();
    for (x, (first, row)) in belief.x.iter_mut().zip(transition.iter()) {
        *x += dot(row, &off[first..]);
    }
    Ok((belief, transition))
}

pub(super) fn corrected(
    sensing: &mut Sensing,
    row: &Row,
    before: Belief,
    transition: Option<Rows>,
) -> Result<Pass, Error> {
    let h = sensing.evaluate(row.t, &row.guess, &row.inputs)?.to_vec();
    let mut after = before.clone();
    let mut readings = vec![];
    for believed in &row.readings {
        let c = sensing.slopes(believed.sensor);
        // h linearised at the guess
        let offset = h[believed.sensor] - dot(&c, &row.guess);
        let y = believed.reading - offset;
        readings.extend(take(&mut after, c, y, believed.variance));
    }
    let by_readings = after.root.clone();
    let mut bounds = vec![];
    for (place, Met { state, bound }) in row.met.iter().enumerate() {
        let mut c = vec![0.0; after.x.len()];
        c[*state] = 1.0;
        let correction = take(&mut after, c, *bound, 0.0);
        bounds.extend(correction.map(|correction| AtBound { place, correction }));
    }
    Ok(Pass {
        before,
        after,
        by_readings,
        transition,
        readings,
        bounds,
    })
}

/// Corrects by cᵀx = y with noise of variance r.
fn take(belief: &mut Belief, c: Vec<f64>, y: f64, r: f64) -> Option<Correction> {
    let mut projected = vec![0.0; c.len()];
    belief.root.transposed_times(&c, &mut projected);
    let variance = dot(&projected, &projected) + r;
    let innovation = y - dot(&c, &belief.x);
    let gain = belief.root.update(&projected, r)?;
    for (x, k) in belief.x.iter_mut().zip(&gain) {
        *x += k * innovation;
    }
    Some(Correction::single(c, innovation, variance, gain))
}

/// The window's rows given all of it.
pub(super) fn backward(passes: &[Pass]) -> Vec<Smooth> {
    let n = passes.first().map_or(0, |p| p.after.x.len());
    let mut adjoint = Adjoint::nothing(n);
    let mut rows = vec![];
    for pass in passes.iter().rev() {
        let shift = pass.after.root.covariance_times(&adjoint.vector);
        let x = pass.after.x.iter().zip(&shift).map(|(x, s)| x - s);
        let x = x.collect();
        let forces = pass.bounds.iter().rev().map(|at| Force {
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
