//! What names mean where an expression stands.

use lynkeus_expr::Node;

use super::value::Scalar;

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

pub(crate) trait Scope {
    fn named(&self, name: &str, mode: Mode) -> Named<'_>;

    /// A constant by its name in full.
    fn constant(&self, _full: &str, _mode: Mode) -> Named<'_> {
        Named::Unknown
    }

    /// Dimensions of a declared name.
    fn dims(&self, name: &str) -> Option<&[usize]>;

    /// The names of the members, where the name is a record's.
    fn members(&self, _record: &str) -> Option<&[String]> {
        None
    }

    /// The symbol of the derivative, where the node is a variable that may have one.
    fn derivative(&self, variable: Node) -> Option<Node>;

    /// True for the symbol of a parameter.
    fn is_parameter(&self, _symbol: Node) -> bool {
        false
    }

    /// Declared names, for suggestions.
    fn names(&self) -> Vec<&str>;

    /// The symbol of time, where it has one.
    fn time(&self, mode: Mode) -> Option<Node>;
}
