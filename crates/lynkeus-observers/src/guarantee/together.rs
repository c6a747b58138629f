//! The error system as one matrix at every point: for proofs that take its slopes as they come together.
//!
//! e' = (J(ξ) + G(x̂, ε)) e in the mean over ξ between x and x̂ and over ε between 0 and the innovation: J is the
//! Jacobian of F where the innovations vanish, and G its slopes in the innovations, in the columns of the states whose errors
//! they are. x̂ is anywhere in the box whatever ξ is.

use std::collections::HashMap;

use lynkeus_expr::{Budget, Graph, MissingInput, Node, jacobian};
use lynkeus_proof::decay::{Together, fastest_together, prove_together};
use lynkeus_structure::{AugmentedPlant, Dimension, Region, regularity};

use super::error_system::{Apart, ErrorSystem, hats};
use crate::Observer;
use crate::field::Joint;

/// The rate that a proof is sought for.
pub(super) enum Wanted {
    /// the fastest, but not a slower one than this
    From(f64),
    /// this one
    At(f64),
}

/// A proof that takes the slopes together, of decay at a rate, or at the fastest one from a least one up to a limit.
pub(super) fn together(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    system: &ErrorSystem,
    (wanted, limit): (Wanted, f64),
    budget: &Budget,
) -> Result<Option<Together>, MissingInput> {
    let Some(joint) = continuous(augmented, observer, &system.region)? else {
        return Ok(None);
    };
    let scale = &system.scale;
    Ok(joint.field(|field| match wanted {
        Wanted::From(least) => fastest_together(field, scale, (least, limit), budget),
        Wanted::At(rate) => prove_together(field, scale, (rate, limit), budget),
    }))
}

/// That of an observer whose sensors are read continuously. None where F jumps, where A depends on too many numbers,
/// and where a range is open.
fn continuous(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    region: &Region,
) -> Result<Option<Joint>, MissingInput> {
    let graph = augmented.graph();
    let states: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    let apart = Apart::new(augmented, observer, region)?;
    let moving = [&states[..], &apart.errors()].concat();
    if !regularity(graph, &apart.derivatives, &moving, &apart.region)?.is_proved() {
        return Ok(None);
    }
    let n = states.len();
    let found = Blocks::new(graph, &apart, &states, &states);
    let mut entries = found.right;
    for (i, k, slope) in found.gains {
        let entry = &mut entries[i * n + apart.read[k].1.state];
        *entry = (graph.expr(*entry) + graph.expr(slope)).node();
    }
    Joint::of(graph, &entries, n, found.region)
}

/// That over (e, ε) of an observer whose measurements w follow the model between samples, ε = (w − y)/c for a sensor
/// that shows c·x_s. With the innovations σ = e_s − ε, and G at x̂ and w,
///
/// e' = (J + G E) e + (c H − G) ε, ε' = ∂f_s/∂x e,
///
/// where H has F's slopes in what is read apart from the innovations, and J, H and ∂f_s/∂x are means over one segment
/// from (x, y) to (x̂, w).
pub(super) fn sampled(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    region: &Region,
    (shown, slopes): (&[usize], &[f64]),
) -> Result<Option<Joint>, MissingInput> {
    let graph = augmented.graph();
    let states: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    let measured: Vec<Node> = observer.measured.iter().map(|m| m.symbol).collect();
    let apart = Apart::new(augmented, observer, region)?;
    let plant = graph.substitute(&augmented.derivatives, &hats(augmented, observer));
    let predicted: Vec<Node> = shown.iter().map(|&state| plant[state]).collect();
    let moving = [&states[..], &apart.errors(), &measured].concat();
    let all = [&apart.derivatives[..], &predicted].concat();
    if !regularity(graph, &all, &moving, &apart.region)?.is_proved() {
        return Ok(None);
    }
    let (n, size) = (states.len(), states.len() + shown.len());
    let found = Blocks::new(graph, &apart, &states, &[&states[..], &measured].concat());
    let mut entries = vec![graph.constant(0.0).node(); size * size];
    let mut add = |i: usize, j: usize, factor: f64, slope: Node| {
        let entry = &mut entries[i * size + j];
        *entry = (graph.expr(*entry) + factor * graph.expr(slope)).node();
    };
    for (place, &slope) in found.right.iter().enumerate() {
        add(place / n, place % n, 1.0, slope);
    }
    for (i, k, slope) in found.gains {
        let (sensor, own) = &apart.read[k];
        add(i, own.state, 1.0, slope);
        add(i, n + sensor, -1.0, slope);
    }
    for (i, j, slope) in jacobian::forward(graph, &found.derivatives, &measured).entries {
        add(i, n + j, slopes[j], slope);
    }
    for (j, i, slope) in jacobian::forward(graph, &predicted, &states).entries {
        add(n + j, i, 1.0, slope);
    }
    Joint::of(graph, &entries, size, found.region)
}

/// The slopes of F where the innovations vanish, and in these, which are not at the same points.
struct Blocks {
    /// F where the innovations vanish
    derivatives: Vec<Node>,
    /// J, its slopes in the states, row by row
    right: Vec<Node>,
    /// G, those of F in the innovations: equation, innovation, slope
    gains: Vec<(usize, usize, Node)>,
    /// with sides for where G is beside those of where J is
    region: Region,
}

impl Blocks {
    /// With symbols of its own in G for each of `doubled`.
    fn new(graph: &Graph, apart: &Apart, states: &[Node], doubled: &[Node]) -> Self {
        let zero = graph.constant(0.0).node();
        let n = states.len();
        let errors = apart.errors();
        let vanishing = errors.iter().map(|&error| (error, zero)).collect();
        let derivatives = graph.substitute(&apart.derivatives, &vanishing);
        let mut right = vec![zero; n * n];
        for (i, j, slope) in jacobian::forward(graph, &derivatives, states).entries {
            right[i * n + j] = slope;
        }
        let mut region = apart.region.clone();
        let mut elsewhere = HashMap::new();
        for side in &apart.region.dimensions {
            if doubled.contains(&side.symbol) {
                let own = graph.fresh(&side.name).node();
                elsewhere.insert(side.symbol, own);
                region.dimensions.push(Dimension {
                    symbol: own,
                    ..side.clone()
                });
            }
        }
        let gains = jacobian::forward(graph, &apart.derivatives, &errors).entries;
        let slopes: Vec<Node> = gains.iter().map(|gain| gain.2).collect();
        let slopes = graph.substitute(&slopes, &elsewhere);
        let places = gains.into_iter().zip(slopes);
        Self {
            derivatives,
            right,
            gains: places.map(|((i, k, _), slope)| (i, k, slope)).collect(),
            region,
        }
    }
}
