//! The noises of a filter: as the study declares them, else from the log and the ranges.

use lynkeus_expr::Node;
use lynkeus_model::Variable;
use lynkeus_run::Level;
use lynkeus_run::filter::{Correlation, Drawn};
use lynkeus_structure::AugmentedPlant;
use lynkeus_words::short;

use crate::Series;
use crate::course::Samples;
use crate::prepare::Prepared;
use crate::prepare::declared::Declared;
use lynkeus_table::series::{Sorted, steps};

/// The noise of each measured output; without `noise` in the study, how much the log's own
/// readings scatter.
pub(crate) fn levels(
    declared: &Declared,
    augmented: &AugmentedPlant<'_>,
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Vec<Level> {
    let mut levels = vec![];
    for (i, output) in augmented.outputs.iter().enumerate() {
        let name = &output.variable.name;
        levels.push(match declared.noise.of(name) {
            Some(noise) => Level::from(*noise),
            None => {
                let readings = &samples.readings[i];
                let found = scatter(&samples.time, readings, 0).unwrap_or_else(|| even(readings));
                notes.push(format!(
                    "noise of {name}: {} (standard deviation), from the scatter of its readings; noise = {{ {name} = … }} under [sensors] says better",
                    short(found)
                ));
                Level::Absolute(found)
            }
        });
    }
    levels
}

/// What every row draws anew: errors of the readings of these inputs, and what the noises of the measured outputs have
/// in common; none where nothing is declared of either.
pub fn drawn<'g>(
    declared: &Declared,
    augmented: &AugmentedPlant<'g>,
    inputs: &[(String, Node)],
) -> Option<Drawn<'g>> {
    let measured = augmented.outputs.iter();
    let measured: Vec<&str> = measured.map(|o| o.variable.name.as_str()).collect();
    let place = |name: &str| measured.iter().position(|output| *output == name);
    let pairs = declared.correlation.iter().flat_map(|(one, others)| {
        let others = others.iter();
        others.filter_map(|(other, value)| Some((place(one)?, place(other)?, *value)))
    });
    let pairs: Vec<(usize, usize, f64)> = pairs.filter(|pair| pair.2 != 0.0).collect();
    // a part of a positive definite matrix is one
    let correlation = Correlation::new(measured.len(), &pairs).ok();
    let correlation = correlation.filter(|_| !pairs.is_empty());
    let errors = errors(declared, inputs);
    let is_there = !errors.is_empty() || correlation.is_some();
    is_there.then(|| Drawn::new(augmented.graph(), &errors, correlation))
}

/// The first of these alone.
pub(crate) fn misread<'g>(
    declared: &Declared,
    augmented: &AugmentedPlant<'g>,
    inputs: &[(String, Node)],
) -> Option<Drawn<'g>> {
    let errors = errors(declared, inputs);
    (!errors.is_empty()).then(|| Drawn::new(augmented.graph(), &errors, None))
}

/// The inputs whose readings have errors.
fn errors(declared: &Declared, inputs: &[(String, Node)]) -> Vec<(String, Node, Level)> {
    let error = |(name, symbol): &(String, Node)| {
        let level = Level::from(*declared.input_noise.of(name)?);
        (level.size() > 0.0).then(|| (name.clone(), *symbol, level))
    };
    inputs.iter().filter_map(error).collect()
}

/// Readings that do not scatter: a thousandth of their range, or of their size.
fn even(readings: &Series) -> f64 {
    let finite = || readings.iter().filter(|y| y.is_finite());
    let (low, high) = (
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(f64::NEG_INFINITY, f64::max),
    );
    let size = if high > low { high - low } else { high.abs() };
    1e-3 * if size > 0.0 && size.is_finite() {
        size
    } else {
        1.0
    }
}

/// The standard deviation of white noise on a smooth signal, from the distance of each reading
/// from row `from` on to the line between its neighbours: robust, by the median. None for fewer
/// than five readings, or readings that lie on one line.
pub fn scatter(time: &Series, readings: &Series, from: usize) -> Option<f64> {
    let points = || {
        let pairs = time.iter_from(from).zip(readings.iter_from(from));
        pairs.filter(|(_, y)| y.is_finite())
    };
    if points().take(5).count() < 5 {
        return None;
    }
    let triples = points().zip(points().skip(1)).zip(points().skip(2));
    let residuals = triples
        .filter(|((a, _), c)| c.0 > a.0)
        .map(|((a, b), c)| off_line(a, b, c));
    let residuals = Sorted::new(time.store(), residuals);
    // 1.4826 times the median of |normal deviates| is their standard deviation
    let median = 1.4826 * residuals.median()?;
    drop(residuals);
    // readings in steps: most of them on a line, and the step's own error
    let values = Sorted::new(time.store(), points().map(|p| p.1));
    let step = steps(values.iter()).filter(|d| *d > 0.0);
    let step = step.fold(f64::INFINITY, f64::min);
    let quantised = if step.is_finite() {
        step / 12_f64.sqrt()
    } else {
        0.0
    };
    let found = median.max(quantised);
    (found > 0.0).then_some(found)
}

