//! What a step's solution is between its ends: polynomials, and what they enclose.

/// Coefficients of the polynomials: the interpolant of the explicit method has degree 7.
pub(crate) const COEFFICIENTS: usize = 8;

/// A polynomial in the part of a step that is done, 0 … 1, lowest power first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Poly(pub [f64; COEFFICIENTS]);

/// What the guards read, as functions of the part of a step that is done.
#[derive(Clone, Debug, Default)]
pub(crate) struct Path {
    pub read: Vec<Poly>,
}

/// A stretch of the step, in parts of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    pub from: f64,
    pub to: f64,
}

impl Stretch {
    pub fn middle(self) -> f64 {
        0.5 * (self.from + self.to)
    }

    pub fn radius(self) -> f64 {
        0.5 * (self.to - self.from)
    }
}

impl Poly {
    /// a + b·s
    pub fn line(a: f64, b: f64) -> Self {
        let mut poly = Self::default();
        [poly.0[0], poly.0[1]] = [a, b];
        poly
    }

    /// A constant and weighted polynomials.
    pub fn combined<'a>(constant: f64, parts: impl Iterator<Item = (&'a Self, &'a f64)>) -> Self {
        let mut sum = Self::line(constant, 0.0);
        for (part, weight) in parts {
            for (sum, c) in sum.0.iter_mut().zip(part.0) {
                *sum += weight * c;
            }
        }
        sum
    }

    pub fn at(&self, s: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |value, c| value * s + c)
    }

    /// The coefficients about another point.
    fn about(&self, middle: f64) -> [f64; COEFFICIENTS] {
        let mut c = self.0;
        for first in 0..COEFFICIENTS - 1 {
            for k in (first..COEFFICIENTS - 1).rev() {
                c[k] += middle * c[k + 1];
            }
        }
        c
    }

    /// What rounding may have changed of what moves.
    fn rounding(&self) -> f64 {
        32.0 * f64::EPSILON * self.0[1..].iter().map(|c| c.abs()).sum::<f64>()
    }

    /// An enclosure over a stretch.
    pub fn range(&self, stretch: Stretch) -> [f64; 2] {
        let (c, r) = (self.about(stretch.middle()), stretch.radius());
        let spread = c[1..].iter().rev().fold(0.0, |sum, c| (sum + c.abs()) * r);
        let spread = spread + self.rounding() + 4.0 * f64::EPSILON * c[0].abs();
        [c[0] - spread, c[0] + spread]
    }

    /// An enclosure of the slope over a stretch.
    pub fn slope(&self, stretch: Stretch) -> [f64; 2] {
        let (c, r) = (self.about(stretch.middle()), stretch.radius());
        let mut spread = 0.0;
        for k in (2..COEFFICIENTS).rev() {
            spread = (spread + k as f64 * c[k].abs()) * r;
        }
        let spread = spread + COEFFICIENTS as f64 * self.rounding();
        [c[1] - spread, c[1] + spread]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enclosures_hold_what_they_are_of() {
        let p = Poly([0.3, -2.0, 5.0, -1.5, 0.2, 3.0, -4.0, 1.0]);
        let derivative = |s: f64| (p.at(s + 1e-6) - p.at(s - 1e-6)) / 2e-6;
        for i in 0..10 {
            for j in i + 1..=10 {
                let stretch = Stretch {
                    from: 0.1 * f64::from(i),
                    to: 0.1 * f64::from(j),
                };
                let ([low, high], [least, most]) = (p.range(stretch), p.slope(stretch));
                for k in 0..=20 {
                    let s = stretch.from + f64::from(k) / 20.0 * (stretch.to - stretch.from);
                    assert!((low..=high).contains(&p.at(s)));
                    assert!((least - 1e-6..=most + 1e-6).contains(&derivative(s)));
                }
            }
        }
        let short = Stretch {
            from: 0.499,
            to: 0.501,
        };
        let [low, high] = p.range(short);
        assert!(high - low < 0.01, "{low} {high}");
    }
}
