//! The parts of a plant, from the declared names and the solved equations: variables with their
//! attributes, start values, assertions.

use std::collections::{BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Interval, Node, Tape, Unary, jacobian};

use super::evaluate::Claim;
use super::flatten::Flat;
use super::scope::{Context, Mode};
use super::symbols::{Component, Symbols, is_outer_input};
use super::value::{Scalar, Value, describe_dims, element_name};
use crate::balance::{FlatEquation, System, Unknown};
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::{Attribute, Causality, Declaration, ExprId, Kind, TypeName, Variability};
use crate::syntax::{plain, unquoted};
use crate::{Assertion, Parameter, Plant, Variable, balance};

/// A plant that has not taken the graph yet.
pub(super) struct Parts {
    name: String,
    time: Node,
    states: Vec<Variable>,
    derivatives: Vec<Node>,
    inputs: Vec<Variable>,
    outputs: Vec<Variable>,
    algebraics: Vec<Variable>,
    parameters: Vec<Parameter>,
    table_points: BTreeSet<Node>,
    assertions: Vec<Assertion>,
    pub(super) warnings: Vec<Problem>,
}

impl Parts {
    pub(super) fn with_graph(self, graph: Graph) -> Plant {
        Plant {
            table_points: self.table_points,
            assertions: self.assertions,
            warnings: vec![],
            name: self.name,
            graph,
            time: self.time,
            states: self.states,
            derivatives: self.derivatives,
            inputs: self.inputs,
            outputs: self.outputs,
            algebraics: self.algebraics,
            parameters: self.parameters,
        }
    }
}

pub(super) fn parts<'a>(
    context: &Context<'a>,
    symbols: &Symbols<'a>,
    flat: &Flat,
) -> Result<Parts> {
    let (unknowns, inputs) = unknowns(context, symbols, &flat.equations)?;
    let system = System {
        graph: context.graph,
        equations: &flat.equations,
        unknowns: &unknowns,
        inputs: &inputs,
        time: symbols.time,
    };
    let solution = balance::solve(&system, context.source, context.model.name)?;
    let mut parts = Parts {
        name: context.model.title.clone(),
        time: symbols.time,
        states: vec![],
        derivatives: vec![],
        inputs: vec![],
        outputs: vec![],
        algebraics: vec![],
        parameters: vec![],
        table_points: BTreeSet::new(),
        assertions: vec![],
        warnings: vec![],
    };
    let inputs: HashSet<Node> = inputs.into_iter().collect();
    for (place, declaration, component) in symbols.placed() {
        if declaration.package.is_some() {
            continue;
        }
        let attributes = Attributes::new(context, symbols, declaration, component)?;
        let sorter = Sorter {
            context,
            symbols,
            declaration,
            component,
            attributes,
            inputs: &inputs,
        };
        if declaration.prefix.variability == Variability::Continuous {
            sorter.variables(&solution, &mut parts);
        } else {
            let dependent = symbols.dependent.get(place).copied().unwrap_or_default();
            sorter.parameters(dependent, &mut parts);
        }
    }
    let graph = context.graph;
    parts.warnings = fix_starts(graph, symbols, flat, &solution, &mut parts.states);
    let found = assertions(context, &flat.claims, &solution);
    let variables: Vec<&Variable> = parts.states.iter().chain(&parts.inputs).collect();
    let failing = failing_at_start(graph, symbols, &found, &variables);
    parts.warnings.extend(failing);
    parts.table_points = context.table_points.take();
    parts.assertions = found.into_iter().map(|(assertion, _)| assertion).collect();
    Ok(parts)
}

/// Derivatives of the states and all other variables, and the inputs apart.
fn unknowns(
    context: &Context<'_>,
    symbols: &Symbols<'_>,
    equations: &[FlatEquation],
) -> Result<(Vec<Unknown>, Vec<Node>)> {
    let (mut unknowns, mut inputs) = (vec![], vec![]);
    let equated: HashSet<Node> = equations
        .iter()
        .flat_map(|equation| [equation.left, equation.right])
        .collect();
    for (declaration, component) in symbols.all() {
        if component.is_known {
            continue;
        }
        let is_input = declaration.prefix.causality == Causality::Input;
        let attributes = Attributes::new(context, symbols, declaration, component)?;
        for (offset, node) in nodes(component).enumerate() {
            let is_open = declaration.binding.is_none() && !equated.contains(&node);
            if is_input && (is_open || is_outer_input(declaration)) {
                inputs.push(node);
                continue;
            }
            let derivative = symbols.derivative_of(node);
            // nothing is declared of derivatives
            let (start, range) = match derivative {
                Some(_) => (0.0, Interval::ENTIRE),
                None => attributes.search(offset),
            };
            unknowns.push(Unknown {
                symbol: derivative.unwrap_or(node),
                name: element_name(&declaration.label, &component.dims, offset),
                span: declaration.name,
                state: derivative.map(|_| node),
                rank: rank(context, declaration),
                start,
                range,
            });
        }
    }
    Ok((unknowns, inputs))
}

