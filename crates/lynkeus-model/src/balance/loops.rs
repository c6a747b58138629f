//! Loops that are not linear. Tearing: what is left of equations that need each other when each of
//! them that gives a variable, as `v = R*i` does, is used for it; and whether that determines its
//! unknowns.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use lynkeus_expr::{Binary, Graph, Node, Tape, jacobian};

use super::linear::{Form, Linear};
use super::system::{FlatEquation, Incidence, System, Unknown, lines, listed};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_COUPLED;

/// A block of equations whose unknowns follow from a few of them.
pub(super) struct Torn<'a> {
    /// those few; more than may be coupled where the search was given up
    pub unknowns: Vec<&'a Unknown>,
    /// the equations that are left for them
    pub equations: Vec<&'a FlatEquation>,
    /// left − right of these, over those few and what other blocks determine
    pub residuals: Vec<Node>,
    /// the other unknowns: symbol and value, over the same
    pub explicit: Vec<(Node, Node)>,
    /// all unknowns of the block
    pub all: Vec<&'a Unknown>,
    /// the equations that gave the other unknowns
    pub used: Vec<&'a FlatEquation>,
}

impl<'a> Torn<'a> {
    /// Tears a block of (equation, unknown) by their places, greedily.
    pub(super) fn new(
        system: &'a System<'a>,
        incidence: &Incidence,
        linear: &Linear<'_>,
        block: &[(usize, usize)],
    ) -> Result<Self> {
        let mut search = Search::new(system, incidence, block);
        // a mass matrix is solved as a whole, with pivots
        if search
            .readers
            .keys()
            .all(|&u| system.unknowns[u].state.is_some())
        {
            search.torn = search.readers.keys().copied().collect();
            return Ok(search.finished());
        }
        loop {
            search.follow(linear)?;
            match search.most_read() {
                Some(unknown) if search.torn.len() <= MAX_COUPLED => search.tear(unknown),
                _ => return Ok(search.finished()),
            }
        }
    }
}

/// The state of the search; equations and unknowns by their places.
struct Search<'a> {
    system: &'a System<'a>,
    /// equations that gave no variable
    open: BTreeSet<usize>,
    /// unknowns of the block in each equation that are still to be determined
    left: HashMap<usize, Vec<usize>>,
    /// equations of the block with each of its unknowns
    readers: BTreeMap<usize, Vec<usize>>,
    determined: BTreeSet<usize>,
    /// equations with a single unknown left
    ready: VecDeque<usize>,
    torn: Vec<usize>,
    values: HashMap<Node, Node>,
    explicit: Vec<(Node, Node)>,
}

impl<'a> Search<'a> {
    fn new(system: &'a System<'a>, incidence: &Incidence, block: &[(usize, usize)]) -> Self {
        let mut readers: BTreeMap<usize, Vec<usize>> = block
            .iter()
            .map(|&(_, unknown)| (unknown, vec![]))
            .collect();
        let mut left = HashMap::new();
        for &(equation, _) in block {
            let mut unknowns = incidence.of_equation[equation].clone();
            unknowns.retain(|unknown| readers.contains_key(unknown));
            for unknown in &unknowns {
                readers.entry(*unknown).or_default().push(equation);
            }
            left.insert(equation, unknowns);
        }
        Self {
            system,
            open: block.iter().map(|&(equation, _)| equation).collect(),
            left,
            readers,
            determined: BTreeSet::new(),
            ready: VecDeque::new(),
            torn: vec![],
            values: HashMap::new(),
            explicit: vec![],
        }
    }

    /// Uses every equation that gives its last unknown.
    fn follow(&mut self, linear: &Linear<'_>) -> Result<()> {
        while let Some(equation) = self.ready.pop_front() {
            let Some(&[unknown]) = self.left.get(&equation).map(Vec::as_slice) else {
                continue;
            };
            let symbol = self.system.unknowns[unknown].symbol;
            if let Some(value) = self.given(linear, equation, symbol)? {
                let value = self.system.graph.substitute(&[value], &self.values)[0];
                self.values.insert(symbol, value);
                self.explicit.push((symbol, value));
                self.open.remove(&equation);
                self.settle(unknown);
            }
        }
        Ok(())
    }

