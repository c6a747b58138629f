//! Certified gains on a distillation column of twelve trays, written down by hand: the
//! slope of each tray's equilibrium curve lies in [1/α, α], and the feed's composition
//! is the thirteenth state.
#![allow(non_upper_case_globals)]

use lynkeus_expr::{Budget, Interval};
use lynkeus_proof::decay::{self, Aim, ErrorModel, NoGain, Request, Sector};
use nalgebra::DMatrix;

const TRAYS: usize = 12;
const α: f64 = 1.65;

/// e' = (A₀ + Σ θ_k b_k e_kᵀ) e for a reflux L and a vapour rate V.
fn column(L: f64, V: f64) -> ErrorModel {
    let (n, feed, F) = (TRAYS + 1, 7, 1.65);
    let holdup = |i: usize| if i == 0 || i == TRAYS - 1 { 5.5 } else { 0.55 };
    let mut A = DMatrix::zeros(n, n);
    A[(0, 0)] = -V / holdup(0);
    for i in 1..TRAYS {
        let from_above = if i <= feed { L } else { F + L };
        let down = if i < feed { L } else { F + L };
        A[(i, i - 1)] = from_above / holdup(i);
        A[(i, i)] = -down / holdup(i);
    }
    A[(feed, TRAYS)] = F / holdup(feed);
    A[(TRAYS - 1, TRAYS - 1)] += V / holdup(TRAYS - 1);
    let point = |x: &f64| Interval::point(*x);
    let constant = (0..n)
        .map(|i| A.row(i).iter().map(point).collect())
        .collect();
    let sector = |k: usize| {
        let mut direction = vec![Interval::ZERO; n];
        direction[k - 1] = Interval::point(V / holdup(k - 1));
        direction[k] = Interval::point(-V / holdup(k));
        Sector {
            column: k,
            direction,
            range: Interval::new(1.0 / α, α).unwrap(),
        }
    };
    ErrorModel {
        constant,
        sectors: (1..TRAYS).map(sector).collect(),
    }
}

fn request(rate: f64, aim: Aim) -> Request {
    Request {
        rate,
        measured: vec![0, TRAYS - 1],
        slopes: vec![1.0, 1.0],
        noise: vec![1.0, 1.0],
        scale: vec![1.0; TRAYS + 1],
        aim,
        limit: None,
        budget: Budget::default(),
    }
}

#[test]
fn gains_are_proved_on_the_whole_box() {
    // the largest entries of an independent computation (SDP with trace P + |Y| as its
    // objective) for the same inequality
    for (rate, independent) in [(0.1, 19.2), (0.2, 37.9), (0.5, 251.0)] {
        for aim in [Aim::Noise, Aim::Gain] {
            let found = decay::design(&[column(4.69, 5.94)], &request(rate, aim)).unwrap();
            assert!(
                found.K.amax() <= independent,
                "{rate} {aim:?} {}",
                found.K.amax()
            );
            let corrected = column(4.69, 5.94).corrected(&found.K, &[0, TRAYS - 1]);
            assert!(decay::holds(&[corrected], &found.proof));
        }
    }
}

#[test]
fn a_corrupted_proof_is_rejected() {
    let found = decay::design(&[column(4.69, 5.94)], &request(0.2, Aim::Noise)).unwrap();
    let corrected = [column(4.69, 5.94).corrected(&found.K, &[0, TRAYS - 1])];
    assert!(decay::holds(&corrected, &found.proof));
    let n = found.proof.P.nrows();
    for i in 0..n {
        for j in 0..=i {
            let mut corrupted = found.proof.clone();
            let change = 0.3 * (found.proof.P[(i, i)] * found.proof.P[(j, j)]).sqrt();
            corrupted.P[(i, j)] += change;
            assert!(
                i == j || !decay::holds(&corrected, &corrupted),
                "an unsymmetric P"
            );
            corrupted.P[(j, i)] = corrupted.P[(i, j)];
            assert!(
                !decay::holds(&corrected, &corrupted),
                "P[{i}, {j}] + {change}"
            );
        }
    }
    let mut corrupted = found.proof.clone();
    corrupted.multipliers[0][3] *= -1.0;
    assert!(!decay::holds(&corrected, &corrupted));
    let mut faster = found.proof.clone();
    faster.rate *= 1.5;
    assert!(!decay::holds(&corrected, &faster));
    let mut nan = found.proof;
    nan.P[(0, 0)] = f64::NAN;
    assert!(!decay::holds(&corrected, &nan));
}

#[test]
fn a_limit_below_what_is_possible_says_what_is() {
    let request = Request {
        limit: Some(0.5),
        ..request(0.2, Aim::Noise)
    };
    match decay::design(&[column(4.69, 5.94)], &request) {
        Err(NoGain::Limit(found)) => assert!(found > 0.5 && found < 20.0, "{found}"),
        other => panic!("{other:?}"),
    }
}

/// In other units of the outputs the same gains, each entry divided by its unit: the limit and the
/// smallest largest entry are those of the outputs' own errors.
#[test]
fn a_limit_is_one_of_the_outputs_errors() {
    let models = [column(4.69, 5.94)];
    let least = |slopes: [f64; 2], limit| {
        let request = Request {
            slopes: slopes.to_vec(),
            limit,
            ..request(0.1, Aim::Gain)
        };
        let found = decay::design(&models, &request)?;
        Ok(request.largest(&found.K))
    };
    let plain = least([1.0, 1.0], None).unwrap();
    for c in [0.01, 100.0] {
        let other = least([c, c], None).unwrap();
        assert!(
            (other * c / plain - 1.0).abs() < 0.05,
            "{c} {other} {plain}"
        );
        // what a limit forbids, and what it allows
        assert!(matches!(
            least([c, c], Some(0.3 * plain / c)),
            Err(NoGain::Limit(_))
        ));
        assert!(least([c, c], Some(1.5 * plain / c)).unwrap() <= 1.5 * plain / c);
    }
}

#[test]
fn the_fastest_rate_of_a_gain_is_found_again() {
    let models = [column(4.69, 5.94)];
    let found = decay::design(&models, &request(0.2, Aim::Noise)).unwrap();
    let corrected = [models[0].corrected(&found.K, &[0, TRAYS - 1])];
    let proof = decay::fastest(&corrected, &[1.0; TRAYS + 1], 5.0, &Budget::default()).unwrap();
    assert!(proof.rate >= 0.198, "{}", proof.rate);
}

/// Ranges of L and V as four vertices with one P; 4.81 is the independent computation's.
#[test]
fn flow_rates_may_vary() {
    let ends = [(-0.1, -0.1), (-0.1, 0.1), (0.1, -0.1), (0.1, 0.1)];
    let vertices = ends.map(|(l, v)| column(4.69 + l, 5.94 + v));
    let found = decay::design(&vertices, &request(0.1, Aim::Noise)).unwrap();
    assert!(found.K.amax() < 1.05 * 4.81, "{}", found.K.amax());
    let corrected = vertices.map(|m| m.corrected(&found.K, &[0, TRAYS - 1]));
    assert!(decay::holds(&corrected, &found.proof));
}