/// How much a variable is wanted as a state, where the equations leave a choice.
fn rank(context: &Context<'_>, declaration: &Declaration) -> i32 {
    let given = |name: &str| {
        let mut attributes = declaration.attributes.iter();
        attributes.find(|attribute| attribute.name.text(context.source) == name)
    };
    let selected = given("stateSelect").and_then(|attribute| attribute.value);
    let selected = selected.map(|id| plain(context.ast.expression(id).span.text(context.source)));
    let wanted = match selected.as_deref() {
        Some("StateSelect.always") => 40,
        Some("StateSelect.prefer") => 20,
        Some("StateSelect.avoid") => -20,
        Some("StateSelect.never") => -40,
        _ => 0,
    };
    let known = |name| i32::from(given(name).is_some());
    // ranges are what conditions are proved on; a compiler writes a start everywhere
    wanted + 4 * (known("min") + known("max")) + 2 * known("fixed") + known("start")
}

fn nodes(component: &Component) -> impl Iterator<Item = Node> {
    component
        .elements
        .iter()
        .filter_map(|element| match element {
            Scalar::Real(node) | Scalar::Boolean(node) => Some(*node),
            Scalar::Integer(_) => None,
        })
}

/// Puts the elements of one declaration where they belong.
struct Sorter<'s, 'a> {
    context: &'s Context<'a>,
    symbols: &'s Symbols<'a>,
    declaration: &'s Declaration,
    component: &'s Component,
    attributes: Attributes,
    inputs: &'s HashSet<Node>,
}

impl Sorter<'_, '_> {
    fn variable(&self, offset: usize, node: Node) -> Variable {
        let Self {
            declaration,
            component,
            ..
        } = self;
        self.attributes
            .variable(declaration, &component.dims, offset, node)
    }

    fn variables(&self, solution: &HashMap<Node, Node>, parts: &mut Parts) {
        for (offset, symbol) in nodes(self.component).enumerate() {
            let causality = self.declaration.prefix.causality;
            if self.inputs.contains(&symbol) {
                parts.inputs.push(self.variable(offset, symbol));
                continue;
            }
            let derivative = self.symbols.derivative_of(symbol);
            let derivative = derivative.and_then(|symbol| solution.get(&symbol).copied());
            // what was under `der` and follows from other states is none itself
            let derivative = derivative.filter(|_| !solution.contains_key(&symbol));
            let is_state = derivative.is_some();
            if let Some(derivative) = derivative {
                parts.states.push(self.variable(offset, symbol));
                parts.derivatives.push(derivative);
            }
            let value = solution.get(&symbol).copied().unwrap_or(symbol);
            if causality == Causality::Output {
                parts.outputs.push(self.variable(offset, value));
            } else if !is_state {
                parts.algebraics.push(self.variable(offset, value));
            }
        }
    }

    fn parameters(&self, dependent: bool, parts: &mut Parts) {
        let prefix = &self.declaration.prefix;
        let is_fixed = prefix.variability == Variability::Constant || prefix.is_final;
        if is_fixed || dependent || prefix.type_name == TypeName::Boolean {
            return;
        }
        let graph = self.context.graph;
        let name = &self.declaration.label;
        for offset in 0..self.component.elements.len() {
            let full = element_name(name, &self.component.dims, offset);
            let value = self
                .component
                .values
                .as_ref()
                .and_then(|values| values.get(offset));
            parts.parameters.push(Parameter {
                variable: self.variable(offset, graph.symbol(&full).node()),
                value: value.and_then(|value| value.number(graph)),
            });
        }
    }
}

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
        node: Node,
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

/// Sets the start of each state that an initial equation fixes; a warning for every other.
fn fix_starts<'a>(
    graph: &Graph,
    symbols: &Symbols<'a>,
    flat: &Flat,
    solution: &HashMap<Node, Node>,
    states: &mut [Variable],
) -> Vec<Problem> {
    let mut at_start = solution.clone();
    at_start.insert(symbols.time, graph.constant(0.0).node());
    let by_symbol: HashMap<Node, usize> = states
        .iter()
        .enumerate()
        .map(|(place, state)| (state.node, place))
        .collect();
    let starts = Starts {
        graph,
        values: symbols.parameter_values(),
        by_symbol,
    };
    let mut warnings: Vec<Problem> = flat
        .initial_unread
        .iter()
        .map(|&span| unread(span))
        .collect();
    for equation in &flat.initial {
        let sides = graph.substitute(&[equation.left, equation.right], &at_start);
        let [left, right] = sides[..] else {
            continue;
        };
        let found = starts
            .explicit(left, right)
            .or_else(|| starts.explicit(right, left));
        let found = found.or_else(|| starts.solved(graph.binary(Binary::Sub, left, right)));
        match found {
            Some((place, node, value)) if place < states.len() => {
                let state = &mut states[place];
                state.start = value;
                state.start_node = (!graph.symbols_of(&[node]).is_empty()).then_some(node);
                state.fixed = true;
            }
            _ => warnings.push(does_not_fix(equation)),
        }
    }
    warnings
}

struct Starts<'g> {
    graph: &'g Graph,
    /// values of the parameters that are symbols, where they have one
    values: HashMap<Node, Option<f64>>,
    by_symbol: HashMap<Node, usize>,
}

