//! Whether an estimate is credible, on a device: in constant memory, by the figures of every judge.

use lynkeus_run::credible::{By, CHANCE, CLIP, ENOUGH, FEW};

use super::machine::{Kind, Machine};
use super::tables::number;
use super::template::{chosen, exchanged};

const CREDIBLE: &str = include_str!("runtime/credible.c");

/// Readings of a block once there were that many; two blocks are judged together.
const LONGEST_BLOCK: usize = 128;

impl Machine {
    /// What is kept of each sensor's readings, and the verdict on them.
    pub fn credible(&mut self, sensors: usize, by: By, has_gate: bool) {
        let both = || vec![0.0; 2 * sensors];
        let about =
            "of each sensor, in this block and in the one before: Σ z², z how many deviations off";
        self.field("squares", Kind::Real, about, both());
        self.field("largest", Kind::Real, "of these z²", both());
        self.field("taken", Kind::Int, "readings with such a z", both());
        if has_gate {
            let about = "readings that the gate kept out, likewise";
            self.field("kept_out", Kind::Int, about, both());
        }
        let about = "readings of a full block";
        self.field("block", Kind::Int, about, vec![1.0; sensors]);
        let allowed = by.limit().powi(2);
        // P(χ² of n degrees > n + 2√(nx) + 2x) < exp(-x) (Laurent and Massart), and 2√(nx) is n + x at most
        let chance = 3.0 * -CHANCE.ln();
        let facts = [
            (has_gate, "gate"),
            // of one reading the limit says it, too
            (allowed < 2.0 + chance, "chance"),
        ];
        let holds: Vec<&str> = facts.iter().filter(|f| f.0).map(|f| f.1).collect();
        let text = exchanged(&chosen(CREDIBLE, &holds), |word| {
            Some(match word {
                "MOST_OFF" => number(CLIP * CLIP),
                "ALLOWED" => number(allowed),
                "CHANCE" => number(chance),
                "ENOUGH" => ENOUGH.to_string(),
                "FEW" => FEW.to_string(),
                "LONGEST_BLOCK" => LONGEST_BLOCK.to_string(),
                _ => return None,
            })
        });
        self.add(&text);
    }

    /// Whether readings are judged.
    pub fn is_judged(&self) -> bool {
        self.fields.iter().any(|field| field.name == "squares")
    }
}
