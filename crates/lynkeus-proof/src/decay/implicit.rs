//! Decay in coordinates z = Φ(x) of which only the Jacobian Q is known: one P for all of a box of x.
//!
//! z' = F z + r(x) with an error e of x and e_z = Φ(x + e) − Φ(x) of z. By the mean value theorem along the segment
//! from x to x + e
//!
//! e_z' = F e_z + R̃ e, e_z = Q̃ e
//!
//! with means R̃ and Q̃ of ∂r/∂x and Q over one and the same segment. R̃Q̃⁻¹ is no mean of anything, and a box around it
//! forgets most of what is known. But the two equations are affine in the means. For V = e_zᵀP⁻¹e_z, λ = P⁻¹e_z and any
//! matrices N₁ and N₂
//!
//! V' + 2αV = 2λᵀ(F e_z + R̃ e) + 2αλᵀPλ + 2(λᵀN₁ + eᵀN₂)(Q̃ e − e_z),
//!
//! the last term being zero (Finsler's lemma; for P, N₁ and N₂ in place of P⁻¹ it is the inequality of descriptor systems).
//! That is a form in (λ, e), affine in R̃ and Q̃, which is negative definite for the means if it is so for R(ξ) and Q(ξ) at
//! every ξ of the box:
//!
//! He( [I N₁; 0 N₂] [F R; −I Q] [P 0; 0 I] ) + 2α [P 0; 0 0] < 0.

use lynkeus_expr::{Budget, Interval};
use nalgebra::DMatrix;

use super::ErrorModel;
use super::check::is_form;
use super::frame::Frame;
use super::together::{
    Covered, Fallen, Field, Form, PARTS, Search, Sought, covered, in_the_middle,
};
use crate::definite::is_positive_definite;
use crate::ellipsoid::Ellipsoid;
use crate::lmi::{Affine, Problem};
use crate::lyapunov::symmetric;
use crate::matrix::{IntervalMatrix, points, square};
use crate::spectrum;

/// Entries of z for which a proof is sought: the solver's work grows with the sixth power.
const STATES: usize = 8;
/// Parts that may be examined in all of a search: its matrices are twice as large as those of z.
const ALL_PARTS: usize = 12_000;

/// What makes V = e_zᵀP⁻¹e_z fall.
#[derive(Clone, Debug, PartialEq)]
pub struct ImplicitProof {
    /// V' ≤ −2·rate·V
    pub rate: f64,
    /// P, n×n
    pub P: DMatrix<f64>,
    /// N₁ above N₂, 2n×n
    pub N: DMatrix<f64>,
}

/// Whether V falls for every [F R(ξ); −I Q(ξ)] of a box. Nothing but P, N, the rate and interval arithmetic decides.
pub fn holds_implicit(field: &Field<'_>, proof: &ImplicitProof, budget: &Budget) -> Covered {
    let form = form(&proof.P, &proof.N, proof.rate, &in_the_middle(field));
    let mut left = PARTS;
    covered(field, form, &mut left, budget)
}

/// The fastest decay from a rate on that is proved on the box, for z of such sizes, with the number of its parts; none where nothing that fast
/// is. The field's matrix is [F R; −I Q].
pub fn fastest_implicit(
    field: &Field<'_>,
    sizes: &[f64],
    least: f64,
    budget: &Budget,
) -> Option<(ImplicitProof, usize)> {
    if sizes.len() > STATES {
        return None;
    }
    let mut search = Search::new(field, Implicit(sizes), ALL_PARTS, budget);
    let each = search.points().iter().map(|A| decay(&explicit(A)?));
    let limit = each.reduce(|a, b| Some(a?.min(b?)))??;
    if limit <= least.max(0.0) {
        return None;
    }
    search.fastest(least, limit).map(proof)
}

/// A proof of decay at a rate on the box, likewise.
pub fn prove_implicit(
    field: &Field<'_>,
    sizes: &[f64],
    rate: f64,
    budget: &Budget,
) -> Option<(ImplicitProof, usize)> {
    if sizes.len() > STATES {
        return None;
    }
    Search::new(field, Implicit(sizes), ALL_PARTS, budget)
        .prove(rate, rate.abs())
        .map(proof)
}

impl ImplicitProof {
    /// P with bounds of its eigenvalues; none where they have none that is proved.
    pub fn ellipsoid(&self) -> Option<Ellipsoid> {
        Ellipsoid::of(self.P.clone(), self.rate)
    }
}

fn proof(((P, N), rate, parts): Fallen<(DMatrix<f64>, DMatrix<f64>)>) -> (ImplicitProof, usize) {
    (ImplicitProof { rate, P, N }, parts)
}

