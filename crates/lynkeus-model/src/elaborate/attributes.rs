//! `start`, `min`, `max`, `nominal`, `fixed` and `unit` of declarations.

use lynkeus_expr::{Interval, Node};

use super::scope::Mode;
use super::symbols::{Component, Context, Symbols};
use super::value::{Scalar, Value, describe_dims, element_name};
use crate::Variable;
use crate::syntax::ast::{Attribute, Declaration, ExprId, Kind, TypeName};
use crate::syntax::{Problem, Result, unquoted};

/// What a declaration says of all its elements.
pub(super) struct Attributes {
    start: Option<Numbers>,
    /// the start as expressions, one for all elements or one for each
    start_nodes: Vec<Node>,
    min: Option<Numbers>,
    max: Option<Numbers>,
    nominal: Option<Numbers>,
    /// 1 for true
    fixed: Option<Numbers>,
    unit: Option<String>,
}

/// One number for all elements, or one for each.
enum Numbers {
    Same(f64),
    Each(Vec<f64>),
}

impl Numbers {
    fn at(&self, offset: usize) -> Option<f64> {
        match self {
            Numbers::Same(value) => Some(*value),
            Numbers::Each(values) => values.get(offset).copied(),
        }
    }
}

impl Attributes {
    pub(super) fn new<'a>(
        context: &Context<'a>,
        symbols: &Symbols<'a>,
        declaration: &Declaration,
        component: &Component,
    ) -> Result<Self> {
        let reader = Reader {
            context,
            symbols,
            component,
            is_boolean: declaration.prefix.type_name == TypeName::Boolean,
        };
        let mut attributes = Self {
            start: None,
            start_nodes: vec![],
            min: None,
            max: None,
            nominal: None,
            fixed: None,
            unit: None,
        };
        if let Some(library) = context.model.library.get(&declaration.label) {
            attributes.unit = Some(library.unit.to_owned());
            attributes.min = library.min.map(Numbers::Same);
        }
        let mut given: Vec<&str> = vec![];
        for attribute in &declaration.attributes {
            let name = attribute.name.text(context.source);
            if given.contains(&name) {
                let message = "this attribute is given twice";
                return Err(Problem::new(attribute.name, message));
            }
            given.push(name);
            let Some(value) = attribute.value else {
                return Err(Problem::new(
                    attribute.name,
                    format!("expected a value for `{name}`"),
                ));
            };
            let slot = match name {
                "start" => &mut attributes.start,
                "min" => &mut attributes.min,
                "max" => &mut attributes.max,
                "nominal" => &mut attributes.nominal,
                "fixed" => &mut attributes.fixed,
                "unit" => {
                    attributes.unit = Some(reader.text(value)?);
                    continue;
                }
                _ => continue,
            };
            *slot = reader.numbers(name, value)?;
            if name == "start" {
                attributes.start_nodes = reader.symbolic(value)?;
            }
        }
        // A start that cannot be computed from parameters is not known, however fixed.
        let is_start = |attribute: &Attribute| attribute.name.text(context.source) == "start";
        let unknown = attributes.start.is_none() && attributes.start_nodes.is_empty();
        if unknown && declaration.attributes.iter().any(is_start) {
            attributes.fixed = None;
        }
        attributes.check_range(declaration, component)?;
        Ok(attributes)
    }

    fn check_range(&self, declaration: &Declaration, component: &Component) -> Result<()> {
        for offset in 0..component.elements.len() {
            let bound = |numbers: &Option<Numbers>| numbers.as_ref()?.at(offset);
            if let (Some(min), Some(max)) = (bound(&self.min), bound(&self.max))
                && min > max
            {
                let name = declaration.label.as_str();
                let name = element_name(name, &component.dims, offset);
                let message = format!("the range of `{name}` is empty: min {min} > max {max}");
                return Err(Problem::new(declaration.name, message));
            }
        }
        Ok(())
    }

    /// Where the search for an element begins that a loop determines, and where it may end.
    pub(super) fn search(&self, offset: usize) -> (f64, Interval) {
        let at = |numbers: &Option<Numbers>| numbers.as_ref()?.at(offset);
        let low = at(&self.min).unwrap_or(f64::NEG_INFINITY);
        let high = at(&self.max).unwrap_or(f64::INFINITY);
        let range = Interval::new(low, high).unwrap_or(Interval::ENTIRE);
        (
            at(&self.start).unwrap_or(0.0).clamp(range.lo(), range.hi()),
            range,
        )
    }

    /// One element as a variable of the plant.
    pub(super) fn variable(
        &self,
        declaration: &Declaration,
        dims: &[usize],
        offset: usize,
        node: lynkeus_expr::Node,
    ) -> Variable {
        let at = |numbers: &Option<Numbers>| numbers.as_ref()?.at(offset);
        Variable {
            name: element_name(&declaration.label, dims, offset),
            node,
            unit: self.unit.clone(),
            description: declaration.description.clone(),
            start: at(&self.start),
            start_node: match &self.start_nodes[..] {
                [one] => Some(*one),
                nodes => nodes.get(offset).copied(),
            },
            min: at(&self.min).unwrap_or(f64::NEG_INFINITY),
            max: at(&self.max).unwrap_or(f64::INFINITY),
            nominal: at(&self.nominal),
            integer: declaration.prefix.is_integer(),
            fixed: at(&self.fixed) == Some(1.0),
        }
    }
}

