//! For what inputs and where the states can be told apart, in words.

use std::fmt;

use lynkeus_structure::{self as structure, Blind, Place, Uniformity};

use crate::words::{number, side};
use lynkeus_observability::{Answer, Quantity, Verdict};

/// What was found on the box, and how far it may be said beside the verdicts on the
/// quantities: the box is examined with unknown inputs that stay constant, the verdicts are on
/// any. Made in one place, so that the two never contradict each other.
#[derive(Clone, Debug)]
pub struct Uniform {
    examined: Uniformity,
    /// states and unknown inputs that the outputs do not determine
    hidden: Vec<String>,
    /// unknown inputs
    constant: Vec<String>,
}

impl Uniform {
    pub(super) fn new(examined: Uniformity, answer: &Answer, unknown: &[String]) -> Self {
        let asked = answer.quantities.iter();
        let hidden = asked.filter(|(asked, kind)| {
            *kind != Quantity::Parameter && asked.verdict == Verdict::Unobservable
        });
        Self {
            hidden: hidden.map(|(asked, _)| asked.name.clone()).collect(),
            constant: unknown.to_vec(),
            examined,
        }
    }

    /// The finding, unless something is not observable at all: then no map from states to
    /// outputs tells all of them apart.
    pub fn said(&self) -> Option<&Uniformity> {
        self.hidden.is_empty().then_some(&self.examined)
    }

    /// What was examined, whatever may be said of it: the singular set for constant unknown inputs.
    pub(super) fn examined(&self) -> &Uniformity {
        &self.examined
    }

    /// The assumption in words.
    fn assumption(&self) -> String {
        match self.constant.is_empty() {
            true => String::new(),
            false => format!(" (while {} stays constant too)", self.constant.join(", ")),
        }
    }
}

/// `reserves` are those of what is known, in words.
pub(super) fn print(f: &mut fmt::Formatter<'_>, uniform: &Uniform, reserves: &str) -> fmt::Result {
    let Some(uniformity) = uniform.said() else {
        return Ok(());
    };
    let assumption = uniform.assumption();
    match &uniformity.regular.verdict {
        structure::Verdict::Proved => {
            writeln!(
                f,
                "for every constant input{assumption} and everywhere on the box: proved{}{reserves}",
                match uniformity.one_to_one.finding.is_proved() {
                    true => "",
                    false => ", for neighbouring states: locally",
                }
            )?;
            return twins(f, uniformity);
        }
        structure::Verdict::Refuted(witness) => {
            let place = witness.zero().map(|p| {
                let sides = p
                    .coordinates
                    .iter()
                    .map(|c| side(&c.name, c.value, c.value));
                sides.collect::<Vec<_>>().join(", ")
            });
            writeln!(
                f,
                "not everywhere on the box{assumption}: the map from states to outputs and their derivatives is singular at {}",
                place.unwrap_or_default()
            )?;
        }
        structure::Verdict::Undecided(_) => {
            writeln!(f, "not decided everywhere on the box{assumption}")?;
        }
    }
    twins(f, uniformity)?;
    for blind in &uniformity.blind {
        writeln!(f, "  {}", told(blind))?;
    }
    if !uniformity.undeclared.is_empty() {
        let names = uniformity.undeclared.join(", ");
        return writeln!(
            f,
            "  declare min and max of {names} to see where singular points lie"
        );
    }
    if uniformity.blind.is_empty() && !uniformity.singular.is_empty() {
        writeln!(
            f,
            "  singular points lie in {} with {} % of its volume, within {}",
            match uniformity.singular.len() {
                1 => "one part".to_owned(),
                count => format!("{count} parts"),
            },
            number(100.0 * uniformity.share),
            hull(&uniformity.singular)
        )?;
    }
    Ok(())
}

/// Two states far apart that nothing tells apart.
fn twins(f: &mut fmt::Formatter<'_>, uniformity: &Uniformity) -> fmt::Result {
    let Some(alike) = &uniformity.one_to_one.alike else {
        return Ok(());
    };
    let [one, other] = alike.points.each_ref().map(|point| {
        let sides = point.coordinates.iter();
        let sides = sides.map(|c| side(&c.name, c.value, c.value));
        sides.collect::<Vec<_>>().join(", ")
    });
    writeln!(
        f,
        "  ({one}) and ({other}) give the same outputs and first {} derivatives{}",
        uniformity.sides.len().saturating_sub(1),
        if alike.is_proved {
            ""
        } else {
            ", to twelve digits"
        }
    )
}

fn told(blind: &Blind) -> String {
    let input = side(&blind.input, blind.value, blind.value);
    let Some(states) = &blind.alike else {
        return format!(
            "with the constant input {input} neighbouring states look alike everywhere: excite it"
        );
    };
    let [one, other] = states.each_ref().map(|state| {
        let sides = state.iter().map(|c| side(&c.name, c.value, c.value));
        sides.collect::<Vec<_>>().join(", ")
    });
    format!(
        "with the constant input {input} states that differ only in {} give the same outputs, e.g. ({one}) and ({other}): excite it",
        blind.hidden.join(", ")
    )
}

/// The smallest box around the parts.
fn hull(parts: &[Place]) -> String {
    let Some(first) = parts.first() else {
        return String::new();
    };
    let sides = first.iter().enumerate().map(|(i, first)| {
        let low = parts.iter().map(|p| p[i].min);
        let high = parts.iter().map(|p| p[i].max);
        side(
            &first.name,
            low.fold(f64::INFINITY, f64::min),
            high.fold(f64::NEG_INFINITY, f64::max),
        )
    });
    sides.collect::<Vec<_>>().join(", ")
}
