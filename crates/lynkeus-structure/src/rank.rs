//! Ranks of matrices of expressions on the box, and one-to-one maps.
//!
//! Of a large square matrix rows and columns are permuted so that the matrix is block triangular: its determinant
//! is then, but for the sign, the product of those of the irreducible blocks on the
//! diagonal. The determinant of a small block is expanded and bounded. For a
//! larger one the box is cut until, on every part, each matrix with entries in the ranges of
//! this one's is regular, or until two points show determinants of both signs.

use std::collections::VecDeque;

use lynkeus_expr::interval::{Intervals, solve};
use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Tape, jacobian};

use crate::matrix::blocks;
use crate::region::Cell;
use crate::{
    Dimension, Finding, Matrix, Point, Reason, Region, Verdict, Witness, regularity, sign, steps,
};

/// Larger minors are not expanded.
const MAX_COLUMNS: usize = 5;
/// More minors are not looked at.
const MAX_MINORS: usize = 250;

/// Decides whether the columns of `matrix` are independent everywhere on the box.
///
/// Proved by one minor that keeps its sign, or by the sum of the squares of all
/// minors, det AᵀA, being positive. Refuted where every minor is zero
/// everywhere, where the only minor vanishes, or at a point where all do. Large square
/// matrices are decided by [`regular`].
///
/// # Errors
/// [`MissingInput`] where an entry depends on a symbol outside the region.
pub fn full_column_rank(matrix: &Matrix<'_>, region: &Region) -> Result<Finding, MissingInput> {
    let graph = matrix.graph();
    if matrix.rows == matrix.columns && matrix.columns > MAX_COLUMNS {
        return regular(matrix, region);
    }
    let Some(mut minors) = minors(matrix) else {
        let reason = Reason::ManyMinors(matrix.rows, matrix.columns);
        return Ok(Finding::undecided(reason));
    };
    if minors.is_empty() {
        let reason = Reason::ZeroMinors(matrix.rows, matrix.columns);
        return Ok(Finding::refuted(everywhere_zero(), reason));
    }
    if matrix.rows == matrix.columns {
        return Ok(sign::keeps_sign(graph, minors[0], region)?.finding);
    }
    minors.sort_by_key(|&minor| graph.reachable(&[minor]).len());
    for &minor in &minors {
        if !may_keep_sign(graph, minor, region)? {
            continue;
        }
        let found = sign::keeps_sign(graph, minor, region)?.finding;
        if found.is_proved() {
            return Ok(found);
        }
    }
    let gram = sum_of_squares(graph, &minors);
    Ok(sign::keeps_sign(graph, gram, region)?.finding)
}

/// A determinant that vanishes whatever its variables are.
fn everywhere_zero() -> Point {
    Point {
        coordinates: vec![],
        value: 0.0,
    }
}

/// det AᵀA as the sum of the squared minors (Cauchy and Binet), of the A with these entries; none where A is wider than
/// tall or the minors are too many.
pub(crate) fn gram(
    graph: &Graph,
    (rows, columns): (usize, usize),
    entry: impl Fn(usize, usize) -> Option<Node>,
) -> Option<Node> {
    if columns > rows || columns > MAX_COLUMNS {
        return None;
    }
    let minors = minors(&Matrix::from_fn(graph, (rows, columns), entry))?;
    Some(sum_of_squares(graph, &minors))
}

fn sum_of_squares(graph: &Graph, nodes: &[Node]) -> Node {
    let squares = nodes.iter().map(|&node| graph.powi(node, 2));
    let sum = squares.reduce(|a, b| graph.binary(Binary::Add, a, b));
    sum.unwrap_or_else(|| graph.constant(0.0).node())
}

