//! Exact quantiles of what right readings do.

use lynkeus_run::credible::CHANCE;

/// The normal deviate that is exceeded with that probability.
const DEVIATE: f64 = 4.753_424;
/// So many degrees of freedom are as good as infinitely many.
const MANY: usize = 2000;

/// The sum of the squares of `n` independent normal deviates of variance 1 is larger than this with
/// the probability [`CHANCE`].
pub(super) fn largest_sum(n: usize) -> f64 {
    match n > MANY {
        true => of_many(n, DEVIATE),
        false => solve(n, |lower| 1.0 - lower < CHANCE),
    }
}

/// The same sum is smaller than this with the probability [`CHANCE`].
pub(super) fn smallest_sum(n: usize) -> f64 {
    match n > MANY {
        true => of_many(n, -DEVIATE),
        false => solve(n, |lower| lower > CHANCE),
    }
}

/// By Wilson and Hilferty, right to 10⁻⁴ for so many.
fn of_many(n: usize, deviate: f64) -> f64 {
    let n = n as f64;
    let spread = 2.0 / (9.0 * n);
    n * (1.0 - spread + deviate * spread.sqrt()).powi(3)
}

/// The smallest x whose lower tail of χ² of n degrees of freedom is beyond.
fn solve(n: usize, is_beyond: impl Fn(f64) -> bool) -> f64 {
    let log_gamma = log_gamma(n as f64);
    let lower_tail = |x: f64| lower_tail(n, log_gamma, x);
    let (mut low, mut high) = (0.0, 1.0);
    while !is_beyond(lower_tail(high)) && high < 1e18 {
        high *= 2.0;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        match is_beyond(lower_tail(middle)) {
            true => high = middle,
            false => low = middle,
        }
    }
    high
}

/// P(χ²ₙ ≤ x): the regularised incomplete gamma function of n/2 and x/2, by its series where that
/// converges fast, else by its continued fraction (Lentz). `log_gamma` is ln Γ(n/2).
fn lower_tail(n: usize, log_gamma: f64, x: f64) -> f64 {
    if n == 0 || x <= 0.0 {
        return if n == 0 { 1.0 } else { 0.0 };
    }
    let n = n as f64;
    let (a, x) = (0.5 * n, 0.5 * x);
    let front = (a * x.ln() - x - log_gamma).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > 1e-17 * sum {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        return front * sum;
    }
    let (mut b, mut c) = (x + 1.0 - a, f64::MAX);
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    1.0 - front * h
}

/// ln Γ(n/2) for a whole n.
fn log_gamma(n: f64) -> f64 {
    let (mut a, mut sum) = (0.5 * n, 0.0);
    while a > 1.0 {
        a -= 1.0;
        sum += a.ln();
    }
    match a > 0.75 {
        true => sum,
        false => sum + 0.5 * std::f64::consts::PI.ln(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against SciPy's `chi2.isf(1e-6, n)` and `chi2.ppf(1e-6, n)`.
    #[test]
    fn quantiles_are_those_of_tables() {
        for (n, largest, smallest) in TABLE {
            let (high, low) = (largest_sum(n), smallest_sum(n));
            assert!((high / largest - 1.0).abs() < 1e-4, "{n}: {high} {largest}");
            assert!(
                (low - smallest).abs() < 2e-4 * smallest,
                "{n}: {low} {smallest}"
            );
        }
    }

    const TABLE: [(usize, f64, f64); 7] = [
        (1, 23.928127, 1.5707963e-12),
        (2, 27.631021, 2.000001e-06),
        (5, 35.888187, 0.01289616),
        (20, 65.420681, 2.5536376),
        (101, 183.45989, 47.169855),
        (1000, 1227.1524, 801.62444),
        (5000, 5489.8199, 4538.9702),
    ];
}