/// The form of the inequality, in axes in which it is −1 for the given [F R; −I Q]; none where it is not negative there.
fn form(P: &DMatrix<f64>, N: &DMatrix<f64>, rate: f64, A: &IntervalMatrix) -> Option<Form> {
    let n = P.nrows();
    let is_sound = is_form(P)
        && N.shape() == (2 * n, n)
        && A.len() == 2 * n
        && N.iter().all(|entry| entry.is_finite())
        && rate.is_finite()
        && is_positive_definite(&points(P));
    if !is_sound {
        return None;
    }
    let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
    let left = DMatrix::from_fn(2 * n, 2 * n, |i, j| match j < n {
        true => unit(i, j),
        false => N[(i, j - n)],
    });
    let right = DMatrix::from_fn(2 * n, 2 * n, |i, j| match i < n && j < n {
        true => P[(i, j)],
        false => unit(i, j),
    });
    let twice = Interval::point(2.0) * Interval::point(rate);
    let falling = square(2 * n, |i, j| match i < n && j < n {
        true => twice * Interval::point(P[(i, j)]),
        false => Interval::ZERO,
    });
    form_of([&left, &right], &falling, A)
}

/// D + He(L A R) in axes in which it is −1 for the given A; none where it is not negative there.
pub(super) fn form_of(
    [L, R]: [&DMatrix<f64>; 2],
    D: &IntervalMatrix,
    A: &IntervalMatrix,
) -> Option<Form> {
    let middle = L * numbers(A) * R;
    let value = -(&middle + middle.transpose() + numbers(D));
    let T = value.cholesky()?.l().transpose().try_inverse()?;
    Some(Form::of([L, R], D, &T))
}

/// F, R, −I and Q, in numbers.
pub(super) fn blocks(A: &IntervalMatrix) -> [DMatrix<f64>; 4] {
    let (n, A) = (A.len() / 2, numbers(A));
    [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| A.view((i * n, j * n), (n, n)).into_owned())
}

fn numbers(A: &IntervalMatrix) -> DMatrix<f64> {
    DMatrix::from_fn(A.len(), A.len(), |i, j| A[i][j].midpoint())
}

/// F + R Q⁻¹
fn explicit(A: &IntervalMatrix) -> Option<DMatrix<f64>> {
    let [F, R, _, Q] = blocks(A);
    let found = F + R * Q.try_inverse()?;
    found.iter().all(|entry| entry.is_finite()).then_some(found)
}

/// The slowest decay among the eigenvalues.
fn decay(A: &DMatrix<f64>) -> Option<f64> {
    let each = spectrum::eigenvalues(A.clone())?;
    Some(each.iter().fold(f64::INFINITY, |least, λ| least.min(-λ.re)))
}

/// P and N for z of such sizes.
struct Implicit<'a>(&'a [f64]);

impl Sought for Implicit<'_> {
    type Found = (DMatrix<f64>, DMatrix<f64>);

    fn propose(&self, given: &[IntervalMatrix], rate: f64, budget: &Budget) -> Option<Self::Found> {
        let model = |A: &IntervalMatrix| {
            let constant = points(&explicit(A)?);
            let sectors = vec![];
            Some(ErrorModel { constant, sectors })
        };
        let models: Vec<ErrorModel> = given.iter().map(model).collect::<Option<_>>()?;
        let natural = Frame::natural(&models, self.0).into_iter();
        let mut frames = natural.chain([Frame::plain(&models, self.0)]);
        frames.find_map(|frame| proposed(&frame, given, rate, budget))
    }

    fn form(&self, (P, N): &Self::Found, rate: f64, A: &IntervalMatrix) -> Option<Form> {
        form(P, N, rate, A)
    }
}

