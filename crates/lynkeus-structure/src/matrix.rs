//! Matrices of expressions that know their zeros.

use std::collections::{HashMap, VecDeque};

use lynkeus_expr::{Binary, Expr, Graph, Node, Unary, components, jacobian};

use crate::exact::is_zero;

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
            (!is_zero(graph, node)).then_some(node)
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

    /// The determinant by expansion along the rows; none where it is zero everywhere. For small square matrices only.
    pub fn determinant(&self) -> Option<Node> {
        let determinant = self.expanded();
        determinant.filter(|&found| !is_zero(self.graph, found))
    }

    /// The same as it is expanded; none where it is zero by its pattern.
    pub(crate) fn expanded(&self) -> Option<Node> {
        let row = |i: usize| (0..self.columns).map(move |j| self.get(i, j)).collect();
        let rows: Rows = (0..self.rows).map(row).collect();
        determinant(self.graph, &rows)
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

/// A matrix row by row; none where an entry is zero everywhere.
pub type Rows = Vec<Vec<Option<Node>>>;

/// ∂(functions)/∂(symbols)
pub fn jacobian_rows(graph: &Graph, functions: &[Node], symbols: &[Node]) -> Rows {
    let jacobian = jacobian::forward(graph, functions, symbols);
    let row = |i| (0..symbols.len()).map(|j| jacobian.get(i, j)).collect();
    (0..functions.len()).map(row).collect()
}

/// The determinant by Laplace expansion with shared minors: 2ⁿ of them at most, so
/// only for small matrices. None where it is zero everywhere by its pattern.
pub fn determinant(graph: &Graph, rows: &[Vec<Option<Node>>]) -> Option<Node> {
    let mut minors: HashMap<u64, Option<Node>> = HashMap::new();
    minor(graph, rows, 0, &mut minors)
}

/// The minor of the last rows without the columns in `used`.
fn minor(
    graph: &Graph,
    rows: &[Vec<Option<Node>>],
    used: u64,
    minors: &mut HashMap<u64, Option<Node>>,
) -> Option<Node> {
    let row = used.count_ones() as usize;
    let Some(entries) = rows.get(row) else {
        return Some(graph.constant(1.0).node());
    };
    if let Some(&known) = minors.get(&used) {
        return known;
    }
    let mut sum: Option<Expr<'_>> = None;
    let free = (0..entries.len()).filter(|j| used >> j & 1 == 0);
    for (place, j) in free.enumerate() {
        let Some(entry) = entries[j] else { continue };
        let Some(rest) = minor(graph, rows, used | 1 << j, minors) else {
            continue;
        };
        let term = graph.expr(entry) * graph.expr(rest);
        sum = Some(match (sum, place.is_multiple_of(2)) {
            (None, true) => term,
            (None, false) => -term,
            (Some(sum), true) => sum + term,
            (Some(sum), false) => sum - term,
        });
    }
    let value = sum.map(Expr::node);
    minors.insert(used, value);
    value
}

/// The irreducible blocks on the diagonal of the block triangular form; none
/// where no permutation has a diagonal without zeros.
pub(crate) fn blocks<'g>(matrix: &Matrix<'g>) -> Option<Vec<Matrix<'g>>> {
    let column_of = transversal(matrix)?;
    let n = matrix.rows;
    // row i reads the column that belongs to row k
    let reads = |i: usize| {
        (0..n)
            .filter(|&k| matrix.get(i, column_of[k]).is_some())
            .collect()
    };
    let mut blocks = components(&(0..n).map(reads).collect::<Vec<Vec<usize>>>());
    blocks.sort_unstable();
    let block = |rows: Vec<usize>| {
        Matrix::from_fn(matrix.graph(), (rows.len(), rows.len()), |i, j| {
            matrix.get(rows[i], column_of[rows[j]])
        })
    };
    Some(blocks.into_iter().map(block).collect())
}

/// A column for every row, all different, with entries that are not zero everywhere.
fn transversal(matrix: &Matrix<'_>) -> Option<Vec<usize>> {
    let n = matrix.rows;
    if matrix.columns != n {
        return None;
    }
    let mut row_of: Vec<Option<usize>> = vec![None; n];
    for start in 0..n {
        // breadth first: which row asked for the column
        let mut asked: Vec<Option<usize>> = vec![None; n];
        let mut open = VecDeque::from([start]);
        let mut free = None;
        while let Some(row) = open.pop_front() {
            for column in (0..n).filter(|&j| matrix.get(row, j).is_some()) {
                if asked[column].is_some() {
                    continue;
                }
                asked[column] = Some(row);
                match row_of[column] {
                    None => free = free.or(Some(column)),
                    Some(next) => open.push_back(next),
                }
            }
        }
        let mut column = free?;
        // the rows along the way move on by one column
        while let Some(row) = asked[column] {
            let before = row_of.iter().position(|&r| r == Some(row));
            row_of[column] = Some(row);
            match before {
                Some(left) if row != start => column = left,
                _ => break,
            }
        }
    }
    let mut column_of = vec![0; n];
    for (column, row) in row_of.into_iter().enumerate() {
        column_of[row?] = column;
    }
    Some(column_of)
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Tape;
    use proptest::prelude::*;

    use super::*;

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

    proptest! {
        #[test]
        fn determinants_agree_with_elimination(a in prop::array::uniform16(-1.0..1.0f64), holes in any::<u16>()) {
            let graph = Graph::new();
            let hole = |k: usize| holes >> k & 1 == 1 && k.is_multiple_of(3);
            let rows: Rows = (0..4)
                .map(|i| (0..4).map(|j| (!hole(4 * i + j)).then(|| graph.constant(a[4 * i + j]).node())).collect())
                .collect();
            let matrix = nalgebra::Matrix4::from_fn(|i, j| if hole(4 * i + j) { 0.0 } else { a[4 * i + j] });
            let found = determinant(&graph, &rows).map_or(0.0, |d| graph.constant_value(d).unwrap());
            prop_assert!((found - matrix.determinant()).abs() < 1e-13);
        }
    }
}
