//! A text of classes to the one flat model that is meant: types, records and base classes are
//! written out; components of other models are refused, with the commands that flatten them.

mod library;

use std::collections::{HashMap, HashSet};

use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{MAX_SCALARS, grouped};
use crate::syntax::ast::{
    Ast, Attribute, Class, ClassKind, Declaration, Equation, ExprId, Import, Kind, Statement,
    TypeName, Variability,
};
use crate::syntax::{HOW_TO_FLATTEN, plain, shortened};

pub(crate) use library::constant;

/// Most classes that one may be made from.
const MAX_BASES: usize = 100;

/// A model without classes: what is left are declarations of numbers, and equations.
#[derive(Debug, Default)]
pub(crate) struct FlatModel {
    pub name: Span,
    pub title: String,
    /// the class and its bases: where names of functions and types are looked up
    pub scopes: Vec<String>,
    pub declarations: Vec<Declaration>,
    /// names of the members of each record, by its label
    pub records: HashMap<String, Vec<String>>,
    /// labels of constants that the text may not mean
    pub possible: HashSet<String>,
    pub equations: Vec<Equation>,
    pub initial: Vec<Equation>,
    pub algorithms: Vec<Vec<Statement>>,
}

/// The flat model of a class.
pub(crate) fn flat_model(
    source: &str,
    ast: &mut Ast,
    classes: &Classes<'_>,
    class: &Class,
) -> Result<FlatModel> {
    let own = |declaration: &Declaration| declaration.label.clone();
    let mut flattening = Flattening {
        source,
        classes,
        ast,
        model: FlatModel::default(),
        declared: class.declarations.iter().map(own).collect(),
    };
    flattening.constants()?;
    flattening.whole(class)?;
    let mut model = flattening.model;
    model.name = class.name;
    model.title = title(&class.path).to_owned();
    elements_by_themselves(source, ast, &mut model.declarations);
    Ok(model)
}

struct Flattening<'a> {
    source: &'a str,
    classes: &'a Classes<'a>,
    ast: &'a mut Ast,
    model: FlatModel,
    /// labels of the declarations so far
    declared: HashSet<String>,
}

impl<'a> Flattening<'a> {
    fn whole(&mut self, class: &'a Class) -> Result<()> {
        let mut scopes = vec![];
        let parts = self.parts(class, vec![], &[], &mut scopes)?;
        self.model.scopes = scopes;
        for (class, modification) in parts {
            for declaration in &class.declarations {
                let declaration = modified(self.source, declaration, &modification);
                self.declaration(declaration, &class.path)?;
            }
            let model = &mut self.model;
            model.equations.extend(class.equations.iter().cloned());
            model.initial.extend(class.initial.iter().cloned());
            model.algorithms.extend(class.algorithms.iter().cloned());
        }
        Ok(())
    }

    /// What a class is made of: its bases before itself, each with what modifies its declarations,
    /// outer modifications first.
    fn parts(
        &self,
        class: &'a Class,
        modification: Vec<Attribute>,
        above: &[&str],
        scopes: &mut Vec<String>,
    ) -> Result<Vec<(&'a Class, Vec<Attribute>)>> {
        if above.contains(&class.path.as_str()) || scopes.len() > MAX_BASES {
            let message = format!("`{}` is made from itself", class.path);
            return Err(Problem::new(class.name, message).hint("remove the `extends`"));
        }
        let above = [above, &[&class.path]].concat();
        scopes.push(class.path.clone());
        let mut parts = vec![];
        for base in &class.bases {
            let both = [&modification[..], &base.nested].concat();
            let base = self.base(class, base.name)?;
            parts.extend(self.parts(base, both, &above, scopes)?);
        }
        parts.push((class, modification));
        Ok(parts)
    }

