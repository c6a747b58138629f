//! Models that are not rational, with answers by hand (docs/observability.md has the reasons),
//! and identities in disguise.

use super::{expect, plant, question};
use lynkeus_observability::{Question, Verdict, analyse};

/// T' is measured, so that k·e^(−E/T)·c is known as a function of T: k, E and c's scale. With
/// H given besides, c itself.
#[test]
fn arrhenius_reactor() {
    let reactor = |outputs: &str| {
        plant(
            &format!(
                "parameter Real k; parameter Real E; parameter Real H; parameter Real q = 1; input Real cf; input Real Tf; Real c; Real T; {outputs}"
            ),
            "der(c) = q*(cf - c) - k*exp(-E/T)*c; der(T) = q*(Tf - T) + H*k*exp(-E/T)*c;",
        )
    };
    expect(
        &reactor("output Real y = T;"),
        &question(),
        "c T k E H q",
        "",
    );
    let no_feed = Question {
        disturbances: vec!["cf".into()],
        ..question()
    };
    let answer = expect(&reactor("output Real y = T;"), &no_feed, "T k E q", "c H");
    assert_eq!(answer.symmetries[0].invariants, ["H*c"]);
    expect(
        &reactor("output Real y = T; output Real z = c;"),
        &no_feed,
        "c T k E H q",
        "",
    );
}

/// k·e^(E/R)… : E and R only as a quotient, and the frequency factor with its reference.
#[test]
fn arrhenius_with_a_reference_temperature() {
    let model = plant(
        "parameter Real k0; parameter Real E; parameter Real R; parameter Real T0; input Real T; Real c; output Real y = c;",
        "der(c) = -k0*exp(E/R*(1/T0 - 1/T))*c;",
    );
    let answer = expect(&model, &question(), "c", "k0 E R T0");
    let directions: usize = answer.symmetries.iter().map(|s| s.directions).sum();
    assert_eq!(directions, 2);
    let asking = Question {
        about: vec![
            "E/R".into(),
            "k0*exp(E/(R*T0))".into(),
            "log(k0) + E/R/T0".into(),
            "k0".into(),
        ],
        ..question()
    };
    let verdicts = analyse(&model, &asking).unwrap().about;
    let observable: Vec<bool> = verdicts
        .iter()
        .map(|a| a.verdict == Verdict::Observable)
        .collect();
    assert_eq!(observable, [true, true, true, false]);
}

/// Batch growth seen through biomass: m and K from the curve, the yield only with the
/// substrate's scale (S, K, Y scale together); with poisoning exp(−S/P), P as well.
#[test]
fn growth_with_exponential_poisoning() {
    let batch = |output: &str| {
        plant(
            &format!(
                "parameter Real m; parameter Real K; parameter Real P; parameter Real Y; Real X; Real S; {output}"
            ),
            "der(X) = m*S/(K + S)*exp(-S/P)*X; der(S) = -m*S/(K + S)*exp(-S/P)*X/Y;",
        )
    };
    let answer = expect(&batch("output Real y = X;"), &question(), "X m", "S K P Y");
    assert_eq!(answer.symmetries[0].directions, 1);
    assert_eq!(answer.symmetries[0].invariants.len(), 3);
    expect(
        &batch("output Real y = X; output Real z = S;"),
        &question(),
        "X S m K P Y",
        "",
    );
}

/// Only g/l and d; with the torque through 1/(m·l²), l and m·l² but m·l² and l give both.
#[test]
fn pendulum() {
    let model = plant(
        "parameter Real g; parameter Real l; parameter Real d; Real phi; Real w; output Real y = phi;",
        "der(phi) = w; der(w) = -g/l*sin(phi) - d*w;",
    );
    let answer = expect(&model, &question(), "phi w d", "g l");
    assert_eq!(answer.symmetries[0].invariants, ["l/g"]);
    let turned = plant(
        "parameter Real k; parameter Real o; Real phi; Real w; output Real y = w;",
        "der(phi) = w; der(w) = -k*sin(phi + o);",
    );
    // the angle only from the unknown zero; k from w'² + (w''/w)² = k²
    let answer = expect(&turned, &question(), "w k", "phi o");
    assert_eq!(answer.symmetries[0].invariants, ["o + phi"]);
}

