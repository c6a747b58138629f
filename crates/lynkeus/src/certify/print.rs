//! Certificates for people.

use std::fmt;

use lynkeus_observers::{Certificate, UltimateBound};
use lynkeus_structure::Standing;
use lynkeus_words::Words;

use super::CertifyReport;
use crate::judge::interval::Intervals;
use crate::words::{conditions, number, side};

/// Where it is guaranteed.
pub(crate) fn region(report: &CertifyReport) -> String {
    let sides = report.best().region.iter();
    let sides: Vec<String> = sides.map(|s| side(&s.name, s.min, s.max)).collect();
    format!("box: {}", abbreviated(&sides))
}

impl CertifyReport {
    /// The verdict in a sentence.
    pub fn conclusion(&self) -> String {
        conclusion(self)
    }

    /// The verdict of one of its certificates, in a word or two.
    pub(crate) fn word(&self, certificate: &Certificate) -> &'static str {
        word(self, certificate)
    }
}

impl fmt::Display for CertifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        report(f, self)
    }
}

fn report(f: &mut fmt::Formatter<'_>, report: &CertifyReport) -> fmt::Result {
    writeln!(
        f,
        "{}: {} observer, {}",
        report.plant,
        report.design.examination.family,
        conclusion(report)
    )?;
    writeln!(f, "{}", region(report))?;
    writeln!(f)?;
    certificate(f, report, &report.certificate)?;
    if let Some(theorem) = &report.theorem {
        writeln!(f)?;
        certificate(f, report, theorem)?;
    }
    if let Some(excited) = &report.excited {
        write!(f, "\n{excited}")?;
    }
    // where something is proved, the first line says it
    let strays = report.strays.words(false).filter(|_| !report.is_proved());
    let strays = strays.map(|words| format!("the study leaves the box: {words}"));
    let unseen = report.strays.failure.iter();
    let unseen = unseen.map(|why| {
        format!("whether the study stays in the box is not known, its run failed: {why}")
    });
    let notes: Vec<String> = report
        .assumed
        .iter()
        .cloned()
        .chain(strays)
        .chain(unseen)
        .chain(report.declared.told())
        .collect();
    if !notes.is_empty() {
        writeln!(f)?;
    }
    for note in &notes {
        writeln!(f, "note: {note}")?;
    }
    Ok(())
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

fn conclusion(report: &CertifyReport) -> String {
    let best = report.best();
    if report.is_contradiction() {
        return "undecided: one way proves and the other refutes it, which is a defect of this program; believe neither and report it".to_owned();
    }
    match (report.verdict(), best.rate) {
        (Standing::Proved, Some(rate)) => {
            format!(
                "{}: with sensors read continuously, the error decays at {} or faster{}{}",
                proved(report),
                number(rate),
                left(report, best),
                but(report)
            )
        }
        (Standing::Proved, None) => {
            format!(
                "{}: with sensors read continuously, the error decays{}",
                proved(report),
                but(report)
            )
        }
        (Standing::Refuted, _) => "refuted: an error grows, however small it is".to_owned(),
        (Standing::Undecided, _) => "undecided: neither a proof nor a counterexample".to_owned(),
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
    samples.into_iter().chain(strays).collect()
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
    let bounds = bounds(report, each);
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

/// `0.3 K of T`, for every bounded quantity.
fn bounds(report: &CertifyReport, each: &[UltimateBound]) -> Vec<String> {
    let estimates = &report.design.observer.estimates;
    let unit = |name: &str| {
        let mut found = estimates.iter().filter(|e| e.variable.name == name);
        let unit = found.next().and_then(|e| e.variable.unit.as_deref());
        unit.filter(|unit| !unit.is_empty())
            .map_or(String::new(), |unit| format!(" {unit}"))
    };
    each.iter()
        .map(|b| format!("{}{} of {}", number(b.value), unit(&b.name), b.name))
        .collect()
}

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

fn certificate(
    f: &mut fmt::Formatter<'_>,
    report: &CertifyReport,
    certificate: &Certificate,
) -> fmt::Result {
    writeln!(f, "{}: {}", certificate.basis, word(report, certificate))?;
    conditions(f, &certificate.hypotheses, "hypotheses")?;
    for constant in &certificate.constants {
        writeln!(
            f,
            "  {:<10} {:<12} {}",
            constant.name,
            number(constant.value),
            constant.words()
        )?;
    }
    if !certificate.ultimate.is_empty() && certificate.ultimate_bound.is_some_and(|b| b > 0.0) {
        let bounds = bounds(report, &certificate.ultimate).join(", ");
        writeln!(f, "  in the end within: {bounds}")?;
    }
    if let Some(found) = &certificate.mean_square {
        let bounds = bounds(report, &found.states).join(", ");
        writeln!(f, "  {IN_MEAN_SQUARE}: {bounds}")?;
    }
    for note in report.notes_of(certificate) {
        writeln!(f, "  note: {note}")?;
    }
    Ok(())
}
