//! What names mean in a draft.

use std::collections::HashMap;

use super::{
    Declaration, Expr, Function, If, Item, Line, Operator, Otherwise, Parameter, Statement, Type,
    Value,
};
use crate::curly::machine::Field;

/// What is known wherever a function stands.
#[derive(Clone, Debug)]
pub(in crate::curly) struct Program<'p> {
    fields: &'p [Field],
    functions: HashMap<&'p str, &'p Function>,
    tables: HashMap<&'p str, &'p Declaration>,
    alias: &'p [Parameter],
    /// functions that change the state
    changers: Vec<&'p str>,
}

/// A variable of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::curly) struct Variable {
    pub kind: Type,
    /// an array, or the state, that is somebody else's
    pub is_pointer: bool,
}

impl<'p> Program<'p> {
    /// Functions stand after those that they call.
    pub fn of(items: &'p [Item], fields: &'p [Field]) -> Self {
        let mut program = Self {
            fields,
            functions: HashMap::new(),
            tables: HashMap::new(),
            alias: &[],
            changers: vec![],
        };
        for item in items {
            match item {
                Item::Function(function) => {
                    if program.changes_state(function) {
                        program.changers.push(&function.name);
                    }
                    program.functions.insert(&function.name, function);
                }
                Item::Table(table) => {
                    program.tables.insert(&table.name, table);
                }
                Item::Alias(parameters) => program.alias = parameters,
                Item::Blank | Item::Comment(_) => {}
            }
        }
        program
    }

    /// Whether there is a table of this name, written in capitals.
    pub fn has_table(&self, name: &str) -> bool {
        let mut tables = self.tables.keys();
        tables.any(|table| table.to_ascii_uppercase() == name)
    }

    pub fn table(&self, name: &str) -> Option<&'p Declaration> {
        self.tables.get(name).copied()
    }

    pub fn function(&self, name: &str) -> Option<&'p Function> {
        self.functions.get(name).copied()
    }

    /// The names of the functions, in no order.
    pub fn functions(&self) -> impl Iterator<Item = &'p str> {
        self.functions.keys().copied()
    }

    /// What a call takes; empty for functions of the language's library.
    pub fn parameters(&self, function: &str, scope: &Scope) -> &'p [Parameter] {
        match self.functions.get(function) {
            Some(function) => &function.parameters,
            None if scope.kind(function) == Some(Type::Field) => self.alias,
            None => &[],
        }
    }

    /// Whether a function is none of the draft.
    pub fn is_foreign(&self, function: &str) -> bool {
        !self.functions.contains_key(function)
    }

    /// Whether a function changes the state that it is given.
    pub fn is_changer(&self, function: &str) -> bool {
        self.changers.contains(&function)
    }

    /// The type of a value, or of the entries of an array.
    pub fn kind(&self, value: &Expr, scope: &Scope) -> Type {
        match value {
            Expr::Name(name) => {
                let own = scope.kind(name);
                let own = own.or_else(|| self.table(name).map(|table| table.kind));
                own.unwrap_or(match name.as_str() {
                    "NAN" | "INFINITY" | "EPSILON" | "SMALLEST" | "RANK" => Type::Real,
                    // sizes and codes
                    _ => Type::Int,
                })
            }
            Expr::Real(_) => Type::Real,
            Expr::Number(digits) => match digits.contains(['.', 'e']) {
                true => Type::Double,
                false => Type::Int,
            },
            Expr::Part(name) => {
                let field = self.fields.iter().find(|field| field.name == name);
                field.map_or(Type::Real, |field| field.kind)
            }
            Expr::Index(array, _) => self.kind(array, scope),
            Expr::Call(name, _) => match (name.as_str(), self.functions.get(name.as_str())) {
                (_, Some(function)) => function.kind,
                ("isfinite" | "isnan" | "signbit", _) => Type::Truth,
                ("ceil", _) => Type::Double,
                _ => Type::Real,
            },
            Expr::Cast(kind, _) => *kind,
            Expr::Prefix("!", _) => Type::Truth,
            Expr::Prefix(_, inner) | Expr::Group(inner) => self.kind(inner, scope),
            Expr::Binary(operator, left, _) => match operator.level() {
                ..5 => Type::Truth,
                _ => self.kind(left, scope),
            },
            Expr::Choice(_, then, _) => self.kind(then, scope),
        }
    }

    fn changes_state(&self, function: &Function) -> bool {
        let has_state = function.parameters.iter().any(|p| p.kind == Type::State);
        has_state
            && any(&function.body, &mut |statement| {
                let is_target = match statement {
                    Statement::Assign { target, .. } | Statement::Count { target, .. } => {
                        is_of_state(target)
                    }
                    _ => false,
                };
                is_target
                    || values(statement)
                        .iter()
                        .any(|value| self.hands_state_out(value))
            })
    }

    /// Whether a call in a value may change the state.
    fn hands_state_out(&self, value: &Expr) -> bool {
        let mut does = false;
        visit(value, &mut |inner| {
            if let Expr::Call(name, arguments) = inner {
                does |= self.is_changer(name);
                let parameters = self.functions.get(name.as_str());
                let parameters = parameters.map_or(&[][..], |function| &function.parameters);
                let mut pairs = parameters.iter().zip(arguments);
                does |= pairs.any(|(parameter, argument)| {
                    parameter.is_pointer
                        && !parameter.is_const
                        && is_of_state(argument)
                        && parameter.kind != Type::State
                });
            }
        });
        does
    }
}

