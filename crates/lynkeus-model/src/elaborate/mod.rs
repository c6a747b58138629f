//! A syntax tree written out as a plant: names get sizes and values, loops and arrays become
//! scalar equations, and these are solved for the derivatives and the algebraic variables.

mod arithmetic;
mod arrays;
mod assemble;
mod calls;
mod clauses;
mod declare;
mod delay;
mod delayed;
mod evaluate;
mod events;
mod execute;
mod flatten;
mod functions;
mod scope;
mod symbols;
mod tables;
mod value;

use std::collections::HashSet;

use lynkeus_expr::{Graph, Spent};

use crate::diagnostic::{Problem, Result, Span};
use crate::flat::{Classes, FlatModel, flat_model, title};
use crate::names::choose;
use crate::syntax::ast::{Ast, Class, ClassKind};
use crate::syntax::parse_file;
use crate::{LoadOptions, Plant};
use scope::Mode;
use symbols::{Names, Symbols};

pub use delayed::{DELAY_STATES, MAX_DELAY_STATES};
pub(crate) use evaluate::Evaluator;

/// The plant of a Modelica text, with what looks wrong in it.
pub(crate) fn plant(source: &str, options: &LoadOptions) -> Result<(Plant, Vec<Problem>)> {
    let (mut ast, classes) = parse_file(source)?;
    let class = choose_model(&classes, options)?;
    let classes = Classes::new(source, &classes);
    let model = flat_model(source, &mut ast, &classes, class)?;
    let (ast, model) = (&ast, &model);
    let graph = Graph::new();
    graph.set_budget(options.budget.clone());
    let done = graph.budgeted(options.budget.clone(), || {
        let symbols = Symbols::new(source, ast, &graph, model, &classes, options).declared()?;
        let flat = flatten::flatten(&symbols)?;
        assemble::plant(&symbols, flat)
    });
    let (plant, mut warnings) = done.map_err(|spent| ended(model, spent))??;
    warnings.extend(crate::units::check(source, ast, model));
    Ok((Plant { graph, ..plant }, warnings))
}

/// Evaluates expressions of a text that stand by themselves; `names` gives the meaning of names.
pub(crate) fn evaluated<T>(
    source: &str,
    ast: &Ast,
    graph: &Graph,
    names: Names<'_>,
    run: impl FnOnce(&mut Evaluator<'_>) -> Result<T>,
) -> Result<T> {
    let (model, classes) = (FlatModel::default(), Classes::default());
    let options = LoadOptions::default();
    let mut symbols = Symbols::new(source, ast, graph, &model, &classes, &options);
    symbols.given = Some(names);
    run(&mut Evaluator::new(&symbols, Mode::Continuous))
}

/// A limit ended the reading.
fn ended(model: &FlatModel, spent: Spent) -> Problem {
    Problem::new(model.name, format!("the model was not read: {spent}"))
}

/// The model that is asked for, or the only one.
fn choose_model<'a>(classes: &'a [Class], options: &LoadOptions) -> Result<&'a Class> {
    let none = || {
        Problem::new(Span::default(), "the text holds no model")
            .hint("a model reads `model Name … equation … end Name;`")
    };
    let models: Vec<&Class> = models(classes).collect();
    let names = models.iter().map(|class| (title(&class.path), class.name));
    let names: Vec<(&str, Span)> = names.collect();
    let wanted = options.model.as_deref().map(|wanted| {
        // the last part of a name is enough where it says which
        let is_exact = names.iter().any(|(name, _)| *name == wanted);
        let names = names.iter().map(|(name, _)| *name);
        let mut ends = names.filter(|name| name.rsplit('.').next() == Some(wanted));
        match (ends.next(), ends.next()) {
            (Some(name), None) if !is_exact => name,
            _ => wanted,
        }
    });
    let place = choose(&names, wanted, none)?;
    models.get(place).copied().ok_or_else(none)
}

/// The classes that may be a plant.
fn models(classes: &[Class]) -> impl Iterator<Item = &Class> {
    let is_model = |class: &&Class| class.kind == ClassKind::Model;
    let paths = classes.iter().filter(is_model);
    let paths: HashSet<&str> = paths.map(|class| class.path.as_str()).collect();
    // a class inside of a model is a part of it
    let is_inside = move |class: &Class| {
        let around = class.path.rsplit_once('.');
        around.is_some_and(|(above, _)| paths.contains(above))
    };
    let classes = classes.iter().filter(is_model);
    classes.filter(move |class| !class.is_partial && !is_inside(class))
}

/// The names of the models of a Modelica text.
pub(crate) fn names(source: &str) -> Result<Vec<String>> {
    let (_, classes) = parse_file(source)?;
    let name = |class: &Class| title(&class.path).to_owned();
    Ok(models(&classes).map(name).collect())
}
