//! What the library says about a case: every claim that can be attacked. The only file
//! that knows what certificates look like.

use lynkeus::observers::guarantee::Said;
use lynkeus::observers::{
    Bounds, Certificate, Check, Examination, FAMILIES, Reason, Statement, Tuning, UltimateBound,
};
use lynkeus::prepare::{Prepared, StudyDesign};
use lynkeus::structure::{AugmentedPlant, Dimension, Standing, Verdict};
use lynkeus::{ErrorTube, Tube};
use nalgebra::DMatrix;

use super::case::Case;
use super::tally::Counts;

/// |e(t)| ≤ overshoot·e^(−rate·t)·|e(0)| + ultimate bound, while plant and estimate
/// stay in the box.
#[derive(Clone, Debug)]
pub struct Claim {
    pub basis: String,
    pub rate: f64,
    /// none where the certificate names no such constant
    pub overshoot: Option<f64>,
    /// none where the certificate makes no statement
    pub ultimate: Option<f64>,
    /// the same per quantity
    pub each: Vec<UltimateBound>,
    /// what the error is within in the end, at any one time with a probability
    pub probable: Option<Bounds>,
    /// V = eᵀPe falls at 2·rate without disturbance and noise
    pub lyapunov: Option<DMatrix<f64>>,
    /// the box by names
    pub sides: Vec<Dimension>,
}

/// A condition that is said to fail, with the points that are to show it.
#[derive(Clone, Debug)]
pub struct Refutation {
    pub condition: Statement,
    pub points: Vec<lynkeus::structure::Point>,
    /// of the observer's error, not of the plant
    pub of_error: bool,
}

/// Everything said about one case.
pub struct Findings {
    /// none where the family does not take the plant
    pub design: Option<StudyDesign>,
    pub claims: Vec<Claim>,
    /// for samples, with the longest interval between them, and whether the slopes count together
    pub sampled: Option<(Claim, f64, bool)>,
    /// where the plant is from the starts that the study asks about
    pub tube: Option<Tube>,
    /// what is said of the observer's error from there
    pub error_tube: Option<ErrorTube>,
    pub refutations: Vec<Refutation>,
    /// the family that the study asks for
    pub examination: Option<Examination>,
    /// the theorem is proved and a point refutes it, in one report
    pub contradicts: bool,
    /// the gain as it is printed for machines
    pub gain: serde_json::Value,
    pub counts: Counts,
    /// the certificates, for settings that follow from their constants
    pub certificates: Vec<Certificate>,
}

/// What every family finds in the plant, and nothing of an observer.
pub fn examined(prepared: &Prepared<'_>) -> Findings {
    let mut found = Findings::new(prepared);
    found.examined(prepared.augmented(), true);
    found
}

/// Asks the library.
pub fn findings(prepared: &Prepared<'_>, thorough: bool) -> Findings {
    let mut found = Findings::new(prepared);
    found.examined(prepared.augmented(), thorough);
    let Ok(design) = prepared.design() else {
        return found;
    };
    found.design = Some(design);
    found.counts.designs = 1;
    let Ok(report) = lynkeus::certify(prepared.study()) else {
        return found;
    };
    found.gain = report.entries()["gain"].take();
    let theorem = report.theorem.as_ref();
    found.contradicts = report.certificate.verdict() == Standing::Refuted
        && theorem.is_some_and(|theorem| theorem.verdict() == Standing::Proved);
    found.sampled = report.sampled.as_ref().and_then(|sampled| {
        let sampled = sampled.as_ref().ok()?;
        let longest = &sampled.longest;
        let claim = Claim {
            basis: format!("samples up to {} apart", longest.interval),
            rate: longest.rate,
            overshoot: longest.overshoot,
            ultimate: None,
            each: vec![],
            probable: None,
            lyapunov: Some(longest.lyapunov.clone()),
            sides: report.certificate.region.clone(),
        };
        Some((claim, longest.interval, sampled.together))
    });
    found.tube = report.tube;
    found.error_tube = report.error_tube;
    let error = found.error_tube.as_ref().map(|tube| tube.verdict);
    found.counts.proved += usize::from(error == Some(Standing::Proved));
    found.certified(report.certificate, true);
    if let Some(theorem) = report.theorem {
        found.certified(theorem, false);
    }
    found
}

