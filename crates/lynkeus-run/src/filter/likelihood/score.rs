//! What a likelihood is told of, and what it comes to.

use crate::filter::censored::{End, Tail};
use crate::{Error, Result};

/// A row of a log.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// its time
    pub t: f64,
    /// one per sensor; not a number where it did not report
    pub readings: &'a [f64],
    /// one per known input
    pub inputs: &'a [f64],
}

/// −log L of a log at θ, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// −log L; infinite or no number where the plant has no value on the way
    pub value: f64,
    /// its derivative by each parameter
    pub gradient: Vec<f64>,
    /// Fisher's information, row by row
    pub information: Vec<f64>,
    /// how many readings there were
    pub readings: usize,
    /// intervals on which the plant had no value where the estimate was ([`ParametricPlant::ranges`](super::ParametricPlant::ranges))
    pub confined: usize,
    /// readings of which plant and sensor are certain: without a variance they have no density, and do not count
    pub certain: usize,
}

/// An innovation on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// the place of its row
    pub row: usize,
    /// its place among the sensors
    pub sensor: usize,
    /// y − ŷ; of a reading at an end of its range the end less ŷ
    pub innovation: f64,
    /// its variance; 0 of a reading of which plant and sensor are certain, which does not count
    pub variance: f64,
    /// whether the reading only says that y is there or beyond
    pub is_at_end: bool,
}

/// ν and σ² of a reading with their derivatives by all parameters.
#[derive(Clone, Debug, Default)]
pub(super) struct Tangents {
    pub ν: f64,
    pub σ2: f64,
    pub dν: Vec<f64>,
    pub dσ2: Vec<f64>,
}

/// # Errors
/// [`Error::Setting`] for another number of something.
pub(super) fn check(what: &str, expected: usize, found: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::setting(what, expected.to_string(), found)),
    }
}

impl Tangents {
    /// Those of a pass; `along(0)` are the derivatives of ν, `along(1)` those of σ².
    pub(super) fn take<const L: usize>(
        &mut self,
        pass: usize,
        [ν, σ2]: [&[f64; L]; 2],
        along: impl Fn(usize) -> [f64; L],
    ) {
        (self.ν, self.σ2) = (ν[0], σ2[0]);
        for (into, tangents) in [&mut self.dν, &mut self.dσ2]
            .into_iter()
            .zip([0, 1].map(along))
        {
            let own = into.iter_mut().skip(pass * L).zip(tangents);
            own.for_each(|(place, tangent)| *place = tangent);
        }
    }
}

impl Tangents {
    /// Neither the estimate nor the sensor has any variance: as [`Root::update`](super::root::Root::update) there is no
    /// correction then, and no density.
    pub(super) fn is_certain(&self) -> bool {
        self.σ2 == 0.0
    }
}

impl Score {
    pub(super) fn none(parameters: usize) -> Self {
        Self {
            value: 0.0,
            gradient: vec![0.0; parameters],
            information: vec![0.0; parameters * parameters],
            readings: 0,
            confined: 0,
            certain: 0,
        }
    }

    pub(super) fn count(&mut self, seen: &Tangents) {
        if seen.is_certain() {
            self.certain += 1;
            return;
        }
        let Tangents { ν, σ2, dν, dσ2 } = seen;
        let weight = 1.0 / σ2;
        let share = ν * weight;
        self.value += 0.5 * (ν * share + (std::f64::consts::TAU * σ2).ln());
        self.readings += 1;
        let [first, second] = [share, 0.5 * (weight - share * share)];
        for ((g, dν), dσ2) in self.gradient.iter_mut().zip(dν).zip(dσ2) {
            *g += dν * first + dσ2 * second;
        }
        let half = 0.5 * weight * weight;
        let rows = self.information.chunks_exact_mut(dν.len().max(1));
        for (row, (own_ν, own_σ2)) in rows.zip(dν.iter().zip(dσ2)) {
            let (a, b) = (own_ν * weight, own_σ2 * half);
            for ((entry, dν), dσ2) in row.iter_mut().zip(dν).zip(dσ2) {
                *entry += a * dν + b * dσ2;
            }
        }
    }

    /// −log Φ(−a) with a = ±ν/σ, whose slope is λ and whose curvature δ.
    pub(super) fn count_end(&mut self, end: End, seen: &Tangents) {
        if seen.is_certain() {
            self.certain += 1;
            return;
        }
        let σ = seen.σ2.sqrt();
        let a = end.sign() * seen.ν / σ;
        let tail = Tail::beyond(a);
        self.value -= tail.log_weight();
        self.readings += 1;
        let tangents = seen.dν.iter().zip(&seen.dσ2);
        let da = tangents.map(|(dν, dσ2)| end.sign() * dν / σ - 0.5 * a * dσ2 / seen.σ2);
        let da: Vec<f64> = da.collect();
        for (p, own) in da.iter().enumerate() {
            self.gradient[p] += tail.mean * own;
            for (q, other) in da.iter().enumerate() {
                self.information[p * da.len() + q] += tail.told() * own * other;
            }
        }
    }
}
