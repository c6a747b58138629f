//! What the reader is told of an observer: gains, matrices and notes.

use lynkeus_expr::{Node, Tape};
use lynkeus_structure::Extended;
use nalgebra::{DMatrix, DVector};

use super::assembly::{Solution, WHOLE};
use super::derivative_name;
use super::form::Form;
use super::gains::Gains;
use super::poles;
use super::variant::Variant;
use crate::{ChainGain, DesignError, InputDerivative, Observer};

/// Characters of an entry of a matrix.
const WIDTH: usize = 60;

pub(super) fn notes(
    extended: &Extended<'_>,
    form: &Form,
    derivatives: &[InputDerivative],
) -> Vec<String> {
    let mut notes = vec![];
    if let [_, _, ..] = form.indices[..] {
        let outputs = extended.outputs.iter().zip(&form.indices);
        let parts: Vec<String> = outputs
            .map(|(o, μ)| format!("{} {μ}", o.variable.name))
            .collect();
        notes.push(format!(
            "derivatives used of each output: {}; the key 'indices' decides otherwise",
            parts.join(", ")
        ));
    }
    if !derivatives.is_empty() {
        let names: Vec<&str> = derivatives.iter().map(|d| d.signal.name.as_str()).collect();
        notes.push(format!(
            "the theoretical observer needs {} exactly, which a simulation has; a log needs columns of them (`input_derivatives` of [estimate]) or the `generator` of the input, or variant = \"practical\"",
            names.join(", ")
        ));
    }
    if form.variant == Variant::Bounded && form.U.iter().any(|U| !U.is_empty()) {
        notes.push("the bounded variant converges for small inputs only (Theorem 3.3)".to_owned());
    }
    notes
}

/// An observer with what it was made from.
pub(super) struct Laid<'a, 'p> {
    pub extended: &'a Extended<'p>,
    pub form: &'a Form,
    pub gains: &'a Gains,
    /// Q or Q̄ at the estimate, row by row
    pub Q: &'a [Node],
    pub solution: &'a Solution,
    pub observer: &'a Observer,
}

impl Laid<'_, '_> {
    /// Q⁻¹K where Q is a matrix of numbers: then the observer is f − Q⁻¹K (ŷ − y). None where
    /// Q follows the estimate, or where a filter takes part.
    pub fn constant_gains(&self) -> Result<Vec<ChainGain>, DesignError> {
        let graph = self.extended.graph();
        let numbers: Option<Vec<f64>> = self.Q.iter().map(|&q| graph.constant_value(q)).collect();
        let filtered = self.gains.K2.iter().any(|K2| !K2.is_empty());
        let (Some(numbers), false) = (numbers, filtered) else {
            return Ok(vec![]);
        };
        let whole = self.at_start(&[self.solution.alone])?;
        match whole {
            Some(rcond) if rcond[0] >= WHOLE => {}
            _ => return Ok(vec![]),
        }
        Ok(self.corrections(&numbers).unwrap_or_default())
    }

    /// Q⁻¹K column by column: what a unit of y − ŷ adds to each state's derivative.
    fn corrections(&self, Q: &[f64]) -> Option<Vec<ChainGain>> {
        let n = self.form.rows.len();
        let Q = DMatrix::from_row_slice(n, n, Q).lu();
        let outputs = self.extended.outputs.iter().enumerate();
        let used = outputs.filter(|(i, _)| self.form.indices[*i] > 0);
        used.map(|(i, output)| {
            let K = |&(row_of, k): &(usize, usize)| match row_of == i {
                true => self.gains.K[i][k],
                false => 0.0,
            };
            let column = DVector::from_iterator(n, self.form.rows.iter().map(K));
            let gain = Q.solve(&column)?;
            if !gain.iter().all(|k| k.is_finite()) {
                return None;
            }
            let states = self.extended.states.iter().map(|s| s.name.clone());
            Some(ChainGain {
                output: output.variable.name.clone(),
                entries: states.zip(gain.iter().copied()).collect(),
            })
        })
        .collect()
    }

    /// The matrices of the paper, as expressions of the estimate and at its start.
    pub fn parameters(&self) -> Result<Vec<(String, String)>, DesignError> {
        let mut rows = vec![("variant".to_owned(), self.form.variant.word().to_owned())];
        let outputs = self.extended.outputs.iter().zip(&self.gains.λ);
        for ((output, λ), K) in outputs
            .zip(&self.gains.K)
            .filter(|((_, λ), _)| !λ.is_empty())
        {
            let y = &output.variable.name;
            rows.push((format!("λ of {y}"), poles::list(λ)));
            rows.push((format!("K of {y}"), listed(K)));
        }
        let inputs = self.extended.inputs.iter().zip(&self.gains.filter_λ);
        for ((input, λ), K2) in inputs
            .zip(&self.gains.K2)
            .filter(|((_, λ), _)| !λ.is_empty())
        {
            let u = &input.name;
            rows.push((format!("λ of the filter of {u}"), poles::list(λ)));
            rows.push((format!("K2 of the filter of {u}"), listed(K2)));
        }
        for found in &self.gains.lemma {
            rows.push(("σ of Lemma 3.2".to_owned(), found.σ.to_string()));
            let peaking = match found.peaking.is_finite() {
                true => found.peaking.to_string(),
                false => "beyond the range of numbers".to_owned(),
            };
            rows.push(("√cn(P)".to_owned(), peaking));
        }
        self.add_matrices(&mut rows)?;
        Ok(rows)
    }

    fn add_matrices(&self, rows: &mut Vec<(String, String)>) -> Result<(), DesignError> {
        let graph = self.extended.graph();
        let Q = match self.form.variant {
            Variant::Bounded => "Q",
            _ => "Q̄",
        };
        let n = self.form.rows.len();
        for (&(i, k), entries) in self.form.rows.iter().zip(self.Q.chunks(n.max(1))) {
            let y = derivative_name(&self.extended.outputs[i].variable.name, k);
            let entries: Vec<String> = entries.iter().map(|&q| graph.render(q, WIDTH)).collect();
            rows.push((format!("{Q}, row {y}"), entries.join(", ")));
        }
        let Some(start) = self.at_start(self.Q)? else {
            return Ok(());
        };
        for gain in self.corrections(&start).unwrap_or_default() {
            let column: Vec<f64> = gain.entries.iter().map(|e| e.1).collect();
            let name = format!("{Q}⁻¹K of {} at the start", gain.output);
            rows.push((name, listed(&column)));
        }
        Ok(())
    }

    /// The values where the observer starts; none where they depend on more than its states.
    fn at_start(&self, nodes: &[Node]) -> Result<Option<Vec<f64>>, DesignError> {
        let graph = self.extended.graph();
        let states = &self.observer.states;
        let symbols: Vec<Node> = states.iter().map(|(signal, _)| signal.symbol).collect();
        if graph.symbols_of(nodes).iter().any(|s| !symbols.contains(s)) {
            return Ok(None);
        }
        let start: Vec<f64> = states.iter().map(|(_, start)| *start).collect();
        let mut values = vec![0.0; nodes.len()];
        Tape::new(graph, &symbols, nodes)?
            .evaluator()
            .eval(&start, &mut values);
        Ok(values.iter().all(|v| v.is_finite()).then_some(values))
    }
}

fn listed(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    values.join(", ")
}
