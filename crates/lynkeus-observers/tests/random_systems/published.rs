//! Observers of the papers, with gains that depend on the estimate, on time, or on
//! limited errors: the same judgement.

use lynkeus_observers::{
    Claim as Sought, Family, Tuning, Value, block_triangular::BLOCK_TRIANGULAR,
    triangular::TRIANGULAR,
};
use lynkeus_structure::Standing;

use crate::designed::chain;
use crate::judge::{self, Claim, Sides};
use crate::numbers::Numbers;
use crate::pair::{self, Pair};
use crate::{Context, simulate};

const OBSERVERS: u64 = 120;

/// A family with keys that make its right-hand side more than a constant gain.
fn tuned(numbers: &mut Numbers) -> (&'static dyn Family, Tuning) {
    let θ = numbers.size(0.5, 8.0);
    let mut tuning = Tuning::from([("theta", θ)]);
    let mut with = |key: &str, value: Value| {
        tuning.values.insert(key.to_owned(), value);
    };
    let family: &'static dyn Family = match numbers.below(13) {
        0..3 => TRIANGULAR,
        3..6 => {
            with("partials", Value::Flag(true));
            TRIANGULAR
        }
        6..9 => {
            let keys = [("theta", 0.5 * θ), ("until", 1.0)];
            let keys = keys.map(|(key, x)| (key.to_owned(), Value::Number(x)));
            with("transient", Value::Table(keys.into()));
            TRIANGULAR
        }
        9..12 => {
            with("innovation_limit", Value::Number(numbers.size(0.05, 2.0)));
            TRIANGULAR
        }
        // rarely: the slopes of its gain take long to enclose
        _ => BLOCK_TRIANGULAR,
    };
    (family, tuning)
}

/// The verdict on an observer, judged; none where the family does not take the plant.
fn judged(seed: u64) -> Option<Standing> {
    let mut numbers = Numbers(seed.wrapping_mul(0xD6E8_FEB8_6659_FD93));
    let random = chain(&mut numbers).at_rest();
    let (family, tuning) = tuned(&mut numbers);
    let context = Context(format!("observer {seed}, {tuning:?}\n{}", random.text()));
    let plant = pair::plant(&random.text());
    let augmented = pair::augmented(&plant);
    let design = family.design(&augmented, &tuning).ok()?;
    let observer = &design.observer;
    if !observer.input_derivatives.is_empty() {
        return None;
    }
    let certificate = crate::certificate(&augmented, observer, [&[], &[]], Sought::Fastest);
    let sides = Sides::new(&certificate, random.states.len());
    let mut pair = Pair::new(&augmented, observer);
    match certificate.verdict() {
        Standing::Proved => {
            let claim = Claim::new(&certificate);
            judge::secants(&mut pair, &claim, &sides, &mut numbers);
            simulate::decay(&mut pair, &claim, &sides, &mut numbers);
        }
        Standing::Refuted => judge::witness(&mut pair, &certificate, &sides),
        Standing::Undecided => {}
    }
    drop(context);
    Some(certificate.verdict())
}

#[test]
fn verdicts_on_observers_of_the_papers_stand() {
    let verdicts: Vec<Standing> = (1..=OBSERVERS).filter_map(judged).collect();
    let count = |verdict| verdicts.iter().filter(|v| **v == verdict).count();
    let counts = [Standing::Proved, Standing::Refuted, Standing::Undecided].map(count);
    assert!(counts[0] >= 30 && counts[1] >= 1, "{counts:?}");
}
