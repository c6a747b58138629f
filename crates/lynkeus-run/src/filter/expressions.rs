//! A sample of an extended filter over expressions: what the loops do, operation by operation, without what is
//! zero whatever happens.

use lynkeus_expr::{Expr, Graph, Node};

use super::order::by_distance;
use crate::Jacobian;
use crate::classical::{Term, classical_step, sum};
use crate::equations::Equations;
use crate::routine::LARGEST_STEP;

/// x' = f with F, and the noise on its states in units of its largest density.
pub(crate) struct Flow<'f, 'g> {
    pub graph: &'g Graph,
    /// time, the states and what is constant over a step
    pub inputs: &'f [Node],
    pub derivatives: &'f [Node],
    /// entries of F
    pub slopes: &'f [Node],
    pub places: &'f [(usize, usize)],
    pub noise: Vec<Term<'g>>,
    /// columns of the covariance's root with smaller squares count as zeros
    pub least_square: f64,
}

impl<'f, 'g> Flow<'f, 'g> {
    /// Of equations with noise on such states.
    pub fn of(
        graph: &'g Graph,
        equations: &'f Equations,
        jacobian: &'f Jacobian,
        noisy: &[bool],
    ) -> Self {
        let free = &equations.roots.free;
        let noise = noisy.iter().map(|n| n.then(|| graph.fresh("q")));
        Flow {
            graph,
            inputs: &equations.inputs[..equations.smooth_inputs()],
            derivatives: &free.derivatives,
            slopes: &free.outputs[jacobian.outputs()],
            places: jacobian.places(),
            noise: noise.collect(),
            least_square: 0.0,
        }
    }

    /// The same where a step from anywhere is not too much, which fills Φ and W.
    pub fn small(self) -> Option<Self> {
        let operations = 16 * self.states() * self.places.len();
        (operations <= LARGEST_STEP).then_some(self)
    }

    /// The same where the first step from a sample is not too much: from Φ = I and W = 0 it reaches a few places
    /// further in each of its stages.
    pub fn small_at_first(self) -> Option<Self> {
        let (n, width) = (self.states(), self.width());
        let start: Vec<bool> = (0..n * width).map(|k| k % width == k / width).collect();
        let (mut rows, mut operations) = (start, 0);
        for _ in 0..4 {
            let mut reached = rows.clone();
            for &(i, j) in self.places {
                for c in (0..width).filter(|c| rows[j * width + c]) {
                    reached[i * width + c] = true;
                    operations += 2;
                }
            }
            for (i, noise) in self.noise.iter().enumerate().filter(|_| width > n) {
                for j in 0..i {
                    let (a, b) = (i * width + n + j, j * width + n + i);
                    let both = reached[a] || reached[b];
                    (reached[a], reached[b]) = (both, both);
                }
                reached[i * width + n + i] |= noise.is_some();
            }
            operations += 4 * reached.iter().filter(|reached| **reached).count();
            rows = reached;
            if operations > LARGEST_STEP {
                return None;
            }
        }
        Some(self)
    }

    /// What the equations read, then these symbols.
    pub fn inputs_with(&self, more: impl Iterator<Item = Term<'g>>) -> Vec<Node> {
        let more = more.flatten().map(Expr::node);
        self.inputs.iter().copied().chain(more).collect()
    }

    fn states(&self) -> usize {
        self.derivatives.len()
    }

    /// Numbers in a row of (Φ W).
    fn width(&self) -> usize {
        match self.is_noisy() {
            true => 2 * self.states(),
            false => self.states(),
        }
    }

    fn is_noisy(&self) -> bool {
        self.noise.iter().any(Option::is_some)
    }

    /// The states from the noise on, as its factor goes.
    fn order(&self) -> Vec<usize> {
        let noisy: Vec<bool> = self.noise.iter().map(Option::is_some).collect();
        let slopes = self.places.iter().copied().zip(self.slopes.iter().copied());
        let order = by_distance(self.graph, &noisy, slopes);
        order.unwrap_or_else(|| (0..self.states()).collect())
    }

