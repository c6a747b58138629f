//! Motion along surfaces that both sides push the state onto.

use nalgebra::{DMatrix, DVector};

use super::Switched;
use crate::Dynamics;

impl<D: Dynamics> Switched<'_, D> {
    /// How fast the functions of the surfaces change as the state moves with dx: a central
    /// difference, exact for what is affine.
    pub(super) fn speeds(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        let size = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let stays = (1e-5 * size(x).max(1e-3)) / size(dx).max(f64::MIN_POSITIVE);
        let step = (1e-5 * self.length).min(stays);
        let mut at = |step: f64| {
            let moved: Vec<f64> = x.iter().zip(dx).map(|(x, dx)| x + step * dx).collect();
            let mut values = vec![0.0; self.parts.len()];
            self.read(t + step, &moved, &mut values);
            values
        };
        let (after, before) = (at(step), at(-step));
        let speed = |(after, before): (&f64, &f64)| (after - before) / (2.0 * step);
        after.iter().zip(&before).map(speed).collect()
    }

    /// f + Σ part·(f on the other side − f), with the parts that keep the state on every
    /// surface it slides along.
    pub(super) fn slide(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        let along: Vec<usize> = (0..self.parts.len())
            .filter(|&i| self.at.sliding[i])
            .collect();
        self.inner.derivatives(t, x, dx);
        self.mend(t, x, dx);
        let here = self.speeds(t, x, dx);
        let mut others = vec![];
        let mut matrix = DMatrix::zeros(along.len(), along.len());
        for (column, &i) in along.iter().enumerate() {
            let mut other = vec![0.0; x.len()];
            let sides = self.at.sides.clone();
            self.turn(i, t, x);
            self.inner.derivatives(t, x, &mut other);
            self.mend(t, x, &mut other);
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
        let parts = matrix
            .lu()
            .solve(&right)
            .unwrap_or_else(|| DVector::repeat(along.len(), 0.5));
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
        let [mut before, mut after] = [vec![0.0; count], vec![0.0; count]];
        let is_alone = count == 1;
        if !is_alone {
            self.read(t, x, &mut before);
        }
        self.at.sides[i] = -self.at.sides[i];
        self.hold();
        if is_alone {
            return;
        }
        self.read(t, x, &mut after);
        for j in (0..count).filter(|&j| !self.at.sliding[j]) {
            if before[j] * after[j] < 0.0 {
                self.at.sides[j] = -self.at.sides[j];
            }
        }
        self.hold();
    }
}
