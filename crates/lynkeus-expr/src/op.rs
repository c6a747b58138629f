//! Nodes, and the operations that they stand for.

/// A node of a [`Graph`](crate::Graph): cheap to copy, meaningful only with its graph.
/// Arguments of a node are always smaller than the node itself.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub struct Node(pub(crate) u32);

impl Node {
    /// Position of the node in the order of construction.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Operations of one argument.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub enum Unary {
    /// −x
    Neg,
    /// |x|
    Abs,
    /// −1, 0 or 1; NaN stays NaN
    Sign,
    /// the largest integer not above x
    Floor,
    /// √x
    Sqrt,
    /// eˣ
    Exp,
    /// natural logarithm
    Ln,
    /// sine
    Sin,
    /// cosine
    Cos,
    /// tangent
    Tan,
    /// inverse sine
    Asin,
    /// inverse cosine
    Acos,
    /// inverse tangent
    Atan,
    /// hyperbolic sine
    Sinh,
    /// hyperbolic cosine
    Cosh,
    /// hyperbolic tangent
    Tanh,
    /// logical not of a truth value (1 − x)
    Not,
}

/// Operations of two arguments. Truth values are 1 and 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub enum Binary {
    /// x + y
    Add,
    /// x − y
    Sub,
    /// x·y
    Mul,
    /// x/y
    Div,
    /// xʸ for a real exponent (base ≥ 0, as `f64::powf`)
    Pow,
    /// the angle of the point (x, y) = (second, first) argument
    Atan2,
    /// the smaller one; NaN if either is
    Min,
    /// the larger one; NaN if either is
    Max,
    /// x < y
    Less,
    /// x ≤ y
    LessEq,
    /// x = y
    Equal,
    /// both truth values
    And,
    /// either truth value
    Or,
}

impl Unary {
    /// Every operation.
    pub const ALL: [Self; 17] = {
        use Unary::*;
        [
            Neg, Abs, Sign, Floor, Sqrt, Exp, Ln, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh,
            Tanh, Not,
        ]
    };

    /// Whether the value jumps where the argument does not.
    pub(crate) fn jumps(self) -> bool {
        matches!(self, Self::Sign | Self::Floor | Self::Not)
    }
}

impl Binary {
    /// Every operation, the arithmetic ones first.
    pub const ALL: [Self; 13] = {
        use Binary::*;
        [
            Add, Sub, Mul, Div, Pow, Atan2, Min, Max, Less, LessEq, Equal, And, Or,
        ]
    };

    /// Whether the value jumps where the arguments do not, other than at the cut of the angle.
    pub(crate) fn jumps(self) -> bool {
        use Binary::*;
        matches!(self, Less | LessEq | Equal | And | Or)
    }

    /// True where exchanging the arguments gives the same value.
    pub(crate) fn commutes(self) -> bool {
        use Binary::*;
        matches!(self, Add | Mul | Min | Max | Equal | And | Or)
    }
}

/// A product and a sum that are rounded once, of the two that a [tape](crate::Tape::fused) has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fused {
    /// x·y + z
    Add,
    /// x·y − z
    Sub,
    /// z − x·y
    From,
}

/// What a node of a [`Graph`](crate::Graph) is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Op {
    /// a number
    Constant(f64),
    /// a free variable: its index among the graph's names
    Symbol(u32),
    /// a function of one node
    Unary(Unary, Node),
    /// an integer power; any base
    Powi(Node, i32),
    /// a function of two nodes
    Binary(Binary, Node, Node),
    /// `if` the first is true (non-zero) the second, else the third
    Select(Node, Node, Node),
    /// a linear system, or an implicit function of some nodes; its index among the graph's systems.
    /// Has no value of its own
    System(u32),
    /// one result of a system: 0..n are the solution, n is the reciprocal condition estimate of a
    /// linear one
    Entry(Node, u32),
}

impl Op {
    /// Whether the node stands for several results, its entries, and has no value of its own.
    pub fn is_system(self) -> bool {
        matches!(self, Self::System(_))
    }
}
