//! The declared names of a model, with sizes, symbols and values.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Graph, Node};

use super::clauses::EventSymbols;
use super::delayed::Delayed;
use super::scope::{Mode, Named};
use super::value::Scalar;
use crate::LoadOptions;
use crate::flat::{Classes, FlatModel, constant_label};
use crate::limits::{Budget, MAX_ELABORATED, MAX_RANK, MAX_SCALARS, MAX_TEXT};
use crate::syntax::ast::{Ast, Causality, Declaration, Variability};

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

/// What a name means to the caller who has a single expression read.
pub(crate) type Names<'a> = &'a dyn Fn(&str) -> Option<Node>;

/// All declared names of a model, and the text that they stand in.
pub(crate) struct Symbols<'a> {
    pub source: &'a str,
    pub ast: &'a Ast,
    pub graph: &'a Graph,
    pub model: &'a FlatModel,
    pub classes: &'a Classes<'a>,
    pub options: &'a LoadOptions,
    /// where there is no model; behind them `pi`, and `time` where nothing must be known
    pub given: Option<Names<'a>>,
    pub budget: Budget,
    /// what declarations are written out to
    pub(super) scalars: Budget,
    pub(super) texts: Budget,
    /// of which the points of tables are made, found on the way
    pub table_points: RefCell<BTreeSet<Node>>,
    /// the delays that equations have
    pub(super) delays: RefCell<Vec<Delayed>>,
    pub(super) by_name: HashMap<&'a str, usize>,
    pub(super) components: Vec<Option<Component>>,
    /// arrays whose elements are declared by themselves: `x` of `x[1]` and `x[2]`
    pub(super) gathered: HashMap<String, Component>,
    /// symbols of parameters
    pub(super) parameters: HashSet<Node>,
    /// symbols that may stand in `der`, with the symbols of their derivatives once they do
    pub(super) derivatives: RefCell<HashMap<Node, Option<Node>>>,
    /// what the text says of events, found on the way
    pub(super) events: RefCell<EventSymbols>,
    /// of each declaration: true where the value of a parameter is made from other parameters
    pub dependent: Vec<bool>,
}

impl<'a> Symbols<'a> {
    /// A text of which no declaration is known yet.
    pub(crate) fn new(
        source: &'a str,
        ast: &'a Ast,
        graph: &'a Graph,
        model: &'a FlatModel,
        classes: &'a Classes<'a>,
        options: &'a LoadOptions,
    ) -> Self {
        Self {
            source,
            ast,
            graph,
            model,
            classes,
            options,
            given: None,
            budget: Budget::new(
                MAX_ELABORATED,
                "scalar operations when loops and arrays are written out",
            ),
            scalars: Budget::new(MAX_SCALARS, "scalar variables and parameters"),
            texts: Budget::new(MAX_TEXT, "bytes of names, units and descriptions"),
            table_points: RefCell::default(),
            delays: RefCell::default(),
            by_name: HashMap::new(),
            components: vec![],
            gathered: HashMap::new(),
            parameters: HashSet::new(),
            derivatives: RefCell::default(),
            events: RefCell::default(),
            dependent: vec![],
        }
    }

    /// Places of the declarations, with their components, in order of the text.
    pub(crate) fn all(&self) -> impl Iterator<Item = (usize, &'a Declaration, &Component)> {
        let pairs = self.model.declarations.iter().zip(&self.components);
        let pairs = pairs.enumerate();
        pairs.filter_map(|(place, (declaration, component))| {
            Some((place, declaration, component.as_ref()?))
        })
    }

    /// The symbol of time.
    pub(crate) fn time(&self) -> Node {
        self.graph.symbol("time").node()
    }

