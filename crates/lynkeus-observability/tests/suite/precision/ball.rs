//! A ball that bounces once: what its formula says of the errors of a fit.

use lynkeus_model::{LoadOptions, Plant, Variable};
use lynkeus_observability::precision::{Deviation, Experiment, Quantity, Sensor, Window};
use lynkeus_run::{Method, Step};
use nalgebra::{Matrix2, Vector2};

const G: f64 = 9.81;
const KEPT: f64 = 0.8;
const NOISE: f64 = 0.02;
const STEP: f64 = 0.05;
const SAMPLES: usize = 15;

/// Height and speed at t of what starts at a height with a speed.
fn ball(t: f64, [h, v]: [f64; 2]) -> [f64; 2] {
    let impact = (v * v + 2.0 * G * h).sqrt();
    let instant = (v + impact) / G;
    match t < instant {
        true => [h + v * t - 0.5 * G * t * t, v - G * t],
        false => {
            let (s, up) = (t - instant, KEPT * impact);
            [up * s - 0.5 * G * s * s, up - G * s]
        }
    }
}

/// ∂(h, v)/∂(h₀, v₀).
fn slopes(t: f64) -> Matrix2<f64> {
    let column = |p: usize| {
        let at = |h: f64| {
            let mut start = [1.0, 0.2];
            start[p] += h;
            Vector2::from(ball(t, start))
        };
        (at(1e-6) - at(-1e-6)) / 2e-6
    };
    Matrix2::from_columns(&[column(0), column(1)])
}

#[test]
fn errors_go_through_a_bounce() {
    let text = "model Ball
  Real h(start = 1);
  Real v(start = 0.2);
  Integer n(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -9.81;
  when h <= 0 then
    reinit(v, -0.8*pre(v));
    n = pre(n) + 1;
  end when;
end Ball;";
    let plant = Plant::from_modelica(text, "m.mo", &LoadOptions::default()).unwrap();
    // one of the scales is small
    let quantity = |v: &Variable| Quantity {
        name: v.name.clone(),
        node: v.node,
        start: v.start.unwrap_or(0.0),
        scale: if v.name == "h" { 0.01 } else { 2.0 },
        is_known: v.discrete,
    };
    for method in [Method::default(), Method::Rk4(Step::Substeps(4))] {
        let experiment = Experiment {
            states: plant.states.iter().map(quantity).collect(),
            derivatives: plant.derivatives.clone(),
            whens: plant.whens.clone(),
            sensors: vec![Sensor {
                name: "y".into(),
                node: plant.outputs[0].node,
                noise: Deviation::Absolute(NOISE),
                limits: None,
            }],
            method,
            ..Experiment::new(
                &plant.graph,
                plant.time,
                Window {
                    start: 0.0,
                    step: STEP,
                    horizons: vec![SAMPLES],
                },
            )
        };
        let σ = experiment.run().unwrap().deviations(0, &[0]);
        let mut information = Matrix2::zeros();
        for k in 0..=SAMPLES {
            let row = slopes(STEP * k as f64).row(0).into_owned();
            information += row.transpose() * row / (NOISE * NOISE);
        }
        let start = information.try_inverse().unwrap();
        let way = slopes(STEP * SAMPLES as f64);
        let present = way * start * way.transpose();
        for (place, name) in ["h", "v"].into_iter().enumerate() {
            let own = plant.states.iter().position(|s| s.name == name).unwrap();
            let expected = [start, present].map(|p| p[(place, place)].sqrt());
            let found = [σ.start[own], σ.present[own]];
            for (found, expected) in found.into_iter().zip(expected) {
                assert!(
                    (found / expected - 1.0).abs() < 1e-6,
                    "{name}: {found} {expected}"
                );
            }
        }
        let count = plant.states.iter().position(|s| s.discrete).unwrap();
        assert_eq!(σ.present[count], 0.0, "{σ:?}");
    }
}
