//! A combination of values, and what came of it.

use serde::Serialize;

/// One combination of values and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The values, one per axis.
    pub values: Vec<f64>,
    /// The figures, one per measure; none where a run failed or the figure does not exist.
    pub figures: Vec<Option<f64>>,
    /// Where the largest error of the exact run is; only in simulation.
    pub peak: Option<Peak>,
    /// Readings that the likelihood counts; of filters on a log.
    pub readings: Option<usize>,
    /// Why figures are missing, if a run failed.
    pub failure: Option<String>,
}

/// The largest error of a run after its start.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Peak {
    /// the quantity
    pub name: String,
    /// its estimate there, in its unit
    pub estimate: f64,
    /// the time
    pub time: f64,
}

impl Row {
    pub(super) fn empty(values: &[f64], measures: usize) -> Self {
        Self {
            values: values.to_vec(),
            figures: vec![None; measures],
            peak: None,
            readings: None,
            failure: None,
        }
    }

    pub(super) fn set(&mut self, measure: usize, figure: Option<f64>) {
        if let Some(slot) = self.figures.get_mut(measure) {
            *slot = figure.filter(|x| x.is_finite());
        }
    }

    pub(super) fn failed(mut self, reason: impl ToString) -> Self {
        self.failure = Some(reason.to_string());
        self
    }

    /// A figure by its place among the measures.
    pub fn figure(&self, measure: usize) -> Option<f64> {
        self.figures.get(measure).copied().flatten()
    }
}
