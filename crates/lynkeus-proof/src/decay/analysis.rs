//! The fastest decay that can be proved for a given error system.

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

use super::extent::{Extent, is_large};
use super::frame::{Frame, Seen};
use super::{ErrorModel, Proof, check::holds};
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
    let scale = &frame.scale;
    let scaled: Vec<ErrorModel> = models.iter().map(|m| scale.model(m)).collect();
    let seen: Vec<Seen> = scaled.iter().map(|m| frame.seen(m)).collect();
    let mut problem = Problem::new();
    problem.set_budget(budget);
    let P = extent.lyapunov(&mut problem, &scaled);
    let mut proof = candidate(problem, &P, &seen, rate * scale.unit)?;
    proof.P = symmetric(&frame.restored(&proof.P));
    let proof = scale.restored(models, &proof);
    let proof = Proof { rate, ..proof };
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
    let solution = problem.inside().ok()?;
    let restored = |(T, model): (&Affine, &Seen)| {
        let diagonal = solution.value(T).diagonal();
        diagonal.component_div(&model.weights)
    };
    Some(Proof {
        rate,
        P: symmetric(&solution.value(P)),
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