/// Decides whether `functions` are one-to-one in `variables` on the box, for any
/// values of what else they read.
///
/// By the mean value theorem F(a) − F(b) = J (a − b), with row r of J taken at some
/// point between a and b, another one for each row. So F is one-to-one if J has
/// full column rank for all independent choices of these points. Where F is affine in
/// the variables this is necessary as well; else a failure leaves it undecided.
///
/// # Errors
/// [`MissingInput`] where a function depends on a symbol outside the region.
pub fn one_to_one(
    graph: &Graph,
    functions: &[Node],
    variables: &[Node],
    region: &Region,
) -> Result<Finding, MissingInput> {
    let local = Matrix::jacobian(graph, functions, variables);
    let entries = local.nonzero();
    let affine = jacobian::pattern(graph, &entries, variables)
        .iter()
        .all(Vec::is_empty)
        && !functions.iter().any(|&f| steps(graph, f, variables));
    let Finding { verdict, reason } = regularity(graph, functions, variables, region)?;
    if verdict != Verdict::Proved {
        let reason = Reason::NoMeanValue(Box::new(reason));
        return Ok(Finding { verdict, reason });
    }
    if affine {
        return full_column_rank(&local, region);
    }
    let mut wider = region.clone();
    let size = (local.rows, local.columns);
    let rows: Vec<Vec<Option<Node>>> = (0..local.rows)
        .map(|r| {
            let copies = copies(graph, variables, r, &mut wider);
            let row = (0..local.columns).map(|j| {
                let entry = local.get(r, j)?;
                Some(graph.substitute(&[entry], &copies)[0])
            });
            row.collect()
        })
        .collect();
    let mean = Matrix::from_fn(graph, size, |i, j| rows[i][j]);
    let found = full_column_rank(&mean, &wider)?;
    Ok(match found.verdict {
        Verdict::Refuted(_) => Finding::undecided(Reason::RowsApart),
        _ => found,
    })
}

/// Symbols for the variables at the mean value point of row `row`, with their sides.
fn copies(
    graph: &Graph,
    variables: &[Node],
    row: usize,
    region: &mut Region,
) -> std::collections::HashMap<Node, Node> {
    let copy = |side: &Dimension| {
        let name = format!("[{} in row {}]", side.name, row + 1);
        let symbol = graph.fresh(&name).node();
        Dimension {
            name,
            symbol,
            ..side.clone()
        }
    };
    let sides = region.restricted(variables).dimensions;
    let added: Vec<Dimension> = sides.iter().map(copy).collect();
    let pairs = sides.iter().zip(&added).map(|(x, y)| (x.symbol, y.symbol));
    let map = pairs.collect();
    region.dimensions.extend(added);
    map
}

/// The minors of full size that are not zero everywhere; none if there are too many.
fn minors(matrix: &Matrix<'_>) -> Option<Vec<Node>> {
    if matrix.columns > MAX_COLUMNS {
        return None;
    }
    let rows = subsets(matrix.rows, matrix.columns, MAX_MINORS)?;
    let minor = |rows: &Vec<usize>| matrix.select_rows(rows).determinant();
    Some(rows.iter().filter_map(minor).collect())
}

