//! Expressions as text, for messages.

use crate::{Binary, Graph, Node, Op, Unary, real};

/// Deeper expressions are cut: messages need no more.
const DEPTH: usize = 40;
/// Significant digits of a number.
const DIGITS: usize = 6;
/// Linear systems up to this size are spelled out.
const SPELLED: usize = 3;
/// Symbols named of others.
const NAMED: usize = 4;

impl Graph {
    /// The expression in Modelica notation, cut with `…` to about `max_chars`.
    pub fn render(&self, node: Node, max_chars: usize) -> String {
        let mut text = String::new();
        Renderer {
            graph: self,
            max: max_chars,
            in_system: false,
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
    /// a system within one is not spelled out
    in_system: bool,
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
            Op::Constant(value) => {
                let negative = value.is_sign_negative();
                self.grouped(outer > 2 && negative, text, |text| {
                    // 0.65 for the sum that is 0.6499999999999999
                    text.push_str(&real::rounded(value, DIGITS).to_string())
                });
            }
            Op::Symbol(_) => text.push_str(&self.graph.symbol_name(node).unwrap_or_default()),
            Op::Unary(Unary::Neg, a) => self.grouped(outer > 1, text, |text| {
                let start = text.len();
                self.write(a, 2, depth, text);
                // two signs cancel: what stands here is a product
                match text[start..].starts_with('-') {
                    true => _ = text.remove(start),
                    false => text.insert(start, '-'),
                }
            }),
            Op::Powi(a, n) => self.grouped(outer > 3, text, |text| {
                self.write(a, 4, depth, text);
                match n < 0 {
                    true => text.push_str(&format!("^({n})")),
                    false => text.push_str(&format!("^{n}")),
                }
            }),
            Op::Unary(op, a) => self.call(&format!("{op:?}").to_lowercase(), &[a], depth, text),
            Op::Binary(op, a, b) => match infix(op) {
                Some((sign, level)) => self.grouped(outer > level, text, |text| {
                    let is_power = op == Binary::Pow;
                    let (a, b) = self.ordered(op, a, b);
                    self.write(a, level + u8::from(is_power), depth, text);
                    let start = text.len();
                    text.push_str(sign);
                    self.write(b, level + 1, depth, text);
                    let joined = match op {
                        Binary::Add => Some(" - "),
                        Binary::Sub => Some(" + "),
                        _ => None,
                    };
                    let end = start + sign.len();
                    if let Some(other) = joined
                        && text[end..].starts_with('-')
                    {
                        text.replace_range(start..=end, other);
                    }
                }),
                None => self.call(&format!("{op:?}").to_lowercase(), &[a, b], depth, text),
            },
            Op::Select(c, a, b) => self.grouped(outer > 0, text, |text| {
                for (word, part) in [("if ", c), (" then ", a), (" else ", b)] {
                    text.push_str(word);
                    self.write(part, 1, depth, text);
                }
            }),
            Op::System(_) => self.system(node, depth, text),
            Op::Entry(system, entry) => {
                self.write(system, 0, depth + 1, text);
                let call = self.graph.system(system);
                if call.is_none_or(|call| call.function().is_none() || call.size() > 1) {
                    text.push_str(&format!("[{}]", entry + 1));
                }
            }
        }
    }

    /// The operands, a negative factor in front.
    fn ordered(&self, op: Binary, a: Node, b: Node) -> (Node, Node) {
        match self.graph.op(b) {
            Op::Constant(value) if op == Binary::Mul && value < 0.0 => (b, a),
            _ => (a, b),
        }
    }

    /// `root(a: a + exp(a) - x = 0)`, or `solve([a, b; c, d], {e, f})`; a large linear system, and
    /// one within another, by what it reads.
    fn system(&self, node: Node, depth: usize, text: &mut String) {
        let Some(call) = self.graph.system(node) else {
            return;
        };
        if let Some(function) = call.function() {
            text.push_str(&format!("root({})", function.text()));
        }
        let Some((matrix, right)) = call.linear() else {
            return;
        };
        let n = right.len();
        if self.in_system || n > SPELLED {
            let symbols = self.graph.symbols_of(&[node]);
            let names: Vec<String> = symbols
                .iter()
                .take(NAMED + 1)
                .filter_map(|s| self.graph.symbol_name(*s))
                .collect();
            let more = if names.len() > NAMED { ", …" } else { "" };
            let names = names[..names.len().min(NAMED)].join(", ");
            text.push_str(&format!("solve({n}×{n} in {names}{more})"));
            return;
        }
        let inner = Renderer {
            in_system: true,
            ..*self
        };
        text.push_str("solve([");
        for (i, row) in matrix.chunks(n).enumerate() {
            text.push_str(if i > 0 { "; " } else { "" });
            inner.list(row, depth, text);
        }
        text.push_str("], {");
        inner.list(right, depth, text);
        text.push_str("})");
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
        self.list(arguments, depth, text);
        text.push(')');
    }

    fn list(&self, nodes: &[Node], depth: usize, text: &mut String) {
        for (i, &node) in nodes.iter().enumerate() {
            text.push_str(if i > 0 { ", " } else { "" });
            self.write(node, 0, depth, text);
        }
    }
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
            (-(-1.097 * (x + y)), "1.097*(x + y)"),
            (x - -1.5 * y, "x + 1.5*y"),
            (g.constant(-2.0) + x, "x - 2"),
            (x / g.constant(-2.0), "x/(-2)"),
            ((-2.0 * x).sin() * -3.0, "-3*sin(-2*x)"),
            (x.powi(2).powi(-3), "(x^2)^(-3)"),
            (x.pow(y).pow(x), "(x^y)^x"),
        ];
        for (expression, text) in cases {
            assert_eq!(g.render(expression.node(), 80), text);
        }
    }

    #[test]
    fn a_linear_system_is_spelled_out() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let one = g.constant(1.0).node();
        let inner = g.solve(&[one, x.node(), y.node(), one], &[y.node(), one]);
        let text = "solve([1, x; y, 1], {y, 1})[2]";
        assert_eq!(g.render(inner.x[1], 80), text);
        assert_eq!(g.render(inner.x[1], 12), "solve([1, x…");
        let outer = g.solve(&[inner.x[0]], &[one]).x[0];
        let text = "solve([solve(2×2 in x, y)[1]], {1})[1]";
        assert_eq!(g.render(outer, 80), text);
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
