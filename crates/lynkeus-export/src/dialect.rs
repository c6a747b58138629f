//! How a language writes operations: a [`Dialect`], and a [`Body`] of assignments in it, one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Call, Node, Op, Unary};

use crate::code::is_truth;
use crate::{Code, Names, Refusal};

/// How tightly the outermost operation of a text binds, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binding {
    /// `x < y`
    Relation,
    /// `x + y`
    Sum,
    /// `x*y`
    Product,
    /// `-x`
    Sign,
    /// `x**2`
    Power,
    /// a name, a literal, a call
    Atom,
}

/// The text of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Text {
    /// as it stands
    pub text: String,
    /// what decides on parentheses around it
    pub binding: Binding,
}

impl Text {
    /// A text that needs no parentheses anywhere.
    pub fn atom(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            binding: Binding::Atom,
        }
    }

    /// A number's digits with their sign.
    pub fn signed(digits: impl Into<String>, is_negative: bool) -> Self {
        match is_negative {
            true => Self {
                text: format!("-{}", digits.into()),
                binding: Binding::Sign,
            },
            false => Self::atom(digits),
        }
    }

    /// The text where at least this binding is needed.
    pub fn at_least(&self, binding: Binding) -> String {
        match self.binding >= binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// The text where more than this binding is needed.
    pub fn tighter(&self, binding: Binding) -> String {
        match self.binding > binding {
            true => self.text.clone(),
            false => format!("({})", self.text),
        }
    }

    /// A call with these arguments.
    pub fn call(function: &str, arguments: &[&Text]) -> Self {
        let arguments: Vec<&str> = arguments.iter().map(|a| a.text.as_str()).collect();
        Self::atom(format!("{function}({})", arguments.join(", ")))
    }
}

