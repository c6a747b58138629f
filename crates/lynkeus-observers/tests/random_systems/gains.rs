//! Constant gains of every quality.

use nalgebra::DMatrix;

use crate::numbers::Numbers;
use crate::pair::Pair;

/// What the equations are in the middle of the box.
pub struct Middle {
    pub A: DMatrix<f64>,
    pub C: DMatrix<f64>,
}

impl Middle {
    pub fn new(copy: &mut Pair, sides: &[(f64, f64)], inputs: &[(f64, f64)]) -> Self {
        let middle = |sides: &[(f64, f64)]| -> Vec<f64> {
            // off the exact middle, where kinks may lie
            sides.iter().map(|(a, b)| a + 0.4871 * (b - a)).collect()
        };
        let (x, u) = (middle(sides), middle(inputs));
        let y = copy.outputs(0.3, &x, &u);
        let mut C = DMatrix::zeros(y.len(), x.len());
        for j in 0..x.len() {
            let mut moved = x.clone();
            // outputs are affine
            moved[j] += 1.0;
            for (i, after) in copy.outputs(0.3, &moved, &u).iter().enumerate() {
                C[(i, j)] = after - y[i];
            }
        }
        let A = copy.jacobian(0.3, &x, &u);
        Self { A, C }
    }
}

/// A gain that suits the middle of the box, one that does not, or any.
pub fn random(numbers: &mut Numbers, middle: &Middle) -> DMatrix<f64> {
    let (p, n) = middle.C.shape();
    let any = DMatrix::from_fn(n, p, |_, _| numbers.signed(0.02, 6.0));
    match numbers.below(10) {
        0..6 => filter(middle, numbers.size(0.1, 30.0)).unwrap_or(any),
        6 => -filter(middle, numbers.size(0.1, 3.0)).unwrap_or(any),
        7 => DMatrix::zeros(n, p),
        _ => any,
    }
}

/// The stationary Kalman gain for process noise `pace`² I and measurement noise I.
fn filter(middle: &Middle, pace: f64) -> Option<DMatrix<f64>> {
    let (A, C) = (&middle.A, &middle.C);
    let n = A.nrows();
    let noise = DMatrix::identity(n, n) * pace * pace;
    let mut P = DMatrix::identity(n, n);
    for _ in 0..4000 {
        let gain = &P * C.transpose();
        let change = A * &P + &P * A.transpose() + &noise - &gain * gain.transpose();
        let step = 0.05 / (1.0 + A.amax() + gain.norm() * C.norm());
        P += &change * step;
        if !P.iter().all(|x| x.is_finite()) {
            return None;
        }
        if change.amax() < 1e-3 * noise.amax() {
            break;
        }
    }
    Some(P * C.transpose())
}
