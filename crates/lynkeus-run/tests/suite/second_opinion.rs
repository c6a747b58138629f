//! Filters and smoother beside an independent implementation, the crate `numeris`, which takes a
//! discrete plant: here the flow over a sample, by many Runge–Kutta steps of this test's own.

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor, SigmaPoints, Smoothed,
};
use lynkeus_run::{Blueprint, Estimator, EstimatorSettings, Level, Method, Tolerances};
use numeris::estimate::{Ckf, Ekf, EkfStep, Ukf, rts_smooth};
use numeris::{Matrix, Vector};

type State = Vector<f64, 2>;
type Square = Matrix<f64, 2, 2>;

const STEP: f64 = 0.15;
const DENSITIES: [f64; 2] = [0.01, 0.04];
const NOISES: [f64; 2] = [0.05, 0.2];
const START: [f64; 2] = [0.8, -0.1];
const VARIANCES: [f64; 2] = [0.3, 0.5];

/// f and h of the states.
type Equations<'g> = ([Expr<'g>; 2], [Expr<'g>; 2]);

/// A plant twice: in symbols for us, as functions for the other.
struct Plant {
    symbols: for<'g> fn([Expr<'g>; 2]) -> Equations<'g>,
    f: fn(&State) -> State,
    jacobian: fn(&State) -> Square,
    h: fn(&State) -> State,
    slopes: fn(&State) -> Square,
}

/// A level that follows its rate, a rate that decays; both and their sum are seen.
const LINEAR: Plant = Plant {
    symbols: |[x, v]| ([v, x * -0.5 - v * 0.3], [x, x + v]),
    f: |x| Vector::from_array([x[1], -0.5 * x[0] - 0.3 * x[1]]),
    jacobian: |_| Matrix::new([[0.0, 1.0], [-0.5, -0.3]]),
    h: |x| Vector::from_array([x[0], x[0] + x[1]]),
    slopes: |_| Matrix::new([[1.0, 0.0], [1.0, 1.0]]),
};

/// A pendulum, its horizontal place and its kinetic energy.
const PENDULUM: Plant = Plant {
    symbols: |[x, v]| ([v, x.sin() * -4.0 - v * 0.2], [x.sin(), v * v * 0.5]),
    f: |x| Vector::from_array([x[1], -4.0 * x[0].sin() - 0.2 * x[1]]),
    jacobian: |x| Matrix::new([[0.0, 1.0], [-4.0 * x[0].cos(), -0.2]]),
    h: |x| Vector::from_array([x[0].sin(), 0.5 * x[1] * x[1]]),
    slopes: |x| Matrix::new([[x[0].cos(), 0.0], [0.0, x[1]]]),
};

/// x, Φ and W over a sample.
#[derive(Clone, Copy)]
struct Flown {
    x: State,
    transition: Square,
    noise: Square,
}

impl Plant {
    fn rate(&self, z: &Flown) -> Flown {
        let F = (self.jacobian)(&z.x);
        let Q = Matrix::new([[DENSITIES[0], 0.0], [0.0, DENSITIES[1]]]);
        Flown {
            x: (self.f)(&z.x),
            transition: F * z.transition,
            noise: F * z.noise + z.noise * F.transpose() + Q,
        }
    }

    fn flown(&self, x: &State) -> Flown {
        let mut z = Flown {
            x: *x,
            transition: Matrix::eye(),
            noise: Matrix::zeros(),
        };
        let h = STEP / 200.0;
        let moved = |z: &Flown, k: &Flown, h: f64| Flown {
            x: z.x + k.x * h,
            transition: z.transition + k.transition * h,
            noise: z.noise + k.noise * h,
        };
        for _ in 0..200 {
            let k1 = self.rate(&z);
            let k2 = self.rate(&moved(&z, &k1, 0.5 * h));
            let k3 = self.rate(&moved(&z, &k2, 0.5 * h));
            let k4 = self.rate(&moved(&z, &k3, h));
            for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                z = moved(&z, &k, weight * h / 6.0);
            }
        }
        z
    }

    fn filter(&self, kind: FilterKind) -> Estimator {
        let g = Graph::new();
        let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
        let (derivatives, outputs) = (self.symbols)([x, v]);
        let sensors = outputs.iter().zip(NOISES).enumerate();
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: vec![
                ("x".into(), x.node(), START[0]),
                ("v".into(), v.node(), START[1]),
            ],
            derivatives: derivatives.iter().map(|d| d.node()).collect(),
            inputs: vec![],
            sensors: sensors
                .map(|(i, (output, noise))| Sensor {
                    name: format!("y{i}"),
                    output: output.node(),
                    noise: Level::Absolute(noise),
                    limits: None,
                })
                .collect(),
            process_noise: DENSITIES.to_vec(),
            initial_variance: VARIANCES.to_vec(),
            ranges: vec![
                Limits {
                    low: -100.0,
                    high: 100.0,
                };
                2
            ],
            confined: None,
            whens: Default::default(),
        });
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let run = EstimatorSettings {
            method: Method::Explicit(Tolerances {
                relative: 1e-12,
                absolute: 1e-14,
                ..Tolerances::default()
            }),
            ..EstimatorSettings::default()
        };
        Blueprint::filter(model.unwrap(), settings, run)
            .estimator()
            .unwrap()
    }
}

