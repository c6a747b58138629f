//! Declarations to symbols: in which order they can be given sizes and values, and which.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

use super::scope::{Context, Mode};
use super::symbols::{Component, Symbols, gathered, is_outer_input};
use super::value::{
    Array, Scalar, check_size, describe_dims, element_count, element_name, expected_number,
};
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::{FlatModel, constant_label};
use crate::limits::{Budget, MAX_SCALARS, MAX_TEXT};
use crate::names::{did_you_mean, listed};
use crate::syntax::ast::{Causality, Declaration, ExprId, Kind, TypeName, Variability};
use crate::syntax::plain;

impl<'a> Symbols<'a> {
    /// The declarations of a model, each behind those that its size or value needs.
    pub(crate) fn new(context: &Context<'a>) -> Result<Self> {
        let model = context.model;
        let by_name = index_names(context.source, &model.declarations)?;
        let declarations = &model.declarations;
        let needs = declarations.iter().map(|d| needs(context, d, &by_name));
        let needs: Vec<Vec<usize>> = needs.collect();
        let sequence = sort(declarations, &needs)?;
        let dependent = dependent(declarations, &needs, &sequence);
        let overrides = overrides(context, &by_name)?;
        let mut symbols = Self {
            declarations,
            by_name,
            components: model.declarations.iter().map(|_| None).collect(),
            gathered: HashMap::new(),
            parameters: HashSet::new(),
            model,
            derivatives: RefCell::default(),
            time: context.graph.symbol("time").node(),
            graph: context.graph,
            dependent,
        };
        let sizes = Sizes::new();
        for place in sequence {
            let component = symbols.component(context, &overrides, &sizes, place);
            if component.is_err() && model.possible.contains(&model.declarations[place].label) {
                continue;
            }
            let component = component?;
            if component.is_known {
                let elements = component
                    .elements
                    .iter()
                    .filter_map(|e| e.real(context.graph));
                symbols.parameters.extend(elements);
            }
            if let Some(slot) = symbols.components.get_mut(place) {
                *slot = Some(component);
            }
        }
        symbols.gathered = gathered(&symbols.by_name, &symbols.components);
        Ok(symbols)
    }

    fn component(
        &self,
        context: &Context<'a>,
        overrides: &HashMap<usize, Vec<Override>>,
        sizes: &Sizes,
        place: usize,
    ) -> Result<Component> {
        let declaration = &self.declarations[place];
        let name = declaration.label.as_str();
        if declaration.variability != Variability::Continuous {
            return self.parameter(context, overrides, sizes, place);
        }
        let dims = self.dims(context, declaration)?.into_iter();
        let dims: Option<Vec<usize>> = dims.collect();
        let dims = dims.ok_or_else(|| {
            Problem::new(
                declaration.name,
                format!("the size of variable `{name}` must be given"),
            )
            .hint("write a number or a parameter instead of `:`")
        })?;
        sizes.charge(context, &dims, declaration)?;
        let count: usize = dims.iter().product();
        let is_boolean = declaration.type_name == TypeName::Boolean;
        if is_boolean && declaration.causality == Causality::Input {
            let problem = Problem::new(declaration.name, "a Boolean input is not supported");
            return Err(problem.hint("use a Real and compare it, as in `if u > 0.5 then …`"));
        }
        let may_have_derivative =
            declaration.type_name == TypeName::Real && !is_outer_input(declaration);
        let mut derivatives = self.derivatives.borrow_mut();
        let symbol = |offset: usize| {
            let symbol = self.graph.symbol(&element_name(name, &dims, offset)).node();
            if may_have_derivative {
                derivatives.insert(symbol, None);
            }
            match is_boolean {
                true => Scalar::Boolean(symbol),
                false => Scalar::Real(symbol),
            }
        };
        let elements = (0..count).map(symbol).collect();
        Ok(Component {
            dims,
            elements,
            values: None,
            is_known: false,
        })
    }

    /// Sizes as declared; `None` for `:`.
    fn dims(&self, context: &Context<'a>, declaration: &Declaration) -> Result<Vec<Option<usize>>> {
        let mut evaluator = self.evaluator_of(context, declaration, Mode::Structural);
        let length = |&id| match context.ast.expression(id).kind {
            Kind::All => Ok(None),
            _ => evaluator.length(id).map(Some),
        };
        declaration.dimensions.iter().map(length).collect()
    }
}

