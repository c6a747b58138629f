//! Equations x' = f(t, x, u), y = h(t, x, u) as C: what they give, how they change along a
//! direction, and fixed steps of the classical Runge-Kutta method.

use lynkeus_run::{Method, System};

use super::c::{File, listed, prefix, title};
use super::fmu::Quantity;
use super::function::{Arguments, Entry, Target, draft};
use super::language::Language;
use super::machine::{Machine, code, refuse_jumps};
use super::template::exchanged;
use crate::code::{Part, Solver};
use crate::{Code, Refusal};

const ADVANCE: &str = include_str!("runtime/ode.c");
const INTERFACE: &str = include_str!("runtime/ode_interface.c");

/// What `advance` can say, from 1 on.
pub(super) const CODES: [(&str, &str); 2] = [
    (
        "INTERVAL",
        "time runs backward, or the interval takes more than a million steps",
    ),
    ("NOT_FINITE", "the equations have no value there"),
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
    /// lines for people
    pub about: &'a [String],
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
    let report = code(&[Part::all(system.output_tape())])?;
    machine.add(&draft(
        "The outputs.",
        "outputs",
        &report,
        &arguments,
        std::slice::from_ref(&y),
    )?);
    let parts = [system.derivative_tape(), system.output_tape()].map(Part::all);
    // a condition of a linear system has a derivative where it is spelled out
    let all = Code::of_parts(&parts, Solver::Plain)?;
    machine.add(&draft(
        "How both change along a direction, which is at the end of w: of time, x and the inputs.",
        "along",
        &all.along(1 + n + m),
        &arguments.with_direction(m),
        &[dx, y],
    )?);
    machine.steps(ode.method)?;
    machine.integrate(n);
    machine.add(ADVANCE);
    Ok(Sources {
        files: [header(ode, &arguments), source(ode, &machine)],
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

fn header(ode: &Ode<'_>, arguments: &Arguments) -> File {
    let name = prefix(ode.name);
    let capitals = name.to_ascii_uppercase();
    let outputs: Vec<Entry> = ode.outputs.iter().map(entry).collect();
    let codes = CODES
        .iter()
        .enumerate()
        .map(|(k, (code, about))| format!("#define {capitals}_{code} {} /* {about} */\n", k + 1));
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
         int {name}_advance(double from, double to, const double *u, double *x);\n\n\
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
        let is_code = CODES.iter().any(|(code, _)| *code == word);
        is_code.then(|| format!("{capitals}_{word}"))
    });
    let starts = ode.states.iter().enumerate();
    let starts = starts.map(|(i, s)| format!("    x[{i}] = {:?};\n", s.quantity.start));
    let interface = INTERFACE
        .replace("@NAME@", &name)
        .replace("@STARTS@", &starts.collect::<String>());
    let text = format!(
        "{}#include \"{name}.h\"\n\n#include <math.h>\n\n{}{interface}",
        title(&format!("{name}.c"), ode.about),
        Language::C.render(&draft),
    );
    File {
        name: format!("{name}.c"),
        text,
    }
}
