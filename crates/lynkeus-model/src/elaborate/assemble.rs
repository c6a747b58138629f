//! The parts of a plant, from the declared names and the solved equations: variables with their
//! attributes, start values, assertions.

use std::collections::{BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Interval, Node, Tape, Unary, jacobian};

use super::flatten::Flat;
use super::scope::{Context, Mode};
use super::symbols::{Component, Symbols, is_outer_input};
use super::value::{Scalar, describe_dims, element_name};
use crate::balance::{FlatEquation, System, Unknown};
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::{Causality, Declaration, ExprId, Kind, TypeName, Variability};
use crate::syntax::{plain, unquoted};
use crate::{Assertion, Parameter, Plant, Variable, balance};

/// The plant, with what looks wrong in it. Its graph is still the caller's: this one is empty.
pub(super) fn plant<'a>(
    context: &Context<'a>,
    symbols: &Symbols<'a>,
    flat: Flat,
) -> Result<(Plant, Vec<Box<Problem>>)> {
    let (unknowns, inputs) = unknowns(context, symbols, &flat.equations)?;
    let graph = context.graph;
    let system = System {
        graph,
        equations: &flat.equations,
        unknowns: &unknowns,
        inputs: &inputs,
        time: symbols.time,
    };
    let solution = balance::solve(&system, context.source, context.model.name)?;
    let mut plant = Plant {
        name: context.model.title.clone(),
        graph: Graph::new(),
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
        let attributes = Declared::new(context, symbols, declaration, component)?;
        if declaration.variability == Variability::Continuous {
            variables(symbols, &attributes, &inputs, &solution, &mut plant);
        } else if !symbols.dependent.get(place).copied().unwrap_or_default() {
            parameters(graph, &attributes, &mut plant);
        }
    }
    let mut warnings = fix_starts(graph, symbols, &flat, &solution, &mut plant.states);
    let found = assertions(context, flat.claims, &solution);
    let variables: Vec<&Variable> = plant.states.iter().chain(&plant.inputs).collect();
    warnings.extend(failing_at_start(graph, symbols, &found, &variables));
    plant.table_points = context.table_points.take();
    plant.assertions = found.into_iter().map(|(assertion, _)| assertion).collect();
    Ok((plant, warnings))
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
        let is_input = declaration.causality == Causality::Input;
        let attributes = Declared::new(context, symbols, declaration, component)?;
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

/// Puts the elements of a declared variable where they belong.
fn variables(
    symbols: &Symbols<'_>,
    declared: &Declared<'_>,
    inputs: &HashSet<Node>,
    solution: &HashMap<Node, Node>,
    plant: &mut Plant,
) {
    let causality = declared.declaration.causality;
    for (offset, symbol) in nodes(declared.component).enumerate() {
        if inputs.contains(&symbol) {
            plant.inputs.push(declared.variable(offset, symbol));
            continue;
        }
        let derivative = symbols.derivative_of(symbol);
        let derivative = derivative.and_then(|symbol| solution.get(&symbol).copied());
        // what was under `der` and follows from other states is none itself
        let derivative = derivative.filter(|_| !solution.contains_key(&symbol));
        let is_state = derivative.is_some();
        if let Some(derivative) = derivative {
            plant.states.push(declared.variable(offset, symbol));
            plant.derivatives.push(derivative);
        }
        let value = solution.get(&symbol).copied().unwrap_or(symbol);
        if causality == Causality::Output {
            plant.outputs.push(declared.variable(offset, value));
        } else if !is_state {
            plant.algebraics.push(declared.variable(offset, value));
        }
    }
}

/// The elements of a declared parameter, where a caller may set them.
fn parameters(graph: &Graph, declared: &Declared<'_>, plant: &mut Plant) {
    let Declared {
        declaration,
        component,
        ..
    } = declared;
    let is_fixed = declaration.variability == Variability::Constant || declaration.is_final;
    if is_fixed || declaration.type_name == TypeName::Boolean {
        return;
    }
    for offset in 0..component.elements.len() {
        let full = element_name(&declaration.label, &component.dims, offset);
        let values = component.values.as_ref();
        let value = values.and_then(|values| values.get(offset));
        plant.parameters.push(Parameter {
            variable: declared.variable(offset, graph.symbol(&full).node()),
            value: value.and_then(|value| value.number(graph)),
        });
    }
}

/// What a declaration says of all its elements. Numbers are one for all elements or one for each;
/// none where nothing is given.
struct Declared<'s> {
    declaration: &'s Declaration,
    component: &'s Component,
    start: Vec<f64>,
    /// the start as expressions
    start_nodes: Vec<Node>,
    min: Vec<f64>,
    max: Vec<f64>,
    nominal: Vec<f64>,
    /// 1 for true
    fixed: Vec<f64>,
    unit: Option<String>,
}

