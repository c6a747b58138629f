//! Angles and rotations in filters: a rotor whose encoder is wrapped, and attitudes beside a multiplicative extended
//! Kalman filter that is written down here.

use std::f64::consts::TAU;

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor, SigmaPoints,
};
use lynkeus_run::manifold::{angle_between, turned, unit, wrapped};
use lynkeus_run::{Blueprint, Estimator, EstimatorSettings, Level, Manifold, Method, Step};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::coverage::Normal;

const STEP: f64 = 0.05;

fn run() -> EstimatorSettings {
    EstimatorSettings {
        method: Method::Rk4(Step::Substeps(1)),
        ..EstimatorSettings::default()
    }
}

fn estimator(model: NoisyModel, kind: FilterKind, keep_history: bool) -> Estimator {
    let settings = FilterSettings {
        keep_history,
        ..FilterSettings::of(kind)
    };
    Blueprint::filter(model, settings, run())
        .estimator()
        .unwrap()
}

/// θ' = ω, ω' = −2 sin θ − 0.02 ω + w, θ measured.
fn rotor(manifold: Manifold) -> NoisyModel {
    let g = Graph::new();
    let [time, angle, rate] = ["time", "theta", "omega"].map(|name| g.symbol(name));
    let open = lynkeus_run::filter::Limits {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![
            ("theta".into(), angle.node(), 0.0),
            ("omega".into(), rate.node(), 5.0),
        ],
        derivatives: vec![rate.node(), (angle.sin() * -2.0 - rate * 0.02).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "enc".into(),
            output: angle.node(),
            noise: Level::Absolute(0.05),
            limits: None,
        }],
        process_noise: vec![0.0, 0.05],
        initial_variance: vec![1.0, 9.0],
        ranges: vec![open; 2],
        confined: None,
        whens: Default::default(),
    });
    model.unwrap().on(manifold)
}

/// A rotor that turns many times, by readings in ±π: every filter gives what it gives by readings that are not
/// wrapped, and so does the smoother.
#[test]
fn a_wrapped_encoder_is_one_that_is_not() {
    let dial = Manifold {
        circles: vec![0],
        dials: vec![0],
        ..Manifold::default()
    };
    let kinds = [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        FilterKind::MovingHorizon(5),
    ];
    for kind in kinds {
        let mut normal = Normal(7);
        let mut wrapping = estimator(rotor(dial.clone()), kind.clone(), true);
        let mut plain = estimator(rotor(Manifold::default()), kind, true);
        let (mut angle, mut rate) = (0.3_f64, 6.0_f64);
        for k in 0..400 {
            let t = STEP * f64::from(k);
            let reading = match k % 9 {
                5 => f64::NAN,
                _ => angle + 0.05 * normal.next(),
            };
            let own = wrapping.push(t, &[wrapped(reading)]).unwrap().to_vec();
            let other = plain.push(t, &[reading]).unwrap();
            for (own, other) in own.iter().zip(other) {
                assert!((own - other).abs() < 1e-9, "row {k}: {own} beside {other}");
            }
            let (one, other) = (wrapping.innovations()[0], plain.innovations()[0]);
            assert!((one.value - other.value).abs() < 1e-9);
            // fine steps of the plant
            for _ in 0..50 {
                let h = STEP / 50.0;
                rate += h * (-2.0 * angle.sin() - 0.02 * rate);
                angle += h * rate;
            }
        }
        assert!(angle > 10.0 * TAU, "{angle}");
        let rows = [&wrapping, &plain].map(|e| e.smoothed(None, true).unwrap());
        for (one, other) in rows[0].iter().zip(&rows[1]) {
            for (a, b) in one.estimate.iter().zip(&other.estimate) {
                assert!((a - b).abs() < 1e-8);
            }
        }
        // without [manifold] the same log tears the filter apart
        let mut torn = estimator(rotor(Manifold::default()), FilterKind::Extended, false);
        let mut off = 0.0_f64;
        for k in 0..100 {
            let angle = wrapped(0.5 * f64::from(k));
            torn.push(0.1 * f64::from(k), &[angle]).unwrap();
            off = off.max(torn.innovations()[0].value.abs());
        }
        assert!(off > 3.0, "{off}");
    }
}

