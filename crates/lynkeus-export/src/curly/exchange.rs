//! Equations as functional mock-up units: model exchange and co-simulation in one archive.

use super::c::{File, prefix};
use super::description::{Description, Role, Variable, page};
use super::fmu::{Archive, EXCHANGE, Experiment, Quantity, Unit, Version, reasons};
use super::ode::{CODES, Ode, Sources, sources};
use crate::Refusal;

const CORE: &str = include_str!("runtime/fmu/ode.c");

/// Equations with what a description says of them.
#[derive(Clone, Copy, Debug)]
pub struct Exchange<'a> {
    /// the equations
    pub ode: &'a Ode<'a>,
    /// every unit that a quantity names, once
    pub units: &'a [Unit],
    /// the independent variable
    pub time: &'a Quantity,
    /// what a tool starts from, where the study says
    pub experiment: Option<Experiment>,
}

impl Exchange<'_> {
    /// The name of the archive, of its library and of its functions' source: a name of C.
    pub fn identifier(&self) -> String {
        prefix(self.ode.name)
    }

    /// The texts of the archive, as [`fmu::files`](super::fmu::files): for tools that integrate the
    /// equations themselves (model exchange), and for those that have them integrated with fixed steps
    /// (co-simulation).
    ///
    /// # Errors
    /// What jumps with time alone, no fixed steps, operations that C has not.
    pub fn files(&self, version: Version) -> Result<Vec<File>, Refusal> {
        let name = self.identifier();
        let ode = self.ode;
        let Sources {
            files,
            dependencies,
        } = sources(ode)?;
        let structure = Structure {
            inputs: ode.inputs.len(),
            states: ode.states,
            outputs: ode.outputs.len(),
            dependencies: &dependencies,
        };
        Ok(Archive {
            name: &name,
            version,
            sources: files.into(),
            description: &|token| self.description(&structure, version, token),
            wrapper: &|token| self.wrapper(version, token),
            page: page(ode.name, ode.title, ode.about),
        }
        .files())
    }

    fn description(&self, structure: &Structure<'_>, version: Version, token: &str) -> String {
        let ode = self.ode;
        let variable = |quantity, role| Variable { quantity, role };
        let mut variables = vec![variable(self.time, Role::Time)];
        variables.extend(ode.inputs.iter().map(|q| variable(q, Role::Input)));
        variables.extend(ode.states.iter().map(|state| {
            let is_output = state.is_output;
            variable(&state.quantity, Role::State { is_output })
        }));
        variables.extend(ode.states.iter().enumerate().map(|(i, state)| {
            let of = structure.state(i);
            variable(&state.derivative, Role::Derivative { of })
        }));
        variables.extend(ode.outputs.iter().map(|q| variable(q, Role::Estimate)));
        variables.extend(ode.parameters.iter().map(|q| variable(q, Role::Tunable)));
        Description {
            model: ode.name,
            title: ode.title,
            units: self.units,
            experiment: self.experiment,
            categories: &["logStatusError", "logStatusDiscard"],
            variables: &variables,
            interface: interface(&self.identifier(), version),
            structure: structure.text(version),
        }
        .text(version, token)
    }

    fn wrapper(&self, version: Version, token: &str) -> String {
        let name = self.identifier();
        let ode = self.ode;
        let listed = |numbers: Vec<f64>| match numbers.is_empty() {
            true => "0.0".to_owned(),
            false => {
                let texts: Vec<String> = numbers.iter().map(|n| format!("{n:?}")).collect();
                texts.join(", ")
            }
        };
        let given = ode.inputs.iter().chain(ode.parameters).map(|q| q.start);
        let nominals = ode.states.iter().map(|state| &state.quantity);
        let nominals = nominals.map(|q: &Quantity| q.nominal.unwrap_or(1.0));
        let places = [
            ("@NAME@", name.clone()),
            ("@CAPITALS@", name.to_ascii_uppercase()),
            ("@TOKEN@", token.to_owned()),
            ("@FIRST_GIVEN@", listed(given.collect())),
            ("@NOMINALS@", listed(nominals.collect())),
            ("@REASONS@", reasons(CODES.into_iter())),
        ];
        let file = version.wrapper();
        format!("/* {file}: {name} as a functional mock-up unit. */\n")
            + &version.wrapped(CORE, &[EXCHANGE], &places)
    }
}

