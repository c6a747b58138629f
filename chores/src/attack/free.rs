//! Plants of no particular form, with any family, filters among them.

use std::fmt::Write;

use super::base::Base;
use crate::numbers::Numbers;

const FUNCTIONS: &[&str] = &[
    "sin", "cos", "tanh", "abs", "sign", "exp", "atan", "floor", "sqrt", "log",
];

const OBSERVERS: &[&str] = &[
    "",
    "[observer]\nfamily = \"ekf\"\n",
    "[observer]\nfamily = \"ekf\"\ngate = 3\n[estimate]\nsmooth = true\n",
    "[observer]\nfamily = \"ukf\"\n[estimate]\nlag = 3\n",
    "[observer]\nfamily = \"mhe\"\nhorizon = 4\n",
    "[observer]\nfamily = \"triangular\"\ntheta = 4\n[estimate]\nsd = true\n",
    "[observer]\nfamily = \"drift-observable\"\npoles = -3\n",
    "[observer]\nfamily = \"block-triangular\"\ntheta = [2]\n",
    "[observer]\nfamily = \"state-affine\"\ntheta = 2\n",
];

/// What the model's names are.
struct Names {
    states: Vec<String>,
    known: Vec<String>,
    unknown: Vec<String>,
}

/// A plant with a study and a short simulation.
pub fn free(numbers: &mut Numbers) -> Base {
    let mut names = |letter: &str, least: usize, most: usize| -> Vec<String> {
        let count = least + numbers.below(most - least + 1);
        (0..count).map(|i| format!("{letter}{i}")).collect()
    };
    let names = Names {
        states: names("x", 1, 5),
        known: names("u", 0, 2),
        unknown: names("w", 0, 2),
    };
    let outputs = 1 + numbers.below(2);
    let files = [
        ("study.toml", study(numbers, &names, outputs)),
        ("plant.mo", model(numbers, &names, outputs)),
    ];
    Base {
        files: files
            .map(|(name, text)| (name.to_owned(), text.into_bytes()))
            .into(),
    }
}

fn study(numbers: &mut Numbers, names: &Names, outputs: usize) -> String {
    let mut text = "plant = \"plant.mo\"\n[sensors]\n".to_owned();
    if !names.unknown.is_empty() {
        _ = writeln!(text, "unknown = {:?}", names.unknown);
    }
    if numbers.chance(0.7) {
        let noises = (0..outputs).map(|k| format!("y{k} = {:?}", numbers.size(1e-3, 0.3)));
        _ = writeln!(
            text,
            "noise = {{ {} }}",
            noises.collect::<Vec<_>>().join(", ")
        );
    }
    text += *numbers.of(OBSERVERS);
    let courses = ["1", "sin(3*time)", "if time < 0.5 then 1 else -1", "0"];
    let all = names.known.iter().chain(&names.unknown);
    let inputs: Vec<String> = all
        .map(|name| format!("{name} = \"{}\"", numbers.of(&courses)))
        .collect();
    let until = numbers.size(0.1, 10.0);
    let method = numbers.of(&[
        "",
        "method = \"rk4\"\nstep = 0.01\n",
        "method = \"implicit\"\n",
    ]);
    _ = writeln!(
        text,
        "[simulate]\nuntil = {until:?}\noutput_step = {:?}\n{method}inputs = {{ {} }}",
        until / 20.0,
        inputs.join(", ")
    );
    text
}

fn model(numbers: &mut Numbers, names: &Names, outputs: usize) -> String {
    let all = [&names.states[..], &names.known, &names.unknown].concat();
    let mut text = "model M\n".to_owned();
    for name in &all {
        let kind = match names.states.contains(name) {
            true => "",
            false => "input ",
        };
        let start = numbers.between(-1.0, 1.0);
        let range = match numbers.chance(0.9) {
            true => ", min = -2, max = 2",
            false => "",
        };
        _ = writeln!(text, "{kind}Real {name}(start = {start:?}{range});");
    }
    for k in 0..outputs {
        let shown = match numbers.chance(0.6) {
            true => numbers.of(&names.states).clone(),
            false => sum(numbers, &all),
        };
        _ = writeln!(text, "output Real y{k} = {shown};");
    }
    text += "equation\n";
    for state in &names.states {
        _ = writeln!(text, "der({state}) = {};", sum(numbers, &all));
    }
    text + "end M;\n"
}

fn sum(numbers: &mut Numbers, names: &[String]) -> String {
    let terms: Vec<String> = (0..1 + numbers.below(3))
        .map(|_| term(numbers, names))
        .collect();
    terms.join(" + ")
}

fn term(numbers: &mut Numbers, names: &[String]) -> String {
    let factor = numbers.signed(0.05, 3.0);
    let (a, b) = (numbers.of(names).clone(), numbers.of(names).clone());
    match numbers.below(8) {
        0..=2 => format!("({factor:?})*{a}"),
        3 => format!("({factor:?})*{a}*{b}"),
        4 => format!("({factor:?})*{a}^2"),
        5 => format!("({factor:?})*{a}/(3 + {b})"),
        6 => format!("({factor:?})*(if {a} > {b} then {a} else 0.5*{b})"),
        _ => format!("({factor:?})*{}({a})", numbers.of(FUNCTIONS)),
    }
}