/// Vectors of the world: down and north.
const SEEN: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [0.5, 0.0, -0.866]];
const NOISE: f64 = 0.05;
const DENSITIES: [f64; 2] = [1e-4, 1e-6];

/// A body with a gyroscope of unknown offset, which sees two vectors of the world.
fn body(start: [f64; 4], variances: [f64; 2]) -> NoisyModel {
    shaken(start, variances, DENSITIES)
}

/// The same, moved by other noises.
fn shaken(start: [f64; 4], variances: [f64; 2], densities: [f64; 2]) -> NoisyModel {
    let g = Graph::new();
    let time = g.symbol("time");
    let q = ["q1", "q2", "q3", "q4"].map(|name| g.symbol(name));
    let b = ["b1", "b2", "b3"].map(|name| g.symbol(name));
    let w = ["w1", "w2", "w3"].map(|name| g.symbol(name));
    let r: Vec<Expr<'_>> = w.iter().zip(b).map(|(w, b)| *w - b).collect();
    let rates = [
        -q[1] * r[0] - q[2] * r[1] - q[3] * r[2],
        q[0] * r[0] + q[2] * r[2] - q[3] * r[1],
        q[0] * r[1] - q[1] * r[2] + q[3] * r[0],
        q[0] * r[2] + q[1] * r[1] - q[2] * r[0],
    ];
    let zero = g.constant(0.0);
    let mut derivatives: Vec<_> = rates.map(|rate| (rate * 0.5).node()).to_vec();
    derivatives.extend([zero.node(); 3]);
    let [a, x, y, z] = q;
    // the rows of Rᵀ, the world in the body's axes
    let rows = [
        [
            a * a + x * x - y * y - z * z,
            (x * y + a * z) * 2.0,
            (x * z - a * y) * 2.0,
        ],
        [
            (x * y - a * z) * 2.0,
            a * a - x * x + y * y - z * z,
            (y * z + a * x) * 2.0,
        ],
        [
            (x * z + a * y) * 2.0,
            (y * z - a * x) * 2.0,
            a * a - x * x - y * y + z * z,
        ],
    ];
    let seen = SEEN
        .iter()
        .flat_map(|v| rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]));
    let names = q.iter().chain(&b).enumerate();
    let states = names.map(|(i, x)| (format!("x{i}"), x.node(), *start.get(i).unwrap_or(&0.0)));
    let [of_q, of_b] = densities;
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: states.collect(),
        derivatives,
        inputs: w.iter().map(|w| (format!("{w:?}"), w.node())).collect(),
        sensors: seen
            .enumerate()
            .map(|(i, output)| Sensor {
                name: format!("y{i}"),
                output: output.node(),
                noise: Level::Absolute(NOISE),
                limits: None,
            })
            .collect(),
        process_noise: [vec![0.25 * of_q; 4], vec![of_b; 3]].concat(),
        initial_variance: [vec![0.25 * variances[0]; 4], vec![variances[1]; 3]].concat(),
        ranges: vec![],
        confined: None,
        whens: Default::default(),
    });
    model.unwrap().on(Manifold {
        rotations: vec![0],
        ..Manifold::default()
    })
}

/// The world's vectors as a body sees them.
fn shown(q: [f64; 4]) -> Vec<Vector3<f64>> {
    let [w, x, y, z] = q;
    let rotation = Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    );
    SEEN.iter()
        .map(|v| rotation.transpose() * Vector3::from_row_slice(v))
        .collect()
}

/// The filter with a multiplicative error as textbooks have it: P is that of the vector of the rotation and of the
/// offset; Joseph's form.
struct Multiplicative {
    q: [f64; 4],
    b: Vector3<f64>,
    p: DMatrix<f64>,
}

