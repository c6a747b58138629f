//! Text written to break the reader ends in a diagnostic, soon and within bounds.

use std::time::Duration;

use lynkeus_model::{Diagnostic, LoadOptions, Plant, parse_expression};

use super::support::within;

/// A second is usual, of a processor's time; the bound leaves room for a slow one.
const SOON: Duration = Duration::from_secs(5);

/// What becomes of a text, which must be told soon.
fn read(text: &str) -> Result<Plant, Diagnostic> {
    within(SOON, || {
        Plant::from_modelica(text, "hostile.mo", &LoadOptions::default())
    })
}

/// The refusal, which must come soon.
fn refused(text: &str) -> Diagnostic {
    let result = read(text);
    let refused = result.expect_err("must be refused");
    // Also the rendered text stays short.
    assert!(
        refused.to_string().len() < 4000,
        "{}",
        refused.to_string().len()
    );
    refused
}

fn equation(equation: &str) -> String {
    format!("model M Real x; equation {equation}; end M;")
}

#[test]
fn deep_nesting() {
    let n = 100_000;
    let levels = "nested more than 200 levels deep";
    for text in [
        equation(&format!("der(x) = {}x{}", "(".repeat(n), ")".repeat(n))),
        equation(&format!("der(x) = {}x", "(".repeat(n))),
        equation(&format!("der(x) = if {}x then 1 else 2", "not ".repeat(n))),
        equation(&format!("der(x) = {}", "if x > 0 then 1 else ".repeat(n))),
        equation(&format!("der(x) = {}", "if ".repeat(n))),
        equation(&format!("der(x) = {}", "sin(".repeat(n))),
        equation(&format!("der(x) = {}", "{".repeat(n))),
        equation(&format!("der(x) = {}", "[".repeat(n))),
        equation(&format!("der(x) = {}", "x[".repeat(n))),
        equation(&"for i in 1:2 loop ".repeat(n)),
        equation(&"if x > 0 then ".repeat(n)),
        format!("model M Real x(start = {}", "(".repeat(n)),
    ] {
        assert_eq!(refused(&text).message, levels, "{}", &text[..60]);
    }
    // one sign is read, however many follow
    for text in [
        equation(&format!("der(x) = {}x", "-".repeat(n))),
        equation(&format!("der(x) = 1*{}x", "- ".repeat(n))),
        equation(&format!("der(x) = 2^{}x", "-".repeat(n))),
    ] {
        let message = refused(&text).message;
        assert!(message.contains("sign"), "{message}: {}", &text[..60]);
    }
    let nested = format!("{}1{}", "(".repeat(n), ")".repeat(n));
    let graph = lynkeus_expr::Graph::new();
    assert_eq!(
        parse_expression(&nested, &graph, &|_| None)
            .unwrap_err()
            .message,
        levels
    );
}

#[test]
fn the_deepest_allowed_nesting_is_taken() {
    // Levels that one repetition costs: its bracket, and the operand it stands in.
    for (open, close, levels) in [
        ("(", ")", 1),
        ("-(", ")", 2),
        ("sin(", ")", 1),
        ("{1, 2}*{1, ", "}", 2),
        ("if x > 0 then 1 else (", ")", 2),
        ("1 + 2*(", ")", 3),
        ("2^(", ")", 2),
        (
            "x^(1 + (if x > 0 and x < 1 or 1 > 2*(",
            ") then 1 else 2))",
            10,
        ),
    ] {
        let n = 190 / levels;
        let text = equation(&format!("der(x) = {}x{}", open.repeat(n), close.repeat(n)));
        let plant = Plant::from_modelica(&text, "deep.mo", &LoadOptions::default());
        assert!(plant.is_ok(), "{open}: {}", plant.unwrap_err());
    }
}

#[test]
fn long_chains() {
    // Taken, or refused by a limit: never a stack overflow, also when all is dropped.
    for operator in ["+", "-", "*", "/", ".+"] {
        let text = equation(&format!(
            "der(x) = {}x",
            format!("x{operator}").repeat(400_000)
        ));
        let plant = read(&text);
        assert!(plant.is_ok(), "{}", plant.unwrap_err());
    }
    for word in [" and ", " or "] {
        let chain = format!("x > 0{word}").repeat(100_000);
        let text = equation(&format!("der(x) = if {chain}x > 1 then 1 else 2"));
        assert!(Plant::from_modelica(&text, "chain.mo", &LoadOptions::default()).is_ok());
    }
    let million = equation(&format!("der(x) = {}x", "x+".repeat(1_000_000)));
    let found = refused(&million);
    assert_eq!(
        found.message,
        "the text has more than 2,000,000 operands and operators"
    );
}

