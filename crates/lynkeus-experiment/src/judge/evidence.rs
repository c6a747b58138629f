//! What a run knows of itself.

use lynkeus_model::Variable;
use lynkeus_study::EstimateSettings;

use super::Judged;
use crate::{Frozen, Quantity, Series};

/// What a run knows of itself.
pub(crate) struct Evidence<'e> {
    pub time: &'e Series,
    pub quantities: &'e [Quantity],
    /// where the log has what
    pub settings: &'e EstimateSettings,
    /// what is declared of everything estimated
    pub declared: Vec<&'e Variable>,
    /// standard deviations of quantities by name, whether or not they are told
    pub deviations: Vec<(&'e str, &'e Series)>,
    /// by measured output
    pub sensors: Vec<Judged<'e>>,
    pub frozen: &'e [Frozen],
    /// whether the deviations are a filter's own, or those of a linearised error system
    pub is_filter: bool,
    /// whether the readings are those of a log
    pub replayed: bool,
}
