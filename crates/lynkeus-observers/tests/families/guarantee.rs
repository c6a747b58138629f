//! What is certified of an observer as a system, whatever its family.

use crate::common::{design_with, plant};
use lynkeus_observers::drift_observable::DRIFT_OBSERVABLE;
use lynkeus_observers::guarantee::{SampledDecay, between_samples};
use lynkeus_observers::triangular::TRIANGULAR;
use lynkeus_observers::{Assumptions, Certificate, Claim, Tuning, Value, certify};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing};
use lynkeus_words::Words;

/// The certificate of x̂' = −x̂ − f(x̂) − θ(x̂ − y) on x in [0, 2].
fn certified(f: &str) -> Certificate {
    let plant = plant(&format!(
        "model P Real x(start = 0.1, min = 0, max = 2); output Real y = x; equation der(x) = -x - {f}; end P;"
    ));
    let design = design_with(TRIANGULAR, &plant, &[], &Tuning::from([("theta", 3.0)])).unwrap();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region()).unwrap();
    certify(&augmented, &design.observer, &assumptions, Claim::Fastest).unwrap()
}

/// Beyond x = 1.77 the slope of exp(400 x) is no number: nothing is said of every point.
#[test]
fn points_without_eigenvalues_are_not_called_stable() {
    let found = certified("exp(400*x)");
    assert_eq!(found.verdict(), Standing::Undecided);
    let said: Vec<String> = found.notes.iter().map(Words::words).collect();
    let said = said.join("\n");
    assert!(
        !said.contains("at every point") && !said.contains("inf"),
        "{said}"
    );
    // all of them are seen, and more than that is proved
    assert_eq!(certified("exp(x)").verdict(), Standing::Proved);
}

/// Van der Pol's oscillator, its position measured, at a θ: what is proved, and for samples.
fn oscillator(θ: f64) -> (Certificate, Option<SampledDecay>) {
    let plant = plant(
        "model P
          Real x(start = 1, min = -6, max = 6); Real v(start = 0, min = -8, max = 8);
          output Real y = x;
        equation
          der(x) = v; der(v) = (1 - x^2)*v - x;
        end P;",
    );
    let design = design_with(TRIANGULAR, &plant, &[], &Tuning::from([("theta", θ)])).unwrap();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region()).unwrap();
    let observer = &design.observer;
    let found = certify(&augmented, observer, &assumptions, Claim::Fastest).unwrap();
    let sampled = found.rate.and_then(|rate| {
        between_samples(&augmented, observer, &assumptions, rate, None)
            .unwrap()
            .ok()
    });
    (found, sampled)
}

/// The slopes 1 − x² and −2xv − 1 are at their ends together nowhere: at x = 0, where the first one drives, the other one
/// is −1.
#[test]
fn slopes_count_as_they_are_together() {
    let words = |found: &Certificate| {
        let checks = found.hypotheses.iter().map(|check| check.words());
        checks.collect::<Vec<_>>().join("\n")
    };
    let (together, _) = oscillator(6.0);
    assert_eq!(together.verdict(), Standing::Proved, "{}", words(&together));
    assert!(
        words(&together).contains("together"),
        "{}",
        words(&together)
    );
    assert!(together.rate.unwrap() > 0.3, "{:?}", together.rate);
    // where apart they are not too many, together they prove a faster decay: apart it is 7.72
    let (faster, _) = oscillator(16.0);
    assert!(faster.rate.unwrap() > 8.4, "{:?}", faster.rate);
    // or the same, and stay apart
    let (apart, _) = oscillator(30.0);
    assert_eq!(apart.verdict(), Standing::Proved);
    assert!(!words(&apart).contains("together"), "{}", words(&apart));
    // at x = 1, v = -8 the Jacobian has an eigenvalue to the right: no P serves
    assert_eq!(oscillator(3.0).0.verdict(), Standing::Undecided);
}

