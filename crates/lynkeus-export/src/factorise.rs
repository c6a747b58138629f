//! A x = b spelled out: the factorisation of `lynkeus-expr` with its choice of columns as
//! selections, so that it also answers within bounds near singularity.

use lynkeus_expr::{Expr, Graph, Node};

/// Unknowns of the largest system that is spelled out: the text grows with the cube.
pub(crate) const LARGEST: usize = 12;
/// Pivots smaller than this fraction of the largest count as zero, as in `lynkeus-expr`.
const RANK_TOLERANCE: f64 = 1e-13;

/// (x, reciprocal condition estimate); `a` is n×n row by row.
pub(crate) fn factorised(graph: &Graph, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
    let n = b.len();
    let expr = |&node: &Node| graph.expr(node);
    let mut system = System {
        graph,
        a: a.chunks(n.max(1))
            .map(|row| row.iter().map(expr).collect())
            .collect(),
        b: b.iter().map(expr).collect(),
    };
    let swaps: Vec<_> = (0..n)
        .map(|k| {
            let swap = system.pivot(k);
            system.reflect(k);
            swap
        })
        .collect();
    let (mut x, rcond) = system.substituted();
    for (k, swap) in swaps.iter().enumerate().rev() {
        exchange(&mut x, k, swap);
    }
    (x.iter().map(|x| x.node()).collect(), rcond.node())
}

struct System<'g> {
    graph: &'g Graph,
    a: Vec<Vec<Expr<'g>>>,
    b: Vec<Expr<'g>>,
}

/// Entry k against the one of those after it whose truth value holds.
fn exchange<'g>(row: &mut [Expr<'g>], k: usize, chosen: &[Expr<'g>]) {
    let own = row[k];
    for (j, &is_chosen) in chosen.iter().enumerate() {
        let j = k + 1 + j;
        let other = row[j];
        row[k] = is_chosen.select(other, row[k]);
        row[j] = is_chosen.select(own, other);
    }
}

fn sum<'g>(graph: &'g Graph, terms: impl Iterator<Item = Expr<'g>>) -> Expr<'g> {
    let total = terms.reduce(|sum, term| sum + term);
    total.unwrap_or_else(|| graph.constant(0.0))
}

impl<'g> System<'g> {
    fn constant(&self, value: f64) -> Expr<'g> {
        self.graph.constant(value)
    }

    fn norm(&self, k: usize, j: usize) -> Expr<'g> {
        sum(self.graph, self.a[k..].iter().map(|row| row[j].powi(2)))
    }

    /// Brings the column of the remaining block with the largest norm to place k; tells by truth
    /// values which of those after k it was.
    fn pivot(&mut self, k: usize) -> Vec<Expr<'g>> {
        let mut best = self.norm(k, k);
        let mut is_better = vec![];
        for j in k + 1..self.b.len() {
            let norm = self.norm(k, j);
            let better = best.less(norm);
            best = better.select(norm, best);
            is_better.push(better);
        }
        // the last one that is better is the best
        let mut later: Option<Expr<'g>> = None;
        for better in is_better.iter_mut().rev() {
            let own = *better;
            *better = later.map_or(own, |later| own.and(!later));
            later = Some(later.map_or(own, |later| own.or(later)));
        }
        for row in &mut self.a {
            exchange(row, k, &is_better);
        }
        is_better
    }

    /// Householder reflection that zeroes column k below the diagonal.
    fn reflect(&mut self, k: usize) {
        let n = self.b.len();
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let column: Vec<Expr<'g>> = (k..n).map(|i| self.a[i][k]).collect();
        let sizes = column.iter().map(|entry| entry.abs());
        let largest = sizes.reduce(Expr::max).unwrap_or(zero);
        // a column of zeros has v = 0 and stays
        let is_zero = largest.equal(zero);
        let scale = is_zero.select(one, largest);
        let squares = sum(
            self.graph,
            column.iter().map(|&entry| (entry / scale).powi(2)),
        );
        let norm = largest * is_zero.select(one, squares).sqrt();
        let corner = column[0];
        let alpha = zero.less(corner).select(-norm, norm);
        let mut v: Vec<Expr<'g>> = column.iter().map(|&entry| entry / scale).collect();
        v[0] = corner / scale - alpha / scale;
        let vv = sum(self.graph, v.iter().map(|v| v.powi(2)));
        let vv = vv.equal(zero).select(one, vv);
        for j in k..n {
            let below: Vec<Expr<'g>> = (k..n).map(|i| self.a[i][j]).collect();
            for (i, entry) in reflected(self.graph, &v, vv, &below)
                .into_iter()
                .enumerate()
            {
                self.a[k + i][j] = entry;
            }
        }
        let b = reflected(self.graph, &v, vv, &self.b[k..]);
        self.b.splice(k.., b);
    }

    /// (x before columns are put back, reciprocal condition): what is lost is zero, what is NaN
    /// stays NaN.
    fn substituted(&self) -> (Vec<Expr<'g>>, Expr<'g>) {
        let n = self.b.len();
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let Some(largest) = self.a.first().map(|row| row[0].abs()) else {
            return (vec![], one);
        };
        let mut alive: Vec<Expr<'g>> = vec![];
        for k in 0..n {
            let own = (RANK_TOLERANCE * largest).less(self.a[k][k].abs());
            alive.push(alive.last().map_or(own, |&before| before.and(own)));
        }
        let mut x = vec![zero; n];
        for k in (0..n).rev() {
            let (b, pivot) = (self.b[k], self.a[k][k]);
            let tail = (k + 1..n).map(|j| self.a[k][j] * x[j]);
            let rest = tail.fold(b, |rest, term| rest - term);
            let is_number = b.equal(b).and(pivot.equal(pivot));
            let lost = is_number.select(zero, self.constant(f64::NAN));
            x[k] = alive[k].select(rest / alive[k].select(pivot, one), lost);
        }
        let smallest = self.a[n - 1][n - 1].abs();
        let is_zero = largest.equal(zero);
        let ratio = (smallest / is_zero.select(one, largest)).min(one);
        (x, is_zero.select(zero, ratio))
    }
}

