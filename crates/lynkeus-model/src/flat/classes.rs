//! Where the names of classes lead: inner classes first, then those around, then imports.

use std::collections::{HashMap, HashSet};

use crate::syntax::ast::{Class, Import};

/// The classes of a text by their names in full.
#[derive(Debug, Default)]
pub(crate) struct Classes<'a> {
    by_path: HashMap<&'a str, usize>,
    imports: HashMap<&'a str, &'a [Import]>,
    /// last parts of the names that lead to classes
    last: HashSet<&'a str>,
    /// ordinals of the literals of enumerations, from 1
    literals: HashMap<String, i64>,
}

impl<'a> Classes<'a> {
    pub(crate) fn new(source: &str, classes: &'a [Class]) -> Self {
        let mut index = Self::default();
        for (place, class) in classes.iter().enumerate() {
            index.by_path.entry(&class.path).or_insert(place);
            index.last.insert(last(&class.path));
            let shorts = class.imports.iter().filter_map(|i| i.short.as_deref());
            index.last.extend(shorts);
            if !class.imports.is_empty() {
                index.imports.insert(&class.path, &class.imports);
            }
            for (ordinal, literal) in (1..).zip(&class.literals) {
                let literal = crate::syntax::plain(literal.text(source));
                let name = format!("{}.{literal}", class.path);
                index.literals.insert(name, ordinal);
            }
        }
        index
    }

    /// The class that a name means in the first of some scopes that know it.
    pub(crate) fn class(&self, name: &str, scopes: &[&str]) -> Option<usize> {
        if !self.last.contains(last(name)) {
            return None;
        }
        let candidates = self.full_names(name, scopes);
        let mut found = candidates
            .iter()
            .map(|full| self.by_path.get(full.as_str()));
        found.find_map(|place| place.copied())
    }

    /// The ordinal of a literal of an enumeration.
    pub(crate) fn literal(&self, name: &str, scopes: &[&str]) -> Option<i64> {
        if self.literals.is_empty() || !name.contains('.') {
            return None;
        }
        let candidates = self.full_names(name, scopes);
        candidates
            .iter()
            .find_map(|full| self.literals.get(full).copied())
    }

    /// What a name may be in full, nearest first.
    pub(crate) fn full_names(&self, name: &str, scopes: &[&str]) -> Vec<String> {
        let mut found = vec![];
        let (first, rest) = match name.split_once('.') {
            Some((first, rest)) => (first, Some(rest)),
            None => (name, None),
        };
        for scope in scopes {
            let mut around = Some(*scope).filter(|scope| !scope.is_empty());
            while let Some(path) = around {
                found.push(format!("{path}.{name}"));
                for import in self.imports.get(path).copied().unwrap_or_default() {
                    match &import.short {
                        Some(short) if short == first => found.push(match rest {
                            Some(rest) => format!("{}.{rest}", import.full),
                            None => import.full.clone(),
                        }),
                        None => found.push(format!("{}.{name}", import.full)),
                        _ => {}
                    }
                }
                around = path.rsplit_once('.').map(|(above, _)| above);
            }
        }
        found.push(name.to_owned());
        found
    }
}

fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}
