//! What a filter knows along the run that trusts the model only as far as `[process_noise]` says: the
//! standard deviations of the extended Kalman filter itself, on readings without noise, a
//! sensor with limits as its readings tell on average.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus_model::Variable;
use lynkeus_observability::precision::Deviation;
use lynkeus_observers::{Initial, Tuning, Value};
use lynkeus_run::{Role, Simulation};

use super::experiment::Setup;
use crate::{Error, Study};
use lynkeus_experiment::course::filter;
use lynkeus_experiment::course::plant::{alone, seen};
use lynkeus_experiment::crew::within;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_study::{Name, Noise};

/// Nothing is known at the start: a standard deviation of so many ranges.
const PRIOR: f64 = 1000.0;

/// Standard deviations by horizon, then by quantity, in their units; none where the filter breaks down.
pub(super) fn filtered(
    prepared: &Prepared<'_>,
    setup: &Setup<'_>,
    mut run: Simulation,
) -> Result<Option<Vec<Vec<f64>>>, Error> {
    let (study, plant) = (prepared.study(), prepared.plant());
    let window = &setup.experiment.window;
    run.output_step = window.step;
    run.noise = lynkeus_run::Noise::default();
    let watch = &mut |_: f64| ControlFlow::Continue(());
    let Ok(truth) = alone(study, &run, watch) else {
        return Ok(None);
    };
    let first = |variables: &[Variable], role: Role, name: &str| {
        let place = variables.iter().position(|v| v.name == name)?;
        truth.column(role.at(place))?.first()
    };
    let start = |name: &str| {
        let state = first(&plant.states, Role::State, name);
        state.or(first(&plant.inputs, Role::Input, name))
    };
    let own = with_filter(study, setup, &start);
    let own = Prepared::new(&own, plant)?;
    let design = own.design()?;
    let samples = seen(plant, &design.observer, &truth);
    let watch = &mut within(&study.budget, watch);
    let deviations = filter::foreseen(&own, &design, &samples, watch)?;
    let at = |&horizon: &usize| -> Option<Vec<f64>> {
        deviations
            .iter()
            .map(|column| column.get(horizon))
            .collect()
    };
    Ok(window.horizons.iter().map(at).collect())
}

/// The study with the filter for its observer, the noises as they were assumed, and a start at the truth.
fn with_filter(study: &Study, setup: &Setup<'_>, start: &dyn Fn(&str) -> Option<f64>) -> Study {
    let mut own = study.clone();
    let quantities = || {
        setup
            .experiment
            .states
            .iter()
            .chain(&setup.experiment.unknown)
    };
    let variance = |scale: f64| Value::Number((PRIOR * scale).powi(2));
    let variances: BTreeMap<String, Value> = quantities()
        .map(|q| (q.name.clone(), variance(q.scale)))
        .collect();
    own.observer.family = Some(Name::from("ekf"));
    own.observer.tuning = Tuning {
        initial: Initial {
            default: None,
            values: quantities()
                .filter_map(|q| Some((q.name.clone(), start(&q.name)?)))
                .collect(),
        },
        clamp: false,
        tunable: false,
        values: BTreeMap::from([("initial_variance".to_owned(), Value::Table(variances))]),
        ..Tuning::default()
    };
    let sensors = setup.experiment.sensors.iter().take(setup.measured);
    own.sensors.noise = sensors
        .map(|sensor| {
            let noise = match sensor.noise {
                Deviation::Absolute(deviation) => Noise::Absolute(deviation),
                Deviation::Relative { share, .. } => Noise::Relative(share),
            };
            (Name::from(sensor.name.as_str()), noise)
        })
        .collect();
    own.estimate.smoothing = None;
    own
}
