//! −log L along a filter and its derivatives, beside the filter itself and beside differences.

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Likelihood, Limits, NoisyModel, NoisyPlant, ParametricLevel,
    ParametricPlant, ParametricSensor, Row, Seen, Sensor, SigmaPoints,
};
use lynkeus_run::{Blueprint, EstimatorSettings, Level, Method, Step};

struct Random(u64);

impl Random {
    /// In [−1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (1.0 + self.next())
    }
}

/// What makes the noise so large that readings rarely contradict the prediction: to one that does, the filter
/// gives another noise.
const SHARE: f64 = 9.0;

/// A log: time, readings (NaN in gaps), inputs.
pub(crate) type Log = Vec<(f64, Vec<f64>, Vec<f64>)>;

pub(crate) fn rows(log: &Log) -> impl Iterator<Item = Row<'_>> {
    log.iter().map(|(t, readings, inputs)| Row {
        t: *t,
        readings,
        inputs,
    })
}

/// A plant of random structure: rates, a density, a noise and a start are parameters.
pub(crate) struct Case {
    graph: Graph,
    n: usize,
    sensors: usize,
    /// [rates…, density, noise, start]
    pub values: Vec<f64>,
    pub log: Log,
    seed: u64,
}

impl Case {
    pub fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        let n = 1 + seed as usize % 4;
        let sensors = 1 + (seed + seed / 4) as usize % 2;
        let mut values: Vec<f64> = (0..n).map(|_| random.between(0.4, 1.6)).collect();
        values.extend([0.02, 0.05, 0.7].map(|v| v * random.between(0.5, 2.0)));
        let mut t = 0.0;
        let log = (0..25).map(|_| {
            let y = (0..sensors).map(|_| match random.next() < 0.5 {
                true => 0.6 + 0.3 * random.next(),
                false => f64::NAN,
            });
            let row = (t, y.collect(), vec![random.next()]);
            t += random.between(0.02, 0.3);
            row
        });
        let log = log.collect();
        Self {
            graph: Graph::new(),
            n,
            sensors,
            values,
            log,
            seed,
        }
    }

    /// The sensor of some plants with one does not show more than so much.
    fn limits(&self) -> Option<Limits> {
        let (low, high) = (0.45, 0.75);
        (self.seed % 4 == 2 && self.sensors == 1 && !self.is_share())
            .then_some(Limits { low, high })
    }

    /// The noise of others grows with the output.
    pub fn is_share(&self) -> bool {
        self.seed / 4 % 3 == 1
    }

    /// Noise acts on one state alone where there are three.
    fn is_noisy(&self, state: usize) -> bool {
        self.n != 3 || state == self.seed as usize / 4 % 3
    }

    fn noise(&self, r: Expr<'_>) -> ParametricLevel {
        match self.is_share() {
            true => ParametricLevel::Share((SHARE * r).node()),
            false => ParametricLevel::Variance((r * r).node()),
        }
    }

    /// The plant with these expressions for its parameters.
    fn plant(&self, θ: &[Node]) -> (Vec<Node>, Vec<Node>, Vec<Node>, [Node; 2]) {
        let g = &self.graph;
        let mut random = Random(self.seed + 1000);
        let x: Vec<Expr<'_>> = (0..self.n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let u = g.symbol("u");
        let derivatives = (0..self.n).map(|i| {
            let own = -g.expr(θ[i]) * x[i] * (1.0 + 0.2 * x[i]);
            let before = if i == 0 {
                u
            } else {
                g.expr(θ[i - 1]) * x[i - 1].sin()
            };
            own + before + 0.1 * random.next() * x[self.n - 1]
        });
        let derivatives = derivatives.map(Expr::node).collect();
        let outputs =
            (0..self.sensors).map(|k| (x[self.n - 1] + 0.3 * k as f64 * x[0].exp()).node());
        let states = x.iter().map(|x| x.node()).collect();
        (
            states,
            derivatives,
            outputs.collect(),
            [g.symbol("time").node(), u.node()],
        )
    }

    pub fn likelihood(&self) -> Likelihood {
        self.likelihood_by(Likelihood::new)
    }

    pub fn likelihood_by(
        &self,
        make: impl FnOnce(&ParametricPlant<'_>) -> Result<Likelihood, lynkeus_run::Error>,
    ) -> Likelihood {
        let g = &self.graph;
        let θ: Vec<Expr<'_>> = (0..self.values.len())
            .map(|i| g.symbol(&format!("p{i}")))
            .collect();
        let nodes: Vec<Node> = θ.iter().map(|θ| θ.node()).collect();
        let (states, derivatives, outputs, [time, u]) = self.plant(&nodes);
        let [q, r, start] = [0, 1, 2].map(|k| θ[self.n + k]);
        let zero = g.constant(0.0).node();
        make(&ParametricPlant {
            graph: g,
            time,
            derivatives,
            inputs: vec![u],
            sensors: outputs
                .iter()
                .map(|&output| ParametricSensor {
                    output,
                    noise: self.noise(r),
                    limits: self.limits(),
                    is_dial: false,
                })
                .collect(),
            process_noise: (0..self.n)
                .map(|i| if self.is_noisy(i) { q.node() } else { zero })
                .collect(),
            ranges: vec![],
            start: states
                .iter()
                .map(|_| (start.node(), g.constant(0.2).node()))
                .collect(),
            drawn: 0,
            whens: Default::default(),
            parameters: nodes,
            states,
        })
        .unwrap()
    }

    /// −log L of the filter of the library, whose corrections are other code.
    fn filtered(&self, kind: FilterKind) -> f64 {
        let g = &self.graph;
        let θ: Vec<Node> = self.values.iter().map(|&v| g.constant(v).node()).collect();
        let (states, derivatives, outputs, [time, u]) = self.plant(&θ);
        let [q, r, start] = [0, 1, 2].map(|k| self.values[self.n + k]);
        let model = NoisyModel::new(&NoisyPlant {
            graph: g,
            time,
            states: states
                .iter()
                .map(|&x| (format!("{x:?}"), x, start))
                .collect(),
            derivatives,
            inputs: vec![("u".into(), u)],
            sensors: (outputs.iter().enumerate())
                .map(|(k, &output)| Sensor {
                    name: format!("y{k}"),
                    output,
                    noise: match self.is_share() {
                        true => Level::Relative(SHARE * r),
                        false => Level::Absolute(r),
                    },
                    limits: self.limits(),
                })
                .collect(),
            process_noise: (0..self.n)
                .map(|i| if self.is_noisy(i) { q } else { 0.0 })
                .collect(),
            initial_variance: vec![0.2 * 0.2; self.n],
            ranges: vec![],
            confined: None,
            whens: Default::default(),
        })
        .unwrap();
        let run = EstimatorSettings {
            method: Method::Rk4(Step::Substeps(1)),
            ..EstimatorSettings::default()
        };
        let settings = FilterSettings::of(kind);
        let mut filter = Blueprint::filter(model, settings, run).estimator().unwrap();
        filter.keep_record();
        let mut sum = 0.0;
        for (t, readings, inputs) in &self.log {
            filter.push(*t, &[&readings[..], inputs].concat()).unwrap();
            sum -= filter.record().unwrap().log_likelihood;
        }
        sum
    }
}

