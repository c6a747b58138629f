//! What is left beside the polynomial: G ξ with ξ ∈ [−1, 1]ᵐ, and its way through a step.

use super::model::raised;

/// Most columns per row.
const COLUMNS: usize = 30;

/// The columns of G.
#[derive(Clone, Debug)]
pub(super) struct Zonotope {
    columns: Vec<Vec<f64>>,
    rows: usize,
}

impl Zonotope {
    /// The origin.
    pub fn origin(rows: usize) -> Self {
        Self {
            columns: vec![],
            rows,
        }
    }

    /// d with |(Gξ)ⱼ| ≤ dⱼ.
    pub fn reach(&self) -> Vec<f64> {
        sums(&self.columns, self.rows)
    }

    /// L (Gξ / d) + β with |β| ≤ `around`: the image by W = L/d of every column, a column per row for
    /// β and what rounding takes, and no more columns than are bearable.
    pub fn through(&self, L: &[Vec<f64>], d: &[f64], around: &[f64]) -> Self {
        let n = self.rows;
        let scaled = |l: f64, d: f64| if d > 0.0 { l / d } else { 0.0 };
        let W: Vec<Vec<f64>> = L
            .iter()
            .map(|row| row.iter().zip(d).map(|(&l, &d)| scaled(l, d)).collect())
            .collect();
        let along = |row: &Vec<f64>, column: &[f64]| -> f64 {
            row.iter().zip(column).map(|(w, g)| w * g).sum()
        };
        let image = |column: &Vec<f64>| W.iter().map(|row| along(row, column)).collect();
        let mut columns: Vec<Vec<f64>> = self.columns.iter().map(image).collect();
        let long = d.iter().fold(0.0_f64, |a, b| a.max(*b));
        // Σᵢ |Wₖⱼ Gⱼᵢ| ≤ |Lₖⱼ|, of which each product and sum takes a share
        let rounding = |k: usize| {
            let size: f64 = L[k].iter().map(|l| l.abs()).sum();
            let tiny = (n * (self.columns.len() + 1)) as f64 * f64::MIN_POSITIVE * (1.0 + long);
            raised((n as f64 + 4.0) * f64::EPSILON * size, n) + tiny
        };
        let mut rest: Vec<f64> = (0..n).map(|k| raised(around[k] + rounding(k), 2)).collect();
        let most = n * COLUMNS;
        if columns.len() + n > most {
            // long columns that are no axis say most about the shape
            let weight = |c: &Vec<f64>| {
                let sizes = c.iter().map(|x| x.abs());
                sizes.clone().sum::<f64>() - sizes.fold(0.0, f64::max)
            };
            columns.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
            let small = columns.split_off((most - n) * 3 / 4);
            for (rest, sum) in rest.iter_mut().zip(sums(&small, n)) {
                *rest = raised(*rest + sum, 2);
            }
        }
        columns.extend((0..n).filter(|&k| rest[k] > 0.0).map(|k| {
            let mut column = vec![0.0; n];
            column[k] = rest[k];
            column
        }));
        Self { columns, rows: n }
    }

    /// With more columns; the next image joins what are too many.
    pub fn beside(mut self, columns: Vec<Vec<f64>>) -> Self {
        let is_there = |column: &Vec<f64>| column.iter().any(|x| *x != 0.0);
        self.columns.extend(columns.into_iter().filter(is_there));
        self
    }
}

/// Sums of sizes along the rows, rounded up.
fn sums(columns: &[Vec<f64>], rows: usize) -> Vec<f64> {
    let row = |j: usize| raised(columns.iter().map(|c| c[j].abs()).sum(), columns.len());
    (0..rows).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 2;

    /// The largest c·x.
    fn support(zonotope: &Zonotope, c: &[f64]) -> f64 {
        let along = |column: &Vec<f64>| -> f64 { column.iter().zip(c).map(|(g, c)| g * c).sum() };
        zonotope.columns.iter().map(|g| along(g).abs()).sum()
    }

    /// In every direction the image reaches as far as the set itself does through L/d and β, and
    /// where columns are joined not much further; through a hundred turns and shears.
    #[test]
    fn images_reach_as_far_as_they_have_to() {
        let mut set =
            Zonotope::origin(ROWS).through(&vec![vec![0.0; 2]; 2], &[0.0; 2], &[1.0, 0.5]);
        for turn in 0..100 {
            let d = set.reach();
            let (sine, cosine) = (0.3 + 0.1 * f64::from(turn)).sin_cos();
            let W = [[cosine, -sine], [0.2 + sine, cosine]].map(|row| row.map(|w| 0.8 * w));
            let L: Vec<Vec<f64>> = W
                .iter()
                .map(|row| row.iter().zip(&d).map(|(w, d)| w * d).collect())
                .collect();
            let around = [0.01, 0.02];
            let next = set.through(&L, &d, &around);
            assert!(next.columns.len() <= ROWS * COLUMNS);
            for k in 0..24 {
                let (s, c) = (f64::from(k) * 0.27).sin_cos();
                let back = [W[0][0] * c + W[1][0] * s, W[0][1] * c + W[1][1] * s];
                let needed = support(&set, &back) + around[0] * c.abs() + around[1] * s.abs();
                let found = support(&next, &[c, s]);
                assert!(found >= needed * (1.0 - 1e-14), "{turn}: {found} {needed}");
                assert!(found <= 1.5 * needed, "{turn}: {found} {needed}");
            }
            let axes = [[1.0, 0.0], [0.0, 1.0]].map(|axis| support(&next, &axis));
            assert!(
                next.reach()
                    .iter()
                    .zip(axes)
                    .all(|(d, reached)| *d >= reached)
            );
            set = next;
        }
    }
}
