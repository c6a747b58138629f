//! Values of a draft as Structured Text. What C evaluates only under a condition becomes a variable, which is set
//! in the lines before.

use super::bound::{ATOM, Bound, SIGN, literal};
use super::print::{Printer, lacks};
use crate::Refusal;
use crate::curly::c::Precision;
use crate::curly::syntax::{Expr, Operator, Type, visit};
use crate::curly::words;

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
                None => self.tables.get(name.as_str()).map(|list| list.len()),
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
        if let Some(number) = words::number(name) {
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
        let right = right.after_a_sign(least.max(level + 1));
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
        Ok(value.after_a_sign(operator.level() + 1))
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