    fn base(&self, class: &Class, name: Span) -> Result<&'a Class> {
        let text = plain(name.text(self.source));
        match self.classes.class(&text, &[&class.path]) {
            Some(found) if found.kind != ClassKind::Function => Ok(found),
            _ => {
                let message = format!("the model is not flat: `extends {text}` of another file");
                Err(Problem::new(name, message).hint(HOW_TO_FLATTEN))
            }
        }
    }

    /// A declaration of numbers as it is, one of a record as those of its members.
    fn declaration(&mut self, mut declaration: Declaration, path: &str) -> Result<()> {
        if let Some(span) = declaration.of_connector {
            let message = "the model is not flat: it has a connector variable";
            return Err(Problem::new(span, message).hint(HOW_TO_FLATTEN));
        }
        let mut path = path.to_owned();
        for _ in 0..MAX_BASES {
            let TypeName::Named(name) = declaration.type_name else {
                return self.scalar_or_array(declaration);
            };
            let text = plain(name.text(self.source));
            let Some(class) = self.classes.class(&text, &[&path]) else {
                return self.of_library(declaration, &text, name, &path);
            };
            match (class.kind, &class.alias) {
                (_, Some(alias)) => {
                    declaration.type_name = alias.type_name;
                    declaration.dimensions.extend(&alias.dimensions);
                    inherit(self.source, &mut declaration.attributes, &alias.attributes);
                    let around = class.path.rsplit_once('.');
                    path = around.map_or("", |(above, _)| above).to_owned();
                }
                (ClassKind::Type, None) if !class.literals.is_empty() => {
                    declaration.type_name = TypeName::Integer;
                }
                (ClassKind::Record, None) => return self.record(declaration, class),
                _ => {
                    let label = &declaration.label;
                    let message = format!(
                        "the model is not flat: `{label}` is a component of class `{text}`"
                    );
                    return Err(Problem::new(name, message).hint(HOW_TO_FLATTEN));
                }
            }
        }
        let message = "the type of this variable is made from itself";
        Err(Problem::new(declaration.name, message))
    }

    fn of_library(
        &mut self,
        mut declaration: Declaration,
        text: &str,
        name: Span,
        path: &str,
    ) -> Result<()> {
        let full = self.classes.full_names(text, &[path]);
        if let Some(found) = full.iter().find_map(|full| library::type_named(full)) {
            declaration.type_name = TypeName::Real;
            declaration.library = Some(found);
            return self.scalar_or_array(declaration);
        }
        if matches!(text, "StateSelect" | "AssertionLevel") {
            declaration.type_name = TypeName::String;
            return self.scalar_or_array(declaration);
        }
        let shown = shortened(text);
        let (message, hint) = match full.iter().any(|full| full.starts_with("Modelica.")) {
            true => (
                format!("the library type `{shown}` is not known here"),
                "write `Real` with `unit = \"…\"`; a component of the library makes a model \
                 that is not flat: ",
            ),
            false => (
                format!("unknown type `{shown}`"),
                "components of other models are not supported: ",
            ),
        };
        Err(Problem::new(name, message).hint(hint.to_owned() + HOW_TO_FLATTEN))
    }

    fn scalar_or_array(&mut self, declaration: Declaration) -> Result<()> {
        if declaration.type_name == TypeName::String {
            // a text takes no part in equations, nor does a choice of the library
            if declaration.variability != Variability::Continuous {
                return Ok(());
            }
            let message = "String variables are not supported";
            return Err(Problem::new(declaration.name, message).hint("remove it"));
        }
        check_attributes(self.source, &declaration.attributes)?;
        if self.model.declarations.len() as u64 >= MAX_SCALARS {
            let limit = grouped(MAX_SCALARS);
            let message =
                format!("the model needs more than {limit} scalar variables and parameters");
            return Err(Problem::new(declaration.name, message));
        }
        self.declared.insert(declaration.label.clone());
        self.model.declarations.push(declaration);
        Ok(())
    }
}

/// What a class is called: its path, but once where a package of the same name holds it.
pub(crate) fn title(path: &str) -> &str {
    let halves = path.split_at_checked(path.len() / 2);
    let halves = halves.and_then(|(package, rest)| Some((package, rest.strip_prefix('.')?)));
    match halves {
        Some((package, model)) if package == model => model,
        _ => path,
    }
}

/// `Real x[1]; Real x[2];` declares two elements of one array, not one array twice.
fn elements_by_themselves(source: &str, ast: &Ast, declarations: &mut [Declaration]) {
    let mut count: HashMap<String, usize> = HashMap::new();
    for declaration in declarations.iter() {
        *count.entry(declaration.label.clone()).or_default() += 1;
    }
    let literal = |id: &ExprId| matches!(ast.expression(*id).kind, Kind::Integer(_));
    for declaration in declarations {
        let dimensions = &declaration.dimensions;
        let repeated = count.get(&declaration.label) > Some(&1);
        if !repeated || dimensions.is_empty() || !dimensions.iter().all(literal) {
            continue;
        }
        let subscript = |id: &ExprId| ast.expression(*id).span.text(source);
        let subscripts: Vec<&str> = dimensions.iter().map(subscript).collect();
        declaration.label = format!("{}[{}]", declaration.label, subscripts.join(","));
        declaration.dimensions.clear();
    }
}

/// Attributes that a number may have.
const KNOWN: &str = "start min max nominal unit displayUnit quantity fixed stateSelect unbounded";

/// Most members of members of records.
const MAX_DEPTH: usize = 20;

