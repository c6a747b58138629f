//! Is a square matrix of expressions regular everywhere on the box?
//!
//! Rows and columns are permuted so that the matrix is block triangular: its determinant
//! is then, but for the sign, the product of those of the irreducible blocks on the
//! diagonal. The determinant of a small block is expanded and bounded. For a
//! larger one the box is cut until, on every part, each matrix with entries in the ranges of
//! this one's is regular, or until two points show determinants of both signs.

use std::collections::VecDeque;

use lynkeus_expr::interval::{Intervals, solve};
use lynkeus_expr::{Interval, MissingInput, Tape};

use crate::irreducible::blocks;
use crate::output_map::determinant;
use crate::region::Cell;
use crate::words::short;
use crate::{Coordinate, Finding, Matrix, Point, Region, Verdict, Witness, sign};

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
        let zero = Point {
            coordinates: vec![],
            value: 0.0,
        };
        let detail = "det is zero everywhere, by the zeros of the matrix";
        return Ok(Finding::refuted(zero, detail));
    };
    let mut product = Some((1.0, 1.0));
    let mut parts = 0;
    let mut open: Option<Block> = None;
    for block in blocks {
        let found = decide(&block, region)?;
        match found.verdict {
            Verdict::Refuted(witness) => {
                let detail = "det vanishes or changes its sign";
                return Ok(Finding::refuted(witness, detail));
            }
            Verdict::Undecided(_) => open = open.or(Some(found)),
            Verdict::Proved => {
                let pairs = product.zip(found.bounds);
                product = pairs.map(|(all, one)| (all.0 * one.0, all.1 * one.1));
                parts += found.parts;
            }
        }
    }
    if let Some(open) = open {
        return Ok(Finding {
            verdict: open.verdict,
            detail: open.detail,
        });
    }
    let detail = match product {
        Some((low, high)) => format!("|det| lies in [{}, {}]", short(low), short(high)),
        None => format!(
            "the ranges of its entries keep it regular, on each of {parts} parts of the box"
        ),
    };
    Ok(Finding::proved(detail))
}

/// What is known of an irreducible block.
struct Block {
    verdict: Verdict,
    detail: String,
    /// of |det|, where it was expanded
    bounds: Option<(f64, f64)>,
    /// parts of the box of the proof, where it was not
    parts: usize,
}

fn decide(block: &Matrix<'_>, region: &Region) -> Result<Block, MissingInput> {
    if block.rows > EXPANDED {
        return by_parts(block, region);
    }
    let graph = block.graph();
    let rows: Vec<Vec<_>> = (0..block.rows)
        .map(|i| (0..block.columns).map(|j| block.get(i, j)).collect())
        .collect();
    let det = determinant(graph, &rows).unwrap_or_else(|| graph.constant(0.0).node());
    let found = sign::keeps_sign(graph, det, region)?;
    let (low, high) = found.bounds;
    if let Verdict::Undecided(_) = found.finding.verdict
        && block.rows > 1
    {
        let second = by_parts(block, region)?;
        if second.verdict == Verdict::Proved {
            return Ok(second);
        }
    }
    Ok(Block {
        verdict: found.finding.verdict,
        detail: format!(
            "|det| lies in [{}, {}] as far as can be proved",
            short(low),
            short(high)
        ),
        bounds: Some((low, high)),
        parts: 0,
    })
}

/// Cuts the box until the ranges of the entries decide.
fn by_parts(block: &Matrix<'_>, region: &Region) -> Result<Block, MissingInput> {
    let graph = block.graph();
    let entries = block.dense();
    let region = region.restricted(&graph.symbols_of(&entries));
    let tape = Tape::new(graph, &region.symbols(), &entries)?;
    let zeros = vec![Interval::ZERO; block.rows];
    let is_regular = |cell: &Cell| {
        let entries = tape.eval_in(&Intervals, cell);
        entries.iter().all(|e| e.is_defined() && !e.is_empty()) && solve(&entries, &zeros).1
    };
    let mut signs = Signs::default();
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
        let det = sure_determinant(tape.eval_in(&Intervals, &at), block.rows);
        signs.note(&region, &middle, det);
        let halves = region
            .split(&cell)
            .filter(|_| looked < CELLS && graph.spent().is_none());
        let Some((first, second)) = halves.filter(|_| signs.witness().is_none()) else {
            let verdict = match signs.witness() {
                Some(witness) => Verdict::Refuted(witness),
                None => Verdict::Undecided(region.named(&cell)),
            };
            return Ok(Block {
                verdict,
                detail: format!(
                    "{CELLS} parts of the box do not decide for a block of {} rows; the column rcond shows it along the estimate",
                    block.rows
                ),
                bounds: None,
                parts,
            });
        };
        open.extend([first, second]);
    }
    Ok(Block {
        verdict: Verdict::Proved,
        detail: String::new(),
        bounds: None,
        parts,
    })
}

/// Points with determinants of either sign.
#[derive(Default)]
struct Signs {
    positive: Option<Point>,
    negative: Option<Point>,
}

impl Signs {
    fn note(&mut self, region: &Region, at: &[f64], det: Option<f64>) {
        let Some(value) = det else { return };
        let names = region.dimensions.iter().map(|d| d.name.clone());
        let point = Point {
            coordinates: names
                .zip(at.iter().copied())
                .map(Coordinate::from)
                .collect(),
            value,
        };
        match value > 0.0 {
            true => self.positive = Some(point),
            false => self.negative = Some(point),
        }
    }

    fn witness(&self) -> Option<Witness> {
        let points = vec![self.negative.clone()?, self.positive.clone()?];
        Some(Witness { points })
    }
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
    use super::*;
    use crate::Dimension;
    use lynkeus_expr::{Expr, Graph};
    use proptest::prelude::*;

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
        assert_eq!(found.verdict, Verdict::Proved, "{}", found.detail);
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
        assert!(
            found.detail.starts_with("|det| lies in"),
            "{}",
            found.detail
        );
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
        assert!(!found.detail.contains("[0,"), "{}", found.detail);
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