#[test]
fn the_likelihood_is_the_filter_s() {
    let mut shares = 0;
    for seed in 0..40 {
        let case = Case::new(seed);
        let mut is_surprised = false;
        let see = |seen: Seen| is_surprised |= seen.innovation.powi(2) > 9.0 * seen.variance;
        let score = case
            .likelihood()
            .watched(&case.values, rows(&case.log), Step::AtMost(1.0), see)
            .unwrap();
        let readings = case
            .log
            .iter()
            .flat_map(|row| &row.1)
            .filter(|y| y.is_finite());
        assert_eq!(score.readings, readings.count());
        if case.is_share() && is_surprised {
            continue;
        }
        shares += u32::from(case.is_share());
        let expected = case.filtered(FilterKind::Extended);
        let off = (score.value - expected).abs() / (1.0 + expected.abs());
        assert!(
            off < 1e-11,
            "seed {seed}: {} beside {expected}",
            score.value
        );
    }
    assert!(shares > 2, "{shares}");
}

/// Points with a negative weight at the centre, and the usual ones.
const POINTS: [SigmaPoints; 2] = [
    SigmaPoints {
        alpha: 0.6,
        beta: 0.0,
        kappa: 0.5,
    },
    SigmaPoints {
        alpha: 1.0,
        beta: 0.0,
        kappa: 0.0,
    },
];

