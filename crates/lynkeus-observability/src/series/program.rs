//! Expressions as a list of operations on series.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use crate::field::Modular;

/// One operation; slots are numbered in order.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Constant(Modular),
    /// a symbol, by its place among those given
    Symbol(usize),
    Neg(usize),
    Add(usize, usize),
    Sub(usize, usize),
    Mul(usize, usize),
    Div(usize, usize),
    Sqrt(usize),
    Exp(usize),
    /// sin, with its cosine in the next slot
    Sin(usize),
    Cos,
    /// sinh, with its cosh in the next slot
    Sinh(usize),
    Cosh,
    /// y with y' = h·a', a random y(0)
    Integral {
        a: usize,
        h: usize,
    },
}

/// Operations that compute some roots from symbols.
#[derive(Clone, Debug, Default)]
pub(crate) struct Program {
    pub(super) steps: Vec<Step>,
    pub(super) roots: Vec<usize>,
    /// functions that are not rational, by name
    pub functions: Vec<&'static str>,
}

/// An expression that has no power series here.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unsupported(pub String);

impl Program {
    /// Compiles roots. `branch` gives the value of a condition at a reference point:
    /// of several branches the one there is analysed.
    pub fn new(
        graph: &Graph,
        symbols: &[Node],
        roots: &[Node],
        branch: &dyn Fn(Node) -> Option<f64>,
    ) -> Result<Self, Unsupported> {
        let mut builder = Builder {
            graph,
            symbols,
            branch,
            program: Program::default(),
            slots: HashMap::new(),
            pairs: HashMap::new(),
            solutions: HashMap::new(),
        };
        for node in graph.reachable(roots) {
            builder.node(node)?;
        }
        let slot = |root: &Node| builder.slots.get(root).copied();
        let roots: Option<Vec<usize>> = roots.iter().map(slot).collect();
        builder.program.roots =
            roots.ok_or_else(|| Unsupported("a linear system as a value".into()))?;
        Ok(builder.program)
    }
}

struct Builder<'a> {
    graph: &'a Graph,
    symbols: &'a [Node],
    branch: &'a dyn Fn(Node) -> Option<f64>,
    program: Program,
    slots: HashMap<Node, usize>,
    /// slots of sin and sinh by argument
    pairs: HashMap<(bool, usize), usize>,
    solutions: HashMap<Node, Vec<usize>>,
}

