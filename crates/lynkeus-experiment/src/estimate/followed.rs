//! An observer over a log's samples, beside what its readings are judged by.

use lynkeus_observers::Design;
use lynkeus_run::EstimatorSettings;

use crate::course::checkpoint::Checkpoint;
use crate::course::replay::Watch;
use crate::course::run::course_of;
use crate::course::{Course, Samples, sampled};
use crate::crew::within;
use crate::prepare::{Prepared, StudyDesign};
use crate::{Error, Study};

/// An observer over samples, with what judges it.
pub(super) fn followed(
    prepared: &Prepared<'_>,
    design: &StudyDesign,
    samples: &Samples,
    run: EstimatorSettings,
    watch: Watch<'_>,
) -> Result<Course, Error> {
    let study = prepared.study();
    let is_judged_beside = is_judged_beside(study, design);
    let share = if is_judged_beside { 0.5 } else { 1.0 };
    let mut told = within(&study.budget, watch.watch);
    let mut checkpoint = watch.checkpoint;
    let own = &mut Watch {
        watch: &mut |done| told(share * done),
        checkpoint: checkpoint.as_deref_mut(),
    };
    let mut course = course_of(prepared, design, samples, run, own)?;
    if is_judged_beside && course.ended.is_none() {
        let beside = &mut Watch {
            watch: &mut |done| told(share * (1.0 + done)),
            checkpoint: checkpoint.map(Checkpoint::beside),
        };
        sampled::judge(prepared, design, samples, run, beside, &mut course)?;
    }
    Ok(course)
}

/// Whether readings have noises to be judged by, and the run itself follows no error.
fn is_judged_beside(study: &Study, design: &Design) -> bool {
    let is_followed = design.observer.filter.is_some() || study.estimate.follows_errors();
    !is_followed && !study.sensors.noise.is_empty()
}
