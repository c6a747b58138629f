//! Functional mock-up units: the files of the archive, of which the C is [`c`]'s.

use super::c::{self, File, Precision, prefix};
use super::description::{Description, Role, Variable, build, page};
use super::device::{Device, codes};
use super::draft::comment;
use super::template::chosen;
use crate::Refusal;

pub use super::description::{Base, Experiment, Quantity, Unit, Version};

const HEAD: &str = include_str!("runtime/fmu/head.c");
const CORE: &str = include_str!("runtime/fmu/core.c");
const TAIL: &str = include_str!("runtime/fmu/tail.c");
const THREE: &str = include_str!("runtime/fmu/fmi3.c");
const THREE_ABSENT: &str = include_str!("runtime/fmu/fmi3_absent.c");
const TWO: &str = include_str!("runtime/fmu/fmi2.c");
const THREE_EXCHANGE: &str = include_str!("runtime/fmu/fmi3_exchange.c");
const TWO_EXCHANGE: &str = include_str!("runtime/fmu/fmi2_exchange.c");

/// The part of the templates that is for continuous states.
pub(super) const EXCHANGE: &str = "exchange";

/// A device as a functional mock-up unit.
#[derive(Clone, Copy, Debug)]
pub struct Component<'a> {
    /// the estimator
    pub device: &'a Device<'a>,
    /// its signals, in the order of the device
    pub signals: &'a [Quantity],
    /// its estimates, in the order of the device
    pub estimates: &'a [Quantity],
    /// the starts of its first states, in their order
    pub starts: &'a [Quantity],
    /// the numbers that may be changed while it runs, in the order of the device
    pub tunables: &'a [Quantity],
    /// every unit that a quantity names, once
    pub units: &'a [Unit],
    /// the independent variable
    pub time: &'a Quantity,
    /// what a tool starts from, where the study says
    pub experiment: Option<Experiment>,
}

impl Component<'_> {
    /// The name of the archive, of its library and of its functions' source: a name of C.
    pub fn identifier(&self) -> String {
        prefix(self.device.name)
    }

    fn title(&self) -> String {
        format!("Estimator for {}", self.device.name)
    }
}

/// The texts of the archive: `modelDescription.xml`, under `sources/` what a C compiler needs, and a page
/// for people.
///
/// # Errors
/// As [`c::files`].
pub fn files(
    component: &Component<'_>,
    version: Version,
    precision: Precision,
) -> Result<Vec<File>, Refusal> {
    let name = component.identifier();
    let mut sources = c::files(component.device, precision)?;
    sources.retain(|file| file.name == format!("{name}.h") || file.name == format!("{name}.c"));
    Ok(archive(
        &name,
        version,
        sources,
        |token| description(component, version, token),
        |token| wrapper(component, version, precision, token),
        page(
            component.device.name,
            &component.title(),
            component.device.about,
        ),
    ))
}

/// The files of an archive around the C that is wrapped: `description` gives `modelDescription.xml`, `wrapper`
/// what answers as the standard asks, each with the token of the archive; `page` is for people.
pub(super) fn archive(
    name: &str,
    version: Version,
    mut files: Vec<File>,
    description: impl Fn(&str) -> String,
    wrapper: impl Fn(&str) -> String,
    page: String,
) -> Vec<File> {
    let texts = files.iter().map(|file| file.text.as_str());
    let token = token(texts.chain([description("").as_str()]));
    files.push(File {
        name: version.wrapper().to_owned(),
        text: wrapper(&token),
    });
    if version == Version::Three {
        files.push(File {
            name: "buildDescription.xml".into(),
            text: build(name),
        });
    }
    for file in &mut files {
        file.name.insert_str(0, "sources/");
    }
    let description = File {
        name: "modelDescription.xml".into(),
        text: description(&token),
    };
    files.insert(0, description);
    files.push(File {
        name: "documentation/index.html".into(),
        text: page,
    });
    files
}

impl Version {
    /// How the standard's macros begin.
    fn macros(self) -> &'static str {
        match self {
            Self::Two => "FMI2",
            Self::Three => "FMI3",
        }
    }

    /// The functions of the standard around what they call, of which what `holds` names is chosen, with
    /// places filled.
    pub(super) fn wrapped(self, core: &str, holds: &[&str], places: &[(&str, String)]) -> String {
        let has = |part| holds.contains(&part);
        let edition: Vec<&str> = match self {
            Self::Two if has(EXCHANGE) => vec![TWO, TWO_EXCHANGE],
            Self::Two => vec![TWO],
            Self::Three if has(EXCHANGE) => vec![THREE, THREE_ABSENT, THREE_EXCHANGE],
            Self::Three => vec![THREE, THREE_ABSENT],
        };
        let draft = [HEAD, core, TAIL, &edition.concat()].join("\n");
        let draft = chosen(&draft, holds).replace("@FMI@", self.macros());
        places
            .iter()
            .fold(draft, |text, (word, value)| text.replace(word, value))
    }
}

