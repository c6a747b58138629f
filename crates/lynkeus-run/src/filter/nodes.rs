//! Polynomials through Lobatto's nodes.

/// Lobatto's five nodes on [0, 1]; the first, the third and the last are his three.
pub(super) const FINE: [f64; 5] = [
    0.0,
    0.172_673_164_646_011_43,
    0.5,
    0.827_326_835_353_988_6,
    1.0,
];

/// How much of what is left out counts where it is odd about the middle: over the piece it comes
/// to nothing, and an estimate from every other coefficient is too large.
pub(super) const ODD: f64 = 0.1;

/// What rounding makes of a value of a polynomial, as a share of it.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Interpolation of a vector that is known at the nodes.
#[derive(Clone, Debug)]
pub(super) struct Lobatto {
    /// coefficients of the polynomials that are 1 at one of the nodes and 0 at the others
    coarse: Vec<Vec<f64>>,
    fine: Vec<Vec<f64>>,
}

impl Lobatto {
    pub fn new() -> Self {
        Self {
            coarse: basis(&[FINE[0], FINE[2], FINE[4]]),
            fine: basis(&FINE),
        }
    }

    /// Coefficients of 1, s, s² through three nodes; none where more nodes are needed for an
    /// error of `tolerance`. Legendre's coefficients tell, which of a smooth function fall
    /// geometrically; of one that is odd about the middle there is none of s² to tell by, so that
    /// what is found has to [meet](meets) the function elsewhere, too.
    pub fn coarse(&self, values: &[Vec<f64>], tolerance: f64) -> Option<Vec<Vec<f64>>> {
        let fit = combined(&self.coarse, values);
        let last = largest(fit[2].iter().map(|c| c / 6.0));
        let before = largest(fit[1].iter().zip(&fit[2]).map(|(b, c)| 0.5 * (b + c)));
        accepted(fit, &[beyond(before, last)], tolerance)
    }

    /// … of 1 … s⁴ through five nodes. Of an odd function every other coefficient falls.
    pub fn fine(&self, values: &[Vec<f64>], tolerance: f64) -> Option<Vec<Vec<f64>>> {
        let fit = combined(&self.fine, values);
        let last = largest(fit[4].iter().map(|c| c / 70.0));
        let before = largest(fit[3].iter().zip(&fit[4]).map(|(b, c)| b / 20.0 + c / 10.0));
        let pairs = (fit[1].iter().zip(&fit[2])).zip(fit[3].iter().zip(&fit[4]));
        let first = largest(pairs.map(|((a, b), (c, d))| 0.5 * (a + b) + 0.45 * c + 0.4 * d));
        let next = [beyond(before, last), ODD * beyond(first, before)];
        accepted(fit, &next, tolerance)
    }
}

/// Whether a polynomial of s is this close to the values at s.
pub(super) fn meets(fit: &[Vec<f64>], s: f64, values: &[f64], tolerance: f64) -> bool {
    values.iter().enumerate().all(|(i, value)| {
        let found = fit.iter().rev().fold(0.0, |sum, c| sum * s + c[i]);
        (found - value).abs() <= tolerance.max(ROUNDING * value.abs())
    })
}

/// The next one of coefficients that fall geometrically.
fn beyond(before: f64, last: f64) -> f64 {
    match last < before {
        true => last * last / before,
        false => last,
    }
}

/// The polynomial, where what is left out of it is within the tolerance.
fn accepted(mut fit: Vec<Vec<f64>>, next: &[f64], tolerance: f64) -> Option<Vec<Vec<f64>>> {
    // false of what is not a number
    if !next.iter().all(|next| *next <= tolerance) {
        return None;
    }
    // what is far below the tolerance is rounding, and would make sparse products dense
    for coefficient in fit.iter_mut().skip(1).flatten() {
        if coefficient.abs() <= 1e-3 * tolerance {
            *coefficient = 0.0;
        }
    }
    while fit.len() > 1 && fit.last().is_some_and(|c| c.iter().all(|c| *c == 0.0)) {
        fit.pop();
    }
    Some(fit)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m: f64, v| if v.abs() <= m { m } else { v.abs() })
}

