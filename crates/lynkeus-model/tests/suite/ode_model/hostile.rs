//! Random and hostile texts: no panic, bounded time, and every refusal points into the text.

use lynkeus_model::{LoadOptions, Plant, model_names};
use proptest::prelude::*;

use super::{refused, symbolic, taken};

const WORDS: &[&str] = &[
    "@ODEmodel",
    "@ODEmodel(",
    "m =",
    "using",
    "x",
    "x'(t)",
    "x(t)",
    "y(t)",
    "z",
    "t",
    "(t)",
    "(",
    ")",
    ",",
    "\n",
    "=",
    "'",
    "+",
    "-",
    "*",
    "/",
    "//",
    "^",
    "exp",
    "min",
    "sin(",
    "1",
    "0",
    "2.5",
    ".5",
    "1_000",
    "1e3",
    "1e999",
    "1f0",
    "0x1",
    ".",
    ".*",
    "[",
    "]",
    ";",
    ":",
    "\"",
    "\"\"\"",
    "\\",
    "'a'",
    "#",
    "#=",
    "=#",
    "β",
    "x₁",
    "\u{302}",
    "é",
    "\0",
    "begin",
    "end",
    "if",
    "time",
    "==",
    "$",
    "!",
];

const MODEL: &str = "using StructuralIdentifiability
m = @ODEmodel(
  x₁'(t) = -(a + 1//2)*x₁(t) + 2u(t)^2, # comment
  z'(t) = exp(-β*t)/(1.0e-3 + z(t)) #= more =#
  y(t) = x₁(t) - z(t),
)
other = @ODEmodel(w'(t) = -w(t))";

/// The text is taken or refused at a place within it.
fn check(text: &str) {
    drop(model_names(text, "soup.jl"));
    for model in [None, Some("m".to_owned())] {
        for symbolic_parameters in [false, true] {
            let options = LoadOptions {
                model: model.clone(),
                symbolic_parameters,
                ..LoadOptions::default()
            };
            if let Err(refused) = Plant::from_ode_model(text, "soup.jl", &options) {
                assert!(refused.span.start <= refused.span.end);
                assert!(refused.span.end as usize <= text.len());
                assert!(refused.line as usize <= 1 + text.matches('\n').count());
                assert!(!refused.to_string().is_empty() && !refused.one_line().contains('\n'));
            }
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
        check(&format!("m = @ODEmodel({text})"));
    }

    #[test]
    fn words_alone(words in words()) {
        check(&words.join(" "));
        check(&words.concat());
    }

    #[test]
    fn words_as_models(words in words()) {
        check(&format!("m = @ODEmodel({})", words.join(" ")));
        check(&format!("m = @ODEmodel(x'(t) = {})", words.concat()));
    }

    #[test]
    fn mutated_models(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..12usize,
                                                     prop::sample::select(WORDS)), 1..6)) {
        let mut text = MODEL.to_owned();
        for (place, removed, word) in edits {
            let start = place.index(text.len() + 1);
            let end = (start + removed).min(text.len());
            if text.is_char_boundary(start) && text.is_char_boundary(end) {
                text.replace_range(start..end, word);
            }
        }
        check(&text);
    }
}

#[test]
fn the_model_that_is_mutated_is_taken() {
    let model = Some("m".to_owned());
    let options = LoadOptions {
        model,
        ..symbolic()
    };
    if let Err(refused) = Plant::from_ode_model(MODEL, "soup.jl", &options) {
        panic!("{refused}");
    }
}

fn model(right: &str) -> String {
    format!("@ODEmodel(x'(t) = {right})")
}

#[test]
fn deep_nesting() {
    let n = 100_000;
    for part in ["(", "-", "2(", "exp(", "2^", "1+(2*(", "x(t)^(1//-("] {
        let message = refused(&model(&part.repeat(n))).message;
        assert_eq!(message, "nested more than 200 levels deep", "{part}");
    }
    let message = refused(&"#=".repeat(n)).message;
    assert_eq!(message, "this comment has no end");
}

#[test]
fn the_deepest_allowed_nesting_is_taken() {
    let n = 39;
    let (open, close) = ("1 + 2*3//-(".repeat(n), ")^2".repeat(n));
    taken(&model(&format!("{open}x(t){close}")));
    let (open, close) = ("(".repeat(199), ")".repeat(199));
    taken(&model(&format!("{open}x(t){close}")));
}

#[test]
fn long_texts() {
    let n = 100_000;
    taken(&model(&"x(t)*2 + ".repeat(n).replacen("x(t)*2 +", "x(t) +", 1)).replace("+ )", "+ 1)"));
    let plant = taken(&format!("@ODEmodel(x'(t) = 1{})", "\n-x(t)".repeat(n)));
    assert_eq!(plant.states.len(), 1);
    let equations = (0..n).map(|i| format!("x{i}'(t) = -p{i}*x{i}(t)"));
    let text = format!("@ODEmodel({})", equations.collect::<Vec<_>>().join(","));
    assert_eq!(taken(&text).parameters.len(), n);
    let message = refused(&format!("@ODEmodel({}'(t) = 1)", "x".repeat(n))).message;
    assert_eq!(message, "this name is longer than 250 characters");
    let message = refused(&"@ODEmodel ".repeat(n)).message;
    assert_eq!(
        message,
        "the text holds 100000 models; say which one to take"
    );
}

#[test]
fn too_many_variables() {
    let terms: Vec<String> = (0..250_000).map(|i| format!("p{i}")).collect();
    let message = refused(&model(&terms.join("+"))).message;
    assert_eq!(
        message,
        "the model needs more than 200,000 variables and parameters"
    );
}
