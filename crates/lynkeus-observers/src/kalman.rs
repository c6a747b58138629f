//! Kalman filters, for any plant: x' = f(t, x, u) + w, y = h(t, x, u) + v with white noises.
//!
//! The observer's flow is the plant itself, x̂' = f(t, x̂, u); the measurements correct the
//! estimate when they are taken, by the gain that follows from the noises
//! ([`lynkeus_run::filter`]). Unknown inputs are states with derivative 0 that wander.
//!
//! `ekf`: the extended Kalman filter, continuous-discrete (Jazwinski, *Stochastic Processes and
//! Filtering Theory*, 1970). `ukf`: the unscented Kalman filter (Julier and Uhlmann 1997; with
//! its default weights the cubature filter of Arasaratnam and Haykin 2009).
//!
//! `mhe`: moving-horizon estimation (Rao, Rawlings and Mayne, *IEEE Transactions on Automatic
//! Control* 48 (2003) 246–258), whose states stay within their declared ranges.
//!
//! `particle`: particles that are drawn and weighed, for what no Gaussian holds (Gordon, Salmond and Smith, *IEE
//! Proceedings F* 140 (1993) 107–113; Pitt and Shephard, *Journal of the American Statistical Association* 94 (1999) 590–599).
//!
//! Nothing is required of the plant, and nothing is proved of the error on a whole box.

use lynkeus_model::{Home, Variable};
use lynkeus_run::filter::{FilterKind, PATIENCE, Particles, SigmaPoints};
use lynkeus_structure::AugmentedPlant;

use crate::estimate::{PlantCopy, Speed, limited, no_such_estimate};
use crate::paper::lasting;
use crate::tuning::is_or_has;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, Family, FilterTuning, KeySpec,
    ParameterValue, Shape, Tuning, TuningError, Value,
};

/// The tunable number of a filter: no equation reads it, the noises are the study's.
const NOISE_SCALE: &str = "process_noise_scale";

const NOISE_MEANING: &str = "multiplies the densities of process noise";

/// A filter as a family.
struct Filter {
    name: &'static str,
    paper: &'static str,
    /// what people call it
    called: &'static str,
    keys: &'static [&'static [KeySpec]],
    smooths: bool,
    follows_jumps: bool,
    is_sampled: bool,
    kind: fn(&Tuning) -> Result<FilterKind, TuningError>,
}

/// The family `ekf`.
pub const EKF: &dyn Family = &Filter {
    name: "ekf",
    paper: "Jazwinski 1970, the extended Kalman filter, continuous-discrete",
    called: "extended Kalman filter",
    keys: &[&KEYS, &BOUNDS, &ITERATIONS],
    smooths: true,
    follows_jumps: true,
    is_sampled: false,
    kind: |_| Ok(FilterKind::Extended),
};

/// The family `ukf`.
pub const UKF: &dyn Family = &Filter {
    name: "ukf",
    paper: "Julier and Uhlmann 1997, the unscented Kalman filter",
    called: "unscented Kalman filter",
    keys: &[&KEYS, &BOUNDS, &POINTS],
    smooths: false,
    follows_jumps: true,
    is_sampled: false,
    kind: |tuning| {
        let SigmaPoints { alpha, beta, kappa } = SigmaPoints::default();
        let [own_alpha, own_beta, own_kappa] = &POINTS;
        Ok(FilterKind::Unscented(SigmaPoints {
            alpha: tuning.positive(own_alpha.name)?.unwrap_or(alpha),
            beta: number(tuning, own_beta)?.unwrap_or(beta),
            kappa: number(tuning, own_kappa)?.unwrap_or(kappa),
        }))
    },
};

/// The family `mhe`.
pub const MHE: &dyn Family = &Filter {
    name: "mhe",
    paper: "Rao, Rawlings and Mayne 2003, moving-horizon estimation",
    called: "moving-horizon estimator",
    keys: &[&KEYS, &WINDOW],
    smooths: false,
    follows_jumps: false,
    is_sampled: false,
    kind: |tuning| {
        let length = whole(tuning, &WINDOW[0], 1e4)?;
        Ok(FilterKind::MovingHorizon(length.unwrap_or(HORIZON)))
    },
};

