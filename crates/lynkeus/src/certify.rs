//! What can be guaranteed about a study's observer.

use std::ops::ControlFlow;

use lynkeus_observers::guarantee::{Said, SampledDecay, between_samples};
use lynkeus_observers::{Bounds, Certificate, Claim, Design, Tuning};
use lynkeus_structure::{AugmentedPlant, Standing};
use lynkeus_words::Words;

use crate::{Correction, Error, Study};
use lynkeus_experiment::judge::interval::{self, Intervals};
use lynkeus_experiment::prepare::correction;
use lynkeus_experiment::prepare::declared::{Account, Declared};
use lynkeus_experiment::prepare::{Prepared, StudyDesign};
use lynkeus_experiment::{prepare, words};

mod assumptions;
mod bounds;
mod error;
mod excited;
mod json;
mod print;
mod sampled;
mod strays;
mod tube;

pub use error::{ErrorTube, Followed, Reading};
pub use excited::{AtTheta, Excitation, Excited};
pub(crate) use json::Proof;
#[cfg(test)]
pub(crate) use json::Report as CertificateReport;
pub(crate) use print::region;
pub use strays::Strays;
pub use tube::{Tube, Witness};

/// The answer of `lynkeus certify`.
#[derive(Debug)]
pub struct CertifyReport {
    /// name of the plant
    pub plant: String,
    /// the observer that is certified
    pub design: StudyDesign,
    /// by linear matrix inequalities, for observers whose states are the estimate
    pub certificate: Certificate,
    /// what the study adds to it: the inputs for which it holds, a limit that has a say in the family
    pub notes: Vec<String>,
    /// by the family's own theorem; none for a gain that no paper gives
    pub theorem: Option<Certificate>,
    /// how the measurements enter the observer that was certified
    pub correction: Correction,
    /// what both take for granted of disturbances and unknown inputs, in words
    pub assumed: Vec<String>,
    /// which of the study's declarations counted
    pub declared: Account,
    /// where the study itself is not in the box of the proof
    pub strays: Strays,
    /// the study's samples against what the observer stands: every proof is for sensors that are
    /// read continuously. None where the study has no samples, or no limit is known
    pub sampling: Option<Intervals>,
    /// what the inequality proves of samples with measurements that follow the model between them, or why
    /// nothing; none where it proves nothing of sensors that are read continuously
    pub sampled: Option<Result<SampledDecay, Said>>,
    /// α(θ) of Ltaief et al. as the study's run shows it; none for observers without that
    pub excited: Option<Excited>,
    /// whether the plant stays in the box, from the starts that the study asks about
    pub tube: Option<Tube>,
    /// what is proved of the observer's error from these starts
    pub error_tube: Option<ErrorTube>,
}

/// Proves, refutes or leaves undecided that the study's observer converges: on the
/// declared box, or else on the box of the inputs that the study simulates, and then
/// says how much wider the inputs may range.
///
/// # Errors
/// As [`crate::design()`]; names in `[box]` and `[certify]` that the plant does not have.
pub fn certify(study: &Study) -> Result<CertifyReport, Error> {
    certified(study, true)
}

/// The same; the search for wider ranges of the inputs only on request.
pub(crate) fn certified(study: &Study, explore: bool) -> Result<CertifyReport, Error> {
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    let task = Task {
        study,
        inputs: prepared.simulated_inputs()?,
        prepared,
        explore,
        tuning: inside_the_box(&study.observer.tuning),
    };
    task.report()
}

/// Inside the box, where an inequality guarantees anything, limits and prolongation of the
/// functions do nothing.
fn inside_the_box(tuning: &Tuning) -> Tuning {
    let mut inside = tuning.clone();
    inside.clamp = false;
    inside.values.remove("prolong");
    inside
}

struct Task<'a> {
    study: &'a Study,
    prepared: Prepared<'a>,
    /// ranges of the simulated inputs where these are narrower than the declared
    inputs: Vec<(String, f64, f64)>,
    explore: bool,
    tuning: Tuning,
}

/// A decay so many times faster for the study's own inputs is preferred to one for all that are declared.
const MUCH: f64 = 10.0;

/// Steps of the search for the widest ranges of the inputs.
const HALVINGS: usize = 5;

