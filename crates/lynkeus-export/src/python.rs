//! Functions in Python over a namespace `xp`: `numpy` or `jax.numpy`, or `casadi`.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_export::python::{Function, Namespace, Vector, module};
//!
//! let g = Graph::new();
//! let [t, level, inflow] = ["t", "level", "inflow"].map(|name| g.symbol(name));
//! let inputs = [t, level, inflow].map(|e| e.node());
//! let outputs = [(inflow - 0.5 * level.sqrt()).node()];
//! let vectors = [("x", "level"), ("u", "inflow")].map(|(name, entry)| Vector {
//!     name: name.into(),
//!     entries: vec![entry.into()],
//! });
//! let f = Function { name: "f", graph: &g, inputs: &inputs, outputs: &outputs };
//! let module = module("Tank", &[f], &vectors, Namespace::Numpy)?;
//! assert!(module.text.ends_with(
//!     "    level = x[0]\n    inflow = u[0]\n    return xp.array([inflow - 0.5*xp.sqrt(level)])\n"
//! ));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use lynkeus_expr::{Binary, Graph, Node, Unary};

use crate::code::Solver;
use crate::{Binding, Body, Code, Dialect, Form, Names, Refusal, Text};

/// Whose functions are called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Namespace {
    /// `numpy`, `jax.numpy`, and what is like them
    Numpy,
    /// `casadi`
    Casadi,
}

/// An argument of functions: a vector whose entries have names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vector {
    /// an identifier
    pub name: String,
    /// what the model calls the entries
    pub entries: Vec<String>,
}

/// A function `name(xp, t, …)` of time and the vectors of its module.
#[derive(Clone, Copy, Debug)]
pub struct Function<'a> {
    /// an identifier
    pub name: &'a str,
    /// what holds its expressions
    pub graph: &'a Graph,
    /// symbols, all that it reads: time, then the entries of the vectors
    pub inputs: &'a [Node],
    /// what is returned
    pub outputs: &'a [Node],
}

/// The text of a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Module {
    /// ends with a line break
    pub text: String,
    /// whether linear systems are left to the namespace
    pub has_systems: bool,
}

