//! What a model means: states, derivatives, inputs and outputs over one expression graph.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use lynkeus_expr::{Budget, Graph, Node};

use crate::Diagnostic;

/// A plant x′ = f(t, x, u), y = h(t, x, u).
///
/// `derivatives`, `outputs` and `algebraics` are expressions over the symbols `time`,
/// the states and the inputs, and over the parameters where these stay symbolic.
#[derive(Clone, Debug)]
pub struct Plant {
    /// name of the model
    pub name: String,
    /// holds every expression of the plant
    pub graph: Graph,
    /// the symbol of time
    pub time: Node,
    /// the states, in order of declaration; arrays element by element
    pub states: Vec<Variable>,
    /// x′, in the order of `states`
    pub derivatives: Vec<Node>,
    /// the inputs, in order of declaration
    pub inputs: Vec<Variable>,
    /// the outputs, in order of declaration
    pub outputs: Vec<Variable>,
    /// variables that are neither state, input nor output
    pub algebraics: Vec<Variable>,
    /// parameters that a caller may set; constants and dependent parameters are not listed
    pub parameters: Vec<Parameter>,
    /// what the points of tables are made of that is no number, such as parameters that stay symbolic:
    /// that the points increase is not known
    pub table_points: BTreeSet<Node>,
    /// what is delayed, of which the last of it is held by a few states
    pub delays: Vec<Delay>,
    /// what must hold along every run, in order of the text
    pub assertions: Vec<Assertion>,
    /// what happens at events, in order of the text
    pub whens: Whens,
    /// what the text says that has no effect here, or that looks wrong
    pub warnings: Vec<Diagnostic>,
}

impl Plant {
    /// A plant without variables.
    pub(crate) fn empty(name: String, graph: Graph, time: Node) -> Self {
        Self {
            name,
            graph,
            time,
            states: vec![],
            derivatives: vec![],
            inputs: vec![],
            outputs: vec![],
            algebraics: vec![],
            parameters: vec![],
            table_points: BTreeSet::new(),
            delays: vec![],
            assertions: vec![],
            whens: Whens::default(),
            warnings: vec![],
        }
    }
}

/// A `delay` of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Delay {
    /// as it stands in the text
    pub text: String,
    /// the names of its states begin so
    pub states: String,
    /// how many there are
    pub count: usize,
}

/// The `when` clauses of a model. A variable that they assign is a state at rest, which jumps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Whens {
    /// in order of the text
    pub clauses: Vec<Clause>,
    /// states with the symbols of their values before an event, where clauses read these
    pub before: Vec<(Node, Node)>,
    /// what is told by time alone
    pub timers: Vec<Timer>,
}

impl Whens {
    /// True of a model without events.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.clauses.is_empty()
    }

    /// The lines of the text where clauses stand.
    #[must_use]
    pub fn lines(&self) -> Vec<usize> {
        let mut lines: Vec<usize> = self.clauses.iter().map(|clause| clause.line).collect();
        lines.dedup();
        lines
    }

    /// The same with other expressions in the place of symbols; of states, other symbols.
    #[must_use]
    pub fn substituted(&self, graph: &Graph, by: &HashMap<Node, Node>) -> Self {
        let mut changed = self.clone();
        let image = |state: &mut Node| *state = by.get(state).copied().unwrap_or(*state);
        changed
            .before
            .iter_mut()
            .for_each(|pair| image(&mut pair.0));
        for clause in &mut changed.clauses {
            clause.conditions = graph.substitute(&clause.conditions, by);
            let values: Vec<Node> = clause.changes.iter().map(|change| change.1).collect();
            let values = graph.substitute(&values, by);
            let changes = clause.changes.iter_mut().zip(values);
            changes.for_each(|(change, value)| {
                image(&mut change.0);
                change.1 = value;
            });
        }
        changed
    }
}

/// A `when` or an `elsewhen`; without conditions, an equation that holds at every event.
#[derive(Clone, Debug, PartialEq)]
pub struct Clause {
    /// of clauses with one number the first that is due takes effect
    pub group: usize,
    /// it takes effect where one of them comes to hold
    pub conditions: Vec<Node>,
    /// states with their new values, over `time`, inputs, discrete states as they are now, and the
    /// states as they were before
    pub changes: Vec<(Node, Node)>,
    /// line of the text, from 1
    pub line: usize,
}

