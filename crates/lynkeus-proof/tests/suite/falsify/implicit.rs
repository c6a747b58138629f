//! Decay in coordinates of which only the Jacobian is known, at means over random segments.

use lynkeus_expr::{Budget, Interval};
use lynkeus_proof::decay::{
    Covered, Field, ImplicitProof, Reach, fastest_implicit, holds_implicit,
};
use nalgebra::{DMatrix, Matrix2, Vector2};

use super::{Random, largest};

/// z₁ = x₁, z₂ = x₂ + a x₁x₂ + b x₂² + c x₁² with z₁' = z₂ − k₁z₁, z₂' = −k₂z₁ + p x₁²x₂ + q x₁x₂ + s x₂² + w x₂ on
/// |x₁|, |x₂| ≤ 1.
struct Plant {
    map: [f64; 3],
    rest: [f64; 4],
    poles: [f64; 2],
}

impl Plant {
    fn random(random: &mut Random) -> Self {
        let slow = random.within(0.5, 4.0);
        Self {
            map: [0.4, 0.25, 1.5].map(|size| random.within(-size, size)),
            rest: [1.0, 1.5, 1.0, 2.0].map(|size| random.within(-size, size)),
            poles: [slow, slow * random.within(1.1, 3.0)],
        }
    }

    fn gain(&self) -> [f64; 2] {
        let [a, b] = self.poles;
        [a + b, a * b]
    }

    /// [F R; −I Q] at x, or on a part of the box.
    fn matrix(&self, x: &[Interval]) -> Vec<Vec<Interval>> {
        let number = Interval::point;
        let ([a, b, c], [p, q, s, w]) = (self.map.map(number), self.rest.map(number));
        let [k1, k2] = self.gain().map(number);
        let (x1, x2, two) = (x[0], x[1], number(2.0));
        let (zero, one) = (Interval::ZERO, Interval::ONE);
        vec![
            vec![-k1, one, zero, zero],
            vec![
                -k2,
                zero,
                two * p * x1 * x2 + q * x2,
                p * x1.powi(2) + q * x1 + two * s * x2 + w,
            ],
            vec![-one, zero, one, zero],
            vec![
                zero,
                -one,
                a * x2 + two * c * x1,
                one + a * x1 + two * b * x2,
            ],
        ]
    }

    /// F + R̃Q̃⁻¹ and Q̃ for the means over a segment: Simpson's rule is exact for these polynomials.
    fn mean(&self, from: [f64; 2], to: [f64; 2]) -> [Matrix2<f64>; 2] {
        let mut sum = DMatrix::<f64>::zeros(4, 4);
        for (t, weight) in [(0.0, 1.0), (0.5, 4.0), (1.0, 1.0)] {
            let x = [0, 1].map(|i| Interval::point(from[i] + t * (to[i] - from[i])));
            let A = self.matrix(&x);
            sum += DMatrix::from_fn(4, 4, |i, j| A[i][j].midpoint()) * (weight / 6.0);
        }
        let block = |i: usize, j: usize| Matrix2::from_fn(|k, l| sum[(2 * i + k, 2 * j + l)]);
        let Q = block(1, 1);
        [block(0, 0) + block(0, 1) * Q.try_inverse().unwrap(), Q]
    }
}

fn faster(field: &Field<'_>, proof: &ImplicitProof) -> ImplicitProof {
    let (mut low, mut high) = (proof.rate, 2.0 * proof.rate);
    for _ in 0..7 {
        let rate = 0.5 * (low + high);
        let tried = ImplicitProof {
            rate,
            ..proof.clone()
        };
        match holds_implicit(field, &tried, &Budget::default()) {
            Covered::By(_) => low = rate,
            _ => high = rate,
        }
    }
    ImplicitProof {
        rate: low,
        ..proof.clone()
    }
}

#[test]
fn implicit_decay_stands_means_over_segments() {
    let mut random = Random::new(7);
    let (mut proved, mut tight, mut near) = (0, 0, 0);
    for _ in 0..24 {
        let plant = Plant::random(&mut random);
        let on = |part: &[Interval]| plant.matrix(part);
        let side = Interval::new(-1.0, 1.0).unwrap();
        let field = Field {
            on: &on,
            slopes: None,
            sides: vec![side, side],
        };
        let Some((found, _)) = fastest_implicit(&field, &[1.0, 1.0], 0.0, &Budget::default())
        else {
            continue;
        };
        proved += 1;
        let hardest = faster(&field, &found);
        let P = Matrix2::from_fn(|i, j| hardest.P[(i, j)]);
        let mut worst = f64::NEG_INFINITY;
        let inverse = P.try_inverse().unwrap();
        let ellipsoid = found.ellipsoid().unwrap();
        let reach = Reach::of(&field, &ellipsoid, &Budget::default()).unwrap();
        let mut reached = [0.0_f64; 4];
        for _ in 0..2000 {
            let [from, to] = [0, 1].map(|_| [0, 1].map(|_| random.of_range(-1.0, 1.0)));
            let [A, Q] = plant.mean(from, to);
            // of V = eᵀP⁻¹e in the coordinates P⁻¹e
            let form = A * P + P * A.transpose() + P * (2.0 * hardest.rate);
            let form = DMatrix::from_fn(2, 2, |i, j| form[(i, j)] / (P[(i, i)] * P[(j, j)]).sqrt());
            worst = worst.max(largest(&form));
            for e in [[to[0] - from[0], to[1] - from[1]], [1.0, 0.0], [0.0, 1.0]] {
                let e = Vector2::from(e);
                let root = (Q * e).dot(&(inverse * Q * e)).sqrt();
                let sizes = [
                    root / (reach.form * e.norm()),
                    e.norm() / (reach.whole * root),
                    e[0].abs() / (reach.entries[0] * root),
                    e[1].abs() / (reach.entries[1] * root),
                ];
                // a segment of one point has no size
                for (most, size) in reached.iter_mut().zip(sizes) {
                    *most = most.max(size);
                }
            }
        }
        assert!(reached.iter().all(|most| *most <= 1.0), "{reached:?}");
        near += usize::from(reached.iter().all(|most| *most > 0.5));
        assert!(worst < 1e-10, "{worst:e} at {}", hardest.rate);
        tight += usize::from(worst > -0.3 * hardest.rate);
    }
    assert!(
        proved >= 10 && tight >= 3 && 2 * near > proved,
        "{proved} {tight} {near}"
    );
}
