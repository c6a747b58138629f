//! Matrices of expressions that know their zeros.

use lynkeus_expr::{Binary, Graph, Node, Unary, jacobian};

use crate::polynomial;

/// A matrix of expressions, row by row; entries that vanish everywhere are left out.
#[derive(Clone)]
pub struct Matrix<'g> {
    /// number of rows
    pub rows: usize,
    /// number of columns
    pub columns: usize,
    graph: &'g Graph,
    entries: Vec<Option<Node>>,
}

impl<'g> Matrix<'g> {
    /// The matrix whose entry (i, j) is `entry(i, j)`.
    pub fn from_fn(
        graph: &'g Graph,
        (rows, columns): (usize, usize),
        entry: impl Fn(usize, usize) -> Option<Node>,
    ) -> Self {
        let entry = |place: usize| {
            let node = entry(place / columns, place % columns)?;
            (!polynomial::vanishes(graph, node)).then_some(node)
        };
        Self {
            rows,
            columns,
            graph,
            entries: (0..rows * columns).map(entry).collect(),
        }
    }

    /// ∂functions/∂variables
    pub fn jacobian(graph: &'g Graph, functions: &[Node], variables: &[Node]) -> Self {
        let jacobian = jacobian::forward(graph, functions, variables);
        let size = (functions.len(), variables.len());
        Self::from_fn(graph, size, |i, j| jacobian.get(i, j))
    }

    /// The identity.
    pub fn identity(graph: &'g Graph, n: usize) -> Self {
        let one = graph.constant(1.0).node();
        Self::from_fn(graph, (n, n), |i, j| (i == j).then_some(one))
    }

    /// The graph of the entries.
    pub fn graph(&self) -> &'g Graph {
        self.graph
    }

    /// One entry; none where it is zero everywhere or outside the matrix.
    pub fn get(&self, i: usize, j: usize) -> Option<Node> {
        let inside = i < self.rows && j < self.columns;
        inside.then(|| self.entries[i * self.columns + j]).flatten()
    }

    /// One entry, the number 0 where it is zero everywhere.
    pub fn node(&self, i: usize, j: usize) -> Node {
        self.get(i, j)
            .unwrap_or_else(|| self.graph.constant(0.0).node())
    }

    /// Every entry that is not zero everywhere.
    pub fn nonzero(&self) -> Vec<Node> {
        self.entries.iter().copied().flatten().collect()
    }

    /// Each entry that is not zero everywhere replaced by its image.
    pub fn map(&self, image: impl Fn(Node) -> Node) -> Self {
        let size = (self.rows, self.columns);
        Self::from_fn(self.graph, size, |i, j| self.get(i, j).map(&image))
    }

    /// Aᵀ
    pub fn transposed(&self) -> Self {
        Self::from_fn(self.graph, (self.columns, self.rows), |i, j| self.get(j, i))
    }

    /// The given rows, in that order.
    pub fn select_rows(&self, rows: &[usize]) -> Self {
        let size = (rows.len(), self.columns);
        Self::from_fn(self.graph, size, |i, j| self.get(rows[i], j))
    }

    /// (A | B), for B with the same number of rows.
    pub fn beside(&self, right: &Self) -> Self {
        let size = (self.rows, self.columns + right.columns);
        Self::from_fn(self.graph, size, |i, j| match j.checked_sub(self.columns) {
            Some(j) => right.get(i, j),
            None => self.get(i, j),
        })
    }

    /// A above B, for B with the same number of columns.
    pub fn above(&self, below: &Self) -> Self {
        let size = (self.rows + below.rows, self.columns);
        Self::from_fn(self.graph, size, |i, j| match i.checked_sub(self.rows) {
            Some(i) => below.get(i, j),
            None => self.get(i, j),
        })
    }

    /// A B, for B with as many rows as A has columns.
    pub fn times(&self, right: &Self) -> Self {
        let product = |a: Node, b: Node| match a == b {
            // an even power has tighter bounds than a product
            true => self.graph.powi(a, 2),
            false => self.graph.binary(Binary::Mul, a, b),
        };
        let entry = |i: usize, j: usize| {
            let terms =
                (0..self.columns).filter_map(|k| Some(product(self.get(i, k)?, right.get(k, j)?)));
            terms.reduce(|a, b| self.graph.binary(Binary::Add, a, b))
        };
        Self::from_fn(self.graph, (self.rows, right.columns), entry)
    }

    /// A + B, for B of the same size.
    pub fn plus(&self, other: &Self) -> Self {
        self.combined(other, |a, b| self.graph.binary(Binary::Add, a, b), |b| b)
    }

    /// A − B, for B of the same size.
    pub fn minus(&self, other: &Self) -> Self {
        self.combined(
            other,
            |a, b| self.graph.binary(Binary::Sub, a, b),
            |b| self.graph.unary(Unary::Neg, b),
        )
    }

    fn combined(
        &self,
        other: &Self,
        both: impl Fn(Node, Node) -> Node,
        only_other: impl Fn(Node) -> Node,
    ) -> Self {
        let size = (self.rows, self.columns);
        Self::from_fn(self.graph, size, |i, j| {
            match (self.get(i, j), other.get(i, j)) {
                (Some(a), Some(b)) => Some(both(a, b)),
                (Some(a), None) => Some(a),
                (None, b) => b.map(&only_other),
            }
        })
    }

    /// A⁺B with the left inverse A⁺ by least squares: the solution X of
    /// (AᵀA) X = AᵀB, or of A X = B where A is square. It stays bounded where A loses
    /// rank, as [`Graph::solve`] does.
    pub fn left_divide(&self, right: &Self) -> Self {
        let (n, graph) = (self.columns, self.graph);
        let (normal, right) = match self.rows == n {
            true => (self.clone(), right.clone()),
            false => {
                let transposed = self.transposed();
                (transposed.times(self), transposed.times(right))
            }
        };
        let normal = normal.dense();
        let solved = |j: usize| {
            let b: Vec<Node> = (0..n).map(|i| right.node(i, j)).collect();
            let zero = (0..n).all(|i| right.get(i, j).is_none());
            (!zero).then(|| graph.solve(&normal, &b).x)
        };
        let columns: Vec<Option<Vec<Node>>> = (0..right.columns).map(solved).collect();
        let size = (n, right.columns);
        Self::from_fn(graph, size, |i, j| columns[j].as_ref().map(|x| x[i]))
    }

    /// Every entry row by row, zeros as numbers.
    pub fn dense(&self) -> Vec<Node> {
        let places = (0..self.rows).flat_map(|i| (0..self.columns).map(move |j| (i, j)));
        places.map(|(i, j)| self.node(i, j)).collect()
    }

    /// The determinant by expansion along the rows; none where it is zero
    /// everywhere. For small square matrices only: n! terms.
    pub fn determinant(&self) -> Option<Node> {
        let columns: Vec<usize> = (0..self.columns).collect();
        let found = self.expanded(0, &columns)?;
        (!polynomial::vanishes(self.graph, found)).then_some(found)
    }

    fn expanded(&self, row: usize, columns: &[usize]) -> Option<Node> {
        if columns.is_empty() {
            return Some(self.graph.constant(1.0).node());
        }
        let mut sum: Option<Node> = None;
        for (place, &column) in columns.iter().enumerate() {
            let Some(entry) = self.get(row, column) else {
                continue;
            };
            let others: Vec<usize> = columns.iter().copied().filter(|&c| c != column).collect();
            let Some(rest) = self.expanded(row + 1, &others) else {
                continue;
            };
            let term = self.graph.binary(Binary::Mul, entry, rest);
            sum = Some(match (sum, place % 2) {
                (None, 0) => term,
                (None, _) => self.graph.unary(Unary::Neg, term),
                (Some(sum), 0) => self.graph.binary(Binary::Add, sum, term),
                (Some(sum), _) => self.graph.binary(Binary::Sub, sum, term),
            });
        }
        sum
    }
}

