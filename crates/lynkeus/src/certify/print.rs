//! Certificates for people.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Line, Table};
use lynkeus_observers::Certificate;
use lynkeus_proof::noise::PROBABILITY;
use lynkeus_structure::Standing;
use lynkeus_words::Words;
use serde_json::Value;

use super::{CertifyReport, bounds, sampled};
use crate::Answer;
use lynkeus_experiment::judge::interval::Intervals;
use lynkeus_experiment::words::{condition, number, side};

/// Where it is guaranteed.
pub(crate) fn region(report: &CertifyReport) -> String {
    let sides = report.best().region.iter();
    let sides: Vec<String> = sides.map(|s| side(&s.name, s.min, s.max)).collect();
    format!("box: {}", abbreviated(&sides))
}

impl CertifyReport {
    /// The verdict in a sentence.
    pub fn conclusion(&self) -> Line {
        conclusion(self)
    }

    /// Its certificates, one after the other.
    pub(crate) fn tell_certificates(&self, document: &mut Document) {
        certificate(document, self, &self.certificate);
        if let Some(theorem) = &self.theorem {
            certificate(document, self, theorem);
        }
    }

    /// What the reader should know of all of it.
    pub(crate) fn remarks(&self) -> Vec<String> {
        // where something is proved, the first line says it
        let strays = self.strays.words(false).filter(|_| !self.is_proved());
        let strays = strays.map(|words| format!("the study leaves the box: {words}"));
        let unseen = self.strays.failure.iter().map(|why| {
            format!("whether the study stays in the box is not known, its run failed: {why}")
        });
        let assumed = self.assumed.iter().cloned();
        let notes = assumed.chain(strays).chain(unseen);
        notes.chain(self.declared.told()).collect()
    }
}

lynkeus_experiment::displayed!(CertifyReport);

impl Answer for CertifyReport {
    fn document(&self) -> Document {
        let family = self.design.examination.family;
        let title = Line::from(format!("{}: {family} observer, ", self.plant));
        let mut document = Document::new(title.then(self.conclusion()));
        document.line(region(self));
        self.tell_certificates(&mut document);
        if let Some(sampled) = &self.sampled {
            sampled::tell(sampled, self, &mut document);
        }
        if let Some(tube) = &self.tube {
            tube.tell(&mut document);
        }
        if let Some(error) = &self.error_tube {
            error.tell(&mut document);
        }
        if let Some(excited) = &self.excited {
            excited.tell(&mut document);
        }
        document.part().notes(self.remarks());
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn is_positive(&self) -> bool {
        let leaves = self.tube.as_ref().map(|tube| tube.verdict);
        !self.is_refuted() && leaves != Some(Standing::Refuted)
    }
}

/// The verdict in a word or two: never "proved" alone where the study is not in the box.
fn word(report: &CertifyReport, certificate: &Certificate) -> &'static str {
    let strays = |certificate| report.strays.words(report.is_theorem(certificate));
    match certificate.verdict() {
        // the observer may converge all the same
        Standing::Refuted if report.is_theorem(certificate) => "does not apply",
        Standing::Proved if strays(certificate).is_some() => "proved inside the box",
        verdict => verdict.word(),
    }
}

fn conclusion(report: &CertifyReport) -> Line {
    let best = report.best();
    if report.is_contradiction() {
        return Line::verdict("undecided").and(": one way proves and the other refutes it, which is a defect of this program; believe neither and report it");
    }
    match (report.verdict(), best.rate) {
        (Standing::Proved, rate) => {
            let rate = rate.map_or(String::new(), |rate| {
                format!(" at {} or faster{}", number(rate), left(report, best))
            });
            Line::verdict(proved(report)).and(format!(
                ": with sensors read continuously, the error decays{rate}{}",
                but(report)
            ))
        }
        (Standing::Refuted, _) => {
            Line::verdict("refuted").and(": an error grows, however small it is")
        }
        (Standing::Undecided, _) => {
            let tube = report.error_tube.as_ref();
            let tube = tube.map_or(String::new(), |found| format!("; {}", found.clause()));
            Line::verdict("undecided").and(format!(": neither a proof nor a counterexample{tube}"))
        }
    }
}

