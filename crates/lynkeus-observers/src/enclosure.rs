//! Bounds over the box of expressions and of matrices of them, for the constants
//! of proofs.
//!
//! Everything here is outward rounded: bounds are the upper ends of intervals. What a
//! theorem makes of them in plain operations it rounds up by [`up`].

use std::cell::RefCell;
use std::collections::BTreeSet;

use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Unary};
use lynkeus_structure::{Dimension, Matrix, Region, range_within};

/// Cells examined per end of the range of an entry.
const CELLS: usize = 600;
/// More than the rounding errors of a sum of some hundred positive numbers.
const GUARD: f64 = 1e-12;
/// Share by which a guessed bound is raised before it is checked.
const RESERVE: f64 = 1e-9;

/// A box with what was found to be unbounded on it.
pub(crate) struct Enclosure<'g> {
    graph: &'g Graph,
    region: Region,
    open: RefCell<BTreeSet<String>>,
}

impl<'g> Enclosure<'g> {
    pub fn new(graph: &'g Graph, region: &Region) -> Self {
        Self {
            graph,
            region: region.clone(),
            open: RefCell::default(),
        }
    }

    /// The box with everything added.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// A further variable, bounded by `size` in absolute value.
    pub fn within(&mut self, name: impl Into<String>, size: f64) -> Node {
        let name = name.into();
        let symbol = self.graph.fresh(&name).node();
        self.add(name, symbol, -size, size);
        symbol
    }

    /// A further variable of the box.
    pub fn add(&mut self, name: String, symbol: Node, min: f64, max: f64) {
        self.region.dimensions.push(Dimension {
            name,
            symbol,
            min,
            max,
            integer: false,
        });
    }

    /// The side of a variable; the whole line where the box has none.
    pub fn side(&self, symbol: Node) -> (f64, f64) {
        let mut sides = self.region.dimensions.iter();
        sides
            .find(|d| d.symbol == symbol)
            .map_or((f64::NEG_INFINITY, f64::INFINITY), |d| (d.min, d.max))
    }

    /// Variables without bounds that kept something from being bounded, or the
    /// expression itself where every variable has bounds.
    pub fn open(&self) -> Vec<String> {
        self.open.borrow().iter().cloned().collect()
    }

    /// Smallest and largest value.
    pub fn range(&self, node: Node) -> Result<(f64, f64), MissingInput> {
        let found = range_within(self.graph, node, &self.region, CELLS)?;
        let bounds = (found.enclosure.lo(), found.enclosure.hi());
        if bounds.0.is_finite() && bounds.1.is_finite() {
            return Ok(bounds);
        }
        let size = self.of_parts(node)?;
        if !size.is_finite() {
            self.note(node);
        }
        Ok((-size, size))
    }

    /// Largest absolute value.
    pub fn magnitude(&self, node: Node) -> Result<f64, MissingInput> {
        let (low, high) = self.range(node)?;
        Ok(low.abs().max(high.abs()))
    }

    /// Where the whole is too hard, its factors and terms one by one.
    fn of_parts(&self, node: Node) -> Result<f64, MissingInput> {
        let part = |node: Node| self.magnitude_of(node);
        Ok(match self.graph.op(node) {
            Op::Unary(Unary::Neg, a) => part(a)?,
            Op::Binary(Binary::Add | Binary::Sub, a, b) => plus(part(a)?, part(b)?),
            Op::Binary(Binary::Mul, a, b) => times(part(a)?, part(b)?),
            Op::Powi(a, n) if n > 0 => size(part(a)?).powi(n).hi(),
            Op::Entry(system, i) => self.of_solution(node, system, i as usize)?,
            _ => f64::INFINITY,
        })
    }

