//! A text of classes to the one flat model that is meant: types, records and base classes are
//! written out; components of other models are refused, with the commands that flatten them.

mod classes;
mod constants;
mod library;
mod members;

use std::collections::{HashMap, HashSet};

use crate::limits::{MAX_SCALARS, grouped};

pub(crate) use classes::Classes;
pub(crate) use constants::label as constant_label;
pub(crate) use library::{LibraryType, constant};

use crate::syntax::ast::{
    Ast, Attribute, Class, ClassKind, Declaration, Equation, ExprId, Kind, Statement, TypeName,
    Variability,
};
use crate::syntax::{Problem, Result, Span, plain};

/// What to do with a model that has connectors or components.
pub(crate) const HOW_TO_FLATTEN: &str = "flatten it first: `omc -f -i=MODEL FILE.mo > flat.mo` \
     (OpenModelica), or `python -c 'import rumoca; print(rumoca.Session().load(\"FILE.mo\", \
     model=\"MODEL\").render(\"base-modelica\"))' > flat.mo`";

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
    /// of declarations, by label: what the library's type says of them
    pub library: HashMap<String, &'static LibraryType>,
    /// names of the members of each record, by its label
    pub records: HashMap<String, Vec<String>>,
    /// labels of constants that the text may not mean
    pub possible: HashSet<String>,
    pub equations: Vec<Equation>,
    pub initial: Vec<Equation>,
    pub algorithms: Vec<Vec<Statement>>,
}

/// The flat model of a class.
pub(crate) fn flat_model(source: &str, ast: &mut Ast, place: usize) -> Result<FlatModel> {
    let classes = std::mem::take(&mut ast.classes);
    let index = Classes::new(source, &classes);
    let mut flattening = Flattening {
        source,
        classes: &classes,
        index: &index,
        ast,
        model: FlatModel::default(),
        declared: HashSet::new(),
        depth: 0,
    };
    let done = flattening.whole(place);
    let model = flattening.model;
    drop(index);
    ast.classes = classes;
    done.map(|()| model)
}

struct Flattening<'a> {
    source: &'a str,
    classes: &'a [Class],
    index: &'a Classes<'a>,
    ast: &'a mut Ast,
    model: FlatModel,
    /// labels of the declarations so far
    declared: HashSet<String>,
    /// records around the one that is written out
    depth: usize,
}

impl<'a> Flattening<'a> {
    fn whole(&mut self, place: usize) -> Result<()> {
        let Some(class) = self.classes.get(place) else {
            return Ok(());
        };
        self.model.name = class.name;
        self.model.title = title(&class.path).to_owned();
        let own = |declaration: &Declaration| declaration.label.clone();
        self.declared = class.declarations.iter().map(own).collect();
        self.constants()?;
        self.contents(class, &[], &mut vec![])?;
        elements_by_themselves(self.source, self.ast, &mut self.model.declarations);
        Ok(())
    }

    /// Declarations and equations of a class, those of its bases first.
    fn contents(
        &mut self,
        class: &Class,
        modification: &[Attribute],
        above: &mut Vec<String>,
    ) -> Result<()> {
        if above.contains(&class.path) || self.model.scopes.len() > MAX_BASES {
            let message = format!("`{}` is made from itself", class.path);
            return Err(Problem::new(class.name, message).hint("remove the `extends`"));
        }
        above.push(class.path.clone());
        self.model.scopes.push(class.path.clone());
        for base in &class.bases {
            let found = self.base(class, base.name)?;
            let both: Vec<Attribute> = modification
                .iter()
                .chain(&base.modification)
                .cloned()
                .collect();
            self.contents(found, &both, above)?;
        }
        for declaration in &class.declarations {
            let mut declaration = declaration.clone();
            members::modify(self.source, &mut declaration, modification);
            self.declaration(declaration, &class.path)?;
        }
        self.model.equations.extend(class.equations.iter().cloned());
        self.model.initial.extend(class.initial.iter().cloned());
        self.model
            .algorithms
            .extend(class.algorithms.iter().cloned());
        above.pop();
        Ok(())
    }

