//! How fast a system's fastest mode is.

use nalgebra::DMatrix;

use crate::{Dynamics, Slopes};

/// Squarings of the Jacobian: the norm of its 2^8-th power has forgotten all
/// but 1/256 of the logarithm of its departure from normality.
const SQUARINGS: u32 = 8;

/// Largest system whose Jacobian is squared; larger ones use the power method.
const SMALL: usize = 48;

/// The share of a state's size over which a secant is taken.
const SECANT: f64 = 0.01;

/// Steps of the power method, and how many at the end are averaged.
const ITERATIONS: (usize, usize) = (40, 16);

/// Estimates the spectral radius of ∂f/∂x at (t, x), in 1/(unit of time).
///
/// The Jacobian is the system's own ([`Dynamics::slopes`]) or taken by finite
/// differences, and its radius from Gelfand's formula ρ = lim ‖Jᵏ‖^(1/k), which needs
/// no eigenvalue iteration and takes strongly non-normal matrices (high gain) as well
/// as complex pairs. Not finite where the derivative is not.
pub fn spectral_radius(f: &mut impl Dynamics, t: f64, x: &[f64]) -> f64 {
    if x.is_empty() {
        0.0
    } else if x.len() <= SMALL {
        let mut slopes = Slopes::default();
        slopes.look(f, t, x);
        gelfand(slopes.dense(x.len()))
    } else {
        power(f, t, x)
    }
}

/// The fastest mode at (t, x), and how it was seen.
pub(crate) struct Fastest {
    pub radius: f64,
    /// by secants, since a slope at x itself is infinite
    pub is_steep: bool,
}

/// As [`spectral_radius`], but where f knows its slopes and one is not finite, as that of a root at 0,
/// by secants over a hundredth of each state's size (1 where none is given).
pub(crate) fn fastest(f: &mut impl Dynamics, t: f64, x: &[f64], sizes: &[f64]) -> Fastest {
    let mut slopes = Slopes::default();
    let is_steep = !x.is_empty() && f.slopes(t, x, &mut slopes) && !slopes.are_finite();
    if !is_steep {
        let radius = spectral_radius(f, t, x);
        return Fastest { radius, is_steep };
    }
    let size = |k: usize| SECANT * sizes.get(k).copied().unwrap_or(1.0);
    slopes.differences(f, t, x, size);
    let radius = match x.len() <= SMALL {
        true => gelfand(slopes.dense(x.len())),
        false => growth(x.len(), |v, image| slopes.times(v, image)),
    };
    Fastest { radius, is_steep }
}

fn gelfand(mut power: DMatrix<f64>) -> f64 {
    // ‖Jᵏ‖ = exp(log) · ‖power‖, with the exponent k = 2^i
    let mut log = 0.0;
    for _ in 0..SQUARINGS {
        let norm = power.norm();
        if norm == 0.0 || !norm.is_finite() {
            return norm;
        }
        power /= norm;
        log = 2.0 * (log + norm.ln());
        power = &power * &power;
    }
    let exponent = f64::from(2_u32.pow(SQUARINGS));
    ((log + power.norm().ln()) / exponent).exp()
}

/// The power method: products with the Jacobian where it is known, else differences in the
/// direction of v.
fn power(f: &mut impl Dynamics, t: f64, x: &[f64]) -> f64 {
    let n = x.len();
    let mut slopes = Slopes::default();
    if f.slopes(t, x, &mut slopes) && slopes.are_finite() {
        return growth(n, |v, image| slopes.times(v, image));
    }
    let (mut base, mut moved) = (vec![0.0; n], vec![0.0; n]);
    f.derivatives(t, x, &mut base);
    let step = f64::EPSILON.sqrt() * (1.0 + norm(x));
    growth(n, |v, image| {
        for i in 0..n {
            moved[i] = x[i] + step * v[i];
        }
        f.derivatives(t, &moved, image);
        for (image, base) in image.iter_mut().zip(&base) {
            *image = (*image - base) / step;
        }
    })
}

/// How much a linear map of unit vectors stretches them in the long run.
fn growth(n: usize, mut map: impl FnMut(&[f64], &mut [f64])) -> f64 {
    // any direction that has a part along every mode will do
    let mut v: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64 * 0.7).sin()).collect();
    let mut image = vec![0.0; n];
    let mut logs = 0.0;
    for iteration in 0..ITERATIONS.0 {
        let length = norm(&v);
        if length == 0.0 || !length.is_finite() {
            return length;
        }
        v.iter_mut().for_each(|v| *v /= length);
        map(&v, &mut image);
        std::mem::swap(&mut v, &mut image);
        if iteration >= ITERATIONS.0 - ITERATIONS.1 {
            logs += norm(&v).ln();
        }
    }
    (logs / ITERATIONS.1 as f64).exp()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Function;

    fn radius(n: usize, f: impl FnMut(f64, &[f64], &mut [f64])) -> f64 {
        spectral_radius(&mut Function::new(n, f), 0.0, &vec![0.5; n])
    }

    #[test]
    fn complex_pairs_and_non_normal_matrices() {
        let rotation = radius(2, |_, x, dx| {
            dx[0] = 30.0 * x[1];
            dx[1] = -30.0 * x[0];
        });
        assert!((rotation / 30.0 - 1.0).abs() < 0.01, "{rotation}");
        // a high-gain error system: eigenvalues −10, −20, −30, norm about 6000
        let high_gain = radius(3, |_, x, dx| {
            dx[0] = -60.0 * x[0] + x[1];
            dx[1] = -1100.0 * x[0] + x[2];
            dx[2] = -6000.0 * x[0];
        });
        assert!((high_gain / 30.0 - 1.0).abs() < 0.06, "{high_gain}");
        assert_eq!(radius(1, |_, _, dx| dx[0] = 1.0), 0.0);
    }

    #[test]
    fn large_systems_use_the_power_method() {
        let chain = radius(100, |_, x, dx| {
            for i in 0..100 {
                let left = if i > 0 { x[i - 1] } else { 0.0 };
                dx[i] = 50.0 * (left - 2.0 * x[i] + x.get(i + 1).unwrap_or(&0.0));
            }
        });
        assert!((chain / 200.0 - 1.0).abs() < 0.05, "{chain}");
    }
}