/// The variables of one function.
#[derive(Clone, Debug, Default)]
pub(in crate::curly) struct Scope {
    variables: HashMap<String, Variable>,
    /// in the order of their declaration
    names: Vec<String>,
}

impl Scope {
    pub fn of(function: &Function) -> Self {
        let mut scope = Self::default();
        for parameter in &function.parameters {
            scope.add(&parameter.name, parameter.kind, parameter.is_pointer);
        }
        let _ = any(&function.body, &mut |statement| {
            match statement {
                Statement::Declare(own)
                | Statement::For {
                    start: Some(own), ..
                } => scope.add(&own.name, own.kind, false),
                _ => {}
            }
            false
        });
        scope
    }

    fn add(&mut self, name: &str, kind: Type, is_pointer: bool) {
        let known = self
            .variables
            .insert(name.to_owned(), Variable { kind, is_pointer });
        if known.is_none() {
            self.names.push(name.to_owned());
        }
    }

    pub fn variable(&self, name: &str) -> Option<Variable> {
        self.variables.get(name).copied()
    }

    fn kind(&self, name: &str) -> Option<Type> {
        self.variable(name).map(|variable| variable.kind)
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }
}

/// Whether a value is the state or a part of it.
fn is_of_state(value: &Expr) -> bool {
    match value {
        Expr::Part(_) => true,
        Expr::Name(name) => name == "s",
        Expr::Index(array, _) => is_of_state(array),
        _ => false,
    }
}

/// Whether a value reads the state.
pub(in crate::curly) fn reads_state(value: &Expr) -> bool {
    let mut does = false;
    visit(value, &mut |inner| does |= matches!(inner, Expr::Part(_)));
    does
}

/// Whether a statement satisfies a condition; all that come before are looked at.
pub(in crate::curly) fn any<'l>(
    lines: &'l [Line],
    condition: &mut impl FnMut(&'l Statement) -> bool,
) -> bool {
    lines.iter().any(|line| {
        let statement = &line.statement;
        condition(statement)
            || match statement {
                Statement::If(conditional) => any_branch(conditional, condition),
                Statement::For { body, step, .. } => condition(step) || any(body, condition),
                Statement::While { body, .. } => any(body, condition),
                _ => false,
            }
    })
}

