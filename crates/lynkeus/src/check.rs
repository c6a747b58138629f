//! What can be estimated from these sensors, by which observer, and what fails where.

use std::fmt;

use lynkeus_observers::{Examination, Fit};
use lynkeus_structure::{Condition, Extended, Point, visibility};
use serde_json::{Value, json};

use crate::{Error, Study, prepare};

/// The answer of `lynkeus check`.
#[derive(Clone, Debug)]
pub struct Report {
    /// name of the plant
    pub plant: String,
    /// names of its states
    pub states: Vec<String>,
    /// measured outputs
    pub measured: Vec<String>,
    /// inputs that nobody measures
    pub unknown: Vec<String>,
    /// what each family finds
    pub examinations: Vec<Examination>,
    /// the family to use
    pub recommended: Option<&'static str>,
    /// for each state and unknown input: does it leave a trace in the outputs?
    pub visible: Vec<(String, bool)>,
}

/// Examines the study's plant with every family that the study allows.
///
/// # Errors
/// A study that does not fit its plant.
pub fn check(study: &Study) -> Result<Report, Error> {
    let plant = prepare::plant(study)?;
    let extended = prepare::extended(study, &plant)?;
    let examinations = prepare::examinations(study, &extended)?;
    let names =
        |of: std::ops::Range<usize>| extended.states[of].iter().map(|s| s.name.clone()).collect();
    let split = extended.plant_states();
    Ok(Report {
        plant: plant.name.clone(),
        states: names(0..split),
        unknown: names(split..extended.states.len()),
        measured: extended
            .outputs
            .iter()
            .map(|o| o.variable.name.clone())
            .collect(),
        recommended: prepare::recommended(&examinations).map(|e| e.family),
        visible: visible(&extended, &examinations)?,
        examinations,
    })
}

/// A family whose conditions are all proved makes everything visible; otherwise
/// the rank of the outputs' derivatives is looked at.
fn visible(
    extended: &Extended<'_>,
    examinations: &[Examination],
) -> Result<Vec<(String, bool)>, Error> {
    let names = extended.states.iter().map(|s| s.name.clone());
    if examinations.iter().any(|e| e.fit == Fit::Fits) {
        return Ok(names.map(|name| (name, true)).collect());
    }
    let visible = visibility::visible(extended).map_err(|error| Error::input(error.to_string()))?;
    Ok(names.zip(visible).collect())
}

impl Report {
    /// True if an observer exists.
    pub fn is_positive(&self) -> bool {
        self.recommended.is_some()
    }

    /// The report for machines.
    pub fn to_json(&self) -> Value {
        let families: Vec<Value> = self.examinations.iter().map(family).collect();
        let visible: serde_json::Map<String, Value> = self
            .visible
            .iter()
            .map(|(name, seen)| (name.clone(), json!(seen)))
            .collect();
        json!({
            "plant": self.plant,
            "states": self.states,
            "measured": self.measured,
            "unknown": self.unknown,
            "recommended": self.recommended,
            "families": families,
            "visible": visible,
        })
    }
}

fn family(examination: &Examination) -> Value {
    let check = |check: &lynkeus_structure::Check| {
        let mut entry = json!({
            "name": check.name,
            "verdict": check.verdict.word(),
            "detail": check.detail,
        });
        match &check.verdict {
            Condition::Proved => {}
            Condition::Refuted(witness) => {
                entry["witness"] = witness.points.iter().map(point).collect();
            }
            Condition::Undecided(sides) => {
                let sides = sides
                    .iter()
                    .map(|(name, low, high)| (name.clone(), json!([low, high])));
                entry["box"] = Value::Object(sides.collect());
            }
        }
        entry
    };
    json!({
        "family": examination.family,
        "fit": examination.fit.words(),
        "summary": examination.summary,
        "chains": examination.chains,
        "checks": examination.checks.iter().map(check).collect::<Vec<_>>(),
    })
}

pub(crate) fn point(point: &Point) -> Value {
    let at = point
        .coordinates
        .iter()
        .map(|(name, x)| (name.clone(), json!(x)));
    json!({ "value": point.value, "at": Value::Object(at.collect()) })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |names: &[String]| {
            if names.is_empty() {
                "nothing".to_owned()
            } else {
                names.join(", ")
            }
        };
        writeln!(
            f,
            "{}: {} states, measured {}, unknown {}",
            self.plant,
            self.states.len(),
            list(&self.measured),
            list(&self.unknown)
        )?;
        for examination in &self.examinations {
            writeln!(f, "\n{}: {}", examination.family, examination.fit.words())?;
            writeln!(f, "  {}", examination.summary)?;
            conditions(f, examination)?;
        }
        writeln!(f)?;
        self.conclusion(f)
    }
}

/// Conditions listed one by one: more proved ones than this become a count.
const LISTED: usize = 12;

fn conditions(f: &mut fmt::Formatter<'_>, examination: &Examination) -> fmt::Result {
    let proved = |check: &&lynkeus_structure::Check| check.verdict == Condition::Proved;
    let count = examination.checks.iter().filter(proved).count();
    let brief = count > LISTED;
    if brief {
        writeln!(f, "  proved     {count} conditions on the whole box")?;
    }
    for check in examination.checks.iter().filter(|c| !(brief && proved(c))) {
        writeln!(
            f,
            "  {:<10} {}: {}",
            check.verdict.word(),
            check.name,
            check.detail
        )?;
        if let Condition::Refuted(_) = check.verdict {
            writeln!(f, "             {}", check.verdict)?;
        }
    }
    Ok(())
}

impl Report {
    /// Why the family is recommended.
    fn reason(&self) -> String {
        let chosen = self
            .examinations
            .iter()
            .find(|e| Some(e.family) == self.recommended);
        let others = self
            .examinations
            .iter()
            .filter(|e| e.fit == Fit::Fits)
            .count()
            > 1;
        match chosen.map(|e| (e.family, e.fit)) {
            Some((family, Fit::Fits)) if others => {
                format!("{family} comes first: of the families that fit, it has the simplest gain")
            }
            Some((family, Fit::Fits)) => {
                format!("{family} is the one whose every condition is proved")
            }
            Some((family, _)) => format!(
                "{family} is not proved to fit, but nothing refutes it; watch its monitors, or tighten min and max"
            ),
            None => String::new(),
        }
    }

    fn conclusion(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |seen: bool| -> Vec<&str> {
            self.visible
                .iter()
                .filter(|(_, v)| *v == seen)
                .map(|(name, _)| name.as_str())
                .collect()
        };
        let (visible, hidden) = (named(true), named(false));
        match self.recommended {
            Some(family) => {
                let all: Vec<&str> = self.visible.iter().map(|(name, _)| name.as_str()).collect();
                writeln!(f, "can be estimated: {} (by {family})", all.join(", "))?;
                writeln!(f, "{}", self.reason())
            }
            None => {
                writeln!(f, "no observer of this version fits these sensors")?;
                if !visible.is_empty() {
                    writeln!(
                        f,
                        "leave a trace in the outputs (numerically, at generic points): {}",
                        visible.join(", ")
                    )?;
                }
                if !hidden.is_empty() {
                    writeln!(
                        f,
                        "leave no trace in the outputs: {}; measure something that they act on",
                        hidden.join(", ")
                    )?;
                }
                Ok(())
            }
        }
    }
}
