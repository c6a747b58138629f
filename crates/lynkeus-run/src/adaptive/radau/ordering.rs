//! The order in which the columns of a sparse matrix are eliminated.

use std::collections::BTreeSet;

use crate::Place;

/// The order of least degree: what is eliminated next has the fewest neighbours among those that
/// are left, in the pattern of A + Aᵀ with all that elimination has filled so far. None where
/// more than `most` entries are filled on one side of the diagonal.
pub(super) fn least_degree(n: usize, places: &[Place], most: usize) -> Option<Vec<usize>> {
    let mut neighbours = vec![BTreeSet::new(); n];
    for at in places.iter().filter(|at| at.row != at.column) {
        neighbours[at.row].insert(at.column);
        neighbours[at.column].insert(at.row);
    }
    let mut queue: BTreeSet<(usize, usize)> =
        neighbours.iter().map(BTreeSet::len).zip(0..n).collect();
    let mut order = Vec::with_capacity(n);
    let mut filled = 0;
    while let Some((degree, i)) = queue.pop_first() {
        filled += degree;
        if filled > most {
            return None;
        }
        order.push(i);
        let around = std::mem::take(&mut neighbours[i]);
        for &j in &around {
            let own = &mut neighbours[j];
            queue.remove(&(own.len(), j));
            own.extend(&around);
            own.remove(&i);
            own.remove(&j);
            queue.insert((own.len(), j));
        }
    }
    Some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An arrow whose head comes first fills everything in the order as given, and nothing in
    /// that of least degree, which leaves the head to the end.
    #[test]
    fn the_head_of_an_arrow_comes_last() {
        let arrow = |n: usize| -> Vec<Place> {
            let place = |row, column| Place { row, column };
            (1..n)
                .flat_map(|i| [place(0, i), place(i, 0), place(i, i)])
                .collect()
        };
        let order = least_degree(50, &arrow(50), 49).unwrap();
        // the last but one and the head are equals
        assert!(order[48..].contains(&0), "{order:?}");
        assert_eq!(least_degree(50, &arrow(50), 48), None);
        let full: Vec<Place> = (0..100)
            .map(|k| Place {
                row: k / 10,
                column: k % 10,
            })
            .collect();
        assert_eq!(least_degree(10, &full, 44), None);
        assert_eq!(least_degree(10, &full, 45).unwrap().len(), 10);
    }
}
