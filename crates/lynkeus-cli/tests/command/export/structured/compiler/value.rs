//! Values, each with its type.

use tree_sitter::Node;

use super::{Compiler, Composed, Kind, Value, Variable, children, of_kind};

impl Compiler<'_> {
    pub(super) fn value(&mut self, node: Node<'_>) -> Value {
        let parts = children(node);
        let text = self.text[node.byte_range()].to_owned();
        let of = |text: String, kind: Kind| Value { text, kind };
        match node.kind() {
            "integer_literal" => of(text, Kind::Dint),
            "real_literal" => {
                // what REAL has not, compilers refuse
                let size = text.parse::<f64>().unwrap().abs();
                assert!(size == 0.0 || (1.2e-38..=3.4e38).contains(&size), "{text}");
                assert!(text.contains('.'), "{text}");
                of(text, Kind::AnyReal)
            }
            "typed_literal" => Value {
                text: self.value(parts[2]).text,
                kind: self.kind(parts[0]),
            },
            "boolean_literal" => of(u8::from(self.word(node) == "true").to_string(), Kind::Bool),
            "parenthesized_expression" => {
                let inner = self.value(parts[1]);
                of(format!("({})", inner.text), inner.kind)
            }
            "identifier" => self.variable(&text),
            "member_access_expression" => self.member(&parts),
            "index_expression" => self.entry(&parts),
            "unary_expression" => self.unary(&parts),
            "binary_expression" => self.binary(&parts),
            "call_expression" => self.call(&parts),
            other => panic!("{other}: {text}"),
        }
    }

    fn find(&self, name: &str) -> Variable {
        let name = name.to_ascii_lowercase();
        let found = self.variables.iter().find(|own| own.name == name);
        found.unwrap_or_else(|| panic!("no {name}")).clone()
    }

    fn variable(&self, name: &str) -> Value {
        let found = self.find(name);
        let star = if found.is_shared { "*" } else { "" };
        Value {
            text: format!("({star}v_{})", found.name),
            kind: found.kind,
        }
    }

    fn composed(&self, value: &Value) -> Composed {
        match &value.kind {
            Kind::Named(name) => self.types[name].clone(),
            _ => panic!("{} has no parts", value.text),
        }
    }

    fn member(&mut self, parts: &[Node<'_>]) -> Value {
        let whole = self.value(parts[0]);
        let name = self.word(parts[2]);
        let Composed::Structure(fields) = self.composed(&whole) else {
            panic!("{} is no structure", whole.text);
        };
        let field = fields.into_iter().find(|field| field.0 == name);
        Value {
            text: format!("{}.v_{name}", whole.text),
            kind: field.unwrap().1,
        }
    }

    fn entry(&mut self, parts: &[Node<'_>]) -> Value {
        let whole = self.value(parts[0]);
        let place = self.place(parts[2]);
        let Composed::Array(count, kind) = self.composed(&whole) else {
            panic!("{} is no array", whole.text);
        };
        Value {
            text: format!("{}.e[at({place}, {count})]", whole.text),
            kind,
        }
    }

    fn unary(&mut self, parts: &[Node<'_>]) -> Value {
        let inner = self.value(parts[1]);
        let sign = match self.word(parts[0]).as_str() {
            "not" => {
                assert_eq!(inner.kind, Kind::Bool, "{}", inner.text);
                "!"
            }
            _ => {
                assert_ne!(inner.kind, Kind::Bool, "{}", inner.text);
                "-"
            }
        };
        Value {
            text: format!("({sign}{})", inner.text),
            kind: inner.kind,
        }
    }

    fn binary(&mut self, parts: &[Node<'_>]) -> Value {
        let (left, right) = (self.value(parts[0]), self.value(parts[2]));
        let kind = match (&left.kind, &right.kind) {
            (a, b) if a == b => a.clone(),
            (Kind::AnyReal, other @ (Kind::Real | Kind::Lreal))
            | (other @ (Kind::Real | Kind::Lreal), Kind::AnyReal) => other.clone(),
            other => panic!("{other:?}: {} and {}", left.text, right.text),
        };
        assert!(!matches!(kind, Kind::Named(_)));
        let word = self.word(parts[1]);
        let is_truth = kind == Kind::Bool;
        let (sign, result) = match word.as_str() {
            "and" | "or" => {
                assert!(is_truth);
                (if word == "and" { "&" } else { "|" }, Kind::Bool)
            }
            "=" => ("==", Kind::Bool),
            "<>" => ("!=", Kind::Bool),
            "<" | "<=" | ">" | ">=" => {
                assert!(!is_truth);
                (word.as_str(), Kind::Bool)
            }
            _ => {
                assert!(!is_truth);
                (word.as_str(), kind.clone())
            }
        };
        // a literal is of the type of the other
        let of_kind = |value: Value| match (&kind, value.kind) {
            (Kind::Real, Kind::AnyReal) => format!("(float)({})", value.text),
            _ => value.text,
        };
        Value {
            text: format!("({} {sign} {})", of_kind(left), of_kind(right)),
            kind: result,
        }
    }

    fn call(&mut self, parts: &[Node<'_>]) -> Value {
        let name = self.word(parts[0]);
        if self.functions.contains_key(&name) {
            return self.own(&name, parts[1]);
        }
        let given = children(parts[1]);
        let given = given.into_iter().filter(|part| part.is_named());
        let given: Vec<Value> = given.map(|part| self.value(part)).collect();
        let kinds: Vec<Kind> = given.iter().map(|value| value.kind.clone()).collect();
        let kind = kinds[0].clone();
        let texts: Vec<String> = given.into_iter().map(|value| value.text).collect();
        if let Some((from, to)) = name.split_once("_to_") {
            let word = format!("{kind:?}").to_lowercase();
            assert_eq!(from, word, "{name}");
            let (c, kind) = match to {
                "lreal" => ("double", Kind::Lreal),
                "real" => ("float", Kind::Real),
                other => panic!("{other}"),
            };
            return Value {
                text: format!("(({c})({}))", texts[0]),
                kind,
            };
        }
        if name == "trunc" {
            assert!([Kind::Real, Kind::Lreal].contains(&kind));
            return Value {
                text: format!("((int32_t)({}))", texts[0]),
                kind: Kind::Dint,
            };
        }
        let function = match name.as_str() {
            "abs" => "fabs",
            "ln" => "log",
            "expt" => "pow",
            "sqrt" | "exp" | "sin" | "cos" | "tan" | "asin" | "acos" | "atan" => name.as_str(),
            other => panic!("{other}"),
        };
        let suffix = if kind == Kind::Real { "f" } else { "" };
        // a literal alone is REAL for some compilers
        assert!(
            kinds.iter().all(|other| *other == kind),
            "{name}: {kinds:?}"
        );
        assert!(
            [Kind::Real, Kind::Lreal].contains(&kind),
            "{name}: {kind:?}"
        );
        Value {
            text: format!("{function}{suffix}({})", texts.join(", ")),
            kind,
        }
    }

    /// A function of the program: every parameter is given, by name.
    fn own(&mut self, name: &str, list: Node<'_>) -> Value {
        let function = self.functions[name].clone();
        let arguments = of_kind(list, "named_argument");
        assert_eq!(arguments.len(), function.parameters.len(), "{name}");
        let mut texts = vec![];
        for parameter in &function.parameters {
            let argument = arguments
                .iter()
                .find(|argument| self.name_of(**argument) == parameter.name);
            let given = children(*argument.unwrap())[2];
            let value = self.value(given);
            let is_literal =
                value.kind == Kind::AnyReal && [Kind::Real, Kind::Lreal].contains(&parameter.kind);
            assert!(
                is_literal || value.kind == parameter.kind,
                "{name}: {} := {}",
                parameter.name,
                value.text
            );
            if parameter.is_shared {
                let kinds = ["identifier", "member_access_expression"];
                assert!(kinds.contains(&given.kind()), "{name}: {}", value.text);
                texts.push(format!("&{}", value.text));
            } else if parameter.kind == Kind::Real {
                texts.push(format!("(float)({})", value.text));
            } else {
                texts.push(value.text);
            }
        }
        Value {
            text: format!("f_{name}({})", texts.join(", ")),
            kind: function.returns,
        }
    }
}