/// y − 2 (v·y)/(v·v) v
fn reflected<'g>(graph: &'g Graph, v: &[Expr<'g>], vv: Expr<'g>, y: &[Expr<'g>]) -> Vec<Expr<'g>> {
    let dot = sum(graph, v.iter().zip(y).map(|(&v, &y)| v * y));
    let factor = 2.0 * dot / vv;
    y.iter().zip(v).map(|(&y, &v)| y - factor * v).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::{Algebra, Reals, Tape};
    use proptest::prelude::*;

    fn spelled(n: usize) -> Tape {
        let graph = Graph::new();
        let symbols: Vec<Node> = (0..n * n + n)
            .map(|i| graph.symbol(&format!("s{i}")).node())
            .collect();
        let (mut outputs, rcond) = factorised(&graph, &symbols[..n * n], &symbols[n * n..]);
        outputs.push(rcond);
        Tape::new(&graph, &symbols, &outputs).unwrap()
    }

    fn same(n: usize, numbers: &[f64]) {
        let mut found = vec![0.0; n + 1];
        spelled(n).evaluator().eval(numbers, &mut found);
        let (mut expected, rcond) = Reals.solve(&numbers[..n * n], &numbers[n * n..]);
        let size = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        expected.push(rcond);
        for (found, expected) in found.iter().zip(&expected) {
            let close = (found - expected).abs() <= 1e-14 * size / rcond.max(1e-13);
            assert!(
                close || found.is_nan() && expected.is_nan(),
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn singular_systems_have_the_same_bounded_answer() {
        same(2, &[1.0, 1.0, 1.0, 1.0, 1.0, 2.0]);
        same(2, &[0.0, 0.0, 0.0, 0.0, 1.0, 2.0]);
        same(1, &[0.0, 3.0]);
        same(
            3,
            &[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0],
        );
    }

    #[test]
    fn nan_in_the_data_reaches_the_answer() {
        let mut found = [0.0; 3];
        let data = [f64::NAN, 0.0, 0.0, 1.0, 1.0, 2.0];
        spelled(2).evaluator().eval(&data, &mut found);
        assert!(found[..2].iter().any(|x| x.is_nan()));
    }

    proptest! {
        #[test]
        fn any_system_has_the_same_answer(numbers in prop::array::uniform20(-2.0..2.0)) {
            same(4, &numbers);
            same(1, &numbers[..2]);
        }
    }
}
