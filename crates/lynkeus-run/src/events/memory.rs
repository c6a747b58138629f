//! What is remembered of clauses, and whether their events come to an end.

use lynkeus_model::Timer;

use super::when::{Clauses, SAME, Seen, first_after};
use crate::grid::Grid;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, Result};

/// No condition came to hold, and discrete variables have changed.
pub(super) const NONE: usize = usize::MAX;

/// Events in a row that come sooner and sooner, down to so small a share of the time since the first of them.
const HURRIED: usize = 5;
const SOON: f64 = 1e-4;

/// Events in a row between which time hardly goes on, against the time that it is.
const AT_ONCE: usize = 200;
const HARDLY: f64 = 1e-12;

/// What happens in the last part of an interval that is no larger share of it happens at its end.
const AT_END: f64 = 1e-9;

/// A quantity that goes so far beyond where it was at the last of them, against its largest value, is
/// not held back any more.
const BEYOND: f64 = 1e-6;

/// What is remembered of clauses from one event to the next.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    pub(super) is_started: bool,
    /// whether each condition holds
    pub(super) truths: Vec<bool>,
    /// the next instant of each timer
    pub(super) timers: Vec<usize>,
    /// the state at the end of the last interval
    pub(super) last: Vec<f64>,
    /// the interval that is gone through
    interval: (f64, f64),
    /// relations that changed at the end of the last interval, and whether they held then
    pub(super) left: Vec<(usize, bool)>,
    /// of each clause
    hurry: Vec<Hurry>,
    /// when any clause took effect last, and events in a row between which time hardly went on
    newest: f64,
    at_once: usize,
    /// a clause that takes effect ever sooner, and its relation
    suspect: Option<(usize, usize)>,
    /// events by the state since somebody counts them, and how many there may be
    happened: usize,
    allowed: Option<usize>,
}

/// When a clause took effect.
#[derive(Clone, Copy, Debug)]
struct Hurry {
    /// last
    at: f64,
    /// so long after the time before
    apart: f64,
    /// how often in a row sooner than before, and since when
    streak: usize,
    since: f64,
}

impl Default for Hurry {
    fn default() -> Self {
        Self {
            at: f64::NEG_INFINITY,
            apart: f64::INFINITY,
            streak: 0,
            since: 0.0,
        }
    }
}

impl Persist for Memory {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        // none of a system without clauses: nothing is kept of it
        let mut count = walk.length(self.truths.len())?;
        self.truths.resize(count, false);
        self.truths.iter_mut().try_for_each(|t| walk.flag(t))?;
        self.is_started = count > 0;
        count = walk.length(self.timers.len())?;
        self.timers.resize(count, 0);
        self.timers.iter_mut().try_for_each(|t| walk.count(t))?;
        count = walk.length(self.last.len())?;
        self.last.resize(count, 0.0);
        walk.numbers(&mut self.last)?;
        count = walk.length(self.left.len())?;
        self.left.resize(count, (0, false));
        for (relation, held) in &mut self.left {
            walk.count(relation)?;
            walk.flag(held)?;
        }
        count = walk.length(self.hurry.len())?;
        self.hurry.resize(count, Hurry::default());
        for hurry in &mut self.hurry {
            walk.number(&mut hurry.at)?;
            walk.number(&mut hurry.apart)?;
            walk.count(&mut hurry.streak)?;
            walk.number(&mut hurry.since)?;
        }
        walk.number(&mut self.newest)?;
        walk.count(&mut self.at_once)?;
        walk.optional(&mut self.suspect, |walk, suspect| {
            walk.count(&mut suspect.0)?;
            walk.count(&mut suspect.1)
        })
    }
}

impl Memory {
    pub(super) fn begin(&mut self, clauses: &Clauses, t: f64) {
        self.is_started = true;
        let first = |timer: &Timer| match timer.is_initial {
            true => 0,
            false => first_after(timer, t),
        };
        self.timers = clauses.shape.timers.iter().map(first).collect();
        self.hurry = vec![Hurry::default(); clauses.shape.clauses.len()];
    }

    /// Counts events by the state from now on, of which there may be so many.
    pub(crate) fn count(&mut self, allowed: Option<usize>) {
        (self.happened, self.allowed) = (0, allowed);
    }

    /// How many there were.
    pub(crate) fn happened(&self) -> usize {
        self.happened
    }

    /// One more.
    pub(super) fn note(&mut self) {
        self.happened += 1;
    }

    /// Whether there may be no more.
    pub(super) fn is_spent(&self) -> bool {
        self.allowed.is_some_and(|allowed| self.happened >= allowed)
    }

