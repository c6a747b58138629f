//! Implicit functions: the root z of g(z, p) = 0, for algebraic loops and equations that are
//! not linear in their unknown.
//!
//! The residual g and its derivatives are compiled once, when the function is made, and every
//! use shares them. By the implicit function theorem z' = −g_z⁻¹ g_p p', so that derivatives
//! of any order, symbols and bounds need nothing but g, g_z, g_p and linear systems.

use std::sync::Arc;

use crate::code::{Body, Implicit, Slopes, Tape};
use crate::interval::Intervals;
use crate::{
    Algebra, Binary, Evaluator, Graph, Interval, MissingInput, Node, Nodes, Op, Unary, jacobian,
    linear,
};

/// Characters of an equation in a message.
const SHOWN: usize = 80;
/// Equations that a message spells out.
const SPELLED: usize = 3;

/// One of the unknowns z.
#[derive(Clone, Debug)]
pub struct ImplicitUnknown {
    /// the symbol that stands for it in the equations
    pub symbol: Node,
    /// where the search begins
    pub start: f64,
    /// where the root is looked for: one outside is none
    pub range: Interval,
}

impl Implicit {
    /// The root of `residuals`, one for each unknown: the entries of z, in order. Everything
    /// in the residuals that does not depend on an unknown becomes one argument of the
    /// function.
    ///
    /// # Errors
    /// [`MissingInput`] only if nodes without a value are mixed in.
    ///
    /// # Panics
    /// If there are not as many residuals as unknowns.
    pub fn solve(
        graph: &Graph,
        unknowns: &[ImplicitUnknown],
        residuals: &[Node],
    ) -> Result<Vec<Node>, MissingInput> {
        assert_eq!(unknowns.len(), residuals.len(), "one equation per unknown");
        let z: Vec<Node> = unknowns.iter().map(|unknown| unknown.symbol).collect();
        let fixed = graph.largest(residuals, |symbol| !z.contains(symbol));
        let cut = graph.replaced(residuals, fixed);
        let inputs = [&z[..], &cut.symbols].concat();
        let name = |&symbol: &Node| graph.symbol_name(symbol).unwrap_or_default();
        let equation = |&residual: &Node| format!("{} = 0", graph.render(residual, SHOWN));
        let slopes = |columns: &[Node]| Slopes::new(graph, &cut.roots, columns, &inputs);
        let function = Self(Arc::new(Body {
            names: z.iter().map(name).collect(),
            equations: residuals.iter().map(equation).collect(),
            start: unknowns.iter().map(|unknown| unknown.start).collect(),
            range: unknowns.iter().map(|unknown| unknown.range).collect(),
            parameters: cut.symbols.len(),
            residual: Tape::new(graph, &inputs, &cut.roots)?,
            by_unknowns: slopes(&z)?,
            by_parameters: slopes(&cut.symbols)?,
            steps: Tape::new(graph, &inputs, &steps(graph, &cut.roots))?,
        }));
        Ok(graph.implicit(&function, &cut.values))
    }

    /// g at (z, p).
    pub fn residual<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        self.0.residual.eval_in(algebra, at)
    }

    /// g_z at (z, p), n×n, row by row.
    pub fn matrix<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        let n = self.size();
        let mut matrix = vec![algebra.constant(0.0); n * n];
        for (i, j, slope) in self.0.by_unknowns.entries(algebra, at) {
            matrix[i * n + j] = slope;
        }
        matrix
    }

    /// Newton steps from `z` over any algebra, undamped: each doubles the digits that are
    /// right, where the algebra has them.
    pub fn refined<A: Algebra>(
        &self,
        algebra: &A,
        mut z: Vec<A::Value>,
        p: &[A::Value],
        steps: usize,
    ) -> Vec<A::Value> {
        for _ in 0..steps {
            let at = [&z[..], p].concat();
            let g = self.residual(algebra, &at);
            let (step, _) = algebra.solve(&self.matrix(algebra, &at), &g);
            for (z, step) in z.iter_mut().zip(&step) {
                *z = algebra.binary(Binary::Sub, z, step);
            }
        }
        z
    }

    /// The entries of g_p at (z, p) that are not zero everywhere: (row, column, value).
    pub(crate) fn sensitivities(&self, graph: &Graph, at: &[Node]) -> Vec<(usize, usize, Node)> {
        self.0.by_parameters.entries(&Nodes(graph), at)
    }

    /// What jumps in g as z moves, at (z, p).
    pub(crate) fn steps_in<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        self.0.steps.eval_in(algebra, at)
    }

    /// `a, b: a - b - x = 0, b - sin(a) = 0`
    pub(crate) fn text(&self) -> String {
        let spelled = self.0.equations.iter().take(SPELLED);
        let equations: Vec<&str> = spelled.map(String::as_str).collect();
        let names: Vec<&str> = self.0.names.iter().map(String::as_str).take(8).collect();
        let more = |n: usize| if self.size() > n { ", …" } else { "" };
        let (names, equations) = (names.join(", "), equations.join(", "));
        format!("{names}{}: {equations}{}", more(8), more(SPELLED))
    }
}

