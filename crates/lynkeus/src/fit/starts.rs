//! Where searches start.

use nalgebra::DVector;

use super::problem::Problem;
use crate::Error;

/// How far searches of noises, and of logarithms without bounds, start from the study's own values: a factor of 10;
/// others without bounds by the value itself, or by 1.
const APART: f64 = 10.0;

/// The study's own values, then points that fill the bounds evenly (the additive recurrence of M. Roberts, *The
/// unreasonable effectiveness of quasirandom sequences*, 2018), moved by the seed.
pub(super) fn spread(
    problem: &Problem<'_>,
    begin: &DVector<f64>,
    count: usize,
    seed: u64,
) -> Vec<DVector<f64>> {
    let n = begin.len();
    // the positive root of r^(n + 1) = r + 1
    let mut root = 2.0_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (n as f64 + 1.0));
    }
    let ends = problem.unknowns.iter().zip(begin).map(|(unknown, &z)| {
        let (low, high) = (
            unknown.searched(unknown.low),
            unknown.searched(unknown.high),
        );
        let reach = match unknown.is_log {
            true => APART.ln(),
            false => z.abs().max(1.0),
        };
        // a logarithm without a bound of its own ends where numbers do
        let is_endless = unknown.is_log && unknown.low == f64::MIN_POSITIVE;
        let is_open = unknown.kind.is_noise() || is_endless || !(high - low).is_finite();
        match is_open {
            true => ((z - reach).max(low), (z + reach).min(high)),
            false => (low, high),
        }
    });
    let ends: Vec<(f64, f64)> = ends.collect();
    let shift = |i: usize| {
        // SplitMix64
        let mut x = seed.wrapping_add((i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x >> 11) as f64 / (1_u64 << 53) as f64
    };
    let further = (1..count).map(|k| {
        DVector::from_fn(n, |i, _| {
            let share = (shift(i) + k as f64 / root.powi(i as i32 + 1)).fract();
            let (low, high) = ends[i];
            low + share * (high - low)
        })
    });
    std::iter::once(begin.clone()).chain(further).collect()
}

/// Points that are looked at where nobody says how many searches there are, and those of them that are searched from.
const LOOKED_AT: usize = 48;
const FURTHER: usize = 4;

/// Those of spread points with the least −log L.
///
/// # Errors
/// As [`Problem::at`].
pub(super) fn best(
    problem: &mut Problem<'_>,
    begin: &DVector<f64>,
    seed: u64,
) -> Result<Vec<DVector<f64>>, Error> {
    let all = spread(problem, begin, LOOKED_AT + 1, seed);
    let points = all.into_iter().skip(1).map(|z| problem.at(z));
    let mut points = points.collect::<Result<Vec<_>, _>>()?;
    points.retain(|point| point.value.is_finite());
    points.sort_by(|a, b| a.value.total_cmp(&b.value));
    Ok(points
        .into_iter()
        .take(FURTHER)
        .map(|point| point.z)
        .collect())
}
