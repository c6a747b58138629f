//! What names mean where an expression stands: in a model, and in a function or an algorithm whose
//! statements are carried out.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::{Graph, Node};

use super::value::{Scalar, Value};

/// How much may be unknown in an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// everything has a value: sizes, loop bounds, subscripts, attributes
    Structural,
    /// parameters may be symbols: values of parameters
    Parametric,
    /// anything: equations
    Continuous,
}

/// The meaning of a name.
#[derive(Clone, Debug)]
pub(crate) enum Named<'a> {
    Array(&'a [usize], &'a [Scalar]),
    Scalar(Scalar),
    /// a variable, where the mode allows none
    Varying,
    /// a parameter without value, where one is needed
    Valueless,
    Unknown,
}

/// What the statements have given values to so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Frame {
    pub locals: BTreeMap<String, Local>,
    /// names of the members of its records
    pub records: HashMap<String, Vec<String>>,
    /// names outside of it are constants only
    pub is_function: bool,
}

/// A variable; an element without value is `None`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Local {
    pub dims: Vec<usize>,
    pub elements: Vec<Option<Scalar>>,
    pub is_integer: bool,
}

impl Local {
    pub(super) fn without_value(dims: Vec<usize>, is_integer: bool) -> Self {
        let count = dims.iter().product();
        Self {
            dims,
            elements: vec![None; count],
            is_integer,
        }
    }

    /// A Real with this value.
    pub(super) fn of(value: Value) -> Self {
        Self {
            dims: value.dims,
            elements: value.elements.into_iter().map(Some).collect(),
            is_integer: false,
        }
    }

    /// All elements; `None` where one has no value.
    pub(super) fn value(&self) -> Option<Value> {
        let elements: Option<Vec<Scalar>> = self.elements.iter().copied().collect();
        Some(Value {
            dims: self.dims.clone(),
            elements: elements?,
        })
    }

    /// A value of this variable's type: what stands in a Real is a Real.
    pub(super) fn converted(&self, scalar: Scalar, graph: &Graph) -> Scalar {
        match scalar {
            Scalar::Integer(_) if !self.is_integer => {
                scalar.real(graph).map_or(scalar, Scalar::Real)
            }
            _ => scalar,
        }
    }
}

impl Frame {
    /// Nothing has a value, and names outside of it are constants only.
    pub(super) fn closed() -> Self {
        Self {
            is_function: true,
            ..Self::default()
        }
    }

    /// What a copy costs.
    pub(super) fn size(&self) -> usize {
        let elements = self.locals.values().map(|local| local.elements.len());
        self.locals.len() + elements.sum::<usize>()
    }

    /// What holds behind an `if`: the values of one branch or the other.
    pub(super) fn joined(condition: Node, yes: Frame, mut no: Frame, graph: &Graph) -> Frame {
        for (name, local) in &mut no.locals {
            let Some(other) = yes.locals.get(name) else {
                continue;
            };
            for (b, a) in local.elements.iter_mut().zip(&other.elements) {
                *b = either(condition, *a, *b, graph);
            }
        }
        no
    }
}

fn either(condition: Node, a: Option<Scalar>, b: Option<Scalar>, graph: &Graph) -> Option<Scalar> {
    let (a, b) = (a?, b?);
    match a == b {
        true => Some(a),
        false => a.select(condition, b, graph),
    }
}