/// Readings of a truth that nobody's model makes.
fn readings() -> Vec<[f64; 2]> {
    let row = |k: i32| {
        let t = STEP * f64::from(k);
        [
            0.7 * (1.9 * t).cos() + 0.03 * (17.0 * t).sin(),
            0.4 + 0.3 * (3.1 * t).sin(),
        ]
    };
    (0..60).map(row).collect()
}

fn noise() -> Square {
    Matrix::new([[NOISES[0].powi(2), 0.0], [0.0, NOISES[1].powi(2)]])
}

fn start() -> (State, Square) {
    let variances = Matrix::new([[VARIANCES[0], 0.0], [0.0, VARIANCES[1]]]);
    (Vector::from_array(START), variances)
}

fn agree(ours: (&[f64], &[f64]), x: &State, P: &Square, what: &str) {
    for i in 0..2 {
        let (off, spread) = (ours.0[i] - x[i], ours.1[i] - P[(i, i)].sqrt());
        assert!(
            off.abs() < 1e-9 && spread.abs() < 1e-9,
            "{what}: {off} {spread}"
        );
    }
}

#[test]
fn ekf_and_smoother() {
    for plant in [LINEAR, PENDULUM] {
        let mut ours = plant.filter(FilterKind::Extended);
        let (x, P) = start();
        let mut theirs = Ekf::<f64, 2, 2>::new(x, P);
        let mut steps = vec![];
        for (k, y) in readings().into_iter().enumerate() {
            let flown = plant.flown(theirs.state());
            if k > 0 {
                theirs.predict(|_| flown.x, |_| flown.transition, Some(&flown.noise));
            }
            let before = (*theirs.state(), *theirs.covariance());
            theirs
                .update(&Vector::from_array(y), plant.h, plant.slopes, &noise())
                .unwrap();
            ours.push(STEP * k as f64, &y).unwrap();
            let (x, P) = (theirs.state(), theirs.covariance());
            agree(
                (ours.estimate(), ours.deviations().unwrap()),
                x,
                P,
                &format!("filter, row {k}"),
            );
            steps.push(EkfStep {
                x_predicted: before.0,
                p_predicted: before.1,
                x_updated: *x,
                p_updated: *P,
                f_jacobian: flown.transition,
            });
        }
        smoothers_agree(&ours.smoothed(None, true).unwrap(), &steps);
    }
}

fn smoothers_agree(ours: &[Smoothed], steps: &[EkfStep<f64, 2>]) {
    let theirs = rts_smooth(steps).unwrap();
    for (k, ((x, P), ours)) in theirs.iter().zip(ours).enumerate() {
        let what = format!("smoother, row {k}");
        agree((&ours.estimate, &ours.deviations), x, P, &what);
    }
}

/// The F for which PFᵀ is the covariance of the cubature points before and after a flow: their
/// smoother's gain is then that of Rauch, Tung and Striebel.
fn carried(x: &State, P: &Square, flow: impl Fn(&State) -> State) -> Square {
    let first = P[(0, 0)].sqrt();
    let below = P[(1, 0)] / first;
    let L: Square = Matrix::new([[first, 0.0], [below, (P[(1, 1)] - below * below).sqrt()]]);
    let mut cross: Square = Matrix::zeros();
    for column in 0..2 {
        for sign in [1.0, -1.0] {
            let off = [L[(0, column)], L[(1, column)]].map(|l| sign * 2.0_f64.sqrt() * l);
            let image = flow(&(*x + Vector::from_array(off)));
            for i in 0..2 {
                for j in 0..2 {
                    cross[(i, j)] += 0.25 * off[i] * image[j];
                }
            }
        }
    }
    let determinant = P[(0, 0)] * P[(1, 1)] - P[(0, 1)] * P[(1, 0)];
    let adjugate: Square = Matrix::new([[P[(1, 1)], -P[(0, 1)]], [-P[(1, 0)], P[(0, 0)]]]);
    cross.transpose() * adjugate * (1.0 / determinant)
}

