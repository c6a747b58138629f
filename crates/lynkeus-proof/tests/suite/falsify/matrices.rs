//! Inverses, definiteness and norms of interval matrices.

use lynkeus_expr::Interval;
use lynkeus_proof::definite::{is_positive_definite, least_eigenvalue};
use lynkeus_proof::inverse::{self, Inverse};
use lynkeus_proof::magnitude;
use lynkeus_proof::matrix::{IntervalMatrix, square};
use lynkeus_proof::metzler;
use nalgebra::DMatrix;

use proptest::prelude::*;

use super::Random;

pub fn around(middle: &DMatrix<f64>, radius: f64) -> IntervalMatrix {
    square(middle.nrows(), |i, j| {
        Interval::new(middle[(i, j)] - radius, middle[(i, j)] + radius).unwrap()
    })
}

fn member(matrix: &IntervalMatrix, random: &mut Random) -> DMatrix<f64> {
    let n = matrix.len();
    DMatrix::from_fn(n, n, |i, j| {
        random.of_range(matrix[i][j].lo(), matrix[i][j].hi())
    })
}

fn symmetric_member(matrix: &IntervalMatrix, random: &mut Random) -> DMatrix<f64> {
    let lower = member(matrix, random);
    DMatrix::from_fn(matrix.len(), matrix.len(), |i, j| {
        lower[(i.max(j), i.min(j))]
    })
}

#[test]
fn inverses_of_members_lie_within_the_bounds() {
    let mut random = Random::new(10);
    let (mut bounded, mut tight) = (0, 0);
    for _ in 0..300 {
        let n = 1 + random.below(5);
        let radius = [0.0, 1e-9, 0.01, 0.1, 0.4][random.below(5)];
        let matrix = around(&random.matrix(n, 1.0), radius);
        let Some(found) = Inverse::of(&matrix) else {
            continue;
        };
        bounded += 1;
        let bounds = found.bounds();
        for _ in 0..100 {
            let A = member(&matrix, &mut random);
            let inverse = A.try_inverse().unwrap();
            let slack = 1e-10 * inverse.amax().powi(2);
            for i in 0..n {
                for j in 0..n {
                    let (x, bound) = (inverse[(i, j)].abs(), bounds[i][j]);
                    assert!(x <= bound + slack, "{x} {bound} at {i}, {j}");
                    tight += usize::from(radius == 0.0 && bound < x * (1.0 + 1e-6) + 1e-6);
                }
            }
        }
    }
    assert!(bounded >= 150 && tight >= 1000, "{bounded} {tight}");
}

/// A singular member: no bound exists.
#[test]
fn families_with_a_singular_member_have_no_inverse() {
    let mut random = Random::new(11);
    for _ in 0..300 {
        let n = 1 + random.below(5);
        let mut singular = random.matrix(n, 1.0);
        // the last row is the sum of the others, up to rounding, which the radius covers
        for j in 0..n {
            singular[(n - 1, j)] = (0..n - 1).map(|i| singular[(i, j)]).sum();
        }
        let radius = 10f64.powf(random.within(-14.0, -1.0));
        assert_eq!(Inverse::of(&around(&singular, radius)), None, "{singular}");
    }
}

#[test]
fn definite_families_have_no_eigenvalue_below_the_bound() {
    let mut random = Random::new(12);
    let mut proved = 0;
    for _ in 0..300 {
        let n = 1 + random.below(5);
        let root = random.matrix(n, 1.0);
        let shift = random.within(-0.5, 1.0);
        let middle = &root * root.transpose() + DMatrix::identity(n, n) * shift;
        let radius = [0.0, 1e-6, 0.05, 0.3][random.below(4)];
        let matrix = around(&middle, radius);
        let bound = least_eigenvalue(&matrix, f64::INFINITY);
        assert_eq!(bound.is_some(), is_positive_definite(&matrix));
        let diagonal = bound.and_then(|_| inverse::diagonal(&matrix));
        proved += usize::from(bound.is_some());
        for _ in 0..100 {
            let A = symmetric_member(&matrix, &mut random);
            let least = A.clone().symmetric_eigenvalues().min();
            if let Some(bound) = bound {
                assert!(least >= bound - 1e-12, "{least} {bound}");
            }
            if let Some(diagonal) = &diagonal {
                let inverse = A.try_inverse().unwrap();
                let fine = |i: usize| inverse[(i, i)] <= diagonal[i] * (1.0 + 1e-9);
                assert!((0..n).all(fine));
            }
        }
    }
    assert!(proved >= 100, "{proved}");
}

