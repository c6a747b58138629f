//! Where the models of a Julia script begin.
//!
//! Nothing else of the script can change what `@ODEmodel` means, so all other code is skipped;
//! only comments and strings have to be known, as they may speak of models.

use super::characters::{comment_end, continues_name, name_end, starts_name};
use crate::syntax::{Problem, Result, Span};

const MACRO: &str = "@ODEmodel";

/// The beginning of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    /// the variable that the model is assigned to
    pub name: Option<Span>,
    /// the word `@ODEmodel`
    pub place: Span,
}

/// Every model, in order.
pub(super) fn heads(source: &str) -> Result<Vec<Head>> {
    let mut heads = vec![];
    let (mut at, mut last) = (0, None);
    while let Some(character) = source.get(at..).and_then(|rest| rest.chars().next()) {
        let next = match character {
            '#' => comment_end(source, at)?,
            '"' => string_end(source, at)?,
            '\'' if !ends_operand(last) => character_end(source, at),
            '@' => name_end(source, at + 1),
            _ if starts_name(character) => name_end(source, at),
            _ => at + character.len_utf8(),
        };
        if source.get(at..next) == Some(MACRO) {
            let name = assigned_name(source, at);
            let place = Span::new(at, next);
            heads.push(Head { name, place });
        }
        last = Some(character);
        at = next;
    }
    Ok(heads)
}

/// Whether `'` behind this character is a prime and opens no character literal.
fn ends_operand(last: Option<char>) -> bool {
    last.is_some_and(|last| continues_name(last) || matches!(last, ')' | ']' | '}' | '\'' | '.'))
}

/// The end of `"…"` or `"""…"""`.
fn string_end(source: &str, start: usize) -> Result<usize> {
    let rest = source.get(start..).unwrap_or_default();
    let quote = if rest.starts_with("\"\"\"") {
        "\"\"\""
    } else {
        "\""
    };
    let mut at = start + quote.len();
    while let Some(rest) = source.as_bytes().get(at..).filter(|rest| !rest.is_empty()) {
        if rest.starts_with(quote.as_bytes()) {
            return Ok(at + quote.len());
        }
        at += if rest.starts_with(b"\\") { 2 } else { 1 };
    }
    let problem = Problem::new(Span::new(start, start + 1), "this string has no end");
    Err(problem.hint(format!("close it with `{quote}`")))
}

/// The end of a character literal such as `'"'`; the quote alone where there is none.
fn character_end(source: &str, start: usize) -> usize {
    let mut characters = source
        .get(start..)
        .unwrap_or_default()
        .char_indices()
        .skip(1);
    let escaped = characters
        .next()
        .is_some_and(|(_, character)| character == '\\');
    let mut behind = characters.skip(usize::from(escaped));
    match behind.next() {
        Some((length, '\'')) => start + length + 1,
        _ => start + 1,
    }
}

/// `name` of `name = @ODEmodel`, also where the module stands before the `@`.
fn assigned_name(source: &str, at: usize) -> Option<Span> {
    let mut before = source.get(..at)?;
    if let Some(module) = before.strip_suffix('.') {
        before = module.trim_end_matches(continues_name);
    }
    let before = before.trim_end().strip_suffix('=')?.trim_end();
    let start = before.trim_end_matches(continues_name).len();
    let name = before.get(start..)?;
    let is_name = name.chars().next().is_some_and(starts_name);
    is_name.then(|| Span::new(start, before.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<Option<&str>> {
        let heads = heads(text).unwrap();
        heads
            .iter()
            .map(|head| head.name.map(|name| name.text(text)))
            .collect()
    }

    #[test]
    fn names_of_models() {
        assert_eq!(names("ode=@ODEmodel()"), [Some("ode")]);
        assert_eq!(names("β₁ = SI.@ODEmodel()"), [Some("β₁")]);
        assert_eq!(names("@ODEmodel() :a => @ODEmodel()"), [None, None]);
        assert_eq!(names("2 = @ODEmodel() = @ODEmodel()"), [None, None]);
        assert_eq!(names("@ODEmodels @odemodel ODEmodel"), []);
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
            assert_eq!(names(text), [], "{text}");
        }
        assert_eq!(names("'\"' @ODEmodel '\"'").len(), 1);
        assert_eq!(names("x' y' @ODEmodel(x'(t))").len(), 1);
    }

    #[test]
    fn what_has_no_end() {
        for text in ["#=", "\"", "\"\"\" \"", "\"\\"] {
            let message = heads(text).unwrap_err().into_details().message;
            assert!(message.contains("no end"), "{text}");
        }
    }
}
