//! Whether the latest readings of a sensor agree with what was expected of them: the figures of every judge, over
//! the readings of a window, so that what is over is forgotten.

use std::collections::VecDeque;

use lynkeus::run::credible::{By, CHANCE, CLIP, ENOUGH, FEW};
use lynkeus::run::filter::{Innovation, Reading};

use crate::bytes::{Parser, Writer};

/// So many readings are looked at.
const WINDOW: usize = 64;

/// The latest readings of a sensor beside what was expected of them, by their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Consistency {
    /// time, and the square of the innovation in its deviations: infinite where the gate rejected it
    readings: VecDeque<(f64, f64)>,
}

impl Consistency {
    /// Takes what became of the reading of the row at `t`, in the place of what was known of it before.
    pub fn take(&mut self, t: f64, innovation: &Innovation) {
        let square = match innovation.reading {
            Reading::Missing | Reading::AtLimit => None,
            Reading::Rejected => Some(f64::INFINITY),
            Reading::Taken => (innovation.deviation > 0.0).then(|| {
                (innovation.value / innovation.deviation)
                    .powi(2)
                    .min(CLIP * CLIP)
            }),
        };
        let place = self.readings.partition_point(|(known, _)| *known < t);
        let is_there = self
            .readings
            .get(place)
            .is_some_and(|(known, _)| *known == t);
        match (square, is_there) {
            (Some(square), true) => self.readings[place].1 = square,
            (Some(square), false) => self.readings.insert(place, (t, square)),
            (None, true) => drop(self.readings.remove(place)),
            (None, false) => {}
        }
        if self.readings.len() > WINDOW {
            self.readings.pop_front();
        }
    }

    /// Whether they contradict the estimate, and not by chance.
    pub fn contradicts(&self, by: By) -> bool {
        let all = self.readings.len();
        let taken = || self.readings.iter().map(|r| r.1).filter(|s| s.is_finite());
        let mut count = taken().count();
        if 2 * (all - count) > all && all >= ENOUGH {
            return true;
        }
        let mut squares: f64 = taken().sum();
        if count >= FEW {
            squares -= taken().fold(0.0, f64::max);
            count -= 1;
        }
        // χ² of n is more than 2n + 3x with a probability of e⁻ˣ at most (Laurent and Massart)
        let by_chance = 2.0 * count as f64 - 3.0 * CHANCE.ln();
        squares > by_chance && squares > by.limit().powi(2) * count as f64
    }

    pub fn save(&self, to: &mut Writer) {
        to.word(self.readings.len() as u64);
        for (t, square) in &self.readings {
            to.number(*t);
            to.number(*square);
        }
    }

    pub fn load(from: &mut Parser<'_>) -> Option<Self> {
        let count = from.count(16)?;
        let readings = (0..count).map(|_| Some((from.number()?, from.number()?)));
        Some(Self {
            readings: readings.collect::<Option<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(value: f64) -> Innovation {
        Innovation {
            value,
            deviation: 1.0,
            reading: Reading::Taken,
            ..Innovation::default()
        }
    }

    #[test]
    fn many_far_off_contradict_and_one_glitch_does_not() {
        let mut seen = Consistency::default();
        for k in 0..100 {
            seen.take(f64::from(k), &taken(if k % 2 == 0 { 1.0 } else { -1.0 }));
        }
        assert!(!seen.contradicts(By::Filter));
        seen.take(100.0, &taken(1e6));
        assert!(!seen.contradicts(By::Filter));
        for k in 101..140 {
            seen.take(f64::from(k), &taken(6.0));
        }
        assert!(seen.contradicts(By::Filter));
        // what is over is forgotten
        for k in 140..210 {
            seen.take(f64::from(k), &taken(0.5));
        }
        assert!(!seen.contradicts(By::Filter));
    }

    #[test]
    fn a_row_that_is_gone_over_again_counts_once() {
        let mut seen = Consistency::default();
        for t in [1.0, 3.0, 2.0, 3.0] {
            seen.take(t, &taken(t));
        }
        let times: Vec<f64> = seen.readings.iter().map(|r| r.0).collect();
        assert_eq!(times, [1.0, 2.0, 3.0]);
        let mut to = Writer::default();
        seen.save(&mut to);
        assert_eq!(Consistency::load(&mut Parser(&to.0)), Some(seen));
    }

    #[test]
    fn most_of_them_rejected_contradict() {
        let mut seen = Consistency::default();
        let rejected = Innovation {
            reading: Reading::Rejected,
            ..taken(50.0)
        };
        for k in 0..19 {
            seen.take(f64::from(k), &rejected);
        }
        assert!(!seen.contradicts(By::Filter));
        seen.take(19.0, &rejected);
        assert!(seen.contradicts(By::Filter));
    }
}
