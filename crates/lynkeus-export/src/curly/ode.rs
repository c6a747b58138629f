//! Equations x' = f(t, x, u), y = h(t, x, u): in C what they give, how they change along a direction, and fixed
//! steps of the classical Runge-Kutta method; and as functional mock-up units for model exchange and co-simulation
//! in one archive.

use std::ops::Range;

use lynkeus_run::{Method, System};

use super::c::{File, Precision, listed, prefix, title};
use super::description::{Description, Experiment, Quantity, Role, Unit, Variable, Version, page};
use super::device::Entry;
use super::draft::{Arguments, Target, draft};
use super::fmu::{EXCHANGE, archive, reasons};
use super::machine::{Machine, code, refuse_jumps};
use super::pass::{holds, remembering};
use super::template::{chosen, exchanged};
use crate::code::Solver;
use crate::{Code, Refusal};

const ADVANCE: &str = include_str!("runtime/ode.c");
const INTERFACE: &str = include_str!("runtime/ode_interface.c");
const OWN_EVENTS: &str = include_str!("runtime/ode_events.c");

/// What `advance` can say, from 1 on; the last of what jumps at events.
const CODES: [(&str, &str); 3] = [
    (
        "INTERVAL",
        "time runs backward, or the interval takes more than a million steps",
    ),
    ("NOT_FINITE", "the equations have no value there"),
    ("EVENTS", "events follow each other without end"),
];

/// A system with what is said of its variables.
#[derive(Clone, Copy, Debug)]
pub struct Ode<'a> {
    /// its name in files and functions
    pub name: &'a str,
    /// what it is, in words
    pub title: &'a str,
    /// the equations, of one state at least; its signals are the inputs, then the parameters
    pub system: &'a System,
    /// fixed steps
    pub method: Method,
    /// the inputs, in the order of the system
    pub inputs: &'a [Quantity],
    /// what stays but may be set, in the order of the system
    pub parameters: &'a [Quantity],
    /// the states, in the order of the system
    pub states: &'a [State],
    /// the outputs, in the order of the system; states that are outputs are not among them
    pub outputs: &'a [Quantity],
    /// what passes zero where a state may jump, in the order of the system's relations
    pub indicators: &'a [Quantity],
    /// lines for people
    pub about: &'a [String],
}

impl Ode<'_> {
    /// Facts that pieces of the runtime ask for.
    fn holds(&self) -> Vec<&'static str> {
        let mut facts = holds(self.system);
        facts.extend(self.system.has_clauses().then_some("events"));
        facts
    }

    /// What `advance` can say.
    fn codes(&self) -> impl Iterator<Item = (usize, (&'static str, &'static str))> {
        let count = CODES.len() - usize::from(!self.system.has_clauses());
        (1..).zip(CODES).take(count)
    }
}

/// A state.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// what it is and where it starts
    pub quantity: Quantity,
    /// its derivative by time
    pub derivative: Quantity,
    /// whether others may see it
    pub is_output: bool,
}

/// The equations in C, and which of time, states and inputs each needs.
#[derive(Clone, Debug)]
pub(super) struct Sources {
    /// `NAME.h` and `NAME.c`
    pub files: [File; 2],
    /// by state, then by output: the places in (t, x, u, p) that it depends on
    pub dependencies: Vec<Vec<usize>>,
}

