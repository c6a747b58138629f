//! The positions of a slider, as studies.

use lynkeus_observers::Design;

use crate::{Error, Study};
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::tune::{Axis, axis};
use lynkeus_study::Name;

/// Positions to either side of the study's own.
const TO_A_SIDE: usize = 5;

/// What a slider moves, and where to.
#[derive(Clone, Debug)]
pub(super) struct Positions {
    /// what it is called
    pub label: String,
    /// what `tune` would sweep
    pub axis: Axis,
    /// in ascending order of their factors, the study's own among them
    pub all: Vec<Position>,
}

/// One position.
#[derive(Clone, Debug)]
pub(super) struct Position {
    /// by which the study's own value is multiplied; 1 for the study's own
    pub factor: f64,
    /// where it is one number
    pub value: Option<f64>,
    /// the value of the axis
    pub at: f64,
    /// with that value
    pub study: Study,
}

impl Positions {
    /// The speed of an observer, or the process noise of a filter; none where there is nothing of the kind.
    ///
    /// # Errors
    /// Keys of `[observer]` that cannot be used.
    pub fn new(prepared: &Prepared<'_>, design: &Design) -> Result<Option<Self>, Error> {
        match design.observer.filter {
            Some(_) => Ok(noises(prepared.study())),
            None => speeds(prepared, design),
        }
    }

    /// What is swept, with a study for each value.
    pub fn grid(&self) -> Vec<(Vec<f64>, Study)> {
        let all = self.all.iter();
        all.map(|p| (vec![p.at], p.study.clone())).collect()
    }
}

fn speeds(prepared: &Prepared<'_>, design: &Design) -> Result<Option<Positions>, Error> {
    let mut study = prepared.study().clone();
    study.observer.family = Some(Name::from(design.examination.family.name()));
    study.observer.tuning = prepared.tuning()?;
    let Some(axis) = axis::around(&study, TO_A_SIDE) else {
        return Ok(None);
    };
    let (is_factor, present) = (axis.is_factor, axis.present.unwrap_or(1.0));
    let grid = axis::grid(&study, std::slice::from_ref(&axis))?;
    let position = |(values, study): (Vec<f64>, Study)| {
        let at = values.first().copied()?;
        Some(Position {
            factor: if is_factor { at } else { at / present },
            value: (!is_factor).then_some(at),
            at,
            study,
        })
    };
    let mut all: Vec<Position> = grid.into_iter().filter_map(position).collect();
    all.sort_by(|a, b| a.factor.total_cmp(&b.factor));
    Ok(Some(Positions {
        label: axis.key.replace("theta", "\u{3b8}"),
        axis,
        all,
    }))
}

fn noises(study: &Study) -> Option<Positions> {
    if study.process_noise.is_empty() {
        return None;
    }
    let axis = Axis::of_densities(TO_A_SIDE);
    let position = |&factor: &f64| {
        let mut study = study.clone();
        let densities = study.process_noise.iter_mut();
        densities.for_each(|(_, density)| *density *= factor);
        Position {
            factor,
            value: None,
            at: factor,
            study,
        }
    };
    Some(Positions {
        label: axis.key.replace('_', " "),
        all: axis.values.iter().map(position).collect(),
        axis,
    })
}
