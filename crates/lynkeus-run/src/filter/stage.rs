//! The way from one sample to the next, linearised once and gone many times.

use std::sync::Arc;

use super::Belief;
use super::root::{Root, dot};
use super::spanned::Rows;
use crate::snapshot::{Damaged, Walk};

/// x⁻ = φ(x̃) + Φ(x − x̃) and P⁻ = ΦPΦᵀ + W about a state x̃.
#[derive(Clone, Debug, Default)]
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
    /// Of so many states.
    pub fn walk(&mut self, walk: &mut Walk<'_>, states: usize) -> Result<(), Damaged> {
        for vector in [&mut self.about, &mut self.end] {
            vector.resize(states, 0.0);
            walk.numbers(vector)?;
        }
        Arc::make_mut(&mut self.transition).walk(walk, states)?;
        let mut is_disturbed = !self.noise.is_empty();
        walk.flag(&mut is_disturbed)?;
        let count = if is_disturbed { states * states } else { 0 };
        self.noise.resize(count, 0.0);
        walk.numbers(&mut self.noise)
    }

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
