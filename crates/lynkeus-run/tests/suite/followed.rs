//! −log L along a filter itself, by differences: beside what straight-line code gives with tangents, and beside a ball
//! that bounces as formulas say.

use lynkeus_expr::{Graph, Node};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Likelihood, ParametricLevel, ParametricPlant, ParametricSensor,
    Row, Score, Seen, SigmaPoints,
};
use lynkeus_run::{Error, Manifold, Step};

use crate::likelihood::{Case, rows};

/// The largest difference of numbers, against the largest number.
fn off(own: &[f64], other: &[f64]) -> f64 {
    let largest = other.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let pairs = own.iter().zip(other).map(|(a, b)| (a - b).abs());
    pairs.fold(0.0, f64::max) / largest
}

/// Random plants with gaps, limits and noises that grow with the output.
#[test]
fn differences_are_what_tangents_say() {
    let mut compared = 0;
    for seed in 0..24 {
        let case = Case::new(seed);
        for is_unscented in [false, true] {
            let points = SigmaPoints::default();
            let (kind, mut exact) = match is_unscented {
                false => (FilterKind::Extended, case.likelihood()),
                true => (
                    FilterKind::Unscented(points),
                    case.likelihood_by(|plant| Likelihood::unscented(plant, points)),
                ),
            };
            let settings = FilterSettings::of(kind);
            let mut followed = case
                .likelihood_by(|plant| Likelihood::along(plant, &settings, Manifold::default()));
            let mut is_surprised = false;
            let mut score = |of: &mut Likelihood| {
                let see =
                    |seen: Seen| is_surprised |= seen.innovation.powi(2) > 9.0 * seen.variance;
                of.watched(&case.values, rows(&case.log), Step::AtMost(1.0), see)
                    .unwrap()
            };
            let (own, exact) = (score(&mut followed), score(&mut exact));
            // a reading that contradicts the prediction has a say in a noise that is a share
            if case.is_share() && is_surprised {
                continue;
            }
            compared += 1;
            assert_eq!(own.readings, exact.readings);
            assert!(
                (own.value - exact.value).abs() < 1e-8 * (1.0 + exact.value.abs()),
                "{seed}"
            );
            let slopes = off(&own.gradient, &exact.gradient);
            let told = off(&own.information, &exact.information);
            assert!(slopes < 1e-5 && told < 1e-5, "{seed}: {slopes:e} {told:e}");
        }
    }
    assert!(compared > 35, "{compared}");
}

/// Height of a ball that is let fall from 1 and keeps the share e of its speed.
fn height(t: f64, e: f64, g: f64) -> f64 {
    let (mut start, mut v) = (-(2.0 / g).sqrt(), (2.0 * g).sqrt());
    while t >= start + 2.0 * v / g {
        start += 2.0 * v / g;
        v *= e;
    }
    (t - start) * (v - 0.5 * g * (t - start))
}

/// The likelihood of a ball's height as a function of e and g, along these settings.
fn ball(spread: f64) -> Likelihood {
    let text = "model M
  parameter Real e = 0.8;
  parameter Real g = 9.81;
  Real h(start = 1);
  Real v(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -g;
  when h <= 0 then
    reinit(v, -e*pre(v));
  end when;
end M;";
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let plant = Plant::from_modelica(text, "m.mo", &options).unwrap();
    let graph: &Graph = &plant.graph;
    let number = |x: f64| graph.constant(x).node();
    let parameters: Vec<Node> = plant.parameters.iter().map(|p| p.variable.node).collect();
    let parametric = ParametricPlant {
        graph,
        time: plant.time,
        states: plant.states.iter().map(|s| s.node).collect(),
        derivatives: plant.derivatives.clone(),
        inputs: vec![],
        sensors: vec![ParametricSensor {
            output: plant.outputs[0].node,
            noise: ParametricLevel::Variance(number(0.01)),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![number(0.0); 2],
        ranges: vec![],
        start: vec![(number(1.0), number(spread)), (number(0.0), number(spread))],
        drawn: 0,
        whens: plant.whens.clone(),
        parameters,
    };
    // straight-line code goes through no event
    assert!(matches!(
        Likelihood::new(&parametric),
        Err(Error::Setting { .. })
    ));
    let settings = FilterSettings::of(FilterKind::Extended);
    Likelihood::along(&parametric, &settings, Manifold::default()).unwrap()
}

const ROWS: usize = 40;
const APART: f64 = 0.05;

fn score(likelihood: &mut Likelihood, at: [f64; 2]) -> Score {
    let readings: Vec<[f64; 1]> = (0..ROWS)
        .map(|k| [height(APART * k as f64, 0.78, 9.7) + 0.05 * (7.0 * k as f64).sin()])
        .collect();
    let rows = readings.iter().enumerate().map(|(k, readings)| Row {
        t: APART * k as f64,
        readings,
        inputs: &[],
    });
    likelihood.score(&at, rows, Step::Substeps(1)).unwrap()
}

/// From a start that is known the innovations are those of the formula, bounces and all, and so are their slopes.
#[test]
fn a_ball_bounces_in_the_likelihood() {
    let mut likelihood = ball(0.0);
    let at = [0.8, 9.81];
    let own = score(&mut likelihood, at);
    let readings = |k: usize| height(APART * k as f64, 0.78, 9.7) + 0.05 * (7.0 * k as f64).sin();
    let innovation = |k: usize, [e, g]: [f64; 2]| readings(k) - height(APART * k as f64, e, g);
    let (mut value, mut gradient, mut information) = (0.0, [0.0; 2], [0.0; 4]);
    for k in 0..ROWS {
        let ν = innovation(k, at);
        let slope = |p: usize| {
            let beside = |h: f64| {
                let mut there = at;
                there[p] += h;
                innovation(k, there)
            };
            (beside(1e-6) - beside(-1e-6)) / 2e-6
        };
        let slopes = [slope(0), slope(1)];
        value += 0.5 * (ν * ν / 0.01 + (std::f64::consts::TAU * 0.01).ln());
        for p in 0..2 {
            gradient[p] += ν * slopes[p] / 0.01;
            (0..2).for_each(|q| information[2 * p + q] += slopes[p] * slopes[q] / 0.01);
        }
    }
    assert!(
        (own.value - value).abs() < 1e-9 * value.abs(),
        "{} {value}",
        own.value
    );
    assert!(
        off(&own.gradient, &gradient) < 1e-6,
        "{:?} {gradient:?}",
        own.gradient
    );
    assert!(off(&own.information, &information) < 1e-6);
}

/// With a start that is not known the covariance goes through the bounces, too; the gradient is that of the value.
#[test]
fn the_gradient_is_that_of_the_value_through_events() {
    let mut likelihood = ball(0.1);
    let at = [0.8, 9.81];
    let own = score(&mut likelihood, at);
    for p in 0..2 {
        let h = 1e-4 * at[p];
        let mut value = |k: f64| {
            let mut there = at;
            there[p] += k * h;
            score(&mut likelihood, there).value
        };
        let slope = (8.0 * (value(1.0) - value(-1.0)) - (value(2.0) - value(-2.0))) / (12.0 * h);
        let off = (slope - own.gradient[p]).abs() / slope.abs().max(1.0);
        assert!(off < 1e-4, "{p}: {slope} {}", own.gradient[p]);
    }
}
