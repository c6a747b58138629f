//! (17) of Hammouri, Targui and Armanet (2002) for chains of any length, at a cost that grows with the length and not with the
//! number of vertices of the bounds.
//!
//! −P(a) has in its column j, down to the diagonal, a_{j−1} times three numbers (S is
//! tridiagonal): it is pentadiagonal. Eliminating the states from the sensor on, all that
//! the next column meets is the Schur complement T on the last two states, a 2×2 matrix.
//! Schur complements are monotone and concave in the Loewner order, so
//!
//! * the two ends of a_{j−1} decide (concave, and affine in a_{j−1} before),
//! * of two matrices T ≤ T' only T counts (monotone),
//! * any lower bound of several may stand for them.
//!
//! The first two lose nothing; the third is used where more than `MOST` are left.

use lynkeus_expr::Interval;

use crate::Bounds;

/// Lower bounds kept beside each other. A chain of seven states, with the ends of six partials, is decided
/// exactly; one of nine mostly, as few of its ends count.
const MOST: usize = 64;
/// A common lower bound is taken this much smaller, so that rounding does not spoil it.
const SHRUNK: f64 = 1.0 - 1e-9;

/// The column of a state in −P(a), per unit of its partial.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// two rows above the diagonal
    pub far: Interval,
    /// one row above
    pub near: Interval,
    /// on the diagonal
    pub own: Interval,
}

/// The columns of −D⁻¹PD⁻¹ from the second state on for a tridiagonal S, D² = diag S, where
/// P = AᵀS + SA has (SA)_ij = S_{i,j−1} a_{j−1}.
pub fn columns(n: usize, S: impl Fn(usize, usize) -> Interval) -> Vec<Column> {
    let weight = |j: usize| S(j, j).sqrt();
    let entry = |i: usize, j: usize, row: usize| S(i, j) / (weight(row) * weight(j + 1));
    let column = |j: usize| Column {
        far: match j {
            1 => Interval::ZERO,
            _ => entry(j - 2, j - 1, j - 2),
        },
        near: entry(j - 1, j - 1, j - 1),
        own: Interval::point(-2.0) * entry(j, j - 1, j),
    };
    (1..n).map(column).collect()
}

/// [t11, t12; t12, t22], a lower bound of the Schur complement on the last two states.
#[derive(Clone, Copy, Debug)]
struct Tail([f64; 3]);

fn difference(a: f64, b: f64) -> Interval {
    Interval::point(a) - Interval::point(b)
}

impl Tail {
    /// Below every symmetric matrix with entries in the enclosures: what the corner entry
    /// is off by goes to the diagonal, in proportion to it.
    fn below([p, o, d]: [Interval; 3]) -> Self {
        let middle = o.midpoint();
        let off = difference(o.hi(), middle)
            .hi()
            .max(difference(middle, o.lo()).hi());
        let ratio = Some((p.lo() / d.lo()).sqrt());
        let ratio = ratio.filter(|ratio| ratio.is_finite() && *ratio > 0.0);
        let ratio = ratio.unwrap_or(1.0);
        let less = |x: f64, share: f64| {
            (Interval::point(x) - Interval::point(off) * Interval::point(share)).lo()
        };
        // 1/ratio rounded up, so that the product of the shares is at least one
        let inverse = (Interval::ONE / Interval::point(ratio)).hi();
        Self([less(p.lo(), ratio), middle, less(d.lo(), inverse)])
    }

    /// self ≥ other, proved.
    fn above(&self, other: &Self) -> bool {
        let [x, y, z] = [0, 1, 2].map(|i| difference(self.0[i], other.0[i]));
        x.lo() >= 0.0 && z.lo() >= 0.0 && (x * z - y.powi(2)).lo() >= 0.0
    }

    fn positive(&self) -> bool {
        let [x, y, z] = self.0.map(Interval::point);
        x.is_positive() && z.is_positive() && (x * z - y.powi(2)).is_positive()
    }

