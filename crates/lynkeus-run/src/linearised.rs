//! Systems that are compiled with their Jacobians.

use std::ops::Range;

use lynkeus_expr::{Graph, Node, jacobian};
use lynkeus_model::Whens;

use crate::filter::by_distance;
use crate::method::are_finite;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Evaluation, Events, Parts, Result, System};

/// A [`System`] x' = f(t, x, w), y = h(t, x, w), x̂ = g(t, x, w) with those of its Jacobians F = ∂f/∂x,
/// G = ∂g/∂x and C = ∂h/∂x that are asked for.
///
/// They are sparse: the system's outputs are the entries of F, the values of h, the entries of G and those
/// of C, so that one evaluation along a trajectory gives all of them.
#[derive(Clone, Debug)]
pub struct Linearised {
    system: System,
    jacobians: Jacobians<Jacobian>,
}

/// One of each Jacobian, empty where it is not asked for.
#[derive(Clone, Debug, Default)]
pub struct Jacobians<J> {
    /// F, of the derivatives
    pub state: J,
    /// G, of the estimates
    pub estimate: J,
    /// C, of the outputs
    pub output: J,
}

/// The entries of a sparse Jacobian among the outputs of a system.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jacobian {
    /// the output that is the first of them
    first: usize,
    /// (row, column) of each
    places: Vec<(usize, usize)>,
}

/// Entries (row, column, value) of a matrix.
pub(crate) type Entries = Vec<(usize, usize, Node)>;

impl Linearised {
    /// Compiles a system, as [`System::new`], with Jacobians that are derived already.
    ///
    /// # Errors
    /// As [`System::new`].
    pub fn new(
        graph: &Graph,
        time: Node,
        states: &[(String, Node, f64)],
        signals: &[(String, Node)],
        derivatives: &[Node],
        outputs: &[(String, Node)],
        jacobians: &Jacobians<Entries>,
    ) -> Result<Self> {
        let parts = Parts {
            graph,
            time,
            states,
            signals,
            derivatives,
            outputs,
            whens: None,
        };
        Self::of(&parts, jacobians)
    }

    /// The same of a system with all its parts; the Jacobians come before its outputs.
    ///
    /// # Errors
    /// As [`System::new`].
    pub fn of(parts: &Parts<'_>, jacobians: &Jacobians<Entries>) -> Result<Self> {
        let mut all = vec![];
        let state = Jacobian::among(&mut all, &jacobians.state);
        all.extend_from_slice(parts.outputs);
        let jacobians = Jacobians {
            state,
            estimate: Jacobian::among(&mut all, &jacobians.estimate),
            output: Jacobian::among(&mut all, &jacobians.output),
        };
        let system = System::of(&Parts {
            outputs: &all,
            ..*parts
        })?;
        Ok(Self { system, jacobians })
    }

    /// A flow x' = f with F, by its states.
    ///
    /// # Errors
    /// As [`System::new`].
    pub(crate) fn flow(
        graph: &Graph,
        time: Node,
        states: &[(String, Node, f64)],
        signals: &[(String, Node)],
        derivatives: &[Node],
        whens: &Whens,
    ) -> Result<Self> {
        let symbols: Vec<Node> = states.iter().map(|s| s.1).collect();
        let jacobians = Jacobians {
            state: jacobian::forward(graph, derivatives, &symbols).entries,
            ..Jacobians::default()
        };
        let parts = Parts {
            graph,
            time,
            states,
            signals,
            derivatives,
            outputs: &[],
            whens: Some(whens),
        };
        Self::of(&parts, &jacobians)
    }

    /// Outputs h with C by x: a system without states, whose signals are x and w.
    ///
    /// # Errors
    /// As [`System::new`].
    pub(crate) fn output_map(
        graph: &Graph,
        time: Node,
        states: &[(String, Node, f64)],
        signals: &[(String, Node)],
        outputs: &[(String, Node)],
    ) -> Result<Self> {
        let symbols: Vec<Node> = states.iter().map(|s| s.1).collect();
        let h: Vec<Node> = outputs.iter().map(|output| output.1).collect();
        let jacobians = Jacobians {
            output: jacobian::forward(graph, &h, &symbols).entries,
            ..Jacobians::default()
        };
        let states = states.iter().map(|(name, node, _)| (name.clone(), *node));
        let read: Vec<(String, Node)> = states.chain(signals.iter().cloned()).collect();
        Self::new(graph, time, &[], &read, &[], outputs, &jacobians)
    }

