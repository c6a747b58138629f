//! What the rank of F_k says before any input is known.

use lynkeus_expr::{Graph, MissingInput, Node};
use nalgebra::DMatrix;

use super::Factor;
use super::constant::{self, Kernel};
use crate::rank::subsets;
use crate::{Extended, Finding, Matrix, Point, Region, Verdict, sign};

/// Larger minors are not expanded.
const MAX_COLUMNS: usize = 5;
/// More minors than this are left undecided.
const MAX_MINORS: usize = 250;

impl Factor {
    /// Has F_k full column rank everywhere on the box? Then x^{k+1} shows in x^k
    /// whatever the input. Refuted, with the direction ξ that F_k ξ = 0 hides,
    /// only where F_k is a matrix of numbers: anything that moves may turn the
    /// hidden direction, and the excitation decides.
    ///
    /// # Errors
    /// [`MissingInput`] where an entry depends on a symbol outside the region.
    pub fn column_rank(
        &self,
        extended: &Extended<'_>,
        k: usize,
        region: &Region,
    ) -> Result<Finding, MissingInput> {
        let graph = extended.graph();
        let shape = format!("F_{k} is {}×{}", self.rows.len(), self.columns.len());
        if let Some(F) = self.constant(graph) {
            return Ok(self.constant_rank(extended, &F, &shape));
        }
        let entries: Vec<Node> = self.entries.iter().map(|&(.., node)| node).collect();
        let used = region.restricted(&graph.symbols_of(&entries));
        let sides = used.named(&used.cell());
        let Some(minors) = self.minors(graph) else {
            let detail = format!(
                "{shape}: it shows these states only while its entries move, so convergence rests on the excitation (A4)"
            );
            return Ok(Finding {
                verdict: Verdict::Undecided(sides),
                detail,
            });
        };
        let found = sign::keeps_sign(graph, minors, region)?.finding;
        Ok(match found.verdict {
            Verdict::Refuted(witness) => Finding {
                detail: format!(
                    "{shape} and loses rank (det F_{k}ᵀF_{k}: {witness}); convergence rests on inputs that do not stay there (A4)"
                ),
                verdict: Verdict::Undecided(sides),
            },
            verdict => Finding {
                detail: format!("{shape}; det F_{k}ᵀF_{k} = {}", found.detail),
                verdict,
            },
        })
    }

    /// The matrix, where all of its entries are numbers.
    fn constant(&self, graph: &Graph) -> Option<DMatrix<f64>> {
        let mut matrix = DMatrix::zeros(self.rows.len(), self.columns.len());
        for &(i, j, node) in &self.entries {
            let value = graph.constant_value(node)?;
            matrix[(i, j)] = Some(value).filter(|x| x.is_finite())?;
        }
        Some(matrix)
    }

    /// [`Factor::column_rank`] of a matrix of numbers.
    fn constant_rank(&self, extended: &Extended<'_>, F: &DMatrix<f64>, shape: &str) -> Finding {
        let kernel = constant::kernel(F);
        let Kernel::Direction(ξ) = kernel else {
            let (verdict, detail) = match kernel {
                Kernel::Zero => (
                    Verdict::Proved,
                    format!(
                        "{shape} and constant, its columns independent by elimination in interval arithmetic"
                    ),
                ),
                _ => (
                    Verdict::open(),
                    format!(
                        "{shape} and constant, so near to one that hides a direction that rounding errors keep from telling whether it does"
                    ),
                ),
            };
            return Finding { verdict, detail };
        };
        let component = |(&i, x): (&usize, f64)| (extended.states[i].name.clone(), x).into();
        let direction = Point {
            coordinates: self.columns.iter().zip(ξ).map(component).collect(),
            value: 0.0,
        };
        let detail = format!(
            "{shape} and constant: whatever the input, the layer before does not show this direction, so that this arrangement of the states does not fit; measure another output"
        );
        Finding::refuted(direction, detail)
    }

    /// det FᵀF as the sum of the squared minors (Cauchy and Binet); none where F
    /// is wider than tall or the minors are too many.
    fn minors(&self, graph: &Graph) -> Option<Node> {
        let (rows, columns) = (self.rows.len(), self.columns.len());
        if columns > rows || columns > MAX_COLUMNS {
            return None;
        }
        let entry = |i: usize, j: usize| {
            let found = self.entries.iter().find(|&&(k, l, _)| (k, l) == (i, j));
            found.map(|&(.., node)| node)
        };
        let matrix = Matrix::from_fn(graph, (rows, columns), entry);
        let squares = subsets(rows, columns, MAX_MINORS)?
            .into_iter()
            .filter_map(|rows| matrix.select_rows(&rows).determinant())
            .map(|minor| graph.expr(minor).powi(2));
        let zero = || graph.constant(0.0);
        Some(squares.reduce(|a, b| a + b).unwrap_or_else(zero).node())
    }
}
