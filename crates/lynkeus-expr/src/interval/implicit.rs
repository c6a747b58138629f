//! Enclosures of implicit functions: z with g(z, p) = 0 for every p of a box.
//!
//! Newton's operator N = x̃ − A⁻¹ g(x̃, P), with every slope of g on X × P in A, holds all roots
//! that X holds, and where A is regular there is at most one for each p. There is one where
//! N ⊆ X (e.g. Neumaier, *Interval Methods for Systems of Equations*, theorem 5.1.7), or where
//! a preconditioned g has opposite signs on opposite faces (Miranda), which wide P leave in
//! sight longer. All that needs g to be continuous on X, so that no slope is missing. What cannot be proved so is bounded by the
//! boxes on which g may vanish, and marked as not defined.

use std::collections::VecDeque;

use super::solve::{invert, solve};
use super::{Interval, Intervals};
use crate::Implicit;

/// Newton steps on one box.
const STEPS: usize = 24;
/// Boxes that the range is split into, at most.
const BOXES: usize = 96;
/// Boxes looked at between two attempts on their hull.
const OFTEN: usize = 12;
/// Slices cut from either end of a side, at most.
const SLICES: usize = 12;

type Sides = Vec<Interval>;

/// A box that holds every root of the box it came from.
struct Shrunk {
    sides: Sides,
    /// for every p there is one root, and only one
    proved: bool,
}

/// Encloses z for all p: defined where there is exactly one root in the declared range for
/// every p, empty where there is none for any.
pub(super) fn enclose(function: &Implicit, p: &[Interval]) -> Sides {
    let n = function.size();
    if p.iter().any(|p| p.is_empty()) {
        return vec![Interval::EMPTY; n];
    }
    let search = Search { function, p };
    let Some(found) = search.whole() else {
        return vec![Interval::EMPTY; n];
    };
    let defined = found.proved && p.iter().all(|p| p.is_defined());
    let sides = found.sides.into_iter();
    sides.map(|side| side.and_defined(defined)).collect()
}

struct Search<'a> {
    function: &'a Implicit,
    p: &'a [Interval],
}

