//! The sectors of one model: which terms share a slope, and the slope's range.

use std::collections::BTreeMap;

use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, jacobian};
use lynkeus_proof::decay::{ErrorModel, Sector};

use super::linear::Splitter;
use super::{Innovation, Slope};
use crate::{Region, Regularity, range_within};

/// Cells examined per end of a slope's range.
pub(super) const BUDGET: usize = 1500;
/// Cells examined to see whether a slope has a bound at all.
const GLANCE: usize = 50;

/// Nonlinear terms that share one slope per state: Σ node·coefficient.
struct Group {
    /// weight in each equation
    direction: Vec<Interval>,
    terms: Vec<(Node, Interval)>,
}

/// A symbol with the state whose error it counts for.
type Column = (Node, usize);

pub(super) fn model(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    innovations: &[Innovation],
    region: &Region,
) -> Result<(ErrorModel, Vec<Slope>), MissingInput> {
    let n = derivatives.len();
    let mut model = ErrorModel {
        constant: vec![vec![Interval::ZERO; n]; n],
        sectors: vec![],
    };
    let mut slopes = vec![];
    let right = at_rest(region, innovations);
    let columns: Vec<Column> = states.iter().copied().zip(0..).collect();
    let vanishing: Vec<Node> = innovations.iter().map(|i| i.symbol).collect();
    for split in [
        Part::of(graph, derivatives, &columns, &vanishing, &right)?,
        Part::of(graph, derivatives, &columns_of(innovations), &[], region)?,
    ] {
        for (row, state, coefficient) in split.constant {
            let entry = &mut model.constant[row][state];
            *entry = *entry + coefficient;
        }
        for (sector, slope) in split.sectors {
            add(&mut model.sectors, &mut slopes, sector, slope);
        }
    }
    Ok((model, slopes))
}

fn columns_of(innovations: &[Innovation]) -> Vec<Column> {
    innovations.iter().map(|i| (i.symbol, i.state)).collect()
}

/// The region where every innovation is 0.
fn at_rest(region: &Region, innovations: &[Innovation]) -> Region {
    let mut right = region.clone();
    for side in &mut right.dimensions {
        if innovations.iter().any(|i| i.symbol == side.symbol) {
            (side.min, side.max) = (0.0, 0.0);
        }
    }
    right
}

/// Slopes of the same state with the same weights count together: θ₁ + θ₂ is one
/// uncertain number.
fn add(sectors: &mut Vec<Sector>, slopes: &mut Vec<Slope>, sector: Sector, slope: Slope) {
    let same = |s: &Sector| s.column == sector.column && s.direction == sector.direction;
    let Some(place) = sectors.iter().position(same) else {
        sectors.push(sector);
        slopes.push(slope);
        return;
    };
    let range = sectors[place].range + sector.range;
    sectors[place].range = range;
    let mine = &mut slopes[place];
    mine.range = range;
    mine.term = format!("{} and {}", mine.term, slope.term);
    for name in slope.variables {
        if !mine.variables.contains(&name) {
            mine.variables.push(name);
        }
    }
}

/// What some columns contribute to an error system.
#[derive(Default)]
struct Part {
    /// (row, state, number)
    constant: Vec<(usize, usize, Interval)>,
    sectors: Vec<(Sector, Slope)>,
}

impl Part {
    /// `vanishing`: symbols that are 0 in the region; a term that they make 0 everywhere
    /// has no slope.
    fn of(
        graph: &Graph,
        derivatives: &[Node],
        columns: &[Column],
        vanishing: &[Node],
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let mut part = Self::default();
        if columns.is_empty() {
            return Ok(part);
        }
        let n = derivatives.len();
        let mut splitter = Splitter::new(graph, region);
        let mut weights: BTreeMap<Node, Vec<Interval>> = BTreeMap::new();
        for (row, &f) in derivatives.iter().enumerate() {
            for (term, coefficient) in splitter.split(f)?.terms {
                match columns.iter().find(|(symbol, _)| *symbol == term) {
                    Some(&(_, state)) => part.constant.push((row, state, coefficient)),
                    None => {
                        let weight = weights.entry(term);
                        weight.or_insert_with(|| vec![Interval::ZERO; n])[row] = coefficient;
                    }
                }
            }
        }
        let mut idle = vec![];
        for (&term, weight) in &weights {
            let unused = weight.iter().all(|w| *w == Interval::ZERO);
            if unused || vanishes(graph, term, vanishing, region)? {
                idle.push(term);
            }
        }
        weights.retain(|term, _| !idle.contains(term));
        let moving: Vec<Node> = columns.iter().map(|c| c.0).collect();
        for group in groups(weights) {
            let terms: Vec<Node> = group.terms.iter().map(|t| t.0).collect();
            let regular = Regularity::of(graph, &terms, &moving, region)?.holds();
            for &column in columns {
                let found = sector(graph, &group, column, regular, region)?;
                part.sectors.extend(found);
            }
        }
        Ok(part)
    }
}

/// Whether the term is 0 on the whole region because some symbols are.
fn vanishes(
    graph: &Graph,
    term: Node,
    vanishing: &[Node],
    region: &Region,
) -> Result<bool, MissingInput> {
    let used = graph.symbols_of(&[term]);
    if !vanishing.iter().any(|symbol| used.contains(symbol)) {
        return Ok(false);
    }
    let found = range_within(graph, term, region, 0)?;
    Ok(found.enclosure.is_defined() && found.enclosure == Interval::ZERO)
}

fn sector(
    graph: &Graph,
    group: &Group,
    (symbol, state): Column,
    regular: bool,
    region: &Region,
) -> Result<Option<(Sector, Slope)>, MissingInput> {
    let Some((range, variables)) = slope(graph, group, symbol, regular, region)? else {
        return Ok(None);
    };
    let sector = Sector {
        column: state,
        direction: group.direction.clone(),
        range,
    };
    let slope = Slope {
        state,
        term: written(graph, group, symbol),
        range,
        variables,
    };
    Ok(Some((sector, slope)))
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
/// it is zero everywhere. Terms that are not regular have no slope, whatever their
/// derivative is where they have one.
fn slope(
    graph: &Graph,
    group: &Group,
    state: Node,
    regular: bool,
    region: &Region,
) -> Result<Option<(Interval, Vec<String>)>, MissingInput> {
    let mut sum: Option<Node> = None;
    let mut rest = Interval::ZERO;
    let mut depends = false;
    for &(term, coefficient) in &group.terms {
        if jacobian::pattern(graph, &[term], &[state])[0].is_empty() {
            continue;
        }
        depends = true;
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
        return Ok((depends && !regular).then_some(entire));
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
    let range = match found.enclosure.is_defined() && regular {
        true => found.enclosure + rest,
        false => Interval::ENTIRE,
    };
    Ok(Some((range, names)))
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
