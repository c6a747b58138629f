//! The error system as one matrix at every point: for proofs that take its slopes as they come together.
//!
//! e' = (J(ξ) + G(x̂, ε)) e in the mean over ξ between x and x̂ and over ε between 0 and the innovation: J is the
//! Jacobian of F where the innovations vanish, and G its slopes in the innovations, in the columns of the states whose errors
//! they are. x̂ is anywhere in the box whatever ξ is.

use std::collections::HashMap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Budget, Graph, Interval, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::decay::{Field, Together, fastest_together, prove_together};
use lynkeus_proof::matrix::{IntervalMatrix, square};
use lynkeus_structure::{AugmentedPlant, Innovation, Region, regularity};

use super::error_system::{Apart, ErrorSystem};
use crate::Observer;

/// Numbers that A may depend on: the work grows with the power of them.
const SIDES: usize = 10;

/// The rate that a proof is sought for.
pub(super) enum Wanted {
    /// the fastest, but not a slower one than this
    From(f64),
    /// this one
    At(f64),
}

/// A at every point of a box.
struct Joint {
    /// row by row
    entries: Tape,
    /// the derivatives of the entries that are not 0, with the places of the entries and the numbers; none where an entry
    /// may jump
    slopes: Option<(Tape, Vec<(usize, usize)>)>,
    sides: Vec<Interval>,
    size: usize,
}

/// A proof that takes the slopes together, of decay at a rate, or at the fastest one from a least one up to a limit.
pub(super) fn together(
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    system: &ErrorSystem,
    (wanted, limit): (Wanted, f64),
    budget: &Budget,
) -> Result<Option<Together>, MissingInput> {
    let Some(joint) = Joint::new(augmented, observer, &system.region)? else {
        return Ok(None);
    };
    let on = |part: &[Interval]| joint.on(part);
    let slopes = |part: &[Interval]| joint.slopes(part);
    let field = Field {
        on: &on,
        slopes: joint.slopes.is_some().then_some(&slopes),
        sides: joint.sides.clone(),
    };
    let scale = &system.scale;
    Ok(match wanted {
        Wanted::From(least) => fastest_together(&field, scale, (least, limit), budget),
        Wanted::At(rate) => prove_together(&field, scale, (rate, limit), budget),
    })
}

impl Joint {
    /// None where F jumps, where A depends on too many numbers, and where a range is open.
    fn new(
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
        region: &Region,
    ) -> Result<Option<Self>, MissingInput> {
        let graph = augmented.graph();
        let states: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
        let apart = Apart::new(augmented, observer, region)?;
        let read: Vec<Innovation> = apart.read.into_iter().map(|(_, own)| own).collect();
        let errors: Vec<Node> = read.iter().map(|own| own.symbol).collect();
        let moving = [&states[..], &errors].concat();
        if !regularity(graph, &apart.derivatives, &moving, &apart.region)?.is_proved() {
            return Ok(None);
        }
        let (entries, sides) = joined(graph, &apart.derivatives, &states, &read, apart.region);
        let used = graph.symbols_of(&entries);
        let sides = Region {
            dimensions: sides
                .dimensions
                .into_iter()
                .filter(|side| used.contains(&side.symbol))
                .collect(),
        };
        let is_finite = |side: &Interval| side.is_bounded();
        let ends: Option<Vec<Interval>> = sides
            .dimensions
            .iter()
            .map(|side| Interval::new(side.min, side.max).ok().filter(is_finite))
            .collect();
        let Some(ends) = ends.filter(|ends| ends.len() <= SIDES) else {
            return Ok(None);
        };
        let symbols = sides.symbols();
        let is_smooth = regularity(graph, &entries, &symbols, &sides)?.is_proved();
        let slopes = match is_smooth {
            true => {
                let found = jacobian::forward(graph, &entries, &symbols).entries;
                let nodes: Vec<Node> = found.iter().map(|entry| entry.2).collect();
                let places = found.iter().map(|entry| (entry.0, entry.1)).collect();
                Some((Tape::new(graph, &symbols, &nodes)?, places))
            }
            false => None,
        };
        Ok(Some(Self {
            entries: Tape::new(graph, &symbols, &entries)?,
            slopes,
            sides: ends,
            size: states.len(),
        }))
    }

    fn on(&self, part: &[Interval]) -> IntervalMatrix {
        let entries = self.entries.eval_in(&Intervals, part);
        entries.chunks(self.size).map(<[_]>::to_vec).collect()
    }

    fn slopes(&self, part: &[Interval]) -> Vec<IntervalMatrix> {
        let mut all = vec![square(self.size, |_, _| Interval::ZERO); part.len()];
        if let Some((tape, places)) = &self.slopes {
            for (value, (entry, side)) in tape.eval_in(&Intervals, part).into_iter().zip(places) {
                all[*side][entry / self.size][entry % self.size] = value;
            }
        }
        all
    }
}

/// J + G, row by row, with sides for x̂ beside those of ξ.
fn joined(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    read: &[Innovation],
    mut region: Region,
) -> (Vec<Node>, Region) {
    let zero = graph.constant(0.0).node();
    let n = states.len();
    let errors: Vec<Node> = read.iter().map(|own| own.symbol).collect();
    let right = errors.iter().map(|&error| (error, zero)).collect();
    let right = graph.substitute(derivatives, &right);
    let mut entries = vec![zero; n * n];
    for (i, j, slope) in jacobian::forward(graph, &right, states).entries {
        entries[i * n + j] = slope;
    }
    let mut elsewhere = HashMap::new();
    for side in region.dimensions.clone() {
        if states.contains(&side.symbol) {
            let own = graph.fresh(&side.name).node();
            elsewhere.insert(side.symbol, own);
            region.dimensions.push(lynkeus_structure::Dimension {
                symbol: own,
                ..side
            });
        }
    }
    let gains = jacobian::forward(graph, derivatives, &errors).entries;
    let slopes: Vec<Node> = gains.iter().map(|gain| gain.2).collect();
    let slopes = graph.substitute(&slopes, &elsewhere);
    for ((i, k, _), slope) in gains.into_iter().zip(slopes) {
        let entry = &mut entries[i * n + read[k].state];
        *entry = (graph.expr(*entry) + graph.expr(slope)).node();
    }
    (entries, region)
}
