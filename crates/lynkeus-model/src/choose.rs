//! Which model of a text is meant.

use crate::names::did_you_mean;
use crate::syntax::{Problem, Result, Span};

/// Most names that a message lists.
const LISTED: usize = 12;

/// The place of the model that is asked for, or of the only one. `none` is the refusal of a
/// text without models.
pub(crate) fn choose(
    models: &[(&str, Span)],
    wanted: Option<&str>,
    none: impl FnOnce() -> Problem,
) -> Result<usize> {
    let Some(wanted) = wanted else {
        return match models {
            [_] => Ok(0),
            [] => Err(none()),
            [_, (_, second), ..] => {
                let count = models.len();
                let message = format!("the text holds {count} models; say which one to take");
                Err(Problem::new(*second, message).hint(listed(models)))
            }
        };
    };
    let found = models.iter().position(|(name, _)| *name == wanted);
    found.ok_or_else(|| {
        let place = models.first().map(|(_, span)| *span).unwrap_or_default();
        let names = models.iter().map(|(name, _)| *name);
        let hint = did_you_mean(wanted, names).unwrap_or_else(|| listed(models));
        Problem::new(place, format!("the text holds no model `{wanted}`")).hint(hint)
    })
}

fn listed(models: &[(&str, Span)]) -> String {
    let names = models.iter().map(|(name, _)| *name);
    let shown: Vec<&str> = names.take(LISTED).collect();
    let more = if models.len() > LISTED { ", …" } else { "" };
    format!("its models are {}{more}", shown.join(", "))
}
