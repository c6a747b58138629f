//! Numbers in their order, however many there are.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use super::{Iter, Series, Store};

/// Numbers that are sorted at once.
const RUN: usize = 1 << 20;

/// Numbers in the order of [`f64::total_cmp`]: sorted runs, which are merged as they are read.
#[derive(Debug)]
pub struct Sorted {
    runs: Vec<Series>,
}

impl Sorted {
    /// Of these numbers; the store keeps what is too much for memory.
    pub fn new(store: &Store, values: impl Iterator<Item = f64>) -> Self {
        let mut runs = vec![];
        let mut run = vec![];
        for x in values {
            if run.len() == RUN {
                run.sort_unstable_by(f64::total_cmp);
                runs.push(Series::gathered(store, run.drain(..)));
            }
            run.push(x);
        }
        run.sort_unstable_by(f64::total_cmp);
        runs.push(Series::from(run));
        Self { runs }
    }

    /// How many they are.
    pub fn len(&self) -> usize {
        self.runs.iter().map(Series::len).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number with so many before it.
    pub fn at(&self, place: usize) -> Option<f64> {
        match &self.runs[..] {
            [run] => run.get(place),
            _ => self.iter().nth(place),
        }
    }

    /// The one in the middle, the upper one of two.
    pub fn median(&self) -> Option<f64> {
        self.at(self.len() / 2)
    }

    /// All of them, in ascending order.
    pub fn iter(&self) -> Merged<'_> {
        let mut rest: Vec<Iter<'_>> = self.runs.iter().map(Series::iter).collect();
        let runs = rest.iter_mut().enumerate();
        let firsts = runs.filter_map(|(run, rest)| {
            Some(Reverse(Next {
                x: rest.next()?,
                run,
            }))
        });
        Merged {
            next: firsts.collect(),
            rest,
        }
    }
}

/// The numbers of all runs, the least first.
pub struct Merged<'s> {
    next: BinaryHeap<Reverse<Next>>,
    rest: Vec<Iter<'s>>,
}

impl Iterator for Merged<'_> {
    type Item = f64;

    fn next(&mut self) -> Option<f64> {
        let mut least = self.next.peek_mut()?;
        let Reverse(Next { x, run }) = *least;
        match self.rest.get_mut(run).and_then(Iterator::next) {
            Some(x) => *least = Reverse(Next { x, run }),
            None => drop(PeekMut::pop(least)),
        }
        Some(x)
    }
}

/// The least number of a run that is not yet read.
#[derive(Clone, Copy, Debug)]
struct Next {
    x: f64,
    run: usize,
}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        self.x.total_cmp(&other.x)
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Next {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Next {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_number_of_them_is_in_order() {
        let mixed = |k: usize| ((k as f64) * 1.618).fract() - 0.5;
        for count in [0, 1, 5, RUN, 2 * RUN + 3] {
            let found = Sorted::new(&Store::default(), (0..count).map(mixed));
            let mut expected: Vec<f64> = (0..count).map(mixed).collect();
            expected.sort_by(f64::total_cmp);
            assert_eq!(found.len(), count);
            assert!(found.iter().eq(expected.iter().copied()), "{count}");
            assert_eq!(found.median(), expected.get(count / 2).copied());
            assert_eq!(found.at(count / 20), expected.get(count / 20).copied());
        }
    }
}
