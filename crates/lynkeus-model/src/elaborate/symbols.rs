//! The declared names of a model, with sizes, symbols and values.

use super::scope::Context;
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Graph, Node};

use super::evaluate::Evaluator;
use super::scope::{Frame, Mode, Named, Scope};
use super::value::Scalar;
use crate::flat::{FlatModel, constant_label};
use crate::limits::MAX_RANK;
use crate::syntax::ast::{Causality, Declaration, Variability};

/// A declared name.
#[derive(Debug)]
pub(crate) struct Component {
    pub dims: Vec<usize>,
    /// as equations see it: symbols of variables; values or symbols of parameters
    pub elements: Vec<Scalar>,
    /// as sizes and attributes see it; `None` for variables and parameters without value
    pub values: Option<Vec<Scalar>>,
    pub is_known: bool,
}

/// All declared names of a model.
pub(crate) struct Symbols<'a> {
    pub declarations: &'a [Declaration],
    pub(super) by_name: HashMap<&'a str, usize>,
    pub(super) components: Vec<Option<Component>>,
    /// arrays whose elements are declared by themselves: `x` of `x[1]` and `x[2]`
    pub(super) gathered: HashMap<String, Component>,
    /// symbols of parameters
    pub(super) parameters: HashSet<Node>,
    pub(super) model: &'a FlatModel,
    /// symbols that may stand in `der`, with the symbols of their derivatives once they do
    pub(super) derivatives: RefCell<HashMap<Node, Option<Node>>>,
    pub time: Node,
    pub(super) graph: &'a Graph,
    pub dependent: Vec<bool>,
}

impl<'a> Symbols<'a> {
    /// Declarations with their components, in order of the text.
    pub(crate) fn all(&self) -> impl Iterator<Item = (&'a Declaration, &Component)> {
        self.placed()
            .map(|(_, declaration, component)| (declaration, component))
    }

    /// The same with their places among the declarations.
    pub(crate) fn placed(&self) -> impl Iterator<Item = (usize, &'a Declaration, &Component)> {
        let pairs = self.declarations.iter().zip(&self.components).enumerate();
        pairs.filter_map(|(place, (declaration, component))| {
            Some((place, declaration, component.as_ref()?))
        })
    }

    pub(crate) fn evaluator<'e>(&'e self, context: &'e Context<'a>, mode: Mode) -> Evaluator<'e> {
        let (source, ast) = (context.source, context.ast);
        Evaluator::new(source, ast, context.graph, context.budget, self, mode).within(context)
    }

    /// For the declaration of a name: of a package, only what it knows.
    pub(super) fn evaluator_of<'e>(
        &'e self,
        context: &'e Context<'a>,
        declaration: &'e Declaration,
        mode: Mode,
    ) -> Evaluator<'e> {
        let mut evaluator = self.evaluator(context, mode);
        if let Some(package) = &declaration.package {
            evaluator.scopes = vec![package];
            evaluator.frame = Some(Frame::closed());
        }
        evaluator
    }

    /// The symbols of parameters with their values, where they have one.
    pub(super) fn parameter_values(&self) -> HashMap<Node, Option<f64>> {
        let mut found = HashMap::new();
        for component in self.components.iter().flatten().filter(|c| c.is_known) {
            for (offset, element) in component.elements.iter().enumerate() {
                let value = component
                    .values
                    .as_ref()
                    .and_then(|values| values.get(offset));
                let value = value.and_then(|value| value.number(self.graph));
                if let Some(node) = element.real(self.graph) {
                    found.insert(node, value);
                }
            }
        }
        found
    }

    /// The symbol of the derivative of a state; `None` if it is no state.
    pub(crate) fn derivative_of(&self, variable: Node) -> Option<Node> {
        self.derivatives.borrow().get(&variable).copied().flatten()
    }
}

