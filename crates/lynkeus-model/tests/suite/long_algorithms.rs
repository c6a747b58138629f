//! Algorithms and imports whose length asks for more than memory and time: an answer, soon.

use std::fmt::Write;
use std::time::Duration;

use lynkeus_model::{Diagnostic, LoadOptions, Plant};

use super::support::within;

/// A second is usual, of a processor's time; the bound leaves room for a slow one.
const SOON: Duration = Duration::from_secs(10);

fn read(text: &str) -> Result<Plant, Diagnostic> {
    within(SOON, || {
        Plant::from_modelica(text, "long.mo", &LoadOptions::default())
    })
}

/// A model of one state whose slope is that function of it.
fn function(body: &str) -> String {
    format!(
        "package P function f input Real x; output Real y; protected Real z[20000]; algorithm {body} end f;
         model M Real x; equation der(x) = f(x); end M; end P;"
    )
}

#[test]
fn ten_thousand_branches() {
    let chain = |value: &dyn Fn(usize) -> String, last: &str| {
        let mut text = format!("if x > 0 then {} ", value(0));
        for i in 1..10_000 {
            write!(text, "elseif x > {i} then {} ", value(i)).unwrap();
        }
        text + "else " + last
    };
    let statements = chain(&|i| format!("a := {i};"), "a := -1; end if;");
    let equations = chain(&|i| format!("a = {i};"), "a = -1; end if;");
    let value = chain(&|i| i.to_string(), "-1");
    for part in [
        format!("algorithm {statements}"),
        format!("equation {equations}"),
        format!("equation a = {value};"),
    ] {
        let text = format!("model M Real x; Real a; {part} equation der(x) = a; end M;");
        assert_eq!(read(&text).unwrap().states.len(), 1);
    }
}

#[test]
fn every_copy_of_an_array_counts() {
    let fill = "for i in 1:20000 loop z[i] := i; end for; y := 0;";
    let sum = format!("{fill} for i in 1:20000 loop y := y + z[i]; end for;");
    assert!(read(&function(&sum)).is_ok());
    let if_more = "if x > i then y := y + 1; end if;";
    let branches = format!("{fill} for i in 1:20000 loop {if_more} end for;");
    let found = read(&function(&branches)).unwrap_err();
    let limit = "1,000,000 scalar operations";
    assert!(found.message.contains(limit), "{}", found.message);
}

#[test]
fn names_among_many_imports() {
    let text = |imports: usize, calls: usize| {
        let imports: String = (0..imports).map(|i| format!("import A{i}.*;")).collect();
        let calls = "+ sin(x)".repeat(calls);
        format!("model M {imports} Real x; equation der(x) = x {calls}; end M;")
    };
    assert!(read(&text(1_000, 50_000)).is_ok());
    let found = read(&text(50_000, 50_000)).unwrap_err();
    assert_eq!(found.message, "a class with more than 1,000 imports");
}

/// Statements that give a value to `y`, so many levels deep.
type Body<'a> = &'a dyn Fn(&str, usize) -> String;

/// Functions that call each other, each from as deep as a text may be nested.
#[test]
fn depth_adds_up_over_calls() {
    let text = |count: usize, levels: usize, body: Body<'_>| {
        let mut text = String::from("package P ");
        for k in 0..count {
            let value = match k {
                0 => "x".to_owned(),
                _ => format!("f{}(x)", k - 1),
            };
            let body = body(&value, levels);
            let head = format!("function f{k} input Real x; output Real y;");
            write!(text, "{head} algorithm y := 0; {body} end f{k};").unwrap();
        }
        let last = count - 1;
        text + &format!("model M Real x; equation der(x) = f{last}(x); end M; end P;")
    };
    let around = |open: &str, inner: &str, close: &str, levels: usize| {
        format!("{}{inner}{}", open.repeat(levels), close.repeat(levels))
    };
    let value = |v: &str, n: usize| format!("y := {};", around("sin(", v, ")", n));
    let loops =
        |v: &str, n: usize| around("for i in 1:1 loop ", &format!("y := {v};"), "end for; ", n);
    let branches =
        |v: &str, n: usize| around("if x > 0 then ", &format!("y := {v};"), "end if; ", n);
    for body in [&value as Body<'_>, &loops, &branches] {
        let found = read(&text(39, 190, body)).unwrap_err();
        let limit = "nested more than 400 levels";
        assert!(found.message.starts_with(limit), "{}", found.message);
        assert!(read(&text(39, 3, body)).is_ok());
        assert!(read(&text(1, 190, body)).is_ok());
    }
}

#[test]
fn a_chain_of_parameters_declared_one_by_one() {
    let mut text = String::from("model M parameter Real p[1] = 1; ");
    for i in 2..=20_000 {
        write!(text, "parameter Real p[{i}] = p[{}] + 1; ", i - 1).unwrap();
    }
    let plant = read(&(text + "Real x; equation der(x) = p[20000]; end M;")).unwrap();
    assert_eq!(
        plant.graph.constant_value(plant.derivatives[0]),
        Some(20_000.0)
    );
}