impl<'a> Flattening<'a> {
    /// The members of a record, each declared under its full name.
    fn record(&mut self, record: Declaration, class: &'a Class) -> Result<()> {
        if record.label.matches('.').count() > MAX_DEPTH {
            let message = format!("the record `{}` holds itself", class.path);
            return Err(Problem::new(record.name, message));
        }
        let parts = self.parts(class, vec![], &[], &mut vec![])?;
        let members = parts.iter().flat_map(|(class, modification)| {
            let declarations = class.declarations.iter();
            declarations.map(move |member| (member, modification, &class.path))
        });
        let names = members.clone().map(|(member, ..)| member.label.clone());
        let names = names.collect();
        self.model.records.insert(record.label.clone(), names);
        for (member, modification, path) in members {
            let name = member.label.clone();
            let member = modified(self.source, member, modification);
            let default = member.binding;
            let mut member = modified(self.source, &member, &record.attributes);
            if record.binding.is_none() && member.binding == default {
                self.check_default(&member, class)?;
            }
            member.label = format!("{}.{name}", record.label);
            member.dimensions.splice(0..0, record.dimensions.clone());
            if let Some(value) = record.binding {
                member.binding = Some(self.ast.member(value, name));
            } else if !record.dimensions.is_empty() {
                member.binding = None;
            }
            if member.variability == Variability::Continuous {
                member.variability = record.variability;
            }
            member.is_final |= record.is_final;
            member.causality = record.causality;
            member.name = record.name;
            member.package.clone_from(&record.package);
            if !self.declared.contains(&member.label) {
                self.declaration(member, path)?;
            }
        }
        Ok(())
    }

    /// Refuses a default whose names would lead to the model instead of to the record.
    fn check_default(&self, member: &Declaration, class: &Class) -> Result<()> {
        let Some(default) = member.binding else {
            return Ok(());
        };
        let is_known = |name: &str| {
            let mut siblings = class.declarations.iter();
            siblings.any(|d| d.label == name) || self.declared.contains(name)
        };
        for part in self.ast.parts(default) {
            let name = plain(part.span.text(self.source));
            let first = name.split(['.', '[']).next().unwrap_or_default();
            if matches!(part.kind, Kind::Name) && is_known(first) {
                let (label, record) = (&member.label, &class.path);
                let message = format!("the default of `{label}` in `{record}` needs `{first}`");
                return Err(Problem::new(part.span, message).hint(format!(
                    "give `{label}` a value where the record is declared: `r({label} = …)`"
                )));
            }
        }
        Ok(())
    }
}

/// A declaration with what modifications say of it; outer ones stand first and win.
fn modified(source: &str, declaration: &Declaration, modification: &[Attribute]) -> Declaration {
    let mut changed = declaration.clone();
    let is_meant = |given: &&Attribute| plain(given.name.text(source)) == declaration.label;
    for given in modification.iter().rev().filter(is_meant) {
        changed.binding = given.value.or(changed.binding);
        let own = std::mem::replace(&mut changed.attributes, given.nested.clone());
        inherit(source, &mut changed.attributes, &own);
    }
    changed
}

/// Adds attributes that are not given yet.
fn inherit(source: &str, attributes: &mut Vec<Attribute>, from: &[Attribute]) {
    for attribute in from {
        let is_other = |given: &Attribute| given.name.text(source) != attribute.name.text(source);
        if attributes.iter().all(is_other) {
            attributes.push(attribute.clone());
        }
    }
}

/// Refuses attributes that numbers do not have.
fn check_attributes(source: &str, attributes: &[Attribute]) -> Result<()> {
    let is_known = |name: &str| KNOWN.split(' ').any(|known| known == name);
    let mut names = attributes.iter().map(|attribute| attribute.name);
    let Some(name) = names.find(|name| !is_known(name.text(source))) else {
        return Ok(());
    };
    let message = format!("unknown attribute `{}`", shortened(name.text(source)));
    let hint = format!("the attributes are {}", KNOWN.replace(' ', ", "));
    Err(Problem::new(name, message).hint(hint))
}

/// The label of the constant of a package: its name in full behind a dot, as no name of a model
/// is written, so that neither can be taken for the other.
pub(crate) fn constant_label(full: &str) -> String {
    format!(".{full}")
}

