//! Expressions as a list of operations on series.

use std::collections::{BTreeSet, HashMap};
use std::f64::consts::{E, LN_2, LN_10, PI};

use lynkeus_expr::{Binary, Call, Graph, Node, Op, Unary};

use crate::Note;
use crate::series::functions::Function;
use lynkeus_expr::modular::Modular;

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
    /// sin, with its cosine in the next slot
    Sin(usize),
    Cos,
    /// y with y' = h·a'
    Integral {
        a: usize,
        h: usize,
        of: Function,
    },
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

impl Program {
    /// Compiles roots. `branch` gives the value of a condition at a reference point:
    /// of several branches the one there is analysed.
    ///
    /// # Errors
    /// What has no power series here.
    pub fn new(
        graph: &Graph,
        symbols: &[Node],
        roots: &[Node],
        branch: &dyn Fn(Node) -> Option<f64>,
    ) -> Result<Self, Note> {
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
        builder.program.roots = roots.ok_or(Note::System)?;
        Ok(builder.program)
    }

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
            let of_logarithm = |of: Function| of == Function::Logarithm;
            matches!(step, Step::Sqrt(_))
                || matches!(step, Step::Integral { of, .. } if of_logarithm(*of))
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
                Some(Step::Neg(a) | Step::Sqrt(a) | Step::Sin(a)) => open.push(a),
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

/// What stands for all inverse functions of angles in the list of functions.
const ARCS: &str = "asin";

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
    fn node(&mut self, node: Node) -> Result<(), Note> {
        let of = |builder: &Self, a: Node| builder.slots.get(&a).copied().unwrap_or(usize::MAX);
        let slot = match self.graph.op(node) {
            Op::Constant(x) => self.number(x)?,
            Op::Symbol(_) => self.symbol(node)?,
            Op::Powi(a, n) => self.power(of(self, a), n)?,
            Op::Unary(op, a) => self.unary(op, of(self, a), node, a)?,
            Op::Binary(op, a, b) => {
                let slots = [of(self, a), of(self, b)];
                self.binary(op, slots, [a, b], node)?
            }
            Op::Select(condition, a, b) => match self.value_at_reference(condition)? != 0.0 {
                true => of(self, a),
                false => of(self, b),
            },
            Op::System(_) => return self.solve(node),
            Op::Entry(solve, i) => {
                let solution = self.solutions.get(&solve);
                let slot = solution.and_then(|x| x.get(i as usize));
                *slot.ok_or(Note::ConditionEstimate)?
            }
        };
        self.slots.insert(node, slot);
        Ok(())
    }

    fn symbol(&mut self, node: Node) -> Result<usize, Note> {
        match self.symbols.iter().position(|&s| s == node) {
            Some(place) => Ok(self.push(Step::Symbol(place))),
            None => Err(Note::NoValue(
                self.graph.symbol_name(node).unwrap_or_default(),
            )),
        }
    }

    fn value_at_reference(&mut self, node: Node) -> Result<f64, Note> {
        self.program.choices += usize::from(!self.graph.symbols_of(&[node]).is_empty());
        (self.branch)(node).ok_or_else(|| Note::NotDefined(self.graph.render(node, 60)))
    }

