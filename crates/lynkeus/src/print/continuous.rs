//! Plants and observers in continuous time for simulators.

mod settable;

use lynkeus_model::Plant;
use lynkeus_run::{Method, Step, System, fastest_at};

use crate::print::fmu::equations::{Equations, Texts};
use crate::print::{
    head::designed, head::origin, target::Export, target::ExportOptions, target::Target,
};
use crate::{Error, FmiVersion, Precision, Study};
use lynkeus_experiment::course::fixed_steps::{Unsaid, bends, sound, steps};
use lynkeus_experiment::prepare::systems;
use lynkeus_experiment::prepare::{self, Prepared};
use lynkeus_study::{self, Rk4Step};

use settable::{Settled, settled};

/// The plant of a study as a functional mock-up unit, its parameters to be set where they can be symbols.
///
/// # Errors
/// Other languages, `float`, and what cannot run elsewhere.
pub(crate) fn plant(study: &Study, options: &ExportOptions) -> Result<Export, Error> {
    let version = version(study, options)?;
    let valued = prepare::plant(study)?;
    let drawn = |plant: &Plant| plant_as(study, plant, version, options);
    if valued.parameters.is_empty() {
        return Ok(drawn(&valued)?.exported());
    }
    let system = Equations::of_plant(study, &valued)?.system()?;
    // which is known of times and events alone where they are numbers
    let Settled { mut made, notes } = match system.modes() > 0 || system.has_instants() {
        true => Settled {
            made: drawn(&valued)?,
            notes: vec![
                "parameters are numbers: what happens at times and at events has to be known"
                    .to_owned(),
            ],
        },
        false => settled(study, &valued, drawn)?,
    };
    made.notes.extend(notes);
    Ok(made.exported())
}

fn plant_as(
    study: &Study,
    plant: &Plant,
    version: FmiVersion,
    options: &ExportOptions,
) -> Result<Drawn, Error> {
    let settings = study.simulate.as_ref();
    let component = Component {
        study,
        equations: Equations::of_plant(study, plant)?,
        settings: settings.map(|settings| &settings.method),
        section: settings.map(|_| "simulate"),
        about: vec![format!("The plant {}.", plant.name)],
    };
    component.drawn(version, options)
}

/// The observer of a study, as its family has it, as a functional mock-up unit.
///
/// # Errors
/// As [`plant`], and a filter.
pub(crate) fn observer(study: &Study, options: &ExportOptions) -> Result<Export, Error> {
    let version = version(study, options)?;
    let plant = prepare::plant(study)?;
    prepare::whens::refuse(study, &plant, "export")?;
    let design = Prepared::new(study, &plant)?.design()?;
    if design.observer.filter.is_some() {
        return Err(filter(study, design.examination.family.name()));
    }
    let about = format!(
        "An observer of {} in continuous time: its inputs are the measurements.",
        plant.name
    );
    let component = Component {
        study,
        equations: Equations::of_observer(study, &plant, &design.observer),
        settings: Some(&study.estimate.method),
        section: Some("estimate"),
        about: std::iter::once(about).chain(designed(study)).collect(),
    };
    Ok(component.drawn(version, options)?.exported())
}

/// The version of the standard; other languages are refused.
fn version(study: &Study, options: &ExportOptions) -> Result<FmiVersion, Error> {
    let Target::Fmu(version) = options.to else {
        let message =
            "in continuous time a plant or an observer goes to simulators: expected --to fmu";
        return Err(Error::input(message).at(&study.file).hint(
            "the estimator of a study is exported to C, JavaScript, Rust and Structured Text",
        ));
    };
    if options.tunable {
        let message = "what is tunable: expected an estimator, found a system in continuous time";
        return Err(Error::input(message));
    }
    match options.precision {
        Precision::F64 => Ok(version),
        Precision::F32 => Err(Error::input(
            "--precision f32: expected f64, in which simulators count",
        )),
    }
}

/// Equations on their way into an archive.
struct Component<'a> {
    study: &'a Study,
    equations: Equations<'a>,
    /// how the study integrates them
    settings: Option<&'a lynkeus_study::Method>,
    /// of the study, where it says so
    section: Option<&'static str>,
    /// lines for people
    about: Vec<String>,
}

/// The texts of an archive, which no compiler has seen yet.
struct Drawn {
    texts: Texts,
    notes: Vec<String>,
}

impl Drawn {
    fn exported(mut self) -> Export {
        Export {
            files: vec![self.texts.archive(&mut self.notes)],
            notes: self.notes,
        }
    }
}

impl Component<'_> {
    fn drawn(&self, version: FmiVersion, options: &ExportOptions) -> Result<Drawn, Error> {
        let system = self.equations.system()?;
        let mut notes: Vec<String> = bends(&system).into_iter().collect();
        let method = match sound(options.step)? {
            Some(step) => Method::Rk4(Step::AtMost(step)),
            None => self.stepped(&system, &mut notes)?,
        };
        let step = steps(method).unwrap_or_default();
        let mut about = vec![
            origin(self.study),
            format!(
                "In co-simulation: classical Runge-Kutta method, {step}; inputs are held from one communication point to the next."
            ),
        ];
        about.extend(self.about.iter().cloned());
        let texts = self
            .equations
            .texts(&system, method, &about, version, &mut notes)?;
        Ok(Drawn { texts, notes })
    }

    /// Fixed steps: those of the study, or such as the fastest mode needs.
    fn stepped(&self, system: &System, notes: &mut Vec<String>) -> Result<Method, Error> {
        if let Some(settings @ lynkeus_study::Method::Rk4(Rk4Step::Length(_))) = self.settings {
            return Ok(systems::method(settings));
        }
        let mut evaluation = system.evaluation();
        let signals = evaluation.signals_mut().iter_mut();
        for (signal, value) in signals.zip(self.equations.typical_signals()) {
            *signal = value;
        }
        let unsaid = Unsaid {
            study: self.study,
            within: "in co-simulation ",
            point: "communication point",
            section: self.section,
        };
        let needed = fastest_at(&mut evaluation, system.start(), &self.equations.sizes());
        unsaid.method(needed, notes)
    }
}

fn filter(study: &Study, family: &str) -> Error {
    Error::refused(format!(
        "{family} jumps when a sensor reports, and has no equations in continuous time: expected an observer whose correction is in its derivatives"
    ))
    .at(&study.file)
    .hint("without --system observer the filter is exported for co-simulation")
}
