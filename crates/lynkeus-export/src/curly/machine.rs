//! A draft under way: its state, its tables, and how it goes along a flow, alone or with its Jacobian and the
//! covariance along an estimate.

use lynkeus_expr::Node;
use lynkeus_run::{Expressions, Level, Linearised, Method, Step, System};

use super::draft::{Arguments, Target, draft, places, table};
use super::pass::{integrated, integrated_alone, remembering};
use super::syntax::Type;
use super::template::{chosen, exchanged, mentions, parts};
use crate::code::Solver;
use crate::{Code, Refusal};

/// A part of the state that is carried from sample to sample.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub name: &'static str,
    /// of a number, or of each entry
    pub kind: Type,
    /// number of entries; none for a single number
    pub count: Option<usize>,
    pub about: String,
    /// at the start
    pub start: Vec<f64>,
}

/// The estimator as a draft, but for the frame that each language has of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Machine {
    pub sizes: Vec<(String, usize)>,
    pub fields: Vec<Field>,
    pub tables: String,
    /// functions, in the order of their use
    pub source: String,
}

const LIBRARY: &str = include_str!("runtime/library.c");
const STEPS: &str = include_str!("runtime/steps.c");

impl Machine {
    /// The functions of the library that are called, those that others call first.
    pub fn library(&self) -> Vec<(&'static str, &'static str)> {
        let mut needed: Vec<(&str, &str)> = vec![];
        let all: Vec<(&str, &str)> = parts(LIBRARY).collect();
        for part in all.into_iter().rev() {
            let is_called = |text: &str| mentions(text, part.0);
            if is_called(&self.source) || needed.iter().any(|other| is_called(other.1)) {
                needed.insert(0, part);
            }
        }
        needed
    }

    /// Sizes, tables, what is called of the library, and the functions.
    pub fn text(&self) -> String {
        let sizes = self.sizes.iter();
        let sizes: Vec<String> = sizes.map(|(name, n)| format!("    {name} = {n}")).collect();
        let sizes = sizes.join(",\n");
        let library = self.library().into_iter();
        let library: String = library.map(|(_, text)| format!("{text}\n\n")).collect();
        let tables = match self.tables.is_empty() {
            true => String::new(),
            false => format!("{}\n", self.tables),
        };
        format!("enum {{\n{sizes}\n}};\n\n{tables}{library}{}", self.source)
    }

    /// How an interval is divided.
    pub fn steps(&mut self, method: Method) -> Result<(), Refusal> {
        self.add(&STEPS.replace("STEP_LENGTH", &step_length(method)?));
        Ok(())
    }

    /// The classical Runge-Kutta method for x' that [`Machine::flow`] writes.
    pub fn integrate(&mut self, flow: &System) {
        self.size("DIMENSION", flow.states().len());
        self.add(FIELD);
        self.add(&integrated_alone(flow));
    }

    pub fn size(&mut self, name: impl Into<String>, value: usize) {
        self.sizes.push((name.into(), value));
    }

    pub fn field(&mut self, name: &'static str, kind: Type, about: &str, start: Vec<f64>) {
        self.fields.push(Field {
            name,
            kind,
            count: Some(start.len()),
            about: about.into(),
            start,
        });
    }

    pub fn single(&mut self, name: &'static str, kind: Type, about: &str, start: f64) {
        self.fields.push(Field {
            name,
            kind,
            count: None,
            about: about.into(),
            start: vec![start],
        });
    }

    pub fn add(&mut self, text: &str) {
        self.source += text;
        self.source.push('\n');
    }

    /// Whether readings are judged.
    pub fn is_judged(&self) -> bool {
        self.fields.iter().any(|field| field.name == "squares")
    }

    /// x' alone.
    pub fn flow(&mut self, system: &System, arguments: &Arguments) -> Result<(), Refusal> {
        refuse_jumps(system)?;
        let own = system.expressions();
        let text = draft(
            "The derivatives.",
            "flow",
            &code(&own, &[own.derivatives])?,
            arguments,
            &[Target::all("dx", system.states().len())],
        )?;
        self.add(&text);
        Ok(())
    }
}

