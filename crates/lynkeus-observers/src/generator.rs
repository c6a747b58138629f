//! Known inputs whose generation is known: Germani and Manes (1999), Remark 4.2.
//!
//! A filter of gain one with the poles λ makes u of a command r:
//!
//!   w₁' = w₂, …, w_{m−1}' = w_m,   w_m' = k_m (r − w₁) − k_{m−1} w₂ − … − k₁ w_m,   u = w₁,
//!
//! ∏(s − λᵢ) = sᵐ + k₁ sᵐ⁻¹ + … + k_m. Its states *are* u, u', …, u^(m−1), exact whatever the command does:
//! with m ≥ n − r of them (4.1) has all it reads, and nothing is differenced.

use lynkeus_expr::{Graph, Node};
use lynkeus_gain::integrators::{Pole, place_all};

use crate::{Observer, Signal};

/// What makes a known input.
#[derive(Clone, Debug, PartialEq)]
pub enum Generator {
    /// u is this expression of time
    Time(Node),
    /// u is what a filter of gain one makes of a command
    Prefilter {
        /// its poles
        poles: Vec<Pole>,
        /// u, u', … where it starts; zeros where there are no more
        start: Vec<f64>,
        /// what the command is called
        command: String,
    },
}

/// A generator that does not give what an observer reads.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeneratorError {
    /// fewer poles than entries of U
    #[error(
        "the observer reads {read} of {input} and its derivatives, and a filter with {poles} poles gives {poles}: expected {read} poles or more"
    )]
    TooFewPoles {
        /// name of the input
        input: String,
        /// how many poles there are
        poles: usize,
        /// how many derivatives are read, the zeroth included
        read: usize,
    },
    /// an expression that reads something else than time
    #[error("the generator of {input} reads more than time")]
    NotOfTime {
        /// name of the input
        input: String,
    },
}

impl Observer {
    /// Lets a known input, and the derivatives of it that are read, come from its generator. The
    /// observer then reads the command in its place, or nothing.
    ///
    /// # Errors
    /// A filter with too few poles, or an expression that reads more than time.
    pub fn generate(
        &mut self,
        graph: &Graph,
        input: &str,
        generator: &Generator,
    ) -> Result<(), GeneratorError> {
        let Some(place) = self.inputs.iter().position(|signal| signal.name == input) else {
            return Ok(());
        };
        match generator {
            Generator::Time(u) => {
                let pair = [(input.to_owned(), *u)];
                let derivatives = self.input_derivative_expressions(graph, &pair);
                let derivatives = derivatives.map_err(|_| GeneratorError::NotOfTime {
                    input: input.to_owned(),
                })?;
                let own = self.inputs.remove(place);
                self.generated.push((own.symbol, *u));
                let own = (self.input_derivatives.iter()).filter(|needed| needed.input == input);
                let own = own.map(|needed| needed.signal.symbol);
                self.generated
                    .extend(own.zip(derivatives.into_iter().map(|(_, node)| node)));
                self.see_generated(graph);
            }
            Generator::Prefilter {
                poles,
                start,
                command,
            } => self.filter_input(graph, place, poles, start, command)?,
        }
        self.input_derivatives
            .retain(|needed| needed.input != input);
        Ok(())
    }

    /// Expressions of time in the place of what they generate.
    fn see_generated(&mut self, graph: &Graph) {
        let images = self.generated.iter().copied().collect();
        self.derivatives = graph.substitute(&self.derivatives, &images);
        for estimate in &mut self.estimates {
            estimate.node = graph.substitute(&[estimate.node], &images)[0];
        }
        for monitor in &mut self.monitors {
            monitor.node = graph.substitute(&[monitor.node], &images)[0];
        }
    }

