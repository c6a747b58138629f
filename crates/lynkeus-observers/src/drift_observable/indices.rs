//! Which derivatives of which outputs: the indices.
//!
//! Those of Krener and Respondek are taken where all is proved with them. Else others
//! are examined, on the box of the states and the declared ranges of the inputs, so that a
//! certificate on a smaller range of the inputs is about the same observer.
//!
//! Why the derivatives of the outputs do not determine the state is decided in exact arithmetic:
//! floating point loses a digit with each derivative.

use lynkeus_expr::Spent;
use lynkeus_model::{Plant, Variable};
use lynkeus_observability::{Answer, Question, analyse};
use lynkeus_structure::output_map::Codistribution;
use lynkeus_structure::{AugmentedPlant, Region, Standing, Verdict};

use super::form::{Form, Map, unfit};
use super::said::{Known, Others, Said};
use super::settings::{POLES, Settings};
use crate::conditions::lasts;
use crate::design::Found;
use crate::{DesignError, Examination, Reason, TuningError};

/// Further index vectors that are examined.
const EXAMINED: usize = 6;

/// Index vectors that are told where none fits.
const TOLD: usize = 4;

/// The form of the plant on `region`, or why there is none.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Result<Found<Form>, DesignError> {
    let map = Map::new(augmented, settings, region)?;
    let asked: Option<Vec<usize>> = settings.indices.iter().copied().collect();
    if let Some(indices) = asked.filter(|indices| !indices.is_empty()) {
        return Form::new(augmented, &map, &indices, region);
    }
    lasts(augmented)?;
    let mut rows = Codistribution::new(augmented, &map.gradients)?;
    lasts(augmented)?;
    let first = rows.krener_respondek();
    if first.iter().sum::<usize>() < augmented.states.len() {
        return Err(blind(augmented)?.into());
    }
    let candidates = candidates(&mut rows, first, &settings.indices)?;
    let wide = declared(augmented, region);
    let examined = |μ: &[usize]| Form::new(augmented, &map, μ, &wide);
    let (found, left) = best(&mut rows, &candidates, examined)?;
    let mut chosen = match wide == *region {
        true => found,
        false => Form::new(augmented, &map, &found.form.indices, region)?,
    };
    if let Reason::DriftObservable(Said::Form { others, .. }) = &mut chosen.examination.summary {
        *others = left;
    }
    Ok(chosen)
}

/// The region with the inputs' declared ranges.
fn declared(augmented: &AugmentedPlant<'_>, region: &Region) -> Region {
    let mut region = region.clone();
    for side in &mut region.dimensions {
        let mut inputs = augmented.plant.inputs.iter();
        let known = augmented.inputs.iter().any(|i| i.node == side.symbol);
        if let Some(input) = inputs.find(|i| known && i.node == side.symbol) {
            (side.min, side.max) = (input.min, input.max);
        }
    }
    region
}

/// Index vectors of the lengths that the study asks for, the first of them Krener and
/// Respondek's where it may be.
fn candidates(
    rows: &mut Codistribution,
    first: Vec<usize>,
    asked: &[Option<usize>],
) -> Result<Vec<Vec<usize>>, TuningError> {
    let further = match first.len() > 1 {
        true => rows.alternatives(&first),
        false => vec![],
    };
    let all: Vec<Vec<usize>> = std::iter::once(first).chain(further).collect();
    let fits = |μ: &&Vec<usize>| {
        let mut pairs = μ.iter().zip(asked);
        pairs.all(|(μ, asked)| asked.is_none_or(|asked| asked == *μ))
    };
    let found: Vec<Vec<usize>> = all.iter().filter(fits).cloned().collect();
    if found.is_empty() {
        let shown: Vec<String> = all.iter().take(TOLD).map(|μ| format!("{μ:?}")).collect();
        let expected = format!(
            "lists of lengths that make up a map of the state: {}",
            shown.join(", ")
        );
        let found = "lists of other lengths";
        return Err(TuningError::new(POLES.name, expected, found));
    }
    Ok(found)
}

