//! A plant as a function of what is not known.

use lynkeus_expr::{Graph, Node, jacobian};

use crate::noise::Limits;
use crate::{Error, Result};

/// A plant with its sensors and noises as functions of parameters θ.
///
/// Everything is an expression of one graph: f and h of time, states, inputs and θ; noises of sensors of the same, as
/// the estimate is before the row's readings; densities and starts of θ alone.
#[derive(Clone, Debug)]
pub struct ParametricPlant<'g> {
    /// the graph of all expressions
    pub graph: &'g Graph,
    /// the symbol of time
    pub time: Node,
    /// symbols of the states
    pub states: Vec<Node>,
    /// f, one per state
    pub derivatives: Vec<Node>,
    /// symbols of the known inputs, held from one row to the next
    pub inputs: Vec<Node>,
    /// what is measured
    pub sensors: Vec<ParametricSensor>,
    /// spectral density of the white noise on each derivative
    pub process_noise: Vec<Node>,
    /// where the plant is known to have values, one per state, or none: where it has none at an estimate, this
    /// is put there, and the plant's expressions see it limited to that until the next row
    pub ranges: Vec<Limits>,
    /// the first estimate of each state, and its standard deviation
    pub start: Vec<(Node, Node)>,
    /// symbols of θ
    pub parameters: Vec<Node>,
}

impl ParametricPlant<'_> {
    /// # Errors
    /// [`Error::Setting`] for wrong numbers of expressions.
    pub(super) fn check(&self) -> Result<()> {
        let n = self.states.len();
        let counts = [
            self.derivatives.len(),
            self.process_noise.len(),
            self.start.len(),
        ];
        let is_ranged = self.ranges.is_empty() || self.ranges.len() == n;
        if n == 0 || !is_ranged || counts.iter().any(|count| *count != n) {
            let expected =
                "one derivative, density and start for each state, of which there are some";
            return Err(Error::setting("states", expected, n));
        }
        Ok(())
    }

    /// The same with the states in the order in which noise reaches them: those that it acts on, those that these
    /// drive, and so on. What noise makes of a state in a step of length h is of order h^(2d + 1) for one that is d
    /// away, and Runge and Kutta's steps tell it up to h⁴. The factor of the noise's covariance W begins with the
    /// first state: with one that is far away it would begin with what the steps left of nothing, and drop what
    /// that has in common with the others.
    pub(super) fn by_distance(&self) -> Self {
        let order = self.order();
        let ordered = |nodes: &[Node]| order.iter().map(|&i| nodes[i]).collect();
        Self {
            states: ordered(&self.states),
            derivatives: ordered(&self.derivatives),
            process_noise: ordered(&self.process_noise),
            ranges: match self.ranges.is_empty() {
                true => vec![],
                false => order.iter().map(|&i| self.ranges[i]).collect(),
            },
            start: order.iter().map(|&i| self.start[i]).collect(),
            ..self.clone()
        }
    }

    /// The places of the states in that order.
    pub(super) fn order(&self) -> Vec<usize> {
        let n = self.states.len();
        let is_noisy = |q: &Node| self.graph.constant_value(*q) != Some(0.0);
        let mut away: Vec<usize> = (self.process_noise.iter())
            .map(|q| if is_noisy(q) { 0 } else { n })
            .collect();
        let slopes = jacobian::forward(self.graph, &self.derivatives, &self.states).entries;
        for _ in 0..n {
            for &(row, column, _) in &slopes {
                away[row] = away[row].min(away[column] + 1);
            }
        }
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|&i| away[i]);
        order
    }
}

/// A sensor of a [`ParametricPlant`].
#[derive(Clone, Debug)]
pub struct ParametricSensor {
    /// h(t, x, u)
    pub output: Node,
    /// how strong its noise is
    pub noise: ParametricLevel,
    /// the range that it can show; a reading at an end says that y is there or beyond
    pub limits: Option<Limits>,
}

/// The noise of a sensor.
#[derive(Clone, Copy, Debug)]
pub enum ParametricLevel {
    /// its variance
    Variance(Node),
    /// its standard deviation as a share p of the output: the variance is p²E\[h²\]
    Share(Node),
}