impl Builder<'_> {
    fn push(&mut self, step: Step) -> usize {
        self.program.steps.push(step);
        self.program.steps.len() - 1
    }

    fn number(&mut self, x: f64) -> Result<usize, Unsupported> {
        let value = Modular::from_f64(x).ok_or_else(|| Unsupported(format!("the number {x}")))?;
        Ok(self.push(Step::Constant(value)))
    }

    fn function(&mut self, name: &'static str) {
        if !self.program.functions.contains(&name) {
            self.program.functions.push(name);
        }
    }

    /// Slots of the arguments; a linear system has none of its own.
    fn node(&mut self, node: Node) -> Result<(), Unsupported> {
        let of = |builder: &Self, a: Node| builder.slots.get(&a).copied().unwrap_or(usize::MAX);
        let slot = match self.graph.op(node) {
            Op::Constant(x) => self.number(x)?,
            Op::Symbol(_) => self.symbol(node)?,
            Op::Powi(a, n) => self.power(of(self, a), n)?,
            Op::Unary(op, a) => self.unary(op, of(self, a), node, a)?,
            Op::Binary(op, a, b) => self.binary(op, of(self, a), of(self, b), node)?,
            Op::Select(condition, a, b) => match self.value_at_reference(condition)? != 0.0 {
                true => of(self, a),
                false => of(self, b),
            },
            Op::Solve(_) => return self.solve(node),
            Op::Entry(solve, i) => match self.solutions.get(&solve).and_then(|x| x.get(i as usize))
            {
                Some(&slot) => slot,
                None => {
                    return Err(Unsupported(
                        "the condition estimate of a linear system".into(),
                    ));
                }
            },
        };
        self.slots.insert(node, slot);
        Ok(())
    }

    fn symbol(&mut self, node: Node) -> Result<usize, Unsupported> {
        match self.symbols.iter().position(|&s| s == node) {
            Some(place) => Ok(self.push(Step::Symbol(place))),
            None => {
                let name = self.graph.symbol_name(node).unwrap_or_default();
                Err(Unsupported(format!("'{name}', which has no value")))
            }
        }
    }

    fn value_at_reference(&self, node: Node) -> Result<f64, Unsupported> {
        (self.branch)(node).ok_or_else(|| {
            let text = self.graph.render(node, 60);
            Unsupported(format!(
                "{text}, which is not defined at the reference point"
            ))
        })
    }

    fn power(&mut self, a: usize, n: i32) -> Result<usize, Unsupported> {
        if n == 0 {
            return self.number(1.0);
        }
        let (mut base, mut left) = (a, n.unsigned_abs());
        let mut result = None;
        while left > 0 {
            if left & 1 == 1 {
                result = Some(match result {
                    None => base,
                    Some(r) => self.push(Step::Mul(r, base)),
                });
            }
            left >>= 1;
            if left > 0 {
                base = self.push(Step::Mul(base, base));
            }
        }
        // n ≠ 0, so a bit was set
        let result = result.unwrap_or(a);
        if n > 0 {
            return Ok(result);
        }
        let one = self.number(1.0)?;
        Ok(self.push(Step::Div(one, result)))
    }

    /// The slots of (sin, cos) or (sinh, cosh).
    fn pair(&mut self, hyperbolic: bool, a: usize) -> (usize, usize) {
        if let Some(&slot) = self.pairs.get(&(hyperbolic, a)) {
            return (slot, slot + 1);
        }
        let (first, second) = match hyperbolic {
            true => (Step::Sinh(a), Step::Cosh),
            false => (Step::Sin(a), Step::Cos),
        };
        let slot = self.push(first);
        self.push(second);
        self.pairs.insert((hyperbolic, a), slot);
        (slot, slot + 1)
    }

    fn unary(
        &mut self,
        op: Unary,
        a: usize,
        node: Node,
        argument: Node,
    ) -> Result<usize, Unsupported> {
        let name = match op {
            Unary::Exp => "exp",
            Unary::Ln => "log",
            Unary::Sin | Unary::Cos | Unary::Tan => "sin",
            Unary::Asin | Unary::Acos | Unary::Atan => "asin",
            Unary::Sinh | Unary::Cosh | Unary::Tanh => "sinh",
            Unary::Sqrt => "sqrt",
            _ => "",
        };
        if !name.is_empty() {
            self.function(name);
        }
        Ok(match op {
            Unary::Neg => self.push(Step::Neg(a)),
            Unary::Abs => match self.value_at_reference(argument)? < 0.0 {
                true => self.push(Step::Neg(a)),
                false => a,
            },
            Unary::Sign | Unary::Floor | Unary::Not => {
                let x = self.value_at_reference(node)?;
                self.number(x)?
            }
            Unary::Sqrt => self.push(Step::Sqrt(a)),
            Unary::Exp => self.push(Step::Exp(a)),
            Unary::Ln => {
                let one = self.number(1.0)?;
                let h = self.push(Step::Div(one, a));
                self.push(Step::Integral { a, h })
            }
            Unary::Sin => self.pair(false, a).0,
            Unary::Cos => self.pair(false, a).1,
            Unary::Tan => {
                let (sin, cos) = self.pair(false, a);
                self.push(Step::Div(sin, cos))
            }
            Unary::Sinh => self.pair(true, a).0,
            Unary::Cosh => self.pair(true, a).1,
            Unary::Tanh => {
                let (sinh, cosh) = self.pair(true, a);
                self.push(Step::Div(sinh, cosh))
            }
            Unary::Atan => self.arc_tangent(a)?,
            Unary::Asin | Unary::Acos => {
                let one = self.number(1.0)?;
                let square = self.push(Step::Mul(a, a));
                let rest = self.push(Step::Sub(one, square));
                let root = self.push(Step::Sqrt(rest));
                let slope = self.push(Step::Div(one, root));
                let h = if op == Unary::Acos {
                    self.push(Step::Neg(slope))
                } else {
                    slope
                };
                self.push(Step::Integral { a, h })
            }
        })
    }

    fn arc_tangent(&mut self, a: usize) -> Result<usize, Unsupported> {
        let one = self.number(1.0)?;
        let square = self.push(Step::Mul(a, a));
        let sum = self.push(Step::Add(one, square));
        let h = self.push(Step::Div(one, sum));
        Ok(self.push(Step::Integral { a, h }))
    }

    fn binary(&mut self, op: Binary, a: usize, b: usize, node: Node) -> Result<usize, Unsupported> {
        Ok(match op {
            Binary::Add => self.push(Step::Add(a, b)),
            Binary::Sub => self.push(Step::Sub(a, b)),
            Binary::Mul => self.push(Step::Mul(a, b)),
            Binary::Div => self.push(Step::Div(a, b)),
            // e^(b·ln a)
            Binary::Pow => {
                self.function("power");
                let one = self.number(1.0)?;
                let h = self.push(Step::Div(one, a));
                let logarithm = self.push(Step::Integral { a, h });
                let exponent = self.push(Step::Mul(b, logarithm));
                self.push(Step::Exp(exponent))
            }
            Binary::Atan2 => {
                self.function("atan2");
                let ratio = self.push(Step::Div(a, b));
                self.arc_tangent(ratio)?
            }
            Binary::Min | Binary::Max => {
                let [x, y] = self.graph.arguments(node)[..] else {
                    return Err(Unsupported("a choice without arguments".into()));
                };
                let first = self.value_at_reference(x)? < self.value_at_reference(y)?;
                if first == (op == Binary::Min) { a } else { b }
            }
            Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or => {
                let x = self.value_at_reference(node)?;
                self.number(x)?
            }
        })
    }

    /// Gaussian elimination; pivots are generic, so that only structural zeros matter.
    fn solve(&mut self, node: Node) -> Result<(), Unsupported> {
        let arguments: Vec<usize> = self
            .graph
            .arguments(node)
            .into_iter()
            .map(|a| self.slots[&a])
            .collect();
        let n = (0..).find(|n| n * n + n >= arguments.len()).unwrap_or(0);
        let zero = |builder: &Self, slot: usize| matches!(builder.program.steps[slot], Step::Constant(c) if c.is_zero());
        let mut rows: Vec<Vec<usize>> = (0..n)
            .map(|i| {
                let mut row = arguments[i * n..(i + 1) * n].to_vec();
                row.push(arguments[n * n + i]);
                row
            })
            .collect();
        for k in 0..n {
            let Some(pivot) = (k..n).find(|&i| !zero(self, rows[i][k])) else {
                return Err(Unsupported("a singular linear system".into()));
            };
            rows.swap(k, pivot);
            let chosen = rows[k].clone();
            for (_, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
                if zero(self, row[k]) {
                    continue;
                }
                let factor = self.push(Step::Div(row[k], chosen[k]));
                for (entry, &above) in row.iter_mut().zip(&chosen).skip(k + 1) {
                    let product = self.push(Step::Mul(factor, above));
                    *entry = self.push(Step::Sub(*entry, product));
                }
            }
        }
        let solution = (0..n)
            .map(|k| self.push(Step::Div(rows[k][n], rows[k][k])))
            .collect();
        self.solutions.insert(node, solution);
        Ok(())
    }
}
