//! The report for machines.

use lynkeus_model::Diagnostic;
use lynkeus_observability::Verdict;
use lynkeus_observers::{Check, Examination, fit_word};
use lynkeus_structure as structure;
use lynkeus_words::Words;
use serde_json::{Value, json};

use super::{Knowledge, Next, Report, Uniform, observability, point, uniform};
use crate::prepare::choice::Choice;

impl Report {
    /// The report for machines.
    pub fn to_json(&self) -> Value {
        let families: Vec<Value> = self.examinations.iter().map(family).collect();
        let visible = self.answer.quantities.iter().map(|(asked, _)| {
            (
                asked.name.clone(),
                json!(asked.verdict == Verdict::Observable),
            )
        });
        let mut report = json!({
            "plant": self.plant,
            "states": self.states,
            "measured": self.measured,
            "unknown": self.unknown,
            "recommended": self.recommended,
            "warnings": self.warnings.iter().map(Diagnostic::one_line).collect::<Vec<_>>(),
            "families": families,
            "visible": visible.collect::<serde_json::Map<_, _>>(),
        });
        observability::add_json(&self.answer, &mut report);
        report["uniform"] = json!(
            self.uniform
                .as_ref()
                .and_then(Uniform::said)
                .map(uniform::json)
        );
        report["knowledge"] = self.knowledge.iter().map(Knowledge::to_json).collect();
        report["choice"] = json!(self.choice.as_ref().map(Choice::to_json));
        report["declared"] = self.declared.to_json();
        report["next"] = json!(self.next.as_ref().map(Next::to_json));
        report
    }
}

fn family(examination: &Examination) -> Value {
    let check = |check: &Check| {
        let mut entry = json!({
            "name": check.statement.words(),
            "verdict": check.verdict.word(),
            "detail": check.reason.words(),
        });
        match &check.verdict {
            structure::Verdict::Proved => {}
            structure::Verdict::Refuted(witness) => {
                entry["witness"] = witness.points.iter().map(point).collect();
            }
            structure::Verdict::Undecided(sides) => {
                let sides = sides
                    .iter()
                    .map(|side| (side.name.clone(), json!([side.min, side.max])));
                entry["box"] = Value::Object(sides.collect());
            }
        }
        entry
    };
    json!({
        "family": examination.family.name(),
        "fit": fit_word(examination.fit()),
        "summary": examination.summary.words(),
        "chains": examination.chains,
        "checks": examination.conditions().map(check).collect::<Vec<_>>(),
    })
}
