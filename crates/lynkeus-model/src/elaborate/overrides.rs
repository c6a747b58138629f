//! Parameter values that the caller gives instead of those in the text.

use std::collections::HashMap;

use super::symbols::Context;
use super::value::describe_dims;
use crate::flat::FlatModel;
use crate::names::did_you_mean;
use crate::syntax::ast::{Declaration, Variability};
use crate::syntax::{Problem, Result, Span};

/// Values by declaration.
pub(super) struct Overrides {
    by_place: HashMap<usize, Vec<Override>>,
}

struct Override {
    subscripts: Vec<usize>,
    value: f64,
}

impl Overrides {
    pub(super) fn new(context: &Context<'_>, by_name: &HashMap<&str, usize>) -> Result<Self> {
        let model = context.model;
        let mut by_place: HashMap<usize, Vec<Override>> = HashMap::new();
        for (key, &value) in &context.options.parameters {
            let (name, subscripts) = split(key).ok_or_else(|| {
                Problem::new(
                    model.name,
                    format!("`{key}` is not the name of a parameter"),
                )
                .hint("names of parameters read `k`, `H[3]` or `A[1,2]`")
            })?;
            // an element may be declared by itself: `x[3]`
            let (name, subscripts) = match by_name.contains_key(key.trim()) {
                true => (key.trim(), vec![]),
                false => (name, subscripts),
            };
            let Some((&place, declaration)) = by_name
                .get(name)
                .and_then(|place| Some((place, model.declarations.get(*place)?)))
            else {
                return Err(unknown(model, name));
            };
            check_settable(name, declaration)?;
            if !value.is_finite() {
                let message = format!("parameter `{key}` is given the value {value}");
                return Err(Problem::new(declaration.name, message).hint("give a finite number"));
            }
            by_place
                .entry(place)
                .or_default()
                .push(Override { subscripts, value });
        }
        Ok(Self { by_place })
    }

    /// The values given to a declaration, by offset of its elements.
    pub(super) fn of(
        &self,
        place: usize,
        name: &str,
        dims: &[usize],
        span: Span,
    ) -> Result<Vec<(usize, f64)>> {
        let given = self.by_place.get(&place).map_or(&[][..], Vec::as_slice);
        let offset = |given: &Override| {
            let offset = offset(&given.subscripts, dims).ok_or_else(|| {
                let size = describe_dims(dims);
                let subscripts = describe_dims(&given.subscripts);
                let message = format!(
                    "a value is given for `{name}` {subscripts}, which has the size {size}"
                );
                Problem::new(span, message)
                    .hint("give values to elements, such as `H[3]`, with subscripts from 1")
            })?;
            Ok((offset, given.value))
        };
        given.iter().map(offset).collect()
    }
}

fn check_settable(name: &str, declaration: &Declaration) -> Result<()> {
    let prefix = &declaration.prefix;
    let what = match prefix.variability {
        Variability::Parameter if prefix.is_final => "a final parameter",
        Variability::Parameter => return Ok(()),
        Variability::Constant => "a constant",
        Variability::Continuous => "a variable",
    };
    let message = format!("`{name}` is {what}; its value cannot be set from outside");
    Err(Problem::new(declaration.name, message).hint("only parameters can be set"))
}

fn unknown(model: &FlatModel, name: &str) -> Problem {
    let settable = model.declarations.iter().filter(|declaration| {
        let prefix = &declaration.prefix;
        prefix.variability == Variability::Parameter && !prefix.is_final
    });
    let names: Vec<&str> = settable
        .map(|declaration| declaration.label.as_str())
        .collect();
    let model_name = &model.title;
    let hint = did_you_mean(name, names.iter().copied()).or_else(|| {
        let listed: Vec<&str> = names.iter().copied().take(12).collect();
        let more = if names.len() > 12 { ", …" } else { "" };
        let some = format!("its parameters are {}{more}", listed.join(", "));
        Some(if names.is_empty() {
            "it has no parameters".to_owned()
        } else {
            some
        })
    });
    let message = format!("model `{model_name}` has no parameter `{name}`");
    Problem::new(model.name, message).maybe_hint(hint)
}

/// `H[3]` as `H` and 3.
fn split(key: &str) -> Option<(&str, Vec<usize>)> {
    let key = key.trim();
    let Some((name, rest)) = key.split_once('[') else {
        return Some((key, vec![]));
    };
    let inside = rest.strip_suffix(']')?;
    let subscripts = inside
        .split(',')
        .map(|subscript| subscript.trim().parse().ok());
    Some((name.trim(), subscripts.collect::<Option<Vec<usize>>>()?))
}

fn offset(subscripts: &[usize], dims: &[usize]) -> Option<usize> {
    if subscripts.len() != dims.len() {
        return None;
    }
    subscripts
        .iter()
        .zip(dims)
        .try_fold(0usize, |offset, (&subscript, &dim)| {
            let place = subscript.checked_sub(1).filter(|place| *place < dim)?;
            Some(offset * dim + place)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_names() {
        assert_eq!(split("H[3]"), Some(("H", vec![3])));
        assert_eq!(split(" A[1, 2]"), Some(("A", vec![1, 2])));
        assert_eq!(split("k"), Some(("k", vec![])));
        assert_eq!(split("H[3"), None);
        assert_eq!(split("H[-1]"), None);
    }

    #[test]
    fn offsets() {
        assert_eq!(offset(&[2, 3], &[2, 3]), Some(5));
        assert_eq!(offset(&[0], &[3]), None);
        assert_eq!(offset(&[4], &[3]), None);
        assert_eq!(offset(&[], &[3]), None);
    }
}
