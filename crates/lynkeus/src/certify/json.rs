//! Certificates for machines.

use lynkeus_observers::{Certificate, Check, UltimateBound};
use lynkeus_structure::Verdict;
use lynkeus_words::Words;
use serde_json::{Map, Value, json};

use super::{CertifyReport, Excited};
use crate::check::point;
use crate::judge::interval::Intervals;

/// `{verdict, rate, ultimate_bound, mean_square_bound, box, hypotheses, …}`; the hypotheses are those of
/// the inequality, then those of the theorem.
pub(crate) fn certificate(report: &CertifyReport) -> Value {
    let mut best = report.best().clone();
    best.mean_square = None;
    if report.is_contradiction() {
        (best.rate, best.ultimate_bound, best.ultimate) = (None, None, vec![]);
    } else {
        best.mean_square = report.mean_square().cloned();
    }
    let theorem = report.theorem.iter().flat_map(|t| &t.hypotheses);
    let hypotheses: Vec<Value> = report
        .certificate
        .hypotheses
        .iter()
        .chain(theorem)
        .map(hypothesis)
        .collect();
    let mut object = summary(&best);
    object["verdict"] = json!(report.verdict().word());
    object["hypotheses"] = json!(hypotheses);
    object["declared"] = report.declared.to_json();
    object["outside_box"] = report.strays.to_json();
    object["excitation"] = json!(report.excited.as_ref().map(Excited::to_json));
    object["sampling"] = json!(report.sampling.map(sampling));
    let strays = report.strays.words(false);
    let strays = strays.map(|words| format!("the certificate is for the box only, and {words}"));
    object["notes"] = json!(
        std::iter::once(&report.certificate)
            .chain(&report.theorem)
            .flat_map(|certificate| report.notes_of(certificate))
            .chain(report.assumed.iter().cloned())
            .chain(strays)
            .collect::<Vec<_>>()
    );
    if let Some(theorem) = &report.theorem {
        object["theorem"] = summary(theorem);
    }
    object
}

fn summary(certificate: &Certificate) -> Value {
    let sides = certificate
        .region
        .iter()
        .map(|s| (s.name.clone(), json!([s.min, s.max])));
    let bounds = |each: &[UltimateBound]| -> Map<String, Value> {
        let pairs = each.iter().map(|b| (b.name.clone(), json!(b.value)));
        pairs.collect()
    };
    let mean_square = certificate.mean_square.as_ref();
    let constants = certificate
        .constants
        .iter()
        .map(|c| json!({ "name": c.name, "value": c.value, "meaning": c.words() }));
    json!({
        "basis": certificate.basis,
        "verdict": certificate.verdict().word(),
        "rate": certificate.rate,
        "ultimate_bound": certificate.ultimate_bound,
        "ultimate_bounds": bounds(&certificate.ultimate),
        "mean_square_bound": mean_square.map(|b| b.norm),
        "mean_square_bounds": bounds(mean_square.map_or(&[], |b| &b.states)),
        "box": sides.collect::<Map<_, _>>(),
        "constants": constants.collect::<Vec<_>>(),
    })
}

/// The study's samples against what the observer stands.
fn sampling(intervals: Intervals) -> Value {
    let mut entry = intervals.to_json();
    entry["beyond"] = json!(intervals.is_beyond());
    entry
}

fn hypothesis(check: &Check) -> Value {
    let mut entry = json!({
        "name": check.statement.words(),
        "verdict": check.verdict.word(),
        "detail": check.reason.words(),
    });
    if let Verdict::Refuted(witness) = &check.verdict {
        entry["witness"] = witness.points.iter().map(point).collect();
    }
    entry
}