    /// The unknown from an equation in which it stands once, as a term of its own: no other
    /// coefficient is sure not to be small.
    fn given(&self, linear: &Linear<'_>, equation: usize, symbol: Node) -> Result<Option<Node>> {
        let FlatEquation {
            left, right, span, ..
        } = self.system.equations[equation];
        let forms = (
            linear.form(left, symbol, span)?,
            linear.form(right, symbol, span)?,
        );
        let (Some(left), Some(right)) = forms else {
            return Ok(None);
        };
        let number = |form: Form| match form.coefficient {
            Some(node) => self.system.graph.constant_value(node),
            None => Some(0.0),
        };
        let alone = match (number(left), number(right)) {
            (Some(left), Some(right)) => (left - right).abs() == 1.0,
            _ => false,
        };
        Ok(alone.then(|| linear.solution(left, right)).flatten())
    }

    /// The unknown that stands in most equations; those of which something is declared first,
    /// for that is where a search begins.
    fn most_read(&self) -> Option<usize> {
        let rest = self
            .readers
            .iter()
            .filter(|(unknown, _)| !self.determined.contains(unknown));
        let key = |(&unknown, equations): (&usize, &Vec<usize>)| {
            let declared = self.system.unknowns[unknown].is_declared();
            let open = equations
                .iter()
                .filter(|equation| self.open.contains(equation));
            (declared, open.count(), std::cmp::Reverse(unknown))
        };
        rest.map(key).max().map(|(.., unknown)| unknown.0)
    }

    fn tear(&mut self, unknown: usize) {
        self.torn.push(unknown);
        self.settle(unknown);
    }

    fn settle(&mut self, unknown: usize) {
        self.determined.insert(unknown);
        for equation in &self.readers[&unknown] {
            let left = self.left.entry(*equation).or_default();
            left.retain(|&other| other != unknown);
            if left.len() == 1 {
                self.ready.push_back(*equation);
            }
        }
    }

    fn finished(self) -> Torn<'a> {
        let system = self.system;
        let equations: Vec<&FlatEquation> = self
            .open
            .iter()
            .map(|&place| &system.equations[place])
            .collect();
        let used = self.left.keys().filter(|place| !self.open.contains(place));
        let difference = |e: &&FlatEquation| system.graph.binary(Binary::Sub, e.left, e.right);
        let residuals: Vec<Node> = equations.iter().map(difference).collect();
        Torn {
            unknowns: self
                .torn
                .iter()
                .map(|&place| &system.unknowns[place])
                .collect(),
            residuals: system.graph.substitute(&residuals, &self.values),
            equations,
            all: self
                .readers
                .keys()
                .map(|&place| &system.unknowns[place])
                .collect(),
            used: used.map(|&place| &system.equations[place]).collect(),
            explicit: self.explicit,
        }
    }
}

/// Points looked at.
const POINTS: usize = 4;
/// Points farther away that are looked at where slopes jump.
const FAR: usize = 96;
/// Powers of ten up to which they are away.
const POWERS: usize = 8;
/// A pivot this small against its row is none.
const TINY: f64 = 1e-11;

/// Names the equations of a block of which one follows from the others.
pub(super) fn check_regular(graph: &Graph, torn: &Torn<'_>, source: &str) -> Result<()> {
    let unknowns: Vec<Node> = torn.unknowns.iter().map(|unknown| unknown.symbol).collect();
    let slopes = jacobian::forward(graph, &torn.residuals, &unknowns);
    let entries: Vec<Node> = slopes.entries.iter().map(|entry| entry.2).collect();
    let symbols = graph.symbols_of(&entries);
    let Ok(tape) = Tape::new(graph, &symbols, &entries) else {
        return Ok(());
    };
    // none where a slope has no value
    let look = |turn: usize| {
        let values = tape.eval_in(&lynkeus_expr::Reals, &point(torn, &symbols, turn));
        let places = slopes.entries.iter().map(|&(i, j, _)| (i, j));
        let are_finite = values.iter().all(|value| value.is_finite());
        are_finite.then(|| dependent_rows(matrix(unknowns.len(), places.zip(values))))
    };
    let mut dependent = vec![];
    for rows in (1..=POINTS).filter_map(look) {
        if rows.is_empty() {
            return Ok(());
        }
        dependent = rows;
    }
    if dependent.is_empty() {
        return Ok(());
    }
    let nodes = graph.reachable(&entries).into_iter();
    let may_jump = nodes.into_iter().any(|node| graph.jumps(node));
    let mut far = (POINTS + 1..=POINTS + FAR).filter_map(look);
    let only_near_starts = may_jump && far.any(|rows| rows.is_empty());
    Err(undetermined(torn, &dependent, only_near_starts, source))
}

fn matrix(n: usize, entries: impl Iterator<Item = ((usize, usize), f64)>) -> Vec<Vec<f64>> {
    let mut matrix = vec![vec![0.0; n]; n];
    for ((i, j), value) in entries {
        matrix[i][j] = value;
    }
    matrix
}