/// The inflow is known, and with it the area A; a and √g stand together everywhere.
#[test]
fn tanks() {
    let tanks = |output: &str| {
        plant(
            &format!(
                "parameter Real a; parameter Real b; parameter Real A = 2; parameter Real g = 9.81; input Real q; Real h1(start = 1); Real h2(start = 1); {output}"
            ),
            "A*der(h1) = q - a*sqrt(2*g*h1); A*der(h2) = a*sqrt(2*g*h1) - b*sqrt(2*g*h2);",
        )
    };
    let answer = expect(
        &tanks("output Real y = h2;"),
        &question(),
        "h1 h2 A",
        "a b g",
    );
    assert_eq!(answer.symmetries[0].invariants, ["b/a", "g*a^2"]);
    let g_known = Question {
        parameters: false,
        ..question()
    };
    expect(&tanks("output Real y = h2;"), &g_known, "h1 h2", "");
    // an inflow that nobody measures: its height over the ground stays
    let leak = Question {
        unknown: vec!["q".into()],
        ..g_known
    };
    expect(&tanks("output Real y = h2;"), &leak, "h1 h2 q", "");
}

/// A cascade of forty tanks: forty roots, each needing a square at the point.
#[test]
fn a_long_cascade_has_a_point() {
    let n = 40;
    let model = plant(
        &format!("parameter Real a[{n}]; Real h[{n}]; output Real y[{n}] = h;"),
        &format!(
            "der(h[1]) = -a[1]*sqrt(h[1] - h[2]); for i in 2:{} loop der(h[i]) = a[i-1]*sqrt(h[i-1] - h[i]) - a[i]*sqrt(h[i] - h[i+1]); end for; der(h[{n}]) = a[{}]*sqrt(h[{}] - h[{n}]) - a[{n}]*sqrt(h[{n}]);",
            n - 1,
            n - 1,
            n - 1
        ),
    );
    assert!(analyse(&model, &question()).unwrap().is_complete());
}

