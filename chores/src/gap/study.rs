//! The text of a shipped study with another tuning, box or simulation.

use std::fs;

use super::rows::Row;
use xtask::process::root;

/// Names with numbers.
pub type Values<'a> = &'a [(String, f64)];

/// A study's text, line by line, without noise and pictures.
#[derive(Clone, Debug)]
pub struct Text {
    lines: Vec<String>,
    key: &'static str,
    powers: &'static [i32],
    tuning: Vec<f64>,
    /// the inputs of `[simulate]` as (name, value in TOML)
    inputs: Vec<(String, String)>,
}

impl Text {
    /// The study of a row, on the row's box.
    pub fn of(row: &Row) -> Result<Self, String> {
        Self::read(row, &[], row.certify)
    }

    /// The study as the theorem is asked about it: without some keys, on the declared box.
    pub fn for_theorem(row: &Row) -> Result<Self, String> {
        Self::read(row, row.theorem_without, row.theorem_with)
    }

    fn read(row: &Row, without: &[&str], appended: &str) -> Result<Self, String> {
        let path = root().join("examples").join(row.study);
        let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        let folder = path.parent().unwrap_or(&path).display().to_string();
        let text = text.replace("plant = \"", &format!("plant = \"{folder}/"));
        let dropped = ["noise"].iter().chain(without);
        let dropped: Vec<String> = dropped.map(|key| format!("{key} = ")).collect();
        let mut text = Self {
            lines: without_entries(&text, &dropped),
            key: row.key,
            powers: row.powers,
            tuning: vec![],
            inputs: vec![],
        };
        let value = |key: &str| text.value(key).unwrap_or_default();
        let tuning = numbers(&value(row.key));
        let inputs = entries(value("inputs").trim_matches(['{', '}', ' ']));
        (text.tuning, text.inputs) = (tuning, inputs);
        let observer = text.lines.iter().position(|line| line == "[observer]");
        let observer = observer.ok_or("no [observer]")? + 1;
        text.lines
            .splice(observer..observer, row.observer.lines().map(str::to_owned));
        text.lines.extend(appended.lines().map(str::to_owned));
        Ok(text)
    }

    fn value(&self, key: &str) -> Option<String> {
        let start = format!("{key} = ");
        let line = self.lines.iter().find(|line| line.starts_with(&start))?;
        let value = line[start.len()..].split('#').next()?;
        Some(value.trim().to_owned())
    }

    fn values(&self, factor: f64) -> Vec<f64> {
        let power = |i: usize| self.powers.get(i).copied().unwrap_or(1);
        let values = self.tuning.iter().enumerate();
        values.map(|(i, x)| x * factor.powi(power(i))).collect()
    }

    /// The scaled tuning, for people.
    pub fn tuning(&self, factor: f64) -> String {
        let values: Vec<String> = self.values(factor).into_iter().map(super::number).collect();
        match &values[..] {
            [one] => one.clone(),
            _ => format!("({})", values.join(", ")),
        }
    }

    /// The study with its tuning times a factor.
    pub fn scaled(&self, factor: f64) -> String {
        let values: Vec<String> = self
            .values(factor)
            .iter()
            .map(|x| format!("{x:?}"))
            .collect();
        let value = match &values[..] {
            [one] => one.clone(),
            _ => format!("[{}]", values.join(", ")),
        };
        let start = format!("{} = ", self.key);
        let line = |line: &String| match line.starts_with(&start) {
            true => format!("{start}{value}"),
            false => line.clone(),
        };
        let lines: Vec<String> = self.lines.iter().map(line).collect();
        lines.join("\n") + "\n"
    }

    /// The study with `gain = "lmi"` and no gain above the limit.
    pub fn with_designed_gain(&self, limit: f64) -> String {
        let own = [
            "theta",
            "delta",
            "r",
            "S",
            "partials",
            "k",
            "correction",
            "clamp",
        ];
        let own: Vec<String> = own.iter().map(|key| format!("{key} = ")).collect();
        let text = without_entries(&self.lines.join("\n"), &own).join("\n");
        let gain = format!("[observer]\ngain = \"lmi\"\ngain_limit = {limit:?}");
        text.replace("[observer]", &gain) + "\n"
    }

