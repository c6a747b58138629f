//! Strongly connected components (Tarjan), without recursion.

use super::matching::Matching;

/// Groups of equations that need each other, each group behind those it needs.
pub(super) fn blocks(edges: &[Vec<usize>], matching: &Matching) -> Vec<Vec<usize>> {
    let mut search = Search {
        edges,
        matching,
        number: vec![None; edges.len()],
        low: vec![0; edges.len()],
        is_open: vec![false; edges.len()],
        open: vec![],
        count: 0,
        blocks: vec![],
    };
    for root in 0..edges.len() {
        if search.number[root].is_none() {
            search.from(root);
        }
    }
    search.blocks
}

struct Search<'a> {
    edges: &'a [Vec<usize>],
    matching: &'a Matching,
    number: Vec<Option<usize>>,
    low: Vec<usize>,
    is_open: Vec<bool>,
    open: Vec<usize>,
    count: usize,
    blocks: Vec<Vec<usize>>,
}

impl Search<'_> {
    fn enter(&mut self, equation: usize, path: &mut Vec<(usize, usize)>) {
        self.number[equation] = Some(self.count);
        self.low[equation] = self.count;
        self.count += 1;
        self.open.push(equation);
        self.is_open[equation] = true;
        path.push((equation, 0));
    }

    fn from(&mut self, root: usize) {
        let mut path = vec![];
        self.enter(root, &mut path);
        while let Some((equation, next)) = path.last_mut() {
            let equation = *equation;
            let Some(&unknown) = self.edges[equation].get(*next) else {
                path.pop();
                if let Some((above, _)) = path.last() {
                    self.low[*above] = self.low[*above].min(self.low[equation]);
                }
                self.close(equation);
                continue;
            };
            *next += 1;
            // The equation that gives the unknown is needed first.
            let Some(needed) = self.matching.of_unknown[unknown] else {
                continue;
            };
            match self.number[needed] {
                None => self.enter(needed, &mut path),
                Some(number) if self.is_open[needed] => {
                    self.low[equation] = self.low[equation].min(number);
                }
                Some(_) => {}
            }
        }
    }

    fn close(&mut self, equation: usize) {
        if self.number[equation] != Some(self.low[equation]) {
            return;
        }
        let mut block = vec![];
        while let Some(member) = self.open.pop() {
            self.is_open[member] = false;
            block.push(member);
            if member == equation {
                break;
            }
        }
        block.sort_unstable();
        self.blocks.push(block);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(n: usize) -> Matching {
        let all: Vec<Option<usize>> = (0..n).map(Some).collect();
        Matching {
            of_equation: all.clone(),
            of_unknown: all,
        }
    }

    #[test]
    fn needed_blocks_come_first() {
        // 0 needs 1 and 2, which need each other; 3 needs 0.
        let edges = vec![vec![0, 1], vec![1, 2], vec![1, 2], vec![0, 3]];
        assert_eq!(blocks(&edges, &identity(4)), [vec![1, 2], vec![0], vec![3]]);
    }

    #[test]
    fn a_long_chain_needs_no_stack() {
        let n = 100_000;
        let edges: Vec<Vec<usize>> = (0..n).map(|i| vec![i, (i + 1).min(n - 1)]).collect();
        assert_eq!(blocks(&edges, &identity(n)).len(), n);
    }
}
