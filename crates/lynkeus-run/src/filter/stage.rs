//! The way from one sample to the next, linearised once and gone many times.

use std::sync::Arc;

use super::Belief;
use super::root::{Root, dot};
use super::spanned::Rows;

/// x⁻ = φ(x̃) + Φ(x − x̃) and P⁻ = ΦPΦᵀ + W about a state x̃.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    /// x̃
    pub about: Vec<f64>,
    /// φ(x̃)
    pub end: Vec<f64>,
    pub transition: Arc<Rows>,
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
        let begin = self.noise.len();
        let mut rows = Vec::with_capacity(begin + n * n);
        rows.extend_from_slice(&self.noise);
        rows.resize(begin + n * n, 0.0);
        let mut sums = vec![0.0; n];
        for (i, (first, row)) in self.transition.iter().enumerate() {
            sums.fill(0.0);
            for (j, phi) in (first..).zip(row) {
                for (sum, s) in sums.iter_mut().zip(&after.root.row(j)[..=j]) {
                    *sum += phi * s;
                }
            }
            let column = rows[begin + i..].iter_mut().step_by(n);
            column.zip(&sums).for_each(|(into, sum)| *into = *sum);
        }
        let mut root = Root {
            n,
            entries: vec![0.0; n * n],
        };
        root.of_rows_with(&mut rows, &mut sums);
        Belief { x, root }
    }
}
