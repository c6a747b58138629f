//! Random models of which one thing is known by construction.

use super::plant;
use lynkeus_observability::{Answer, Question, Verdict, analyse};

const MODELS: u64 = 500;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }

    fn of<'a>(&mut self, among: &'a [String]) -> &'a str {
        &among[self.below(among.len())]
    }

    /// An expression in these names, a third of them not rational.
    fn expression(&mut self, names: &[String], depth: usize) -> String {
        if depth == 0 || names.is_empty() {
            return match self.below(4) {
                0 => format!("{}", 1 + self.below(9)),
                _ if names.is_empty() => "3".into(),
                _ => self.of(names).to_owned(),
            };
        }
        let a = self.expression(names, depth - 1);
        let b = self.expression(names, depth - 1);
        match self.below(12) {
            0..=2 => format!("({a} + {b})"),
            3 | 4 => format!("({a} - 2*{b})"),
            5..=7 => format!("({a})*({b})"),
            8 => format!("({a})/(3 + ({b})^2)"),
            9 => format!("exp(-({a}))"),
            10 => format!("sin({a})*({b})"),
            _ => format!("sqrt(2 + ({a})^2)"),
        }
    }
}

fn names(prefix: &str, count: usize) -> Vec<String> {
    (1..=count).map(|i| format!("{prefix}{i}")).collect()
}

fn declared(kind: &str, names: &[String]) -> String {
    names.iter().map(|n| format!("{kind} {n}; ")).collect()
}

/// Every combination that is said to be known has to be, and the count has to fit.
fn invariants_hold(model: &lynkeus_model::Plant, question: &Question, answer: &Answer, of: &str) {
    let told = answer.symmetries.iter();
    let invariants: Vec<String> = told.flat_map(|s| s.invariants.clone()).collect();
    for symmetry in &answer.symmetries {
        assert!(symmetry.directions <= symmetry.moves.len(), "{of}");
        if !symmetry.invariants.is_empty() {
            let known = symmetry.moves.len() - symmetry.directions;
            assert_eq!(symmetry.invariants.len(), known, "{of} {symmetry:?}");
        }
        for name in &symmetry.moves {
            let verdict = answer.verdict(name);
            assert_eq!(verdict, Some(Verdict::Unobservable), "{of} {symmetry:?}");
        }
    }
    let asking = Question {
        about: invariants,
        ..question.clone()
    };
    for asked in analyse(model, &asking).unwrap().about {
        assert_eq!(asked.verdict, Verdict::Observable, "{} {of}", asked.name);
    }
}

/// A model around invariants z1 … zn; `z1` is what the symmetry leaves alone.
/// (declarations, equations, names that must be hidden)
fn symmetric(random: &mut Random) -> (String, String, Vec<String>) {
    let n = 1 + random.below(3);
    let states = names("z", n);
    let parameters = names("p", random.below(3));
    let all = [states.clone(), parameters.clone()].concat();
    let slope = random.expression(&all, 2);
    let output = random.expression(&all, 2);
    let kind = random.below(6);
    let w = random.expression(&all, 1);
    let (extra, z1, equations, hidden): (&str, &str, String, &[&str]) = match kind {
        0 => (
            "Real x; parameter Real c;",
            "c*x",
            format!("der(x) = ({slope})/c;"),
            &["x", "c"],
        ),
        1 => (
            "Real x; parameter Real c;",
            "x + 3*c",
            format!("der(x) = {slope};"),
            &["x", "c"],
        ),
        2 => (
            "Real x; parameter Real c; parameter Real d;",
            "x^2*d/c",
            format!("der(x) = ({slope})*c/(2*x*d);"),
            &["x", "c", "d"],
        ),
        3 => (
            "Real x; Real v; parameter Real c;",
            "x^2 + v^2",
            format!("der(x) = x*({slope}) - c*v; der(v) = v*({slope}) + c*x;"),
            &["x", "v", "c"],
        ),
        4 => (
            "Real x; Real v; parameter Real c;",
            "x",
            format!("der(x) = {slope}; der(v) = c*v + ({w})*sin(v);"),
            &["v", "c"],
        ),
        _ => (
            "Real x; Real v; input Real w;",
            "x",
            format!("der(x) = ({slope}) + v*w; der(v) = -v^2;"),
            &["v", "w"],
        ),
    };
    let mut equations = format!("z1 = {z1}; {equations} y = {output};");
    for state in &states[1..] {
        equations += &format!(" der({state}) = {};", random.expression(&all, 2));
    }
    let declarations = format!(
        "{extra} {}{}output Real y; output Real y2 = z1;",
        declared("Real", &states),
        declared("parameter Real", &parameters)
    );
    let hidden = hidden.iter().map(|s| (*s).to_owned()).collect();
    (declarations, equations, hidden)
}

#[test]
fn a_planted_symmetry_is_never_called_observable() {
    let mut told = 0;
    for seed in 0..MODELS {
        let (declarations, equations, hidden) = symmetric(&mut Random(seed));
        let model = plant(&declarations, &equations);
        let unknown = model.inputs.iter().map(|i| i.name.clone()).collect();
        let question = Question {
            unknown,
            ..super::question()
        };
        let answer = analyse(&model, &question).unwrap();
        let of = format!("{seed}: {declarations}\n{equations}");
        for name in &hidden {
            let verdict = answer.verdict(name);
            assert_eq!(
                verdict,
                Some(Verdict::Unobservable),
                "{name} {of} {answer:?}"
            );
        }
        invariants_hold(&model, &question, &answer, &of);
        told += usize::from(answer.symmetries.iter().any(|s| !s.invariants.is_empty()));
    }
    assert!(told > 200, "invariants were named for {told} models only");
}

/// x1' = f1(x1) + g1·x2, x2' = f2(x1, x2) + g2·x3, …, and a parameter or an unknown input
/// at the end: each is read off the one before.
#[test]
fn a_triangular_chain_is_never_called_unobservable() {
    for seed in 0..MODELS {
        let mut random = Random(seed + 10_000);
        let n = 1 + random.below(6);
        let states = names("x", n);
        let end = ["p", "w"][random.below(2)];
        let kind = if end == "p" { "parameter" } else { "input" };
        let mut equations = String::new();
        for i in 0..n {
            let next = states.get(i + 1).map_or(end, String::as_str);
            let before = &states[..=i];
            let (f, g) = (random.expression(before, 2), random.expression(before, 1));
            let gain = ["1", "-2", &format!("(2 + ({g})^2)"), &format!("exp({g})")]
                [random.below(4)]
            .to_owned();
            equations += &format!("der(x{}) = {f} + {gain}*{next};\n", i + 1);
        }
        let h = ["x1", "exp(x1)", "x1^3", "atan(x1)"][random.below(4)];
        let declarations = format!(
            "{kind} Real {end}; {}output Real y = {h};",
            declared("Real", &states)
        );
        let model = plant(&declarations, &equations);
        let unknown = if end == "w" { vec!["w".into()] } else { vec![] };
        let question = Question {
            unknown,
            ..super::question()
        };
        let answer = analyse(&model, &question).unwrap();
        assert!(
            answer.is_complete(),
            "{seed}: {declarations}\n{equations}{answer:?}"
        );
        assert!(answer.symmetries.is_empty());
        // no more derivatives than it takes
        assert_eq!(answer.order, n, "{seed}: {declarations}\n{equations}");
    }
}
