//! Values of a draft as Structured Text. What C evaluates only under a condition becomes a variable, which is set
//! in the lines before. Arguments have names, but for the standard's own functions.

use super::print::{Instance, Printer, lacks, library};
use crate::Refusal;
use crate::curly::c::Precision;
use crate::curly::device::number_of;
use crate::curly::syntax::{ATOM, Bound, Expr, Operator, Parameter, SIGN, Type, visit};

impl<'p> Printer<'p> {
    /// A value where one of a type is wanted.
    pub fn value(&mut self, value: &'p Expr, wanted: Type) -> Result<String, Refusal> {
        Ok(self.bound(value, wanted)?.text)
    }

    /// The opposite of a condition.
    pub fn negated(&mut self, value: &'p Expr) -> Result<String, Refusal> {
        let value = self.bound(value, Type::Truth)?;
        Ok(format!("NOT {}", value.at_least(ATOM)))
    }

    pub fn bound(&mut self, value: &'p Expr, wanted: Type) -> Result<Bound, Refusal> {
        if let (Some(number), true) = (self.constant(value), wanted != Type::Truth) {
            return Ok(Bound {
                text: number.to_string(),
                level: if number < 0 { SIGN } else { ATOM },
            });
        }
        Ok(match value {
            Expr::Group(inner) => self.bound(inner, wanted)?,
            Expr::Number(digits) if wanted == Type::Truth => match digits.as_str() {
                "0" => Bound::atom("FALSE"),
                _ => Bound::atom("TRUE"),
            },
            Expr::Number(digits) => literal(digits),
            Expr::Real(digits) => self.real(digits),
            Expr::Name(name) => self.named(name)?,
            Expr::Part(name) => Bound::atom(format!("{}.{}", self.here.called("s"), part(name))),
            Expr::Index(array, place) => {
                let array = self.bound(array, wanted)?.text;
                Bound::atom(format!("{array}[{}]", self.value(place, Type::Int)?))
            }
            Expr::Call(name, arguments) => self.call(name, arguments)?,
            Expr::Cast(kind, inner) => self.cast(*kind, inner)?,
            Expr::Prefix("-", inner) => Bound {
                text: format!("-{}", self.bound(inner, wanted)?.at_least(ATOM)),
                level: SIGN,
            },
            Expr::Prefix("!", inner) => Bound {
                text: self.negated(inner)?,
                level: SIGN,
            },
            Expr::Prefix(..) => return Err(lacks("the address of a variable")),
            Expr::Binary(operator, left, right) => self.binary(*operator, left, right)?,
            Expr::Choice(condition, then, otherwise) => {
                if wanted == Type::Truth && is(then, "1") && is(otherwise, "0") {
                    return self.bound(condition, Type::Truth);
                }
                let chosen = self.here.fresh("chosen", self.kind(wanted));
                self.choose(condition, then, otherwise, &|value| {
                    (format!("{chosen} := {value};"), wanted)
                })?;
                Bound::atom(chosen)
            }
        })
    }

    /// What is known before anything runs.
    pub fn constant(&self, value: &Expr) -> Option<i64> {
        match value {
            Expr::Number(digits) => digits.parse().ok(),
            Expr::Name(name) if self.here.scope.variable(name).is_none() => {
                let size = self.sizes.iter().find(|size| size.0 == *name)?;
                i64::try_from(size.1).ok()
            }
            Expr::Group(inner) => self.constant(inner),
            Expr::Binary(operator, left, right) => {
                let (left, right) = (self.constant(left)?, self.constant(right)?);
                match operator {
                    Operator::Add => left.checked_add(right),
                    Operator::Sub => left.checked_sub(right),
                    Operator::Mul => left.checked_mul(right),
                    _ => None,
                }
            }
            _ => None,
        }
    }

    /// Entries of an array.
    pub fn size_of(&self, array: &Expr) -> Result<usize, Refusal> {
        let size = match array {
            Expr::Name(name) => match self.here.sizes.get(name) {
                Some(size) => Some(*size),
                None => self.program.table(name).map(|table| table.entries().len()),
            },
            Expr::Part(name) => {
                let field = self.fields.iter().find(|field| field.name == name);
                field.and_then(|field| field.count)
            }
            _ => None,
        };
        size.ok_or_else(|| lacks("an array of unknown size"))
    }

