//! A draft as functions of IEC 61131-3: one for each size of arrays, as an array has one size there.

use std::collections::{BTreeSet, HashMap};

use super::names::Identifiers;
use crate::Refusal;
use crate::curly::c::Precision;
use crate::curly::machine::Field;
use crate::curly::syntax::{Declaration, Expr, Function, Item, Program, Scope, Type};
use crate::names::seen;

/// Functions that the standard has not, or has with another meaning here: in the order in which they are written.
const LIBRARY: [&str; 11] = [
    "infinite",
    "undefined",
    "smaller",
    "larger",
    "floor",
    "ceil",
    "power_of_two",
    "sinh",
    "cosh",
    "tanh",
    "atan2",
];

/// The function of the library for one of the draft.
pub(super) fn library(name: &str) -> Option<&'static str> {
    LIBRARY.into_iter().find(|own| *own == name)
}

/// Writes one function after the other, those that are called first.
pub(super) struct Printer<'p> {
    pub program: &'p Program<'p>,
    pub fields: &'p [Field],
    pub sizes: &'p [(String, usize)],
    pub precision: Precision,
    /// before the names of functions and types, which all programs of a controller share
    pub prefix: &'p str,
    /// the comments before functions, by name
    about: HashMap<&'p str, &'p str>,
    made: Vec<(Instance, Made)>,
    /// the function under way
    pub here: Routine,
    /// functions of the library that are called
    pub own: BTreeSet<&'static str>,
    /// sizes of arrays, each a type: by that of their entries
    pub arrays: BTreeSet<(&'static str, usize)>,
    /// the functions
    pub text: String,
}

/// What a function is called, and what its parameters are.
#[derive(Clone, Debug, Default)]
pub(super) struct Made {
    pub name: String,
    /// without functions
    pub parameters: Vec<String>,
}

impl<'p> Printer<'p> {
    pub fn new(
        items: &'p [Item],
        program: &'p Program<'p>,
        (fields, sizes): (&'p [Field], &'p [(String, usize)]),
        (precision, prefix): (Precision, &'p str),
    ) -> Self {
        let mut printer = Self {
            program,
            fields,
            sizes,
            precision,
            prefix,
            about: HashMap::new(),
            made: vec![],
            here: Routine::none(),
            own: BTreeSet::new(),
            arrays: BTreeSet::new(),
            text: String::new(),
        };
        let mut about = "";
        for item in items {
            match item {
                Item::Comment(words) => about = words,
                Item::Function(function) => {
                    printer.about.insert(&function.name, about);
                    about = "";
                }
                _ => about = "",
            }
        }
        printer
    }

    pub fn kind(&self, kind: Type) -> &'static str {
        match kind {
            Type::Real if self.precision == Precision::F32 => "REAL",
            Type::Real | Type::Double => "LREAL",
            Type::Int => "DINT",
            _ => "BOOL",
        }
    }

    pub fn kind_of(&self, value: &Expr) -> Type {
        self.program.kind(value, &self.here.scope)
    }

    /// The type of an array.
    pub fn array(&mut self, kind: Type, size: usize) -> String {
        let kind = self.kind(kind);
        let size = size.max(1);
        self.arrays.insert((kind, size));
        array_type(self.prefix, kind, size)
    }

    /// A table is declared where it is read: functions see nothing else.
    pub fn table(&mut self, name: &str) -> Result<String, Refusal> {
        if let Some(known) = self.here.known(name) {
            return Ok(known);
        }
        let table = self.program.table(name).ok_or_else(|| lacks(name))?;
        let (list, kind) = (table.entries(), table.kind);
        let mut texts = vec![];
        let mut split = vec![];
        for (place, value) in list.iter().enumerate() {
            let text = self.bounded(value, kind)?;
            // no declaration has factors
            if text.contains('*') {
                split.push((place, text));
                texts.push("0.0".to_owned());
            } else {
                texts.push(text);
            }
        }
        let (kind, last) = (self.kind(kind), list.len().saturating_sub(1));
        let texts = texts.join(", ");
        let own = self.here.once(name, |own| {
            format!("{own} : ARRAY [0..{last}] OF {kind} := [{texts}];")
        });
        for (place, text) in split {
            self.here.first(format!("{own}[{place}] := {text};"));
        }
        Ok(own)
    }

    /// A number of a table, where an end that is nowhere is the last number there is.
    fn bounded(&mut self, value: &'p Expr, kind: Type) -> Result<String, Refusal> {
        const LAST: &str = "3.4E38";
        match value {
            value if self.is_infinite(value) => Ok(LAST.to_owned()),
            Expr::Prefix("-", inner) if self.is_infinite(inner) => Ok(format!("-{LAST}")),
            value => self.value(value, kind),
        }
    }

