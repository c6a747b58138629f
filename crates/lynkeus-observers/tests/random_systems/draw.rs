//! What the random systems draw from [`Numbers`] beside what all draw.

use crate::numbers::Numbers;

impl Numbers {
    /// One number in each range, at times at its ends.
    pub fn inside(&mut self, sides: &[(f64, f64)]) -> Vec<f64> {
        let ends = self.chance(0.2);
        let mut place = |&(low, high): &(f64, f64)| match (ends, self.unit()) {
            (true, x) if x < 0.5 => low,
            (true, _) => high,
            (false, x) => low + x * (high - low),
        };
        sides.iter().map(&mut place).collect()
    }
}