    /// The symbols of parameters with their values, where they have one.
    pub(super) fn parameter_values(&self) -> HashMap<Node, Option<f64>> {
        let mut found = HashMap::new();
        for component in self.components.iter().flatten().filter(|c| c.is_known) {
            for (offset, element) in component.elements.iter().enumerate() {
                let value = component.values.as_ref().map(|values| values[offset]);
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

impl Symbols<'_> {
    fn component_named(&self, name: &str) -> Option<&Component> {
        let place = self.by_name.get(name).copied();
        let declared = place.and_then(|place| self.components.get(place)?.as_ref());
        declared.or_else(|| self.gathered.get(name))
    }

    pub(super) fn named(&self, name: &str, mode: Mode) -> Named<'_> {
        if let Some(names) = self.given {
            return self.named_by(names, name, mode);
        }
        let Some(component) = self.component_named(name) else {
            return Named::Unknown;
        };
        match (mode, &component.values) {
            (Mode::Structural | Mode::Parametric, _) if !component.is_known => Named::Varying,
            (Mode::Structural, Some(values)) => Named::Array(&component.dims, values),
            (Mode::Structural, None) => Named::Valueless,
            _ => Named::Array(&component.dims, &component.elements),
        }
    }

    fn named_by(&self, names: Names<'_>, name: &str, mode: Mode) -> Named<'_> {
        let pi = || (name == "pi").then(|| self.graph.constant(std::f64::consts::PI).node());
        let node = names(name).or_else(pi);
        match node {
            Some(node) if mode != Mode::Continuous && self.graph.constant_value(node).is_none() => {
                Named::Varying
            }
            Some(node) => Named::Scalar(Scalar::Real(node)),
            None => Named::Unknown,
        }
    }

    /// One of a package, or of the model and its bases; flat texts declare those of packages in
    /// the model, by their names in full.
    pub(super) fn constant(&self, full: &str, mode: Mode) -> Named<'_> {
        match self.named(&constant_label(full), mode) {
            Named::Unknown => {}
            found => return found,
        }
        let in_class = |class: &String| full.strip_prefix(class.as_str())?.strip_prefix('.');
        let own = self.model.scopes.iter().find_map(in_class);
        let own = own.or(full.contains('.').then_some(full));
        let is_constant = |name: &&str| {
            let place = self.by_name.get(name);
            let declaration = place.and_then(|&place| self.model.declarations.get(place));
            declaration.is_some_and(|d| d.variability == Variability::Constant)
        };
        let name = own.filter(is_constant);
        name.map_or(Named::Unknown, |name| self.named(name, mode))
    }

    /// Dimensions of a declared name.
    pub(super) fn dims(&self, name: &str) -> Option<&[usize]> {
        Some(&self.component_named(name)?.dims)
    }

    /// The symbol of the derivative, where the node is a variable that may have one.
    pub(super) fn derivative(&self, variable: Node) -> Option<Node> {
        let mut derivatives = self.derivatives.borrow_mut();
        let slot = derivatives.get_mut(&variable)?;
        if slot.is_none() {
            let name = self.graph.symbol_name(variable)?;
            *slot = Some(self.graph.fresh(format!("der({name})")).node());
        }
        *slot
    }

    /// Declared names, for suggestions.
    pub(super) fn names(&self) -> Vec<&str> {
        if self.given.is_some() {
            return vec!["pi", "time"];
        }
        let names = self.by_name.keys();
        names
            .map(|name| name.strip_prefix('.').unwrap_or(name))
            .collect()
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
            && !by_name.contains_key(base)
            && let Some(component) = &components[place]
            && component.dims.is_empty()
        {
            let group = groups.entry(base).or_default();
            group.push((subscripts, component));
        }
    }
    let groups = groups.into_iter();
    groups
        .filter_map(|(base, elements)| Some((base.to_owned(), gather(elements)?)))
        .collect()
}

/// `x` and 1, 2 of `x[1,2]`.
pub(super) fn literal_subscripts(name: &str) -> Option<(&str, Vec<usize>)> {
    let (base, inside) = name.strip_suffix(']')?.rsplit_once('[')?;
    let numbers = inside.split(',').map(|number| number.trim().parse().ok());
    let numbers: Vec<usize> = numbers.collect::<Option<_>>()?;
    (numbers.len() <= MAX_RANK).then_some((base.trim(), numbers))
}

/// The array of all elements; `None` where some are missing.
fn gather(mut elements: Vec<(Vec<usize>, &Component)>) -> Option<Component> {
    elements.sort_by(|(a, _), (b, _)| a.cmp(b));
    let dims = elements.last()?.0.clone();
    let count = dims.iter().try_fold(1usize, |n, &dim| n.checked_mul(dim))?;
    let fits = |(subscripts, _): &(Vec<usize>, &Component)| {
        let mut pairs = subscripts.iter().zip(&dims);
        subscripts.len() == dims.len() && pairs.all(|(s, dim)| (1..=*dim).contains(s))
    };
    if count != elements.len() || !elements.iter().all(fits) {
        return None;
    }
    let components = || elements.iter().map(|(_, component)| *component);
    let values = components().map(|c| Some(c.values.as_ref()?[0]));
    Some(Component {
        values: values.collect(),
        is_known: components().all(|component| component.is_known),
        elements: components()
            .map(|component| component.elements[0])
            .collect(),
        dims,
    })
}
