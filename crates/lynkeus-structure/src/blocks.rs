//! The block-triangular form, found in the equations.
//!
//! In the form of Lee, Yee and Park, eq. (2) and Remark 3, there is one chain per
//! measured output and an order among the chains such that row j of chain i
//! depends on earlier chains, on x_i1 … x_i,j+1 of its own, and on the *measured*
//! first states of later chains. So once the earlier chains are known a chain
//! grows by the one new state of its last equation, as in [`chains`](crate::chains);
//! what is searched is the order.

use std::collections::HashSet;

use crate::chains::{ChainRequest, grown, heads, imbalance, named, names};
use crate::{AugmentedPlant, Chain, Misfit};

/// Chains in the order in which the observer uses them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// (index of the measured output, its chain), first block first
    pub order: Vec<(usize, Chain)>,
}

impl Blocks {
    /// The chains, in the order of the measured outputs.
    pub fn chains(&self) -> Vec<Chain> {
        let mut chains = vec![vec![]; self.order.len()];
        for (output, chain) in &self.order {
            chains[*output] = chain.clone();
        }
        chains
    }

    /// Lengths of the chains, in the order of the measured outputs.
    pub fn lengths(&self) -> Vec<usize> {
        self.chains().iter().map(Vec::len).collect()
    }

    /// Names of the states of each chain, in the order of the measured outputs.
    pub fn names(&self, augmented: &AugmentedPlant<'_>) -> Vec<Vec<String>> {
        named(augmented, &self.chains())
    }
}

/// Chains that are grown in search of arrangements: enough for every order of seven outputs.
const STEPS: usize = 20_000;

/// Every arrangement into blocks, the most balanced first; of equally balanced
/// ones that which follows the order of the measured outputs. With many outputs, those of
/// the first 20,000 steps of the search. `order`: places of the measured outputs, if the
/// order of their chains is given.
///
/// # Errors
/// Where there is none: which equation breaks the form.
pub fn find(
    augmented: &AugmentedPlant<'_>,
    request: &ChainRequest,
    order: Option<&[usize]>,
) -> Result<Vec<Blocks>, Misfit> {
    let heads = heads(augmented)?;
    let mut search = Search {
        augmented,
        heads: &heads,
        order,
        steps: 0,
        dead: HashSet::new(),
        found: vec![],
        furthest: None,
    };
    search.extend(&mut vec![], &mut vec![false; augmented.states.len()]);
    let Search {
        found,
        furthest,
        steps,
        ..
    } = search;
    if found.is_empty() {
        let why = furthest.map_or(Misfit::NoChain, |(_, why)| why);
        return Err(match steps < STEPS {
            true => why,
            false => Misfit::OrdersLeft(Box::new(why)),
        });
    }
    let (mut fits, other): (Vec<Blocks>, Vec<_>) = found
        .into_iter()
        .partition(|b| request.is_met(augmented, &b.chains()));
    if fits.is_empty() {
        let in_order = |b: &Blocks| named(augmented, b.order.iter().map(|(_, chain)| chain));
        let shown = other.iter().take(SHOWN).map(in_order);
        return Err(Misfit::OtherBlocks(shown.collect()));
    }
    fits.sort_by_key(|blocks| imbalance(&blocks.chains()));
    Ok(fits)
}

/// Arrangements that an error message shows.
const SHOWN: usize = 12;

struct Search<'e, 'p> {
    augmented: &'e AugmentedPlant<'p>,
    heads: &'e [usize],
    order: Option<&'e [usize]>,
    steps: usize,
    /// states taken, and by which chains, from where nothing can be completed
    dead: HashSet<(Vec<bool>, Vec<usize>)>,
    found: Vec<Blocks>,
    /// states covered by the best attempt, and why it stopped
    furthest: Option<(usize, Misfit)>,
}

impl Search<'_, '_> {
    fn extend(&mut self, order: &mut Vec<(usize, Chain)>, taken: &mut Vec<bool>) {
        if order.len() == self.heads.len() {
            return self.complete(order, taken);
        }
        let mut used: Vec<usize> = order.iter().map(|(output, _)| *output).collect();
        used.sort_unstable();
        let here = (taken.clone(), used);
        if self.dead.contains(&here) {
            return;
        }
        let before = self.found.len();
        for output in self.next(order) {
            if self.steps == STEPS || self.augmented.graph().spent().is_some() {
                return;
            }
            self.steps += 1;
            match self.grow(self.heads[output], taken) {
                Ok(chain) => {
                    chain.iter().for_each(|&i| taken[i] = true);
                    order.push((output, chain));
                    self.extend(order, taken);
                    if let Some((_, chain)) = order.pop() {
                        chain.iter().for_each(|&i| taken[i] = false);
                    }
                }
                Err(why) => self.stopped(taken, why),
            }
        }
        if self.found.len() == before {
            self.dead.insert(here);
        }
    }

    /// The outputs that may come next.
    fn next(&self, order: &[(usize, Chain)]) -> Vec<usize> {
        let free = |output: &usize| order.iter().all(|(used, _)| used != output);
        match self.order {
            Some(given) => given.get(order.len()).copied().into_iter().collect(),
            None => (0..self.heads.len()).filter(free).collect(),
        }
    }

    fn complete(&mut self, order: &[(usize, Chain)], taken: &[bool]) {
        if taken.iter().all(|&t| t) {
            return self.found.push(Blocks {
                order: order.to_vec(),
            });
        }
        let left = (0..taken.len()).filter(|&i| !taken[i]);
        self.stopped(taken, Misfit::OutOfReach(names(self.augmented, left)));
    }

    fn stopped(&mut self, taken: &[bool], why: Misfit) {
        let covered = taken.iter().filter(|&&t| t).count();
        if self
            .furthest
            .as_ref()
            .is_none_or(|(best, _)| covered > *best)
        {
            self.furthest = Some((covered, why));
        }
    }

    /// The chain from `head` given that the states `taken` belong to earlier chains.
    fn grow(&self, head: usize, taken: &[bool]) -> Result<Chain, Misfit> {
        let is_known = |i: usize| taken[i] || self.heads.contains(&i);
        let (chain, new) = grown(self.augmented, head, is_known);
        if new.is_empty() {
            return Ok(chain);
        }
        let last = &self.augmented.states[chain[chain.len() - 1]];
        Err(Misfit::BlockBreaks {
            of: last.name.clone(),
            new: names(self.augmented, new),
        })
    }
}
