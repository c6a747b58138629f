//! Branch by branch: `if`, `abs`, `min`, `max`, `sign`, `floor`, √x² and asin∘sin choose, and a rank at one point says
//! nothing of another branch.
//!
//! Branches are found at points spread over the box, at the model's own time and at others where choices read it, and
//! each is analysed. What the outputs tell in one and not in another is known on a part of the box, or at some times. What they tell
//! in none may still show when the branch changes, or from two branches together: `switched` decides on that. The *guards* are the
//! expressions on which the choices hang. Only choices that the outputs feel count.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Evaluator, Graph, Node, Op, Tape, Unary};
use lynkeus_model::{Plant, Variable};

use crate::{Note, Question};
use lynkeus_expr::modular::Random;

/// Points at which branches are looked for.
const POINTS: usize = 256;
/// Seed of the points.
const SEED: u64 = 77;
/// Branches at the own time that are analysed beside the model's own, and branches at other times.
const BRANCHES: usize = 5;
const LATER: usize = 5;
/// Times looked at, from the first, over so many decades, with so many steps in each; points beside the own one; instants
/// at each, and how near two are one; moments in all.
const FIRST: f64 = 1e-6;
const DECADES: usize = 15;
const STEPS: usize = 16;
const ASIDE: usize = 3;
const INSTANTS: usize = 64;
const SAME: f64 = 1e-9;
const MOMENTS: usize = 16;

/// Values of every symbol at a point.
pub(crate) type Reference = HashMap<Node, f64>;

/// The choices that the outputs feel.
pub(crate) struct Choices {
    /// nodes whose values tell the branch
    marks: Vec<Node>,
    /// expressions that are zero, or whole, where the branch changes
    pub guards: Vec<Node>,
    /// names of everything that the outputs feel
    felt: HashSet<String>,
}

/// A branch that some points are in.
pub(crate) struct Branch {
    /// one of them
    pub reference: Reference,
    /// when that is: the place of its moment, the first being the model's own time
    pub moment: usize,
    /// of each moment the share of the points looked at that are in the branch
    pub shares: Vec<f64>,
}

/// The branches that were found.
pub(crate) struct Branches {
    /// those to analyse, the model's own first
    pub found: Vec<Branch>,
    /// whether there are no others
    pub all: bool,
}

impl Branches {
    /// The own branch, those at the own time, then those at others; of each kind those with the most points.
    fn chosen(mut branches: Vec<Branch>) -> Option<Self> {
        let count = branches.len();
        let mut others = branches.split_off(1);
        others.sort_by(|a, b| b.shares[0].total_cmp(&a.shares[0]));
        let now = others.partition_point(|branch| branch.shares[0] > 0.0);
        let mut later = others.split_off(now);
        let whole = |branch: &Branch| branch.shares.iter().sum::<f64>();
        later.sort_by(|a, b| whole(b).total_cmp(&whole(a)));
        let mut found = branches;
        found.extend(others.into_iter().take(BRANCHES));
        found.extend(later.into_iter().take(LATER));
        let all = found.len() == count;
        (count > 0).then_some(Self { found, all })
    }

    pub fn note(&self) -> Note {
        Note::Branches {
            count: self.found.len(),
            later: self.found.iter().any(|branch| branch.moment > 0),
            all: self.all,
        }
    }
}

