//! The error system of a copy of x' = f(x, u): for x and x̂ in a convex box,
//! f(x̂, u) − f(x, u) = A(θ)(x̂ − x), where A is linear in the *slopes* θ of the distinct
//! nonlinear terms of f.
//!
//! Every equation is split into numbers times states and numbers times nonlinear terms
//! (maximal nonlinear nodes of the graph). A term that stands in several equations, as
//! the equilibrium curve of a tray does, keeps one slope in all of them. Terms that
//! stand in one equation only are taken together: only the range of their sum counts.
//! By the mean value theorem the slope of a term in a state is an average of its
//! partial derivative over the segment from x to x̂, so it lies in the range of that
//! derivative over the box.
//!
//! An observer also reads *innovations* ε = x̂_s − x_s, which vanish where it is right. They
//! are not taken through the mean value theorem along with x̂: F(x̂, ε) − F(x, 0) is
//! F(x̂, ε) − F(x̂, 0), whose slope in ε counts for the state s, plus F(x̂, 0) − F(x, 0). A
//! gain g(x̂) times ε then costs the range of g, not that of ε·∂g/∂x̂.
//!
//! Inputs in which every equation is affine make the error system multi-affine: one
//! model per vertex of their ranges covers all values between.

mod kinks;
mod linear;
mod model;

use lynkeus_expr::{Graph, Interval, MissingInput, Node, jacobian};
use lynkeus_proof::decay::ErrorModel;

use crate::{Place, Region, Regularity};
pub(crate) use kinks::without_removable_jumps;
use model::model;

/// Inputs whose ranges become vertices: 2⁴ models at most.
const VERTEX_INPUTS: usize = 4;

/// The error system of a right-hand side on a box.
#[derive(Clone, Debug)]
pub struct Slopes {
    /// one model per vertex of the inputs below
    pub models: Vec<ErrorModel>,
    /// inputs that are affine in every equation, with the ends of their ranges
    pub inputs: Place,
    /// what each sector of the models is
    pub slopes: Vec<Slope>,
}

/// The slope of nonlinear terms in one state.
#[derive(Clone, Debug)]
pub struct Slope {
    /// index of the state
    pub state: usize,
    /// the term as a person would write it, e.g. `x[2]/(1 + 0.65·x[2])`
    pub term: String,
    /// enclosure of the slope over the box, all vertices together
    pub range: Interval,
    /// names of the variables that it depends on
    pub variables: Vec<String>,
}

/// The error of a state as the observer reads it, x̂_s − x_s.
#[derive(Clone, Debug)]
pub struct Innovation {
    /// what stands for it in the equations
    pub symbol: Node,
    /// s
    pub state: usize,
}

impl Slopes {
    /// The error system of x' = `derivatives` in `states`.
    ///
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol outside the region.
    pub fn new(
        graph: &Graph,
        derivatives: &[Node],
        states: &[Node],
        region: &Region,
    ) -> Result<Self, MissingInput> {
        Self::around(graph, derivatives, states, &[], region)
    }

    /// The error system of an observer x̂' = F(x̂, ε), with the innovations ε among the
    /// sides of the region, their ranges around 0.
    ///
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol outside the region.
    pub fn around(
        graph: &Graph,
        derivatives: &[Node],
        states: &[Node],
        innovations: &[Innovation],
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let derivatives = &without_removable_jumps(graph, derivatives)[..];
        let moving: Vec<Node> = states
            .iter()
            .copied()
            .chain(innovations.iter().map(|i| i.symbol))
            .collect();
        let inputs = vertex_inputs(graph, derivatives, &moving, region)?;
        let mut found: Option<Self> = None;
        for vertex in 0..1_usize << inputs.len() {
            let fixed = at_vertex(region, &inputs, vertex);
            let (model, slopes) = model(graph, derivatives, states, innovations, &fixed)?;
            match &mut found {
                None => {
                    found = Some(Self {
                        models: vec![model],
                        inputs: named(region, &inputs),
                        slopes,
                    });
                }
                Some(all) => {
                    all.models.push(model);
                    slopes.into_iter().for_each(|slope| all.include(slope));
                }
            }
        }
        // there is always the vertex 0
        Ok(found.unwrap_or(Self {
            models: vec![],
            inputs: vec![],
            slopes: vec![],
        }))
    }

    /// Adds a slope of another vertex to what is told about slopes.
    fn include(&mut self, new: Slope) {
        let same = |mine: &&mut Slope| mine.state == new.state && mine.term == new.term;
        match self.slopes.iter_mut().find(same) {
            Some(mine) => mine.range = mine.range.hull(new.range),
            None => self.slopes.push(new),
        }
    }

    /// The first slope without bound, and the variables without bound that it depends
    /// on (none where the slope is unbounded by itself, as that of √ at 0 is).
    pub fn unbounded(&self, region: &Region) -> Option<(&Slope, Vec<String>)> {
        let infinite = |s: &&Slope| !s.range.magnitude().is_finite() || !s.range.is_defined();
        let slope = self.slopes.iter().find(infinite)?;
        let open = |name: &&String| {
            let mut sides = region.dimensions.iter();
            sides.any(|d| d.name == **name && !(d.min.is_finite() && d.max.is_finite()))
        };
        Some((
            slope,
            slope.variables.iter().filter(open).cloned().collect(),
        ))
    }
}

/// Indices into the region: finite ranges of inputs in which every equation is affine.
fn vertex_inputs(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    region: &Region,
) -> Result<Vec<usize>, MissingInput> {
    let mut found = vec![];
    for (i, side) in region.dimensions.iter().enumerate() {
        let wide = side.min < side.max && side.min.is_finite() && side.max.is_finite();
        if found.len() < VERTEX_INPUTS
            && wide
            && !states.contains(&side.symbol)
            && moves_slopes_affinely(graph, derivatives, states, side.symbol, region)?
        {
            found.push(i);
        }
    }
    Ok(found)
}

/// What is only added, as a measurement is to a copy of the plant, moves no slope: its
/// vertices would all be the same.
fn moves_slopes_affinely(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    symbol: Node,
    region: &Region,
) -> Result<bool, MissingInput> {
    let partials = jacobian::forward(graph, derivatives, &[symbol]);
    let partials: Vec<Node> = partials.entries.iter().map(|e| e.2).collect();
    let read = graph.symbols_of(&partials);
    if read.contains(&symbol) || !states.iter().any(|state| read.contains(state)) {
        return Ok(false);
    }
    // a step has no derivative, and what it does between the ends they do not tell
    Ok(Regularity::of(graph, derivatives, &[symbol], region)?.holds())
}

/// The region with each of the inputs at one end of its range.
fn at_vertex(region: &Region, inputs: &[usize], vertex: usize) -> Region {
    let mut fixed = region.clone();
    for (bit, &input) in inputs.iter().enumerate() {
        let side = &mut fixed.dimensions[input];
        match vertex >> bit & 1 {
            0 => side.max = side.min,
            _ => side.min = side.max,
        }
    }
    fixed
}

fn named(region: &Region, inputs: &[usize]) -> Place {
    inputs
        .iter()
        .map(|&i| region.dimensions[i].side())
        .collect()
}

#[cfg(test)]
mod tests;
