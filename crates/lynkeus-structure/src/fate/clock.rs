//! Which fates a linearisation at one instant does not tell: an error that decays like e^−t at the start may
//! stay for ever where its slope fades with time.

use lynkeus_expr::{Node, jacobian};

use super::{Hidden, Told};
use crate::Extended;

/// Whether one of these expressions reads the time.
pub(super) fn is_read(extended: &Extended<'_>, nodes: &[Node]) -> bool {
    let symbols = extended.graph().symbols_of(nodes);
    symbols.contains(&extended.plant.time)
}

/// Per extended state whether the error in it, if it is hidden, obeys an equation that reads the
/// time. `slopes` are those of the equations, then the outputs, by the extended states.
pub(super) fn timed(hidden: &Hidden<'_, '_>, slopes: &jacobian::Jacobian) -> Vec<bool> {
    let count = hidden.told.len();
    let is_free = |i: usize| i < count && hidden.told[i] != Told::Determined;
    let entries = slopes.entries.iter().filter(|entry| is_free(entry.1));
    let entries: Vec<(usize, usize, bool)> = entries
        .map(|(i, j, slope)| (*i, *j, is_read(hidden.extended, &[*slope])))
        .collect();
    let is_driven = (0..count).any(|i| is_free(i) && hidden.is_signal(i));
    let mut timed = vec![false; count];
    loop {
        let is_new = |i: usize| !is_free(i) || !timed[i];
        let next = entries
            .iter()
            .find(|&&(i, j, own)| is_new(i) && (own || timed[j]));
        match next {
            // what the outputs and the equations of what is known say couples all that is
            // hidden, as do unknown inputs
            Some(&(i, ..)) if is_driven || !is_free(i) => return vec![true; count],
            Some(&(i, ..)) => timed[i] = true,
            None => return timed,
        }
    }
}
