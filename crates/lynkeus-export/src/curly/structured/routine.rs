//! One function while it is written.

use std::collections::HashMap;

use super::names::Identifiers;
use crate::curly::syntax::{Function, Scope, Type};

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
    head: Vec<Line>,
    lines: Vec<Line>,
    depth: usize,
    /// what it returns
    pub returns: Type,
}

#[derive(Clone, Debug)]
pub(super) struct Line {
    depth: usize,
    text: String,
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
        self.head.push(Line { depth: 1, text });
    }

    pub fn line(&mut self, text: impl Into<String>) {
        let line = Line {
            depth: self.depth,
            text: text.into(),
        };
        self.lines.push(line);
    }

    /// How many lines there are.
    pub fn length(&self) -> usize {
        self.lines.len()
    }

    /// The lines from one on, which are no longer there.
    pub fn take_from(&mut self, line: usize) -> Vec<Line> {
        self.lines.split_off(line.min(self.lines.len()))
    }

    /// Lines that were taken.
    pub fn put_back(&mut self, lines: Vec<Line>) {
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
        let lines = self.head.iter().chain(&self.lines);
        let lines = lines.map(|line| format!("{:1$}{2}\n", "", 4 * line.depth, line.text));
        lines.collect()
    }
}
