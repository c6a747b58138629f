//! Consistency of units where they are declared. What is not declared fits everything; nothing
//! is ever converted.

use std::collections::HashMap;

use lynkeus_expr::Binary;

use crate::diagnostic::{Problem, Span};
use crate::flat::FlatModel;
use crate::syntax::ast::{Ast, Call, Equation, EquationKind, ExprId, Kind, Term};
use crate::syntax::{plain, unquoted};

/// Powers of kg, m, s, A, K, mol and cd.
const BASE: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

/// A unit in SI base units: `value · factor + offset` counts in kg^a m^b s^c A^d K^e mol^f cd^g.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseUnit {
    /// powers of kg, m, s, A, K, mol and cd
    pub powers: [f64; 7],
    /// how many of the base unit one of it is
    pub factor: f64,
    /// where its zero lies, in the base unit: that of a degree Celsius is elsewhere
    pub offset: f64,
    /// power of the model's own unit of time, which `der` divides by
    ticks: f64,
    /// as it is written, where it is
    text: Option<String>,
}

impl BaseUnit {
    /// A unit as Modelica writes it: `kg.m2/s`, `J/(kg.K)`, `degC`; none where a part is not known.
    pub fn of(text: &str) -> Option<Self> {
        let letters: String = text.split_whitespace().collect();
        let (mut unit, rest) = product(&letters, 0)?;
        unit.text = Some(text.to_owned());
        rest.is_empty().then_some(unit)
    }

    fn one() -> Self {
        Self {
            powers: [0.0; 7],
            factor: 1.0,
            offset: 0.0,
            ticks: 0.0,
            text: None,
        }
    }

    fn times(&self, other: &Self, power: f64) -> Option<Self> {
        if self.offset != 0.0 || other.offset != 0.0 {
            return None;
        }
        let mut product = Self {
            factor: self.factor * other.factor.powf(power),
            ticks: self.ticks + power * other.ticks,
            ..Self::one()
        };
        for (place, slot) in product.powers.iter_mut().enumerate() {
            *slot = self.powers[place] + power * other.powers[place];
        }
        Some(product)
    }

    /// A difference of degrees Celsius is one of kelvin.
    fn difference(&self) -> Self {
        Self {
            offset: 0.0,
            text: None,
            ..self.clone()
        }
    }

    /// A part of time, behind `der`.
    fn per_tick(&self) -> Self {
        let mut rate = self.difference();
        rate.ticks -= 1.0;
        rate.powers[2] -= 1.0;
        rate
    }

    fn is_pure_number(&self) -> bool {
        self.powers.iter().all(|power| power.abs() < 1e-9)
    }

    fn same_dimension(&self, other: &Self) -> bool {
        let mut pairs = self.powers.iter().zip(&other.powers);
        pairs.all(|(a, b)| (a - b).abs() < 1e-9)
    }

    fn describe(&self) -> String {
        if let Some(text) = &self.text {
            return text.clone();
        }
        let mut parts = vec![];
        for (name, power) in BASE.iter().zip(&self.powers) {
            if power.abs() > 1e-9 {
                parts.push(match *power == 1.0 {
                    true => (*name).to_owned(),
                    false => format!("{name}{power}"),
                });
            }
        }
        let product = match parts.is_empty() {
            true => "1".to_owned(),
            false => parts.join("."),
        };
        match (self.factor - 1.0).abs() < 1e-12 {
            true => product,
            false => format!("{} {product}", self.factor),
        }
    }
}

/// A product at the beginning of a text without blanks, and what is behind it.
fn product(text: &str, depth: usize) -> Option<(BaseUnit, &str)> {
    let (mut unit, mut rest) = factor(text, depth)?;
    loop {
        let power = match rest.chars().next() {
            Some('.' | '*') => 1.0,
            Some('/') => -1.0,
            _ => return Some((unit, rest)),
        };
        let (next, behind) = factor(&rest[1..], depth)?;
        (unit, rest) = (unit.times(&next, power)?, behind);
    }
}

