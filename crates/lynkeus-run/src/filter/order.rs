//! In which order noise reaches the states.

use lynkeus_expr::{Graph, Node};

/// The places of the states in the order in which noise reaches them: those that it acts on, those that these drive,
/// and so on, last those that it does not reach; none where they stand in this order. `slopes` are the entries of F
/// and their places (row, column).
///
/// In a time h noise makes W_ij of order h^(a + b + 1) of states that are a and b away, and steps of order 4 tell it
/// up to h⁴. The factor of W has to begin at the noise. There it meets what the steps tell well; of a state far away
/// it takes what it has in common with the nearer ones, and drops a pivot that is lost in the error of the steps,
/// which is of order h⁵ then. A factor that begins far away begins with a variance of which the steps have told
/// nothing, and drops with it what this state has in common with the others: of order h³ in a chain of three.
pub(crate) fn by_distance(
    graph: &Graph,
    noisy: &[bool],
    slopes: impl IntoIterator<Item = ((usize, usize), Node)>,
) -> Option<Vec<usize>> {
    let n = noisy.len();
    let is_there = |slope: &((usize, usize), Node)| graph.constant_value(slope.1) != Some(0.0);
    let slopes: Vec<_> = slopes.into_iter().filter(is_there).collect();
    let start = noisy.iter().map(|is_noisy| if *is_noisy { 0 } else { n });
    let mut away: Vec<usize> = start.collect();
    for _ in 0..n {
        for &((row, column), _) in &slopes {
            away[row] = away[row].min(away[column] + 1);
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|&i| away[i]);
    (!order.is_sorted()).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_stand_by_their_distance_from_the_noise() {
        let g = Graph::new();
        let order = |noisy: &[bool], slopes: &[(usize, usize)]| {
            // what is written of the others vanishes
            let vanishing = [((0, 2), g.constant(0.0).node())];
            let slopes = slopes.iter().map(|place| (*place, g.constant(2.0).node()));
            by_distance(&g, noisy, slopes.chain(vanishing))
        };
        // x0' = 2 x1, x1' = 2 x2, x2' = 2 x0
        let chain = [(0, 1), (1, 2), (2, 0)];
        assert_eq!(order(&[false, false, true], &chain), Some(vec![2, 1, 0]));
        assert_eq!(order(&[true, false, false], &chain), Some(vec![0, 2, 1]));
        // what stands in the order stays, as do those that are equally far
        assert_eq!(order(&[true; 3], &chain), None);
        assert_eq!(order(&[false; 3], &chain), None);
        assert_eq!(order(&[true, false, false], &[(1, 0), (2, 0)]), None);
        // a state that nothing moves is last
        let found = order(&[false, false, true], &[(1, 2), (1, 0)]);
        assert_eq!(found, Some(vec![2, 1, 0]));
    }
}
