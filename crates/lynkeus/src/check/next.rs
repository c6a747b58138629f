//! What to type next, with what to paste into the study.

use std::path::Path;

use lynkeus_answer::Document;
use lynkeus_answer::document::Table;
use lynkeus_expr::real::rounded;
use lynkeus_model::Variable;
use lynkeus_observers::{Initial, Tuning, Value as Tuned};
use lynkeus_proof::spectrum;
use lynkeus_words::figures;
use serde::{Serialize, Serializer};
use serde_json::Value;

use crate::Study;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::choice::{Choice, Grounds, Proposal};
use lynkeus_experiment::words::number;

/// What to do next.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Next {
    /// commands to type; for people, each with what it does
    #[serde(serialize_with = "lines")]
    #[cfg_attr(test, schemars(with = "Vec<String>"))]
    pub commands: Vec<(String, &'static str)>,
    /// `[observer]`, and what else belongs to it, as TOML; none where the study has it all
    pub observer: Option<String>,
    /// a whole study for a bare model, `[observer]` included
    pub study: Option<String>,
}

impl Next {
    pub(super) fn new(prepared: &Prepared<'_>, choice: &Choice) -> Self {
        let study = prepared.study();
        let bare = study.is_bare();
        let is_missing = !choice.is_asked_for || choice.proposal.is_some();
        let observer = (bare || is_missing).then(|| observer(prepared, choice));
        let file = match bare {
            true => "study.toml".to_owned(),
            false => quoted_for_shell(&study.file),
        };
        Self {
            commands: commands(study, bare, choice, &file),
            study: observer
                .as_ref()
                .filter(|_| bare)
                .map(|observer| skeleton(prepared, observer)),
            observer,
        }
    }
}

