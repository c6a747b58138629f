//! The smallest factor of a tuning for which something holds.

use std::ops::RangeInclusive;

/// Halvings of the interval, on a logarithmic scale: to within 2 %.
const HALVINGS: usize = 5;

/// What a search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Found {
    /// for this factor, and for 1 or up to the next power of two above
    From(f64),
    /// for the smallest factor tried
    Any,
    /// for no factor tried
    Never,
}

/// Starts at the study's own tuning, else at the nearest power of two above, else below,
/// for which it holds; walks down by powers of two until it fails, then halves.
pub fn smallest(
    powers: RangeInclusive<i32>,
    mut holds: impl FnMut(f64) -> Result<bool, String>,
) -> Result<Found, String> {
    let mut anchor = None;
    for power in (0..=*powers.end()).chain((*powers.start()..0).rev()) {
        if holds(f64::from(power).exp2())? {
            anchor = Some(power);
            break;
        }
    }
    let Some(mut lowest) = anchor else {
        return Ok(Found::Never);
    };
    // above the study's own tuning the step below is known to fail
    while lowest <= 0 {
        if lowest == *powers.start() {
            return Ok(Found::Any);
        }
        if !holds(f64::from(lowest - 1).exp2())? {
            break;
        }
        lowest -= 1;
    }
    let (mut low, mut high) = (f64::from(lowest - 1), f64::from(lowest));
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        match holds(middle.exp2())? {
            true => high = middle,
            false => low = middle,
        }
    }
    Ok(Found::From(high.exp2()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_found_from_either_side() {
        for threshold in [0.013, 0.9, 1.0, 7.3, 100.0] {
            let found = smallest(-10..=8, |factor| Ok(factor >= threshold)).unwrap();
            let Found::From(factor) = found else {
                panic!("{threshold}: {found:?}")
            };
            assert!(factor >= threshold && factor < 1.03 * threshold, "{factor}");
        }
        let band = smallest(-3..=3, |factor| Ok((0.3..0.6).contains(&factor)));
        assert!(matches!(band, Ok(Found::From(f)) if (0.3..0.31).contains(&f)));
        assert_eq!(smallest(-3..=3, |_| Ok(true)), Ok(Found::Any));
        assert_eq!(smallest(-3..=3, |_| Ok(false)), Ok(Found::Never));
    }
}