/// `(…)`, `1`, or a symbol with its exponent: `m2`, `m-1`, `m^2`.
fn factor(text: &str, depth: usize) -> Option<(BaseUnit, &str)> {
    if let Some(inner) = text.strip_prefix('(').filter(|_| depth < 20) {
        let (unit, rest) = product(inner, depth + 1)?;
        return Some((unit, rest.strip_prefix(')')?));
    }
    if let Some(rest) = text.strip_prefix('1') {
        return Some((BaseUnit::one(), rest));
    }
    let behind = |text: &str, is_part: fn(char) -> bool| {
        let end = text.find(|c| !is_part(c));
        end.unwrap_or(text.len())
    };
    let (name, rest) = text.split_at(behind(text, char::is_alphabetic));
    let unit = symbol(name)?;
    let rest = rest.strip_prefix('^').unwrap_or(rest);
    let sign = usize::from(rest.starts_with(['-', '+']));
    let (exponent, rest) = rest.split_at(sign + behind(&rest[sign..], |c| c.is_ascii_digit()));
    let power: f64 = match exponent {
        "" => 1.0,
        text => text.parse().ok()?,
    };
    match power {
        1.0 => Some((unit, rest)),
        _ if power.abs() < 20.0 => Some((BaseUnit::one().times(&unit, power)?, rest)),
        _ => None,
    }
}

/// Symbols with their powers and their size in base units.
const SYMBOLS: [(&str, [i8; 7], f64); 33] = [
    ("g", [1, 0, 0, 0, 0, 0, 0], 1e-3),
    ("m", [0, 1, 0, 0, 0, 0, 0], 1.0),
    ("s", [0, 0, 1, 0, 0, 0, 0], 1.0),
    ("A", [0, 0, 0, 1, 0, 0, 0], 1.0),
    ("K", [0, 0, 0, 0, 1, 0, 0], 1.0),
    ("mol", [0, 0, 0, 0, 0, 1, 0], 1.0),
    ("cd", [0, 0, 0, 0, 0, 0, 1], 1.0),
    ("rad", [0; 7], 1.0),
    ("deg", [0; 7], std::f64::consts::PI / 180.0),
    ("sr", [0; 7], 1.0),
    ("min", [0, 0, 1, 0, 0, 0, 0], 60.0),
    ("h", [0, 0, 1, 0, 0, 0, 0], 3600.0),
    ("d", [0, 0, 1, 0, 0, 0, 0], 86400.0),
    ("Hz", [0, 0, -1, 0, 0, 0, 0], 1.0),
    ("N", [1, 1, -2, 0, 0, 0, 0], 1.0),
    ("Pa", [1, -1, -2, 0, 0, 0, 0], 1.0),
    ("bar", [1, -1, -2, 0, 0, 0, 0], 1e5),
    ("J", [1, 2, -2, 0, 0, 0, 0], 1.0),
    ("Wh", [1, 2, -2, 0, 0, 0, 0], 3600.0),
    ("W", [1, 2, -3, 0, 0, 0, 0], 1.0),
    ("C", [0, 0, 1, 1, 0, 0, 0], 1.0),
    ("Ah", [0, 0, 1, 1, 0, 0, 0], 3600.0),
    ("V", [1, 2, -3, -1, 0, 0, 0], 1.0),
    ("F", [-1, -2, 4, 2, 0, 0, 0], 1.0),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0], 1.0),
    ("S", [-1, -2, 3, 2, 0, 0, 0], 1.0),
    ("Wb", [1, 2, -2, -1, 0, 0, 0], 1.0),
    ("T", [1, 0, -2, -1, 0, 0, 0], 1.0),
    ("H", [1, 2, -2, -2, 0, 0, 0], 1.0),
    ("l", [0, 3, 0, 0, 0, 0, 0], 1e-3),
    ("L", [0, 3, 0, 0, 0, 0, 0], 1e-3),
    ("t", [1, 0, 0, 0, 0, 0, 0], 1e3),
    ("Bq", [0, 0, -1, 0, 0, 0, 0], 1.0),
];