/// The shape of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// `name(x, …)`
    Call(&'static str),
    /// the sign before its argument
    Prefix(&'static str, Binding),
    /// the sign between its arguments, with its spaces; the order of operations is kept
    Infix(&'static str, Binding),
}

impl Form {
    /// The operation of these arguments.
    pub fn of(self, arguments: &[&Text]) -> Text {
        match (self, arguments) {
            (Self::Prefix(sign, binding), [x]) => Text {
                text: format!("{sign}{}", x.tighter(binding)),
                binding,
            },
            (Self::Infix(sign, binding), [x, y]) => {
                // relations do not chain, and sums are not associative
                let left = match binding {
                    Binding::Relation => x.tighter(binding),
                    _ => x.at_least(binding),
                };
                Text {
                    text: format!("{left}{sign}{}", y.tighter(binding)),
                    binding,
                }
            }
            (Self::Call(name) | Self::Prefix(name, _) | Self::Infix(name, _), arguments) => {
                Text::call(name, arguments)
            }
        }
    }
}

/// A language, as far as the printing of operations goes. None is an operation that it lacks.
pub(crate) trait Dialect {
    /// What messages call it.
    fn name(&self) -> &'static str;
    /// Words that cannot be identifiers.
    fn is_reserved(&self, word: &str) -> bool;
    /// A number: the shortest digits that give the same one back.
    fn number(&self, value: f64) -> Text;
    /// A function of one argument.
    fn unary(&self, op: Unary) -> Option<Form>;
    /// A function of two arguments.
    fn binary(&self, op: Binary) -> Option<Form>;
    /// An integer power of any base.
    fn power(&self, base: &Text, exponent: i32) -> Text;
    /// `if condition then x else y`; the condition is a truth value.
    fn select(&self, condition: &Text, x: &Text, y: &Text) -> Text;
    /// A line that names a value.
    fn assignment(&self, name: &str, value: &Text) -> String;
    /// A line that names a truth value.
    fn truth(&self, name: &str, value: &Text) -> String {
        self.assignment(name, value)
    }
    /// Lines that name the solution of A x = b; `a` is n×n row by row.
    fn solution(&self, name: &str, a: &[Text], b: &[Text]) -> Option<Vec<String>>;
    /// An entry of a solution.
    fn entry(&self, solution: &str, place: usize) -> Text;

    /// An identifier like the name.
    fn identifier(&self, names: &mut Names, name: &str) -> String {
        names.identifier(name, |word| self.is_reserved(word))
    }
}

/// Longest text of a value that is written where it is used, in characters.
const LONGEST: usize = 72;

/// The operations of a [`Code`] in a language.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// assignments
    pub lines: Vec<String>,
    /// one for each output
    pub outputs: Vec<Text>,
}

impl Body {
    /// Writes the code, where its inputs have these texts; none of what is named is among `names`.
    ///
    /// # Errors
    /// [`Refusal::Lacks`].
    pub fn of(
        code: &Code,
        dialect: &dyn Dialect,
        inputs: &[Text],
        names: &mut Names,
    ) -> Result<Self, Refusal> {
        let operations = code.operations();
        let mut printer = Printer {
            code,
            dialect,
            names,
            uses: uses(code, &operations),
            texts: code
                .inputs()
                .iter()
                .copied()
                .zip(inputs.iter().cloned())
                .collect(),
            lines: vec![],
        };
        for node in operations {
            printer.write(node)?;
        }
        let outputs = code.outputs().iter();
        Ok(Self {
            outputs: outputs.map(|&output| printer.value(output)).collect(),
            lines: printer.lines,
        })
    }
}

/// How often each operation is used.
fn uses(code: &Code, operations: &[Node]) -> HashMap<Node, usize> {
    let mut uses = HashMap::new();
    let arguments = operations
        .iter()
        .flat_map(|&node| code.graph().arguments(node));
    for node in arguments.chain(code.outputs().iter().copied()) {
        *uses.entry(node).or_default() += 1;
    }
    uses
}

/// An operation in words.
fn called(op: impl std::fmt::Debug) -> String {
    format!("{op:?}").to_lowercase()
}

struct Printer<'a> {
    code: &'a Code,
    dialect: &'a dyn Dialect,
    names: &'a mut Names,
    uses: HashMap<Node, usize>,
    texts: HashMap<Node, Text>,
    lines: Vec<String>,
}

