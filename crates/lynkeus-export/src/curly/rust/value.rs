//! Values of a draft as Rust, and names that cannot stay in it.

use std::collections::HashMap;

use crate::curly::c::Precision;
use crate::curly::syntax::{
    ATOM, Bound, Expr, Function, Operator, Program, SIGN, Scope, Type, reads_state,
};

/// How tightly `as` binds. A cast stands in parentheses wherever it is a part of an operation: `x as usize < y`
/// begins a list of types.
const CAST: u8 = 4;
/// `if … { … } else { … }`
const CHOICE: u8 = 0;

/// What of the library is not drafted: with numbers that may be negative, and parts of numbers.
pub(super) const OWN: [(&str, &str); 2] = [
    (
        "integer_power",
        "/// An integer power, as it is computed everywhere else: by squares.
fn integer_power(a: REAL, exponent: i32) -> REAL {
    let mut power = 1.0;
    let mut factor = a;
    let mut rest = exponent.unsigned_abs();
    while rest > 0 {
        if rest % 2 == 1 {
            power *= factor;
        }
        factor *= factor;
        rest /= 2;
    }
    if exponent < 0 { 1.0 / power } else { power }
}",
    ),
    (
        "power_of_two",
        "/// The power of two of a number.
fn power_of_two(a: REAL) -> REAL {
    libm::ldexpSUFFIX(1.0, libm::frexpSUFFIX(a).1 - 1)
}",
    ),
];

/// Writes the values of one function after the other.
pub(super) struct Values<'p> {
    pub program: &'p Program<'p>,
    precision: Precision,
    scope: Scope,
    /// what names are called here that cannot be called so
    others: HashMap<String, String>,
    /// values that were read before a call
    taken: HashMap<String, String>,
}

impl<'p> Values<'p> {
    pub fn new(program: &'p Program<'p>, precision: Precision) -> Self {
        Self {
            program,
            precision,
            scope: Scope::default(),
            others: HashMap::new(),
            taken: HashMap::new(),
        }
    }

    /// From here on in a function.
    pub fn enter(&mut self, function: &Function) {
        self.scope = Scope::of(function);
        self.taken.clear();
        self.others = renamed(&self.scope, self.program);
    }

