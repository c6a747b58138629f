//! Lyapunov matrices with fewer unknowns for systems whose states have few neighbours.
//!
//! In a chain of n states a full P has n(n + 1)/2 unknowns and a step of the solver takes n⁶
//! operations. Where e_j reaches e_i through many others only, P_ij is of little use; without
//! these entries there are O(n) unknowns. A P that is found so is a P like any other.

use nalgebra::DMatrix;

use super::ErrorModel;
use crate::lmi::{Affine, Problem};

/// States from which on few unknowns are tried before all of them.
const LARGE: usize = 32;
/// Couplings from one state to another over which P still has an entry.
const STEPS: usize = 8;

/// Whether a full P has so many unknowns that one with fewer is worth a trial.
pub(super) fn is_large(states: usize) -> bool {
    states > LARGE
}

/// Which entries P has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// between states that few couplings join
    Near,
    /// all
    Full,
}

impl Extent {
    /// P of this extent for the models, all of one size.
    pub fn lyapunov(self, problem: &mut Problem, models: &[ErrorModel]) -> Affine {
        let n = models.first().map_or(0, ErrorModel::size);
        match self {
            Extent::Full => problem.symmetric(n),
            Extent::Near => {
                let distances = distances(&coupled(models, n));
                problem.symmetric_where(n, |i, j| distances[i][j] <= STEPS)
            }
        }
    }
}

/// Per state: those whose equation reads it, or that its equation reads.
fn coupled(models: &[ErrorModel], n: usize) -> Vec<Vec<usize>> {
    let sum = models.iter().fold(DMatrix::zeros(n, n), |sum, model| {
        let spread = model.spread().abs() * model.reads();
        sum + model.nominal().abs() + spread
    });
    let joined = |i: usize, j: usize| sum[(i, j)] != 0.0 || sum[(j, i)] != 0.0;
    let row = |i: usize| (0..n).filter(|&j| j != i && joined(i, j)).collect();
    (0..n).map(row).collect()
}

/// Couplings from each state to each; n where nothing joins them. A state that is coupled to
/// most others, as one is whose error corrects all, is an end but no way between them.
fn distances(coupled: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let n = coupled.len();
    let is_hub = |state: usize| 2 * coupled[state].len() > n;
    let from = |start: usize| {
        let mut distance = vec![n; n];
        distance[start] = 0;
        let mut reached = vec![start];
        let mut next = 0;
        while let Some(&state) = reached.get(next) {
            next += 1;
            if state != start && is_hub(state) {
                continue;
            }
            for &other in &coupled[state] {
                if distance[other] == n {
                    distance[other] = distance[state] + 1;
                    reached.push(other);
                }
            }
        }
        distance
    };
    (0..n).map(from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decay::Sector;
    use lynkeus_expr::Interval;

    /// A chain 0 – 1 – … with one more state that only a nonlinear term couples to state 2.
    #[test]
    fn distances_count_couplings() {
        let n = 12;
        let mut constant = vec![vec![Interval::ZERO; n]; n];
        for i in 0..n - 2 {
            constant[i][i + 1] = Interval::ONE;
        }
        let mut direction = vec![Interval::ZERO; n];
        direction[2] = Interval::ONE;
        let sectors = vec![Sector {
            column: n - 1,
            direction,
            range: Interval::new(-1.0, 1.0).unwrap(),
        }];
        let models = [ErrorModel { constant, sectors }];
        let found = distances(&coupled(&models, n));
        for (i, row) in found.iter().enumerate().take(n - 1) {
            let along: Vec<usize> = (0..n - 1).map(|j| i.abs_diff(j)).collect();
            assert_eq!(row[..n - 1], along);
            assert_eq!(row[n - 1], i.abs_diff(2) + 1);
        }
        let mut corrected = models.clone();
        for row in 0..n {
            corrected[0].constant[row][0] = Interval::ONE;
        }
        let around = distances(&coupled(&corrected, n));
        assert_eq!((around[1][9], around[0][9], around[9][0]), (8, 1, 1));
        let mut problem = Problem::new();
        let P = Extent::Near.lyapunov(&mut problem, &models);
        let kept = |i: usize, j: usize| P.at_entry(i, j) != Affine::constant(&DMatrix::zeros(1, 1));
        assert!(kept(0, 8) && !kept(0, 9) && kept(9, 11) && !kept(10, 11));
    }
}
