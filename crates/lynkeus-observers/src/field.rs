//! A matrix of expressions as a field on a box, for proofs that take its entries as they come together.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Graph, Interval, MissingInput, Node, Tape, jacobian};
use lynkeus_proof::decay::Field;
use lynkeus_proof::matrix::{IntervalMatrix, square};
use lynkeus_structure::{Region, regularity};

/// Numbers that A may depend on: the work grows with the power of them.
const SIDES: usize = 10;

/// A at every point of a box.
pub(crate) struct Joint {
    /// row by row
    entries: Tape,
    /// the derivatives of the entries that are not 0, with the places of the entries and the numbers; none where an entry
    /// may jump
    slopes: Option<(Tape, Vec<(usize, usize)>)>,
    sides: Vec<Interval>,
    size: usize,
}

impl Joint {
    /// None where A depends on too many numbers, and where a range is open.
    ///
    /// # Errors
    /// [`MissingInput`] where an entry reads what has no side.
    pub fn of(
        graph: &Graph,
        entries: &[Node],
        size: usize,
        region: Region,
    ) -> Result<Option<Self>, MissingInput> {
        let used = graph.symbols_of(entries);
        let mut sides = region;
        sides.dimensions.retain(|side| used.contains(&side.symbol));
        let is_finite = |side: &Interval| side.is_bounded();
        let ends: Option<Vec<Interval>> = sides
            .dimensions
            .iter()
            .map(|side| Interval::new(side.min, side.max).ok().filter(is_finite))
            .collect();
        let Some(ends) = ends.filter(|ends| ends.len() <= SIDES) else {
            return Ok(None);
        };
        let symbols = sides.symbols();
        let is_smooth = regularity(graph, entries, &symbols, &sides)?.is_proved();
        let slopes = match is_smooth {
            true => {
                let found = jacobian::forward(graph, entries, &symbols).entries;
                let nodes: Vec<Node> = found.iter().map(|entry| entry.2).collect();
                let places = found.iter().map(|entry| (entry.0, entry.1)).collect();
                Some((Tape::new(graph, &symbols, &nodes)?, places))
            }
            false => None,
        };
        Ok(Some(Self {
            entries: Tape::new(graph, &symbols, entries)?,
            slopes,
            sides: ends,
            size,
        }))
    }

    /// What a proof needs of it.
    pub fn field<T>(&self, look: impl FnOnce(&Field<'_>) -> T) -> T {
        let on = |part: &[Interval]| self.on(part);
        let slopes = |part: &[Interval]| self.slopes(part);
        look(&Field {
            on: &on,
            slopes: self.slopes.is_some().then_some(&slopes),
            sides: self.sides.clone(),
        })
    }

    fn on(&self, part: &[Interval]) -> IntervalMatrix {
        let entries = self.entries.eval_in(&Intervals, part);
        entries.chunks(self.size).map(<[_]>::to_vec).collect()
    }

    fn slopes(&self, part: &[Interval]) -> Vec<IntervalMatrix> {
        let mut all = vec![square(self.size, |_, _| Interval::ZERO); part.len()];
        if let Some((tape, places)) = &self.slopes {
            for (value, (entry, side)) in tape.eval_in(&Intervals, part).into_iter().zip(places) {
                all[*side][entry / self.size][entry % self.size] = value;
            }
        }
        all
    }
}
