//! The fastest decay that can be proved for a given error system.
//!
//! In a chain of n states a full P has n(n + 1)/2 unknowns and a step of the solver takes n⁶
//! operations. Where e_j reaches e_i through many others only, P_ij is of little use; without
//! these entries there are O(n) unknowns. A P that is found so is a P like any other.

use std::collections::BTreeSet;

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

use super::check::holds;
use super::frame::{Frame, Seen};
use super::{ErrorModel, Proof};
use crate::lmi::{Affine, Problem};
use crate::lyapunov::symmetric;

/// The rate is found to this relative accuracy: finer than the reserve with which gains
/// are designed, so that a designed gain is found to reach its rate.
const ACCURACY: f64 = 0.005;
/// Rates below this share of the limit count as none.
const NEGLIGIBLE: f64 = 1e-7;

/// A proof of decay at `rate`, accepted by [`holds`]; none where there is none of this
/// form or it cannot be found. `scale` is the size of each state that counts as one.
pub fn prove(models: &[ErrorModel], scale: &[f64], rate: f64, budget: &Budget) -> Option<Proof> {
    let n = models.first()?.size();
    if !models.iter().all(|m| m.size() == n && m.is_bounded()) {
        return None;
    }
    let frames: Vec<Frame> = Frame::natural(models, scale)
        .into_iter()
        .chain([Frame::plain(models, scale)])
        .collect();
    let extents = match is_large(n) {
        true => &[Extent::Near, Extent::Full][..],
        false => &[Extent::Full],
    };
    let mut trials = extents
        .iter()
        .flat_map(|&extent| frames.iter().map(move |frame| (frame, extent)));
    trials.find_map(|(frame, extent)| prove_in(frame, extent, models, rate, budget))
}

fn prove_in(
    frame: &Frame,
    extent: Extent,
    models: &[ErrorModel],
    rate: f64,
    budget: &Budget,
) -> Option<Proof> {
    let scaled = |m: &ErrorModel| m.scaled(&frame.sizes, frame.unit);
    let scaled: Vec<ErrorModel> = models.iter().map(scaled).collect();
    let seen: Vec<Seen> = scaled.iter().map(|m| frame.seen(m)).collect();
    let mut problem = Problem::new(budget);
    let P = extent.lyapunov(&mut problem, &scaled);
    let found = candidate(problem, &P, &seen, rate * frame.unit)?;
    let found = frame.restored(models, found);
    let proof = Proof { rate, ..found };
    holds(models, &proof).then_some(proof)
}

/// What the solver says, unchecked: P in the frame's axes, the multipliers in the
/// models' units.
fn candidate(mut problem: Problem, P: &Affine, models: &[Seen], rate: f64) -> Option<Proof> {
    problem.positive(P.clone());
    problem.positive(Affine::identity(P.rows()).minus(P));
    let mut multipliers = vec![];
    for model in models {
        if problem.is_spent() {
            return None;
        }
        let PA = P.times(&model.A);
        multipliers.push(inequality(&mut problem, P, &PA, (&model.B, &model.C), rate));
    }
    let point = problem.inside().ok()?;
    let restored = |(T, model): (&Affine, &Seen)| {
        let diagonal = T.at(&point).diagonal();
        diagonal.component_div(&model.weights)
    };
    Some(Proof {
        rate,
        P: symmetric(&P.at(&point)),
        multipliers: multipliers.iter().zip(models).map(restored).collect(),
    })
}

/// The proof of the fastest decay up to `limit`, by bisection; none where not even a
/// rate of zero can be proved. Where the budget ends it is the fastest found by then.
pub fn fastest(models: &[ErrorModel], scale: &[f64], limit: f64, budget: &Budget) -> Option<Proof> {
    let mut best = prove(models, scale, 0.0, budget)?;
    if let Some(proof) = prove(models, scale, limit, budget) {
        return Some(proof);
    }
    let (mut low, mut high) = (0.0, limit);
    // slow decay is worth knowing as precisely as fast decay: bisect on a
    // logarithmic scale once a positive rate is found
    while low < high * (1.0 - ACCURACY) && high > NEGLIGIBLE * limit && budget.spent().is_none() {
        let rate = match low > 0.0 {
            true => (low * high).sqrt(),
            false => high * 0.25,
        };
        match prove(models, scale, rate, budget) {
            Some(proof) => (low, best) = (rate, proof),
            None => high = rate,
        }
    }
    Some(best)
}

/// Adds the inequality of [`super`] for one model, PA given, with B and C of its
/// uncertain part B δ C; returns T.
pub(super) fn inequality(
    problem: &mut Problem,
    P: &Affine,
    PA: &Affine,
    (B, C): (&DMatrix<f64>, &DMatrix<f64>),
    rate: f64,
) -> Affine {
    let decay = PA.he().plus(&P.scaled(2.0 * rate));
    let T = problem.diagonal(C.nrows());
    let paid = T.after(&C.transpose()).times(C);
    let corner = decay.plus(&paid);
    let PB = P.times(B);
    let block = Affine::symmetric_blocks(&corner, &PB, &T.scaled(-1.0));
    problem.positive(block.scaled(-1.0));
    T
}

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
                let near = near(&coupled(models, n));
                problem.symmetric_where(n, |i, j| near[i].contains(&j))
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

/// The states that few couplings join to each. A state that is coupled to most others, as one is
/// whose error corrects all, is an end but no way between them.
fn near(coupled: &[Vec<usize>]) -> Vec<BTreeSet<usize>> {
    let n = coupled.len();
    let from = |start: usize| {
        let is_way = |&&state: &&usize| state == start || 2 * coupled[state].len() <= n;
        let mut near = BTreeSet::from([start]);
        for _ in 0..STEPS {
            let next: Vec<usize> = near
                .iter()
                .filter(is_way)
                .flat_map(|&s| &coupled[s])
                .copied()
                .collect();
            near.extend(next);
        }
        near
    };
    (0..n).map(from).collect()
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Interval;

    use super::*;
    use crate::decay::Sector;

    /// A chain 0 – 1 – … with one more state that only a nonlinear term couples to state 2.
    #[test]
    fn near_is_what_few_couplings_join() {
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
        for (i, found) in near(&coupled(&models, n)).iter().enumerate().take(n - 1) {
            let along = (0..n - 1).filter(|&j| i.abs_diff(j) <= STEPS);
            let beside = (i.abs_diff(2) < STEPS).then_some(n - 1);
            let expected: Vec<usize> = along.chain(beside).collect();
            assert_eq!(found.iter().copied().collect::<Vec<_>>(), expected);
        }
        let mut corrected = models.clone();
        for row in 0..n {
            corrected[0].constant[row][0] = Interval::ONE;
        }
        let around = near(&coupled(&corrected, n));
        // not by way of state 0, to which all are coupled
        assert!(around[1].contains(&9) && !around[1].contains(&10));
        assert!(around[0].contains(&10) && around[10].contains(&0));
        let mut problem = Problem::new(&Budget::default());
        let P = Extent::Near.lyapunov(&mut problem, &models);
        let kept = |i: usize, j: usize| P.terms(i, j).next().is_some();
        assert!(kept(0, 8) && !kept(0, 9) && kept(9, 11) && !kept(10, 11));
    }
}
