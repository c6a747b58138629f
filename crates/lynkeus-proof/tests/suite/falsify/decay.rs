//! Decay of uncertain error systems, and the Riccati inequality.

use lynkeus_expr::{Budget, Interval};
use lynkeus_proof::decay::{self, ErrorModel, Proof, Sector};
use lynkeus_proof::riccati;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::matrices::around;
use super::{Random, largest};

/// More than the rounding of an eigenvalue of a matrix of size one.
const ROUNDING: f64 = 1e-11;

/// n states, damped so that about half of the models can be proved.
fn model(random: &mut Random) -> ErrorModel {
    let n = 2 + random.below(3);
    let damped = random.matrix(n, 1.0) - DMatrix::identity(n, n) * random.within(0.5, 3.0);
    let radius = if random.below(2) == 0 { 0.0 } else { 0.05 };
    let entry = |x: f64| Interval::new(x - radius, x + radius).unwrap();
    let constant = (0..n).map(|i| damped.row(i).iter().map(|&x| entry(x)).collect());
    let mut sector = || {
        let middle = random.within(-1.0, 1.0);
        let half = random.within(0.0, 1.5);
        Sector {
            column: random.below(n),
            direction: (0..n).map(|_| entry(random.within(-1.0, 1.0))).collect(),
            range: Interval::new(middle - half, middle + half).unwrap(),
        }
    };
    let sectors = vec![sector(), sector(), sector()];
    ErrorModel {
        constant: constant.collect(),
        sectors,
    }
}

/// A(θ) for one choice within every interval of the model.
fn member(model: &ErrorModel, random: &mut Random) -> DMatrix<f64> {
    let mut pick = |x: &Interval| random.of_range(x.lo(), x.hi());
    let n = model.size();
    let mut A = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..n {
            A[(i, j)] = pick(&model.constant[i][j]);
        }
    }
    for sector in &model.sectors {
        let θ = pick(&sector.range);
        for i in 0..n {
            A[(i, sector.column)] += θ * pick(&sector.direction[i]);
        }
    }
    A
}

/// The largest eigenvalue of He(PA) + 2·rate·P relative to the sizes.
fn growth(P: &DMatrix<f64>, A: &DMatrix<f64>, rate: f64) -> f64 {
    let form = P * A + A.transpose() * P + P * (2.0 * rate);
    largest(&form) / (P.norm() * (1.0 + A.norm() + rate.abs()))
}

/// The proof of the largest rate that the check accepts for this P.
fn hardest(models: &[ErrorModel], proof: &Proof) -> Proof {
    let (mut low, mut high) = (proof.rate, proof.rate.abs() + 10.0);
    for _ in 0..60 {
        let rate = 0.5 * (low + high);
        let faster = Proof {
            rate,
            ..proof.clone()
        };
        match decay::holds(models, &faster) {
            true => low = rate,
            false => high = rate,
        }
    }
    Proof {
        rate: low,
        ..proof.clone()
    }
}

#[test]
fn proved_decay_stands_random_members() {
    let mut random = Random::new(1);
    let mut proved = 0;
    for _ in 0..60 {
        let model = model(&mut random);
        let n = model.size();
        // the vertices give other inequalities than the multipliers
        let models = match random.below(2) {
            0 => vec![model.clone()],
            _ => decay::expanded(std::slice::from_ref(&model), 8),
        };
        let Some(found) = decay::fastest(&models, &vec![1.0; n], 5.0, &Budget::default()) else {
            continue;
        };
        proved += 1;
        assert!(decay::holds(&models, &found));
        let hardest = hardest(&models, &found);
        assert!(hardest.rate >= found.rate);
        assert!(found.P.clone().symmetric_eigenvalues().min() > 0.0);
        for _ in 0..200 {
            let A = member(&model, &mut random);
            let growth = growth(&hardest.P, &A, hardest.rate);
            assert!(growth < ROUNDING, "{growth:e} for {A}");
            // no Lyapunov function promises more than the slowest eigenvalue
            let slowest = A
                .complex_eigenvalues()
                .iter()
                .map(|λ| λ.re)
                .fold(f64::NEG_INFINITY, f64::max);
            assert!(hardest.rate < -slowest + 1e-6, "{} {slowest}", hardest.rate);
        }
    }
    assert!(proved >= 15, "{proved} of 60 models");
}

