//! Angles and rotations of a run as they are shown and compared.

use lynkeus_model::{Home, Plant, Variable};
use lynkeus_observers::{Estimate, Observer};
use lynkeus_run::Role;
use lynkeus_run::manifold::{angle_between, wrapped};

use crate::course::Course;
use crate::course::quantity::Rotation;
use crate::course::recorded::Recorded;
use crate::prepare::headers::Headers;
use crate::prepare::manifold::firsts;
use crate::{Quantity, Series};

/// Tells quantities where they live: angles go to their declared turn, and a quaternion's first number has
/// what is known of its rotation. Readings of angles go to the turn of their output.
pub(crate) fn place(
    plant: &Plant,
    replayed: bool,
    quantities: &mut [Quantity],
    measurements: &mut [(String, Series)],
) {
    let homes = plant.states.iter().chain(&plant.outputs);
    let curved: Vec<&Variable> = homes.filter(|v| v.home != Home::Line).collect();
    if curved.is_empty() {
        return;
    }
    for quantity in quantities.iter_mut() {
        let own = plant.states.iter().find(|s| s.name == quantity.name);
        quantity.home = own.map_or(Home::Line, |state| state.home);
        match quantity.home {
            Home::Circle { from: Some(from) } => {
                let columns = [
                    &mut quantity.truth,
                    &mut quantity.estimate,
                    &mut quantity.smoothed,
                ];
                columns
                    .into_iter()
                    .flatten()
                    .for_each(|x| *x = in_turn(x, from));
            }
            // a log's truth is of any turn
            Home::Circle { from: None } if replayed => {
                quantity.truth = beside(&quantity.truth, &quantity.estimate);
            }
            _ => {}
        }
    }
    for (name, readings) in measurements.iter_mut() {
        let output = plant.outputs.iter().find(|o| o.name == *name);
        let Some(Home::Circle { from }) = output.map(|o| o.home) else {
            continue;
        };
        let state = plant
            .states
            .iter()
            .find(|s| Some(s.node) == output.map(|o| o.node));
        let shown = state.and_then(|s| quantities.iter().find(|q| q.name == s.name));
        let estimate = shown.map_or(&None, |q| &q.estimate);
        *readings = match (from, beside(&Some(readings.clone()), estimate)) {
            (Some(from), _) => in_turn(readings, from),
            (None, Some(lifted)) => lifted,
            (None, None) => readings.clone(),
        };
    }
    for (place, name) in firsts(&plant.states) {
        turn_readings(plant, place, quantities, measurements);
        place_rotation(&name, quantities);
    }
}

/// Readings that change their sign with a quaternion as those of its estimate, where they are its numbers.
fn turn_readings(
    plant: &Plant,
    of: usize,
    quantities: &[Quantity],
    measurements: &mut [(String, Series)],
) {
    let output = |name: &str| plant.outputs.iter().find(|o| o.name == name);
    let own: Vec<usize> = (0..measurements.len())
        .filter(|&i| output(&measurements[i].0).is_some_and(|o| o.home == Home::Signed { of }))
        .collect();
    let estimate = |i: usize| {
        let node = output(&measurements[i].0)?.node;
        let state = plant.states.iter().find(|s| s.node == node)?;
        let shown = quantities.iter().find(|q| q.name == state.name)?;
        Some((measurements[i].1.iter(), shown.estimate.as_ref()?.iter()))
    };
    let mut pairs: Vec<_> = own.iter().filter_map(|&i| estimate(i)).collect();
    if pairs.is_empty() {
        return;
    }
    let rows = own.iter().map(|&i| measurements[i].1.len()).max();
    let signs: Vec<f64> = (0..rows.unwrap_or(0))
        .map(|_| {
            let products = pairs.iter_mut();
            let products = products.filter_map(|(y, x)| Some(y.next()? * x.next()?));
            let along: f64 = products.filter(|p| p.is_finite()).sum();
            if along < 0.0 { -1.0 } else { 1.0 }
        })
        .collect();
    for i in own {
        let readings = &mut measurements[i].1;
        let signed = readings.iter().zip(&signs).map(|(y, sign)| sign * y);
        *readings = Series::gathered(readings.store(), signed);
    }
}

/// Gives what is expected of measured angles that are no states their turn.
pub(crate) fn place_expected(quantities: &mut [Quantity]) {
    for quantity in quantities {
        let Some(expected) = &quantity.expected else {
            continue;
        };
        quantity.expected = match quantity.home {
            Home::Circle { from: Some(from) } => Some(in_turn(expected, from)),
            Home::Circle { from: None } => match &quantity.measured {
                Some(readings) => Some(lifted(expected, readings)),
                None => continue,
            },
            _ => continue,
        };
    }
}