/// The subsets of {0, …, n−1} with k elements in lexicographic order; none if
/// there are more than `limit`.
pub fn subsets(n: usize, k: usize, limit: usize) -> Option<Vec<Vec<usize>>> {
    let mut all: Vec<Vec<usize>> = vec![vec![]];
    for chosen in 0..k {
        let longer = |s: &Vec<usize>| {
            let first = s.last().map_or(0, |last| last + 1);
            let last = (n + chosen + 1).saturating_sub(k);
            let next = |i: usize| [&s[..], &[i]].concat();
            (first..last).map(next).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(longer).collect();
        if all.len() > limit {
            return None;
        }
    }
    Some(all)
}

/// False where samples show a zero or both signs: not worth a proof attempt.
fn may_keep_sign(graph: &Graph, node: Node, region: &Region) -> Result<bool, MissingInput> {
    let region = region.restricted(&graph.symbols_of(&[node]));
    let mut evaluator = Tape::new(graph, &region.symbols(), &[node])?.evaluator();
    let (mut positive, mut negative) = (true, true);
    for point in region.samples(&region.cell()) {
        let value = evaluator.value(&point);
        positive &= value > 0.0;
        negative &= value < 0.0;
    }
    Ok(positive || negative)
}

/// Determinants of larger blocks are not expanded.
const EXPANDED: usize = 5;
/// Parts of the box that are looked at.
const CELLS: usize = 2000;

/// Decides whether the square `matrix` is regular at every point of the region.
///
/// Refuted with a point where the determinant of a diagonal block vanishes, or with two
/// where its signs differ.
///
/// # Errors
/// [`MissingInput`] where an entry depends on a symbol outside the region.
pub fn regular(matrix: &Matrix<'_>, region: &Region) -> Result<Finding, MissingInput> {
    let Some(blocks) = blocks(matrix) else {
        return Ok(Finding::refuted(everywhere_zero(), Reason::ZeroDeterminant));
    };
    let mut product = Some((1.0, 1.0));
    let mut parts = 0;
    let mut open: Option<Finding> = None;
    for block in blocks {
        let found = decide(&block, region)?;
        match (&found.verdict, &found.reason) {
            (Verdict::Refuted(_), _) => {
                let reason = Reason::DeterminantVanishes;
                return Ok(Finding { reason, ..found });
            }
            (Verdict::Proved, Reason::Determinant { low, high, .. }) => {
                product = product.map(|all| (all.0 * low, all.1 * high));
            }
            (Verdict::Proved, Reason::RegularParts(more)) => {
                product = None;
                parts += more;
            }
            _ => open = open.or(Some(found)),
        }
    }
    Ok(open.unwrap_or(Finding::proved(match product {
        Some((low, high)) => Reason::Determinant {
            low,
            high,
            open: false,
        },
        None => Reason::RegularParts(parts),
    })))
}

/// Of an irreducible block: proved by [`Reason::Determinant`] where that was expanded, else by
/// [`Reason::RegularParts`].
fn decide(block: &Matrix<'_>, region: &Region) -> Result<Finding, MissingInput> {
    if block.rows > EXPANDED {
        return by_parts(block, region);
    }
    let graph = block.graph();
    let zero = || graph.constant(0.0).node();
    let det = block.expanded().unwrap_or_else(zero);
    let found = sign::keeps_sign(graph, det, region)?;
    let verdict = found.finding.verdict;
    let open = matches!(verdict, Verdict::Undecided(_));
    if open && block.rows > 1 {
        let second = by_parts(block, region)?;
        if second.is_proved() {
            return Ok(second);
        }
    }
    let (low, high) = found.bounds;
    let reason = Reason::Determinant { low, high, open };
    Ok(Finding { verdict, reason })
}

/// Cuts the box until the ranges of the entries decide.
fn by_parts(block: &Matrix<'_>, region: &Region) -> Result<Finding, MissingInput> {
    let graph = block.graph();
    let entries = block.dense();
    let region = region.restricted(&graph.symbols_of(&entries));
    let tape = Tape::new(graph, &region.symbols(), &entries)?;
    let zeros = vec![Interval::ZERO; block.rows];
    let is_regular = |cell: &Cell| {
        let entries = tape.eval_in(&Intervals, cell);
        entries.iter().all(|e| e.is_defined() && !e.is_empty()) && solve(&entries, &zeros).1
    };
    // points with a negative and with a positive determinant
    let mut seen: [Option<Point>; 2] = [None, None];
    let mut open = VecDeque::from([region.cell()]);
    let mut parts = 0;
    let mut looked = 0;
    while let Some(cell) = open.pop_front() {
        looked += 1;
        if is_regular(&cell) {
            parts += 1;
            continue;
        }
        let middle = region.middle_point(&cell);
        let at: Cell = middle.iter().map(|&x| Interval::point(x)).collect();
        if let Some(value) = sure_determinant(tape.eval_in(&Intervals, &at), block.rows) {
            let place = usize::from(value > 0.0);
            seen[place] = Some(region.point(&middle, value));
        }
        let witness: Option<Vec<Point>> = seen.iter().cloned().collect();
        let halves = region
            .split(&cell)
            .filter(|_| looked < CELLS && graph.spent().is_none());
        let Some(halves) = halves.filter(|_| witness.is_none()) else {
            let reason = Reason::OpenParts(CELLS, block.rows);
            return Ok(match witness {
                Some(points) => Finding::refuted(Witness { points }, reason),
                None => Finding {
                    verdict: Verdict::Undecided(region.named(&cell)),
                    reason,
                },
            });
        };
        open.extend(halves);
    }
    Ok(Finding::proved(Reason::RegularParts(parts)))
}

/// The determinant by elimination, where its sign is beyond rounding errors.
fn sure_determinant(mut a: Vec<Interval>, n: usize) -> Option<f64> {
    let mut det = 1.0;
    for k in 0..n {
        let size = |i: &usize| a[i * n + k].mignitude();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)))?;
        if pivot != k {
            det = -det;
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
        }
        let lead = a[k * n + k];
        if !(lead.is_positive() || lead.is_negative()) {
            return None;
        }
        det *= lead.midpoint();
        for i in k + 1..n {
            let factor = a[i * n + k] / lead;
            for j in k + 1..n {
                a[i * n + j] = a[i * n + j] - factor * a[k * n + j];
            }
        }
    }
    (det.is_finite() && det != 0.0).then_some(det)
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::{Expr, Graph};
    use proptest::prelude::*;

    use super::*;
    use crate::Dimension;

    fn rank(rows: &[&[Expr<'_>]], symbols: &[Expr<'_>]) -> Finding {
        let graph = rows[0][0].graph();
        let size = (rows.len(), rows[0].len());
        let matrix = Matrix::from_fn(graph, size, |i, j| Some(rows[i][j].node()));
        full_column_rank(&matrix, &region(symbols, 2.0)).unwrap()
    }

    #[test]
    fn no_minor_keeps_its_sign_but_their_squares_add_up() {
        let g = Graph::new();
        let x = g.symbol("x");
        let check = rank(&[&[-x], &[1.0 - x]], &[x]);
        assert_eq!(check.verdict, Verdict::Proved, "{:?}", check.reason);
    }

    #[test]
    fn a_common_zero_is_the_witness() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let check = rank(&[&[x], &[y.sin()]], &[x, y]);
        let Verdict::Refuted(witness) = check.verdict else {
            panic!("{:?}", check.reason)
        };
        let values: Vec<f64> = witness.points[0]
            .coordinates
            .iter()
            .map(|c| c.value)
            .collect();
        assert_eq!(values, [0.0, 0.0]);
    }

    #[test]
    fn dependent_columns_are_refuted_without_a_search() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let check = rank(&[&[x, x * y], &[y, y * y], &[x + 1.0, y * x + y]], &[x, y]);
        assert!(matches!(check.verdict, Verdict::Refuted(_)));
        let reason = rank(&[&[x, y]], &[x, y]).reason;
        assert_eq!(reason, Reason::ZeroMinors(1, 2));
    }

    #[test]
    fn every_subset_once() {
        assert_eq!(
            subsets(4, 2, 10).unwrap(),
            [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
        );
        assert_eq!(subsets(3, 0, 10).unwrap(), [vec![]; 1]);
        assert!(subsets(2, 3, 10).unwrap().is_empty());
        assert_eq!(subsets(40, 20, 1000), None);
    }

    /// (a² − b² , 2ab)-like maps have a regular Jacobian on a ring but are two to one.
    #[test]
    fn one_to_one_is_more_than_a_local_rank() {
        let g = Graph::new();
        let (a, b) = (g.symbol("a"), g.symbol("b"));
        let decide = |f: [Expr<'_>; 2], region: &Region| {
            let functions = f.map(|f| f.node());
            let variables = [a.node(), b.node()];
            one_to_one(&g, &functions, &variables, region).unwrap()
        };
        let box_ = region(&[a, b], 2.0);
        let tame = decide([a + 0.2 * b.sin(), b - 0.1 * a * a], &box_);
        assert_eq!(tame.verdict, Verdict::Proved, "{:?}", tame.reason);
        let folded = decide([a * a - b * b, 2.0 * a * b], &box_);
        assert!(matches!(folded.verdict, Verdict::Undecided(_)));
        let flat = decide([a + b, 2.0 * a + 2.0 * b], &box_);
        assert!(matches!(flat.verdict, Verdict::Refuted(_)));
    }

    fn region(symbols: &[Expr<'_>], size: f64) -> Region {
        let side = |x: &Expr<'_>| Dimension {
            name: x.graph().symbol_name(x.node()).unwrap(),
            symbol: x.node(),
            min: -size,
            max: size,
            integer: false,
        };
        Region {
            dimensions: symbols.iter().map(side).collect(),
        }
    }

    /// n × n with ones on the diagonal, `a` right of it and `b` in the lower left corner.
    fn cycle<'g>(graph: &'g Graph, n: usize, a: Expr<'g>, b: Expr<'g>) -> Matrix<'g> {
        let one = graph.constant(1.0).node();
        Matrix::from_fn(graph, (n, n), |i, j| match j {
            _ if i == j => Some(one),
            _ if j == i + 1 => Some(a.node()),
            0 if i + 1 == n => Some(b.node()),
            _ => None,
        })
    }

    /// det = 1 + (−1)ⁿ⁻¹ aⁿ⁻¹ b, and no permutation makes it triangular.
    #[test]
    fn large_irreducible_blocks_are_decided() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|n| g.symbol(n));
        let decide = |size: f64| {
            let matrix = cycle(&g, 8, x, y);
            regular(&matrix, &region(&[x, y], size)).unwrap()
        };
        let found = decide(0.9);
        assert_eq!(found.verdict, Verdict::Proved, "{:?}", found.reason);
        let Verdict::Refuted(witness) = decide(1.5).verdict else {
            panic!()
        };
        for point in &witness.points {
            let [x, y] = [0, 1].map(|i| point.coordinates[i].value);
            let det = 1.0 - x.powi(7) * y;
            assert!((det - point.value).abs() < 1e-9, "{det} {}", point.value);
        }
        assert!(witness.points[0].value < 0.0 && witness.points[1].value > 0.0);
    }

    /// Rows and columns in any order; each block alone.
    #[test]
    fn permuted_block_triangular_matrices_fall_apart() {
        let g = Graph::new();
        let x = g.symbol("x");
        let n = 9;
        let place = |i: usize| (4 * i + 2) % n;
        let matrix = Matrix::from_fn(&g, (n, n), |i, j| {
            let (i, j) = (place(i), place(j));
            let node = match j {
                _ if i == j => 2.0 + x.sin(),
                _ if j > i => 100.0 * x,
                _ => return None,
            };
            Some(node.node())
        });
        let found = regular(&matrix, &region(&[x], 3.0)).unwrap();
        assert_eq!(found.verdict, Verdict::Proved);
        assert!(matches!(found.reason, Reason::Determinant { .. }));
    }

    #[test]
    fn structurally_singular_matrices_are_refuted() {
        let g = Graph::new();
        let x = g.symbol("x");
        // two columns for three rows
        let matrix = Matrix::from_fn(&g, (7, 7), |i, j| {
            (i == j || (i > 3 && j < 2))
                .then(|| (x + 2.0).node())
                .filter(|_| i < 4 || j < 2)
        });
        let found = regular(&matrix, &region(&[x], 1.0)).unwrap();
        assert!(matches!(found.verdict, Verdict::Refuted(_)));
    }

    /// A determinant of 10⁻²⁰ is not printed as zero.
    #[test]
    fn small_determinants_have_digits() {
        let g = Graph::new();
        let x = g.symbol("x");
        let matrix = Matrix::from_fn(&g, (1, 1), |_, _| Some((1e-20 * (x + 2.0)).node()));
        let found = regular(&matrix, &region(&[x], 1.0)).unwrap();
        assert_eq!(found.verdict, Verdict::Proved);
        assert!(matches!(found.reason, Reason::Determinant { low, .. } if low > 0.9e-20));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        /// Numbers in a random pattern: regular is what elimination finds regular.
        #[test]
        fn numbers_agree_with_elimination(
            a in prop::collection::vec(-2i32..3, 49), holes in prop::collection::vec(any::<bool>(), 49)
        ) {
            let g = Graph::new();
            let value = |i: usize, j: usize| match holes[7 * i + j] {
                true => 0.0,
                false => f64::from(a[7 * i + j]),
            };
            let matrix = Matrix::from_fn(&g, (7, 7), |i, j| Some(g.constant(value(i, j)).node()));
            let det = nalgebra::DMatrix::from_fn(7, 7, value).determinant();
            let found = regular(&matrix, &Region::default()).unwrap();
            // whole numbers: a determinant is zero or at least one
            match found.verdict {
                Verdict::Proved => prop_assert!(det.abs() > 0.5),
                Verdict::Refuted(_) => prop_assert!(det.abs() < 0.5),
                Verdict::Undecided(_) => prop_assert!(det.abs() < 0.5),
            }
        }
    }
}