    /// The filter's states are u, u', …: they take the symbols of these, and the command that of u's place.
    fn filter_input(
        &mut self,
        graph: &Graph,
        place: usize,
        poles: &[Pole],
        start: &[f64],
        command: &str,
    ) -> Result<(), GeneratorError> {
        let k = place_all(poles);
        let input = self.inputs[place].clone();
        let own = (self.input_derivatives.iter()).filter(|d| d.input == input.name);
        let read = own.clone().map(|d| d.order).max().unwrap_or(0) + 1;
        if k.len() < read {
            return Err(GeneratorError::TooFewPoles {
                input: input.name,
                poles: k.len(),
                read,
            });
        }
        let entry = |order: usize| match (order, own.clone().find(|d| d.order == order)) {
            (0, _) => input.clone(),
            (_, Some(derivative)) => derivative.signal.clone(),
            _ => Signal::fresh(graph, "derivative", &format!("{order} of {}", input.name)),
        };
        let w: Vec<Signal> = (0..k.len()).map(entry).collect();
        let command = Signal::fresh(graph, "command", command);
        let spring = graph.expr(command.symbol) - graph.expr(w[0].symbol);
        let mut last = graph.constant(k[k.len() - 1]) * spring;
        for (signal, &k) in w.iter().skip(1).zip(k.iter().rev().skip(1)) {
            last = last - graph.constant(k) * graph.expr(signal.symbol);
        }
        self.derivatives
            .extend(w.iter().skip(1).map(|signal| signal.symbol));
        self.derivatives.push(last.node());
        let starts = start.iter().copied().chain(std::iter::repeat(0.0));
        self.states.extend(w.into_iter().zip(starts));
        self.inputs[place] = command;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Tape;

    use crate::InputDerivative;

    /// x' = u + u', nothing measured.
    fn observer(graph: &Graph) -> Observer {
        let [time, x, u, slope] = ["time", "x", "u", "u'"].map(|name| Signal {
            name: name.to_owned(),
            symbol: graph.symbol(name).node(),
        });
        Observer {
            time: time.symbol,
            states: vec![(x, 0.0)],
            derivatives: vec![(graph.expr(u.symbol) + graph.expr(slope.symbol)).node()],
            inputs: vec![u],
            input_derivatives: vec![InputDerivative {
                input: "u".into(),
                order: 1,
                signal: slope,
            }],
            generated: vec![],
            measured: vec![],
            estimates: vec![],
            monitors: vec![],
            filter: None,
            tunables: vec![],
            is_whole: false,
        }
    }

    fn values(graph: &Graph, observer: &Observer, point: &[f64]) -> Vec<f64> {
        let states = observer.states.iter().map(|(signal, _)| signal.symbol);
        let inputs = observer.inputs.iter().map(|signal| signal.symbol);
        let symbols: Vec<Node> = [observer.time].into_iter().chain(states).collect();
        let symbols: Vec<Node> = symbols.into_iter().chain(inputs).collect();
        let mut values = vec![0.0; observer.derivatives.len()];
        let tape = Tape::new(graph, &symbols, &observer.derivatives).unwrap();
        tape.evaluator().eval(point, &mut values);
        values
    }

    /// (s + 1)(s + 2) = s² + 3s + 2: w₂' = 2(r − w₁) − 3w₂, and x' = w₁ + w₂.
    #[test]
    fn a_filter_of_two_poles_by_hand() {
        let graph = Graph::new();
        let mut observer = observer(&graph);
        let filter = |poles: &[f64]| Generator::Prefilter {
            poles: poles.iter().map(|λ| Pole::Real(*λ)).collect(),
            start: vec![0.5],
            command: "r".into(),
        };
        let refused = observer.clone().generate(&graph, "u", &filter(&[-1.0]));
        assert!(matches!(
            refused,
            Err(GeneratorError::TooFewPoles {
                poles: 1,
                read: 2,
                ..
            })
        ));
        observer
            .generate(&graph, "u", &filter(&[-1.0, -2.0]))
            .unwrap();
        let starts: Vec<f64> = observer.states.iter().map(|(_, start)| *start).collect();
        assert_eq!(starts, [0.0, 0.5, 0.0]);
        assert_eq!(observer.inputs[0].name, "r");
        assert!(observer.input_derivatives.is_empty());
        // t, x, w₁, w₂, r
        let found = values(&graph, &observer, &[0.0, 9.0, 0.25, 0.75, 2.0]);
        assert_eq!(found, [1.0, 0.75, 2.0 * 1.75 - 3.0 * 0.75]);
    }

    /// u = t³: x' = t³ + 3t².
    #[test]
    fn an_expression_is_differentiated() {
        let graph = Graph::new();
        let mut observer = observer(&graph);
        let u = graph.expr(observer.time).powi(3).node();
        observer.generate(&graph, "u", &Generator::Time(u)).unwrap();
        assert!(observer.inputs.is_empty() && observer.input_derivatives.is_empty());
        assert_eq!(values(&graph, &observer, &[2.0, 9.0]), [20.0]);
    }
}