/// The commands alone.
fn lines<S: Serializer>(commands: &[(String, &'static str)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(commands.iter().map(|(command, _)| command))
}

impl Next {
    pub(super) fn tell(&self, document: &mut Document) {
        let paste = match (&self.study, &self.observer) {
            (Some(study), _) => Some(("a study to begin with (study.toml):", study)),
            (None, Some(observer)) => Some(("to paste into the study:", observer)),
            (None, None) => None,
        };
        if let Some((words, text)) = paste {
            document.part().line(words).part().code(text);
        }
        let commands = self.commands.iter();
        let rows = commands.map(|(command, what)| vec![command.as_str().into(), (*what).into()]);
        let table = Table::plain(["command", "what it tells"]).with(rows);
        document.heading("next:").table(table);
    }
}

fn commands(study: &Study, bare: bool, choice: &Choice, file: &str) -> Vec<(String, &'static str)> {
    let line = |rest: String, what| (format!("lynkeus {rest}"), what);
    let mut found = vec![];
    if bare || study.simulate.is_some() {
        found.push(line(
            format!("simulate {file} --plot run.svg"),
            "how it does in simulation",
        ));
        found.push(line(
            format!("check {file} --how-well"),
            "how well each quantity can be known",
        ));
        if choice.grounds != Grounds::Filter {
            found.push(line(
                format!("tune {file} --plot tune.svg"),
                "the best speed",
            ));
        }
        found.push(line(
            format!("compare {file}"),
            "every family on the same data",
        ));
    }
    found.push(line(
        format!("estimate {file} LOG.csv -o estimate.csv"),
        "on a log of yours",
    ));
    found
}

fn quoted_for_shell(file: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/\\.:_-+,=@%".contains(c);
    match (
        file.chars().all(plain),
        file.chars().all(|c| plain(c) || c == ' '),
    ) {
        (true, _) => file.to_owned(),
        (false, true) => format!("\"{file}\""),
        (false, false) => format!("'{}'", file.replace('\'', "'\\''")),
    }
}

/// A name as a key of TOML.
fn key(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    match !name.is_empty() && name.chars().all(plain) {
        true => name.to_owned(),
        false => text(name),
    }
}

/// A text of TOML.
fn text(value: &str) -> String {
    Value::from(value).to_string()
}

/// A value as TOML.
fn toml(value: &Tuned) -> String {
    match value {
        Tuned::Text(word) => text(word),
        Tuned::List(values) => {
            let values: Vec<String> = values.iter().map(toml).collect();
            format!("[{}]", values.join(", "))
        }
        Tuned::Table(values) => {
            let pairs = values
                .iter()
                .map(|(name, value)| format!("{} = {}", key(name), toml(value)));
            format!("{{ {} }}", pairs.collect::<Vec<_>>().join(", "))
        }
        plain => plain.to_string(),
    }
}

fn observer(prepared: &Prepared<'_>, choice: &Choice) -> String {
    let study = prepared.study();
    let mut lines = vec![
        "[observer]".to_owned(),
        format!("family = {}", text(choice.family.name())),
    ];
    if let Some(Proposal {
        speed, value, why, ..
    }) = &choice.proposal
    {
        lines.push(format!("{} = {value}  # {why}", speed.key()));
    }
    let given = study.observer.tuning.values.iter();
    let given = given.filter(|(name, _)| choice.family.owns(name));
    lines.extend(given.map(|(name, value)| format!("{} = {}", key(name), toml(value))));
    lines.extend(common(&study.observer.tuning));
    if choice.grounds == Grounds::Filter && !prepared.declared().process_noise.is_declared() {
        lines.extend(process_noise(prepared));
    }
    lines.join("\n") + "\n"
}

/// The keys of every family, as the study has them.
fn common(tuning: &Tuning) -> Vec<String> {
    let Initial { default, values } = &tuning.initial;
    let default = default.iter().map(|value| format!("default = {value}"));
    let values = values
        .iter()
        .map(|(name, value)| format!("{} = {value}", key(name)));
    let starts: Vec<String> = default.chain(values).collect();
    let mut lines = vec![];
    if !starts.is_empty() {
        lines.push(format!("initial = {{ {} }}", starts.join(", ")));
    }
    if tuning.clamp {
        lines.push("clamp = true".to_owned());
    }
    lines
}

/// What the filter takes where nothing is declared, to be edited.
fn process_noise(prepared: &Prepared<'_>) -> Vec<String> {
    let augmented = prepared.augmented();
    let unknown = &augmented.states[augmented.plant_states()..];
    let mut lines = vec![
        String::new(),
        "# [process_noise]  # spectral densities: how far the model is trusted".to_owned(),
    ];
    let own = unknown
        .iter()
        .chain(augmented.states.iter().take(augmented.plant_states()));
    for state in own.take(6) {
        let width = state.max - state.min;
        let size = if width.is_finite() && width > 0.0 {
            width
        } else {
            state.start.unwrap_or(0.0).abs().max(1.0)
        };
        let is_unknown = unknown.iter().any(|u| u.name == state.name);
        let (share, what) = match is_unknown {
            true => (0.1, "a tenth of its range in one unit of time"),
            false => (1e-4, "a ten-thousandth of its range in one unit of time"),
        };
        lines.push(format!(
            "# {} = {}  # {what}",
            key(&state.name),
            figures((share * size).powi(2), 2)
        ));
    }
    lines
}

/// A study for a bare model.
fn skeleton(prepared: &Prepared<'_>, observer: &str) -> String {
    let (study, plant) = (prepared.study(), prepared.plant());
    let file = study.plant.as_deref().and_then(Path::file_name);
    let file = file.map_or(String::new(), |name| name.to_string_lossy().into_owned());
    let mut lines = vec![format!("plant = {}", text(&file))];
    lines.extend(
        study
            .model
            .iter()
            .map(|model| format!("model = {}", text(model))),
    );
    let names = |variables: &[Variable]| {
        variables
            .iter()
            .map(|v| text(&v.name))
            .collect::<Vec<_>>()
            .join(", ")
    };
    lines.push("\n[sensors]".to_owned());
    lines.push(format!(
        "measured = [{}]  # what sensors show",
        names(&plant.outputs)
    ));
    if !plant.inputs.is_empty() {
        lines.push(format!(
            "unknown = []  # inputs that nobody measures, of {}",
            names(&plant.inputs)
        ));
    }
    let noises = plant.outputs.iter().filter_map(|output| {
        let states = plant.states.iter().find(|s| s.node == output.node);
        let shown = if (output.max - output.min).is_finite() {
            Some(output)
        } else {
            states
        };
        let width = shown
            .map(|v| v.max - v.min)
            .filter(|w| w.is_finite() && *w > 0.0)?;
        Some(format!(
            "{} = {}",
            key(&output.name),
            figures(0.01 * width, 2)
        ))
    });
    let noises: Vec<String> = noises.collect();
    if !noises.is_empty() {
        lines.push(format!(
            "noise = {{ {} }}  # standard deviations: 1 % of the range",
            noises.join(", ")
        ));
    }
    lines.push(format!("\n{observer}"));
    lines.push("[simulate]".to_owned());
    let until = choice_of_span(prepared);
    lines.push(format!("until = {}", number(until)));
    lines.push("seed = 1".to_owned());
    if !plant.inputs.is_empty() {
        let inputs = plant.inputs.iter().map(|input| {
            let middle = (input.min + input.max) / 2.0;
            let value = input
                .start
                .unwrap_or(if middle.is_finite() { middle } else { 0.0 });
            format!("{} = \"{value}\"", key(&input.name))
        });
        lines.push(format!(
            "inputs = {{ {} }}  # expressions of time",
            inputs.collect::<Vec<_>>().join(", ")
        ));
    }
    lines.join("\n") + "\n"
}

/// Ten times the slowest time scale of the plant at its start, else 10.
fn choice_of_span(prepared: &Prepared<'_>) -> f64 {
    let augmented = prepared.augmented();
    let J = lynkeus_experiment::prepare::modes::Start::of(augmented).jacobian(augmented);
    let Some(modes) = J.and_then(spectrum::eigenvalues) else {
        return 10.0;
    };
    let sizes: Vec<f64> = modes.iter().map(|λ| λ.norm()).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let slowest = sizes
        .into_iter()
        .filter(|x| *x > 1e-6 * largest)
        .fold(f64::INFINITY, f64::min);
    let span = 10.0 / slowest;
    let rounded = rounded(span, 1);
    if rounded.is_finite() && rounded > 0.0 {
        rounded
    } else {
        10.0
    }
}

#[cfg(test)]
mod tests {
    use super::quoted_for_shell;

    #[test]
    fn a_shell_reads_the_name_that_was_meant() {
        for (name, typed) in [
            ("plants/s-1.toml", "plants/s-1.toml"),
            ("größe.toml", "größe.toml"),
            ("a b.toml", "\"a b.toml\""),
            ("d$x (1).toml", "'d$x (1).toml'"),
            ("it's.toml", "'it'\\''s.toml'"),
        ] {
            assert_eq!(quoted_for_shell(name), typed);
        }
    }
}
