//! For what inputs and where the states can be told apart, in words.

use lynkeus_answer::Document;
use lynkeus_structure::{self as structure, Blind, Coordinate, Place, Uniformity};

use lynkeus_experiment::words::{number, side};
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
pub(super) fn tell(document: &mut Document, uniform: &Uniform, reserves: &str) {
    let Some(uniformity) = uniform.said() else {
        return;
    };
    let assumption = uniform.assumption();
    match &uniformity.regular.verdict {
        structure::Verdict::Proved => {
            let locally = match uniformity.one_to_one.finding.is_proved() {
                true => "",
                false => ", for neighbouring states: locally",
            };
            document.line(format!(
                "for every constant input{assumption} and everywhere on the box: proved{locally}{reserves}"
            ));
            document.items(twins(uniformity));
            return;
        }
        structure::Verdict::Refuted(witness) => {
            let place = witness.zero().map(|p| place(&p.coordinates));
            document.line(format!(
                "not everywhere on the box{assumption}: the map from states to outputs and their derivatives is singular at {}",
                place.unwrap_or_default()
            ));
        }
        structure::Verdict::Undecided(_) => {
            document.line(format!("not decided everywhere on the box{assumption}"));
        }
    }
    document.items(twins(uniformity));
    document.items(uniformity.blind.iter().map(told));
    if !uniformity.undeclared.is_empty() {
        document.item(format!(
            "declare min and max of {} to see where singular points lie",
            uniformity.undeclared.join(", ")
        ));
    } else if uniformity.blind.is_empty() && !uniformity.singular.is_empty() {
        document.item(format!(
            "singular points lie in {} with {} % of its volume, within {}",
            match uniformity.singular.len() {
                1 => "one part".to_owned(),
                count => format!("{count} parts"),
            },
            number(100.0 * uniformity.share),
            hull(&uniformity.singular)
        ));
    }
}

/// A point in words.
fn place(coordinates: &[Coordinate]) -> String {
    let sides = coordinates.iter().map(|c| side(&c.name, c.value, c.value));
    sides.collect::<Vec<_>>().join(", ")
}

/// Two states far apart that nothing tells apart.
fn twins(uniformity: &Uniformity) -> Option<String> {
    let alike = uniformity.one_to_one.alike.as_ref()?;
    let [one, other] = alike
        .points
        .each_ref()
        .map(|point| place(&point.coordinates));
    let nearly = if alike.is_proved {
        ""
    } else {
        ", to twelve digits"
    };
    Some(format!(
        "({one}) and ({other}) give the same outputs and first {} derivatives{nearly}",
        uniformity.sides.len().saturating_sub(1)
    ))
}

fn told(blind: &Blind) -> String {
    let input = side(&blind.input, blind.value, blind.value);
    let Some(states) = &blind.alike else {
        return format!(
            "with the constant input {input} neighbouring states look alike everywhere: excite it"
        );
    };
    let [one, other] = states.each_ref().map(|state| place(state));
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
