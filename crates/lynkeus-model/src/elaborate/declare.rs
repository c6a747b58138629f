//! Declarations to symbols: in which order they can be given sizes and values, and which.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use super::evaluate::Evaluator;
use super::scope::Mode;
use super::symbols::{Component, Symbols, gathered, is_outer_input, literal_subscripts};
use super::value::{
    Scalar, Value, check_size, describe_dims, element_count, element_name, expected_number,
};
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::{FlatModel, constant_label};
use crate::names::{did_you_mean, listed};
use crate::syntax::ast::{Causality, Declaration, ExprId, Kind, TypeName, Variability};
use crate::syntax::plain;

impl<'a> Symbols<'a> {
    /// With the declarations of the model, each found behind those that its size or value needs.
    pub(crate) fn declared(mut self) -> Result<Self> {
        let declarations = &self.model.declarations;
        self.by_name = index_names(self.source, declarations)?;
        let needs = declarations.iter().map(|d| self.needs(d));
        let needs: Vec<Vec<usize>> = needs.collect();
        let sequence = sort(declarations, &needs)?;
        self.dependent = dependent(declarations, &needs, &sequence);
        let overrides = self.overrides()?;
        self.components = declarations.iter().map(|_| None).collect();
        self.time();
        for place in sequence {
            let given = overrides.get(&place).map_or(&[][..], Vec::as_slice);
            let component = self.component(place, given);
            if component.is_err() && self.model.possible.contains(&declarations[place].label) {
                continue;
            }
            let component = component?;
            if component.is_known {
                let elements = component.elements.iter();
                let symbols = elements.filter_map(|element| element.real(self.graph));
                self.parameters.extend(symbols);
            }
            self.components[place] = Some(component);
        }
        self.gathered = gathered(&self.by_name, &self.components);
        Ok(self)
    }

    fn component(&self, place: usize, given: &[Given]) -> Result<Component> {
        let declaration = &self.model.declarations[place];
        let name = declaration.label.as_str();
        if declaration.variability != Variability::Continuous {
            return self.parameter(declaration, self.dependent[place], given);
        }
        let mut evaluator = Evaluator::of(self, declaration, Mode::Structural);
        let dims = evaluator.sizes(&declaration.dimensions, |_| {
            let message = format!("the size of variable `{name}` must be given");
            Err(Problem::new(declaration.name, message)
                .hint("write a number or a parameter instead of `:`"))
        })?;
        self.charge(&dims, declaration)?;
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
        Ok(Component {
            elements: (0..dims.iter().product()).map(symbol).collect(),
            dims,
            values: None,
            is_known: false,
        })
    }

    /// Takes what a declaration is written out to from the budgets.
    fn charge(&self, dims: &[usize], declaration: &Declaration) -> Result<()> {
        // A size beside a size of zero counts as well: slices walk along it.
        let walked: Vec<usize> = dims.iter().map(|&dim| dim.max(1)).collect();
        let count = element_count(&walked);
        self.scalars.charge(count, declaration.name)?;
        let description = declaration.description.as_ref().map_or(0, String::len);
        let values = declaration.attributes.iter().filter_map(|a| a.value);
        let values = values.map(|value| self.ast.expression(value));
        let texts = values.filter(|value| matches!(value.kind, Kind::Text));
        let spans = texts.map(|text| text.span).chain([declaration.name]);
        let lengths = spans.map(|span| u64::from(span.end.saturating_sub(span.start)));
        let length: u64 = lengths.sum();
        let each = length.saturating_add(description as u64);
        self.texts
            .charge(count.saturating_mul(each), declaration.name)
    }
}

fn index_names<'a>(
    source: &'a str,
    declarations: &'a [Declaration],
) -> Result<HashMap<&'a str, usize>> {
    let twice = |declaration: &Declaration, earlier: usize, how: &str| {
        let line = declarations[earlier].name.line(source);
        let message = format!("`{}` is declared twice", declaration.label);
        Problem::new(declaration.name, message).hint(format!("{how} on line {line}"))
    };
    let mut by_name: HashMap<&str, usize> = HashMap::with_capacity(declarations.len());
    for (place, declaration) in declarations.iter().enumerate() {
        let name = declaration.label.as_str();
        if name == "time" {
            let message = format!("`{name}` is a word of the language");
            return Err(Problem::new(declaration.name, message).hint("choose another name"));
        }
        if let Some(earlier) = by_name.insert(name, place) {
            return Err(twice(declaration, earlier, "it is first declared"));
        }
    }
    for declaration in declarations {
        // an element by itself beside the whole array would be two variables of one name
        let element = declaration.label.strip_suffix(']');
        if let Some((base, _)) = element.and_then(|name| name.rsplit_once('['))
            && let Some(&whole) = by_name.get(base)
        {
            let how = format!("`{base}` is declared as a whole");
            return Err(twice(declaration, whole, &how));
        }
    }
    Ok(by_name)
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

