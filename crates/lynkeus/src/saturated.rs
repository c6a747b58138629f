//! Readings at an end of what their sensor can show.

use lynkeus_observers::Design;
use lynkeus_run::filter::Limits;
use lynkeus_structure::Measurement;

use crate::prepare::Prepared;
use crate::{Error, Series, filter};

/// What is to be said of readings at an end of their sensor's range, by an observer that takes them
/// as they stand.
///
/// # Errors
/// Limits of what is not measured.
pub(crate) fn told(
    prepared: &Prepared<'_>,
    design: &Design,
    measurements: &[(String, Series)],
) -> Result<Vec<String>, Error> {
    let extended = prepared.extended();
    let limits = filter::limits(prepared.study(), extended)?;
    if design.observer.filter.is_some() {
        return Ok(vec![]);
    }
    let of = |(output, limits): (&Measurement, Option<Limits>)| {
        let (name, limits) = (&output.variable.name, limits?);
        let (_, readings) = measurements.iter().find(|(own, _)| own == name)?;
        let count = readings.iter().filter(|y| limits.ends(*y)).count();
        (count > 0).then(|| {
            format!(
                "{name} is at an end of its sensor's range in {count} of {} rows, and this observer takes that for its value: family = \"ekf\", \"ukf\" or \"mhe\" takes it for a bound",
                readings.len()
            )
        })
    };
    let pairs = extended.outputs.iter().zip(limits);
    Ok(pairs.filter_map(of).collect())
}
