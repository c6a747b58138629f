//! Plant and observer in time: classical Runge–Kutta steps, inputs that switch.

use nalgebra::DVector;

use crate::judge::{Claim, Sides};
use crate::numbers::Numbers;
use crate::pair::Pair;

/// Starts per system.
const STARTS: usize = 4;
const STEPS: usize = 200;
/// |J|·step
const PRODUCT: f64 = 0.1;
/// What a step may add to V, relative: the error of the method at this product.
const INTEGRATION: f64 = 1e-6;
/// A step that looks too large is looked at in pieces, this often: at a kink the method
/// is of low order.
const REFINEMENTS: usize = 4;
/// Errors below this share of the start drown in rounding.
const SMALL: f64 = 1e-7;

/// Steps compared.
pub fn decay(pair: &mut Pair, claim: &Claim, sides: &Sides, numbers: &mut Numbers) -> usize {
    let h = PRODUCT / pace(pair, sides, numbers);
    (0..STARTS)
        .map(|_| {
            // deep inside, so that something is seen before the box is left
            let depth = numbers.between(0.1, 1.0);
            let inner: Vec<(f64, f64)> = sides.states.iter().map(|s| shrunk(s, depth)).collect();
            let (x, hat) = (numbers.inside(&inner), numbers.inside(&inner));
            one(pair, claim, sides, numbers, h, [x, hat])
        })
        .sum()
}

pub fn shrunk(&(low, high): &(f64, f64), depth: f64) -> (f64, f64) {
    let (middle, half) = (f64::midpoint(low, high), 0.5 * depth * (high - low));
    (middle - half, middle + half)
}

/// The largest norm of the Jacobian at a few points.
pub fn pace(pair: &mut Pair, sides: &Sides, numbers: &mut Numbers) -> f64 {
    let mut largest = 1.0_f64;
    for _ in 0..20 {
        let t = numbers.between(-20.0, 20.0);
        let (x, u) = (numbers.inside(&sides.states), numbers.inside(&sides.inputs));
        let norm = pair.jacobian(t, &x, &u).norm();
        largest = largest.max(if norm.is_finite() { norm } else { 0.0 });
    }
    largest
}

fn one(
    pair: &mut Pair,
    claim: &Claim,
    sides: &Sides,
    numbers: &mut Numbers,
    h: f64,
    [mut x, mut hat]: [Vec<f64>; 2],
) -> usize {
    let mut t = numbers.between(-5.0, 5.0);
    let mut u = numbers.inside(&sides.inputs);
    let start = claim.V(&difference(&x, &hat));
    for step in 0..STEPS {
        if numbers.chance(0.03) {
            u = numbers.inside(&sides.inputs);
        }
        let before = claim.V(&difference(&x, &hat));
        if before <= SMALL * SMALL * start {
            return step;
        }
        let Some(next) = stepped(pair, t, h, &u, [&x, &hat], sides) else {
            return step;
        };
        let allowed = before * (-2.0 * claim.rate * h).exp() * (1.0 + INTEGRATION);
        let after = claim.V(&difference(&next[0], &next[1]));
        if after > allowed {
            let finer = in_pieces(pair, t, h, &u, [&x, &hat], sides);
            let after = finer.map_or(0.0, |[x, hat]| claim.V(&difference(&x, &hat)));
            assert!(
                after <= allowed,
                "V from {before} to {after}, allowed {allowed}, over {h} from t = {t}, x = {x:?}, estimate {hat:?}, u = {u:?}"
            );
        }
        [x, hat] = next;
        t += h;
    }
    STEPS
}

pub fn difference(x: &[f64], hat: &[f64]) -> DVector<f64> {
    DVector::from_iterator(x.len(), hat.iter().zip(x).map(|(a, b)| a - b))
}

/// The same step in ever smaller pieces; none where that leaves the box.
fn in_pieces(
    pair: &mut Pair,
    t: f64,
    h: f64,
    u: &[f64],
    [x, hat]: [&[f64]; 2],
    sides: &Sides,
) -> Option<[Vec<f64>; 2]> {
    let pieces = 1 << (3 * REFINEMENTS);
    let h = h / f64::from(pieces);
    let mut now = [x.to_vec(), hat.to_vec()];
    for piece in 0..pieces {
        let at = t + f64::from(piece) * h;
        now = stepped(pair, at, h, u, [&now[0], &now[1]], sides)?;
    }
    Some(now)
}

/// One step; none where a stage or its end is outside the box.
fn stepped(
    pair: &mut Pair,
    t: f64,
    h: f64,
    u: &[f64],
    [x, hat]: [&[f64]; 2],
    sides: &Sides,
) -> Option<[Vec<f64>; 2]> {
    let moved = |x: &[f64], k: &DVector<f64>, h: f64| -> Vec<f64> {
        x.iter().zip(k.iter()).map(|(x, k)| x + h * k).collect()
    };
    let (mut sum, mut sum_hat) = (DVector::zeros(x.len()), DVector::zeros(x.len()));
    let (mut k, mut k_hat) = (DVector::zeros(x.len()), DVector::zeros(x.len()));
    for (place, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        let stage = [moved(x, &k, place * h), moved(hat, &k_hat, place * h)];
        if !stage.iter().all(|x| sides.hold(x)) {
            return None;
        }
        (k, k_hat) = pair.both(t + place * h, &stage[0], &stage[1], u);
        sum += &k * weight;
        sum_hat += &k_hat * weight;
    }
    let next = [moved(x, &sum, h / 6.0), moved(hat, &sum_hat, h / 6.0)];
    next.iter().all(|x| sides.hold(x)).then_some(next)
}