fn combined(basis: &[Vec<f64>], values: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let size = values.first().map_or(0, Vec::len);
    let mut fit = vec![vec![0.0; size]; basis.len()];
    for (polynomial, values) in basis.iter().zip(values) {
        for (into, factor) in fit.iter_mut().zip(polynomial) {
            for (into, value) in into.iter_mut().zip(values) {
                *into += factor * value;
            }
        }
    }
    fit
}

/// Π (s − c_j)/(c_i − c_j) over j ≠ i, for each node c_i.
fn basis(nodes: &[f64]) -> Vec<Vec<f64>> {
    let one = |i: usize| {
        let mut polynomial = vec![1.0];
        for c in nodes
            .iter()
            .enumerate()
            .filter(|(j, _)| *j != i)
            .map(|n| n.1)
        {
            let scale = 1.0 / (nodes[i] - c);
            polynomial.push(0.0);
            for k in (0..polynomial.len()).rev() {
                let lower = if k > 0 { polynomial[k - 1] } else { 0.0 };
                polynomial[k] = scale * (lower - c * polynomial[k]);
            }
        }
        polynomial
    };
    (0..nodes.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(nodes: &[f64], f: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
        nodes.iter().map(|s| vec![f(*s)]).collect()
    }

    #[test]
    fn polynomials_are_found_and_others_refused() {
        let lobatto = Lobatto::new();
        let line = lobatto.coarse(&at(&[0.0, 0.5, 1.0], |s| 2.0 - 3.0 * s), 1e-12);
        let line = line.unwrap();
        assert_eq!(line.len(), 2);
        assert!((line[0][0] - 2.0).abs() < 1e-15 && (line[1][0] + 3.0).abs() < 1e-14);
        assert!(
            lobatto
                .coarse(&at(&[0.0, 0.5, 1.0], f64::exp), 1e-3)
                .is_none()
        );
        let wave = |s: f64| (0.2 * s).sin();
        let fit = lobatto.fine(&at(&FINE, wave), 1e-8).unwrap();
        for k in 0..=10 {
            let s = 0.1 * f64::from(k);
            let value: f64 = fit.iter().rev().fold(0.0, |sum, c| sum * s + c[0]);
            assert!((value - wave(s)).abs() < 1e-8, "{s}");
        }
        assert!(
            lobatto
                .fine(&at(&FINE, |s| (s - 0.4).abs()), 1e-3)
                .is_none()
        );
        assert!(lobatto.fine(&at(&FINE, |_| f64::NAN), 1e-3).is_none());
    }

    /// What is odd about the middle has no even coefficients to fall: its own tell, and what three
    /// nodes take for a line does not meet it elsewhere.
    #[test]
    fn a_wave_that_is_odd_about_the_middle_is_no_line() {
        let lobatto = Lobatto::new();
        let three = [FINE[0], FINE[2], FINE[4]];
        for rate in [1.0, std::f64::consts::TAU] {
            let wave = |s: f64| (rate * (s - 0.5)).sin();
            let line = lobatto.coarse(&at(&three, wave), 1e-9).unwrap();
            assert!(line.len() <= 2);
            assert!(!meets(&line, FINE[1], &[wave(FINE[1])], 1e-4));
            assert!(lobatto.fine(&at(&FINE, wave), 1e-6).is_none());
        }
        let slow = |s: f64| (0.02 * (s - 0.5)).sin();
        let line = lobatto.coarse(&at(&three, slow), 1e-6).unwrap();
        assert!(meets(&line, FINE[1], &[slow(FINE[1])], 1e-6));
        let fit = lobatto.fine(&at(&FINE, slow), 1e-9).unwrap();
        assert!(meets(&fit, 0.3, &[slow(0.3)], 1e-9));
        assert!(!meets(&fit, 0.3, &[f64::NAN], 1e-9));
    }
}