/// Cases of a `switch` that say what went wrong.
pub(super) fn reasons(codes: impl Iterator<Item = (usize, &'static str)>) -> String {
    let case = |(number, about): (usize, &str)| {
        let about = comment(about);
        format!("    case {number}:\n        return \"{about}\";\n")
    };
    codes.map(case).collect()
}

fn wrapper(
    component: &Component<'_>,
    version: Version,
    precision: Precision,
    token: &str,
) -> String {
    let name = component.identifier();
    let real = match precision {
        Precision::F64 => "double",
        Precision::F32 => "float",
    };
    let starts = component.signals.iter().map(|signal| match signal.start {
        start if start.is_finite() => match precision {
            Precision::F64 => format!("{start:?}"),
            Precision::F32 => format!("{:?}f", start as f32),
        },
        // which is a `float` in C
        _ => format!("({real})NAN"),
    });
    let title = format!(
        "/* {}: {name} as a functional mock-up unit. */\n",
        version.wrapper()
    );
    let holds: &[&str] = match component.tunables {
        [] => &[],
        _ => &["tunable"],
    };
    let values = [
        ("@NAME@", name.clone()),
        ("@CAPITALS@", name.to_ascii_uppercase()),
        ("@REAL@", real.to_owned()),
        ("@SENSORS@", component.device.sensors().to_string()),
        ("@STARTS@", component.starts.len().to_string()),
        ("@TOKEN@", token.to_owned()),
        ("@FIRST_SIGNALS@", starts.collect::<Vec<_>>().join(", ")),
        (
            "@REASONS@",
            reasons(codes(component.device).map(|reason| (reason.number, reason.about))),
        ),
    ];
    title + &version.wrapped(CORE, holds, &values)
}

/// `modelDescription.xml` of an estimator.
fn description(component: &Component<'_>, version: Version, token: &str) -> String {
    let variables = variables(component);
    Description {
        model: component.device.name,
        title: &component.title(),
        units: component.units,
        experiment: component.experiment,
        categories: &["logStatusError"],
        variables: &variables,
        indicators: 0,
        interface: interface(component, version),
        structure: structure(&variables, version),
    }
    .text(version, token)
}

fn variables<'q>(component: &Component<'q>) -> Vec<Variable<'q>> {
    let of = |quantities: &'q [Quantity], role| {
        quantities
            .iter()
            .map(move |quantity| Variable { quantity, role })
    };
    let mut all = vec![Variable {
        quantity: component.time,
        role: Role::Time,
    }];
    all.extend(of(component.signals, Role::Signal));
    all.extend(of(component.estimates, Role::Estimate));
    all.extend(of(component.starts, Role::Start));
    all.extend(of(component.tunables, Role::Tunable));
    all
}

fn interface(component: &Component<'_>, version: Version) -> String {
    let name = component.identifier();
    match version {
        Version::Two => format!(
            "  <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" \
             canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\">\n\
             \x20   <SourceFiles>\n      <File name=\"{name}.c\"/>\n      <File name=\"{}\"/>\n    </SourceFiles>\n\
             \x20 </CoSimulation>\n",
            version.wrapper()
        ),
        Version::Three => format!(
            "  <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" \
             canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" hasEventMode=\"true\"/>\n"
        ),
    }
}

/// What is computed: every estimate, from everything.
fn structure(variables: &[Variable<'_>], version: Version) -> String {
    let all = variables.iter().enumerate();
    let estimates = all.filter(|(_, variable)| variable.role == Role::Estimate);
    let places: Vec<usize> = estimates.map(|(place, _)| place).collect();
    let each = |line: &dyn Fn(usize) -> String| places.iter().map(|p| line(*p)).collect::<String>();
    match version {
        Version::Two => {
            let unknowns = each(&|place| format!("      <Unknown index=\"{}\"/>\n", place + 1));
            format!(
                "    <Outputs>\n{unknowns}    </Outputs>\n    <InitialUnknowns>\n{unknowns}    </InitialUnknowns>\n"
            )
        }
        Version::Three => {
            each(&|place| format!("    <Output valueReference=\"{place}\"/>\n"))
                + &each(&|place| format!("    <InitialUnknown valueReference=\"{place}\"/>\n"))
        }
    }
}

/// A name for these texts and no others, as a UUID is written: FNV-1a with 128 bits.
fn token<'t>(texts: impl Iterator<Item = &'t str>) -> String {
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    let hash = texts.flat_map(str::bytes).fold(BASIS, |hash, byte| {
        (hash ^ u128::from(byte)).wrapping_mul(PRIME)
    });
    let digits = format!("{hash:032x}");
    let parts = [0..8, 8..12, 12..16, 16..20, 20..32].map(|part| &digits[part]);
    parts.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_that_of_the_texts() {
        // the reference values of the hash's authors: of nothing, and of "a"
        assert_eq!(
            token([].into_iter()),
            "6c62272e-07bb-0142-62b8-21756295c58d"
        );
        assert_eq!(
            token(["a"].into_iter()),
            "d228cb69-6f1a-8caf-7891-2b704e4a8964"
        );
    }
}
