//! Certificates for people.

use std::fmt;

use lynkeus_observers::{Certificate, Verdict};

use super::CertifyReport;
use crate::words::{conditions, number, side};

pub(super) fn report(f: &mut fmt::Formatter<'_>, report: &CertifyReport) -> fmt::Result {
    let observer = &report.design.observer;
    writeln!(
        f,
        "{}: {} observer, {}",
        report.plant,
        observer.family,
        conclusion(report)
    )?;
    let sides: Vec<String> = report
        .best()
        .region
        .iter()
        .map(|(n, low, high)| side(n, *low, *high))
        .collect();
    writeln!(f, "box: {}", abbreviated(&sides))?;
    writeln!(f)?;
    certificate(f, &report.certificate)?;
    if let Some(theorem) = &report.theorem {
        writeln!(f)?;
        certificate(f, theorem)?;
    }
    Ok(())
}

pub(super) fn conclusion(report: &CertifyReport) -> String {
    let best = report.best();
    match (report.verdict(), best.rate) {
        (Verdict::Proved, Some(rate)) => {
            let bound = match best.ultimate_bound {
                Some(bound) if bound > 0.0 => format!(", in the end within {}", number(bound)),
                _ => String::new(),
            };
            format!(
                "proved: the error decays at {} or faster{bound}",
                number(rate)
            )
        }
        (Verdict::Proved, None) => "proved: the error decays".to_owned(),
        (Verdict::Refuted, _) => "refuted: at a point of the box the error grows".to_owned(),
        (Verdict::Undecided, _) => "undecided: neither a proof nor a counterexample".to_owned(),
    }
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

fn certificate(f: &mut fmt::Formatter<'_>, certificate: &Certificate) -> fmt::Result {
    writeln!(f, "{}: {}", certificate.basis, certificate.verdict.word())?;
    conditions(f, &certificate.hypotheses, "hypotheses")?;
    for constant in &certificate.constants {
        writeln!(
            f,
            "  {:<10} {:<12} {}",
            constant.name,
            number(constant.value),
            constant.meaning
        )?;
    }
    if !certificate.ultimate.is_empty() && certificate.ultimate_bound.is_some_and(|b| b > 0.0) {
        let bounds: Vec<String> = certificate
            .ultimate
            .iter()
            .map(|(n, b)| format!("{n} {}", number(*b)))
            .collect();
        writeln!(f, "  in the end within: {}", bounds.join(", "))?;
    }
    for note in &certificate.notes {
        writeln!(f, "  note: {note}")?;
    }
    Ok(())
}
