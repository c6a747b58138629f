//! A mode as a function of time: constant between instants.

/// The values of one mode over an interval.
#[derive(Clone, Debug, Default)]
pub(super) struct Timeline {
    /// where the value changes, increasing
    instants: Vec<f64>,
    /// one more than instants
    values: Vec<f64>,
}

impl Timeline {
    pub(super) fn clear(&mut self) {
        self.instants.clear();
        self.values.clear();
    }

    /// Where the value changes, increasing.
    pub(super) fn instants(&self) -> &[f64] {
        &self.instants
    }

    /// The mode is `value` from `t` on (from the start, for the first value).
    pub(super) fn push(&mut self, t: f64, value: f64) {
        match self.values.last() {
            Some(&last) if same(last, value) => return,
            Some(_) => self.instants.push(t),
            None => {}
        }
        self.values.push(value);
    }

    /// The value at `t`, which is no instant; NaN before the first value is known.
    pub(super) fn at(&self, t: f64) -> f64 {
        let place = self.instants.partition_point(|&instant| instant <= t);
        self.values.get(place).copied().unwrap_or(f64::NAN)
    }
}

/// Equality for which NaN, "not defined here", equals NaN.
pub(super) fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// Two instants closer than this are one: rounding put them apart.
pub(super) fn apart(t: f64) -> f64 {
    4.0 * f64::EPSILON * t.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changes_are_instants() {
        let mut line = Timeline::default();
        for (t, value) in [(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, f64::NAN)] {
            line.push(t, value);
        }
        line.push(4.0, 0.0);
        assert_eq!(line.instants(), [2.0, 4.0]);
        assert_eq!((line.at(0.5), line.at(5.0)), (1.0, 0.0));
        assert!(line.at(2.5).is_nan() && Timeline::default().at(0.0).is_nan());
    }
}