/// A symbol that is 1 at the instants start + k·interval, and else 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Timer {
    /// the symbol
    pub symbol: Node,
    /// the first instant
    pub start: f64,
    /// the time between two of them
    pub interval: f64,
    /// the start of a run alone, wherever that is
    pub is_initial: bool,
}

/// An `assert` of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Assertion {
    /// 1 where it holds, over `time`, the states and the inputs
    pub condition: Node,
    /// the message of the model; may be empty
    pub message: String,
    /// line of the text, from 1
    pub line: usize,
    /// the model asks for a warning, not for an error
    pub is_warning: bool,
}

/// A scalar variable with what its declaration says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// `x`, `x[3]` or `A[1,2]`
    pub name: String,
    /// the symbol of a state, input or parameter; the defining expression of an output or
    /// an algebraic variable
    pub node: Node,
    /// physical unit, as written
    pub unit: Option<String>,
    /// description string
    pub description: Option<String>,
    /// value at the start
    pub start: Option<f64>,
    /// the same as an expression, where it depends on parameters that are symbols
    pub start_node: Option<Node>,
    /// smallest value of its range; −∞ if not given
    pub min: f64,
    /// largest value of its range; +∞ if not given
    pub max: f64,
    /// typical size
    pub nominal: Option<f64>,
    /// declared as `Integer`
    pub integer: bool,
    /// it changes at events alone
    pub discrete: bool,
    /// declared with `fixed = true`: the value at the start is known, 0 where `start` is absent
    pub fixed: bool,
    /// where its values live
    pub home: Home,
}

/// Where the values of a variable live.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Home {
    /// among the real numbers
    #[default]
    Line,
    /// on a circle, in radians: a full turn changes nothing
    Circle {
        /// the values are shown in the turn that begins here; none where they are shown as they come
        from: Option<f64>,
    },
    /// it changes its sign with a quaternion, which says the same as its negative
    Signed {
        /// place among the states of the first of the four numbers
        of: usize,
    },
    /// it is one of the four numbers of a unit quaternion, which says the same as its negative
    Rotation {
        /// its place among them; 0 is the scalar
        element: usize,
    },
}

impl Variable {
    /// How wide its range is: a full turn of an angle; infinite where an end is missing.
    #[must_use]
    pub fn width(&self) -> f64 {
        match self.home {
            Home::Line | Home::Signed { .. } => self.max - self.min,
            Home::Circle { .. } | Home::Rotation { .. } => std::f64::consts::TAU,
        }
    }

    /// A variable of which nothing is declared.
    pub(crate) fn new(name: String, node: Node) -> Self {
        Self {
            name,
            node,
            unit: None,
            description: None,
            start: None,
            start_node: None,
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            nominal: None,
            integer: false,
            discrete: false,
            fixed: false,
            home: Home::Line,
        }
    }
}

/// A parameter and its value; `None` where the model gives none.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// the parameter; its node is a symbol
    pub variable: Variable,
    /// the value in force, overrides included
    pub value: Option<f64>,
}

/// What `Modelica.Math.Vectors.interpolate` is between the points of its table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tables {
    /// straight lines, as the Modelica library has it; outside, along the first and the last
    #[default]
    Linear,
    /// cubics with one slope at each point (Fritsch and Carlson): monotone where the points are; outside,
    /// along the tangents at the ends
    Monotone,
}

/// How a model text becomes a plant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// the model to take; needed where the file holds several
    pub model: Option<String>,
    /// values instead of those in the file, by name: `"k"`, `"H[3]"`, `"A[1,2]"`
    pub parameters: BTreeMap<String, f64>,
    /// keep parameters of type Real as symbols, and allow them to have no value. Sizes,
    /// loop bounds and attributes still use the values.
    pub symbolic_parameters: bool,
    /// of these the parameters that take their values all the same, by name, arrays element by element
    pub numbers: BTreeSet<String>,
    /// what tables are between their points
    pub tables: Tables,
    /// states of each delay, from 1 to [`MAX_DELAY_STATES`](crate::MAX_DELAY_STATES); without it
    /// [`DELAY_STATES`](crate::DELAY_STATES)
    pub delay_states: Option<usize>,
    /// when to stop; the graph of the plant keeps it
    pub budget: Budget,
}