impl Slopes {
    fn new(
        graph: &Graph,
        residuals: &[Node],
        columns: &[Node],
        inputs: &[Node],
    ) -> Result<Self, MissingInput> {
        let jacobian = jacobian::forward(graph, residuals, columns);
        let entries: Vec<Node> = jacobian.entries.iter().map(|entry| entry.2).collect();
        Ok(Self {
            tape: Tape::new(graph, inputs, &entries)?,
            places: jacobian.entries.iter().map(|&(i, j, _)| (i, j)).collect(),
        })
    }

    fn entries<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<(usize, usize, A::Value)> {
        let values = self.tape.eval_in(algebra, at);
        let places = self.places.iter().zip(values);
        places.map(|(&(i, j), value)| (i, j, value)).collect()
    }
}

/// The operations that are not continuous; a cut residual has none that depend on p alone.
fn steps(graph: &Graph, residuals: &[Node]) -> Vec<Node> {
    let zero = graph.constant(0.0).node();
    let mut found = vec![];
    for node in graph.reachable(residuals) {
        match graph.op(node) {
            Op::Unary(op, _) if op.jumps() => found.push(node),
            Op::Binary(op, ..) if op.jumps() => found.push(node),
            // the cut of the angle
            Op::Binary(Binary::Atan2, y, x) => {
                let behind = graph.binary(Binary::LessEq, x, zero);
                let crossing = graph.binary(Binary::Equal, y, zero);
                found.push(graph.binary(Binary::And, behind, crossing));
            }
            Op::Select(condition, ..) => found.push(graph.unary(Unary::Not, condition)),
            // what jumps in a loop within the loop
            Op::System(_) => {
                if let Some(call) = graph.system(node)
                    && let Some(function) = call.function()
                {
                    found.extend(function.steps_in(&Nodes(graph), &call.at(graph, node)));
                }
            }
            _ => {}
        }
    }
    found
}

/// Newton steps from one start.
const STEPS: usize = 80;
/// Halvings of one step.
const HALVINGS: usize = 30;
/// A step this small against its unknown, in units of the last place, is the last.
const LAST: f64 = 4.0 * f64::EPSILON;
/// Starts tried besides the declared one.
const STARTS: usize = 16;
/// Values between which a change of sign is looked for, to either side of the start.
const SAMPLES: usize = 64;
/// Halvings of a bracket: down to neighbouring numbers, whatever it was.
const BISECTIONS: usize = 1200;

impl Implicit {
    /// z with g(z, p) = 0 within rounding, in the declared range.
    ///
    /// # Errors
    /// Why no root was found.
    pub(crate) fn root(&self, p: &[f64]) -> Result<Vec<f64>, String> {
        let mut search = Newton::new(self, p);
        let first = search.newton(self.start());
        if search.is_root(&first) {
            return Ok(first);
        }
        let bracketed = (self.size() == 1).then(|| search.bracketed()).flatten();
        if let Some(z) = bracketed.filter(|z| search.is_root(z)) {
            return Ok(z);
        }
        for turn in 1..=STARTS {
            let z = search.newton(&self.other_start(turn));
            if search.is_root(&z) {
                return Ok(z);
            }
        }
        Err(self.failure(&first, &search.residual(&first)))
    }

