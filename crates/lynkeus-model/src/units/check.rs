//! Walks equations and compares the units of what is added, equated or compared.

use std::collections::HashMap;

use super::Unit;
use crate::flat::FlatModel;
use crate::syntax::ast::{Ast, BinaryOperator, Call, Equation, EquationKind, ExprId, Kind};
use crate::syntax::{Problem, Span, plain, unquoted};

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
        let library = model
            .library
            .get(&declaration.label)
            .map(|known| known.unit.to_owned());
        if let Some(unit) = text.or(library).and_then(|text| Unit::parse(&text)) {
            let label = declaration.label.as_str();
            declared.insert(label.strip_prefix('.').unwrap_or(label), unit);
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
    declared: HashMap<&'a str, Unit>,
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
        a: Option<Unit>,
        b: Option<Unit>,
        span: Span,
        other: &str,
    ) -> Option<Unit> {
        let (one, two) = match (a, b) {
            (Some(one), Some(two)) => (one, two),
            (one, two) => return one.or(two),
        };
        if self.found.len() >= MOST {
            return Some(one);
        }
        let (x, y) = (one.describe(), two.describe());
        if !one.same_dimension(&two) {
            let message = format!("units differ: one is {x}, {other} is {y}");
            self.found.push(Problem::new(span, message));
            return Some(one);
        }
        if one.has_offset != two.has_offset {
            let message = format!("a degree Celsius against a kelvin: one is {x}, {other} is {y}");
            let hint = "nothing is converted: add or subtract 273.15 where it belongs";
            self.found.push(Problem::new(span, message).hint(hint));
            return Some(one);
        }
        let ratio = one.scale / two.scale;
        match one.ticks - two.ticks {
            0.0 if (ratio - 1.0).abs() > 1e-9 => {
                let message = format!("the same quantity in two units: one is {x}, {other} is {y}");
                let hint = format!("nothing is converted: 1 {x} is {ratio} {y}");
                self.found.push(Problem::new(span, message).hint(hint));
            }
            ticks if ticks == -1.0 || ticks == 1.0 => {
                self.time(ratio.powf(-ticks), &x, &y, span);
            }
            _ => {}
        }
        Some(one)
    }

    /// An equation says how long the model's unit of time is: all must say the same.
    fn time(&mut self, seconds: f64, x: &str, y: &str, span: Span) {
        let line = span.line(self.source);
        let known = TIMES.iter().any(|time| (seconds / time - 1.0).abs() < 1e-9);
        match self.tick {
            _ if !known => {
                let message = format!("a rate in two units: {x} on one side, {y} on the other");
                self.found
                    .push(Problem::new(span, message).hint("nothing is converted"));
            }
            Some((before, first)) if (seconds / before - 1.0).abs() > 1e-9 => {
                let message = format!(
                    "this equation takes {seconds} s as the unit of time, line {first} takes {before} s"
                );
                let hint = "nothing is converted: write all rates over one unit of time";
                self.found.push(Problem::new(span, message).hint(hint));
            }
            Some(_) => {}
            None => self.tick = Some((seconds, line)),
        }
    }

    /// The unit of an expression; `None` where it is not known, and for plain numbers.
    fn unit(&mut self, id: ExprId) -> Option<Unit> {
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
            Kind::Unary(_, operand) => self.unit(*operand),
            Kind::Chain(head, rest) => self.chain(*head, rest),
            Kind::Power(base, exponent, _) => {
                let base = self.unit(*base);
                match ast.expression(*exponent).kind {
                    Kind::Integer(power) if power.abs() < 20 => {
                        Unit::one().times(&base?, power as f64)
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

    fn named(&self, name: &str) -> Option<Unit> {
        self.declared.get(name).cloned()
    }

    fn chain(&mut self, head: ExprId, rest: &[(BinaryOperator, ExprId)]) -> Option<Unit> {
        use BinaryOperator as B;
        let span = |walk: &Self, id: ExprId| walk.ast.expression(id).span;
        let is_sum = |operator: B| {
            matches!(
                operator,
                B::Add | B::Subtract | B::ElementAdd | B::ElementSubtract
            )
        };
        let (operator, _) = *rest.first()?;
        if is_sum(operator) {
            let mut unit = self.unit(head);
            for &(operator, operand) in rest {
                let next = self.unit(operand);
                let place = span(self, head).to(span(self, operand));
                let has_offset = |unit: &Option<Unit>| unit.as_ref().is_some_and(|u| u.has_offset);
                let is_difference = matches!(operator, B::Subtract | B::ElementSubtract)
                    && has_offset(&unit)
                    && has_offset(&next);
                unit = self.compare(unit, next, place, "what is added");
                if is_difference {
                    unit = unit.map(|unit| unit.difference());
                }
            }
            return unit;
        }
        let mut product = self.factor(head);
        for &(operator, operand) in rest {
            let factor = self.factor(operand);
            let power = match operator {
                B::Multiply | B::ElementMultiply => 1.0,
                B::Divide | B::ElementDivide => -1.0,
                _ => return None,
            };
            product = product.zip(factor).and_then(|(a, b)| a.times(&b, power));
        }
        product
    }

    /// Small whole numbers count as numbers; others may hide a unit.
    fn factor(&mut self, id: ExprId) -> Option<Unit> {
        match self.ast.expression(id).kind {
            Kind::Integer(value) if value.abs() <= 10 => Some(Unit::one()),
            _ => self.unit(id),
        }
    }

    fn call(&mut self, call: &Call, span: Span) -> Option<Unit> {
        let name = plain(call.function.text(self.source));
        let units: Vec<Option<Unit>> = call.arguments.iter().map(|&id| self.unit(id)).collect();
        let first = units.first().cloned().flatten();
        match &*name {
            "der" => first?.per_tick(),
            "abs" | "noEvent" | "sum" | "homotopy" => first,
            "smooth" => units.get(1).cloned().flatten(),
            "min" | "max" => {
                let second = units.get(1).cloned().flatten();
                self.compare(first, second, span, "the other")
            }
            "sqrt" => Unit::one().times(&first?, 0.5),
            "exp" | "log" | "log10" | "sin" | "cos" | "tan" | "sinh" | "cosh" | "tanh" => {
                if let Some(unit) = first.filter(|unit| !unit.is_pure_number())
                    && self.found.len() < MOST
                {
                    let message = format!("`{name}` of a quantity in {}", unit.describe());
                    let hint = "divide it by a reference in the same unit";
                    self.found.push(Problem::new(span, message).hint(hint));
                }
                None
            }
            _ => None,
        }
    }
}
