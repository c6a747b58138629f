//! Calls in Structured Text: arguments have names, but for the standard's own functions.

use super::bound::{ATOM, Bound};
use super::print::{Printer, lacks};
use super::routine::Instance;
use crate::Refusal;
use crate::curly::syntax::{Expr, Operator, Parameter, Type};

/// Functions of the standard, with their names in C.
const STANDARD: [(&str, &str); 11] = [
    ("acos", "ACOS"),
    ("asin", "ASIN"),
    ("atan", "ATAN"),
    ("cos", "COS"),
    ("exp", "EXP"),
    ("fabs", "ABS"),
    ("log", "LN"),
    ("pow", "EXPT"),
    ("sin", "SIN"),
    ("sqrt", "SQRT"),
    ("tan", "TAN"),
];

/// What is given and beyond it counts as missing. So no infinity has to be made to say that something is, at which
/// there are controllers that stop.
const FINITE: &str = "1.0E38";

impl<'p> Printer<'p> {
    /// A call of the library.
    pub fn own(&mut self, name: &'static str, arguments: &str) -> Bound {
        self.own.insert(name);
        Bound::atom(format!("{}_{name}({arguments})", self.prefix))
    }

    pub fn call(&mut self, name: &'p str, arguments: &'p [Expr]) -> Result<Bound, Refusal> {
        let parameters = self.program.parameters(name, &self.here.scope);
        if !parameters.is_empty() {
            return self.drafted(name, parameters, arguments);
        }
        let mut values = vec![];
        for argument in arguments {
            let kind = self.kind_of(argument);
            values.push(self.bound(argument, kind)?);
        }
        if let ("isfinite" | "isnan", [argument]) = (name, arguments) {
            let value = values.pop().ok_or_else(|| lacks(name))?;
            return Ok(match name {
                "isnan" => differs(value),
                _ if is_given(argument) => Bound::infix(
                    &format!("ABS({})", value.text),
                    "<",
                    FINITE,
                    Operator::Less.level(),
                ),
                _ => is_finite(value),
            });
        }
        let texts: Vec<String> = values.into_iter().map(|value| value.text).collect();
        let typed = || {
            let pairs = arguments.iter().zip(&texts);
            let texts = pairs.map(|(argument, text)| self.typed(argument, text));
            texts.collect::<Vec<_>>().join(", ")
        };
        if let Some((_, standard)) = STANDARD.iter().find(|known| known.0 == name) {
            return Ok(Bound::atom(format!("{standard}({})", typed())));
        }
        match (super::library(name), &texts[..]) {
            (Some(own), [a]) => Ok(self.own(own, &format!("a := {a}"))),
            (Some(own), [a, b]) => Ok(self.own(own, &format!("a := {a}, b := {b}"))),
            _ => Err(lacks(name)),
        }
    }

    /// An argument of the standard's functions, which take numbers of any type: a literal says which one it is, as
    /// there are compilers that take it for the smaller one.
    fn typed(&self, argument: &Expr, text: &str) -> String {
        let kind = self.kind(self.kind_of(argument));
        match argument {
            Expr::Group(inner) => self.typed(inner, text),
            Expr::Real(_) | Expr::Number(_) => format!("{kind}#{text}"),
            Expr::Prefix("-", inner) if matches!(**inner, Expr::Real(_)) => {
                format!("-{kind}#{}", text.trim_start_matches('-'))
            }
            _ => text.to_owned(),
        }
    }

    /// A call of a function of the draft.
    fn drafted(
        &mut self,
        name: &'p str,
        parameters: &'p [Parameter],
        arguments: &'p [Expr],
    ) -> Result<Bound, Refusal> {
        let mut instance = Instance {
            function: match self.here.fields.get(name) {
                Some(given) => given.clone(),
                None => name.to_owned(),
            },
            ..Instance::default()
        };
        let mut values = vec![];
        for (parameter, argument) in parameters.iter().zip(arguments) {
            match (parameter.kind, parameter.is_pointer) {
                (Type::Field, _) => instance.fields.push(self.handed(argument)?),
                (Type::State, _) => values.push(self.here.called("s")),
                (_, true) => {
                    instance.sizes.push(self.size_of(argument)?);
                    values.push(self.value(argument, parameter.kind)?);
                }
                (kind, false) => values.push(self.value(argument, kind)?),
            }
        }
        let made = self.instance(instance)?;
        let pairs = made.parameters.iter().zip(values);
        let texts: Vec<String> = pairs
            .map(|(name, text)| format!("{name} := {text}"))
            .collect();
        Ok(Bound::atom(format!("{}({})", made.name, texts.join(", "))))
    }

    /// A function as an argument.
    fn handed(&self, argument: &Expr) -> Result<String, Refusal> {
        match argument {
            Expr::Name(name) => Ok(self.here.fields.get(name).unwrap_or(name).clone()),
            _ => Err(lacks("a function that is chosen while it runs")),
        }
    }
}

/// Whether a value is what the block was given, rather than computed: the runtime's names for that.
fn is_given(value: &Expr) -> bool {
    match value {
        Expr::Name(name) | Expr::Part(name) => {
            ["reading", "readings", "signals"].contains(&name.as_str())
        }
        Expr::Index(array, _) | Expr::Group(array) => is_given(array),
        _ => false,
    }
}

/// Only what is no number is not itself.
fn differs(value: Bound) -> Bound {
    let value = value.at_least(ATOM);
    Bound::infix(&value, "<>", &value, Operator::Equal.level())
}

/// Only a finite number less itself is nothing. A controller that stops at an infinity has stopped where it arose.
fn is_finite(value: Bound) -> Bound {
    let value = value.at_least(ATOM);
    let nothing = format!("{value} - {value}");
    Bound::infix(&nothing, "=", "0.0", Operator::Equal.level())
}
