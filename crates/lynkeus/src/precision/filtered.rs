//! What a filter knows along the run that trusts the model only as far as `[process_noise]` says: the
//! standard deviations of the extended Kalman filter itself, on readings without noise, a
//! sensor with limits as its readings tell on average.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus_model::Variable;
use lynkeus_observability::precision::Deviation;
use lynkeus_observers::{Design, Initial, Tuning, Value};
use lynkeus_run::{Role, Simulation, Updates};

use super::experiment::Setup;
use crate::course::replay::{Watch, replay};
use crate::course::{Course, Samples};
use crate::crew::within;
use crate::prepare::Prepared;
use crate::words::explain;
use crate::{Error, Series, Study, course::filter, estimate};
use lynkeus_study::{Name, Noise};

/// Nothing is known at the start: a standard deviation of so many ranges.
const PRIOR: f64 = 1000.0;

/// Standard deviations by horizon, then by quantity, in their units; none where the filter breaks down.
pub(super) fn filtered(
    prepared: &Prepared<'_>,
    setup: &Setup<'_>,
    mut run: Simulation,
) -> Result<Option<Vec<Vec<f64>>>, Error> {
    let plant = prepared.plant();
    let window = &setup.experiment.window;
    run.output_step = window.step;
    run.noise = lynkeus_run::Noise::default();
    let budget = prepared.study().budget.clone();
    let watch = &mut |_: f64| ControlFlow::Continue(());
    let Ok(truth) = run.run_watched(&mut within(&budget, watch)) else {
        return Ok(None);
    };
    let place = |variables: &[Variable], name: &str| variables.iter().position(|v| v.name == name);
    let column = |role: Role, at: Option<usize>| {
        at.and_then(|i| truth.column(role.at(i)))
            .unwrap_or_default()
    };
    let start = |name: &str| {
        let state = column(Role::State, place(&plant.states, name));
        let input = column(Role::Input, place(&plant.inputs, name));
        state.first().or(input.first()).copied()
    };
    let own = study(prepared.study(), setup, &start);
    let own = Prepared::new(&own, plant)?;
    let design = own.design()?;
    let observer = &design.observer;
    let samples = Samples {
        time: truth.times().to_vec().into(),
        readings: observer
            .measured
            .iter()
            .map(|s| {
                column(Role::Measured, place(&plant.outputs, &s.name))
                    .to_vec()
                    .into()
            })
            .collect(),
        inputs: observer
            .inputs
            .iter()
            .map(|s| {
                column(Role::Input, place(&plant.inputs, &s.name))
                    .to_vec()
                    .into()
            })
            .collect(),
    };
    let deviations = foreseen(&own, &design, &samples, &mut within(&budget, watch))?;
    let at = |&horizon: &usize| -> Option<Vec<f64>> {
        deviations
            .iter()
            .map(|column| column.get(horizon))
            .collect()
    };
    Ok(window.horizons.iter().map(at).collect())
}

/// The standard deviations of the filter on readings that stand for those that will come.
fn foreseen(
    own: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<Series>, Error> {
    let run = estimate::run_settings(&own.study().estimate);
    let notes = &mut vec![];
    let mut blueprint = filter::blueprint(own, design, samples, run, notes)?;
    if let Updates::Filter { settings, .. } = &mut blueprint.updates {
        settings.foresees = true;
    }
    let mut filter = blueprint.estimator().map_err(explain)?;
    let mut course = Course::default();
    let count = filter.names().len();
    replay(
        &mut filter,
        samples,
        count,
        &mut course,
        &mut Watch::only(watch),
    )?;
    Ok(course.deviations.unwrap_or_default())
}

/// The study with the filter for its observer, the noises as they were assumed, and a start at the truth.
fn study(study: &Study, setup: &Setup<'_>, start: &dyn Fn(&str) -> Option<f64>) -> Study {
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
