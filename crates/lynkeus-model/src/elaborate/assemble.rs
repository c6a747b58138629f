//! The parts of a plant, from the declared names and the solved equations.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Interval, Node};

use super::attributes::Attributes;
use super::symbols::{Component, Context, Symbols};
use super::value::{Scalar, element_name};
use crate::balance::{self, FlatEquation, System, Unknown};
use crate::syntax::Result;
use crate::syntax::ast::{Causality, Declaration, ModelSyntax, Variability};
use crate::{Parameter, Plant, Variable};

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
}

impl Parts {
    pub(super) fn with_graph(self, graph: Graph) -> Plant {
        Plant {
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
    model: &'a ModelSyntax,
    equations: &[FlatEquation],
) -> Result<Parts> {
    let (unknowns, inputs) = unknowns(context, symbols)?;
    let system = System {
        graph: context.graph,
        equations,
        unknowns: &unknowns,
    };
    let solution = balance::solve(&system, &inputs, context.source, model.name)?;
    let mut parts = Parts {
        name: model.name.text(context.source).to_owned(),
        time: symbols.time,
        states: vec![],
        derivatives: vec![],
        inputs: vec![],
        outputs: vec![],
        algebraics: vec![],
        parameters: vec![],
    };
    for (place, (declaration, component)) in symbols.all().enumerate() {
        let attributes = Attributes::new(context, symbols, declaration, component)?;
        let sorter = Sorter {
            context,
            symbols,
            declaration,
            component,
            attributes,
        };
        if declaration.prefix.variability == Variability::Continuous {
            sorter.variables(&solution, &mut parts);
        } else {
            let dependent = symbols.dependent.get(place).copied().unwrap_or_default();
            sorter.parameters(dependent, &mut parts);
        }
    }
    Ok(parts)
}

/// Derivatives of the states and all other variables, and the inputs apart.
fn unknowns(context: &Context<'_>, symbols: &Symbols<'_>) -> Result<(Vec<Unknown>, Vec<Node>)> {
    let (mut unknowns, mut inputs) = (vec![], vec![]);
    for (declaration, component) in symbols.all() {
        if component.is_known {
            continue;
        }
        if declaration.prefix.causality == Causality::Input {
            inputs.extend(nodes(component));
            continue;
        }
        let attributes = Attributes::new(context, symbols, declaration, component)?;
        for (offset, node) in nodes(component).enumerate() {
            let name = declaration.name.text(context.source);
            let name = element_name(name, &component.dims, offset);
            let span = declaration.name;
            let state = symbols.derivative_of(node);
            // nothing is declared of derivatives
            let (start, range) = match state {
                Some(_) => (0.0, Interval::ENTIRE),
                None => attributes.search(offset),
            };
            unknowns.push(Unknown {
                symbol: state.unwrap_or(node),
                name,
                span,
                state: state.map(|_| node),
                start,
                range,
            });
        }
    }
    Ok((unknowns, inputs))
}

fn nodes(component: &Component) -> impl Iterator<Item = Node> {
    component
        .elements
        .iter()
        .filter_map(|element| match element {
            Scalar::Real(node) => Some(*node),
            _ => None,
        })
}

/// Puts the elements of one declaration where they belong.
struct Sorter<'s, 'a> {
    context: &'s Context<'a>,
    symbols: &'s Symbols<'a>,
    declaration: &'s Declaration,
    component: &'s Component,
    attributes: Attributes,
}

impl Sorter<'_, '_> {
    fn variable(&self, offset: usize, node: Node) -> Variable {
        let Self {
            context,
            declaration,
            component,
            ..
        } = self;
        self.attributes
            .variable(context, declaration, &component.dims, offset, node)
    }

    fn variables(&self, solution: &HashMap<Node, Node>, parts: &mut Parts) {
        for (offset, symbol) in nodes(self.component).enumerate() {
            let causality = self.declaration.prefix.causality;
            if causality == Causality::Input {
                parts.inputs.push(self.variable(offset, symbol));
                continue;
            }
            let derivative = self.symbols.derivative_of(symbol);
            let derivative = derivative.and_then(|symbol| solution.get(&symbol).copied());
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
        if prefix.variability == Variability::Constant || prefix.is_final || dependent {
            return;
        }
        let graph = self.context.graph;
        let name = self.declaration.name.text(self.context.source);
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
