//! Models that choose: what each branch hides, what several tell together, and the same by brute force.

use std::collections::HashMap;

use lynkeus_expr::{Node, Tape};
use lynkeus_model::Plant;
use lynkeus_observability::{Answer, Note, Question, Verdict, analyse};
use nalgebra::DMatrix;

use super::{plant, question};

/// Names of what is observable, not observable and undecided.
fn verdicts(answer: &Answer) -> [String; 3] {
    [
        Verdict::Observable,
        Verdict::Unobservable,
        Verdict::Undecided,
    ]
    .map(|verdict| {
        let asked = answer.asked().filter(|asked| asked.verdict == verdict);
        let names: Vec<&str> = asked.map(|asked| asked.name.as_str()).collect();
        names.join(" ")
    })
}

#[track_caller]
fn judged(plant: &Plant, question: &Question, expected: [&str; 3]) -> Answer {
    let answer = analyse(plant, question).unwrap();
    assert_eq!(verdicts(&answer), expected, "{answer:?}");
    answer
}

/// A run of a plant: the values of its symbols by name, and of its inputs over time.
struct Run<'a> {
    plant: &'a Plant,
    values: Vec<(&'a str, f64)>,
    input: fn(f64) -> f64,
    until: f64,
}

/// Times at which outputs are read.
const READ: usize = 60;
/// How far beside a value it is looked.
const BESIDE: f64 = 1e-4;
/// Of the largest singular value, below it is none; of a direction, below it is no part.
const NONE: f64 = 2e-4;
const PART: f64 = 1e-2;

impl Run<'_> {
    fn value(&self, name: &str) -> f64 {
        self.values.iter().find(|(n, _)| *n == name).unwrap().1
    }

    /// The outputs, where some of the values are others.
    fn outputs(&self, moved: &str, by: f64) -> Vec<f64> {
        let plant = self.plant;
        let outputs = plant.outputs.iter().map(|o| o.node);
        let roots: Vec<Node> = plant.derivatives.iter().copied().chain(outputs).collect();
        let variables = plant.states.iter().chain(&plant.inputs);
        let variables = variables.chain(plant.parameters.iter().map(|p| &p.variable));
        let symbols: Vec<Node> = variables.map(|v| v.node).chain([plant.time]).collect();
        let mut evaluator = Tape::new(&plant.graph, &symbols, &roots)
            .unwrap()
            .evaluator();
        let at = |name: &str| self.value(name) + if name == moved { by } else { 0.0 };
        let parameters: Vec<f64> = plant
            .parameters
            .iter()
            .map(|p| at(&p.variable.name))
            .collect();
        let mut x: Vec<f64> = plant.states.iter().map(|s| at(&s.name)).collect();
        let n = x.len();
        let mut flow = |t: f64, x: &[f64]| -> Vec<f64> {
            let inputs = plant.inputs.iter().map(|_| (self.input)(t));
            let all = x
                .iter()
                .copied()
                .chain(inputs)
                .chain(parameters.iter().copied());
            let all: Vec<f64> = all.chain([t]).collect();
            let mut out = vec![0.0; roots.len()];
            evaluator.eval(&all, &mut out);
            out
        };
        let mut read = vec![];
        let mut t = 0.0;
        for k in 0..=READ {
            let end = self.until * k as f64 / READ as f64;
            let mut h: f64 = 0.02;
            // halved steps find the jumps
            while t < end {
                let step = h.min(end - t);
                let whole = step_of(&mut flow, t, &x, step);
                let half = step_of(&mut flow, t, &x, step / 2.0);
                let twice = step_of(&mut flow, t + step / 2.0, &half, step / 2.0);
                let pairs = whole.iter().zip(&twice);
                let error = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                if error > 1e-11 && step > 1e-12 {
                    h = step / 2.0;
                    continue;
                }
                (x, t) = (twice, t + step);
                h = (2.0 * h).min(0.02);
            }
            read.extend_from_slice(&flow(end, &x)[n..]);
        }
        read
    }

    /// The names of those that the readings tell, from the rank of their slopes.
    fn told(&self, unknown: &str) -> String {
        let names: Vec<&str> = unknown.split(' ').collect();
        let columns: Vec<Vec<f64>> = names
            .iter()
            .map(|name| {
                let (up, down) = (self.outputs(name, BESIDE), self.outputs(name, -BESIDE));
                let pairs = up.iter().zip(&down);
                pairs.map(|(a, b)| (a - b) / (2.0 * BESIDE)).collect()
            })
            .collect();
        let slopes = DMatrix::from_fn(columns[0].len(), names.len(), |i, j| columns[j][i]);
        let svd = slopes.svd(false, true);
        let directions = svd.v_t.unwrap();
        let largest = svd.singular_values.max();
        let hides = |j: usize| {
            let of = svd.singular_values.iter().enumerate();
            let mut none = of.filter(|(_, s)| **s <= NONE * largest.max(NONE));
            none.any(|(k, _)| directions[(k, j)].abs() > PART)
        };
        let told = names.iter().enumerate().filter(|(j, _)| !hides(*j));
        told.map(|(_, name)| *name).collect::<Vec<_>>().join(" ")
    }
}

