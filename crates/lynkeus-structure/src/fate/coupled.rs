//! Which fates contradict the equations' own couplings, however small these are: what reads a quantity that
//! grows, or that an unknown input moves, does not decay for certain.

use lynkeus_expr::jacobian;

use super::{Fate, Hidden, Told};

/// Undecides what decays or stays, but reads what does not. `slopes` are those of the equations by the
/// extended states; that the outputs may cancel what is read is not looked for. What is `sure` rests on no threshold.
pub(super) fn weaken(
    hidden: &Hidden<'_, '_>,
    slopes: &jacobian::Jacobian,
    sure: &[bool],
    of: &mut [Fate],
) {
    let count = hidden.told.len();
    let is_free = |i: usize| i < count && hidden.told[i] != Told::Determined;
    let entries = slopes.entries.iter();
    let is_coupled = |i: usize, j: usize| is_free(i) && is_free(j) && !sure[i];
    let couplings = entries.filter(|entry| is_coupled(entry.0, entry.1));
    let couplings: Vec<(usize, usize)> = couplings.map(|(i, j, _)| (*i, *j)).collect();
    loop {
        let doubted = couplings.iter().find(|(i, j)| match of[*i] {
            Fate::Decays { .. } => !matches!(of[*j], Fate::Decays { .. }),
            Fate::Stays => !matches!(of[*j], Fate::Decays { .. } | Fate::Stays),
            _ => false,
        });
        match doubted {
            Some((i, _)) => of[*i] = Fate::Undecided,
            None => return,
        }
    }
}
