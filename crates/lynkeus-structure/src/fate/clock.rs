//! Which fates a linearisation at one instant does not tell: an error that decays like e^−t at the start may
//! stay for ever where its slope fades with time.

use std::collections::HashSet;

use lynkeus_expr::{Node, jacobian};

use super::{Hidden, Told};
use crate::Extended;

/// Whether one of these expressions reads the time.
pub(super) fn is_read(extended: &Extended<'_>, nodes: &[Node]) -> bool {
    let symbols = extended.graph().symbols_of(nodes);
    symbols.contains(&extended.plant.time)
}

/// Per extended state whether the error in it, if it is hidden, obeys an equation that reads one of these
/// symbols. `slopes` are those of the equations, then the outputs, by the extended states.
pub(super) fn moved(
    hidden: &Hidden<'_, '_>,
    slopes: &jacobian::Jacobian,
    moving: &HashSet<Node>,
) -> Vec<bool> {
    let graph = hidden.extended.graph();
    let reads = |slope: Node| {
        graph
            .symbols_of(&[slope])
            .iter()
            .any(|s| moving.contains(s))
    };
    let count = hidden.told.len();
    let is_free = |i: usize| i < count && hidden.told[i] != Told::Determined;
    let entries = slopes.entries.iter().filter(|entry| is_free(entry.1));
    let entries: Vec<(usize, usize, bool)> = entries
        .map(|(i, j, slope)| (*i, *j, reads(*slope)))
        .collect();
    let is_driven = (0..count).any(|i| is_free(i) && hidden.is_signal(i));
    let mut moved = vec![false; count];
    loop {
        let is_new = |i: usize| !is_free(i) || !moved[i];
        let next = entries
            .iter()
            .find(|&&(i, j, own)| is_new(i) && (own || moved[j]));
        match next {
            // what the outputs and the equations of what is known say couples all that is
            // hidden, as do unknown inputs
            Some(&(i, ..)) if is_driven || !is_free(i) => return vec![true; count],
            Some(&(i, ..)) => moved[i] = true,
            None => return moved,
        }
    }
}
