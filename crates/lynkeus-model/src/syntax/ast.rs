//! The syntax tree. Expressions live in one arena: a chain of a million terms is flat,
//! and nothing here needs deep recursion to be read or dropped.

use lynkeus_expr::Binary;

use crate::diagnostic::Span;

/// Index of an expression in [`Ast::expressions`]; operands come before their users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct ExprId(pub(crate) u32);

/// A parsed text.
#[derive(Debug, Default)]
pub(crate) struct Ast {
    pub expressions: Vec<Expression>,
}

impl Ast {
    pub(crate) fn expression(&self, id: ExprId) -> &Expression {
        &self.expressions[id.0 as usize]
    }

    /// The expressions that an expression is made of, itself included.
    pub(crate) fn parts(&self, root: ExprId) -> impl Iterator<Item = &Expression> {
        self.ids(root).map(|id| self.expression(id))
    }

    /// Their ids, operands before their users.
    pub(crate) fn ids(&self, root: ExprId) -> impl Iterator<Item = ExprId> + use<> {
        // The parts of an expression lie side by side in the arena; what was added to a record
        // later stands behind them.
        let root = match self.expression(root).kind {
            Kind::Member(record, _) => record,
            _ => root,
        };
        let first = self.expression(root).first;
        (first.0..=root.0).map(ExprId)
    }

    /// The member of a record, as an expression.
    pub(crate) fn member(&mut self, record: ExprId, member: String) -> ExprId {
        let (span, first) = (self.expression(record).span, self.expression(record).first);
        let id = ExprId(u32::try_from(self.expressions.len()).unwrap_or(u32::MAX));
        let kind = Kind::Member(record, member);
        self.expressions.push(Expression { kind, span, first });
        id
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
    /// `a[1].b[2].c`: the parts of a name, the subscripts of each
    Path(Vec<PathPart>),
    /// a member of a record: `x`, `z.re`
    Member(ExprId, String),
    Call(Call),
    /// `{a, b}`
    Array(Vec<ExprId>),
    /// `[a, b; c, d]`
    Matrix(Vec<Vec<ExprId>>),
    /// `{e for i in r}`
    Comprehension(ExprId, Vec<ForIndex>),
    Plus(ExprId),
    Minus(ExprId),
    Not(ExprId),
    /// operators of one precedence, from the left
    Chain(ExprId, Vec<Term>),
    /// base, exponent, elementwise
    Power(ExprId, ExprId, bool),
    /// `<` and its like, as it is written
    Relation(&'static str, ExprId, ExprId),
    /// conditions with values, and the value of `else`
    If(Vec<(ExprId, ExprId)>, ExprId),
    /// start, step, stop
    Range(ExprId, Option<ExprId>, ExprId),
}

/// An operator, whether it is applied element by element, and the operand behind it.
pub(crate) type Term = (Binary, bool, ExprId);

/// One part of a dotted name.
#[derive(Debug)]
pub(crate) struct PathPart {
    pub name: Span,
    pub subscripts: Vec<ExprId>,
}

#[derive(Debug, Default)]
pub(crate) struct Call {
    pub function: Span,
    pub arguments: Vec<ExprId>,
    /// arguments given by name, behind the others
    pub named: Vec<(Span, ExprId)>,
    /// of `sum(e for i in r)`
    pub iterators: Vec<ForIndex>,
}

/// `name in range`
#[derive(Clone, Debug)]
pub(crate) struct ForIndex {
    pub name: Span,
    pub range: ExprId,
}

/// What kind of class it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ClassKind {
    /// `model`, `class` and `block`
    #[default]
    Model,
    Package,
    Record,
    Function,
    Type,
    Connector,
}

/// A class with its contents as they are written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Class {
    pub kind: ClassKind,
    pub is_partial: bool,
    pub name: Span,
    /// with the names of the classes around it: `Circuits.Divider`
    pub path: String,
    pub declarations: Vec<Declaration>,
    pub equations: Vec<Equation>,
    pub initial: Vec<Equation>,
    pub algorithms: Vec<Vec<Statement>>,
    /// `extends Name(k = 2);`
    pub bases: Vec<Attribute>,
    pub imports: Vec<Import>,
    /// of `type Angle = Real(unit = "rad")`: what its variables are declared as
    pub alias: Option<Declaration>,
    /// of `type Kind = enumeration(one, two)`
    pub literals: Vec<Span>,
    pub is_external: bool,
}