    /// |x_i| ≤ Σ_j |(A⁻¹)_ij| |b_j| for an entry of the solution of A x = b.
    fn of_solution(&self, node: Node, system: Node, i: usize) -> Result<f64, MissingInput> {
        let Some(system) = self.graph.system(system) else {
            return Ok(f64::INFINITY);
        };
        let (n, A, b) = (system.size(), system.matrix(), system.right());
        let number = |one: bool| self.graph.constant(f64::from(u8::from(one))).node();
        let mut sum = 0.0;
        for (j, &b) in b.iter().enumerate() {
            let unit: Vec<Node> = (0..n).map(|k| number(k == j)).collect();
            let entry = self.graph.solve(A, &unit).x.get(i).copied();
            let size = match entry {
                // it is such an entry itself
                Some(entry) if entry != node => {
                    let found = range_within(self.graph, entry, &self.region, CELLS)?;
                    times(found.enclosure.magnitude(), self.magnitude_of(b)?)
                }
                _ => f64::INFINITY,
            };
            sum = plus(sum, size);
        }
        Ok(if n == 0 { f64::INFINITY } else { sum })
    }

    /// The largest absolute value, of which nothing is noted where there is none.
    fn magnitude_of(&self, node: Node) -> Result<f64, MissingInput> {
        let found = range_within(self.graph, node, &self.region, CELLS)?;
        let size = found.enclosure.magnitude();
        match size.is_finite() {
            true => Ok(size),
            false => self.of_parts(node),
        }
    }

    fn note(&self, node: Node) {
        let used = self.region.restricted(&self.graph.symbols_of(&[node]));
        let sides = used.dimensions.iter().filter(|d| d.name != "time");
        let open = sides.filter(|d| !(d.min.is_finite() && d.max.is_finite()));
        let names: Vec<String> = open.map(|d| d.name.clone()).collect();
        let mut noted = self.open.borrow_mut();
        match names.is_empty() {
            true => {
                noted.insert(self.graph.render(node, 60));
            }
            false => noted.extend(names),
        }
    }

    /// Bounds of the absolute values of the entries.
    pub fn magnitudes(&self, A: &Matrix<'_>) -> Result<Vec<Vec<f64>>, MissingInput> {
        let entry = |i, j| A.get(i, j).map_or(Ok(0.0), |node| self.magnitude(node));
        let row = |i| (0..A.columns).map(|j| entry(i, j)).collect();
        (0..A.rows).map(row).collect()
    }

    /// A bound of the spectral norm.
    pub fn norm(&self, A: &Matrix<'_>) -> Result<f64, MissingInput> {
        Ok(norm(&self.magnitudes(A)?))
    }

    /// What is known of Ã⁻¹ for every Ã whose entries lie in the ranges of those of
    /// the square matrix A, such as a mean of A along a line; none where none could
    /// be found.
    pub fn inverse(&self, A: &Matrix<'_>) -> Result<Option<Inverse>, MissingInput> {
        if A.rows != A.columns {
            return Ok(None);
        }
        let entry = |i, j| A.get(i, j).map_or(Ok((0.0, 0.0)), |node| self.range(node));
        let row = |i: usize| (0..A.columns).map(|j| entry(i, j)).collect();
        let ranges: Vec<Vec<(f64, f64)>> = (0..A.rows).map(row).collect::<Result<_, _>>()?;
        Ok(inverse_of_ranges(&ranges))
    }

    /// Bounds of the entries of B̃ Ã⁻¹ for means of B and A along the same line.
    pub fn divided(&self, B: &Matrix<'_>, A: &Inverse) -> Result<Vec<Vec<f64>>, MissingInput> {
        let n = A.R.len();
        let R = Matrix::from_fn(self.graph, (n, n), |i, j| {
            Some(self.graph.constant(A.R[i][j]).node())
        });
        Ok(product(&self.magnitudes(&B.times(&R))?, &A.N))
    }

    /// A bound of ‖Ã⁻¹‖, infinite where none could be found.
    pub fn inverse_norm(&self, A: &Matrix<'_>) -> Result<f64, MissingInput> {
        let found = self.inverse(A)?;
        Ok(found.map_or(f64::INFINITY, |inverse| norm(&inverse.bounds())))
    }
}

/// Ã = (I + E)R⁻¹ with |E| so small that |(I + E)⁻¹| ≤ N.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Inverse {
    R: Vec<Vec<f64>>,
    N: Vec<Vec<f64>>,
}

