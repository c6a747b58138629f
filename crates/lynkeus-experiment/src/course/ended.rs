//! What becomes of a run that ended before its last row.

use lynkeus_expr::Spent;
use lynkeus_run::Error as RunError;

use crate::course::Course;
use crate::words::in_words;
use crate::{Error, Study};

/// What becomes of a run that ended before its last row: one that a limit ended is not whole,
/// and an answer says something of the estimate; both keep their rows.
///
/// # Errors
/// Any other end, or one before the first row.
pub(crate) fn settle(
    course: &mut Course,
    rows: usize,
    study: &Study,
    place: &str,
    is_answer: fn(&RunError) -> bool,
) -> Result<(), Error> {
    match (course.ended.take(), study.budget.marked()) {
        (None, _) => Ok(()),
        (Some(error @ RunError::Cancelled { .. }), Some(spent)) if spent != Spent::Cancelled => {
            (course.ended, course.limit) = (Some(error), Some(spent));
            Ok(())
        }
        (Some(error), _) if rows > 0 && is_answer(&error) => {
            course.ended = Some(error);
            Ok(())
        }
        (Some(error), _) => Err(interrupted_on(error, place, &study.file)),
    }
}

/// Whether the end of a run says something of the estimate, and not of the input.
pub(crate) fn is_answer(error: &RunError) -> bool {
    matches!(
        error,
        RunError::Diverged { .. }
            | RunError::DeviationDiverged { .. }
            | RunError::NotFinite { .. }
            | RunError::StepUnderflow { .. }
            | RunError::Singular { .. }
            | RunError::Grazing { .. }
    )
}

/// The same where the observer alone is integrated: readings, or its tuning, may take it to where no number
/// of steps is enough.
pub(crate) fn is_observers_answer(error: &RunError) -> bool {
    let is_steep = matches!(
        error,
        RunError::StepBudget { .. } | RunError::TooStiff { .. }
    );
    is_steep || is_answer(error)
}

/// A run on a log that ended early; what is wrong with a setting is the study's fault, not the log's.
pub(crate) fn interrupted_on(error: RunError, log: &str, study: &str) -> Error {
    let is_setting = matches!(
        error,
        RunError::Setting { .. } | RunError::TooStiff { .. } | RunError::EndlessEvents { .. }
    );
    interrupted(error, if is_setting { study } else { log })
}

/// A run that ended early: no result; an estimate that left every bound is an
/// answer, everything else is a fault of the input.
pub(crate) fn interrupted(error: RunError, place: &str) -> Error {
    let text = in_words(&error);
    let told = match is_answer(&error) {
        true => Error::refused(text),
        false => Error::input(text),
    };
    told.caused_by(error).at(place)
}