fn index_names<'a>(
    source: &'a str,
    declarations: &'a [Declaration],
) -> Result<HashMap<&'a str, usize>> {
    let mut by_name: HashMap<&str, usize> = HashMap::with_capacity(declarations.len());
    for (place, declaration) in declarations.iter().enumerate() {
        let name = declaration.label.as_str();
        if name == "time" {
            let message = format!("`{name}` is a word of the language");
            return Err(Problem::new(declaration.name, message).hint("choose another name"));
        }
        if let Some(earlier) = by_name.insert(name, place) {
            let line = declarations[earlier].name.line(source);
            let message = format!("`{name}` is declared twice");
            return Err(Problem::new(declaration.name, message)
                .hint(format!("it is first declared on line {line}")));
        }
    }
    for declaration in declarations {
        // an element by itself beside the whole array would be two variables of one name
        let base = declaration
            .label
            .strip_suffix(']')
            .and_then(|name| name.rsplit_once('['));
        if let Some((base, _)) = base
            && let Some(&whole) = by_name.get(base)
        {
            let message = format!("`{}` is declared twice", declaration.label);
            let line = declarations[whole].name.line(source);
            return Err(Problem::new(declaration.name, message)
                .hint(format!("`{base}` is declared as a whole on line {line}")));
        }
    }
    Ok(by_name)
}

/// Budgets of what declarations are written out to.
struct Sizes {
    scalars: Budget,
    text: Budget,
}

impl Sizes {
    fn new() -> Self {
        Self {
            scalars: Budget::new(MAX_SCALARS, "scalar variables and parameters"),
            text: Budget::new(MAX_TEXT, "bytes of names, units and descriptions"),
        }
    }

    fn charge(
        &self,
        context: &Context<'_>,
        dims: &[usize],
        declaration: &Declaration,
    ) -> Result<()> {
        // A size beside a size of zero counts as well: slices walk along it.
        let walked: Vec<usize> = dims.iter().map(|&dim| dim.max(1)).collect();
        let count = element_count(&walked).unwrap_or(u64::MAX);
        self.scalars.charge(count, declaration.name)?;
        let description = declaration.description.as_ref().map_or(0, String::len);
        let is_text = |id| matches!(context.ast.expression(id).kind, Kind::Text);
        let texts = declaration
            .attributes
            .iter()
            .filter_map(|attribute| attribute.value);
        let texts = texts
            .filter(|&id| is_text(id))
            .map(|id| context.ast.expression(id).span);
        let length: u64 = texts
            .chain([declaration.name])
            .map(|span| u64::from(span.end.saturating_sub(span.start)))
            .sum();
        let each = length.saturating_add(description as u64);
        self.text
            .charge(count.saturating_mul(each), declaration.name)
    }
}

/// Of each declaration: true where the value of a parameter is made from other parameters of type
/// Real. `needs`: places of the declarations that each one reads; `sequence`: each behind these.
fn dependent(declarations: &[Declaration], needs: &[Vec<usize>], sequence: &[usize]) -> Vec<bool> {
    let mut dependent = vec![false; declarations.len()];
    for &place in sequence {
        let depends = |&need: &usize| {
            let needed = &declarations[need];
            dependent[need] || (needed.is_settable() && !needed.is_integer())
        };
        dependent[place] = needs[place].iter().any(depends);
    }
    dependent
}