impl Multiplicative {
    fn new(q: [f64; 4], variances: [f64; 2]) -> Self {
        let [of_q, of_b] = variances;
        let diagonal = [of_q, of_q, of_q, of_b, of_b, of_b];
        Self {
            q,
            b: Vector3::zeros(),
            p: DMatrix::from_diagonal(&DVector::from_row_slice(&diagonal)),
        }
    }

    fn predict(&mut self, h: f64, w: &Vector3<f64>) {
        // parts of the interval, as fine as rounding
        let parts = 40;
        let h = h / f64::from(parts);
        let rate = w - self.b;
        let mut f = DMatrix::zeros(6, 6);
        f.view_mut((0, 0), (3, 3)).copy_from(&-rate.cross_matrix());
        f.view_mut((0, 3), (3, 3)).copy_from(&-Matrix3::identity());
        let transition = DMatrix::identity(6, 6) + &f * h + &f * &f * (h * h / 2.0);
        let [of_q, of_b] = DENSITIES;
        let density = [of_q, of_q, of_q, of_b, of_b, of_b];
        let density = DMatrix::from_diagonal(&DVector::from_row_slice(&density));
        for _ in 0..parts {
            let noise = (&transition * &density * transition.transpose() + &density) * (h / 2.0);
            self.p = &transition * &self.p * transition.transpose() + noise;
            self.q = turned(self.q, (rate * h).into());
        }
    }

    fn correct(&mut self, readings: &[f64]) {
        let seen = shown(self.q);
        let mut c = DMatrix::zeros(6, 6);
        let mut innovation = DVector::zeros(6);
        for (k, v) in seen.iter().enumerate() {
            c.view_mut((3 * k, 0), (3, 3)).copy_from(&v.cross_matrix());
            (0..3).for_each(|i| innovation[3 * k + i] = readings[3 * k + i] - v[i]);
        }
        let noise = DMatrix::identity(6, 6) * (NOISE * NOISE);
        let spread = &c * &self.p * c.transpose() + &noise;
        let gain = &self.p * c.transpose() * spread.try_inverse().unwrap();
        let moved = &gain * innovation;
        let kept = DMatrix::identity(6, 6) - &gain * c;
        self.p = &kept * &self.p * kept.transpose() + &gain * noise * gain.transpose();
        self.q = turned(self.q, [moved[0], moved[1], moved[2]]);
        self.b += Vector3::new(moved[3], moved[4], moved[5]);
    }

    fn deviation(&self) -> f64 {
        (0..3).map(|i| self.p[(i, i)]).sum::<f64>().sqrt()
    }
}

/// A run of a body: rows of true attitude, offset, rates and readings.
struct Flight {
    normal: Normal,
    q: [f64; 4],
    b: Vector3<f64>,
}

impl Flight {
    fn rates(t: f64) -> Vector3<f64> {
        let turning = [
            0.5 * (0.7 * t).sin(),
            0.4 * (0.5 * t).cos(),
            0.3 * (0.3 * t + 1.0).sin(),
        ];
        Vector3::from_row_slice(&turning)
    }

    fn readings(&mut self) -> Vec<f64> {
        let seen = shown(self.q);
        let all = seen.iter().flat_map(|v| v.iter().copied());
        all.map(|y| y + NOISE * self.normal.next()).collect()
    }

    /// The gyroscope reads `w` for a while; what it does not say is white.
    fn go(&mut self, w: &Vector3<f64>) {
        let parts = 20;
        let h = STEP / f64::from(parts);
        let [of_q, of_b] = DENSITIES.map(|q| (q * h).sqrt());
        for _ in 0..parts {
            let rate = w - self.b;
            let vector = std::array::from_fn(|i| rate[i] * h + of_q * self.normal.next());
            self.q = turned(self.q, vector);
            (0..3).for_each(|i| self.b[i] += of_b * self.normal.next());
        }
    }
}