    /// Where Newton's method from the declared start ended, and with what residual.
    fn failure(&self, end: &[f64], residual: &[f64]) -> String {
        let named = |values: &[f64]| {
            let pairs = self.names().iter().zip(values).take(4);
            let pairs: Vec<String> = pairs.map(|(n, v)| format!("{n} = {v:.6}")).collect();
            pairs.join(", ")
        };
        let worst = residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        format!(
            "Newton's method from {} ends at {} with a residual of {worst:.3e}; the equations may \
             have no solution in the declared range there, or need another `start`",
            named(self.start()),
            named(end),
        )
    }

    /// Points that fill ever larger boxes around the declared start evenly.
    fn other_start(&self, turn: usize) -> Vec<f64> {
        let reach = 4.0_f64.powi(turn as i32 / 4);
        let entries = self.start().iter().zip(self.range()).enumerate();
        let place = |(i, (&start, range)): (usize, (&f64, &Interval))| {
            let size = reach * start.abs().max(1.0);
            let near = Interval::point(start).inflate(size).intersection(*range);
            let near = if near.is_empty() { *range } else { near };
            let (lo, hi) = (near.lo().max(-1e300), near.hi().min(1e300));
            // multiples of √2, √5, … modulo 1
            let fraction = ((turn * (i + 1)) as f64 * ((i * i + 2 * i + 2) as f64).sqrt()).fract();
            lo + fraction * (hi - lo)
        };
        entries.map(place).collect()
    }
}

/// Newton's method on one function at one p.
struct Newton<'a> {
    function: &'a Implicit,
    residual: Evaluator,
    slopes: Evaluator,
    /// (z, p)
    at: Vec<f64>,
}

impl<'a> Newton<'a> {
    fn new(function: &'a Implicit, p: &[f64]) -> Self {
        let mut at = function.start().to_vec();
        at.extend(p);
        Self {
            residual: function.0.residual.evaluator(),
            slopes: function.0.by_unknowns.tape.evaluator(),
            function,
            at,
        }
    }

