//! An extended Kalman filter: after x and e, the lower triangle of its covariance P, and the known inputs ū that vary, as it
//! holds them. Between samples
//!
//! x' = f(x, u), e' = f(x + e, ū) − f(x, u), P' = F P + P Fᵀ + Q with F = ∂f/∂x at x + e and ū,
//!
//! and a sample takes the readings h(x) + ν one after the other,
//! K = P cᵀ/(c P cᵀ + R), e⁺ = e + K (h(x) + ν − h(x̂⁻) − c (e − e⁻)), P⁺ = P − K c P,
//! with the slopes c of h at x̂⁻, as the filter of `lynkeus-run` would in exact arithmetic.

use lynkeus_expr::{Expr, Node};
use lynkeus_observers::Observer;
use lynkeus_run::Level;
use lynkeus_run::filter::FilterKind;
use lynkeus_structure::AugmentedPlant;
use lynkeus_study::{BetweenSamples, Noise};

use super::beside::{Beside, Equations};
use lynkeus_experiment::course::filter::noise;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::Declared;

/// States beyond which a covariance is too large for a tube.
const STATES: usize = 6;

/// What of a filter is not followed.
pub(super) fn excluded(
    prepared: &Prepared<'_>,
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
) -> Option<String> {
    let tuning = observer.filter.as_ref()?;
    let noise = &prepared.declared().noise;
    let unread = augmented.outputs.iter().find(|o| {
        let noise = noise.of(&o.variable.name);
        !matches!(noise, Some(Noise::Absolute(size) | Noise::Uniform(size)) if *size > 0.0)
    });
    if let Some(output) = unread {
        let name = &output.variable.name;
        let what = match noise.of(name) {
            Some(Noise::Relative(_)) => "a share of its value",
            _ => "no number above 0",
        };
        return Some(format!(
            "a filter where the noise of {name} is {what}: noise = {{ {name} = … }} under [sensors], in its unit"
        ));
    }
    let found = [
        (
            tuning.kind != FilterKind::Extended,
            "another filter than the extended Kalman filter",
        ),
        (tuning.gate.is_some(), "a `gate`"),
        (tuning.projects, "`bounds`"),
        (tuning.iterations > 1, "`iterations`"),
        (!tuning.whens.is_empty(), "events (`when`)"),
    ];
    if let Some((_, what)) = found.into_iter().find(|(is, _)| *is) {
        return Some(what.to_owned());
    }
    let n = augmented.states.len();
    (n > STATES).then(|| format!("a covariance of {n} states: it is too large beyond {STATES}"))
}

/// The filter beside the plant, or why it is not followed.
pub(super) fn equations(
    beside: &Beside<'_, '_>,
    prepared: &Prepared<'_>,
    span: f64,
    notes: &mut Vec<String>,
) -> Result<Equations, String> {
    if !beside.varying.is_empty()
        && prepared.study().estimate.between_samples == BetweenSamples::Linear
    {
        return Err("the tube of a filter follows known inputs that it holds between samples, not `between_samples = \"linear\"`".to_owned());
    }
    let densities = noise::densities(prepared, span, notes);
    let n = beside.x.len();
    let fresh = |name: &str, count: usize| -> Vec<Node> {
        (0..count)
            .map(|_| beside.graph.fresh(name).node())
            .collect()
    };
    let model = Model {
        beside,
        P: fresh("P", n * (n + 1) / 2),
    };
    Ok(Equations {
        first: model.first(),
        right: model.flow(&densities),
        sample: model.sample(&variances(prepared.declared(), beside.augmented)),
        variances: (0..n).map(|i| place(i, i)).collect(),
        others: [&model.P[..], &beside.held].concat(),
        monitors: vec![],
    })
}

/// R, one per measured output.
fn variances(declared: &Declared, augmented: &AugmentedPlant<'_>) -> Vec<f64> {
    let of = |name: &str| {
        let noise = declared.noise.of(name);
        noise.map_or(0.0, |noise| Level::from(*noise).variance(0.0))
    };
    let outputs = augmented.outputs.iter();
    outputs.map(|o| of(&o.variable.name)).collect()
}