/// How far b is from the line from a to c, scaled to the deviation of one of them.
fn off_line(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> f64 {
    let share = (b.0 - a.0) / (c.0 - a.0);
    let line = a.1 + share * (c.1 - a.1);
    let weight = 1.0 + share.powi(2) + (1.0 - share).powi(2);
    (b.1 - line).abs() / weight.sqrt()
}

/// Spectral densities, one per estimated quantity: the study's `[process_noise]`; for an
/// unknown input without one, a wander over a quarter of its range in a tenth of the log. Where the
/// study declares none at all every state may drift a little.
pub fn densities(prepared: &Prepared<'_>, span: f64, notes: &mut Vec<String>) -> Vec<f64> {
    let (study, augmented) = (prepared.study(), prepared.augmented());
    let declared = &prepared.declared().process_noise;
    // who says how wrong the readings of inputs are has said what moves the plant otherwise
    let is_declared = declared.is_declared() || prepared.declared().input_noise.acts();
    let is_constant = |state: &Variable| {
        let mut names = study.sensors.unknown.iter();
        names.any(|name| name.is_or_has(&state.name))
    };
    let mut is_awake = false;
    let chosen = augmented.states.iter().enumerate();
    let chosen: Vec<f64> = chosen
        .map(|(i, state)| match declared.of(&state.name) {
            Some(density) => *density,
            None if span <= 0.0 => 0.0,
            None if i >= augmented.plant_states() => wander(state, span, notes),
            None if is_declared || is_constant(state) => 0.0,
            None => {
                let width = state.width();
                is_awake |= width.is_finite();
                if width.is_finite() {
                    10.0 * (DOUBT * width).powi(2) / span
                } else {
                    0.0
                }
            }
        })
        .collect();
    if is_awake {
        notes.push(format!(
            "without [process_noise] the model is taken as right up to {} % of each state's range in a tenth of the log, so that the gain does not decay to zero",
            100.0 * DOUBT
        ));
    }
    chosen
}

/// The same for a family with a theorem, whose gain reads none: what is not declared is an unknown
/// input's wander, and no doubt of the model.
pub(crate) fn of_families(prepared: &Prepared<'_>, span: f64, notes: &mut Vec<String>) -> Vec<f64> {
    let (augmented, declared) = (prepared.augmented(), &prepared.declared().process_noise);
    let states = augmented.states.iter().enumerate();
    let density = |(i, state): (usize, &Variable)| match declared.of(&state.name) {
        Some(density) => *density,
        None if i >= augmented.plant_states() && span > 0.0 => wander(state, span, notes),
        None => 0.0,
    };
    states.map(density).collect()
}

/// A density to begin a search with: a wander over a twentieth of the range, or of the start value, in a tenth
/// of the log.
pub fn guessed(state: &Variable, span: f64) -> f64 {
    let width = state.width();
    let size = match width.is_finite() && width > 0.0 {
        true => width,
        false => state.start.unwrap_or(0.0).abs().max(1.0),
    };
    10.0 * (0.05 * size).powi(2) / span.max(f64::MIN_POSITIVE)
}

/// What a model may be wrong by where the study does not say: this share of a state's range.
const DOUBT: f64 = 0.0025;

fn wander(state: &Variable, span: f64, notes: &mut Vec<String>) -> f64 {
    let width = state.width();
    let (reach, from) = match width.is_finite() && width > 0.0 {
        true => (width / 4.0, "a quarter of its range"),
        false => (
            state.start.unwrap_or(0.0).abs().max(1.0),
            "its start value, or 1,",
        ),
    };
    let density = 10.0 * reach.powi(2) / span;
    notes.push(format!(
        "{} wanders with a spectral density of {}: {from} in a tenth of the log; {} = … under [process_noise] says better",
        state.name,
        short(density),
        state.name
    ));
    density
}

#[cfg(test)]
mod tests {
    use super::scatter;

    #[test]
    fn noise_is_told_from_a_signal_by_its_scatter() {
        // a slow wave with alternating errors of ±0.1 and one outlier
        let time: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
        let mut y: Vec<f64> = time
            .iter()
            .enumerate()
            .map(|(k, t)| t.sin() + if k % 2 == 0 { 0.1 } else { -0.1 })
            .collect();
        y[77] = 50.0;
        y[10] = f64::NAN;
        let scatter =
            |time: &[f64], y: &[f64]| scatter(&time.to_vec().into(), &y.to_vec().into(), 0);
        let found = scatter(&time, &y).unwrap();
        assert!(0.1 < found && found < 0.4, "{found}");
        assert_eq!(scatter(&time, &[3.0; 200]), None);
        assert_eq!(scatter(&time[..3], &y[..3]), None);
        // whole numbers: the error of rounding
        let counted: Vec<f64> = time.iter().map(|t| (0.2 * t).floor()).collect();
        assert!((scatter(&time, &counted).unwrap() - 1.0 / 12_f64.sqrt()).abs() < 1e-12);
    }
}
