//! On which sides of its surfaces a system is.

use super::{REACHED, Switched};
use crate::Dynamics;

/// The argument of a `floor` may be so far beyond the whole numbers that it was between.
const AROUND: f64 = 1e-6;

impl<D: Dynamics> Switched<'_, D> {
    /// Decides on which sides an interval starts.
    pub(super) fn start(&mut self, t: f64, x: &[f64]) {
        self.encounter(t, x);
        self.align(t, x, &[]);
        let reached = self.reached(t, x);
        let at_hand: Vec<usize> = (0..reached.len()).filter(|&i| reached[i]).collect();
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
            let Some(i) = (0..self.values.len()).find(is_new) else {
                break;
            };
            self.decide(i, t, x);
            done.push(i);
            self.align(t, x, &done);
        }
        self.carry();
        self.hold();
    }

    /// Puts the surfaces of each `floor` around where the state is: one may be within another.
    fn encounter(&mut self, t: f64, x: &[f64]) {
        for first in self.pairs() {
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
        let at_hand: Vec<usize> = (0..margins.len()).filter(|&i| margins[i] < 0.0).collect();
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
        let count = self.values.len();
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
                match self.pair(i) {
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
        let mut dx = vec![0.0; x.len()];
        self.derivatives(t, x, &mut dx);
        let speeds = self.speeds(t, x, &dx);
        let functions = self.values.iter().zip(&self.at.largest).zip(&speeds);
        let is_reached = |((value, largest), speed): ((&f64, &f64), &f64)| {
            value.abs() <= REACHED * largest.max(speed.abs() * self.length)
        };
        functions.map(is_reached).collect()
    }

    /// Which side of a surface that is reached carries the state away from it: that one
    /// holds; or neither, and the state slides. On neither side is what stays exactly there.
    fn decide(&mut self, i: usize, t: f64, x: &[f64]) {
        let (value, sides, sliding) = (
            self.values[i],
            self.at.sides.clone(),
            self.at.sliding.clone(),
        );
        let mut speed_on = |side: f64| {
            self.at.sides.copy_from_slice(&sides);
            self.at.sliding.copy_from_slice(&sliding);
            self.at.sides[i] = side;
            self.at.sliding[i] = false;
            self.align(t, x, &[i]);
            let mut dx = vec![0.0; x.len()];
            self.derivatives(t, x, &mut dx);
            self.speeds(t, x, &dx)[i]
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
}

fn side_of(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}