/// `import Name;`, `import Short = Name;` or `import Name.*;`
#[derive(Clone, Debug)]
pub(crate) struct Import {
    /// what it is called here; `None` for everything in it
    pub short: Option<String>,
    pub full: String,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Variability {
    Parameter,
    Constant,
    #[default]
    Continuous,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Causality {
    Input,
    Output,
    #[default]
    Local,
}

/// The types that are built in, or the name of another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum TypeName {
    #[default]
    Real,
    Integer,
    Boolean,
    String,
    Named(Span),
}

/// A type of `Modelica.Units.SI`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LibraryType {
    pub unit: &'static str,
    pub min: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Declaration {
    pub is_final: bool,
    pub variability: Variability,
    pub causality: Causality,
    /// `discrete` is written
    pub is_discrete: bool,
    /// `flow` or `stream`, where it is written
    pub of_connector: Option<Span>,
    pub type_name: TypeName,
    /// where its type is one of the library's
    pub library: Option<LibraryType>,
    pub name: Span,
    /// the name without quotes, members of records in full: `r1.p.v`, `x[3]`
    pub label: String,
    /// of `Real x[N]`, with those of the type behind them, as in `Real[N] x`
    pub dimensions: Vec<ExprId>,
    pub attributes: Vec<Attribute>,
    pub binding: Option<ExprId>,
    pub description: Option<String>,
    /// the package that it is a constant of: where the names in it are looked up
    pub package: Option<String>,
}

impl Declaration {
    /// The label as a text has it: that of a constant of a package without the dot before it.
    pub(crate) fn written(&self) -> &str {
        self.label.strip_prefix('.').unwrap_or(&self.label)
    }

    pub(crate) fn is_integer(&self) -> bool {
        self.type_name == TypeName::Integer
    }

    /// Whether its value may come from outside.
    pub(crate) fn is_settable(&self) -> bool {
        self.variability == Variability::Parameter && !self.is_final
    }
}

/// `start = 1` in a declaration, `x(start = 1) = 2` where it is a record, or a base class.
#[derive(Clone, Debug)]
pub(crate) struct Attribute {
    pub name: Span,
    pub value: Option<ExprId>,
    pub nested: Vec<Attribute>,
}

/// An equation or a statement, and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Placed<K> {
    pub kind: K,
    pub span: Span,
}

pub(crate) type Equation = Placed<EquationKind>;
pub(crate) type Statement = Placed<StatementKind>;

#[derive(Clone, Debug)]
pub(crate) enum EquationKind {
    Equality(ExprId, ExprId),
    /// `(a, , b) = f(x)`
    Several(Vec<Option<ExprId>>, ExprId),
    For(Vec<ForIndex>, Vec<Equation>),
    /// conditions with equations, and those of `else`
    If(Vec<(ExprId, Vec<Equation>)>, Vec<Equation>),
    /// conditions with what happens when they come to hold, `elsewhen` behind `when`
    When(Vec<(ExprId, Vec<Equation>)>),
    /// `reinit(x, e)`
    Reinit(ExprId, ExprId),
    Assert(Assert),
}

/// `assert(condition, "message")`
#[derive(Clone, Debug)]
pub(crate) struct Assert {
    pub condition: ExprId,
    pub message: String,
    /// `AssertionLevel.warning` is given
    pub is_warning: bool,
}

#[derive(Clone, Debug)]
pub(crate) enum StatementKind {
    /// `a := e` and `(a, , b) := f(x)`
    Assign(Vec<Option<ExprId>>, ExprId),
    For(Vec<ForIndex>, Vec<Statement>),
    While(ExprId, Vec<Statement>),
    If(Vec<(ExprId, Vec<Statement>)>, Vec<Statement>),
    When(Vec<(ExprId, Vec<Statement>)>),
    Assert(Assert),
    Break,
    Return,
}