    fn power(&mut self, a: usize, n: i32) -> Result<usize, Note> {
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

    fn binary(
        &mut self,
        op: Binary,
        [a, b]: [usize; 2],
        [x, y]: [Node; 2],
        node: Node,
    ) -> Result<usize, Note> {
        Ok(match op {
            Binary::Add => self.push(Step::Add(a, b)),
            Binary::Sub => self.push(Step::Sub(a, b)),
            Binary::Mul => self.push(Step::Mul(a, b)),
            Binary::Div => self.push(Step::Div(a, b)),
            // e^(b·ln a)
            Binary::Pow => {
                if let Some(halves) = self.halves(y) {
                    self.function("sqrt");
                    let root = self.push(Step::Sqrt(a));
                    return self.power(root, halves);
                }
                self.function("power");
                let logarithm = self.logarithm(a)?;
                let exponent = self.push(Step::Mul(b, logarithm));
                self.exponential(exponent)
            }
            Binary::Atan2 => self.angle_of(a, b, node)?,
            Binary::Min | Binary::Max => {
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
    fn halves(&self, exponent: Node) -> Option<i32> {
        match self.graph.op(exponent) {
            Op::Constant(x) if (2.0 * x).fract() == 0.0 && x.abs() < 100.0 => {
                Some((2.0 * x) as i32)
            }
            _ => None,
        }
    }

    /// Gaussian elimination; pivots are generic, so that only structural zeros matter.
    fn solve(&mut self, node: Node) -> Result<(), Note> {
        let call = self.graph.system(node);
        let Some((a, b)) = call.as_ref().and_then(Call::linear) else {
            return Err(Note::Loop(self.graph.render(node, 60)));
        };
        let n = b.len();
        let zero = |builder: &Self, slot: usize| matches!(builder.program.steps[slot], Step::Constant(c) if c.is_zero());
        let mut rows: Vec<Vec<usize>> = (0..n)
            .map(|i| {
                let row = a[i * n..(i + 1) * n].iter().chain(&b[i..=i]);
                row.map(|node| self.slots[node]).collect()
            })
            .collect();
        for k in 0..n {
            let Some(pivot) = (k..n).find(|&i| !zero(self, rows[i][k])) else {
                return Err(Note::SingularSystem);
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

    /// A number: e and the logarithms of 2 and 10 by what they are, fractions of π as such.
    pub(super) fn number(&mut self, x: f64) -> Result<usize, Note> {
        let natural = [(LN_2, 2.0), (LN_10, 10.0)];
        if let Some((_, of)) = natural.into_iter().find(|(logarithm, _)| *logarithm == x) {
            let of = self.number(of)?;
            return self.logarithm(of);
        }
        if x == E {
            let one = self.number(1.0)?;
            return Ok(self.exponential(one));
        }
        let value = fraction_of_pi(x).or_else(|| Modular::from_f64(x));
        let value = value.ok_or(Note::Number(x))?;
        Ok(self.push(Step::Constant(value)))
    }

    /// The slots of (sin, cos).
    fn pair(&mut self, a: usize) -> (usize, usize) {
        if let Some(&slot) = self.pairs.get(&a) {
            return (slot, slot + 1);
        }
        self.cosines_of_tangents(a);
        let slot = self.push(Step::Sin(a));
        self.push(Step::Cos);
        self.pairs.insert(a, slot);
        (slot, slot + 1)
    }

    /// The sine of an inverse tangent takes the root of 1 + a²: the point has to have one.
    fn cosines_of_tangents(&mut self, a: usize) {
        if !self.program.functions.contains(&ARCS) {
            return;
        }
        for slot in self.program.below(a) {
            let Step::Integral { h, of, .. } = self.program.steps[slot] else {
                continue;
            };
            if let (Function::Arctangent, Step::Div(_, sum)) = (of, self.program.steps[h])
                && self.rooted.insert(sum)
            {
                self.push(Step::Sqrt(sum));
            }
        }
    }

    /// The angle of a point (a above b): what b/a's inverse tangent leaves out is a half turn.
    pub(super) fn angle_of(&mut self, a: usize, b: usize, node: Node) -> Result<usize, Note> {
        self.function(ARCS);
        let ratio = self.push(Step::Div(a, b));
        let arc = self.arc_tangent(ratio)?;
        let angle = self.value_at_reference(node)?;
        if angle.abs() <= std::f64::consts::FRAC_PI_2 {
            return Ok(arc);
        }
        let half = self.number(std::f64::consts::PI.copysign(angle))?;
        Ok(self.push(Step::Add(arc, half)))
    }

    /// f⁻¹(f(z)) and √z², which are z up to sign and shift: as they are at the reference point.
    fn undone(&mut self, op: Unary, node: Node, argument: Node) -> Result<Option<usize>, Note> {
        let inner = match (op, self.graph.op(argument)) {
            (Unary::Asin, Op::Unary(Unary::Sin, z))
            | (Unary::Acos, Op::Unary(Unary::Cos, z))
            | (Unary::Atan, Op::Unary(Unary::Tan, z))
            | (Unary::Sqrt, Op::Powi(z, 2)) => z,
            (Unary::Sqrt, Op::Binary(Binary::Mul, z, other)) if z == other => z,
            _ => return Ok(None),
        };
        let Some(&slot) = self.slots.get(&inner) else {
            return Ok(None);
        };
        let (outer, z) = (
            self.value_at_reference(node)?,
            self.value_at_reference(inner)?,
        );
        let rising = match op {
            Unary::Asin => z.cos() > 0.0,
            Unary::Acos => z.sin() > 0.0,
            Unary::Sqrt => z > 0.0,
            _ => true,
        };
        let signed = if rising {
            slot
        } else {
            self.push(Step::Neg(slot))
        };
        let shift = if rising { outer - z } else { outer + z };
        let turns = (shift / std::f64::consts::PI).round();
        if turns == 0.0 {
            return Ok(Some(signed));
        }
        let shift = self.number(turns * std::f64::consts::PI)?;
        Ok(Some(self.push(Step::Add(signed, shift))))
    }

    /// e^a + e^−a and e^a − e^−a
    fn hyperbolic(&mut self, a: usize) -> Result<(usize, usize), Note> {
        let one = self.number(1.0)?;
        let up = self.exponential(a);
        let down = self.push(Step::Div(one, up));
        Ok((
            self.push(Step::Add(up, down)),
            self.push(Step::Sub(up, down)),
        ))
    }

    fn half(&mut self, a: usize) -> Result<usize, Note> {
        let half = self.number(0.5)?;
        Ok(self.push(Step::Mul(half, a)))
    }

    /// y with y' = y·a'
    fn exponential(&mut self, a: usize) -> usize {
        let (h, of) = (self.program.steps.len(), Function::Exponential);
        self.push(Step::Integral { a, h, of })
    }

    pub(super) fn logarithm(&mut self, a: usize) -> Result<usize, Note> {
        let one = self.number(1.0)?;
        Ok(self.integral(a, (one, a), Function::Logarithm))
    }

    fn arc_sine(&mut self, a: usize) -> Result<usize, Note> {
        let one = self.number(1.0)?;
        let square = self.push(Step::Mul(a, a));
        let rest = self.push(Step::Sub(one, square));
        let root = self.push(Step::Sqrt(rest));
        Ok(self.integral(a, (one, root), Function::Arcsine))
    }

    /// y with y' = h·a' for h = above/below
    fn integral(&mut self, a: usize, (above, below): (usize, usize), of: Function) -> usize {
        let h = self.push(Step::Div(above, below));
        self.push(Step::Integral { a, h, of })
    }

    pub(super) fn unary(
        &mut self,
        op: Unary,
        a: usize,
        node: Node,
        argument: Node,
    ) -> Result<usize, Note> {
        let name = match op {
            Unary::Exp => "exp",
            Unary::Ln => "log",
            Unary::Sin | Unary::Cos | Unary::Tan => "sin",
            Unary::Asin | Unary::Acos | Unary::Atan => ARCS,
            Unary::Sinh | Unary::Cosh | Unary::Tanh => "sinh",
            Unary::Sqrt => "sqrt",
            _ => "",
        };
        if !name.is_empty() {
            self.function(name);
        }
        if let Some(slot) = self.undone(op, node, argument)? {
            return Ok(slot);
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
            Unary::Exp => self.exponential(a),
            Unary::Ln => self.logarithm(a)?,
            Unary::Sin => self.pair(a).0,
            Unary::Cos => self.pair(a).1,
            Unary::Tan => {
                let (sin, cos) = self.pair(a);
                self.push(Step::Div(sin, cos))
            }
            Unary::Cosh | Unary::Sinh => {
                let (sum, difference) = self.hyperbolic(a)?;
                self.half(if op == Unary::Cosh { sum } else { difference })?
            }
            Unary::Tanh => {
                let (sum, difference) = self.hyperbolic(a)?;
                self.push(Step::Div(difference, sum))
            }
            Unary::Atan => self.arc_tangent(a)?,
            Unary::Asin => self.arc_sine(a)?,
            // a right angle less the inverse sine
            Unary::Acos => {
                let right = self.number(std::f64::consts::FRAC_PI_2)?;
                let sine = self.arc_sine(a)?;
                self.push(Step::Sub(right, sine))
            }
        })
    }

    pub(super) fn arc_tangent(&mut self, a: usize) -> Result<usize, Note> {
        let one = self.number(1.0)?;
        let square = self.push(Step::Mul(a, a));
        let sum = self.push(Step::Add(one, square));
        Ok(self.integral(a, (one, sum), Function::Arctangent))
    }
}

/// Parts of a right angle's multiples that are looked for.
const PARTS: [f64; 7] = [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 180.0];

fn fraction_of_pi(x: f64) -> Option<Modular> {
    PARTS.into_iter().find_map(|part| {
        let times = (x * part / PI).round();
        if times == 0.0
            || times.abs() > 1000.0
            || (times * PI / part != x && times / part * PI != x)
        {
            return None;
        }
        let part = Modular::from_f64(part)?.inverse()?;
        Some(Modular::from_f64(PI)? * Modular::from_f64(times)? * part)
    })
}