#[test]
fn the_unscented_likelihood_is_the_filter_s() {
    let (mut compared, mut signs) = (0, [0, 0]);
    for seed in 0..60 {
        let case = Case::new(seed);
        let points = POINTS[seed as usize % 7 % 2];
        let weights = points.weights(case.n).unwrap();
        let mut is_left = false;
        let see = |seen: Seen| {
            let is_surprised = seen.innovation.powi(2) > 9.0 * seen.variance;
            // points are drawn anew for a reading at an end, and a share counts otherwise where it is contradicted
            is_left |= (seen.is_at_end && case.sensors > 1) || (case.is_share() && is_surprised);
        };
        let score = case
            .likelihood_by(|plant| Likelihood::unscented(plant, points))
            .watched(&case.values, rows(&case.log), Step::AtMost(1.0), see)
            .unwrap();
        if is_left {
            continue;
        }
        compared += 1;
        signs[usize::from(weights.centre < 0.0)] += 1;
        let expected = case.filtered(FilterKind::Unscented(points));
        let off = (score.value - expected).abs() / (1.0 + expected.abs());
        assert!(off < 1e-9, "seed {seed}: {} beside {expected}", score.value);
    }
    assert!(
        compared > 40 && signs.iter().all(|count| *count > 5),
        "{compared} {signs:?}"
    );
}

/// Beside differences of order 6, which leave about 1e-9 of the value.
#[test]
fn derivatives_are_those_of_the_value() {
    for seed in 0..200 {
        let case = Case::new(seed);
        derivatives_hold(&case, case.likelihood());
    }
    for seed in 0..40 {
        let case = Case::new(seed);
        let points = POINTS[seed as usize % 7 % 2];
        derivatives_hold(
            &case,
            case.likelihood_by(|plant| Likelihood::unscented(plant, points)),
        );
    }
}

fn derivatives_hold(case: &Case, mut likelihood: Likelihood) {
    let seed = case.seed;
    {
        let mut value = |θ: &[f64]| {
            likelihood
                .score(θ, rows(&case.log), Step::AtMost(0.1))
                .unwrap()
                .value
        };
        let mut differences = vec![];
        for p in 0..case.values.len() {
            let h = 2e-3 * case.values[p];
            let mut at = |k: f64| {
                let mut θ = case.values.clone();
                θ[p] += k * h;
                value(&θ)
            };
            let [one, two, three] = [1.0, 2.0, 3.0].map(|k| at(k) - at(-k));
            differences.push((45.0 * one - 9.0 * two + three) / (60.0 * h));
        }
        let score = likelihood
            .score(&case.values, rows(&case.log), Step::AtMost(0.1))
            .unwrap();
        for (p, (exact, difference)) in score.gradient.iter().zip(differences).enumerate() {
            let size = 1.0 + exact.abs() + score.value.abs() / case.values[p];
            let off = (exact - difference).abs() / size;
            assert!(
                off < 1e-8,
                "seed {seed}, parameter {p}: {exact} beside {difference}"
            );
        }
    }
}