fn any_branch<'l>(conditional: &'l If, condition: &mut impl FnMut(&'l Statement) -> bool) -> bool {
    any(&conditional.then, condition)
        || match &conditional.otherwise {
            Otherwise::Nothing => false,
            Otherwise::If(other) => any_branch(other, condition),
            Otherwise::Block(lines) => any(lines, condition),
        }
}

/// The values in a statement itself, without what stands in its blocks.
pub(in crate::curly) fn values(statement: &Statement) -> Vec<&Expr> {
    match statement {
        Statement::Declare(declaration) => declared(declaration),
        Statement::Assign { target, value, .. } => vec![target, value],
        Statement::Count { target, .. } => vec![target],
        Statement::Call(value) | Statement::Return(value) => vec![value],
        Statement::If(conditional) => conditions(conditional),
        Statement::For {
            start, condition, ..
        } => {
            let mut found = start.as_ref().map_or(vec![], declared);
            found.push(condition);
            found
        }
        Statement::While { condition, .. } => vec![condition],
        Statement::Comment(_) | Statement::Unused(_) | Statement::Continue => vec![],
    }
}

fn conditions(conditional: &If) -> Vec<&Expr> {
    let mut found = vec![&conditional.condition];
    if let Otherwise::If(other) = &conditional.otherwise {
        found.extend(conditions(other));
    }
    found
}

fn declared(declaration: &Declaration) -> Vec<&Expr> {
    let mut found: Vec<&Expr> = declaration.size.iter().collect();
    match &declaration.value {
        Value::None => {}
        Value::One(value) => found.push(value),
        Value::List(list) => found.extend(list),
    }
    found
}

/// A value and everything in it.
pub(in crate::curly) fn visit<'e>(value: &'e Expr, look: &mut impl FnMut(&'e Expr)) {
    look(value);
    match value {
        Expr::Name(_) | Expr::Real(_) | Expr::Number(_) | Expr::Part(_) => {}
        Expr::Index(left, right) | Expr::Binary(_, left, right) => {
            visit(left, look);
            visit(right, look);
        }
        Expr::Call(_, arguments) => arguments.iter().for_each(|argument| visit(argument, look)),
        Expr::Cast(_, inner) | Expr::Prefix(_, inner) | Expr::Group(inner) => visit(inner, look),
        Expr::Choice(condition, then, otherwise) => {
            visit(condition, look);
            visit(then, look);
            visit(otherwise, look);
        }
    }
}

/// A loop over places, one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::curly) struct Range<'l> {
    pub name: &'l str,
    pub from: &'l Expr,
    /// the last condition that holds
    pub to: &'l Expr,
    /// whether `to` is one of the places
    pub is_inclusive: bool,
    pub is_up: bool,
    /// a condition that ends the loop where it does not hold
    pub only: Option<&'l Expr>,
}

impl<'l> Range<'l> {
    /// Of the parts of a `for`.
    pub fn of(
        start: Option<&'l Declaration>,
        condition: &'l Expr,
        step: &Statement,
    ) -> Option<Self> {
        let start = start?;
        let Value::One(from) = &start.value else {
            return None;
        };
        let (condition, only) = match condition {
            Expr::Binary(Operator::And, first, rest) => (&**first, Some(&**rest)),
            other => (other, None),
        };
        let Expr::Binary(operator, left, to) = condition else {
            return None;
        };
        let is = |value: &Expr| matches!(value, Expr::Name(name) if *name == start.name);
        let is_up = match step {
            Statement::Count { target, is_up } if is(target) && is(left) => *is_up,
            _ => return None,
        };
        let is_inclusive = match (operator, is_up) {
            (Operator::Less, true) => false,
            (Operator::LessEq, true) | (Operator::GreaterEq, false) => true,
            _ => return None,
        };
        Some(Self {
            name: &start.name,
            from,
            to,
            is_inclusive,
            is_up,
            only,
        })
    }
}