/// How a state changes, as a type.
pub(super) const FIELD: &str = "/* How a state changes: writes dx. */\ntypedef void (*field)(real t, const real *x, const real *w, real *dx);\n";

/// Some expressions of a system, part by part.
pub(super) fn code(of: &Expressions<'_>, parts: &[&[Node]]) -> Result<Code, Refusal> {
    Code::of(&of.graph, of.inputs, parts, Solver::Conditioned)
}

/// The length of a step, for an interval of some `length`.
pub(super) fn step_length(method: Method) -> Result<String, Refusal> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Ok(format!("(length < {h:?} ? length : {h:?})")),
        Method::Rk4(Step::Substeps(n)) => Ok(format!("(length / {n}.0)")),
        _ => Err(Refusal::NoFixedStep),
    }
}

/// What jumps with time alone needs its instants found.
pub(super) fn refuse_jumps(system: &System) -> Result<(), Refusal> {
    match system.modes() {
        0 => Ok(()),
        _ => Err(Refusal::JumpsWithTime),
    }
}

const LINEARISED: &str = include_str!("runtime/linearised.c");
const ALONG: &str = include_str!("runtime/along.c");
const PREDICT: &str = include_str!("runtime/predict.c");

/// What stands for the factor on a filter's process noise among what its flow reads.
pub(super) const NOISE_FACTOR: &str = "w[INPUTS]";

/// A flow with its Jacobian and the densities of the noise on its states.
pub(super) struct Linear<'a> {
    pub flow: &'a Linearised,
    pub noise: &'a [f64],
    /// the densities are multiplied by a number that may be changed
    pub is_tuned: bool,
}

/// Which of two flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Which {
    Free,
    /// inside the declared ranges
    Inside {
        /// whether the free flow is linearised, too: then both are integrated by the same functions
        is_shared: bool,
        /// whether its covariance is carried by Φ, too: then by the same function
        is_carried: bool,
    },
}

/// Names and sizes of which there is one for each flow.
const OWN: [&str; 6] = [
    "linear_flow",
    "linearised",
    "entry_rows",
    "entry_columns",
    "ENTRIES",
    "ENTRIES_ROOM",
];

/// And where the free flow has no covariance along it.
const SHARED: [&str; 8] = [
    "integrate",
    "along",
    "rows_of_noise",
    "process_noise",
    "noise_order",
    "WIDTH",
    "CARRIED",
    "DIMENSION",
];

impl Which {
    /// Whether the free flow has left these functions, sizes and tables.
    fn shares(self) -> bool {
        matches!(
            self,
            Self::Inside {
                is_shared: true,
                ..
            }
        )
    }

    /// Whether the free flow has left the function that carries a covariance.
    fn is_carried(self) -> bool {
        matches!(
            self,
            Self::Inside {
                is_carried: true,
                ..
            }
        )
    }

    /// The text, in which what this flow has for itself is called so.
    pub fn renamed(self, text: &str) -> String {
        exchanged(text, |word| {
            let is_own = OWN.contains(&word)
                || (SHARED.contains(&word) && !self.shares())
                || (word == "predict" && !self.is_carried());
            let is_own = is_own && self != Self::Free;
            is_own.then(|| match word.chars().all(|c| !c.is_lowercase()) {
                true => format!("{word}_INSIDE"),
                false => format!("{word}_inside"),
            })
        })
    }
}

impl Machine {
    /// The root of a covariance that starts diagonal.
    pub fn root(&mut self, variances: &[f64]) {
        let n = variances.len();
        let mut start = vec![0.0; n * n];
        for (i, variance) in variances.iter().enumerate() {
            start[i * n + i] = variance.sqrt();
        }
        self.lower_root(start);
    }

    /// The lower root of a covariance.
    pub fn lower_root(&mut self, start: Vec<f64>) {
        self.field(
            "root",
            Type::Real,
            "lower root of the covariance, row by row",
            start,
        );
    }

