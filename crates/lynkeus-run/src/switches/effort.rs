//! What following the switches of a system may cost, in an interval and in a run.

use super::timeline::apart;
use crate::Error;
use crate::snapshot::{Damaged, Persist, Walk};

/// Switching instants allowed in one interval, over all indicators of a system.
const SWITCHES: usize = 100_000;

/// Stretches that may be looked at for them.
const LOOKS: usize = 500_000;

/// What a run may have in all, in multiples of what an interval may.
const INTERVALS: usize = 4;

/// What each interval adds to that of the run.
const MORE_SWITCHES: usize = 1000;
const MORE_LOOKS: usize = 4000;

/// Part of the interval in which rounding errors may hide the mode.
pub(super) const DOUBTFUL: f64 = 1e-6;

/// What following the switches over all intervals of a run may still cost.
#[derive(Clone, Debug)]
pub(super) struct Allowance {
    /// start of the first interval
    since: Option<f64>,
    switches: usize,
    /// switches found and left
    granted: usize,
    looks: usize,
}

impl Default for Allowance {
    fn default() -> Self {
        Self {
            since: None,
            switches: INTERVALS * SWITCHES,
            granted: INTERVALS * SWITCHES,
            looks: INTERVALS * LOOKS,
        }
    }
}

impl Persist for Allowance {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.optional(&mut self.since, Walk::number)?;
        walk.count(&mut self.switches)?;
        walk.count(&mut self.granted)?;
        walk.count(&mut self.looks)
    }
}

impl Allowance {
    /// What the interval may cost.
    pub(super) fn effort(&mut self, from: f64, to: f64) -> Effort {
        let since = *self.since.get_or_insert(from);
        self.switches = self.switches.saturating_add(MORE_SWITCHES);
        self.granted = self.granted.saturating_add(MORE_SWITCHES);
        self.looks = self.looks.saturating_add(MORE_LOOKS);
        let (counted_from, limit) = match self.switches < SWITCHES {
            true => (since, self.granted),
            false => (from, SWITCHES),
        };
        Effort {
            from,
            to,
            switches: self.switches.min(SWITCHES),
            looks: self.looks.min(LOOKS),
            counted_from,
            limit,
            doubtful: DOUBTFUL * (to - from),
        }
    }

    /// Takes what the interval cost.
    pub(super) fn pay(&mut self, effort: &Effort) {
        let spent = |left: usize, most: usize, now: usize| left - (left.min(most) - now);
        self.switches = spent(self.switches, SWITCHES, effort.switches);
        self.looks = spent(self.looks, LOOKS, effort.looks);
    }
}

/// What following the switches over an interval may still cost.
#[derive(Debug)]
pub(super) struct Effort {
    pub from: f64,
    pub to: f64,
    switches: usize,
    looks: usize,
    /// where the switches that the limit is for begin
    counted_from: f64,
    limit: usize,
    /// length of time on which rounding errors may still hide a mode
    doubtful: f64,
}

impl Effort {
    /// Pays for one look.
    pub(super) fn look(&mut self, at: f64, expression: &str) -> Result<(), Error> {
        self.looks = self
            .looks
            .checked_sub(1)
            .ok_or_else(|| unresolved(at, expression))?;
        Ok(())
    }

    /// Pays for a stretch at `at` on which the mode is not certain.
    pub(super) fn doubt(&mut self, at: f64, width: f64, expression: &str) -> Result<(), Error> {
        // around a simple zero some last bits are always in doubt
        if width > 64.0 * apart(at) {
            self.doubtful -= width;
        }
        if self.doubtful < 0.0 {
            return Err(unresolved(at, expression));
        }
        Ok(())
    }

    /// Refuses more than the switches that are left.
    pub(super) fn check(&self, count: f64, expression: &str) -> Result<(), Error> {
        if count <= self.switches as f64 {
            return Ok(());
        }
        Err(Error::TooManySwitches {
            expression: expression.to_owned(),
            from: self.counted_from,
            to: self.to,
            limit: self.limit,
        })
    }

    /// Pays for a switch.
    pub(super) fn switch(&mut self, expression: &str) -> Result<(), Error> {
        self.check(1.0, expression)?;
        self.switches -= 1;
        Ok(())
    }
}

fn unresolved(time: f64, expression: &str) -> Error {
    Error::UnresolvedSwitches {
        expression: expression.to_owned(),
        time,
    }
}