impl Inverse {
    /// Bounds of the entries of Ã⁻¹ = R(I + E)⁻¹.
    pub fn bounds(&self) -> Vec<Vec<f64>> {
        let row = |row: &Vec<f64>| row.iter().map(|x| x.abs()).collect();
        product(&self.R.iter().map(row).collect::<Vec<_>>(), &self.N)
    }
}

/// Raised by more than the rounding of a few dozen plain operations on positive numbers
/// has cost.
pub(crate) fn up(x: f64) -> f64 {
    x * (1.0 + GUARD)
}

/// A bound as an interval: an infinite one bounds nothing.
fn size(bound: f64) -> Interval {
    match bound.is_finite() {
        true => Interval::point(bound),
        false => Interval::new(0.0, f64::INFINITY).unwrap_or(Interval::ENTIRE),
    }
}

/// a + b for bounds, rounded up.
pub(crate) fn plus(a: f64, b: f64) -> f64 {
    (size(a) + size(b)).hi()
}

/// The sum of bounds, rounded up.
fn total(bounds: impl Iterator<Item = f64>) -> f64 {
    bounds.fold(0.0, plus)
}

/// a b for bounds, rounded up, of which 0 · ∞ is 0.
pub(crate) fn times(a: f64, b: f64) -> f64 {
    match a == 0.0 || b == 0.0 {
        true => 0.0,
        false => (size(a) * size(b)).hi(),
    }
}

/// √a for a bound, rounded up.
fn root(a: f64) -> f64 {
    size(a).sqrt().hi()
}

/// The product of two matrices of bounds.
pub(crate) fn product(A: &[Vec<f64>], B: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let columns = B.first().map_or(0, Vec::len);
    let entry = |row: &Vec<f64>, j: usize| {
        let terms = row.iter().zip(B);
        total(terms.map(|(a, b)| times(*a, b[j])))
    };
    let row = |row: &Vec<f64>| (0..columns).map(|j| entry(row, j)).collect();
    A.iter().map(row).collect()
}

/// A number for a sentence.
pub(crate) use lynkeus_structure::short as figures;

/// √(Σ x²)
pub(crate) fn length(x: &[f64]) -> f64 {
    root(total(x.iter().map(|x| times(x.abs(), x.abs()))))
}

/// A bound of the spectral norm of every matrix with entries up to these: the
/// smaller of Frobenius' and of √(‖A‖₁ ‖A‖_∞).
pub(crate) fn norm(A: &[Vec<f64>]) -> f64 {
    let frobenius = length(&A.concat());
    let columns = A.first().map_or(0, Vec::len);
    let rows = A.iter().map(|row| total(row.iter().copied()));
    let column = |j: usize| total(A.iter().map(|row| row[j]));
    let largest = |sums: &mut dyn Iterator<Item = f64>| sums.fold(0.0, f64::max);
    let mixed = times(
        largest(&mut rows.into_iter()),
        largest(&mut (0..columns).map(column)),
    );
    frobenius.min(root(mixed))
}

