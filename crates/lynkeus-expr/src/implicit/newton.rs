//! Newton's method on an implicit function at one p, within its declared range: on the function
//! as it is, or on one of its sides, where nothing jumps.

use crate::code::Residual;
use crate::interval::Intervals;
use crate::{Evaluator, Implicit, Interval, linear};

/// Newton steps from one start.
const STEPS: usize = 80;
/// Halvings of one step.
const HALVINGS: usize = 30;
/// A step this small against its unknown, in units of the last place, is the last.
const LAST: f64 = 4.0 * f64::EPSILON;
/// Values between which a change of sign is looked for, to either side of the start.
const SAMPLES: usize = 64;
/// Halvings of a bracket: down to neighbouring numbers, whatever it was.
const BISECTIONS: usize = 1200;

/// Newton's method on one function at one p.
pub(super) struct Newton<'a> {
    function: &'a Implicit,
    equations: &'a Residual,
    residual: Evaluator,
    slopes: Evaluator,
    /// (z, p), and the sides that are held
    at: Vec<f64>,
}

impl<'a> Newton<'a> {
    /// On the function as it is.
    pub(super) fn new(function: &'a Implicit, p: &[f64]) -> Self {
        Self::on(function, &function.0.residual, p)
    }

    /// On equations whose inputs after z have such values.
    pub(super) fn on(function: &'a Implicit, equations: &'a Residual, inputs: &[f64]) -> Self {
        let mut at = function.start().to_vec();
        at.extend(inputs);
        Self {
            residual: equations.values.evaluator(),
            slopes: equations.by_unknowns.tape.evaluator(),
            equations,
            function,
            at,
        }
    }

    /// From now on on these sides, the last of the inputs.
    pub(super) fn hold(&mut self, sides: &[f64]) {
        let first = self.at.len() - sides.len();
        self.at[first..].copy_from_slice(sides);
    }