/// Each is zero, so that d acts on nothing; with q in place of one term, it does.
#[test]
fn identities_in_disguise() {
    for zero in [
        "exp(2*x) - exp(x)^2",
        "exp(x + z) - exp(x)*exp(z)",
        "exp(-x)*exp(x) - 1",
        "exp(x/3)^3 - exp(x)",
        "exp(x + q + 2) - exp(x + 2)*exp(q)",
        "exp(0.07*x)*exp(0.03*x) - exp(0.1*x)",
        "exp(x*z/q) - exp(x/q*z)",
        "sin(x)^2 + cos(x)^2 - 1",
        "sin(2*x) - 2*sin(x)*cos(x)",
        "cos(x - z) - cos(x)*cos(z) - sin(x)*sin(z)",
        "sin(-x) + sin(x)",
        "tan(x) - sin(x)/cos(x)",
        "tanh(x) - (exp(2*x) - 1)/(exp(2*x) + 1)",
        "cosh(x)^2 - sinh(x)^2 - 1",
        "log(x*z) - log(x) - log(z)",
        "log(x/z) + log(z) - log(x)",
        "log(x^3) - 3*log(x)",
        "log(3*x) - log(x) - log(3*z) + log(z)",
        "exp(log(x)) - x",
        "log(exp(x)) - x",
        "exp(2*log(x)) - x^2",
        "sqrt(x)*sqrt(x) - x",
        "sqrt(x*z) - sqrt(x)*sqrt(z)",
        "sqrt(3*x)*sqrt(z) - sqrt(3*z)*sqrt(x)",
        "x^1.5*x^0.5 - x^2",
        "x^q*x - x^(q + 1)",
        "x^q*z^q - (x*z)^q",
        "asin(x) + acos(x) - asin(z) - acos(z)",
        "atan(-x) + atan(x)",
        "sin(asin(z)) - z",
        "cos(acos(z)) - z",
        "tan(atan(z)) - z",
        "10^log10(z) - z",
        "log10(10^z) - z",
        "2^x*2^z - 2^(x + z)",
        "8^x - 2^(3*x)",
        "exp(0.5*log(z)) - sqrt(z)",
        "exp(log(z)/3)^3 - z",
        "z^(1/3)*z^(2/3) - z",
        "z^0.37*z^0.63 - z",
        "z^1.7/z^0.2 - z*sqrt(z)",
        "(z^0.6)^(1/0.6) - z",
        "sqrt(exp(x)) - exp(x/2)",
        "sqrt(x^2) - x",
        "sqrt(x^2*z) - x*sqrt(z)",
        "log(sqrt(x)) - log(x)/2",
        "log(x^0.3) - 0.3*log(x)",
        "sin(atan(z)) - z/sqrt(1 + z^2)",
        "cos(atan(z)) - 1/sqrt(1 + z^2)",
        "cos(asin(z)) - sqrt(1 - z^2)",
        "sin(acos(z)) - sqrt(1 - z^2)",
        "tan(asin(z)) - z/sqrt(1 - z^2)",
        "sin(2*asin(z)) - 2*z*sqrt(1 - z^2)",
        "sin(x + asin(z)) - z*cos(x) - sin(x)*sqrt(1 - z^2)",
        "asin(sin(z)) - z",
        "acos(cos(z)) - z",
        "atan(tan(z)) - z",
        "asin(z) - atan(z/sqrt(1 - z^2))",
        "atan(z) - asin(z/sqrt(1 + z^2))",
        "atan(z) + atan(1/z) - atan(x) - atan(1/x)",
        "atan2(x, z) - atan(x/z)",
        "sin(atan2(x, z)) - x/sqrt(x^2 + z^2)",
        "cos(atan2(x, -z)) + z/sqrt(x^2 + z^2)",
        "cos(x + 3.141592653589793) + cos(x)",
        "sin(x + 1.5707963267948966) - cos(x)",
        "exp(x + 1) - 2.718281828459045*exp(x)",
        "sinh(x) - (exp(x) - exp(-x))/2",
        "cosh(x) + sinh(x) - exp(x)",
        "tanh(log(x)) - (x^2 - 1)/(x^2 + 1)",
        "sinh(log(x)) - (x - 1/x)/2",
        "tan(x) - sin(x)/cos(x)",
        "x^q - exp(q*log(x))",
        "sqrt(sqrt(x)) - x^0.25",
        "exp(x + z + q) - exp(x)*exp(z)*exp(q)",
        "sin(x + z + q) - sin(x + z)*cos(q) - cos(x + z)*sin(q)",
        "log(exp(x)*z) - x - log(z)",
    ] {
        let model = |text: &str| {
            plant(
                // where all of them are identities: √x² is x for x > 0 alone
                "parameter Real d; parameter Real q; Real x(start = 0.5, min = 0.1, max = 1); Real z(start = 0.4, min = 0.1, max = 0.9); output Real y = x; output Real v = z; output Real r = q;",
                &format!("der(x) = -x + d*({text}); der(z) = -z;"),
            )
        };
        let answer = analyse(&model(zero), &question()).unwrap();
        // of two branches, the box has one
        let found = answer.verdict("d");
        assert_eq!(found, Some(Verdict::Unobservable), "{zero}: {answer:?}");
        let answer = analyse(&model(&format!("{zero} + x")), &question()).unwrap();
        assert_eq!(answer.verdict("d"), Some(Verdict::Observable), "{zero} + x");
    }
}