impl Flattening<'_> {
    fn constants(&mut self) -> Result<()> {
        let named = self.names();
        let classes = self.classes.list.iter();
        for package in classes.filter(|class| class.kind == ClassKind::Package) {
            for constant in &package.declarations {
                let full = format!("{}.{}", package.path, constant.label);
                let label = constant_label(&full);
                let is_constant = constant.variability != Variability::Continuous;
                let is_meant = is_meant(&named, &full);
                // its last part alone may be the name of a variable
                let may_be_meant = is_meant || named.contains(last(&full));
                if !is_constant || !may_be_meant || self.declared.contains(&label) {
                    continue;
                }
                let mut copy = constant.clone();
                copy.label.clone_from(&label);
                copy.package = Some(package.path.clone());
                copy.variability = Variability::Constant;
                let declared = self.declaration(copy, &package.path);
                // what nobody may mean must not end the reading
                if is_meant {
                    declared?;
                } else {
                    self.model.possible.insert(label);
                }
            }
        }
        Ok(())
    }

    /// Names in the expressions of the text, as they are written and as imports have them in
    /// full; with those of what they may be members of.
    fn names(&self) -> HashSet<String> {
        let mut imported: HashMap<&str, Vec<&str>> = HashMap::new();
        for import in self.classes.list.iter().flat_map(|class| &class.imports) {
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
            let imported = imported.get(first).into_iter().flatten();
            let mut names: Vec<String> = imported
                .map(|full| format!("{full}{}", &name[first.len()..]))
                .collect();
            names.push(name.into_owned());
            for name in &names {
                // what encloses a name that is known is known as well
                enclosing(name).all(|name| found.insert(name.to_owned()));
            }
        }
        found
    }
}

/// A name and the names before each of its dots, the longest first.
fn enclosing(name: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(name), |name| Some(name.rsplit_once('.')?.0))
}

/// Whether a name in full stands in the text as it is, or behind one of its dots.
fn is_meant(names: &HashSet<String>, full: &str) -> bool {
    let behind = std::iter::successors(Some(full), |name| Some(name.split_once('.')?.1));
    let mut behind = behind.filter(|name| name.contains('.'));
    behind.any(|name| names.contains(name))
}

/// The classes of a text by their names in full.
#[derive(Debug, Default)]
pub(crate) struct Classes<'a> {
    /// in the order of the text
    pub list: &'a [Class],
    by_path: HashMap<&'a str, &'a Class>,
    imports: HashMap<&'a str, &'a [Import]>,
    /// last parts of the names that lead to classes
    last: HashSet<&'a str>,
    /// ordinals of the literals of enumerations, from 1
    literals: HashMap<String, i64>,
}

impl<'a> Classes<'a> {
    pub(crate) fn new(source: &str, classes: &'a [Class]) -> Self {
        let mut index = Self {
            list: classes,
            ..Self::default()
        };
        for class in classes {
            index.by_path.entry(&class.path).or_insert(class);
            index.last.insert(last(&class.path));
            let shorts = class.imports.iter().filter_map(|i| i.short.as_deref());
            index.last.extend(shorts);
            if !class.imports.is_empty() {
                index.imports.insert(&class.path, &class.imports);
            }
            for (ordinal, literal) in (1..).zip(&class.literals) {
                let literal = plain(literal.text(source));
                let name = format!("{}.{literal}", class.path);
                index.literals.insert(name, ordinal);
            }
        }
        index
    }

    /// The class that a name means in the first of some scopes that know it.
    pub(crate) fn class(&self, name: &str, scopes: &[&str]) -> Option<&'a Class> {
        if !self.last.contains(last(name)) {
            return None;
        }
        let mut candidates = self.full_names(name, scopes).into_iter();
        candidates.find_map(|full| self.by_path.get(full.as_str()).copied())
    }

    /// The ordinal of a literal of an enumeration.
    pub(crate) fn literal(&self, name: &str, scopes: &[&str]) -> Option<i64> {
        if self.literals.is_empty() || !name.contains('.') {
            return None;
        }
        let mut candidates = self.full_names(name, scopes).into_iter();
        candidates.find_map(|full| self.literals.get(&full).copied())
    }

    /// What a name may be in full, nearest first.
    pub(crate) fn full_names(&self, name: &str, scopes: &[&str]) -> Vec<String> {
        let mut found = vec![];
        let first = name.split('.').next().unwrap_or_default();
        let behind = &name[first.len()..];
        let scopes = scopes.iter().filter(|scope| !scope.is_empty());
        for path in scopes.flat_map(|scope| enclosing(scope)) {
            found.push(format!("{path}.{name}"));
            for import in self.imports.get(path).copied().unwrap_or_default() {
                match &import.short {
                    Some(short) if short == first => {
                        found.push(format!("{}{behind}", import.full));
                    }
                    None => found.push(format!("{}.{name}", import.full)),
                    _ => {}
                }
            }
        }
        found.push(name.to_owned());
        found
    }
}

fn last(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}
