//! Known starts at which less is seen than elsewhere, or later: "unobservable" has to be proved
//! there, whatever the derivatives so far say. The answers are by hand.

use super::{plant, question};
use lynkeus_observability::{Answer, Note, Question, Symmetry, Verdict, analyse};

/// Expected verdicts: `p` observable, `!p` unobservable, `?p` undecided.
#[track_caller]
fn judge(declarations: &str, equations: &str, unknown: &[&str], expected: &str) -> Answer {
    let model = plant(declarations, equations);
    let asking = Question {
        unknown: unknown.iter().map(|s| (*s).to_owned()).collect(),
        ..question()
    };
    let answer = analyse(&model, &asking).unwrap();
    let found: Vec<String> = answer
        .quantities
        .iter()
        .map(|(asked, _)| match asked.verdict {
            Verdict::Observable => asked.name.clone(),
            Verdict::Unobservable => format!("!{}", asked.name),
            Verdict::Undecided => format!("?{}", asked.name),
        })
        .collect();
    assert_eq!(
        found.join(" "),
        expected,
        "{declarations} {equations} {answer:?}"
    );
    answer
}

const FROM_ZERO: &str = "parameter Real p; Real s(start = 0, fixed = true); Real q(start = 0, fixed = true); Real x(start = 0, fixed = true); output Real y = x;";

/// Each factor vanishes at the start, to the order given by hand; p shows one later.
#[test]
fn traces_that_come_late_are_found() {
    for (factor, order) in [
        ("s^40", 41),
        ("s^60", 61),
        ("s^300", 301),
        ("sin(s)^40", 41),
        ("s^20*q^20", 61),
        ("(1 - cos(s))^12", 25),
        ("(exp(s) - 1 - s)^10", 21),
        ("(tan(s) - s)^8", 25),
        ("(asin(s) - s)^7", 22),
        ("(atan(s) - s)^7", 22),
        ("log(1 + s)^25", 26),
        ("(s^2 - q)^9", 19),
        ("(s - 2*q)^30*s", 32),
        ("(sqrt(1 + s) - 1 - s/2)^10", 21),
        ("sinh(s)^33", 34),
    ] {
        let equations = format!("der(s) = 1; der(q) = 3*s; der(x) = p*({factor});");
        let answer = judge(FROM_ZERO, &equations, &[], "p");
        assert_eq!(answer.order, order, "{factor}");
    }
    judge(
        "parameter Real a; parameter Real b; Real s(start = 0, fixed = true); Real x(start = 0, fixed = true); output Real y = x;",
        "der(s) = 1; der(x) = a*s^10 + b*s^30;",
        &[],
        "a b",
    );
    judge(
        "Real z; Real s(start = 0, fixed = true); Real x; output Real y = x;",
        "der(s) = 1; der(z) = -z; der(x) = z*s^25;",
        &[],
        "z x",
    );
    judge(
        "parameter Real p; input Real u; Real s(start = 0, fixed = true); Real x(start = 0, fixed = true); output Real y = x;",
        "der(s) = u; der(x) = p*s^18;",
        &[],
        "p",
    );
}

/// Time is zero where known starts are.
#[test]
fn time_starts_with_the_known_starts() {
    judge(
        "parameter Real p; Real x(start = 0, fixed = true); output Real y = x;",
        "der(x) = p*time^40;",
        &[],
        "p",
    );
    // s is time, so that p acts on nothing; without the start, p·s(0) does
    for (fixed, expected) in [(", fixed = true", "!p"), ("", "!s !p")] {
        judge(
            &format!(
                "parameter Real p; Real s(start = 0{fixed}); output Real y = p*(s - time) + x; Real x(start = 1, fixed = true);"
            ),
            "der(s) = 1; der(x) = -x;",
            &[],
            expected,
        );
    }
    // not defined at zero
    judge(
        "parameter Real p; Real x(start = 1, fixed = true); output Real y = x;",
        "der(x) = -p*x/time;",
        &[],
        "p",
    );
}