fn interface(name: &str, version: Version) -> String {
    match version {
        Version::Two => {
            let of = |kind: &str, more: &str| {
                format!(
                    "  <{kind} modelIdentifier=\"{name}\" {more} canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" \
                     canSerializeFMUstate=\"true\" providesDirectionalDerivative=\"true\">\n\
                     \x20   <SourceFiles>\n      <File name=\"{name}.c\"/>\n      <File name=\"{}\"/>\n    </SourceFiles>\n\
                     \x20 </{kind}>\n",
                    version.wrapper()
                )
            };
            of("ModelExchange", "completedIntegratorStepNotNeeded=\"true\"")
                + &of(
                    "CoSimulation",
                    "canHandleVariableCommunicationStepSize=\"true\"",
                )
        }
        Version::Three => {
            let of = |kind: &str, more: &str| {
                format!(
                    "  <{kind} modelIdentifier=\"{name}\" {more}canGetAndSetFMUState=\"true\" \
                     canSerializeFMUState=\"true\" providesDirectionalDerivatives=\"true\"/>\n"
                )
            };
            of("ModelExchange", "")
                + &of(
                    "CoSimulation",
                    "canHandleVariableCommunicationStepSize=\"true\" ",
                )
        }
    }
}

/// What depends on what, by value references: time, inputs, states, derivatives, outputs, parameters.
struct Structure<'a> {
    inputs: usize,
    states: &'a [super::State],
    outputs: usize,
    /// by derivative, then by output: places in (t, x, u, p)
    dependencies: &'a [Vec<usize>],
}

/// A computed variable and the value references that it depends on.
struct Unknown {
    reference: usize,
    of: Vec<usize>,
}

/// When a variable is computed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// of everything that can be set
    Initialization,
    /// of what moves
    Run,
}

impl Structure<'_> {
    /// The value reference of a state.
    fn state(&self, place: usize) -> usize {
        1 + self.inputs + place
    }

    /// The value references of places in (t, x, u, p), in their order.
    fn known(&self, places: &[usize], phase: Phase) -> Vec<usize> {
        let states = self.states.len();
        let moving = states + self.inputs;
        let first_parameter = self.state(2 * states + self.outputs);
        let reference = |&place: &usize| match place {
            0 => 0,
            place if place <= states => self.state(place - 1),
            place if place <= moving => place - states,
            place => first_parameter + place - moving - 1,
        };
        let counts = |place: &&usize| phase == Phase::Initialization || **place <= moving;
        let mut known: Vec<usize> = places.iter().filter(counts).map(reference).collect();
        known.sort_unstable();
        known
    }

    /// The derivatives and the outputs that are no states.
    fn computed(&self, phase: Phase) -> Vec<Unknown> {
        let computed = self.dependencies.iter().enumerate();
        let unknown = |(place, of): (usize, &Vec<usize>)| Unknown {
            reference: self.state(self.states.len() + place),
            of: self.known(of, phase),
        };
        computed.map(unknown).collect()
    }

    fn text(&self, version: Version) -> String {
        let n = self.states.len();
        let computed = self.computed(Phase::Run);
        let (derivatives, outputs) = computed.split_at(n);
        let initial = self.computed(Phase::Initialization);
        let shown = self.states.iter().enumerate().filter(|(_, s)| s.is_output);
        let shown: Vec<Unknown> = shown
            .map(|(place, _)| Unknown {
                reference: self.state(place),
                of: vec![self.state(place)],
            })
            .collect();
        let all = |element: &str, unknowns: &[Unknown]| -> String {
            let each = unknowns.iter();
            each.map(|unknown| unknown.text(element, version)).collect()
        };
        match version {
            Version::Two => {
                let lists = [
                    ("Outputs", [&shown, outputs]),
                    ("Derivatives", [derivatives, &[]]),
                    ("InitialUnknowns", [&initial, &[]]),
                ];
                let list = |(name, parts): (&str, [&[Unknown]; 2])| {
                    let unknowns: String = parts.iter().map(|p| all("Unknown", p)).collect();
                    match unknowns.is_empty() {
                        true => unknowns,
                        false => format!("    <{name}>\n{unknowns}    </{name}>\n"),
                    }
                };
                lists.into_iter().map(list).collect()
            }
            Version::Three => [
                all("Output", &shown),
                all("Output", outputs),
                all("ContinuousStateDerivative", derivatives),
                all("InitialUnknown", &initial),
            ]
            .concat(),
        }
    }
}

impl Unknown {
    /// Of value references in FMI 3.0, of places from 1 on in FMI 2.0.
    fn text(&self, element: &str, version: Version) -> String {
        let (indent, attribute, first) = match version {
            Version::Two => ("      ", "index", 1),
            Version::Three => ("    ", "valueReference", 0),
        };
        let of: Vec<String> = self.of.iter().map(|k| (k + first).to_string()).collect();
        format!(
            "{indent}<{element} {attribute}=\"{}\" dependencies=\"{}\"/>\n",
            self.reference + first,
            of.join(" ")
        )
    }
}
