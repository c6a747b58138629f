//! What can be guaranteed about a study's observer.

use std::fmt;

use lynkeus_model::Plant;
use lynkeus_observers::{Certificate, Design, Tuning, Value, Verdict};
use lynkeus_structure::Extended;

use crate::{Error, Study, prepare, words};

mod assumptions;
mod json;
mod print;

pub(crate) use json::certificate as certificate_json;

/// The answer of `lynkeus certify`.
#[derive(Debug)]
pub struct CertifyReport {
    /// name of the plant
    pub plant: String,
    /// the observer that is certified
    pub design: Design,
    /// by linear matrix inequalities, for observers whose states are the estimate
    pub certificate: Certificate,
    /// by the family's own theorem; none for a gain that no paper gives
    pub theorem: Option<Certificate>,
}

/// Proves, refutes or leaves undecided that the study's observer converges, first on
/// the declared box, then on the box of the inputs that the study simulates.
///
/// # Errors
/// As [`crate::design()`]; names in `[box]` and `[certify]` that the plant does not have.
pub fn certify(study: &Study) -> Result<CertifyReport, Error> {
    let plant = prepare::plant(study)?;
    let mut extended = prepare::extended(study, &plant)?;
    assumptions::tube(study, &mut extended)?;
    let inputs = assumptions::simulated_inputs(study, &plant, &extended)?;
    let declared = report(study, &plant, &extended);
    if inputs.is_empty() || matches!(&declared, Ok(found) if found.is_proved()) {
        return declared;
    }
    let mut narrowed = prepare::extended(study, &plant)?;
    assumptions::tube(study, &mut narrowed)?;
    for (name, low, high) in &inputs {
        let narrow = narrowed.narrow(name, *low, *high);
        narrow.map_err(|error| Error::input(error.to_string()).at(&study.file))?;
    }
    let mut found = match (report(study, &plant, &narrowed), &declared) {
        (Ok(found), _) => found,
        (Err(_), Ok(_)) => return declared,
        (Err(error), Err(_)) => return Err(error),
    };
    let wider = match declared {
        Ok(report) => report.verdict().word().to_owned(),
        Err(error) => format!("no observer ({error})"),
    };
    let sides: Vec<String> = inputs
        .iter()
        .map(|(n, low, high)| words::side(n, *low, *high))
        .collect();
    found.certificate.notes.push(format!(
        "for the inputs of [simulate], {}; on the declared ranges of the inputs: {wider}",
        sides.join(", ")
    ));
    Ok(found)
}

fn report(study: &Study, plant: &Plant, extended: &Extended<'_>) -> Result<CertifyReport, Error> {
    // inside the box, where the guarantee holds, the limits of `clamp` do nothing
    let tuning = Tuning {
        clamp: false,
        ..study.observer.tuning.clone()
    };
    let design = prepare::design_with(study, extended, &tuning)?;
    let assumptions = assumptions::of(study, plant, extended)?;
    let refusal = |error| prepare::refusal(study, &error);
    let certificate =
        lynkeus_observers::certify(extended, &design.observer, &assumptions).map_err(refusal)?;
    let published = tuning.values.get("gain") != Some(&Value::Text("lmi".into()));
    let theorem = match lynkeus_observers::find(design.observer.family) {
        Some(family) if published => Some(
            family
                .theorem(extended, &tuning, &assumptions)
                .map_err(refusal)?,
        ),
        _ => None,
    };
    Ok(CertifyReport {
        plant: plant.name.clone(),
        design,
        certificate,
        theorem,
    })
}

impl CertifyReport {
    /// Whether the decay is proved, by the inequality or by the theorem.
    pub fn is_proved(&self) -> bool {
        self.verdict() == Verdict::Proved
    }

    /// The verdict in a sentence.
    pub fn conclusion(&self) -> String {
        print::conclusion(self)
    }

    /// Whether a point of the box shows that there is no decay.
    pub fn is_refuted(&self) -> bool {
        self.verdict() == Verdict::Refuted
    }

    /// The report for machines: the gain by state, then by measured output, and the
    /// certificate.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!({
            "plant": self.plant,
            "family": self.design.observer.family,
            "gain": crate::design::gain_json(&self.design),
            "certificate": certificate_json(self),
        })
    }

    /// Proved by either way; refuted by a point of the box; else undecided. A theorem
    /// whose hypothesis fails refutes nothing: it only does not apply.
    pub fn verdict(&self) -> Verdict {
        match &self.theorem {
            Some(theorem) if theorem.verdict == Verdict::Proved => Verdict::Proved,
            _ => self.certificate.verdict,
        }
    }

    /// The proof with the faster rate, or the certificate by inequality if there is none.
    pub fn best(&self) -> &Certificate {
        match &self.theorem {
            Some(theorem) if theorem.rate > self.certificate.rate => theorem,
            _ => &self.certificate,
        }
    }
}

impl fmt::Display for CertifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        print::report(f, self)
    }
}
