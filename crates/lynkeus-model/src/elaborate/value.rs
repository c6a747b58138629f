//! Values of expressions while a model is written out: scalars and arrays of them.

use lynkeus_expr::{Graph, Node};

use crate::diagnostic::{Problem, Result, Span};

/// An Integer is always known; Real and Boolean values are expressions (truth is 1, else 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scalar {
    Integer(i64),
    Real(Node),
    Boolean(Node),
}

impl Scalar {
    /// As a Real expression; `None` for a Boolean.
    pub(crate) fn real(self, graph: &Graph) -> Option<Node> {
        match self {
            // Integers beyond 2⁵³ are rounded, as in any conversion to Real.
            Scalar::Integer(value) => Some(graph.constant(value as f64).node()),
            Scalar::Real(node) => Some(node),
            Scalar::Boolean(_) => None,
        }
    }

    /// The number, where it is known.
    pub(crate) fn number(self, graph: &Graph) -> Option<f64> {
        match self {
            Scalar::Integer(value) => Some(value as f64),
            Scalar::Real(node) => graph.constant_value(node),
            Scalar::Boolean(_) => None,
        }
    }
}

/// Elements row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    pub dims: Vec<usize>,
    pub elements: Vec<Scalar>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Scalar(Scalar),
    Array(Array),
}

impl Value {
    pub(crate) fn vector(elements: Vec<Scalar>) -> Self {
        let dims = vec![elements.len()];
        Value::Array(Array { dims, elements })
    }

    /// An array, or a scalar where there are no dimensions.
    pub(crate) fn new(dims: Vec<usize>, elements: Vec<Scalar>) -> Self {
        match (dims.as_slice(), elements.as_slice()) {
            ([], [scalar]) => Value::Scalar(*scalar),
            _ => Value::Array(Array { dims, elements }),
        }
    }

    pub(crate) fn dims(&self) -> &[usize] {
        match self {
            Value::Scalar(_) => &[],
            Value::Array(array) => &array.dims,
        }
    }

    pub(crate) fn elements(&self) -> &[Scalar] {
        match self {
            Value::Scalar(scalar) => std::slice::from_ref(scalar),
            Value::Array(array) => &array.elements,
        }
    }

    pub(crate) fn into_array(self) -> Array {
        match self {
            Value::Scalar(scalar) => Array {
                dims: vec![],
                elements: vec![scalar],
            },
            Value::Array(array) => array,
        }
    }
}

/// Number of elements, where it fits.
pub(crate) fn element_count(dims: &[usize]) -> Option<u64> {
    dims.iter()
        .try_fold(1u64, |count, &dim| count.checked_mul(dim as u64))
}

/// "a scalar", "[3]" or "[2, 3]".
pub(crate) fn describe_dims(dims: &[usize]) -> String {
    if dims.is_empty() {
        return "a scalar".to_owned();
    }
    let shown: Vec<String> = dims.iter().take(8).map(usize::to_string).collect();
    format!("[{}]", shown.join(", "))
}

/// `x`, `x[3]` or `A[1,2]` for the element at `offset`, row by row.
pub(crate) fn element_name(name: &str, dims: &[usize], offset: usize) -> String {
    if dims.is_empty() {
        return name.to_owned();
    }
    let mut left = offset;
    let mut subscripts: Vec<String> = vec![];
    for &dim in dims.iter().rev() {
        subscripts.push((left % dim.max(1) + 1).to_string());
        left /= dim.max(1);
    }
    subscripts.reverse();
    format!("{name}[{}]", subscripts.join(","))
}

pub(super) fn unequal_sizes(left: &[usize], right: &[usize], span: Span) -> Box<Problem> {
    let (left, right) = (describe_dims(left), describe_dims(right));
    Problem::new(
        span,
        format!("the sizes differ: left is {left}, right is {right}"),
    )
}

/// The members of a record, those of inner records by their names in full, as `z.re`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record {
    pub members: Vec<(String, Value)>,
}

impl Record {
    pub(super) fn member(&self, name: &str) -> Option<&Value> {
        let mut members = self.members.iter();
        members
            .find(|(member, _)| member == name)
            .map(|(_, value)| value)
    }

    /// The members behind `prefix.`, where there are any.
    pub(super) fn inner(&self, prefix: &str) -> Option<Record> {
        let inner = |(name, value): &(String, Value)| {
            let rest = name.strip_prefix(prefix)?.strip_prefix('.')?;
            Some((rest.to_owned(), value.clone()))
        };
        let members: Vec<(String, Value)> = self.members.iter().filter_map(inner).collect();
        (!members.is_empty()).then_some(Record { members })
    }
}

/// What one output of a function gives.
pub(super) enum Outcome {
    Value(Value),
    Record(Record),
}

/// Refuses a value of another size than its variable has.
pub(super) fn check_size(name: &str, has: &[usize], found: &[usize], span: Span) -> Result<()> {
    if has == found {
        return Ok(());
    }
    let (has, found) = (describe_dims(has), describe_dims(found));
    let message = format!("`{name}` has the size {has}, its value has {found}");
    Err(Problem::new(span, message))
}

/// Refuses a truth value where a number must stand.
pub(super) fn expected_number(span: Span) -> Box<Problem> {
    Problem::new(span, "expected a number, found a Boolean").hint("write `if a then 1 else 0`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_elements() {
        assert_eq!(element_name("x", &[], 0), "x");
        assert_eq!(element_name("x", &[4], 2), "x[3]");
        assert_eq!(element_name("A", &[2, 3], 4), "A[2,2]");
    }
}
