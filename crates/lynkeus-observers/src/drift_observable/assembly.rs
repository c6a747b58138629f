//! The observers (3.1), (4.1) and (4.22) as expressions.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_model::Variable;
use lynkeus_structure::Extended;

use super::form::Form;
use super::gains::Gains;
use super::report::{Laid, notes};
use super::variant::Variant;
use super::{NAME, derivative_name};
use crate::estimate::{Common, Copy};
use crate::stages::Found;
use crate::tunable::Speed;
use crate::{Design, DesignError, InputDerivative, Monitor, Signal};

/// Below this rcond of Q̄, with rows and columns scaled, the flag is raised.
const ALARM: f64 = 1e-2;
/// The correction is multiplied by 1 − exp(−(rcond/WITHDRAWN)²): exactly 1 in `f64`
/// from 6·WITHDRAWN on, and small enough below for Q̄⁻¹, which grows like
/// 1/rcond, to pass a singularity in bounds.
const WITHDRAWN: f64 = 1e-4;
/// From here on the correction is not withdrawn at all.
pub(super) const WHOLE: f64 = 6.0 * WITHDRAWN;

pub(super) fn design(
    extended: &Extended<'_>,
    common: &Common,
    Found { form, examination }: Found<Form>,
    gains: Gains,
) -> Result<Design, DesignError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, common);
    let speed = Speed::new(&copy, "pole_scale", 1.0, scale_of_poles(&gains));
    let filters = filters(extended, &form, &gains, &speed);
    let seen = filters.seen();
    // the plant and its map at x̂, and at x̂_a where (4.22) has it
    let at = |expressions: &[Node]| graph.substitute(&copy.at_estimate(expressions), &seen);
    let K = Corrections {
        gains: &gains,
        speed: &speed,
        filters: &filters,
    };
    let right = innovations(extended, &copy, &form, &K, &at);
    let Q = numbers(graph, &form.Q, &at);
    let solution = solve(extended, &Q, &right);
    let f = at(&extended.derivatives);
    let derivatives = f.iter().zip(&solution.x);
    let mut derivatives: Vec<Node> = derivatives
        .map(|(&f, &x)| (graph.expr(f) + graph.expr(x)).node())
        .collect();
    derivatives.extend(filters.derivatives(graph));
    let mut observer = copy.observer(NAME, derivatives)?.tuned_by([&speed]);
    observer.states.extend(filters.states(&gains));
    let matrix = match form.variant {
        Variant::Bounded => "Q",
        Variant::Theoretical | Variant::Practical => "Q̄",
    };
    observer.monitors.push(Monitor {
        name: "rcond".into(),
        node: solution.rcond,
        alarm_below: ALARM,
        meaning: format!(
            "{matrix} is close to singular: the outputs and their derivatives hardly tell the states apart here, and the correction is large or withdrawn"
        ),
        matrix: Some(matrix),
    });
    if form.variant == Variant::Theoretical {
        observer.input_derivatives = input_derivatives(extended, &form);
    }
    let laid = Laid {
        extended,
        form: &form,
        gains: &gains,
        Q: &Q,
        solution: &solution,
        observer: &observer,
    };
    Ok(Design {
        notes: notes(extended, &form, &observer.input_derivatives),
        gains: laid.constant_gains()?,
        parameters: laid.parameters()?,
        observer,
        examination,
    })
}

/// x̂_a: per input the symbols of its filter, empty where there is none.
struct Filters {
    input: Vec<Variable>,
    x_a: Vec<Vec<Signal>>,
    U: Vec<Vec<Node>>,
    /// K₂ per input
    K2: Vec<Vec<Node>>,
}

/// What the factor on the poles does.
fn scale_of_poles(gains: &Gains) -> String {
    let what = "multiplies the poles of the observer";
    let mut filters = gains.filter_follows.iter().zip(&gains.K2);
    match filters.any(|(follows, K2)| *follows && !K2.is_empty()) {
        true => format!("{what} and of the input filters that the study gives none for"),
        false => what.to_owned(),
    }
}

