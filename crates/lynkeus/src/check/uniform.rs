//! For what inputs and where the states can be told apart, in words and for machines.

use std::fmt;

use lynkeus_structure::uniform::Part;
use lynkeus_structure::{Blind, Condition, Uniformity};
use serde_json::{Map, Value, json};

use crate::words::{number, side};
#[cfg(feature = "plot")]
use crate::{Error, plot::Plane};

/// Parts of the singular set listed for machines.
const LISTED: usize = 256;

pub(super) fn print(f: &mut fmt::Formatter<'_>, uniformity: &Uniformity) -> fmt::Result {
    match &uniformity.regular.verdict {
        Condition::Proved => {
            return writeln!(
                f,
                "for every constant input and everywhere on the box: proved"
            );
        }
        Condition::Refuted(witness) => {
            let first = witness
                .points
                .iter()
                .min_by(|p, q| p.value.abs().total_cmp(&q.value.abs()));
            let place = first.map(|p| {
                let sides = p.coordinates.iter().map(|(n, x)| side(n, *x, *x));
                sides.collect::<Vec<_>>().join(", ")
            });
            writeln!(
                f,
                "not everywhere on the box: the map from states to outputs and their derivatives is singular at {}",
                place.unwrap_or_default()
            )?;
        }
        Condition::Undecided(_) => {
            writeln!(f, "not decided everywhere on the box")?;
        }
    }
    for blind in &uniformity.blind {
        writeln!(f, "  {}", told(blind))?;
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

fn told(blind: &Blind) -> String {
    let input = side(&blind.input, blind.value, blind.value);
    let Some(states) = &blind.alike else {
        return format!(
            "with the constant input {input} neighbouring states look alike everywhere: excite it"
        );
    };
    let [one, other] = states.each_ref().map(|state| {
        let sides = state.iter().map(|(name, x)| side(name, *x, *x));
        sides.collect::<Vec<_>>().join(", ")
    });
    format!(
        "with the constant input {input} states that differ only in {} give the same outputs, e.g. ({one}) and ({other}): excite it",
        blind.hidden.join(", ")
    )
}

/// The smallest box around the parts.
fn hull(parts: &[Part]) -> String {
    let Some(first) = parts.first() else {
        return String::new();
    };
    let sides = first.iter().enumerate().map(|(i, (name, ..))| {
        let low = parts.iter().map(|p| p[i].1).fold(f64::INFINITY, f64::min);
        let high = parts
            .iter()
            .map(|p| p[i].2)
            .fold(f64::NEG_INFINITY, f64::max);
        side(name, low, high)
    });
    sides.collect::<Vec<_>>().join(", ")
}

/// `{verdict, detail, share, singular, blind}`
pub(super) fn json(uniformity: &Uniformity) -> Value {
    let part = |part: &Part| {
        let sides = part
            .iter()
            .map(|(name, low, high)| (name.clone(), json!([low, high])));
        Value::Object(sides.collect::<Map<_, _>>())
    };
    let blind = uniformity
        .blind
        .iter()
        .map(|blind| json!({ "input": blind.input, "value": blind.value, "hidden": blind.hidden }));
    json!({
        "verdict": uniformity.regular.verdict.word(),
        "detail": uniformity.regular.detail,
        "share": uniformity.share,
        "singular": uniformity.singular.iter().take(LISTED).map(part).collect::<Vec<_>>(),
        "blind": blind.collect::<Vec<_>>(),
    })
}

/// The singular set of a plant with two states.
#[cfg(feature = "plot")]
pub(super) fn picture(plant: &str, uniformity: &Uniformity) -> Result<Plane, Error> {
    let [(x, x_low, x_high), (y, y_low, y_high)] = &uniformity.sides[..] else {
        let message = format!(
            "{plant} has {} states and unknown inputs: a picture of the singular set needs two; --json lists its parts",
            uniformity.sides.len()
        );
        return Err(Error::input(message));
    };
    let side = |part: &Part, name: &str, all: std::ops::Range<f64>| {
        let found = part.iter().find(|(n, ..)| n == name);
        found.map_or(all, |(_, low, high)| *low..*high)
    };
    let parts = uniformity.singular.iter().map(|part| {
        (
            side(part, x, *x_low..*x_high),
            side(part, y, *y_low..*y_high),
        )
    });
    Ok(Plane {
        title: format!(
            "{plant}: where the outputs' derivatives may not tell neighbouring states apart"
        ),
        across: (x.clone(), *x_low..*x_high),
        upwards: (y.clone(), *y_low..*y_high),
        parts: parts.collect(),
    })
}
