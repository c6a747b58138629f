//! Command lines, most of them sensible.

use super::base::Base;
use crate::numbers::Numbers;

/// What a result must look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Csv,
    /// a table of which an infinity is an answer
    CsvOrInfinite,
    Svg,
    Json,
    Text,
}

/// A command, with where its results go.
#[derive(Clone, Debug)]
pub struct Command {
    pub arguments: Vec<String>,
    /// files that it reads
    pub inputs: Vec<String>,
    /// files that may change, with what they become
    pub results: Vec<(String, Form)>,
    /// what standard output has
    pub printed: Form,
    /// the study that may be rewritten
    pub rewritten: Option<String>,
}

impl Command {
    fn new(words: &[&str], base: &Base, printed: Form) -> Self {
        let words: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
        let read = |word: &&String| base.files.iter().any(|(name, _)| name == *word);
        let mut inputs: Vec<String> = words.iter().filter(read).cloned().collect();
        inputs.push(base.model().to_owned());
        Self {
            arguments: words,
            inputs,
            results: vec![],
            printed,
            rewritten: None,
        }
    }

    /// Whether a limit of time may end it.
    pub fn has_limit(&self) -> bool {
        let given = |word: &String| ["--time-limit", "design", "certify"].contains(&word.as_str());
        self.arguments.iter().any(given)
    }

    fn flag(&mut self, numbers: &mut Numbers, chance: f64, words: &[&str]) -> bool {
        let chosen = numbers.chance(chance);
        if chosen {
            self.arguments.extend(words.iter().map(|w| (*w).to_owned()));
        }
        chosen
    }

    /// An option with a file.
    fn result(
        &mut self,
        numbers: &mut Numbers,
        chance: f64,
        option: &str,
        form: Form,
        base: &Base,
    ) -> bool {
        let name = match numbers.below(12) {
            0 => "-",
            1 => numbers.of(&[base.study(), base.model(), "log.csv"]),
            2 => "missing/result",
            _ => *numbers.of(&["a", "b", "c", "d"]),
        };
        let name = name.to_owned();
        if !self.flag(numbers, chance, &[option, &name]) {
            return false;
        }
        match name.as_str() {
            "-" => self.printed = form,
            _ => self.results.push((name, form)),
        }
        true
    }

    fn json(&mut self, numbers: &mut Numbers) {
        if self.flag(numbers, 0.4, &["--json"]) {
            self.printed = Form::Json;
        }
    }
}

const ABOUT: &[&str] = &[
    "x1*x2",
    "sin(time)",
    "y1",
    "1/0",
    "der(x1)",
    "((",
    "k1+k2",
    "\u{1b}[2J",
];

/// One command, or a simulation whose log another reads.
pub fn choose(numbers: &mut Numbers, base: &Base) -> Vec<Command> {
    let study = base.study();
    match numbers.below(9) {
        0 | 1 => vec![check(numbers, base)],
        2 => vec![report(numbers, base, "design")],
        3 => vec![report(numbers, base, "certify")],
        4 => vec![run(numbers, base, &["simulate", study])],
        5 | 6 => match base.log() {
            Some(log) => vec![run(numbers, base, &["estimate", study, log])],
            None => vec![
                logged(base),
                run(numbers, base, &["estimate", study, "made.csv"]),
            ],
        },
        7 => vec![compare(numbers, base)],
        _ => vec![tune(numbers, base)],
    }
}

fn logged(base: &Base) -> Command {
    let words = [
        "simulate",
        base.study(),
        "--log",
        "made.csv",
        "-o",
        "all.csv",
    ];
    let mut command = Command::new(&words, base, Form::Text);
    for name in ["made.csv", "all.csv"] {
        command.results.push((name.to_owned(), Form::Csv));
    }
    command
}

fn check(numbers: &mut Numbers, base: &Base) -> Command {
    let input = match numbers.chance(0.2) {
        true => base.model(),
        false => base.study(),
    };
    let words = ["check", input, "--time-limit", "2", "--memory-limit", "256"];
    let mut command = Command::new(&words, base, Form::Text);
    command.flag(numbers, 0.3, &["--parameters"]);
    if numbers.chance(0.3) {
        command.flag(numbers, 0.3, &["--how-well"]);
        command.flag(numbers, 0.3, &["--sensors"]);
        let horizon = *numbers.of(&["1", "0", "-1", "1e300", "nan", "0.001"]);
        command.flag(numbers, 0.3, &["--horizon", horizon]);
        command.json(numbers);
        command.result(numbers, 0.4, "-o", Form::CsvOrInfinite, base);
        command.result(numbers, 0.4, "--plot", Form::Svg, base);
        return command;
    }
    let about = *numbers.of(ABOUT);
    command.flag(numbers, 0.3, &["--about", about]);
    command.json(numbers);
    command.result(numbers, 0.2, "--singular", Form::Svg, base);
    command
}

/// `design` and `certify`.
fn report(numbers: &mut Numbers, base: &Base, word: &str) -> Command {
    let mut command = Command::new(&[word, base.study()], base, Form::Text);
    command.json(numbers);
    let form = command.printed;
    command.result(numbers, 0.4, "-o", form, base);
    command
}

/// `simulate` and `estimate`.
fn run(numbers: &mut Numbers, base: &Base, words: &[&str]) -> Command {
    let mut command = Command::new(words, base, Form::Csv);
    command.json(numbers);
    command.flag(numbers, 0.3, &["-q"]);
    command.result(numbers, 0.5, "-o", Form::Csv, base);
    command.result(numbers, 0.4, "--plot", Form::Svg, base);
    if words[0] == "simulate" {
        command.result(numbers, 0.4, "--log", Form::Csv, base);
        let seed = *numbers.of(&["0", "7", "18446744073709551615"]);
        command.flag(numbers, 0.2, &["--seed", seed]);
        let runs = *numbers.of(&["0", "1", "3", "70"]);
        // without a file for the table it is a summary that is printed
        if command.flag(numbers, 0.2, &["--runs", runs]) && command.printed == Form::Csv {
            command.printed = Form::Text;
        }
    }
    let backend = *numbers.of(&["interpreter", "native"]);
    command.flag(numbers, 0.4, &["--backend", backend]);
    command
}

fn compare(numbers: &mut Numbers, base: &Base) -> Command {
    let words = ["compare", base.study(), "--time-limit", "20"];
    let mut command = Command::new(&words, base, Form::Text);
    if let Some(log) = base.log()
        && command.flag(numbers, 0.5, &[log])
    {
        command.inputs.push(log.to_owned());
    }
    command.json(numbers);
    command.result(numbers, 0.3, "--plot", Form::Svg, base);
    command
}

fn tune(numbers: &mut Numbers, base: &Base) -> Command {
    let mut command = Command::new(&["tune", base.study()], base, Form::Text);
    command.json(numbers);
    if let Some(log) = base.log()
        && command.flag(numbers, 0.5, &["--log", log])
    {
        command.inputs.push(log.to_owned());
    }
    command.result(numbers, 0.3, "-o", Form::Csv, base);
    command.result(numbers, 0.3, "--plot", Form::Svg, base);
    if command.flag(numbers, 0.3, &["--write"]) {
        command.rewritten = Some(base.study().to_owned());
    }
    command
}
