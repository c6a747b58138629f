//! The Jacobian of a right-hand side at a point, and how fast its fastest mode is.

use nalgebra::DMatrix;

use crate::{Dynamics, Place, Slopes};

/// Squarings of the Jacobian: the norm of its 2^8-th power has forgotten all
/// but 1/256 of the logarithm of its departure from normality.
const SQUARINGS: u32 = 8;

/// Largest system whose Jacobian is squared; larger ones use the power method.
const SMALL: usize = 48;

/// The share of a state's size over which a secant is taken.
const SECANT: f64 = 0.01;

/// Steps of the power method, and how many at the end are averaged.
const ITERATIONS: (usize, usize) = (40, 16);

impl Slopes {
    /// Looks at f: at its own derivatives where it knows them and they have values, else at
    /// differences. Not finite where f is not.
    pub(crate) fn look(&mut self, f: &mut dyn Dynamics, t: f64, x: &[f64]) {
        if !(f.slopes(t, x, self) && self.are_finite()) {
            self.differences(f, t, x, |k| rounding(x[k]));
        }
    }

    /// One-sided differences over such a size of each state, every entry: forward, or backward where f
    /// has no value ahead.
    pub(crate) fn differences(
        &mut self,
        f: &mut dyn Dynamics,
        t: f64,
        x: &[f64],
        size: impl Fn(usize) -> f64,
    ) {
        let n = x.len();
        // as many places as there are in all are all of them
        let column = |column: usize| (0..n).map(move |row| Place { row, column });
        let places = match self.places().len() == n * n {
            true => self.places().clone(),
            false => (0..n).flat_map(column).collect(),
        };
        let mut base = vec![0.0; n];
        f.derivatives(t, x, &mut base);
        let mut moved = x.to_vec();
        let mut image = vec![0.0; n];
        let mut columns = DMatrix::zeros(n, n);
        for (k, mut column) in columns.column_iter_mut().enumerate() {
            let size = size(k);
            for ahead in [size, -size] {
                moved[k] = x[k] + ahead;
                // the difference that the rounded sum really makes
                let step = moved[k] - x[k];
                f.derivatives(t, &moved, &mut image);
                for (entry, (moved, base)) in column.iter_mut().zip(image.iter().zip(&base)) {
                    *entry = (moved - base) / step;
                }
                if column.iter().all(|entry| entry.is_finite()) {
                    break;
                }
            }
            moved[k] = x[k];
        }
        let values = self.at(&places);
        for (value, at) in values.iter_mut().zip(&*places) {
            *value = columns[(at.row, at.column)];
        }
    }
}

/// The size of a difference where rounding is the limit.
fn rounding(x: f64) -> f64 {
    f64::EPSILON.sqrt() * x.abs().max(1e-3)
}

/// Estimates the spectral radius of ∂f/∂x at (t, x), in 1/(unit of time).
///
/// The Jacobian is the system's own ([`Dynamics::slopes`]) or taken by finite
/// differences, and its radius from Gelfand's formula ρ = lim ‖Jᵏ‖^(1/k), which needs
/// no eigenvalue iteration and takes strongly non-normal matrices (high gain) as well
/// as complex pairs. Not finite where the derivative is not.
pub fn spectral_radius(f: &mut dyn Dynamics, t: f64, x: &[f64]) -> f64 {
    fastest(f, t, x, None).radius
}

/// The fastest mode of a system at a point, and how it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fastest {
    /// the spectral radius
    pub radius: f64,
    /// a slope there is infinite, as that of a root at 0: that over a hundredth of the states' sizes
    /// counts instead
    pub is_steep: bool,
}

