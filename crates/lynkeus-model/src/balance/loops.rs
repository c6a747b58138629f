//! Tearing: what is left of equations that need each other when each of them that gives a
//! variable, as `v = R*i` does, is used for it.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use lynkeus_expr::{Binary, Node};

use super::incidence::Incidence;
use super::linear::{Form, Linear};
use super::{FlatEquation, System, Unknown};
use crate::limits::MAX_COUPLED;
use crate::syntax::Result;

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
