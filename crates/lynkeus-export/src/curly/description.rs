//! What an archive says of itself: `modelDescription.xml` and `buildDescription.xml`.

use lynkeus_answer::visible::is_hidden;
use std::collections::HashSet;

/// Which edition of the standard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0
    Two,
    /// FMI 3.0
    #[default]
    Three,
}

/// A unit, in SI base units where it can be written in them.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// as the model writes it
    pub name: String,
    /// none where a part of it is not known
    pub base: Option<Base>,
}

/// `value · factor + offset` counts in kg^a m^b s^c A^d K^e mol^f cd^g.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// powers of kg, m, s, A, K, mol and cd
    pub powers: [i32; 7],
    /// how many of the base unit one of it is
    pub factor: f64,
    /// where its zero lies, in the base unit
    pub offset: f64,
}

/// A run that a tool may propose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Experiment {
    /// its first instant
    pub start: f64,
    /// its last
    pub stop: f64,
    /// from one communication point to the next
    pub step: f64,
}

/// What the description says of a variable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quantity {
    /// its name, unlike all others
    pub name: String,
    /// one line; may be empty
    pub description: String,
    /// the name of a unit
    pub unit: Option<String>,
    /// a difference of values: the zero of its unit does not count
    pub is_difference: bool,
    /// before anything is set; not finite where nothing was measured
    pub start: f64,
    /// the ends of its range, where it has any
    pub range: [Option<f64>; 2],
    /// its typical size, above 0
    pub nominal: Option<f64>,
}

impl Version {
    /// The source that answers as the standard asks.
    pub(super) fn wrapper(self) -> &'static str {
        match self {
            Self::Two => "fmi2.c",
            Self::Three => "fmi3.c",
        }
    }
}

/// The place of a variable in the model, from which its value reference follows.
pub(super) struct Variable<'q> {
    pub quantity: &'q Quantity,
    pub role: Role,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    Signal,
    Estimate,
    Start,
    Tunable,
    /// continuous, as those that follow
    Input,
    State {
        is_output: bool,
    },
    /// of the state with this value reference
    Derivative {
        of: usize,
    },
    /// passes zero where a state may jump
    Indicator,
}

/// What every `modelDescription.xml` has.
pub(super) struct Description<'a> {
    /// the name of the model
    pub model: &'a str,
    /// what the component is, in words
    pub title: &'a str,
    pub units: &'a [Unit],
    pub experiment: Option<Experiment>,
    /// of messages
    pub categories: &'a [&'static str],
    /// in the order of their value references
    pub variables: &'a [Variable<'a>],
    /// how many of these are event indicators
    pub indicators: usize,
    /// the elements of the interfaces that are offered
    pub interface: String,
    /// what `ModelStructure` holds
    pub structure: String,
}

impl Description<'_> {
    pub fn text(&self, version: Version, token: &str) -> String {
        let units: String = self.units.iter().map(unit).collect();
        let units = match units.is_empty() {
            true => units,
            false => format!("  <UnitDefinitions>\n{units}  </UnitDefinitions>\n"),
        };
        let (edition, token_name) = match version {
            Version::Two => ("2.0", "guid"),
            Version::Three => ("3.0", "instantiationToken"),
        };
        let indicators = match (version, self.indicators) {
            (Version::Two, count) if count > 0 => format!(" numberOfEventIndicators=\"{count}\""),
            _ => String::new(),
        };
        let experiment = self.experiment.map(experiment).unwrap_or_default();
        let categories = self.categories.iter();
        let categories: String = categories
            .map(|name| format!("    <Category name=\"{name}\"/>\n"))
            .collect();
        let names = names(self.variables);
        let variables = self.variables.iter().zip(&names).enumerate();
        let written: String = match version {
            Version::Two => variables.map(|(k, (v, name))| scalar(k, v, name)).collect(),
            Version::Three => variables.map(|(k, (v, name))| float(k, v, name)).collect(),
        };
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"{edition}\" modelName=\"{}\" {token_name}=\"{token}\" \
             description=\"{}\" generationTool=\"lynkeus {}\" variableNamingConvention=\"flat\"{indicators}>\n\
             {}{units}  <LogCategories>\n{categories}  </LogCategories>\n{experiment}\
             \x20 <ModelVariables>\n{written}  </ModelVariables>\n\
             \x20 <ModelStructure>\n{}  </ModelStructure>\n\
             </fmiModelDescription>\n",
            escaped(self.model),
            escaped(self.title),
            env!("CARGO_PKG_VERSION"),
            self.interface,
            self.structure,
        )
    }
}

fn experiment(experiment: Experiment) -> String {
    let Experiment { start, stop, step } = experiment;
    let [start, stop, step] = [start, stop, step].map(number);
    format!(
        "  <DefaultExperiment startTime=\"{start}\" stopTime=\"{stop}\" stepSize=\"{step}\"/>\n"
    )
}

