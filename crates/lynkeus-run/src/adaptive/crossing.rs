//! The instant at which a step crosses a surface on which the right-hand side jumps.

use super::{Adaptive, Leg, Point, resolution};
use crate::relays::Switched;
use crate::{Dynamics, Error};

/// Steps tried to find the crossing.
const TRIES: usize = 60;

/// A step, where it ends, and how far the surfaces are there.
pub(super) struct Reach {
    pub step: f64,
    pub x: Vec<f64>,
    pub margins: Vec<f64>,
}

impl Adaptive {
    /// The shortest step found that crosses a surface, where the step taken does; `attempt`
    /// makes a step of another length from the same start. None where none is crossed; a step that
    /// leads up to the surface where none across it is accurate.
    pub(super) fn crossing<D: Dynamics>(
        &mut self,
        f: &mut Switched<'_, D>,
        leg: &mut Leg<'_>,
        start: &[f64],
        taken: (f64, &[f64]),
        mut attempt: impl FnMut(&mut Switched<'_, D>, f64, &mut Option<Point>) -> Option<Vec<f64>>,
    ) -> Result<Option<Reach>, Error> {
        if f.is_plain() {
            return Ok(None);
        }
        let t = leg.t;
        let reach = |f: &mut Switched<'_, D>, step: f64, x: Vec<f64>| {
            let mut margins = vec![];
            f.margins(t + step, &x, &mut margins);
            Reach { step, x, margins }
        };
        let (step, x) = taken;
        let mut end = reach(f, step, x.to_vec());
        if !end.crosses() {
            let Some(part) = f.dip((leg.t, start), (leg.t + step, x)) else {
                return Ok(None);
            };
            let Some(x) = attempt(f, part * step, &mut None) else {
                return Ok(None);
            };
            end = reach(f, part * step, x);
            if !end.crosses() {
                return Ok(None);
            }
        }
        let mut begin = reach(f, 0.0, start.to_vec());
        let fine = 4.0 * resolution(leg.t + step).max(1e-14 * step);
        let mut rejected = None;
        for turn in 0..TRIES {
            let width = end.step - begin.step;
            if width <= fine {
                break;
            }
            let guess = match turn % 3 {
                _ if let Some(longest) = rejected => begin.step + 0.5 * (longest - begin.step),
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
