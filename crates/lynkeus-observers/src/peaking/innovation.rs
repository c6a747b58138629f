//! A limit on the innovation.

use lynkeus_expr::Node;

use crate::estimate::Copy;
use crate::{KeySpec, Shape, Tuning, TuningError};

/// The study's key.
pub(super) const LIMIT: KeySpec = KeySpec {
    name: "innovation_limit",
    kind: "number > 0, or one per output",
    shape: Shape::POSITIVES,
    default: "none",
    meaning: "the correction sees the innovation limited to ± this: a remedy against [peaking](peaking.md)",
};

/// How large |Cx̂ − y| may get in a correction, per measured output and in its unit.
///
/// While |Cx̂ − y| stays below the limit the observer is the unlimited one, bit by bit,
/// hence the hard saturation: convergence is kept for every start from which the unlimited
/// error never leaves that strip. Beyond it the correction is smaller than the proof asks for.
pub struct InnovationLimit(Option<Vec<f64>>);

impl InnovationLimit {
    pub fn read(tuning: &Tuning, outputs: usize) -> Result<Self, TuningError> {
        Ok(Self(tuning.positive_per_chain(LIMIT.name, outputs)?))
    }

    /// Whether there is a limit.
    pub fn is_set(&self) -> bool {
        self.0.is_some()
    }

    /// x̂ − x as measured for the state that output `i` shows, limited; in the unit of the state,
    /// y = slope·x + offset. None where the output shows no single state.
    pub(crate) fn innovation(&self, copy: &Copy<'_, '_>, i: usize) -> Option<Node> {
        let innovation = copy.innovation(i)?;
        let Some(limits) = &self.0 else {
            return Some(innovation);
        };
        let graph = copy.extended.graph();
        let (_, slope, _) = copy.extended.outputs[i].state?;
        let limit = graph.constant(limits[i]) / graph.expr(slope).abs();
        Some(graph.expr(innovation).min(limit).max(-limit).node())
    }
}
