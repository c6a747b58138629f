//! Times at equal distances, as decimal numbers where they are.

/// Whole numbers up to here are exact.
const EXACT: i64 = 1 << 53;

/// Most decimals of a start and a step that count as decimal numbers.
const DECIMALS: i32 = 15;

/// The times start + k·step. Where both are decimal numbers, as 0.05, each time is the number
/// nearest to the decimal one: the third is 0.15 and not 0.15000000000000002.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Grid {
    /// start and step in units of 1/scale
    Decimal { start: i64, step: i64, scale: i64 },
    /// no decimal numbers
    Binary { start: f64, step: f64 },
}

impl Grid {
    pub(crate) fn new(start: f64, step: f64) -> Self {
        let mut scales = (0..=DECIMALS).map(|e| 10_i64.pow(e.unsigned_abs()));
        let decimal = scales.find_map(|scale| {
            let (start, step) = (whole(start, scale)?, whole(step, scale)?);
            Some(Self::Decimal { start, step, scale })
        });
        decimal.unwrap_or(Self::Binary { start, step })
    }

    /// Start, step and scale of the times (start + k·step)/scale.
    pub(crate) fn whole(&self) -> [f64; 3] {
        match *self {
            Self::Binary { start, step } => [start, step, 1.0],
            Self::Decimal { start, step, scale } => [start as f64, step as f64, scale as f64],
        }
    }

    /// Time `k`.
    pub(crate) fn time(&self, k: usize) -> f64 {
        let (start, step) = match *self {
            Self::Binary { start, step } => (start, step),
            Self::Decimal { start, step, scale } => {
                let steps = i64::try_from(k).ok().and_then(|k| k.checked_mul(step));
                let units = steps.and_then(|steps| steps.checked_add(start));
                // both are exact, so the quotient is rounded once
                if let Some(units) = units.filter(|units| units.abs() < EXACT) {
                    return units as f64 / scale as f64;
                }
                (start as f64 / scale as f64, step as f64 / scale as f64)
            }
        };
        start + k as f64 * step
    }
}

/// How many 1/scale are `x`, if that is a whole number.
fn whole(x: f64, scale: i64) -> Option<i64> {
    let units = (x * scale as f64).round();
    let fits = units.abs() < EXACT as f64 && units / scale as f64 == x;
    fits.then_some(units as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_the_decimal_numbers() {
        for (start, step, text) in [(0, 5, 0.05), (17_i32, 3_i64, 0.03), (-40, 7, 0.07)] {
            let grid = Grid::new(f64::from(start) / 100.0, text);
            for k in 0..5000_i32 {
                let units = i64::from(start) + i64::from(k) * step;
                let sign = if units < 0 { "-" } else { "" };
                let units = units.abs();
                let decimal = format!("{sign}{}.{:02}", units / 100, units % 100);
                assert_eq!(Ok(grid.time(k as usize)), decimal.parse::<f64>());
            }
        }
        assert_eq!(Grid::new(1.7e9, 1e-3).time(7), 1_700_000_000.007);
    }

    #[test]
    fn other_steps_are_multiples() {
        let third = 1.0 / 3.0;
        let grid = Grid::new(0.5, third);
        assert_eq!(grid.time(10), 0.5 + 10.0 * third);
        assert_eq!(Grid::new(0.0, 1e-300).time(3), 3e-300);
        assert_eq!(Grid::new(1e300, 1e290).time(2), 1e300 + 2e290);
    }
}
