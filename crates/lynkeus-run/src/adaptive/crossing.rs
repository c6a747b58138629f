//! The instant at which a step crosses a surface on which the right-hand side jumps.

use super::{Adaptive, Leg, Point, resolution};
use crate::relays::{Ahead, Span, Switched};
use crate::{Dynamics, Error};

/// Steps tried to find the crossing.
const TRIES: usize = 60;

/// How often a step that is not accurate is halved on the way to a crossing.
const HALVINGS: usize = 8;

/// A step, where it ends, and how far the surfaces are there.
pub(super) struct Reach {
    pub step: f64,
    pub x: Vec<f64>,
    pub margins: Vec<f64>,
}

impl Adaptive {
    /// The shortest step found that crosses a surface, where the step taken does; `attempt`
    /// makes a step of another length from the same start, and `ahead` is what comes first in it.
    /// None where nothing comes. A step that leads up to it where something bends, or where none
    /// across the surface is accurate.
    pub(super) fn crossing<D: Dynamics>(
        &mut self,
        f: &mut Switched<'_, D>,
        leg: &mut Leg<'_>,
        span: &Span<'_>,
        ahead: Ahead,
        mut attempt: impl FnMut(&mut Switched<'_, D>, f64, &mut Option<Point>) -> Option<Vec<f64>>,
    ) -> Result<Option<Reach>, Error> {
        let (t, step) = (span.from.0, span.step);
        let reach = |f: &mut Switched<'_, D>, step: f64, x: Vec<f64>| {
            let mut margins = vec![];
            f.margins(t + step, &x, &mut margins);
            Reach { step, x, margins }
        };
        let fine = 4.0 * resolution(t + step).max(1e-14 * step);
        let mut end = reach(f, step, span.to.to_vec());
        // the end of the step is across; or another one before it is, or leads up to what comes
        let shorter = match ahead {
            Ahead::Nothing if !end.crosses() => return Ok(None),
            Ahead::Jump { beyond, .. } if beyond < 1.0 || !end.crosses() => Some(beyond),
            Ahead::Stop { at } => Some(at),
            Ahead::Nothing | Ahead::Jump { .. } => None,
        };
        if let Some(part) = shorter {
            let mut shorter = (part * step).max(fine);
            for _ in 0..HALVINGS {
                leg.spend(f)?;
                if let Some(x) = attempt(f, shorter, &mut None) {
                    end = reach(f, shorter, x);
                    break;
                }
                shorter *= 0.5;
            }
            if !end.crosses() {
                return Ok((end.step < step).then_some(end));
            }
        }
        let mut told = match ahead {
            Ahead::Jump { at, .. } => Some(at * step + 0.5 * fine),
            Ahead::Nothing | Ahead::Stop { .. } => None,
        };
        let mut begin = reach(f, 0.0, span.from.1.to_vec());
        let mut rejected = None;
        for turn in 0..TRIES {
            let width = end.step - begin.step;
            if width <= fine {
                break;
            }
            let guess = match turn % 3 {
                _ if let Some(longest) = rejected => begin.step + 0.5 * (longest - begin.step),
                0 if let Some(told) = told.take().filter(|told| *told < end.step) => told,
                2 => begin.step + 0.5 * width,
                _ => between(&begin, &end, fine),
            };
            leg.spend(f)?;
            let Some(x) = attempt(f, guess, &mut None) else {
                // the step that crosses may be accurate and this one not, where what is not
                // held bends on the surface: shorter ones lead up to it
                rejected = Some(guess);
                continue;
            };
            let tried = reach(f, guess, x);
            match tried.crosses() {
                true => (end, rejected) = (tried, None),
                false => begin = tried,
            }
            if rejected.is_some() && begin.step > fine {
                return Ok(Some(begin));
            }
        }
        Ok(Some(end))
    }
}

impl Reach {
    fn crosses(&self) -> bool {
        self.margins.iter().any(|&margin| margin < 0.0)
    }
}

/// Where the first of the surfaces is crossed if their margins change evenly, a little beyond.
fn between(begin: &Reach, end: &Reach, fine: f64) -> f64 {
    let width = end.step - begin.step;
    let zero = |(a, b): (&f64, &f64)| match *b < 0.0 {
        true if *a > 0.0 => a / (a - b),
        true => 0.0,
        false => 1.0,
    };
    let pairs = begin.margins.iter().zip(&end.margins);
    let first = pairs.map(zero).fold(1.0, f64::min);
    let at = begin.step + first * width + 0.5 * fine;
    at.clamp(begin.step + 0.25 * fine, end.step - 0.25 * fine)
}