#[test]
fn a_line_of_ten_megabytes() {
    let long = "x".repeat(10 << 20);
    let found = refused(&equation(&format!("der(x) = {long}")));
    assert_eq!(found.message, "this name is longer than 250 characters");
    let found = refused(&equation(&format!("der(x) = {}", "1".repeat(10 << 20))));
    assert!(
        found.message.starts_with("the Integer 1111"),
        "{}",
        found.message
    );
    let found = refused(&equation(&format!("der(x) = /*{long}*/ y")));
    assert_eq!(
        found.column as usize,
        1 + "model M Real x; equation der(x) = /**/ ".len() + long.len()
    );
    assert!(found.to_string().contains("*/ y; end M;"), "{found}");
    refused(&format!("model M \"{long}\" Real"));
    refused(&"é".repeat(5 << 20));
    refused(&"\0".repeat(10 << 20));
    refused(&"(".repeat(10 << 20));
    refused(&equation(&"x;".repeat(5 << 20)));
    refused(&format!("model M {}", "Real x;".repeat(1_000_000)));
}

#[test]
fn huge_sizes_and_loops() {
    let million = "1000000000";
    let scalars = "200,000 scalar variables and parameters";
    let operations = "1,000,000 scalar operations";
    for (text, limit) in [
        (
            format!("model M Real x[{million}]; equation der(x) = x; end M;"),
            scalars,
        ),
        (
            format!("model M Real x[{million},{million},{million}]; end M;"),
            scalars,
        ),
        (format!("model M Real x[{million},0]; end M;"), scalars),
        (
            "model M Real x[1000,1000]; equation der(x) = x; end M;".to_owned(),
            scalars,
        ),
        (
            format!("model M parameter Real p[{million}] = ones({million}); end M;"),
            operations,
        ),
        (
            equation(&format!("for i in 1:{million} loop der(x) = x; end for")),
            operations,
        ),
        (
            equation(&format!("for i in 1:{million} loop end for")),
            operations,
        ),
        (
            equation("for i in 1:2000, j in 1:2000 loop end for"),
            operations,
        ),
        (
            equation("for i in 1:9000000000000000000 loop end for"),
            operations,
        ),
        (
            equation("for i in -9000000000000000000:9000000000000000000 loop end for"),
            operations,
        ),
        (equation("for i in 0:1e-300:1 loop end for"), operations),
        (
            equation(&format!("der(x) = sum(zeros({million}))")),
            operations,
        ),
        (
            equation(&format!("der(x) = sum(zeros({million}, 0))")),
            operations,
        ),
        (
            equation(&format!("der(x) = sum(identity({million}))")),
            operations,
        ),
        (
            equation(&format!("der(x) = sum(linspace(0, 1, {million}))")),
            operations,
        ),
        (
            equation("der(x) = sum(i*j*k for i in 1:1000, j in 1:1000, k in 1:1000)"),
            operations,
        ),
        (
            equation("der(x) = sum({{{0 for i in 1:1000} for j in 1:1000} for k in 1:1000})"),
            operations,
        ),
        (
            equation("der(x) = sum(ones(1000, 1000)*ones(1000, 1000))"),
            operations,
        ),
        (equation("der(x) = sum(fill(1, 200, 200, 200))"), operations),
    ] {
        let found = refused(&text);
        assert!(found.message.contains(limit), "{text}: {}", found.message);
    }
}

#[test]
fn texts_of_large_arrays() {
    let text = format!(
        "model M Real x[1000] \"{}\"; equation der(x) = x; end M;",
        "d".repeat(1 << 20)
    );
    assert!(
        refused(&text)
            .message
            .contains("bytes of names, units and descriptions")
    );
    let text = format!(
        "model M Real x[1000](unit = \"{}\"); end M;",
        "u".repeat(1 << 20)
    );
    assert!(
        refused(&text)
            .message
            .contains("bytes of names, units and descriptions")
    );
}