impl std::fmt::Debug for Matrix<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let row = |i| (0..self.columns).map(move |j| self.graph.render(self.node(i, j), 60));
        f.debug_list()
            .entries((0..self.rows).map(|i| row(i).collect::<Vec<_>>()))
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Tape;

    fn matrix<'g>(graph: &'g Graph, rows: &[&[f64]]) -> Matrix<'g> {
        Matrix::from_fn(graph, (rows.len(), rows[0].len()), |i, j| {
            Some(graph.constant(rows[i][j]).node())
        })
    }

    fn value(graph: &Graph, node: Node) -> f64 {
        let mut out = [0.0];
        let tape = Tape::new(graph, &[], &[node]).unwrap();
        tape.evaluator().eval(&[], &mut out);
        out[0]
    }

    #[test]
    fn determinants_have_the_right_signs() {
        let g = Graph::new();
        let a = matrix(&g, &[&[0.0, 2.0, 1.0], &[3.0, 0.0, 4.0], &[5.0, 6.0, 0.0]]);
        assert_eq!(value(&g, a.determinant().unwrap()), 58.0);
        let singular = matrix(&g, &[&[1.0, 2.0], &[2.0, 4.0]]);
        assert_eq!(singular.determinant(), None);
    }

    #[test]
    fn a_left_inverse_undoes_a_tall_matrix() {
        let g = Graph::new();
        for a in [
            matrix(&g, &[&[1.0, 2.0], &[0.0, 1.0], &[3.0, -1.0]]),
            matrix(&g, &[&[1.0, 2.0], &[0.0, 4.0]]),
        ] {
            let product = a.left_divide(&a);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let expected = f64::from(u8::from(i == j));
                assert!((value(&g, product.node(i, j)) - expected).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn products_that_cancel_are_known_to_be_zero() {
        let g = Graph::new();
        let x = g.symbol("x");
        let row = Matrix::from_fn(&g, (1, 2), |_, j| {
            Some(if j == 0 { -x } else { 1.0 - x }.node())
        });
        let column = Matrix::from_fn(&g, (2, 1), |i, _| {
            Some(if i == 0 { 1.0 - x } else { x }.node())
        });
        assert_eq!(row.times(&column).get(0, 0), None);
    }
}