/// y = c + noise of deviation r, known exactly but for c and r: Fisher's information of N readings is N/r² of c
/// and 2N/r² of r, and they have nothing in common.
#[test]
fn the_information_is_fisher_s() {
    let g = Graph::new();
    let [time, x, c, r] = ["time", "x", "c", "r"].map(|name| g.symbol(name));
    let zero = g.constant(0.0).node();
    let mut likelihood = Likelihood::new(&ParametricPlant {
        graph: &g,
        time: time.node(),
        states: vec![x.node()],
        derivatives: vec![zero],
        inputs: vec![],
        sensors: vec![ParametricSensor {
            output: x.node(),
            noise: ParametricLevel::Variance((r * r).node()),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![zero],
        ranges: vec![],
        start: vec![(c.node(), zero)],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![c.node(), r.node()],
    })
    .unwrap();
    let log: Log = (0..50)
        .map(|k| (f64::from(k), vec![1.0 + (f64::from(k)).sin()], vec![]))
        .collect();
    let score = likelihood
        .score(&[1.1, 0.5], rows(&log), Step::AtMost(1.0))
        .unwrap();
    for (found, expected) in score.information.iter().zip([200.0, 0.0, 0.0, 400.0]) {
        assert!((found - expected).abs() < 1e-9, "{found} beside {expected}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let case = Case::new(1);
    let mut likelihood = case.likelihood();
    let refused = |likelihood: &mut Likelihood, θ: &[f64], step: f64| {
        likelihood
            .score(θ, rows(&case.log), Step::AtMost(step))
            .unwrap_err()
            .to_string()
    };
    assert!(refused(&mut likelihood, &[1.0], 1.0).contains("number of parameters"));
    assert!(refused(&mut likelihood, &case.values, f64::NAN).contains("step"));
    let mut wide = case.log.clone();
    wide[2].1.push(1.0);
    let error = likelihood
        .score(&case.values, rows(&wide), Step::AtMost(1.0))
        .unwrap_err();
    assert!(error.to_string().contains("number of readings"), "{error}");
    let mut timeless = case.log.clone();
    timeless[0].0 = f64::NAN;
    let error = likelihood
        .score(&case.values, rows(&timeless), Step::AtMost(1.0))
        .unwrap_err();
    assert!(
        matches!(error, lynkeus_run::Error::NoNumber { .. }),
        "{error}"
    );
    let back = vec![case.log[3].clone(), case.log[1].clone()];
    let error = likelihood
        .score(&case.values, rows(&back), Step::AtMost(1.0))
        .unwrap_err();
    assert!(
        matches!(error, lynkeus_run::Error::TimeBefore { .. }),
        "{error}"
    );
}

/// Nothing that is searched: the value alone, by hand of two readings 1 and 2 about 0 with variance 4.
#[test]
fn a_plant_without_parameters_has_a_value() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name).node());
    let number = |value: f64| g.constant(value).node();
    let mut likelihood = Likelihood::new(&ParametricPlant {
        graph: &g,
        time,
        states: vec![x],
        derivatives: vec![number(0.0)],
        inputs: vec![],
        sensors: vec![ParametricSensor {
            output: x,
            noise: ParametricLevel::Variance(number(4.0)),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![number(0.0)],
        ranges: vec![],
        start: vec![(number(0.0), number(0.0))],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![],
    })
    .unwrap();
    let log: Log = [1.0, 2.0].iter().map(|y| (*y, vec![*y], vec![])).collect();
    let value = likelihood
        .score(&[], rows(&log), Step::AtMost(1.0))
        .unwrap()
        .value;
    let expected = 0.5 * (1.25 + 2.0 * (8.0 * std::f64::consts::PI).ln());
    assert!(
        (value - expected).abs() < 1e-12,
        "{value} beside {expected}"
    );
}

/// A tank that the log empties: the plant has no value below 0, where readings push the estimate. The filter puts it
/// into its range, and so does the likelihood; its derivatives are those of that.
#[test]
fn an_estimate_without_a_value_is_put_into_its_range() {
    let g = Graph::new();
    let [time, x, k] = ["time", "x", "k"].map(|name| g.symbol(name));
    let number = |value: f64| g.constant(value).node();
    let range = Limits {
        low: 0.01,
        high: 10.0,
    };
    let inside = x.min(g.constant(range.high)).max(g.constant(range.low));
    let value = 0.9;
    let derivative = |k: Expr<'_>, x: Expr<'_>| (-(k * x.sqrt())).node();
    let mut likelihood = Likelihood::new(&ParametricPlant {
        graph: &g,
        time: time.node(),
        states: vec![x.node()],
        derivatives: vec![derivative(k, x)],
        inputs: vec![],
        sensors: vec![ParametricSensor {
            output: x.node(),
            noise: ParametricLevel::Variance(number(0.04)),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![number(0.1)],
        ranges: vec![range],
        start: vec![(number(1.0), number(0.3))],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![k.node()],
    })
    .unwrap();
    let log: Log = [1.0, 0.4, -0.9, -0.5, 0.3, 0.2]
        .iter()
        .enumerate()
        .map(|(i, y)| (0.3 * i as f64, vec![*y], vec![]))
        .collect();
    let score = likelihood
        .score(&[value], rows(&log), Step::Substeps(1))
        .unwrap();
    assert!(score.confined > 0);

    let fixed = g.constant(value);
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 1.0)],
        derivatives: vec![derivative(fixed, x)],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x.node(),
            noise: Level::Absolute(0.2),
            limits: None,
        }],
        process_noise: vec![0.1],
        initial_variance: vec![0.09],
        ranges: vec![range],
        confined: Some(vec![derivative(fixed, inside)]),
        whens: Default::default(),
    })
    .unwrap();
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(1)),
        ..EstimatorSettings::default()
    };
    let settings = FilterSettings::of(FilterKind::Extended);
    let mut filter = Blueprint::filter(model, settings, run).estimator().unwrap();
    filter.keep_record();
    let mut expected = 0.0;
    for (t, readings, _) in &log {
        filter.push(*t, readings).unwrap();
        expected -= filter.record().unwrap().log_likelihood;
    }
    assert!(
        (score.value - expected).abs() < 1e-11,
        "{} beside {expected}",
        score.value
    );
    let mut value_at = |k: f64| {
        let score = likelihood.score(&[k], rows(&log), Step::Substeps(1));
        score.unwrap().value
    };
    let h = 1e-4;
    let difference = (value_at(value + h) - value_at(value - h)) / (2.0 * h);
    assert!(
        (score.gradient[0] - difference).abs() < 1e-6,
        "{difference}"
    );
}

