//! A draft as Rust: slices for pointers, ranges for loops, places as `usize`.

use super::value::Values;
use crate::Refusal;
use crate::curly::c::Precision;
use crate::curly::machine::Field;
use crate::curly::syntax::{
    Declaration, Expr, Function, If, Item, Line, Otherwise, Parameter, Program, Range, Statement,
    Type, Value, any, parsed, values, visit,
};
use crate::curly::template::{chosen, mentions};
use crate::names::seen;

/// A draft in Rust.
///
/// # Errors
/// [`Refusal::Draft`]
pub(super) fn printed(
    draft: &str,
    fields: &[Field],
    precision: Precision,
) -> Result<String, Refusal> {
    let items = parsed(&chosen(draft, precision.holds()))?;
    let program = Program::of(&items, fields);
    let mut printer = Printer {
        values: Values::new(&program, precision),
        text: String::new(),
    };
    for (place, item) in items.iter().enumerate() {
        printer.item(item, items.get(place + 1))?;
    }
    Ok(printer.text)
}

struct Printer<'p> {
    values: Values<'p>,
    text: String,
}

/// What a loop or a branch of a function is printed with.
#[derive(Clone, Copy)]
struct Place {
    depth: usize,
    /// what the function returns
    returns: Type,
}

impl Place {
    fn inside(self) -> Self {
        Self {
            depth: self.depth + 1,
            ..self
        }
    }
}

impl<'p> Printer<'p> {
    fn item(&mut self, item: &'p Item, next: Option<&Item>) -> Result<(), Refusal> {
        match item {
            // one at a time
            Item::Blank if matches!(next, Some(Item::Blank) | None) => {}
            Item::Blank => self.line(0, ""),
            Item::Comment(words) => match next {
                Some(Item::Blank | Item::Comment(_)) | None => self.comment(0, "//", words),
                Some(_) => self.comment(0, "///", words),
            },
            Item::Alias(parameters) => {
                let kinds: Vec<String> = parameters.iter().map(|p| self.kind_of(p, "")).collect();
                self.line(0, &format!("type Field = fn({});", kinds.join(", ")));
            }
            Item::Table(table) => self.table(table),
            Item::Function(function) => self.function(function)?,
        }
        Ok(())
    }

    fn line(&mut self, depth: usize, text: &str) {
        let indent = if text.is_empty() { 0 } else { 4 * depth };
        self.text += &format!("{:indent$}{text}\n", "");
    }

    fn comment(&mut self, depth: usize, mark: &str, words: &str) {
        for words in comment_lines(words) {
            let words = match mark {
                "///" => documented(&plain(words)),
                _ => plain(words),
            };
            self.line(depth, format!("{mark} {words}").trim_end());
        }
    }

    fn table(&mut self, table: &Declaration) {
        let Value::List(list) = &table.value else {
            return;
        };
        let texts: Vec<String> = list
            .iter()
            .map(|value| self.values.text(value, table.kind))
            .collect();
        let line = format!(
            "static {}: [{}; {}] = [{}];",
            table.name.to_ascii_uppercase(),
            self.values.kind(table.kind),
            list.len(),
            texts.join(", ")
        );
        self.line(0, &line);
    }

    fn kind_of(&self, parameter: &Parameter, function: &str) -> String {
        let one = self.values.kind(parameter.kind);
        match (parameter.kind, parameter.is_pointer, parameter.is_const) {
            (Type::State, ..) => match self.values.program.is_changer(function) {
                true => "&mut State".to_owned(),
                false => "&State".to_owned(),
            },
            (_, true, true) => format!("&[{one}]"),
            (_, true, false) => format!("&mut [{one}]"),
            (_, false, _) => one.to_owned(),
        }
    }

    fn function(&mut self, function: &'p Function) -> Result<(), Refusal> {
        self.values.enter(function);
        let parameters = function.parameters.iter().map(|parameter| {
            let name = self.values.name(&parameter.name);
            let unused = if is_used(&function.body, &parameter.name) {
                ""
            } else {
                "_"
            };
            format!(
                "{unused}{name}: {}",
                self.kind_of(parameter, &function.name)
            )
        });
        let parameters: Vec<String> = parameters.collect();
        let result = match function.kind {
            Type::Void => String::new(),
            kind => format!(" -> {}", self.values.kind(kind)),
        };
        let head = format!("fn {}({}){result} {{", function.name, parameters.join(", "));
        self.line(0, &head);
        let place = Place {
            depth: 1,
            returns: function.kind,
        };
        if let Some((last, lines)) = function.body.split_last() {
            self.block(place, lines)?;
            self.last(place, last)?;
        }
        self.line(0, "}");
        Ok(())
    }

