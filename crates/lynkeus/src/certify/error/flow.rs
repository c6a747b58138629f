//! An observer of the papers, x̂' = F(x̂, q, u, y), q' = G(x̂, q, u, y): after x and e, what else it keeps, q (factors of S,
//! a filtered input), and where its sensors report at samples the measurements w that it reads in place of y. Then
//! w⁺ = h(x) + ν at a sample, and between samples w' = 0, or L_f h(x̂) where it is predicted; known inputs that vary are held
//! from sample to sample, as on a log. Sensors that are read continuously show h(x) + ν at every time, ν being any
//! measurable function.
//!
//! e' = F(x + e, q, u, y) − f(x, u)

use std::collections::HashMap;

use lynkeus_expr::{Expr, Node};
use lynkeus_observers::Observer;
use lynkeus_structure::AugmentedPlant;
use lynkeus_study::BetweenSamples;

use super::beside::{Beside, Equations};
use lynkeus_experiment::words::explain;

/// Quantities beyond which a plant with its observer is too large for a tube.
const QUANTITIES: usize = 40;

/// What of an observer is not followed.
pub(super) fn excluded(augmented: &AugmentedPlant<'_>, observer: &Observer) -> Option<String> {
    let n = augmented.states.len();
    let pairs = observer.states.iter().zip(&observer.estimates).take(n);
    let is_the_estimate = pairs.filter(|((s, _), e)| s.symbol == e.node).count() == n;
    if !observer.generated.is_empty() {
        return Some("an input with a `generator`".to_owned());
    }
    let all = n + observer.states.len() + observer.measured.len();
    if !is_the_estimate {
        return Some("an observer whose first states are not the estimate".to_owned());
    }
    if all > QUANTITIES {
        return Some(format!(
            "{all} quantities of plant and observer: at most {QUANTITIES}"
        ));
    }
    None
}

/// The observer beside the plant, with sensors that report `every` so often, or continuously.
pub(super) fn equations(
    beside: &Beside<'_, '_>,
    between: BetweenSamples,
    every: Option<f64>,
) -> Result<Equations, String> {
    let (graph, n) = (beside.graph, beside.x.len());
    let observer = beside.observer;
    let nodes = |all: Vec<Expr<'_>>| all.into_iter().map(Expr::node).collect::<Vec<Node>>();
    let read = nodes(beside.readings());
    let mut map: HashMap<Node, Node> = match every {
        Some(_) => beside.held(),
        None => beside.known.clone(),
    };
    let others = observer.states[n..].iter();
    let (mut others, starts): (Vec<Node>, Vec<f64>) = others
        .map(|(signal, start)| (signal.symbol, *start))
        .unzip();
    let constant = |value: f64| graph.constant(value).node();
    let mut first = beside.first();
    first.extend(starts.into_iter().map(constant));
    let measured: Vec<Node> = observer.measured.iter().map(|m| m.symbol).collect();
    let mut w = vec![];
    let mut sample = [&beside.x[..], &beside.e, &others].concat();
    match every {
        None => map.extend(measured.into_iter().zip(read.iter().copied())),
        Some(_) => {
            let sampled = observer.sampled(beside.augmented);
            let sampled = sampled.map_err(|error| explain(error).to_string())?;
            let still = || vec![constant(0.0); measured.len()];
            w = match between {
                BetweenSamples::Predict => sampled.rates,
                BetweenSamples::Hold => still(),
                BetweenSamples::Linear => return Err("the tube of the error does not follow measurements and inputs along lines between samples (`between_samples = \"linear\"`)".to_owned()),
            };
            if !(beside.varying.is_empty() || observer.input_derivatives.is_empty()) {
                return Err("the tube of the error does not follow derivatives of known inputs that are held from sample to sample".to_owned());
            }
            w.extend(beside.held.iter().map(|_| constant(0.0)));
            first.extend(still());
            first.extend(beside.first_varying());
            sample.extend(&read);
            sample.extend(beside.varying());
            others.extend(measured);
            others.extend(&beside.held);
        }
    }
    let monitors: Vec<Node> = observer.monitors.iter().map(|m| m.node).collect();
    let monitors = nodes(beside.put_with(&monitors, map.clone()));
    let hats = beside.put_with(&[&observer.derivatives[..], &w].concat(), map);
    let actual = beside.put(&beside.actual);
    let errors = hats.iter().zip(&actual).map(|(&hat, &x)| hat - x);
    let right = errors.chain(hats[n..].iter().copied()).map(Expr::node);
    Ok(Equations {
        right: right.collect(),
        first,
        sample,
        variances: vec![],
        others,
        monitors,
    })
}