#[test]
fn many_dimensions() {
    let ones = vec!["1"; 100_000].join(",");
    for text in [
        format!("model M Real x[{ones}]; equation der(x) = x; end M;"),
        equation(&format!("der(x) = sum(zeros({ones}))")),
        equation(&format!("der(x) = x[{ones}]")),
    ] {
        assert_eq!(
            refused(&text).message,
            "an array of more than 32 dimensions"
        );
    }
}

#[test]
fn many_names() {
    let declarations: Vec<String> = (0..100_000)
        .map(|i| format!("Real {}{i};", "n".repeat(50)))
        .collect();
    let text = format!(
        "model M {} equation {} = 1; end M;",
        declarations.join(" "),
        "n".repeat(54)
    );
    assert!(refused(&text).message.starts_with("unknown name `nnn"));
    let models: Vec<String> = (0..20_000)
        .map(|i| format!("model M{i} end M{i};"))
        .collect();
    assert!(
        refused(&models.join(" "))
            .message
            .starts_with("the text holds 20000 models")
    );
}

#[test]
fn many_iterators() {
    let iterators: Vec<String> = (0..100_000).map(|i| format!("i{i} in 1:1")).collect();
    let text = equation(&format!("der(x) = sum(x for {})", iterators.join(", ")));
    assert_eq!(refused(&text).message, "more than 32 iterators");
}

#[test]
fn long_chains_of_parameters() {
    let n = 50_000;
    let chain: Vec<String> = (1..n)
        .map(|i| format!("parameter Real p{i} = p{};", i + 1))
        .collect();
    let text = |last: &str| {
        format!(
            "model M {} {last} Real x; equation der(x) = p1; end M;",
            chain.join(" ")
        )
    };
    let cycle = refused(&text(&format!("parameter Real p{n} = p1;")));
    assert!(
        cycle.message.contains("… 49992 more …"),
        "{}",
        cycle.message
    );
    let taken = text(&format!("parameter Real p{n} = 3;"));
    assert!(Plant::from_modelica(&taken, "chain.mo", &LoadOptions::default()).is_ok());
}

#[test]
fn long_chains_of_algebraic_variables() {
    let n = 20_000;
    let text = |last: &str| {
        format!(
            "model M parameter Integer n = {n}; Real a[n]; Real x; equation der(x) = a[1]; \
             for i in 1:n - 1 loop a[i] = sin(a[i + 1]); end for; a[n] = {last}; end M;"
        )
    };
    for last in ["x", "cos(a[1])"] {
        assert!(read(&text(last)).is_ok());
    }
}

#[test]
fn dense_systems() {
    let text = "model M parameter Integer n = 500; Real a[n]; Real x; equation der(x) = 1; \
                for i in 1:n loop a[i] = sum(a)^2; end for; end M;";
    assert!(refused(text).message.contains("need each other"));
    let mass = |n: usize| {
        format!(
            "model M parameter Integer n = {n}; Real v[n]; equation \
             for i in 1:n loop sum(der(v)) + der(v[i]) = 1; end for; end M;"
        )
    };
    let found = refused(&mass(400));
    assert_eq!(
        found.message,
        "the model needs more than 5,000,000 steps to solve its equations"
    );
    assert!(read(&mass(64)).is_ok());
}

#[test]
fn control_characters() {
    for text in [
        "\0",
        "model M\0 end M;",
        "\u{1b}[31m",
        "model \u{200b}M",
        "\r\r\r",
        "model M;\r\n;",
    ] {
        refused(text);
    }
}

#[test]
fn numbers_at_the_edge() {
    for expression in [
        "-9223372036854775807 - 2",
        "abs(-9223372036854775807 - 1)",
        "div(-9223372036854775807 - 1, -1)",
        "sum(9223372036854775800:9223372036854775807)",
        "integer(1e300)",
    ] {
        let found = refused(&equation(&format!("der(x) = {expression}")));
        assert!(
            found.message.contains("does not fit in 64 bits"),
            "{expression}: {found}"
        );
    }
    for expression in [
        "rem(-9223372036854775807 - 1, -1)",
        "0^0",
        "2^10000",
        "(-8)^(1/3)",
    ] {
        // Taken or refused, without a panic.
        let text = equation(&format!("der(x) = {expression}"));
        drop(Plant::from_modelica(
            &text,
            "edge.mo",
            &LoadOptions::default(),
        ));
    }
}
