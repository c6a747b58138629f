//! Which unknowns the sensors and the logs can tell.

use std::time::Duration;

use lynkeus_expr::Node;
use lynkeus_model::Plant;
use lynkeus_observability::{Quantity, Question, Symmetry, Verdict, analyse};
use lynkeus_study::Objective;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::plant;
use super::problem::{Point, Problem};
use super::unknown::{Kind, Unknown};
use crate::Error;
use lynkeus_experiment::prepare::{self, Prepared, calibrate, manifold};
use lynkeus_experiment::words::explain;

/// The time for what the sensors can tell at all.
const EXACT: Duration = Duration::from_secs(10);

/// What the outputs tell of the parameters, whatever the log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exact {
    /// parameters that no log can tell alone
    pub hidden: Vec<String>,
    /// how they change together without a trace
    pub symmetries: Vec<Symmetry>,
}

/// Decides in exact arithmetic which of the fitted parameters the outputs determine; starts that are known
/// exactly are taken as such.
pub(super) fn exact(
    prepared: &Prepared<'_>,
    symbolic: &Plant,
    unknowns: &[Unknown],
    variances: &[f64],
) -> Result<Exact, Error> {
    let parameters = unknowns.iter().filter(|u| u.kind == Kind::Parameter);
    let parameters: Vec<&str> = parameters.map(|u| u.name.as_str()).collect();
    if parameters.is_empty() {
        return Ok(Exact::default());
    }
    let study = prepared.study();
    let sensors = prepare::sensors(study, symbolic);
    // unknown inputs wander slowly, as the filter has them
    let symbolic = &calibrate::constant_inputs(symbolic.clone(), &sensors.unknown);
    let is_fitted = |place: usize| {
        let mut starts = unknowns.iter();
        starts.any(|u| matches!(u.kind, Kind::Start { state, .. } if state == place))
    };
    let is_exact = |place: usize| {
        study.fit.objective == Objective::Simulation || variances.get(place) == Some(&0.0)
    };
    let states = symbolic.states.iter().enumerate();
    let known = states.filter(|(place, _)| is_exact(*place) && !is_fitted(*place));
    let with_lengths = manifold::with_lengths(symbolic);
    let mut measured = sensors.measured;
    if let (Some(own), false) = (&with_lengths, measured.is_empty()) {
        let known = own.outputs[symbolic.outputs.len()..].iter();
        measured.extend(known.map(|output| output.name.clone()));
    }
    let question = Question {
        measured,
        disturbances: sensors.disturbances,
        parameters: true,
        known_starts: known.map(|(_, state)| state.name.clone()).collect(),
        budget: study.budget.within(EXACT),
        ..Question::default()
    };
    let seen = with_lengths.as_ref().unwrap_or(symbolic);
    let answer = analyse(seen, &question).map_err(|e| explain(e).at(&study.file))?;
    let of_noises = of_noises(prepared, symbolic)?;
    let hidden = answer.quantities.iter().filter(|(asked, kind)| {
        *kind == Quantity::Parameter
            && asked.verdict == Verdict::Unobservable
            && parameters.contains(&asked.name.as_str())
            && !of_noises.contains(&asked.name)
    });
    let hidden: Vec<String> = hidden.map(|(asked, _)| asked.name.clone()).collect();
    let moves = |s: &&Symmetry| s.moves.iter().any(|name| hidden.contains(name));
    Ok(Exact {
        symmetries: answer.symmetries.iter().filter(moves).cloned().collect(),
        hidden,
    })
}

/// The parameters that noises depend on: how far readings scatter tells them, whatever the outputs do.
fn of_noises(prepared: &Prepared<'_>, symbolic: &Plant) -> Result<Vec<String>, Error> {
    let measured = prepared.augmented().outputs.iter();
    let levels = measured
        .map(|output| plant::named(prepared.study(), symbolic, &output.variable.name))
        .collect::<Result<Vec<_>, _>>()?;
    let levels: Vec<Node> = levels.into_iter().flatten().collect();
    let symbols = symbolic.graph.symbols_of(&levels);
    let all = symbolic.parameters.iter().map(|p| &p.variable);
    let own = all.filter(|variable| symbols.contains(&variable.node));
    Ok(own.map(|variable| variable.name.clone()).collect())
}

