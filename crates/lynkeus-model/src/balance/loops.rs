//! Loops that are not linear. Tearing: what is left of equations that need each other when each of
//! them that gives a variable, as `v = R*i` does, is used for it; and whether that determines its
//! unknowns.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use lynkeus_expr::{Binary, Node, Reals, Tape, jacobian};

use super::linear::Form;
use super::system::{FlatEquation, System, Unknown};
use crate::diagnostic::{Problem, Result};
use crate::limits::MAX_COUPLED;

/// A block of equations whose unknowns follow from a few of them; equations and unknowns by their
/// places.
pub(super) struct Torn<'a> {
    system: &'a System<'a>,
    /// those few; more than may be coupled where the search was given up
    pub unknowns: Vec<usize>,
    /// the equations that are left for them: that gave no variable
    pub equations: BTreeSet<usize>,
    /// left − right of these, over those few and what other blocks determine
    pub residuals: Vec<Node>,
    /// the other unknowns: symbol and value, over the same
    pub explicit: HashMap<Node, Node>,
    /// unknowns of the block in each equation that are still to be determined
    left: HashMap<usize, Vec<usize>>,
    /// equations of the block with each of its unknowns
    readers: BTreeMap<usize, Vec<usize>>,
    /// equations with a single unknown left
    ready: VecDeque<usize>,
}

impl<'a> Torn<'a> {
    /// Tears a block of (equation, unknown), greedily.
    pub(super) fn new(system: &'a System<'a>, block: &[(usize, usize)]) -> Result<Self> {
        let mut torn = Self::whole(system, block);
        let mut unknowns = torn.readers.keys();
        // a mass matrix is solved as a whole, with pivots
        if unknowns.all(|&unknown| system.unknowns[unknown].state.is_some()) {
            torn.unknowns = torn.readers.keys().copied().collect();
        } else {
            torn.follow()?;
            while torn.unknowns.len() <= MAX_COUPLED
                && let Some(unknown) = torn.most_read()
            {
                torn.unknowns.push(unknown);
                torn.settle(unknown);
                torn.follow()?;
            }
        }
        let residual = |&place: &usize| {
            let FlatEquation { left, right, .. } = system.equations[place];
            system.graph.binary(Binary::Sub, left, right)
        };
        let residuals: Vec<Node> = torn.equations.iter().map(residual).collect();
        torn.residuals = system.graph.substitute(&residuals, &torn.explicit);
        Ok(torn)
    }

    /// A block before anything is determined.
    fn whole(system: &'a System<'a>, block: &[(usize, usize)]) -> Self {
        let mut readers: BTreeMap<usize, Vec<usize>> = block
            .iter()
            .map(|&(_, unknown)| (unknown, vec![]))
            .collect();
        let mut left = HashMap::new();
        for &(equation, _) in block {
            let mut unknowns = system.pattern[equation].clone();
            unknowns.retain(|unknown| readers.contains_key(unknown));
            for unknown in &unknowns {
                readers.entry(*unknown).or_default().push(equation);
            }
            left.insert(equation, unknowns);
        }
        Self {
            system,
            unknowns: vec![],
            equations: block.iter().map(|&(equation, _)| equation).collect(),
            residuals: vec![],
            explicit: HashMap::new(),
            left,
            readers,
            ready: VecDeque::new(),
        }
    }

