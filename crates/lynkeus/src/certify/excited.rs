//! α(θ) of Ltaief et al., measured: the excitation along the study's own run, for values of θ around its tuning.
//!
//! Theorem 1 takes λ_min(S) ≥ δ₀/(e α(θ)) for granted (A4), with α(θ)/θ² → 0 (12), and asks for σ_s L/θ < ½. What no box
//! decides a run shows: λ_min(S) at each θ, how fast it falls as θ grows (α(θ)/θ² ~ θ^(p−2) where λ_min(S) ~ θ^−p), and
//! what the theorem makes of it. It is measured on one run, and has no say in the verdict.

use std::ops::ControlFlow;

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_observers::{Family, Tuning, Value};
use lynkeus_structure::AugmentedPlant;
use serde::Serialize;

use super::assumptions;
use lynkeus_experiment::course::rig::Rig;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::simulated_by;

use crate::{Error, Outcome};
use lynkeus_experiment::thrifty::thrifty;
use lynkeus_experiment::words::number;

/// The monitor of λ_min(S).
const MONITOR: &str = "excitation";
/// Half decades below and above the study's θ.
const HALF_DECADES: std::ops::RangeInclusive<i32> = -2..=4;
/// λ_min(S) ~ θ^−p: from this p on α(θ)/θ² does not fall as far as measured, and up to the second it does.
const STAYS: f64 = 1.8;
const FALLS: f64 = 1.5;

/// The excitation for values of θ, along the study's run.
#[derive(Clone, Debug, PartialEq)]
pub struct Excited {
    /// from when on, and until when, it was looked at: the last half of the rows
    pub window: (f64, f64),
    /// the study's own θ
    pub theta: f64,
    /// one per value of θ, in increasing order
    pub rows: Vec<AtTheta>,
}

/// What was measured at a value of θ.
#[derive(Clone, Debug, PartialEq)]
pub struct AtTheta {
    /// θ
    pub theta: f64,
    /// the figures, or why the run gave none
    pub figures: Result<Excitation, String>,
}

/// The figures of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excitation {
    /// the smallest λ_min(S)
    pub excitation: f64,
    /// σ_s L/θ with this λ_min(S), which has to be below ½; none where the theorem has no L
    pub condition: Option<f64>,
    /// the largest RMS error of a quantity, in widths of its declared range
    pub error: Option<f64>,
}

impl Excited {
    /// Runs the study for values of θ around its own; none where its observer has no such monitor
    /// or it has no `[simulate]`.
    ///
    /// # Errors
    /// The user ended it, or a limit.
    pub(super) fn of(
        prepared: &Prepared<'_>,
        own: Option<&Outcome>,
        place: &AugmentedPlant<'_>,
        family: Option<&'static dyn Family>,
    ) -> Result<Option<Self>, Error> {
        let (Some(own), Some(family)) = (own, family) else {
            return Ok(None);
        };
        let tuning = prepared.tuning()?;
        let (Some(Value::Number(theta)), Some(window)) = (tuning.values.get("theta"), window(own))
        else {
            return Ok(None);
        };
        if lowest(own).is_none() {
            return Ok(None);
        }
        let mut rows = vec![];
        for k in HALF_DECADES {
            let theta = theta * 10f64.powf(f64::from(k) / 2.0);
            rows.push(measured(prepared, place, family, &tuning, theta)?);
        }
        Ok(Some(Self {
            window,
            theta: *theta,
            rows,
        }))
    }

    /// The figures that there are, with their θ.
    fn known(&self) -> impl DoubleEndedIterator<Item = (f64, Excitation)> {
        let rows = self.rows.iter();
        rows.filter_map(|row| Some((row.theta, *row.figures.as_ref().ok()?)))
    }

    /// p of λ_min(S) ~ θ^−p between the two largest values of θ.
    #[must_use]
    pub fn exponent(&self) -> Option<f64> {
        let mut known = self.known().rev();
        let (high, low) = (known.next()?, known.next()?);
        let fall = (low.1.excitation / high.1.excitation).ln();
        Some(fall / (high.0 / low.0).ln()).filter(|p| p.is_finite())
    }

