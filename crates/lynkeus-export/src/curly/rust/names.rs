//! Names that cannot stay in Rust.

use std::collections::HashMap;

use crate::curly::syntax::{Program, Scope};

/// Words that cannot be names.
const KEYWORDS: [&str; 51] = [
    "Self", "abstract", "as", "async", "await", "become", "box", "break", "const", "continue",
    "crate", "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if",
    "impl", "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub",
    "ref", "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "where", "while", "yield",
];

/// Constants of the frame, and of every Rust program.
const OWN_NAMES: [&str; 7] = [
    "ESTIMATES",
    "ESTIMATE_NAMES",
    "Err",
    "None",
    "Ok",
    "SIGNAL_NAMES",
    "Some",
];

/// Names of a function that mean something else in Rust, with what they are called instead. A local name cannot
/// be that of a constant; those of the runtime are names in no draft.
pub(super) fn renamed(scope: &Scope, program: &Program<'_>) -> HashMap<String, String> {
    let is_taken = |name: &str| {
        KEYWORDS.contains(&name) || OWN_NAMES.contains(&name) || program.has_table(name)
    };
    let mut others = HashMap::new();
    for name in scope.names().iter().filter(|name| is_taken(name)) {
        let mut other = format!("{name}_");
        while is_taken(&other) || scope.variable(&other).is_some() {
            other.push('_');
        }
        others.insert(name.clone(), other);
    }
    others
}