impl Choices {
    /// What the outputs read, and the derivatives of the states that they read, and so on.
    pub fn of(plant: &Plant, outputs: &[Node]) -> Self {
        let graph = &plant.graph;
        let mut functions: Vec<Node> = outputs.to_vec();
        let mut read: HashSet<Node> = HashSet::new();
        loop {
            let symbols: HashSet<Node> = graph.symbols_of(&functions).into_iter().collect();
            let states = plant.states.iter().zip(&plant.derivatives);
            let new = states.filter(|(s, _)| symbols.contains(&s.node) && !read.contains(&s.node));
            let new: Vec<(Node, Node)> = new.map(|(s, derivative)| (s.node, *derivative)).collect();
            if new.is_empty() {
                break;
            }
            for (state, derivative) in new {
                read.insert(state);
                functions.push(derivative);
            }
        }
        let felt = graph.symbols_of(&functions).into_iter();
        let mut found = Self {
            marks: vec![],
            guards: vec![],
            felt: felt
                .filter_map(|symbol| graph.symbol_name(symbol))
                .collect(),
        };
        for node in graph.reachable(&functions) {
            found.note(graph, node);
        }
        found
    }

    fn note(&mut self, graph: &Graph, node: Node) {
        let (mark, guard) = match graph.op(node) {
            Op::Unary(Unary::Abs, a) => (graph.unary(Unary::Sign, a), a),
            Op::Unary(Unary::Sign | Unary::Floor, a) => (node, a),
            Op::Binary(Binary::Min | Binary::Max, a, b) => (
                graph.binary(Binary::Less, a, b),
                graph.binary(Binary::Sub, a, b),
            ),
            Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, a, b) => {
                (node, graph.binary(Binary::Sub, a, b))
            }
            _ => match folded(graph, node) {
                Some(Folded { guard, .. }) => (graph.unary(Unary::Sign, guard), guard),
                None => return,
            },
        };
        if graph.symbols_of(&[guard]).is_empty() {
            return;
        }
        self.marks.push(mark);
        self.guards.push(guard);
    }

    /// Whether a path of equations leads from a variable to an output, whatever branches they take.
    pub fn feel(&self, name: &str) -> bool {
        self.felt.contains(name)
    }

    pub fn is_empty(&self) -> bool {
        self.marks.is_empty()
    }

    /// The branches at the model's own values, and at points of the box; at other times, too, where choices read the
    /// time and no start is known: from a known start not every point is reached. None where the choices have no value.
    pub fn branches(&self, plant: &Plant, question: &Question) -> Option<Branches> {
        let mut random = Random::new(SEED);
        let own = own(plant, question);
        let mut seen: Vec<(Vec<u64>, Branch)> = vec![];
        let mut marked = Marked::new(plant, &self.marks, &own)?;
        let mut moments = vec![own[&plant.time]];
        if !has_known_starts(plant, question) && self.read_time(plant) {
            moments.extend(marked.moments(plant, &own));
        }
        for (moment, &time) in moments.iter().enumerate() {
            let points = if moment == 0 { POINTS } else { POINTS / 8 };
            for k in 0..points {
                let mut reference = match k {
                    0 => own.clone(),
                    _ => spread(plant, &own, &mut random),
                };
                reference.insert(plant.time, time);
                let may_be_border = k == 0 && moment == 0;
                let Some(key) = marked.key(plant, &reference, may_be_border) else {
                    continue;
                };
                let place = seen.iter().position(|(known, _)| *known == key);
                let place = place.unwrap_or_else(|| {
                    let shares = vec![0.0; moments.len()];
                    let branch = Branch {
                        reference,
                        moment,
                        shares,
                    };
                    seen.push((key, branch));
                    seen.len() - 1
                });
                seen[place].1.shares[moment] += 1.0 / points as f64;
            }
        }
        Branches::chosen(seen.into_iter().map(|(_, branch)| branch).collect())
    }

    fn read_time(&self, plant: &Plant) -> bool {
        plant.graph.symbols_of(&self.marks).contains(&plant.time)
    }

    /// Whether a node chooses, or one that it is made of.
    pub fn are_made(graph: &Graph, root: Node) -> bool {
        let mut choices = Self {
            marks: vec![],
            guards: vec![],
            felt: HashSet::new(),
        };
        for node in graph.reachable(&[root]) {
            choices.note(graph, node);
        }
        !choices.is_empty()
    }
}