const PREFIXES: [(&str, f64); 11] = [
    ("da", 1e1),
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
];

fn symbol(name: &str) -> Option<BaseUnit> {
    if name == "degC" {
        let mut celsius = symbol("K")?;
        celsius.offset = 273.15;
        return Some(celsius);
    }
    let whole = |name: &str, factor: f64| {
        let (_, powers, size) = SYMBOLS.iter().find(|(symbol, ..)| *symbol == name)?;
        Some(BaseUnit {
            powers: powers.map(f64::from),
            factor: size * factor,
            ..BaseUnit::one()
        })
    };
    whole(name, 1.0).or_else(|| {
        let mut prefixes = PREFIXES.iter();
        prefixes.find_map(|(prefix, factor)| whole(name.strip_prefix(prefix)?, *factor))
    })
}

/// Most warnings of one text.
const MOST: usize = 20;
/// Sizes in seconds that a model's unit of time may have.
const TIMES: [f64; 8] = [1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0, 31_557_600.0];

/// Warnings where declared units do not fit.
pub(crate) fn check(source: &str, ast: &Ast, model: &FlatModel) -> Vec<Problem> {
    let mut declared = HashMap::new();
    for declaration in &model.declarations {
        let mut attributes = declaration.attributes.iter();
        let given = attributes.find(|a| a.name.text(source) == "unit");
        let text = given.and_then(|attribute| {
            let span = ast.expression(attribute.value?).span;
            Some(unquoted(span.text(source)))
        });
        let library = declaration.library.map(|known| known.unit.to_owned());
        if let Some(unit) = text.or(library).and_then(|text| BaseUnit::of(&text)) {
            declared.insert(declaration.written(), unit);
        }
    }
    if declared.is_empty() {
        return vec![];
    }
    let mut walk = Walk {
        source,
        ast,
        declared,
        tick: None,
        found: vec![],
    };
    // a package has names of its own
    for declaration in model.declarations.iter().filter(|d| d.package.is_none()) {
        let Some(id) = declaration.binding else {
            continue;
        };
        let value = walk.unit(id);
        let own = walk.declared.get(declaration.label.as_str()).cloned();
        walk.compare(own, value, ast.expression(id).span, "its value");
    }
    walk.equations(&model.equations);
    walk.found
}

struct Walk<'a> {
    source: &'a str,
    ast: &'a Ast,
    declared: HashMap<&'a str, BaseUnit>,
    /// seconds in the model's unit of time, with the line that says so
    tick: Option<(f64, usize)>,
    found: Vec<Problem>,
}

