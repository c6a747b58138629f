//! The partition of the measured outputs, and every condition on the box.

use crate::statement::{Statement, standing};
use crate::{Check, Farza};
use lynkeus_expr::{MissingInput, Node};
use lynkeus_structure::{Extended, Layers, Region, layers, rank};
use lynkeus_structure::{Finding, Standing};

use super::NAME;
use super::blocks::{self, Shape};
use super::form::Form;
use super::settings::{Settings, wrong_size};
use crate::conditions::{lipschitz, names, output_slope};
use crate::family;
use crate::stages::{Found, Searched};
use crate::{DesignError, Examination, TuningError};

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
        match standing(&own) {
            Standing::Proved => return Ok(Ok(finish(form, region, shared, own)?)),
            Standing::Undecided => {
                undecided.get_or_insert((form, own));
            }
            Standing::Refuted => refuted.push((form, own)),
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
        if standing(&conditions(&candidate, region)?) == Standing::Proved {
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
        let (layer, rank) = (k + 1, x.len());
        let h1 = Statement::from(Farza::H1 { layer, rank });
        checks.push(h1.with(rank::full_column_rank(&jacobian, region)?));
        let h2 = Statement::from(Farza::H2 { layer });
        checks.push(h2.with(rank::one_to_one(graph, &f, &x, region)?));
    }
    checks.push(lipschitz(extended, region)?);
    Ok(checks)
}

/// (H4) for one partition. The first refuted condition ends it.
fn conditions(form: &Form<'_, '_>, region: &Region) -> Result<Vec<Check>, DesignError> {
    let m = form.layers.factors.columns;
    let found = rank::full_column_rank(&form.G11(), region)?;
    let i = Statement::from(Farza::H4i { rank: m }).with(found);
    if form.q() == 1 || i.standing() == Standing::Refuted {
        return Ok(vec![i]);
    }
    let n2 = form.block(2).len();
    let found = rank::full_column_rank(&form.eleven(), region)?;
    let eleven = Statement::from(Farza::Eleven { rank: n2 }).with(found);
    if eleven.standing() == Standing::Refuted {
        return Ok(vec![i, eleven]);
    }
    let ii = match standing([&i, &eleven]) {
        Standing::Proved => Finding::proved("follows from (i) and (11)"),
        _ => rank::full_column_rank(&form.ii(), region)?,
    };
    let ii = Statement::from(Farza::H4ii { rank: n2 + m }).with(ii);
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
    let fails = |check: &Check| check.standing() == Standing::Refuted;
    let met = |own: &[Check]| own.iter().take_while(|check| !fails(check)).count();
    let furthest = refuted.into_iter().rev().max_by_key(|(_, own)| met(own));
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
                own.iter()
                    .find(|check| fails(check))
                    .map_or(String::new(), |c| c.statement.to_string())
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