/// A fast state without noise, whose uncertainty decays below every number, takes neither the value nor its
/// derivatives from what it drives: those of the plant in which it has settled, whose slope by the rate k is nearly 0.
#[test]
fn what_has_decayed_leaves_the_derivatives() {
    let score = |is_fast: bool| {
        let g = Graph::new();
        let names = ["time", "x", "z", "u", "k", "a"];
        let [time, x, z, u, k, a] = names.map(|name| g.symbol(name));
        let number = |value: f64| g.constant(value).node();
        let [fast, own] = [(x, -k * (x - u)), (z, if is_fast { x } else { u } - a * z)];
        let states = if is_fast { vec![fast, own] } else { vec![own] };
        let mut likelihood = Likelihood::new(&ParametricPlant {
            graph: &g,
            time: time.node(),
            states: states.iter().map(|(state, _)| state.node()).collect(),
            derivatives: states.iter().map(|(_, slope)| slope.node()).collect(),
            inputs: vec![u.node()],
            sensors: vec![ParametricSensor {
                output: z.node(),
                noise: ParametricLevel::Variance(number(0.01)),
                limits: None,
                is_dial: false,
            }],
            process_noise: states
                .iter()
                .map(|(state, _)| number(if state.node() == z.node() { 1e-3 } else { 0.0 }))
                .collect(),
            ranges: vec![],
            start: states.iter().map(|_| (number(1.0), number(0.1))).collect(),
            drawn: 0,
            whens: Default::default(),
            parameters: vec![k.node(), a.node()],
        })
        .unwrap();
        let log: Log = (0..40)
            .map(|i| {
                (
                    0.2 * f64::from(i),
                    vec![1.0 + 0.1 * f64::from(i).sin()],
                    vec![1.0],
                )
            })
            .collect();
        let step = if is_fast { 1e-3 } else { 0.05 };
        likelihood
            .score(&[900.0, 0.9], rows(&log), Step::AtMost(step))
            .unwrap()
    };
    let [fast, settled] = [true, false].map(score);
    let off = |a: f64, b: f64| (a - b).abs() / (1.0 + b.abs());
    assert!(
        off(fast.value, settled.value) < 1e-3,
        "{fast:?} beside {settled:?}"
    );
    assert!(
        off(fast.gradient[1], settled.gradient[1]) < 1e-3,
        "{fast:?} beside {settled:?}"
    );
    assert!(fast.gradient[0].abs() < 1e-5, "{fast:?}");
    assert!(fast.information.iter().all(|x| x.is_finite()), "{fast:?}");
}