    pub(super) fn residual(&mut self, z: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; z.len()];
        self.at[..z.len()].copy_from_slice(z);
        self.residual.eval(&self.at, &mut g);
        g
    }

    fn matrix(&mut self, z: &[f64]) -> Vec<f64> {
        let n = z.len();
        let places = &self.equations.by_unknowns.places;
        let mut entries = vec![0.0; places.len()];
        self.at[..n].copy_from_slice(z);
        self.slopes.eval(&self.at, &mut entries);
        let mut matrix = vec![0.0; n * n];
        for (&(i, j), entry) in places.iter().zip(entries) {
            matrix[i * n + j] = entry;
        }
        matrix
    }

    fn within(&self, z: f64, i: usize) -> f64 {
        let range = self.function.range()[i];
        z.clamp(range.lo(), range.hi())
    }

    /// The point where Newton's method ends, be it a root or not. The size of the residual is
    /// measured in rows scaled to one, so that no unit counts more than another.
    pub(super) fn newton(&mut self, start: &[f64]) -> Vec<f64> {
        let start = start.iter().enumerate();
        let mut z: Vec<f64> = start.map(|(i, &z)| self.within(z, i)).collect();
        for _ in 0..STEPS {
            let g = self.residual(&z);
            if g.iter().all(|&g| g == 0.0) {
                return z;
            }
            let mut matrix = self.matrix(&z);
            let scales = row_scales(&matrix, &z, self.function.start());
            let mut step: Vec<f64> = g.iter().map(|g| -g).collect();
            linear::solve(&mut matrix, &mut step);
            if step.iter().any(|step| !step.is_finite()) {
                return z;
            }
            let mut pairs = step.iter().zip(&z);
            let last = pairs.all(|(step, z)| step.abs() <= LAST * z.abs());
            match self.damped(&z, &step, size(&g, &scales), &scales) {
                Some(next) if last => return next,
                Some(next) => z = next,
                None => return z,
            }
        }
        z
    }

    /// The longest of the halved steps that makes the residual smaller.
    fn damped(&mut self, z: &[f64], step: &[f64], before: f64, scales: &[f64]) -> Option<Vec<f64>> {
        let mut fraction = 1.0;
        for _ in 0..HALVINGS {
            let next: Vec<f64> = (z.iter().zip(step).enumerate())
                .map(|(i, (z, step))| self.within(z + fraction * step, i))
                .collect();
            let after = size(&self.residual(&next), scales);
            if after <= (1.0 - fraction / 4.0) * before {
                return Some(next);
            }
            fraction /= 2.0;
        }
        None
    }

    /// Whether g may vanish within a few roundings of z. NaN is none; nor is a jump over zero.
    pub(super) fn is_root(&mut self, z: &[f64]) -> bool {
        let n = z.len();
        let near = |z: f64| Interval::point(z).inflate(LAST * z.abs());
        let p = self.at[n..].iter().map(|&p| near(p));
        let at: Vec<Interval> = z.iter().map(|&z| near(z)).chain(p).collect();
        let steps = self.equations.steps.eval_in(&Intervals, &at);
        if steps.iter().any(|step| !step.is_point()) {
            return self.residual(z).iter().all(|&g| g == 0.0);
        }
        let g = self.equations.values.eval_in(&Intervals, &at);
        g.iter()
            .all(|g| g.contains_zero() && g.lo().is_finite() && g.hi().is_finite())
    }

    /// A single unknown between two values of which g has different signs, the nearest found.
    pub(super) fn bracketed(&mut self) -> Option<Vec<f64>> {
        let start = self.within(self.function.start()[0], 0);
        let range = self.function.range()[0];
        let (mut below, mut above) = (start, start);
        let at_start = self.residual(&[start])[0];
        let (mut low, mut high) = (at_start, at_start);
        let first = 1e-3 * start.abs().max(1.0);
        for turn in 0..SAMPLES {
            let reach = first * 2.0_f64.powi(turn as i32);
            let (down, up) = (self.within(start - reach, 0), self.within(start + reach, 0));
            let (at_down, at_up) = (self.residual(&[down])[0], self.residual(&[up])[0]);
            for (z, g, end, at_end) in [(down, at_down, below, low), (up, at_up, above, high)] {
                if g * at_end < 0.0 {
                    return Some(vec![self.halved((end, at_end), z)]);
                }
            }
            (below, low, above, high) = (down, at_down, up, at_up);
            if down <= range.lo() && up >= range.hi() {
                break;
            }
        }
        None
    }

    /// Halves a bracket down to neighbouring numbers.
    fn halved(&mut self, (mut a, at_a): (f64, f64), mut b: f64) -> f64 {
        for _ in 0..BISECTIONS {
            let middle = 0.5 * a + 0.5 * b;
            if middle == a || middle == b {
                break;
            }
            let g = self.residual(&[middle])[0];
            match g * at_a > 0.0 {
                true => a = middle,
                false => b = middle,
            }
        }
        let (at_a, at_b) = (self.residual(&[a])[0].abs(), self.residual(&[b])[0].abs());
        if at_a < at_b { a } else { b }
    }
}

/// 1/Σⱼ |g_z|ᵢⱼ·|zⱼ|, where an unknown near zero counts as large as its start, or one.
fn row_scales(matrix: &[f64], z: &[f64], start: &[f64]) -> Vec<f64> {
    let n = z.len();
    let weight = |j: usize| match z[j].abs().max(start[j].abs()) {
        0.0 => 1.0,
        size => size,
    };
    let sum = |row: &[f64]| {
        row.iter()
            .enumerate()
            .map(|(j, a)| a.abs() * weight(j))
            .sum::<f64>()
    };
    matrix
        .chunks(n)
        .map(|row| match sum(row) {
            sum if sum > 0.0 && sum.is_finite() => 1.0 / sum,
            _ => 1.0,
        })
        .collect()
}

/// The scaled Euclidean norm; NaN is larger than anything.
fn size(g: &[f64], scales: &[f64]) -> f64 {
    let sum: f64 = g
        .iter()
        .zip(scales)
        .map(|(g, scale)| (g * scale).powi(2))
        .sum();
    if sum.is_nan() {
        f64::INFINITY
    } else {
        sum.sqrt()
    }
}
