//! The rank of the outputs' coefficients at one start, order by order.

use std::collections::{BTreeSet, VecDeque};

use crate::expansion::{Columns, Expansion, Start};
use crate::model::{Model, Role};
use crate::series::Stop;
use lynkeus_expr::modular::{Echelon, Modular};

/// Products of coefficients, with a sensitivity each, that cost little.
const WORK: usize = 100_000_000;

/// The rows of sensitivities so far.
pub(crate) struct Search<'a> {
    model: &'a Model,
    expansion: Expansion<'a>,
    rows: Echelon,
    /// the rows' part in the columns of unknown inputs
    signals: Echelon,
    /// gradients of the expressions asked about, at the start
    about: Vec<Vec<Modular>>,
    /// what counts as measured beside the outputs; nothing where the ranks cost little
    succession: Option<Succession<'a>>,
    /// coefficients taken so far
    taken: usize,
}

impl<'a> Search<'a> {
    pub fn new(model: &'a Model, start: &'a Start, columns: Columns) -> Self {
        let width = columns.width();
        Self {
            expansion: Expansion::new(model, start, columns),
            rows: Echelon::new(width),
            signals: Echelon::new(width),
            about: vec![],
            succession: None,
            taken: 0,
            model,
        }
    }

    /// Adds the next order.
    pub fn advance(&mut self) -> Result<(), Stop> {
        self.expansion.advance()?;
        self.taken += 1;
        if self.taken == 1 {
            let expressions = 0..self.model.about;
            self.about = expressions.map(|i| self.expansion.about(i)).collect();
            if self.is_large() {
                let gradient = |root: usize| self.expansion.root(root).1;
                self.succession = Some(Succession::new(self.model, &gradient));
            }
        }
        for output in 0..self.model.outputs {
            self.add(self.expansion.output(output));
        }
        let places = self.succession.as_ref().map(|s| s.places.clone());
        for place in places.into_iter().flatten() {
            self.add(self.expansion.symbol(place).to_vec());
        }
        Ok(())
    }

    /// Adds orders at a generic start until none can bring anything new.
    pub fn run_out(&mut self) -> Result<(), Stop> {
        // the number of states and parameters, and one more for unknown inputs, is enough
        for k in 0..=self.model.depth {
            let before = self.settled();
            self.advance()?;
            if self.is_complete() || k > 0 && self.settled() == before {
                break;
            }
        }
        Ok(())
    }

    /// Adds orders until the rank is reached, everything is observable or `last` was taken.
    pub fn until(&mut self, rank: Option<usize>, last: usize) -> Result<(), Stop> {
        let reached = |search: &Self| rank.is_some_and(|rank| search.rank() >= rank);
        while self.taken <= last {
            self.advance()?;
            if reached(self) || self.is_complete() {
                break;
            }
        }
        Ok(())
    }

    /// Whether the coefficients of all orders that may be needed cost much.
    fn is_large(&self) -> bool {
        let products = self.model.depth.saturating_mul(self.model.depth) / 2;
        let sensitivities = self.model.program.len() * self.columns().width();
        products.saturating_mul(sensitivities) > WORK
    }

    /// Derivatives of the outputs from which all is known.
    pub fn outputs_order(&self) -> usize {
        self.order() + self.succession.as_ref().map_or(0, |s| s.order)
    }

    /// Derivatives of the outputs, and of what counts as measured, that were taken.
    pub fn order(&self) -> usize {
        self.taken.saturating_sub(1)
    }

    pub fn rank(&self) -> usize {
        self.rows.rank()
    }

    pub fn columns(&self) -> &Columns {
        &self.expansion.columns
    }

    /// Values of the named quantities at the start.
    pub fn point(&self) -> &[Modular] {
        &self.expansion.point
    }

    /// Gradients of the expressions asked about; fewer where not even the first
    /// coefficients were reached.
    pub fn about(&self) -> &[Vec<Modular>] {
        &self.about
    }

    /// Whether a combination of the unknowns is seen.
    pub fn sees(&self, row: &[Modular]) -> bool {
        self.rows.contains(row)
    }

    /// The rank of what is seen of states and parameters whatever the unknown inputs do.
    /// Derivatives of it, with those of the outputs, give all of the next order's: at a
    /// generic point, what did not grow once never grows.
    pub fn settled(&self) -> usize {
        self.rows.rank() - self.signals.rank()
    }

    fn add(&mut self, mut row: Vec<Modular>) {
        self.rows.add(&row);
        if self.model.unknown_inputs == 0 {
            return;
        }
        let inputs = self.columns().inputs();
        let columns = row.iter_mut().enumerate();
        let others = columns.filter(|(column, _)| !inputs.contains(column));
        others.for_each(|(_, x)| *x = Modular::ZERO);
        self.signals.add(&row);
    }

    /// Whether everything is observable: then nothing more can be learnt.
    pub fn is_complete(&self) -> bool {
        let named = self.columns().named;
        self.rows.rank() >= named
            && (self.model.unknown_inputs == 0
                || (0..named).all(|column| self.rows.contains(&self.columns().unit(column))))
    }

    /// Directions of the named quantities that no row so far sees, each with the
    /// column that moves in no other of them.
    pub fn unseen(&self) -> Vec<(usize, Vec<Modular>)> {
        let (named, unseen) = (self.columns().named, self.rows.kernel());
        let of_named = unseen.iter().map(|direction| &direction[..named]);
        Echelon::of(named, of_named).reduced_rows()
    }

