//! An explicit Runge–Kutta pair of orders 5 and 4 (Dormand and Prince), independent of
//! the integrators of the library.

const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
        0.0,
        0.0,
    ],
    [
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
        0.0,
    ],
    [
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];
/// The difference of the two solutions.
const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// How far and how well to integrate.
pub struct Limits<'a> {
    pub tolerance: f64,
    /// per component, what counts as small
    pub scale: &'a [f64],
    /// steps, rejected ones included
    pub budget: usize,
}

/// A system that can be followed.
pub trait Flow {
    fn slope(&mut self, t: f64, state: &[f64], out: &mut [f64]);
    /// the next instant after t at which the slope jumps
    fn next_break(&self, t: f64) -> f64;
    /// called after every step; false ends the run
    fn seen(&mut self, t: f64, state: &[f64]) -> bool;
}

/// Follows the flow from `start` to where it is at `until`; none where the budget ends before, or it asks to stop.
pub fn follow(
    flow: &mut impl Flow,
    start: &[f64],
    [t0, until]: [f64; 2],
    limits: &Limits<'_>,
) -> Option<Vec<f64>> {
    let n = start.len();
    let mut x = start.to_vec();
    let mut k = vec![vec![0.0; n]; 7];
    let mut stage = vec![0.0; n];
    let mut t = t0;
    let mut h = 1e-4 * (until - t0).min(1.0);
    let mut stop = flow.next_break(t).min(until);
    flow.slope(t, &x, &mut k[0]);
    for _ in 0..limits.budget {
        if t >= until {
            return Some(x);
        }
        if !h.is_finite() || h <= 1e-15 * t.abs().max(1e-3) {
            return None;
        }
        let last = t + h >= stop;
        let step = if last { stop - t } else { h };
        for s in 1..7 {
            for i in 0..n {
                let sum: f64 = (0..s).map(|j| A[s][j] * k[j][i]).sum();
                stage[i] = x[i] + step * sum;
            }
            // just before a jump of the slope, not at it
            let end = if last { stop - 1e-12 * step } else { t + step };
            let at = if s >= 5 { end } else { t + C[s] * step };
            let (_, rest) = k.split_at_mut(s);
            flow.slope(at, &stage, &mut rest[0]);
        }
        let error = (0..n).fold(0.0_f64, |worst, i| {
            let difference: f64 = (0..7).map(|s| E[s] * k[s][i]).sum::<f64>() * step;
            let size = x[i].abs().max(stage[i].abs()) + limits.scale[i];
            let one = (difference / (limits.tolerance * size)).abs();
            if one.is_nan() {
                f64::INFINITY
            } else {
                worst.max(one)
            }
        });
        let factor = match error {
            0.0 => 5.0,
            _ => (0.9 * error.powf(-0.2)).clamp(0.1, 5.0),
        };
        if error > 1.0 {
            h = step * factor;
            continue;
        }
        x.copy_from_slice(&stage);
        t = if last { stop } else { t + step };
        if !flow.seen(t, &x) {
            return None;
        }
        if last {
            stop = flow.next_break(t).min(until);
            flow.slope(t, &x, &mut k[0]);
        } else {
            let (first, rest) = k.split_at_mut(6);
            first[0].copy_from_slice(&rest[0]);
        }
        h = if last {
            h.max(step * factor)
        } else {
            step * factor
        };
    }
    (t >= until).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Oscillator(Vec<f64>);

    impl Flow for Oscillator {
        fn slope(&mut self, _: f64, x: &[f64], out: &mut [f64]) {
            (out[0], out[1]) = (x[1], -x[0]);
        }
        fn next_break(&self, t: f64) -> f64 {
            t.floor() + 1.0
        }
        fn seen(&mut self, _: f64, x: &[f64]) -> bool {
            self.0 = x.to_vec();
            true
        }
    }

    #[test]
    fn an_oscillator_is_followed_to_its_tolerance() {
        let mut flow = Oscillator(vec![]);
        let limits = Limits {
            tolerance: 1e-10,
            scale: &[1.0; 2],
            budget: 10_000,
        };
        let end = follow(&mut flow, &[1.0, 0.0], [0.0, 7.5], &limits);
        assert_eq!(end.as_ref(), Some(&flow.0));
        assert!((flow.0[0] - 7.5f64.cos()).abs() < 1e-8, "{:?}", flow.0);
        assert!((flow.0[1] + 7.5f64.sin()).abs() < 1e-8, "{:?}", flow.0);
    }
}