/// The family `particle`.
pub const PARTICLE: &dyn Family = &Filter {
    name: "particle",
    paper: "Gordon, Salmond and Smith 1993, the bootstrap filter; Pitt and Shephard 1999, the auxiliary one; Whitaker and Hamill 2002, the ensemble",
    called: "particle filter",
    keys: &[&KEYS, &DRAWN],
    smooths: false,
    follows_jumps: true,
    is_sampled: true,
    kind: |tuning| {
        let own = Particles::default();
        let [count, proposal, inflation, below, seed] = &DRAWN;
        let share = number(tuning, below)?.unwrap_or(own.resample_below);
        if !(0.0..=1.0).contains(&share) {
            return Err(below.wrong(share));
        }
        let factor = number(tuning, inflation)?;
        let meant = tuning.meant(proposal, [0, 1, 2])?.unwrap_or(0);
        // a study has no number that is none
        if factor.is_some_and(|factor| factor < 1.0 || meant != 2) {
            let expected = "1 or more, with proposal = \"ensemble\"";
            return Err(TuningError::new(
                inflation.name,
                expected,
                factor.unwrap_or(1.0),
            ));
        }
        Ok(FilterKind::Particles(Particles {
            inflation: (meant == 2).then_some(factor.unwrap_or(1.0)),
            count: whole(tuning, count, Particles::MOST as f64)?.unwrap_or(own.count),
            looks_ahead: meant == 1,
            resample_below: share,
            seed: whole(tuning, seed, MOST_EXACT)?.unwrap_or(own.seed as usize) as u64,
        }))
    },
};

impl Filter {
    fn check(&self, augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<(), TuningError> {
        (self.kind)(tuning)?;
        tuning.checked()?;
        tuning.positive(GATE.name)?;
        patience(tuning)?;
        projects(tuning)?;
        iterations(augmented, tuning)?;
        variances(augmented, tuning).map(drop)
    }

    fn designed(
        &self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
        examination: Examination,
    ) -> Result<Design, DesignError> {
        let copy = PlantCopy::new(augmented, tuning);
        let derivatives = copy.at_estimate(&augmented.derivatives);
        let outputs: Vec<_> = augmented.outputs.iter().map(|o| o.variable.node).collect();
        let limits = copy.hats.iter().zip(&augmented.states);
        let limits =
            limits.map(|(hat, state)| (hat.symbol, limited(augmented.graph(), hat.symbol, state)));
        let confined = augmented
            .graph()
            .substitute(&derivatives, &limits.collect());
        let mut observer = copy.observer(derivatives)?;
        let scale = Speed::new(&copy, NOISE_SCALE, 1.0, NOISE_MEANING.to_owned());
        observer = observer.tuned_by([&scale]);
        let starts = observer.states.iter().map(|(_, start)| *start);
        let given = variances(augmented, tuning)?;
        let given = given.iter().zip(&augmented.states);
        let variance = given
            .clone()
            .zip(starts)
            .map(|((given, state), start)| given.unwrap_or_else(|| prior_variance(state, start)));
        let variance: Vec<f64> = variance.collect();
        observer.filter = Some(FilterTuning {
            kind: (self.kind)(tuning)?,
            gate: tuning.positive(GATE.name)?,
            patience: patience(tuning)?,
            projects: projects(tuning)?,
            iterations: iterations(augmented, tuning)?,
            outputs: copy.at_estimate(&outputs),
            whens: copy.whens(),
            confined,
            initial_variance: variance.clone(),
        });
        let parameters = variance
            .iter()
            .zip(given)
            .map(|(variance, (given, state))| {
                let value = ParameterValue::Variance {
                    variance: *variance,
                    from_range: given.is_none(),
                };
                (format!("initial variance of {}", state.name), value)
            });
        Ok(Design {
            observer,
            examination,
            gains: vec![],
            parameters: parameters.collect(),
            notes: vec![],
        })
    }
}

impl Family for Filter {
    fn name(&self) -> &'static str {
        self.name
    }

