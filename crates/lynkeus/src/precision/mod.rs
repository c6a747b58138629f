//! How well: the standard error of every state and unknown input along the study's run, for its noise
//! and sampling; how it falls with the horizon; which sensors help most.
//!
//! The definitions are in [`lynkeus_observability::precision`].

mod experiment;
mod filtered;
#[cfg(feature = "plot")]
mod picture;
mod report;
#[cfg(test)]
mod tests;
mod words;

use lynkeus_expr::Node;
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_observability::precision::{Advice, Deviations, SensorSet};

use crate::{Error, Study};
pub use experiment::{Assumed, Candidates, Options};
use experiment::{Setup, ended};
use lynkeus_experiment::course::plant::open_loop;
use lynkeus_experiment::prepare;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::{Account, Declared};
use lynkeus_experiment::prepare::systems;
use lynkeus_experiment::words::explain;
#[cfg(test)]
pub(crate) use report::HowWellReport;

/// The answer of `lynkeus check --how-well`.
#[derive(Clone, Debug)]
pub struct Report {
    /// Name of the plant.
    pub plant: String,
    /// The unit of time, where the study has one.
    pub time_unit: Option<String>,
    /// States and unknown inputs.
    pub names: Vec<String>,
    /// What errors are compared with: range or magnitude, in the unit of each.
    pub scales: Vec<f64>,
    /// Number of entries of `names` that are states.
    pub states: usize,
    /// First instant of the window.
    pub start: f64,
    /// Time between samples.
    pub step: f64,
    /// Horizons, in the plant's unit of time.
    pub horizons: Vec<f64>,
    /// How many were asked for: a limit may have ended the run before the last.
    pub asked: usize,
    /// Standard errors at each horizon, in the units of the quantities.
    pub deviations: Vec<Deviations>,
    /// By horizon, the standard errors for a model that is exact.
    pub exact: Vec<Vec<f64>>,
    /// By horizon, the standard deviations of the extended Kalman filter on the study's noises; none
    /// where it breaks down.
    pub filtered: Option<Vec<Vec<f64>>>,
    /// What the study declares of how far the model is right, by key: then the present standard errors count it.
    pub counted: Vec<&'static str>,
    /// Which of the study's declarations the present standard errors count.
    pub declared: Account,
    /// All sensors considered, the study's first.
    pub sensors: Vec<Assumed>,
    /// How many of them are the study's.
    pub measured: usize,
    /// Inputs that are taken as zero: what they add to errors is not in these numbers.
    pub disturbances: Vec<String>,
    /// Whether which quantities are seen at the longest horizon hangs on the integrator's accuracy.
    pub is_doubtful: bool,
    /// Which sensors help most, where it was asked.
    pub advice: Option<Advice>,
}

/// Computes standard errors along the study's run.
///
/// # Errors
/// A study that does not fit its plant or has no `[simulate]`; an impossible horizon; a run that
/// breaks down.
pub fn precision(study: &Study, options: &Options) -> Result<Report, Error> {
    let settings = systems::settings(study)?;
    let plant = prepare::plant(study)?;
    refuse_driven_events(study, &plant)?;
    let prepared = Prepared::new(study, &plant)?;
    let mut states = plant.states.iter();
    if let Some(state) = states.find(|s| matches!(s.home, Home::Rotation { .. })) {
        let message = format!(
            "what is foretold here is how well real numbers can be known, and [manifold] has a quaternion ({})",
            state.name
        );
        let hint = "`lynkeus simulate STUDY --runs 100` says how well a filter knows it";
        return Err(Error::input(message).at(&study.file).hint(hint));
    }
    let setup = Setup::new(&prepared, settings, options)?;
    let found = setup
        .experiment
        .run()
        .map_err(|error| ended(study).unwrap_or_else(|| explain(error).at(&study.file)))?;
    let measured: Vec<usize> = (0..setup.measured).collect();
    let at = |horizon: usize| found.deviations(horizon, &measured);
    let candidates: Vec<usize> = (0..found.sensors.len()).collect();
    let mut deviations: Vec<Deviations> = (0..found.horizons.len()).map(at).collect();
    let exact = deviations.iter().map(|d| d.present.clone()).collect();
    let mut run = open_loop(study, settings, &plant)?;
    run.until = run.start + found.horizons.last().copied().unwrap_or_default();
    let filtered = filtered::filtered(&prepared, &setup, run)?;
    let counted = counted(prepared.declared(), filtered.is_some());
    if let (false, Some(filtered)) = (counted.is_empty(), &filtered) {
        deviations
            .iter_mut()
            .zip(filtered)
            .for_each(|(d, own)| count(d, own));
    }
    let report = Report {
        disturbances: prepare::sensors(study, &plant).disturbances,
        asked: setup.experiment.window.horizons.len(),
        exact,
        filtered,
        declared: account(prepared.declared(), !counted.is_empty()),
        counted,
        plant: plant.name.clone(),
        time_unit: study.time_unit.clone(),
        states: plant.states.len(),
        start: setup.experiment.window.start,
        step: setup.experiment.window.step,
        deviations,
        advice: options
            .sensors
            .map(|_| found.advise(&measured, &candidates)),
        is_doubtful: found.is_doubtful(found.horizons.len().saturating_sub(1), &measured),
        measured: setup.measured,
        sensors: setup.assumed,
        names: found.names,
        scales: found.scales,
        horizons: found.horizons,
    };
    // what was computed after the end does not count
    ended(study).map_or(Ok(report), Err)
}

