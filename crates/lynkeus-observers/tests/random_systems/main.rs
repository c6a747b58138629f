//! Certificates of random small systems against their equations: every proof is
//! confirmed, every refutation reproduced. One false proof fails the build.
#![allow(clippy::unwrap_used)]

mod designed;
mod disturbed;
mod draw;
mod gains;
mod judge;
mod known;
#[path = "../../../../chores/src/numbers.rs"]
mod numbers;
mod pair;
mod plants;
mod published;
mod simulate;
mod terms;

use lynkeus_observers::{Assumptions, Certificate, Claim as Sought, Observer};
use lynkeus_structure::{AugmentedPlant, Standing};
use nalgebra::DMatrix;

use judge::{Claim, Sides};
use numbers::Numbers;
use pair::Pair;

/// How often each verdict was reached, and how much of it was looked at.
#[derive(Debug, Default)]
struct Tally {
    proved: usize,
    refuted: usize,
    undecided: usize,
    /// proved systems whose trajectories stayed in the box for a while
    seen: usize,
}

/// With bounds of what acts on the plant and of the measurement errors.
fn certificate(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    [drift, noise]: [&[f64]; 2],
    sought: Sought,
) -> Certificate {
    let assumptions = Assumptions::new(augmented, augmented.region())
        .unwrap()
        .with_drift(drift.to_vec())
        .with_noise(noise.to_vec());
    lynkeus_observers::certify(augmented, observer, &assumptions, sought).unwrap()
}

/// The system with that number, judged.
fn judged(seed: u64, tally: &mut Tally) {
    let mut numbers = Numbers(seed.wrapping_mul(0x5851_F42D_4C95_7F2D));
    let mut random = plants::random(&mut numbers);
    if numbers.chance(0.8) {
        random = random.at_rest();
    }
    let plant = pair::plant(&random.text());
    let augmented = pair::augmented(&plant);
    let none = DMatrix::zeros(plant.states.len(), plant.outputs.len());
    let copy = pair::observer(&augmented, &none);
    let (states, inputs) = (&random.states, &random.inputs);
    let middle = gains::Middle::new(&mut Pair::new(&augmented, &copy), states, inputs);
    let K = gains::random(&mut numbers, &middle);
    let observer = pair::observer(&augmented, &K);
    let certificate = certificate(&augmented, &observer, [&[], &[]], Sought::Fastest);
    let sides = Sides::new(&certificate, states.len());
    let mut pair = Pair::new(&augmented, &observer);
    let context = Context(format!("system {seed}\n{}K ={K}", random.text()));
    match certificate.verdict() {
        Standing::Proved => {
            assert!(!random.jumps, "a right-hand side that jumps");
            let claim = Claim::new(&certificate);
            judge::secants(&mut pair, &claim, &sides, &mut numbers);
            judge::points(&mut pair, &claim, &sides, &mut numbers);
            let steps = simulate::decay(&mut pair, &claim, &sides, &mut numbers);
            tally.proved += 1;
            tally.seen += usize::from(steps >= 60);
        }
        Standing::Refuted => {
            judge::witness(&mut pair, &certificate, &sides);
            tally.refuted += 1;
        }
        Standing::Undecided => tally.undecided += 1,
    }
    drop(context);
}

/// Printed where a judgement fails inside.
struct Context(String);

impl Drop for Context {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{}", self.0);
        }
    }
}

#[test]
fn every_verdict_on_a_random_system_stands() {
    stand(400);
}

#[test]
#[ignore = "a minute"]
fn every_verdict_on_very_many_random_systems_stands() {
    stand(4000);
}

fn stand(systems: u64) {
    let mut tally = Tally::default();
    let mut failed = vec![];
    for seed in 1..=systems {
        let judgement = std::panic::AssertUnwindSafe(|| judged(seed, &mut tally));
        if std::panic::catch_unwind(judgement).is_err() {
            failed.push(seed);
        }
    }
    assert!(
        failed.is_empty(),
        "{} systems: {failed:?}; {tally:?}",
        failed.len()
    );
    let share = |count: usize| count as f64 / systems as f64;
    assert!(share(tally.proved) >= 0.15, "{tally:?}");
    assert!(share(tally.refuted) >= 0.05, "{tally:?}");
    assert!(share(tally.undecided) >= 0.05, "{tally:?}");
    assert!(2 * tally.seen >= tally.proved, "{tally:?}");
}