/// What is `of`, up to a sign that changes with its guard's and to a shift.
pub(crate) struct Folded {
    pub of: Node,
    pub guard: Node,
}

/// √z², and the inverse of sine or cosine of itself.
pub(crate) fn folded(graph: &Graph, node: Node) -> Option<Folded> {
    let Op::Unary(outer, argument) = graph.op(node) else {
        return None;
    };
    let (of, guard) = match (outer, graph.op(argument)) {
        (Unary::Sqrt, Op::Powi(z, 2)) => (z, z),
        (Unary::Sqrt, Op::Binary(Binary::Mul, z, other)) if z == other => (z, z),
        (Unary::Asin, Op::Unary(Unary::Sin, z)) => (z, graph.unary(Unary::Cos, z)),
        (Unary::Acos, Op::Unary(Unary::Cos, z)) => (z, graph.unary(Unary::Sin, z)),
        _ => return None,
    };
    Some(Folded { of, guard })
}

/// The values of the marks at points.
struct Marked<'a> {
    marks: &'a [Node],
    symbols: Vec<Node>,
    evaluator: Evaluator,
}

impl<'a> Marked<'a> {
    fn new(plant: &Plant, marks: &'a [Node], own: &Reference) -> Option<Self> {
        let symbols: Vec<Node> = own.keys().copied().collect();
        let tape = Tape::new(&plant.graph, &symbols, marks).ok()?;
        Some(Self {
            marks,
            evaluator: tape.evaluator(),
            symbols,
        })
    }

    /// What tells the branch at a point; none where the choices have no value, or on a border, which is no branch.
    fn key(&mut self, plant: &Plant, point: &Reference, may_be_border: bool) -> Option<Vec<u64>> {
        let mut values = vec![0.0; self.marks.len()];
        let at: Vec<f64> = self.symbols.iter().map(|s| point[s]).collect();
        self.evaluator.eval(&at, &mut values);
        let on_border = |(v, mark): (&f64, &Node)| {
            *v == 0.0 && matches!(plant.graph.op(*mark), Op::Unary(Unary::Sign, _))
        };
        let border = !may_be_border && values.iter().zip(self.marks).any(on_border);
        let has_value = !border && !values.iter().any(|v| v.is_nan());
        has_value.then(|| values.iter().map(|v| v.to_bits()).collect())
    }

    /// Times at which other branches are than at the own time, at the own point or at some others: between the
    /// instants at which a mark changes.
    fn moments(&mut self, plant: &Plant, own: &Reference) -> Vec<f64> {
        let mut random = Random::new(SEED + 1);
        let mut points = vec![own.clone()];
        points.resize_with(1 + ASIDE, || spread(plant, own, &mut random));
        let mut at = |point: &mut Reference, time: f64| {
            point.insert(plant.time, time);
            self.key(plant, point, true)
        };
        let mut ends = vec![FIRST];
        for point in &mut points {
            ends.extend(instants(&mut |time| at(point, time)));
        }
        ends.sort_by(f64::total_cmp);
        // the same instant at several points
        ends.dedup_by(|next, before| *next - *before <= SAME * *before);
        ends.push(10.0 * ends[ends.len() - 1]);
        let mut keys = |time: f64| -> Vec<_> { points.iter_mut().map(|p| at(p, time)).collect() };
        let mut known = vec![keys(own[&plant.time])];
        let mut moments = vec![];
        for pair in ends.windows(2) {
            let time = pair[0] + (pair[1] - pair[0]) / 2.0;
            let found = keys(time);
            if !known.contains(&found) && moments.len() < MOMENTS {
                known.push(found);
                moments.push(time);
            }
        }
        moments
    }
}