/// Where a member is unstable nothing is proved, and where one lies outside of the stable
/// ones by little the check does not say otherwise.
#[test]
fn nothing_is_proved_of_a_family_with_an_unstable_member() {
    let mut random = Random::new(2);
    let mut attacked = 0;
    for _ in 0..60 {
        let model = model(&mut random);
        let unstable = (0..50).any(|_| {
            let eigenvalues = member(&model, &mut random).complex_eigenvalues();
            eigenvalues.iter().any(|λ| λ.re > 1e-9)
        });
        if unstable {
            attacked += 1;
            let scale = vec![1.0; model.size()];
            assert!(decay::prove(&[model], &scale, 0.0, &Budget::default()).is_none());
        }
    }
    assert!(attacked >= 10, "{attacked}");
}

#[test]
fn unstable_is_said_of_no_family_with_a_stable_member() {
    let mut random = Random::new(3);
    let (mut said, mut stable) = (0, 0);
    for _ in 0..300 {
        let n = 2 + random.below(4);
        let middle = random.matrix(n, 1.0) - DMatrix::identity(n, n) * random.within(-0.5, 1.0);
        let radius = random.within(0.0, 0.2);
        let entry = |x: &f64| Interval::new(x - radius, x + radius).unwrap();
        let rows: Vec<Vec<Interval>> = middle
            .row_iter()
            .map(|row| row.iter().map(entry).collect())
            .collect();
        let verdict = decay::is_unstable(&rows);
        said += usize::from(verdict);
        for _ in 0..30 {
            let A = DMatrix::from_fn(n, n, |i, j| {
                random.of_range(rows[i][j].lo(), rows[i][j].hi())
            });
            let slowest = A
                .complex_eigenvalues()
                .iter()
                .map(|λ| λ.re)
                .fold(f64::NEG_INFINITY, f64::max);
            stable += usize::from(slowest < -1e-9);
            assert!(!(verdict && slowest < -1e-9), "{slowest} {A}");
        }
    }
    assert!(said >= 50 && stable >= 500, "{said} {stable}");
}

#[test]
fn riccati_solutions_satisfy_the_inequality() {
    let mut random = Random::new(4);
    let mut proved = 0;
    for _ in 0..80 {
        let n = 2 + random.below(3);
        let A = random.matrix(n, 1.0) - DMatrix::identity(n, n) * 2.0;
        let E = random.matrix(n, 0.5);
        let γ = random.within(0.0, 1.5);
        let Some(found) = riccati::fastest(&A, &E, γ, 2.0) else {
            continue;
        };
        proved += 1;
        let P = found.P.clone();
        let form = &A * &P
            + &P * A.transpose()
            + &E * E.transpose()
            + &P * (2.0 * found.α)
            + &P * &P * (γ * γ);
        assert!(largest(&form) < ROUNDING * (1.0 + P.norm()), "{form}");
        let values = P.clone().symmetric_eigenvalues();
        assert!(values.max() <= found.largest && values.min() >= found.smallest);
        assert!((values.max() / values.min()).sqrt() <= found.peak());
        for _ in 0..20 {
            let f = DVector::from_fn(n, |_, _| random.within(-1.0, 1.0));
            let exact = f.dot(&P.clone().lu().solve(&f).unwrap()).sqrt();
            let bound = found.weight(f.as_slice());
            assert!(exact <= bound * (1.0 + ROUNDING) && bound <= exact * (1.0 + 1e-5));
            assert!(exact <= found.weight_of_length(f.norm()) * (1.0 + ROUNDING));
        }
    }
    assert!(proved >= 30, "{proved} of 80");
}

proptest! {
    /// It agrees with the eigenvalues wherever these are clear, and never says more.
    #[test]
    fn instability_agrees_with_eigenvalues(
        entries in proptest::collection::vec(-1.0_f64..1.0, 25),
        shift in -3.0_f64..2.0,
        radius in prop_oneof![Just(0.0), 0.0_f64..0.2],
    ) {
        let A = DMatrix::from_vec(5, 5, entries) + DMatrix::identity(5, 5) * shift;
        let highest = |A: &DMatrix<f64>| {
            A.complex_eigenvalues().iter().map(|λ| λ.re).fold(f64::NEG_INFINITY, f64::max)
        };
        let verdict = decay::is_unstable(&around(&A, radius));
        // the matrix shifted by the radius lies within the entries, too
        let least = highest(&A) - radius;
        if least < -1e-9 {
            prop_assert!(!verdict, "{least}");
        }
        if radius == 0.0 && least > 1e-3 {
            prop_assert!(verdict, "{least}");
        }
    }
}
