//! Text to syntax tree: lexer, tree and recursive-descent parser.

pub(crate) mod ast;
mod classes;
mod declarations;
mod equations;
mod expressions;
mod lexer;
mod names;
mod parser;
mod references;
mod span;
mod statements;
mod token;

pub(crate) use expressions::too_many_dimensions;
pub(crate) use names::plain;
pub(crate) use parser::{check_length, parse_file, parse_single_expression, unquoted};
pub use span::Span;
pub(crate) use span::{Problem, Result};
pub(crate) use token::shortened;