/// From 120° off: as the filter that is written down, attitude, offset and deviation.
#[test]
fn an_attitude_from_far_off_is_that_of_the_multiplicative_filter() {
    let (start, variances) = ([0.5; 4], [4.0, 0.01]);
    let mut flight = Flight {
        normal: Normal(3),
        q: [1.0, 0.0, 0.0, 0.0],
        b: Vector3::new(0.05, -0.03, 0.02),
    };
    let mut reference = Multiplicative::new(start, variances);
    // any multiple of a quaternion is the same rotation
    let model = body(start.map(|x| 3.0 * x), variances);
    let mut own = estimator(model, FilterKind::Extended, true);
    assert!((angle_between(start, flight.q) - TAU / 3.0).abs() < 1e-12);
    let mut squares = [0.0; 2];
    for k in 0..600 {
        let t = STEP * f64::from(k);
        let w = Flight::rates(t);
        let readings = flight.readings();
        let signals = [readings.as_slice(), w.as_slice()].concat();
        let estimate = own.push(t, &signals).unwrap();
        reference.correct(&readings);
        let q: [f64; 4] = std::array::from_fn(|i| estimate[i]);
        assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14);
        let off = angle_between(q, reference.q);
        assert!(off < 2e-6, "row {k}: {off}");
        assert!((0..3).all(|i| (estimate[4 + i] - reference.b[i]).abs() < 2e-6));
        let deviations = own.deviations().unwrap();
        let deviation = 2.0 * deviations[..4].iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((deviation / reference.deviation() - 1.0).abs() < 1e-4);
        if k >= 300 {
            squares[0] += angle_between(q, flight.q).powi(2);
            squares[1] += angle_between(reference.q, flight.q).powi(2);
        }
        reference.predict(STEP, &w);
        flight.go(&w);
    }
    let [own_rms, reference] = squares.map(|sum: f64| (sum / 300.0).sqrt().to_degrees());
    assert!(
        own_rms < 1.001 * reference && own_rms < 2.5,
        "{own_rms}° beside {reference}°"
    );
}

/// What a filter's errors are in its own deviations: the normalised error squared of attitude and offset (6 in the mean),
/// and the share within two deviations of the angle's root mean square.
fn consistency(kind: &FilterKind, runs: u64, from: f64) -> [f64; 4] {
    let (mut squares, mut within, mut rows) = (0.0, 0.0, 0.0);
    let mut of_smoother = [0.0; 2];
    for seed in 0..runs {
        let mut normal = Normal(100 + seed);
        let q = unit(std::array::from_fn(|_| normal.next())).unwrap();
        let start = turned(q, std::array::from_fn(|_| from * normal.next()));
        let b = Vector3::from_fn(|_, _| 0.05 * normal.next());
        let mut flight = Flight { normal, q, b };
        let model = body(start, [from * from, 0.0025]);
        let mut own = estimator(model, kind.clone(), true);
        let mut truth = vec![];
        for k in 0..120 {
            let t = STEP * f64::from(k);
            let w = Flight::rates(t + seed as f64);
            let signals = [flight.readings().as_slice(), w.as_slice()].concat();
            let estimate = own.push(t, &signals).unwrap();
            let q: [f64; 4] = std::array::from_fn(|i| estimate[i]);
            let angle = angle_between(q, flight.q);
            let deviations = own.deviations().unwrap();
            let deviation = 2.0 * deviations[..4].iter().map(|x| x * x).sum::<f64>().sqrt();
            truth.push((flight.q, angle));
            if k >= 20 {
                squares += (angle / deviation).powi(2);
                within += f64::from(u8::from(angle < 2.0 * deviation));
                rows += 1.0;
            }
            flight.go(&w);
        }
        for (row, (q, angle)) in own.smoothed(None, false).unwrap().iter().zip(truth) {
            let found = std::array::from_fn(|i| row.estimate[i]);
            of_smoother[0] += angle_between(found, q).powi(2);
            of_smoother[1] += angle.powi(2);
        }
    }
    let [smooth, filtered] = of_smoother;
    [
        squares / rows,
        within / rows,
        (smooth / filtered).sqrt(),
        rows,
    ]
}

