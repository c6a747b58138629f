//! Any bytes are the snapshot of an estimator or refused, and what is refused changes nothing. The first bytes may
//! stand in the place of some of a true snapshot's.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use lynkeus::Study;
use lynkeus::run::Estimator;

const MODEL: &str = "model Tank input Real u(min = 0, max = 5); Real level(start = 4, min = 0.1, max = 10); \
    output Real y = level; equation der(level) = u - 0.5*sqrt(level); end Tank;";
const STUDY: &str = "plant = \"tank.mo\"\nsensors = { unknown = [\"u\"], noise = { y = 0.1 } }\n\
    process_noise = { u = 0.1 }\nobserver = { family = \"ekf\" }\n";

static TANK: LazyLock<Estimator> = LazyLock::new(|| {
    let mut study = Study::parse(STUDY, "tank.toml").expect("a study");
    study.plant_text = Some(MODEL.into());
    let mut estimator = lynkeus::estimator(&study).expect("an estimator");
    for k in 0..5 {
        estimator.push(f64::from(k), &[4.0]).expect("a sample");
    }
    estimator
});

fuzz_target!(|bytes: &[u8]| {
    let mut estimator = TANK.clone();
    let known = estimator.snapshot();
    let mut patched = known.clone();
    let place = bytes.first().map_or(0, |&b| usize::from(b) * known.len() / 256);
    for (old, new) in patched.iter_mut().skip(place).zip(bytes.iter().skip(1)) {
        *old = *new;
    }
    for snapshot in [bytes, &patched] {
        let before = estimator.snapshot();
        match estimator.restore(snapshot) {
            Ok(()) => assert_eq!(estimator.snapshot(), snapshot),
            Err(refused) => {
                assert!(!refused.to_string().is_empty());
                assert_eq!(estimator.snapshot(), before);
            }
        }
    }
});