impl<'a> Symbols<'a> {
    /// Declarations whose size or value this one reads.
    fn needs(&self, declaration: &Declaration) -> Vec<usize> {
        let is_known = declaration.variability != Variability::Continuous;
        let binding = declaration.binding.filter(|_| is_known);
        let own: Vec<&str> = self.model.scopes.iter().map(String::as_str).collect();
        let package = declaration.package.as_deref();
        let scopes = package.map_or(own, |package| vec![package]);
        let mut found = vec![];
        for root in declaration.dimensions.iter().copied().chain(binding) {
            for name in self.names_in(root) {
                let before = found.len();
                if package.is_none() {
                    self.places(&name, &mut found);
                }
                if found.len() > before {
                    continue;
                }
                let full = self.classes.full_names(&name, &scopes);
                let mut constants = full.iter().map(|full| constant_label(full));
                while found.len() == before
                    && let Some(label) = constants.next()
                {
                    self.places(&label, &mut found);
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The names in an expression: `p[2]` where that is declared by itself, and not `p`.
    fn names_in(&self, root: ExprId) -> Vec<Cow<'a, str>> {
        let text = |id: ExprId| plain(self.ast.expression(id).span.text(self.source));
        let mut elements = HashSet::new();
        for id in self.ast.ids(root) {
            if let Kind::Index(base, _) = self.ast.expression(id).kind
                && self.by_name.contains_key(&*text(id))
            {
                elements.insert(base);
                elements.insert(id);
            }
        }
        let is_name = |id: &ExprId| match self.ast.expression(*id).kind {
            Kind::Name | Kind::Path(_) => !elements.contains(id),
            _ => elements.contains(id),
        };
        self.ast.ids(root).filter(is_name).map(text).collect()
    }

    /// The declaration of a name; else those of the members of a record, and of elements that are
    /// declared by themselves.
    fn places(&self, name: &str, found: &mut Vec<usize>) {
        if let Some(&place) = self.by_name.get(name) {
            found.push(place);
            return;
        }
        let base = name.split('[').next().unwrap_or_default();
        let element = |element| self.by_name.get(format!("{base}[{element}]").as_str());
        found.extend((1..).map_while(element));
        for member in self.model.records.get(base).into_iter().flatten() {
            self.places(&format!("{base}.{member}"), found);
        }
    }
}

/// Depth-first, without recursion: a chain of parameters may be as long as the file.
fn sort(declarations: &[Declaration], needs: &[Vec<usize>]) -> Result<Vec<usize>> {
    let (mut is_met, mut is_done) = (vec![false; needs.len()], vec![false; needs.len()]);
    let mut sequence = Vec::with_capacity(needs.len());
    let mut path: Vec<(usize, usize)> = vec![];
    for root in 0..needs.len() {
        if !std::mem::replace(&mut is_met[root], true) {
            path.push((root, 0));
        }
        while let Some((place, next)) = path.last_mut() {
            let Some(&need) = needs[*place].get(*next) else {
                is_done[*place] = true;
                sequence.push(*place);
                path.pop();
                continue;
            };
            *next += 1;
            if !std::mem::replace(&mut is_met[need], true) {
                path.push((need, 0));
            } else if !is_done[need] {
                return Err(cycle(declarations, &path, need));
            }
        }
    }
    Ok(sequence)
}

fn cycle(declarations: &[Declaration], path: &[(usize, usize)], closing: usize) -> Problem {
    let start = path.iter().position(|(place, _)| *place == closing);
    let cycle = &path[start.unwrap_or(0)..];
    let name = |place: usize| format!("`{}`", declarations[place].label);
    let mut names: Vec<String> = cycle
        .iter()
        .take(8)
        .map(|&(place, _)| name(place))
        .collect();
    if cycle.len() > 8 {
        names.push(format!("… {} more …", cycle.len() - 8));
    }
    names.push(name(closing));
    let message = format!("these declarations need each other: {}", names.join(" → "));
    Problem::new(declarations[closing].name, message).hint("give one of them a number")
}

impl<'a> Symbols<'a> {
    /// A parameter: its value as sizes see it and its symbols as equations see it.
    fn parameter(
        &self,
        declaration: &Declaration,
        dependent: bool,
        given: &[Given],
    ) -> Result<Component> {
        let name = declaration.written();
        if declaration.causality == Causality::Input {
            let message = format!("`{name}` is both a parameter and an input");
            return Err(Problem::new(declaration.name, message).hint("choose one of the two"));
        }
        let known = self.binding(declaration, Mode::Structural)?;
        let mut evaluator = Evaluator::of(self, declaration, Mode::Structural);
        let dims = evaluator.sizes(&declaration.dimensions, |axis| {
            let found = known.as_ref().and_then(|(value, _)| value.dims.get(axis));
            found.copied().ok_or_else(|| {
                let message = "the size `:` needs a value to be taken from";
                Problem::new(declaration.name, message)
            })
        })?;
        self.charge(&dims, declaration)?;
        let given = by_offset(given, name, &dims, declaration.name)?;
        let filled = |binding: Option<(Value, Span)>, must_be_known: bool| {
            let mut elements = self.bound(declaration, &dims, binding, must_be_known)?;
            for &(offset, value) in &given {
                elements[offset] = Some(self.converted(declaration, value)?);
            }
            Ok(elements.into_iter().collect::<Option<Vec<Scalar>>>())
        };
        let element_name = |offset: usize| element_name(name, &dims, offset);
        let symbol = |offset| Scalar::Real(self.graph.symbol(&element_name(offset)).node());
        let symbols = || (0..dims.iter().product()).map(symbol).collect();
        let values = filled(known, true)?;
        let is_symbolic = self.options.symbolic_parameters;
        let is_parameter = declaration.variability == Variability::Parameter;
        let keeps_symbols = declaration.is_settable() && declaration.type_name == TypeName::Real;
        let elements = match &values {
            _ if dependent && is_symbolic => {
                let symbolic = self.binding(declaration, Mode::Parametric)?;
                filled(symbolic, false)?.unwrap_or_else(symbols)
            }
            Some(values) if keeps_symbols && is_symbolic => {
                let is_number = |offset| self.options.numbers.contains(&element_name(offset));
                let element = |(offset, value): (usize, &Scalar)| match is_number(offset) {
                    true => *value,
                    false => symbol(offset),
                };
                values.iter().enumerate().map(element).collect()
            }
            Some(values) => values.clone(),
            None if is_parameter && is_symbolic => symbols(),
            None => {
                let message = format!("parameter `{name}` has no value");
                let hint = format!("write `{name} = …` here, or give the value on loading");
                return Err(Problem::new(declaration.name, message).hint(hint));
            }
        };
        Ok(Component {
            dims,
            elements,
            values,
            is_known: true,
        })
    }

    /// The value of the declaration equation, and where it stands; `None` if there is none, or if it
    /// needs a parameter without value where these are allowed.
    fn binding(&self, declaration: &Declaration, mode: Mode) -> Result<Option<(Value, Span)>> {
        let Some(id) = declaration.binding else {
            return Ok(None);
        };
        let mut evaluator = Evaluator::of(self, declaration, mode);
        let value = evaluator.value_if_known(id)?;
        Ok(value.map(|value| (value, evaluator.span(id))))
    }

    /// What the declaration equation says of the elements.
    fn bound(
        &self,
        declaration: &Declaration,
        dims: &[usize],
        binding: Option<(Value, Span)>,
        must_be_known: bool,
    ) -> Result<Vec<Option<Scalar>>> {
        let Some((value, span)) = binding else {
            return Ok(vec![None; dims.iter().product()]);
        };
        let checked = check_size(declaration.written(), dims, &value.dims, span);
        checked.map_err(|problem| match value.dims.is_empty() {
            true => problem.hint("use `fill(value, size)`"),
            false => problem,
        })?;
        let elements = value.elements.into_iter();
        let typed = |element| self.typed(declaration, element, must_be_known, span);
        elements.map(|element| typed(element).map(Some)).collect()
    }

    /// A value of the declared type, or an expression over other parameters.
    fn typed(
        &self,
        declaration: &Declaration,
        element: Scalar,
        must_be_known: bool,
        span: Span,
    ) -> Result<Scalar> {
        let (graph, name) = (self.graph, declaration.written());
        let is_known = |node| !must_be_known || graph.constant_value(node).is_some();
        if declaration.type_name == TypeName::Boolean {
            return match element {
                Scalar::Boolean(node) if is_known(node) => Ok(element),
                _ => Err(Problem::new(span, "expected `true` or `false`")),
            };
        }
        let node = element.real(graph).ok_or_else(|| expected_number(span))?;
        let is_integer = must_be_known && declaration.is_integer();
        match element {
            Scalar::Integer(_) if is_integer => Ok(element),
            _ if is_integer => {
                let message = format!("`{name}` is an Integer, its value is a Real");
                Err(Problem::new(span, message).hint("use `div(a, b)` or `integer(a)`"))
            }
            _ if is_known(node) => Ok(Scalar::Real(node)),
            _ => {
                let message = format!("the value of `{name}` is not a finite number");
                Err(Problem::new(span, message))
            }
        }
    }

    /// A number from outside as a value of the declared type.
    fn converted(&self, declaration: &Declaration, value: f64) -> Result<Scalar> {
        let constant = |value: f64| self.graph.constant(value).node();
        match declaration.type_name {
            TypeName::Boolean => Ok(Scalar::Boolean(constant(f64::from(value != 0.0)))),
            TypeName::Integer if value.fract() != 0.0 || value.abs() > 2f64.powi(53) => {
                let name = declaration.written();
                let message = format!("`{name}` is an Integer and is given the value {value}");
                Err(Problem::new(declaration.name, message).hint("give a whole number"))
            }
            TypeName::Integer => Ok(Scalar::Integer(value as i64)),
            _ => Ok(Scalar::Real(constant(value))),
        }
    }
}

/// What the caller gives to a parameter, or to an element of one: its subscripts, and the value.
type Given = (Vec<usize>, f64);

impl Symbols<'_> {
    /// The values that the caller gives, by place of the declaration.
    fn overrides(&self) -> Result<HashMap<usize, Vec<Given>>> {
        let model = self.model;
        let mut by_place: HashMap<usize, Vec<Given>> = HashMap::new();
        for (key, &value) in &self.options.parameters {
            let key = key.trim();
            // an element may be declared by itself: `x[3]`
            let (name, subscripts) = match self.by_name.contains_key(key) {
                true => (key, vec![]),
                false => split(key).ok_or_else(|| {
                    let message = format!("`{key}` is not the name of a parameter");
                    Problem::new(model.name, message)
                        .hint("names of parameters read `k`, `H[3]` or `A[1,2]`")
                })?,
            };
            let place = self.by_name.get(name);
            let &place = place.ok_or_else(|| unknown(model, name))?;
            let declaration = &model.declarations[place];
            check_settable(name, declaration)?;
            if !value.is_finite() {
                let message = format!("parameter `{key}` is given the value {value}");
                return Err(Problem::new(declaration.name, message).hint("give a finite number"));
            }
            by_place.entry(place).or_default().push((subscripts, value));
        }
        Ok(by_place)
    }
}

/// The values given to a declaration, by offset of its elements.
fn by_offset(given: &[Given], name: &str, dims: &[usize], span: Span) -> Result<Vec<(usize, f64)>> {
    let offset = |(subscripts, value): &Given| {
        let offset = offset(subscripts, dims).ok_or_else(|| {
            let (size, subscripts) = (describe_dims(dims), describe_dims(subscripts));
            let message =
                format!("a value is given for `{name}` {subscripts}, which has the size {size}");
            Problem::new(span, message)
                .hint("give values to elements, such as `H[3]`, with subscripts from 1")
        })?;
        Ok((offset, *value))
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

fn unknown(model: &FlatModel, name: &str) -> Problem {
    let declarations = model.declarations.iter();
    let settable = declarations.filter(|d| d.is_settable());
    let names: Vec<&str> = settable.map(|d| d.label.as_str()).collect();
    let model_name = &model.title;
    let hint =
        did_you_mean(name, names.iter().copied()).unwrap_or_else(|| match names.is_empty() {
            true => "it has no parameters".to_owned(),
            false => listed("parameters", &names),
        });
    let message = format!("model `{model_name}` has no parameter `{name}`");
    Problem::new(model.name, message).hint(hint)
}

/// `H[3]` as `H` and 3. Subscripts of other parts than the last belong to the name, as in `a[1].b`.
fn split(key: &str) -> Option<(&str, Vec<usize>)> {
    let last = key.rsplit('.').next().unwrap_or_default();
    match last.split_once('[') {
        None => Some((key, vec![])),
        // one pair of brackets
        Some((_, rest)) if rest.contains('[') => None,
        Some(_) => literal_subscripts(key),
    }
}

fn offset(subscripts: &[usize], dims: &[usize]) -> Option<usize> {
    if subscripts.len() != dims.len() {
        return None;
    }
    let mut pairs = subscripts.iter().zip(dims);
    pairs.try_fold(0usize, |offset, (&subscript, &dim)| {
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
        assert_eq!(split("A[1, 2]"), Some(("A", vec![1, 2])));
        assert_eq!(split("a[1].b"), Some(("a[1].b", vec![])));
        assert_eq!(split("a[1].b[2]"), Some(("a[1].b", vec![2])));
        assert_eq!(split("a[1].b[2][3]"), None);
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