/// The mean square of the angle in its own deviations is 1; within two of them are 99.3 % where the three axes are alike,
/// and 95.4 % where one has all; and the smoother is nearer than the filter.
#[test]
fn deviations_of_rotations_are_true() {
    for kind in [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
    ] {
        let [ratio, within, smoother, _] = consistency(&kind, 30, 0.3);
        assert!((0.8..1.2).contains(&ratio), "{kind:?}: {ratio}");
        assert!(
            within > 0.95 && smoother < 0.8,
            "{kind:?}: {within}, {smoother}"
        );
    }
}

/// `cargo test -p lynkeus-run --test suite --release deviations_of_a_thousand -- --ignored --nocapture`: the figures of docs/ekf.md.
#[test]
#[ignore = "takes a minute"]
fn deviations_of_a_thousand_rotations() {
    for (name, kind) in [
        ("ekf", FilterKind::Extended),
        ("ukf", FilterKind::Unscented(SigmaPoints::default())),
    ] {
        for from in [0.05, 0.1, 0.3, 1.0] {
            let [ratio, within, smoother, rows] = consistency(&kind, 1000, from);
            println!(
                "{name}, {from} rad at the start: {ratio:.4} over {rows} rows, {:.2} % within 2 sd, smoother {smoother:.3} of the filter",
                100.0 * within
            );
            // from further off the first correction is far from linear
            assert!(from > 0.1 || (0.95..1.05).contains(&ratio), "{ratio}");
        }
    }
}

/// Gone on from a snapshot it is the same to the bit, and one of another manifold is refused.
#[test]
fn a_snapshot_goes_on() {
    let model = || body([0.9, 0.1, 0.2, 0.0], [0.1, 0.01]);
    let mut one = estimator(model(), FilterKind::Extended, true);
    let mut flight = Flight {
        normal: Normal(5),
        q: [1.0, 0.0, 0.0, 0.0],
        b: Vector3::zeros(),
    };
    let mut sample = |t: f64| {
        let w = Flight::rates(t);
        let signals = [flight.readings().as_slice(), w.as_slice()].concat();
        flight.go(&w);
        signals
    };
    for k in 0..20 {
        one.push(STEP * f64::from(k), &sample(STEP * f64::from(k)))
            .unwrap();
    }
    let snapshot = one.snapshot();
    let mut other = estimator(model(), FilterKind::Extended, true);
    other.restore(&snapshot).unwrap();
    let next = sample(1.0);
    assert_eq!(
        one.push(1.0, &next).unwrap(),
        other.push(1.0, &next).unwrap()
    );
    assert_eq!(one.smoothed(None, true), other.smoothed(None, true));
    let flat = model().on(Manifold::default());
    assert!(
        estimator(flat, FilterKind::Extended, true)
            .restore(&snapshot)
            .is_err()
    );
}