/// Declarations whose size or value this one reads.
fn needs(
    context: &Context<'_>,
    declaration: &Declaration,
    by_name: &HashMap<&str, usize>,
) -> Vec<usize> {
    let is_known = declaration.variability != Variability::Continuous;
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

fn cycle(declarations: &[Declaration], path: &[(usize, usize)], closing: usize) -> Box<Problem> {
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

impl<'a> Symbols<'a> {
    /// A parameter: its value as sizes see it and its symbols as equations see it.
    fn parameter(
        &self,
        context: &Context<'a>,
        overrides: &HashMap<usize, Vec<Override>>,
        sizes: &Sizes,
        place: usize,
    ) -> Result<Component> {
        let (declaration, dependent) = (&self.declarations[place], self.dependent[place]);
        let label = declaration.label.as_str();
        let name = label.strip_prefix('.').unwrap_or(label);
        if declaration.causality == Causality::Input {
            let message = format!("`{name}` is both a parameter and an input");
            return Err(Problem::new(declaration.name, message).hint("choose one of the two"));
        }
        let keeps_symbols = context.options.symbolic_parameters
            && declaration.is_settable()
            && declaration.type_name == TypeName::Real;
        let known = self.binding(context, declaration, Mode::Structural)?;
        let dims = self.parameter_dims(context, declaration, known.as_ref())?;
        sizes.charge(context, &dims, declaration)?;
        let given = overrides.get(&place).map_or(&[][..], Vec::as_slice);
        let given = by_offset(given, name, &dims, declaration.name)?;
        let parts = Parts {
            context,
            declaration,
            name,
            dims: &dims,
            given: &given,
        };
        let values = parts.values(known)?;
        if !context.options.symbolic_parameters {
            let values = values.ok_or_else(|| parts.no_value())?;
            let elements = values.clone();
            return Ok(Component {
                dims,
                elements,
                values: Some(values),
                is_known: true,
            });
        }
        let elements = match (dependent, &values) {
            (true, _) => {
                let symbolic = self.binding(context, declaration, Mode::Parametric)?;
                parts.symbolic(symbolic)?
            }
            (false, Some(values)) if keeps_symbols => parts.symbols_but(values),
            (false, None) if keeps_symbols => parts.symbols(),
            (false, Some(values)) => values.clone(),
            (false, None) if declaration.variability == Variability::Parameter => parts.symbols(),
            (false, None) => return Err(parts.no_value()),
        };
        Ok(Component {
            dims,
            elements,
            values,
            is_known: true,
        })
    }

    /// The value of the declaration equation; `None` if there is none, or if it needs a
    /// parameter without value where these are allowed.
    fn binding(
        &self,
        context: &Context<'a>,
        declaration: &Declaration,
        mode: Mode,
    ) -> Result<Option<(Array, ExprId)>> {
        let Some(id) = declaration.binding else {
            return Ok(None);
        };
        let mut evaluator = self.evaluator_of(context, declaration, mode);
        match evaluator.value(id) {
            Ok(value) => Ok(Some((value.into_array(), id))),
            Err(_) if evaluator.valueless && context.options.symbolic_parameters => Ok(None),
            Err(problem) => Err(problem),
        }
    }

    /// The declared size, with `:` taken from the value.
    fn parameter_dims(
        &self,
        context: &Context<'a>,
        declaration: &Declaration,
        value: Option<&(Array, ExprId)>,
    ) -> Result<Vec<usize>> {
        let declared = self.dims(context, declaration)?;
        let found = value.map(|(array, _)| array.dims.as_slice());
        let open = |axis: usize| {
            found
                .and_then(|dims| dims.get(axis))
                .copied()
                .ok_or_else(|| {
                    let message = "the size `:` needs a value to be taken from";
                    Problem::new(declaration.name, message)
                })
        };
        let sizes = declared.into_iter().enumerate();
        sizes
            .map(|(axis, size)| size.map_or_else(|| open(axis), Ok))
            .collect()
    }
}

/// One declaration with what is known about it.
struct Parts<'p> {
    context: &'p Context<'p>,
    declaration: &'p Declaration,
    name: &'p str,
    dims: &'p [usize],
    given: &'p [(usize, f64)],
}

impl Parts<'_> {
    /// Known values of all elements; `None` where some have none.
    fn values(&self, binding: Option<(Array, ExprId)>) -> Result<Option<Vec<Scalar>>> {
        let count: usize = self.dims.iter().product();
        let mut values = vec![None; count];
        if let Some((array, id)) = binding {
            self.check_size(&array, id)?;
            let span = self.context.ast.expression(id).span;
            for (slot, element) in values.iter_mut().zip(array.elements) {
                *slot = Some(self.known(element, span)?);
            }
        }
        for &(offset, value) in self.given {
            let value = self.converted(value)?;
            if let Some(slot) = values.get_mut(offset) {
                *slot = Some(value);
            }
        }
        Ok(values.into_iter().collect())
    }

    /// Expressions over other parameters, but for elements set from outside.
    fn symbolic(&self, binding: Option<(Array, ExprId)>) -> Result<Vec<Scalar>> {
        let Some((array, id)) = binding else {
            return Ok(self.symbols());
        };
        self.check_size(&array, id)?;
        let span = self.context.ast.expression(id).span;
        let graph = self.context.graph;
        let is_boolean = self.declaration.type_name == TypeName::Boolean;
        let typed = |element: Scalar| {
            if is_boolean {
                return match element {
                    Scalar::Boolean(_) => Ok(element),
                    _ => Err(Problem::new(span, "expected `true` or `false`")),
                };
            }
            let node = element.real(graph).ok_or_else(|| expected_number(span))?;
            Ok(Scalar::Real(node))
        };
        let mut elements: Vec<Scalar> = array
            .elements
            .into_iter()
            .map(typed)
            .collect::<Result<_>>()?;
        for &(offset, value) in self.given {
            if let Some(slot) = elements.get_mut(offset) {
                *slot = match is_boolean {
                    true => self.converted(value)?,
                    false => Scalar::Real(graph.constant(value).node()),
                };
            }
        }
        Ok(elements)
    }

    fn symbols(&self) -> Vec<Scalar> {
        let count: usize = self.dims.iter().product();
        let graph = self.context.graph;
        let symbol = |offset| {
            graph
                .symbol(&element_name(self.name, self.dims, offset))
                .node()
        };
        (0..count)
            .map(|offset| Scalar::Real(symbol(offset)))
            .collect()
    }

    /// Symbols, but for elements that are to be numbers.
    fn symbols_but(&self, values: &[Scalar]) -> Vec<Scalar> {
        let numbers = &self.context.options.numbers;
        let mut elements = self.symbols();
        for (offset, (element, value)) in elements.iter_mut().zip(values).enumerate() {
            if numbers.contains(&element_name(self.name, self.dims, offset)) {
                *element = *value;
            }
        }
        elements
    }

    fn check_size(&self, array: &Array, id: ExprId) -> Result<()> {
        let span = self.context.ast.expression(id).span;
        let checked = check_size(self.name, self.dims, &array.dims, span);
        checked.map_err(|problem| match array.dims.is_empty() {
            true => problem.hint("use `fill(value, size)`"),
            false => problem,
        })
    }

    /// A value of the declared type.
    fn known(&self, element: Scalar, span: Span) -> Result<Scalar> {
        let graph = self.context.graph;
        if self.declaration.type_name == TypeName::Boolean {
            return match element {
                Scalar::Boolean(node) if graph.constant_value(node).is_some() => Ok(element),
                _ => Err(Problem::new(span, "expected `true` or `false`")),
            };
        }
        let node = element.real(graph).ok_or_else(|| expected_number(span))?;
        match (element, self.declaration.is_integer()) {
            (Scalar::Integer(_), true) => Ok(element),
            (_, true) => {
                let message = format!("`{}` is an Integer, its value is a Real", self.name);
                Err(Problem::new(span, message).hint("use `div(a, b)` or `integer(a)`"))
            }
            _ if graph.constant_value(node).is_some() => Ok(Scalar::Real(node)),
            _ => {
                let message = format!("the value of `{}` is not a finite number", self.name);
                Err(Problem::new(span, message))
            }
        }
    }

    fn converted(&self, value: f64) -> Result<Scalar> {
        if self.declaration.type_name == TypeName::Boolean {
            let node = self
                .context
                .graph
                .constant(f64::from(u8::from(value != 0.0)));
            return Ok(Scalar::Boolean(node.node()));
        }
        if !self.declaration.is_integer() {
            return Ok(Scalar::Real(self.context.graph.constant(value).node()));
        }
        if value.fract() != 0.0 || value.abs() > 2f64.powi(53) {
            let message = format!(
                "`{}` is an Integer and is given the value {value}",
                self.name
            );
            return Err(Problem::new(self.declaration.name, message).hint("give a whole number"));
        }
        Ok(Scalar::Integer(value as i64))
    }

    fn no_value(&self) -> Box<Problem> {
        let name = self.name;
        Problem::new(
            self.declaration.name,
            format!("parameter `{name}` has no value"),
        )
        .hint(format!(
            "write `{name} = …` here, or give the value on loading"
        ))
    }
}