fn unit(unit: &Unit) -> String {
    let name = escaped(&unit.name);
    let Some(Base {
        powers,
        factor,
        offset,
    }) = unit.base
    else {
        return format!("    <Unit name=\"{name}\"/>\n");
    };
    let names = ["kg", "m", "s", "A", "K", "mol", "cd"].iter().zip(powers);
    let mut base: String = names
        .filter(|(_, power)| *power != 0)
        .map(|(name, power)| format!(" {name}=\"{power}\""))
        .collect();
    for (word, value, usual) in [("factor", factor, 1.0), ("offset", offset, 0.0)] {
        if value != usual {
            base += &format!(" {word}=\"{value:?}\"");
        }
    }
    format!("    <Unit name=\"{name}\">\n      <BaseUnit{base}/>\n    </Unit>\n")
}

/// A number as XML Schema writes it.
fn number(value: f64) -> String {
    match value {
        v if v == f64::INFINITY => "INF".to_owned(),
        v if v == f64::NEG_INFINITY => "-INF".to_owned(),
        v => format!("{v:?}"),
    }
}

impl Variable<'_> {
    fn causality(&self) -> &'static str {
        match self.role {
            Role::Time => "independent",
            Role::Signal | Role::Input => "input",
            Role::Estimate | Role::State { is_output: true } => "output",
            Role::Start | Role::Tunable => "parameter",
            Role::State { is_output: false } | Role::Derivative { .. } | Role::Indicator => "local",
        }
    }

    fn variability(&self) -> &'static str {
        match self.role {
            Role::Time | Role::Estimate | Role::Indicator => "continuous",
            Role::Input | Role::State { .. } | Role::Derivative { .. } => "continuous",
            // a sample, which nobody should draw lines between
            Role::Signal => "discrete",
            Role::Start => "fixed",
            Role::Tunable => "tunable",
        }
    }

    fn name(&self, name: &str) -> String {
        let description = match self.quantity.description.is_empty() {
            true => String::new(),
            false => format!(" description=\"{}\"", escaped(&self.quantity.description)),
        };
        format!("name=\"{}\"", escaped(name)) + &description
    }

    fn unit(&self) -> String {
        let Some(unit) = &self.quantity.unit else {
            return String::new();
        };
        let relative = match self.quantity.is_difference {
            true => " relativeQuantity=\"true\"",
            false => "",
        };
        format!(" unit=\"{}\"{relative}", escaped(unit))
    }

    fn start(&self) -> String {
        match self.role {
            Role::Signal | Role::Start | Role::Tunable | Role::Input | Role::State { .. } => {
                format!(" start=\"{}\"", number(self.quantity.start))
            }
            Role::Time | Role::Estimate | Role::Derivative { .. } | Role::Indicator => {
                String::new()
            }
        }
    }

    /// A state is what it is set to.
    fn initial(&self) -> &'static str {
        match self.role {
            Role::State { .. } => " initial=\"exact\"",
            _ => "",
        }
    }

    /// Ends of the range and the typical size.
    fn range(&self) -> String {
        let Quantity { range, nominal, .. } = self.quantity;
        let [min, max] = range;
        let parts = [("min", min), ("max", max), ("nominal", nominal)];
        let written = parts.into_iter().filter_map(|(word, value)| {
            let value = value.as_ref()?;
            Some(format!(" {word}=\"{}\"", number(*value)))
        });
        written.collect()
    }

    /// Whose derivative it is: a value reference, or in FMI 2.0 a place from 1 on.
    fn derivative(&self, version: Version) -> String {
        match (self.role, version) {
            (Role::Derivative { of }, Version::Three) => format!(" derivative=\"{of}\""),
            (Role::Derivative { of }, Version::Two) => format!(" derivative=\"{}\"", of + 1),
            _ => String::new(),
        }
    }
}