/// The verdict of a proof: never "proved" alone where the study's samples are too far apart.
fn proved(report: &CertifyReport) -> &'static str {
    match report.sampling.as_ref().is_some_and(Intervals::is_beyond) {
        true => "proved, but not for these samples",
        false => "proved",
    }
}

/// What a proof is worth for a study that is not in its box, or whose samples are too far apart.
fn but(report: &CertifyReport) -> String {
    let samples = report.sampling.as_ref().and_then(Intervals::beyond);
    let samples = samples.map(|words| format!("; {words}"));
    let strays = report.strays.words(report.is_theorem(report.best()));
    let strays = strays.map(|words| format!("; but only inside the box, and {words}"));
    let sampled = sampled::also(report);
    let tube = report
        .tube
        .as_ref()
        .map(|tube| format!("; {}", tube.clause()));
    samples
        .into_iter()
        .chain(sampled)
        .chain(strays)
        .chain(tube)
        .collect()
}

/// Bounds named in the first line.
const NAMED: usize = 4;

/// What is left of the error in the end.
fn left(report: &CertifyReport, best: &Certificate) -> String {
    let (bound, each, what) = match (best.ultimate_bound, report.mean_square()) {
        (Some(bound), _) if bound <= 0.0 => return String::new(),
        (Some(bound), _) => (bound, &best.ultimate, "in the end within"),
        (None, Some(found)) => (found.norm, &found.states, IN_MEAN_SQUARE),
        (None, None) => {
            return "; what disturbances, process noise and measurement errors leave of it has no bound, see the notes".to_owned();
        }
    };
    let bounds = bounds::in_words(report, each);
    match bounds.len() {
        0 => format!(
            ", {what} {} (Euclidean norm of all quantities)",
            number(bound)
        ),
        count if count <= NAMED => format!(", {what} {}", bounds.join(", ")),
        count => format!(
            ", {what} {} and {} more",
            bounds[..NAMED].join(", "),
            count - NAMED
        ),
    }
}

/// Of what process noise leaves.
const IN_MEAN_SQUARE: &str = "in the end in mean square (the root of E e²) within";

/// Equal ranges of an array's elements are one entry.
fn abbreviated(sides: &[String]) -> String {
    let mut texts: Vec<(String, usize)> = vec![];
    for text in sides {
        let key = match (text.find('['), text.find("] in ")) {
            (Some(open), Some(close)) if open < close => {
                format!("{}[…] in {}", &text[..open], &text[close + 5..])
            }
            _ => text.clone(),
        };
        match texts.iter_mut().find(|(known, _)| *known == key) {
            Some((_, count)) => *count += 1,
            None => texts.push((key, 1)),
        }
    }
    let texts: Vec<String> = texts.into_iter().map(|(text, _)| text).collect();
    texts.join(", ")
}

fn certificate(document: &mut Document, report: &CertifyReport, certificate: &Certificate) {
    let heading = Line::from(format!("{}: ", certificate.basis));
    document.heading(heading.decided(word(report, certificate)));
    document.conditions(certificate.hypotheses.iter().map(condition), "hypotheses");
    let constants = certificate.constants.iter();
    let rows = constants.map(|c| {
        let value = Cell::Number(number(c.value));
        vec![c.name.as_str().into(), value, c.words().into()]
    });
    document.table(Table::plain(["constant", "value", "meaning"]).with(rows));
    if !certificate.ultimate.is_empty() && certificate.ultimate_bound.is_some_and(|b| b > 0.0) {
        let bounds = bounds::in_words(report, &certificate.ultimate).join(", ");
        document.item(format!("in the end within: {bounds}"));
    }
    if let Some(found) = &certificate.mean_square {
        let bounds = bounds::in_words(report, &found.states).join(", ");
        document.item(format!("{IN_MEAN_SQUARE}: {bounds}"));
    }
    if let Some(found) = &certificate.probable {
        let bounds = bounds::in_words(report, &found.states).join(", ");
        document.item(format!(
            "in the end, at any one time with a probability of {PROBABILITY}, within: {bounds}"
        ));
    }
    document.notes(report.notes_of(certificate));
}
