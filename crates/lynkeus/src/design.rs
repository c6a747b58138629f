//! The gains, matrices and parameters of a study's observer.

use lynkeus_answer::Document;
use lynkeus_answer::document::Table;
use lynkeus_observers::{Design, fit_word};
use lynkeus_structure::Standing;
use lynkeus_words::{Words, counted};
use serde_json::{Map, Value, json};

use crate::certify::{self, certificate_json};

use crate::{Answer, CertifyReport, Error, Study};

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

impl DesignReport {
    /// The report for machines; `gain` is by state, then by measured output, and null for a
    /// correction that is no constant gain: then `injection` has its derivatives.
    pub fn to_json(&self) -> Value {
        let Design {
            observer,
            examination,
            parameters,
            ..
        } = &*self.certified.design;
        let parameters: Map<String, Value> = parameters
            .iter()
            .map(|(name, value)| (name.clone(), json!(value.words())))
            .collect();
        let starts: Map<String, Value> = observer
            .states
            .iter()
            .map(|(signal, start)| (signal.name.clone(), json!(start)))
            .collect();
        json!({
            "plant": self.plant,
            "family": examination.family.name(),
            "fit": fit_word(examination.fit()),
            "chains": examination.chains,
            "gain": self.certified.correction.gain_json(),
            "injection": self.certified.correction.injection_json(),
            "parameters": parameters,
            "initial": starts,
            "certificate": certificate_json(&self.certified),
            "notes": self.certified.design.notes,
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

    fn to_json(&self) -> Value {
        Self::to_json(self)
    }
}
