//! Readings at an end of what their sensor can show.

use lynkeus_observers::Design;
use lynkeus_run::filter::Limits;

use crate::Series;
use crate::prepare::Prepared;

/// What an observer without covariance makes of such a reading, and what would heed it.
pub(crate) const TAKEN: &str = "this observer takes that for its value: family = \"ekf\", \"ukf\" or \"mhe\" takes it for a bound";

/// A measured output whose sensor cannot show everything.
#[derive(Clone, Debug)]
pub(crate) struct Limited {
    pub name: String,
    pub limits: Limits,
}

/// The measured outputs whose sensors have limits.
pub(crate) fn limited(prepared: &Prepared<'_>) -> Vec<Limited> {
    let limits = &prepared.declared().limits;
    let of = |output: &lynkeus_structure::Measurement| {
        let name = output.variable.name.clone();
        let limits = *limits.of(&name)?;
        Some(Limited { name, limits })
    };
    prepared.augmented().outputs.iter().filter_map(of).collect()
}

/// What is to be said of readings at an end of their sensor's range, by an observer that takes them
/// as they stand.
pub(crate) fn told(
    prepared: &Prepared<'_>,
    design: &Design,
    measurements: &[(String, Series)],
) -> Vec<String> {
    if design.observer.filter.is_some() {
        return vec![];
    }
    let of = |Limited { name, limits }: &Limited| {
        let (_, readings) = measurements.iter().find(|(own, _)| own == name)?;
        let count = readings.iter().filter(|y| limits.ends(*y)).count();
        (count > 0).then(|| {
            format!(
                "{name} is at an end of its sensor's range in {count} of {} rows, and {TAKEN}",
                readings.len()
            )
        })
    };
    limited(prepared).iter().filter_map(of).collect()
}
