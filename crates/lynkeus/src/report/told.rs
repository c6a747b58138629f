//! All that a page tells.

use lynkeus_model::{Diagnostic, Plant};
use serde_json::Value;

use super::fitted::Fitted;
use super::knob::Knob;
use super::tradeoff::Tradeoff;
use crate::print::head::file_name;
use crate::{Error, Outcome, Study, certify, check};

/// All that a page tells.
pub(super) struct Told<'a> {
    pub study: &'a Study,
    pub plant: &'a Plant,
    /// where the samples come from
    pub source: String,
    pub outcome: Outcome,
    pub checked: Result<check::Report, Error>,
    /// where the study has `[fit]`
    pub fitted: Option<Fitted>,
    pub certified: Result<certify::CertifyReport, Error>,
    pub moving: Result<Knob, Error>,
    pub tradeoff: Option<Tradeoff>,
    pub data: Value,
    pub notes: Vec<String>,
}

/// A warning of the model without the folders of this machine.
pub(super) fn without_folder(warning: &Diagnostic) -> Diagnostic {
    let mut warning = warning.clone();
    warning.file = file_name(&warning.file);
    warning
}
