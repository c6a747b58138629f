//! Small models that mislead a careless test of rank.

use super::{expect, plant, question};
use lynkeus_observability::{Note, Question, Verdict, analyse};

fn known(states: &[&str]) -> Question {
    Question {
        known_starts: states.iter().map(|s| (*s).to_owned()).collect(),
        ..question()
    }
}

fn unknown(inputs: &[&str]) -> Question {
    Question {
        unknown: inputs.iter().map(|s| (*s).to_owned()).collect(),
        ..Question::default()
    }
}

/// S = t + a·t³/3 + …: the first and second derivatives at the start do not know a.
#[test]
fn a_known_start_at_a_special_point_shows_the_parameter_late() {
    let plant = plant(
        "parameter Real a; Real S(start = 0); output Real y = S;",
        "der(S) = 1 + a*S^2;",
    );
    expect(&plant, &known(&["S"]), "a", "");
    expect(&plant, &question(), "S a", "");
}

/// x = p·t¹¹/11: eleven derivatives, of one unknown.
#[test]
fn a_trace_may_come_far_later_than_the_number_of_unknowns() {
    let plant = plant(
        "parameter Real p; Real s(start = 0); Real x(start = 0); output Real y = x;",
        "der(s) = 1; der(x) = p*s^10;",
    );
    let answer = expect(&plant, &known(&["s", "x"]), "p", "");
    assert_eq!(answer.order, 11);
}

/// From rest at the bottom a pendulum stays there, whatever its length; sin 0 is 0.
#[test]
fn a_known_equilibrium_shows_nothing() {
    let plant = plant(
        "parameter Real k; Real phi(start = 0); Real w(start = 0); output Real y = phi;",
        "der(phi) = w; der(w) = -k*sin(phi);",
    );
    let answer = expect(&plant, &known(&["phi", "w"]), "", "k");
    // proved: the rest is an invariant set, and no derivative leaves it
    let is_open = |note: &Note| matches!(note, Note::Derivatives(_));
    assert!(!answer.notes.iter().any(is_open), "{:?}", answer.notes);
    expect(&plant, &question(), "phi w k", "");
}

/// With s0 = 0 given, b never acts and a is seen alone; elsewhere both are.
#[test]
fn a_known_start_can_hide_what_acts_through_it() {
    let plant = plant(
        "parameter Real a; parameter Real b; Real s(start = 0); Real x(start = 1); output Real y = x;",
        "der(s) = -s; der(x) = a*x + b*s;",
    );
    expect(&plant, &known(&["s", "x"]), "a", "b");
    expect(&plant, &known(&["x"]), "a", "s b");
}

#[test]
fn a_parameter_that_cancels_is_hidden() {
    let plant = plant(
        "parameter Real a; parameter Real b; parameter Real c; Real x; Real z; output Real y = x;",
        "der(x) = a*x - z*b/b + (x + c)^2 - x^2 - 2*c*x - c^2; der(z) = -(z*a + a*c)/a + c;",
    );
    expect(&plant, &question(), "x z a", "b c");
}

/// z acts on x only while u is on: u known and not zero shows it, u at zero does not.
#[test]
fn a_state_that_only_an_input_shows() {
    let plant = plant(
        "input Real u; Real x; Real z; output Real y = x;",
        "der(x) = -x + u*z; der(z) = -z;",
    );
    expect(&plant, &Question::default(), "x z", "");
    let off = Question {
        disturbances: vec!["u".into()],
        ..Question::default()
    };
    expect(&plant, &off, "x", "z");
    // the product is seen, the factors are not
    let answer = expect(&plant, &unknown(&["u"]), "x", "z u");
    assert_eq!(answer.symmetries[0].invariants, ["u*z"]);
}

/// x2 is read off x1 if w is known; an unknown w takes its place.
#[test]
fn an_unknown_input_hides_a_state() {
    let plant = plant(
        "input Real w; Real x1; Real x2; output Real y = x1;",
        "der(x1) = x2 + w; der(x2) = -2*x2;",
    );
    expect(&plant, &Question::default(), "x1 x2", "");
    let answer = expect(&plant, &unknown(&["w"]), "x1", "x2 w");
    assert_eq!(answer.symmetries[0].invariants, ["w + x2"]);
}

