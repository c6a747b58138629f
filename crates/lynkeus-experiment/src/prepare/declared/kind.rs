//! What is said of single quantities, by their names.

use std::collections::BTreeMap;

/// One kind of declaration: what is said of single quantities, by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Kind<T> {
    /// what it is, in words
    pub(super) name: &'static str,
    pub(super) said: BTreeMap<String, T>,
    /// whether any of it is more than nothing: a density of 0 is none
    pub(super) acts: bool,
}

impl<T> Kind<T> {
    pub(super) fn new(name: &'static str, said: impl IntoIterator<Item = (String, T)>) -> Self {
        let said: BTreeMap<String, T> = said.into_iter().collect();
        let acts = !said.is_empty();
        Self { name, said, acts }
    }

    /// With what makes it more than nothing.
    pub(super) fn acting(self, is_something: impl Fn(&T) -> bool) -> Self {
        let acts = self.said.values().any(is_something);
        Self { acts, ..self }
    }

    /// What is said of a quantity.
    pub fn of(&self, quantity: &str) -> Option<&T> {
        self.said.get(quantity)
    }

    /// Whether any of it is more than nothing.
    pub fn acts(&self) -> bool {
        self.acts
    }

    /// Whether anything of this kind is declared.
    pub fn is_declared(&self) -> bool {
        !self.said.is_empty()
    }

    /// The quantities with what is said of them.
    pub fn iter(&self) -> impl Iterator<Item = (&String, &T)> {
        self.said.iter()
    }
}
