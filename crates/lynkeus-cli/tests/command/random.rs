//! Plants of no particular form: whatever they are, there is an answer.

use crate::Folder;
use crate::normal::Normal;

/// Which of `choices` comes next.
pub fn pick<'c, T>(random: &mut Normal, choices: &'c [T]) -> &'c T {
    let place = random.uniform() * choices.len() as f64;
    &choices[place as usize]
}

fn term(random: &mut Normal, names: &[String]) -> String {
    let factor = *pick(random, &["0.5", "-1", "2", "-0.3", "0.1"]);
    let (a, b) = (pick(random, names).clone(), pick(random, names));
    match pick(random, &[0, 0, 1, 1, 2, 3, 4]) {
        0 => format!("({factor}*{a})"),
        1 => format!("({factor}*{a}*{b})"),
        2 => format!("({factor}*{a}^2)"),
        3 => format!("({factor}*sin({a}))"),
        _ => format!("({factor}*sqrt({a} + 3))"),
    }
}

fn sum(random: &mut Normal, names: &[String]) -> String {
    let count = *pick(random, &[1, 2, 3]);
    let terms: Vec<String> = (0..count).map(|_| term(random, names)).collect();
    terms.join(" + ")
}

/// A model with its unknown inputs.
pub fn plant(random: &mut Normal) -> (String, Vec<String>) {
    let names = |letter: &str, count: usize| -> Vec<String> {
        (0..count).map(|i| format!("{letter}{i}")).collect()
    };
    let (states, known) = (pick(random, &[1, 2, 3, 4]), pick(random, &[0, 1, 2]));
    let (states, known) = (names("x", *states), names("u", *known));
    let unknown = names("w", *pick(random, &[0, 1, 2]));
    let all = [&states[..], &known, &unknown].concat();
    let mut text = "model M\n".to_owned();
    for name in &all {
        let input = if states.contains(name) { "" } else { "input " };
        let start = pick(random, &["0", "0.5", "1", "-0.5"]);
        text += &format!("{input}Real {name}(start = {start}, min = -2, max = 2);\n");
    }
    let output = match random.uniform() < 0.7 {
        true => pick(random, &states).clone(),
        false => sum(random, &states),
    };
    text += &format!("output Real y = {output};\nequation\n");
    for state in &states {
        text += &format!("der({state}) = {};\n", sum(random, &all));
    }
    (text + "end M;\n", unknown)
}

#[test]
fn every_plant_has_an_answer() {
    for seed in 0..40 {
        let mut random = Normal(seed);
        let (model, unknown) = plant(&mut random);
        let folder = Folder::empty();
        folder.write("m.mo", &model);
        let study = format!("plant = \"m.mo\"\n[sensors]\nunknown = {unknown:?}\n");
        folder.write("s.toml", &study);
        let ended = folder.run(&["check", "s.toml", "--json", "--time-limit", "10"]);
        assert!([0, 1].contains(&ended.code), "{model}\n{}", ended.err);
        assert_eq!(ended.json()["plant"], "M");
    }
}
