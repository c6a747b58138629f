//! A plant with its study, as text: what is attacked, shrunk and kept.

use std::fmt::Write;

/// Which claims a case is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Triangular,
    BlockTriangular,
    StateAffine,
    DriftObservable,
    UnknownInput,
    /// a gain by linear matrix inequalities
    Designed,
}

impl Kind {
    pub const ALL: [Self; 6] = [
        Self::Triangular,
        Self::BlockTriangular,
        Self::StateAffine,
        Self::DriftObservable,
        Self::UnknownInput,
        Self::Designed,
    ];

    /// As the command and the tables have it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Triangular => "triangular",
            Self::BlockTriangular => "block-triangular",
            Self::StateAffine => "state-affine",
            Self::DriftObservable => "drift-observable",
            Self::UnknownInput => "unknown-input",
            Self::Designed => "lmi",
        }
    }
}

/// A name with its range.
#[derive(Clone, Debug)]
pub struct Side {
    pub name: String,
    pub low: f64,
    pub high: f64,
}

impl Side {
    /// About the middle, in few digits.
    pub fn middle(&self) -> f64 {
        let middle = f64::midpoint(self.low, self.high);
        let short = (middle * 1e3).round() / 1e3;
        match self.low < short && short < self.high {
            true => short,
            false => middle,
        }
    }

    pub fn width(&self) -> f64 {
        self.high - self.low
    }
}

/// Who knows an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    Known,
    /// with the bound of its rate of change, where one is declared
    Unknown(Option<f64>),
    Disturbance,
}

#[derive(Clone, Debug)]
pub struct Input {
    pub side: Side,
    pub role: Role,
    /// whether the model declares the range
    pub declared: bool,
}

/// Sums of terms, so that terms can be dropped one by one.
pub type Sum = Vec<String>;

/// A derivative that stands in another's equation: an entry of the mass matrix beside its
/// diagonal of ones.
#[derive(Clone, Debug)]
pub struct Coupling {
    pub row: usize,
    pub column: usize,
    pub factor: String,
}

/// From where the plant may start, and until when it is asked to stay in the box.
#[derive(Clone, Debug)]
pub struct Asked {
    pub start: Vec<Side>,
    pub until: f64,
}

#[derive(Clone, Debug)]
pub struct Case {
    pub kind: Kind,
    pub states: Vec<Side>,
    pub inputs: Vec<Input>,
    /// right-hand sides, one per state
    pub equations: Vec<Sum>,
    /// empty where the derivatives are explicit
    pub couplings: Vec<Coupling>,
    pub outputs: Vec<Sum>,
    /// standard deviation per output; 0 for none
    pub noise: Vec<f64>,
    /// the bound of the known inputs' derivatives, where the study declares one
    pub slope: Option<f64>,
    /// what is asked about its tube
    pub tube: Option<Asked>,
    /// key and value of `[observer]`
    pub observer: Vec<(String, String)>,
}

/// A number as Modelica and TOML read it back bit by bit.
pub fn number(x: f64) -> String {
    let text = format!("{x:?}");
    if x < 0.0 { format!("({text})") } else { text }
}

fn sum(terms: &Sum) -> String {
    match terms.is_empty() {
        true => "0".to_owned(),
        false => terms.join(" + "),
    }
}

impl Case {
    /// Sets a key of `[observer]`.
    pub fn key(&mut self, name: &str, value: impl Into<String>) {
        self.observer.retain(|(key, _)| key != name);
        self.observer.push((name.to_owned(), value.into()));
    }

    /// The text of a key of `[observer]`.
    pub fn setting(&self, name: &str) -> Option<&str> {
        let found = self.observer.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    /// The Modelica text.
    pub fn model(&self) -> String {
        let mut text = "model M\n".to_owned();
        for input in &self.inputs {
            let Side { name, low, high } = &input.side;
            let range = match input.declared {
                true => format!("(min = {low:?}, max = {high:?})"),
                false => String::new(),
            };
            _ = writeln!(text, "  input Real {name}{range};");
        }
        for side in &self.states {
            let Side { name, low, high } = side;
            let start = side.middle();
            _ = writeln!(
                text,
                "  Real {name}(min = {low:?}, max = {high:?}, start = {start:?});"
            );
        }
        for (i, output) in self.outputs.iter().enumerate() {
            _ = writeln!(text, "  output Real y{} = {};", i + 1, sum(output));
        }
        text += "equation\n";
        for (i, (side, terms)) in self.states.iter().zip(&self.equations).enumerate() {
            let mut left = format!("der({})", side.name);
            for Coupling { column, factor, .. } in self.couplings.iter().filter(|c| c.row == i) {
                left += &format!(" + {factor}*der({})", self.states[*column].name);
            }
            _ = writeln!(text, "  {left} = {};", sum(terms));
        }
        text + "end M;\n"
    }

    /// The study.
    pub fn study(&self) -> String {
        let named = |wanted: fn(&Role) -> bool| -> String {
            let inputs = self.inputs.iter().filter(|i| wanted(&i.role));
            let names: Vec<String> = inputs.map(|i| format!("{:?}", i.side.name)).collect();
            names.join(", ")
        };
        let unknown = named(|role| matches!(role, Role::Unknown(_)));
        let disturbances = named(|role| *role == Role::Disturbance);
        let mut text = "plant = \"plant.mo\"\n\n[sensors]\n".to_owned();
        for (key, names) in [("unknown", unknown), ("disturbances", disturbances)] {
            if !names.is_empty() {
                _ = writeln!(text, "{key} = [{names}]");
            }
        }
        let noise = self.noise.iter().enumerate().filter(|(_, σ)| **σ > 0.0);
        let noise: Vec<String> = noise.map(|(i, σ)| format!("y{} = {σ:?}", i + 1)).collect();
        if !noise.is_empty() {
            _ = writeln!(text, "noise = {{ {} }}", noise.join(", "));
        }
        text += "\n[observer]\n";
        for (key, value) in &self.observer {
            _ = writeln!(text, "{key} = {value}");
        }
        let slew = self.inputs.iter().filter_map(|input| match input.role {
            Role::Unknown(Some(slew)) => Some(format!("{} = {slew:?}", input.side.name)),
            _ => None,
        });
        let slew: Vec<String> = slew.collect();
        if !slew.is_empty() || self.tube.is_some() {
            text += "\n[certify]\n";
        }
        if !slew.is_empty() {
            _ = writeln!(text, "slew = {{ {} }}", slew.join(", "));
        }
        if let Some(Asked { start, until }) = &self.tube {
            let range = |s: &Side| format!("{} = [{:?}, {:?}]", s.name, s.low, s.high);
            let start: Vec<String> = start.iter().map(range).collect();
            _ = writeln!(
                text,
                "start = {{ {} }}\nuntil = {until:?}",
                start.join(", ")
            );
        }
        text
    }
}