    fn is_infinite(&self, value: &Expr) -> bool {
        match value {
            Expr::Name(name) => name == "INFINITY",
            Expr::Real(digits) if self.precision == Precision::F32 => {
                digits.parse::<f32>().is_ok_and(f32::is_infinite)
            }
            _ => false,
        }
    }

    /// A function for arrays of some sizes, written where it is not yet.
    pub fn instance(&mut self, instance: Instance) -> Result<Made, Refusal> {
        if let Some((_, made)) = self.made.iter().find(|made| made.0 == instance) {
            return Ok(made.clone());
        }
        let function = self.program.function(&instance.function);
        let function = function.ok_or_else(|| lacks(&instance.function))?;
        let about = self.about.get(instance.function.as_str());
        let about = about.copied().unwrap_or_default();
        let others = self.made.iter();
        let others = others.filter(|made| made.0.function == instance.function);
        let name = match others.count() {
            0 => format!("{}_{}", self.prefix, function.name),
            n => format!("{}_{}_{}", self.prefix, function.name, n + 1),
        };
        let routine = Routine::new(function, name.clone(), self.identifiers());
        let outside = std::mem::replace(&mut self.here, routine);
        let made = self.written(function, about, &instance)?;
        self.here = outside;
        self.made.push((instance, made.clone()));
        Ok(made)
    }

    /// Without the names of functions and types.
    pub fn identifiers(&self) -> Identifiers {
        const TYPES: [&str; 6] = ["counts", "example", "flags", "init", "reals", "state"];
        let functions = self.program.functions();
        Identifiers::inside(self.prefix, functions.chain(LIBRARY).chain(TYPES))
    }

    fn written(
        &mut self,
        function: &'p Function,
        about: &str,
        instance: &Instance,
    ) -> Result<Made, Refusal> {
        let mut sizes = instance.sizes.iter();
        let mut fields = instance.fields.iter();
        let (mut shared, mut given) = (vec![], vec![]);
        let mut parameters = vec![];
        for parameter in &function.parameters {
            let name = self.here.called(&parameter.name);
            match (parameter.kind, parameter.is_pointer) {
                (Type::Field, _) => {
                    let field = fields.next().ok_or_else(|| lacks("a function"))?;
                    let fields = &mut self.here.fields;
                    fields.insert(parameter.name.clone(), field.clone());
                    continue;
                }
                (Type::State, _) => shared.push(format!("{name} : {}_state;", self.prefix)),
                (kind, true) => {
                    let size = *sizes.next().ok_or_else(|| lacks("an array"))?;
                    self.here.sizes.insert(parameter.name.clone(), size);
                    shared.push(format!("{name} : {};", self.array(kind, size)));
                }
                (kind, false) => given.push(format!("{name} : {};", self.kind(kind))),
            }
            parameters.push(name);
        }
        self.block(&function.body)?;
        if function.kind == Type::Void {
            let done = format!("{} := TRUE;", self.here.name);
            self.here.line(done);
        }
        let name = self.here.name.clone();
        self.text += &format!(
            "{}FUNCTION {name} : {}\n{}{}{}{}END_FUNCTION\n\n",
            comment(about),
            self.kind(function.kind),
            section("VAR_IN_OUT", &shared),
            section("VAR_INPUT", &given),
            section("VAR", &self.here.locals),
            self.here.text()
        );
        Ok(Made { name, parameters })
    }

    /// Declares a variable of the function.
    pub fn declare(&mut self, declaration: &'p Declaration) -> Result<(), Refusal> {
        let name = self.here.called(&declaration.name);
        let kind = match &declaration.size {
            None => self.kind(declaration.kind).to_owned(),
            Some(size) => {
                let size = self.constant(size).and_then(|size| size.try_into().ok());
                let size: usize = size.ok_or_else(|| lacks("an array of unknown size"))?;
                let known = self.here.sizes.insert(declaration.name.clone(), size);
                if known.is_some_and(|known| known != size) {
                    return Err(lacks("two arrays of one name"));
                }
                self.array(declaration.kind, size)
            }
        };
        let declared = format!("{name} : {kind};");
        if !self.here.locals.contains(&declared) {
            self.here.locals.push(declared);
        }
        Ok(())
    }
}

/// What the type of an array is called.
pub(super) fn array_type(prefix: &str, kind: &str, size: usize) -> String {
    let word = match kind {
        "DINT" => "counts",
        "BOOL" => "flags",
        _ => "reals",
    };
    format!("{prefix}_{word}_{size}")
}

/// A section of declarations, where there are any.
pub(super) fn section(word: &str, declarations: &[String]) -> String {
    if declarations.is_empty() {
        return String::new();
    }
    let lines = declarations.iter();
    let lines: String = lines.map(|line| format!("        {line}\n")).collect();
    format!("    {word}\n{lines}    END_VAR\n")
}

