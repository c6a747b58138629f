use super::*;
use crate::curly::template::{chosen, parts};

const RUNTIME: [(&str, &str); 15] = [
    ("along", include_str!("../../runtime/along.c")),
    ("credible", include_str!("../../runtime/credible.c")),
    ("extended", include_str!("../../runtime/extended.c")),
    ("filter", include_str!("../../runtime/filter.c")),
    ("integrate", include_str!("../../runtime/integrate.c")),
    ("judge", include_str!("../../runtime/judge.c")),
    ("library", include_str!("../../runtime/library.c")),
    ("linearised", include_str!("../../runtime/linearised.c")),
    ("predict", include_str!("../../runtime/predict.c")),
    ("push", include_str!("../../runtime/push.c")),
    ("sampled", include_str!("../../runtime/sampled.c")),
    ("spread", include_str!("../../runtime/spread.c")),
    ("steps", include_str!("../../runtime/steps.c")),
    ("tuned", include_str!("../../runtime/tuned.c")),
    ("unscented", include_str!("../../runtime/unscented.c")),
];

/// The names of all conditions of a text.
fn conditions(text: &str) -> Vec<&str> {
    let lines = text.lines().filter_map(|line| line.strip_prefix("//?"));
    lines
        .map(|line| line.trim().trim_start_matches('!'))
        .collect()
}

#[test]
fn every_part_of_the_runtime_is_a_draft() {
    for (name, text) in RUNTIME {
        let text = text.replace("FIRST_READINGS", "widen(s, s->x[0]);");
        let text = match name {
            "library" => parts(&text)
                .map(|part| part.1)
                .collect::<Vec<_>>()
                .join("\n"),
            _ => text,
        };
        for holds in [vec![], conditions(&text)] {
            let items = parsed(&chosen(&text, &holds)).unwrap_or_else(|e| panic!("{name}: {e}"));
            let functions = items
                .iter()
                .filter(|item| matches!(item, Item::Function(_)));
            let functions = functions.count();
            let static_functions = chosen(&text, &holds).matches("\nstatic ").count();
            let begins = usize::from(text.starts_with("static "));
            assert_eq!(functions, static_functions + begins, "{name}");
        }
    }
}

#[test]
fn what_is_no_draft_is_refused_with_its_line() {
    let body = |line: &str| format!("static void f(int i)\n{{\n    {line}\n}}\n");
    let cases = [
        ("goto end;", "`end`"),
        ("i = 1", "`}`"),
        ("i = *p;", "`*`"),
        ("do { i++; } while (i < 3);", "`{`"),
        ("i = (1 + 2;", "`;`"),
        ("i = R(x);", "`x`"),
    ];
    for (line, found) in cases {
        let refusal = parsed(&body(line)).unwrap_err().to_string();
        assert!(
            refusal.contains("line 3") || refusal.contains("line 4"),
            "{refusal}"
        );
        assert!(
            refusal.contains(&format!("found {found}")),
            "{line}: {refusal}"
        );
    }
    assert!(parsed("int i;").is_err());
}

#[test]
fn operations_bind_as_in_c() {
    let value = |text: &str| {
        let draft = format!("static void f(int i)\n{{\n    i = {text};\n}}\n");
        let items = parsed(&draft).unwrap();
        let [Item::Function(function)] = &items[..] else {
            panic!("{items:?}")
        };
        let Statement::Assign { value, .. } = &function.body[0].statement else {
            panic!("{function:?}")
        };
        value.clone()
    };
    let name = |name: &str| Box::new(Expr::Name(name.into()));
    let of = |operator, left, right| Box::new(Expr::Binary(operator, left, right));
    use Operator::{Add, And, Less, Mul, Or, Sub};
    let sum = of(
        Sub,
        of(Sub, name("a"), name("b")),
        of(Mul, name("c"), name("d")),
    );
    assert_eq!(value("a - b - c * d"), *sum);
    let relation = of(Less, name("a"), of(Add, name("b"), name("c")));
    let both = of(And, relation, name("d"));
    assert_eq!(value("a < b + c && d || e"), *of(Or, both, name("e")));
    let cast = Expr::Cast(Type::Real, name("a"));
    assert_eq!(value("(real)a * b"), *of(Mul, Box::new(cast), name("b")));
    let choice = Expr::Choice(name("a"), name("b"), name("c"));
    assert_eq!(value("a ? b : c"), choice);
}
