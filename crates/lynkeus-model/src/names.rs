//! Names that users give: which model is meant, and "did you mean …?"

use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_SUGGESTIONS;

/// The names closest to `wanted`, best first, at most three.
pub(crate) fn near<'a>(wanted: &str, known: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    if wanted.len() > 64 {
        return vec![];
    }
    let allowed = wanted.chars().count().div_ceil(3).min(3);
    let allowed = if wanted.len() < 2 { 0 } else { allowed };
    let mut found: Vec<(usize, &str)> = known
        .filter(|name| name.len() <= 64)
        .take(MAX_SUGGESTIONS)
        .map(|name| (distance(wanted, name), name))
        .filter(|(distance, _)| *distance <= allowed)
        .collect();
    found.sort_unstable();
    found.dedup();
    found.truncate(3);
    found.into_iter().map(|(_, name)| name).collect()
}

/// ``did you mean `a` or `b`?``
pub(crate) fn did_you_mean<'a>(
    wanted: &str,
    known: impl Iterator<Item = &'a str>,
) -> Option<String> {
    let names = near(wanted, known);
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    (!quoted.is_empty()).then(|| format!("did you mean {}?", quoted.join(" or ")))
}

/// Number of edits (with swaps of neighbours) between two words; case counts half as much
/// as it would, by being ignored where all else agrees.
fn distance(a: &str, b: &str) -> usize {
    if a.eq_ignore_ascii_case(b) {
        return usize::from(a != b);
    }
    strsim::osa_distance(a, b)
}

/// Most names that a message lists.
const LISTED: usize = 12;

/// The place of the model that is asked for, or of the only one. `none` is the refusal of a
/// text without models.
pub(crate) fn choose(
    models: &[(&str, Span)],
    wanted: Option<&str>,
    none: impl FnOnce() -> Box<Problem>,
) -> Result<usize> {
    let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
    let Some(wanted) = wanted else {
        return match models {
            [_] => Ok(0),
            [] => Err(none()),
            [_, (_, second), ..] => {
                let count = models.len();
                let message = format!("the text holds {count} models; say which one to take");
                Err(Problem::new(*second, message).hint(listed("models", &names)))
            }
        };
    };
    let found = models.iter().position(|(name, _)| *name == wanted);
    found.ok_or_else(|| {
        let place = models.first().map(|(_, span)| *span).unwrap_or_default();
        let known = names.iter().copied();
        let hint = did_you_mean(wanted, known).unwrap_or_else(|| listed("models", &names));
        Problem::new(place, format!("the text holds no model `{wanted}`")).hint(hint)
    })
}

/// ``its models are a, b, …``
pub(crate) fn listed(what: &str, names: &[&str]) -> String {
    let shown = &names[..names.len().min(LISTED)];
    let more = if names.len() > LISTED { ", …" } else { "" };
    format!("its {what} are {}{more}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_neighbours() {
        let known = ["level", "lower", "pump", "Level"];
        assert_eq!(near("levle", known.into_iter()), ["level", "Level"]);
        assert_eq!(near("LEVEL", known.into_iter()), ["Level", "level"]);
        assert!(near("temperature", known.into_iter()).is_empty());
    }
}