impl Walk<'_> {
    fn equations(&mut self, equations: &[Equation]) {
        for equation in equations {
            match &equation.kind {
                EquationKind::Equality(left, right) => {
                    let (a, b) = (self.unit(*left), self.unit(*right));
                    self.compare(a, b, equation.span, "the other side");
                }
                EquationKind::For(_, body) => self.equations(body),
                EquationKind::When(clauses) => {
                    for (condition, body) in clauses {
                        self.unit(*condition);
                        self.equations(body);
                    }
                }
                EquationKind::Reinit(state, value) => {
                    let (a, b) = (self.unit(*state), self.unit(*value));
                    self.compare(a, b, equation.span, "the other side");
                }
                EquationKind::If(branches, otherwise) => {
                    for (condition, body) in branches {
                        self.unit(*condition);
                        self.equations(body);
                    }
                    self.equations(otherwise);
                }
                EquationKind::Assert(assert) => {
                    self.unit(assert.condition);
                }
                EquationKind::Several(..) => {}
            }
        }
    }

    /// The first of two units that is known; a warning where both are and they differ.
    fn compare(
        &mut self,
        a: Option<BaseUnit>,
        b: Option<BaseUnit>,
        span: Span,
        other: &str,
    ) -> Option<BaseUnit> {
        let (one, two) = match (a, b) {
            (Some(one), Some(two)) => (one, two),
            (one, two) => return one.or(two),
        };
        let (x, y) = (one.describe(), two.describe());
        let ratio = one.factor / two.factor;
        let ticks = one.ticks - two.ticks;
        if !one.same_dimension(&two) {
            let message = format!("units differ: one is {x}, {other} is {y}");
            self.warn(Problem::new(span, message));
        } else if one.offset != two.offset {
            let message = format!("a degree Celsius against a kelvin: one is {x}, {other} is {y}");
            let hint = "nothing is converted: add or subtract 273.15 where it belongs";
            self.warn(Problem::new(span, message).hint(hint));
        } else if ticks == 0.0 && (ratio - 1.0).abs() > 1e-9 {
            let message = format!("the same quantity in two units: one is {x}, {other} is {y}");
            let hint = format!("nothing is converted: 1 {x} is {ratio} {y}");
            self.warn(Problem::new(span, message).hint(hint));
        } else if ticks == -1.0 || ticks == 1.0 {
            self.time(ratio.powf(-ticks), &x, &y, span);
        }
        Some(one)
    }

    fn warn(&mut self, problem: Problem) {
        if self.found.len() < MOST {
            self.found.push(problem);
        }
    }

    /// An equation says how long the model's unit of time is: all must say the same.
    fn time(&mut self, seconds: f64, x: &str, y: &str, span: Span) {
        let line = span.line(self.source);
        let fits = |time: f64| (seconds / time - 1.0).abs() < 1e-9;
        if !TIMES.into_iter().any(fits) {
            let message = format!("a rate in two units: {x} on one side, {y} on the other");
            return self.warn(Problem::new(span, message).hint("nothing is converted"));
        }
        let (before, first) = *self.tick.get_or_insert((seconds, line));
        if !fits(before) {
            let message = format!(
                "this equation takes {seconds} s as the unit of time, line {first} takes {before} s"
            );
            let hint = "nothing is converted: write all rates over one unit of time";
            self.warn(Problem::new(span, message).hint(hint));
        }
    }

    /// The unit of an expression; `None` where it is not known, and for plain numbers.
    fn unit(&mut self, id: ExprId) -> Option<BaseUnit> {
        let ast = self.ast;
        let expression = ast.expression(id);
        match &expression.kind {
            Kind::Name => self.named(&plain(expression.span.text(self.source))),
            Kind::Index(base, _) => self.unit(*base),
            Kind::Path(parts) => {
                let names = parts.iter().map(|part| plain(part.name.text(self.source)));
                let joined = names.collect::<Vec<_>>().join(".");
                let whole = plain(expression.span.text(self.source));
                self.named(&whole).or_else(|| self.named(&joined))
            }
            Kind::Plus(operand) | Kind::Minus(operand) | Kind::Not(operand) => self.unit(*operand),
            Kind::Chain(head, rest) => self.chain(*head, rest),
            Kind::Power(base, exponent, _) => {
                let base = self.unit(*base);
                match ast.expression(*exponent).kind {
                    Kind::Integer(power) if power.abs() < 20 => {
                        BaseUnit::one().times(&base?, power as f64)
                    }
                    _ => None,
                }
            }
            Kind::Relation(_, left, right) => {
                let (a, b) = (self.unit(*left), self.unit(*right));
                self.compare(a, b, expression.span, "what it is compared with");
                None
            }
            Kind::If(branches, otherwise) => {
                let mut unit = self.unit(*otherwise);
                for (condition, value) in branches {
                    self.unit(*condition);
                    let value = self.unit(*value);
                    unit = self.compare(unit, value, expression.span, "another branch");
                }
                unit
            }
            Kind::Call(call) => self.call(call, expression.span),
            _ => None,
        }
    }

    fn named(&self, name: &str) -> Option<BaseUnit> {
        self.declared.get(name).cloned()
    }

    fn chain(&mut self, head: ExprId, rest: &[Term]) -> Option<BaseUnit> {
        if matches!(rest.first()?.0, Binary::Add | Binary::Sub) {
            return self.sum(head, rest);
        }
        let mut product = self.factor(head);
        for &(operation, _, operand) in rest {
            let factor = self.factor(operand);
            let power = match operation {
                Binary::Mul => 1.0,
                Binary::Div => -1.0,
                _ => return None,
            };
            product = product.zip(factor).and_then(|(a, b)| a.times(&b, power));
        }
        product
    }

    fn sum(&mut self, head: ExprId, rest: &[Term]) -> Option<BaseUnit> {
        let has_offset = |unit: &Option<BaseUnit>| unit.as_ref().is_some_and(|u| u.offset != 0.0);
        let mut unit = self.unit(head);
        for &(operation, _, operand) in rest {
            let next = self.unit(operand);
            let span = |id| self.ast.expression(id).span;
            let place = span(head).to(span(operand));
            let is_difference = operation == Binary::Sub && has_offset(&unit) && has_offset(&next);
            unit = self.compare(unit, next, place, "what is added");
            if is_difference {
                unit = unit.map(|unit| unit.difference());
            }
        }
        unit
    }

    /// Small whole numbers count as numbers; others may hide a unit.
    fn factor(&mut self, id: ExprId) -> Option<BaseUnit> {
        match self.ast.expression(id).kind {
            Kind::Integer(value) if value.abs() <= 10 => Some(BaseUnit::one()),
            _ => self.unit(id),
        }
    }

    fn call(&mut self, call: &Call, span: Span) -> Option<BaseUnit> {
        let name = plain(call.function.text(self.source));
        let units: Vec<Option<BaseUnit>> = call.arguments.iter().map(|&id| self.unit(id)).collect();
        let first = units.first().cloned().flatten();
        match &*name {
            "der" => Some(first?.per_tick()),
            "abs" | "noEvent" | "sum" | "homotopy" => first,
            "smooth" => units.get(1).cloned().flatten(),
            "min" | "max" => {
                let second = units.get(1).cloned().flatten();
                self.compare(first, second, span, "the other")
            }
            "sqrt" => BaseUnit::one().times(&first?, 0.5),
            "exp" | "log" | "log10" | "sin" | "cos" | "tan" | "sinh" | "cosh" | "tanh" => {
                if let Some(unit) = first.filter(|unit| !unit.is_pure_number()) {
                    let message = format!("`{name}` of a quantity in {}", unit.describe());
                    let hint = "divide it by a reference in the same unit";
                    self.warn(Problem::new(span, message).hint(hint));
                }
                None
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base_units_of_texts() {
        let celsius = BaseUnit::of("degC").unwrap();
        assert_eq!((celsius.factor, celsius.offset), (1.0, 273.15));
        let flow = BaseUnit::of("l/min").unwrap();
        assert_eq!(flow.powers, [0.0, 3.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((flow.factor - 1e-3 / 60.0).abs() < 1e-18 && flow.offset == 0.0);
        assert_eq!(BaseUnit::of("cells"), None);
    }

    #[test]
    fn units_over_the_base_units() {
        for (text, same, scale) in [
            ("N", "kg.m/s2", 1.0),
            ("J/(kg.K)", "m2.s-2/K", 1.0),
            ("kW.h", "J", 3.6e6),
            ("mV", "W/A", 1e-3),
            ("rad/s", "1/s", 1.0),
            ("km/h", "m/s", 1.0 / 3.6),
            ("Ohm.F", "s", 1.0),
            ("V.s", "Wb", 1.0),
        ] {
            let (one, other) = (BaseUnit::of(text).unwrap(), BaseUnit::of(same).unwrap());
            assert!(one.same_dimension(&other), "{text} {same}");
            let ratio = one.factor / other.factor;
            assert!((ratio - scale).abs() < 1e-12 * scale, "{text} {same}");
        }
        for text in [
            "cells",
            "%",
            "kg.",
            "/s",
            "m/(s",
            "",
            "((((((((((((((((((((((((s",
        ] {
            assert_eq!(BaseUnit::of(text), None, "{text}");
        }
    }
}