/// The first of the candidates with which most is proved, and those that were not chosen.
fn best(
    rows: &mut Codistribution,
    candidates: &[Vec<usize>],
    form: impl Fn(&[usize]) -> Result<Found<Form>, DesignError>,
) -> Result<(Found<Form>, Others), DesignError> {
    let mut best = form(&candidates[0])?;
    let (mut others, mut examined) = (vec![], 0);
    for μ in &candidates[1..] {
        let open = best.examination.fit() != Standing::Proved && examined < EXAMINED;
        if !open || rows.changes_sign(μ) {
            let known = if open { Known::Singular } else { Known::Open };
            others.push((μ.clone(), known));
            continue;
        }
        examined += 1;
        let mut left = form(μ)?;
        if rank(&left) < rank(&best) {
            std::mem::swap(&mut left, &mut best);
        }
        let fit = left.examination.fit();
        others.push((left.form.indices, Known::Examined(fit)));
    }
    Ok((best, others))
}

/// Smaller for what is closer to a proof.
fn rank(form: &Found<Form>) -> (Standing, usize, usize) {
    let count = |test: fn(&Verdict) -> bool| {
        let checks = form.examination.checks.iter();
        checks.filter(|c| test(&c.verdict)).count()
    };
    (
        form.examination.fit(),
        count(|v| matches!(v, Verdict::Refuted(_))),
        count(|v| matches!(v, Verdict::Undecided(_))),
    )
}

/// The share of the time for the names of what is not seen.
const WORDS: f64 = 0.5;

/// What hides the state, where that is so.
///
/// # Errors
/// Only rounding hides it, or a limit ended the search for it.
pub(super) fn blind(augmented: &AugmentedPlant<'_>) -> Result<Examination, DesignError> {
    lasts(augmented)?;
    let names = |of: &[Variable]| of.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    let drift = answer(augmented, names(&augmented.inputs))?;
    if drift.is_complete() {
        return Err(DesignError::Spent(Spent::Digits));
    }
    let mut hidden = hidden(&drift);
    if hidden.is_empty() {
        lasts(augmented)?;
        return Err(DesignError::Spent(Spent::Digits));
    }
    if !augmented.inputs.is_empty() {
        hidden = self::hidden(&answer(augmented, vec![])?);
    }
    Ok(unfit(Said::Blind {
        rank: drift.rank,
        of: augmented.states.len(),
        hidden,
    }))
}

/// States that no derivative of an output tells.
fn hidden(answer: &Answer) -> Vec<String> {
    let quantities = answer.quantities.iter();
    let hidden = quantities
        .filter(|(asked, _)| asked.verdict == lynkeus_observability::Verdict::Unobservable);
    hidden.map(|(asked, _)| asked.name.clone()).collect()
}

/// What can be known of the augmented states, with these inputs at zero.
fn answer(augmented: &AugmentedPlant<'_>, zero: Vec<String>) -> Result<Answer, DesignError> {
    let question = Question {
        disturbances: zero,
        budget: augmented.graph().budget().part(WORDS),
        ..Question::default()
    };
    let answer = analyse(&plant(augmented), &question);
    // the names are the plant's own
    answer.map_err(|_| DesignError::Spent(Spent::Digits))
}

/// The augmented plant as a plant of its own: unknown inputs are states, starts are not known.
fn plant(augmented: &AugmentedPlant<'_>) -> Plant {
    let state = |state: &Variable| Variable {
        fixed: false,
        start_node: None,
        ..state.clone()
    };
    Plant {
        states: augmented.states.iter().map(state).collect(),
        derivatives: augmented.derivatives.clone(),
        inputs: augmented.inputs.clone(),
        outputs: augmented
            .outputs
            .iter()
            .map(|o| o.variable.clone())
            .collect(),
        ..augmented.plant.clone()
    }
}
