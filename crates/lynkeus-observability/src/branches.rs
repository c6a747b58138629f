//! Branch by branch: `if`, `abs`, `min`, `max`, `sign` and `floor` choose, and a rank at one point says nothing of another
//! branch.
//!
//! Branches are found at points spread over the box, and each is analysed. What the outputs tell in one and not in
//! another is known on a part of the box. What they tell in none may still show when the branch changes: it is not
//! observable only if the *guards*, the expressions on which the choices hang, do not feel it either. Only choices that the outputs
//! feel count.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Tape, Unary};
use lynkeus_model::{Plant, Variable};

use lynkeus_expr::modular::Random;

/// Points at which branches are looked for.
const POINTS: usize = 256;
/// Seed of the points.
const SEED: u64 = 77;

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

/// A branch that some points of the box are in.
pub(crate) struct Branch {
    /// one of them
    pub reference: Reference,
    /// how many of the points looked at
    pub share: f64,
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
            _ => return,
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

    /// The branches at the model's own values, which comes first, and at points of the box, those with the most points
    /// before the others; none where the choices have no value.
    pub fn branches(&self, plant: &Plant) -> Option<Vec<Branch>> {
        let mut random = Random::new(SEED);
        let own = reference(plant, &mut Random::new(1));
        let mut seen: Vec<(Vec<u64>, Branch)> = vec![];
        let symbols: Vec<Node> = own.keys().copied().collect();
        let mut evaluator = Tape::new(&plant.graph, &symbols, &self.marks)
            .ok()?
            .evaluator();
        let mut values = vec![0.0; self.marks.len()];
        for k in 0..POINTS {
            let reference = match k {
                0 => own.clone(),
                _ => spread(plant, &own, &mut random),
            };
            let at: Vec<f64> = symbols.iter().map(|s| reference[s]).collect();
            evaluator.eval(&at, &mut values);
            if values.iter().any(|v| v.is_nan()) {
                continue;
            }
            // a border is no branch
            let marks = values.iter().zip(&self.marks);
            let on_border = |(v, mark): (&f64, &Node)| {
                *v == 0.0 && matches!(plant.graph.op(*mark), Op::Unary(Unary::Sign, _))
            };
            if k > 0 && marks.clone().any(on_border) {
                continue;
            }
            let key: Vec<u64> = values.iter().map(|v| v.to_bits()).collect();
            let share = 1.0 / POINTS as f64;
            match seen.iter_mut().find(|(known, _)| *known == key) {
                Some((_, branch)) => branch.share += share,
                None => seen.push((key, Branch { reference, share })),
            }
        }
        let mut found: Vec<Branch> = seen.into_iter().map(|(_, branch)| branch).collect();
        let others = found.get_mut(1..)?;
        others.sort_by(|a, b| b.share.total_cmp(&a.share));
        Some(found)
    }
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

/// How far beside zero a known start is looked at.
const BESIDE: f64 = 1e-6;

/// Values of every symbol: the model's own where it gives them, else inside the range.
pub(crate) fn reference(plant: &Plant, random: &mut Random) -> HashMap<Node, f64> {
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