/// As long as its window has all rows, a moving horizon ends where least squares do over all of them: attitudes and
/// offsets of the newest row, from 120° off, each 0.2 rad moved between two rows (SciPy's `least_squares` in vectors of
/// rotation; W by C. F. Van Loan's exponential at the minimum itself).
#[test]
fn a_window_of_rotations_ends_in_the_minimum() {
    let rates = [
        [0.0, 0.18, -0.16],
        [-0.53, -0.27, -0.59],
        [0.04, 0.8, -0.3],
        [-0.37, 0.29, 0.21],
        [0.06, -0.56, -0.02],
        [0.42, -0.81, -0.27],
    ];
    let readings = [
        [0.032, 0.116, 0.883, 0.353, -0.371, -0.865],
        [-0.13, 0.131, 0.938, 0.483, 0.067, -0.892],
        [-0.221, -0.17, 1.04, 0.44, 0.497, -0.719],
        [-0.776, -0.287, 0.552, 0.871, 0.61, -0.125],
        [-0.77, -0.295, 0.395, 0.826, 0.532, -0.067],
        [-0.781, -0.164, 0.571, 0.922, 0.348, -0.118],
    ];
    let attitudes = [
        [0.9544918686, 0.0639121574, -0.0095548958, 0.2911515289],
        [0.9911524151, 0.0563329274, 0.0239003908, -0.1177805703],
        [0.905945636, -0.0362501305, 0.112462512, -0.4065717847],
        [0.794891435, 0.0459624947, 0.4664297425, -0.3853288866],
        [0.7795919695, 0.0438386185, 0.5135836252, -0.3557336033],
        [0.8535082549, 0.0377718639, 0.4567060854, -0.2480251935],
    ];
    let offsets = [
        [0.0, 0.0, 0.0],
        [0.0237354419, 0.0055850789, 0.1955305527],
        [0.0167707304, -0.067078205, 0.2917174688],
        [0.0671433008, -0.2064901807, 0.2153145828],
        [0.0321536231, -0.1707424724, 0.2063206758],
        [0.0607264347, -0.1694874575, 0.1041843763],
    ];
    let anywhere = Limits {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    let mut model = shaken([0.5; 4], [4.0, 0.04], [0.1, 0.01]);
    model.ranges = vec![anywhere; 7];
    let settings = FilterSettings {
        keep_history: true,
        ..FilterSettings::of(FilterKind::MovingHorizon(10))
    };
    let exact = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(40)),
        ..EstimatorSettings::default()
    };
    let mut window = Blueprint::filter(model, settings, exact)
        .estimator()
        .unwrap();
    for k in 0..6 {
        let signals = [&readings[k][..], &rates[k]].concat();
        let estimate = window.push(0.4 * k as f64, &signals).unwrap();
        let q = std::array::from_fn(|i| estimate[i]);
        let off = angle_between(q, attitudes[k]);
        assert!(off < 1e-6, "row {k}: {off}");
        for (found, expected) in estimate[4..].iter().zip(offsets[k]) {
            assert!(
                (found - expected).abs() < 1e-6,
                "row {k}: {found} {expected}"
            );
        }
    }
    // the smoother that is linearised about the minimum is at it
    let smoothed = window.smoothed(None, true).unwrap();
    let newest = smoothed.last().unwrap();
    let q = std::array::from_fn(|i| newest.estimate[i]);
    assert!(smoothed.len() == 6 && angle_between(q, attitudes[5]) < 1e-6);
}

/// A window shorter than the log, which smooths and goes on from a snapshot to the bit.
#[test]
fn a_window_of_rotations_goes_on() {
    let anywhere = Limits {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    let new = || {
        let mut model = body([0.5; 4], [4.0, 0.01]);
        model.ranges = vec![anywhere; 7];
        estimator(model, FilterKind::MovingHorizon(4), true)
    };
    let (mut window, mut restored) = (new(), new());
    let mut flight = Flight {
        normal: Normal(5),
        q: [1.0, 0.0, 0.0, 0.0],
        b: Vector3::new(0.05, -0.03, 0.02),
    };
    let mut truth = vec![];
    for k in 0..120 {
        let t = STEP * f64::from(k);
        let w = Flight::rates(t);
        let signals = [flight.readings().as_slice(), w.as_slice()].concat();
        let estimate = window.push(t, &signals).unwrap().to_vec();
        let length: f64 = estimate[..4].iter().map(|x| x * x).sum();
        assert!((length - 1.0).abs() < 1e-14);
        match k {
            60 => restored.restore(&window.snapshot()).unwrap(),
            61.. => assert_eq!(restored.push(t, &signals).unwrap(), estimate),
            _ => {}
        }
        truth.push((
            flight.q,
            angle_between(std::array::from_fn(|i| estimate[i]), flight.q),
        ));
        flight.go(&w);
    }
    let smoothed = window.smoothed(None, true).unwrap();
    assert_eq!(restored.smoothed(None, true).unwrap(), smoothed);
    let mut squares = [0.0; 2];
    for (row, (q, angle)) in smoothed.iter().zip(&truth) {
        let found = std::array::from_fn(|i| row.estimate[i]);
        squares[0] += angle_between(found, *q).powi(2);
        squares[1] += angle.powi(2);
    }
    assert!(squares[0] < squares[1], "{squares:?}");
    assert!(window.health().unsolved == 0);
}
