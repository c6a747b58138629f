//! The Jacobian of a flow together with its own variational equation.

use std::sync::Arc;

use crate::{Place, Slopes};

/// How the right-hand sides f, FΦ and FW + WFᵀ depend on x̂, Φ and W: F on each column, and
/// through ∂F/∂x on x̂.
#[derive(Clone, Debug, Default)]
pub(super) struct Curvature {
    /// ∂F/∂x: its rows are the entries of F
    pub second: Slopes,
    /// where the entries of ∂F/∂x were when the terms were made
    known: Option<Arc<[Place]>>,
    places: Arc<[Place]>,
    terms: Vec<Term>,
}

/// One entry.
#[derive(Clone, Copy, Debug)]
enum Term {
    /// an entry of F
    First(usize),
    /// an entry of ∂F/∂x times a number of the state
    Second { entry: usize, of: usize },
}

/// Where x̂, Φ and W are in the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub n: usize,
    /// numbers in a row of (Φ W)
    pub width: usize,
}

impl Layout {
    /// An entry of (Φ W).
    pub fn at(self, row: usize, column: usize) -> usize {
        self.n + row * self.width + column
    }
}

impl Curvature {
    /// Writes the Jacobian at the state z, where F has these values at its places and ∂F/∂x is
    /// [`Curvature::second`].
    pub fn write(
        &mut self,
        layout: Layout,
        entries: &[(usize, usize)],
        first: &[f64],
        z: &[f64],
        slopes: &mut Slopes,
    ) {
        let second = self.second.places();
        if self.known.as_ref().is_none_or(|k| !Arc::ptr_eq(k, second)) {
            self.known = Some(second.clone());
            self.arrange(layout, entries);
        }
        let values = slopes.at(&self.places);
        for (value, term) in values.iter_mut().zip(&self.terms) {
            *value = match *term {
                Term::First(entry) => first[entry],
                Term::Second { entry, of } => self.second.values()[entry] * z[of],
            };
        }
    }

    fn arrange(&mut self, layout: Layout, entries: &[(usize, usize)]) {
        let mut all: Vec<(Place, Term)> = vec![];
        let mut add = |row, column, term| all.push((Place { row, column }, term));
        for (entry, &(i, j)) in entries.iter().enumerate() {
            add(i, j, Term::First(entry));
            for (row, of) in affected(layout, i, j) {
                add(row, of, Term::First(entry));
            }
        }
        // outputs that are no entries of F may follow them
        let places = self.second.places().iter().enumerate();
        for (entry, at) in places.filter(|(_, at)| at.row < entries.len()) {
            let (i, j) = entries[at.row];
            for (row, of) in affected(layout, i, j) {
                add(row, at.column, Term::Second { entry, of });
            }
        }
        self.places = all.iter().map(|(place, _)| *place).collect();
        self.terms = all.into_iter().map(|(_, term)| term).collect();
    }
}

/// Which derivatives the entry (i, j) of F adds to, and of what it adds its multiple: (FΦ)ᵢ꜀ has
/// Φⱼ꜀, and so has (FW)ᵢ꜀ and its mirror image.
fn affected(layout: Layout, i: usize, j: usize) -> impl Iterator<Item = (usize, usize)> {
    let n = layout.n;
    let transition = (0..n).map(move |c| (layout.at(i, c), layout.at(j, c)));
    let noise = (0..layout.width - n).flat_map(move |c| {
        let of = layout.at(j, n + c);
        [(layout.at(i, n + c), of), (layout.at(c, n + i), of)]
    });
    transition.chain(noise)
}
