//! Filters and smoothers on linear plants beside the exact discrete Kalman filter and the smoother of
//! Rauch, Tung and Striebel, by matrix exponentials: whatever the interval between samples.

use lynkeus_expr::Graph;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor, SigmaPoints,
};
use lynkeus_run::{Blueprint, Estimator, EstimatorSettings, Level, Method, Step, Tolerances};
use nalgebra::{DMatrix, DVector};

/// x' = Fx + w, y = Cx + v.
struct Linear {
    name: &'static str,
    F: DMatrix<f64>,
    C: DMatrix<f64>,
    densities: Vec<f64>,
}

/// Numbers in [-1, 1] from a counter, by a hash.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }
}

fn plants() -> Vec<Linear> {
    let mut random = Random(7);
    let mut found = vec![];
    for n in [1, 2, 3, 5] {
        let shift = DMatrix::identity(n, n);
        let any = random.matrix(n, n);
        let skew = &any - any.transpose();
        let mut stiff = random.matrix(n, n) * 0.3 - &shift;
        // a fast state that feeds the others
        stiff.row_mut(n - 1).scale_mut(80.0);
        let kinds = [
            ("stable", random.matrix(n, n) - &shift * 1.5),
            ("unstable", random.matrix(n, n) + &shift * 0.2),
            ("oscillating", skew * 6.0 - &shift * 0.05),
            ("stiff", stiff),
        ];
        for (name, F) in kinds {
            let mut densities: Vec<f64> = (0..n).map(|_| random.next().abs()).collect();
            if n > 1 {
                // noise that reaches a state through others only
                densities[0] = 0.0;
            }
            let C = random.matrix(n.div_ceil(2), n);
            found.push(Linear {
                name,
                F,
                C,
                densities,
            });
        }
    }
    found
}

impl Linear {
    /// Φ and W over an interval: Van Loan's exponential over a short part of it, then doubled.
    fn flown(&self, interval: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.F.nrows();
        let doublings = (self.F.amax() * interval * n as f64).max(1.0).log2().ceil() as i32;
        let h = interval * 0.5_f64.powi(doublings);
        let mut both = DMatrix::zeros(2 * n, 2 * n);
        both.view_mut((0, 0), (n, n)).copy_from(&(-&self.F * h));
        let Q = DMatrix::from_diagonal(&DVector::from_vec(self.densities.clone()));
        both.view_mut((0, n), (n, n)).copy_from(&(Q * h));
        both.view_mut((n, n), (n, n))
            .copy_from(&(self.F.transpose() * h));
        let exponential = both.exp();
        let mut transition = exponential.view((n, n), (n, n)).transpose();
        let mut noise = &transition * exponential.view((0, n), (n, n));
        for _ in 0..doublings {
            noise = &noise + &transition * &noise * transition.transpose();
            transition = &transition * &transition;
        }
        (transition, noise)
    }

    fn filter(&self, kind: FilterKind, method: Method) -> Estimator {
        let g = Graph::new();
        let n = self.F.nrows();
        let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let row = |row: Vec<f64>| {
            let products = x.iter().zip(row).map(|(x, a)| *x * a);
            products
                .fold(g.constant(0.0), |sum, term| sum + term)
                .node()
        };
        let rows = |m: &DMatrix<f64>| -> Vec<_> {
            let rows = m.row_iter().map(|r| row(r.iter().copied().collect()));
            rows.collect()
        };
        let sensors = rows(&self.C).into_iter().enumerate();
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: g.symbol("time").node(),
            states: x
                .iter()
                .enumerate()
                .map(|(i, x)| (format!("x{i}"), x.node(), 0.3 * i as f64))
                .collect(),
            derivatives: rows(&self.F),
            inputs: vec![],
            sensors: sensors
                .map(|(i, output)| Sensor {
                    name: format!("y{i}"),
                    output,
                    noise: Level::Absolute(NOISE),
                    limits: None,
                })
                .collect(),
            process_noise: self.densities.clone(),
            initial_variance: vec![VARIANCE; n],
            ranges: vec![
                Limits {
                    low: -1e9,
                    high: 1e9,
                };
                n
            ],
            confined: None,
            whens: Default::default(),
        });
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let run = EstimatorSettings {
            method,
            ..EstimatorSettings::default()
        };
        Blueprint::filter(model.unwrap(), settings, run)
            .estimator()
            .unwrap()
    }
}