    pub fn kind(&self, of: Type) -> &'static str {
        kind(of, self.precision)
    }

    pub fn zero(&self, kind: Type) -> &'static str {
        match kind {
            Type::Int => "0",
            Type::Truth => "false",
            _ => "0.0",
        }
    }

    pub fn kind_of(&self, value: &Expr) -> Type {
        self.program.kind(value, &self.scope)
    }

    pub fn name(&self, name: &str) -> String {
        let other = self.others.get(name);
        other.map_or_else(|| name.to_owned(), Clone::clone)
    }

    /// A value where one of a type is wanted.
    pub fn text(&self, value: &Expr, wanted: Type) -> String {
        self.bound_as(value, wanted).text
    }

    /// The end of a range.
    pub fn bound(&self, value: &Expr) -> String {
        self.bound_as(value, Type::Int).at_least(CAST + 1)
    }

    /// `n` where the value is `n - 1`.
    pub fn beyond(&self, value: &Expr) -> Option<String> {
        match value {
            Expr::Binary(Operator::Sub, left, right) if **right == Expr::Number("1".into()) => {
                Some(self.bound(left))
            }
            _ => None,
        }
    }

    /// The opposite of a condition.
    pub fn negated(&self, value: &Expr) -> String {
        if let Expr::Binary(operator, left, right) = value
            && let (Type::Int, Some(opposite)) = (self.kind_of(left), opposite(*operator))
        {
            return self.binary(opposite, left, right).text;
        }
        format!("!{}", self.bound_as(value, Type::Truth).at_least(SIGN))
    }

    /// The arguments of a call that read the state which it changes, with names for them: a parameter's.
    pub fn taken_before(&mut self, function: &str, arguments: &[Expr]) -> Vec<(String, String)> {
        let mut taken = vec![];
        if !self.program.is_changer(function) {
            return taken;
        }
        let parameters = self.program.parameters(function, &self.scope);
        for (parameter, argument) in parameters.iter().zip(arguments) {
            if parameter.is_pointer || !reads_state(argument) {
                continue;
            }
            let text = self.text(argument, parameter.kind);
            let mut name = parameter.name.clone();
            while self.scope.variable(&name).is_some() {
                name.push('_');
            }
            taken.push((name.clone(), text.clone()));
            self.taken.insert(format!("{function}.{text}"), name);
        }
        taken
    }

    fn bound_as(&self, value: &Expr, wanted: Type) -> Bound {
        match value {
            Expr::Group(inner) => self.bound_as(inner, wanted),
            Expr::Number(digits) if wanted == Type::Truth => {
                Bound::atom(if digits == "0" { "false" } else { "true" })
            }
            Expr::Number(digits) => Bound::atom(digits.clone()),
            Expr::Real(digits) => Bound::atom(self.literal(digits)),
            Expr::Name(name) => Bound::atom(self.named(name)),
            Expr::Part(name) => Bound::atom(format!("s.{name}")),
            Expr::Index(array, place) => Bound::atom(format!(
                "{}[{}]",
                self.bound_as(array, wanted).text,
                self.text(place, Type::Int)
            )),
            Expr::Call(name, arguments) => Bound::atom(self.call(name, arguments)),
            Expr::Cast(kind, inner) => self.cast(*kind, inner),
            Expr::Prefix(sign, inner) => {
                let inner = self.bound_as(inner, wanted);
                // a sign after a sign is not for reading
                let least = if *sign == "-" { ATOM } else { SIGN };
                Bound {
                    text: format!("{sign}{}", inner.at_least(least)),
                    level: SIGN,
                }
            }
            Expr::Binary(operator, left, right) => self.binary(*operator, left, right),
            Expr::Choice(condition, then, otherwise) => {
                let condition = self.bound_as(condition, Type::Truth);
                if wanted == Type::Truth && is_one(then) && is_zero(otherwise) {
                    return condition;
                }
                let text = format!(
                    "if {} {{ {} }} else {{ {} }}",
                    condition.text,
                    self.text(then, wanted),
                    self.text(otherwise, wanted)
                );
                Bound {
                    text,
                    level: CHOICE,
                }
            }
        }
    }

    fn named(&self, name: &str) -> String {
        let real = self.kind(Type::Real);
        match name {
            _ if self.scope.variable(name).is_some() => self.name(name),
            "NAN" | "INFINITY" | "EPSILON" => format!("{real}::{name}"),
            "SMALLEST" => format!("{real}::MIN_POSITIVE"),
            "RANK" => match self.precision {
                Precision::F64 => "1e-13".to_owned(),
                Precision::F32 => "1e-6".to_owned(),
            },
            _ if self.program.table(name).is_some() => name.to_ascii_uppercase(),
            _ => name.to_owned(),
        }
    }

    fn literal(&self, digits: &str) -> String {
        if self.precision == Precision::F64 {
            return digits.to_owned();
        }
        match digits.parse::<f64>() {
            Ok(value) if (value as f32).is_infinite() => "f32::INFINITY".to_owned(),
            Ok(value) => format!("{:?}", value as f32),
            Err(_) => digits.to_owned(),
        }
    }

    fn cast(&self, kind: Type, inner: &Expr) -> Bound {
        let from = self.kind(self.kind_of(inner));
        let to = self.kind(kind);
        let value = self.bound_as(inner, Type::Real);
        match from == to {
            true => value,
            false => Bound {
                text: format!("{} as {to}", value.at_least(SIGN)),
                level: CAST,
            },
        }
    }

    fn binary(&self, operator: Operator, left: &Expr, right: &Expr) -> Bound {
        let level = operator.level();
        let is_truth = self.kind_of(left) == Type::Truth && level >= Operator::Equal.level();
        if is_truth && operator == Operator::Unequal && is_zero(right) {
            return self.bound_as(left, Type::Truth);
        }
        let wanted = match operator {
            Operator::And | Operator::Or => Type::Truth,
            _ => self.kind_of(left),
        };
        // relations do not chain
        let least = if (3..5).contains(&level) { 5 } else { level };
        let left = self.bound_as(left, wanted).at_least(least);
        let right = self.bound_as(right, wanted).at_least(least.max(level + 1));
        Bound::infix(&left, operator.sign(), &right, level)
    }

    fn call(&self, name: &str, arguments: &[Expr]) -> String {
        let method = |method: &str, real: &str| {
            let texts = arguments
                .iter()
                .map(|argument| self.text(argument, Type::Real));
            format!("{real}::{method}({})", texts.collect::<Vec<_>>().join(", "))
        };
        let kind = arguments
            .first()
            .map_or(Type::Real, |first| self.kind_of(first));
        let of = self.kind(kind);
        match name {
            "fabs" => return method("abs", self.kind(Type::Real)),
            "isfinite" => return method("is_finite", of),
            "isnan" => return method("is_nan", of),
            "signbit" => return method("is_sign_negative", of),
            _ => {}
        }
        let parameters = self.program.parameters(name, &self.scope);
        let is_own = OWN.iter().any(|own| own.0 == name);
        if parameters.is_empty() && !is_own && self.program.is_foreign(name) {
            let single = self.precision == Precision::F32 && name != "ceil";
            let suffix = if single { "f" } else { "" };
            return method(&format!("{name}{suffix}"), "libm");
        }
        let texts = arguments.iter().enumerate().map(|(place, argument)| {
            let parameter = parameters.get(place);
            let wanted = parameter.map_or(Type::Real, |parameter| parameter.kind);
            let text = self.text(argument, wanted);
            match parameter {
                Some(parameter) if parameter.is_pointer => {
                    self.lent(argument, text, parameter.is_const)
                }
                _ => match self.taken.get(&format!("{name}.{text}")) {
                    Some(taken) => taken.clone(),
                    None => text,
                },
            }
        });
        let texts: Vec<String> = texts.collect();
        format!("{}({})", self.name(name), texts.join(", "))
    }

    /// An array, or the state, as an argument.
    fn lent(&self, argument: &Expr, text: String, is_const: bool) -> String {
        let is_lent = match argument {
            Expr::Name(name) => {
                let variable = self.scope.variable(name);
                variable.is_some_and(|variable| variable.is_pointer)
            }
            _ => false,
        };
        match (is_lent, is_const) {
            (true, _) => text,
            (false, true) => format!("&{text}"),
            (false, false) => format!("&mut {text}"),
        }
    }
}