    /// The last statement of a function gives its value.
    fn last(&mut self, place: Place, line: &'p Line) -> Result<(), Refusal> {
        let Statement::Return(value) = &line.statement else {
            return self.statement(place, line);
        };
        self.read_before(place, &line.statement)?;
        let text = self.values.text(value, place.returns);
        self.line(place.depth, &text);
        Ok(())
    }

    fn block(&mut self, place: Place, lines: &'p [Line]) -> Result<(), Refusal> {
        lines
            .iter()
            .try_for_each(|line| self.statement(place, line))
    }

    fn statement(&mut self, place: Place, line: &'p Line) -> Result<(), Refusal> {
        let depth = place.depth;
        self.read_before(place, &line.statement)?;
        match &line.statement {
            Statement::Unused(_) => {}
            Statement::Comment(words) => self.comment(depth, "//", words),
            Statement::If(conditional) => self.conditional(place, "", conditional)?,
            Statement::For {
                start,
                condition,
                step,
                body,
            } => match Range::of(start.as_ref(), condition, step) {
                Some(range) => self.range(place, &range, body)?,
                None => self.repeated(place, start.as_ref(), condition, (body, step))?,
            },
            Statement::While { condition, body } => {
                let head = format!("while {} {{", self.values.text(condition, Type::Truth));
                self.enclosed(place, &head, body)?;
            }
            simple => {
                let words = line.comment.iter().flat_map(|words| comment_lines(words));
                let words: Vec<&str> = words.collect();
                let text = format!("{};", self.simple(place, simple));
                let text = match words.is_empty() {
                    true => text,
                    false => format!("{text} // {}", plain(&words.join(" "))),
                };
                self.line(depth, &text);
            }
        }
        Ok(())
    }

    fn enclosed(&mut self, place: Place, head: &str, body: &'p [Line]) -> Result<(), Refusal> {
        self.line(place.depth, head);
        self.block(place.inside(), body)?;
        self.line(place.depth, "}");
        Ok(())
    }

    fn range(&mut self, place: Place, range: &Range<'p>, body: &'p [Line]) -> Result<(), Refusal> {
        let text = |value: &Expr| self.values.bound(value);
        let (from, to) = (text(range.from), text(range.to));
        let places = match (
            range.is_up,
            range.is_inclusive,
            self.values.beyond(range.from),
        ) {
            (true, false, _) => format!("{from}..{to}"),
            (true, true, _) => format!("{from}..={to}"),
            (false, _, Some(beyond)) => format!("({to}..{beyond}).rev()"),
            (false, _, None) => format!("({to}..={from}).rev()"),
        };
        let name = self.values.name(range.name);
        let before = std::mem::take(&mut self.text);
        if let Some(only) = range.only {
            let inside = place.inside().depth;
            let only = self.values.negated(only);
            self.line(inside, &format!("if {only} {{"));
            self.line(inside + 1, "break;");
            self.line(inside, "}");
        }
        self.block(place.inside(), body)?;
        let inside = std::mem::replace(&mut self.text, before);
        let name = if mentions(&inside, &name) { &name } else { "_" };
        self.line(place.depth, &format!("for {name} in {places} {{"));
        self.text += &inside;
        self.line(place.depth, "}");
        Ok(())
    }

    /// A loop that is no range.
    fn repeated(
        &mut self,
        place: Place,
        start: Option<&'p Declaration>,
        condition: &'p Expr,
        (body, step): (&'p [Line], &'p Statement),
    ) -> Result<(), Refusal> {
        if start.is_some() || any(body, &mut |s| matches!(s, Statement::Continue)) {
            return Err(lacks(
                "a loop that is no range and begins with a value, or goes on early",
            ));
        }
        let head = format!("while {} {{", self.values.text(condition, Type::Truth));
        self.line(place.depth, &head);
        self.block(place.inside(), body)?;
        let step = format!("{};", self.simple(place, step));
        self.line(place.inside().depth, &step);
        self.line(place.depth, "}");
        Ok(())
    }

