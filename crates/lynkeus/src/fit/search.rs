//! The search: damped scoring within bounds, then Newton's steps.
//!
//! A step d solves (M + λD)d = −g, with g the gradient, M Fisher's information (K. Levenberg, *Quarterly of Applied
//! Mathematics* 2 (1944) 164–168; D. W. Marquardt, *SIAM Journal* 11 (1963) 431–441) and D the largest diagonal that M
//! had (J. J. Moré, *Lecture Notes in Mathematics* 630 (1978) 105–116), so that it does not matter in which units an
//! unknown is. Unknowns at a bound that the gradient presses against stay there. Near the end M is the Hessian
//! itself, by differences of exact gradients: scoring alone would only creep where the model is wrong.

use std::ops::ControlFlow;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::problem::{Point, Problem};
use crate::Error;

/// What is left to gain of −log L at the end: a hundredth of a standard deviation of one unknown is 5·10⁻⁵.
const LITTLE: f64 = 1e-9;

/// Most steps of scoring, and of Newton.
const STEPS: [usize; 2] = [200, 30];

/// A logarithm does not move further in one step: by a factor 20.
const FARTHEST: f64 = 3.0;

/// Where a search ended.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub point: Point,
    /// by what is searched; unknowns at a bound have zeros
    pub hessian: DMatrix<f64>,
    /// those at a bound that the gradient presses against
    pub is_bound: Vec<bool>,
    /// nothing is left to gain nearby
    pub is_converged: bool,
    /// it was told to stop
    pub is_ended: bool,
}