    /// The few unknowns that are left.
    pub(super) fn unknowns(&self) -> impl Iterator<Item = &'a Unknown> {
        let system = self.system;
        self.unknowns.iter().map(|&place| &system.unknowns[place])
    }

    /// Uses every equation that gives its last unknown.
    fn follow(&mut self) -> Result<()> {
        while let Some(equation) = self.ready.pop_front() {
            let Some(&[unknown]) = self.left.get(&equation).map(Vec::as_slice) else {
                continue;
            };
            let symbol = self.system.unknowns[unknown].symbol;
            if let Some(value) = self.given(equation, symbol)? {
                let value = self.system.graph.substitute(&[value], &self.explicit)[0];
                self.explicit.insert(symbol, value);
                self.equations.remove(&equation);
                self.settle(unknown);
            }
        }
        Ok(())
    }

    /// The unknown from an equation in which it stands once, as a term of its own: no other
    /// coefficient is sure not to be small.
    fn given(&self, equation: usize, symbol: Node) -> Result<Option<Node>> {
        let equation = &self.system.equations[equation];
        let Some(sides) = self.system.sides(equation, symbol)? else {
            return Ok(None);
        };
        let number = |form: Form| match form.coefficient {
            Some(node) => self.system.graph.constant_value(node),
            None => Some(0.0),
        };
        let alone = match sides.map(number) {
            [Some(left), Some(right)] => (left - right).abs() == 1.0,
            _ => false,
        };
        Ok(alone.then(|| self.system.solution(sides)).flatten())
    }

    /// The unknown that stands in most equations; those of which something is declared first,
    /// for that is where a search begins. Numbers before truth values, which no step of a search
    /// leads to.
    fn most_read(&self) -> Option<usize> {
        let key = |(&place, equations): (&usize, &Vec<usize>)| {
            let unknown = &self.system.unknowns[place];
            let follows = self.explicit.contains_key(&unknown.symbol);
            let is_open = |equation: &&usize| self.equations.contains(equation);
            let open = equations.iter().filter(is_open).count();
            let key = (
                !unknown.is_discrete,
                unknown.is_declared(),
                open,
                Reverse(place),
            );
            (!follows && !self.unknowns.contains(&place)).then_some(key)
        };
        let most = self.readers.iter().filter_map(key).max();
        most.map(|(.., Reverse(place))| place)
    }

    fn settle(&mut self, unknown: usize) {
        for equation in &self.readers[&unknown] {
            let left = self.left.entry(*equation).or_default();
            left.retain(|&other| other != unknown);
            if left.len() == 1 {
                self.ready.push_back(*equation);
            }
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

impl Torn<'_> {
    /// Names the equations of the block of which one follows from the others.
    pub(super) fn check_regular(&self) -> Result<()> {
        let graph = self.system.graph;
        let unknowns: Vec<Node> = self.unknowns().map(|unknown| unknown.symbol).collect();
        let slopes = jacobian::forward(graph, &self.residuals, &unknowns);
        let entries: Vec<Node> = slopes.entries.iter().map(|entry| entry.2).collect();
        let symbols = graph.symbols_of(&entries);
        let Ok(tape) = Tape::new(graph, &symbols, &entries) else {
            return Ok(());
        };
        // none where a slope has no value
        let look = |turn: usize| {
            let values = tape.eval_in(&Reals, &self.point(&symbols, turn));
            let mut matrix = vec![vec![0.0; unknowns.len()]; unknowns.len()];
            for (&(i, j, _), &value) in slopes.entries.iter().zip(&values) {
                matrix[i][j] = value;
            }
            let are_finite = values.iter().all(|value| value.is_finite());
            are_finite.then(|| dependent_rows(matrix))
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
        let mut nodes = graph.reachable(&entries).into_iter();
        let may_jump = nodes.any(|node| graph.jumps(node));
        let mut far = (POINTS + 1..=POINTS + FAR).filter_map(look);
        let only_near_starts = may_jump && far.any(|rows| rows.is_empty());
        Err(self.undetermined(&dependent, only_near_starts))
    }

    /// Numbers in which no relation hides: multiples of √2, √3, … modulo 1, off zero; of the
    /// unknowns within their ranges, or beyond their starts. From the turn after [`POINTS`] on ever
    /// farther, on either side.
    fn point(&self, symbols: &[Node], turn: usize) -> Vec<f64> {
        let part = |i: usize| (turn as f64 * ((i + 2) as f64 + 0.1 * turn as f64).sqrt()).fract();
        let is_far = turn > POINTS;
        let away = |i: usize| match is_far {
            true => (0.3 + part(i)) * 10.0_f64.powi((turn % POWERS) as i32),
            false => 0.3 + part(i),
        };
        let side = |i: usize| match is_far && part(i + symbols.len()) < 0.5 {
            true => -1.0,
            false => 1.0,
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
        let number = |(i, &symbol): (usize, &Node)| {
            let mut unknowns = self.unknowns();
            match unknowns.find(|unknown| unknown.symbol == symbol) {
                Some(unknown) => within(unknown, i),
                None => side(i) * away(i),
            }
        };
        symbols.iter().enumerate().map(number).collect()
    }

    /// `only_near_starts`: on this side of a threshold, beyond which they are regular.
    fn undetermined(&self, rows: &[usize], only_near_starts: bool) -> Problem {
        let start = |equation: &usize| self.system.equations[*equation].span.start;
        let left: Vec<usize> = self.equations.iter().copied().collect();
        let dependent = rows.iter().map(|&row| left[row]);
        let last = dependent.clone().max_by_key(start);
        let span = last.map(|equation| self.system.equations[equation].span);
        let used = self.left.keys().copied();
        let used = used.filter(|equation| !self.equations.contains(equation));
        let mut all: Vec<usize> = dependent.chain(used).collect();
        all.sort_by_key(start);
        let names = self.system.listed(self.readers.keys().copied());
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
        let message =
            format!("these equations do not determine {names}: they are singular {place}");
        let lines = self.system.lines(all.into_iter());
        Problem::new(span.unwrap_or_default(), message)
            .label(format!(
                "it says nothing new of them beside the others on {lines}"
            ))
            .hint(hint)
    }
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