    /// The next state in, the first of the two out; `shift` is taken from its diagonal.
    fn next(&self, column: &Column, a: f64, shift: f64) -> Self {
        let ([x, y, z], a) = (self.0.map(Interval::point), Interval::point(a));
        let far = a * column.far;
        let share = y / x;
        Self::below([
            z - y.powi(2) / x,
            share * far - a * column.near,
            a * column.own - Interval::point(shift) - far.powi(2) / x,
        ])
    }

    /// cᵀT⁻¹c, from above.
    fn cross(&self, c: [Interval; 2]) -> f64 {
        let [x, y, z] = self.0.map(Interval::point);
        let adjugate = c[0].powi(2) * z - Interval::point(2.0) * c[0] * c[1] * y + c[1].powi(2) * x;
        (adjugate / (x * z - y.powi(2))).hi()
    }

    /// A lower bound of both, the largest in the coordinates that make both diagonal.
    fn common(&self, other: &Self) -> Self {
        let found = smaller(self.0, other.0);
        if found.positive() && self.above(&found) && other.above(&found) {
            return found;
        }
        let hull = |i: usize| Interval::point(self.0[i]).hull(Interval::point(other.0[i]));
        Self::below([hull(0), hull(1), hull(2)])
    }
}

/// L min(W, I) Lᵀ with A = LLᵀ and W = L⁻¹BL⁻ᵀ, in floating point.
fn smaller(A: [f64; 3], B: [f64; 3]) -> Tail {
    let l11 = A[0].sqrt();
    let l21 = A[1] / l11;
    let l22 = (A[2] - l21 * l21).sqrt();
    let w11 = B[0] / A[0];
    let b = B[1] / l11;
    let w12 = (b - l21 * w11) / l22;
    let w22 = (B[2] - 2.0 * l21 * b + l21 * l21 * w11) / (l22 * l22);
    let (mean, half) = (0.5 * (w11 + w22), 0.5 * (w11 - w22));
    let radius = half.hypot(w12);
    let (m1, m2) = ((mean + radius).min(1.0), (mean - radius).min(1.0));
    let (s, c) = (0.5 * w12.atan2(half)).sin_cos();
    let n11 = m1 * c * c + m2 * s * s;
    let n12 = (m1 - m2) * c * s;
    let n22 = m1 * s * s + m2 * c * c;
    let M = [
        A[0] * n11,
        l11 * (l21 * n11 + l22 * n12),
        l21 * l21 * n11 + 2.0 * l21 * l22 * n12 + l22 * l22 * n22,
    ];
    Tail(M.map(|x| SHRUNK * x))
}

/// Lower bounds for all partials so far.
#[derive(Clone, Debug)]
pub struct Tails(Vec<Tail>);

impl Tails {
    /// The first state, of which nothing else is read.
    pub fn start(first: Interval) -> Self {
        Self(vec![Tail([1.0, 0.0, first.lo()])])
    }

    /// With one more state.
    pub fn grown(&self, column: &Column, bounds: Bounds, shift: f64) -> Self {
        let next = |&tail: &Tail| ends(bounds).map(move |a| tail.next(column, a, shift));
        Self(self.0.iter().flat_map(next).collect()).pruned()
    }

    /// Whether −P is positive definite so far, for every partial within its bounds.
    pub fn positive(&self) -> bool {
        self.0.iter().all(Tail::positive)
    }

    /// A bound of cᵀ(−P)⁻¹c for a c with entries at the last two states.
    pub fn cross(&self, c: [Interval; 2]) -> f64 {
        self.0.iter().fold(0.0, |m: f64, tail| m.max(tail.cross(c)))
    }

