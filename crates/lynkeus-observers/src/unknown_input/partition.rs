//! The partition of the measured outputs, and every condition on the box.

use lynkeus_expr::{MissingInput, Node};
use lynkeus_structure::{Check, Condition, Extended, Layers, Region, layers, rank};

use super::NAME;
use super::blocks::{self, Shape};
use super::form::Form;
use super::settings::{Settings, wrong_size};
use crate::conditions::{fit, lipschitz, names, output_slope};
use crate::family;
use crate::stages::{Found, Searched};
use crate::{DesignError, Examination, Fit, TuningError};

/// More partitions are not tried.
const MAX_PARTITIONS: usize = 500;
/// Nor more only to advise one.
const MAX_ADVISED: usize = 20;

/// The first partition whose conditions are proved, else the first that nothing
/// refutes; else the examination that says why there is none.
pub(super) fn search<'e, 'p>(
    extended: &'e Extended<'p>,
    settings: &Settings,
    region: &Region,
) -> Searched<Form<'e, 'p>> {
    let layers = match layers::find(extended) {
        Ok(layers) => layers,
        Err(summary) => {
            return Ok(Err(Examination::unfit(NAME, summary, vec![])));
        }
    };
    let given = given(extended, &layers, settings)?;
    let shared = shared(extended, &layers, region)?;
    let candidates = match &given {
        Some(first) => vec![first.clone()],
        None => candidates(extended, &layers),
    };
    let (mut undecided, mut refuted) = (None, vec![]);
    for first in candidates {
        let form = form(extended, &layers, first);
        let own = conditions(&form, region)?;
        match fit(&own) {
            Fit::Fits => return Ok(Ok(finish(form, region, shared, own)?)),
            Fit::Undecided => {
                undecided.get_or_insert((form, own));
            }
            Fit::DoesNotFit => refuted.push((form, own)),
        }
    }
    if let Some((form, own)) = undecided {
        return Ok(Ok(finish(form, region, shared, own)?));
    }
    Ok(Err(none(extended, &layers, shared, refuted)))
}

fn form<'e, 'p>(
    extended: &'e Extended<'p>,
    layers: &Layers<'p>,
    first: Vec<usize>,
) -> Form<'e, 'p> {
    let second = (0..extended.outputs.len()).filter(|i| !first.contains(i));
    Form {
        extended,
        layers: layers.clone(),
        second: second.collect(),
        first,
    }
}

/// Sizes m ≤ m₁ < p that leave p − m₁ ≥ n₂, as (11) needs; the smallest first.
fn sizes(extended: &Extended<'_>, layers: &Layers<'_>) -> std::ops::RangeInclusive<usize> {
    let (p, n2) = (
        extended.outputs.len(),
        layers.layers.get(1).map_or(0, Vec::len),
    );
    layers.factors.columns..=p.saturating_sub(n2.max(1))
}

fn candidates(extended: &Extended<'_>, layers: &Layers<'_>) -> Vec<Vec<usize>> {
    let p = extended.outputs.len();
    let mut all = vec![];
    for size in sizes(extended, layers) {
        all.extend(rank::subsets(p, size, MAX_PARTITIONS).unwrap_or_default());
    }
    all.truncate(MAX_PARTITIONS);
    all
}

/// The outputs of x₁¹ that the study asks for.
fn given(
    extended: &Extended<'_>,
    layers: &Layers<'_>,
    settings: &Settings,
) -> Result<Option<Vec<usize>>, TuningError> {
    let Some(first) = &settings.partition else {
        return Ok(None);
    };
    let sizes = sizes(extended, layers);
    match sizes.contains(&first.len()) {
        true => Ok(Some(first.clone())),
        false => Err(wrong_size(&sizes, extended.outputs.len(), first.len())),
    }
}

/// A partition that meets (H4) and makes every block of Λ₂ square, as `partition` wants it.
pub(super) fn square(form: &Form<'_, '_>, region: &Region) -> Result<Option<String>, DesignError> {
    let extended = form.extended;
    let own = form.block(form.q().min(2)).len();
    let size = extended.outputs.len() - own;
    if form.q() < 2 || size < form.layers.factors.columns || form.shape() == Shape::Narrowing {
        return Ok(None);
    }
    let all = rank::subsets(extended.outputs.len(), size, MAX_PARTITIONS).unwrap_or_default();
    for first in all.into_iter().take(MAX_ADVISED) {
        let candidate = self::form(extended, &form.layers, first);
        if fit(&conditions(&candidate, region)?) == Fit::Fits {
            let name = |&i: &usize| format!("\"{}\"", extended.outputs[i].variable.name);
            let outputs: Vec<String> = candidate.first.iter().map(name).collect();
            return Ok(Some(outputs.join(", ")));
        }
    }
    Ok(None)
}