    fn named(&mut self, name: &str) -> Result<Bound, Refusal> {
        if self.here.scope.variable(name).is_some() {
            return Ok(Bound::atom(self.here.called(name)));
        }
        if let Some(number) = number_of(name) {
            return Ok(Bound::atom(format!("{number} (* {name} *)")));
        }
        let is_single = self.precision == Precision::F32;
        Ok(match (name, is_single) {
            ("NAN", _) => self.own("undefined", "a := 0.0"),
            ("INFINITY", _) => self.own("infinite", "a := 1.0"),
            ("EPSILON", false) => literal("2.220446049250313e-16"),
            ("EPSILON", true) => literal("1.1920929e-7"),
            ("SMALLEST", false) => literal("2.2250738585072014e-308"),
            ("SMALLEST", true) => literal("1.1754944e-38"),
            ("RANK", false) => literal("1e-13"),
            ("RANK", true) => literal("1e-6"),
            _ => Bound::atom(self.table(name)?),
        })
    }

    /// A number in the precision of the export.
    fn real(&mut self, digits: &str) -> Bound {
        match (self.precision, digits.parse::<f64>()) {
            (Precision::F32, Ok(value)) if (value as f32).is_infinite() => {
                self.own("infinite", "a := 1.0")
            }
            (Precision::F32, Ok(value)) => literal(&format!("{:?}", value as f32)),
            _ => literal(digits),
        }
    }

    fn cast(&mut self, kind: Type, inner: &'p Expr) -> Result<Bound, Refusal> {
        let of = self.kind_of(inner);
        let value = self.bound(inner, of)?;
        let (from, to) = (self.kind(of), self.kind(kind));
        Ok(match (from, to) {
            _ if from == to => value,
            ("LREAL" | "REAL", "DINT") => Bound::atom(format!("TRUNC({})", value.text)),
            ("BOOL", _) => return Err(lacks("a number of a truth")),
            _ => Bound::atom(format!("{from}_TO_{to}({})", value.text)),
        })
    }

    fn binary(
        &mut self,
        operator: Operator,
        left: &'p Expr,
        right: &'p Expr,
    ) -> Result<Bound, Refusal> {
        let is_truth = self.kind_of(left) == Type::Truth;
        let sign = match operator {
            Operator::And | Operator::Or => {
                if self.is_guarded(left, right) {
                    return self.in_turn(operator, left, right);
                }
                if operator == Operator::And {
                    "AND"
                } else {
                    "OR"
                }
            }
            Operator::Unequal if is_truth && is(right, "0") => {
                return self.bound(left, Type::Truth);
            }
            Operator::Equal => "=",
            Operator::Unequal => "<>",
            Operator::ShiftRight if is(right, "1") => {
                let left = self.bound(left, Type::Int)?;
                let level = Operator::Div.level();
                return Ok(Bound::infix(&left.at_least(level), "/", "2", level));
            }
            Operator::ShiftRight => return Err(lacks("a shift by more than one place")),
            other => other.sign(),
        };
        if operator == Operator::Add && self.constant(left) == Some(0) {
            return self.bound(right, Type::Int);
        }
        let level = operator.level();
        let wanted = match operator {
            Operator::And | Operator::Or => Type::Truth,
            _ => self.kind_of(left),
        };
        // relations do not chain, and a sign stands first or in parentheses
        let is_relation = (Operator::Equal.level()..Operator::ShiftRight.level()).contains(&level);
        let least = match operator {
            // AND in OR is told by parentheses
            Operator::Or => level + 2,
            _ if is_relation => Operator::Add.level(),
            _ => level,
        };
        let left = self.bound(left, wanted)?;
        let left = match operator {
            Operator::Or if left.level == level => left.text,
            _ => left.at_least(least),
        };
        let right = self.bound(right, wanted)?;
        let right = after_a_sign(right, least.max(level + 1));
        Ok(Bound::infix(&left, sign, &right, level))
    }

    /// What stands at the right of an operation.
    pub fn operand(
        &mut self,
        value: &'p Expr,
        operator: Operator,
        kind: Type,
    ) -> Result<String, Refusal> {
        let value = self.bound(value, kind)?;
        Ok(after_a_sign(value, operator.level() + 1))
    }

    /// The place before one.
    pub fn before(&mut self, place: &'p Expr) -> Result<String, Refusal> {
        let place = self.bound(place, Type::Int)?;
        Ok(format!("{} - 1", place.at_least(Operator::Sub.level())))
    }

    /// Whether a condition needs no lines before it.
    pub fn is_simple(&self, condition: &Expr) -> bool {
        let mut is_simple = true;
        visit(condition, &mut |inner| match inner {
            Expr::Choice(..) => is_simple = false,
            Expr::Binary(Operator::And | Operator::Or, first, second) => {
                is_simple &= !self.is_guarded(first, second);
            }
            _ => {}
        });
        is_simple
    }

