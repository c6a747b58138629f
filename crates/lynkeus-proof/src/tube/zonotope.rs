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
}

/// Sums of sizes along the rows, rounded up.
fn sums(columns: &[Vec<f64>], rows: usize) -> Vec<f64> {
    let row = |j: usize| raised(columns.iter().map(|c| c[j].abs()).sum(), columns.len());
    (0..rows).map(row).collect()
}
