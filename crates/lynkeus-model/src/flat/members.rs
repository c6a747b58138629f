//! Members of records, and modifications of declarations.

use super::Flattening;
use crate::syntax::ast::{Attribute, Class, Declaration, Kind, Variability};
use crate::syntax::{Problem, Result, plain, shortened};

/// Attributes that a number may have.
const KNOWN: [&str; 10] = [
    "start",
    "min",
    "max",
    "nominal",
    "unit",
    "displayUnit",
    "quantity",
    "fixed",
    "stateSelect",
    "unbounded",
];

/// Most members of members of records.
const MAX_DEPTH: usize = 20;

impl Flattening<'_> {
    /// The members of a record, each declared under its full name.
    pub(super) fn record(&mut self, record: Declaration, class: &Class) -> Result<()> {
        self.depth += 1;
        let done = self.record_here(record, class);
        self.depth -= 1;
        done
    }

    fn record_here(&mut self, record: Declaration, class: &Class) -> Result<()> {
        if self.depth > MAX_DEPTH {
            let message = format!("the record `{}` holds itself", class.path);
            return Err(Problem::new(record.name, message));
        }
        let mut members: Vec<(Declaration, String)> = vec![];
        self.members(class, &mut members, 0)?;
        let names = members
            .iter()
            .map(|(member, _)| member.label.clone())
            .collect();
        self.model.records.insert(record.label.clone(), names);
        for (mut member, path) in members {
            let name = member.label.clone();
            let default = member.binding;
            modify(self.source, &mut member, &record.attributes);
            if record.binding.is_none() && member.binding == default {
                self.check_default(&member, class)?;
            }
            member.label = format!("{}.{name}", record.label);
            let sized = !record.dimensions.is_empty();
            let mut dimensions = record.dimensions.clone();
            dimensions.append(&mut member.dimensions);
            member.dimensions = dimensions;
            if let Some(value) = record.binding {
                member.binding = Some(self.ast.member(value, name));
            } else if sized {
                member.binding = None;
            }
            if member.prefix.variability == Variability::Continuous {
                member.prefix.variability = record.prefix.variability;
            }
            member.prefix.is_final |= record.prefix.is_final;
            member.prefix.causality = record.prefix.causality;
            member.name = record.name;
            member.package.clone_from(&record.package);
            if !self.declared.contains(&member.label) {
                self.declaration(member, &path)?;
            }
        }
        Ok(())
    }

    /// Refuses a default whose names would lead to the model instead of to the record.
    fn check_default(&self, member: &Declaration, class: &Class) -> Result<()> {
        let Some(default) = member.binding else {
            return Ok(());
        };
        let is_sibling = |name: &str| class.declarations.iter().any(|d| d.label == name);
        for part in self.ast.parts(default) {
            let name = plain(part.span.text(self.source));
            let first = name.split(['.', '[']).next().unwrap_or_default();
            if matches!(part.kind, Kind::Name)
                && (is_sibling(first) || self.declared.contains(first))
            {
                let (label, record) = (&member.label, &class.path);
                let message = format!("the default of `{label}` in `{record}` needs `{first}`");
                return Err(Problem::new(part.span, message).hint(format!(
                    "give `{label}` a value where the record is declared: `r({label} = …)`"
                )));
            }
        }
        Ok(())
    }

    /// Members of a record and of its bases, each with the class it stands in.
    fn members(
        &self,
        class: &Class,
        into: &mut Vec<(Declaration, String)>,
        depth: usize,
    ) -> Result<()> {
        if depth > MAX_DEPTH {
            let message = format!("`{}` is made from itself", class.path);
            return Err(Problem::new(class.name, message).hint("remove the `extends`"));
        }
        for base in &class.bases {
            let from = into.len();
            self.members(self.base(class, base.name)?, into, depth + 1)?;
            for (member, _) in into.iter_mut().skip(from) {
                modify(self.source, member, &base.modification);
            }
        }
        let own = class.declarations.iter().cloned();
        into.extend(own.map(|member| (member, class.path.clone())));
        Ok(())
    }
}

/// Applies what modifications say of a declaration, if they do; outer ones stand first and win.
pub(super) fn modify(source: &str, declaration: &mut Declaration, modification: &[Attribute]) {
    for given in modification.iter().rev() {
        if plain(given.name.text(source)) != declaration.label {
            continue;
        }
        if given.value.is_some() {
            declaration.binding = given.value;
        }
        let own = std::mem::replace(&mut declaration.attributes, given.nested.clone());
        inherit(source, &mut declaration.attributes, &own);
    }
}

/// Adds attributes that are not given yet.
pub(super) fn inherit(source: &str, attributes: &mut Vec<Attribute>, from: &[Attribute]) {
    for attribute in from {
        let name = attribute.name.text(source);
        if attributes
            .iter()
            .all(|given| given.name.text(source) != name)
        {
            attributes.push(attribute.clone());
        }
    }
}

/// Refuses attributes that numbers do not have.
pub(super) fn check_attributes(source: &str, attributes: &[Attribute]) -> Result<()> {
    let stranger = |attribute: &&Attribute| !KNOWN.contains(&attribute.name.text(source));
    match attributes.iter().find(stranger) {
        None => Ok(()),
        Some(found) => {
            let text = shortened(found.name.text(source));
            let message = format!("unknown attribute `{text}`");
            let hint = format!("the attributes are {}", KNOWN.join(", "));
            Err(Problem::new(found.name, message).hint(hint))
        }
    }
}