    fn pruned(self) -> Self {
        let mut least = minimal(self.0);
        while least.len() > MOST {
            let slope = |t: &Tail| t.0[1] / (t.0[0] * t.0[2]).sqrt();
            least.sort_by(|a, b| slope(a).total_cmp(&slope(b)));
            let pairs = least.chunks(2).map(|pair| match pair {
                [a, b] => a.common(b),
                _ => pair[0],
            });
            least = minimal(pairs.collect());
        }
        Self(least)
    }
}

fn minimal(all: Vec<Tail>) -> Vec<Tail> {
    let mut least: Vec<Tail> = vec![];
    for tail in all {
        if !least.iter().any(|other| tail.above(other)) {
            least.retain(|other| !other.above(&tail));
            least.push(tail);
        }
    }
    least
}

fn ends(bounds: Bounds) -> impl Iterator<Item = f64> {
    let other = (bounds.upper > bounds.lower).then_some(bounds.upper);
    std::iter::once(bounds.lower).chain(other)
}

/// Whether a matrix with `first` in its corner and these columns, the first one that of the
/// second state, is positive definite by more than `shift` times the identity, for all
/// partials within their bounds. False may also mean: not proved.
pub fn positive(first: Interval, columns: &[Column], bounds: &[Bounds], shift: f64) -> bool {
    let mut tails = Tails::start(first - Interval::point(shift));
    for (k, (column, b)) in columns.iter().zip(bounds).enumerate() {
        if !tails.positive() {
            return false;
        }
        // nothing stands two rows above the second state
        let far = if k == 0 { Interval::ZERO } else { column.far };
        tails = tails.grown(&Column { far, ..*column }, *b, shift);
    }
    tails.positive()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    fn column([far, near, own]: [f64; 3]) -> Column {
        let [far, near, own] = [far, near, own].map(Interval::point);
        Column { far, near, own }
    }

    /// −P(a) as a matrix.
    fn matrix(first: f64, columns: &[[f64; 3]], a: &[f64]) -> DMatrix<f64> {
        let n = columns.len() + 1;
        DMatrix::from_fn(n, n, |i, j| {
            let (i, j) = (i.min(j), i.max(j));
            match (j, j - i) {
                (0, _) => first,
                (_, 0) => a[j - 1] * columns[j - 1][2],
                (_, 1) => -a[j - 1] * columns[j - 1][1],
                (_, 2) => -a[j - 1] * columns[j - 1][0],
                _ => 0.0,
            }
        })
    }

    fn least_eigenvalue(first: f64, columns: &[[f64; 3]], bounds: &[Bounds]) -> f64 {
        let vertex = |choice: usize| {
            let a: Vec<f64> = bounds
                .iter()
                .enumerate()
                .map(|(i, b)| {
                    if choice >> i & 1 == 1 {
                        b.upper
                    } else {
                        b.lower
                    }
                })
                .collect();
            matrix(first, columns, &a).symmetric_eigenvalues().min()
        };
        (0..1 << bounds.len())
            .map(vertex)
            .fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        /// Against all vertices: never more than the least eigenvalue, and for chains that
        /// need no common lower bounds just that.
        #[test]
        fn it_is_what_the_vertices_say(
            chain in prop::collection::vec((-0.4..0.4f64, -0.9..0.9f64, 1.0..2.0f64, 1.0..2.0f64), 1..8)
        ) {
            let columns: Vec<[f64; 3]> = chain.iter().map(|&(f, n, o, _)| [f, n, o]).collect();
            let bounds: Vec<Bounds> = chain
                .iter()
                .map(|&(.., upper)| Bounds { lower: 1.0, upper })
                .collect();
            let exact = least_eigenvalue(1.0, &columns, &bounds);
            let enclosed: Vec<Column> = columns.iter().map(|&c| column(c)).collect();
            let holds = |shift: f64| positive(Interval::ONE, &enclosed, &bounds, shift);
            prop_assert!(!holds(exact + 1e-9));
            if 1 << columns.len() <= MOST {
                prop_assert!(holds(exact - 1e-9));
            }
        }
    }
}