    fn base(&self, class: &Class, name: Span) -> Result<&'a Class> {
        let classes = self.classes;
        let text = plain(name.text(self.source));
        let found = self.index.class(&text, &[&class.path]);
        match found.and_then(|place| classes.get(place)) {
            Some(found) if found.kind != ClassKind::Function => Ok(found),
            _ => {
                let message = format!("the model is not flat: `extends {text}` of another file");
                Err(Problem::new(name, message).hint(HOW_TO_FLATTEN))
            }
        }
    }

    /// A declaration of numbers as it is, one of a record as those of its members.
    fn declaration(&mut self, mut declaration: Declaration, path: &str) -> Result<()> {
        if let Some(span) = declaration.prefix.of_connector {
            return Err(
                Problem::new(span, "the model is not flat: it has a connector variable")
                    .hint(HOW_TO_FLATTEN),
            );
        }
        let mut path = path.to_owned();
        for _ in 0..MAX_BASES {
            let TypeName::Named(name) = declaration.prefix.type_name else {
                return self.scalar_or_array(declaration);
            };
            let text = plain(name.text(self.source));
            let Some(place) = self.index.class(&text, &[&path]) else {
                return self.of_library(declaration, &text, name, &path);
            };
            let classes = self.classes;
            let class = &classes[place];
            match (class.kind, &class.alias) {
                (_, Some(alias)) => {
                    declaration.prefix.type_name = alias.of;
                    declaration.dimensions.extend(&alias.dimensions);
                    members::inherit(
                        self.source,
                        &mut declaration.attributes,
                        &alias.modification,
                    );
                    path = class
                        .path
                        .rsplit_once('.')
                        .map_or("", |(above, _)| above)
                        .to_owned();
                }
                (ClassKind::Type, None) if !class.literals.is_empty() => {
                    declaration.prefix.type_name = TypeName::Integer;
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
        Err(Problem::new(
            declaration.name,
            "the type of this variable is made from itself",
        ))
    }

    fn of_library(
        &mut self,
        mut declaration: Declaration,
        text: &str,
        name: Span,
        path: &str,
    ) -> Result<()> {
        let full = self.index.full_names(text, &[path]);
        if let Some(found) = full.iter().find_map(|full| library::type_named(full)) {
            declaration.prefix.type_name = TypeName::Real;
            self.model.library.insert(declaration.label.clone(), found);
            return self.scalar_or_array(declaration);
        }
        if matches!(text, "StateSelect" | "AssertionLevel") {
            declaration.prefix.type_name = TypeName::String;
            return self.scalar_or_array(declaration);
        }
        let shown = crate::syntax::shortened(text);
        let library = full.iter().any(|full| full.starts_with("Modelica."));
        let message = match library {
            true => format!("the library type `{shown}` is not known here"),
            false => format!("unknown type `{shown}`"),
        };
        let hint = match library {
            true => "write `Real` with `unit = \"…\"`; a component of the library makes a model \
                     that is not flat: "
                .to_owned(),
            false => "components of other models are not supported: ".to_owned(),
        };
        Err(Problem::new(name, message).hint(hint + HOW_TO_FLATTEN))
    }

    fn scalar_or_array(&mut self, declaration: Declaration) -> Result<()> {
        if declaration.prefix.type_name == TypeName::String {
            // a text takes no part in equations, nor does a choice of the library
            return match declaration.prefix.variability {
                Variability::Continuous => Err(Problem::new(
                    declaration.name,
                    "String variables are not supported",
                )
                .hint("remove it")),
                _ => Ok(()),
            };
        }
        members::check_attributes(self.source, &declaration.attributes)?;
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
    match path.split_once('.') {
        Some((package, model)) if package == model => model,
        Some(_) => {
            let half = path.len() / 2;
            let (package, model) = (path.get(..half), path.get(half + 1..));
            match (package, model) {
                (Some(package), Some(model)) if package == model => model,
                _ => path,
            }
        }
        None => path,
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
        let repeated = count
            .get(&declaration.label)
            .is_some_and(|&count| count > 1);
        if !repeated || dimensions.is_empty() || !dimensions.iter().all(literal) {
            continue;
        }
        let subscripts = dimensions
            .iter()
            .map(|id| ast.expression(*id).span.text(source));
        let subscripts: Vec<&str> = subscripts.collect();
        declaration.label = format!("{}[{}]", declaration.label, subscripts.join(","));
        declaration.dimensions.clear();
    }
}