    fn conditional(
        &mut self,
        place: Place,
        before: &str,
        conditional: &'p If,
    ) -> Result<(), Refusal> {
        let condition = self.values.text(&conditional.condition, Type::Truth);
        self.line(place.depth, &format!("{before}if {condition} {{"));
        self.block(place.inside(), &conditional.then)?;
        match &conditional.otherwise {
            Otherwise::Nothing => self.line(place.depth, "}"),
            Otherwise::If(other) => self.conditional(place, "} else ", other)?,
            Otherwise::Block(lines) => self.enclosed(place, "} else {", lines)?,
        }
        Ok(())
    }

    /// A statement of one line, without its semicolon.
    fn simple(&self, place: Place, statement: &Statement) -> String {
        match statement {
            Statement::Declare(declaration) => self.declared(declaration),
            Statement::Assign {
                target,
                operator,
                value,
            } => {
                let sign = operator.map_or("", |operator| operator.sign());
                let kind = self.values.kind_of(target);
                let (target, value) = (
                    self.values.text(target, kind),
                    self.values.text(value, kind),
                );
                format!("{target} {sign}= {value}")
            }
            Statement::Count { target, is_up } => {
                let sign = if *is_up { "+=" } else { "-=" };
                format!("{} {sign} 1", self.values.text(target, Type::Int))
            }
            Statement::Call(call) => self.values.text(call, Type::Void),
            Statement::Return(value) => {
                format!("return {}", self.values.text(value, place.returns))
            }
            Statement::Continue => "continue".to_owned(),
            // the others take several lines
            _ => String::new(),
        }
    }

    fn declared(&self, declaration: &Declaration) -> String {
        let Declaration { kind, size, .. } = declaration;
        let name = self.values.name(&declaration.name);
        let word = if declaration.is_const {
            "let"
        } else {
            "let mut"
        };
        let value = match (&declaration.value, size) {
            (Value::List(list), _) => {
                let texts = list.iter().map(|value| self.values.text(value, *kind));
                format!("[{}]", texts.collect::<Vec<_>>().join(", "))
            }
            (Value::One(value), _) => self.values.text(value, *kind),
            (Value::None, Some(size)) => {
                let size = self.values.text(size, Type::Int);
                format!("[{}; {size}]", self.values.zero(*kind))
            }
            (Value::None, None) => self.values.zero(*kind).to_owned(),
        };
        format!("{word} {name} = {value}")
    }

    /// What a call reads of the state that it is also given to change is read before.
    fn read_before(&mut self, place: Place, statement: &'p Statement) -> Result<(), Refusal> {
        let mut calls = vec![];
        for value in values(statement) {
            visit(value, &mut |inner| {
                if let Expr::Call(name, arguments) = inner {
                    calls.push((name, arguments));
                }
            });
        }
        for (name, arguments) in calls {
            let is_loop = matches!(statement, Statement::While { .. } | Statement::For { .. });
            let taken = self.values.taken_before(name, arguments);
            if is_loop && !taken.is_empty() {
                return Err(lacks("a loop whose condition changes the state"));
            }
            for (name, text) in taken {
                self.line(place.depth, &format!("let {name} = {text};"));
            }
        }
        Ok(())
    }
}

pub(super) fn lacks(operation: &str) -> Refusal {
    Refusal::Lacks {
        language: "Rust",
        operation: operation.to_owned(),
    }
}

/// Whether more is done with a parameter than to say that it may stay unused.
fn is_used(lines: &[Line], name: &str) -> bool {
    any(lines, &mut |statement| {
        let mut is_used = false;
        for value in values(statement) {
            visit(value, &mut |inner| {
                is_used |= match inner {
                    Expr::Name(other) | Expr::Call(other, _) => other == name,
                    Expr::Part(_) => name == "s",
                    _ => false,
                }
            });
        }
        is_used
    })
}

/// Words in a comment of one line.
pub(super) fn plain(words: &str) -> String {
    seen(words)
}

/// Words in documentation, where brackets would be links and angles elements.
pub(super) fn documented(words: &str) -> String {
    let words = words.chars().map(|c| match c {
        '[' | ']' | '<' | '>' | '`' | '*' | '_' | '\\' => format!("\\{c}"),
        c => c.to_string(),
    });
    words.collect()
}

/// The words of a comment, line by line.
fn comment_lines(words: &str) -> impl Iterator<Item = &str> {
    let words = words.trim_start_matches("/*").trim_end_matches("*/");
    words.trim().lines().map(str::trim)
}

#[cfg(test)]
mod tests;
