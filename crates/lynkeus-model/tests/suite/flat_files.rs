//! What flat files bring: units on every variable, and thousands of equations.

use std::time::Duration;

use lynkeus_expr::Tape;

use crate::support::{plant, refused, within};

#[test]
fn units_that_do_not_fit_are_told() {
    let warnings = |declarations: &str, equations: &str| {
        let text = format!("model M\n{declarations}\nequation\n{equations}\nend M;");
        let told = plant(&text).warnings;
        told.iter()
            .map(|w| format!("{}: {}", w.line, w.message))
            .collect::<Vec<_>>()
    };
    let tank = "Real T(unit = \"K\"); Real C(unit = \"degC\"); Real h(unit = \"m\"); \
                Real t(unit = \"s\"); parameter Real q(unit = \"m/h\") = 2; Real d(unit = \"mm\"); \
                parameter Real r(unit = \"m/s\") = 1; parameter Real k = 3;";
    let rest = "der(T) = k; t = time; der(h) = k*q;";
    assert_eq!(
        warnings(tank, &format!("{rest}\nC = T;\nd = h;")),
        [
            "5: a degree Celsius against a kelvin: one is degC, the other side is K",
            "6: the same quantity in two units: one is mm, the other side is m",
        ]
    );
    assert_eq!(
        warnings(
            tank,
            "der(T) = k;\nder(h) = q;\nder(d) = 1000*r; t = if h > T then h else k; C = k;"
        ),
        [
            "6: units differ: one is m, what it is compared with is K",
            "6: units differ: one is s, the other side is m"
        ]
    );
    // one rate over hours, another over seconds
    assert_eq!(
        warnings(
            "Real h(unit = \"m\"); Real x(unit = \"m\"); parameter Real q(unit = \"m/h\") = 2; parameter Real r(unit = \"m/s\") = 1;",
            "der(h) = q;\nder(x) = r;"
        ),
        ["5: this equation takes 1 s as the unit of time, line 4 takes 3600 s"]
    );
    // a difference of degrees Celsius is one of kelvin
    assert_eq!(
        warnings(
            "Real C(unit = \"degC\"); Real D(unit = \"degC\"); Real d(unit = \"K\"); \
             parameter Real G(unit = \"W/K\") = 1; Real Q(unit = \"W\"); Real m(unit = \"m\");",
            "D = 3; d = C - D; Q = G*(C - D); m = G*(C - D);\nder(C) = 1;"
        ),
        ["4: units differ: one is m, the other side is kg.m2.s-3"]
    );
    // what fits, or says nothing, is left alone
    let quiet = "Real v(unit = \"V\"); parameter Real R(unit = \"Ohm\") = 2; parameter Real C(unit = \"F\") = 1; \
                 Real i(unit = \"A\"); Real P(unit = \"W\"); Real e; Real cells(unit = \"cells\");";
    let equations =
        "C*der(v) = i; v = -R*i + 2; P = v^2/R + v*i; e = exp(v/(R*i)) + sqrt(v*v)/v; cells = v;";
    assert_eq!(warnings(quiet, equations), Vec::<String>::new());
}

/// A chain of n equations as compilers write them.
fn chain(n: usize) -> String {
    let mut text = String::from("model Chain\n  Real x(start = 1, fixed = true);\n");
    for i in 0..n {
        text += &format!("  Real 'part[{i}].p.v'(start = 0.0, unit = \"V\") \"Potential\";\n");
    }
    text += "equation\n  der(x) = -'part[0].p.v';\n";
    for i in 0..n - 1 {
        text += &format!("  0.0 = ('part[{i}].p.v' - (0.5*'part[{}].p.v'));\n", i + 1);
    }
    text + &format!("  'part[{}].p.v' = x;\nend Chain;\n", n - 1)
}

/// The best of ten times from text to tape. Ask for it with
/// `cargo test --release -p lynkeus-model --test suite text_to_tape -- --ignored --nocapture`.
#[test]
#[ignore = "measures time"]
fn text_to_tape_of_flat_equations() {
    for n in [1_000, 10_000] {
        let text = chain(n);
        let time = || {
            let start = std::time::Instant::now();
            let plant = plant(&text);
            let tape = Tape::new(&plant.graph, &[plant.states[0].node], &plant.derivatives);
            assert!(tape.is_ok());
            start.elapsed()
        };
        let best = (0..10).map(|_| time()).min().unwrap();
        println!("{n} equations: {best:?}");
        assert!(best.as_secs_f64() < 0.5, "{best:?}");
    }
}

#[test]
fn ten_thousand_flat_equations_are_read_soon() {
    let n = 10_000;
    let text = chain(n);
    // half a second of a processor's time in a release build; room for less speed
    let read = within(Duration::from_secs(5), || plant(&text));
    assert_eq!(read.algebraics.len(), n);
    // a ladder of as many equations that need each other, linear and not
    let ladder = |term: &str| {
        let mut text = String::from("model Loop Real x; ");
        text += &format!("Real v[{n}]; equation der(x) = v[1]; v[1] = x; v[{n}] = 0;\n");
        text += &format!("for i in 2:{n} - 1 loop 2*v[i] = v[i - 1] + {term}; end for; end Loop;");
        text
    };
    let found = within(Duration::from_secs(10), || {
        assert_eq!(plant(&ladder("v[i + 1]")).states.len(), 1);
        refused(&ladder("sin(v[i + 1])"))
    });
    assert!(
        found.message.contains("need each other"),
        "{}",
        found.message
    );
}
