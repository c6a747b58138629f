//! Values of parameters and constants.

use super::overrides::Overrides;
use super::scope::Mode;
use super::symbols::{Component, Context, Sizes, Symbols};
use super::value::{Array, Scalar, describe_dims, element_name};
use crate::syntax::ast::{Causality, Declaration, ExprId, TypeName, Variability};
use crate::syntax::{Problem, Result, Span};

impl<'a> Symbols<'a> {
    /// A parameter: its value as sizes see it and its symbols as equations see it.
    pub(super) fn parameter(
        &self,
        context: &Context<'a>,
        overrides: &Overrides,
        sizes: &Sizes,
        place: usize,
    ) -> Result<Component> {
        let (declaration, dependent) = (&self.declarations[place], self.dependent[place]);
        let label = declaration.label.as_str();
        let name = label.strip_prefix('.').unwrap_or(label);
        if declaration.prefix.causality == Causality::Input {
            let message = format!("`{name}` is both a parameter and an input");
            return Err(Problem::new(declaration.name, message).hint("choose one of the two"));
        }
        let keeps_symbols = context.options.symbolic_parameters
            && declaration.prefix.variability == Variability::Parameter
            && !declaration.prefix.is_final
            && declaration.prefix.type_name == TypeName::Real;
        let known = self.binding(context, declaration, Mode::Structural)?;
        let dims = self.parameter_dims(context, declaration, known.as_ref())?;
        sizes.charge(context, &dims, declaration)?;
        let given = overrides.of(place, name, &dims, declaration.name)?;
        let parts = Parts {
            context,
            declaration,
            name,
            dims: &dims,
            given: &given,
        };
        let values = parts.values(known)?;
        if !context.options.symbolic_parameters {
            let values = values.ok_or_else(|| parts.no_value())?;
            let elements = values.clone();
            return Ok(Component {
                dims,
                elements,
                values: Some(values),
                is_known: true,
            });
        }
        let elements = match (dependent, &values) {
            (true, _) => {
                let symbolic = self.binding(context, declaration, Mode::Parametric)?;
                parts.symbolic(symbolic)?
            }
            (false, Some(values)) if keeps_symbols => parts.symbols_but(values),
            (false, None) if keeps_symbols => parts.symbols(),
            (false, Some(values)) => values.clone(),
            (false, None) if declaration.prefix.variability == Variability::Parameter => {
                parts.symbols()
            }
            (false, None) => return Err(parts.no_value()),
        };
        Ok(Component {
            dims,
            elements,
            values,
            is_known: true,
        })
    }

    /// The value of the declaration equation; `None` if there is none, or if it needs a
    /// parameter without value where these are allowed.
    fn binding(
        &self,
        context: &Context<'a>,
        declaration: &Declaration,
        mode: Mode,
    ) -> Result<Option<(Array, ExprId)>> {
        let Some(id) = declaration.binding else {
            return Ok(None);
        };
        let mut evaluator = self.evaluator_of(context, declaration, mode);
        match evaluator.value(id) {
            Ok(value) => Ok(Some((value.into_array(), id))),
            Err(_) if evaluator.valueless && context.options.symbolic_parameters => Ok(None),
            Err(problem) => Err(problem),
        }
    }

    /// The declared size, with `:` taken from the value.
    fn parameter_dims(
        &self,
        context: &Context<'a>,
        declaration: &Declaration,
        value: Option<&(Array, ExprId)>,
    ) -> Result<Vec<usize>> {
        let declared = self.dims(context, declaration)?;
        let found = value.map(|(array, _)| array.dims.as_slice());
        let open = |axis: usize| {
            found
                .and_then(|dims| dims.get(axis))
                .copied()
                .ok_or_else(|| {
                    let message = "the size `:` needs a value to be taken from";
                    Problem::new(declaration.name, message)
                })
        };
        let sizes = declared.into_iter().enumerate();
        sizes
            .map(|(axis, size)| size.map_or_else(|| open(axis), Ok))
            .collect()
    }
}

/// One declaration with what is known about it.
struct Parts<'p> {
    context: &'p Context<'p>,
    declaration: &'p Declaration,
    name: &'p str,
    dims: &'p [usize],
    given: &'p [(usize, f64)],
}