impl Starts<'_> {
    /// `x = e` with e free of variables.
    fn explicit(&self, state: Node, start: Node) -> Option<(usize, Node, Option<f64>)> {
        let place = *self.by_symbol.get(&state)?;
        let symbols = self.graph.symbols_of(&[start]);
        let known = symbols
            .iter()
            .all(|symbol| self.values.contains_key(symbol));
        let value = self.number(start);
        (known && (value.is_some() || !symbols.is_empty())).then_some((place, start, value))
    }

    /// The state that a residual fixes, with its start as an expression of the parameters and
    /// as a number.
    fn solved(&self, residual: Node) -> Option<(usize, Node, Option<f64>)> {
        let graph = self.graph;
        let symbols = graph.symbols_of(&[residual]);
        let is_state = |symbol: &&Node| self.by_symbol.contains_key(symbol);
        let others = |symbol: &&Node| !is_state(symbol) && !self.values.contains_key(symbol);
        if symbols.iter().any(|symbol| others(&symbol)) {
            return None;
        }
        let mut states = symbols.iter().filter(is_state);
        let (&state, None) = (states.next()?, states.next()) else {
            return None;
        };
        let slope = jacobian::reverse(graph, &[residual], &[state]).get(0, 0)?;
        if graph.symbols_of(&[slope]).contains(&state) {
            return None;
        }
        let zero = HashMap::from([(state, graph.constant(0.0).node())]);
        let rest = *graph.substitute(&[residual], &zero).first()?;
        let start = match graph.constant_value(slope) {
            Some(0.0) => return None,
            Some(1.0) => graph.unary(Unary::Neg, rest),
            Some(-1.0) => rest,
            _ => graph.unary(Unary::Neg, graph.binary(Binary::Div, rest, slope)),
        };
        let value = self.number(start);
        if value.is_none() && graph.symbols_of(&[start]).is_empty() {
            return None;
        }
        Some((*self.by_symbol.get(&state)?, start, value))
    }

    fn number(&self, node: Node) -> Option<f64> {
        if let Some(value) = self.graph.constant_value(node) {
            return Some(value);
        }
        let symbols = self.graph.symbols_of(&[node]);
        let values: Option<Vec<f64>> = symbols
            .iter()
            .map(|symbol| self.values.get(symbol).copied()?)
            .collect();
        let tape = Tape::new(self.graph, &symbols, &[node]).ok()?;
        let mut out = [f64::NAN];
        tape.evaluator().eval(&values?, &mut out);
        out[0].is_finite().then_some(out[0])
    }
}

fn unread(span: Span) -> Problem {
    Problem::new(span, "an initial equation of a derivative has no effect")
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

fn does_not_fix(equation: &FlatEquation) -> Problem {
    let message = "this initial equation fixes the start of no state by itself: it has no effect";
    Problem::new(equation.span, message)
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

/// What is to hold along a run; what holds whatever happens is left out.
fn assertions(
    context: &Context<'_>,
    claims: &[Claim],
    solution: &HashMap<Node, Node>,
) -> Vec<(Assertion, Claim)> {
    let conditions: Vec<Node> = claims.iter().map(|claim| claim.condition).collect();
    let conditions = context.graph.substitute(&conditions, solution);
    let pairs = claims.iter().zip(conditions);
    let open = pairs.filter(|(_, condition)| {
        !matches!(context.graph.constant_value(*condition), Some(value) if value != 0.0)
    });
    open.map(|(claim, condition)| {
        let assertion = Assertion {
            condition,
            message: claim.message.clone(),
            line: claim.span.line(context.source),
            is_warning: claim.is_warning,
        };
        (assertion, claim.clone())
    })
    .collect()
}

/// A warning for each assertion that fails at the declared starts.
fn failing_at_start(
    graph: &Graph,
    symbols: &Symbols<'_>,
    assertions: &[(Assertion, Claim)],
    variables: &[&Variable],
) -> Vec<Problem> {
    let mut known: HashMap<Node, f64> = HashMap::from([(symbols.time, 0.0)]);
    let values = symbols.parameter_values().into_iter();
    known.extend(values.filter_map(|(node, value)| Some((node, value?))));
    known.extend(variables.iter().filter_map(|v| Some((v.node, v.start?))));
    let fails = |assertion: &Assertion| {
        let read = graph.symbols_of(&[assertion.condition]);
        let values: Option<Vec<f64>> = read.iter().map(|node| known.get(node).copied()).collect();
        let tape = Tape::new(graph, &read, &[assertion.condition]).ok();
        let (Some(values), Some(tape)) = (values, tape) else {
            return false;
        };
        let mut out = [1.0];
        tape.evaluator().eval(&values, &mut out);
        out[0] == 0.0
    };
    let failing = assertions.iter().filter(|(assertion, _)| fails(assertion));
    failing
        .map(|(assertion, claim)| {
            let message = format!("this assertion fails at the start: {}", assertion.message);
            Problem::new(claim.span, message)
                .hint("change the start values, or the parameters that it is about")
        })
        .collect()
}