    /// A study's text with the simulation of one trial; `starts` and the estimate's are
    /// (name, value), among them the constant unknown inputs.
    pub fn simulation(
        study: &str,
        inputs: &[(String, String)],
        until: f64,
        (plant, estimate): (Values<'_>, Values<'_>),
    ) -> String {
        let mut lines = without_entries(study, &["initial = ".to_owned()]);
        if let Some(start) = lines.iter().position(|line| line == "[simulate]") {
            let rest = &lines[start + 1..];
            let end = rest.iter().position(|line| line.starts_with('['));
            let end = end.map_or(lines.len(), |end| start + 1 + end);
            lines.drain(start..end);
        }
        let observer = lines
            .iter()
            .position(|line| line == "[observer]")
            .unwrap_or(0);
        lines.insert(observer + 1, format!("initial = {}", table(estimate)));
        let inputs: Vec<String> = inputs.iter().map(|(n, v)| format!("{n} = {v}")).collect();
        let step = until / f64::from(ROWS);
        lines.push(format!(
            "[simulate]\nuntil = {until:?}\noutput_step = {step:?}\nrtol = 1e-7\natol = 1e-10\ninputs = {{ {} }}\ninitial = {}",
            inputs.join(", "),
            table(plant)
        ));
        lines.join("\n") + "\n"
    }

    /// The inputs with some of them constant.
    pub fn inputs_with(&self, constant: &[(String, f64)]) -> Vec<(String, String)> {
        let known = self.inputs.iter();
        let known = known.filter(|(name, _)| !constant.iter().any(|(c, _)| c == name));
        let constant = constant.iter().map(|(n, x)| (n.clone(), format!("{x:?}")));
        known.cloned().chain(constant).collect()
    }
}

/// Rows of a simulated trial.
pub const ROWS: u32 = 250;

/// Lines without those entries (over several lines, as lists are) and without `[plot]`.
fn without_entries(text: &str, dropped: &[String]) -> Vec<String> {
    let (mut kept, mut open, mut plot) = (vec![], 0_i32, false);
    for line in text.lines() {
        if line.starts_with('[') && open == 0 {
            plot = line == "[plot]";
        }
        let starts = dropped.iter().any(|start| line.starts_with(start.as_str()));
        if open > 0 || starts {
            open += line.matches('[').count() as i32 - line.matches(']').count() as i32;
        } else if !plot {
            kept.push(line.to_owned());
        }
    }
    kept
}

fn numbers(list: &str) -> Vec<f64> {
    let parts = list.trim_matches(['[', ']']).split(',');
    parts.filter_map(|part| part.trim().parse().ok()).collect()
}

/// `a = 1, b = "x, y"` as pairs.
fn entries(table: &str) -> Vec<(String, String)> {
    let (mut parts, mut quoted) = (vec![String::new()], false);
    for letter in table.chars() {
        quoted ^= letter == '"';
        match letter {
            ',' if !quoted => parts.push(String::new()),
            _ => parts.last_mut().into_iter().for_each(|p| p.push(letter)),
        }
    }
    let pair = |part: &String| {
        let (name, value) = part.split_once('=')?;
        Some((name.trim().to_owned(), value.trim().to_owned()))
    };
    parts.iter().filter_map(pair).collect()
}

fn table(pairs: &[(String, f64)]) -> String {
    let pairs: Vec<String> = pairs
        .iter()
        .map(|(n, x)| format!("\"{n}\" = {x:?}"))
        .collect();
    format!("{{ {} }}", pairs.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_over_several_lines_are_dropped_whole() {
        let text = "a = 1\nS = [\n  { x = [1] },\n]\nb = 2\n[plot]\nshow = 1";
        assert_eq!(
            without_entries(text, &["S = ".to_owned()]),
            ["a = 1", "b = 2"]
        );
    }

    #[test]
    fn commas_in_expressions_do_not_part() {
        let found = entries("u = 1, v = \"max(time, 2)\"");
        assert_eq!(found[1], ("v".to_owned(), "\"max(time, 2)\"".to_owned()));
    }
}
