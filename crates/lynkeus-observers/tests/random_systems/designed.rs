//! Gains that come with a promise: `gain = "lmi"` on random chains.

use lynkeus_observers::{
    Claim as Sought, Correction, Design, DesignError, Family, Observer, Tuning, Value,
    block_triangular::BLOCK_TRIANGULAR, triangular::TRIANGULAR,
};
use lynkeus_structure::{AugmentedPlant, Standing};

use crate::judge::{self, Claim, Sides};
use crate::numbers::Numbers;
use crate::pair::{self, Pair};
use crate::plants::{Random, sides};
use crate::{Context, simulate};

const CHAINS: u64 = 80;

/// x_i' = a(x_{i+1}) + terms in x_1 … x_i and u, a increasing or decreasing.
pub fn chain(numbers: &mut Numbers) -> Random {
    let count = 2 + numbers.below(3);
    let states = sides(numbers, count);
    let inputs = vec![(-1.0, 1.0)];
    let mut equations = vec![];
    for i in 1..=count {
        let next = i + 1;
        let a = numbers.signed(0.5, 2.0);
        let link = match numbers.below(4) {
            _ if i == count => "u1".to_owned(),
            0 => format!("x{next} + 0.1*x{next}^3"),
            1 => format!("tanh(0.7*x{next})"),
            2 => format!("(2 + u1)*x{next}"),
            _ => format!("x{next}"),
        };
        let j = 1 + numbers.below(i);
        let term = match numbers.below(6) {
            0 => format!("sin(x{j})"),
            1 => format!("x{j}*x{i}"),
            2 => format!("u1*x{j}"),
            3 => format!("abs(x{j})"),
            4 => format!("cos(time)*x{j}"),
            _ => format!("x{j}/(1 + x{j}^2)"),
        };
        let b = numbers.signed(0.05, 0.8);
        equations.push(format!("({a:.4})*({link}) + ({b:.4})*({term})"));
    }
    let outputs =
        vec![["x1", "2*x1 + 1", "-0.5*x1", "100*x1", "0.01*x1 + 0.5"][numbers.below(5)].to_owned()];
    Random {
        states,
        inputs,
        outputs,
        equations,
        jumps: false,
    }
}

fn design(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
    family: usize,
) -> Result<Design, DesignError> {
    let family: &'static dyn Family = [TRIANGULAR, BLOCK_TRIANGULAR][family];
    family.design(augmented, tuning)
}

/// Whether there was a gain; what it promises is judged.
fn kept(seed: u64) -> bool {
    let mut numbers = Numbers(seed.wrapping_mul(0x2545_F491_4F6C_DD1D));
    let random = chain(&mut numbers).at_rest();
    let rate = numbers.size(0.1, 4.0);
    let mut tuning = Tuning::from([("rate", rate)]);
    let text = |text: &str| Value::Text(text.to_owned());
    tuning.values.insert("gain".into(), text("lmi"));
    let aim = ["noise", "peak", "gain"][numbers.below(3)];
    tuning.values.insert("minimise".into(), text(aim));
    let context = Context(format!(
        "chain {seed}, rate {rate}, {aim}\n{}",
        random.text()
    ));
    let plant = pair::plant(&random.text());
    let augmented = pair::augmented(&plant);
    let family = numbers.below(2);
    let design = match design(&augmented, &tuning, family) {
        Ok(design) => design,
        Err(DesignError::NoGain { .. }) => return false,
        Err(other) => panic!("{other}"),
    };
    let observer = &design.observer;
    let certified = |sought| crate::certificate(&augmented, observer, [&[], &[]], sought);
    let fastest = Claim::new(&certified(Sought::Fastest));
    // bisection comes this close to the fastest rate, which may be the one asked for
    assert!(
        fastest.rate >= rate * 0.995,
        "{} against {rate}",
        fastest.rate
    );
    let certificate = certified(Sought::At(rate));
    assert_eq!(certificate.verdict(), Standing::Proved);
    let claim = Claim::new(&certificate);
    assert_eq!(claim.rate, rate);
    let sides = Sides::new(&certificate, random.states.len());
    let mut pair = Pair::new(&augmented, observer);
    judge::secants(&mut pair, &claim, &sides, &mut numbers);
    judge::points(&mut pair, &claim, &sides, &mut numbers);
    simulate::decay(&mut pair, &claim, &sides, &mut numbers);
    limited(&augmented, tuning, largest(&augmented, observer), family);
    drop(context);
    true
}

/// The largest |∂F/∂y|, by the observer's own equations.
fn largest(augmented: &AugmentedPlant<'_>, observer: &Observer) -> f64 {
    match Correction::of(augmented, observer).unwrap() {
        Correction::Gain(K) => K.amax(),
        Correction::Varying(other) => panic!("{other:?}"),
    }
}

/// A limit below what a gain without one has is kept, or nothing is designed.
fn limited(augmented: &AugmentedPlant<'_>, mut tuning: Tuning, free: f64, family: usize) {
    for share in [0.9, 0.3] {
        let limit = Value::Number(share * free);
        tuning.values.insert("gain_limit".into(), limit);
        match design(augmented, &tuning, family) {
            Ok(found) => {
                let entry = largest(augmented, &found.observer);
                assert!(
                    entry <= share * free * (1.0 + 1e-12),
                    "{entry} of {free}, {share}"
                );
            }
            Err(DesignError::NoGain { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn every_designed_gain_is_proved_at_the_rate_asked_for() {
    let designed = (1..=CHAINS).filter(|&seed| kept(seed)).count();
    assert!(4 * designed >= 3 * CHAINS as usize, "{designed}");
}

/// Two sensors of what either alone would show: the gain is taken from the one that is declared to
/// be exact, and in another unit of the second sensor it is the same gain.
#[test]
fn declared_noise_weighs_the_outputs_in_their_own_units() {
    let columns = |c: f64, noise: [f64; 2]| {
        let text = format!(
            "model P Real x(min = -2, max = 2); Real z(min = -2, max = 2); Real w(min = -2, max = 2);
             output Real y = x; output Real q = {c}*w; equation der(x) = z - x + 0.5*w;
             der(z) = -0.2*x - z + 0.2*sin(x) + w; der(w) = -w + 0.8*x + 0.3*z; end P;"
        );
        let plant = pair::plant(&text);
        let augmented = pair::augmented(&plant);
        let mut tuning = Tuning::from([("rate", 1.5)]);
        tuning
            .values
            .insert("gain".into(), Value::Text("lmi".into()));
        let named = ["y", "q"].map(str::to_owned).into_iter().zip(noise);
        tuning.noise = named.collect();
        let found = TRIANGULAR.design(&augmented, &tuning).unwrap();
        match Correction::of(&augmented, &found.observer).unwrap() {
            Correction::Gain(K) => [K.column(0).amax(), K.column(1).amax()],
            Correction::Varying(other) => panic!("{other:?}"),
        }
    };
    let [y, q] = columns(1.0, [1.0, 0.01]);
    assert!(y < 0.01 * q, "{y} {q}");
    let [first, second] = columns(1.0, [0.01, 1.0]);
    assert!(second < 0.01 * first, "{first} {second}");
    let [same, other] = columns(100.0, [1.0, 1.0]);
    assert!((same / y - 1.0).abs() < 0.02, "{same} {y}");
    assert!((100.0 * other / q - 1.0).abs() < 0.02, "{other} {q}");
}