impl<'a> Task<'a> {
    fn report(&self) -> Result<CertifyReport, Error> {
        let declared = self.on(1.0)?;
        let simulated = match self.inputs.is_empty() {
            true => None,
            false => Some(self.on(0.0)?),
        };
        let design = self.prepared.design_with(&self.tuning)?;
        let lmi = prepare::is_certified_gain(&self.tuning);
        let claim = match self.tuning.numbers("rate") {
            Ok(Some(rate)) if lmi => Claim::At(rate[0]),
            _ => Claim::Fastest,
        };
        let mut place = &declared;
        let mut certificate = self.certificate(&declared, &design, claim)?;
        let mut notes = vec![];
        if let Some(simulated) = &simulated {
            let narrow = self.certificate(simulated, &design, claim)?;
            if certificate.verdict() != Standing::Proved || is_much_faster(&narrow, &certificate) {
                let wide = std::mem::replace(&mut certificate, narrow);
                notes.push(self.reach(&design, &certificate, &wide)?);
                place = simulated;
            }
        }
        // a limit that has a say in the family is no note of a proof only
        if let Some(choice) = self.prepared.choice()?.filter(|c| c.ended.is_some()) {
            notes.extend(choice.notes());
        }
        let family = (!lmi).then_some(design.examination.family);
        let theorem = match family {
            Some(family) => {
                let assumptions = assumptions::of(&self.prepared, place)?;
                let tuning = Tuning {
                    clamp: false,
                    ..self.prepared.tuning()?
                };
                let theorem = family.theorem(place, &tuning, &assumptions);
                Some(theorem.map_err(|error| self.prepared.refusal(error))?)
            }
            None => None,
        };
        let correction =
            correction::of(self.study, self.prepared.plant(), place, &design.observer)?;
        let run = self.study.simulate.as_ref();
        let go_on = &mut |_| ControlFlow::Continue(());
        let run = run.map(|_| lynkeus_experiment::simulated(&self.prepared, go_on));
        let seen = run.as_ref().and_then(|run| run.as_ref().ok());
        let excited = match self.explore {
            true => Excited::of(&self.prepared, seen, place, family)?,
            false => None,
        };
        let sampling = seen.and_then(|run| {
            interval::simulated(&self.prepared, &design, &run.time, &run.quantities)
        });
        let interval = sampling.as_ref().map(|sampling| sampling.interval);
        let sampled = match certificate.rate.filter(|rate| self.explore && *rate > 0.0) {
            Some(rate) => Some(self.between_samples(place, &design, rate, interval)?),
            None => None,
        };
        let certificates = theorem.iter().chain([&certificate]);
        let in_mean_square = certificates.into_iter().any(|c| c.mean_square.is_some());
        let of_samples = sampled.as_ref().is_some_and(|s: &Result<SampledDecay, _>| {
            s.as_ref().is_ok_and(|found| found.at.is_some())
        });
        let error_tube = match self.explore {
            true => ErrorTube::of(&self.prepared, place, &self.study.observer.tuning)?,
            false => None,
        };
        let of_samples = of_samples
            || error_tube
                .as_ref()
                .is_some_and(|tube| tube.every.is_some() && tube.verdict == Standing::Proved);
        Ok(CertifyReport {
            plant: self.prepared.plant().name.clone(),
            declared: account(self.prepared.declared(), in_mean_square, of_samples),
            strays: Strays::of(&self.prepared, run.as_ref(), place, &design),
            sampling,
            sampled,
            excited,
            tube: match self.explore {
                true => Tube::of(&self.prepared, place)?,
                false => None,
            },
            error_tube,
            design,
            certificate,
            notes,
            theorem,
            correction,
            assumed: assumptions::notes(&self.prepared, place),
        })
    }

    /// The box with the inputs' ranges between the simulated (0) and the declared (1).
    fn on(&self, share: f64) -> Result<AugmentedPlant<'a>, Error> {
        self.prepared.narrowed(&self.ranges(share))
    }

    fn ranges(&self, share: f64) -> Vec<(String, f64, f64)> {
        let wider = |(name, low, high): &(String, f64, f64)| {
            let mut inputs = self.prepared.augmented().inputs.iter();
            let declared = inputs.find(|i| i.name == *name)?;
            let towards = |from: f64, to: f64| match share {
                0.0 => from,
                1.0 => to,
                _ if to.is_finite() => from + share * (to - from),
                _ => from,
            };
            Some((
                name.clone(),
                towards(*low, declared.min),
                towards(*high, declared.max),
            ))
        };
        self.inputs.iter().filter_map(wider).collect()
    }

    fn certificate(
        &self,
        augmented: &AugmentedPlant<'_>,
        design: &Design,
        claim: Claim,
    ) -> Result<Certificate, Error> {
        let assumptions = assumptions::of(&self.prepared, augmented)?;
        lynkeus_observers::certify(augmented, &design.observer, &assumptions, claim)
            .map_err(|error| self.prepared.refusal(error))
    }

    /// What is proved of samples where the certificate has this rate.
    fn between_samples(
        &self,
        augmented: &AugmentedPlant<'_>,
        design: &Design,
        rate: f64,
        interval: Option<f64>,
    ) -> Result<Result<SampledDecay, Said>, Error> {
        let assumptions = assumptions::of(&self.prepared, augmented)?;
        between_samples(augmented, &design.observer, &assumptions, rate, interval)
            .map_err(|error| self.prepared.refusal(error))
    }

    /// How far the inputs may leave the study's, in words.
    fn reach(
        &self,
        design: &Design,
        proved: &Certificate,
        wide: &Certificate,
    ) -> Result<String, Error> {
        let words = |ranges: &[(String, f64, f64)]| {
            let sides = ranges
                .iter()
                .map(|(n, low, high)| words::side(n, *low, *high));
            sides.collect::<Vec<_>>().join(", ")
        };
        let slower = match (wide.verdict(), wide.rate) {
            (Standing::Proved, Some(rate)) => format!(", at {}", words::number(rate)),
            _ => String::new(),
        };
        let simulated = format!(
            "for the inputs of [simulate], {}; on their declared ranges: {}{slower}",
            words(&self.inputs),
            wide.verdict().word()
        );
        let Some(rate) = proved.rate.filter(|_| self.explore) else {
            return Ok(simulated);
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let share = f64::midpoint(low, high);
            // a tenth of the rate may go
            let certificate = self.certificate(&self.on(share)?, design, Claim::At(0.9 * rate))?;
            match certificate.verdict() {
                Standing::Proved => low = share,
                _ => high = share,
            }
        }
        let reached = self.ranges(low);
        Ok(match low > 0.0 {
            true => format!(
                "{simulated}; at nine tenths of the rate also proved for {}",
                words(&reached)
            ),
            false => simulated,
        })
    }
}

