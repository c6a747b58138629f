//! Expressions as a list of operations on series.

mod numbers;
mod unary;

use std::collections::{BTreeSet, HashMap};

use lynkeus_expr::{Binary, Graph, Node, Op};

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
    /// y with y' = h·a'
    Integral {
        a: usize,
        h: usize,
        of: Inverse,
    },
}

/// Which function an integral is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inverse {
    Logarithm,
    Arc(crate::series::functions::Arc),
}

/// Operations that compute some roots from symbols.
#[derive(Clone, Debug, Default)]
pub(crate) struct Program {
    pub(super) steps: Vec<Step>,
    pub(super) roots: Vec<usize>,
    /// functions that are not rational, by name
    pub functions: Vec<&'static str>,
    /// branches that were chosen at the reference point
    pub choices: usize,
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
            rooted: BTreeSet::new(),
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

impl Program {
    /// Number of operations.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Number of roots.
    pub fn roots(&self) -> usize {
        self.roots.len()
    }

    /// Whether an operation reads a symbol.
    pub fn reads(&self, place: usize) -> bool {
        let reads = |step: &Step| matches!(step, Step::Symbol(p) if *p == place);
        self.steps.iter().any(reads)
    }

    /// Slots of roots and logarithms, which not every value has.
    pub fn partial(&self) -> impl Iterator<Item = usize> + '_ {
        let partial = |step: &Step| {
            let of = Inverse::Logarithm;
            matches!(step, Step::Sqrt(_))
                || matches!(step, Step::Integral { of: found, .. } if *found == of)
        };
        let steps = self.steps.iter().enumerate();
        steps.filter_map(move |(slot, step)| partial(step).then_some(slot))
    }

    /// Places of the symbols that a root depends on.
    pub fn inputs(&self, root: usize) -> BTreeSet<usize> {
        self.support(self.roots[root])
    }

    /// Places of the symbols that a slot depends on.
    pub fn support(&self, slot: usize) -> BTreeSet<usize> {
        let place = |slot: usize| match self.steps[slot] {
            Step::Symbol(place) => Some(place),
            _ => None,
        };
        let below = self.below(slot);
        below.into_iter().filter_map(place).collect()
    }

    /// The slots that a slot is computed from, itself included.
    fn below(&self, slot: usize) -> BTreeSet<usize> {
        let mut seen = BTreeSet::new();
        let mut open = vec![slot];
        while let Some(slot) = open.pop() {
            if !seen.insert(slot) {
                continue;
            }
            match self.steps.get(slot).copied() {
                Some(Step::Neg(a) | Step::Sqrt(a) | Step::Exp(a) | Step::Sin(a)) => open.push(a),
                Some(Step::Add(a, b) | Step::Sub(a, b) | Step::Mul(a, b) | Step::Div(a, b)) => {
                    open.extend([a, b]);
                }
                Some(Step::Integral { a, h, .. }) => open.extend([a, h]),
                Some(Step::Cos) => open.push(slot - 1),
                Some(Step::Constant(_) | Step::Symbol(_)) => {}
                None => {
                    seen.remove(&slot);
                }
            }
        }
        seen
    }
}

struct Builder<'a> {
    graph: &'a Graph,
    symbols: &'a [Node],
    branch: &'a dyn Fn(Node) -> Option<f64>,
    program: Program,
    slots: HashMap<Node, usize>,
    /// slots of sin by argument
    pairs: HashMap<usize, usize>,
    /// slots whose root was asked for
    rooted: BTreeSet<usize>,
    solutions: HashMap<Node, Vec<usize>>,
}

impl Builder<'_> {
    fn push(&mut self, step: Step) -> usize {
        self.program.steps.push(step);
        self.program.steps.len() - 1
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
            Op::Implicit(_) => {
                let text = self.graph.render(node, 60);
                return Err(Unsupported(format!("an algebraic loop, {text}")));
            }
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

    fn value_at_reference(&mut self, node: Node) -> Result<f64, Unsupported> {
        self.program.choices += usize::from(!self.graph.symbols_of(&[node]).is_empty());
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

    fn binary(&mut self, op: Binary, a: usize, b: usize, node: Node) -> Result<usize, Unsupported> {
        Ok(match op {
            Binary::Add => self.push(Step::Add(a, b)),
            Binary::Sub => self.push(Step::Sub(a, b)),
            Binary::Mul => self.push(Step::Mul(a, b)),
            Binary::Div => self.push(Step::Div(a, b)),
            // e^(b·ln a)
            Binary::Pow => {
                if let Some(halves) = self.halves(node) {
                    self.function("sqrt");
                    let root = self.push(Step::Sqrt(a));
                    return self.power(root, halves);
                }
                self.function("power");
                let logarithm = self.logarithm(a)?;
                let exponent = self.push(Step::Mul(b, logarithm));
                self.push(Step::Exp(exponent))
            }
            Binary::Atan2 => self.angle_of(a, b, node)?,
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

    /// n of an exponent n/2 that is a number.
    fn halves(&self, power: Node) -> Option<i32> {
        let exponent = self.graph.arguments(power).get(1).copied()?;
        match self.graph.op(exponent) {
            Op::Constant(x) if (2.0 * x).fract() == 0.0 && x.abs() < 100.0 => {
                Some((2.0 * x) as i32)
            }
            _ => None,
        }
    }

    /// Gaussian elimination; pivots are generic, so that only structural zeros matter.
    fn solve(&mut self, node: Node) -> Result<(), Unsupported> {
        let Some(system) = self.graph.system(node) else {
            return Ok(());
        };
        let n = system.size();
        let zero = |builder: &Self, slot: usize| matches!(builder.program.steps[slot], Step::Constant(c) if c.is_zero());
        let mut rows: Vec<Vec<usize>> = (0..n)
            .map(|i| {
                let row = &system.matrix()[i * n..(i + 1) * n];
                let row = row.iter().chain(&system.right()[i..=i]);
                row.map(|node| self.slots[node]).collect()
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