fn step_of(flow: &mut dyn FnMut(f64, &[f64]) -> Vec<f64>, t: f64, x: &[f64], h: f64) -> Vec<f64> {
    let along =
        |k: &[f64], h: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + h * k).collect() };
    let a = flow(t, x);
    let b = flow(t + h / 2.0, &along(&a, h / 2.0));
    let c = flow(t + h / 2.0, &along(&b, h / 2.0));
    let d = flow(t + h, &along(&c, h));
    let slope = (0..x.len()).map(|i| (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]) / 6.0);
    along(&slope.collect::<Vec<_>>(), h)
}

fn run<'a>(plant: &'a Plant, values: &[(&'a str, f64)], input: fn(f64) -> f64) -> Run<'a> {
    let (values, until) = (values.to_vec(), 12.0);
    Run {
        plant,
        values,
        input,
        until,
    }
}

/// One branch tells p + q, the other p − q: neither p nor q is hidden, and no run within one branch tells them.
#[test]
fn two_branches_tell_what_neither_does() {
    let plant = plant(
        "parameter Real p=1; parameter Real q=0.3; input Real u(min=-3, max=3); Real x(start=1, min=-2, max=2); output Real y = x;",
        "der(x) = u + (if x < 0 then p + q else p - q);",
    );
    let asked = Question {
        about: vec!["p + q".into(), "p - q".into(), "p*q".into()],
        ..question()
    };
    let answer = judged(&plant, &asked, ["x p + q p - q", "", "p q p*q"]);
    assert!(answer.symmetries.is_empty());
    let told =
        |note: &Note| matches!(note, Note::WithinBranches(names) if names == &["p", "q", "p*q"]);
    assert!(answer.notes.iter().any(told), "{:?}", answer.notes);
    let values = [("x", 1.0), ("p", 1.0), ("q", 0.3)];
    let through = run(&plant, &values, |t| -1.0 + 3.0 * t.sin());
    assert_eq!(through.told("x p q"), "x p q");
    assert_eq!(run(&plant, &values, |_| 0.5).told("x p q"), "x");
}

/// The same with constant states and a choice of time.
#[test]
fn two_branches_in_turn_tell_states() {
    let plant = plant(
        "Real x(start=1); Real a(start=1); Real b(start=0.4); output Real y = x;",
        "der(x) = -x + (if sin(time) < 0 then a + b else a - b); der(a) = 0; der(b) = 0;",
    );
    judged(&plant, &Question::default(), ["x", "", "a b"]);
    let values = [("x", 1.0), ("a", 1.0), ("b", 0.4)];
    assert_eq!(run(&plant, &values, |_| 0.0).told("x a b"), "x a b");
}

/// b is hidden in each branch, and so is not what both hide: one branch moves a by b, the other shows a.
#[test]
fn what_is_hidden_in_each_branch_may_pass_from_one_to_the_other() {
    let plant = plant(
        "input Real u(min=-1, max=1); Real a; Real b; output Real y = if u < 0 then 0 else a;",
        "der(a) = if u < 0 then b else 0; der(b) = 0;",
    );
    judged(&plant, &Question::default(), ["a", "", "b"]);
    let values = [("a", 0.7), ("b", 0.2)];
    assert_eq!(run(&plant, &values, f64::sin).told("a b"), "a b");
    // an unknown input that only the second branch feels makes no excuse
    let plant = super::plant(
        "input Real u(min=-1, max=1); input Real w; Real a; Real b; output Real y = if u < 0 then 0 else a;",
        "der(a) = if u < 0 then b else w; der(b) = 0;",
    );
    let unknown = Question {
        unknown: vec!["w".into()],
        ..Question::default()
    };
    judged(&plant, &unknown, ["a w", "", "b"]);
}

/// What is common to all branches stays proved, with its invariants.
#[test]
fn what_every_branch_hides_alike_is_hidden() {
    let known = |t: f64| 1.3 + t.cos();
    for equation in [
        "der(x) = u - max(0, k1*k2*x);",
        "der(x) = u - k1*k2*abs(x);",
        "der(x) = u - min(k1*k2, 2)*x;",
        "der(x) = u - (if x < 0.5 then (k1*k2)^2 elseif x < 0.8 then k1*k2 else 1/(k1*k2))*x;",
        "der(x) = 0.1*u + 0.1*k1*k2*floor(x);",
        "der(x) = u - k1*k2*x*(if x > 0.7 and not u < 0.5 then 1 else 2);",
        "der(x) = u - sqrt(max(0, k1*k2*x));",
    ] {
        let plant = plant(
            "parameter Real k1=1.2; parameter Real k2=0.9; input Real u(min=0, max=2); Real x(start=1, min=-9, max=9); output Real y = x;",
            equation,
        );
        let answer = judged(&plant, &question(), ["x", "k1 k2", ""]);
        assert_eq!(answer.symmetries[0].invariants, ["k2*k1"], "{equation}");
        let values = [("x", 1.0), ("k1", 1.2), ("k2", 0.9)];
        assert_eq!(
            run(&plant, &values, known).told("x k1 k2"),
            "x",
            "{equation}"
        );
    }
    let plant = plant(
        "Real a(min=-2, max=2); Real b(min=-2, max=2); output Real y = max(a + b, 2*(a + b));",
        "der(a) = 0.3 - a; der(b) = -b;",
    );
    let answer = judged(&plant, &Question::default(), ["", "a b", ""]);
    assert_eq!(answer.symmetries[0].invariants, ["b + a"]);
    let run = run(&plant, &[("a", 0.5), ("b", -1.0)], |_| 0.0);
    assert_eq!(run.told("a b"), "");
}

/// √x² shows x + |x| on one side alone, asin∘sin where the cosine is positive; from the other side no less is known of it.
#[test]
fn what_is_folded_has_branches_too() {
    for output in [
        "x + sqrt(x^2)",
        "x + sqrt(x*x)",
        "x + asin(sin(x + 1.6))",
        "x + acos(cos(x))",
    ] {
        for start in [-1, 1] {
            let text =
                format!("Real x(start={start}, min=-1.2, max=1.2); output Real y = {output};");
            let plant = plant(&text, "der(x) = 0;");
            let answer = judged(&plant, &Question::default(), ["x", "", ""]);
            assert_eq!(answer.partial.len(), 1, "{output} from {start}");
        }
    }
    // what no side shows is hidden on both
    let plant = plant(
        "parameter Real k1=1.2; parameter Real k2=0.9; Real x(start=-1, min=-2, max=2); output Real y = x;",
        "der(x) = k1*k2*sqrt(x^2);",
    );
    judged(&plant, &question(), ["x", "k1 k2", ""]);
}

/// The smaller of two states shows one of them at a time.
#[test]
fn the_smaller_of_two_states_is_known() {
    let plant = plant(
        "Real a(min=0, max=2); Real b(min=0, max=2); output Real y = min(a, b);",
        "der(a) = -a; der(b) = -2*b;",
    );
    let answer = judged(&plant, &Question::default(), ["a b", "", ""]);
    assert_eq!(answer.partial.len(), 2);
    let run = run(&plant, &[("a", 1.0), ("b", 1.5)], |_| 0.0);
    assert_eq!(run.told("a b"), "a b");
}

/// What no path leads from is hidden, however many branches there are; so is what none of them feels.
#[test]
fn what_nothing_feels_is_hidden_in_all_branches() {
    let plant = plant(
        "parameter Real c=1; parameter Real p=2; parameter Real q=3; Real x(min=0, max=90); Real z; output Real y = x;",
        "der(x) = -p*q*floor(x); der(z) = c*abs(z) + x;",
    );
    let asked = Question {
        about: vec!["c + x".into(), "p*q".into(), "abs(z)".into()],
        ..question()
    };
    let answer = judged(&plant, &asked, ["x p*q", "z c p q c + x", "abs(z)"]);
    let others = |note: &Note| matches!(note, Note::Branches { all: false, .. });
    assert!(answer.notes.iter().any(others), "{:?}", answer.notes);
}

/// No point of the box lies within the band that tells q.
#[test]
fn a_branch_that_no_point_finds_counts() {
    let plant = plant(
        "parameter Real p=1; parameter Real q=3; input Real u; Real x(min=-2, max=2); output Real y = x;",
        "der(x) = u - p*x + (if abs(x) < 1e-5 then q else 0);",
    );
    judged(&plant, &question(), ["x p", "", "q"]);
}

/// After five units of time g acts, and shows; the time at which it begins may show, too.
#[test]
fn a_branch_that_only_time_reaches_counts() {
    let declarations = "parameter Real k=0.5; parameter Real tau=5; parameter Real g=3; Real x(start=1); output Real y = x;";
    for choice in [
        "time > tau then g else 1",
        "time > 8 and time < 8.003 then g else 1",
        "abs(time - 700) > 0.01 then 1 else g",
        "sin(time/1000) < 0 then g else 1",
        "time < 7 then 2 elseif time < 9 then g else 3",
    ] {
        let plant = plant(declarations, &format!("der(x) = -k*x + (if {choice});"));
        let hidden = match choice.contains("tau") {
            true => ["x k g", "", "tau"],
            false => ["x k g", "tau", ""],
        };
        let answer = judged(&plant, &question(), hidden);
        let part = &answer.partial[0];
        assert_eq!(
            (part.name.as_str(), part.at[0].0.as_str()),
            ("g", "time"),
            "{choice}"
        );
        assert!((part.share - 1.0).abs() < 1e-9, "{part:?}");
        let later = |note: &Note| matches!(note, Note::Branches { later: true, .. });
        assert!(answer.notes.iter().any(later), "{:?}", answer.notes);
        // with a known start a later branch may show it, or not
        let known = Question {
            known_starts: vec!["x".into()],
            ..question()
        };
        let hidden = match choice.contains("tau") {
            true => ["k", "", "tau g"],
            false => ["k", "tau", "g"],
        };
        judged(&plant, &known, hidden);
    }
    let plant = plant(
        declarations,
        "der(x) = -k*x + (if time > tau then g else 1);",
    );
    let values = [("x", 1.0), ("k", 0.5), ("tau", 5.0), ("g", 3.0)];
    assert_eq!(run(&plant, &values, |_| 0.0).told("x k tau g"), "x k tau g");
}

/// At first z is seen, then not any more: a share of the box is told at the time at which it is hidden.
#[test]
fn what_a_later_branch_hides_is_told_with_its_time() {
    let plant = plant(
        "Real x(min=0, max=1); Real z(min=0, max=4); output Real y = x;",
        "der(x) = -x + (if time < 10 then z elseif z < 1 then z else 0); der(z) = 0;",
    );
    let answer = judged(&plant, &Question::default(), ["x z", "", ""]);
    let part = &answer.partial[0];
    let at: HashMap<&str, f64> = part.at.iter().map(|(n, x)| (n.as_str(), *x)).collect();
    assert!(at["time"] > 10.0 && at["z"] > 1.0, "{part:?}");
    assert!((part.share - 0.75).abs() < 0.2, "{part:?}");
}

/// From its known start x falls into the branch that shows g; where it rests it never does.
#[test]
fn known_starts_move_into_other_branches() {
    let declarations = "parameter Real g=2; Real x(start=1, fixed=true); output Real y = x;";
    let falls = plant(declarations, "der(x) = if x > 0 then -1 else -g;");
    judged(&falls, &question(), ["", "", "g"]);
    let through = run(&falls, &[("x", 1.0), ("g", 2.0)], |_| 0.0);
    assert_eq!(through.told("g"), "g");
    let scaled = plant(
        "parameter Real g=2; parameter Real h=2; Real x(start=1, fixed=true); output Real y = x;",
        "der(x) = if x > 0.5 then -g*h*x else -g*h;",
    );
    judged(&scaled, &question(), ["", "g h", ""]);
    let through = run(&scaled, &[("x", 1.0), ("g", 0.5), ("h", 0.9)], |_| 0.0);
    assert_eq!(through.told("g h"), "");
    let rests = plant(
        "parameter Real g=2; Real x(start=0, fixed=true); output Real y = x;",
        "der(x) = -g*abs(x) - g*max(x, 3*x);",
    );
    judged(&rests, &question(), ["", "g", ""]);
}

/// A known start is that at time zero: the branch there is the one before the choice of time.
#[test]
fn a_known_start_is_in_the_branch_of_time_zero() {
    let plant = plant(
        "parameter Real g=2; parameter Real k=1; Real x(start=1, fixed=true); output Real y = x;",
        "der(x) = if time < 0.05 then -g*x else -k*x;",
    );
    judged(&plant, &question(), ["g", "", "k"]);
}

/// An unknown input hides z in both branches, and itself.
#[test]
fn what_unknown_inputs_hide_alike_is_hidden() {
    let declarations = "input Real w(min=0, max=2); Real x(min=-1, max=1); Real z(min=0, max=1); output Real y = x;";
    let unknown = Question {
        unknown: vec!["w".into()],
        ..Question::default()
    };
    for equation in [
        "der(x) = -x + max(w*z, 0.2*w*z); der(z) = -z;",
        "der(x) = if x < 0 then w*z else -x; der(z) = -z;",
        "der(x) = (if x < 0 then 2 else 1)*w*z - x; der(z) = 0;",
    ] {
        judged(&plant(declarations, equation), &unknown, ["x", "z w", ""]);
    }
    // here one branch shows z, and then the other may show the input
    let shown = plant(
        declarations,
        "der(x) = if x < 0 then w*z else z; der(z) = 0;",
    );
    judged(&shown, &unknown, ["x z", "", "w"]);
}

/// A choice that is the same on the whole box is made: p + q·s with a factor s that is 1 or −1, by the branch. On a box
/// that lies in both nothing is decided.
#[test]
fn a_choice_that_the_box_makes_hides_for_certain() {
    for (factor, inside, across) in [
        ("sqrt(z^2)/z", "min=0.5, max=3", "min=-1, max=3"),
        ("abs(z)/z", "min=-3, max=-0.5", "min=-1, max=3"),
        ("sign(z)", "min=0.5, max=3", "min=-1, max=3"),
        (
            "(if z < 0.2 then -1 else 1)",
            "min=0.2, max=3",
            "min=-1, max=3",
        ),
        (
            "(if z <= 0.2 and time > 0 then -1 else 1)",
            "min=0.3, max=3",
            "min=-1, max=3",
        ),
        ("(2*floor(z) - 1)", "min=1.1, max=1.9", "min=0.1, max=1.9"),
        (
            "(max(z, 0)/z - min(z, 0)/z)",
            "min=0, max=3",
            "min=-1, max=3",
        ),
        ("der_of_asin(z)", "min=-1.5, max=1.5", "min=1, max=2"),
        ("der_of_acos(z)", "min=3.2, max=6.2", "min=1, max=6"),
    ] {
        // the slopes of asin∘sin and acos∘cos by differences, which are exact within a branch
        let by = |outer: &str, inner: &str| {
            format!("(({outer}({inner}(z + 0.01)) - {outer}({inner}(z)))/0.01)")
        };
        let factor = match factor {
            "der_of_asin(z)" => by("asin", "sin"),
            "der_of_acos(z)" => by("acos", "cos"),
            own => own.to_owned(),
        };
        let hidden = |range: &str| {
            let declarations = format!(
                "parameter Real p; parameter Real q; Real x; Real z({range}); output Real y = x; output Real w = z;"
            );
            let plant = plant(
                &declarations,
                &format!("der(x) = p + q*{factor}; der(z) = 0;"),
            );
            let answer = analyse(&plant, &question()).unwrap();
            let is_told = answer
                .notes
                .iter()
                .any(|note| matches!(note, Note::Settled(_)));
            (verdicts(&answer)[1].clone(), is_told)
        };
        assert_eq!(hidden(inside), ("p q".to_owned(), true), "{factor}");
        assert_eq!(hidden(across), (String::new(), false), "{factor}");
    }
}
