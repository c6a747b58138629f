//! Numbers of an estimator that may be changed while it runs.

use lynkeus_run::Tuned;

use super::device::Device;
use super::function::{Arguments, Entry, Target, draft};
use super::machine::{Kind, Machine, code};
use super::template::chosen;
use crate::Refusal;
use crate::code::Part;

const TUNED: &str = include_str!("runtime/tuned.c");

/// What stands for the factor on a filter's process noise among what its flow reads.
pub(super) const NOISE_FACTOR: &str = "w[INPUTS]";

impl Machine {
    /// The numbers with what follows from them: `gains` of an observer; the factor on its process
    /// noise of a filter. What is made of them lies behind the known inputs, and what an observer
    /// reads besides.
    pub fn tuned(&mut self, device: &Device<'_>, gains: Option<&Tuned>) -> Result<(), Refusal> {
        let tunables = device.tunables;
        if tunables.is_empty() {
            return Ok(());
        }
        self.size("TUNABLES", tunables.len());
        let names: Vec<&str> = tunables.iter().map(|t| t.entry.name.as_str()).collect();
        let starts = tunables.iter().map(|tunable| tunable.start).collect();
        let about = format!("may be changed at any time: {}", names.join(", "));
        self.field("tuning", Kind::Real, &about, starts);
        let holds: &[&str] = match gains {
            None => &[],
            Some(gains) => {
                let count = gains.system.outputs().len();
                self.size("TUNED", count);
                let about = "the numbers for which the last inputs hold";
                self.field("tuned_for", Kind::Real, about, vec![0.0; tunables.len()]);
                let arguments = Arguments {
                    x: vec![],
                    w: names.iter().map(|name| Entry::named(*name)).collect(),
                };
                let text = draft(
                    "What the equations make of the numbers that may be changed.",
                    "tune",
                    &code(&[Part::all(gains.system.output_tape())])?,
                    &arguments,
                    &[Target::all("gains", count)],
                )?;
                self.add(&text);
                &["gains"]
            }
        };
        self.add(&chosen(TUNED, holds));
        Ok(())
    }
}
