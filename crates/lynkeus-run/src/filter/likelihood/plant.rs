//! A plant as a function of what is not known.

use lynkeus_expr::{Graph, Node};
use lynkeus_model::Whens;

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
    /// so many of the states, the last, are drawn anew in every row
    pub drawn: usize,
    /// by which the states jump; none where they never do
    pub whens: Whens,
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

    /// Straight-line code goes through no event.
    ///
    /// # Errors
    /// [`Error::Setting`] where the states jump.
    pub(super) fn refuse_events(&self) -> Result<()> {
        match self.whens.is_empty() {
            true => Ok(()),
            false => Err(Error::setting(
                "plant",
                "one whose states do not jump; another is followed along its filter",
                "`when`",
            )),
        }
    }

    /// The derivatives of the states limited to their ranges.
    pub(super) fn limited(&self) -> Vec<Node> {
        let g = self.graph;
        let limited = self.states.iter().zip(&self.ranges).map(|(&x, range)| {
            let mut image = g.expr(x);
            if range.high.is_finite() {
                image = image.min(g.constant(range.high));
            }
            if range.low.is_finite() {
                image = image.max(g.constant(range.low));
            }
            (x, image.node())
        });
        g.substitute(&self.derivatives, &limited.collect())
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
    /// it shows an angle: a full turn changes nothing
    pub is_dial: bool,
}

/// The noise of a sensor.
#[derive(Clone, Copy, Debug)]
pub enum ParametricLevel {
    /// its variance
    Variance(Node),
    /// its standard deviation as a share p of the output: the variance is p²E\[h²\]
    Share(Node),
}
