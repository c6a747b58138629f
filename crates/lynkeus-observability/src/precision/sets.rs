//! Which sensors help most.

use super::{Deviations, Precision, share, side_by_side};

/// Sets of one size that are all tried; beyond, only exchanges of one sensor are.
const MOST_SETS: usize = 20_000;

/// Relative errors below this are equally good: sixteen digits are more than any noise.
const LEAST: f64 = 1e-12;

/// Sensors, and what they tell at the longest horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorSet {
    /// indices of the sensors, increasing
    pub sensors: Vec<usize>,
    /// standard errors
    pub deviations: Deviations,
    /// mean over the quantities that are seen of ln(present standard error / scale)
    pub score: f64,
    /// number of quantities that are not seen
    pub unseen: usize,
    /// the quantity with the greatest present standard error relative to its scale
    pub worst: usize,
}

/// Sensor sets in order, the best first.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// the sensors there are
    pub present: SensorSet,
    /// sets as large as the present one, which is among them
    pub same_size: Vec<SensorSet>,
    /// true where every set of that size was tried, and not only exchanges of one sensor
    pub is_complete: bool,
    /// the present sensors and one more
    pub additions: Vec<SensorSet>,
    /// single sensors
    pub singles: Vec<SensorSet>,
    /// pairs; empty where there are too many
    pub pairs: Vec<SensorSet>,
}

impl Precision {
    /// The set with what it tells at the longest horizon.
    pub fn judge(&self, sensors: &[usize]) -> SensorSet {
        let mut sensors = sensors.to_vec();
        sensors.sort_unstable();
        sensors.dedup();
        let last = self.horizons.len().saturating_sub(1);
        let deviations = self.deviations(last, &sensors);
        let relative = self.relative(&deviations);
        let seen = || relative.iter().filter(|r| r.is_finite());
        // what is certain has no say in the mean
        let told = || seen().filter(|r| **r > 0.0);
        let count = told().count();
        let sum: f64 = told().map(|r| r.max(LEAST).ln()).sum();
        let worst = (0..relative.len()).max_by(|&i, &j| relative[i].total_cmp(&relative[j]));
        SensorSet {
            sensors,
            deviations,
            score: sum / count.max(1) as f64,
            unseen: relative.len() - seen().count(),
            worst: worst.unwrap_or(0),
        }
    }

    /// Present standard errors as shares of the scales.
    pub fn relative(&self, deviations: &Deviations) -> Vec<f64> {
        let pairs = deviations.present.iter().zip(&self.scales);
        pairs.map(|(σ, scale)| σ / scale).collect()
    }

    /// Tries the sensors `candidates` (indices) alone, in pairs, in sets as large as `present`, and
    /// beside it, in parallel.
    pub fn advise(&self, present: &[usize], candidates: &[usize]) -> Advice {
        let present = self.judge(present);
        let mut all: Vec<usize> = candidates.iter().chain(&present.sensors).copied().collect();
        all.sort_unstable();
        all.dedup();
        let size = present.sensors.len();
        let (same_size, is_complete) = match choose(all.len(), size) <= MOST_SETS {
            true => (subsets(&all, size), true),
            false => (exchanges(&all, &present.sensors), false),
        };
        let others = || all.iter().filter(|c| !present.sensors.contains(c));
        let additions = others().map(|c| with(&present.sensors, *c)).collect();
        let pairs = match choose(all.len(), 2) <= MOST_SETS {
            true => subsets(&all, 2),
            false => vec![],
        };
        Advice {
            same_size: self.ranked(same_size),
            is_complete,
            additions: self.ranked(additions),
            singles: self.ranked(subsets(&all, 1)),
            pairs: self.ranked(pairs),
            present,
        }
    }

    /// Judges sets in parallel: fewest unseen first, then by score.
    fn ranked(&self, sets: Vec<Vec<usize>>) -> Vec<SensorSet> {
        let work = |some: &[Vec<usize>]| -> Vec<SensorSet> {
            let judged = some.iter().map(|set| self.judge(set));
            // what comes after the end does not count
            judged
                .take_while(|_| self.budget.spent().is_none())
                .collect()
        };
        let mut judged = side_by_side(sets.chunks(share(sets.len())), work).concat();
        judged.sort_by(|a, b| a.unseen.cmp(&b.unseen).then(a.score.total_cmp(&b.score)));
        judged
    }
}

/// Number of subsets of a size, as far as it can be counted.
fn choose(count: usize, size: usize) -> usize {
    (0..size).fold(1, |ways: usize, k| {
        ways.saturating_mul(count.saturating_sub(k)) / (k + 1)
    })
}

/// All subsets of a size.
fn subsets(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    let Some(rest) = size.checked_sub(1) else {
        return vec![vec![]];
    };
    let starting = |(i, first): (usize, &usize)| -> Vec<Vec<usize>> {
        let mut sets = subsets(&of[i + 1..], rest);
        sets.iter_mut().for_each(|set| set.insert(0, *first));
        sets
    };
    of.iter().enumerate().flat_map(starting).collect()
}

/// The present set, and every set with one of its sensors replaced.
fn exchanges(all: &[usize], present: &[usize]) -> Vec<Vec<usize>> {
    let mut sets = vec![present.to_vec()];
    for removed in present {
        let rest: Vec<usize> = present.iter().filter(|s| *s != removed).copied().collect();
        let others = all.iter().filter(|c| !present.contains(c));
        sets.extend(others.map(|c| with(&rest, *c)));
    }
    sets
}

fn with(set: &[usize], one: usize) -> Vec<usize> {
    let mut set = set.to_vec();
    set.push(one);
    set
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subsets_are_counted_and_listed() {
        assert_eq!(subsets(&[1, 4, 7], 2), [vec![1, 4], vec![1, 7], vec![4, 7]]);
        assert_eq!(subsets(&(0..9).collect::<Vec<_>>(), 4).len(), choose(9, 4));
        assert_eq!(choose(3, 5), 0);
        assert_eq!(exchanges(&[0, 1, 2, 3], &[1, 2]).len(), 5);
    }
}
