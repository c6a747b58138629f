//! Single expressions, as a study gives them for its inputs.

use lynkeus_expr::{Graph, Node};

use crate::Diagnostic;
use crate::elaborate::{Evaluator, Mode, Named, Scalar, Scope, Value, budget};
use crate::syntax::{Problem, parse_single_expression};

/// Reads one Modelica expression, such as `if time < 20 then 0.75 else 0.38`.
///
/// `names` gives the meaning of names, also of subscripted ones such as `x[3]`. Where it does
/// not know them, `time` is the symbol `time` of the graph and `pi` is the number. Names with
/// other characters than ASCII letters, digits and `_` stand in single quotes: `2*'β'`.
///
/// The operators are those of Modelica. The functions are `sqrt exp log log10 sin cos tan asin
/// acos atan atan2 sinh cosh tanh abs sign min max floor ceil integer mod rem div noEvent
/// smooth`, and for arrays `sum product min max size ndims zeros ones fill linspace identity
/// diagonal transpose cat scalar vector matrix array`.
///
/// # Errors
/// The text is not an expression, reads an unknown name, or is not a scalar number.
///
/// ```
/// use lynkeus_expr::{Graph, Tape};
///
/// let graph = Graph::new();
/// let feed = lynkeus_model::parse_expression(
///     "if time < 20 then 0.75 else 0.38*cos(pi)",
///     &graph,
///     &|_| None,
/// )?;
/// let time = graph.symbol("time").node();
/// let tape = Tape::new(&graph, &[time], &[feed]).unwrap();
/// let mut out = [0.0];
/// tape.evaluator().eval(&[30.0], &mut out);
/// assert_eq!(out, [-0.38]);
/// # Ok::<(), lynkeus_model::Diagnostic>(())
/// ```
pub fn parse_expression(
    source: &str,
    graph: &Graph,
    names: &dyn Fn(&str) -> Option<Node>,
) -> Result<Node, Diagnostic> {
    let refused = |problem| Diagnostic::new(problem, "expression", source);
    let (ast, root) = parse_single_expression(source).map_err(refused)?;
    let scope = StudyScope { graph, names };
    let budget = budget();
    let mut evaluator = Evaluator::new(source, &ast, graph, &budget, &scope, Mode::Continuous);
    let value = evaluator.value(root).map_err(refused)?;
    let node = match value {
        Value::Scalar(scalar) => scalar.real(graph),
        Value::Array(_) => None,
    };
    node.ok_or_else(|| {
        let span = ast.expression(root).span;
        refused(Problem::new(
            span,
            "expected a number, found an array or a condition",
        ))
    })
}

struct StudyScope<'a> {
    graph: &'a Graph,
    names: &'a dyn Fn(&str) -> Option<Node>,
}

impl Scope for StudyScope<'_> {
    fn named(&self, name: &str, mode: Mode) -> Named<'_> {
        let unquoted = || name.strip_prefix('\'')?.strip_suffix('\'');
        let node = (self.names)(name).or_else(|| (self.names)(unquoted()?));
        let node = node.or_else(|| {
            let pi = || self.graph.constant(std::f64::consts::PI).node();
            (name == "pi").then(pi)
        });
        match node {
            Some(node) if mode != Mode::Continuous => match self.graph.constant_value(node) {
                Some(_) => Named::Scalar(Scalar::Real(node)),
                None => Named::Varying,
            },
            Some(node) => Named::Scalar(Scalar::Real(node)),
            None => Named::Unknown,
        }
    }

    fn dims(&self, _name: &str) -> Option<&[usize]> {
        None
    }

    fn derivative(&self, _variable: Node) -> Option<Node> {
        None
    }

    fn names(&self) -> Vec<&str> {
        vec!["pi", "time"]
    }

    fn time(&self, mode: Mode) -> Option<Node> {
        (mode == Mode::Continuous).then(|| self.graph.symbol("time").node())
    }
}