/// Later than any order that is looked at: undecided, and not "p can have any value".
#[test]
fn what_comes_too_late_is_undecided() {
    let answer = judge(
        FROM_ZERO,
        "der(s) = 1; der(q) = 1; der(x) = p*s^5000;",
        &[],
        "?p",
    );
    assert!(answer.symmetries.is_empty());
    let is_open = |note: &Note| matches!(note, Note::Derivatives(_));
    assert!(answer.notes.iter().any(is_open), "{:?}", answer.notes);
    // what certainly is hidden beside it
    let answer = judge(
        "parameter Real p; parameter Real c; parameter Real d; Real e; Real s(start = 0, fixed = true); Real x(start = 0, fixed = true); output Real y = x; output Real z = d*e;",
        "der(s) = 1; der(x) = p*s^5000; der(e) = -e;",
        &[],
        "!e ?p !c !d",
    );
    let symmetries = &answer.symmetries;
    assert_eq!(symmetries.len(), 2, "{symmetries:?}");
    let frees_c = |s: &Symmetry| s.moves == ["c"] && s.invariants.is_empty();
    assert!(symmetries.iter().any(frees_c), "{symmetries:?}");
    // hidden for ever, which an affine set does not show: q = s²
    for factor in ["q - s^2", "(q - s^2)*s"] {
        let equations = format!("der(s) = 1; der(q) = 2*s; der(x) = p*({factor});");
        judge(FROM_ZERO, &equations, &[], "?p");
    }
}

/// The start lies in an invariant set on which a factor vanishes.
#[test]
fn what_an_invariant_set_hides_is_proved_hidden() {
    for (equations, expected) in [
        ("der(s) = -s; der(q) = s - q; der(x) = p*q - x;", "!p"),
        ("der(s) = s*q; der(q) = 1; der(x) = p*s;", "!p"),
        (
            "der(s) = -s + 1; der(q) = -q + 1; der(x) = p*(s - q);",
            "!p",
        ),
        (
            "der(s) = cos(x) - 2*s; der(q) = cos(x) - 2*q; der(x) = p*(s - q)^3 + 1;",
            "!p",
        ),
        ("der(s) = 1; der(q) = 2; der(x) = p*(2*s - q);", "!p"),
        ("der(s) = 1; der(q) = 2; der(x) = p*(2*s - q + s^9);", "p"),
        ("der(s) = q; der(q) = -p*sin(s); der(x) = s;", "!p"),
        ("der(s) = x; der(q) = x^2; der(x) = p*(s + q);", "!p"),
    ] {
        judge(FROM_ZERO, equations, &[], expected);
    }
    judge(
        "parameter Real k; parameter Real a; parameter Real b; Real r; Real s(start = 0, fixed = true); Real x(start = 1, fixed = true); output Real y = x;",
        "der(r) = 1; der(s) = k*s*r; der(x) = a*x + b*s;",
        &[],
        "!r !k a !b",
    );
    judge(
        "parameter Real b; input Real u; Real s(start = 0, fixed = true); Real x; output Real y = x;",
        "der(s) = u*s; der(x) = u*x + b*s;",
        &[],
        "x !b",
    );
}

/// No invariant set is small enough, but a symmetry fixes the start.
#[test]
fn what_a_symmetry_hides_is_proved_hidden() {
    let scaled = |exponent: usize| {
        let answer = judge(
            "parameter Real p; parameter Real c; Real s(start = 0.5, fixed = true); Real x(start = 1, fixed = true); output Real y = x;",
            &format!("der(s) = c; der(x) = p*(s - 0.5)^{exponent};"),
            &[],
            "!p !c",
        );
        answer.symmetries[0].clone()
    };
    assert_eq!(scaled(3).invariants, ["c^3*p"]);
    assert_eq!(scaled(24).invariants, ["c^24*p"]);
    // beyond the orders and exponents that are looked at
    assert_eq!(scaled(4000).directions, 1);
    // turned about the start
    judge(
        "parameter Real a; parameter Real b; Real s(start = 0, fixed = true); Real q(start = 0, fixed = true); output Real y = s^2 + q^2;",
        "der(s) = a - q; der(q) = b + s;",
        &[],
        "!a !b",
    );
    judge(
        "input Real w; parameter Real p; Real s(start = 0, fixed = true); Real x; output Real y = x;",
        "der(s) = 1; der(x) = w*s^9 + p*s^9;",
        &["w"],
        "x !p !w",
    );
}