    fn paper(&self) -> &'static str {
        self.paper
    }

    fn keys(&self) -> Vec<&'static KeySpec> {
        self.keys.iter().copied().flatten().collect()
    }

    fn is_filter(&self) -> bool {
        true
    }

    fn smooths(&self) -> bool {
        self.smooths
    }

    fn follows_jumps(&self) -> bool {
        self.follows_jumps
    }

    fn is_sampled(&self) -> bool {
        self.is_sampled
    }

    fn verify(&self, augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<(), TuningError> {
        self.check(augmented, tuning)
    }

    fn examine(
        &'static self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        self.check(augmented, tuning)?;
        Ok(Examination::of_any_plant(self, self.called))
    }

    fn design(
        &'static self,
        augmented: &AugmentedPlant<'_>,
        tuning: &Tuning,
    ) -> Result<Design, DesignError> {
        self.check(augmented, tuning)?;
        let examination = Examination::of_any_plant(self, self.called);
        lasting(augmented, || self.designed(augmented, tuning, examination))
    }

    fn theorem(
        &self,
        _: &AugmentedPlant<'_>,
        _: &Tuning,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        Ok(Certificate::of_filter("no theorem", assumptions))
    }
}

const VARIANCE: KeySpec = KeySpec {
    name: "initial_variance",
    shape: Shape::As(
        "table: name = number ≥ 0, an array = list of them, and `default`",
        &Shape::Table(&Shape::Either(&[
            Shape::NotNegative,
            Shape::List(&Shape::NotNegative),
        ])),
    ),
    default: "the square of a quarter of the declared range (without a range: of the start value, or 1; of an angle or a rotation: of a turn)",
    meaning: "how uncertain the first estimate is: the variance of each state and unknown input; `default` holds for everything not listed",
};

const GATE: KeySpec = KeySpec {
    name: "gate",
    shape: Shape::Positive,
    default: "none",
    meaning: "a reading whose innovation exceeds so many of its standard deviations is rejected and counted",
};

const GATE_PATIENCE: KeySpec = KeySpec {
    name: "gate_patience",
    shape: Shape::Whole(1),
    default: "10",
    meaning: "after so many rejections of a sensor in a row, at least half of which moved, its next reading is accepted",
};

/// Those of every filter.
const KEYS: [KeySpec; 3] = [VARIANCE, GATE, GATE_PATIENCE];

/// That of the filters that may go anywhere.
const BOUNDS: [KeySpec; 1] = [KeySpec {
    name: "bounds",
    shape: Shape::As("\"project\"", &Shape::Word(&["project"])),
    default: "none",
    meaning: "\"project\" keeps the estimate in the declared ranges `[min, max]`: each prediction and correction moves it to the nearest point inside in the metric of the covariance, so that correlated quantities move along; the covariance stays",
}];

/// That of the filter that linearises what the sensors show.
const ITERATIONS: [KeySpec; 1] = [KeySpec {
    name: "iterations",
    shape: Shape::Whole(1),
    default: "1; 20 with a quaternion",
    meaning: "how often, at most, the readings of a sample are linearised: about the prediction, then about the resulting estimate, until it stays (the iterated extended Kalman filter); for a start that is far off, with nonlinear sensors",
}];

/// Those where a sum of states is none.
const CURVED: usize = 20;

/// Those of the unscented filter.
const POINTS: [KeySpec; 3] = [
    KeySpec {
        name: "alpha",
        shape: Shape::Positive,
        default: "1",
        meaning: "α, the spread of the sigma points: λ = α²(n + κ) − n",
    },
    KeySpec {
        name: "beta",
        shape: Shape::Number,
        default: "0",
        meaning: "β, what the first weight of the covariance gets on top",
    },
    KeySpec {
        name: "kappa",
        shape: Shape::Number,
        default: "0",
        meaning: "κ, with n + κ above 0; the defaults make the cubature filter",
    },
];

/// Samples in the window where the study does not say.
const HORIZON: usize = 10;

/// That of the moving-horizon estimator.
const WINDOW: [KeySpec; 1] = [KeySpec {
    name: "horizon",
    shape: Shape::Whole(1),
    default: "10",
    meaning: "number of samples in the window that is estimated at each sample, within `[min, max]`",
}];

/// Whole numbers up to here are those of a study.
const MOST_EXACT: f64 = 9_007_199_254_740_992.0;