/// Numbers in which no relation hides: multiples of √2, √3, … modulo 1, off zero; of the unknowns
/// within their ranges, or beyond their starts. From the turn after [`POINTS`] on ever farther, on
/// either side.
fn point(torn: &Torn<'_>, symbols: &[Node], turn: usize) -> Vec<f64> {
    let part = |i: usize| (turn as f64 * ((i + 2) as f64 + 0.1 * turn as f64).sqrt()).fract();
    let is_far = turn > POINTS;
    let away = |i: usize| match is_far {
        true => (0.3 + part(i)) * 10.0_f64.powi((turn % POWERS) as i32),
        false => 0.3 + part(i),
    };
    let side = |i: usize| {
        if is_far && part(i + symbols.len()) < 0.5 {
            -1.0
        } else {
            1.0
        }
    };
    let within = |unknown: &Unknown, i: usize| {
        let (low, high) = (unknown.range.lo(), unknown.range.hi());
        match (low.is_finite(), high.is_finite()) {
            (true, true) => low + part(i) * (high - low),
            (false, true) => unknown.start - away(i),
            (true, false) => unknown.start + away(i),
            (false, false) => unknown.start + side(i) * away(i),
        }
    };
    let places = symbols.iter().enumerate();
    places
        .map(|(i, symbol)| {
            let mut unknowns = torn.unknowns.iter();
            match unknowns.find(|unknown| unknown.symbol == *symbol) {
                Some(unknown) => within(unknown, i),
                None => side(i) * away(i),
            }
        })
        .collect()
}

/// The rows of which a combination vanishes; none where the matrix is regular.
fn dependent_rows(mut rows: Vec<Vec<f64>>) -> Vec<usize> {
    let n = rows.len();
    // each row with what it is made of
    for (i, row) in rows.iter_mut().enumerate() {
        let size = row.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        if size == 0.0 {
            return vec![i];
        }
        row.iter_mut().for_each(|x| *x /= size);
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for k in 0..n {
        let largest = |row: &Vec<f64>| row[k..n].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if let Some(row) = rows[k..].iter().find(|row| largest(row) < TINY) {
            return (0..n).filter(|&j| row[n + j].abs() > TINY).collect();
        }
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let size = |&(i, j): &(usize, usize)| rows[i][j].abs();
        let largest = places.max_by(|a, b| size(a).total_cmp(&size(b)));
        let pivot = largest.unwrap_or((k, k));
        rows.swap(k, pivot.0);
        rows.iter_mut().for_each(|row| row.swap(k, pivot.1));
        let top = rows[k].clone();
        for row in &mut rows[k + 1..] {
            let factor = row[k] / top[k];
            row.iter_mut()
                .zip(&top)
                .for_each(|(x, top)| *x -= factor * top);
        }
    }
    vec![]
}

/// `only_near_starts`: on this side of a threshold, beyond which they are regular.
fn undetermined(
    torn: &Torn<'_>,
    rows: &[usize],
    only_near_starts: bool,
    source: &str,
) -> Box<Problem> {
    let dependent = rows.iter().map(|&i| torn.equations[i].span);
    let span = dependent
        .clone()
        .max_by_key(|span| span.start)
        .unwrap_or_default();
    let mut spans: Vec<Span> = dependent.chain(torn.used.iter().map(|e| e.span)).collect();
    spans.sort_by_key(|span| span.start);
    let names = listed(torn.all.iter().copied());
    let (place, hint) = match only_near_starts {
        false => (
            "everywhere",
            "one equation repeats others, or is a constraint between states or inputs (index \
             above 1): leave it out, or replace it by its derivative with respect to time",
        ),
        true => (
            "where these start, and determine them elsewhere only",
            "give a start, or min and max, on the side of the threshold on which they are",
        ),
    };
    let message = format!("these equations do not determine {names}: they are singular {place}");
    let lines = lines(source, spans.into_iter());
    Problem::new(span, message)
        .label(format!(
            "it says nothing new of them beside the others on {lines}"
        ))
        .hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_that_depend_on_each_other_are_found() {
        let regular = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        assert!(dependent_rows(regular).is_empty());
        let repeated = vec![
            vec![1.0, 2.0, 0.0],
            vec![0.0, 1.0, 1.0],
            vec![2.0, 4.0, 0.0],
        ];
        assert_eq!(dependent_rows(repeated), [0, 2]);
        let scaled = vec![vec![1e-9, 0.0], vec![0.0, 1e9]];
        assert!(dependent_rows(scaled).is_empty());
        assert_eq!(dependent_rows(vec![vec![0.0]]), [0]);
    }
}
