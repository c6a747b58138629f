//! Why the derivatives of the outputs do not determine the state, decided in exact arithmetic:
//! floating point loses a digit with each derivative.

use lynkeus_expr::Spent;
use lynkeus_model::{Plant, Variable};
use lynkeus_observability::{Answer, Question, Verdict, analyse};
use lynkeus_structure::Extended;

use super::form::unfit;
use crate::conditions::lasts;
use crate::{DesignError, Examination};

/// The share of the time for the names of what is not seen.
const WORDS: f64 = 0.5;

/// What hides the state, where that is so.
///
/// # Errors
/// Only rounding hides it, or a limit ended the search for it.
pub(super) fn blind(extended: &Extended<'_>) -> Result<Examination, DesignError> {
    lasts(extended)?;
    let names = |of: &[Variable]| of.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    let drift = answer(extended, names(&extended.inputs))?;
    if drift.is_complete() {
        return Err(DesignError::Spent(Spent::Digits));
    }
    let mut hidden = hidden(&drift);
    if hidden.is_empty() {
        lasts(extended)?;
        return Err(DesignError::Spent(Spent::Digits));
    }
    if !extended.inputs.is_empty() {
        hidden = self::hidden(&answer(extended, vec![])?);
    }
    let advice = match hidden.is_empty() {
        true => "the rest shows only where the inputs are not zero; write the model around an operating point, u = u0 + du with the input du".to_owned(),
        false => format!("no measured output feels {}; measure more", hidden.join(", ")),
    };
    Ok(unfit(format!(
        "with u = 0 the outputs and their derivatives determine {} of {} combinations of states: {advice}",
        drift.rank,
        extended.states.len()
    )))
}

/// States that no derivative of an output tells.
fn hidden(answer: &Answer) -> Vec<String> {
    let quantities = answer.quantities.iter();
    let hidden = quantities.filter(|(asked, _)| asked.verdict == Verdict::Unobservable);
    hidden.map(|(asked, _)| asked.name.clone()).collect()
}

/// What can be known of the extended states, with these inputs at zero.
fn answer(extended: &Extended<'_>, zero: Vec<String>) -> Result<Answer, DesignError> {
    let question = Question {
        disturbances: zero,
        budget: extended.graph().budget().part(WORDS),
        ..Question::default()
    };
    let answer = analyse(&plant(extended), &question);
    // the names are the plant's own
    answer.map_err(|_| DesignError::Spent(Spent::Digits))
}

/// The extended plant as a plant of its own: unknown inputs are states, starts are not known.
fn plant(extended: &Extended<'_>) -> Plant {
    let state = |state: &Variable| Variable {
        fixed: false,
        start_node: None,
        ..state.clone()
    };
    Plant {
        states: extended.states.iter().map(state).collect(),
        derivatives: extended.derivatives.clone(),
        inputs: extended.inputs.clone(),
        outputs: extended
            .outputs
            .iter()
            .map(|o| o.variable.clone())
            .collect(),
        ..extended.plant.clone()
    }
}