/// The one for all elements, or that of an element.
fn at<T: Copy>(values: &[T], offset: usize) -> Option<T> {
    match values {
        [one] => Some(*one),
        _ => values.get(offset).copied(),
    }
}

impl<'s> Declared<'s> {
    fn new<'a>(
        context: &Context<'a>,
        symbols: &Symbols<'a>,
        declaration: &'s Declaration,
        component: &'s Component,
    ) -> Result<Self> {
        let library = context.model.library.get(&declaration.label);
        let mut attributes = Self {
            declaration,
            component,
            start: vec![],
            start_nodes: vec![],
            min: library
                .and_then(|library| library.min)
                .into_iter()
                .collect(),
            max: vec![],
            nominal: vec![],
            fixed: vec![],
            unit: library.map(|library| library.unit.to_owned()),
        };
        let mut given: Vec<&str> = vec![];
        for attribute in &declaration.attributes {
            let name = attribute.name.text(context.source);
            if given.contains(&name) {
                let message = "this attribute is given twice";
                return Err(Problem::new(attribute.name, message));
            }
            given.push(name);
            let Some(value) = attribute.value else {
                let message = format!("expected a value for `{name}`");
                return Err(Problem::new(attribute.name, message));
            };
            if name == "unit" {
                attributes.unit = Some(text(context, value)?);
            } else if let Some(slot) = attributes.numbers_of(name) {
                *slot = numbers(context, symbols, declaration, component, name, value)?;
            }
            if name == "start" {
                attributes.start_nodes = symbolic(context, symbols, value)?;
            }
        }
        // A start that cannot be computed from parameters is not known, however fixed.
        let unknown = attributes.start.is_empty() && attributes.start_nodes.is_empty();
        if unknown && given.contains(&"start") {
            attributes.fixed.clear();
        }
        attributes.check_range()?;
        Ok(attributes)
    }

    fn numbers_of(&mut self, name: &str) -> Option<&mut Vec<f64>> {
        match name {
            "start" => Some(&mut self.start),
            "min" => Some(&mut self.min),
            "max" => Some(&mut self.max),
            "nominal" => Some(&mut self.nominal),
            "fixed" => Some(&mut self.fixed),
            _ => None,
        }
    }

    fn check_range(&self) -> Result<()> {
        for offset in 0..self.component.elements.len() {
            if let (Some(min), Some(max)) = (at(&self.min, offset), at(&self.max, offset))
                && min > max
            {
                let name = self.name(offset);
                let message = format!("the range of `{name}` is empty: min {min} > max {max}");
                return Err(Problem::new(self.declaration.name, message));
            }
        }
        Ok(())
    }

    fn name(&self, offset: usize) -> String {
        element_name(&self.declaration.label, &self.component.dims, offset)
    }

    /// Where the search for an element begins that a loop determines, and where it may end.
    fn search(&self, offset: usize) -> (f64, Interval) {
        let low = at(&self.min, offset).unwrap_or(f64::NEG_INFINITY);
        let high = at(&self.max, offset).unwrap_or(f64::INFINITY);
        let range = Interval::new(low, high).unwrap_or(Interval::ENTIRE);
        let start = at(&self.start, offset).unwrap_or(0.0);
        (start.clamp(range.lo(), range.hi()), range)
    }

    /// One element as a variable of the plant.
    fn variable(&self, offset: usize, node: Node) -> Variable {
        Variable {
            name: self.name(offset),
            node,
            unit: self.unit.clone(),
            description: self.declaration.description.clone(),
            start: at(&self.start, offset),
            start_node: at(&self.start_nodes, offset),
            min: at(&self.min, offset).unwrap_or(f64::NEG_INFINITY),
            max: at(&self.max, offset).unwrap_or(f64::INFINITY),
            nominal: at(&self.nominal, offset),
            integer: self.declaration.is_integer(),
            fixed: at(&self.fixed, offset) == Some(1.0),
        }
    }
}

