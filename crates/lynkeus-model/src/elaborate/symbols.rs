//! The declared names of a model, with sizes, symbols and values.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap, HashSet};

use lynkeus_expr::{Graph, Node};

use super::evaluate::Evaluator;
use super::frame::Frame;
use super::order::{Order, order};
use super::overrides::Overrides;
use super::scope::{Mode, Named, Scope};
use super::value::{Scalar, element_count, element_name};
use crate::LoadOptions;
use crate::flat::{Classes, FlatModel, constant_label};
use crate::limits::{Budget, MAX_SCALARS, MAX_TEXT};
use crate::syntax::ast::{Ast, Causality, Declaration, Kind, TypeName, Variability};
use crate::syntax::{Problem, Result};

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

/// What all parts of the elaboration share.
pub(crate) struct Context<'a> {
    pub source: &'a str,
    pub ast: &'a Ast,
    pub graph: &'a Graph,
    pub budget: &'a Budget,
    pub options: &'a LoadOptions,
    pub model: &'a FlatModel,
    pub classes: &'a Classes<'a>,
    /// of which the points of tables are made, found on the way
    pub table_points: &'a RefCell<BTreeSet<Node>>,
}

/// All declared names of a model.
pub(crate) struct Symbols<'a> {
    pub declarations: &'a [Declaration],
    by_name: HashMap<&'a str, usize>,
    components: Vec<Option<Component>>,
    /// arrays whose elements are declared by themselves: `x` of `x[1]` and `x[2]`
    gathered: HashMap<String, Component>,
    /// symbols of parameters
    parameters: HashSet<Node>,
    model: &'a FlatModel,
    /// symbols that may stand in `der`, with the symbols of their derivatives once they do
    derivatives: RefCell<HashMap<Node, Option<Node>>>,
    pub time: Node,
    graph: &'a Graph,
    pub dependent: Vec<bool>,
}

impl<'a> Symbols<'a> {
    pub(crate) fn new(context: &Context<'a>) -> Result<Self> {
        let model = context.model;
        let by_name = index_names(context.source, &model.declarations)?;
        let Order {
            sequence,
            dependent,
        } = order(context, &by_name)?;
        let overrides = Overrides::new(context, &by_name)?;
        let mut symbols = Self {
            declarations: &model.declarations,
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
        symbols.gathered = super::names::gathered(&symbols.by_name, &symbols.components);
        Ok(symbols)
    }

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
        let Context {
            source,
            ast,
            graph,
            budget,
            ..
        } = context;
        Evaluator::new(source, ast, graph, budget, self, mode).within(context)
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

    fn component(
        &self,
        context: &Context<'a>,
        overrides: &Overrides,
        sizes: &Sizes,
        place: usize,
    ) -> Result<Component> {
        let declaration = &self.declarations[place];
        let name = declaration.label.as_str();
        if declaration.prefix.variability != Variability::Continuous {
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
        let is_boolean = declaration.prefix.type_name == TypeName::Boolean;
        if is_boolean && declaration.prefix.causality == Causality::Input {
            let problem = Problem::new(declaration.name, "a Boolean input is not supported");
            return Err(problem.hint("use a Real and compare it, as in `if u > 0.5 then …`"));
        }
        let may_have_derivative =
            declaration.prefix.type_name == TypeName::Real && !is_outer_input(declaration);
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
    pub(super) fn dims(
        &self,
        context: &Context<'a>,
        declaration: &Declaration,
    ) -> Result<Vec<Option<usize>>> {
        let mut evaluator = self.evaluator_of(context, declaration, Mode::Structural);
        let length = |&id| match context.ast.expression(id).kind {
            Kind::All => Ok(None),
            _ => evaluator.length(id).map(Some),
        };
        declaration.dimensions.iter().map(length).collect()
    }
}

/// Budgets of what declarations are written out to.
pub(super) struct Sizes {
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

    pub(super) fn charge(
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
            (Some(name), Some(declaration))
                if declaration.prefix.variability == Variability::Constant =>
            {
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
    declaration.prefix.causality == Causality::Input
        && declaration.binding.is_none()
        && !declaration.label.contains('.')
}

fn index_names<'a>(
    source: &'a str,
    declarations: &'a [Declaration],
) -> Result<HashMap<&'a str, usize>> {
    let reserved: HashSet<&str> = ["time"].into();
    let mut by_name: HashMap<&str, usize> = HashMap::with_capacity(declarations.len());
    for (place, declaration) in declarations.iter().enumerate() {
        let name = declaration.label.as_str();
        if reserved.contains(name) {
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