impl Search<'_> {
    /// The declared range; none where it holds no root.
    fn whole(&self) -> Option<Shrunk> {
        let whole = self.shrunk(self.function.range().to_vec())?;
        match whole.proved {
            true => Some(self.shaved(whole)),
            false => self.paved(whole.sides),
        }
    }

    fn at(&self, z: &[Interval]) -> Sides {
        [z, self.p].concat()
    }

    /// Newton's operator again and again, until it brings no more.
    fn shrunk(&self, mut sides: Sides) -> Option<Shrunk> {
        let mut proved = false;
        for _ in 0..STEPS {
            let at = self.at(&sides);
            let g = self.function.residual(&Intervals, &at);
            if g.iter().any(|g| !g.contains_zero()) {
                return None;
            }
            let regular = g.iter().all(|g| g.is_defined()) && self.is_continuous(&at);
            let slopes = regular.then(|| self.function.matrix(&Intervals, &at));
            let image = slopes
                .as_ref()
                .and_then(|slopes| self.newton(&sides, slopes));
            let (Some(slopes), Some(image)) = (slopes, image) else {
                break;
            };
            let pairs = || image.iter().zip(&sides);
            let inside = pairs().all(|(n, x)| n.is_subset(*x));
            proved = proved || inside || self.changes_sign(&sides, &slopes);
            let next: Sides = pairs().map(|(n, x)| n.intersection(*x)).collect();
            if next.iter().any(|side| side.is_empty()) {
                return None;
            }
            let mut pairs = next.iter().zip(&sides);
            let gains = pairs.any(|(n, x)| n.width() < 0.9 * x.width());
            sides = next;
            if !gains {
                break;
            }
        }
        Some(Shrunk { sides, proved })
    }

    /// Whether nothing in g jumps on the box.
    fn is_continuous(&self, at: &[Interval]) -> bool {
        let steps = self.function.steps_in(&Intervals, at);
        steps.iter().all(|step| step.is_point())
    }

    /// x̃ − A⁻¹ g(x̃, P), where A is regular.
    fn newton(&self, sides: &[Interval], slopes: &[Interval]) -> Option<Sides> {
        let middle = self.middle(sides);
        let there: Sides = middle.iter().map(|&x| Interval::point(x)).collect();
        let g = self.function.residual(&Intervals, &self.at(&there));
        let known = slopes.iter().chain(&g).all(|value| value.is_defined());
        let negative: Sides = g.iter().map(|&g| -g).collect();
        let (step, regular) = known.then(|| solve(slopes, &negative))?;
        let image = there.iter().zip(step).map(|(&x, step)| x + step);
        regular.then(|| image.collect())
    }

    /// Whether (C g)ᵢ has opposite signs where zᵢ is at either end, for every i and a C that
    /// makes the slopes in the middle the identity.
    fn changes_sign(&self, sides: &[Interval], slopes: &[Interval]) -> bool {
        let n = sides.len();
        if !sides.iter().all(|side| side.width().is_finite()) {
            return false;
        }
        let middle: Vec<f64> = slopes.iter().map(|slope| slope.midpoint()).collect();
        let Some(c) = invert(&middle, n) else {
            return false;
        };
        let face = |i: usize, end: f64| {
            let mut there = sides.to_vec();
            there[i] = Interval::point(end);
            let g = self.function.residual(&Intervals, &self.at(&there));
            let terms = g.iter().zip(&c[i * n..]);
            terms.fold(Interval::ZERO, |sum, (&g, &c)| sum + Interval::point(c) * g)
        };
        let changes = (0..n).all(|i| {
            let (low, high) = (face(i, sides[i].lo()), face(i, sides[i].hi()));
            !low.is_empty() && !high.is_empty() && low.hi() <= 0.0 && high.lo() >= 0.0
        });
        // where C were singular, C g could vanish and g not
        let exact: Sides = c.iter().map(|&c| Interval::point(c)).collect();
        changes && solve(&exact, &vec![Interval::ZERO; n]).1
    }

    /// A point of the box: the declared start where a side has no end.
    fn middle(&self, sides: &[Interval]) -> Vec<f64> {
        let starts = self.function.start().iter();
        let side = |(side, &start): (&Interval, &f64)| match side.lo().is_finite()
            && side.hi().is_finite()
        {
            true => side.midpoint(),
            false => start.clamp(side.lo(), side.hi()),
        };
        sides.iter().zip(starts).map(side).collect()
    }

    /// Splits the box and drops the parts without a root; then tries the hull of what is left.
    fn paved(&self, sides: Sides) -> Option<Shrunk> {
        let mut open = VecDeque::from([sides]);
        let mut single: Option<Sides> = None;
        for turn in 1..=BOXES {
            let Some(widest) = open.pop_front() else {
                break;
            };
            for half in self.halves(&widest) {
                match self.shrunk(half) {
                    None => {}
                    Some(part) if part.proved && single.is_none() => single = Some(part.sides),
                    Some(part) => open.push_back(part.sides),
                }
            }
            let all = || open.iter().chain(&single);
            all().next()?;
            if open.is_empty() {
                let proved = true;
                return single.map(|sides| self.shaved(Shrunk { sides, proved }));
            }
            if turn % OFTEN == 0 {
                let tried = self.shrunk(self.widened(&hull(all())))?;
                if tried.proved {
                    return Some(self.shaved(tried));
                }
            }
        }
        let sides = hull(open.iter().chain(&single));
        Some(Shrunk {
            sides,
            proved: false,
        })
    }

    /// A little wider, within the declared range.
    fn widened(&self, sides: &[Interval]) -> Sides {
        let wider = |side: &Interval| side.inflate(0.1 * side.width() + 1e-12 * side.magnitude());
        let ranges = self.function.range().iter();
        sides
            .iter()
            .zip(ranges)
            .map(|(side, range)| wider(side).intersection(*range))
            .collect()
    }

    /// Two parts of a box, along the side that is the longest against its numbers.
    fn halves(&self, sides: &[Interval]) -> [Sides; 2] {
        let length = |side: &Interval| match side.width() {
            width if width.is_finite() => width / side.magnitude().max(1.0),
            _ => f64::INFINITY,
        };
        let longest = (0..sides.len()).max_by(|&i, &j| {
            let order = length(&sides[i]).total_cmp(&length(&sides[j]));
            order.then(j.cmp(&i))
        });
        let mut halves = [sides.to_vec(), sides.to_vec()];
        if let Some(i) = longest {
            let [below, above] = split(sides[i], self.function.start()[i]);
            halves[0][i] = below;
            halves[1][i] = above;
        }
        halves
    }

    /// The same with slices cut from the ends of its sides where g has no root.
    fn shaved(&self, mut found: Shrunk) -> Shrunk {
        for i in 0..found.sides.len() {
            for upper in [false, true] {
                for _ in 0..SLICES {
                    let Some(rest) = self.without_slice(&found.sides, i, upper) else {
                        break;
                    };
                    found.sides[i] = rest;
                }
            }
        }
        found
    }

    /// Side `i` without a slice at one end, where that holds no root.
    fn without_slice(&self, sides: &[Interval], i: usize, upper: bool) -> Option<Interval> {
        let side = sides[i];
        let cut = side.width() / 16.0;
        if !(cut.is_finite() && cut > 4.0 * f64::EPSILON * side.magnitude()) {
            return None;
        }
        let at = if upper {
            side.hi() - cut
        } else {
            side.lo() + cut
        };
        let below = Interval::new(side.lo(), at).ok()?;
        let above = Interval::new(at, side.hi()).ok()?;
        let (rest, slice) = if upper {
            (below, above)
        } else {
            (above, below)
        };
        let mut there = sides.to_vec();
        there[i] = slice;
        let g = self.function.residual(&Intervals, &self.at(&there));
        let rest = rest.and_defined(side.is_defined());
        g.iter().any(|g| !g.contains_zero()).then_some(rest)
    }
}

/// Two parts that share a point; of a side without an end that point lies ever further out.
fn split(side: Interval, start: f64) -> [Interval; 2] {
    let reach = |x: f64| 4.0 * x.abs().max(1.0);
    let at = match (side.lo().is_finite(), side.hi().is_finite()) {
        (true, true) => side.midpoint(),
        (true, false) => (side.lo() + reach(side.lo())).min(f64::MAX),
        (false, true) => (side.hi() - reach(side.hi())).max(f64::MIN),
        (false, false) => start,
    };
    let part = |lo, hi| Interval::new(lo, hi).unwrap_or(side);
    [part(side.lo(), at), part(at, side.hi())]
}

fn hull<'b>(boxes: impl Iterator<Item = &'b Sides>) -> Sides {
    let joined = |a: Sides, b: &Sides| a.iter().zip(b).map(|(a, b)| a.hull(*b)).collect();
    let mut boxes = boxes;
    let first = boxes.next().cloned().unwrap_or_default();
    boxes.fold(first, joined)
}
