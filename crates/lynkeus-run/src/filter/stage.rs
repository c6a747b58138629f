//! The way from one sample to the next, linearised once and gone many times.

use super::Belief;
use super::root::dot;
use super::spanned::Rows;

/// x⁻ = φ(x̃) + Φ(x − x̃) and P⁻ = ΦPΦᵀ + W about a state x̃.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    /// x̃
    pub about: Vec<f64>,
    /// φ(x̃)
    pub end: Vec<f64>,
    pub transition: Rows,
    /// rows whose sum of squares is W; none where nothing disturbs the states
    pub noise: Vec<f64>,
}

impl Stage {
    /// What is believed at the next sample.
    pub fn carry(&self, after: &Belief) -> Belief {
        let n = self.end.len();
        let off: Vec<f64> = after
            .x
            .iter()
            .zip(&self.about)
            .map(|(x, a)| x - a)
            .collect();
        let moved = self.end.iter().zip(self.transition.iter());
        let x = moved.map(|(x, (first, row))| x + dot(row, &off[first..]));
        let x = x.collect();
        // the rows of (ΦS)ᵀ after those of the noise
        let mut rows = self.noise.clone();
        let begin = rows.len();
        rows.resize(begin + n * n, 0.0);
        for (i, (first, row)) in self.transition.iter().enumerate() {
            for (j, phi) in (first..).zip(row) {
                for (k, s) in after.root.row(j)[..=j].iter().enumerate() {
                    rows[begin + k * n + i] += phi * s;
                }
            }
        }
        let mut root = after.root.clone();
        root.of_rows(&mut rows);
        Belief { x, root }
    }
}
