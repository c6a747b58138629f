//! Text to syntax tree: lexer, tree and recursive-descent parser.

pub(crate) mod ast;
mod classes;
mod equations;
mod expressions;
mod lexer;
mod parser;

pub(crate) use classes::HOW_TO_FLATTEN;
pub(crate) use expressions::too_many_dimensions;
pub(crate) use lexer::{Lexer, Token, check_name, no_end, plain, shortened, unquoted};
pub(crate) use parser::{
    Language, PRODUCT, Parser, SUM, check_length, parse_file, parse_single_expression,
};