/// The C of a system.
///
/// # Errors
/// What jumps with time alone, no fixed steps, operations that C has not.
pub(super) fn sources(ode: &Ode<'_>) -> Result<Sources, Refusal> {
    let system = ode.system;
    refuse_jumps(system)?;
    let (n, m) = (system.states().len(), ode.inputs.len());
    let told = system.outputs().len();
    let mut machine = Machine::default();
    machine.size("STATES", n);
    machine.size("INPUTS", m);
    machine.size("PARAMETERS", ode.parameters.len());
    let arguments = Arguments {
        x: ode.states.iter().map(|s| entry(&s.quantity)).collect(),
        w: ode.inputs.iter().chain(ode.parameters).map(entry).collect(),
    };
    let (dx, y) = (Target::all("dx", n), Target::all("y", told));
    machine.flow(system, &arguments)?;
    let own = system.expressions();
    let report = code(&own, &[own.outputs])?;
    machine.add(&draft(
        "The outputs.",
        "outputs",
        &report,
        &arguments,
        std::slice::from_ref(&y),
    )?);
    let parts = [own.derivatives, own.outputs];
    // a condition of a linear system has a derivative where it is spelled out
    let all = Code::of(&own.graph, own.inputs, &parts, Solver::Plain)?;
    machine.add(&draft(
        "How both change along a direction, which is at the end of w: of time, x and the inputs.",
        "along",
        &all.along(1 + n + m),
        &arguments.with_direction(m),
        &[dx, y],
    )?);
    machine.steps(ode.method)?;
    machine.events(system, &arguments, ode.method)?;
    machine.integrate(system);
    let holds = ode.holds();
    machine.add(&remembering(&chosen(ADVANCE, &holds), system.has_clauses()));
    if system.has_clauses() {
        machine.add(&chosen(OWN_EVENTS, &holds));
    }
    Ok(Sources {
        files: [header(ode, &arguments, &machine), source(ode, &machine)],
        dependencies: all.dependencies(),
    })
}

impl Arguments {
    /// The same, with how fast time, states and inputs change behind all that is given.
    fn with_direction(&self, inputs: usize) -> Self {
        let part = |entry: &Entry| Entry::named(format!("d_{}", entry.name));
        let time = Entry::named("d_time");
        let moving = self.x.iter().chain(self.w.iter().take(inputs));
        let changes = std::iter::once(time).chain(moving.map(part));
        Self {
            x: self.x.clone(),
            w: self.w.iter().cloned().chain(changes).collect(),
        }
    }
}

fn entry(quantity: &Quantity) -> Entry {
    let unit = quantity.unit.as_ref().map(|unit| format!("[{unit}] "));
    Entry {
        name: quantity.name.clone(),
        about: unit.unwrap_or_default() + &quantity.description,
    }
}

impl Ode<'_> {
    /// What a header says of events.
    fn events(&self, machine: &Machine) -> String {
        if !self.system.has_clauses() {
            return String::new();
        }
        let name = prefix(self.name);
        let capitals = name.to_ascii_uppercase();
        let size = |word: &str| {
            let mut sizes = machine.sizes.iter();
            sizes.find(|(own, _)| own == word).map_or(0, |own| own.1)
        };
        format!(
            "/* What is remembered of events: m, and of each relation its side. */\n\
             #define {capitals}_MEMORY {}\n#define {capitals}_RELATIONS {}\n\
             void {name}_begin(double *m, double *sides);\n\n\
             /* What is due at t takes effect; 0, or one of the codes above. */\n\
             int {name}_event(double t, const double *u, double *x, double *m, double *sides);\n\n\
             /* What passes zero, and a little beyond, where a relation changes; sizes are those of the states. */\n\
             void {name}_indicators(double t, const double *x, const double *u, const double *sizes, const double *sides, double *z);\n\n\
             /* The next instant at which the clock has an event: 1 where there is one. */\n\
             int {name}_next_instant(const double *m, double *next);\n\n",
            size("MEMORY"),
            size("RELATIONS"),
        )
    }
}

