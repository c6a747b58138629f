//! Strongly connected components (Tarjan), without recursion.

/// Groups of members that need each other, each group in increasing order and behind those it needs; `needs[i]` are the
/// members that member i needs itself.
pub fn components(needs: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut search = Search {
        needs,
        number: vec![None; needs.len()],
        low: vec![0; needs.len()],
        is_open: vec![false; needs.len()],
        open: vec![],
        count: 0,
        components: vec![],
    };
    for root in 0..needs.len() {
        if search.number[root].is_none() {
            search.from(root);
        }
    }
    search.components
}

struct Search<'a> {
    needs: &'a [Vec<usize>],
    number: Vec<Option<usize>>,
    low: Vec<usize>,
    is_open: Vec<bool>,
    open: Vec<usize>,
    count: usize,
    components: Vec<Vec<usize>>,
}

impl Search<'_> {
    fn enter(&mut self, member: usize, path: &mut Vec<(usize, usize)>) {
        self.number[member] = Some(self.count);
        self.low[member] = self.count;
        self.count += 1;
        self.open.push(member);
        self.is_open[member] = true;
        path.push((member, 0));
    }

    fn from(&mut self, root: usize) {
        let mut path = vec![];
        self.enter(root, &mut path);
        while let Some((member, next)) = path.last_mut() {
            let member = *member;
            let Some(&needed) = self.needs[member].get(*next) else {
                path.pop();
                if let Some((above, _)) = path.last() {
                    self.low[*above] = self.low[*above].min(self.low[member]);
                }
                self.close(member);
                continue;
            };
            *next += 1;
            match self.number[needed] {
                None => self.enter(needed, &mut path),
                Some(number) if self.is_open[needed] => {
                    self.low[member] = self.low[member].min(number);
                }
                Some(_) => {}
            }
        }
    }

    fn close(&mut self, member: usize) {
        if self.number[member] != Some(self.low[member]) {
            return;
        }
        let mut component = vec![];
        while let Some(last) = self.open.pop() {
            self.is_open[last] = false;
            component.push(last);
            if last == member {
                break;
            }
        }
        component.sort_unstable();
        self.components.push(component);
    }
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
