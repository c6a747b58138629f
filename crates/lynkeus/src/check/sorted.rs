//! Quantities by what can be known of them.

use lynkeus_observability::Verdict;
use lynkeus_structure::fate::Fate;

use super::Known;

/// Names by what can be known of them.
#[derive(Default)]
pub(super) struct Sorted<'a> {
    /// the outputs tell
    pub seen: Vec<&'a str>,
    /// known in the end, as errors decay
    pub follows: Vec<&'a str>,
    /// the outputs do not tell
    pub hidden: Vec<&'a str>,
    /// whether the outputs tell is not decided
    pub open: Vec<&'a str>,
}

impl<'a> Sorted<'a> {
    pub fn of_knowledge(quantities: impl Iterator<Item = (&'a str, &'a Known)>) -> Self {
        let mut sorted = Self::default();
        for (name, known) in quantities {
            let group = match known {
                Known::Everywhere
                | Known::WhileConstant
                | Known::Locally { .. }
                | Known::AlmostEverywhere
                | Known::WhileExcited { .. }
                | Known::InPart { .. }
                | Known::Reserved { .. } => &mut sorted.seen,
                Known::Hidden(Fate::Decays { .. }) => &mut sorted.follows,
                Known::Hidden(_) => &mut sorted.hidden,
                Known::Undecided => &mut sorted.open,
            };
            group.push(name);
        }
        sorted
    }

    pub fn of_verdicts(quantities: impl Iterator<Item = (&'a str, Verdict)>) -> Self {
        let mut sorted = Self::default();
        for (name, verdict) in quantities {
            let group = match verdict {
                Verdict::Observable => &mut sorted.seen,
                Verdict::Unobservable => &mut sorted.hidden,
                Verdict::Undecided => &mut sorted.open,
            };
            group.push(name);
        }
        sorted
    }

    /// Whether an estimate of it is worth something.
    pub fn is_estimated(&self, name: &str) -> bool {
        self.seen.contains(&name) || self.follows.contains(&name)
    }
}