    fn term(&self, node: Node) -> Term<'g> {
        let is_nothing = self.graph.constant_value(node) == Some(0.0);
        (!is_nothing).then(|| self.graph.expr(node))
    }

    /// x̂ and the rows of (Φ W) at a sample: Φ = I, W = 0.
    pub fn start(&self) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let x = self.inputs[1..=n].iter().map(|&x| Some(self.graph.expr(x)));
        let mut z: Vec<Term<'g>> = x.collect();
        z.resize(n + n * width, None);
        (0..n).for_each(|i| z[n + i * width + i] = Some(self.graph.constant(1.0)));
        z
    }

    /// What x̂ and the rows of (Φ W) are after a step of length h.
    pub fn step(&self, h: Expr<'g>, z: &[Term<'g>]) -> Vec<Term<'g>> {
        let t = self.graph.expr(self.inputs[0]);
        classical_step(t, h, z, |t, z| self.variation(t, z))
    }

    /// Symbols for what is not zero after some steps from a sample; more of them make no more.
    pub fn under_way(&self, h: Expr<'g>) -> Vec<Term<'g>> {
        let n = self.states();
        let x = self.start();
        let mut found = self.step(h, &x);
        loop {
            let rows = found[n..].iter();
            let rows = rows.map(|entry| entry.map(|_| self.graph.fresh("z")));
            let z: Vec<Term<'g>> = x[..n].iter().copied().chain(rows).collect();
            found = self.step(h, &z);
            let grows = |(new, old): (&Term<'g>, &Term<'g>)| new.is_some() && old.is_none();
            if !found.iter().zip(&z).any(grows) {
                return z;
            }
        }
    }

    /// x̂', Φ' = FΦ and W' = FW + WFᵀ + Q.
    fn variation(&self, t: Expr<'g>, z: &[Term<'g>]) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let (x, rows) = z.split_at(n);
        let at = [Some(t)].into_iter().chain(x.iter().copied());
        let nothing = self.graph.constant(0.0);
        let at = at.map(|value| value.unwrap_or(nothing).node());
        let places = self.inputs.iter().copied().zip(at).collect();
        let all = [self.derivatives, self.slopes].concat();
        let all = self.graph.substitute(&all, &places);
        let (dx, slopes) = all.split_at(n);
        let mut dz: Vec<Term<'g>> = dx.iter().map(|&dx| self.term(dx)).collect();
        dz.resize(z.len(), None);
        let drows = &mut dz[n..];
        for (&(i, j), &slope) in self.places.iter().zip(slopes) {
            let Some(slope) = self.term(slope) else {
                continue;
            };
            for c in 0..width {
                let into = &mut drows[i * width + c];
                *into = sum(*into, rows[j * width + c].map(|from| slope * from));
            }
        }
        for (i, q) in self.noise.iter().enumerate().filter(|_| width > n) {
            for j in 0..i {
                let (a, b) = (i * width + n + j, j * width + n + i);
                let both = sum(drows[a], drows[b]);
                (drows[a], drows[b]) = (both, both);
            }
            let diagonal = &mut drows[i * width + n + i];
            *diagonal = sum(diagonal.map(|d| 2.0 * d), *q);
        }
        dz
    }

    /// The lower root of ΦPΦᵀ + W after a step, row by row, from that of P; then the squares of the columns
    /// that were reflected.
    pub fn carried(&self, next: &[Term<'g>], scale: Expr<'g>, root: &[Term<'g>]) -> Vec<Term<'g>> {
        let (n, width) = (self.states(), self.width());
        let row = |i: usize| &next[n + i * width..n + (i + 1) * width];
        let mut rows = vec![];
        if width > n {
            let order = self.order();
            let noise = order
                .iter()
                .flat_map(|&i| order.iter().map(move |&j| row(i)[n + j]));
            let noise: Vec<Term<'g>> = noise.map(|w| w.map(|w| scale * w)).collect();
            let factor = factor(self.graph, &noise, n);
            rows.resize(n * n, None);
            for (i, &place) in order.iter().enumerate() {
                (0..n).for_each(|k| rows[k * n + place] = factor[i * n + k]);
            }
        }
        let begin = rows.len();
        rows.resize(begin + n * n, None);
        for i in 0..n {
            for (j, phi) in row(i)[..n].iter().enumerate() {
                for (k, s) in root[j * n..=j * n + j].iter().enumerate() {
                    let into = &mut rows[begin + k * n + i];
                    *into = sum(*into, phi.zip(*s).map(|(phi, s)| phi * s));
                }
            }
        }
        let least = self.graph.constant(self.least_square);
        reflected(self.graph, &mut rows, n, |_| least)
    }
}

/// As [`Factor`](super::root::Factor).
pub(crate) fn factor<'g>(graph: &'g Graph, matrix: &[Term<'g>], n: usize) -> Vec<Term<'g>> {
    let nothing = graph.constant(0.0);
    let mut lower: Vec<Term<'g>> = vec![None; n * n];
    for j in 0..n {
        let Some(diagonal) = matrix[j * n + j] else {
            continue;
        };
        let known =
            |lower: &[Term<'g>], i: usize| dot(&lower[i * n..i * n + j], &lower[j * n..j * n + j]);
        let pivot = match known(&lower, j) {
            Some(known) => diagonal - known,
            None => diagonal,
        };
        let noise = n as f64 * f64::EPSILON * diagonal.abs();
        let is_there = noise.less(pivot);
        let root = is_there.select(pivot.sqrt(), nothing);
        lower[j * n + j] = Some(root);
        for i in j + 1..n {
            let rest = match (matrix[i * n + j], known(&lower, i)) {
                (Some(entry), Some(known)) => Some(entry - known),
                (None, Some(known)) => Some(-known),
                (entry, None) => entry,
            };
            lower[i * n + j] = rest.map(|rest| is_there.select(rest / root, nothing));
        }
    }
    lower
}

/// As [`Root::of_rows`](super::root::Root::of_rows), without units, of rows of n entries; then the squares of the columns
/// that were reflected. Columns whose squares are below their least count as zeros.
pub(crate) fn reflected<'g>(
    graph: &'g Graph,
    rows: &mut [Term<'g>],
    n: usize,
    least_square: impl Fn(usize) -> Expr<'g>,
) -> Vec<Term<'g>> {
    let count = rows.len() / n;
    let nothing = graph.constant(0.0);
    let mut root = vec![None; n * n];
    let mut squares = vec![];
    for k in 0..n {
        let column = |rows: &[Term<'g>]| -> Vec<(usize, Expr<'g>)> {
            let all = (k..count).map(|r| (r, rows[r * n + k]));
            all.filter_map(|(r, entry)| entry.map(|entry| (r, entry)))
                .collect()
        };
        let own = column(rows);
        let square = own.iter().map(|(_, entry)| entry.powi(2));
        let Some(square) = square.reduce(|all, one| all + one) else {
            continue;
        };
        squares.push(Some(square));
        // a column of zeros stays one
        let is_there = least_square(k).less(square);
        let norm = is_there.select(square.sqrt(), nothing);
        let pivot = rows[k * n + k];
        let is_above = pivot.map(|pivot| nothing.less(pivot));
        let turned = |is: Expr<'g>, value: Expr<'g>| is.select(-value, value);
        let head = is_above.map_or(norm, |is| turned(is, norm));
        let first = pivot.map_or(-head, |pivot| pivot - head);
        let beta = is_there.select(-head * first, graph.constant(1.0));
        rows[k * n + k] = Some(first);
        let reflector = column(rows);
        let sums: Vec<Term<'g>> = (k + 1..n)
            .map(|j| {
                let products = reflector.iter();
                let products = products.map(|(r, v)| rows[r * n + j].map(|a| *v * a));
                products.fold(None, sum)
            })
            .collect();
        for (r, v) in reflector {
            let factor = v / beta;
            for (j, part) in (k + 1..n).zip(&sums) {
                let Some(part) = part.map(|part| factor * part) else {
                    continue;
                };
                let entry = &mut rows[r * n + j];
                *entry = Some(entry.map_or(-part, |entry| entry - part));
            }
        }
        root[k * n + k] = Some(norm);
        for j in k + 1..n {
            let entry = rows[k * n + j];
            root[j * n + k] = entry.map(|a| is_above.map_or(a, |is| turned(is, a)));
        }
    }
    root.extend(squares);
    root
}

/// Their nodes, 0 where there is nothing.
pub(crate) fn nodes(graph: &Graph, terms: &[Term<'_>]) -> Vec<Node> {
    let nothing = graph.constant(0.0).node();
    terms
        .iter()
        .map(|term| term.map_or(nothing, Expr::node))
        .collect()
}

/// As [`dot`](super::root::dot).
pub(crate) fn dot<'g>(a: &[Term<'g>], b: &[Term<'g>]) -> Term<'g> {
    let whole = a.len() / 4 * 4;
    let mut sums = [None; 5];
    for (at, (a, b)) in a.iter().zip(b).enumerate() {
        let into = &mut sums[if at < whole { at % 4 } else { 4 }];
        *into = sum(*into, a.zip(*b).map(|(a, b)| a * b));
    }
    sums.into_iter().fold(None, sum)
}

/// A belief, and what a reading made of it.
pub(crate) struct Corrected<'g> {
    pub x: Vec<Term<'g>>,
    /// S, row by row
    pub root: Vec<Term<'g>>,
    /// y − ŷ, and its variance
    pub innovation: Expr<'g>,
    pub variance: Expr<'g>,
    /// what of it is the reading's noise
    pub noise: Expr<'g>,
}

/// Sᵀc, as [`Root::transposed_times`](super::root::Root::transposed_times).
pub(crate) fn projected<'g>(root: &[Term<'g>], c: &[Term<'g>]) -> Vec<Term<'g>> {
    let n = c.len();
    let projected = |j: usize| {
        let terms = (j..n).map(|i| c[i].zip(root[i * n + j]).map(|(c, s)| c * s));
        terms.fold(None, sum)
    };
    (0..n).map(projected).collect()
}

/// Carlson's update of x̂ and S by a reading that is `innovation` off; `slopes` is the row of C, `noise` the variance of
/// its noise, which is not 0. As [`Root::update`](super::root::Root::update).
pub(crate) fn corrected<'g>(
    (x, root): (&[Term<'g>], &[Term<'g>]),
    slopes: &[Term<'g>],
    innovation: Expr<'g>,
    noise: Expr<'g>,
) -> Corrected<'g> {
    let n = x.len();
    let mut root = root.to_vec();
    let projected = projected(&root, slopes);
    let spread = dot(&projected, &projected);
    let variance = spread.map_or(noise, |spread| spread + noise);
    let mut gain: Vec<Term<'g>> = vec![None; n];
    let mut alpha = noise;
    for (j, v) in projected.iter().enumerate().rev() {
        let Some(v) = *v else {
            continue;
        };
        let before = alpha;
        alpha = alpha + v * v;
        let left = (before / alpha).sqrt();
        let taken = v / (before.sqrt() * alpha.sqrt());
        for i in j..n {
            let entry = &mut root[i * n + j];
            let own = *entry;
            let kept = own.map(|own| own * left);
            *entry = match gain[i].map(|sum| sum * taken) {
                Some(less) => Some(kept.map_or(-less, |kept| kept - less)),
                None => kept,
            };
            gain[i] = sum(gain[i], own.map(|own| own * v));
        }
    }
    let moved = gain.iter().map(|k| k.map(|k| k / variance * innovation));
    Corrected {
        x: x.iter()
            .zip(moved)
            .map(|(x, moved)| sum(*x, moved))
            .collect(),
        root,
        innovation,
        variance,
        noise,
    }
}