fn fine() -> Method {
    Method::Adaptive(Tolerances {
        relative: 1e-11,
        absolute: 1e-13,
        ..Tolerances::default()
    })
}

const NOISE: f64 = 0.2;
const VARIANCE: f64 = 0.4;
const ROWS: usize = 12;

/// Mean and covariance.
type Moments = (DVector<f64>, DMatrix<f64>);

/// The filter at each row, the smoother, and −log L.
struct Exact {
    filtered: Vec<Moments>,
    smoothed: Vec<Moments>,
    nll: f64,
}

fn exact(plant: &Linear, interval: f64, readings: &[DVector<f64>]) -> Exact {
    let (transition, noise) = plant.flown(interval);
    let (n, m) = (plant.F.nrows(), plant.C.nrows());
    let R = DMatrix::identity(m, m) * NOISE.powi(2);
    let mut x = DVector::from_fn(n, |i, _| 0.3 * i as f64);
    let mut P = DMatrix::identity(n, n) * VARIANCE;
    let (mut before, mut after) = (vec![], vec![]);
    let mut nll = 0.0;
    for (k, y) in readings.iter().enumerate() {
        if k > 0 {
            x = &transition * x;
            P = &transition * P * transition.transpose() + &noise;
        }
        before.push((x.clone(), P.clone()));
        // Joseph's form, sensor by sensor: a large P of an unstable plant cancels in any other
        for i in 0..m {
            let c = plant.C.row(i);
            let variance = (c * &P * c.transpose())[0] + R[(i, i)];
            let gain = &P * c.transpose() / variance;
            let innovation = y[i] - (c * &x)[0];
            nll += 0.5 * (innovation.powi(2) / variance + (std::f64::consts::TAU * variance).ln());
            x = &x + &gain * innovation;
            let left = DMatrix::identity(n, n) - &gain * c;
            P = &left * P * left.transpose() + &gain * gain.transpose() * R[(i, i)];
        }
        after.push((x.clone(), P.clone()));
    }
    let mut smooth: Vec<Moments> = vec![after[readings.len() - 1].clone()];
    for k in (0..readings.len() - 1).rev() {
        let (x, P) = &after[k];
        let (ahead, spread) = &before[k + 1];
        let inverse = spread.clone().pseudo_inverse(1e-14).unwrap();
        let gain = P * transition.transpose() * inverse;
        let (later, later_spread) = smooth.last().unwrap();
        smooth.push((
            x + &gain * (later - ahead),
            P + &gain * (later_spread - spread) * gain.transpose(),
        ));
    }
    smooth.reverse();
    Exact {
        filtered: after,
        smoothed: smooth,
        nll,
    }
}

/// Variances as a share of those of the filter, from which the smoother's are taken away.
fn compare(
    found: (&[f64], &[f64]),
    (x, P): &Moments,
    filter: &DMatrix<f64>,
    tolerance: f64,
    what: &str,
) {
    for i in 0..x.len() {
        let off = (found.0[i] - x[i]).abs() / (1.0 + x[i].abs());
        let spread = (found.1[i].powi(2) - P[(i, i)]).abs() / filter[(i, i)];
        assert!(
            off < tolerance && spread < tolerance,
            "{what}: x{i} off by {off:e}, variance by {spread:e}"
        );
    }
}