    /// Whether α(θ)/θ² falls at the largest values of θ, as (12) asks; none where that cannot be told.
    #[must_use]
    pub fn vanishes(&self) -> Option<bool> {
        let p = self.exponent()?;
        match p {
            _ if p >= STAYS => Some(false),
            _ if p <= FALLS => Some(true),
            _ => None,
        }
    }

    /// The θ with the smallest error.
    #[must_use]
    pub fn best(&self) -> Option<f64> {
        let errors = self.known().filter_map(|(θ, f)| Some((θ, f.error?)));
        errors.min_by(|a, b| a.1.total_cmp(&b.1)).map(|best| best.0)
    }

    /// The θ with the smallest σ_s L/θ, and that.
    fn nearest(&self) -> Option<(f64, f64)> {
        let all = self.known().filter_map(|(θ, f)| Some((θ, f.condition?)));
        all.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// What follows from the table, a line each.
    fn conclusions(&self) -> Vec<String> {
        let mut known = self.known().rev();
        let (high, low) = (known.next(), known.next());
        let fall = high.zip(low).zip(self.exponent()).map(|((high, low), p)| {
            let said = match self.vanishes() {
                Some(true) => "α(θ)/θ² still falls there; (12) asks that it vanishes as θ grows",
                Some(false) => "α(θ)/θ² does not vanish as far as measured, which (12) asks for",
                None => "whether α(θ)/θ² vanishes, which (12) asks for, cannot be told from that",
            };
            format!(
                "λ_min(S) changes like θ^{:.2} from θ = {} to {}: {said}",
                -p,
                number(low.0),
                number(high.0)
            )
        });
        let condition = self.nearest().map(|(θ, least)| match least < 0.5 {
            true => format!(
                "σ_s·L/θ < ½, which Theorem 1 asks for, holds on this run at θ = {} ({})",
                number(θ),
                number(least)
            ),
            false => format!(
                "σ_s·L/θ < ½, which Theorem 1 asks for, holds at none of these θ: the least is {} at θ = {}",
                number(least),
                number(θ)
            ),
        });
        let best = self.best().map(|θ| {
            format!(
                "the error is smallest at θ = {} (the study has {})",
                number(θ),
                number(self.theta)
            )
        });
        [fall, condition, best].into_iter().flatten().collect()
    }

    /// For machines.
    pub(super) fn entry(&self) -> ExcitationEntry<'_> {
        ExcitationEntry {
            from: self.window.0,
            until: self.window.1,
            rows: self.rows.iter().map(AtThetaEntry::from).collect(),
            exponent: self.exponent(),
            vanishes: self.vanishes(),
            best: self.best(),
        }
    }
}

/// Excitation along the study's simulation: measured, no part of a proof.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Excitation"))]
pub(super) struct ExcitationEntry<'a> {
    /// the first instant
    from: f64,
    /// the last instant
    until: f64,
    /// one for each value of θ
    rows: Vec<AtThetaEntry<'a>>,
    /// excitation falls like θ to minus this
    exponent: Option<f64>,
    /// whether α(θ)/θ² falls at the largest θ, as the theorem asks; none where that cannot be told
    vanishes: Option<bool>,
    /// the θ of the smallest error
    best: Option<f64>,
}

/// Excitation measured at a value of θ.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "AtTheta"))]
struct AtThetaEntry<'a> {
    /// θ, in 1/(unit of time)
    theta: f64,
    /// the smallest eigenvalue of S
    excitation: Option<f64>,
    /// σ_s·L/θ, to be below ½
    condition: Option<f64>,
    /// the largest root mean square error, in widths of the declared range
    error: Option<f64>,
    /// why there are no figures
    failure: Option<&'a str>,
}

impl<'a> From<&'a AtTheta> for AtThetaEntry<'a> {
    fn from(AtTheta { theta, figures }: &'a AtTheta) -> Self {
        let found = figures.as_ref().ok();
        Self {
            theta: *theta,
            excitation: found.map(|f| f.excitation),
            condition: found.and_then(|f| f.condition),
            error: found.and_then(|f| f.error),
            failure: figures.as_ref().err().map(String::as_str),
        }
    }
}

