//! Where the models of a Julia script begin.
//!
//! Nothing else of the script can change what `@ODEmodel` means, so all other code is skipped;
//! only comments and strings have to be known, as they may speak of models.

use crate::diagnostic::{Result, Span};
use crate::syntax::{Lexer, ODE_MODEL};

const MACRO: &str = "@ODEmodel";

/// Every model, in order: the variable that it is assigned to, or else `stem`, and the word
/// `@ODEmodel`.
pub(super) fn heads<'s>(source: &'s str, stem: &'s str) -> Result<Vec<(&'s str, Span)>> {
    let mut lexer = Lexer::new(source, &ODE_MODEL);
    let (mut heads, mut last) = (vec![], None);
    while let Some(character) = lexer.rest().chars().next() {
        let at = lexer.position;
        match character {
            '#' => _ = lexer.comment()?,
            '"' => _ = lexer.quoted()?,
            '\'' if !ends_operand(last) => lexer.position = character_end(source, at),
            _ => {
                lexer.position += character.len_utf8();
                if character == '@' || (ODE_MODEL.starts_name)(character) {
                    lexer.name();
                }
            }
        }
        let word = Span::new(at, lexer.position);
        if word.text(source) == MACRO {
            heads.push((assigned_name(source, at).unwrap_or(stem), word));
        }
        last = Some(character);
    }
    Ok(heads)
}

/// Whether `'` behind this character is a prime and opens no character literal.
fn ends_operand(last: Option<char>) -> bool {
    last.is_some_and(|last| {
        (ODE_MODEL.continues_name)(last) || matches!(last, ')' | ']' | '}' | '\'' | '.')
    })
}

/// The end of a character literal such as `'"'`; the quote alone where there is none.
fn character_end(source: &str, start: usize) -> usize {
    let inner = source.get(start + 1..).unwrap_or_default();
    let escaped = usize::from(inner.starts_with('\\'));
    match inner.char_indices().nth(1 + escaped) {
        Some((length, '\'')) => start + 1 + length + 1,
        _ => start + 1,
    }
}

/// `name` of `name = @ODEmodel`, also where the module stands before the `@`.
fn assigned_name(source: &str, at: usize) -> Option<&str> {
    let mut before = source.get(..at)?;
    if let Some(module) = before.strip_suffix('.') {
        before = module.trim_end_matches(ODE_MODEL.continues_name);
    }
    let before = before.trim_end().strip_suffix('=')?.trim_end();
    let start = before.trim_end_matches(ODE_MODEL.continues_name).len();
    let name = before.get(start..)?;
    name.starts_with(ODE_MODEL.starts_name).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<&str> {
        let heads = heads(text, "?").unwrap().into_iter();
        heads.map(|(name, _)| name).collect()
    }

    #[test]
    fn names_of_models() {
        assert_eq!(names("ode=@ODEmodel()"), ["ode"]);
        assert_eq!(names("β₁ = SI.@ODEmodel()"), ["β₁"]);
        assert_eq!(names("@ODEmodel() :a => @ODEmodel()"), ["?", "?"]);
        assert_eq!(names("2 = @ODEmodel() = @ODEmodel()"), ["?", "?"]);
        assert_eq!(names("@ODEmodels @odemodel ODEmodel"), [""; 0]);
    }

    #[test]
    fn comments_and_literals_hold_no_models() {
        for text in [
            "# @ODEmodel",
            "#= #= =# @ODEmodel =#",
            "\"\\\" @ODEmodel\"",
            "\"\"\" \" @ODEmodel \"\"\"",
            "'\"' # \"",
            "'\\'' #",
        ] {
            assert_eq!(names(text), [""; 0], "{text}");
        }
        assert_eq!(names("'\"' @ODEmodel '\"'").len(), 1);
        assert_eq!(names("x' y' @ODEmodel(x'(t))").len(), 1);
    }

    #[test]
    fn what_has_no_end() {
        for text in ["#=", "\"", "\"\"\" \"", "\"\\"] {
            let message = heads(text, "?").unwrap_err().into_details().message;
            assert!(message.contains("no end"), "{text}");
        }
    }
}