    fn residual(&mut self, z: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; z.len()];
        self.at[..z.len()].copy_from_slice(z);
        self.residual.eval(&self.at, &mut g);
        g
    }

    fn matrix(&mut self, z: &[f64]) -> Vec<f64> {
        let n = z.len();
        let places = &self.function.0.by_unknowns.places;
        let mut entries = vec![0.0; places.len()];
        self.at[..n].copy_from_slice(z);
        self.slopes.eval(&self.at, &mut entries);
        let mut matrix = vec![0.0; n * n];
        for (&(i, j), entry) in places.iter().zip(entries) {
            matrix[i * n + j] = entry;
        }
        matrix
    }

    fn within(&self, z: f64, i: usize) -> f64 {
        let range = self.function.range()[i];
        z.clamp(range.lo(), range.hi())
    }

    /// The point where Newton's method ends, be it a root or not. The size of the residual is
    /// measured in rows scaled to one, so that no unit counts more than another.
    fn newton(&mut self, start: &[f64]) -> Vec<f64> {
        let start = start.iter().enumerate();
        let mut z: Vec<f64> = start.map(|(i, &z)| self.within(z, i)).collect();
        for _ in 0..STEPS {
            let g = self.residual(&z);
            if g.iter().all(|&g| g == 0.0) {
                return z;
            }
            let mut matrix = self.matrix(&z);
            let scales = row_scales(&matrix, &z, self.function.start());
            let mut step: Vec<f64> = g.iter().map(|g| -g).collect();
            linear::solve(&mut matrix, &mut step);
            if step.iter().any(|step| !step.is_finite()) {
                return z;
            }
            let mut pairs = step.iter().zip(&z);
            let last = pairs.all(|(step, z)| step.abs() <= LAST * z.abs());
            match self.damped(&z, &step, size(&g, &scales), &scales) {
                Some(next) if last => return next,
                Some(next) => z = next,
                None => return z,
            }
        }
        z
    }

    /// The longest of the halved steps that makes the residual smaller.
    fn damped(&mut self, z: &[f64], step: &[f64], before: f64, scales: &[f64]) -> Option<Vec<f64>> {
        let mut fraction = 1.0;
        for _ in 0..HALVINGS {
            let next: Vec<f64> = (z.iter().zip(step).enumerate())
                .map(|(i, (z, step))| self.within(z + fraction * step, i))
                .collect();
            let after = size(&self.residual(&next), scales);
            if after <= (1.0 - fraction / 4.0) * before {
                return Some(next);
            }
            fraction /= 2.0;
        }
        None
    }

    /// Whether g may vanish within a few roundings of z. NaN is none; nor is a jump over zero.
    fn is_root(&mut self, z: &[f64]) -> bool {
        let n = z.len();
        let near = |z: f64| Interval::point(z).inflate(LAST * z.abs());
        let p = self.at[n..].iter().map(|&p| near(p));
        let at: Vec<Interval> = z.iter().map(|&z| near(z)).chain(p).collect();
        let steps = self.function.steps_in(&Intervals, &at);
        if steps.iter().any(|step| !step.is_point()) {
            return self.residual(z).iter().all(|&g| g == 0.0);
        }
        let g = self.function.residual(&Intervals, &at);
        g.iter()
            .all(|g| g.contains_zero() && g.lo().is_finite() && g.hi().is_finite())
    }

    /// A single unknown between two values of which g has different signs, the nearest found.
    fn bracketed(&mut self) -> Option<Vec<f64>> {
        let start = self.within(self.function.start()[0], 0);
        let range = self.function.range()[0];
        let (mut below, mut above) = (start, start);
        let at_start = self.residual(&[start])[0];
        let (mut low, mut high) = (at_start, at_start);
        let first = 1e-3 * start.abs().max(1.0);
        for turn in 0..SAMPLES {
            let reach = first * 2.0_f64.powi(turn as i32);
            let (down, up) = (self.within(start - reach, 0), self.within(start + reach, 0));
            let (at_down, at_up) = (self.residual(&[down])[0], self.residual(&[up])[0]);
            for (z, g, end, at_end) in [(down, at_down, below, low), (up, at_up, above, high)] {
                if g * at_end < 0.0 {
                    return Some(vec![self.halved((end, at_end), z)]);
                }
            }
            (below, low, above, high) = (down, at_down, up, at_up);
            if down <= range.lo() && up >= range.hi() {
                break;
            }
        }
        None
    }

    /// Halves a bracket down to neighbouring numbers.
    fn halved(&mut self, (mut a, at_a): (f64, f64), mut b: f64) -> f64 {
        for _ in 0..BISECTIONS {
            let middle = 0.5 * a + 0.5 * b;
            if middle == a || middle == b {
                break;
            }
            let g = self.residual(&[middle])[0];
            match g * at_a > 0.0 {
                true => a = middle,
                false => b = middle,
            }
        }
        let (at_a, at_b) = (self.residual(&[a])[0].abs(), self.residual(&[b])[0].abs());
        if at_a < at_b { a } else { b }
    }
}

/// 1/Σⱼ |g_z|ᵢⱼ·|zⱼ|, where an unknown near zero counts as large as its start, or one.
fn row_scales(matrix: &[f64], z: &[f64], start: &[f64]) -> Vec<f64> {
    let n = z.len();
    let weight = |j: usize| match z[j].abs().max(start[j].abs()) {
        0.0 => 1.0,
        size => size,
    };
    let sum = |row: &[f64]| {
        row.iter()
            .enumerate()
            .map(|(j, a)| a.abs() * weight(j))
            .sum::<f64>()
    };
    matrix
        .chunks(n)
        .map(|row| match sum(row) {
            sum if sum > 0.0 && sum.is_finite() => 1.0 / sum,
            _ => 1.0,
        })
        .collect()
}

/// The scaled Euclidean norm; NaN is larger than anything.
fn size(g: &[f64], scales: &[f64]) -> f64 {
    let sum: f64 = g
        .iter()
        .zip(scales)
        .map(|(g, scale)| (g * scale).powi(2))
        .sum();
    if sum.is_nan() {
        f64::INFINITY
    } else {
        sum.sqrt()
    }
}