impl Parts<'_> {
    /// Known values of all elements; `None` where some have none.
    fn values(&self, binding: Option<(Array, ExprId)>) -> Result<Option<Vec<Scalar>>> {
        let count: usize = self.dims.iter().product();
        let mut values = vec![None; count];
        if let Some((array, id)) = binding {
            self.check_size(&array, id)?;
            let span = self.context.ast.expression(id).span;
            for (slot, element) in values.iter_mut().zip(array.elements) {
                *slot = Some(self.known(element, span)?);
            }
        }
        for &(offset, value) in self.given {
            let value = self.converted(value)?;
            if let Some(slot) = values.get_mut(offset) {
                *slot = Some(value);
            }
        }
        Ok(values.into_iter().collect())
    }

    /// Expressions over other parameters, but for elements set from outside.
    fn symbolic(&self, binding: Option<(Array, ExprId)>) -> Result<Vec<Scalar>> {
        let Some((array, id)) = binding else {
            return Ok(self.symbols());
        };
        self.check_size(&array, id)?;
        let span = self.context.ast.expression(id).span;
        let graph = self.context.graph;
        let is_boolean = self.declaration.prefix.type_name == TypeName::Boolean;
        let typed = |element: Scalar| {
            if is_boolean {
                return match element {
                    Scalar::Boolean(_) => Ok(element),
                    _ => Err(Problem::new(span, "expected `true` or `false`")),
                };
            }
            let node = element.real(graph).ok_or_else(|| expected_number(span))?;
            Ok(Scalar::Real(node))
        };
        let mut elements: Vec<Scalar> = array
            .elements
            .into_iter()
            .map(typed)
            .collect::<Result<_>>()?;
        for &(offset, value) in self.given {
            if let Some(slot) = elements.get_mut(offset) {
                *slot = match is_boolean {
                    true => self.converted(value)?,
                    false => Scalar::Real(graph.constant(value).node()),
                };
            }
        }
        Ok(elements)
    }

    fn symbols(&self) -> Vec<Scalar> {
        let count: usize = self.dims.iter().product();
        let graph = self.context.graph;
        let symbol = |offset| {
            graph
                .symbol(&element_name(self.name, self.dims, offset))
                .node()
        };
        (0..count)
            .map(|offset| Scalar::Real(symbol(offset)))
            .collect()
    }

    /// Symbols, but for elements that are to be numbers.
    fn symbols_but(&self, values: &[Scalar]) -> Vec<Scalar> {
        let numbers = &self.context.options.numbers;
        let mut elements = self.symbols();
        for (offset, (element, value)) in elements.iter_mut().zip(values).enumerate() {
            if numbers.contains(&element_name(self.name, self.dims, offset)) {
                *element = *value;
            }
        }
        elements
    }

    fn check_size(&self, array: &Array, id: ExprId) -> Result<()> {
        if array.dims == self.dims {
            return Ok(());
        }
        let (has, found) = (describe_dims(self.dims), describe_dims(&array.dims));
        let message = format!("`{}` has the size {has}, its value has {found}", self.name);
        let span = self.context.ast.expression(id).span;
        Err(Problem::new(span, message).maybe_hint(
            array
                .dims
                .is_empty()
                .then(|| "use `fill(value, size)`".to_owned()),
        ))
    }

    /// A value of the declared type.
    fn known(&self, element: Scalar, span: Span) -> Result<Scalar> {
        let graph = self.context.graph;
        if self.declaration.prefix.type_name == TypeName::Boolean {
            return match element {
                Scalar::Boolean(node) if graph.constant_value(node).is_some() => Ok(element),
                _ => Err(Problem::new(span, "expected `true` or `false`")),
            };
        }
        let node = element.real(graph).ok_or_else(|| expected_number(span))?;
        match (element, self.declaration.prefix.is_integer()) {
            (Scalar::Integer(_), true) => Ok(element),
            (_, true) => {
                let message = format!("`{}` is an Integer, its value is a Real", self.name);
                Err(Problem::new(span, message).hint("use `div(a, b)` or `integer(a)`"))
            }
            _ if graph.constant_value(node).is_some() => Ok(Scalar::Real(node)),
            _ => {
                let message = format!("the value of `{}` is not a finite number", self.name);
                Err(Problem::new(span, message))
            }
        }
    }

    fn converted(&self, value: f64) -> Result<Scalar> {
        if self.declaration.prefix.type_name == TypeName::Boolean {
            let node = self
                .context
                .graph
                .constant(f64::from(u8::from(value != 0.0)));
            return Ok(Scalar::Boolean(node.node()));
        }
        if !self.declaration.prefix.is_integer() {
            return Ok(Scalar::Real(self.context.graph.constant(value).node()));
        }
        if value.fract() != 0.0 || value.abs() > 2f64.powi(53) {
            let message = format!(
                "`{}` is an Integer and is given the value {value}",
                self.name
            );
            return Err(Problem::new(self.declaration.name, message).hint("give a whole number"));
        }
        Ok(Scalar::Integer(value as i64))
    }

    fn no_value(&self) -> Problem {
        let name = self.name;
        Problem::new(
            self.declaration.name,
            format!("parameter `{name}` has no value"),
        )
        .hint(format!(
            "write `{name} = …` here, or give the value on loading"
        ))
    }
}

fn expected_number(span: Span) -> Problem {
    Problem::new(span, "expected a number, found a Boolean").hint("write `if a then 1 else 0`")
}