impl Printer<'_> {
    fn write(&mut self, node: Node) -> Result<(), Refusal> {
        let text = match self.code.graph().op(node) {
            Op::Symbol(_) => return Ok(()),
            Op::Constant(value) => self.dialect.number(value),
            Op::System(_) => self.solution(node)?,
            Op::Entry(system, place) => {
                let solution = self.texts.get(&system).map_or("", |text| &text.text);
                self.dialect.entry(solution, place as usize)
            }
            op => {
                let text = self.operation(op)?;
                self.named(node, text)
            }
        };
        self.texts.insert(node, text);
        Ok(())
    }

    fn operation(&self, op: Op) -> Result<Text, Refusal> {
        let dialect = self.dialect;
        Ok(match op {
            Op::Powi(x, n) => dialect.power(&self.value(x), n),
            Op::Select(c, x, y) => {
                dialect.select(&self.condition(c), &self.value(x), &self.value(y))
            }
            Op::Unary(op, x) => {
                let form = dialect.unary(op).ok_or_else(|| self.lacks(called(op)))?;
                match op {
                    Unary::Not => form.of(&[&self.condition(x)]),
                    _ => form.of(&[&self.value(x)]),
                }
            }
            Op::Binary(op, x, y) => {
                let form = dialect.binary(op).ok_or_else(|| self.lacks(called(op)))?;
                match op {
                    Binary::And | Binary::Or => form.of(&[&self.condition(x), &self.condition(y)]),
                    _ => form.of(&[&self.value(x), &self.value(y)]),
                }
            }
            // leaves and systems are written elsewhere
            other => return Err(self.lacks(called(other))),
        })
    }

    fn lacks(&self, operation: impl Into<String>) -> Refusal {
        Refusal::Lacks {
            language: self.dialect.name(),
            operation: operation.into(),
        }
    }

    /// What is used once and short stands where it is used, everything else has a name.
    fn named(&mut self, node: Node, text: Text) -> Text {
        let is_single = self.uses.get(&node).is_none_or(|&uses| uses < 2);
        if is_single && text.text.len() <= LONGEST {
            return text;
        }
        let name = self.names.numbered('v');
        let line = if is_truth(self.code.graph().op(node)) {
            self.dialect.truth(&name, &text)
        } else {
            self.dialect.assignment(&name, &text)
        };
        self.lines.push(line);
        Text::atom(name)
    }

    fn solution(&mut self, node: Node) -> Result<Text, Refusal> {
        let graph = self.code.graph();
        let call = graph.system(node);
        let Some((a, b)) = call.as_ref().and_then(Call::linear) else {
            return Err(self.lacks("an implicit function"));
        };
        let texts = |nodes: &[Node]| nodes.iter().map(|&n| self.value(n)).collect::<Vec<_>>();
        let (a, b) = (texts(a), texts(b));
        let name = self.names.numbered('s');
        let lines = self.dialect.solution(&name, &a, &b);
        let lines = lines.ok_or_else(|| self.lacks("a linear system"))?;
        self.lines.extend(lines);
        Ok(Text::atom(name))
    }

    fn text(&self, node: Node) -> Text {
        let known = self.texts.get(&node).cloned();
        // arguments come first
        known.unwrap_or_else(|| Text::atom(""))
    }

    /// The text of a node as a number.
    fn value(&self, node: Node) -> Text {
        let text = self.text(node);
        match is_truth(self.code.graph().op(node)) {
            true => {
                let [one, zero] = [1.0, 0.0].map(|number| self.dialect.number(number));
                self.dialect.select(&text, &one, &zero)
            }
            false => text,
        }
    }

    /// The text of a node as a truth value: anything but zero is true.
    fn condition(&self, node: Node) -> Text {
        let text = self.text(node);
        if is_truth(self.code.graph().op(node)) {
            return text;
        }
        let zero = self.dialect.number(0.0).text;
        Text {
            text: format!("{} != {zero}", text.tighter(Binding::Relation)),
            binding: Binding::Relation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Form;
    use crate::code::Solver;
    use crate::python::Namespace;
    use lynkeus_expr::{Expr, Graph};

    fn printed<const N: usize>(
        dialect: &dyn Dialect,
        make: impl for<'g> Fn([Expr<'g>; 3]) -> [Expr<'g>; N],
    ) -> Result<Body, Refusal> {
        let g = Graph::new();
        let symbols = ["a", "b", "c"].map(|name| g.symbol(name));
        let outputs = make(symbols).map(|e| e.node());
        let code = Code::of(&g, &symbols.map(|e| e.node()), &[&outputs], Solver::Plain)?;
        let inputs = ["a", "b", "c"].map(Text::atom);
        Body::of(&code, dialect, &inputs, &mut Names::default())
    }

    fn text(make: impl for<'g> Fn([Expr<'g>; 3]) -> Expr<'g>) -> String {
        let body = printed(&Namespace::Numpy, |symbols| [make(symbols)]).unwrap();
        assert_eq!(body.lines, [""; 0]);
        body.outputs[0].text.clone()
    }

    #[test]
    fn parentheses_keep_the_order_of_operations() {
        assert_eq!(text(|[a, b, c]| a - (b - c)), "a - (b - c)");
        assert_eq!(text(|[a, b, c]| a - b - c), "a - b - c");
        assert_eq!(text(|[a, b, c]| a + (b + c)), "a + (b + c)");
        assert_eq!(text(|[a, b, c]| a / (b / c)), "a/(b/c)");
        assert_eq!(text(|[a, b, c]| (a + b) / -c), "(a + b)/-c");
        assert_eq!(text(|[a, b, _]| -(a + b)), "-(a + b)");
        assert_eq!(text(|[a, _, _]| (-a).powi(2)), "(-a)**2");
        assert_eq!(text(|[a, _, _]| -a.powi(2)), "-a**2");
        assert_eq!(text(|[a, _, _]| a.powi(2).powi(-3)), "(a**2)**-3");
        assert_eq!(text(|[a, b, _]| (a * -0.1) - b * -1e22), "a*-0.1 - b*-1e22");
    }

    #[test]
    fn truth_values_and_numbers_stand_where_the_other_is_needed() {
        assert_eq!(
            text(|[a, b, c]| a.less(b).select(a, c)),
            "xp.where(a < b, a, c)"
        );
        assert_eq!(
            text(|[a, b, c]| a.less(b).equal(c)),
            "xp.where(c == xp.where(a < b, 1.0, 0.0), 1.0, 0.0)"
        );
        assert_eq!(
            text(|[a, b, _]| a.and(!b)),
            "xp.where(xp.logical_and(a != 0.0, xp.logical_not(b != 0.0)), 1.0, 0.0)"
        );
        // nobody knows what a condition says that is no number
        assert_eq!(
            text(|[a, b, c]| a.select(b, c)),
            "xp.where(a == a, xp.where(a != 0.0, b, c), float(\"nan\"))"
        );
    }

    #[test]
    fn what_is_used_twice_has_a_name_and_what_no_one_needs_is_gone() {
        let body = printed(&Namespace::Numpy, |[a, b, c]| {
            let _ = c.exp();
            [a.sin() * b, a.sin() / b]
        })
        .unwrap();
        assert_eq!(body.lines, ["v1 = xp.sin(a)"]);
        let outputs: Vec<&str> = body.outputs.iter().map(|o| o.text.as_str()).collect();
        assert_eq!(outputs, ["b*v1", "v1/b"]);
    }

    /// Without inverse tangents of two arguments and without a solver.
    struct Poor;

    impl Dialect for Poor {
        fn name(&self) -> &'static str {
            "Poor"
        }
        fn is_reserved(&self, _: &str) -> bool {
            false
        }
        fn number(&self, value: f64) -> Text {
            Namespace::Numpy.number(value)
        }
        fn unary(&self, op: Unary) -> Option<Form> {
            Namespace::Numpy.unary(op)
        }
        fn binary(&self, op: Binary) -> Option<Form> {
            (op != Binary::Atan2).then(|| Namespace::Numpy.binary(op))?
        }
        fn power(&self, base: &Text, exponent: i32) -> Text {
            Namespace::Numpy.power(base, exponent)
        }
        fn select(&self, condition: &Text, x: &Text, y: &Text) -> Text {
            Namespace::Numpy.select(condition, x, y)
        }
        fn assignment(&self, name: &str, value: &Text) -> String {
            Namespace::Numpy.assignment(name, value)
        }
        fn solution(&self, _: &str, _: &[Text], _: &[Text]) -> Option<Vec<String>> {
            None
        }
        fn entry(&self, solution: &str, place: usize) -> Text {
            Namespace::Numpy.entry(solution, place)
        }
    }

    #[test]
    fn an_operation_that_a_language_lacks_is_refused_by_name() {
        let refusal = printed(&Poor, |[a, b, _]| [a.atan2(b)]).unwrap_err();
        assert_eq!(refusal.to_string(), "Poor has no way to write atan2");
        let refusal = printed(&Poor, |[a, b, c]| {
            let solution = a.graph().solve(&[a.node()], &[b.node()]);
            [a.graph().expr(solution.x[0]) + c]
        });
        let told = refusal.unwrap_err().to_string();
        assert_eq!(told, "Poor has no way to write a linear system");
    }
}