/// As [`spectral_radius`]; with sizes of the states, where f knows its slopes and one is not finite, as
/// that of a root at 0, by secants over a hundredth of each (of 1 where none is given).
pub(crate) fn fastest(f: &mut dyn Dynamics, t: f64, x: &[f64], sizes: Option<&[f64]>) -> Fastest {
    let (n, mut slopes) = (x.len(), Slopes::default());
    let is_known = n > 0 && f.slopes(t, x, &mut slopes);
    let is_steep = is_known && !slopes.are_finite();
    match sizes {
        Some(sizes) if is_steep => {
            let size = |k: usize| SECANT * sizes.get(k).copied().unwrap_or(1.0);
            slopes.differences(f, t, x, size);
        }
        _ if n == 0 || (is_known && !is_steep) => {}
        _ if n <= SMALL => slopes.differences(f, t, x, |k| rounding(x[k])),
        _ => {
            let radius = power(f, t, x);
            return Fastest { radius, is_steep };
        }
    }
    let radius = match n <= SMALL {
        true => gelfand(slopes.dense(n)),
        false => growth(n, |v, image| slopes.times(v, image)),
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

/// The power method by differences in the direction of v.
fn power(f: &mut dyn Dynamics, t: f64, x: &[f64]) -> f64 {
    let n = x.len();
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
    use crate::{Function, System};
    use lynkeus_expr::Graph;

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

    /// x₁' = sin(w x₁) + x₂², x₂' = √x₃, x₃' = −x₃: the entries of the graph against the formulas
    /// by hand, and against differences where a root has no slope.
    #[test]
    fn a_system_knows_its_slopes() {
        let g = Graph::new();
        let [time, w, x1, x2, x3] = ["time", "w", "x1", "x2", "x3"].map(|name| g.symbol(name));
        let states = [("x1", x1), ("x2", x2), ("x3", x3)].map(|(s, x)| (s.into(), x.node(), 1.0));
        let dx = [(w * x1).sin() + x2.powi(2), x3.sqrt(), -x3].map(|dx| dx.node());
        let signals = [("w".to_owned(), w.node())];
        let system = System::new(&g, time.node(), &states, &signals, &dx, &[]).unwrap();
        let mut f = system.evaluation();
        f.signals_mut()[0] = 3.0;
        let mut slopes = Slopes::default();
        assert!(f.slopes(0.0, &[0.2, 0.7, 0.25], &mut slopes));
        let expected = DMatrix::from_row_slice(
            3,
            3,
            &[3.0 * 0.6f64.cos(), 1.4, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0],
        );
        assert_eq!(slopes.values().len(), 4);
        assert!((slopes.dense(3) - expected).norm() < 1e-15);
        // at 0 the root is as steep as differences say
        slopes.look(&mut f, 0.0, &[0.2, 0.7, 0.0]);
        assert_eq!(slopes.values().len(), 9);
        assert!(slopes.are_finite() && slopes.dense(3)[(1, 2)] > 1e3);
    }

    /// √(1 − x₁) has no value ahead of x₁ = 1, where its slope is −∞; the column of x₂ is as ever.
    #[test]
    fn where_nothing_is_ahead_differences_look_back() {
        let mut f = Function::new(2, |_, x: &[f64], dx: &mut [f64]| {
            dx[0] = (1.0 - x[0]).sqrt() + 3.0 * x[1];
            dx[1] = -x[0];
        });
        let mut slopes = Slopes::default();
        slopes.look(&mut f, 0.0, &[1.0, 0.5]);
        let found = slopes.dense(2);
        // √h/h for the step h = √ε
        assert!(
            (found[(0, 0)] / -f64::EPSILON.powf(-0.25) - 1.0).abs() < 1e-6,
            "{found}"
        );
        assert!((found[(1, 0)] + 1.0).abs() < 1e-7);
        assert!((found[(0, 1)] - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_knows_no_slopes_is_looked_at_by_differences() {
        let mut f = Function::new(2, |_, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * x[1];
            dx[1] = -3.0 * x[0];
        });
        let mut slopes = Slopes::default();
        slopes.look(&mut f, 0.0, &[2.0, 5.0]);
        let expected = DMatrix::from_row_slice(2, 2, &[5.0, 2.0, -3.0, 0.0]);
        assert!((slopes.dense(2) - expected).norm() < 1e-6);
        let mut product = [0.0; 2];
        slopes.times(&[1.0, -1.0], &mut product);
        assert!((product[0] - 3.0).abs() < 1e-6 && (product[1] + 3.0).abs() < 1e-6);
    }
}
