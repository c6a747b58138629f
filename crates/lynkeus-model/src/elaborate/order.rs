//! The order in which declarations can be given their sizes and values.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use super::symbols::Context;
use crate::flat::{FlatModel, constant_label};
use crate::syntax::ast::{Declaration, ExprId, Kind, Variability};
use crate::syntax::{Problem, Result, plain};

/// What the declarations need of each other.
pub(super) struct Order {
    /// every declaration once, each behind those it needs
    pub sequence: Vec<usize>,
    /// true where the value of a parameter is made from other parameters of type Real
    pub dependent: Vec<bool>,
}

pub(super) fn order(context: &Context<'_>, by_name: &HashMap<&str, usize>) -> Result<Order> {
    let declarations = &context.model.declarations;
    let needs: Vec<Vec<usize>> = declarations
        .iter()
        .map(|declaration| needs(context, declaration, by_name))
        .collect();
    let sequence = sort(declarations, &needs)?;
    let mut dependent = vec![false; declarations.len()];
    for &place in &sequence {
        let depends = |&need: &usize| {
            let prefix = &declarations[need].prefix;
            let settable = prefix.variability == Variability::Parameter && !prefix.is_final;
            dependent[need] || (settable && !prefix.is_integer())
        };
        dependent[place] = needs[place].iter().any(depends);
    }
    Ok(Order {
        sequence,
        dependent,
    })
}

/// Declarations whose size or value this one reads.
fn needs(
    context: &Context<'_>,
    declaration: &Declaration,
    by_name: &HashMap<&str, usize>,
) -> Vec<usize> {
    let is_known = declaration.prefix.variability != Variability::Continuous;
    let binding = declaration.binding.filter(|_| is_known);
    let own: Vec<&str> = context.model.scopes.iter().map(String::as_str).collect();
    let package = declaration.package.as_deref();
    let scopes = package.map_or(own, |package| vec![package]);
    let mut found = vec![];
    for root in declaration.dimensions.iter().copied().chain(binding) {
        for name in names(context, by_name, root) {
            let before = found.len();
            if package.is_none() {
                named(context.model, by_name, &name, &mut found);
            }
            if found.len() > before {
                continue;
            }
            let full = context.classes.full_names(&name, &scopes);
            let mut constants = full.iter().map(|full| constant_label(full));
            while found.len() == before
                && let Some(label) = constants.next()
            {
                named(context.model, by_name, &label, &mut found);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// The names in an expression: `p[2]` where that is declared by itself, and not `p`.
fn names<'a>(
    context: &Context<'a>,
    by_name: &HashMap<&str, usize>,
    root: ExprId,
) -> Vec<Cow<'a, str>> {
    let text = |id: ExprId| plain(context.ast.expression(id).span.text(context.source));
    let mut elements = HashSet::new();
    for id in context.ast.ids(root) {
        if let Kind::Index(base, _) = context.ast.expression(id).kind
            && by_name.contains_key(&*text(id))
        {
            elements.insert(base);
            elements.insert(id);
        }
    }
    let is_name = |id: &ExprId| match context.ast.expression(*id).kind {
        Kind::Name | Kind::Path(_) => !elements.contains(id),
        _ => elements.contains(id),
    };
    context.ast.ids(root).filter(is_name).map(text).collect()
}

fn named(model: &FlatModel, by_name: &HashMap<&str, usize>, name: &str, found: &mut Vec<usize>) {
    match by_name.get(name) {
        Some(&place) => found.push(place),
        None => members(model, by_name, name, found),
    }
}

/// Declarations of the members of a record, and of elements that are declared by themselves.
fn members(model: &FlatModel, by_name: &HashMap<&str, usize>, name: &str, found: &mut Vec<usize>) {
    let base = name.split('[').next().unwrap_or_default();
    for element in 1.. {
        let Some(&place) = by_name.get(format!("{base}[{element}]").as_str()) else {
            break;
        };
        found.push(place);
    }
    for member in model.records.get(base).into_iter().flatten() {
        let full = format!("{base}.{member}");
        named(model, by_name, &full, found);
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Mark {
    New,
    Open,
    Done,
}

/// Depth-first, without recursion: a chain of parameters may be as long as the file.
fn sort(declarations: &[Declaration], needs: &[Vec<usize>]) -> Result<Vec<usize>> {
    let mut marks = vec![Mark::New; needs.len()];
    let mut sequence = Vec::with_capacity(needs.len());
    let mut path: Vec<(usize, usize)> = vec![];
    for root in 0..needs.len() {
        if marks[root] != Mark::New {
            continue;
        }
        marks[root] = Mark::Open;
        path.push((root, 0));
        while let Some((place, next)) = path.last_mut() {
            let Some(&need) = needs[*place].get(*next) else {
                marks[*place] = Mark::Done;
                sequence.push(*place);
                path.pop();
                continue;
            };
            *next += 1;
            match marks[need] {
                Mark::Done => {}
                Mark::Open => return Err(cycle(declarations, &path, need)),
                Mark::New => {
                    marks[need] = Mark::Open;
                    path.push((need, 0));
                }
            }
        }
    }
    Ok(sequence)
}

fn cycle(declarations: &[Declaration], path: &[(usize, usize)], closing: usize) -> Problem {
    let name = |place: usize| declarations[place].label.as_str();
    let start = path
        .iter()
        .position(|(place, _)| *place == closing)
        .unwrap_or(0);
    let cycle = &path[start..];
    let mut names: Vec<String> = cycle
        .iter()
        .take(8)
        .map(|(place, _)| format!("`{}`", name(*place)))
        .collect();
    if cycle.len() > 8 {
        names.push(format!("… {} more …", cycle.len() - 8));
    }
    names.push(format!("`{}`", name(closing)));
    let message = format!("these declarations need each other: {}", names.join(" → "));
    Problem::new(declarations[closing].name, message).hint("give one of them a number")
}