fn header(ode: &Ode<'_>, arguments: &Arguments, machine: &Machine) -> File {
    let name = prefix(ode.name);
    let capitals = name.to_ascii_uppercase();
    let outputs: Vec<Entry> = ode.outputs.iter().map(entry).collect();
    let codes = ode.codes();
    let codes =
        codes.map(|(k, (code, about))| format!("#define {capitals}_{code} {k} /* {about} */\n"));
    let text = format!(
        "{title}#ifndef {capitals}_H\n#define {capitals}_H\n\n\
         #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* States x:\n{states} */\n#define {capitals}_STATES {n}\n\n\
         /* Inputs u:\n{inputs} */\n#define {capitals}_INPUTS {m}\n\n\
         /* Parameters, in u behind the inputs:\n{parameters} */\n#define {capitals}_PARAMETERS {q}\n\n\
         /* Outputs y:\n{told} */\n#define {capitals}_OUTPUTS {p}\n\n\
         /* Why a step was refused; nothing has changed then. */\n{codes}\n\
         /* The states at the start. */\nvoid {name}_init(double *x);\n\n\
         /* x' and y. */\n\
         void {name}_derivatives(double t, const double *x, const double *u, double *dx);\n\
         void {name}_outputs(double t, const double *x, const double *u, double *y);\n\n\
         /* How x' and y change along the direction v: of time, the states, the inputs. */\n\
         void {name}_along(double t, const double *x, const double *u, const double *v, double *dx, double *y);\n\n\
         /* From one time to another while the inputs stay; 0, or one of the codes above. */\n\
         int {name}_advance(double from, double to, const double *u, double *x{memory});\n\n{events}\
         #ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
        title = title(&format!("{name}.h"), ode.about),
        states = listed(&arguments.x),
        inputs = listed(&arguments.w[..ode.inputs.len()]),
        parameters = listed(&arguments.w[ode.inputs.len()..]),
        q = ode.parameters.len(),
        told = listed(&outputs),
        n = ode.states.len(),
        m = ode.inputs.len(),
        p = ode.outputs.len(),
        codes = codes.collect::<String>(),
        memory = if ode.system.has_clauses() {
            ", double *m"
        } else {
            ""
        },
        events = ode.events(machine),
    );
    File {
        name: format!("{name}.h"),
        text,
    }
}

fn source(ode: &Ode<'_>, machine: &Machine) -> File {
    let name = prefix(ode.name);
    let capitals = name.to_ascii_uppercase();
    let draft = exchanged(&machine.text(), |word| {
        let is_code = ode.codes().any(|(_, (code, _))| code == word);
        is_code.then(|| format!("{capitals}_{word}"))
    });
    let starts = ode.states.iter().enumerate();
    let starts = starts.map(|(i, s)| format!("    x[{i}] = {:?};\n", s.quantity.start));
    let interface = chosen(INTERFACE, &ode.holds());
    let interface = remembering(&interface, ode.system.has_clauses())
        .replace("@NAME@", &name)
        .replace("@STARTS@", &starts.collect::<String>());
    let text = format!(
        "{}#include \"{name}.h\"\n\n#include <math.h>\n\n{}{interface}",
        title(&format!("{name}.c"), ode.about),
        Precision::F64.render(&draft),
    );
    File {
        name: format!("{name}.c"),
        text,
    }
}

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
        let structure = Structure { ode, dependencies };
        Ok(archive(
            &name,
            version,
            files.into(),
            |token| self.description(&structure, version, token),
            |token| self.wrapper(version, token),
            page(ode.name, ode.title, ode.about),
        ))
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
        variables.extend(ode.indicators.iter().map(|q| variable(q, Role::Indicator)));
        Description {
            model: ode.name,
            title: ode.title,
            units: self.units,
            experiment: self.experiment,
            categories: &["logStatusError", "logStatusDiscard"],
            variables: &variables,
            indicators: ode.indicators.len(),
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
            (
                "@REASONS@",
                reasons(ode.codes().map(|(k, (_, about))| (k, about))),
            ),
        ];
        let mut holds = ode.holds();
        holds.push(EXCHANGE);
        let file = version.wrapper();
        format!("/* {file}: {name} as a functional mock-up unit. */\n")
            + &version.wrapped(CORE, &holds, &places)
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
    ode: &'a Ode<'a>,
    /// by derivative, then by output: places in (t, x, u, p)
    dependencies: Vec<Vec<usize>>,
}