/// Noise on the last of a chain that is seen at its first: what it makes of the first in a step is less than the error
/// of the step, wherever that state stands.
#[test]
fn the_order_of_the_states_does_not_matter() {
    let value = |order: [usize; 3], step: f64| {
        let g = Graph::new();
        let x: Vec<Expr<'_>> = (0..3).map(|i| g.symbol(&format!("x{i}"))).collect();
        let [time, q] = ["time", "q"].map(|name| g.symbol(name));
        let zero = g.constant(0.0);
        let slopes = [x[1].sin() - x[0], x[2] - x[1] * (1.0 + x[1]), -x[2]];
        let density = [zero, zero, q];
        let ordered = |all: &[Expr<'_>]| order.iter().map(|&i| all[i].node()).collect::<Vec<_>>();
        let mut likelihood = Likelihood::new(&ParametricPlant {
            graph: &g,
            time: time.node(),
            states: ordered(&x),
            derivatives: ordered(&slopes),
            inputs: vec![],
            sensors: vec![ParametricSensor {
                output: x[0].node(),
                noise: ParametricLevel::Variance(g.constant(0.01).node()),
                limits: None,
                is_dial: false,
            }],
            process_noise: ordered(&density),
            ranges: vec![],
            start: vec![(g.constant(0.5).node(), g.constant(0.2).node()); 3],
            drawn: 0,
            whens: Default::default(),
            parameters: vec![q.node()],
        })
        .unwrap();
        let log: Log = (0..30)
            .map(|k| (0.2 * f64::from(k), vec![0.4 * f64::from(k).cos()], vec![]))
            .collect();
        let score = likelihood.score(&[0.3], rows(&log), Step::AtMost(step));
        score.unwrap().value
    };
    let exact = value([2, 1, 0], 0.001);
    // the error of the steps is of fourth order
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let coarse = value(order, 0.025);
        assert!(
            (coarse - exact).abs() < 1e-5,
            "{order:?}: {coarse} beside {exact}"
        );
    }
}

