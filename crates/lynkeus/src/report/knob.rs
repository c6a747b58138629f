//! The estimator for every position of a slider.

use lynkeus_export::curly::javascript;
use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Method, Step};

use super::positions::{Position, Positions};
use crate::print::device::{printed, refuse_late};
use crate::print::target::Target;
use crate::{Error, Study};
use lynkeus_experiment::blueprint;
use lynkeus_experiment::course::fixed_steps::{stepped, steps};
use lynkeus_experiment::prepare::Prepared;
use lynkeus_study::{self, Rk4Step};

/// The study's own estimator with fixed steps, as it runs in a page.
#[derive(Debug)]
pub(super) struct Fixed {
    /// the study with these steps
    pub study: Study,
    /// whether they are not the study's
    pub is_chosen: bool,
    pub own: Variant,
    /// the steps that were chosen are so many times shorter than the start needs
    shorter: f64,
    method: Method,
}

/// The estimators that a page holds.
#[derive(Debug)]
pub(super) struct Knob {
    /// the place of the study's own
    pub own: usize,
    /// in ascending order of their factors
    pub variants: Vec<Variant>,
}

/// The estimator of one position.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    /// by which the study's own value is multiplied
    pub factor: f64,
    /// its steps in words
    pub steps: String,
    /// an expression of JavaScript
    pub text: String,
}

impl Fixed {
    /// With the steps of the study, steps of `step` at most, or such as the fastest mode at the start
    /// needs and so many times shorter.
    ///
    /// # Errors
    /// Why it cannot run in a page.
    pub fn new(
        prepared: &Prepared<'_>,
        design: &Design,
        step: Option<f64>,
        shorter: f64,
    ) -> Result<Self, Error> {
        refuse_late(prepared, Target::JavaScript, true)?;
        let is_filter = design.observer.filter.is_some();
        let mut study = prepared.study().clone();
        // a filter has them anyway
        study.estimate.deviations |= is_filter;
        let asked = prepared.run_by(&study)?;
        let plain = blueprint(&asked, design)?;
        let is_chosen = step.is_none() && fixed(plain.run.method).is_none();
        let made = stepped(&asked, plain, step, &mut vec![])?;
        let made = shortened(made, is_chosen, shorter);
        let method = made.run.method;
        let own = Variant {
            factor: 1.0,
            steps: steps(method).unwrap_or_default(),
            text: printed(&asked, design, &made, &[], |device, _| {
                javascript::expression(device)
            })?,
        };
        study.estimate.method = fixed(method).unwrap_or(study.estimate.method);
        Ok(Self {
            study,
            is_chosen,
            own,
            shorter,
            method,
        })
    }
}

fn shortened(made: Blueprint, is_chosen: bool, shorter: f64) -> Blueprint {
    match made.run.method {
        Method::Rk4(Step::AtMost(h)) if is_chosen => {
            made.with_method(Method::Rk4(Step::AtMost(h / shorter)))
        }
        _ => made,
    }
}

impl Knob {
    /// The study's own estimator and its neighbours, as far as they can be made.
    pub fn new(prepared: &Prepared<'_>, fixed: &Fixed, positions: Option<&Positions>) -> Self {
        let positions = positions.map_or(&[][..], |positions| &positions.all);
        let side = |is_in: fn(f64) -> bool| {
            let side = positions.iter().filter(move |p| is_in(p.factor));
            // what cannot be designed has no position
            side.filter_map(|p| variant(prepared, fixed, p).ok())
        };
        let mut variants: Vec<Variant> = side(|factor| factor < 1.0).collect();
        let own = variants.len();
        variants.push(fixed.own.clone());
        variants.extend(side(|factor| factor > 1.0));
        Self { own, variants }
    }
}

/// The estimator of another position. `prepared` is of the study before its steps were chosen.
fn variant(prepared: &Prepared<'_>, fixed: &Fixed, position: &Position) -> Result<Variant, Error> {
    let mut study = position.study.clone();
    study.estimate = prepared.study().estimate.clone();
    study.estimate.deviations = fixed.study.estimate.deviations;
    let prepared = prepared.with_study(&study)?;
    let design = prepared.design()?;
    let made = blueprint(&prepared, &design)?;
    // every position needs steps of its own, but where the study has some
    let made = match fixed.is_chosen {
        true => stepped(&prepared, made, None, &mut vec![])?,
        false => made.with_method(fixed.method),
    };
    let made = shortened(made, fixed.is_chosen, fixed.shorter);
    Ok(Variant {
        factor: position.factor,
        steps: steps(made.run.method).unwrap_or_default(),
        text: printed(&prepared, &design, &made, &[], |device, _| {
            javascript::expression(device)
        })?,
    })
}

/// The method of a run as studies have it.
fn fixed(method: Method) -> Option<lynkeus_study::Method> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Some(lynkeus_study::Method::Rk4(Rk4Step::Length(h))),
        Method::Rk4(Step::Substeps(n)) => {
            Some(lynkeus_study::Method::Rk4(Rk4Step::PerRow(n as u64)))
        }
        _ => None,
    }
}