/// A comment of C, or words, as lines of comments.
pub(super) fn comment(words: &str) -> String {
    let words = words.trim_start_matches("/*").trim_end_matches("*/");
    let lines = words.lines().map(str::trim).filter(|line| !line.is_empty());
    lines
        .map(|line| format!("(* {} *)\n", plain(line)))
        .collect()
}

/// Words in a comment, whatever they hold.
pub(super) fn plain(words: &str) -> String {
    let words = seen(words);
    // a $ or a quote means nothing in a comment, its ends do
    words.replace("*)", "* )").replace("(*", "( *")
}

pub(super) fn lacks(operation: &str) -> Refusal {
    Refusal::Lacks {
        language: "Structured Text",
        operation: operation.to_owned(),
    }
}

/// A function of the draft for arrays of certain sizes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Instance {
    pub function: String,
    /// of its arrays, in the order of its parameters
    pub sizes: Vec<usize>,
    /// the functions that it is given, likewise
    pub fields: Vec<String>,
}

/// What is known of the function that is being written.
#[derive(Clone, Debug)]
pub(super) struct Routine {
    pub scope: Scope,
    /// what it is called
    pub name: String,
    /// entries of its arrays
    pub sizes: HashMap<String, usize>,
    /// the functions that it is given, by parameter
    pub fields: HashMap<String, String>,
    names: HashMap<String, String>,
    identifiers: Identifiers,
    /// declarations, without their indent
    pub locals: Vec<String>,
    /// lines before all others
    head: Vec<String>,
    /// with their indents, as all others
    lines: Vec<String>,
    depth: usize,
    /// what it returns
    pub returns: Type,
}

impl Routine {
    /// Before its first line.
    pub fn new(function: &Function, name: String, mut identifiers: Identifiers) -> Self {
        let scope = Scope::of(function);
        let names = scope.names().iter();
        let names = names.map(|name| (name.clone(), identifiers.of(name)));
        Self {
            names: names.collect(),
            scope,
            name,
            identifiers,
            depth: 1,
            returns: function.kind,
            ..Self::none()
        }
    }

    /// No function.
    pub fn none() -> Self {
        Self {
            scope: Scope::default(),
            name: String::new(),
            sizes: HashMap::new(),
            fields: HashMap::new(),
            names: HashMap::new(),
            identifiers: Identifiers::default(),
            locals: vec![],
            head: vec![],
            lines: vec![],
            depth: 0,
            returns: Type::Void,
        }
    }

    /// What a variable of the draft is called here.
    pub fn called(&self, name: &str) -> String {
        self.known(name).unwrap_or_else(|| name.to_owned())
    }

    /// A variable that the draft has not.
    pub fn fresh(&mut self, name: &str, kind: &str) -> String {
        let name = self.identifiers.of(name);
        self.locals.push(format!("{name} : {kind};"));
        name
    }

    /// A variable that the draft has not, declared where it is first asked for.
    pub fn once(&mut self, name: &str, declared: impl FnOnce(&str) -> String) -> String {
        if let Some(known) = self.known(name) {
            return known;
        }
        let own = self.identifiers.of(name);
        self.locals.push(declared(&own));
        self.names.insert(name.to_owned(), own.clone());
        own
    }

    /// What a variable is called that is the draft's, or declared once.
    pub fn known(&self, name: &str) -> Option<String> {
        self.names.get(name).cloned()
    }

    /// A line at the beginning of the function.
    pub fn first(&mut self, text: String) {
        self.head.push(indented(1, &text));
    }

    pub fn line(&mut self, text: impl AsRef<str>) {
        self.lines.push(indented(self.depth, text.as_ref()));
    }

    /// How many lines there are.
    pub fn length(&self) -> usize {
        self.lines.len()
    }

    /// The lines from one on, which are no longer there.
    pub fn take_from(&mut self, line: usize) -> Vec<String> {
        self.lines.split_off(line.min(self.lines.len()))
    }

    /// Lines that were taken.
    pub fn put_back(&mut self, lines: Vec<String>) {
        self.lines.extend(lines);
    }

    pub fn deeper(&mut self) {
        self.depth += 1;
    }

    pub fn back(&mut self) {
        self.depth = self.depth.saturating_sub(1);
    }

    pub fn is_outermost(&self) -> bool {
        self.depth == 1
    }

    /// All lines with their indents.
    pub fn text(&self) -> String {
        self.head.concat() + &self.lines.concat()
    }
}

fn indented(depth: usize, text: &str) -> String {
    format!("{:1$}{text}\n", "", 4 * depth)
}
