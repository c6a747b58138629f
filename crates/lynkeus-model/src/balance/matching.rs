//! Maximum matching of equations and unknowns (Hopcroft and Karp), without recursion.

use std::collections::VecDeque;

/// Partners of equations and unknowns.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Matching {
    pub of_equation: Vec<Option<usize>>,
    pub of_unknown: Vec<Option<usize>>,
}

const FAR: usize = usize::MAX;

impl Matching {
    /// As many pairs of an equation and one of its unknowns as possible, those that are `wished`
    /// first, where both are still free.
    pub(super) fn new(
        edges: &[Vec<usize>],
        unknowns: usize,
        wished: impl Iterator<Item = (usize, usize)>,
    ) -> Self {
        let mut matching = Self {
            of_equation: vec![None; edges.len()],
            of_unknown: vec![None; unknowns],
        };
        for (equation, unknown) in wished {
            let partners = (matching.of_equation[equation], matching.of_unknown[unknown]);
            if partners == (None, None) {
                matching.pair(equation, unknown);
            }
        }
        matching.augment(edges);
        matching
    }

    fn pair(&mut self, equation: usize, unknown: usize) {
        self.of_equation[equation] = Some(unknown);
        self.of_unknown[unknown] = Some(equation);
    }

    fn augment(&mut self, edges: &[Vec<usize>]) {
        while let Some(levels) = self.levels(edges) {
            let mut next = vec![0; edges.len()];
            for root in 0..edges.len() {
                if self.of_equation[root].is_none() {
                    self.augment_from(root, edges, &levels, &mut next);
                }
            }
        }
    }

    /// Distance of every equation from the unmatched ones along alternating paths; `None`
    /// where no path reaches a free unknown.
    fn levels(&self, edges: &[Vec<usize>]) -> Option<Vec<usize>> {
        let mut levels = vec![FAR; edges.len()];
        let mut queue = VecDeque::new();
        for (equation, partner) in self.of_equation.iter().enumerate() {
            if partner.is_none() {
                levels[equation] = 0;
                queue.push_back(equation);
            }
        }
        let mut reached = false;
        while let Some(equation) = queue.pop_front() {
            for &unknown in &edges[equation] {
                match self.of_unknown[unknown] {
                    None => reached = true,
                    Some(other) if levels[other] == FAR => {
                        levels[other] = levels[equation] + 1;
                        queue.push_back(other);
                    }
                    Some(_) => {}
                }
            }
        }
        reached.then_some(levels)
    }

    /// Depth-first along rising levels; `next` remembers the edges already tried.
    fn augment_from(
        &mut self,
        root: usize,
        edges: &[Vec<usize>],
        levels: &[usize],
        next: &mut [usize],
    ) {
        let mut path: Vec<(usize, usize)> = vec![];
        let mut equation = root;
        loop {
            let Some(&unknown) = edges[equation].get(next[equation]) else {
                let Some((above, _)) = path.pop() else {
                    return;
                };
                equation = above;
                continue;
            };
            next[equation] += 1;
            match self.of_unknown[unknown] {
                None => {
                    path.push((equation, unknown));
                    for (equation, unknown) in path {
                        self.pair(equation, unknown);
                    }
                    return;
                }
                Some(other) if levels[other] == levels[equation] + 1 => {
                    path.push((equation, unknown));
                    equation = other;
                }
                Some(_) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn matched(edges: &[Vec<usize>], unknowns: usize) -> Matching {
        Matching::new(edges, unknowns, std::iter::empty())
    }

    /// Largest matching by trying every assignment.
    fn brute_force(edges: &[Vec<usize>], used: &mut Vec<bool>) -> usize {
        let Some((first, rest)) = edges.split_first() else {
            return 0;
        };
        let mut best = brute_force(rest, used);
        for &unknown in first {
            if !used[unknown] {
                used[unknown] = true;
                best = best.max(1 + brute_force(rest, used));
                used[unknown] = false;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn is_maximum(edges in prop::collection::vec(prop::collection::vec(0..6usize, 0..4), 0..6)) {
            let matching = matched(&edges, 6);
            let pairs = matching.of_equation.iter().flatten().count();
            prop_assert_eq!(pairs, brute_force(&edges, &mut vec![false; 6]));
            for (equation, partner) in matching.of_equation.iter().enumerate() {
                if let Some(unknown) = partner {
                    prop_assert!(edges[equation].contains(unknown));
                    prop_assert_eq!(matching.of_unknown[*unknown], Some(equation));
                }
            }
        }
    }

    #[test]
    fn a_long_chain_needs_no_stack() {
        let n = 100_000;
        let edges: Vec<Vec<usize>> = (0..n).map(|i| vec![(i + 1) % n, i]).collect();
        assert_eq!(matched(&edges, n).of_equation.iter().flatten().count(), n);
    }
}