/// From one point downhill; unknowns that are `held` stay. `watch` is asked before steps whether to go on.
///
/// # Errors
/// As [`Problem::at`].
pub(crate) fn search(
    problem: &mut Problem<'_>,
    start: Point,
    held: &[bool],
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Found, Error> {
    let mut descent = Descent::new(problem, start, held);
    let is_done = descent.score(watch)?;
    if !descent.point.value.is_finite() {
        descent.is_ended = descent.problem.is_spent();
        return Ok(descent.found(None));
    }
    if descent.problem.has_knees() {
        // a gradient need not vanish at a knee: the end is where no step wins anything
        let information = descent.point.information.clone();
        let is_converged = is_done && !descent.is_ended;
        return Ok(Found {
            is_converged,
            ..descent.found(Some(information))
        });
    }
    descent.damping = 0.0;
    descent.growth = 2.0;
    let mut last = None;
    for _ in 0..STEPS[1] {
        if descent.is_ended {
            break;
        }
        let matrix = descent.hessian()?;
        let goes_on = descent.goes_on(&matrix, watch)?;
        // one that a limit cut short is none
        last = Some(matrix).filter(|_| !descent.is_ended);
        if !goes_on {
            break;
        }
    }
    Ok(descent.found(last))
}

/// The least −log L near a point, and whether the search came to its end: by scoring alone, which is enough for the
/// height of a valley.
///
/// # Errors
/// As [`Problem::at`].
pub(crate) fn least(
    problem: &mut Problem<'_>,
    start: DVector<f64>,
    held: &[bool],
) -> Result<(Point, bool), Error> {
    let start = problem.at(start)?;
    let mut descent = Descent::new(problem, start, held);
    descent.score(&mut || ControlFlow::Continue(()))?;
    let is_done = !descent.is_ended && !descent.problem.is_spent();
    Ok((descent.point, is_done))
}

struct Descent<'d, 'p> {
    problem: &'d mut Problem<'p>,
    point: Point,
    ranges: Vec<(f64, f64)>,
    held: Vec<bool>,
    /// D
    scale: DVector<f64>,
    /// λ, and by what it grows
    damping: f64,
    growth: f64,
    is_ended: bool,
}

impl<'d, 'p> Descent<'d, 'p> {
    fn new(problem: &'d mut Problem<'p>, point: Point, held: &[bool]) -> Self {
        Self {
            ranges: problem.ranges(),
            held: held.to_vec(),
            scale: DVector::zeros(point.z.len()),
            damping: 1e-3,
            growth: 2.0,
            point,
            problem,
            is_ended: false,
        }
    }

    /// By Fisher's information; whether it came to where no step wins anything.
    fn score(&mut self, watch: &mut dyn FnMut() -> ControlFlow<()>) -> Result<bool, Error> {
        for _ in 0..STEPS[0] {
            let matrix = self.point.information.clone();
            if !self.point.value.is_finite() || !self.goes_on(&matrix, watch)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// At a bound, and pressed against it.
    fn is_bound(&self, i: usize) -> bool {
        let ((low, high), z, g) = (self.ranges[i], self.point.z[i], self.point.gradient[i]);
        (z <= low && g > 0.0) || (z >= high && g < 0.0)
    }

    /// The unknowns that may move. A threshold that is not met has no say until others have brought the state there.
    fn free(&self) -> Vec<usize> {
        let all = 0..self.point.z.len();
        let has_knees = self.problem.has_knees();
        let has_say = |i: &usize| !has_knees || self.point.information[(*i, *i)] > 0.0;
        all.filter(|&i| !self.held[i] && !self.is_bound(i))
            .filter(has_say)
            .collect()
    }

    /// One step; false where there is none to take.
    fn goes_on(
        &mut self,
        matrix: &DMatrix<f64>,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<bool, Error> {
        for (i, largest) in self.scale.iter_mut().enumerate() {
            *largest = largest.max(matrix[(i, i)].abs());
        }
        loop {
            if watch().is_break() || self.problem.is_spent() {
                self.is_ended = true;
                return Ok(false);
            }
            let free = self.free();
            let Some(step) = self.step(matrix, &free) else {
                self.damp();
                if self.damping > 1e12 {
                    return Ok(false);
                }
                continue;
            };
            let gain = self.expected(matrix, &step);
            if gain <= LITTLE || self.damping > 1e12 {
                return Ok(false);
            }
            let next = self.problem.at(&self.point.z + &step)?;
            let won = self.point.value - next.value;
            if won.is_finite() && won > 1e-4 * gain {
                let ratio = won / gain;
                self.damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(1.0 / 5.0, 1.0);
                if self.damping < 1e-12 {
                    self.damping = 0.0;
                }
                self.growth = 2.0;
                self.point = next;
                return Ok(true);
            }
            // what rounding leaves of a difference of two values
            let noise = 1e-13 * self.point.value.abs().max(1.0);
            if won.abs() <= noise && gain <= 100.0 * noise {
                return Ok(false);
            }
            self.damp();
        }
    }

    fn damp(&mut self) {
        self.damping = (self.damping * self.growth).max(1e-4);
        self.growth *= 2.0;
    }

    /// The step within the bounds; none where the damped matrix is not positive.
    fn step(&self, matrix: &DMatrix<f64>, free: &[usize]) -> Option<DVector<f64>> {
        let n = free.len();
        let damped = DMatrix::from_fn(n, n, |i, j| {
            let own = matrix[(free[i], free[j])];
            match i == j {
                true => own + self.damping * self.scale[free[i]],
                false => own,
            }
        });
        let right = DVector::from_fn(n, |i, _| -self.point.gradient[free[i]]);
        let solved = positive(damped)?.solve(&right);
        let mut step = DVector::zeros(self.point.z.len());
        for (i, &place) in free.iter().enumerate() {
            let is_log = self.problem.unknowns[place].is_log;
            let farthest = if is_log { FARTHEST } else { f64::INFINITY };
            let (low, high) = self.ranges[place];
            let z = self.point.z[place];
            let own = solved[i].clamp(-farthest, farthest);
            step[place] = (z + own).clamp(low, high) - z;
        }
        step.iter().all(|d| d.is_finite()).then_some(step)
    }

    /// What a step should win.
    fn expected(&self, matrix: &DMatrix<f64>, step: &DVector<f64>) -> f64 {
        let quadratic = step.dot(&(matrix * step));
        let gain = -(self.point.gradient.dot(step) + 0.5 * quadratic);
        // a step that was cut off at bounds
        gain.max(-0.5 * self.point.gradient.dot(step))
    }

    fn hessian(&mut self) -> Result<DMatrix<f64>, Error> {
        let free = self.free();
        hessian(self.problem, &self.point, &free)
    }

    fn found(&self, hessian: Option<DMatrix<f64>>) -> Found {
        let n = self.point.z.len();
        let hessian = hessian.unwrap_or_else(|| DMatrix::zeros(n, n));
        let free = self.free();
        let step = self.newton(&hessian, &free);
        let left = step.map(|step| -0.5 * self.point.gradient.dot(&step));
        Found {
            is_bound: (0..n).map(|i| self.is_bound(i)).collect(),
            is_converged: !self.is_ended && left.is_some_and(|left| left <= 1e-6),
            point: self.point.clone(),
            hessian,
            is_ended: self.is_ended,
        }
    }

    /// Newton's whole step.
    fn newton(&self, hessian: &DMatrix<f64>, free: &[usize]) -> Option<DVector<f64>> {
        let own = DMatrix::from_fn(free.len(), free.len(), |i, j| hessian[(free[i], free[j])]);
        let right = DVector::from_fn(free.len(), |i, _| -self.point.gradient[free[i]]);
        let solved = positive(own)?.solve(&right);
        let mut step = DVector::zeros(self.point.z.len());
        for (i, &place) in free.iter().enumerate() {
            step[place] = solved[i];
        }
        Some(step)
    }
}

/// The factor of a matrix that is positive definite, its units set aside.
pub(crate) fn positive(matrix: DMatrix<f64>) -> Option<Scaled> {
    let n = matrix.nrows();
    let scale = DVector::from_fn(n, |i, _| 1.0 / matrix[(i, i)].abs().sqrt());
    if scale.iter().any(|s| !s.is_finite()) {
        return None;
    }
    let unit = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let factor = Cholesky::new(unit)?;
    Some(Scaled { factor, scale })
}

/// A positive definite matrix by the factor of its correlation.
pub(crate) struct Scaled {
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
}

impl Scaled {
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let own = right.component_mul(&self.scale);
        self.factor.solve(&own).component_mul(&self.scale)
    }

    pub fn inverse(&self) -> DMatrix<f64> {
        let own = self.factor.inverse();
        DMatrix::from_fn(own.nrows(), own.ncols(), |i, j| {
            own[(i, j)] * self.scale[i] * self.scale[j]
        })
    }
}

/// Steps of the differences, in standard deviations.
const DIFFERENCE: f64 = 0.01;

/// A value that is a smaller share of its start has no size of its own.
const LEAST: f64 = 1e-4;

/// The Hessian at a point over the unknowns that are free, by differences of exact gradients to fourth order.
///
/// # Errors
/// As [`Problem::at`].
pub(crate) fn hessian(
    problem: &mut Problem<'_>,
    point: &Point,
    free: &[usize],
) -> Result<DMatrix<f64>, Error> {
    let n = point.z.len();
    let ranges = problem.ranges();
    let mut rows = DMatrix::zeros(n, n);
    for &i in free {
        let size = match point.information[(i, i)] {
            information if information > 0.0 => information.sqrt().recip(),
            _ => 1.0,
        };
        // what a log hardly tells may deviate by many times itself
        let unknown = &problem.unknowns[i];
        let own = match unknown.is_log {
            true => 1.0,
            false => point.z[i].abs().max(LEAST * unknown.start.abs()),
        };
        let size = if own > 0.0 { size.min(own) } else { size };
        let (low, high) = ranges[i];
        let room = (point.z[i] - low).min(high - point.z[i]);
        let h = match room > 0.0 {
            true => (DIFFERENCE * size)
                .min(0.5 * room)
                .max(1e-4 * DIFFERENCE * size),
            false => DIFFERENCE * size,
        };
        let mut gradient = |k: f64| {
            let mut z = point.z.clone();
            z[i] += k * h;
            let there = problem.at(z)?;
            Ok::<_, Error>(there.gradient)
        };
        let near = gradient(1.0)? - gradient(-1.0)?;
        let far = gradient(2.0)? - gradient(-2.0)?;
        let row = (near * 8.0 - far) / (12.0 * h);
        for &j in free {
            rows[(i, j)] = row[j];
        }
    }
    Ok((&rows + rows.transpose()) * 0.5)
}