#[test]
fn norms_and_radii_are_upper_bounds() {
    let mut random = Random::new(13);
    for _ in 0..300 {
        let n = 1 + random.below(5);
        let bounds = square(n, |i, j| ((i * 7 + j * 3) % 5) as f64).into_iter();
        let bounds: Vec<Vec<f64>> = bounds
            .map(|row| row.into_iter().map(|x| x * random.unit()).collect())
            .collect();
        let (radius, sharp, coarse) = (
            metzler::spectral_radius(&bounds),
            metzler::spectral_norm(&bounds),
            magnitude::norm(&bounds),
        );
        assert!(sharp <= coarse * (1.0 + 1e-3), "{sharp} {coarse}");
        for _ in 0..30 {
            let A = DMatrix::from_fn(n, n, |i, j| random.of_range(-bounds[i][j], bounds[i][j]));
            let norm = A.clone().svd(false, false).singular_values.max();
            assert!(norm <= sharp * (1.0 + 1e-12) + 1e-300, "{norm} {sharp}");
            let values = A.complex_eigenvalues();
            let largest = values.iter().map(|λ| λ.norm()).fold(0.0, f64::max);
            // a computed eigenvalue of a defective matrix has half of its digits or fewer
            assert!(
                largest <= radius * (1.0 + 1e-9) + 1e-3,
                "{largest} {radius}"
            );
        }
    }
}

/// −M of a comparison matrix that is accepted has positive eigenvalues only.
#[test]
fn accepted_comparison_matrices_are_negative_definite() {
    let mut random = Random::new(14);
    let (mut accepted, mut missed) = (0, 0);
    for _ in 0..500 {
        let n = 1 + random.below(5);
        let off = random.matrix(n, 1.0).abs();
        let shift = random.within(0.5, 3.0);
        let M = DMatrix::from_fn(n, n, |i, j| match i == j {
            true => -shift,
            false => off[(i.max(j), i.min(j))],
        });
        let top = M.clone().symmetric_eigenvalues().max();
        let verdict = metzler::is_negative_definite(&square(n, |i, j| M[(i, j)]));
        accepted += usize::from(verdict);
        assert!(!verdict || top < 1e-13, "{top}");
        missed += usize::from(!verdict && top < -1e-9);
    }
    assert!(accepted >= 100 && missed == 0, "{accepted} {missed}");
}

proptest! {
    /// The verdict agrees with the eigenvalues wherever these are clear.
    #[test]
    fn the_verdict_agrees_with_eigenvalues(
        entries in proptest::collection::vec(-1.0_f64..1.0, 36),
        shift in -3.0_f64..6.0,
        radius in 0.0_f64..0.05,
    ) {
        let square = DMatrix::from_vec(6, 6, entries);
        let matrix = (&square + square.transpose()) * 0.5 + DMatrix::identity(6, 6) * shift;
        let smallest = matrix.symmetric_eigenvalues().min();
        let verdict = is_positive_definite(&around(&matrix, radius));
        // some matrix within the radius has an eigenvalue lower by it
        if smallest <= radius {
            prop_assert!(!verdict, "smallest eigenvalue {smallest}, radius {radius}");
        }
        if radius == 0.0 && smallest > 1e-9 {
            prop_assert!(verdict, "smallest eigenvalue {smallest}");
        }
    }
}