/// Events come when the states say so: an input that nobody measures has no say in them here.
fn refuse_driven_events(study: &Study, plant: &Plant) -> Result<(), Error> {
    let unknown = prepare::sensors(study, plant).unknown;
    let inputs = plant
        .inputs
        .iter()
        .filter(|input| unknown.contains(&input.name));
    let inputs: Vec<&Variable> = inputs.collect();
    for clause in &plant.whens.clauses {
        let values = clause.changes.iter().map(|change| change.1);
        let read: Vec<Node> = clause.conditions.iter().copied().chain(values).collect();
        let read = plant.graph.symbols_of(&read);
        if let Some(input) = inputs.iter().find(|input| read.contains(&input.node)) {
            let message = format!(
                "the `when` of line {} reads the unknown input {}: how well it can be known is not foretold through such events",
                clause.line, input.name
            );
            let hint = "`lynkeus simulate STUDY --runs 100` says how well a filter knows it";
            return Err(Error::input(message).at(&study.file).hint(hint));
        }
    }
    Ok(())
}

/// The section of the densities.
pub(super) const PROCESS_NOISE: &str = "[process_noise]";

/// The keys whose noises are counted, by the filter where it does not break down.
fn counted(declared: &Declared, is_filtered: bool) -> Vec<&'static str> {
    let all = [
        (PROCESS_NOISE, declared.process_noise.is_declared()),
        ("`input_noise`", declared.input_noise.acts()),
        ("`correlation`", declared.correlation.acts()),
    ];
    let all = all
        .into_iter()
        .filter(|(_, is_there)| *is_there && is_filtered);
    all.map(|(key, _)| key).collect()
}

/// What the standard errors count.
fn account(declared: &Declared, by_filter: bool) -> Account {
    let Declared {
        ranges,
        noise,
        limits,
        samples,
        process_noise,
        disturbances,
        slew,
        input_derivatives,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = declared;
    let broken = "the filter on the study's noises breaks down along this run";
    Account::default()
        .counts(manifold)
        .leaves(screens, "they are of logs: every simulated reading counts")
        .leaves(
            late,
            "what is known counts each reading at the time of its sample, and is known once it has come",
        )
        .counts(ranges)
        .counts(noise)
        .counts(limits)
        .counts(samples)
        .counts_if(by_filter, process_noise, broken)
        .counts_if(by_filter, input_noise, broken)
        .counts_if(by_filter, correlation, broken)
        .leaves(disturbances, "taken as zero, as the observer takes them")
        .leaves(
            slew,
            "how far an unknown input wanders counts by [process_noise]",
        )
        .leaves(input_derivatives, "the inputs are those of [simulate]")
}

/// Present errors with the process noise counted; what samples do not show stays unseen.
fn count(deviations: &mut Deviations, filtered: &[f64]) {
    let pairs = deviations.present.iter_mut().zip(filtered);
    pairs
        .filter(|(σ, _)| σ.is_finite())
        .for_each(|(σ, own)| *σ = *own);
}

/// Errors below this share of the range are none.
const NOTHING: f64 = 1e-12;

impl Report {
    /// A standard error of a quantity as it is told: one that the plant has forgotten altogether is 0.
    fn told(&self, quantity: usize, σ: f64) -> f64 {
        match σ < NOTHING * self.scales[quantity] {
            true => 0.0,
            false => σ,
        }
    }

    /// True where every state and unknown input is seen at the longest horizon.
    pub fn is_positive(&self) -> bool {
        self.last()
            .is_some_and(|d| d.present.iter().all(|σ| σ.is_finite()))
    }

    /// Standard errors at the longest horizon.
    pub fn last(&self) -> Option<&Deviations> {
        self.deviations.last()
    }

    /// Present standard error as a share of the scale; infinite where unseen.
    fn share(&self, deviations: &Deviations, quantity: usize) -> f64 {
        self.told(quantity, deviations.present[quantity]) / self.scales[quantity]
    }

    /// Geometric mean over the quantities that are seen, as a share of the scale, and how many are not.
    fn mean(&self, deviations: &Deviations) -> (f64, usize) {
        let all = 0..self.names.len();
        let shares: Vec<f64> = all.map(|i| self.share(deviations, i)).collect();
        let seen = || shares.iter().filter(|s| s.is_finite());
        // what is certain has no say in the mean
        let told = || seen().filter(|s| **s > 0.0);
        let logs: f64 = told().map(|s| s.max(1e-12).ln()).sum();
        let mean = (logs / told().count().max(1) as f64).exp();
        match seen().count() {
            0 => (f64::INFINITY, shares.len()),
            count => (mean, shares.len() - count),
        }
    }

    /// Quantities at the longest horizon, the least certain first.
    fn ranked(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.names.len()).collect();
        if let Some(last) = self.last() {
            order.sort_by(|&i, &j| self.share(last, j).total_cmp(&self.share(last, i)));
        }
        order
    }

    /// Names of the sensors of a set.
    fn set(&self, set: &SensorSet) -> String {
        let names = set.sensors.iter().filter_map(|&s| self.sensors.get(s));
        names
            .map(|s| s.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    }
}
