//! The singular set drawn.

use lynkeus_plot::{Figure, Mark, Panel, Scale};
use lynkeus_structure::{Dimension, Place, Uniformity};
use lynkeus_words::counted;

use super::Report;
use crate::Error;

impl Report {
    /// The singular set inside the box, for a plant with two states.
    ///
    /// # Errors
    /// Another number of states, or a state without range.
    pub fn picture(&self) -> Result<Figure, Error> {
        match &self.uniform {
            Some(uniform) => picture(&self.plant, uniform.examined()),
            None => Err(Error::refused(format!(
                "{}: the singular set was not examined: it needs values for all parameters, at most six states, and outputs that show them",
                self.plant
            ))),
        }
    }
}

/// The singular set of a plant with two states.
fn picture(plant: &str, uniformity: &Uniformity) -> Result<Figure, Error> {
    let [x, y] = &uniformity.sides[..] else {
        let message = format!(
            "{plant} has {} with its unknown inputs: a picture of the singular set needs two; --json lists its parts",
            counted(uniformity.sides.len(), "state")
        );
        return Err(Error::refused(message));
    };
    let along = |part: &Place, whole: &Dimension| {
        let side = part.iter().find(|side| side.name == whole.name);
        let Dimension { min, max, .. } = side.unwrap_or(whole);
        *min..*max
    };
    let parts = uniformity.singular.iter();
    let parts = parts.map(|part| Mark::Part(along(part, x), along(part, y)));
    Ok(Figure {
        title: format!(
            "{plant}: where the outputs' derivatives may not tell neighbouring states apart"
        ),
        label: x.name.clone(),
        across: Scale::Within(x.min..x.max),
        panels: vec![Panel {
            caption: y.name.clone(),
            upwards: Scale::Within(y.min..y.max),
            marks: parts.collect(),
            ..Panel::default()
        }],
    })
}
