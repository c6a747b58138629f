//! One value in simulation: an observer runs along with the plant, a filter on samples of it.

use std::ops::ControlFlow;

use lynkeus_observers::{Design, Observer};
use lynkeus_run::{Events, Role, Simulation};

use super::disturbed::disturbed;
use super::record::{course, told};
use super::reference::Reference;
use super::speed::{longest_step, transparent};
use crate::course::curved;
use crate::course::plant::{self, Ran, Shown, closed_loop, open_loop};
use crate::crew::Watch;
use crate::prepare::Prepared;
use crate::prepare::systems::{self, monitor_column, settings};
use crate::thrifty::thrifty;
use crate::{Error, ErrorKind};

/// What a value is run under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Under {
    /// sensors without noise
    Exact,
    Noise,
    /// sensors without noise, and `disturbance` of `[tune]` on the plant's inputs
    Disturbance,
}

/// The study's simulation, the same for every value.
#[derive(Debug)]
pub(super) struct Simulated {
    pub reference: Reference,
    /// what filters run on
    samples: Option<Sampled>,
}

/// Samples of the plant.
#[derive(Debug)]
struct Sampled {
    exact: Shown,
    noisy: Shown,
    /// none where no disturbance is stated; or why the plant has no run under it
    disturbed: Option<Result<Shown, String>>,
}

impl Simulated {
    /// With samples every so often for a filter.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn new(prepared: &Prepared<'_>, filter: Option<(&Observer, f64)>) -> Result<Self, Error> {
        let reference = Reference::new(prepared)?;
        let sampled = |(filter, step)| Sampled::new(prepared, filter, step, &reference);
        Ok(Self {
            samples: filter.map(sampled).transpose()?,
            reference,
        })
    }

    pub fn is_filters(&self) -> bool {
        self.samples.is_some()
    }
}

impl Sampled {
    fn new(
        prepared: &Prepared<'_>,
        filter: &Observer,
        step: f64,
        reference: &Reference,
    ) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let mut exact = open_loop(study, settings(study)?, plant)?;
        exact.output_step = step;
        exact.noise = reference.exact();
        let noisy = Simulation {
            noise: reference.noise.clone(),
            ..exact.clone()
        };
        let is_disturbed = !study.tune.disturbance.is_empty();
        let disturbed = is_disturbed.then(|| disturbed(study, plant, filter, exact.clone()));
        let exact = shown(prepared, filter, &exact)?;
        Ok(Self {
            disturbed: disturbed
                .transpose()?
                .map(|run| as_read(shown(prepared, filter, &run), &exact))
                .transpose()?,
            noisy: shown(prepared, filter, &noisy)?,
            exact,
        })
    }

    /// Samples, or why there are none.
    fn under(&self, under: Under) -> Result<&Shown, &String> {
        match (under, &self.disturbed) {
            (Under::Exact, _) | (Under::Disturbance, None) => Ok(&self.exact),
            (Under::Noise, _) => Ok(&self.noisy),
            (Under::Disturbance, Some(disturbed)) => disturbed.as_ref(),
        }
    }
}

/// The plant alone, and what an observer reads of it.
fn shown(
    prepared: &Prepared<'_>,
    observer: &Observer,
    simulation: &Simulation,
) -> Result<Shown, Error> {
    let watch = &mut |_| ControlFlow::Continue(());
    plant::shown(
        prepared.study(),
        prepared.plant(),
        observer,
        simulation,
        watch,
    )
}

/// A disturbed run with the inputs as they are read, those of the exact one; why there is none where
/// the plant diverges.
fn as_read(disturbed: Result<Shown, Error>, exact: &Shown) -> Result<Result<Shown, String>, Error> {
    match disturbed {
        Ok(mut disturbed) => {
            disturbed.samples.inputs = exact.samples.inputs.clone();
            Ok(Ok(disturbed))
        }
        Err(error) if error.kind() == ErrorKind::Refused => Ok(Err(error.message().to_owned())),
        Err(error) => Err(error),
    }
}

