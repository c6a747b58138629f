//! The syntax tree. Expressions live in one arena: a chain of a million terms is flat,
//! and nothing here needs deep recursion to be read or dropped.

use super::Span;

/// Index of an expression in [`Ast::expressions`]; operands come before their users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ExprId(pub(crate) u32);

/// A parsed text.
#[derive(Debug, Default)]
pub(crate) struct Ast {
    pub expressions: Vec<Expression>,
    pub models: Vec<ModelSyntax>,
}

impl Ast {
    pub(crate) fn expression(&self, id: ExprId) -> &Expression {
        &self.expressions[id.0 as usize]
    }
}

#[derive(Debug)]
pub(crate) struct Expression {
    pub kind: Kind,
    pub span: Span,
    /// first expression of the arena that belongs to this one
    pub first: ExprId,
}

#[derive(Debug)]
pub(crate) enum Kind {
    Integer(i64),
    Real(f64),
    Boolean(bool),
    Text,
    /// a name, dots included
    Name,
    /// `:`
    All,
    /// `end` within subscripts
    End,
    Index(ExprId, Vec<ExprId>),
    Call(Call),
    /// `{a, b}`
    Array(Vec<ExprId>),
    /// `[a, b; c, d]`
    Matrix(Vec<Vec<ExprId>>),
    /// `{e for i in r}`
    Comprehension(ExprId, Vec<Iterator>),
    Unary(UnaryOperator, ExprId),
    /// operators of one precedence, from the left
    Chain(ExprId, Vec<(BinaryOperator, ExprId)>),
    /// base, exponent, elementwise
    Power(ExprId, ExprId, bool),
    Relation(Relation, ExprId, ExprId),
    /// conditions with values, and the value of `else`
    If(Vec<(ExprId, ExprId)>, ExprId),
    /// start, step, stop
    Range(ExprId, Option<ExprId>, ExprId),
}

#[derive(Debug)]
pub(crate) struct Call {
    pub function: Span,
    pub arguments: Vec<ExprId>,
    /// of `sum(e for i in r)`
    pub iterators: Vec<Iterator>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnaryOperator {
    Plus,
    Minus,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BinaryOperator {
    Add,
    Subtract,
    Multiply,
    Divide,
    ElementAdd,
    ElementSubtract,
    ElementMultiply,
    ElementDivide,
    And,
    Or,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Relation {
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
}

/// `name in range`
#[derive(Clone, Debug)]
pub(crate) struct Iterator {
    pub name: Span,
    pub range: ExprId,
}

#[derive(Debug)]
pub(crate) struct ModelSyntax {
    pub name: Span,
    pub declarations: Vec<Declaration>,
    pub equations: Vec<Equation>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variability {
    Parameter,
    Constant,
    Continuous,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Causality {
    Input,
    Output,
    Local,
}

/// What stands before the names of a declaration.
#[derive(Clone, Debug)]
pub(crate) struct Prefix {
    pub is_final: bool,
    pub variability: Variability,
    pub causality: Causality,
    pub integer: bool,
    /// of `Real[N] x`
    pub dimensions: Vec<ExprId>,
}

#[derive(Debug)]
pub(crate) struct Declaration {
    pub prefix: Prefix,
    pub name: Span,
    /// of `Real x[N]`, with those of the prefix behind them
    pub dimensions: Vec<ExprId>,
    pub attributes: Vec<Attribute>,
    pub binding: Option<ExprId>,
    pub description: Option<String>,
}

/// `start = 1` in a declaration.
#[derive(Debug)]
pub(crate) struct Attribute {
    pub name: Span,
    pub value: ExprId,
}

#[derive(Debug)]
pub(crate) struct Equation {
    pub kind: EquationKind,
    pub span: Span,
}

#[derive(Debug)]
pub(crate) enum EquationKind {
    Equality(ExprId, ExprId),
    For(Vec<Iterator>, Vec<Equation>),
    /// conditions with equations, and those of `else`
    If(Vec<(ExprId, Vec<Equation>)>, Vec<Equation>),
}
