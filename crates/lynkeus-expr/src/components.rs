//! Strongly connected components (Tarjan), without recursion.

/// The number of a member whose component is complete.
const CLOSED: usize = usize::MAX;

/// Groups of members that need each other, each group in increasing order and behind those it needs; `needs[i]` are the
/// members that member i needs itself.
pub fn components(needs: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let (mut number, mut low) = (vec![None; needs.len()], vec![0; needs.len()]);
    let (mut components, mut open, mut path) = (vec![], vec![], vec![]);
    let mut count = 0;
    for root in 0..needs.len() {
        let mut new = number[root].is_none().then_some(root);
        loop {
            if let Some(member) = new.take() {
                (number[member], low[member]) = (Some(count), count);
                count += 1;
                open.push(member);
                path.push((member, needs[member].iter()));
            }
            let Some((member, left)) = path.last_mut() else {
                break;
            };
            let member = *member;
            if let Some(&needed) = left.next() {
                match number[needed] {
                    None => new = Some(needed),
                    Some(number) => low[member] = low[member].min(number),
                }
                continue;
            }
            path.pop();
            if let Some(&(above, _)) = path.last() {
                low[above] = low[above].min(low[member]);
            }
            if number[member] == Some(low[member]) {
                let first = open.iter().rposition(|&m| m == member).unwrap_or(0);
                let mut component = open.split_off(first);
                component.iter().for_each(|&m| number[m] = Some(CLOSED));
                component.sort_unstable();
                components.push(component);
            }
        }
    }
    components
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_comes_first() {
        // 0 needs 1 and 2, which need each other; 3 needs 0.
        let needs = vec![vec![0, 1], vec![1, 2], vec![1, 2], vec![0, 3]];
        assert_eq!(components(&needs), [vec![1, 2], vec![0], vec![3]]);
    }

    #[test]
    fn a_long_chain_needs_no_stack() {
        let n = 100_000;
        let needs: Vec<Vec<usize>> = (0..n).map(|i| vec![i, (i + 1).min(n - 1)]).collect();
        assert_eq!(components(&needs).len(), n);
    }
}
