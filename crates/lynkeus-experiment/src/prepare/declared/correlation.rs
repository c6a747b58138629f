//! Which noises of sensors go together: `correlation` of `[sensors]`.

use std::collections::BTreeMap;

use lynkeus_run::filter::Correlation;
use lynkeus_study::{Name, Noise};

use crate::{Error, near};

/// The correlations by the first output of each pair.
///
/// # Errors
/// A name that is no output, a pair that is given twice or of one output, noises that are none or uniform, and a matrix
/// that is not positive definite.
pub(super) fn read(
    given: &[(Name, Name, f64)],
    noise: &dyn Fn(&str) -> Option<Noise>,
    outputs: &[String],
) -> Result<BTreeMap<String, Vec<(String, f64)>>, Error> {
    let mut said: BTreeMap<String, Vec<(String, f64)>> = BTreeMap::new();
    let mut pairs: Vec<(usize, usize, f64)> = vec![];
    for (one, other, correlation) in given {
        let [a, b] = [place(one, noise, outputs)?, place(other, noise, outputs)?];
        let is_same =
            |pair: &(usize, usize, f64)| (pair.0, pair.1) == (a, b) || (pair.1, pair.0) == (a, b);
        if a == b || pairs.iter().any(is_same) {
            let message = format!(
                "`correlation` of [sensors]: expected each pair of two outputs once, found {one} and {other} again"
            );
            let refusal = Error::input(message).hint("keep one of the two numbers");
            return Err(other.blame(refusal));
        }
        pairs.push((a, b, *correlation));
        let own = said.entry(outputs[a].clone()).or_default();
        own.push((outputs[b].clone(), *correlation));
    }
    if let (Err(least), Some((first, ..))) =
        (Correlation::new(outputs.len(), &pairs), given.first())
    {
        let message = format!(
            "`correlation` of [sensors]: expected a positive definite matrix, found one whose smallest eigenvalue is {}",
            lynkeus_words::figures(least, 3)
        );
        return Err(first.blame(Error::input(message).hint(
            "noises that go with one another so much cannot do so all at once: take smaller correlations",
        )));
    }
    Ok(said)
}

/// The place of an output whose noise has a standard deviation.
fn place(
    name: &Name,
    noise: &dyn Fn(&str) -> Option<Noise>,
    outputs: &[String],
) -> Result<usize, Error> {
    let refuse = |what: String, hint: String| {
        let message = format!("`correlation` of [sensors]: {what}");
        name.blame(Error::input(message).hint(hint))
    };
    let Some(place) = outputs.iter().position(|output| *output == name.text) else {
        let hint = near::suggest(&name.text, outputs.iter().map(String::as_str));
        return Err(refuse(format!("no output is called \"{name}\""), hint));
    };
    match noise(&name.text) {
        Some(Noise::Absolute(_) | Noise::Relative(_)) => Ok(place),
        Some(Noise::Uniform(_)) => Err(refuse(
            format!("the noise of {name} is uniform, and correlations are of normal noises"),
            format!("give its standard deviation: noise = {{ {name} = … }}"),
        )),
        None => Err(refuse(
            format!("{name} has no `noise`"),
            format!("add noise = {{ {name} = … }}, its standard deviation, to [sensors]"),
        )),
    }
}
