//! Constants of packages, for the names of a text that may mean them.

use std::collections::{HashMap, HashSet};

use super::Flattening;
use crate::syntax::ast::{ClassKind, Kind, Variability};
use crate::syntax::{Result, plain};

/// The label of the constant of a package: its name in full behind a dot, as no name of a model
/// is written, so that neither can be taken for the other.
pub(crate) fn label(full: &str) -> String {
    format!(".{full}")
}

impl Flattening<'_> {
    pub(super) fn constants(&mut self) -> Result<()> {
        let named = self.names();
        let classes = self.classes;
        let packages = classes
            .iter()
            .filter(|class| class.kind == ClassKind::Package);
        for package in packages {
            for constant in &package.declarations {
                let full = format!("{}.{}", package.path, constant.label);
                let label = label(&full);
                let is_constant = constant.prefix.variability != Variability::Continuous;
                let meaning = meaning(&named, &full);
                if !is_constant || meaning == Meaning::None || self.declared.contains(&label) {
                    continue;
                }
                let mut copy = constant.clone();
                copy.label.clone_from(&label);
                copy.package = Some(package.path.clone());
                copy.prefix.variability = Variability::Constant;
                let declared = self.declaration(copy, &package.path);
                // what nobody may mean must not end the reading
                if meaning == Meaning::Possible {
                    self.model.possible.insert(label);
                } else {
                    declared?;
                }
            }
        }
        Ok(())
    }

    /// Names in the expressions of the text, as they are written and as imports have them in
    /// full; with those of what they may be members of.
    fn names(&self) -> HashSet<String> {
        let mut imported: HashMap<&str, Vec<&str>> = HashMap::new();
        for import in self.classes.iter().flat_map(|class| &class.imports) {
            if let Some(short) = &import.short {
                imported.entry(short).or_default().push(&import.full);
            }
        }
        let mut found = HashSet::new();
        for expression in &self.ast.expressions {
            if !matches!(expression.kind, Kind::Name | Kind::Path(_)) {
                continue;
            }
            let name = plain(expression.span.text(self.source));
            let first = name.split('.').next().unwrap_or_default();
            for full in imported.get(first).into_iter().flatten() {
                insert(&mut found, &format!("{full}{}", &name[first.len()..]));
            }
            insert(&mut found, &name);
        }
        found
    }
}

/// A name and the names before each of its dots.
fn insert(names: &mut HashSet<String>, name: &str) {
    let mut rest = Some(name);
    while let Some(name) = rest {
        if !names.insert(name.to_owned()) {
            return;
        }
        rest = name.rsplit_once('.').map(|(above, _)| above);
    }
}

/// Whether a constant is meant by a name of the text.
#[derive(Clone, Copy, PartialEq)]
enum Meaning {
    None,
    /// its last part stands there alone, which may be the name of a variable
    Possible,
    Certain,
}

/// The meaning of a name in full that stands in the text as it is, or behind one of its dots.
fn meaning(names: &HashSet<String>, full: &str) -> Meaning {
    let mut rest = full;
    while let Some((_, below)) = rest.split_once('.') {
        if names.contains(rest) {
            return Meaning::Certain;
        }
        rest = below;
    }
    match names.contains(rest) {
        true => Meaning::Possible,
        false => Meaning::None,
    }
}
