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
use lynkeus_experiment::prepare::{self, Prepared, calibrate};
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
    let question = Question {
        measured: sensors.measured,
        disturbances: sensors.disturbances,
        parameters: true,
        known_starts: known.map(|(_, state)| state.name.clone()).collect(),
        budget: study.budget.within(EXACT),
        ..Question::default()
    };
    let answer = analyse(symbolic, &question).map_err(|e| explain(e).at(&study.file))?;
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
pub(super) const ROUNDING: f64 = 1e-12;

/// A share of a direction below which an unknown is not in it.
pub(super) const SHARE: f64 = 1e-3;

/// The unknowns that can change together without a change of −log L to second order, by their places.
pub(super) fn flat(matrix: &DMatrix<f64>, free: &[usize]) -> Vec<usize> {
    let alone = |i: &usize| matrix[(*i, *i)] <= 0.0 || !matrix[(*i, *i)].is_finite();
    let (mut found, rest): (Vec<usize>, Vec<usize>) = free.iter().partition(|i| alone(i));
    if rest.is_empty() {
        return found;
    }
    let scale = DVector::from_fn(rest.len(), |i, _| matrix[(rest[i], rest[i])].sqrt().recip());
    let unit = DMatrix::from_fn(rest.len(), rest.len(), |i, j| {
        matrix[(rest[i], rest[j])] * scale[i] * scale[j]
    });
    let eigen = SymmetricEigen::new(unit);
    let largest = eigen.eigenvalues.max();
    for (place, value) in eigen.eigenvalues.iter().enumerate() {
        if *value > ROUNDING * largest {
            continue;
        }
        let direction = eigen.eigenvectors.column(place);
        for (i, share) in direction.iter().enumerate() {
            if share.abs() > SHARE && !found.contains(&rest[i]) {
                found.push(rest[i]);
            }
        }
    }
    found.sort_unstable();
    found
}

/// How far from the start it is looked again, as a share of a range or of a value.
const ASIDE: [f64; 2] = [0.03, -0.02];

/// The unknowns that the logs do not tell: at the start, and at two places beside it.
///
/// # Errors
/// As [`Problem::at`].
pub(super) fn undetermined(problem: &mut Problem<'_>, start: &Point) -> Result<Vec<usize>, Error> {
    let all: Vec<usize> = (0..start.z.len()).collect();
    let found = flat(&start.information, &all);
    if found.is_empty() {
        return Ok(found);
    }
    for aside in ASIDE {
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
        if point.value.is_finite() && flat(&point.information, &all).is_empty() {
            return Ok(vec![]);
        }
    }
    Ok(found)
}
