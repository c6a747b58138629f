//! Operations as assignments, one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Node, Op, Unary};

use crate::dialect::is_truth;
use crate::{Binding, Code, Dialect, Names, Refusal, Text};

/// Longest text of a value that is written where it is used, in characters.
const LONGEST: usize = 72;

/// The operations of a [`Code`] in a language.
#[derive(Clone, Debug)]
pub struct Body {
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
            Op::Solve(_) | Op::Implicit(_) => self.solution(node)?,
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
        let form = match op {
            Op::Powi(x, n) => return Ok(dialect.power(&self.value(x), n)),
            Op::Select(c, x, y) => {
                let (x, y) = (self.value(x), self.value(y));
                return Ok(dialect.select(&self.condition(c), &x, &y));
            }
            Op::Unary(op, _) => dialect.unary(op).ok_or_else(|| self.lacks(&op)),
            Op::Binary(op, ..) => dialect.binary(op).ok_or_else(|| self.lacks(&op)),
            other => Err(self.lacks(&other)),
        }?;
        Ok(match op {
            Op::Unary(Unary::Not, x) => form.of(&[&self.condition(x)]),
            Op::Unary(_, x) => form.of(&[&self.value(x)]),
            Op::Binary(Binary::And | Binary::Or, x, y) => {
                form.of(&[&self.condition(x), &self.condition(y)])
            }
            Op::Binary(_, x, y) => form.of(&[&self.value(x), &self.value(y)]),
            _ => return Err(self.lacks(&op)),
        })
    }

    fn lacks(&self, operation: &dyn std::fmt::Debug) -> Refusal {
        Refusal::Lacks {
            language: self.dialect.name(),
            operation: format!("{operation:?}").to_lowercase(),
        }
    }

    /// What is used once and short stands where it is used, everything else has a name.
    fn named(&mut self, node: Node, text: Text) -> Text {
        let is_single = self.uses.get(&node).is_none_or(|&uses| uses < 2);
        if is_single && text.text.len() <= LONGEST {
            return text;
        }
        let name = self.names.numbered('v');
        self.lines.push(self.dialect.assignment(&name, &text));
        Text::atom(name)
    }

    fn solution(&mut self, node: Node) -> Result<Text, Refusal> {
        let graph = self.code.graph();
        let Some(system) = graph.system(node) else {
            return Err(self.lacks(&"an implicit function"));
        };
        let texts = |nodes: &[Node]| nodes.iter().map(|&n| self.value(n)).collect::<Vec<_>>();
        let (a, b) = (texts(system.matrix()), texts(system.right()));
        let name = self.names.numbered('s');
        let lines = self.dialect.solution(&name, &a, &b);
        let lines = lines.ok_or_else(|| self.lacks(&"a linear system"))?;
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
