//! Text to syntax tree: lexer, tree and recursive-descent parser.

pub(crate) mod ast;
mod classes;
mod equations;
mod expressions;
mod language;
mod lexer;
mod parser;

pub(crate) use classes::HOW_TO_FLATTEN;
pub(crate) use expressions::too_many_dimensions;
pub(crate) use language::ODE_MODEL;
pub(crate) use lexer::{Lexer, Token, plain, shortened, unquoted};
pub(crate) use parser::{Parser, check_length, parse_file, parse_single_expression};