/// The default is the cubature filter; the other points have a weight in their centre.
#[test]
fn ukf() {
    let spread = SigmaPoints {
        alpha: 0.9,
        beta: 2.0,
        kappa: 1.0,
    };
    for plant in [LINEAR, PENDULUM] {
        let mut cubature = plant.filter(FilterKind::Unscented(SigmaPoints::default()));
        let mut unscented = plant.filter(FilterKind::Unscented(spread));
        let (x, P) = start();
        let mut ckf = Ckf::<f64, 2, 2>::new(x, P);
        let mut steps = vec![];
        let mut ukf = Ukf::<f64, 2, 2>::with_params(x, P, spread.alpha, spread.beta, spread.kappa);
        for (k, y) in readings().into_iter().enumerate() {
            let flow = |x: &State| plant.flown(x).x;
            let carried = carried(ckf.state(), ckf.covariance(), flow);
            if k > 0 {
                // what the process noise comes to along each estimate
                let noise = |x: &State| plant.flown(x).noise;
                let (of_ckf, of_ukf) = (noise(ckf.state()), noise(ukf.state()));
                ckf.predict(flow, Some(&of_ckf)).unwrap();
                ukf.predict(flow, Some(&of_ukf)).unwrap();
            }
            let before = (*ckf.state(), *ckf.covariance());
            let z = Vector::from_array(y);
            ckf.update(&z, plant.h, &noise()).unwrap();
            ukf.update(&z, plant.h, &noise()).unwrap();
            let t = STEP * k as f64;
            cubature.push(t, &y).unwrap();
            unscented.push(t, &y).unwrap();
            let what = format!("row {k}");
            let ours = |filter: &Estimator| {
                let deviations = filter.deviations().unwrap();
                (filter.estimate().to_vec(), deviations.to_vec())
            };
            let (x, d) = ours(&cubature);
            agree((&x, &d), ckf.state(), ckf.covariance(), &what);
            let (x, d) = ours(&unscented);
            agree((&x, &d), ukf.state(), ukf.covariance(), &what);
            steps.push(EkfStep {
                x_predicted: before.0,
                p_predicted: before.1,
                x_updated: *ckf.state(),
                p_updated: *ckf.covariance(),
                f_jacobian: carried,
            });
        }
        let smoothed = cubature.smoothed(None, true).unwrap();
        smoothers_agree(&smoothed, &steps);
    }
}

impl Plant {
    /// The filter of the plant linearised along a trajectory.
    fn linearised(&self, about: &[State]) -> Vec<EkfStep<f64, 2>> {
        let (x, P) = start();
        let mut theirs = Ekf::<f64, 2, 2>::new(x, P);
        let mut steps = vec![];
        for (k, y) in readings().into_iter().enumerate() {
            let before_it = about[k.saturating_sub(1)];
            let flown = self.flown(&before_it);
            if k > 0 {
                let flow = |x: &State| flown.x + flown.transition * (*x - before_it);
                theirs.predict(flow, |_| flown.transition, Some(&flown.noise));
            }
            let before = (*theirs.state(), *theirs.covariance());
            let C = (self.slopes)(&about[k]);
            let h = |x: &State| (self.h)(&about[k]) + C * (*x - about[k]);
            let z = Vector::from_array(y);
            theirs.update(&z, h, |_| C, &noise()).unwrap();
            steps.push(EkfStep {
                x_predicted: before.0,
                p_predicted: before.1,
                x_updated: *theirs.state(),
                p_updated: *theirs.covariance(),
                f_jacobian: flown.transition,
            });
        }
        steps
    }
}

/// A window over everything is the smoother that is linearised about its own result; a short
/// one comes close to it.
#[test]
fn mhe_smoother() {
    for plant in [LINEAR, PENDULUM] {
        let [all, few] = [100, 6].map(|length| {
            let mut ours = plant.filter(FilterKind::MovingHorizon(length));
            let mut filtered = vec![];
            for (k, y) in readings().into_iter().enumerate() {
                let x = ours.push(STEP * k as f64, &y).unwrap();
                filtered.push(Vector::from_array([x[0], x[1]]));
            }
            (ours.smoothed(None, true).unwrap(), filtered)
        });
        let mut about = all.1;
        let mut theirs = vec![];
        for _ in 0..40 {
            theirs = rts_smooth(&plant.linearised(&about)).unwrap();
            about = theirs.iter().map(|(x, _)| *x).collect();
        }
        for (k, ((x, P), (ours, few))) in theirs.iter().zip(all.0.iter().zip(few.0)).enumerate() {
            for i in 0..2 {
                let sd = P[(i, i)].sqrt();
                let off = (ours.estimate[i] - x[i]) / sd;
                let spread = ours.deviations[i] / sd - 1.0;
                assert!(
                    off.abs() < 1e-5 && spread.abs() < 1e-5,
                    "row {k}: {off} {spread}"
                );
                let off = (few.estimate[i] - x[i]) / sd;
                assert!(off.abs() < 0.2, "row {k}, six samples: {off}");
            }
        }
    }
}
