//! The draft as a tree, for languages that are not C.
//!
//! A draft is a small part of C: functions of numbers, arrays of them and the state `s`; tables; declarations
//! with a value or a size, assignments, calls, `if`, `for`, `while`, `return` and `continue`. Its types are
//! named by what they mean: `real`, `double` (time), `int` (places and counts), `truth`. Layout is a part of the tree as far as people
//! read it: comments, blank lines, parentheses.

mod parser;
mod scope;

pub(super) use parser::parsed;
pub(super) use scope::{Program, Range, Scope, any, reads_state, values, visit};

/// What a name holds, one or an array of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Void,
    /// numbers in the precision of the export
    Real,
    /// time
    Double,
    /// places, counts and codes; not negative, but for exponents
    Int,
    /// 0 or 1
    Truth,
    State,
    /// a function that says how a state changes
    Field,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Item {
    /// an empty line
    Blank,
    /// with its marks; lines after the first with their indent
    Comment(String),
    /// the type of functions that say how a state changes
    Alias(Vec<Parameter>),
    /// numbers that never change
    Table(Declaration),
    Function(Function),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Function {
    /// what it returns
    pub kind: Type,
    pub name: String,
    pub parameters: Vec<Parameter>,
    pub body: Vec<Line>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Parameter {
    pub kind: Type,
    pub name: String,
    /// an array, or the state
    pub is_pointer: bool,
    /// whether an array is only read
    pub is_const: bool,
}

/// A statement with the comment at the end of its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    pub statement: Statement,
    pub comment: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Statement {
    Comment(String),
    Declare(Declaration),
    /// `target = value`, or `target op= value`
    Assign {
        target: Expr,
        operator: Option<Operator>,
        value: Expr,
    },
    /// `target++` or `target--`
    Count {
        target: Expr,
        is_up: bool,
    },
    /// a call whose value nobody wants
    Call(Expr),
    /// a parameter that may stay unused
    Unused(String),
    If(If),
    For {
        start: Option<Declaration>,
        condition: Expr,
        step: Box<Statement>,
        body: Vec<Line>,
    },
    While {
        condition: Expr,
        body: Vec<Line>,
    },
    Return(Expr),
    Continue,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct If {
    pub condition: Expr,
    pub then: Vec<Line>,
    pub otherwise: Otherwise,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Otherwise {
    Nothing,
    If(Box<If>),
    Block(Vec<Line>),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Declaration {
    pub is_const: bool,
    pub kind: Type,
    pub name: String,
    /// of an array
    pub size: Option<Expr>,
    pub value: Value,
}

impl Declaration {
    /// The entries of a table.
    pub fn entries(&self) -> &[Expr] {
        match &self.value {
            Value::List(list) => list,
            Value::None | Value::One(_) => &[],
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Value {
    None,
    One(Expr),
    List(Vec<Expr>),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Expr {
    Name(String),
    /// digits of a number in the precision of the export
    Real(String),
    /// digits of an integer, or of a number for time
    Number(String),
    /// a part of the state
    Part(String),
    Index(Box<Expr>, Box<Expr>),
    Call(String, Vec<Expr>),
    Cast(Type, Box<Expr>),
    /// `-`, `!` or `&` before its argument
    Prefix(&'static str, Box<Expr>),
    Binary(Operator, Box<Expr>, Box<Expr>),
    /// `condition ? then : otherwise`
    Choice(Box<Expr>, Box<Expr>, Box<Expr>),
    /// in parentheses, which the order of operations may not need
    Group(Box<Expr>),
}

/// In the order of how tightly they bind, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Or,
    And,
    Equal,
    Unequal,
    Less,
    LessEq,
    Greater,
    GreaterEq,
    ShiftRight,
    Add,
    Sub,
    Mul,
    Div,
}

impl Operator {
    /// All of them, as C writes them.
    pub const SIGNS: [(&'static str, Self); 13] = [
        ("||", Self::Or),
        ("&&", Self::And),
        ("==", Self::Equal),
        ("!=", Self::Unequal),
        ("<", Self::Less),
        ("<=", Self::LessEq),
        (">", Self::Greater),
        (">=", Self::GreaterEq),
        (">>", Self::ShiftRight),
        ("+", Self::Add),
        ("-", Self::Sub),
        ("*", Self::Mul),
        ("/", Self::Div),
    ];

    pub fn sign(self) -> &'static str {
        let known = Self::SIGNS.iter().find(|known| known.1 == self);
        known.map_or("", |known| known.0)
    }

    /// How tightly it binds.
    pub fn level(self) -> u8 {
        match self {
            Self::Or => 1,
            Self::And => 2,
            Self::Equal | Self::Unequal => 3,
            Self::Less | Self::LessEq | Self::Greater | Self::GreaterEq => 4,
            Self::ShiftRight => 5,
            Self::Add | Self::Sub => 6,
            Self::Mul | Self::Div => 7,
        }
    }
}

/// How tightly a sign before a value, and what needs no parentheses bind; operators less ([`Operator::level`]).
pub(super) const SIGN: u8 = 8;
pub(super) const ATOM: u8 = 9;

/// The text of a value in a language, and how tightly it binds.
pub(super) struct Bound {
    pub text: String,
    pub level: u8,
}

impl Bound {
    pub fn atom(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            level: ATOM,
        }
    }

    pub fn infix(left: &str, operator: &str, right: &str, level: u8) -> Self {
        Self {
            text: format!("{left} {operator} {right}"),
            level,
        }
    }

    /// In parentheses where it does not bind so tightly.
    pub fn at_least(self, level: u8) -> String {
        match self.level >= level {
            true => self.text,
            false => format!("({})", self.text),
        }
    }
}
