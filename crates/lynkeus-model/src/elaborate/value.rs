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
    /// Sizes fit an Integer: every one of them is below the limit on elements.
    pub(crate) fn of_size(size: usize) -> Self {
        Scalar::Integer(i64::try_from(size).unwrap_or(i64::MAX))
    }

    /// As a Real expression; `None` for a Boolean.
    pub(crate) fn real(self, graph: &Graph) -> Option<Node> {
        match self {
            // Integers beyond 2⁵³ are rounded, as in any conversion to Real.
            Scalar::Integer(value) => Some(graph.constant(value as f64).node()),
            Scalar::Real(node) => Some(node),
            Scalar::Boolean(_) => None,
        }
    }

    /// Both as expressions, of Booleans those of their truth; `None` of a Boolean and a number.
    pub(crate) fn with(self, other: Self, graph: &Graph) -> Option<(Node, Node)> {
        match (self, other) {
            (Scalar::Boolean(a), Scalar::Boolean(b)) => Some((a, b)),
            _ => Some((self.real(graph)?, other.real(graph)?)),
        }
    }

    /// `if condition then self else other`
    pub(crate) fn select(self, condition: Node, other: Self, graph: &Graph) -> Option<Self> {
        let (a, b) = self.with(other, graph)?;
        let node = graph.select(condition, a, b);
        Some(match self {
            Scalar::Boolean(_) => Scalar::Boolean(node),
            _ => Scalar::Real(node),
        })
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

/// A scalar, which has no dimensions, or an array: its elements row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Value {
    pub dims: Vec<usize>,
    pub elements: Vec<Scalar>,
}

impl From<Scalar> for Value {
    fn from(scalar: Scalar) -> Self {
        Self {
            dims: vec![],
            elements: vec![scalar],
        }
    }
}

impl Value {
    pub(crate) fn vector(elements: Vec<Scalar>) -> Self {
        let dims = vec![elements.len()];
        Self { dims, elements }
    }

    pub(crate) fn as_scalar(&self) -> Option<Scalar> {
        match self.dims[..] {
            [] => self.elements.first().copied(),
            _ => None,
        }
    }
}

/// Number of elements; the largest of all numbers where it does not fit.
pub(crate) fn element_count(dims: &[usize]) -> u64 {
    let mut dims = dims.iter();
    let count = dims.try_fold(1u64, |count, &dim| count.checked_mul(dim as u64));
    count.unwrap_or(u64::MAX)
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

/// The members of a record, those of inner records by their names in full, as `z.re`; a number or
/// an array is the one member without a name.
pub(super) type Members = Vec<(String, Value)>;

/// The number or array that this is; the members back where it is a record.
pub(super) fn number(mut members: Members) -> std::result::Result<Value, Members> {
    match members.pop() {
        Some((name, value)) if name.is_empty() => Ok(value),
        last => {
            members.extend(last);
            Err(members)
        }
    }
}

/// The member of this name.
pub(super) fn member<'m>(members: &'m Members, name: &str) -> Option<&'m Value> {
    let mut members = members.iter();
    let found = members.find(|(member, _)| member == name);
    found.map(|(_, value)| value)
}

/// `z`, or its member `z.re`.
pub(super) fn member_name(record: &str, member: &str) -> String {
    match member {
        "" => record.to_owned(),
        _ => format!("{record}.{member}"),
    }
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
pub(super) fn expected_number(span: Span) -> Problem {
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
