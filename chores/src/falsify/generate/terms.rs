//! Terms of right-hand sides: smooth ones, kinks, and what breaks theorems.

use super::super::case::{Side, number};
use crate::numbers::Numbers;

/// What a term may read.
pub struct Reads<'a> {
    pub states: &'a [Side],
    pub inputs: &'a [Side],
    pub time: bool,
}

impl Reads<'_> {
    fn state(&self, numbers: &mut Numbers) -> Side {
        numbers.of(self.states).clone()
    }

    /// A term without jump that is defined on the whole box.
    pub fn smooth(&self, numbers: &mut Numbers) -> String {
        let (a, b) = (self.state(numbers), self.state(numbers));
        let (x, y) = (&a.name, &b.name);
        let w = number(round(numbers.size(0.3, 3.0)));
        let reach = number(round(1.3 * a.low.abs().max(a.high.abs()) + 0.1));
        // positive throughout the box
        let lifted = format!("({x} - {} + 0.3)", number(a.low));
        match numbers.below(30) {
            0 => format!("sin({w}*{x})"),
            1 => format!("cos({w}*{x} + 1)"),
            2 => format!("tanh({w}*{x})"),
            3 | 4 => format!("{x}*{y}"),
            5 => format!("{x}^2"),
            6 => format!("{x}^3"),
            7 => format!("exp(-{x}^2)"),
            8 => format!("{x}/(1 + {x}^2)"),
            9 => format!("sin({x}*{y})"),
            10 => format!("atan({w}*{x} - {y})"),
            11 => format!("exp(0.3*{x})"),
            12 => format!("sinh(0.5*{x})"),
            13 => format!("cosh(0.5*{x} - 0.2)"),
            14 => format!("log(1 + {x}^2)"),
            15 => format!("sqrt(1 + {x}^2)"),
            16 => format!("asin({x}/{reach})"),
            17 => format!("acos({x}/{reach})"),
            18 => format!("atan2({x}, {reach})"),
            19 => format!("tan({x}/{reach})"),
            20 => format!("{lifted}^1.5"),
            21 => format!("log({lifted})"),
            22 => format!("sqrt({lifted})"),
            23 => format!("1/{lifted}"),
            24 => format!("{x}*abs({x})"),
            25 => format!("log10({lifted})"),
            26 => format!("{lifted}^{lifted}"),
            27 => format!("max({x}, 0)^2"),
            _ => self.driven(numbers),
        }
    }

    /// A term that an input or time drives.
    pub fn driven(&self, numbers: &mut Numbers) -> String {
        let x = self.state(numbers).name;
        if self.inputs.is_empty() || (self.time && numbers.chance(0.2)) {
            return match (self.time, numbers.below(4)) {
                (true, 0) => format!("sin(time)*{x}"),
                (true, 1) => format!("cos(0.7*time + {x})"),
                (true, 2) => format!("(if sin(2*time) > 0.4 then {x} else -0.5*{x})"),
                _ => x,
            };
        }
        let u = &numbers.of(self.inputs).name;
        match numbers.below(8) {
            0 | 1 => format!("{u}*{x}"),
            2 => format!("{u}^2*{x}"),
            3 => format!("abs({u})*{x}"),
            4 => format!("sin({u} + {x})"),
            5 => format!("(if {u} > 0.1 then {x} else -0.7*{x})"),
            6 => format!("floor(3*{u})*{x}"),
            _ => u.clone(),
        }
    }

    /// Continuous, with a slope that jumps.
    pub fn kinked(&self, numbers: &mut Numbers) -> String {
        let (a, b) = (self.state(numbers), self.state(numbers));
        let (x, y, c) = (&a.name, &b.name, place(numbers, &a));
        match numbers.below(10) {
            0 => format!("abs({x} - {c})"),
            1 => format!("min({x}, {c})"),
            2 => format!("max({x}, {y})"),
            3 => format!("(if {x} > {c} then {x} - {c} else 0)"),
            4 => format!("abs({x} - {c})*{y}"),
            5 => format!("sqrt(({x} - {c})^2)"),
            6 => format!("sign({x} - {c})*({x} - {c})"),
            7 => format!("noEvent(if {x} < {c} then 0 else ({x} - {c})^2)"),
            8 => format!("abs(sin(3*{x}))"),
            _ => format!("max(min({x}, {c}), {y})"),
        }
    }

    /// Something that jumps at a place in the box, at its edge or outside.
    pub fn jumping(&self, numbers: &mut Numbers) -> String {
        let a = self.state(numbers);
        let y = self.state(numbers).name;
        let (x, c) = (&a.name, place(numbers, &a));
        let w = number(round(numbers.size(0.5, 3.0)));
        match numbers.below(26) {
            0 => format!("sign({x} - {c})"),
            1 => format!("floor({x} - {c})"),
            2 => format!("mod({x} - {c}, {w})"),
            3 => format!("(if {x} > {c} then 1 else 0.5)"),
            4 => format!("(if {x} > {c} then {y} else -{y})"),
            5 => format!("atan2({x} - {c}, -1.0)"),
            6 => format!("atan2({x} - {c}, {y})"),
            7 => format!("atan(1/({x} - {c}))"),
            8 => format!("({x} - {c})/abs({x} - {c})"),
            9 => format!("tan({w}*({x} - {c}))"),
            10 => format!("ceil({w}*{x})"),
            11 => format!("integer({w}*{x})"),
            12 => format!("rem({x} - {c}, {w})"),
            13 => format!("div({x} - {c}, {w})"),
            14 => format!("sin(floor({x} - {c}))"),
            15 => format!("abs(sign({x} - {c}))"),
            16 => format!("sign({x} - {c})*{y}"),
            17 => format!("(if {x} == {c} then 1 else 0)"),
            18 => format!("(if {x} > {c} and {x} < {c} + 1e-6 then 1 else 0)"),
            19 => format!("max(sign({x} - {c}), {y})"),
            20 => format!("({x} - {c})^2/({x} - {c})^2"),
            21 => format!("sqrt(abs(sign({x} - {c})))"),
            22 => format!("exp(-1/({x} - {c}))"),
            23 => format!("tanh(1/({x} - {c}))"),
            24 => format!("sign(sin(4*({x} - {c})))"),
            _ => format!("acos(max(-1, min(1, 1e6*({x} - {c}))))"),
        }
    }

    /// Something without value at a place in the box, at its edge or outside.
    pub fn undefined(&self, numbers: &mut Numbers) -> String {
        let a = self.state(numbers);
        let y = self.state(numbers).name;
        let (x, c) = (&a.name, place(numbers, &a));
        let reach = number(round(numbers.between(0.3, 1.2) * a.high.abs().max(0.1)));
        match numbers.below(20) {
            0 => format!("log({x} - {c})"),
            1 => format!("sqrt({x} - {c})"),
            2 => format!("({x} - {c})^1.5"),
            3 => format!("acos({x}/{reach})"),
            4 => format!("asin({x}/{reach})"),
            5 => format!("1/({x} - {c})"),
            6 => format!("log10({c} - {x})"),
            7 => format!("({x} - {c})^0.5"),
            8 => format!("({x} - {c})^2.5"),
            9 => format!("1/({x} - {c})^2"),
            10 => format!("0*log({x} - {c})"),
            11 => format!("0*({x} - {c})^1.5"),
            12 => format!("log({x}*{y})"),
            13 => format!("abs({x} - {c})^0.5"),
            14 => format!("({x} - {c})*log(({x} - {c})^2)"),
            15 => format!("(if {x} > {c} then sqrt({x} - {c}) else 0)"),
            16 => format!("({x} - {c})*sin(1/({x} - {c}))"),
            17 => format!("({x} - {c})^2*sin(1/({x} - {c})^2)"),
            18 => format!("max(0, {x} - {c})^0.3"),
            _ => format!("sqrt({x} - {c})*sqrt({x} - {c})"),
        }
    }
}

/// A place where a term is special: mostly inside the range, at times its middle, its
/// end, or outside of it.
fn place(numbers: &mut Numbers, side: &Side) -> String {
    let w = side.width();
    let c = match numbers.below(12) {
        0 => side.low,
        1 => side.high,
        2 => side.low - 0.1 * w,
        3 => side.high + 0.1 * w,
        4 => side.middle(),
        5 => side.low + 1e-3 * w,
        _ => round(side.low + numbers.unit() * w),
    };
    number(c)
}

/// Three decimals, so that shrunk cases can be read.
pub fn round(x: f64) -> f64 {
    if x.abs() < 0.01 {
        return x;
    }
    (x * 1e3).round() / 1e3
}