/// A value that the caller gives to a parameter, or to an element of one.
struct Override {
    subscripts: Vec<usize>,
    value: f64,
}

/// The values that the caller gives, by place of the declaration.
fn overrides(
    context: &Context<'_>,
    by_name: &HashMap<&str, usize>,
) -> Result<HashMap<usize, Vec<Override>>> {
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
    Ok(by_place)
}

/// The values given to a declaration, by offset of its elements.
fn by_offset(
    given: &[Override],
    name: &str,
    dims: &[usize],
    span: Span,
) -> Result<Vec<(usize, f64)>> {
    let offset = |given: &Override| {
        let offset = offset(&given.subscripts, dims).ok_or_else(|| {
            let size = describe_dims(dims);
            let subscripts = describe_dims(&given.subscripts);
            let message =
                format!("a value is given for `{name}` {subscripts}, which has the size {size}");
            Problem::new(span, message)
                .hint("give values to elements, such as `H[3]`, with subscripts from 1")
        })?;
        Ok((offset, given.value))
    };
    given.iter().map(offset).collect()
}

fn check_settable(name: &str, declaration: &Declaration) -> Result<()> {
    let what = match declaration.variability {
        Variability::Parameter if declaration.is_final => "a final parameter",
        Variability::Parameter => return Ok(()),
        Variability::Constant => "a constant",
        Variability::Continuous => "a variable",
    };
    let message = format!("`{name}` is {what}; its value cannot be set from outside");
    Err(Problem::new(declaration.name, message).hint("only parameters can be set"))
}

fn unknown(model: &FlatModel, name: &str) -> Box<Problem> {
    let settable = model.declarations.iter().filter(|d| d.is_settable());
    let names: Vec<&str> = settable
        .map(|declaration| declaration.label.as_str())
        .collect();
    let model_name = &model.title;
    let hint =
        did_you_mean(name, names.iter().copied()).unwrap_or_else(|| match names.is_empty() {
            true => "it has no parameters".to_owned(),
            false => listed("parameters", &names),
        });
    let message = format!("model `{model_name}` has no parameter `{name}`");
    Problem::new(model.name, message).hint(hint)
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