impl Excited {
    pub(super) fn tell(&self, document: &mut Document) {
        let (from, until) = (number(self.window.0), number(self.window.1));
        document.heading(format!(
            "excitation along [simulate], t from {from} to {until}: measured, no part of any proof"
        ));
        let row = |row: &AtTheta| {
            let θ = Cell::Number(number(row.theta));
            match &row.figures {
                Err(reason) => vec![θ, reason.as_str().into()],
                Ok(figures) => {
                    let Excitation {
                        excitation,
                        condition,
                        error,
                    } = *figures;
                    let scaled = excitation * row.theta.powi(2);
                    let figures = [Some(excitation), Some(scaled), condition, error];
                    let figures = figures.map(|x| Cell::number(x, number));
                    std::iter::once(θ).chain(figures).collect()
                }
            }
        };
        let titles = ["θ", "λ_min(S)", "λ_min(S)·θ²", "σ_s·L/θ", "error/range"];
        document.table(Table::new(titles).with(self.rows.iter().map(row)));
        document.items(self.conclusions());
    }
}

/// One value of θ.
fn measured(
    prepared: &Prepared<'_>,
    place: &AugmentedPlant<'_>,
    family: &dyn Family,
    tuning: &Tuning,
    theta: f64,
) -> Result<AtTheta, Error> {
    let mut tuning = tuning.clone();
    tuning
        .values
        .insert("theta".to_owned(), Value::Number(theta));
    let run = run(prepared, &tuning);
    if let Some(spent) = prepared.study().budget.spent() {
        return Err(Error::ended(spent).at(&prepared.study().file));
    }
    let figures = run.map_err(|error| error.to_string()).and_then(|run| {
        if let Some(ended) = &run.ended {
            return Err(ended.message.clone());
        }
        let excitation = lowest(&run).ok_or("the run gives no excitation")?;
        Ok(Excitation {
            excitation,
            condition: condition(prepared, place, family, tuning, excitation),
            error: error(&run, place),
        })
    });
    Ok(AtTheta { theta, figures })
}

/// The study's run with another tuning.
fn run(prepared: &Prepared<'_>, tuning: &Tuning) -> Result<Outcome, Error> {
    let mut rig = Rig::of(prepared, prepared.design_with(tuning)?)?;
    let simulation = &mut rig.simulation;
    let rows = (simulation.until - simulation.start) / simulation.output_step;
    simulation.method = thrifty(simulation.method, rows);
    simulated_by(prepared, rig, &mut |_| ControlFlow::Continue(()))
}

/// From when on the last half of the rows is, and its end.
fn window(run: &Outcome) -> Option<(f64, f64)> {
    Some((run.time.get(run.time.len() / 2)?, run.time.last()?))
}

/// The smallest λ_min(S) in the last half of the rows.
fn lowest(run: &Outcome) -> Option<f64> {
    let mut watches = run.watches.iter();
    let watch = watches.find(|watch| watch.monitor.name == MONITOR)?;
    let late = watch.values.iter().skip(watch.values.len() / 2);
    let least = late.fold(f64::INFINITY, f64::min);
    (least.is_finite() && least > 0.0).then_some(least)
}

/// σ_s L/θ of the theorem for a λ_m that was measured.
fn condition(
    prepared: &Prepared<'_>,
    place: &AugmentedPlant<'_>,
    family: &dyn Family,
    mut tuning: Tuning,
    excitation: f64,
) -> Option<f64> {
    tuning.clamp = false;
    let alarm = Value::Number(excitation);
    tuning.values.insert("alarm".to_owned(), alarm);
    let assumptions = assumptions::of(prepared, place).ok()?;
    let theorem = family.theorem(place, &tuning, &assumptions).ok()?;
    Some(0.5 - theorem.constant("μ_θ")?)
}

/// The largest RMS error over the last half of the rows, in widths of declared ranges.
fn error(run: &Outcome, place: &AugmentedPlant<'_>) -> Option<f64> {
    let share = |state: &lynkeus_model::Variable| {
        let width = state.max - state.min;
        let own = run.quantities.iter().find(|q| q.name == state.name)?;
        let error = own.settled_error()? / width;
        (width.is_finite() && error.is_finite()).then_some(error)
    };
    let shares = place.states.iter().filter_map(share);
    shares.reduce(f64::max)
}
