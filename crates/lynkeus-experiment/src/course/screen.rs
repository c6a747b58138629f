//! Cells of a log that are no readings.

use lynkeus_study::Screen;

use crate::Series;
use crate::words::number;

/// A column without the cells that are no readings, which are NaN then, and how many these are.
pub(super) fn screened(readings: &Series, screen: Screen) -> (Series, usize) {
    let mut count = 0;
    // the last number, and how many times it came
    let mut last = (f64::NAN, 0);
    let left = readings.iter().map(|y| {
        if y.is_nan() {
            return y;
        }
        last = match y == last.0 {
            true => (y, last.1 + 1),
            false => (y, 1),
        };
        let is_none = match screen {
            Screen::Plausible(low, high) => !(low..=high).contains(&y),
            Screen::Repeats => last.1 > 1,
            Screen::Frozen(most) => last.1 > most,
        };
        count += usize::from(is_none);
        if is_none { f64::NAN } else { y }
    });
    let left = Series::gathered(readings.store(), left);
    (left, count)
}

/// What such a cell does.
pub(super) fn words(screen: Screen) -> String {
    match screen {
        Screen::Plausible(low, high) => {
            format!("are outside of [{}, {}]", number(low), number(high))
        }
        Screen::Repeats => "repeat the one before".to_owned(),
        Screen::Frozen(most) => format!("come after {most} equal ones"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(readings: &[f64], screen: Screen) -> (Vec<f64>, usize) {
        let (left, count) = screened(&Series::from(readings.to_vec()), screen);
        (left.iter().filter(|y| !y.is_nan()).collect(), count)
    }

    #[test]
    fn what_is_no_reading_is_left_out_and_counted() {
        let log = [1.0, 1.0, f64::NAN, 1.0, 500.0, 2.0, -3.0, 2.0];
        assert_eq!(
            left(&log, Screen::Plausible(0.0, 200.0)),
            (vec![1.0, 1.0, 1.0, 2.0, 2.0], 2)
        );
        // a missing cell between does not make a new sample of the same number
        assert_eq!(
            left(&log, Screen::Repeats),
            (vec![1.0, 500.0, 2.0, -3.0, 2.0], 2)
        );
        assert_eq!(
            left(&log, Screen::Frozen(2)),
            (vec![1.0, 1.0, 500.0, 2.0, -3.0, 2.0], 1)
        );
    }
}