/// Instants at which what is there changes, between times of a grid.
fn instants(at: &mut dyn FnMut(f64) -> Option<Vec<u64>>) -> Vec<f64> {
    let grid = (0..=DECADES * STEPS).map(|k| FIRST * 10_f64.powf(k as f64 / STEPS as f64));
    let mut found = vec![];
    let mut low = FIRST;
    let mut here = at(low);
    for high in grid {
        let end = at(high);
        while here != end && found.len() < INSTANTS {
            let mut last = high;
            loop {
                let middle = low + (last - low) / 2.0;
                if middle <= low || middle >= last {
                    break;
                }
                match at(middle) == here {
                    true => low = middle,
                    false => last = middle,
                }
            }
            found.push(last);
            (low, here) = (last, at(last));
        }
        (low, here) = (high, end);
    }
    found
}

/// A point of the box; what is given stays.
fn spread(plant: &Plant, own: &Reference, random: &mut Random) -> Reference {
    let mut point = own.clone();
    let variables = plant.states.iter().chain(&plant.inputs);
    for variable in variables.filter(|v| !v.fixed) {
        let value = in_range(variable, own[&variable.node], random);
        point.insert(variable.node, value);
    }
    point
}

/// A value in the range; around the model's own where that has no end.
fn in_range(variable: &Variable, own: f64, random: &mut Random) -> f64 {
    let reach = 2.0 * own.abs().max(1.0);
    let (low, high) = match (variable.min.is_finite(), variable.max.is_finite()) {
        (true, true) => (variable.min, variable.max),
        (true, false) => (variable.min, variable.min.max(own) + reach),
        (false, true) => (variable.max.min(own) - reach, variable.max),
        (false, false) => (own - reach, own + reach),
    };
    let value = low + random.unit() * (high - low);
    if variable.integer {
        value.round()
    } else {
        value
    }
}

fn has_known_starts(plant: &Plant, question: &Question) -> bool {
    !question.known_starts.is_empty() || plant.states.iter().any(|state| state.fixed)
}

/// The model's own values; known starts are those at time zero.
pub(crate) fn own(plant: &Plant, question: &Question) -> Reference {
    let mut own = reference(plant, &mut Random::new(1));
    if has_known_starts(plant, question) {
        own.insert(plant.time, BESIDE);
    }
    own
}

/// How far beside zero a known start is looked at.
const BESIDE: f64 = 1e-6;

/// Values of every symbol: the model's own where it gives them, else inside the range.
fn reference(plant: &Plant, random: &mut Random) -> HashMap<Node, f64> {
    let mut values = HashMap::new();
    let variables = plant.states.iter().chain(&plant.inputs).map(|v| (v, None));
    let parameters = plant.parameters.iter().map(|p| (&p.variable, p.value));
    for (variable, value) in variables.chain(parameters) {
        values.insert(variable.node, inside(variable, value, random));
    }
    values.insert(plant.time, 0.1 + random.unit());
    values
}

fn inside(variable: &Variable, value: Option<f64>, random: &mut Random) -> f64 {
    // a known start at zero is no point of its own: beside it, so that thresholds are told apart
    let start = match variable.fixed && variable.start.unwrap_or(0.0) == 0.0 {
        true => Some(BESIDE),
        false => variable.start.filter(|x| *x != 0.0),
    };
    let given = value.or(start);
    if let Some(given) = given {
        return given;
    }
    let end = |end: f64| Some(end).filter(|end| end.is_finite());
    let low = end(variable.min).unwrap_or(0.0);
    let high = end(variable.max).map_or(low + 2.0, |high| high.max(low));
    low + (0.1 + 0.8 * random.unit()) * (high - low)
}

/// The value of a node there, where it is finite.
pub(crate) fn value(graph: &Graph, node: Node, values: &HashMap<Node, f64>) -> Option<f64> {
    let symbols = graph.symbols_of(&[node]);
    let inputs: Option<Vec<f64>> = symbols.iter().map(|s| values.get(s).copied()).collect();
    let tape = Tape::new(graph, &symbols, &[node]).ok()?;
    let value = tape.evaluator().value(&inputs?);
    value.is_finite().then_some(value)
}
