//! The judgement of certificates: by the equations alone, without the code that made
//! them.

use lynkeus_observers::Certificate;
use lynkeus_structure::{Point, Verdict};
use nalgebra::{DMatrix, DVector};

use crate::numbers::Numbers;
use crate::pair::{Pair, abscissa};

/// Pairs of plant and estimate at which V' is computed.
const SECANTS: usize = 150;
/// Points at which the largest eigenvalue of PJ + JᵀP + 2·rate·P is computed.
const POINTS: usize = 60;
/// Rounding of sums of a few dozen numbers, relative to their size.
const ROUNDING: f64 = 1e-12;

/// The box of a certificate, as states and inputs.
pub struct Sides {
    pub states: Vec<(f64, f64)>,
    pub inputs: Vec<(f64, f64)>,
}

impl Sides {
    pub fn new(certificate: &Certificate, states: usize) -> Self {
        let sides = certificate.region.iter();
        let all: Vec<(f64, f64)> = sides.map(|s| (s.min, s.max)).collect();
        Self {
            states: all[..states].to_vec(),
            inputs: all[states..].to_vec(),
        }
    }

    /// Whether a state or an estimate is inside.
    pub fn hold(&self, x: &[f64]) -> bool {
        let pairs = x.iter().zip(&self.states);
        pairs
            .into_iter()
            .all(|(x, (low, high))| low <= x && x <= high)
    }
}

/// A proof: V = eᵀPe, V' ≤ −2·rate·V.
pub struct Claim {
    pub P: DMatrix<f64>,
    pub rate: f64,
}

impl Claim {
    pub fn new(certificate: &Certificate) -> Self {
        let P = certificate.lyapunov.clone().unwrap();
        let rate = certificate.rate.unwrap();
        assert!(
            rate > 0.0 && P.clone().cholesky().is_some(),
            "{certificate:?}"
        );
        Self { P, rate }
    }

    pub fn V(&self, e: &DVector<f64>) -> f64 {
        e.dot(&(&self.P * e))
    }
}

/// V' at pairs in the box, near and far apart: half of it must be at most −rate·V.
pub fn secants(pair: &mut Pair, claim: &Claim, sides: &Sides, numbers: &mut Numbers) {
    for _ in 0..SECANTS {
        let t = numbers.between(-20.0, 20.0);
        let u = numbers.inside(&sides.inputs);
        let x = numbers.inside(&sides.states);
        let other = numbers.inside(&sides.states);
        let share = if numbers.chance(0.5) {
            1.0
        } else {
            numbers.size(1e-4, 1.0)
        };
        let hat: Vec<f64> = x
            .iter()
            .zip(&other)
            .map(|(x, o)| x + share * (o - x))
            .collect();
        let (plant, observer) = pair.both(t, &x, &hat, &u);
        let e = DVector::from_iterator(x.len(), hat.iter().zip(&x).map(|(a, b)| a - b));
        let Pe = &claim.P * &e;
        let half = Pe.dot(&(&observer - &plant)) + claim.rate * Pe.dot(&e);
        let size = claim.P.norm() * e.norm() * (observer.norm() + plant.norm() + 1.0);
        assert!(
            half <= ROUNDING * size,
            "V'/2 + rate·V = {half} at t = {t}, x = {x:?}, estimate {hat:?}, u = {u:?}"
        );
    }
}

/// The inequality at points, by the Jacobian.
pub fn points(pair: &mut Pair, claim: &Claim, sides: &Sides, numbers: &mut Numbers) {
    for _ in 0..POINTS {
        let t = numbers.between(-20.0, 20.0);
        let (x, u) = (numbers.inside(&sides.states), numbers.inside(&sides.inputs));
        let J = pair.jacobian(t, &x, &u);
        let PJ = &claim.P * &J;
        let decay = &PJ + PJ.transpose() + &claim.P * (2.0 * claim.rate);
        let largest = decay.clone().symmetric_eigenvalues().max();
        let size = claim.P.norm() * (J.norm() + claim.rate);
        assert!(
            largest <= ROUNDING * size,
            "an eigenvalue is {largest} at t = {t}, x = {x:?}, u = {u:?}"
        );
    }
}

/// The witness of a refutation: inside the box, the error's Jacobian there has an
/// eigenvalue with the stated positive real part, by differences of the observer's
/// right-hand side; and it stays the Jacobian, since the plant rests there or since it is
/// the same everywhere.
pub fn witness(pair: &mut Pair, certificate: &Certificate, sides: &Sides) {
    let refuted = certificate
        .hypotheses
        .iter()
        .filter_map(|c| match &c.verdict {
            Verdict::Refuted(witness) => Some(witness),
            _ => None,
        });
    let found: Vec<&Point> = refuted.flat_map(|w| &w.points).collect();
    let [point] = found[..] else {
        panic!("{found:?}")
    };
    let value = |name: &String| {
        let mut coordinates = point.coordinates.iter();
        coordinates.find(|c| c.name == *name).map(|c| c.value)
    };
    let named = certificate.region.iter().map(|s| value(&s.name).unwrap());
    let mut x: Vec<f64> = named.collect();
    let u = x.split_off(pair.states);
    // a plant that time does not move needs none
    let t = value(&"time".to_owned()).unwrap_or(1e3);
    assert!(sides.hold(&x), "outside the box: {x:?}");
    let within = u
        .iter()
        .zip(&sides.inputs)
        .all(|(u, (low, high))| low <= u && u <= high);
    assert!(within, "outside the box: {u:?}");
    assert!(point.value > 0.0, "{}", point.value);
    let J = pair.jacobian(t, &x, &u);
    let pace = pair.plant(t, &x, &u).amax();
    let rests = pace <= 1e-8 * (1.0 + J.norm());
    let everywhere = (1..=8).all(|k| {
        let share = f64::from(k) / 9.0;
        let pairs = sides.states.iter().zip(&x);
        let other: Vec<f64> = pairs
            .map(|((low, high), x)| x + share * (if k % 2 == 0 { high } else { low } - x))
            .collect();
        let ends = sides.inputs.iter().zip(&u);
        let inputs: Vec<f64> = ends
            .map(|((low, high), u)| u + share * (if k % 2 == 0 { high } else { low } - u))
            .collect();
        (pair.jacobian(t + f64::from(k), &other, &inputs) - &J).norm() <= 1e-9 * J.norm()
    });
    assert!(
        rests || everywhere,
        "moves at t = {t}, x = {x:?}, u = {u:?}"
    );
    let best = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7]
        .map(|step| pair.differences(t, &x, &u, step))
        .into_iter()
        .filter(|J| J.iter().all(|x| x.is_finite()))
        .map(|J| (abscissa(&J) - point.value).abs())
        .fold(f64::INFINITY, f64::min);
    assert!(
        best <= 1e-6 * point.value.max(1e-3 * J.norm()),
        "off by {best} from {} at t = {t}, x = {x:?}, u = {u:?}",
        point.value
    );
}
