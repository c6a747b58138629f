//! Ranks of matrices of expressions on the box, and one-to-one maps.

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Tape, jacobian};

use crate::{Dimension, Finding, Matrix, Point, Region, Regularity, Verdict, regular, sign, steps};

/// Larger minors are not expanded.
const MAX_COLUMNS: usize = 5;
/// More minors are not looked at.
const MAX_MINORS: usize = 250;

/// Decides whether the columns of `matrix` are independent everywhere on the box.
///
/// Proved by one minor that keeps its sign, or by the sum of the squares of all
/// minors, det AᵀA, being positive. Refuted where every minor is zero
/// everywhere, where the only minor vanishes, or at a point where all do. Large square
/// matrices are decided by [`regular::regular`].
///
/// # Errors
/// [`MissingInput`] where an entry depends on a symbol outside the region.
pub fn full_column_rank(matrix: &Matrix<'_>, region: &Region) -> Result<Finding, MissingInput> {
    let graph = matrix.graph();
    if matrix.rows == matrix.columns && matrix.columns > MAX_COLUMNS {
        return regular::regular(matrix, region);
    }
    let Some(mut minors) = minors(matrix) else {
        let detail = format!(
            "a {}×{} matrix has too many minors to decide",
            matrix.rows, matrix.columns
        );
        return Ok(Finding::undecided(detail));
    };
    if minors.is_empty() {
        let zero = Point {
            coordinates: vec![],
            value: 0.0,
        };
        let detail = format!(
            "every {0}×{0} minor of the {1}×{0} matrix is zero",
            matrix.columns, matrix.rows
        );
        return Ok(Finding::refuted(zero, detail));
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
    let squares = minors.iter().map(|&minor| graph.powi(minor, 2));
    let gram = squares.reduce(|a, b| graph.binary(Binary::Add, a, b));
    let gram = gram.unwrap_or_else(|| graph.constant(0.0).node());
    Ok(sign::keeps_sign(graph, gram, region)?.finding)
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
    let regularity = Regularity::of(graph, functions, variables, region)?;
    if let Some(trouble) = regularity.trouble() {
        return Ok(Finding {
            verdict: regularity.verdict(),
            detail: format!("the mean value theorem does not apply: {trouble}"),
        });
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
        Verdict::Refuted(_) => Finding::undecided(
            "the mean value theorem does not decide it: rows taken at different points can be dependent",
        ),
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
    let mut out = [0.0];
    let (mut positive, mut negative) = (true, true);
    for point in region.samples(&region.cell()) {
        evaluator.eval(&point, &mut out);
        positive &= out[0] > 0.0;
        negative &= out[0] < 0.0;
    }
    Ok(positive || negative)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Expr;

    fn region(symbols: &[Expr<'_>]) -> Region {
        let side = |x: &Expr<'_>| Dimension {
            name: x.graph().symbol_name(x.node()).unwrap(),
            symbol: x.node(),
            min: -2.0,
            max: 2.0,
            integer: false,
        };
        Region {
            dimensions: symbols.iter().map(side).collect(),
        }
    }

    fn rank(rows: &[&[Expr<'_>]], symbols: &[Expr<'_>]) -> Finding {
        let graph = rows[0][0].graph();
        let size = (rows.len(), rows[0].len());
        let matrix = Matrix::from_fn(graph, size, |i, j| Some(rows[i][j].node()));
        full_column_rank(&matrix, &region(symbols)).unwrap()
    }

    #[test]
    fn no_minor_keeps_its_sign_but_their_squares_add_up() {
        let g = Graph::new();
        let x = g.symbol("x");
        let check = rank(&[&[-x], &[1.0 - x]], &[x]);
        assert_eq!(check.verdict, Verdict::Proved, "{}", check.detail);
    }

    #[test]
    fn a_common_zero_is_the_witness() {
        let g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let check = rank(&[&[x], &[y.sin()]], &[x, y]);
        let Verdict::Refuted(witness) = check.verdict else {
            panic!("{}", check.detail)
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
        assert!(rank(&[&[x, y]], &[x, y]).detail.contains("minor"));
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
        let box_ = region(&[a, b]);
        let tame = decide([a + 0.2 * b.sin(), b - 0.1 * a * a], &box_);
        assert_eq!(tame.verdict, Verdict::Proved, "{}", tame.detail);
        let folded = decide([a * a - b * b, 2.0 * a * b], &box_);
        assert!(matches!(folded.verdict, Verdict::Undecided(_)));
        let flat = decide([a + b, 2.0 * a + 2.0 * b], &box_);
        assert!(matches!(flat.verdict, Verdict::Refuted(_)));
    }
}