fn text(context: &Context<'_>, value: ExprId) -> Result<String> {
    let expression = context.ast.expression(value);
    match expression.kind {
        Kind::Text => Ok(unquoted(expression.span.text(context.source))),
        _ => Err(Problem::new(expression.span, "expected a string")
            .hint("write units as in `unit = \"m/s\"`")),
    }
}

/// The value of an attribute as expressions, where it depends on parameters that are symbols.
fn symbolic<'a>(context: &Context<'a>, symbols: &Symbols<'a>, value: ExprId) -> Result<Vec<Node>> {
    let graph = context.graph;
    if !context.options.symbolic_parameters {
        return Ok(vec![]);
    }
    let value = symbols.evaluator(context, Mode::Parametric).value(value)?;
    let nodes = value.elements().iter().map(|scalar| scalar.real(graph));
    let nodes: Vec<Node> = nodes.collect::<Option<_>>().unwrap_or_default();
    match graph.symbols_of(&nodes).is_empty() {
        true => Ok(vec![]),
        false => Ok(nodes),
    }
}

/// The numbers of an attribute; none where it needs a parameter that has no value.
fn numbers<'a>(
    context: &Context<'a>,
    symbols: &Symbols<'a>,
    declaration: &Declaration,
    component: &Component,
    name: &str,
    id: ExprId,
) -> Result<Vec<f64>> {
    let is_truth = name == "fixed";
    let is_boolean = declaration.type_name == TypeName::Boolean;
    let mut evaluator = symbols.evaluator(context, Mode::Structural);
    let span = context.ast.expression(id).span;
    let value = match evaluator.value(id) {
        Ok(value) => value,
        Err(_) if evaluator.valueless && context.options.symbolic_parameters => return Ok(vec![]),
        Err(problem) => return Err(problem),
    };
    let graph = context.graph;
    let number = |&scalar: &Scalar| {
        let (value, expected) = match (scalar, is_truth) {
            (Scalar::Boolean(node), _) if is_truth || is_boolean => {
                (graph.constant_value(node), "expected `true` or `false`")
            }
            (_, true) => (None, "expected `true` or `false`"),
            _ => (scalar.number(graph), "expected a finite number"),
        };
        value.ok_or_else(|| Problem::new(span, expected))
    };
    if !value.dims().is_empty() && value.dims() != component.dims {
        let (has, found) = (describe_dims(&component.dims), describe_dims(value.dims()));
        let message = format!("the attribute has the size {found}, its variable has {has}");
        return Err(Problem::new(span, message));
    }
    value.elements().iter().map(number).collect()
}

/// Sets the start of each state that an initial equation fixes; a warning for every other.
fn fix_starts<'a>(
    graph: &Graph,
    symbols: &Symbols<'a>,
    flat: &Flat,
    solution: &HashMap<Node, Node>,
    states: &mut [Variable],
) -> Vec<Box<Problem>> {
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
    let mut warnings: Vec<Box<Problem>> = flat
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

fn unread(span: Span) -> Box<Problem> {
    Problem::new(span, "an initial equation of a derivative has no effect")
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

fn does_not_fix(equation: &FlatEquation) -> Box<Problem> {
    let message = "this initial equation fixes the start of no state by itself: it has no effect";
    Problem::new(equation.span, message)
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

/// What is to hold along a run, over states and inputs; what holds whatever happens is left out.
fn assertions(
    context: &Context<'_>,
    claims: Vec<(Assertion, Span)>,
    solution: &HashMap<Node, Node>,
) -> Vec<(Assertion, Span)> {
    let graph = context.graph;
    let conditions: Vec<Node> = claims.iter().map(|(claim, _)| claim.condition).collect();
    let conditions = graph.substitute(&conditions, solution);
    let pairs = claims.into_iter().zip(conditions);
    let solved = pairs.map(|((claim, span), condition)| (Assertion { condition, ..claim }, span));
    let holds = |claim: &Assertion| graph.constant_value(claim.condition).unwrap_or(0.0) != 0.0;
    solved.filter(|(claim, _)| !holds(claim)).collect()
}

/// A warning for each assertion that fails at the declared starts.
fn failing_at_start(
    graph: &Graph,
    symbols: &Symbols<'_>,
    assertions: &[(Assertion, Span)],
    variables: &[&Variable],
) -> Vec<Box<Problem>> {
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
        .map(|(assertion, span)| {
            let message = format!("this assertion fails at the start: {}", assertion.message);
            Problem::new(*span, message)
                .hint("change the start values, or the parameters that it is about")
        })
        .collect()
}