/// The place of Pᵢⱼ in the lower triangle.
fn place(i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    i * (i + 1) / 2 + j
}

/// What makes the expressions.
struct Model<'m, 'g> {
    beside: &'m Beside<'m, 'g>,
    P: Vec<Node>,
}

impl<'g> Model<'_, 'g> {
    /// z₀
    fn first(&self) -> Vec<Node> {
        let graph = self.beside.graph;
        let held = self.beside.first_varying();
        let filter = self.beside.observer.filter.as_ref();
        let variance = filter.map_or(&[][..], |f| &f.initial_variance);
        let P = (0..self.beside.x.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let P = P.map(|(i, j)| if i == j { variance[i] } else { 0.0 });
        let P = P.map(|p| graph.constant(p).node());
        self.beside
            .first()
            .into_iter()
            .chain(P)
            .chain(held)
            .collect()
    }

    /// z' after x', for the densities Q.
    fn flow(&self, densities: &[f64]) -> Vec<Node> {
        let beside = self.beside;
        let n = beside.x.len();
        let derivatives = &beside.observer.derivatives[..n];
        let estimated = beside.put_held(derivatives);
        let F = beside.slopes(derivatives, |nodes| beside.put_held(nodes));
        let actual = beside.put(&beside.actual);
        let e = estimated.iter().zip(&actual).map(|(&hat, &x)| hat - x);
        let P = beside.exprs(&self.P);
        let along = |i: usize, j: usize| {
            let terms = F[i].iter().map(|&(k, slope)| slope * P[place(k, j)]);
            terms.fold(beside.graph.constant(0.0), |sum, term| sum + term)
        };
        let mut all: Vec<Node> = e.map(Expr::node).collect();
        for (i, &density) in densities.iter().enumerate() {
            for j in 0..=i {
                let both = along(i, j) + along(j, i);
                all.push(if i == j { both + density } else { both }.node());
            }
        }
        let still = beside.graph.constant(0.0).node();
        all.extend(beside.held.iter().map(|_| still));
        all
    }

    /// z⁺, for the variances R.
    fn sample(&self, noises: &[f64]) -> Vec<Node> {
        let beside = self.beside;
        let n = beside.x.len();
        let filter = beside.observer.filter.as_ref();
        let outputs = filter.map_or(&[][..], |f| &f.outputs);
        let predicted = beside.put(outputs);
        let slopes = beside.slopes(outputs, |nodes| beside.put(nodes));
        let read = beside.readings();
        let before = beside.exprs(&beside.e);
        let (mut e, mut P) = (before.clone(), beside.exprs(&self.P));
        let zero = beside.graph.constant(0.0);
        for (j, c) in slopes.iter().enumerate() {
            let spread = |i: usize| {
                let terms = c.iter().map(|&(k, slope)| slope * P[place(i, k)]);
                terms.fold(zero, |sum, term| sum + term)
            };
            let Pc: Vec<Expr<'g>> = (0..n).map(spread).collect();
            let S = c
                .iter()
                .fold(beside.graph.constant(noises[j]), |sum, &(k, slope)| {
                    sum + slope * Pc[k]
                });
            let moved = c
                .iter()
                .fold(zero, |sum, &(k, slope)| sum + slope * (e[k] - before[k]));
            let rest = read[j] - predicted[j] - moved;
            // of the only state that is shown P⁺ = P·R/S: the same number, and narrower where P is a range
            let alone = match c[..] {
                [(k, _)] => Some(k),
                _ => None,
            };
            let mut next = P.clone();
            for a in 0..n {
                for b in 0..=a {
                    let at = place(a, b);
                    next[at] = match alone.is_some_and(|k| a == k || b == k) {
                        true => noises[j] * P[at] / S,
                        false => P[at] - Pc[a] * Pc[b] / S,
                    };
                }
            }
            e = e.iter().zip(&Pc).map(|(&e, &K)| e + K * rest / S).collect();
            P = next;
        }
        let x = beside.exprs(&beside.x);
        let all = x.into_iter().chain(e).chain(P).map(Expr::node);
        all.chain(beside.varying()).collect()
    }
}
