//! Readings that are missing, on lines between those that are there.

use crate::Series;
use crate::series::points;

/// Values with those that are not finite on the line between their neighbours; before the first
/// and after the last the nearest one.
pub(crate) fn between(time: &Series, values: &Series) -> Series {
    let mut known = points(time, values).peekable();
    let mut before: Option<(f64, f64)> = None;
    let at = |(t, x): (f64, f64)| {
        if x.is_finite() {
            before = known.next();
            return x;
        }
        match (before, known.peek()) {
            (Some((from, x)), Some((to, y))) => x + (t - from) / (to - from) * (y - x),
            (Some((_, x)), None) | (None, Some(&(_, x))) => x,
            (None, None) => x,
        }
    };
    Series::gathered(values.store(), time.iter().zip(values).map(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_lie_on_the_line_between_their_neighbours() {
        let nan = f64::NAN;
        let found = between(
            &vec![0.0, 1.0, 2.0, 4.0, 5.0, 6.0].into(),
            &vec![nan, 1.0, nan, 7.0, nan, nan].into(),
        );
        assert_eq!(found.to_vec(), [1.0, 1.0, 3.0, 7.0, 7.0, 7.0]);
        assert!(
            between(&vec![0.0].into(), &vec![nan].into())
                .get(0)
                .unwrap()
                .is_nan()
        );
    }
}