struct Reader<'r, 'a> {
    context: &'r Context<'a>,
    symbols: &'r Symbols<'a>,
    component: &'r Component,
    is_boolean: bool,
}

impl Reader<'_, '_> {
    fn text(&self, value: ExprId) -> Result<String> {
        let expression = self.context.ast.expression(value);
        match expression.kind {
            Kind::Text => Ok(unquoted(expression.span.text(self.context.source))),
            _ => Err(Problem::new(expression.span, "expected a string")
                .hint("write units as in `unit = \"m/s\"`")),
        }
    }

    /// The value as expressions, where it depends on parameters that are symbols.
    fn symbolic(&self, value: ExprId) -> Result<Vec<Node>> {
        let graph = self.context.graph;
        if !self.context.options.symbolic_parameters {
            return Ok(vec![]);
        }
        let mut evaluator = self.symbols.evaluator(self.context, Mode::Parametric);
        let elements = match evaluator.value(value)? {
            Value::Scalar(scalar) => vec![scalar],
            Value::Array(array) => array.elements,
        };
        let nodes = elements.into_iter().map(|scalar| scalar.real(graph));
        let nodes: Vec<Node> = nodes.collect::<Option<_>>().unwrap_or_default();
        match graph.symbols_of(&nodes).is_empty() {
            true => Ok(vec![]),
            false => Ok(nodes),
        }
    }

    /// `None` where the value needs a parameter that has none.
    fn numbers(&self, name: &str, id: ExprId) -> Result<Option<Numbers>> {
        let is_truth = name == "fixed";
        let mut evaluator = self.symbols.evaluator(self.context, Mode::Structural);
        let span = self.context.ast.expression(id).span;
        let value = match evaluator.value(id) {
            Ok(value) => value,
            Err(_) if evaluator.valueless && self.context.options.symbolic_parameters => {
                return Ok(None);
            }
            Err(problem) => return Err(problem),
        };
        let graph = self.context.graph;
        let number = |scalar: Scalar| {
            let (value, expected) = match (scalar, is_truth) {
                (Scalar::Boolean(node), _) if is_truth || self.is_boolean => {
                    (graph.constant_value(node), "expected `true` or `false`")
                }
                (_, true) => (None, "expected `true` or `false`"),
                _ => (scalar.number(graph), "expected a finite number"),
            };
            value.ok_or_else(|| Problem::new(span, expected))
        };
        match value {
            Value::Scalar(scalar) => Ok(Some(Numbers::Same(number(scalar)?))),
            Value::Array(array) if array.dims == self.component.dims => {
                let numbers = array
                    .elements
                    .into_iter()
                    .map(number)
                    .collect::<Result<_>>()?;
                Ok(Some(Numbers::Each(numbers)))
            }
            Value::Array(array) => {
                let (has, found) = (
                    describe_dims(&self.component.dims),
                    describe_dims(&array.dims),
                );
                let message = format!("the attribute has the size {found}, its variable has {has}");
                Err(Problem::new(span, message))
            }
        }
    }
}
