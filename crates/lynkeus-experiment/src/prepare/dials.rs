//! Sensors that show angles: what may be said of them.

use lynkeus_structure::AugmentedPlant;

use crate::prepare::declared::Declared;
use crate::prepare::manifold::is_circle;
use crate::{Error, Study};
use lynkeus_study::Noise;

/// Refuses what is said of the readings of angles as if they were real numbers.
///
/// # Errors
/// Ends of a range, a share of the value.
pub(super) fn refuse_ends(
    study: &Study,
    declared: &Declared,
    augmented: &AugmentedPlant<'_>,
) -> Result<(), Error> {
    let dials = augmented.outputs.iter().map(|o| &o.variable);
    for dial in dials.filter(|variable| is_circle(variable)) {
        let name = &dial.name;
        let (key, why) = match (declared.limits.of(name), declared.noise.of(name)) {
            (Some(_), _) => (
                "limits",
                "a full turn changes nothing there, so that it has no ends",
            ),
            (_, Some(Noise::Relative(_))) => {
                ("noise", "a share of it says another noise after each turn")
            }
            _ => continue,
        };
        let message = format!("`{key}` of [sensors]: {name} is an angle by [manifold]: {why}");
        let hint = match key {
            "limits" => "leave it out, or take the angle out of `circle`".to_owned(),
            _ => format!("give its standard deviation in rad: noise = {{ {name} = 0.01 }}"),
        };
        return Err(Error::input(message).at(&study.file).hint(hint));
    }
    Ok(())
}
