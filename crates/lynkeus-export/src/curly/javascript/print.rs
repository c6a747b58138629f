//! A draft as JavaScript: without types, arrays of numbers as `Float64Array`.

use crate::Refusal;
use crate::curly::syntax::{
    Declaration, Expr, Function, If, Item, Line, Otherwise, Statement, Value, parsed,
};
use crate::curly::template::chosen;

/// A draft in JavaScript; `word` exchanges names.
///
/// # Errors
/// [`Refusal::Draft`]
pub(super) fn printed(draft: &str, word: fn(&str) -> Option<String>) -> Result<String, Refusal> {
    let mut printer = Printer {
        word,
        text: String::new(),
    };
    for item in parsed(&chosen(draft, &[]))? {
        printer.item(&item);
    }
    Ok(printer.text)
}

struct Printer {
    word: fn(&str) -> Option<String>,
    text: String,
}

impl Printer {
    fn item(&mut self, item: &Item) {
        match item {
            Item::Blank => self.line(0, ""),
            Item::Comment(words) => self.line(0, words),
            Item::Alias(_) => {}
            Item::Table(table) => {
                let table = self.declared(table);
                self.line(0, &format!("{table};"));
            }
            Item::Function(function) => self.function(function),
        }
    }

    fn line(&mut self, depth: usize, text: &str) {
        let indent = if text.is_empty() { 0 } else { 4 * depth };
        self.text += &format!("{:indent$}{text}\n", "");
    }

    fn function(&mut self, function: &Function) {
        let parameters = function.parameters.iter().map(|p| p.name.as_str());
        let parameters: Vec<&str> = parameters.collect();
        let head = format!("function {}({})", function.name, parameters.join(", "));
        self.line(0, &head);
        self.line(0, "{");
        self.block(1, &function.body);
        self.line(0, "}");
    }

    fn block(&mut self, depth: usize, lines: &[Line]) {
        for line in lines {
            self.statement(depth, line);
        }
    }

    fn statement(&mut self, depth: usize, line: &Line) {
        match &line.statement {
            Statement::Unused(_) => {}
            Statement::If(conditional) => self.conditional(depth, "", conditional),
            Statement::For {
                start,
                condition,
                step,
                body,
            } => {
                let start = start.as_ref().map(|start| self.declared(start));
                let head = format!(
                    "for ({}; {}; {}) {{",
                    start.unwrap_or_default(),
                    self.value(condition),
                    self.simple(step)
                );
                self.loop_of(depth, &head, body);
            }
            Statement::While { condition, body } => {
                let head = format!("while ({}) {{", self.value(condition));
                self.loop_of(depth, &head, body);
            }
            Statement::Comment(words) => self.line(depth, words),
            simple => {
                let comment = line.comment.as_ref();
                let comment = comment.map_or(String::new(), |words| format!(" {words}"));
                let text = format!("{};{comment}", self.simple(simple));
                self.line(depth, &text);
            }
        }
    }

    fn loop_of(&mut self, depth: usize, head: &str, body: &[Line]) {
        self.line(depth, head);
        self.block(depth + 1, body);
        self.line(depth, "}");
    }

    fn conditional(&mut self, depth: usize, before: &str, conditional: &If) {
        let head = format!("{before}if ({}) {{", self.value(&conditional.condition));
        self.line(depth, &head);
        self.block(depth + 1, &conditional.then);
        match &conditional.otherwise {
            Otherwise::Nothing => self.line(depth, "}"),
            Otherwise::If(other) => self.conditional(depth, "} else ", other),
            Otherwise::Block(lines) => self.loop_of(depth, "} else {", lines),
        }
    }

    /// A statement of one line, without its semicolon.
    fn simple(&self, statement: &Statement) -> String {
        match statement {
            Statement::Declare(declaration) => self.declared(declaration),
            Statement::Assign {
                target,
                operator,
                value,
            } => {
                let sign = operator.map_or("", |operator| operator.sign());
                format!("{} {sign}= {}", self.value(target), self.value(value))
            }
            Statement::Count { target, is_up } => {
                let sign = if *is_up { "++" } else { "--" };
                format!("{}{sign}", self.value(target))
            }
            Statement::Call(call) => self.value(call),
            Statement::Return(value) => format!("return {}", self.value(value)),
            Statement::Continue => "continue".to_owned(),
            // the others take several lines
            _ => String::new(),
        }
    }

    fn declared(&self, declaration: &Declaration) -> String {
        let Declaration {
            name, size, value, ..
        } = declaration;
        match (size, value) {
            (Some(_), Value::List(list)) => format!("const {name} = [{}]", self.list(list)),
            (Some(size), _) => format!("const {name} = new Float64Array({})", self.value(size)),
            (None, Value::One(value)) => {
                let word = if declaration.is_const { "const" } else { "let" };
                format!("{word} {name} = {}", self.value(value))
            }
            (None, _) => format!("let {name}"),
        }
    }

    fn list(&self, values: &[Expr]) -> String {
        let texts: Vec<String> = values.iter().map(|value| self.value(value)).collect();
        texts.join(", ")
    }

    fn name(&self, name: &str) -> String {
        (self.word)(name).unwrap_or_else(|| name.to_owned())
    }

    fn value(&self, value: &Expr) -> String {
        match value {
            Expr::Name(name) => self.name(name),
            Expr::Real(digits) | Expr::Number(digits) => digits.clone(),
            Expr::Part(name) => format!("s.{name}"),
            Expr::Index(array, place) => format!("{}[{}]", self.value(array), self.value(place)),
            Expr::Call(name, arguments) => {
                format!("{}({})", self.name(name), self.list(arguments))
            }
            Expr::Cast(_, inner) => self.value(inner),
            Expr::Prefix(sign, inner) => format!("{sign}{}", self.value(inner)),
            Expr::Binary(operator, left, right) => format!(
                "{} {} {}",
                self.value(left),
                operator.sign(),
                self.value(right)
            ),
            Expr::Choice(condition, then, otherwise) => format!(
                "{} ? {} : {}",
                self.value(condition),
                self.value(then),
                self.value(otherwise)
            ),
            Expr::Group(inner) => format!("({})", self.value(inner)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_is_text_without_types() {
        let draft = "static const real table[2] = {R(1.0), -INFINITY};\n\n/* Half\n   of it. */\nstatic truth half(STATE *s, const real *a, int i)\n{\n    real b[3]; /* room */\n    const real c = R(0.5) * a[i];\n    (void)i;\n    for (int k = 0; k < 3; k++) {\n        b[k] = (real)k;\n    }\n    if (c < b[0]) {\n        s->x[0] = sqrt(fabs(c)) + (real)i;\n    } else if (!isfinite(c)) {\n        return 0;\n    } else {\n        /* nothing */\n    }\n    return 1;\n}\n";
        let expected = "const table = [1.0, -Infinity];\n\n/* Half\n   of it. */\nfunction half(s, a, i)\n{\n    const b = new Float64Array(3); /* room */\n    const c = 0.5 * a[i];\n    for (let k = 0; k < 3; k++) {\n        b[k] = k;\n    }\n    if (c < b[0]) {\n        s.x[0] = Math.sqrt(Math.abs(c)) + i;\n    } else if (!Number.isFinite(c)) {\n        return 0;\n    } else {\n        /* nothing */\n    }\n    return 1;\n}\n";
        assert_eq!(printed(draft, super::super::word).unwrap(), expected);
    }
}