    /// Whether the second of two conditions may only be looked at where the first one allows it: it takes a value
    /// from a place that the first one limits, or calls what may have no value.
    fn is_guarded(&self, first: &Expr, second: &Expr) -> bool {
        let mut limited = vec![];
        visit(first, &mut |inner| {
            if let Expr::Binary(operator, left, _) = inner
                && operator.level() < Operator::ShiftRight.level()
                && self.kind_of(left) == Type::Int
            {
                visit(left, &mut |name| limited.extend(variable(name)));
            }
        });
        let mut is_guarded = false;
        visit(second, &mut |inner| match inner {
            Expr::Index(_, place) => visit(place, &mut |name| {
                is_guarded |= variable(name).is_some_and(|name| limited.contains(&name));
            }),
            Expr::Call(name, _) => {
                is_guarded |= !["fabs", "isfinite", "isnan"].contains(&name.as_str());
            }
            Expr::Choice(..) => is_guarded = true,
            _ => {}
        });
        is_guarded
    }

    /// Two conditions, the second one only where it decides.
    fn in_turn(
        &mut self,
        operator: Operator,
        first: &'p Expr,
        second: &'p Expr,
    ) -> Result<Bound, Refusal> {
        let holds = self.here.fresh("holds", "BOOL");
        let value = self.value(first, Type::Truth)?;
        self.here.line(format!("{holds} := {value};"));
        let not = if operator == Operator::And {
            ""
        } else {
            "NOT "
        };
        self.here.line(format!("IF {not}{holds} THEN"));
        self.here.deeper();
        let value = self.value(second, Type::Truth)?;
        self.here.line(format!("{holds} := {value};"));
        self.here.back();
        self.here.line("END_IF;");
        Ok(Bound::atom(holds))
    }
}

/// What a part of the state is called.
pub(super) fn part(name: &str) -> &str {
    if name == "time" { "instant" } else { name }
}

fn variable(value: &Expr) -> Option<&str> {
    match value {
        Expr::Name(name) => Some(name),
        _ => None,
    }
}

fn is(value: &Expr, digits: &str) -> bool {
    matches!(value, Expr::Number(number) if number == digits)
}

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
        match (library(name), &texts[..]) {
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

/// What follows a sign has none of its own, but in parentheses.
fn after_a_sign(value: Bound, level: u8) -> String {
    match value.text.starts_with('-') {
        true => format!("({})", value.text),
        false => value.at_least(level),
    }
}

/// A number as the standard writes it: with a point. Factors take the place of exponents that `REAL` has not:
/// there are compilers that refuse them in `LREAL`, too.
pub(super) fn literal(digits: &str) -> Bound {
    const MOST: i32 = 30;
    let (mantissa, exponent) = match digits.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse().unwrap_or(0)),
        None => (digits, 0),
    };
    let mut rest: i32 = exponent;
    let mut factors = vec![];
    while rest.abs() > MOST + 6 {
        let part = MOST * rest.signum();
        factors.push(written("1", part));
        rest -= part;
    }
    let first = written(mantissa, rest);
    match factors.is_empty() {
        true => Bound::atom(first),
        false => Bound {
            text: format!("{first} * {}", factors.join(" * ")),
            level: Operator::Mul.level(),
        },
    }
}

/// A number in a declaration, which has no factors.
pub(super) fn listed(value: f64) -> String {
    let digits = format!("{value:?}");
    match digits.split_once('e') {
        Some((mantissa, exponent)) => written(mantissa, exponent.parse().unwrap_or(0)),
        None => digits,
    }
}

/// With a point.
fn written(mantissa: &str, exponent: i32) -> String {
    let point = if mantissa.contains('.') { "" } else { ".0" };
    match exponent {
        0 => format!("{mantissa}{point}"),
        _ => format!("{mantissa}{point}E{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_points_and_exponents_that_every_compiler_takes() {
        for (digits, expected) in [
            ("0.5", "0.5"),
            ("2", "2.0"),
            ("1e-9", "1.0E-9"),
            ("2.5e16", "2.5E16"),
            (
                "1e-307",
                "1.0E-7 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30",
            ),
        ] {
            assert_eq!(literal(digits).text, expected);
        }
        assert_eq!(listed(-2e-307), "-2.0E-307");
        assert_eq!(listed(3.0), "3.0");
    }
}