    /// Whether a timer is due.
    pub(super) fn is_due(&self, clauses: &Clauses, t: f64) -> bool {
        let timers = clauses.shape.timers.iter().zip(&self.timers);
        let mut timers = timers.filter(|(timer, _)| !timer.is_initial);
        timers.any(|(timer, &next)| {
            Grid::new(timer.start, timer.interval).time(next) <= t + SAME * t.abs()
        })
    }

    /// An interval begins.
    pub(crate) fn enter(&mut self, from: f64, to: f64) {
        self.interval = (from, to);
    }

    /// Whether a time is the end of the interval, as near as makes no difference.
    pub(super) fn is_at_end(&self, t: f64) -> bool {
        let (from, to) = self.interval;
        (0.0..=AT_END * (to - from) + SAME * t.abs()).contains(&(to - t))
    }

    /// Relations have changed at the end of an interval: what comes of that is for the next one.
    pub(super) fn keep(&mut self, flipped: &[usize], seen: &[Seen]) {
        let held = flipped
            .iter()
            .filter_map(|&r| Some((r, seen.get(r)?.holds)));
        self.left.extend(held);
    }

    /// The relations that changed at the end of the last interval, of which nothing has come yet.
    pub(crate) fn left(&self) -> Vec<usize> {
        self.left.iter().map(|(relation, _)| *relation).collect()
    }

    /// An interval is over.
    pub(crate) fn leave(&mut self, x: &[f64]) {
        self.last.clear();
        self.last.extend_from_slice(x);
    }

    /// A condition came to hold at `t`: whether clauses come ever sooner.
    pub(super) fn hurried(
        &mut self,
        clauses: &Clauses,
        t: f64,
        condition: usize,
        relation: Option<usize>,
    ) -> Result<()> {
        if condition == NONE {
            return Ok(());
        }
        let k = clauses.clause_of(condition);
        let hurry = &mut self.hurry[k];
        let now = t - hurry.at;
        let hardly = now <= HARDLY * t.abs();
        // rounding decides which of such times is the shorter one
        let is_sooner = now < hurry.apart || hardly;
        (hurry.streak, hurry.since) = match is_sooner && hurry.at.is_finite() {
            true => (hurry.streak + 1, hurry.since),
            false => (0, t),
        };
        (hurry.at, hurry.apart) = (t, now);
        let is_suspect = hurry.streak >= HURRIED && now <= SOON * (t - hurry.since);
        self.suspect = relation
            .filter(|_| is_suspect)
            .map(|relation| (k, relation));
        let apart = t - std::mem::replace(&mut self.newest, t);
        self.at_once = match apart <= HARDLY * t.abs() {
            true => self.at_once + 1,
            false => 0,
        };
        match self.at_once > AT_ONCE {
            true => Err(Error::EndlessEvents {
                time: t,
                line: clauses.line_of(condition),
                how: "its events follow each other without time going on (a threshold without hysteresis, or a Zeno point)".to_owned(),
            }),
            false => Ok(()),
        }
    }

    /// Whether something is suspected.
    pub(crate) fn suspects(&self) -> bool {
        self.suspect.is_some()
    }

    /// That what took effect ever sooner still holds the state back: quantities as they are at `t`, and
    /// how large they were.
    pub(crate) fn check(
        &mut self,
        clauses: &Clauses,
        t: f64,
        seen: &[Seen],
        largest: impl Fn(usize) -> f64,
    ) -> Result<()> {
        let Some((k, relation)) = self.suspect else {
            return Ok(());
        };
        let Seen { holds, value } = seen[relation];
        if holds && value > BEYOND * largest(relation) {
            return Err(Error::EndlessEvents {
                time: t,
                line: clauses.shape.clauses[k].line,
                how: "its events come sooner and sooner, and end at this time (Zeno's paradox)"
                    .to_owned(),
            });
        }
        Ok(())
    }

    /// What a correction of the state has changed is no event, but where the flow goes on into it: of
    /// the conditions that hold since then, those that are to take effect keep it to be found.
    pub(super) fn rebase(
        &mut self,
        truths: &[bool],
        needs: &[Vec<usize>],
        away: &[bool],
        flipped: &[bool],
    ) {
        for (c, truth) in truths.iter().enumerate() {
            let own: Vec<usize> = needs[c].iter().copied().filter(|&r| flipped[r]).collect();
            let leaves = !own.is_empty() && own.iter().all(|&r| away[r]);
            if !truth || leaves {
                self.truths[c] = *truth;
            }
        }
    }
}
