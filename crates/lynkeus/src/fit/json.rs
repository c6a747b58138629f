//! A fit for machines.

use serde::Serialize;
use serde_json::{Value, json};

use super::errors::{Errors, Portion};
use super::experiment::NextExperiment;
use super::uncertainty::Known;
use super::unknown::{Kind, Unknown};
use super::{Fit, Optimum};
use crate::{Answer, Doubt};
use lynkeus_experiment::entries::{Named, finite};

/// The answer of `fit`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct FitReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// what was fitted to
    logs: &'a [String],
    /// −log L at the values, without the share of priors
    nll: Option<f64>,
    /// the same at the study's own values
    nll_at_start: Option<f64>,
    /// Akaike's criterion, 2·nll + 2k with k values found
    aic: Option<f64>,
    /// the Bayesian one, 2·nll + k·log(readings)
    bic: Option<f64>,
    /// whether nothing is left to gain nearby
    converged: bool,
    /// whether nothing speaks against the values
    credible: bool,
    /// what the readings say against them, what weighs most first
    doubts: &'a [Doubt],
    /// readings that were fitted
    readings: usize,
    /// how often −log L was computed
    evaluations: usize,
    /// parameters of the plant
    parameters: Named<FittedValue>,
    /// noises of the sensors, as the study has them
    noise: Named<FittedValue>,
    /// spectral densities
    process_noise: Named<FittedValue>,
    /// starts, one per log
    initial: Named<Vec<FittedValue>>,
    /// how the errors of the values depend on each other
    correlation: Correlation,
    /// different ends of the searches that converged, the best first
    optima: Vec<FittedOptimum>,
    /// what the logs do not determine
    undetermined: &'a [String],
    /// combinations of the parameters that the outputs tell nevertheless
    combinations: Vec<&'a str>,
    /// errors of predictions, by output
    errors: Named<FittedErrors>,
    /// how well the values would be known with one more log, the best first; where that is asked
    #[serde(skip_serializing_if = "Option::is_none")]
    next_experiment: Option<&'a [NextExperiment]>,
    /// what speaks against the values
    warnings: &'a [String],
    /// what you should know
    notes: &'a [String],
}

/// A value that was found.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FittedValue {
    /// the value
    value: f64,
    /// its standard deviation; none at a bound
    sd: Option<f64>,
    /// 95 %
    interval: Option<[f64; 2]>,
    /// whether it is at a bound
    at_bound: bool,
}

/// Correlations of the errors of what is not at a bound.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct Correlation {
    /// what stands in each row
    names: Vec<String>,
    /// row by row
    matrix: Vec<Vec<Option<f64>>>,
}

/// An end of searches.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FittedOptimum {
    /// −log L there
    nll: f64,
    /// how many searches ended there
    found: usize,
}

/// Errors of predictions of an output.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FittedErrors {
    /// in the rows that were fitted
    fitted: PortionErrors,
    /// in those that were held out
    held_out: Option<PortionErrors>,
    /// the statistic of Ljung and Box over its number of lags: about 1 where the innovations are white
    ljung_box: Option<f64>,
}

/// Errors of predictions in some of the rows.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct PortionErrors {
    /// readings there
    readings: usize,
    /// root mean square of the innovations
    one_step: Option<f64>,
    /// mean of the squared innovations over their variances: 1 where these are right
    squares: Option<f64>,
    /// root mean square error of the plant alone
    free_run: Option<f64>,
}

impl Fit {
    /// The fit for machines.
    pub fn entries(&self) -> Value {
        let count = self.unknowns.len() as f64;
        let criterion = |each: f64| finite(2.0 * self.nll + each * count);
        let names = self.uncertainty.free.iter();
        let rows = self.uncertainty.correlation.row_iter();
        let mut initial: Named<Vec<FittedValue>> = Named::new();
        for (unknown, known) in self.values() {
            if matches!(unknown.kind, Kind::Start { .. }) {
                initial
                    .entry(unknown.name.clone())
                    .or_default()
                    .push(known.into());
            }
        }
        json!(FitReport {
            plant: &self.plant,
            logs: &self.logs,
            nll: finite(self.nll),
            nll_at_start: finite(self.nll_at_start),
            aic: criterion(2.0),
            bic: criterion((self.readings as f64).ln()),
            converged: self.is_converged,
            credible: self.refusal().is_none(),
            doubts: &self.doubts,
            readings: self.readings,
            evaluations: self.evaluations,
            parameters: self.of(|kind| matches!(kind, Kind::Parameter)),
            noise: self.of(|kind| matches!(kind, Kind::Noise(_))),
            process_noise: self.of(|kind| matches!(kind, Kind::Density(_))),
            initial,
            correlation: Correlation {
                names: names.map(|&i| self.unknowns[i].label()).collect(),
                matrix: rows
                    .map(|row| row.iter().map(|x| finite(*x)).collect())
                    .collect(),
            },
            optima: self.optima.iter().map(FittedOptimum::from).collect(),
            undetermined: &self.undetermined,
            combinations: self.combinations(),
            errors: (self.errors.iter())
                .map(|errors| (errors.output.clone(), errors.into()))
                .collect(),
            next_experiment: self.ahead.as_ref().map(|ahead| &ahead.tried[..]),
            warnings: &self.warnings,
            notes: &self.notes,
        })
    }

    /// What was found, with how well it is known.
    pub(super) fn values(&self) -> impl Iterator<Item = (&Unknown, &Known)> {
        self.unknowns.iter().zip(&self.uncertainty.known)
    }

    fn of(&self, is_asked: fn(Kind) -> bool) -> Named<FittedValue> {
        let own = self.values().filter(|(unknown, _)| is_asked(unknown.kind));
        own.map(|(unknown, known)| (unknown.name.clone(), known.into()))
            .collect()
    }

    /// Combinations of hidden parameters that the outputs tell.
    pub(super) fn combinations(&self) -> Vec<&str> {
        let symmetries = self.exact.symmetries.iter();
        symmetries
            .flat_map(|s| s.invariants.iter().map(String::as_str))
            .collect()
    }
}

impl From<&Known> for FittedValue {
    fn from(known: &Known) -> Self {
        Self {
            value: known.value,
            sd: known.sd.and_then(finite),
            interval: known.interval.map(|(low, high)| [low, high]),
            at_bound: known.is_bound,
        }
    }
}

impl From<&Optimum> for FittedOptimum {
    fn from(optimum: &Optimum) -> Self {
        let Optimum { nll, found, .. } = *optimum;
        Self { nll, found }
    }
}

impl From<&Errors> for FittedErrors {
    fn from(errors: &Errors) -> Self {
        Self {
            fitted: errors.fitted.into(),
            held_out: errors.held_out.map(PortionErrors::from),
            ljung_box: errors.whiteness.and_then(|w| finite(w.ljung_box)),
        }
    }
}

impl From<Portion> for PortionErrors {
    fn from(portion: Portion) -> Self {
        let Portion {
            readings,
            one_step,
            squares,
            free_run,
        } = portion;
        Self {
            readings,
            one_step,
            squares,
            free_run,
        }
    }
}