/// Prints functions of time and these vectors; the title stands above them.
///
/// # Errors
/// [`Refusal::Loop`], [`Refusal::LargeSystem`] and [`Refusal::Lacks`].
pub fn module(
    title: &str,
    functions: &[Function<'_>],
    vectors: &[Vector],
    namespace: Namespace,
) -> Result<Module, Refusal> {
    let mut text = comment(title);
    for Vector { name, entries } in vectors {
        text += &comment(&format!("{name}: {}", entries.join(", ")));
    }
    let mut has_systems = false;
    for function in functions {
        let Function {
            graph,
            inputs,
            outputs,
            ..
        } = function;
        let code = Code::of(graph, inputs, &[outputs], Solver::Plain)?;
        has_systems |= code.has_systems();
        text += "\n\n";
        text += &namespace.function(function.name, &code, vectors)?;
    }
    Ok(Module { text, has_systems })
}

/// A line for people, whatever the model calls its variables.
fn comment(words: &str) -> String {
    let words = crate::names::seen(words);
    format!("# {}\n", words.trim_end())
}

/// Longest list on one line, in characters.
const LONGEST: usize = 80;

const RESERVED: [&str; 39] = [
    "False", "None", "True", "and", "as", "assert", "async", "await", "break", "case", "class",
    "continue", "def", "del", "elif", "else", "except", "finally", "float", "for", "from",
    "global", "if", "import", "in", "is", "lambda", "match", "nonlocal", "not", "or", "pass",
    "raise", "return", "try", "type", "while", "with", "yield",
];

impl Namespace {
    fn function(self, name: &str, code: &Code, vectors: &[Vector]) -> Result<String, Refusal> {
        let arguments: Vec<&str> = vectors.iter().map(|v| v.name.as_str()).collect();
        let mut names = Names::without(["xp", "t"].iter().chain(&arguments).copied());
        let mut lines = self.conversions(&arguments);
        let mut inputs = vec![Text::atom("t")];
        let needed = code.operations();
        for Vector { name, entries } in vectors {
            for (place, entry) in entries.iter().enumerate() {
                let is_needed = match code.inputs().get(inputs.len()) {
                    Some(input) => needed.binary_search(input).is_ok(),
                    None => false,
                };
                if !is_needed {
                    inputs.push(Text::atom(""));
                    continue;
                }
                let identifier = self.identifier(&mut names, entry);
                let told = match identifier == *entry {
                    true => String::new(),
                    false => format!("  {}", comment(entry).trim_end()),
                };
                lines.push(format!("{identifier} = {name}[{place}]{told}"));
                inputs.push(Text::atom(identifier));
            }
        }
        let body = Body::of(code, &self, &inputs, &mut names)?;
        lines.extend(body.lines);
        lines.extend(self.result(&body.outputs));
        let parameters = ["xp", "t"].iter().chain(&arguments).copied();
        let head = parameters.collect::<Vec<_>>().join(", ");
        let lines = lines.into_iter().map(|line| format!("    {line}\n"));
        Ok(format!(
            "def {name}({head}):\n{}",
            lines.collect::<String>()
        ))
    }

    /// Python's own numbers raise exceptions where an array has an infinity.
    fn conversions(self, vectors: &[&str]) -> Vec<String> {
        let convert = |name: &&str| format!("{name} = xp.asarray({name}, dtype=float)");
        match self {
            Self::Numpy => ["t"].iter().chain(vectors).map(convert).collect(),
            Self::Casadi => vec![],
        }
    }

    fn vector(self, entries: &[Text]) -> String {
        let entries: Vec<&str> = entries.iter().map(|entry| entry.text.as_str()).collect();
        let entries = entries.join(", ");
        match self {
            Self::Numpy => format!("xp.array([{entries}])"),
            Self::Casadi => format!("xp.vertcat({entries})"),
        }
    }

    fn result(self, outputs: &[Text]) -> Vec<String> {
        let short = match (self, outputs) {
            (Self::Casadi, []) => "xp.SX(0, 1)".to_owned(),
            _ => self.vector(outputs),
        };
        if short.len() <= LONGEST {
            return vec![format!("return {short}")];
        }
        let (open, close) = match self {
            Self::Numpy => ("return xp.array([", "])"),
            Self::Casadi => ("return xp.vertcat(", ")"),
        };
        let entries = outputs.iter().map(|output| format!("    {},", output.text));
        let lines = std::iter::once(open.to_owned()).chain(entries);
        lines.chain([close.to_owned()]).collect()
    }

    fn matrix(self, a: &[Text], n: usize) -> Vec<String> {
        let (open, row, close) = match self {
            Self::Numpy => ("    xp.array([", "[", "]),"),
            Self::Casadi => ("    xp.vertcat(", "xp.horzcat(", "),"),
        };
        let end = match self {
            Self::Numpy => "],",
            Self::Casadi => "),",
        };
        let rows = a.chunks(n.max(1)).map(|entries| {
            let entries: Vec<&str> = entries.iter().map(|entry| entry.text.as_str()).collect();
            format!("        {row}{}{end}", entries.join(", "))
        });
        let mut lines = vec![open.to_owned()];
        lines.extend(rows);
        lines.push(format!("    {close}"));
        lines
    }
}

/// What both namespaces write in the same way.
const fn common(op: Binary) -> Option<Form> {
    Some(match op {
        Binary::Add => Form::Infix(" + ", Binding::Sum),
        Binary::Sub => Form::Infix(" - ", Binding::Sum),
        Binary::Mul => Form::Infix("*", Binding::Product),
        Binary::Div => Form::Infix("/", Binding::Product),
        Binary::Less => Form::Infix(" < ", Binding::Relation),
        Binary::LessEq => Form::Infix(" <= ", Binding::Relation),
        Binary::Equal => Form::Infix(" == ", Binding::Relation),
        _ => return None,
    })
}

impl Dialect for Namespace {
    fn name(&self) -> &'static str {
        match self {
            Self::Numpy => "Python with NumPy",
            Self::Casadi => "Python with CasADi",
        }
    }

    fn is_reserved(&self, word: &str) -> bool {
        RESERVED.contains(&word)
    }

    fn number(&self, value: f64) -> Text {
        let (text, is_negative) = match value {
            v if v.is_nan() => ("float(\"nan\")".to_owned(), false),
            v if v.is_infinite() => ("float(\"inf\")".to_owned(), v < 0.0),
            v => (format!("{:?}", v.abs()), v.is_sign_negative()),
        };
        Text::signed(text, is_negative)
    }

    fn unary(&self, op: Unary) -> Option<Form> {
        let (numpy, casadi) = match op {
            Unary::Neg => return Some(Form::Prefix("-", Binding::Sign)),
            Unary::Abs => ("xp.abs", "xp.fabs"),
            Unary::Sign => ("xp.sign", "xp.sign"),
            Unary::Floor => ("xp.floor", "xp.floor"),
            Unary::Sqrt => ("xp.sqrt", "xp.sqrt"),
            Unary::Exp => ("xp.exp", "xp.exp"),
            Unary::Ln => ("xp.log", "xp.log"),
            Unary::Sin => ("xp.sin", "xp.sin"),
            Unary::Cos => ("xp.cos", "xp.cos"),
            Unary::Tan => ("xp.tan", "xp.tan"),
            Unary::Asin => ("xp.arcsin", "xp.asin"),
            Unary::Acos => ("xp.arccos", "xp.acos"),
            Unary::Atan => ("xp.arctan", "xp.atan"),
            Unary::Sinh => ("xp.sinh", "xp.sinh"),
            Unary::Cosh => ("xp.cosh", "xp.cosh"),
            Unary::Tanh => ("xp.tanh", "xp.tanh"),
            Unary::Not => ("xp.logical_not", "xp.logic_not"),
        };
        Some(Form::Call(match self {
            Self::Numpy => numpy,
            Self::Casadi => casadi,
        }))
    }

    fn binary(&self, op: Binary) -> Option<Form> {
        let (numpy, casadi) = match op {
            Binary::Pow => ("xp.power", "xp.power"),
            Binary::Atan2 => ("xp.arctan2", "xp.atan2"),
            Binary::Min => ("xp.minimum", "xp.fmin"),
            Binary::Max => ("xp.maximum", "xp.fmax"),
            Binary::And => ("xp.logical_and", "xp.logic_and"),
            Binary::Or => ("xp.logical_or", "xp.logic_or"),
            op => return common(op),
        };
        Some(Form::Call(match self {
            Self::Numpy => numpy,
            Self::Casadi => casadi,
        }))
    }

    fn power(&self, base: &Text, exponent: i32) -> Text {
        Text {
            text: format!("{}**{exponent}", base.tighter(Binding::Power)),
            binding: Binding::Power,
        }
    }

    fn select(&self, condition: &Text, x: &Text, y: &Text) -> Text {
        let function = match self {
            Self::Numpy => "xp.where",
            Self::Casadi => "xp.if_else",
        };
        Text::call(function, &[condition, x, y])
    }

    fn assignment(&self, name: &str, value: &Text) -> String {
        format!("{name} = {}", value.text)
    }

    fn solution(&self, name: &str, a: &[Text], b: &[Text]) -> Option<Vec<String>> {
        let function = match self {
            Self::Numpy => "xp.linalg.solve",
            Self::Casadi => "xp.solve",
        };
        let mut lines = vec![format!("{name} = {function}(")];
        lines.extend(self.matrix(a, b.len()));
        lines.push(format!("    {},", self.vector(b)));
        lines.push(")".to_owned());
        Some(lines)
    }

    fn entry(&self, solution: &str, place: usize) -> Text {
        Text::atom(format!("{solution}[{place}]"))
    }
}
