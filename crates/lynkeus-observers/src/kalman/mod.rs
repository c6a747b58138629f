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
//! Nothing is required of the plant, and nothing is proved of the error.

mod settings;

use lynkeus_run::filter::{Bounds, FilterKind, SigmaPoints};
use lynkeus_structure::{Extended, Region, Standing};

use crate::estimate::{Copy, limited};
use crate::family::Form;
use crate::observer::FilterTuning;
use crate::stages::{FormBox, Found, Searched, Stages};
use crate::statement::{Statement, undecided};
use crate::tunable::Speed;
use crate::{
    Assumptions, Certificate, Design, DesignError, Examination, KeySpec, Tuning, TuningError,
};
use settings::Settings;
pub use settings::prior_variance;

pub(crate) use settings::is_or_has;

/// The tunable number of a filter: no equation reads it, the noises are the study's.
const NOISE_SCALE: &str = "process_noise_scale";
const NOISE_MEANING: &str = "multiplies the densities of process noise";

/// The family `ekf`.
#[derive(Clone, Copy, Debug)]
pub struct Ekf;

/// The family `ukf`.
#[derive(Clone, Copy, Debug)]
pub struct Ukf;

/// The family `mhe`.
#[derive(Clone, Copy, Debug)]
pub struct Mhe;

/// What each has of its own.
trait Kalman: Sync {
    const NAME: &'static str;
    const PAPER: &'static str;
    const WORDS: &'static str;
    const KEYS: &'static [&'static [KeySpec]];

    fn kind(extended: &Extended<'_>, tuning: &Tuning) -> Result<FilterKind, TuningError>;
}

impl Kalman for Ekf {
    const NAME: &'static str = "ekf";
    const PAPER: &'static str = "Jazwinski 1970, the extended Kalman filter, continuous-discrete";
    const WORDS: &'static str = "extended Kalman filter";
    const KEYS: &'static [&'static [KeySpec]] = &[&settings::KEYS, &settings::BOUNDS];

    fn kind(_: &Extended<'_>, _: &Tuning) -> Result<FilterKind, TuningError> {
        Ok(FilterKind::Extended)
    }
}

impl Kalman for Ukf {
    const NAME: &'static str = "ukf";
    const PAPER: &'static str = "Julier and Uhlmann 1997, the unscented Kalman filter";
    const WORDS: &'static str = "unscented Kalman filter";
    const KEYS: &'static [&'static [KeySpec]] =
        &[&settings::KEYS, &settings::BOUNDS, &settings::POINTS];

    fn kind(_: &Extended<'_>, tuning: &Tuning) -> Result<FilterKind, TuningError> {
        let SigmaPoints { alpha, beta, kappa } = SigmaPoints::default();
        let [own_alpha, own_beta, own_kappa] = &settings::POINTS;
        Ok(FilterKind::Unscented(SigmaPoints {
            alpha: tuning.positive(own_alpha.name)?.unwrap_or(alpha),
            beta: settings::number(tuning, own_beta)?.unwrap_or(beta),
            kappa: settings::number(tuning, own_kappa)?.unwrap_or(kappa),
        }))
    }
}

impl Kalman for Mhe {
    const NAME: &'static str = "mhe";
    const PAPER: &'static str = "Rao, Rawlings and Mayne 2003, moving-horizon estimation";
    const WORDS: &'static str = "moving-horizon estimator";
    const KEYS: &'static [&'static [KeySpec]] = &[&settings::KEYS, &settings::WINDOW];

    fn kind(extended: &Extended<'_>, tuning: &Tuning) -> Result<FilterKind, TuningError> {
        let [horizon] = &settings::WINDOW;
        let length = match settings::number(tuning, horizon)? {
            None => settings::HORIZON,
            Some(x) if x >= 1.0 && x.fract() == 0.0 && x <= 1e4 => x as usize,
            Some(x) => return Err(horizon.wrong(x)),
        };
        Ok(FilterKind::MovingHorizon(length, ranges(extended)))
    }
}

/// The declared range of each state.
fn ranges(extended: &Extended<'_>) -> Vec<Bounds> {
    let bounds = extended.states.iter().map(|state| Bounds {
        low: state.min,
        high: state.max,
    });
    bounds.collect()
}

impl<K: Kalman> Stages for K {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = ();
    const NAME: &'static str = K::NAME;
    const PAPER: &'static str = K::PAPER;
    const BASIS: &'static str = "no theorem";
    const FORM_BOX: FormBox = FormBox::Declared;
    const IS_FILTER: bool = true;
    const KEYS: &'static [&'static [KeySpec]] = K::KEYS;

    fn read(extended: &Extended<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(extended, tuning, K::kind(extended, tuning)?)
    }

    fn form(extended: &Extended<'_>, _: &Settings, region: &Region) -> Searched<()> {
        let regularity = Statement::PlantIsRegular.with(extended.regularity(region)?);
        let jumps = match regularity.standing() {
            Standing::Refuted => format!(
                "; {}: the filter linearises beside such places",
                regularity.detail
            ),
            _ => String::new(),
        };
        let summary = format!(
            "the {} runs on any plant; no theorem bounds its error{jumps}",
            K::WORDS
        );
        let form = Form {
            summary,
            chains: vec![],
        };
        let examination = Examination::of_any_plant(K::NAME, form);
        Ok(Ok(Found {
            form: (),
            examination,
        }))
    }

    fn design(
        extended: &Extended<'_>,
        settings: &Settings,
        found: Found<()>,
    ) -> Result<Design, DesignError> {
        let copy = Copy::new(extended, &settings.common);
        let derivatives = copy.at_estimate(&extended.derivatives);
        let outputs: Vec<_> = extended.outputs.iter().map(|o| o.variable.node).collect();
        let limits = copy.hats.iter().zip(&extended.states);
        let limits =
            limits.map(|(hat, state)| (hat.symbol, limited(extended.graph(), hat.symbol, state)));
        let confined = extended.graph().substitute(&derivatives, &limits.collect());
        let mut observer = copy.observer(K::NAME, derivatives)?;
        let scale = Speed::new(&copy, NOISE_SCALE, 1.0, NOISE_MEANING.to_owned());
        observer = observer.tuned_by([&scale]);
        let variance = settings.variances(extended, &observer.states);
        observer.filter = Some(FilterTuning {
            kind: settings.kind.clone(),
            gate: settings.gate,
            bounds: settings.projects.then(|| ranges(extended)),
            outputs: copy.at_estimate(&outputs),
            confined,
            initial_variance: variance.iter().map(|v| v.value).collect(),
        });
        let parameters = variance.iter().zip(&extended.states).map(|(v, state)| {
            let from = if v.given { "" } else { " (from its range)" };
            (
                format!("initial variance of {}", state.name),
                format!("{}{from}", v.value),
            )
        });
        Ok(Design {
            observer,
            examination: found.examination,
            gains: vec![],
            parameters: parameters.collect(),
            notes: vec![],
        })
    }

    fn theorem(
        _: &Extended<'_>,
        _: &Settings,
        _: Found<()>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        let check = undecided(Statement::FilterConverges, NO_THEOREM);
        Ok(Certificate::new(Self::BASIS, assumptions, vec![check]))
    }
}

/// Why nothing is certified of a filter.
pub(crate) const NO_THEOREM: &str =
    "its gain depends on the run: no theorem holds on the whole box, however good it is on a log";