impl Findings {
    /// Whether the family is said to fit, with every condition proved.
    pub fn fits(&self) -> bool {
        self.examination
            .as_ref()
            .is_some_and(|e| e.fit() == Standing::Proved)
    }

    /// The case with its inputs where all that is claimed has them: for inputs of `[simulate]` a certificate may hold
    /// that does not for all that are declared.
    pub fn meant(&self, case: &Case) -> Case {
        let mut case = case.clone();
        let sampled = self.sampled.iter().map(|(claim, ..)| claim);
        let sides = self.claims.iter().chain(sampled).flat_map(|c| &c.sides);
        for side in sides {
            let mut inputs = case.inputs.iter_mut();
            if let Some(input) = inputs.find(|input| input.side.name == side.name) {
                input.side.low = input.side.low.max(side.min);
                input.side.high = input.side.high.min(side.max);
            }
        }
        case
    }

    fn new(prepared: &Prepared<'_>) -> Self {
        let examinations = prepared.examinations();
        Self {
            design: None,
            claims: vec![],
            sampled: None,
            tube: None,
            error_tube: None,
            refutations: vec![],
            examination: examinations.ok().and_then(|all| all.last().cloned()),
            contradicts: false,
            gain: serde_json::Value::Null,
            counts: Counts {
                plants: 1,
                ..Counts::default()
            },
            certificates: vec![],
        }
    }

    fn examined(&mut self, augmented: &AugmentedPlant<'_>, thorough: bool) {
        match self.examination.as_ref().map(|e| e.fit()) {
            Some(Standing::Proved) => self.counts.fits += 1,
            Some(Standing::Undecided) => self.counts.open_fits += 1,
            _ => self.counts.misfits += 1,
        }
        let others = match thorough {
            true => FAMILIES,
            false => &[],
        };
        let others = others.iter().filter_map(|family| {
            let tuning = Tuning::default();
            family.examine(augmented, &tuning).ok()
        });
        let all: Vec<Examination> = self.examination.iter().cloned().chain(others).collect();
        for examination in &all {
            self.refuted(&examination.checks, false);
        }
    }

    fn certified(&mut self, certificate: Certificate, of_error: bool) {
        match certificate.verdict() {
            Standing::Proved => {
                self.counts.proved += 1;
                self.counts.together += usize::from(is_together(&certificate));
            }
            Standing::Undecided => self.counts.undecided += 1,
            Standing::Refuted => self.counts.refuted += 1,
        }
        self.refuted(&certificate.hypotheses, of_error);
        self.claims.extend(claim(&certificate));
        self.certificates.push(certificate);
    }

    fn refuted(&mut self, checks: &[Check], of_error: bool) {
        for check in checks {
            let Verdict::Refuted(witness) = &check.verdict else {
                continue;
            };
            let known = self
                .refutations
                .iter()
                .any(|r| r.condition == check.statement);
            if !known {
                self.refutations.push(Refutation {
                    condition: check.statement.clone(),
                    points: witness.points.clone(),
                    of_error,
                });
            }
        }
    }
}

/// Whether it takes the slopes as they are together at each point.
fn is_together(certificate: &Certificate) -> bool {
    certificate.hypotheses.iter().any(|check| {
        let said = &check.reason;
        matches!(said, Reason::Guarantee(Said::HoldsTogether { .. }))
    })
}

fn claim(certificate: &Certificate) -> Option<Claim> {
    if certificate.verdict() != Standing::Proved {
        return None;
    }
    Some(Claim {
        basis: certificate.basis.to_owned(),
        rate: certificate.rate.unwrap_or(0.0),
        overshoot: certificate.overshoot,
        ultimate: certificate.ultimate_bound,
        each: certificate.ultimate.clone(),
        probable: certificate.probable.clone(),
        lyapunov: certificate.lyapunov.clone(),
        sides: certificate.region.clone(),
    })
}

/// A constant of one of the certificates.
pub fn constant(certificates: &[Certificate], name: &str) -> Option<f64> {
    let mut constants = certificates.iter().flat_map(|c| &c.constants);
    constants.find(|c| c.name == name).map(|c| c.value)
}
