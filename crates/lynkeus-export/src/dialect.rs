//! How a language writes operations.

use lynkeus_expr::{Binary, Op, Unary};

use crate::Names;

/// How tightly the outermost operation of a text binds, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Binding {
    /// `x < y`
    Relation,
    /// `x + y`
    Sum,
    /// `x*y`
    Product,
    /// `-x`
    Sign,
    /// `x**2`
    Power,
    /// a name, a literal, a call
    Atom,
}

/// The text of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// as it stands
    pub text: String,
    /// what decides on parentheses around it
    pub binding: Binding,
}

impl Text {
    /// A text that needs no parentheses anywhere.
    pub fn atom(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            binding: Binding::Atom,
        }
    }

    /// A number's digits with their sign.
    pub fn signed(digits: impl Into<String>, is_negative: bool) -> Self {
        match is_negative {
            true => Self {
                text: format!("-{}", digits.into()),
                binding: Binding::Sign,
            },
            false => Self::atom(digits),
        }
    }

    /// The text where at least this binding is needed.
    pub fn at_least(&self, binding: Binding) -> String {
        match self.binding >= binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// The text where more than this binding is needed.
    pub fn tighter(&self, binding: Binding) -> String {
        match self.binding > binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// A call with these arguments.
    pub fn call(function: &str, arguments: &[&Text]) -> Self {
        let arguments: Vec<&str> = arguments.iter().map(|a| a.text.as_str()).collect();
        Self::atom(format!("{function}({})", arguments.join(", ")))
    }
}

/// The shape of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `name(x, …)`
    Call(&'static str),
    /// the sign before its argument
    Prefix(&'static str, Binding),
    /// the sign between its arguments, with its spaces; the order of operations is kept
    Infix(&'static str, Binding),
}

impl Form {
    /// The operation of these arguments.
    pub fn of(self, arguments: &[&Text]) -> Text {
        match (self, arguments) {
            (Self::Prefix(sign, binding), [x]) => Text {
                text: format!("{sign}{}", x.tighter(binding)),
                binding,
            },
            (Self::Infix(sign, binding), [x, y]) => {
                // relations do not chain, and sums are not associative
                let left = match binding {
                    Binding::Relation => x.tighter(binding),
                    _ => x.at_least(binding),
                };
                Text {
                    text: format!("{left}{sign}{}", y.tighter(binding)),
                    binding,
                }
            }
            (Self::Call(name) | Self::Prefix(name, _) | Self::Infix(name, _), arguments) => {
                Text::call(name, arguments)
            }
        }
    }
}

/// A language, as far as the printing of operations goes. None is an operation that it lacks.
pub trait Dialect {
    /// What messages call it.
    fn name(&self) -> &'static str;
    /// Words that cannot be identifiers.
    fn is_reserved(&self, word: &str) -> bool;
    /// A number: the shortest digits that give the same one back.
    fn number(&self, value: f64) -> Text;
    /// A function of one argument.
    fn unary(&self, op: Unary) -> Option<Form>;
    /// A function of two arguments.
    fn binary(&self, op: Binary) -> Option<Form>;
    /// An integer power of any base.
    fn power(&self, base: &Text, exponent: i32) -> Text;
    /// `if condition then x else y`; the condition is a truth value.
    fn select(&self, condition: &Text, x: &Text, y: &Text) -> Text;
    /// A line that names a value.
    fn assignment(&self, name: &str, value: &Text) -> String;
    /// A line that names a truth value.
    fn truth(&self, name: &str, value: &Text) -> String {
        self.assignment(name, value)
    }
    /// Lines that name the solution of A x = b; `a` is n×n row by row.
    fn solution(&self, name: &str, a: &[Text], b: &[Text]) -> Option<Vec<String>>;
    /// An entry of a solution.
    fn entry(&self, solution: &str, place: usize) -> Text;

    /// An identifier like the name.
    fn identifier(&self, names: &mut Names, name: &str) -> String {
        names.identifier(name, |word| self.is_reserved(word))
    }
}

/// Whether an operation gives a truth value.
pub(crate) fn is_truth(op: Op) -> bool {
    match op {
        Op::Unary(op, _) => op == Unary::Not,
        Op::Binary(op, ..) => {
            use Binary::{And, Equal, Less, LessEq, Or};
            matches!(op, Less | LessEq | Equal | And | Or)
        }
        _ => false,
    }
}
