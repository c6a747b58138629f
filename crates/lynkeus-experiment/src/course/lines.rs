//! Readings that are missing, on lines between those that are there.

use crate::Series;

/// Values with those that are not finite on the line between their neighbours; before the first
/// and after the last the nearest one.
pub(crate) fn between(time: &Series, values: &Series) -> Series {
    within(time, values, std::iter::repeat(0))
}

/// The same where rows belong to numbered stretches and no line leads from one to another: there
/// the next value of the stretch stands, else the last one before.
pub(crate) fn within(
    time: &Series,
    values: &Series,
    stretches: impl Iterator<Item = usize> + Clone,
) -> Series {
    let rows = time.iter().zip(values).zip(stretches);
    let mut known = rows.clone().filter(|((_, x), _)| x.is_finite()).peekable();
    let mut before = None;
    let at = |((t, x), stretch): ((f64, f64), usize)| {
        if x.is_finite() {
            before = known.next();
            return x;
        }
        match (before, known.peek()) {
            (Some(((from, x), a)), Some(&((to, y), b))) if a == stretch && b == stretch => {
                x + (t - from) / (to - from) * (y - x)
            }
            (Some(_), Some(&((_, y), b))) if b == stretch => y,
            (Some(((_, x), _)), _) | (None, Some(&((_, x), _))) => x,
            (None, None) => x,
        }
    };
    Series::gathered(values.store(), rows.map(at))
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
        let stretches = [0, 0, 0, 1, 2, 2].into_iter();
        let time = vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0].into();
        let readings = vec![1.0, nan, nan, nan, nan, 9.0].into();
        let found = within(&time, &readings, stretches);
        assert_eq!(found.to_vec(), [1.0, 1.0, 1.0, 1.0, 9.0, 9.0]);
        assert!(
            between(&vec![0.0].into(), &vec![nan].into())
                .get(0)
                .unwrap()
                .is_nan()
        );
    }
}