/// Those of particles.
const DRAWN: [KeySpec; 5] = [
    KeySpec {
        name: "particles",
        shape: Shape::Whole(2),
        default: "1000",
        meaning: "how many; the error that they add falls with the root of their number",
    },
    KeySpec {
        name: "proposal",
        shape: Shape::Word(&["bootstrap", "auxiliary", "ensemble"]),
        default: "`\"bootstrap\"`",
        meaning: "\"bootstrap\": particles run, then are weighed; \"auxiliary\": those are drawn to run that the flow without noise takes to where the next readings are likely, which pays where readings are precise and the process noise is small; \"ensemble\": none is weighed, and readings move all together by Kalman's formula with their covariances, for many states that few runs of the plant have to stand for",
    },
    KeySpec {
        name: "inflation",
        shape: Shape::Number,
        default: "1",
        meaning: "of an ensemble: by this factor the particles are farther from their mean after each update, which makes up for their small number",
    },
    KeySpec {
        name: "resample_below",
        shape: Shape::Between {
            least: 0.0,
            most: 1.0,
        },
        default: "0.5",
        meaning: "particles are resampled when their effective number falls below this share of them; 1: after every reading",
    },
    KeySpec {
        name: "seed",
        shape: Shape::Whole(0),
        default: "0",
        meaning: "of the random numbers: the same seed gives the same digits, on any number of threads",
    },
];

/// A number of samples, readings or particles.
fn whole(tuning: &Tuning, key: &KeySpec, most: f64) -> Result<Option<usize>, TuningError> {
    let least = match key.shape {
        Shape::Whole(least) => f64::from(least),
        _ => 0.0,
    };
    match number(tuning, key)? {
        None => Ok(None),
        Some(x) if x >= least && x.fract() == 0.0 && x <= most => Ok(Some(x as usize)),
        Some(x) => Err(key.wrong(x)),
    }
}

/// The patience of the gate.
fn patience(tuning: &Tuning) -> Result<usize, TuningError> {
    Ok(whole(tuning, &GATE_PATIENCE, 1e4)?.unwrap_or(PATIENCE))
}

/// How often the readings of a sample are linearised, at most.
fn iterations(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<usize, TuningError> {
    let is_rotation = |state: &Variable| matches!(state.home, Home::Rotation { .. });
    let usual = match augmented.states.iter().any(is_rotation) {
        true => CURVED,
        false => 1,
    };
    Ok(whole(tuning, &ITERATIONS[0], 1e4)?.unwrap_or(usual))
}

/// Whether the estimate is kept in the declared ranges.
fn projects(tuning: &Tuning) -> Result<bool, TuningError> {
    Ok(tuning.meant(&BOUNDS[0], [true])?.is_some())
}

/// The square of a quarter of the range, of an angle and a rotation of a turn: two standard deviations reach its ends. Without a range, that of
/// the start value, or 1.
pub fn prior_variance(state: &Variable, start: f64) -> f64 {
    // what changes at events alone is known until then
    if state.discrete {
        return 0.0;
    }
    let width = state.width();
    match width.is_finite() && width > 0.0 {
        true => (width / 4.0).powi(2),
        false => start.powi(2).max(1.0),
    }
}

/// The variances as given, by augmented state.
fn variances(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
) -> Result<Vec<Option<f64>>, TuningError> {
    let table = match tuning.values.get(VARIANCE.name) {
        None => return Ok(vec![None; augmented.states.len()]),
        Some(Value::Table(table)) => table,
        Some(other) => return Err(VARIANCE.wrong(other)),
    };
    let variance = |name: &str, value: &Value| {
        let number = value.number().filter(|x| *x >= 0.0 && x.is_finite());
        number.ok_or_else(|| VARIANCE.wrong(format!("{name} = {value}")))
    };
    let default = table.get("default").map(|value| variance("default", value));
    let mut found = vec![default.transpose()?; augmented.states.len()];
    for (name, value) in table.iter().filter(|(name, _)| *name != "default") {
        let value = variance(name, value)?;
        let mut meant = 0;
        for (state, found) in augmented.states.iter().zip(&mut found) {
            if is_or_has(name, &state.name) {
                *found = Some(value);
                meant += 1;
            }
        }
        if meant == 0 {
            return Err(no_such_estimate(augmented, VARIANCE.name, name));
        }
    }
    Ok(found)
}

/// A number under a key.
fn number(tuning: &Tuning, key: &KeySpec) -> Result<Option<f64>, TuningError> {
    tuning.read(key.name, &key.kind(), Value::number)
}
