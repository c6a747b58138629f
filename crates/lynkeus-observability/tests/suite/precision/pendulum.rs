//! A swinging pendulum of unknown torque, whose height is measured: 2,000 fits.

use lynkeus_expr::Graph;
use lynkeus_observability::precision::{Deviation, Experiment, Quantity, Sensor, Window};
use lynkeus_run::System;

use super::fits::{Bench, Random};

const NOISE: f64 = 1e-3;
const STEP: f64 = 0.1;
const SAMPLES: usize = 30;
const START: [f64; 3] = [1.2, -0.4, 0.3];

#[test]
fn errors_of_two_thousand_fits_spread_as_computed() {
    let g = Graph::new();
    let [time, angle, speed, torque] = ["time", "angle", "speed", "torque"].map(|n| g.symbol(n));
    let acceleration = torque - angle.sin() * 2.0 - speed * 0.1;
    let height = g.constant(1.0) - angle.cos();
    let quantity = |name: &str, i: usize| Quantity {
        name: name.to_owned(),
        node: [angle, speed, torque][i].node(),
        start: START[i],
        scale: 1.0,
        is_known: false,
    };
    let experiment = Experiment {
        states: vec![quantity("angle", 0), quantity("speed", 1)],
        derivatives: vec![speed.node(), acceleration.node()],
        unknown: vec![quantity("torque", 2)],
        inputs: vec![(torque.node(), g.constant(START[2]).node())],
        sensors: vec![Sensor {
            name: "height".into(),
            node: height.node(),
            noise: Deviation::Absolute(NOISE),
            limits: None,
        }],
        ..Experiment::new(
            &g,
            time.node(),
            Window {
                start: 0.0,
                step: STEP,
                horizons: vec![SAMPLES],
            },
        )
    };
    let σ = experiment.run().unwrap().deviations(0, &[0]);

    let zero = g.constant(0.0).node();
    let named = |i: usize| quantity(["angle", "speed", "torque"][i], i);
    let states = [0, 1, 2].map(|i| (named(i).name, named(i).node, START[i]));
    let slopes = [speed.node(), acceleration.node(), zero];
    let outputs = [("height".to_owned(), height.node())];
    let bench = Bench {
        system: System::new(&g, time.node(), &states, &[], &slopes, &outputs).unwrap(),
        start: 0.0,
        step: STEP,
        samples: SAMPLES,
        substeps: 4,
        noise: NOISE,
        prior: None,
    };
    let (start, end) = bench.errors(&[0], 3, 2000, &mut Random::new(1));
    let pairs = start.iter().zip(&σ.start).chain(end.iter().zip(&σ.present));
    for (found, computed) in pairs {
        let ratio = found / computed;
        assert!((ratio - 1.0).abs() < 0.05, "{start:?} {end:?} {σ:?}");
    }
}