#[test]
fn filters_and_smoothers_are_exact_on_linear_plants_at_any_interval() {
    for plant in plants() {
        for interval in [0.02, 0.4, 3.0] {
            let mut random = Random(11);
            let m = plant.C.nrows();
            let reading = |_| DVector::from_fn(m, |_, _| random.next());
            let readings: Vec<DVector<f64>> = (0..ROWS).map(reading).collect();
            let Exact {
                filtered, smoothed, ..
            } = exact(&plant, interval, &readings);
            for kind in [
                FilterKind::Extended,
                FilterKind::Unscented(SigmaPoints::default()),
                FilterKind::MovingHorizon(4),
            ] {
                let what = format!("{} {kind:?} every {interval}", plant.name);
                let mut ours = plant.filter(kind, fine());
                for (k, y) in readings.iter().enumerate() {
                    ours.push(interval * k as f64, y.as_slice()).unwrap();
                    let deviations = ours.deviations().unwrap();
                    let found = (ours.estimate(), deviations);
                    let what = format!("{what}, row {k}");
                    compare(found, &filtered[k], &filtered[k].1, 1e-8, &what);
                }
                let rows = ours.smoothed(None, true).unwrap();
                for (k, (row, expected)) in rows.iter().zip(&smoothed).enumerate() {
                    let found = (&row.estimate[..], &row.deviations[..]);
                    let what = format!("{what}, smooth {k}");
                    compare(found, expected, &filtered[k].1, 1e-7, &what);
                }
            }
        }
    }
}

/// Integrators in a chain, in some order; noise drives the last of the chain, and a sensor shows the first.
fn chain(order: &[usize]) -> Linear {
    let n = order.len();
    let place = |link: usize| order.iter().position(|i| *i == link).unwrap();
    let mut F = DMatrix::zeros(n, n);
    (1..n).for_each(|link| F[(place(link - 1), place(link))] = 1.0);
    let mut C = DMatrix::zeros(1, n);
    C[(0, place(0))] = 1.0;
    let mut densities = vec![0.0; n];
    densities[place(n - 1)] = 2.0;
    Linear {
        name: "chain",
        F,
        C,
        densities,
    }
}

/// What noise makes of a state that it reaches through two others, or three, is less than the error of a step of Runge
/// and Kutta; what such a state has in common with the others is not.
#[test]
fn fixed_steps_are_of_order_four_wherever_the_noise_is() {
    let interval = 0.15;
    let orders: [&[usize]; 5] = [
        &[0, 1, 2],
        &[2, 1, 0],
        &[1, 2, 0],
        &[0, 1, 2, 3],
        &[2, 0, 3, 1],
    ];
    for order in orders {
        let plant = chain(order);
        let readings: Vec<DVector<f64>> = (0..40)
            .map(|k| DVector::from_element(1, (0.3 * f64::from(k)).sin()))
            .collect();
        let Exact { filtered, nll, .. } = exact(&plant, interval, &readings);
        for kind in [
            FilterKind::Extended,
            FilterKind::Unscented(SigmaPoints::default()),
            FilterKind::MovingHorizon(4),
        ] {
            let off = |substeps: usize| -> [f64; 2] {
                let mut ours = plant.filter(kind.clone(), Method::Rk4(Step::Substeps(substeps)));
                ours.keep_record();
                let (mut own, mut spread) = (0.0, 0.0_f64);
                for (k, y) in readings.iter().enumerate() {
                    ours.push(interval * k as f64, y.as_slice()).unwrap();
                    own -= ours.record().unwrap().log_likelihood;
                    let P = &filtered[k].1;
                    for (i, sd) in ours.deviations().unwrap().iter().enumerate() {
                        spread = spread.max((sd.powi(2) / P[(i, i)] - 1.0).abs());
                    }
                }
                [(own - nll).abs(), spread]
            };
            let [coarse, fine, finer] = [1, 4, 16].map(off);
            let all = coarse.into_iter().zip(fine).zip(finer);
            for ((coarse, fine), finer) in all {
                // 4⁴ is 256
                assert!(
                    coarse < 2e-2 && fine < 1e-4 && finer < fine / 200.0,
                    "{order:?} {kind:?}: {coarse:e}, {fine:e}, {finer:e}"
                );
            }
        }
    }
}
