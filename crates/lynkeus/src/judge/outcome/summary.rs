//! A run in figures, for programs.

use serde_json::{Value, json};

use super::Outcome;
use crate::{Doubt, Frozen, Intervals, Outside, Quantity, Series};

impl Outcome {
    /// The run in figures, as the command's `--json` prints it; `with_truth` as in
    /// [`columns`](Self::columns).
    pub fn to_json(&self, with_truth: bool) -> Value {
        let columns = self.columns(with_truth);
        let object = |pairs: Vec<(String, Value)>| Value::Object(pairs.into_iter().collect());
        let estimated = || self.quantities.iter().filter(|q| q.estimate.is_some());
        let last = |q: &Quantity| json!(q.estimate.as_ref().and_then(Series::last));
        let settled = |q: &Quantity| Some((q.name.clone(), json!(q.settled_error()?)));
        let gains = self.design.gains.iter().map(|gain| {
            let entries = gain
                .entries
                .iter()
                .map(|(state, k)| (state.clone(), json!(k)));
            (gain.output.clone(), object(entries.collect()))
        });
        let watches = self.watches.iter().map(|w| {
            let entry = json!({ "alarm_at": w.alarm, "column": w.header });
            (w.monitor.name.clone(), entry)
        });
        let headers = estimated().map(|q| (q.name.clone(), json!(q.estimate_header)));
        let outside = |outside: &Option<Outside>| json!(outside.as_ref().map(|o| o.to_json()));
        json!({
            "plant": self.plant,
            "family": self.design.examination.family.name(),
            "chains": self.design.examination.chains,
            "gains": object(gains.collect()),
            "rows": self.time.len(),
            "columns": columns.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            "estimates": object(headers.collect()),
            "final": object(estimated().map(|q| (q.name.clone(), last(q))).collect()),
            "rms_error_last_half": object(estimated().filter_map(settled).collect()),
            "errors": object(self.accuracies.iter().map(|a| (a.quantity.clone(), a.to_json())).collect()),
            "sampling": self.intervals.as_ref().map(Intervals::to_json),
            "frozen": self.frozen.iter().map(Frozen::to_json).collect::<Vec<_>>(),
            "monitors": object(watches.collect()),
            "outside_box": {
                "plant": outside(&self.plant_outside),
                "estimate": outside(&self.estimate_outside),
            },
            "innovations": object(self.innovations.iter().map(|i| (i.output.clone(), i.to_json())).collect()),
            "credible": self.is_credible(),
            "declared": self.declared.to_json(),
            "ended": self.ended.as_ref().map(|e| json!({ "message": e.message, "by_limit": e.by_limit })),
            "doubts": self.doubts.iter().map(Doubt::to_json).collect::<Vec<_>>(),
            "warnings": self.warnings,
            "notes": self.notes,
        })
    }
}