/// Whether a proof on less makes so much of a difference that it is the answer.
fn is_much_faster(narrow: &Certificate, wide: &Certificate) -> bool {
    let rates = narrow.rate.zip(wide.rate);
    rates.is_some_and(|(narrow, wide)| narrow > MUCH * wide)
}

/// What a certificate counts.
fn account(declared: &Declared, in_mean_square: bool, of_samples: bool) -> Account {
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
    Account::default()
        .leaves(manifold, "no theorem is about angles and rotations")
        .leaves(screens, "a proof is for readings that come")
        .leaves(
            late,
            "a proof is for the estimate once the readings have come: until then the model alone leads there",
        )
        .counts(ranges)
        .counts(noise)
        .counts(limits)
        .counts(disturbances)
        .counts(slew)
        .counts(input_derivatives)
        .counts_if(
            in_mean_square,
            process_noise,
            "Gaussian, so that no error has a bound for certain, and no bound in mean square is proved",
        )
        .leaves(input_noise, "a proof is for known inputs that are read as they are")
        .leaves(correlation, "bounds take the noises of sensors for independent")
        .counts_if(
            of_samples,
            samples,
            "a proof is for sensors that are read continuously; `sampling` has what the observer stands",
        )
}

impl CertifyReport {
    /// Whether the decay is proved, by the inequality or by the theorem.
    pub fn is_proved(&self) -> bool {
        self.verdict() == Standing::Proved
    }

    /// Whether it is shown that there is no decay.
    pub fn is_refuted(&self) -> bool {
        self.verdict() == Standing::Refuted
    }

    /// Proved by either way; refuted where the error is shown not to decay; else undecided.
    /// A theorem whose hypothesis fails refutes nothing: it only does not apply. A proof
    /// and a refutation of the same leave neither.
    pub fn verdict(&self) -> Standing {
        let theorem = self.theorem.as_ref().map(|theorem| theorem.verdict());
        match (self.certificate.verdict(), theorem) {
            _ if self.is_contradiction() => Standing::Undecided,
            (_, Some(Standing::Proved)) => Standing::Proved,
            (verdict, _) => verdict,
        }
    }

    /// Whether one way proves what the other refutes: a defect of this program.
    pub fn is_contradiction(&self) -> bool {
        let theorem = self.theorem.as_ref().map(|theorem| theorem.verdict());
        self.certificate.verdict() == Standing::Refuted && theorem == Some(Standing::Proved)
    }

    /// What the reader should know of a certificate of this report.
    pub(crate) fn notes_of(&self, certificate: &Certificate) -> Vec<String> {
        let own = certificate.notes.iter().map(Words::words);
        match self.is_theorem(certificate) {
            true => own.collect(),
            false => own.chain(self.notes.iter().cloned()).collect(),
        }
    }

    /// Whether a certificate of this report is the theorem's.
    fn is_theorem(&self, certificate: &Certificate) -> bool {
        let theorem = self.theorem.as_ref();
        theorem.is_some_and(|theorem| std::ptr::eq(theorem, certificate))
    }

    /// What the root of the error's mean square ends within, by the sharper of the two ways; none without
    /// Gaussian noise.
    pub fn mean_square(&self) -> Option<&Bounds> {
        self.sharper(|certificate| certificate.mean_square.as_ref())
    }

    /// What the error is within in the end, at any one time with a probability of 0.99; none without Gaussian noise.
    pub fn probable(&self) -> Option<&Bounds> {
        self.sharper(|certificate| certificate.probable.as_ref())
    }

    fn sharper(&self, of: impl Fn(&Certificate) -> Option<&Bounds>) -> Option<&Bounds> {
        let both = std::iter::once(&self.certificate).chain(&self.theorem);
        both.filter_map(of).min_by(|a, b| a.norm.total_cmp(&b.norm))
    }

    /// The proof with the faster rate, or the certificate by inequality if there is none.
    pub fn best(&self) -> &Certificate {
        match &self.theorem {
            Some(theorem) if theorem.rate > self.certificate.rate => theorem,
            _ => &self.certificate,
        }
    }
}
