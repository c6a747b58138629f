//! Numbers, ranges, verdicts and failures as people read them.

use lynkeus_answer::Error;
use lynkeus_answer::document::Condition;
use lynkeus_expr::real::rounded;
use lynkeus_observers::Check;
use lynkeus_run::Error as RunError;
use lynkeus_structure::Verdict;
use lynkeus_words::{Words, figures};

/// Four significant digits.
pub fn number(value: f64) -> String {
    figures(value, 4)
}

/// Ten significant digits of a time, all written out: rows of a log that counts seconds since 1970 differ.
pub(crate) fn instant(time: f64) -> String {
    let rounded = rounded(time, 10);
    match rounded.abs() {
        0.0 | 1e-4..1e15 => rounded.to_string(),
        _ => figures(rounded, 10),
    }
}

/// `x in [0, 1]`, or `x = 4.69` for a point.
pub fn side(name: &str, low: f64, high: f64) -> String {
    match low == high {
        true => format!("{name} = {}", number(low)),
        false => format!("{name} in [{}, {}]", number(low), number(high)),
    }
}

/// An error in what the user gave, in the words of the one that tells it; of a run that failed, with what
/// a study can do about it.
pub fn explain(source: impl std::error::Error + Send + Sync + 'static) -> Error {
    let text = source.to_string();
    let first: &(dyn std::error::Error + 'static) = &source;
    let run = std::iter::successors(Some(first), |error| error.source())
        .filter_map(|error| error.downcast_ref::<RunError>())
        .find(|error| error.to_string() == text);
    Error::input(run.map_or(text, in_words)).caused_by(source)
}

/// Why a run ended, with what a study can do about it.
pub(crate) fn in_words(error: &RunError) -> String {
    match error {
        RunError::StepBudget {
            time,
            until,
            steps,
            chatters,
            state,
        } => format!(
            "{steps} steps took the integration only to t = {time}, on the way to {until}: {chatters}a gain is too high or a relay or a threshold of the state chatters; lower the gain, smooth what jumps, loosen `rtol`, or set method = \"stiff\" or \"rk4\"; the state is {state}"
        ),
        RunError::DeviationDiverged { .. } => {
            format!("{error}; give smaller values in initial_variance or [process_noise]")
        }
        _ => error.to_string(),
    }
}

/// A condition with what decides it.
pub fn condition(check: &Check) -> Condition {
    let is_refuted = matches!(check.verdict, Verdict::Refuted(_));
    Condition {
        verdict: check.verdict.word(),
        statement: check.statement.words(),
        detail: check.reason.words(),
        witness: is_refuted.then(|| check.verdict.words()),
    }
}

/// Names listed before the rest becomes a count.
const NAMED: usize = 24;

/// Names, the rest as a count where there are many.
pub fn listed(names: &[&str]) -> String {
    match names.len() > NAMED {
        true => format!("{}, … ({} in all)", names[..NAMED].join(", "), names.len()),
        false => names.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_two_rows_differ() {
        for (time, words) in [
            (1_700_002_280.0, "1700002280"),
            (1_405_380.0, "1405380"),
            (-0.1 - 0.2, "-0.3"),
            (0.0, "0"),
            (2e-9, "2e-9"),
            (1e300, "1e300"),
        ] {
            assert_eq!(instant(time), words);
        }
    }
}