fn filters(extended: &Extended<'_>, form: &Form, gains: &Gains, speed: &Speed) -> Filters {
    let graph = extended.graph();
    let state = |input: &Variable, k: usize| {
        let name = format!("filter of {}", derivative_name(&input.name, k));
        let symbol = graph.fresh(&name).node();
        Signal { name, symbol }
    };
    let gain = |(k, gain): (usize, &f64), follows: bool| match follows {
        true => speed.scaled(graph, *gain, (k + 1) as f64).node(),
        false => graph.constant(*gain).node(),
    };
    let pairs = extended.inputs.iter().zip(&gains.K2);
    Filters {
        input: extended.inputs.clone(),
        x_a: pairs
            .map(|(input, K2)| (0..K2.len()).map(|k| state(input, k)).collect())
            .collect(),
        U: form.U.clone(),
        K2: gains
            .K2
            .iter()
            .zip(&gains.filter_follows)
            .map(|(K2, follows)| K2.iter().enumerate().map(|k| gain(k, *follows)).collect())
            .collect(),
    }
}

impl Filters {
    /// u, u', … ↦ x̂_a
    fn seen(&self) -> HashMap<Node, Node> {
        let pairs = self.U.iter().zip(&self.x_a);
        pairs
            .flat_map(|(U, x_a)| U.iter().zip(x_a).map(|(&u, x)| (u, x.symbol)))
            .collect()
    }

    /// u − C x̂_a
    fn innovation<'g>(&self, graph: &'g Graph, j: usize) -> Option<Expr<'g>> {
        let first = self.x_a[j].first()?;
        Some(graph.expr(self.input[j].node) - graph.expr(first.symbol))
    }

    fn states(&self, gains: &Gains) -> Vec<(Signal, f64)> {
        let signals = self.x_a.iter().flatten().cloned();
        signals.zip(gains.filter_start.concat()).collect()
    }

    /// x̂_a' = A x̂_a + K₂(u − C x̂_a)
    fn derivatives(&self, graph: &Graph) -> Vec<Node> {
        let mut derivatives = vec![];
        for (j, x_a) in self.x_a.iter().enumerate() {
            let Some(e) = self.innovation(graph, j) else {
                continue;
            };
            for (k, &gain) in self.K2[j].iter().enumerate() {
                let correction = graph.expr(gain) * e;
                derivatives.push(match x_a.get(k + 1) {
                    Some(next) => (graph.expr(next.symbol) + correction).node(),
                    None => correction.node(),
                });
            }
        }
        derivatives
    }
}

/// What the innovations are multiplied with.
struct Corrections<'a> {
    gains: &'a Gains,
    speed: &'a Speed,
    filters: &'a Filters,
}

/// K(y − h(x̂)) and, for (4.22), − Q̄_a K₂(u − C x̂_a).
fn innovations(
    extended: &Extended<'_>,
    copy: &Copy<'_, '_>,
    form: &Form,
    Corrections {
        gains,
        speed,
        filters,
    }: &Corrections<'_>,
    at: &dyn Fn(&[Node]) -> Vec<Node>,
) -> Vec<Node> {
    let graph = extended.graph();
    let y = &copy.measured;
    let x̂: HashMap<Node, Node> = extended
        .symbols()
        .into_iter()
        .zip(copy.hats.iter().map(|hat| hat.symbol))
        .collect();
    let e: Vec<Expr<'_>> = extended
        .outputs
        .iter()
        .zip(y)
        .map(|(output, y)| {
            // the innovation sees the estimate itself, as in the other families,
            // except where h may leave its domain
            let h = match output.state {
                Some(_) => graph.substitute(&[output.variable.node], &x̂),
                None => copy.at_estimate(&[output.variable.node]),
            };
            h.iter()
                .fold(graph.expr(y.symbol), |y, &h| y - graph.expr(h))
        })
        .collect();
    // K₂(u − C x̂_a), an entry per column of Q̄_a; none without a filter
    let filtered: Vec<Expr<'_>> = (0..form.U.len())
        .filter_map(|j| Some((j, filters.innovation(graph, j)?)))
        .flat_map(|(j, e_a)| {
            filters.K2[j]
                .iter()
                .map(move |&gain| graph.expr(gain) * e_a)
        })
        .collect();
    let Q_a = numbers(graph, &form.Q_a, at);
    let row = |(place, &(i, k)): (usize, &(usize, usize))| {
        let gain = speed.scaled(graph, gains.K[i][k], (k + 1) as f64);
        let mut sum = gain * e[i];
        let entries = form.Q_a.get(place).into_iter().flatten().enumerate();
        for ((column, entry), &e_a) in entries.zip(&filtered) {
            if entry.is_some() {
                sum = sum - graph.expr(Q_a[place * filtered.len() + column]) * e_a;
            }
        }
        sum.node()
    };
    form.rows.iter().enumerate().map(row).collect()
}

