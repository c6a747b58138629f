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
//! Inputs in which every equation is affine make the error system multi-affine: one
//! model per vertex of their ranges covers all values between.

mod linear;

use std::collections::BTreeMap;

use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Unary, jacobian};
use lynkeus_gain::decay::{ErrorModel, Sector};

use crate::{Region, range_within};
use linear::Splitter;

/// Inputs whose ranges become vertices: 2⁴ models at most.
const VERTEX_INPUTS: usize = 4;
/// Cells examined per end of a slope's range.
const BUDGET: usize = 1500;
/// Cells examined to see whether a slope has a bound at all.
const GLANCE: usize = 50;

/// The error system of a right-hand side on a box.
#[derive(Clone, Debug)]
pub struct Slopes {
    /// one model per vertex of the inputs below
    pub models: Vec<ErrorModel>,
    /// inputs that are affine in every equation, with the ends of their ranges
    pub inputs: Vec<(String, f64, f64)>,
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
        let inputs = vertex_inputs(graph, derivatives, states, region)?;
        let mut found: Option<Self> = None;
        for vertex in 0..1_usize << inputs.len() {
            let fixed = at_vertex(region, &inputs, vertex);
            let (model, slopes) = model(graph, derivatives, states, &fixed)?;
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
    for &f in derivatives {
        if jumps_in(graph, f, symbol, region)? {
            return Ok(false);
        }
    }
    Ok(true)
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

fn named(region: &Region, inputs: &[usize]) -> Vec<(String, f64, f64)> {
    let side = |&i: &usize| {
        let d = &region.dimensions[i];
        (d.name.clone(), d.min, d.max)
    };
    inputs.iter().map(side).collect()
}

/// Nonlinear terms that share one slope per state: Σ node·coefficient.
struct Group {
    /// weight in each equation
    direction: Vec<Interval>,
    terms: Vec<(Node, Interval)>,
}

fn model(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    region: &Region,
) -> Result<(ErrorModel, Vec<Slope>), MissingInput> {
    let n = derivatives.len();
    let mut splitter = Splitter::new(graph, region);
    let mut constant = vec![vec![Interval::ZERO; states.len()]; n];
    let mut weights: BTreeMap<Node, Vec<Interval>> = BTreeMap::new();
    for (row, &f) in derivatives.iter().enumerate() {
        for (term, coefficient) in splitter.split(f)?.terms {
            match states.iter().position(|&s| s == term) {
                Some(state) => constant[row][state] = coefficient,
                None => {
                    let weight = weights.entry(term);
                    weight.or_insert_with(|| vec![Interval::ZERO; n])[row] = coefficient;
                }
            }
        }
    }
    let (mut sectors, mut slopes) = (vec![], vec![]);
    for group in groups(weights) {
        for (state, &symbol) in states.iter().enumerate() {
            let Some((range, variables)) = slope(graph, &group, symbol, region)? else {
                continue;
            };
            sectors.push(Sector {
                column: state,
                direction: group.direction.clone(),
                range,
            });
            slopes.push(Slope {
                state,
                term: written(graph, &group, symbol),
                range,
                variables,
            });
        }
    }
    Ok((ErrorModel { constant, sectors }, slopes))
}

/// Terms of one equation only are taken together.
fn groups(weights: BTreeMap<Node, Vec<Interval>>) -> Vec<Group> {
    let (mut shared, mut alone) = (vec![], BTreeMap::<usize, Group>::new());
    for (term, direction) in weights {
        let used = |(_, w): &(usize, &Interval)| **w != Interval::ZERO;
        let rows: Vec<usize> = direction
            .iter()
            .enumerate()
            .filter(used)
            .map(|r| r.0)
            .collect();
        if let [row] = rows[..] {
            let group = alone.entry(row).or_insert_with(|| {
                let mut unit = vec![Interval::ZERO; direction.len()];
                unit[row] = Interval::ONE;
                Group {
                    direction: unit,
                    terms: vec![],
                }
            });
            group.terms.push((term, direction[row]));
        } else {
            let terms = vec![(term, Interval::ONE)];
            shared.push(Group { direction, terms });
        }
    }
    shared.extend(alone.into_values());
    shared
}

/// Range of Σ coefficient·∂term/∂state and the names of what it depends on; none where
/// it is zero everywhere.
fn slope(
    graph: &Graph,
    group: &Group,
    state: Node,
    region: &Region,
) -> Result<Option<(Interval, Vec<String>)>, MissingInput> {
    let mut sum: Option<Node> = None;
    let mut rest = Interval::ZERO;
    let mut jumps = false;
    for &(term, coefficient) in &group.terms {
        if jacobian::pattern(graph, &[term], &[state])[0].is_empty() {
            continue;
        }
        jumps |= jumps_in(graph, term, state, region)?;
        let jacobian = jacobian::forward(graph, &[term], &[state]);
        let Some(partial) = jacobian.get(0, 0) else {
            continue;
        };
        // the coefficient's middle enters the sum, what rounding left of it the rest
        let middle = coefficient.midpoint();
        let weighted = graph.binary(Binary::Mul, graph.constant(middle).node(), partial);
        sum = Some(match sum {
            Some(sum) => graph.binary(Binary::Add, sum, weighted),
            None => weighted,
        });
        let left = coefficient - Interval::point(middle);
        if left != Interval::ZERO {
            rest = rest + left * range_within(graph, partial, region, 0)?.enclosure;
        }
    }
    let Some(sum) = sum else {
        let entire = (Interval::ENTIRE, vec![]);
        return Ok(jumps.then_some(entire));
    };
    let symbols = graph.symbols_of(&[sum]);
    let variables = region.restricted(&symbols).dimensions;
    let names = variables.into_iter().map(|d| d.name).collect();
    // where a few cells leave no bound, more hardly ever do
    let first = range_within(graph, sum, region, GLANCE)?;
    let found = match first.enclosure.magnitude().is_finite() {
        true => range_within(graph, sum, region, BUDGET)?,
        false => first,
    };
    let range = match found.defined && !jumps {
        true => found.enclosure + rest,
        false => Interval::ENTIRE,
    };
    Ok(Some((range, names)))
}

/// Whether the term may jump as the symbol moves: a condition, a sign, a rounding or the
/// cut of an angle stands between them. |x|, min and max do not jump.
fn jumps_in(
    graph: &Graph,
    term: Node,
    symbol: Node,
    region: &Region,
) -> Result<bool, MissingInput> {
    let depends = |node: Node| graph.symbols_of(&[node]).contains(&symbol);
    for node in graph.reachable(&[term]) {
        let jumps = match graph.op(node) {
            Op::Select(condition, ..) => depends(condition),
            Op::Unary(Unary::Sign | Unary::Floor, a) => depends(a),
            Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, a, b) => {
                depends(a) || depends(b)
            }
            Op::Binary(Binary::Atan2, _, x) if depends(node) => {
                !range_within(graph, x, region, BUDGET)?
                    .enclosure
                    .is_positive()
            }
            _ => false,
        };
        if jumps {
            return Ok(true);
        }
    }
    Ok(false)
}

fn written(graph: &Graph, group: &Group, state: Node) -> String {
    let depends = |term: &Node| graph.symbols_of(&[*term]).contains(&state);
    let terms = group.terms.iter().map(|(term, _)| *term).filter(depends);
    let texts: Vec<String> = terms.map(|term| graph.render(term, 40)).collect();
    match &texts[..] {
        [first, .., _] => format!("{first} and {} more", texts.len() - 1),
        _ => texts.concat(),
    }
}

#[cfg(test)]
mod tests;
