//! Maximum matching of equations and unknowns (Hopcroft and Karp), without recursion.

use std::collections::{HashMap, VecDeque};

use super::System;

/// Partners of equations and unknowns.
#[derive(Debug, PartialEq)]
pub(super) struct Matching {
    pub of_equation: Vec<Option<usize>>,
    pub of_unknown: Vec<Option<usize>>,
}

const FAR: usize = usize::MAX;

/// As many pairs as possible. Equations that read `v = …` take `v` first, so that what is
/// left over is what a reader of the model would name.
pub(super) fn maximum(system: &System<'_>, edges: &[Vec<usize>]) -> Matching {
    let mut matching = Matching {
        of_equation: vec![None; edges.len()],
        of_unknown: vec![None; system.unknowns.len()],
    };
    let unknowns = system.unknowns.iter().enumerate();
    let place: HashMap<_, _> = unknowns
        .map(|(place, unknown)| (unknown.symbol, place))
        .collect();
    for (equation, flat) in system.equations.iter().enumerate() {
        let sides = [flat.left, flat.right];
        let explicit = sides.iter().find_map(|side| place.get(side).copied());
        if let Some(unknown) = explicit {
            matching.pair_if_free(equation, unknown);
        }
    }
    // Derivatives before other unknowns: a missing equation is seldom one of a derivative.
    for derivatives in [true, false] {
        for (equation, unknowns) in edges.iter().enumerate() {
            let of_kind = |&&unknown: &&usize| {
                system
                    .unknowns
                    .get(unknown)
                    .is_some_and(|u| u.state.is_some() == derivatives)
            };
            for &unknown in unknowns.iter().filter(of_kind) {
                matching.pair_if_free(equation, unknown);
            }
        }
    }
    matching.augment(edges);
    matching
}

impl Matching {
    fn pair_if_free(&mut self, equation: usize, unknown: usize) {
        if self.of_equation[equation].is_none() && self.of_unknown[unknown].is_none() {
            self.pair(equation, unknown);
        }
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
        let mut matching = Matching {
            of_equation: vec![None; edges.len()],
            of_unknown: vec![None; unknowns],
        };
        matching.augment(edges);
        matching
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