/// The runs of one value.
pub(super) struct Trial<'a> {
    pub prepared: &'a Prepared<'a>,
    pub reference: &'a Reference,
    /// transparent where it runs along
    pub design: Design,
    way: Way<'a>,
}

/// How an observer meets the plant.
enum Way<'a> {
    /// along with it, in one system: this is the run without noise
    Along(Box<Simulation>),
    /// on samples of it
    On(&'a Sampled),
}

impl<'a> Trial<'a> {
    /// # Errors
    /// A study that cannot be simulated.
    pub fn new(
        prepared: &'a Prepared<'a>,
        mut design: Design,
        ground: &'a Simulated,
    ) -> Result<Self, Error> {
        let reference = &ground.reference;
        let way = match &ground.samples {
            Some(sampled) => Way::On(sampled),
            None => {
                design.observer = transparent(&design.observer);
                let plain = closed_loop(prepared.study(), prepared.plant(), &design.observer)?;
                let rows = (plain.until - plain.start) / plain.output_step;
                Way::Along(Box::new(Simulation {
                    noise: reference.exact(),
                    method: thrifty(plain.method, rows),
                    ..plain
                }))
            }
        };
        Ok(Self {
            prepared,
            reference,
            design,
            way,
        })
    }

    /// A run, or why its estimate is none.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn run(&self, under: Under, watch: &mut Watch<'_>) -> Result<Result<Ran, String>, Error> {
        let (study, observer) = (self.prepared.study(), &self.design.observer);
        let exact = match &self.way {
            Way::Along(exact) => exact.as_ref().clone(),
            Way::On(sampled) => {
                let shown = match sampled.under(under) {
                    Ok(shown) => shown,
                    Err(reason) => return Ok(Err(reason.clone())),
                };
                let (samples, between) = (&shown.samples, study.estimate.between_samples);
                let place = &study.file;
                let course = course(self.prepared, &self.design, samples, between, place, watch)?;
                let run = shown.run.clone();
                return Ok(course.map(|mut course| {
                    curved::beside_truth(self.prepared.plant(), observer, &run, &mut course);
                    Ran { run, course }
                }));
            }
        };
        let simulation = match under {
            Under::Exact => exact,
            Under::Noise => Simulation {
                noise: self.reference.noise.clone(),
                ..exact
            },
            Under::Disturbance => disturbed(study, self.prepared.plant(), observer, exact)?,
        };
        let mut ran = Ran::together(&simulation, observer, watch);
        let told = told(&mut ran.course, &study.file, study)?;
        Ok(told.map(|()| ran))
    }

    /// The longest stable step over the step of the sensor, along the exact run; none for a filter, which
    /// corrects nothing between samples.
    pub fn margin(&self, exact: &Ran) -> Option<f64> {
        let Way::Along(simulation) = &self.way else {
            return None;
        };
        let (run, own) = (&exact.run, &self.design.observer);
        let observer = simulation.observer.as_ref()?;
        let mut inputs = simulation.inputs.evaluation();
        let mut u = vec![0.0; simulation.inputs.outputs().len()];
        let names = observer.signals().to_vec();
        // the first signals of an observer are its measured outputs
        let outputs = own.measured.iter().map(|signal| {
            let place = systems::output_of(self.prepared.plant(), signal)?;
            run.column(Role::Output.at(place))
        });
        let outputs: Vec<_> = outputs.collect();
        let column = |signal: usize| outputs.get(signal).copied().flatten();
        let inputs_of_time = simulation.inputs.outputs();
        let input = |signal: usize| inputs_of_time.iter().position(|n| *n == names[signal]);
        let step = longest_step(observer, run.time.len(), &mut |row, x, signals| {
            let t = run.time.get(row)?;
            for (i, x) in x.iter_mut().enumerate() {
                *x = run.column(monitor_column(own, i))?.get(row)?;
            }
            inputs.enter(t);
            inputs.outputs(t, &[], &mut u);
            for (i, signal) in signals.iter_mut().enumerate() {
                *signal = match column(i) {
                    Some(values) => values.get(row)?,
                    None => *u.get(input(i)?)?,
                };
            }
            Some(t)
        })?;
        Some(step / self.reference.sample_step)
    }
}