/// −log L of x' = −λ(x − cos t) − sin t, which starts off the curve at 1.5, x(1) = cos 1 + ½ e^{−λ}, and of z' = −z²x(t)
/// beside it, read once at t = 1 as 0 with variance 1 each, less log 2π: ½(x² + z²).
fn driven(rate: f64, steps: usize, is_implicit: bool) -> lynkeus_run::filter::Score {
    let g = Graph::new();
    let [time, x, z, λ] = ["time", "x", "z", "λ"].map(|name| g.symbol(name));
    let number = |value: f64| g.constant(value).node();
    let sensor = |output: Expr<'_>| ParametricSensor {
        output: output.node(),
        noise: ParametricLevel::Variance(number(1.0)),
        limits: None,
        is_dial: false,
    };
    let mut likelihood = Likelihood::new(&ParametricPlant {
        graph: &g,
        time: time.node(),
        states: vec![x.node(), z.node()],
        derivatives: vec![
            (-λ * (x - time.cos()) - time.sin()).node(),
            (-z * z * x).node(),
        ],
        inputs: vec![],
        sensors: vec![sensor(x), sensor(z)],
        process_noise: vec![number(0.0), number(0.0)],
        ranges: vec![],
        start: vec![(number(1.5), number(0.0)), (number(1.0), number(0.0))],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![λ.node()],
    })
    .unwrap();
    assert!(likelihood.implicit(is_implicit));
    let rows = [(0.0, [f64::NAN; 2]), (1.0, [0.0; 2])];
    let rows = rows.iter().map(|(t, readings)| Row {
        t: *t,
        readings,
        inputs: &[],
    });
    let mut score = likelihood
        .score(&[rate], rows, Step::Substeps(steps))
        .unwrap();
    score.value -= std::f64::consts::TAU.ln();
    score
}

/// Its value in closed form: 1/z = 1 + ∫x.
fn exact(rate: f64) -> f64 {
    let fast = (-rate).exp();
    let x = 1.0_f64.cos() + 0.5 * fast;
    let z = 1.0 / (1.0 + 1.0_f64.sin() + 0.5 * (1.0 - fast) / rate);
    0.5 * (x * x + z * z)
}

#[test]
fn implicit_steps_are_of_order_four() {
    let error = |steps| (driven(3.0, steps, true).value - exact(3.0)).abs();
    for steps in [4, 8] {
        let ratio = error(steps) / error(2 * steps);
        assert!((11.0..24.0).contains(&ratio), "{steps}: {ratio}");
    }
    // its published coefficients are good to ten digits
    assert!(error(80) < 1e-9, "{}", error(80));
}

#[test]
fn implicit_steps_hold_where_explicit_ones_do_not() {
    let rate = 1e5;
    let [implicit, explicit] = [true, false].map(|is| driven(rate, 40, is));
    assert!(explicit.value.is_nan() || explicit.value.abs() > 1e3);
    assert!((implicit.value - exact(rate)).abs() < 1e-6, "{implicit:?}");
    let h = 1e-3 * rate;
    let [more, less] = [rate + h, rate - h].map(|rate| driven(rate, 40, true).value);
    let difference = 0.5 * (more - less) / h;
    assert!(
        (implicit.gradient[0] - difference).abs() < 1e-5 * difference.abs(),
        "{} beside {difference}",
        implicit.gradient[0]
    );
}

