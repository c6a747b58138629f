//! The gains and matrices of a design as its reader sees them: numbers where they are
//! constant, else expressions with their values at the start.

use std::collections::HashMap;

use lynkeus_expr::{Graph, MissingInput, Node, Tape};
use lynkeus_structure::{AugmentedPlant, Matrix};

use crate::estimate::{PlantCopy, middle};
use crate::{ChainGain, ParameterValue, Shown, TuningError};

/// Longest expression that is printed, in characters.
const LONGEST: usize = 120;

/// What corrects the states of one chain.
pub(crate) struct ChainCorrection<'a> {
    /// place of the measured output
    pub output: usize,
    /// the states that are corrected
    pub states: &'a [usize],
    /// one factor per state of the error of the state that the output shows, over the
    /// symbols of the observer
    pub factors: &'a [Node],
    /// the error is limited before it corrects
    pub limited: bool,
}

impl ChainCorrection<'_> {
    /// The factors of ŷ − y.
    fn on_output(&self, augmented: &AugmentedPlant<'_>) -> Vec<Node> {
        let graph = augmented.graph();
        let Some((_, slope, _)) = augmented.outputs[self.output].state else {
            return vec![];
        };
        let divided = |&factor: &Node| (graph.expr(factor) / graph.expr(slope)).node();
        self.factors.iter().map(divided).collect()
    }

    /// K, where this is a constant gain on ŷ − y.
    pub fn constant(&self, augmented: &AugmentedPlant<'_>) -> Option<ChainGain> {
        if self.limited {
            return None;
        }
        let gains = self.on_output(augmented).into_iter();
        let numbers: Vec<f64> = gains
            .map(|gain| augmented.graph().constant_value(gain))
            .collect::<Option<_>>()?;
        let names = self
            .states
            .iter()
            .map(|&i| augmented.states[i].name.clone());
        Some(ChainGain {
            output: augmented.outputs[self.output].variable.name.clone(),
            entries: names.zip(numbers).collect(),
        })
    }

    /// The factors of ŷ − y as parameters.
    pub fn expressions(&self, start: &AtStart<'_>) -> Vec<(String, ParameterValue)> {
        let augmented = start.augmented;
        let output = &augmented.outputs[self.output].variable.name;
        let named = self.states.iter().zip(self.on_output(augmented));
        let row = |(&state, gain): (&usize, Node)| {
            let name = format!("gain of {output} on {}", augmented.states[state].name);
            let (gain, limited) = (start.shown(gain), self.limited);
            (name, ParameterValue::Gain { gain, limited })
        };
        named.map(row).collect()
    }
}

/// Where the estimate starts, for the values of expressions there.
pub(crate) struct AtStart<'a> {
    augmented: &'a AugmentedPlant<'a>,
    images: HashMap<Node, Node>,
}

impl<'a> AtStart<'a> {
    /// Estimates at their starts, the outputs as they are there, inputs at their declared
    /// starts, time 0.
    pub fn new(copy: &PlantCopy<'a, '_>) -> Result<Self, TuningError> {
        let augmented = copy.augmented;
        let graph = augmented.graph();
        let mut images = HashMap::new();
        images.insert(augmented.plant.time, graph.constant(0.0).node());
        for (state, (hat, start)) in augmented.states.iter().zip(copy.states()?) {
            let start = graph.constant(start).node();
            images.insert(state.node, start);
            images.insert(hat.symbol, start);
        }
        for input in &augmented.inputs {
            if let Some(start) = input.start {
                images.insert(input.node, graph.constant(start).node());
            }
        }
        for (output, signal) in augmented.outputs.iter().zip(&copy.measured) {
            let value = graph.substitute(&[output.variable.node], &images)[0];
            images.insert(signal.symbol, value);
        }
        Ok(Self { augmented, images })
    }

    /// A number, or an expression with its value at the start where all it reads has one.
    pub fn shown(&self, node: Node) -> Shown {
        let graph: &Graph = self.augmented.graph();
        let at_start = match graph.constant_value(node) {
            Some(_) => None,
            None => graph.constant_value(graph.substitute(&[node], &self.images)[0]),
        };
        Shown {
            text: graph.render(node, LONGEST),
            at_start,
        }
    }

    /// A matrix row by row, a missing entry being zero everywhere.
    pub fn table(&self, rows: &[Vec<Option<Node>>]) -> ParameterValue {
        let zero = || Shown {
            text: "0".to_owned(),
            at_start: None,
        };
        let entry = |x: &Option<Node>| x.map_or_else(zero, |x| self.shown(x));
        let row = |row: &Vec<Option<Node>>| row.iter().map(entry).collect();
        ParameterValue::AtStart(rows.iter().map(row).collect())
    }
}

/// Characters of an entry that are shown.
const SHOWN: usize = 60;

/// The point at which a run starts: the estimate where it starts, known inputs at their
/// start values (else the middle of their ranges, else 0), time 0.
pub(crate) struct StartPoint<'g> {
    graph: &'g Graph,
    symbols: Vec<Node>,
    values: Vec<f64>,
}

impl<'g> StartPoint<'g> {
    pub fn new(copy: &PlantCopy<'_, 'g>) -> Result<Self, TuningError> {
        let augmented: &AugmentedPlant<'g> = copy.augmented;
        let (mut symbols, mut values) = (vec![augmented.plant.time], vec![0.0]);
        for input in &augmented.inputs {
            symbols.push(input.node);
            values.push(input.start.unwrap_or_else(|| middle(input)));
        }
        symbols.extend(augmented.symbols());
        values.extend(copy.states()?.iter().map(|(_, start)| start));
        Ok(Self {
            graph: augmented.graph(),
            symbols,
            values,
        })
    }

    /// The entries of a matrix of the plant's symbols, row by row.
    pub fn values(&self, A: &Matrix<'_>) -> Result<Vec<Vec<f64>>, MissingInput> {
        let dense = A.dense();
        let tape = Tape::new(self.graph, &self.symbols, &dense)?;
        let mut found = vec![0.0; dense.len()];
        tape.evaluator().eval(&self.values, &mut found);
        Ok(found
            .chunks(A.columns.max(1))
            .map(<[f64]>::to_vec)
            .collect())
    }

    /// The same for the reader.
    pub fn shown(&self, A: &Matrix<'_>) -> Result<ParameterValue, MissingInput> {
        Ok(ParameterValue::Matrix(self.values(A)?))
    }
}

/// Whether every entry is a number.
pub(crate) fn is_constant(A: &Matrix<'_>) -> bool {
    A.graph().symbols_of(&A.nonzero()).is_empty()
}

/// The entries of a matrix as expressions.
pub(crate) fn expressions(A: &Matrix<'_>) -> ParameterValue {
    let entry = |i, j| match A.get(i, j) {
        Some(node) => A.graph().render(node, SHOWN),
        None => "0".to_owned(),
    };
    let row = |i| (0..A.columns).map(|j| entry(i, j)).collect();
    ParameterValue::Expressions((0..A.rows).map(row).collect())
}