/// The names of the variables, each once and without what the standard or XML forbids: a question mark
/// stands for it, and where two would be alike a number follows. A derivative is that of the new name.
fn names(variables: &[Variable<'_>]) -> Vec<String> {
    let own = |v: &Variable<'_>| v.quantity.name.clone();
    let mut taken: HashSet<String> = variables
        .iter()
        .map(own)
        .filter(|n| is_written(n))
        .collect();
    let mut names: Vec<String> = vec![];
    for variable in variables {
        let own = own(variable);
        if is_written(&own) {
            names.push(own);
            continue;
        }
        let of = match variable.role {
            Role::Derivative { of } => names.get(of).map(|state| format!("der({state})")),
            _ => None,
        };
        let plain = of.unwrap_or_else(|| own.replace(is_unwritten, "?"));
        let numbered = (2..).map(|k| format!("{plain}_{k}"));
        let mut candidates = std::iter::once(plain.clone()).chain(numbered);
        let name = candidates.find(|name| taken.insert(name.clone()));
        names.push(name.unwrap_or(plain));
    }
    names
}

fn is_written(name: &str) -> bool {
    !name.contains(is_unwritten)
}

/// What no name has: control characters, line ends, and what is no character of XML.
fn is_unwritten(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{fffe}' | '\u{ffff}')
}

/// A variable of FMI 3.0.
fn float(reference: usize, variable: &Variable<'_>, name: &str) -> String {
    format!(
        "    <Float64 {} valueReference=\"{reference}\" causality=\"{}\" variability=\"{}\"{}{}{}{}{}/>\n",
        variable.name(name),
        variable.causality(),
        variable.variability(),
        variable.initial(),
        variable.unit(),
        variable.range(),
        variable.start(),
        variable.derivative(Version::Three),
    )
}

/// A variable of FMI 2.0.
fn scalar(reference: usize, variable: &Variable<'_>, name: &str) -> String {
    format!(
        "    <ScalarVariable {} valueReference=\"{reference}\" causality=\"{}\" variability=\"{}\"{}>\n\
         \x20     <Real{}{}{}{}/>\n    </ScalarVariable>\n",
        variable.name(name),
        variable.causality(),
        variable.variability(),
        variable.initial(),
        variable.unit(),
        variable.range(),
        variable.start(),
        variable.derivative(Version::Two),
    )
}

/// `buildDescription.xml` of FMI 3.0.
pub(super) fn build(name: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiBuildDescription fmiVersion=\"3.0\">\n\
         \x20 <BuildConfiguration modelIdentifier=\"{name}\">\n\
         \x20   <SourceFileSet language=\"C99\">\n\
         \x20     <SourceFile name=\"{name}.c\"/>\n\
         \x20     <SourceFile name=\"{}\"/>\n\
         \x20   </SourceFileSet>\n\
         \x20 </BuildConfiguration>\n\
         </fmiBuildDescription>\n",
        Version::Three.wrapper()
    )
}

/// `documentation/index.html`: what the component is, in lines for people.
pub(super) fn page(model: &str, title: &str, about: &[String]) -> String {
    let (name, title) = (escaped(model), escaped(title));
    let about = about.iter().map(|line| escaped(line) + "\n");
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{name}</title>\n\
         <h1>{title}</h1>\n<pre>\n{}</pre>\n</html>\n",
        about.collect::<String>()
    )
}

/// In an attribute of XML; what XML has no way to write becomes a question mark.
fn escaped(text: &str) -> String {
    let each = |c: char| match c {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        '\n' => "&#10;".to_owned(),
        '\u{fffe}' | '\u{ffff}' => "?".to_owned(),
        c if c.is_control() => "?".to_owned(),
        // a reader of the file sees it
        c if is_hidden(c) => format!("&#{};", u32::from(c)),
        c => c.to_string(),
    };
    text.chars().map(each).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_in_base_units() {
        let written = |name: &str, base| {
            unit(&Unit {
                name: name.into(),
                base,
            })
        };
        assert_eq!(written("a<b", None), "    <Unit name=\"a&lt;b\"/>\n");
        let litre = Base {
            powers: [0, 3, -1, 0, 0, 0, 0],
            factor: 1e-3,
            offset: 0.0,
        };
        assert_eq!(
            written("l/s", Some(litre)),
            "    <Unit name=\"l/s\">\n      <BaseUnit m=\"3\" s=\"-1\" factor=\"0.001\"/>\n    </Unit>\n"
        );
    }

    /// Names that would be alike, one that has the question mark itself, and their derivatives.
    #[test]
    fn names_are_written_and_stay_apart() {
        let all = ["a\u{1}", "a\u{2}", "a?", "y\nz", "b"];
        let quantities = all.map(|name| Quantity {
            name: name.into(),
            ..Quantity::default()
        });
        let rates = all.map(|name| Quantity {
            name: format!("der({name})"),
            ..Quantity::default()
        });
        let states = quantities.iter().map(|quantity| Variable {
            quantity,
            role: Role::State { is_output: false },
        });
        let rates = rates.iter().enumerate().map(|(of, quantity)| Variable {
            quantity,
            role: Role::Derivative { of },
        });
        let variables: Vec<Variable<'_>> = states.chain(rates).collect();
        assert_eq!(
            names(&variables),
            [
                "a?_2",
                "a?_3",
                "a?",
                "y?z",
                "b",
                "der(a?_2)",
                "der(a?_3)",
                "der(a?)",
                "der(y?z)",
                "der(b)"
            ]
        );
    }

    #[test]
    fn numbers_and_texts_of_xml() {
        assert_eq!(number(f64::NAN), "NaN");
        assert_eq!(number(f64::NEG_INFINITY), "-INF");
        assert_eq!(number(1e-300), "1e-300");
        assert_eq!(
            escaped("a \"<&>\"\u{1}\n\u{202e}"),
            "a &quot;&lt;&amp;&gt;&quot;?&#10;&#8238;"
        );
    }
}
