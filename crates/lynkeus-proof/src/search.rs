//! Searches along one number, and over weights, for the best of what a test proves. They
//! decide nothing: an answer is a number for which the test was passed.

/// Bisections: enough for all digits of a number between zero and its bound.
const BISECTIONS: usize = 50;

/// The largest number in (0, limit] up to bisection for which a test that fails
/// beyond some number is passed; none where it fails near zero.
pub fn largest(limit: f64, passes: impl Fn(f64) -> bool) -> Option<f64> {
    if !(limit > 0.0 && limit.is_finite()) {
        return None;
    }
    let (mut low, mut high) = (0.0, limit);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        match passes(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    (low > 0.0).then_some(low)
}

/// The least θ from which on a test that is passed by every larger θ holds, up to
/// a relative 1e-9 and on the side where it holds; 0 where it never fails.
pub fn first(start: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut high = start;
    let mut doublings = 0;
    while !holds(high) {
        high *= 2.0;
        doublings += 1;
        if doublings > 40 {
            return None;
        }
    }
    let mut low = high;
    for _ in 0..80 {
        low /= 2.0;
        if !holds(low) {
            break;
        }
    }
    if holds(low) {
        return Some(0.0);
    }
    while high - low > 1e-9 * high {
        let middle = 0.5 * (low + high);
        match holds(middle) {
            true => high = middle,
            false => low = middle,
        }
    }
    Some(high)
}

/// A weight further from 1 makes the overshoot larger: it has to lower θ0 by this.
const WORTHWHILE: f64 = 0.999;

/// Weights c_2, c_3, … of the chains beside c_1 = 1 for which θ0 is least, of those
/// tried, one chain after the other. Any positive weights make a proof: S and the
/// inequality it satisfies scale together.
pub fn lightest(chains: usize, at: impl Fn(&[f64]) -> Option<f64>) -> (Vec<f64>, Option<f64>) {
    let mut c = vec![1.0; chains];
    let mut best = at(&c);
    for step in [4.0, 1.0, 0.25, 0.0625] {
        for i in 1..chains {
            let centre = c[i];
            for k in [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0] {
                let mut trial = c.clone();
                trial[i] = centre * 10f64.powf(k * step);
                let found = at(&trial);
                if let Some(θ0) = found
                    && best.is_none_or(|b| θ0 < WORTHWHILE * b)
                {
                    (c, best) = (trial, found);
                }
            }
        }
    }
    (c, best)
}