impl Structure<'_> {
    /// The value reference of a state.
    fn state(&self, place: usize) -> usize {
        1 + self.ode.inputs.len() + place
    }

    /// The value references of the places in (t, x, u, p) that something depends on, in their order.
    fn known(&self, places: impl Iterator<Item = usize>) -> Vec<usize> {
        let states = self.ode.states.len();
        let moving = states + self.ode.inputs.len();
        let first_parameter = self.state(2 * states + self.ode.outputs.len());
        let reference = |place: usize| match place {
            0 => 0,
            place if place <= states => self.state(place - 1),
            place if place <= moving => place - states,
            place => first_parameter + place - moving - 1,
        };
        let mut found: Vec<usize> = places.map(reference).collect();
        found.sort_unstable();
        found
    }

    /// Some of the derivatives and of the outputs that are no states, with those of the first `given` places in
    /// (t, x, u, p) that they depend on.
    fn computed(
        &self,
        version: Version,
        element: &str,
        which: Range<usize>,
        given: usize,
    ) -> String {
        let line = |place: usize| {
            let of = self.dependencies[place].iter().copied();
            let of = self.known(of.filter(|place| *place < given));
            unknown(
                version,
                element,
                self.state(self.ode.states.len() + place),
                &of,
            )
        };
        which.map(line).collect()
    }

    /// The states that are outputs.
    fn shown(&self, version: Version, element: &str) -> String {
        let states = self.ode.states.iter().enumerate();
        let shown = states.filter(|(_, state)| state.is_output);
        let references = shown.map(|(place, _)| self.state(place));
        references
            .map(|reference| unknown(version, element, reference, &[reference]))
            .collect()
    }

    /// What passes zero where a state may jump.
    fn indicators(&self) -> String {
        let first = self.state(2 * self.ode.states.len() + self.ode.outputs.len());
        let first = first + self.ode.parameters.len();
        let references = first..first + self.ode.indicators.len();
        references
            .map(|reference| format!("    <EventIndicator valueReference=\"{reference}\"/>\n"))
            .collect()
    }

    /// While it runs, what does not move counts as known; at the start everything that can be set is told.
    fn text(&self, version: Version) -> String {
        let (n, all) = (self.ode.states.len(), self.dependencies.len());
        let moving = 1 + n + self.ode.inputs.len();
        let computed = |element, which, given| self.computed(version, element, which, given);
        match version {
            Version::Two => {
                let outputs = self.shown(version, "Unknown") + &computed("Unknown", n..all, moving);
                let lists = [
                    ("Outputs", outputs),
                    ("Derivatives", computed("Unknown", 0..n, moving)),
                    ("InitialUnknowns", computed("Unknown", 0..all, usize::MAX)),
                ];
                let list = |(name, unknowns): (&str, String)| match unknowns.is_empty() {
                    true => unknowns,
                    false => format!("    <{name}>\n{unknowns}    </{name}>\n"),
                };
                lists.into_iter().map(list).collect()
            }
            Version::Three => [
                self.shown(version, "Output"),
                computed("Output", n..all, moving),
                computed("ContinuousStateDerivative", 0..n, moving),
                computed("InitialUnknown", 0..all, usize::MAX),
                self.indicators(),
            ]
            .concat(),
        }
    }
}

/// A computed variable and what it depends on: by value references in FMI 3.0, by places from 1 on in FMI 2.0.
fn unknown(version: Version, element: &str, reference: usize, of: &[usize]) -> String {
    let (indent, attribute, first) = match version {
        Version::Two => ("      ", "index", 1),
        Version::Three => ("    ", "valueReference", 0),
    };
    let of: Vec<String> = of.iter().map(|k| (k + first).to_string()).collect();
    format!(
        "{indent}<{element} {attribute}=\"{}\" dependencies=\"{}\"/>\n",
        reference + first,
        of.join(" ")
    )
}
