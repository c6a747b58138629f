//! Readings beside what an estimate says of them, where no covariance does.

use lynkeus_model::Plant;
use lynkeus_run::Level;

use crate::course::trace::Trace;
use crate::prepare::declared::Declared;
use crate::{Quantity, Series};

/// Of each measured output with a declared noise: reading − estimate's output, in deviations of the
/// sensor. A reading that is held until the next one lags behind, by as much as the output moves
/// meanwhile: where `with_lag`, that is no contradiction.
pub(crate) fn residuals(
    declared: &Declared,
    plant: &Plant,
    time: &Series,
    quantities: &[Quantity],
    measurements: &[(String, Series)],
    with_lag: bool,
) -> Vec<(String, Trace)> {
    let of = |(name, readings): &(String, Series)| {
        let level = Level::from(*declared.noise.of(name)?);
        let mut trace = Trace::default();
        let rows = readings.iter().zip(output(plant, quantities, name)?);
        let mut before = f64::NAN;
        for ((y, expected), t) in rows.zip(time.iter()) {
            let lag = expected - std::mem::replace(&mut before, expected);
            let lag = if with_lag && lag.is_finite() {
                lag
            } else {
                0.0
            };
            let deviation = (level.variance(expected) + lag * lag).sqrt();
            if y.is_finite() && expected.is_finite() && deviation > 0.0 {
                trace.push_deviate(t, (y - expected) / deviation);
            }
        }
        (trace.readings() > 0).then(|| (name.clone(), trace))
    };
    measurements.iter().filter_map(of).collect()
}

/// What the estimate says of an output: a column of its own, or the state that it shows.
fn output<'q>(
    plant: &Plant,
    quantities: &'q [Quantity],
    name: &str,
) -> Option<impl Iterator<Item = f64> + 'q> {
    let named = |name: &str| quantities.iter().find(|q| q.name == name);
    let own = named(name).and_then(|q| q.expected.as_ref());
    let shown = || {
        let output = plant.outputs.iter().find(|o| o.name == name)?;
        let state = plant.states.iter().find(|s| s.node == output.node)?;
        named(&state.name)?.estimate.as_ref()
    };
    Some(own.or_else(shown)?.iter())
}
