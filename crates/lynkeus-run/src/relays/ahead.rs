//! What a step passes between its ends, from enclosures of its polynomials: no pulse is too short
//! to be seen.

use super::guard::{Along, Guard, Guards, Input};
use super::path::{Path, Poly, Stretch};
use super::{REACHED, Switched};
use crate::Dynamics;
use crate::method::resolution;

/// The solution between two points, as the step found it.
pub(crate) struct Span<'a> {
    /// time and state at the start
    pub from: (f64, &'a [f64]),
    pub step: f64,
    /// the state at the end
    pub to: &'a [f64],
}

/// A first look at a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Glance {
    /// nothing is near
    Clear,
    /// nothing that is free is near; what the state slides along or rests on is seen at the ends
    Ends,
    /// only the course between the ends tells
    Near,
}

/// What comes first in a step, in parts of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ahead {
    Nothing,
    /// a surface is crossed, and the state certainly on the other side at `beyond`
    Jump {
        at: f64,
        beyond: f64,
    },
    /// something bends there; or nothing is known from there on
    Stop {
        at: f64,
    },
}

impl Ahead {
    fn at(self) -> f64 {
        match self {
            Self::Nothing => 1.0,
            Self::Jump { at, .. } | Self::Stop { at } => at,
        }
    }
}

/// How much faster than at all its stages a state may move somewhere in a step.
const FASTER: f64 = 1.5;

/// Stretches that are looked at for one function in a step.
const LOOKS: usize = 2000;

/// What they have to cover of the way for the step to end there; else the rest is sampled.
const USEFUL: f64 = 1e-3;
const SAMPLES: usize = 64;

/// Stretches shorter than this part of a step are not cut any more.
const SHORTEST: f64 = 1e-13;

/// A bend this near to an end of a step is at the end.
const AT_THE_END: f64 = 1e-9;

impl<D: Dynamics> Switched<'_, D> {
    /// Whether there is nothing to watch.
    pub fn is_unwatched(&self) -> bool {
        self.is_plain() && self.guards.is_none()
    }

    /// Whether a step that nowhere was faster than `fastest` may have met a surface or a bend.
    pub fn glance(&mut self, span: &Span<'_>, fastest: impl Fn(usize) -> f64) -> Glance {
        let Some(guards) = self.guards.clone() else {
            return Glance::Ends;
        };
        let (t, h) = (span.from.0, span.step);
        self.inner.beside(t, &mut self.at.beside);
        let half = 0.5 * h;
        self.at.boxes.clear();
        for &i in &guards.reads {
            self.at.boxes.push(match guards.kind(i) {
                Input::Time => [t + half, half],
                Input::State(k) => {
                    let (a, b) = (span.from.1[k], span.to[k]);
                    let reach = (FASTER * half * fastest(k)).max(0.5 * (b - a).abs());
                    [0.5 * (a + b), reach]
                }
                Input::Beside(k) => {
                    let [value, speed] = self.at.beside[k];
                    [value + speed * half, (speed * half).abs()]
                }
            });
        }
        let free = |(i, guard): (usize, &Guard)| {
            if self.is_bound(i) {
                return false;
            }
            let (side, level) = (self.at.sides[i], self.at.levels[i]);
            let lowest = guard
                .over(&self.at.boxes)
                .map(|[low, high]| match side > 0.0 {
                    true => low - level,
                    false => level - high,
                });
            lowest.is_some_and(|lowest| lowest.is_nan() || lowest < 0.0)
        };
        let bends = |guard: &Guard| {
            guard
                .over(&self.at.boxes)
                .is_some_and(|[low, high]| !(low > 0.0 || high < 0.0))
        };
        match guards.surfaces.iter().enumerate().any(free) || guards.bends.iter().any(bends) {
            true => Glance::Near,
            false if self.has_bound() => Glance::Ends,
            false => Glance::Clear,
        }
    }

    /// What comes first between the ends of a step whose states are these polynomials.
    pub fn ahead(&mut self, span: &Span<'_>, states: impl Fn(usize) -> Poly) -> Ahead {
        let Some(guards) = self.guards.clone() else {
            return Ahead::Nothing;
        };
        let path = self.path(&guards, span, states);
        let shortest = SHORTEST.max(resolution(span.from.0 + span.step) / span.step);
        let mut first = Ahead::Nothing;
        for (i, guard) in guards.surfaces.iter().enumerate() {
            if self.is_bound(i) {
                continue;
            }
            let search = Search {
                along: guard.along(&path),
                side: self.at.sides[i],
                level: self.at.levels[i],
                band: REACHED * self.at.largest[i],
                shortest,
            };
            match search.first(0.0, first.at()) {
                Found::Nothing => {}
                Found::Passed { at, beyond } => first = Ahead::Jump { at, beyond },
                Found::Lost { at } => first = Ahead::Stop { at },
            }
        }
        for guard in &guards.bends {
            let along = guard.along(&path);
            if let Some(at) = bend(along, shortest, first.at()) {
                first = Ahead::Stop { at };
            }
        }
        first
    }

    /// Whether the ends of a step have to be looked at, too.
    pub fn has_bound(&self) -> bool {
        self.guards.is_none() || (0..self.values.len()).any(|i| self.is_bound(i))
    }

    /// Whether a surface is not left by passing it: the state slides along it, or stays there.
    fn is_bound(&self, i: usize) -> bool {
        self.at.sliding[i] || self.at.sides[i] == 0.0
    }

    fn path(&mut self, guards: &Guards, span: &Span<'_>, states: impl Fn(usize) -> Poly) -> Path {
        let (t, h) = (span.from.0, span.step);
        self.inner.beside(t, &mut self.at.beside);
        let read = guards.reads.iter().map(|&i| match guards.kind(i) {
            Input::Time => Poly::line(t, h),
            Input::State(k) => states(k),
            Input::Beside(k) => {
                let [value, speed] = self.at.beside[k];
                Poly::line(value, speed * h)
            }
        });
        Path {
            read: read.collect(),
        }
    }
}