    /// The rows in some of the columns alone.
    pub fn restricted(&self, columns: &[usize]) -> Echelon {
        let rows = self.rows.rows();
        let part = |row: &[Modular]| -> Vec<Modular> { columns.iter().map(|&c| row[c]).collect() };
        Echelon::of(columns.len(), rows.map(part))
    }
}

/// What follows one after another from the outputs, and from how much.
struct Succession<'a> {
    model: &'a Model,
    /// places of the symbols, in the order in which they are found
    places: Vec<usize>,
    /// derivatives of the outputs that they are found from
    order: usize,
    /// of each root the places of symbols that are not known so far
    missing: Vec<BTreeSet<usize>>,
    /// of each place the roots that depend on it
    readers: Vec<Vec<usize>>,
    /// known roots, by how many derivatives of the outputs
    known: Vec<Option<usize>>,
    /// known roots that miss one symbol
    ready: VecDeque<usize>,
}

impl<'a> Succession<'a> {
    /// What follows at a start, where `gradient` has the sensitivities of a root's first
    /// coefficient.
    fn new(model: &'a Model, gradient: &dyn Fn(usize) -> Vec<Modular>) -> Self {
        let is_unknown = |place: &usize| {
            let symbol = &model.symbols[*place];
            // a given start says nothing of later values
            symbol.column.is_some() || matches!(symbol.role, Role::State(_))
        };
        let roots = model.states + model.outputs;
        let read = |root: usize| model.program.inputs(root).into_iter().filter(is_unknown);
        let missing: Vec<BTreeSet<usize>> = (0..roots).map(|root| read(root).collect()).collect();
        let mut readers = vec![vec![]; model.symbols.len()];
        for (root, places) in missing.iter().enumerate() {
            places.iter().for_each(|&place| readers[place].push(root));
        }
        let mut all = Self {
            known: vec![None; roots],
            ready: VecDeque::new(),
            places: vec![],
            order: 0,
            missing,
            readers,
            model,
        };
        for output in model.states..model.states + model.outputs {
            all.know(output, 0);
        }
        while let Some(root) = all.ready.pop_front() {
            let Some(place) = all.missing[root].first().copied() else {
                continue;
            };
            let column = model.symbols[place].column;
            let gives = |column: usize| gradient(root).get(column).is_some_and(|x| !x.is_zero());
            if column.is_some_and(gives) {
                all.find(place, root);
            }
        }
        all
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
        self.places.push(place);
        let order = self.known[root].unwrap_or_default();
        self.order = self.order.max(order);
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

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;
    use crate::Question;
    use crate::model::measured;

    /// Names of what follows, in order, with the derivatives used. The ranks, which
    /// know nothing of it, say the same.
    fn followed(text: &str, question: &Question) -> (Vec<String>, usize) {
        let options = LoadOptions {
            symbolic_parameters: question.parameters,
            ..LoadOptions::default()
        };
        let plant = Plant::from_modelica(text, "p.mo", &options).unwrap();
        let outputs = measured(&plant, question).unwrap();
        let model = Model::new(&plant, question, (&outputs, &[]), None)
            .ok()
            .unwrap();
        let start = crate::hull::find(&model, Start::new(&model, 1)).unwrap();
        let columns = Columns::new(&model, model.depth);
        let mut search = Search::new(&model, &start, columns);
        search.advance().unwrap();
        let gradient = |root: usize| search.expansion.root(root).1;
        let found = Succession::new(&model, &gradient);
        search.until(None, model.depth).unwrap();
        assert!(search.succession.is_none());
        let name = |place: &usize| {
            let column = model.symbols[*place].column.unwrap();
            let name = model.named[column].0.clone();
            assert!(search.sees(&search.columns().unit(column)), "{name}");
            name
        };
        (found.places.iter().map(name).collect(), found.order)
    }

    fn names(of: &[&str]) -> Vec<String> {
        of.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn chains_follow_state_by_state() {
        let text = "model P Real a; Real b; Real c; output Real y = a^3;
      equation der(a) = a*sin(b); der(b) = exp(c) + a; der(c) = -b*c; end P;";
        let found = followed(text, &Question::default());
        assert_eq!(found, (names(&["a", "b", "c"]), 2));
    }

    #[test]
    fn unknown_inputs_and_parameters_follow_too() {
        let text = "model P parameter Real k = 2; input Real u; Real a; Real b; output Real y = a; output Real z = b;
      equation der(a) = -k*a; der(b) = a*u - b; end P;";
        let question = Question {
            unknown: names(&["u"]),
            parameters: true,
            ..Question::default()
        };
        let found = followed(text, &question);
        assert_eq!(found, (names(&["a", "b", "k", "u"]), 1));
    }

    /// Of a sum neither part follows; what a later equation tells comes from the ranks.
    #[test]
    fn two_unknowns_in_one_equation_do_not_follow() {
        let text = "model P Real a; Real b; Real c; Real d; output Real y = a;
      equation der(a) = b + c; der(b) = -b; der(c) = -2*c; der(d) = a; end P;";
        assert_eq!(followed(text, &Question::default()).0, names(&["a"]));
    }

    /// A fixed start is no course: b' shows c only once b is known.
    #[test]
    fn a_given_start_is_not_a_known_course() {
        let text = "model P Real a; Real b(start = 1, fixed = true); Real c; output Real y = a;
      equation der(a) = b*c; der(b) = -c*b; der(c) = -c; end P;";
        assert_eq!(followed(text, &Question::default()).0, names(&["a"]));
    }
}