fn numbers(
    graph: &Graph,
    rows: &[Vec<Option<Node>>],
    at: &dyn Fn(&[Node]) -> Vec<Node>,
) -> Vec<Node> {
    let zero = graph.constant(0.0).node();
    let entries: Vec<Node> = rows.iter().flatten().map(|e| e.unwrap_or(zero)).collect();
    at(&entries)
}

/// The correction and the rcond that it was found with.
pub(super) struct Solution {
    x: Vec<Node>,
    pub rcond: Node,
    /// the same number as an expression that does not read the right-hand side
    pub alone: Node,
}

/// x with Q x = b. Columns are scaled by the states' ranges and rows to length
/// one, so that rcond does not depend on units; where it nearly vanishes the
/// correction is withdrawn smoothly.
fn solve(extended: &Extended<'_>, Q: &[Node], b: &[Node]) -> Solution {
    let graph = extended.graph();
    let n = b.len();
    let scales: Vec<f64> = extended.states.iter().map(scale).collect();
    let (mut A, mut right) = (vec![], vec![]);
    for i in 0..n {
        let row: Vec<Expr<'_>> = (0..n)
            .map(|j| graph.expr(Q[n * i + j]) * scales[j])
            .collect();
        let squares = row.iter().map(|q| q.powi(2));
        // a row of zeros stays one: it is singular, not a division by zero
        let norm = squares
            .fold(graph.constant(1e-300), |sum, square| sum + square)
            .sqrt();
        A.extend(row.iter().map(|&q| (q / norm).node()));
        right.push((graph.expr(b[i]) / norm).node());
    }
    let solution = graph.solve(&A, &right);
    let zeros = vec![graph.constant(0.0).node(); n];
    let alone = graph.solve(&A, &zeros).rcond;
    let ratio = graph.expr(solution.rcond) / WITHDRAWN;
    let share = 1.0 - (-(ratio * ratio)).exp();
    let x = solution.x.iter().zip(&scales);
    Solution {
        x: x.map(|(&x, &scale)| (graph.expr(x) * scale * share).node())
            .collect(),
        rcond: solution.rcond,
        alone,
    }
}

/// A typical size of a state's variation.
fn scale(state: &Variable) -> f64 {
    let width = state.max - state.min;
    match (width.is_finite() && width > 0.0, state.nominal) {
        (true, _) => width,
        (false, Some(nominal)) if nominal != 0.0 => nominal.abs(),
        _ => 1.0,
    }
}

fn input_derivatives(extended: &Extended<'_>, form: &Form) -> Vec<InputDerivative> {
    let mut needed = vec![];
    for (input, U) in extended.inputs.iter().zip(&form.U) {
        for (order, &symbol) in U.iter().enumerate().skip(1) {
            needed.push(InputDerivative {
                input: input.name.clone(),
                order,
                signal: Signal {
                    name: derivative_name(&input.name, order),
                    symbol,
                },
            });
        }
    }
    needed
}
