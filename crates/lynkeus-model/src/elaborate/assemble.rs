//! The parts of a plant, from the declared names and the solved equations: variables with their
//! attributes, start values, assertions.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Interval, Node, Tape, Unary, jacobian};

use super::delayed::Delayed;
use super::evaluate::Evaluator;
use super::events;
use super::flatten::Flat;
use super::scope::Mode;
use super::symbols::{Component, Symbols, is_outer_input};
use super::value::{Scalar, describe_dims, element_name};
use crate::balance::{FlatEquation, System, Unknown};
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::{Attribute, Causality, Declaration, ExprId, Kind, TypeName, Variability};
use crate::syntax::{plain, unquoted};
use crate::{Assertion, Parameter, Plant, Variable, balance};

/// The plant, with what looks wrong in it. Its graph is still the caller's: this one is empty.
pub(super) fn plant(symbols: &Symbols<'_>, mut flat: Flat) -> Result<(Plant, Vec<Problem>)> {
    let (graph, model) = (symbols.graph, symbols.model);
    let (mut unknowns, inputs) = unknowns(symbols, &flat.equations)?;
    let mut equations = std::mem::take(&mut flat.equations);
    let delays = symbols.delays.take();
    for delayed in &delays {
        unknowns.extend(delayed.unknowns());
        equations.extend(delayed.equations(graph));
    }
    let time = symbols.time();
    let system = System::new(graph, symbols.source, equations, unknowns, &inputs, time);
    let solution = balance::solve(system, model.name)?;
    let mut plant = Plant::empty(model.title.clone(), Graph::new(), time);
    let inputs: HashSet<Node> = inputs.into_iter().collect();
    for (place, declaration, component) in symbols.all() {
        if declaration.package.is_some() {
            continue;
        }
        let elements = elements(symbols, declaration, component)?;
        if declaration.variability == Variability::Continuous {
            let is_output = declaration.causality == Causality::Output;
            for element in elements {
                variable(symbols, element, is_output, &inputs, &solution, &mut plant);
            }
        } else if !symbols.dependent[place] {
            parameters(graph, declaration, component, elements, &mut plant);
        }
    }
    let mut warnings: Vec<Problem> = delays.iter().map(Delayed::told).collect();
    for delayed in delays {
        let start = |node: Node, plant: &Plant| {
            let mut known = symbols.parameter_values();
            known.insert(symbols.time(), Some(0.0));
            let starts = plant.states.iter().chain(&plant.inputs);
            known.extend(starts.map(|variable| (variable.node, variable.start)));
            computed(graph, node, |symbol| known.get(&symbol).copied()?)
        };
        delayed.join(graph, &solution, start, &mut plant);
    }
    let held = events::held(&flat.clauses);
    for state in plant.states.iter_mut().filter(|s| held.contains(&s.node)) {
        state.discrete = true;
        state.fixed = true;
        state.start = state.start.or(Some(0.0));
    }
    let states: Vec<Node> = plant.states.iter().map(|state| state.node).collect();
    plant.whens = events::whens(symbols, &flat.clauses, &solution, &states)?;
    warnings.extend(fix_starts(symbols, &flat, &solution, &mut plant.states));
    let found = assertions(graph, flat.claims, &solution);
    warnings.extend(failing_at_start(symbols, &found, &plant));
    plant.table_points = symbols.table_points.take();
    plant.assertions = found.into_iter().map(|(assertion, _)| assertion).collect();
    Ok((plant, warnings))
}

/// Derivatives of the states and all other variables, and the inputs apart.
fn unknowns(
    symbols: &Symbols<'_>,
    equations: &[FlatEquation],
) -> Result<(Vec<Unknown>, Vec<Node>)> {
    let (mut unknowns, mut inputs) = (vec![], vec![]);
    let sides = equations.iter().flat_map(|e| [e.left, e.right]);
    let equated: HashSet<Node> = sides.collect();
    for (_, declaration, component) in symbols.all().filter(|(.., c)| !c.is_known) {
        let is_input = declaration.causality == Causality::Input;
        let is_discrete = matches!(declaration.type_name, TypeName::Boolean | TypeName::Integer);
        for element in elements(symbols, declaration, component)? {
            let node = element.node;
            let is_open = declaration.binding.is_none() && !equated.contains(&node);
            if is_input && (is_open || is_outer_input(declaration)) {
                inputs.push(node);
                continue;
            }
            let derivative = symbols.derivative_of(node);
            // nothing is declared of derivatives
            let (start, range) = match derivative {
                Some(_) => (0.0, Interval::ENTIRE),
                None => search(&element),
            };
            unknowns.push(Unknown {
                symbol: derivative.unwrap_or(node),
                name: element.name,
                span: declaration.name,
                state: derivative.map(|_| node),
                rank: rank(symbols, declaration),
                is_discrete,
                start,
                range,
            });
        }
    }
    Ok((unknowns, inputs))
}

