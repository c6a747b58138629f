//! What a study asks of its logs: what is to be found, and the functions of it that the logs are.

use lynkeus_model::{Plant, Variable};
use lynkeus_observers::FilterTuning;
use lynkeus_observers::kalman::{EKF, UKF};
use lynkeus_structure::{AugmentedPlant, Dimension, Verdict, regularity, steps};
use lynkeus_study::{Name, Objective};

use super::known::{self, Exact};
use super::logs::FittedLog;
use super::plant::Source;
use super::problem::Term;
use super::unknown::{self, Kind, Unknown};
use crate::{Error, Study, Table};
use lynkeus_experiment::prepare::{self, Prepared, StudyDesign};
use lynkeus_experiment::words::explain;

/// The study by the filter whose innovations are fitted, and what is to be said of that.
pub(super) fn with_filter(study: &Study) -> Result<(Study, Vec<String>), Error> {
    let mut own = study.clone();
    let mut notes = vec![];
    let family = study
        .observer
        .family
        .as_ref()
        .map(|name| name.text.as_str());
    if ![EKF, UKF].iter().any(|own| family == Some(own.name())) {
        if let (Some(family), Objective::Innovations) = (family, study.fit.objective) {
            notes.push(format!(
                "the likelihood is that of family = \"ekf\": {family} has none whose derivatives are known"
            ));
        }
        own.observer.family = Some(Name::from(EKF.name()));
    }
    Ok((own, notes))
}

/// The logs as a fit reads them.
///
/// # Errors
/// There is none; as [`FittedLog::new`].
pub(super) fn logs(
    prepared: &Prepared<'_>,
    design: &StudyDesign,
    tables: &[Table],
) -> Result<Vec<FittedLog>, Error> {
    tuning(prepared, design)?;
    if tables.is_empty() {
        return Err(Error::input("fit needs a log").at(&prepared.study().file));
    }
    let logs = tables
        .iter()
        .map(|table| FittedLog::new(prepared, design, table, tables.len() > 1));
    logs.collect()
}

fn tuning<'d>(prepared: &Prepared<'_>, design: &'d StudyDesign) -> Result<&'d FilterTuning, Error> {
    let none = || Error::input("fit needs a filter").at(&prepared.study().file);
    design.observer.filter.as_ref().ok_or_else(none)
}

/// What a study asks of its logs.
pub(super) struct Posed<'s> {
    prepared: &'s Prepared<'s>,
    tuning: &'s FilterTuning,
    /// with the parameters that are found as symbols
    symbolic: &'s Plant,
    seen: AugmentedPlant<'s>,
    logs: &'s [FittedLog],
    pub unknowns: Vec<Unknown>,
}

impl<'s> Posed<'s> {
    /// # Errors
    /// As [`unknown::unknowns`].
    pub fn new(
        prepared: &'s Prepared<'s>,
        design: &'s StudyDesign,
        symbolic: &'s Plant,
        logs: &'s [FittedLog],
    ) -> Result<Self, Error> {
        let study = prepared.study();
        Ok(Self {
            unknowns: unknown::unknowns(prepared, symbolic, logs)?,
            seen: prepare::seen_by(study, symbolic, &prepare::sensors(study, symbolic))?,
            tuning: tuning(prepared, design)?,
            prepared,
            symbolic,
            logs,
        })
    }

    /// What a likelihood is made of, of the plant alone or along the filter.
    pub fn source(&self, is_alone: bool) -> Source<'_> {
        Source {
            prepared: self.prepared,
            symbolic: &self.seen,
            tuning: self.tuning,
            is_alone,
            further: &[],
        }
    }

    /// One per log, of the plant alone or along the filter; logs whose states start alike have one likelihood.
    ///
    /// # Errors
    /// As [`Source::likelihood`].
    pub fn terms(&self, is_alone: bool) -> Result<Vec<Term>, Error> {
        let source = self.source(is_alone);
        let mut terms: Vec<Term> = vec![];
        for (place, log) in self.logs.iter().enumerate() {
            let is_own = |kind: Kind| !matches!(kind, Kind::Start { log, .. } if log != place);
            let own: Vec<(usize, &Unknown)> = (self.unknowns.iter().enumerate())
                .filter(|(_, unknown)| is_own(unknown.kind))
                .collect();
            let places = own.iter().map(|(place, _)| *place).collect();
            let likelihood = match terms.first() {
                Some(first) if log.starts == self.logs[0].starts => first.likelihood.clone(),
                _ => source.likelihood(&own, &log.starts)?,
            };
            terms.push(Term { likelihood, places });
        }
        Ok(terms)
    }

    /// What the sensors can tell at all.
    ///
    /// # Errors
    /// As [`known::exact`].
    pub fn exact(&self) -> Result<Exact, Error> {
        let variances = &self.tuning.initial_variance;
        known::exact(self.prepared, self.symbolic, &self.unknowns, variances)
    }

    /// The places of the parameters on which it depends where the model jumps, or may: no derivative sees that a jump
    /// moves.
    ///
    /// # Errors
    /// An expression that reads another symbol.
    pub fn jumping(&self) -> Result<Vec<usize>, Error> {
        let graph = self.seen.graph();
        let all = [self.seen.derivatives.clone(), self.seen.output_nodes()].concat();
        let seen = graph.with_residuals(&all);
        let mut region = self.seen.region();
        let mut asked = vec![];
        for (place, unknown) in self.unknowns.iter().enumerate() {
            let mut parameters = self.symbolic.parameters.iter().map(|p| &p.variable);
            let is_own = |v: &&Variable| unknown.kind == Kind::Parameter && v.name == unknown.name;
            let Some(own) = parameters.find(is_own) else {
                continue;
            };
            region.dimensions.push(Dimension {
                name: unknown.name.clone(),
                symbol: own.node,
                min: unknown.low,
                max: unknown.high,
                integer: false,
            });
            if seen.iter().any(|node| steps(graph, *node, &[own.node])) {
                asked.push((place, own.node));
            }
        }
        let mut found = vec![];
        for (place, node) in asked {
            let finding = regularity(graph, &all, &[node], &region).map_err(explain)?;
            if finding.verdict != Verdict::Proved {
                found.push(place);
            }
        }
        Ok(found)
    }

    /// Names of what is measured.
    pub fn outputs(&self) -> Vec<String> {
        let outputs = self.seen.outputs.iter();
        outputs.map(|o| o.variable.name.clone()).collect()
    }

    /// What the user should know of the logs and of the filter.
    pub fn notes(&self) -> Vec<String> {
        let logs = self.logs.iter().flat_map(|log| log.notes.clone());
        let is_left_out = self.tuning.gate.is_some() || self.tuning.projects;
        let left_out = is_left_out.then(|| {
            "the gate and `bounds` of [observer] are left out of the likelihood".to_owned()
        });
        logs.chain(left_out).collect()
    }

    /// What of the logs or of the study contradicts itself, or counts nowhere.
    pub fn warnings(&self) -> Vec<String> {
        let logs = self.logs.iter().flat_map(|log| log.warnings.clone());
        let beside = self.unknowns.iter().filter_map(Unknown::beside_its_prior);
        logs.chain(beside).collect()
    }
}