/// (H1), (H2) and what belongs to no partition.
fn shared(
    extended: &Extended<'_>,
    layers: &Layers<'_>,
    region: &Region,
) -> Result<Vec<Check>, DesignError> {
    let graph = extended.graph();
    let mut checks = vec![];
    for i in 0..extended.outputs.len() {
        checks.extend(output_slope(extended, i, region)?);
    }
    for (k, pair) in layers.layers.windows(2).enumerate() {
        let f: Vec<Node> = pair[0].iter().map(|&i| layers.drift[i]).collect();
        let x: Vec<Node> = pair[1].iter().map(|&i| extended.states[i].node).collect();
        let jacobian = lynkeus_structure::Matrix::jacobian(graph, &f, &x);
        let (this, next) = (superscript(k + 1), superscript(k + 2));
        let name = format!("(H1) rank ∂f{this}/∂x{next} = {}", x.len());
        checks.push(rank::full_column_rank(name, &jacobian, region)?);
        let name = format!("(H2) x{next} ↦ f{this} is one to one");
        checks.push(rank::one_to_one(graph, name, &f, &x, region)?);
    }
    checks.push(lipschitz(extended, region)?);
    Ok(checks)
}

fn superscript(k: usize) -> String {
    let digit = |c: char| match c {
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    k.to_string().chars().map(digit).collect()
}

/// (H4) for one partition. The first refuted condition ends it.
fn conditions(form: &Form<'_, '_>, region: &Region) -> Result<Vec<Check>, DesignError> {
    let m = form.layers.factors.columns;
    let name = format!("(H4) (i) rank G₁¹ = {m}");
    let i = rank::full_column_rank(name, &form.G11(), region)?;
    if form.q() == 1 || matches!(i.verdict, Condition::Refuted(_)) {
        return Ok(vec![i]);
    }
    let n2 = form.block(2).len();
    let name = format!("(11) rank ∂f̄₁²/∂x² = {n2}");
    let eleven = rank::full_column_rank(name, &form.eleven(), region)?;
    if matches!(eleven.verdict, Condition::Refuted(_)) {
        return Ok(vec![i, eleven]);
    }
    let name = format!("(H4) (ii) rank (∂f̃¹/∂x² G¹) = {}", n2 + m);
    let proved = [&i, &eleven].iter().all(|c| c.verdict == Condition::Proved);
    let ii = match proved {
        true => Check {
            name,
            verdict: Condition::Proved,
            detail: "follows from (i) and (11)".into(),
        },
        false => rank::full_column_rank(name, &form.ii(), region)?,
    };
    let mut checks = vec![i, eleven, ii];
    checks.extend(blocks::shortened(form));
    Ok(checks)
}

fn finish<'e, 'p>(
    form: Form<'e, 'p>,
    region: &Region,
    shared: Vec<Check>,
    own: Vec<Check>,
) -> Result<Found<Form<'e, 'p>>, MissingInput> {
    let extended = form.extended;
    let checks = [shared, own].concat();
    let mut chains = vec![names(extended, &form.x11())];
    chains.extend((1..=form.q()).map(|k| names(extended, &form.block(k))));
    let unknown: Vec<usize> = (extended.plant_states()..extended.states.len()).collect();
    let summary = format!(
        "layers {}; the unknown {} read from x₁¹ = ({}), the rest from x₂¹ = ({})",
        form.layers.describe(extended),
        names(extended, &unknown).join(", "),
        chains[0].join(", "),
        chains[1].join(", ")
    );
    let found = family::Form { summary, chains };
    let examination = Examination::new(extended, region, NAME, found, checks)?;
    Ok(Found { form, examination })
}

/// No partition: the conditions of the one that went furthest.
fn none(
    extended: &Extended<'_>,
    layers: &Layers<'_>,
    shared: Vec<Check>,
    refuted: Vec<(Form<'_, '_>, Vec<Check>)>,
) -> Examination {
    let count = refuted.len();
    let furthest = refuted.into_iter().rev().max_by_key(|(_, own)| own.len());
    let mut summary = format!("layers {}", layers.describe(extended));
    let own = match furthest {
        Some((form, own)) => {
            let which = match count {
                1 => "the partition".to_owned(),
                _ => format!(
                    "none of {count} partitions of the measured outputs meets (H4); the closest,"
                ),
            };
            summary += &format!(
                "; {which} x₁¹ = ({}) fails {}",
                names(extended, &form.x11()).join(", "),
                own.last().map_or("", |check| check.name.as_str())
            );
            own
        }
        None => {
            summary += "; there are too many measured outputs to try every partition, give the key 'partition'";
            vec![]
        }
    };
    Examination::unfit(NAME, summary, [shared, own].concat())
}