/// P and N for these [F R; −I Q], sought as P⁻¹, N₁ and N₂ in the axes z = W z′, e = Y W e′, where Y is the inverse of the
/// first Q.
fn proposed(
    frame: &Frame,
    given: &[IntervalMatrix],
    rate: f64,
    budget: &Budget,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let n = frame.sizes.len();
    let [_, _, _, Q] = blocks(given.first()?);
    let Y = Q.try_inverse()?;
    let (W, inverse) = frame.widened(&[]);
    let YW = &Y * &W;
    let mut problem = Problem::new(budget);
    let S = problem.symmetric(n);
    let [N1, N2] = [0, 1].map(|_| problem.matrix(n, n));
    problem.positive(S.clone());
    problem.positive(Affine::identity(n).minus(&S));
    for A in given {
        if problem.is_spent() {
            return None;
        }
        let [F, R, _, Q] = blocks(A);
        let F = &inverse * F * &W * frame.unit;
        let R = &inverse * R * &YW * frame.unit;
        let Q = &inverse * Q * &YW;
        let of_z = S.times(&F).minus(&N1).he();
        let of_z = of_z.plus(&S.scaled(2.0 * rate * frame.unit));
        let mixed = S.times(&R).plus(&N1.times(&Q)).minus(&N2.transposed());
        let whole = Affine::symmetric_blocks(&of_z, &mixed, &N2.times(&Q).he());
        problem.positive(whole.scaled(-1.0));
    }
    let found = problem.inside().ok()?;
    let S = symmetric(&S.at(&found));
    let P = symmetric(&(&W * S.try_inverse()? * W.transpose()));
    let [N1, N2] = [N1, N2].map(|N| N.at(&found) * &inverse / frame.unit);
    let N1 = &P * inverse.transpose() * N1;
    let N2 = YW.try_inverse()?.transpose() * N2;
    let N = DMatrix::from_fn(2 * n, n, |i, j| match i < n {
        true => N1[(i, j)],
        false => N2[(i - n, j)],
    });
    Some((P, N))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(low: f64, high: f64) -> Interval {
        Interval::new(low, high).unwrap()
    }

    /// z₁ = x₁, z₂ = x₂ + 0.8 sin x₁ in place of x₂, with z₂' = −k₂z₁ − sin x₁ − x₂: as functions of z the slopes of what is left are
    /// (−0.2 cos z₁, −1).
    fn turned(part: &[Interval]) -> IntervalMatrix {
        let (zero, one) = (Interval::ZERO, Interval::ONE);
        let slope = part[0].cos();
        vec![
            vec![Interval::point(-3.0), one, zero, zero],
            vec![Interval::point(-2.0), zero, -slope, -one],
            vec![-one, zero, one, zero],
            vec![zero, -one, Interval::point(0.8) * slope, one],
        ]
    }

    fn explicit_field(part: &[Interval]) -> IntervalMatrix {
        vec![
            vec![Interval::point(-3.0), Interval::ONE],
            vec![
                Interval::point(-2.0) - Interval::point(0.2) * part[0].cos(),
                -Interval::ONE,
            ],
        ]
    }

    fn field(on: &dyn Fn(&[Interval]) -> IntervalMatrix) -> Field<'_> {
        Field {
            on,
            slopes: None,
            sides: vec![side(-3.0, 3.0)],
        }
    }

    #[test]
    fn it_is_what_the_slopes_by_the_coordinates_prove() {
        let budget = Budget::default();
        let (found, _) = fastest_implicit(&field(&turned), &[1.0, 1.0], 0.0, &budget).unwrap();
        let by_slopes = super::super::fastest_together(
            &field(&explicit_field),
            &[1.0, 1.0],
            (0.0, 3.0),
            &budget,
        );
        let rate = by_slopes.unwrap().proof.rate;
        assert!(
            (found.rate / rate - 1.0).abs() < 0.1,
            "{} {rate}",
            found.rate
        );
        let ellipsoid = found.ellipsoid().unwrap();
        assert!(ellipsoid.α == found.rate && ellipsoid.smallest > 0.0);
        assert!(matches!(
            holds_implicit(&field(&turned), &found, &budget),
            Covered::By(_)
        ));
    }

    #[test]
    fn what_is_no_proof_holds_nowhere() {
        let budget = Budget::default();
        let field = field(&turned);
        let (found, _) = fastest_implicit(&field, &[1.0, 1.0], 0.0, &budget).unwrap();
        let with = |P: DMatrix<f64>, N: DMatrix<f64>, rate: f64| {
            let proof = ImplicitProof { P, N, rate };
            holds_implicit(&field, &proof, &budget)
        };
        let ImplicitProof { P, N, rate } = found;
        let wrong = [
            with(-&P, N.clone(), rate),
            with(P.clone(), -&N, rate),
            with(P.clone(), N.clone() * f64::NAN, rate),
            with(P.clone(), N.clone(), f64::INFINITY),
            with(P.clone(), DMatrix::zeros(4, 1), rate),
            with(DMatrix::identity(3, 3), DMatrix::zeros(6, 3), rate),
            // the slowest eigenvalue of all is 1.5 or less
            with(P, N, 2.0),
        ];
        for covered in wrong {
            assert!(!matches!(covered, Covered::By(_)), "{covered:?}");
        }
    }

    /// Where Q is singular for some mean, nothing is proved, whatever it is at the ends.
    #[test]
    fn a_map_that_folds_has_no_proof() {
        let folds = |part: &[Interval]| {
            vec![
                vec![-Interval::ONE, Interval::ZERO],
                vec![-Interval::ONE, Interval::point(2.0) * part[0]],
            ]
        };
        let found = fastest_implicit(&field(&folds), &[1.0], 0.0, &Budget::default());
        assert_eq!(found, None);
    }
}