/// Where something bends first, before `limit`.
fn bend(along: Along<'_>, shortest: f64, limit: f64) -> Option<f64> {
    let [a, b] = [0.0, 1.0].map(|s| along.at(s).abs());
    let band = 1e-13 * a.max(b);
    // where a step begins at a bend what follows tells the side
    let from = if a <= 1e-10 * a.max(b) {
        AT_THE_END
    } else {
        0.0
    };
    let side = if along.at(from) < 0.0 { -1.0 } else { 1.0 };
    let search = Search {
        along,
        side,
        level: 0.0,
        band,
        shortest,
    };
    match search.first(from, limit) {
        Found::Nothing => None,
        Found::Passed { at, .. } | Found::Lost { at } => {
            (at > AT_THE_END && at < 1.0 - AT_THE_END).then_some(at)
        }
    }
}

/// The search for where a function leaves its side.
struct Search<'a> {
    along: Along<'a>,
    side: f64,
    level: f64,
    /// nobody asks which side it is so close
    band: f64,
    shortest: f64,
}

enum Found {
    Nothing,
    Passed {
        at: f64,
        beyond: f64,
    },
    /// what comes after that is too much
    Lost {
        at: f64,
    },
}

impl Search<'_> {
    fn margin(&self, s: f64) -> f64 {
        self.side * (self.along.at(s) - self.level)
    }

    /// Bounds of the margin, from those of the function.
    fn margins(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        match self.side > 0.0 {
            true => [low - self.level, high - self.level],
            false => [self.level - high, self.level - low],
        }
    }

    /// The first passage in [from, limit], stretch by stretch from left to right.
    fn first(mut self, from: f64, limit: f64) -> Found {
        // what velocities have put on a side may have to go some way to it
        let begins = self.margin(from);
        if begins < 0.0 {
            self.band = self.band.max(-2.0 * begins);
        }
        let mut left = vec![(from, limit)];
        for _ in 0..LOOKS {
            let Some((from, to)) = left.pop() else {
                return Found::Nothing;
            };
            match self.look(Stretch { from, to }) {
                Look::Clear => {}
                Look::Beyond(beyond) => {
                    let at = self.root(0.0, beyond);
                    return Found::Passed { at, beyond };
                }
                Look::Open => {
                    let middle = 0.5 * (from + to);
                    left.extend([(middle, to), (from, middle)]);
                }
            }
        }
        match left.pop() {
            None => Found::Nothing,
            // so far nothing is passed: the next step goes on from there
            Some((at, _)) if at - from > USEFUL * (limit - from) => Found::Lost { at },
            Some((at, _)) => self.sampled(at, limit),
        }
    }

    /// Of what cannot be enclosed, as an algebraic loop that is searched, samples tell.
    fn sampled(&self, from: f64, to: f64) -> Found {
        let samples = (1..=SAMPLES).map(|k| from + (to - from) * k as f64 / SAMPLES as f64);
        let mut passed = samples.filter(|&s| self.margin(s) < -self.band);
        passed
            .next()
            .map_or(Found::Nothing, |beyond| Found::Passed {
                at: self.root(0.0, beyond),
                beyond,
            })
    }

    fn look(&self, stretch: Stretch) -> Look {
        let Stretch { from, to } = stretch;
        let is_short = to - from <= self.shortest;
        let sampled = |s: f64| match self.margin(s) < -self.band {
            true => Look::Beyond(s),
            false => Look::Clear,
        };
        match self.along.range(stretch).map(|r| self.margins(r)) {
            // no value anywhere
            None => return Look::Clear,
            Some([low, _]) if low >= -self.band => return Look::Clear,
            Some([_, high]) if high < -self.band => return Look::Beyond(to),
            _ if is_short => return sampled(stretch.middle()),
            _ => {}
        }
        let Some([least, most]) = self.along.slope(stretch) else {
            return Look::Open;
        };
        if least >= 0.0 || most <= 0.0 {
            return match (sampled(from), sampled(to)) {
                (Look::Clear, at_end) => at_end,
                (beyond, _) => beyond,
            };
        }
        let reach = least.abs().max(most.abs()) * stretch.radius();
        match self.margin(stretch.middle()) - reach >= -self.band {
            true => Look::Clear,
            false => Look::Open,
        }
    }

    /// Where the margin ends before `beyond`, at which it is negative and up to which it ends once.
    fn root(&self, mut from: f64, mut beyond: f64) -> f64 {
        if self.margin(from) < 0.0 {
            return from;
        }
        while beyond - from > self.shortest {
            let middle = 0.5 * (from + beyond);
            match self.margin(middle) < 0.0 {
                true => beyond = middle,
                false => from = middle,
            }
        }
        beyond
    }
}

enum Look {
    /// nothing is passed
    Clear,
    /// it is passed before there
    Beyond(f64),
    Open,
}