    /// The variances of the noises of the sensors.
    pub fn noises(&mut self, levels: impl Iterator<Item = Level>) {
        let parts = levels.map(|level| match level {
            Level::Relative(share) => (0.0, share),
            other => (other.variance(0.0), 0.0),
        });
        let (variances, shares): (Vec<f64>, Vec<f64>) = parts.unzip();
        self.tables += &table("noise_variances", &variances);
        self.tables += &table("noise_shares", &shares);
    }

    /// x, Φ and W along a flow, together, and the rows that W adds to a root.
    pub fn linear(
        &mut self,
        which: Which,
        linear: &Linear<'_>,
        arguments: &Arguments,
    ) -> Result<(), Refusal> {
        let Linear { flow, noise, .. } = linear;
        let entries = flow.jacobians().state.places();
        let flow = flow.system();
        refuse_jumps(flow)?;
        let n = flow.states().len();
        let scale = noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let width = if linear.is_noisy() { 2 * n } else { n };
        self.size(which.renamed("ENTRIES"), entries.len());
        self.size(which.renamed("ENTRIES_ROOM"), entries.len().max(1));
        if !which.shares() {
            self.size(which.renamed("WIDTH"), width);
            self.size(which.renamed("CARRIED"), width);
            self.size(which.renamed("DIMENSION"), n + n * width);
        }
        let mut tables = places("entry_rows", entries.iter().map(|e| e.0));
        tables += &places("entry_columns", entries.iter().map(|e| e.1));
        if scale > 0.0 && !which.shares() {
            let shares: Vec<f64> = noise.iter().map(|q| q / scale).collect();
            tables += &table("process_noise", &shares);
        }
        if let (Some(order), false) = (linear.flow.order_of(noise), which.shares()) {
            tables += &places("noise_order", order.into_iter());
        }
        self.tables += &which.renamed(&tables);
        let own = flow.expressions();
        let slopes = &own.outputs[..entries.len()];
        let flow = draft(
            "The derivatives, and the entries of their Jacobian that are not zero.",
            "linear_flow",
            &code(&own, &[own.derivatives, slopes])?,
            arguments,
            &[Target::all("dx", n), Target::all("slopes", entries.len())],
        )?;
        let linearised = chosen(LINEARISED, linear.holds());
        let kind = if which == Which::Free { FIELD } else { "" };
        let own = [kind, &flow, &linearised].join("\n");
        self.add(&which.renamed(&own));
        if !which.shares() {
            let along = linear.along(scale);
            let integrated = integrated(linear.flow.system(), linear.holds());
            self.add(&which.renamed(&[integrated, along].join("\n")));
        }
        Ok(())
    }

    /// P = ΦPΦᵀ + W along a flow that is drafted already.
    pub fn carried(&mut self, which: Which, linear: &Linear<'_>) {
        if !which.is_carried() {
            let predict = chosen(PREDICT, linear.holds());
            let has_events = linear.flow.system().has_clauses();
            self.add(&which.renamed(&remembering(&predict, has_events)));
        }
    }
}

impl Linear<'_> {
    /// The functions that go along it, with W in units of the largest density.
    fn along(&self, scale: f64) -> String {
        let scale = match self.is_tuned {
            true => format!("R({scale:?}) * {NOISE_FACTOR}"),
            false => format!("R({scale:?})"),
        };
        let place = |at: &str| match self.flow.order_of(self.noise) {
            None => at.to_owned(),
            Some(_) => format!("noise_order[{at}]"),
        };
        let has_events = self.flow.system().has_clauses();
        remembering(&chosen(ALONG, self.holds()), has_events)
            .replace("NOISE_SCALE", &scale)
            .replace("PLACE_I", &place("i"))
            .replace("PLACE_J", &place("j"))
    }

    fn holds(&self) -> &'static [&'static str] {
        match self.is_noisy() {
            true => &["noisy"],
            false => &[],
        }
    }

    /// Whether anything disturbs the states.
    pub fn is_noisy(&self) -> bool {
        self.noise.iter().any(|q| *q > 0.0)
    }
}