/// w enters at the end of a chain: n derivatives for the states, one more for w.
#[test]
fn an_unknown_input_at_the_end_of_a_chain() {
    let plant = plant(
        "input Real w; Real x1; Real x2; Real x3; Real x4; output Real y = x1;",
        "der(x1) = x2; der(x2) = x3 + x1*x2; der(x3) = x4 - x3^2; der(x4) = w - x1*x4;",
    );
    let answer = expect(&plant, &unknown(&["w"]), "x1 x2 x3 x4 w", "");
    assert_eq!(answer.order, 4);
}

/// An unknown input seen at once eliminates: the rank of what is left of x grows only
/// after the output's rank has been fed by w for several orders.
#[test]
fn growth_after_the_unknown_input_took_its_share() {
    let plant = plant(
        "input Real w; Real a; Real b; Real c; output Real y = a + w; output Real z = a*b - w;",
        "der(a) = b + w; der(b) = c + w; der(c) = -c*w;",
    );
    expect(&plant, &unknown(&["w"]), "a b c w", "");
}

/// Both at once: w is seen at once, p in the sixth derivative.
#[test]
fn a_known_start_beside_an_unknown_input() {
    let plant = plant(
        "input Real w; parameter Real p; Real s(start = 0, fixed = true); Real x; output Real y = x + w; output Real z = x - w;",
        "der(s) = 1; der(x) = p*s^5;",
    );
    let both = Question {
        parameters: true,
        ..unknown(&["w"])
    };
    let answer = expect(&plant, &both, "x p w", "");
    assert_eq!(answer.order, 6);
}

/// Known inputs are known at every moment: what they hide at one they show at another.
#[test]
fn a_known_input_that_stirs() {
    let plant = plant(
        "input Real u; parameter Real a; parameter Real b; Real x; output Real y = x;",
        "der(x) = a*u + b*u^2 - x;",
    );
    expect(&plant, &question(), "x a b", "");
    let unmeasured = Question {
        parameters: true,
        ..unknown(&["u"])
    };
    expect(&plant, &unmeasured, "x", "a b u");
}

/// Time is known, and so is what depends on it alone.
#[test]
fn explicit_time_tells_parameters_apart() {
    let plant = plant(
        "parameter Real a; parameter Real b; Real x; output Real y = x;",
        "der(x) = a*sin(time) + b*exp(-time);",
    );
    expect(&plant, &question(), "x a b", "");
}

/// Interchangeable states: two answers far apart, but near each nothing else fits.
#[test]
fn symmetric_states_are_observable_locally() {
    let plant = plant(
        "Real x1; Real x2; output Real s = x1 + x2; output Real p = x1*x2;",
        "der(x1) = -x1; der(x2) = -x2;",
    );
    expect(&plant, &Question::default(), "x1 x2", "");
    let sum = super::plant(
        "Real x1; Real x2; output Real s = x1 + x2;",
        "der(x1) = -x1; der(x2) = -x2;",
    );
    let answer = expect(&sum, &Question::default(), "", "x1 x2");
    assert_eq!(answer.symmetries[0].invariants, ["x2 + x1"]);
}

#[test]
fn an_output_of_time_alone_tells_nothing() {
    let plant = plant("Real x; output Real y = time;", "der(x) = -x;");
    expect(&plant, &Question::default(), "", "x");
}

#[test]
fn a_question_about_a_known_quantity_is_answered() {
    let plant = plant(
        "input Real u; parameter Real g = 2; Real x; Real z; output Real y = x;",
        "der(x) = g*u; der(z) = -z;",
    );
    let about = ["u", "g", "x*u", "z", "1", "z - z", "y"];
    let question = Question {
        about: about.iter().map(|s| (*s).to_owned()).collect(),
        ..Question::default()
    };
    let answer = analyse(&plant, &question).unwrap();
    let hidden: Vec<&str> = answer
        .about
        .iter()
        .filter(|asked| asked.verdict == Verdict::Unobservable)
        .map(|asked| asked.name.as_str())
        .collect();
    assert_eq!(hidden, ["z"]);
}
