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
    /// an extended Kalman filter along a tube
    Filter,
}

impl Kind {
    pub const ALL: [Self; 7] = [
        Self::Triangular,
        Self::BlockTriangular,
        Self::StateAffine,
        Self::DriftObservable,
        Self::UnknownInput,
        Self::Designed,
        Self::Filter,
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
            Self::Filter => "ekf",
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

/// Errors of the readings of an output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// standard deviation of Gaussian noise, bound of uniform noise; 0 for none
    pub size: f64,
    pub is_uniform: bool,
}

impl Noise {
    /// What a certificate takes it to stay within.
    pub fn bound(self) -> f64 {
        match self.is_uniform {
            true => self.size,
            false => 3.0 * self.size,
        }
    }
}

/// A known input over time.
#[derive(Clone, Debug)]
pub struct Wave {
    pub middle: f64,
    pub amplitude: f64,
    pub pace: f64,
}

impl Wave {
    pub fn value(&self, t: f64) -> f64 {
        self.middle + self.amplitude * (self.pace * t).sin()
    }

    fn text(&self) -> String {
        let [middle, amplitude, pace] = [self.middle, self.amplitude, self.pace].map(number);
        match self.amplitude == 0.0 {
            true => middle,
            false => format!("{middle} + {amplitude}*sin({pace}*time)"),
        }
    }
}

/// The run that a filter or an observer is followed along.
#[derive(Clone, Debug)]
pub struct Course {
    /// from sample to sample
    pub every: f64,
    /// the known inputs by their names
    pub known: Vec<(String, Wave)>,
    /// whether an observer's measurements follow the model between samples
    pub is_predicted: bool,
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
    /// per output
    pub noise: Vec<Noise>,
    /// densities of process noise, by states and unknown inputs
    pub process: Vec<(String, f64)>,
    /// the bound of the known inputs' derivatives, where the study declares one
    pub slope: Option<f64>,
    /// what is asked about its tube
    pub tube: Option<Asked>,
    /// of a filter, and of an observer that is followed
    pub course: Option<Course>,
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
        let noise = self.noise.iter().enumerate().filter(|(_, n)| n.size > 0.0);
        let noise = noise.map(|(i, Noise { size, is_uniform })| match is_uniform {
            true => format!("y{} = {{ uniform = {size:?} }}", i + 1),
            false => format!("y{} = {size:?}", i + 1),
        });
        let noise: Vec<String> = noise.collect();
        if !noise.is_empty() {
            _ = writeln!(text, "noise = {{ {} }}", noise.join(", "));
        }
        if !self.process.is_empty() {
            text += "\n[process_noise]\n";
        }
        for (name, density) in &self.process {
            _ = writeln!(text, "{name} = {density:?}");
        }
        self.write_course(&mut text);
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

    /// What it is followed along: the study's own simulation.
    fn write_course(&self, text: &mut String) {
        let (Some(course), Some(asked)) = (&self.course, &self.tube) else {
            return;
        };
        let (until, every) = (asked.until, course.every);
        _ = writeln!(
            text,
            "\n[simulate]\nuntil = {until:?}\nsample_step = {every:?}\noutput_step = {every:?}"
        );
        let inputs = self.inputs.iter().map(|Input { side, .. }| {
            let own = course.known.iter().find(|(name, _)| *name == side.name);
            let value = own.map_or_else(|| number(side.middle()), |(_, wave)| wave.text());
            format!("{} = {value:?}", side.name)
        });
        let inputs: Vec<String> = inputs.collect();
        if !inputs.is_empty() {
            _ = writeln!(text, "inputs = {{ {} }}", inputs.join(", "));
        }
        // it is compared with what is said of it in exact arithmetic
        text.push_str("\n[estimate]\nrtol = 1e-11\natol = 1e-14\n");
        if course.is_predicted {
            text.push_str("between_samples = \"predict\"\n");
        }
    }
}
