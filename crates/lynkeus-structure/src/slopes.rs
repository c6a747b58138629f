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

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Tape, Unary, jacobian};
use lynkeus_proof::decay::{ErrorModel, Sector};
use lynkeus_proof::matrix::IntervalMatrix;

use crate::jumps::without_removable_jumps;
use crate::{Place, Region, range_within, regularity};

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
#[derive(Clone, Debug, PartialEq)]
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
    /// The error system of x' = `derivatives` in `states`, or of an observer x̂' = F(x̂, ε) with the innovations ε among
    /// the sides of the region, their ranges around 0.
    ///
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol outside the region.
    pub fn new(
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
        let sides = inputs.iter().map(|&i| region.dimensions[i].clone());
        let mut all = Self {
            models: vec![],
            inputs: sides.collect(),
            slopes: vec![],
        };
        for vertex in 0..1_usize << inputs.len() {
            let fixed = at_vertex(region, &inputs, vertex);
            let (model, slopes) = model(graph, derivatives, states, innovations, &fixed)?;
            match all.models.is_empty() {
                true => all.slopes = slopes,
                false => slopes.into_iter().for_each(|slope| all.include(slope)),
            }
            all.models.push(model);
        }
        Ok(all)
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
        let slope = self.slopes.iter().find(|s| !s.range.is_bounded())?;
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
    Ok(regularity(graph, derivatives, &[symbol], region)?.is_proved())
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

/// Cells examined per end of a slope's range.
const BUDGET: usize = 1500;
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

fn model(
    graph: &Graph,
    derivatives: &[Node],
    states: &[Node],
    innovations: &[Innovation],
    region: &Region,
) -> Result<(ErrorModel, Vec<Slope>), MissingInput> {
    let n = derivatives.len();
    let mut found = (vec![vec![Interval::ZERO; n]; n], vec![]);
    let columns: Vec<Column> = states.iter().copied().zip(0..).collect();
    let read: Vec<Column> = innovations.iter().map(|i| (i.symbol, i.state)).collect();
    let vanishing: Vec<Node> = read.iter().map(|column| column.0).collect();
    let right = at_rest(region, &vanishing);
    contribute(graph, derivatives, &columns, &vanishing, &right, &mut found)?;
    contribute(graph, derivatives, &read, &[], region, &mut found)?;
    let (constant, found) = found;
    let (sectors, slopes) = found.into_iter().unzip();
    Ok((ErrorModel { constant, sectors }, slopes))
}

/// The region where these symbols are 0.
fn at_rest(region: &Region, vanishing: &[Node]) -> Region {
    let mut right = region.clone();
    for side in &mut right.dimensions {
        if vanishing.contains(&side.symbol) {
            (side.min, side.max) = (0.0, 0.0);
        }
    }
    right
}

/// Slopes of the same state with the same weights count together: θ₁ + θ₂ is one
/// uncertain number.
fn add(found: &mut Vec<(Sector, Slope)>, sector: Sector, slope: Slope) {
    let is_same = |own: &Sector| own.column == sector.column && own.direction == sector.direction;
    let Some((own, mine)) = found.iter_mut().find(|(own, _)| is_same(own)) else {
        return found.push((sector, slope));
    };
    own.range = own.range + sector.range;
    mine.range = own.range;
    mine.term = format!("{} and {}", mine.term, slope.term);
    for name in slope.variables {
        if !mine.variables.contains(&name) {
            mine.variables.push(name);
        }
    }
}

/// Adds what some columns contribute to an error system. `vanishing`: symbols that are 0 in the region; a term that they
/// make 0 everywhere has no slope.
fn contribute(
    graph: &Graph,
    derivatives: &[Node],
    columns: &[Column],
    vanishing: &[Node],
    region: &Region,
    (constant, found): &mut (IntervalMatrix, Vec<(Sector, Slope)>),
) -> Result<(), MissingInput> {
    if columns.is_empty() {
        return Ok(());
    }
    let mut splitter = Splitter::new(graph, region);
    let mut weights: BTreeMap<Node, Vec<Interval>> = BTreeMap::new();
    for (row, &f) in derivatives.iter().enumerate() {
        for (term, coefficient) in splitter.split(f)?.terms {
            match columns.iter().find(|(symbol, _)| *symbol == term) {
                Some(&(_, state)) => {
                    let entry = &mut constant[row][state];
                    *entry = *entry + coefficient;
                }
                None => {
                    let none = || vec![Interval::ZERO; derivatives.len()];
                    weights.entry(term).or_insert_with(none)[row] = coefficient;
                }
            }
        }
    }
    let mut idle = vec![];
    for (&term, weight) in &weights {
        let unused = weight.iter().all(|w| *w == Interval::ZERO);
        if unused || is_idle(graph, term, vanishing, region)? {
            idle.push(term);
        }
    }
    weights.retain(|term, _| !idle.contains(term));
    let moving: Vec<Node> = columns.iter().map(|c| c.0).collect();
    for group in groups(weights) {
        let terms: Vec<Node> = group.terms.iter().map(|t| t.0).collect();
        let regular = regularity(graph, &terms, &moving, region)?.is_proved();
        for &column in columns {
            if let Some((sector, slope)) = sector(graph, &group, column, regular, region)? {
                add(found, sector, slope);
            }
        }
    }
    Ok(())
}

/// Whether the term is 0 on the whole region because some symbols are.
fn is_idle(
    graph: &Graph,
    term: Node,
    vanishing: &[Node],
    region: &Region,
) -> Result<bool, MissingInput> {
    let used = graph.symbols_of(&[term]);
    if !vanishing.iter().any(|symbol| used.contains(symbol)) {
        return Ok(false);
    }
    Ok(range_within(graph, term, region, 0)?.enclosure == Interval::ZERO)
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
        let added = |sum| graph.binary(Binary::Add, sum, weighted);
        sum = Some(sum.map_or(weighted, added));
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

/// c + Σ a_k term_k; a term is a state's symbol or a nonlinear node.
#[derive(Clone, Debug)]
struct Linear {
    constant: Interval,
    terms: BTreeMap<Node, Interval>,
}

impl Linear {
    fn number(constant: Interval) -> Self {
        Self {
            constant,
            terms: BTreeMap::new(),
        }
    }

    fn term(node: Node) -> Self {
        Self {
            constant: Interval::ZERO,
            terms: BTreeMap::from([(node, Interval::ONE)]),
        }
    }

    fn scaled(mut self, factor: Interval) -> Self {
        self.constant = self.constant * factor;
        for coefficient in self.terms.values_mut() {
            *coefficient = *coefficient * factor;
        }
        self
    }

    fn plus(mut self, other: &Linear) -> Self {
        self.constant = self.constant + other.constant;
        for (&node, &coefficient) in &other.terms {
            let mine = self.terms.entry(node).or_insert(Interval::ZERO);
            *mine = *mine + coefficient;
        }
        self
    }

    fn as_number(&self) -> Option<Interval> {
        self.terms.is_empty().then_some(self.constant)
    }

    /// The only term with its coefficient.
    fn single(&self) -> Option<(Node, Interval)> {
        match (self.terms.len(), self.constant == Interval::ZERO) {
            (1, true) => self.terms.iter().next().map(|(&n, &c)| (n, c)),
            _ => None,
        }
    }
}

/// Splits expressions on a box where some symbols have but one value.
struct Splitter<'a> {
    graph: &'a Graph,
    region: &'a Region,
    known: HashMap<Node, Linear>,
}

impl<'a> Splitter<'a> {
    fn new(graph: &'a Graph, region: &'a Region) -> Self {
        Self {
            graph,
            region,
            known: HashMap::new(),
        }
    }

    /// The node as a linear combination. Arguments come before their users, so that
    /// deep expressions need no recursion.
    fn split(&mut self, root: Node) -> Result<Linear, MissingInput> {
        for node in self.graph.reachable(&[root]) {
            if !self.known.contains_key(&node) {
                let linear = self.one(node)?;
                self.known.insert(node, linear);
            }
        }
        Ok(self.known[&root].clone())
    }

    fn of(&self, node: Node) -> Linear {
        // nodes made here are not among those visited before
        let known = self.known.get(&node).cloned();
        known.unwrap_or_else(|| Linear::term(node))
    }

    fn one(&self, node: Node) -> Result<Linear, MissingInput> {
        let number = |node: Node| self.of(node).as_number();
        Ok(match self.graph.op(node) {
            Op::Constant(x) => Linear::number(Interval::point(x)),
            Op::Symbol(_) => self.symbol(node),
            Op::Unary(Unary::Neg, a) => self.of(a).scaled(-Interval::ONE),
            Op::Binary(Binary::Add, a, b) => self.of(a).plus(&self.of(b)),
            Op::Binary(Binary::Sub, a, b) => self.of(a).plus(&self.of(b).scaled(-Interval::ONE)),
            Op::Binary(Binary::Mul, a, b) => match (number(a), number(b)) {
                (Some(x), _) => self.of(b).scaled(x),
                (_, Some(x)) => self.of(a).scaled(x),
                _ => self.product(node, Binary::Mul, a, b),
            },
            Op::Binary(Binary::Div, a, b) => match number(b) {
                Some(x) => self.of(a).scaled(Interval::ONE / x),
                None => self.product(node, Binary::Div, a, b),
            },
            _ => self.other(node)?,
        })
    }

    fn symbol(&self, node: Node) -> Linear {
        let mut sides = self.region.dimensions.iter();
        match sides.find(|d| d.symbol == node) {
            Some(side) if side.min == side.max => Linear::number(Interval::point(side.min)),
            _ => Linear::term(node),
        }
    }

    /// A product or quotient with the numerical factors of its arguments taken out, so
    /// that a term with different coefficients in two equations is one term.
    fn product(&self, node: Node, op: Binary, a: Node, b: Node) -> Linear {
        let factored = |x: Node| self.of(x).single().filter(|&(term, _)| term != x);
        let (a, p) = factored(a).unwrap_or((a, Interval::ONE));
        let (b, q) = factored(b).unwrap_or((b, Interval::ONE));
        if (p, q) == (Interval::ONE, Interval::ONE) {
            return Linear::term(node);
        }
        let factor = if op == Binary::Div { p / q } else { p * q };
        Linear::term(self.graph.binary(op, a, b)).scaled(factor)
    }

    /// A nonlinear node: a number where nothing in it varies.
    fn other(&self, node: Node) -> Result<Linear, MissingInput> {
        let arguments = self.graph.arguments(node);
        let fixed = arguments.iter().all(|&a| self.of(a).as_number().is_some());
        if !fixed || self.graph.op(node).is_system() {
            return Ok(Linear::term(node));
        }
        let used = self.region.restricted(&self.graph.symbols_of(&[node]));
        let tape = Tape::new(self.graph, &used.symbols(), &[node])?;
        Ok(Linear::number(tape.eval_in(&Intervals, &used.cell())[0]))
    }
}

#[cfg(test)]
mod tests;
