//! The gains, matrices and parameters of a study's observer.

use std::fmt;

use lynkeus_observers::{Design, Fit};
use serde_json::{Map, Value, json};

use crate::certify::{self, certificate_json};

use crate::{CertifyReport, Error, Study};

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
    /// The report for machines; `gain` is by state, then by measured output.
    pub fn to_json(&self) -> Value {
        let Design {
            observer,
            examination,
            parameters,
            notes,
            ..
        } = &self.certified.design;
        let parameters: Map<String, Value> = parameters
            .iter()
            .map(|(name, value)| (name.clone(), json!(value)))
            .collect();
        let starts: Map<String, Value> = observer
            .states
            .iter()
            .map(|(signal, start)| (signal.name.clone(), json!(start)))
            .collect();
        json!({
            "plant": self.plant,
            "family": observer.family,
            "fit": examination.fit.words(),
            "chains": examination.chains,
            "gain": gain_json(&self.certified.design),
            "parameters": parameters,
            "initial": starts,
            "certificate": certificate_json(&self.certified),
            "notes": notes,
        })
    }
}

/// The gain by state, then by measured output.
pub(crate) fn gain_json(design: &Design) -> Value {
    let mut gain: Map<String, Value> = Map::new();
    for chain in &design.gains {
        for (state, k) in &chain.entries {
            let row = gain.entry(state.clone()).or_insert_with(|| json!({}));
            row[&chain.output] = json!(k);
        }
    }
    Value::Object(gain)
}

impl fmt::Display for DesignReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Design {
            observer,
            examination,
            gains,
            parameters,
            notes,
        } = &self.certified.design;
        writeln!(
            f,
            "{}: {} observer, {} states",
            self.plant,
            observer.family,
            observer.states.len()
        )?;
        writeln!(f, "  {}", examination.summary)?;
        if examination.fit == Fit::Undecided {
            writeln!(
                f,
                "  not every condition is decided on the box; `lynkeus check` shows them"
            )?;
        }
        writeln!(f, "\nparameters")?;
        for (name, value) in parameters {
            writeln!(f, "  {name:<14} {value}")?;
        }
        for chain in gains {
            writeln!(f, "\ngain of {} on", chain.output)?;
            for (state, k) in &chain.entries {
                writeln!(f, "  {state:<14} {k:.6e}")?;
            }
        }
        writeln!(
            f,
            "\n{}; `lynkeus certify` says more",
            self.certified.conclusion()
        )?;
        for note in notes {
            writeln!(f, "\nnote: {note}")?;
        }
        Ok(())
    }
}