/// Estimates as those of the same angles and rotations that are nearest to the true ones.
pub(crate) fn beside_truth(
    plant: &Plant,
    observer: &Observer,
    ran: &Recorded,
    course: &mut Course,
) {
    let estimates = observer.estimates.iter().enumerate();
    let truth = |e: &Estimate| {
        let place = plant
            .states
            .iter()
            .position(|s| s.node == e.variable.node)?;
        ran.column(Role::State.at(place))
    };
    for (i, estimate) in estimates {
        let home = estimate.variable.home;
        let Some(own) = truth(estimate).filter(|_| home != Home::Line) else {
            continue;
        };
        let smoothed = course.smoothed.iter_mut();
        for columns in std::iter::once(&mut course.estimates).chain(smoothed) {
            match home {
                Home::Circle { .. } => columns[i] = lifted(&columns[i], own),
                Home::Rotation { element: 0 } => {
                    let all = observer.estimates.get(i..i + 4).unwrap_or_default();
                    let known: Vec<&Series> = all.iter().filter_map(truth).collect();
                    if let Ok(known) = <[&Series; 4]>::try_from(known) {
                        take_sign(&mut columns[i..i + 4], &known);
                    }
                }
                _ => {}
            }
        }
    }
}

/// Of a quaternion and its negative the one that is nearer to what is known.
fn take_sign(columns: &mut [Series], known: &[&Series; 4]) {
    let found: Vec<&Series> = columns.iter().collect();
    let Ok(found) = <[&Series; 4]>::try_from(found) else {
        return;
    };
    let along = |(one, other): ([f64; 4], [f64; 4])| -> f64 {
        one.iter().zip(other).map(|(a, b)| a * b).sum()
    };
    let signs = || {
        let pairs = rows(&found).zip(rows(known));
        pairs
            .map(along)
            .map(|along| if along < 0.0 { -1.0 } else { 1.0 })
    };
    let turned = found.map(|own| {
        let values = own.iter().zip(signs()).map(|(x, sign)| sign * x);
        Series::gathered(own.store(), values)
    });
    for (column, turned) in columns.iter_mut().zip(turned) {
        *column = turned;
    }
}

/// The angle, in rad, between the rotations that columns of quaternions say.
pub(crate) fn angles(one: &[&Series; 4], other: &[&Series; 4]) -> Series {
    let angles = rows(one).zip(rows(other));
    let angles = angles.map(|(one, other)| angle_between(one, other));
    Series::gathered(one[0].store(), angles)
}

/// Angles in the turn that begins at an angle.
fn in_turn(angles: &Series, from: f64) -> Series {
    const TURN: f64 = std::f64::consts::TAU;
    let shown = angles
        .iter()
        .map(|x| x - TURN * ((x - from) / TURN).floor());
    Series::gathered(angles.store(), shown)
}

/// Angles in the turns of others.
fn beside(angles: &Option<Series>, others: &Option<Series>) -> Option<Series> {
    Some(lifted(angles.as_ref()?, others.as_ref()?))
}

/// The same of columns that are there.
pub(crate) fn lifted(angles: &Series, others: &Series) -> Series {
    let pairs = angles.iter().zip(others);
    let lifted = pairs.map(|(angle, other)| match other.is_finite() {
        true => other + wrapped(angle - other),
        false => angle,
    });
    Series::gathered(angles.store(), lifted)
}

fn place_rotation(name: &str, quantities: &mut [Quantity]) {
    let is_own = |q: &Quantity| {
        let element = q.name.strip_prefix(name);
        element.is_some_and(|rest| rest.starts_with('[')) && q.home != Home::Line
    };
    let Some(first) = quantities.iter().position(is_own) else {
        return;
    };
    let Some(own) = quantities.get(first..first + 4) else {
        return;
    };
    let estimate = together(own, |q| &q.estimate);
    let truth = together(own, |q| &q.truth);
    let rotation = Rotation {
        name: name.to_owned(),
        error: estimate.zip(truth).map(|(one, other)| angles(&one, &other)),
        deviation: together(own, |q| &q.deviation).map(|sd| of_angle(&sd)),
        smoothed_deviation: together(own, |q| &q.smoothed_deviation).map(|sd| of_angle(&sd)),
        ..Rotation::default()
    };
    quantities[first].rotation = Some(Box::new(rotation));
}

/// Columns of the four numbers.
fn together(own: &[Quantity], of: fn(&Quantity) -> &Option<Series>) -> Option<[&Series; 4]> {
    let columns: Option<Vec<&Series>> = own.iter().map(|q| of(q).as_ref()).collect();
    columns?.try_into().ok()
}

fn rows<'s>(columns: &[&'s Series; 4]) -> impl Iterator<Item = [f64; 4]> + use<'s> {
    let mut columns = columns.map(Series::iter);
    std::iter::from_fn(move || {
        let row = columns.each_mut().map(Iterator::next);
        row.iter()
            .all(Option::is_some)
            .then(|| row.map(Option::unwrap_or_default))
    })
}

/// The deviation of the rotation's angle by those of the four numbers: |θ| = 2|δq|.
fn of_angle(deviations: &[&Series; 4]) -> Series {
    let angle = |sd: [f64; 4]| 2.0 * sd.iter().map(|x| x * x).sum::<f64>().sqrt();
    Series::gathered(deviations[0].store(), rows(deviations).map(angle))
}

impl Rotation {
    /// Gives its columns headers.
    pub(crate) fn give_headers(&mut self, headers: &mut Headers) {
        let what = format!("the deviation of the rotation {}", self.name);
        if self.deviation.is_some() {
            self.deviation_header = headers.free(&format!("{}_sd", self.name), &what);
        }
        if self.smoothed_deviation.is_some() {
            let wanted = format!("{}_smooth_sd", self.name);
            let what = format!("{what} given later rows");
            self.smoothed_deviation_header = headers.free(&wanted, &what);
        }
    }
}
