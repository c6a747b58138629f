//! Expressions as text, for messages.

use crate::{Binary, Graph, Node, Op, Unary};

/// Deeper expressions are cut: messages need no more.
const DEPTH: usize = 40;

impl Graph {
    /// The expression in Modelica notation, cut with `…` to about `max_chars`.
    pub fn render(&self, node: Node, max_chars: usize) -> String {
        let mut text = String::new();
        Renderer {
            graph: self,
            max: max_chars,
        }
        .write(node, 0, DEPTH, &mut text);
        if text.chars().count() > max_chars {
            text = text.chars().take(max_chars.saturating_sub(1)).collect();
            text.push('…');
        }
        text
    }
}

struct Renderer<'g> {
    graph: &'g Graph,
    max: usize,
}

impl Renderer<'_> {
    /// Writes the node; parentheses where `outer` binds tighter.
    fn write(&self, node: Node, outer: u8, depth: usize, text: &mut String) {
        if depth == 0 || text.len() > 4 * self.max {
            text.push('…');
            return;
        }
        let depth = depth - 1;
        match self.graph.op(node) {
            Op::Constant(value) => text.push_str(&brief(value)),
            Op::Symbol(_) => text.push_str(&self.graph.symbol_name(node).unwrap_or_default()),
            Op::Unary(Unary::Neg, a) => self.grouped(outer > 1, text, |text| {
                text.push('-');
                self.write(a, 2, depth, text);
            }),
            Op::Powi(a, n) => {
                self.write(a, 4, depth, text);
                text.push_str(&format!("^{n}"));
            }
            Op::Unary(op, a) => self.call(&format!("{op:?}").to_lowercase(), &[a], depth, text),
            Op::Binary(op, a, b) => match infix(op) {
                Some((sign, level)) => self.grouped(outer > level, text, |text| {
                    self.write(a, level, depth, text);
                    text.push_str(sign);
                    self.write(b, level + 1, depth, text);
                }),
                None => self.call(&format!("{op:?}").to_lowercase(), &[a, b], depth, text),
            },
            Op::Select(c, a, b) => self.grouped(outer > 0, text, |text| {
                for (word, part) in [("if ", c), (" then ", a), (" else ", b)] {
                    text.push_str(word);
                    self.write(part, 1, depth, text);
                }
            }),
            Op::Solve(_) => text.push_str("solve(A, b)"),
            Op::Entry(_, entry) => text.push_str(&format!("solve(A, b)[{}]", entry + 1)),
        }
    }

    fn grouped(&self, parentheses: bool, text: &mut String, body: impl FnOnce(&mut String)) {
        if parentheses {
            text.push('(');
        }
        body(text);
        if parentheses {
            text.push(')');
        }
    }

    fn call(&self, name: &str, arguments: &[Node], depth: usize, text: &mut String) {
        text.push_str(name);
        text.push('(');
        for (i, &argument) in arguments.iter().enumerate() {
            if i > 0 {
                text.push_str(", ");
            }
            self.write(argument, 0, depth, text);
        }
        text.push(')');
    }
}

/// Six significant digits: 0.65 for the sum that is 0.6499999999999999.
fn brief(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    let value: f64 = if value.is_finite() { rounded } else { value };
    value.to_string()
}

fn infix(op: Binary) -> Option<(&'static str, u8)> {
    Some(match op {
        Binary::Add => (" + ", 1),
        Binary::Sub => (" - ", 1),
        Binary::Mul => ("*", 2),
        Binary::Div => ("/", 2),
        Binary::Pow => ("^", 3),
        Binary::Less => (" < ", 1),
        Binary::LessEq => (" <= ", 1),
        Binary::Equal => (" == ", 1),
        Binary::And => (" and ", 0),
        Binary::Or => (" or ", 0),
        Binary::Atan2 | Binary::Min | Binary::Max => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parentheses_stand_where_they_are_needed() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let cases = [
            ((x + y) * x, "x*(x + y)"),
            (x - (y - x), "x - (y - x)"),
            ((-x).powi(2), "(-x)^2"),
            (x / (y * x), "x/(x*y)"),
            (x.sqrt() / 2.0, "sqrt(x)/2"),
            (x * (1.65 - 1.0), "x*0.65"),
        ];
        for (expression, text) in cases {
            assert_eq!(g.render(expression.node(), 80), text);
        }
    }

    #[test]
    fn huge_expressions_are_cut() {
        let g = Graph::new();
        let x = g.symbol("x");
        let deep = (0..100_000).fold(x, |sum, _| (sum + x).sin());
        let text = g.render(deep.node(), 60);
        assert!(text.chars().count() <= 60 && text.ends_with('…'));
    }
}
