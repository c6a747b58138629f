//! The estimator for every position of a slider.

use lynkeus_export::curly::javascript;
use lynkeus_observers::{Design, Tuning};
use lynkeus_run::{Blueprint, Method, Step};

use crate::export::{printed, stepped, steps};
use crate::live::blueprint;
use crate::prepare::Prepared;
use crate::study::{self, Name, Rk4Step};
use crate::tune::axis;
use crate::{Error, Study};

/// Positions to either side of the study's own.
const POSITIONS: i32 = 5;
/// The last of them divides or multiplies the speed of an observer by this,
const REACH: f64 = 4.0;
/// and the process noise of a filter by this.
const NOISE_REACH: f64 = 100.0;

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

/// What a slider moves.
#[derive(Debug)]
pub(super) struct Knob {
    /// what it is called; none where the observer has nothing of the kind
    pub label: Option<&'static str>,
    /// the place of the study's own position
    pub own: usize,
    /// in ascending order of their factors
    pub variants: Vec<Variant>,
}

/// One position.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    /// by which the study's own value is multiplied
    pub factor: f64,
    /// where it is one number
    pub value: Option<f64>,
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
        let is_filter = design.observer.filter.is_some();
        let mut study = prepared.study().clone();
        // a filter has them anyway
        study.estimate.deviations |= is_filter;
        let asked = prepared.run_by(&study);
        let plain = blueprint(&asked, design)?;
        let is_chosen = step.is_none() && fixed(plain.method()).is_none();
        let made = stepped(&asked, plain, step, &mut vec![])?;
        let made = shortened(made, is_chosen, shorter);
        let method = made.method();
        let tuning = prepared.tuning()?;
        let own = Variant {
            factor: 1.0,
            value: value(&tuning, 1.0).filter(|_| !is_filter),
            steps: steps(method).unwrap_or_default(),
            text: printed(&asked, design, &made, &[], javascript::expression)?,
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
    match made.method() {
        Method::Rk4(Step::AtMost(h)) if is_chosen => {
            made.with_method(Method::Rk4(Step::AtMost(h / shorter)))
        }
        _ => made,
    }
}

impl Knob {
    /// The study's own estimator and its neighbours, as far as they can be made.
    ///
    /// # Errors
    /// Keys of `[observer]` that cannot be used.
    pub fn new(prepared: &Prepared<'_>, design: &Design, fixed: &Fixed) -> Result<Self, Error> {
        let source = Source {
            prepared,
            is_filter: design.observer.filter.is_some(),
            fixed,
            family: design.observer.family,
            tuning: prepared.tuning()?,
        };
        Ok(source.knob(fixed.own.clone()))
    }
}

/// The method of a run as studies have it.
fn fixed(method: Method) -> Option<study::Method> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Some(study::Method::Rk4(Rk4Step::Length(h))),
        Method::Rk4(Step::Substeps(n)) => Some(study::Method::Rk4(Rk4Step::PerRow(n as u64))),
        _ => None,
    }
}

/// The number that a slider shows, where what it moves is one.
fn value(tuning: &Tuning, factor: f64) -> Option<f64> {
    let mut tuning = tuning.clone();
    let key = axis::speed_of(&tuning)?;
    if factor != 1.0 {
        axis::scale(&mut tuning, key, factor);
    }
    match tuning.values.get(key) {
        Some(lynkeus_observers::Value::Number(x)) => Some(*x),
        _ => None,
    }
}

/// What positions are made from.
struct Source<'a> {
    /// of the study before its steps were chosen
    prepared: &'a Prepared<'a>,
    is_filter: bool,
    fixed: &'a Fixed,
    family: &'static str,
    tuning: Tuning,
}

impl Source<'_> {
    fn knob(&self, own: Variant) -> Knob {
        let (label, reach) = match (self.is_filter, axis::speed_of(&self.tuning)) {
            (true, _) => (Some("process noise"), NOISE_REACH),
            (false, Some(key)) => (Some(key), REACH),
            (false, None) => (None, 1.0),
        };
        let factor = |k: i32| reach.powf(f64::from(k) / f64::from(POSITIONS));
        let side = |places: &mut dyn Iterator<Item = i32>| -> Vec<Variant> {
            // what cannot be designed has no position
            places
                .filter_map(|k| self.variant(factor(k)).ok())
                .collect()
        };
        if label.is_none() {
            return Knob {
                label,
                own: 0,
                variants: vec![own],
            };
        }
        let mut variants = side(&mut (-POSITIONS..0));
        let place = variants.len();
        variants.push(own);
        variants.extend(side(&mut (1..=POSITIONS)));
        Knob {
            label,
            own: place,
            variants,
        }
    }

    fn variant(&self, factor: f64) -> Result<Variant, Error> {
        let mut study = self.prepared.study().clone();
        study.estimate.deviations = self.fixed.study.estimate.deviations;
        match (self.is_filter, axis::speed_of(&self.tuning)) {
            (true, _) => {
                let densities = study.process_noise.iter_mut();
                densities.for_each(|(_, density)| *density *= factor);
            }
            (false, Some(key)) => {
                study.observer.family = Some(Name::from(self.family));
                study.observer.tuning = self.tuning.clone();
                axis::scale(&mut study.observer.tuning, key, factor);
            }
            (false, None) => {}
        }
        let prepared = match self.is_filter {
            true => self.prepared.run_by(&study),
            false => self.prepared.with_study(&study),
        };
        let design = prepared.design()?;
        let made = blueprint(&prepared, &design)?;
        // every position needs steps of its own, but where the study has some
        let made = match self.fixed.is_chosen {
            true => stepped(&prepared, made, None, &mut vec![])?,
            false => made.with_method(self.fixed.method),
        };
        let made = shortened(made, self.fixed.is_chosen, self.fixed.shorter);
        Ok(Variant {
            factor,
            value: match self.is_filter {
                true => None,
                false => value(&self.tuning, factor),
            },
            steps: steps(made.method()).unwrap_or_default(),
            text: printed(&prepared, &design, &made, &[], javascript::expression)?,
        })
    }
}
