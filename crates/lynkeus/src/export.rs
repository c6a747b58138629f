//! A study's estimator as source code for other machines; what is exported otherwise is in `continuous`.

use crate::ReportOptions;
use crate::{Error, Study, print::continuous, print::fmu, print::tunable};
use lynkeus_experiment::blueprint;
use lynkeus_experiment::course::fixed_steps::{bends, hasty, stepped};
use lynkeus_experiment::course::inputs::on_device;
use lynkeus_experiment::prepare::choice::Choice;
use lynkeus_experiment::prepare::{self, Prepared};
use lynkeus_export::Refusal;
use lynkeus_export::curly::c::{self, Precision};

use crate::print::device::{causal, printed, refuse_late};
use crate::print::head::{about, beyond_float};
use crate::print::target::{Artifact, Declared, Export, ExportOptions, Subject, Writes};

/// The study's estimator as source code, as `[estimate]` says: with the same fixed step it gives what
/// [`estimate()`](crate::estimate()) gives. Where the study has no fixed step, one that is short
/// enough for the fastest mode at the start is taken, and told. With another [`Subject`], and of a bare
/// model, the plant or the observer in continuous time for simulators ([`Target::Fmu`](crate::Target::Fmu)).
///
/// # Errors
/// As [`estimator`](crate::estimator()); and what cannot run elsewhere: a moving horizon, plants
/// that jump with time, loops that are searched, smoothing.
pub fn export(study: &Study, options: &ExportOptions) -> Result<Export, Error> {
    let Declared {
        has_float, writes, ..
    } = options.to.declared();
    if options.precision == Precision::F32 && !has_float {
        let message = "--precision f32: expected f64, the numbers of JavaScript";
        return Err(Error::input(message));
    }
    match options.subject {
        None if study.is_bare() => return continuous::plant(study, options),
        Some(Subject::Plant) => return continuous::plant(study, options),
        Some(Subject::Observer) => return continuous::observer(study, options),
        None | Some(Subject::Estimator) => {}
    }
    let precision = options.precision;
    match writes {
        Writes::Page if options.tunable => {
            let message = "what is tunable: expected C, JavaScript, Rust, Structured Text or an FMU, found a page, whose slider moves it";
            Err(Error::input(message))
        }
        Writes::Page => page(study, options.step),
        Writes::Sources(write) => written(study, options, options.tunable, |made, notes| {
            let sources = write(made.device, precision)?;
            notes.extend(beyond_float(&sources.lost));
            Ok(sources.files.into_iter().map(Artifact::from).collect())
        }),
        Writes::Archive(version) => written(study, options, true, |made, notes| {
            if precision == Precision::F32 {
                notes.extend(beyond_float(&c::lost_in_float(made.device)?));
            }
            Ok(vec![fmu::archive(made, version, precision, notes)?])
        }),
    }
}

/// The study's estimator as `write` makes files of it; with what may be changed while it runs.
fn written(
    study: &Study,
    options: &ExportOptions,
    is_tunable: bool,
    write: impl FnOnce(&fmu::Made<'_>, &mut Vec<String>) -> Result<Vec<Artifact>, Refusal>,
) -> Result<Export, Error> {
    let mut notes = vec![];
    let study = &causal(study, &mut notes);
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    refuse_late(&prepared, options.to, options.tunable)?;
    let mut design = match is_tunable {
        true => tunable::design(&prepared)?,
        false => prepared.design()?,
    };
    on_device(&prepared, &mut design)?;
    let choice = prepared.choice()?.filter(|choice| choice.ended.is_some());
    notes.extend(choice.map(Choice::notes).into_iter().flatten());
    let made = blueprint(&prepared, &design)?;
    let made = stepped(&prepared, made, options.step, &mut notes)?;
    notes.extend(bends(&made.flow));
    if is_tunable {
        notes.push(tunable::note(&design, &made));
    }
    let hasty = hasty(&prepared, &made);
    notes.extend(hasty.clone());
    let about = about(study, &made, hasty);
    let files = printed(&prepared, &design, &made, &about, |device, told| {
        notes.extend(told);
        let of = fmu::Made {
            device,
            prepared: &prepared,
            design: &design,
        };
        write(&of, &mut notes)
    })?;
    Ok(Export { files, notes })
}

/// The report on the study's simulation.
fn page(study: &Study, step: Option<f64>) -> Result<Export, Error> {
    let watch = &mut |_| std::ops::ControlFlow::Continue(());
    let page = crate::report::report(study, None, &ReportOptions { step }, watch)?;
    Ok(Export {
        files: vec![Artifact {
            name: page.name,
            bytes: page.html.into_bytes(),
        }],
        notes: page.notes,
    })
}