impl Scope for Symbols<'_> {
    fn named(&self, name: &str, mode: Mode) -> Named<'_> {
        let place = self.by_name.get(name).copied();
        let declared = place.and_then(|place| self.components.get(place)?.as_ref());
        let Some(component) = declared.or_else(|| self.gathered.get(name)) else {
            return Named::Unknown;
        };
        match (mode, &component.values) {
            (Mode::Structural | Mode::Parametric, _) if !component.is_known => Named::Varying,
            (Mode::Structural, Some(values)) => Named::Array(&component.dims, values),
            (Mode::Structural, None) => Named::Valueless,
            _ => Named::Array(&component.dims, &component.elements),
        }
    }

    /// One of a package, or of the model and its bases; flat texts declare those of packages in
    /// the model, by their names in full.
    fn constant(&self, full: &str, mode: Mode) -> Named<'_> {
        match self.named(&constant_label(full), mode) {
            Named::Unknown => {}
            found => return found,
        }
        let in_class = |class: &String| full.strip_prefix(class.as_str())?.strip_prefix('.');
        let own = self.model.scopes.iter().find_map(in_class);
        let own = own.or(full.contains('.').then_some(full));
        let place = own.and_then(|name| self.by_name.get(name));
        let declaration = place.and_then(|&place| self.declarations.get(place));
        match (own, declaration) {
            (Some(name), Some(declaration)) if declaration.variability == Variability::Constant => {
                self.named(name, mode)
            }
            _ => Named::Unknown,
        }
    }

    fn dims(&self, name: &str) -> Option<&[usize]> {
        let place = self.by_name.get(name).copied();
        let declared = place.and_then(|place| self.components.get(place)?.as_ref());
        Some(&declared.or_else(|| self.gathered.get(name))?.dims)
    }

    fn members(&self, record: &str) -> Option<&[String]> {
        self.model.records.get(record).map(Vec::as_slice)
    }

    fn derivative(&self, variable: Node) -> Option<Node> {
        let mut derivatives = self.derivatives.borrow_mut();
        let slot = derivatives.get_mut(&variable)?;
        if slot.is_none() {
            let name = self.graph.symbol_name(variable)?;
            *slot = Some(self.graph.fresh(format!("der({name})")).node());
        }
        *slot
    }

    fn is_parameter(&self, symbol: Node) -> bool {
        self.parameters.contains(&symbol)
    }

    fn names(&self) -> Vec<&str> {
        let names = self.by_name.keys();
        names
            .map(|name| name.strip_prefix('.').unwrap_or(name))
            .collect()
    }

    fn time(&self, mode: Mode) -> Option<Node> {
        (mode == Mode::Continuous).then_some(self.time)
    }
}

/// True for an input that nothing in the model can determine: one of a part, as `r1.u`, may be
/// equated with another variable.
pub(super) fn is_outer_input(declaration: &Declaration) -> bool {
    declaration.causality == Causality::Input
        && declaration.binding.is_none()
        && !declaration.label.contains('.')
}

/// Arrays whose elements are declared one by one, as `x[1]` and `x[2]`.
pub(super) fn gathered(
    by_name: &HashMap<&str, usize>,
    components: &[Option<Component>],
) -> HashMap<String, Component> {
    let mut groups: HashMap<&str, Vec<(Vec<usize>, &Component)>> = HashMap::new();
    for (&name, &place) in by_name {
        if let Some((base, subscripts)) = literal_subscripts(name)
            && let Some(Some(component)) = components.get(place)
            && component.dims.is_empty()
        {
            groups
                .entry(base)
                .or_default()
                .push((subscripts, component));
        }
    }
    let whole = groups
        .into_iter()
        .filter_map(|(base, elements)| Some((base.to_owned(), gather(elements)?)));
    whole
        .filter(|(base, _)| !by_name.contains_key(base.as_str()))
        .collect()
}

/// `x` and 1, 2 of `x[1,2]`.
fn literal_subscripts(name: &str) -> Option<(&str, Vec<usize>)> {
    let (base, inside) = name.strip_suffix(']')?.rsplit_once('[')?;
    let numbers = inside.split(',').map(|number| number.parse().ok());
    let numbers: Vec<usize> = numbers.collect::<Option<_>>()?;
    (numbers.len() <= MAX_RANK).then_some((base, numbers))
}

/// The array of all elements; `None` where some are missing.
fn gather(mut elements: Vec<(Vec<usize>, &Component)>) -> Option<Component> {
    elements.sort_by(|(a, _), (b, _)| a.cmp(b));
    let dims = elements.last()?.0.clone();
    let count = dims.iter().try_fold(1usize, |n, &dim| n.checked_mul(dim))?;
    let fits = |(subscripts, _): &(Vec<usize>, &Component)| {
        let within = subscripts
            .iter()
            .zip(&dims)
            .all(|(s, dim)| (1..=*dim).contains(s));
        subscripts.len() == dims.len() && within
    };
    if count != elements.len() || !elements.iter().all(fits) {
        return None;
    }
    let values = elements
        .iter()
        .map(|(_, c)| c.values.as_ref()?.first().copied());
    Some(Component {
        values: values.collect(),
        is_known: elements.iter().all(|(_, component)| component.is_known),
        elements: elements
            .iter()
            .filter_map(|(_, c)| c.elements.first().copied())
            .collect(),
        dims,
    })
}