/// With slopes apart there is no proof for any samples. Together there is, and no run with gaps up to the longest one
/// contradicts it: plant, observer and prediction by Runge and Kutta, for as long as both are in the box.
#[test]
fn samples_count_slopes_as_they_are_together() {
    let θ = 6.0;
    let (_, sampled) = oscillator(θ);
    let found = sampled.unwrap();
    let longest = found.longest;
    assert!(found.together && longest.interval > 0.04, "{longest:?}");
    assert!(longest.interval < found.broken, "{}", found.broken);
    // x, v, their estimates, the prediction
    let slope = |z: &[f64; 5]| {
        let [x, v, a, b, w] = *z;
        let pull = |x: f64, v: f64| (1.0 - x * x) * v - x;
        let off = a - w;
        [
            v,
            pull(x, v),
            b - 2.0 * θ * off,
            pull(a, b) - θ * θ * off,
            b,
        ]
    };
    let step = |z: &[f64; 5], h: f64| {
        let along = |k: &[f64; 5], share: f64| std::array::from_fn(|i| z[i] + share * h * k[i]);
        let a = slope(z);
        let b = slope(&along(&a, 0.5));
        let c = slope(&along(&b, 0.5));
        let d = slope(&along(&c, 1.0));
        std::array::from_fn(|i| z[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
    };
    let P = &longest.lyapunov;
    let height = |z: &[f64; 5]| {
        let [e, f] = [z[2] - z[0], z[3] - z[1]];
        P[(0, 0)] * e * e + 2.0 * P[(0, 1)] * e * f + P[(1, 1)] * f * f
    };
    let inside = |z: &[f64; 5]| {
        [0, 2, 4].iter().all(|&i| z[i].abs() <= 6.0) && z[1].abs().max(z[3].abs()) <= 8.0
    };
    let mut seed = 1_u64;
    let mut unit = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut followed = 0;
    for _ in 0..2000 {
        let mut z: [f64; 5] = std::array::from_fn(|i| [12.0, 16.0][i % 2] * (unit() - 0.5));
        let first = height(&z);
        let mut t = 0.0;
        while t < 20.0 * longest.interval {
            z[4] = z[0];
            let gap = longest.interval * if unit() < 0.5 { 1.0 } else { unit() };
            for _ in 0..10 {
                z = step(&z, gap / 10.0);
            }
            if !inside(&z) {
                break;
            }
            t += gap;
            followed += 1;
            let allowed = first * (-2.0 * longest.rate * t).exp() * (1.0 + 1e-6);
            assert!(height(&z) <= allowed, "{z:?} at {t}");
        }
    }
    assert!(followed > 3000, "{followed}");
}

/// The correction by a linear system with Q(x̂), withdrawn where the factorisation finds Q almost singular: at no point of this
/// box, which the proof has to know.
#[test]
fn observers_that_solve_for_their_correction_have_slopes() {
    let text = include_str!("../../../../examples/predator-prey/predator_prey.mo");
    let text = text
        .replace("min = 0.2, max = 8", "min = 1.5, max = 4.5")
        .replace("min = 0.05, max = 6", "min = 0.6, max = 1.8");
    let plant = plant(&text);
    let poles = Value::List([-2.0, -3.0].map(Value::Number).to_vec());
    let mut tuning = Tuning::default();
    tuning.values.insert("poles".into(), poles);
    let design = design_with(DRIFT_OBSERVABLE, &plant, &[], &tuning).unwrap();
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let assumptions = Assumptions::new(&augmented, augmented.region()).unwrap();
    let observer = &design.observer;
    let found = certify(&augmented, observer, &assumptions, Claim::Fastest).unwrap();
    let rate = found.rate.unwrap();
    // from the eigenvalues at x̂ = x on a grid, with NumPy: the slowest decays at 1.32
    assert!(rate > 0.8 && rate < 1.33, "{rate}");
    let sampled = between_samples(&augmented, observer, &assumptions, rate, None).unwrap();
    assert!(sampled.is_ok_and(|sampled| sampled.longest.interval > 0.1));
}
