//! What V = e_zᵀP⁻¹e_z says of e where e_z = Q̃ e with a mean Q̃ of Q over the box ([`super::implicit`]).
//!
//! |Q̃e|² in the norm of P⁻¹ is convex in Q̃, and [P Q; Qᵀ κI] > 0 is affine: V ≤ κ|e|² for means if it holds at every point.
//! eᵀJe ≤ κV holds for means if for some matrices N₁ and N₂ the form
//!
//! eᵀJe − κλᵀPλ + 2(λᵀN₁ + eᵀN₂)(Q̃e − e_z),  λ = P⁻¹e_z,
//!
//! is negative definite for Q(ξ) at every point.

use lynkeus_expr::{Budget, Interval};
use nalgebra::DMatrix;

use super::implicit::{blocks, form_of};
use super::together::{Covered, Field, covered, first_points, points_of};
use crate::ellipsoid::Ellipsoid;
use crate::lmi::{Affine, Problem};
use crate::matrix::{IntervalMatrix, points, square};
use crate::spectrum;

/// Points of the box that bounds are proposed for.
const POINTS: usize = 33;
/// What is added to a bound before it is tried, again and again.
const RESERVES: [f64; 4] = [1.02, 1.1, 1.3, 2.0];
/// What J is more by while N is sought, relatively.
const MARGIN: f64 = 0.03;
/// Bounds beyond this are not sought, where one for the first Q alone would be 1.
const LARGEST: f64 = 1e3;
/// Parts that may be examined for one bound.
const PARTS: usize = 3_000;

/// Bounds of e by V, and of V by e.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// √V is at most this times |e|
    pub form: f64,
    /// |e| is at most this times √V
    pub whole: f64,
    /// and every entry of e at most this times √V
    pub entries: Vec<f64>,
}

impl Reach {
    /// For a field [F R; −I Q] of which Q counts; none where a bound is not proved.
    pub fn of(field: &Field<'_>, ellipsoid: &Ellipsoid, budget: &Budget) -> Option<Self> {
        let P = &ellipsoid.P;
        let n = P.nrows();
        let at = first_points(&field.sides, POINTS).into_iter();
        let all: Vec<IntervalMatrix> = at.map(|point| (field.on)(&points_of(&point))).collect();
        let of_e = |J: &DMatrix<f64>| by_form(field, P, J, &all, budget);
        let unit = |j: usize| {
            let mut J = DMatrix::zeros(n, n);
            J[(j, j)] = 1.0;
            J
        };
        let whole = of_e(&DMatrix::identity(n, n))?;
        // an entry is never more than all of e
        let entry = |j: usize| Some(of_e(&unit(j))?.min(whole));
        Some(Self {
            form: of_form(field, P, &all, budget)?,
            whole,
            entries: (0..n).map(entry).collect::<Option<_>>()?,
        })
    }
}

/// The first bound, each a little larger, for which the form D + He(L A R) is negative everywhere; its root.
fn proved(
    field: &Field<'_>,
    guess: f64,
    A: &IntervalMatrix,
    [L, R]: [&DMatrix<f64>; 2],
    D: &dyn Fn(f64) -> IntervalMatrix,
    budget: &Budget,
) -> Option<f64> {
    RESERVES.iter().find_map(|reserve| {
        let κ = guess * reserve;
        let form = form_of([L, R], &D(κ), A)?;
        let found = covered(field, Some(form), &mut PARTS.clone(), budget);
        matches!(found, Covered::By(_)).then(|| Interval::point(κ).sqrt().hi())
    })
}

/// √V/|e| at most.
fn of_form(
    field: &Field<'_>,
    P: &DMatrix<f64>,
    all: &[IntervalMatrix],
    budget: &Budget,
) -> Option<f64> {
    let n = P.nrows();
    let inverse = P.clone().cholesky()?.inverse();
    let largest = all.iter().map(|A| {
        let [_, _, _, Q] = blocks(A);
        Some(
            spectrum::symmetric(Q.transpose() * &inverse * Q)?
                .eigenvalues
                .max(),
        )
    });
    let guess = largest.reduce(|a, b| Some(a?.max(b?)))??;
    // of (λ, e): −2λᵀQe
    let L = DMatrix::from_fn(2 * n, 2 * n, |i, j| if j == i + n { -1.0 } else { 0.0 });
    let R = DMatrix::from_fn(
        2 * n,
        2 * n,
        |i, j| if i == j && i >= n { 1.0 } else { 0.0 },
    );
    let D = |κ: f64| {
        square(2 * n, |i, j| match (i < n, j < n) {
            (true, true) => -Interval::point(P[(i, j)]),
            (false, false) if i == j => -Interval::point(κ),
            _ => Interval::ZERO,
        })
    };
    proved(field, guess, all.first()?, [&L, &R], &D, budget)
}

/// √(eᵀJe/V) at most.
fn by_form(
    field: &Field<'_>,
    P: &DMatrix<f64>,
    J: &DMatrix<f64>,
    all: &[IntervalMatrix],
    budget: &Budget,
) -> Option<f64> {
    let n = P.nrows();
    // e_z = C z′, e = Y C e′ with P = C Cᵀ and the inverse Y of the first Q: both are about as large as √V
    let C = P.clone().cholesky()?.l();
    let inverse = C.clone().try_inverse()?;
    let [_, _, _, Q] = blocks(all.first()?);
    let YC = Q.try_inverse()? * &C;
    let seen = YC.transpose() * J * &YC;
    let size = spectrum::symmetric(seen.clone())?.eigenvalues.max();
    let mut problem = Problem::new(budget);
    let κ = problem.diagonal(1);
    let [N1, N2] = [0, 1].map(|_| problem.matrix(n, n));
    // a little more in every direction, so that parts of the box have a margin
    let seen = Affine::constant(&(seen / size + DMatrix::identity(n, n) * MARGIN));
    for A in all {
        let [_, _, _, Q] = blocks(A);
        let Q = &inverse * Q * &YC;
        let corner = Affine::multiple_of_identity(&κ, n)
            .scaled(-1.0)
            .minus(&N1.he());
        let mixed = N1.times(&Q).minus(&N2.transposed());
        let of_e = seen.plus(&N2.times(&Q).he());
        let whole = Affine::symmetric_blocks(&corner, &mixed, &of_e);
        problem.positive(whole.scaled(-1.0));
    }
    // a start further out is too far from the minimum
    problem.positive(Affine::identity(1).scaled(LARGEST).minus(&κ));
    problem.minimise(&κ);
    let found = problem.solve().ok()?;
    let guess = κ.at(&found)[(0, 0)] * size;
    let [N1, N2] = [N1, N2].map(|N| N.at(&found) * &inverse * size);
    let N1 = P * inverse.transpose() * N1;
    let N2 = YC.try_inverse()?.transpose() * N2;
    let L = DMatrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (_, true) => 0.0,
        (true, false) => N1[(i, j - n)],
        (false, false) => N2[(i - n, j - n)],
    });
    let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
    let R = DMatrix::from_fn(2 * n, 2 * n, |i, j| match i < n && j < n {
        true => P[(i, j)],
        false => unit(i, j),
    });
    let (P, J) = (points(P), points(J));
    let D = |κ: f64| {
        square(2 * n, |i, j| match (i < n, j < n) {
            (true, true) => -(Interval::point(κ) * P[i][j]),
            (false, false) => J[i - n][j - n],
            _ => Interval::ZERO,
        })
    };
    proved(field, guess, all.first()?, [&L, &R], &D, budget)
}
