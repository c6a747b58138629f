//! Columns of a log that a study gives as expressions of others: `T = "(T_F - 32)/1.8"`.

use std::borrow::Cow;
use std::cell::RefCell;

use lynkeus_expr::{Graph, Node, Tape};
use lynkeus_model::{Diagnostic, parse_expression};

use crate::near::{list, nearest, suggest};
use crate::{Error, Table};
use lynkeus_study::{EstimateSettings, Name};

/// What a study has of a log's columns, whether it is a header or an expression.
pub(super) fn given(settings: &EstimateSettings) -> impl Iterator<Item = &Name> {
    let columns = settings.log.columns.iter().map(|(_, given)| given);
    columns.chain(&settings.log.time)
}

/// The names that such a text reads if it is an expression.
pub(crate) fn names(text: &str) -> Vec<String> {
    let graph = Graph::new();
    let every = RefCell::new(vec![]);
    let known = |name: &str| {
        every.borrow_mut().push(name.to_owned());
        Some(graph.symbol(name).node())
    };
    let is_read = parse_expression(text, &graph, &known).is_ok();
    let mut names = every.into_inner();
    names.retain(|_| is_read);
    names
}

/// What a study has of a column, header or expression, within another expression.
pub(crate) fn within_expression(text: &str) -> String {
    let names = names(text);
    match names.first() {
        Some(name) if name == text => text.to_owned(),
        Some(_) => format!("({text})"),
        // what is no expression is a header: `T (degC)`
        None => format!("'{text}'"),
    }
}

/// A text over the headers of a log.
struct Parsed {
    graph: Graph,
    /// its value, or why it is no expression
    root: Result<Node, Diagnostic>,
    /// what it reads that is no header
    strangers: Vec<String>,
}

impl Parsed {
    fn new(text: &str, table: &Table) -> Self {
        let graph = Graph::new();
        let strangers = RefCell::new(vec![]);
        let known = |name: &str| {
            if !table.has(name) {
                if name == "pi" {
                    return None;
                }
                strangers.borrow_mut().push(name.to_owned());
            }
            Some(graph.symbol(name).node())
        };
        let root = parse_expression(text, &graph, &known);
        let strangers = strangers.into_inner();
        Self {
            graph,
            root,
            strangers,
        }
    }
}

/// The log with the columns that the study gives as expressions, under their texts: a text that is a header is that
/// column. `always` are columns beside them that have to be there. What nobody has to read may be absent, and is told in the notes.
///
/// # Errors
/// The time, or a name that `is_read`, is an expression of what the log does not have, or not as numbers.
pub(super) fn with_expressions<'t, 's>(
    table: &'t Table,
    (settings, always): (&'s EstimateSettings, impl Iterator<Item = &'s Name>),
    is_read: impl Fn(&Name) -> bool,
    notes: &mut Vec<String>,
) -> Result<Cow<'t, Table>, Error> {
    let mut whole = Cow::Borrowed(table);
    let columns = settings.log.columns.iter();
    let columns = columns.map(|(name, given)| (Some(name), given));
    let always = settings.log.time.iter().chain(always);
    for (name, given) in columns.chain(always.map(|given| (None, given))) {
        if whole.has(&given.text) {
            continue;
        }
        match column(table, &whole, given) {
            Ok(with) => whole = with.map_or(whole, Cow::Owned),
            Err(error) if name.is_none_or(&is_read) => return Err(error),
            Err(error) => notes.push(error.message().to_owned()),
        }
    }
    Ok(whole)
}

/// What makes an expression of a text that none can be read from.
const OPERATORS: [char; 7] = ['+', '-', '*', '/', '^', '(', '\''];

/// `whole`, which has the columns of the log and more, with such a column of the log's; none where the text is a header
/// that the log does not have.
fn column(table: &Table, whole: &Table, given: &Name) -> Result<Option<Table>, Error> {
    let text = given.text.as_str();
    let Parsed {
        graph,
        root,
        strangers,
    } = Parsed::new(text, table);
    let root = match root {
        Ok(root) if strangers.is_empty() => root,
        Ok(_) if strangers == [text] => return Ok(None),
        Ok(_) => return Err(given.blame(strange(table, text, &strangers))),
        Err(_) if !text.contains(OPERATORS) => return Ok(None),
        Err(why) => {
            let why = format!("it is no expression of columns: {}", why.one_line());
            return Err(given.blame(absent(table, text, &why)));
        }
    };
    let symbols = graph.symbols_of(&[root]);
    let headers: Vec<String> = symbols
        .iter()
        .filter_map(|symbol| graph.symbol_name(*symbol))
        .collect();
    if headers.is_empty() {
        let error = absent(table, text, "as an expression it reads no column");
        return Err(given.blame(error));
    }
    let tape = Tape::new(&graph, &symbols, &[root]);
    let tape = tape.map_err(|error| given.blame(Error::input(error.to_string())))?;
    let mut evaluator = tape.evaluator();
    let read: Vec<&str> = headers.iter().map(String::as_str).collect();
    let with = whole.with_computed(text, &read, |cells| evaluator.value(cells));
    with.map(Some)
}

/// The refusal of an expression of what are no columns.
fn strange(table: &Table, text: &str, strangers: &[String]) -> Error {
    let quoted: Vec<String> = strangers.iter().map(|name| format!("\"{name}\"")).collect();
    let are = match strangers {
        [_] => "is no column either",
        _ => "are no columns either",
    };
    let why = format!(
        "as an expression it reads {}, which {are}",
        quoted.join(", ")
    );
    let error = absent(table, text, &why);
    let near = nearest(text, table.names()).map(|near| format!("did you mean \"{near}\"?"));
    let first = strangers.first().map_or("", String::as_str);
    error.hint(near.unwrap_or_else(|| suggest(first, table.names())))
}

fn absent(table: &Table, text: &str, why: &str) -> Error {
    Error::input(format!(
        "{}: no column \"{text}\", and {why}; the columns found are: {}",
        table.place(),
        list(table.names())
    ))
    .hint("in an expression, headers that are no names of Modelica stand in single quotes: \"('T degF' - 32)/1.8\"")
}

#[cfg(test)]
mod tests {
    use super::within_expression;

    #[test]
    fn a_header_that_is_no_name_is_quoted_within_an_expression() {
        for (text, within) in [
            ("T", "T"),
            ("T degC", "'T degC'"),
            ("T (degC)", "'T (degC)'"),
            ("flow m3/h", "'flow m3/h'"),
            ("T - 273.15", "(T - 273.15)"),
            ("'T degF' - 32", "('T degF' - 32)"),
        ] {
            assert_eq!(within_expression(text), within);
        }
    }
}