/// A start that is computed from an unknown parameter tells about it.
#[test]
fn starts_may_be_expressions_in_parameters() {
    judge(
        "parameter Real x0 = 2; Real x(start = x0, fixed = true); output Real y = x;",
        "der(x) = -x;",
        &[],
        "x0",
    );
    judge(
        "parameter Real x0; parameter Real k; Real x(start = exp(x0), fixed = true); output Real y = x;",
        "der(x) = -k*x;",
        &[],
        "x0 k",
    );
    let answer = judge(
        "parameter Real a = 1; parameter Real b = 1; Real x(start = a + 2*b, fixed = true); output Real y = x;",
        "der(x) = -x;",
        &[],
        "!a !b",
    );
    assert_eq!(
        answer.symmetries[0].invariants,
        ["b + 0.5*a"].map(|_| "2*b + a")
    );
    // a guess is no knowledge
    judge(
        "parameter Real x0 = 2; Real x(start = x0); output Real y = x;",
        "der(x) = -x;",
        &[],
        "x !x0",
    );
    judge(
        "parameter Real x0 = 0.5; parameter Real p; Real s(start = x0, fixed = true); Real x(start = 0, fixed = true); output Real y = x;",
        "der(s) = 1; der(x) = p*(s - x0)^12;",
        &[],
        "!x0 p",
    );
    // an equilibrium that is no decimal fraction
    judge(
        "parameter Real p; constant Real k = 0.7; Real s(start = 0.3, fixed = true); Real x(start = 0, fixed = true); output Real y = x;",
        "der(s) = 0.21 - k*s; der(x) = 1 + p*(s - 0.3);",
        &[],
        "!p",
    );
}

#[test]
fn known_starts_beside_unknown_inputs() {
    let chain = |start: f64| {
        judge(
            &format!(
                "input Real w; Real x1(start = {start}, fixed = true); Real x2; output Real y = x1;"
            ),
            "der(x1) = x2 + w; der(x2) = -2*x2;",
            &["w"],
            "!x2 !w",
        )
    };
    for start in [0.37, 0.0] {
        assert_eq!(chain(start).symmetries[0].invariants, ["w + x2"]);
    }
    // s·w vanishes at the start: y' shows x2, y'' then w
    judge(
        "input Real w; Real s(start = 0, fixed = true); Real x1; Real x2; output Real y = x1;",
        "der(s) = 1; der(x1) = x2 + s*w; der(x2) = -2*x2;",
        &["w"],
        "x1 x2 w",
    );
    // p in the 31st derivative: beyond those taken, and not hidden
    judge(
        "input Real w; parameter Real p; Real s(start = 0, fixed = true); Real x; output Real y = x + w; output Real z = x - w;",
        "der(s) = 1; der(x) = p*s^30;",
        &["w"],
        "x ?p w",
    );
    // s stays at zero, and with it what it multiplies is hidden
    judge(
        "input Real w; parameter Real p; Real s(start = 0, fixed = true); Real x; output Real y = x;",
        "der(s) = -s; der(x) = w + p*s;",
        &["w"],
        "x !p w",
    );
    judge(
        "input Real w; parameter Real p; Real h(start = 1, fixed = true); Real g(start = 2, fixed = true); output Real y = h; output Real z = g;",
        "der(h) = w - p*h; der(g) = p*h - g^2;",
        &["w"],
        "p w",
    );
}

/// No series at the start: nothing is said.
#[test]
fn a_start_without_series_is_undecided() {
    for factor in ["sqrt(s)", "1/s", "log(s)", "exp(-1/s^2)"] {
        let equations = format!("der(s) = 1; der(q) = 1; der(x) = p*({factor});");
        judge(FROM_ZERO, &equations, &[], "?p");
    }
}