/// What is known of A⁻¹ for every A with entries in the ranges: with
/// R ≈ A_c⁻¹, A_c the middle, and |A R − I| ≤ E of spectral radius below one,
/// |A⁻¹| ≤ |R| (I − E)⁻¹. The inverses are only guessed; that the spectral radius
/// is below one and that the bound is one are checked.
fn inverse_of_ranges(ranges: &[Vec<(f64, f64)>]) -> Option<Inverse> {
    let n = ranges.len();
    let matrix = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        let row = |i| (0..n).map(|j| entry(i, j)).collect();
        (0..n).map(row).collect()
    };
    let one = |i: usize, j: usize| f64::from(u8::from(i == j));
    let middle = matrix(&|i, j| ranges[i][j].0 / 2.0 + ranges[i][j].1 / 2.0);
    let radius = matrix(&|i, j| {
        let (low, high) = ranges[i][j];
        let about = Interval::point(middle[i][j]);
        let (above, below) = (Interval::point(high) - about, about - Interval::point(low));
        above.hi().max(below.hi())
    });
    let R = guessed_inverse(&middle)?;
    let spread = product(&radius, &matrix(&|i, j| R[i][j].abs()));
    let E = matrix(&|i, j| {
        let terms = (0..n).map(|k| Interval::point(middle[i][k]) * Interval::point(R[k][j]));
        let rest = terms.fold(Interval::point(-one(i, j)), |sum, x| sum + x);
        plus(rest.magnitude(), spread[i][j])
    });
    let N = guessed_inverse(&matrix(&|i, j| one(i, j) - E[i][j]))?;
    let v: Vec<f64> = N.iter().map(|row| row.iter().sum()).collect();
    let raised = matrix(&|i, j| N[i][j] + RESERVE * v[i]);
    let positive = v.iter().chain(raised.iter().flatten()).all(|x| *x >= 0.0);
    let covers = |i: usize, j: usize| {
        let mapped = total((0..n).map(|k| times(E[i][k], raised[k][j])));
        (Interval::point(raised[i][j]) - size(mapped)).lo() >= one(i, j)
    };
    let shrinks = |i: usize| v[i] > total((0..n).map(|k| times(E[i][k], v[k])));
    let sure = positive && (0..n).all(|i| shrinks(i) && (0..n).all(|j| covers(i, j)));
    sure.then_some(Inverse { R, N: raised })
}

/// Gauss and Jordan's inverse, without any guarantee.
fn guessed_inverse(A: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = A.len();
    let mut rows: Vec<Vec<f64>> = A.to_vec();
    for (i, row) in rows.iter_mut().enumerate() {
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for k in 0..n {
        let size = |i: &usize| rows[*i][k].abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)))?;
        rows.swap(k, pivot);
        let lead = rows[k].clone();
        if !(lead[k] != 0.0 && lead[k].is_finite()) {
            return None;
        }
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = row[k] / lead[k];
            for (x, l) in row.iter_mut().zip(&lead) {
                *x = if i == k {
                    *l / lead[k]
                } else {
                    *x - factor * l
                };
            }
        }
    }
    let inverse: Vec<Vec<f64>> = rows.into_iter().map(|row| row[n..].to_vec()).collect();
    let finite = inverse.iter().flatten().all(|x| x.is_finite());
    finite.then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wide entry beside the diagonal does no harm.
    #[test]
    fn inverses_of_triangular_ranges() {
        let ranges = [[(1.0, 1.0), (0.0, 0.0)], [(-4.5, 4.5), (-3.25, -1.0)]];
        let ranges = ranges.map(|row| row.to_vec());
        let found = inverse_of_ranges(&ranges).unwrap().bounds();
        assert!((found[0][0] - 1.0).abs() < 1e-6 && found[0][1] < 1e-6);
        assert!((found[1][0] - 4.5).abs() < 1e-6 && (found[1][1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn singular_ranges_have_no_bound() {
        let ranges = [vec![(1.0, 1.0), (0.9, 1.1)], vec![(1.0, 1.0), (1.0, 1.0)]];
        assert_eq!(inverse_of_ranges(&ranges), None);
        assert_eq!(inverse_of_ranges(&[vec![(-1.0, 1.0)]]), None);
    }

    /// Every matrix of the ranges, at their corners.
    #[test]
    fn inverses_lie_inside() {
        let ranges = [
            vec![(1.0, 1.5), (-0.3, 0.2)],
            vec![(0.1, 0.4), (-2.0, -1.0)],
        ];
        let found = inverse_of_ranges(&ranges).unwrap().bounds();
        for corner in 0..16 {
            let pick = |k: usize, (low, high): (f64, f64)| match corner >> k & 1 {
                0 => low,
                _ => high,
            };
            let a: Vec<f64> = ranges
                .concat()
                .iter()
                .enumerate()
                .map(|(k, &r)| pick(k, r))
                .collect();
            let det = a[0] * a[3] - a[1] * a[2];
            let inverse = [[a[3], -a[1]], [-a[2], a[0]]];
            for (i, row) in inverse.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    assert!((x / det).abs() <= found[i][j], "{corner} {i} {j}");
                }
            }
        }
    }
}