    /// Starts elsewhere.
    ///
    /// # Errors
    /// As [`System::with_start`].
    pub(crate) fn start_at(&mut self, start: Vec<f64>) -> Result<()> {
        self.system = self.system.clone().with_start(start)?;
        Ok(())
    }

    /// What is compiled.
    #[must_use]
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Where the entries of its Jacobians are.
    #[must_use]
    pub fn jacobians(&self) -> &Jacobians<Jacobian> {
        &self.jacobians
    }
}

impl Linearised {
    /// The places of the states in the order in which noise of such densities reaches them, as the factor of its
    /// covariance goes with steps of Runge and Kutta; none where they stand so.
    #[must_use]
    pub fn order_of(&self, process_noise: &[f64]) -> Option<Vec<usize>> {
        let noisy: Vec<bool> = process_noise.iter().map(|q| *q > 0.0).collect();
        let (equations, state) = (self.system.equations(), &self.jacobians.state);
        let slopes = &equations.roots.free.outputs[state.outputs()];
        let slopes = state.places().iter().copied().zip(slopes.iter().copied());
        by_distance(&equations.graph(), &noisy, slopes)
    }
}

impl Jacobian {
    /// Of these entries, which become further outputs.
    fn among(outputs: &mut Vec<(String, Node)>, entries: &Entries) -> Self {
        let first = outputs.len();
        outputs.extend(entries.iter().map(|(i, j, e)| (format!("{i},{j}"), *e)));
        Self {
            first,
            places: entries.iter().map(|e| (e.0, e.1)).collect(),
        }
    }

    /// (row, column) of each entry.
    #[must_use]
    pub fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// The outputs of the system that its entries are.
    #[must_use]
    pub fn outputs(&self) -> Range<usize> {
        self.first..self.first + self.places.len()
    }

    /// The entries of a row, by columns, where the system has these outputs.
    pub(crate) fn row(&self, outputs: &[f64], row: usize) -> impl Iterator<Item = (usize, f64)> {
        let entries = self.places.iter().zip(&outputs[self.outputs()]);
        let own = entries.filter(move |((i, _), _)| *i == row);
        own.map(|((_, j), entry)| (*j, *entry))
    }

    /// The same with its zeros.
    pub(crate) fn write_row(&self, outputs: &[f64], row: usize, into: &mut [f64]) {
        into.fill(0.0);
        self.row(outputs, row)
            .for_each(|(j, entry)| into[j] = entry);
    }
}

/// y = h(t, x, u) and C where they were evaluated last.
#[derive(Clone, Debug)]
pub(crate) struct OutputMap {
    evaluation: Evaluation,
    jacobian: Jacobian,
    /// h, then the entries of C
    values: Vec<f64>,
}

impl OutputMap {
    /// Of a [`Linearised::output_map`].
    pub fn new(map: &Linearised) -> Self {
        Self {
            evaluation: map.system.evaluation(),
            jacobian: map.jacobians.output.clone(),
            values: vec![0.0; map.system.outputs().len()],
        }
    }

    /// h(t, x, u), whether or not C has values there.
    pub fn predict(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<&[f64]> {
        self.evaluate(t, x, u, self.jacobian.first)
    }

    /// h(t, x, u), and C there.
    pub fn linearise(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<&[f64]> {
        self.evaluate(t, x, u, self.values.len())
    }

    /// Evaluates h and C, of which the first `needed` values are to be finite.
    fn evaluate(&mut self, t: f64, x: &[f64], u: &[f64], needed: usize) -> Result<&[f64]> {
        let (own, known) = self.evaluation.signals_mut().split_at_mut(x.len());
        own.copy_from_slice(x);
        known.copy_from_slice(u);
        self.evaluation.enter(t);
        self.evaluation.outputs(t, &[], &mut self.values);
        match are_finite(&self.values[..needed]) {
            true => Ok(self.outputs()),
            false => Err(self.evaluation.not_finite(t, &[])),
        }
    }

    /// h.
    pub fn outputs(&self) -> &[f64] {
        &self.values[..self.jacobian.first]
    }

    /// Writes row i of C.
    pub fn write_slopes(&self, i: usize, row: &mut [f64]) {
        self.jacobian.write_row(&self.values, i, row);
    }
}

impl Persist for OutputMap {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.evaluation.walk(walk)
    }
}
