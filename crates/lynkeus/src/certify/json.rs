//! Certificates for machines.

use lynkeus_observers::Certificate;
use lynkeus_words::Words;
use serde::Serialize;
use serde_json::{Value, json};

use super::error::told::ErrorEntry;
use super::excited::ExcitationEntry;
use super::sampled::SampledEntry;
use super::tube::told::TubeEntry;
use super::{CertifyReport, Excited, Strays, bounds};
use lynkeus_experiment::entries::{Condition, Named, Range, Verdict, finite, sides};
use lynkeus_experiment::judge::interval::SamplingLimits;
use lynkeus_experiment::prepare::correction::InjectionEntry;
use lynkeus_experiment::prepare::declared::Account;

/// The answer of `certify`.
#[derive(Debug, Serialize)]
#[cfg_attr(
    test,
    derive(schemars::JsonSchema),
    schemars(rename = "CertificateReport")
)]
pub(crate) struct Report<'a> {
    /// the name of the model
    plant: &'a str,
    /// the observer family
    family: &'static str,
    /// the gain by state, then by measured output; none where it is no constant
    gain: Option<Named<Named<f64>>>,
    /// what takes its place then
    injection: Option<Named<Named<&'a InjectionEntry>>>,
    /// what is proved
    certificate: Proof<'a>,
}

/// A certificate.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Proof<'a> {
    #[serde(flatten)]
    summary: ProofSummary,
    /// its hypotheses one by one: those of the inequality, then those of the theorem
    hypotheses: Vec<Condition>,
    /// what of the study's declarations was counted
    declared: &'a Account,
    /// where the study's own start or simulation leaves the box
    outside_box: &'a Strays,
    /// what was measured of it, of observers whose theorem needs it
    excitation: Option<ExcitationEntry<'a>>,
    /// the study's samples beside what the observer stands
    sampling: Option<SamplingLimits>,
    /// what is proved of samples with measurements that follow the model between them
    /// (`between_samples = "predict"`); null where nothing is proved of sensors that are read continuously
    sampled: Option<SampledEntry>,
    /// whether the plant stays in the box from the starts of `[certify]`; null where that is not asked
    tube: Option<TubeEntry>,
    /// what is proved of the observer's error from these starts; null where that is not asked
    error_tube: Option<ErrorEntry>,
    /// what you should know
    notes: Vec<String>,
    /// what the family's theorem gives, where it was asked
    #[serde(skip_serializing_if = "Option::is_none")]
    theorem: Option<ProofSummary>,
}

/// What one way of proof gives.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct ProofSummary {
    /// the way of proof
    basis: &'static str,
    /// whether the error decays
    verdict: Verdict,
    /// the decay of the error that is proved, in 1/(unit of time)
    rate: Option<f64>,
    /// the norm below which the error ends
    ultimate_bound: Option<f64>,
    /// the same for each quantity, in its unit
    ultimate_bounds: Named<Option<f64>>,
    /// the norm below which the error ends in the root of the mean square, under Gaussian noise
    mean_square_bound: Option<f64>,
    /// the same for each quantity, in its unit
    mean_square_bounds: Named<Option<f64>>,
    /// the norm below which the error is in the end, at any one time with a probability of 0.99, under Gaussian noise
    probable_bound: Option<f64>,
    /// the same for each quantity, in its unit
    probable_bounds: Named<Option<f64>>,
    /// the ranges on which it holds
    #[serde(rename = "box")]
    region: Named<Range>,
    /// constants of the theorem
    constants: Vec<ConstantEntry>,
}

/// A constant of a theorem.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Constant"))]
struct ConstantEntry {
    /// its letter in the paper
    name: String,
    /// its value
    value: Option<f64>,
    /// what it is
    meaning: String,
}

impl CertifyReport {
    /// The report for machines: the gain by state, then by measured output, or what takes
    /// its place, and the certificate.
    pub fn entries(&self) -> Value {
        json!(Report {
            plant: &self.plant,
            family: self.design.examination.family.name(),
            gain: self.correction.gain(),
            injection: self.correction.injection(),
            certificate: Proof::from(self),
        })
    }
}

impl<'a> From<&'a CertifyReport> for Proof<'a> {
    fn from(report: &'a CertifyReport) -> Self {
        let theorem = report.theorem.iter().flat_map(|t| &t.hypotheses);
        let hypotheses = report.certificate.hypotheses.iter().chain(theorem);
        let both = std::iter::once(&report.certificate).chain(&report.theorem);
        let strays = report.strays.words(false);
        let strays =
            strays.map(|words| format!("the certificate is for the box only, and {words}"));
        Self {
            summary: summary(report),
            hypotheses: hypotheses.map(Condition::from).collect(),
            declared: &report.declared,
            outside_box: &report.strays,
            excitation: report.excited.as_ref().map(Excited::entry),
            sampling: report.sampling.as_ref().map(|found| found.entry(true)),
            sampled: report.sampled.as_ref().map(SampledEntry::from),
            tube: report.tube.as_ref().map(TubeEntry::from),
            error_tube: report.error_tube.as_ref().map(ErrorEntry::from),
            notes: both
                .flat_map(|certificate| report.notes_of(certificate))
                .chain(report.assumed.iter().cloned())
                .chain(strays)
                .collect(),
            theorem: report.theorem.as_ref().map(ProofSummary::from),
        }
    }
}

/// The better of the two ways, with the verdict of both.
fn summary(report: &CertifyReport) -> ProofSummary {
    let mut best = report.best().clone();
    (best.mean_square, best.probable) = (None, None);
    if report.is_contradiction() {
        (best.rate, best.ultimate_bound, best.ultimate) = (None, None, vec![]);
    } else {
        best.mean_square = report.mean_square().cloned();
        best.probable = report.probable().cloned();
    }
    ProofSummary {
        verdict: report.verdict().into(),
        ..ProofSummary::from(&best)
    }
}

impl From<&Certificate> for ProofSummary {
    fn from(certificate: &Certificate) -> Self {
        let mean_square = certificate.mean_square.as_ref();
        let probable = certificate.probable.as_ref();
        let constants = certificate.constants.iter().map(|c| ConstantEntry {
            name: c.name.clone(),
            value: finite(c.value),
            meaning: c.words(),
        });
        Self {
            basis: certificate.basis,
            verdict: certificate.verdict().into(),
            rate: certificate.rate,
            ultimate_bound: certificate.ultimate_bound,
            ultimate_bounds: bounds::by_name(&certificate.ultimate),
            mean_square_bound: mean_square.map(|b| b.norm),
            mean_square_bounds: bounds::by_name(mean_square.map_or(&[], |b| &b.states)),
            probable_bound: probable.map(|b| b.norm),
            probable_bounds: bounds::by_name(probable.map_or(&[], |b| &b.states)),
            region: sides(&certificate.region),
            constants: constants.collect(),
        }
    }
}
