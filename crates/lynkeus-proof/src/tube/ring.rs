//! The monomials of the polynomials of Taylor models, and where their products are.

use std::collections::HashMap;
use std::ops::Range;

/// Most monomials in the symbols of the start set, and up to how many states: of more, which have more terms, fewer
/// are bearable.
const MOST: usize = 200;
const STATES: usize = 7;

/// Highest order in them.
const HIGHEST: usize = 8;

/// Monomials in symbols that range over [−1, 1], up to a weighted degree.
///
/// The *symbols of the start set* have weight one. Those of the *remainder*, one per state, have
/// nearly the whole order: they enter linearly, alone and beside one symbol of the start set.
#[derive(Debug)]
pub(super) struct Ring {
    /// exponents, in the order of their weights; the first is the constant
    monomials: Vec<Vec<u8>>,
    /// the places of the monomials of each weight
    by_weight: Vec<Range<usize>>,
    /// `products[i][j]` is the place of monomial i · monomial j; j as far as the weight allows
    products: Vec<Vec<u32>>,
    order: usize,
    start: usize,
}

/// What a monomial means where a step ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Part {
    /// in symbols of the start set only
    Start,
    /// a symbol of the remainder alone
    Remainder(usize),
    /// both, or a higher power
    Mixed,
}

impl Ring {
    /// For so many symbols of the start set and so many of the remainder: of the highest order with
    /// a bearable number of monomials.
    pub fn new(start: usize, remainder: usize) -> Self {
        let count = |order: usize| {
            (1..=order).fold(1_usize, |count, k| count.saturating_mul(start + k) / k)
        };
        let share = (STATES as f64 / remainder as f64).min(1.0).powi(3);
        let fits = |order: &usize| count(*order) as f64 <= MOST as f64 * share;
        let order = match start {
            0 => 1,
            _ => (1..=HIGHEST).rev().find(fits).unwrap_or(1),
        };
        Self::of_order(start, remainder, order)
    }

    /// Of a given order.
    pub fn of_order(start: usize, remainder: usize, order: usize) -> Self {
        let heavy = order.saturating_sub(1).max(1);
        let symbols: Vec<usize> = (0..start + remainder)
            .map(|i| if i < start { 1 } else { heavy })
            .collect();
        let mut found = vec![(0, vec![0_u8; symbols.len()])];
        for (i, &weight) in symbols.iter().enumerate() {
            let mut more = vec![];
            for (total, exponents) in &found {
                for power in 1..=(order - total) / weight {
                    let mut exponents = exponents.clone();
                    exponents[i] = power as u8;
                    more.push((total + power * weight, exponents));
                }
            }
            found.extend(more);
        }
        found.sort_by_key(|(weight, _)| *weight);
        let (weights, monomials): (Vec<usize>, Vec<Vec<u8>>) = found.into_iter().unzip();
        let places: HashMap<&[u8], u32> = (0..).zip(&monomials).map(|(i, m)| (&m[..], i)).collect();
        let product =
            |a: &[u8], b: &[u8]| -> Vec<u8> { a.iter().zip(b).map(|(a, b)| a + b).collect() };
        let row = |i: usize| {
            let partners = monomials.iter().zip(&weights);
            let partners = partners.take_while(|(_, weight)| weights[i] + **weight <= order);
            partners
                .map(|(b, _)| places[&product(&monomials[i], b)[..]])
                .collect()
        };
        let products = (0..monomials.len()).map(row).collect();
        let first = |w: usize| weights.partition_point(|&weight| weight < w);
        Self {
            monomials,
            by_weight: (0..=order).map(|w| first(w)..first(w + 1)).collect(),
            products,
            order,
            start,
        }
    }

    /// Number of monomials.
    pub fn len(&self) -> usize {
        self.monomials.len()
    }

    /// Number of symbols of the start set.
    pub fn start(&self) -> usize {
        self.start
    }

    /// Number of symbols of the remainder.
    pub fn remainders(&self) -> usize {
        self.monomials[0].len() - self.start
    }

    /// The highest weight.
    pub fn order(&self) -> usize {
        self.order
    }

    /// The places of the monomials of each weight.
    pub fn by_weight(&self) -> &[Range<usize>] {
        &self.by_weight
    }

    /// Where the products with monomials 0, 1, … are.
    pub fn products(&self, monomial: usize) -> &[u32] {
        &self.products[monomial]
    }

    pub fn exponents(&self, monomial: usize) -> &[u8] {
        &self.monomials[monomial]
    }

    /// Whether the monomial is never negative.
    pub fn is_even(&self, monomial: usize) -> bool {
        self.monomials[monomial].iter().all(|power| power % 2 == 0)
    }

    /// The place of a symbol, those of the start set first.
    pub fn symbol(&self, symbol: usize) -> Option<usize> {
        let is_it = |m: &Vec<u8>| {
            m.iter()
                .enumerate()
                .all(|(i, &power)| power == u8::from(i == symbol))
        };
        self.monomials.iter().position(is_it)
    }

    pub fn part(&self, monomial: usize) -> Part {
        let remainder = &self.monomials[monomial][self.start..];
        let total: usize = self.monomials[monomial]
            .iter()
            .map(|&p| usize::from(p))
            .sum();
        match remainder.iter().position(|&power| power > 0) {
            None => Part::Start,
            Some(j) if total == 1 => Part::Remainder(j),
            Some(_) => Part::Mixed,
        }
    }
}
