//! What a model may cost. Each limit is named in the message of the refusal it causes,
//! so that hostile text ends in a diagnostic within a second and bounded memory.

use std::cell::Cell;

use crate::diagnostic::{Problem, Result, Span};

/// Largest source file in bytes.
pub(crate) const MAX_SOURCE_BYTES: usize = 64 << 20;
/// Deepest nesting of expressions and equations.
pub(crate) const MAX_NESTING: usize = 200;
/// Deepest nesting of expressions and statements with those of the functions that they call.
pub(crate) const MAX_CALL_DEPTH: usize = 400;
/// Most iterators of one loop or comprehension.
pub(crate) const MAX_ITERATORS: usize = 32;
/// Most expressions, equations and declarations in one file.
pub(crate) const MAX_SYNTAX_NODES: usize = 2_000_000;
/// Most scalar operations while `for` loops and arrays are written out.
pub(crate) const MAX_ELABORATED: u64 = 1_000_000;
/// Most scalar variables and parameters of one model.
pub(crate) const MAX_SCALARS: u64 = 200_000;
/// Most bytes of names, units and descriptions when arrays are written out.
pub(crate) const MAX_TEXT: u64 = 32 << 20;
/// Most imports of one class: each may mean any name in it.
pub(crate) const MAX_IMPORTS: usize = 1_000;
/// Longest name in bytes.
pub(crate) const MAX_NAME: usize = 250;
/// Most dimensions of an array.
pub(crate) const MAX_RANK: usize = 32;
/// Most names that a misspelt one is compared with.
pub(crate) const MAX_SUGGESTIONS: usize = 5_000;
/// Most unknowns that may need each other when those are eliminated that can be.
pub(crate) const MAX_COUPLED: usize = 64;
/// Most steps while equations are solved for their unknowns.
pub(crate) const MAX_SOLVE_STEPS: u64 = 5_000_000;

/// Counts scalar operations against a limit.
#[derive(Debug)]
pub(crate) struct Budget {
    left: Cell<u64>,
    limit: u64,
    what: &'static str,
}

impl Budget {
    /// A budget of `limit` things called `what`.
    pub(crate) fn new(limit: u64, what: &'static str) -> Self {
        Self {
            left: Cell::new(limit),
            limit,
            what,
        }
    }

    /// Takes `amount` from the budget.
    pub(crate) fn charge(&self, amount: u64, span: Span) -> Result<()> {
        let Some(left) = self.left.get().checked_sub(amount) else {
            let (limit, what) = (grouped(self.limit), self.what);
            let problem = Problem::new(span, format!("the model needs more than {limit} {what}"));
            let problem = problem.label("the limit is passed here");
            return Err(problem.hint("use fewer loop turns or smaller arrays"));
        };
        self.left.set(left);
        Ok(())
    }
}

/// Digits in groups of three: `2,000,000`.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_digits() {
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(2_000_000), "2,000,000");
    }
}
