//! The parts of a plant, from the declared names and the solved equations.

use std::collections::{BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Graph, Interval, Node};

use super::attributes::Attributes;
use super::claims;
use super::flatten::Flat;
use super::starts;
use super::symbols::{Component, Context, Symbols, is_outer_input};
use super::value::{Scalar, element_name};
use crate::balance::{self, FlatEquation, System, Unknown};
use crate::syntax::ast::{Causality, Declaration, TypeName, Variability};
use crate::syntax::{Problem, Result, plain};
use crate::{Assertion, Parameter, Plant, Variable};

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
    parts.warnings = starts::fix(graph, symbols, flat, &solution, &mut parts.states);
    let found = claims::assertions(context, &flat.claims, &solution);
    let variables: Vec<&Variable> = parts.states.iter().chain(&parts.inputs).collect();
    let failing = claims::failing_at_start(graph, symbols, &found, &variables);
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