/// A share of the largest eigenvalue of a correlation below which it is rounding.
const ROUNDING: f64 = 1e-12;

/// A share of a direction below which an unknown is not in it.
const SHARE: f64 = 1e-3;

/// What an information tells of the unknowns.
pub(super) struct Knowledge {
    /// those that can change together without a change of −log L to second order, by their places
    pub flat: Vec<usize>,
    /// of the errors as the search has them, in the directions that are told
    pub covariance: DMatrix<f64>,
}

/// What an information, or a Hessian, tells of the unknowns that are free.
pub(super) fn knowledge(information: &DMatrix<f64>, free: &[usize]) -> Knowledge {
    let n = information.nrows();
    let is_read = |i: &usize| information[(*i, *i)] > 0.0 && information[(*i, *i)].is_finite();
    let (read, mut flat): (Vec<usize>, Vec<usize>) = free.iter().partition(|i| is_read(i));
    let mut covariance = DMatrix::zeros(n, n);
    if read.is_empty() {
        return Knowledge { flat, covariance };
    }
    let scale = DVector::from_fn(read.len(), |i, _| {
        information[(read[i], read[i])].sqrt().recip()
    });
    let unit = DMatrix::from_fn(read.len(), read.len(), |i, j| {
        information[(read[i], read[j])] * scale[i] * scale[j]
    });
    let eigen = SymmetricEigen::new(unit);
    let least = ROUNDING * eigen.eigenvalues.max();
    let directions = eigen.eigenvectors.column_iter();
    for (value, direction) in eigen.eigenvalues.iter().zip(directions) {
        for (i, &p) in read.iter().enumerate() {
            if *value <= least {
                if direction[i].abs() > SHARE && !flat.contains(&p) {
                    flat.push(p);
                }
                continue;
            }
            for (j, &q) in read.iter().enumerate() {
                covariance[(p, q)] += direction[i] * direction[j] / value * scale[i] * scale[j];
            }
        }
    }
    flat.sort_unstable();
    Knowledge { flat, covariance }
}

/// The unknowns that can change together without a change of −log L to second order, by their places.
pub(super) fn flat(matrix: &DMatrix<f64>, free: &[usize]) -> Vec<usize> {
    knowledge(matrix, free).flat
}

/// How far from the start it is looked again, as a share of a range or of a value.
const ASIDE: [f64; 2] = [0.03, -0.02];

/// The same where a threshold may not be met there.
const FARTHER: [f64; 6] = [0.03, -0.02, 0.1, -0.1, 0.3, -0.3];

/// The unknowns that the logs do not determine: at the start, and at two places beside it; more where events decide.
///
/// # Errors
/// As [`Problem::at`].
pub(super) fn undetermined(problem: &mut Problem<'_>, start: &Point) -> Result<Vec<usize>, Error> {
    let all: Vec<usize> = (0..start.z.len()).collect();
    let mut found = flat(&start.information, &all);
    if found.is_empty() {
        return Ok(found);
    }
    let asides: &[f64] = match problem.has_knees() {
        true => &FARTHER,
        false => &ASIDE,
    };
    for aside in asides {
        let z = problem.unknowns.iter().zip(&start.z).enumerate();
        let z = z.map(|(i, (unknown, &z))| {
            let turn = aside * (1.0 + 0.37 * i as f64);
            let (low, high) = (
                unknown.searched(unknown.low),
                unknown.searched(unknown.high),
            );
            let size = match (unknown.is_log, (high - low).is_finite()) {
                (true, _) => 1.0,
                (false, true) => high - low,
                (false, false) => z.abs().max(1e-3),
            };
            (z + turn * size).clamp(low, high)
        });
        let z = DVector::from_iterator(start.z.len(), z);
        let point = problem.at(z)?;
        // a place where the plant has no value says nothing
        if !point.value.is_finite() {
            continue;
        }
        let there = flat(&point.information, &all);
        // one threshold may be met here and another there
        match problem.has_knees() {
            true => found.retain(|place| there.contains(place)),
            false if there.is_empty() => found.clear(),
            false => {}
        }
        if found.is_empty() {
            break;
        }
    }
    Ok(found)
}