#[test]
fn a_noise_may_depend_on_the_state() {
    let g = Graph::new();
    let [time, x, θ] = ["time", "x", "θ"].map(|name| g.symbol(name));
    let number = |value: f64| g.constant(value).node();
    let mut likelihood = Likelihood::new(&ParametricPlant {
        graph: &g,
        time: time.node(),
        states: vec![x.node()],
        derivatives: vec![(-θ * x).node()],
        inputs: vec![],
        sensors: vec![ParametricSensor {
            output: x.node(),
            noise: ParametricLevel::Variance((0.1 + θ * x).powi(2).node()),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![number(0.0)],
        ranges: vec![],
        start: vec![(number(2.0), number(0.0))],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![θ.node()],
    })
    .unwrap();
    // by hand: x = 2 e^{−θt}, σ = 0.1 + θx
    let by_hand = |θ: f64| {
        let x = 2.0 * (-θ).exp();
        let σ = 0.1 + θ * x;
        0.5 * ((1.5 - x) / σ).powi(2) + σ.ln() + 0.5 * std::f64::consts::TAU.ln()
    };
    let rows = [(0.0, [f64::NAN]), (1.0, [1.5])];
    let rows = rows.iter().map(|(t, readings)| Row {
        t: *t,
        readings,
        inputs: &[],
    });
    let score = likelihood.score(&[0.4], rows, Step::Substeps(50)).unwrap();
    assert!((score.value - by_hand(0.4)).abs() < 1e-8);
    let slope = (by_hand(0.4 + 1e-5) - by_hand(0.4 - 1e-5)) / 2e-5;
    assert!((score.gradient[0] - slope).abs() < 1e-7, "{score:?}");
}

/// The share of an output that is 0, and known to be, is no noise: such a reading, right or wrong, has no density; the
/// filter is not corrected by it, and it does not count.
#[test]
fn a_reading_of_which_all_is_certain_does_not_count() {
    let (share, at_end) = (0.1, 1.07);
    for first in [0.0, 0.3] {
        let g = Graph::new();
        let [time, x, θ] = ["time", "x", "θ"].map(|name| g.symbol(name));
        let number = |value: f64| g.constant(value).node();
        let plant = ParametricPlant {
            graph: &g,
            time: time.node(),
            states: vec![x.node()],
            derivatives: vec![θ.node()],
            inputs: vec![],
            sensors: vec![ParametricSensor {
                output: x.node(),
                noise: ParametricLevel::Share(number(share)),
                limits: None,
                is_dial: false,
            }],
            process_noise: vec![number(0.0)],
            ranges: vec![],
            start: vec![(number(0.0), number(0.0))],
            drawn: 0,
            whens: Default::default(),
            parameters: vec![θ.node()],
        };
        let log: Log = vec![(0.0, vec![first], vec![]), (1.0, vec![at_end], vec![])];
        // by hand: of the second alone, x = θ and σ = 0.1 θ
        let by_hand = |θ: f64| {
            let σ = share * θ;
            0.5 * ((at_end - θ) / σ).powi(2) + σ.ln() + 0.5 * std::f64::consts::TAU.ln()
        };
        let slope = (by_hand(0.9 + 1e-5) - by_hand(0.9 - 1e-5)) / 2e-5;
        let both = [
            Likelihood::new(&plant),
            Likelihood::unscented(&plant, SigmaPoints::default()),
        ];
        for likelihood in both {
            let mut seen = vec![];
            let score = likelihood
                .unwrap()
                .watched(&[0.9], rows(&log), Step::Substeps(1), |found| {
                    seen.push((found.innovation, found.variance));
                })
                .unwrap();
            assert_eq!((score.readings, score.certain), (1, 1));
            assert!((score.value - by_hand(0.9)).abs() < 1e-12, "{score:?}");
            assert!((score.gradient[0] - slope).abs() < 1e-7, "{score:?}");
            assert_eq!((seen[0], seen.len()), ((first, 0.0), 2));
        }
        for kind in [
            FilterKind::Extended,
            FilterKind::Unscented(SigmaPoints::default()),
        ] {
            let model = NoisyModel::new(&NoisyPlant {
                graph: &g,
                time: time.node(),
                states: vec![("x".into(), x.node(), 0.0)],
                derivatives: vec![number(0.9)],
                inputs: vec![],
                sensors: vec![Sensor {
                    name: "y".into(),
                    output: x.node(),
                    noise: Level::Relative(share),
                    limits: None,
                }],
                process_noise: vec![0.0],
                initial_variance: vec![0.0],
                ranges: vec![],
                confined: None,
                whens: Default::default(),
            });
            let run = EstimatorSettings {
                method: Method::Rk4(Step::Substeps(1)),
                ..EstimatorSettings::default()
            };
            let filter = Blueprint::filter(model.unwrap(), FilterSettings::of(kind), run);
            let mut filter = filter.estimator().unwrap();
            filter.keep_record();
            let mut sum = 0.0;
            for (t, readings, _) in &log {
                filter.push(*t, readings).unwrap();
                sum -= filter.record().unwrap().log_likelihood;
            }
            assert!((sum - by_hand(0.9)).abs() < 1e-12, "{sum}");
        }
    }
}