/// Where the search for a variable begins that a loop determines, and where it may end.
fn search(variable: &Variable) -> (f64, Interval) {
    let range = Interval::new(variable.min, variable.max).unwrap_or(Interval::ENTIRE);
    let start = variable.start.unwrap_or(0.0);
    (start.clamp(range.lo(), range.hi()), range)
}

/// How much a variable is wanted as a state, where the equations leave a choice.
fn rank(symbols: &Symbols<'_>, declaration: &Declaration) -> i32 {
    let given = |name: &str| {
        let mut attributes = declaration.attributes.iter();
        attributes.find(|attribute| attribute.name.text(symbols.source) == name)
    };
    let selected = given("stateSelect").and_then(|attribute| attribute.value);
    let selected = selected.map(|id| plain(symbols.ast.expression(id).span.text(symbols.source)));
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

/// Puts an element of a declared variable where it belongs.
fn variable(
    symbols: &Symbols<'_>,
    element: Variable,
    is_output: bool,
    inputs: &HashSet<Node>,
    solution: &HashMap<Node, Node>,
    plant: &mut Plant,
) {
    let symbol = element.node;
    if inputs.contains(&symbol) {
        plant.inputs.push(element);
        return;
    }
    let derivative = symbols.derivative_of(symbol);
    let derivative = derivative.and_then(|symbol| solution.get(&symbol).copied());
    // what was under `der` and follows from other states is none itself
    let derivative = derivative.filter(|_| !solution.contains_key(&symbol));
    let is_state = derivative.is_some();
    if let Some(derivative) = derivative {
        plant.states.push(element.clone());
        plant.derivatives.push(derivative);
    }
    let node = solution.get(&symbol).copied().unwrap_or(symbol);
    let element = Variable { node, ..element };
    if is_output {
        plant.outputs.push(element);
    } else if !is_state {
        plant.algebraics.push(element);
    }
}

/// The elements of a declared parameter, where a caller may set them.
fn parameters(
    graph: &Graph,
    declaration: &Declaration,
    component: &Component,
    elements: Vec<Variable>,
    plant: &mut Plant,
) {
    let is_fixed = declaration.variability == Variability::Constant || declaration.is_final;
    if is_fixed || declaration.type_name == TypeName::Boolean {
        return;
    }
    for (offset, mut variable) in elements.into_iter().enumerate() {
        variable.node = graph.symbol(&variable.name).node();
        let value = component.values.as_ref().map(|values| values[offset]);
        plant.parameters.push(Parameter {
            variable,
            value: value.and_then(|value| value.number(graph)),
        });
    }
}

/// The elements of a declared name, with what its attributes say of them: one value for all, or one
/// for each.
fn elements(
    symbols: &Symbols<'_>,
    declaration: &Declaration,
    component: &Component,
) -> Result<Vec<Variable>> {
    let library = declaration.library;
    let element = |(offset, scalar): (usize, &Scalar)| {
        let name = element_name(&declaration.label, &component.dims, offset);
        let node = match *scalar {
            Scalar::Real(node) | Scalar::Boolean(node) => node,
            // only a parameter may be one; these get their symbols later
            Scalar::Integer(_) => symbols.time(),
        };
        let least = library.and_then(|library| library.min);
        Variable {
            unit: library.map(|library| library.unit.to_owned()),
            description: declaration.description.clone(),
            min: least.unwrap_or(f64::NEG_INFINITY),
            integer: declaration.is_integer(),
            ..Variable::new(name, node)
        }
    };
    let elements = component.elements.iter().enumerate().map(element);
    let mut elements: Vec<Variable> = elements.collect();
    let mut given: Vec<&str> = vec![];
    for attribute in &declaration.attributes {
        let name = attribute.name.text(symbols.source);
        if given.contains(&name) {
            let message = "this attribute is given twice";
            return Err(Problem::new(attribute.name, message));
        }
        given.push(name);
        set(symbols, declaration, component, attribute, &mut elements)?;
    }
    for element in &mut elements {
        // A start that cannot be computed from parameters is not known, however fixed.
        let is_unknown = element.start.is_none() && element.start_node.is_none();
        element.fixed &= !(is_unknown && given.contains(&"start"));
        let Variable { name, min, max, .. } = element;
        if min > max {
            let message = format!("the range of `{name}` is empty: min {min} > max {max}");
            return Err(Problem::new(declaration.name, message));
        }
    }
    Ok(elements)
}

/// Sets what an attribute says of the elements.
fn set(
    symbols: &Symbols<'_>,
    declaration: &Declaration,
    component: &Component,
    attribute: &Attribute,
    elements: &mut [Variable],
) -> Result<()> {
    let name = attribute.name.text(symbols.source);
    let Some(value) = attribute.value else {
        let message = format!("expected a value for `{name}`");
        return Err(Problem::new(attribute.name, message));
    };
    let set: fn(&mut Variable, Option<f64>) = match name {
        "start" => |element, start| element.start = start,
        "min" => |element, min| element.min = min.unwrap_or(f64::NEG_INFINITY),
        "max" => |element, max| element.max = max.unwrap_or(f64::INFINITY),
        "nominal" => |element, nominal| element.nominal = nominal,
        "fixed" => |element, fixed| element.fixed = fixed == Some(1.0),
        "unit" => {
            let unit = text(symbols, value)?;
            elements
                .iter_mut()
                .for_each(|e| e.unit = Some(unit.clone()));
            return Ok(());
        }
        _ => return Ok(()),
    };
    let numbers = numbers(symbols, declaration, component, name, value)?;
    for (offset, element) in elements.iter_mut().enumerate() {
        set(element, at(&numbers, offset));
    }
    if name == "start" {
        let nodes = symbolic(symbols, value)?;
        for (offset, element) in elements.iter_mut().enumerate() {
            element.start_node = at(&nodes, offset);
        }
    }
    Ok(())
}

/// The one for all elements, or that of an element.
fn at<T: Copy>(values: &[T], offset: usize) -> Option<T> {
    match values {
        [one] => Some(*one),
        _ => values.get(offset).copied(),
    }
}

fn text(symbols: &Symbols<'_>, value: ExprId) -> Result<String> {
    let expression = symbols.ast.expression(value);
    match expression.kind {
        Kind::Text => Ok(unquoted(expression.span.text(symbols.source))),
        _ => Err(Problem::new(expression.span, "expected a string")
            .hint("write units as in `unit = \"m/s\"`")),
    }
}

/// The value of an attribute as expressions, where it depends on parameters that are symbols.
fn symbolic(symbols: &Symbols<'_>, value: ExprId) -> Result<Vec<Node>> {
    let graph = symbols.graph;
    if !symbols.options.symbolic_parameters {
        return Ok(vec![]);
    }
    let value = Evaluator::new(symbols, Mode::Parametric).value(value)?;
    let nodes = value.elements.iter().map(|scalar| scalar.real(graph));
    let nodes: Vec<Node> = nodes.collect::<Option<_>>().unwrap_or_default();
    match graph.symbols_of(&nodes).is_empty() {
        true => Ok(vec![]),
        false => Ok(nodes),
    }
}

/// The numbers of an attribute; none where it needs a parameter that has no value.
fn numbers(
    symbols: &Symbols<'_>,
    declaration: &Declaration,
    component: &Component,
    name: &str,
    id: ExprId,
) -> Result<Vec<f64>> {
    let is_truth = name == "fixed";
    let is_boolean = declaration.type_name == TypeName::Boolean;
    let mut evaluator = Evaluator::new(symbols, Mode::Structural);
    let span = evaluator.span(id);
    let Some(value) = evaluator.value_if_known(id)? else {
        return Ok(vec![]);
    };
    let graph = symbols.graph;
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
    if !value.dims.is_empty() && value.dims != component.dims {
        let (has, found) = (describe_dims(&component.dims), describe_dims(&value.dims));
        let message = format!("the attribute has the size {found}, its variable has {has}");
        return Err(Problem::new(span, message));
    }
    value.elements.iter().map(number).collect()
}

/// Sets the start of each state that an initial equation fixes; a warning for every other.
fn fix_starts(
    symbols: &Symbols<'_>,
    flat: &Flat,
    solution: &HashMap<Node, Node>,
    states: &mut [Variable],
) -> Vec<Problem> {
    let graph = symbols.graph;
    let mut at_start = solution.clone();
    at_start.insert(symbols.time(), graph.constant(0.0).node());
    let now = symbols.now();
    let values = symbols.parameter_values();
    let places: HashMap<Node, usize> = states.iter().map(|state| state.node).zip(0..).collect();
    let unread = flat.initial_unread.iter();
    let mut warnings: Vec<Problem> = unread.map(|&span| without_effect(span, UNREAD)).collect();
    for equation in &flat.initial {
        // before the start is at the start
        let sides = graph.substitute(&[equation.left, equation.right], &now);
        let sides = graph.substitute(&sides, &at_start);
        match start_fixed(graph, &values, &places, [sides[0], sides[1]]) {
            Some((place, start, value)) => {
                let state = &mut states[place];
                state.start = value;
                state.start_node = (!graph.symbols_of(&[start]).is_empty()).then_some(start);
                state.fixed = true;
                if !flat.clauses.is_empty() {
                    // what counts at events begins one value after the other
                    at_start.insert(state.node, start);
                }
            }
            None => warnings.push(without_effect(equation.span, FIXES_NONE)),
        }
    }
    warnings
}

/// The place of the state whose start an equation fixes, the start as an expression over parameters,
/// and as a number, where these have `values`.
fn start_fixed(
    graph: &Graph,
    values: &HashMap<Node, Option<f64>>,
    places: &HashMap<Node, usize>,
    [left, right]: [Node; 2],
) -> Option<(usize, Node, Option<f64>)> {
    let varying = |node: Node| {
        let mut symbols = graph.symbols_of(&[node]);
        symbols.retain(|symbol| !values.contains_key(symbol));
        symbols
    };
    // `x = e` with e free of variables
    let explicit = |state: Node, start: Node| {
        let place = *places.get(&state)?;
        varying(start).is_empty().then_some((place, start))
    };
    let solved = || {
        let residual = graph.binary(Binary::Sub, left, right);
        match varying(residual)[..] {
            [state] => Some((*places.get(&state)?, root(graph, residual, state)?)),
            _ => None,
        }
    };
    // none where the start has neither a value nor symbols
    let valued = |(place, start): (usize, Node)| {
        let value = graph.constant_value(start).or_else(|| {
            let value = computed(graph, start, |symbol| values.get(&symbol).copied()?);
            value.filter(|value| value.is_finite())
        });
        let is_symbolic = !graph.symbols_of(&[start]).is_empty();
        (value.is_some() || is_symbolic).then_some((place, start, value))
    };
    let found = explicit(left, right).and_then(valued);
    let found = found.or_else(|| explicit(right, left).and_then(valued));
    found.or_else(|| solved().and_then(valued))
}

/// Where a residual vanishes that is linear in a symbol.
fn root(graph: &Graph, residual: Node, symbol: Node) -> Option<Node> {
    let (_, slope) = *jacobian::gradient(graph, residual, &[symbol]).first()?;
    if graph.symbols_of(&[slope]).contains(&symbol) {
        return None;
    }
    let zero = HashMap::from([(symbol, graph.constant(0.0).node())]);
    let rest = graph.substitute(&[residual], &zero)[0];
    match graph.constant_value(slope) {
        Some(0.0) => None,
        Some(1.0) => Some(graph.unary(Unary::Neg, rest)),
        Some(-1.0) => Some(rest),
        _ => Some(graph.unary(Unary::Neg, graph.binary(Binary::Div, rest, slope))),
    }
}

/// The number that an expression is for values of its symbols; none where one has no value.
fn computed(graph: &Graph, node: Node, value: impl Fn(Node) -> Option<f64>) -> Option<f64> {
    let symbols = graph.symbols_of(&[node]);
    let values: Option<Vec<f64>> = symbols.iter().map(|&symbol| value(symbol)).collect();
    let tape = Tape::new(graph, &symbols, &[node]).ok()?;
    Some(tape.evaluator().value(&values?))
}

const UNREAD: &str = "an initial equation of a derivative has no effect";
const FIXES_NONE: &str =
    "this initial equation fixes the start of no state by itself: it has no effect";

fn without_effect(span: Span, message: &str) -> Problem {
    Problem::new(span, message)
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

/// What is to hold along a run, over states and inputs; what holds whatever happens is left out.
fn assertions(
    graph: &Graph,
    claims: Vec<(Assertion, Span)>,
    solution: &HashMap<Node, Node>,
) -> Vec<(Assertion, Span)> {
    let conditions: Vec<Node> = claims.iter().map(|(claim, _)| claim.condition).collect();
    let conditions = graph.substitute(&conditions, solution);
    let pairs = claims.into_iter().zip(conditions);
    let solved = pairs.map(|((claim, span), condition)| (Assertion { condition, ..claim }, span));
    let holds = |claim: &Assertion| graph.constant_value(claim.condition).unwrap_or(0.0) != 0.0;
    solved.filter(|(claim, _)| !holds(claim)).collect()
}

/// A warning for each assertion that fails at the declared starts.
fn failing_at_start(
    symbols: &Symbols<'_>,
    assertions: &[(Assertion, Span)],
    plant: &Plant,
) -> Vec<Problem> {
    let mut known = symbols.parameter_values();
    known.insert(symbols.time(), Some(0.0));
    let variables = plant.states.iter().chain(&plant.inputs);
    known.extend(variables.map(|variable| (variable.node, variable.start)));
    let fails = |assertion: &Assertion| {
        let value = |symbol| known.get(&symbol).copied()?;
        computed(symbols.graph, assertion.condition, value) == Some(0.0)
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
