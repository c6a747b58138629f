//! The gains, matrices and parameters of a study's observer.

use lynkeus_answer::Document;
use lynkeus_answer::document::Table;
use lynkeus_observers::Design;
use lynkeus_structure::Standing;
use lynkeus_words::{Words, counted};
use serde::Serialize;
use serde_json::{Value, json};

use crate::certify::{self, Proof};
use crate::{Answer, CertifyReport, Error, Study};
use lynkeus_experiment::entries::{Fit, Named, finite};
use lynkeus_experiment::prepare::correction::InjectionEntry;

/// The answer of `lynkeus design`.
#[derive(Debug)]
pub struct DesignReport {
    /// name of the plant
    pub plant: String,
    /// the design with what is guaranteed about it
    pub certified: CertifyReport,
}

/// Designs the study's observer and certifies it.
///
/// # Errors
/// A study that does not fit its plant, or no family that does.
pub fn design(study: &Study) -> Result<DesignReport, Error> {
    let certified = certify::certified(study, false)?;
    Ok(DesignReport {
        plant: certified.plant.clone(),
        certified,
    })
}

/// The answer of `design`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "DesignReport"))]
pub(crate) struct Report<'a> {
    /// the name of the model
    plant: &'a str,
    /// the observer family
    family: &'static str,
    /// whether the family's conditions hold
    fit: Fit,
    /// the states of each chain, from the sensor outward
    chains: &'a [Vec<String>],
    /// the gain by state, then by measured output; none where it is no constant
    gain: Option<Named<Named<f64>>>,
    /// what takes its place then
    injection: Option<Named<Named<&'a InjectionEntry>>>,
    /// parameters of the observer, as texts
    parameters: Named<String>,
    /// the start of each of its states
    initial: Named<Option<f64>>,
    /// what is proved
    certificate: Proof<'a>,
    /// what you should know
    notes: &'a [String],
}

impl DesignReport {
    /// The report for machines; `gain` is by state, then by measured output, and null for a
    /// correction that is no constant gain: then `injection` has its derivatives.
    pub fn entries(&self) -> Value {
        let Design {
            observer,
            examination,
            parameters,
            ..
        } = &*self.certified.design;
        let parameters = parameters.iter();
        let starts = observer.states.iter();
        json!(Report {
            plant: &self.plant,
            family: examination.family.name(),
            fit: examination.fit().into(),
            chains: &examination.chains,
            gain: self.certified.correction.gain(),
            injection: self.certified.correction.injection(),
            parameters: parameters
                .map(|(name, value)| (name.clone(), value.words()))
                .collect(),
            initial: starts
                .map(|(signal, start)| (signal.name.clone(), finite(*start)))
                .collect(),
            certificate: Proof::from(&self.certified),
            notes: &self.certified.design.notes,
        })
    }
}

/// The parameters of a design.
pub(crate) fn tell_parameters(document: &mut Document, design: &Design) {
    let parameters = design.parameters.iter();
    let rows = parameters.map(|(name, value)| vec![name.as_str().into(), value.words().into()]);
    let table = Table::plain(["parameter", "value"]).with(rows);
    document.heading("parameters").table(table);
}

lynkeus_experiment::displayed!(DesignReport);

impl Answer for DesignReport {
    fn document(&self) -> Document {
        let Design {
            observer,
            examination,
            ..
        } = &*self.certified.design;
        let mut document = Document::new(format!(
            "{}: {} observer, {}",
            self.plant,
            examination.family,
            counted(observer.states.len(), "state")
        ));
        document.item(examination.summary.words());
        if examination.fit() == Standing::Undecided {
            document.item("not every condition is decided on the box; `lynkeus check` shows them");
        }
        tell_parameters(&mut document, &self.certified.design);
        self.certified.correction.tell(&mut document);
        let conclusion = self.certified.conclusion();
        let more = "; `lynkeus certify` says more";
        document.part().line(conclusion.and(more));
        document.part().notes(&self.certified.design.notes);
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }
}
