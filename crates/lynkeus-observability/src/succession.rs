//! What follows from the outputs one after another.
//!
//! A known function of time that depends on a single unknown gives this unknown where the slope is
//! not zero: by the implicit function theorem it is a function of what is known. Of a known
//! state the derivative is known as well, and may give the next. So a chain of a thousand
//! states is seen by the first coefficients alone, where the rank of a thousand takes hours.
//! What is found so may count as measured: its coefficients are combinations of the outputs'.

use std::collections::{BTreeSet, VecDeque};

use crate::field::Modular;
use crate::model::{Model, Role};

/// What follows, and from how much.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Succession {
    /// places of the symbols, in the order in which they are found
    pub places: Vec<usize>,
    /// derivatives of the outputs that they are found from
    pub order: usize,
}

/// What follows at a start, where `gradient` has the sensitivities of a root's first
/// coefficient.
pub(crate) fn succession(model: &Model, gradient: &dyn Fn(usize) -> Vec<Modular>) -> Succession {
    let mut search = Search::new(model);
    for output in model.states..model.states + model.outputs {
        search.know(output, 0);
    }
    while let Some(root) = search.ready.pop_front() {
        let Some(place) = search.missing[root].first().copied() else {
            continue;
        };
        let column = model.symbols[place].column;
        let gives = |column: usize| gradient(root).get(column).is_some_and(|x| !x.is_zero());
        if column.is_some_and(gives) {
            search.find(place, root);
        }
    }
    search.found
}

struct Search<'a> {
    model: &'a Model,
    /// of each root the places of symbols that are not known so far
    missing: Vec<BTreeSet<usize>>,
    /// of each place the roots that depend on it
    readers: Vec<Vec<usize>>,
    /// known roots, by how many derivatives of the outputs
    known: Vec<Option<usize>>,
    /// known roots that miss one symbol
    ready: VecDeque<usize>,
    found: Succession,
}

impl<'a> Search<'a> {
    fn new(model: &'a Model) -> Self {
        let is_unknown = |place: &usize| {
            let symbol = &model.symbols[*place];
            // a given start says nothing of later values
            symbol.column.is_some() || matches!(symbol.role, Role::State(_))
        };
        let roots = model.states + model.outputs;
        let missing: Vec<BTreeSet<usize>> = (0..roots)
            .map(|root| {
                model
                    .program
                    .inputs(root)
                    .into_iter()
                    .filter(is_unknown)
                    .collect()
            })
            .collect();
        let mut readers = vec![vec![]; model.symbols.len()];
        for (root, places) in missing.iter().enumerate() {
            places.iter().for_each(|&place| readers[place].push(root));
        }
        Self {
            known: vec![None; roots],
            ready: VecDeque::new(),
            found: Succession::default(),
            missing,
            readers,
            model,
        }
    }

    /// A root is known from so many derivatives of the outputs.
    fn know(&mut self, root: usize, order: usize) {
        self.known[root] = Some(order);
        self.look(root);
    }

    fn look(&mut self, root: usize) {
        if self.known[root].is_some() && self.missing[root].len() == 1 {
            self.ready.push_back(root);
        }
    }

    /// A symbol is known from a root.
    fn find(&mut self, place: usize, root: usize) {
        self.found.places.push(place);
        let order = self.known[root].unwrap_or_default();
        self.found.order = self.found.order.max(order);
        for reader in std::mem::take(&mut self.readers[place]) {
            self.missing[reader].remove(&place);
            // what it is found from next is known no earlier than this
            self.known[reader] = self.known[reader].map(|known| known.max(order));
            self.look(reader);
        }
        if let Role::State(state) = self.model.symbols[place].role {
            let latest = self.known[state].unwrap_or_default();
            self.know(state, latest.max(order + 1));
        }
    }
}
