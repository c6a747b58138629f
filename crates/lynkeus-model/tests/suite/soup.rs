//! Random texts: no panic, and every refusal points into the text.

use lynkeus_model::{LoadOptions, Plant, parse_expression};
use proptest::prelude::*;

const WORDS: &[&str] = &[
    "model",
    "end",
    "M",
    "Real",
    "Integer",
    "parameter",
    "constant",
    "input",
    "output",
    "x",
    "y",
    "n",
    "[",
    "]",
    "(",
    ")",
    "{",
    "}",
    ",",
    ";",
    ":",
    "=",
    "==",
    "<",
    ">=",
    "<>",
    "+",
    "-",
    "*",
    "/",
    "^",
    ".*",
    ".^",
    "der",
    "if",
    "then",
    "else",
    "elseif",
    "for",
    "in",
    "loop",
    "equation",
    "and",
    "or",
    "not",
    "time",
    "sum",
    "zeros",
    "size",
    "sqrt",
    "mod",
    "1",
    "2",
    "3",
    "0",
    "1.5",
    "start",
    "min",
    "each",
    "annotation",
    "\"text\"",
    "when",
    "end M;",
    "end for;",
    "// c\n",
    "/*",
    "*/",
    "é",
    "\0",
    "999999999999",
    "i",
    "transpose",
    "cat",
    "linspace",
    "'q'",
    ".",
    "package",
    "function",
    "record",
    "type",
    "extends",
    "import",
    "algorithm",
    "initial",
    ":=",
    "assert(",
    "R",
    "f",
    "R(",
    "f(",
    "'r.x'",
    "r.x",
    "while",
    "return",
    "Boolean",
    "enumeration",
    "$i",
];

const MODEL: &str = "model M \"two states\"
  parameter Integer n = 2;
  parameter Real k[n] = {1, 2}, q = 3*k[1];
  input Real u(min = 0, max = 1);
  Real x[n](each start = 1, unit = \"m\");
  Real a;
  output Real y = a + x[end];
equation
  for i in 1:n loop
    k[i]*der(x[i]) = if i == 1 then -q*x[i]^2 else u - sum(x) + min(x[1], a);
  end for;
  0 = 2*a - sqrt(abs(u)) - transpose([x])*[1; 2]*{1}*{1};
end M;";

const PACKAGE: &str = "package P
  import Modelica.Constants.pi;
  type V = Real(unit = \"V\", min = 0);
  record R Real x; V z[2]; end R;
  partial model B parameter Real k = 2; V v(start = k); end B;
  function f input Real x; input R r; output Real y = x; output R q; protected Real s[2];
  algorithm
    s := {x, r.x}; for i in 1:2 loop s[i] := s[i]*r.z[i]; end for;
    if x > 0 then y := s[1]; elseif x < -1 then y := s[2]; else y := pi; end if;
    q := R(y, s); assert(y < 3, \"y\");
  end f;
  model M
    extends B(k = 3); R r(x = 1); R q; R t[2]; Real a; Boolean b = v > 1; Real 'c[1]'; Real 'c[2]'; Real w; Real when_;
  initial equation v = k + 1;
  algorithm a := v; if b then a := a*a; end if;
  equation
    r.z = {v, 2}; (w, q) = f(v, r); t[1] = q; t[2] = R(x = 1, z = c); 'c[1]' = a; c[2] - t[1].z[1] = 0;
    der(v*2) = if b then w else -q.x; when_ = 1;
  end M;
end P;";

/// The text is taken or refused at a place within it.
fn check(text: &str) {
    for symbolic_parameters in [false, true] {
        let options = LoadOptions {
            symbolic_parameters,
            ..LoadOptions::default()
        };
        if let Err(refused) = Plant::from_modelica(text, "soup.mo", &options) {
            assert!(refused.span.start <= refused.span.end);
            assert!(refused.span.end as usize <= text.len());
            assert!(refused.line as usize <= 1 + text.matches('\n').count());
            assert!(!refused.to_string().is_empty() && !refused.one_line().contains('\n'));
        }
    }
}

fn words() -> impl Strategy<Value = Vec<&'static str>> {
    prop::collection::vec(prop::sample::select(WORDS), 0..60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_text(text in ".{0,200}") {
        check(&text);
    }

    #[test]
    fn words_alone(words in words()) {
        check(&words.join(" "));
    }

    #[test]
    fn words_as_equations(words in words()) {
        check(&format!("model M Real x; Real y; equation {}; end M;", words.join(" ")));
    }

    #[test]
    fn words_as_expressions(words in words()) {
        let text = words.join(" ");
        let graph = lynkeus_expr::Graph::new();
        let names = |name: &str| (name == "x").then(|| graph.symbol("x").node());
        drop(parse_expression(&text, &graph, &names));
        check(&format!("model M Real x; Real y; equation der(x) = {text}; y = x; end M;"));
    }

    #[test]
    fn mutated_models(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..12usize,
                                                     prop::sample::select(WORDS)), 1..6)) {
        for model in [MODEL, PACKAGE] {
            let mut text = model.to_owned();
            for (place, removed, word) in &edits {
                let start = place.index(text.len() + 1);
                let end = (start + removed).min(text.len());
                if text.is_char_boundary(start) && text.is_char_boundary(end) {
                    text.replace_range(start..end, word);
                }
            }
            check(&text);
        }
    }
}

#[test]
fn the_models_that_are_mutated_are_taken() {
    for model in [MODEL, PACKAGE] {
        if let Err(refused) = Plant::from_modelica(model, "soup.mo", &LoadOptions::default()) {
            panic!("{refused}");
        }
    }
}