/// What a type is called.
pub(super) fn kind(kind: Type, precision: Precision) -> &'static str {
    match kind {
        Type::Void => "()",
        Type::Real if precision == Precision::F32 => "f32",
        Type::Real | Type::Double => "f64",
        Type::Int => "usize",
        Type::Truth => "bool",
        Type::State => "State",
        Type::Field => "Field",
    }
}

/// Of a relation between integers.
fn opposite(operator: Operator) -> Option<Operator> {
    Some(match operator {
        Operator::Equal => Operator::Unequal,
        Operator::Unequal => Operator::Equal,
        Operator::Less => Operator::GreaterEq,
        Operator::GreaterEq => Operator::Less,
        Operator::LessEq => Operator::Greater,
        Operator::Greater => Operator::LessEq,
        _ => return None,
    })
}

fn is_zero(value: &Expr) -> bool {
    matches!(value, Expr::Number(digits) if digits == "0")
}

fn is_one(value: &Expr) -> bool {
    matches!(value, Expr::Number(digits) if digits == "1")
}

/// Words that cannot be names.
const KEYWORDS: [&str; 51] = [
    "Self", "abstract", "as", "async", "await", "become", "box", "break", "const", "continue",
    "crate", "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if",
    "impl", "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub",
    "ref", "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "where", "while", "yield",
];

/// Constants of the frame, and of every Rust program.
const OWN_NAMES: [&str; 7] = [
    "ESTIMATES",
    "ESTIMATE_NAMES",
    "Err",
    "None",
    "Ok",
    "SIGNAL_NAMES",
    "Some",
];

/// Names of a function that mean something else in Rust, with what they are called instead. A local name cannot
/// be that of a constant; those of the runtime are names in no draft.
fn renamed(scope: &Scope, program: &Program<'_>) -> HashMap<String, String> {
    let is_taken = |name: &str| {
        KEYWORDS.contains(&name) || OWN_NAMES.contains(&name) || program.has_table(name)
    };
    let mut others = HashMap::new();
    for name in scope.names().iter().filter(|name| is_taken(name)) {
        let mut other = format!("{name}_");
        while is_taken(&other) || scope.variable(&other).is_some() {
            other.push('_');
        }
        others.insert(name.clone(), other);
    }
    others
}
