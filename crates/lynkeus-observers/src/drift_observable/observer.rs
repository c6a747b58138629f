//! The observers (3.1), (4.1) and (4.22) as expressions, with the numbers of their gains and
//! what the reader is told of them.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node, Tape};
use lynkeus_gain::integrators::{self, Lemma32, Pole};
use lynkeus_model::Variable;
use lynkeus_proof::magnitude::{root, times};
use lynkeus_structure::AugmentedPlant;
use nalgebra::{DMatrix, DVector};

use super::form::{Form, NAME, derivative_name};
use super::settings;
use super::settings::{Needed, Settings, Variant, spaced};
use crate::design::Found;
use crate::estimate::{Common, PlantCopy, Speed};
use crate::{
    ChainGain, Design, DesignError, InputDerivative, Monitor, Observer, Signal, TuningError,
};

/// Below this rcond of Q̄, with rows and columns scaled, the flag is raised.
const ALARM: f64 = 1e-2;

/// The correction is multiplied by 1 − exp(−(rcond/WITHDRAWN)²): exactly 1 in `f64`
/// from 6·WITHDRAWN on, and small enough below for Q̄⁻¹, which grows like
/// 1/rcond, to pass a singularity in bounds.
const WITHDRAWN: f64 = 1e-4;

/// From here on the correction is not withdrawn at all.
pub(super) const WHOLE: f64 = 6.0 * WITHDRAWN;

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    common: &Common,
    Found { form, examination }: Found<Form>,
    gains: Gains,
) -> Result<Design, DesignError> {
    let graph = augmented.graph();
    let copy = PlantCopy::new(augmented, common);
    let speed = Speed::new(&copy, "pole_scale", 1.0, scale_of_poles(&gains));
    let filters = filters(augmented, &form, &gains, &speed);
    let seen = filters.seen();
    // the plant and its map at x̂, and at x̂_a where (4.22) has it
    let at = |expressions: &[Node]| graph.substitute(&copy.at_estimate(expressions), &seen);
    let right = innovations(&copy, &form, &gains, &speed, &filters, &at);
    let Q = numbers(graph, &form.Q, &at);
    let solution = solve(augmented, &Q, &right);
    let f = at(&augmented.derivatives);
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
        observer.input_derivatives = input_derivatives(augmented, &form);
    }
    let laid = Laid {
        augmented,
        form: &form,
        gains: &gains,
        Q: &Q,
        solution: &solution,
        observer: &observer,
    };
    Ok(Design {
        notes: notes(augmented, &form, &observer.input_derivatives),
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

fn filters(augmented: &AugmentedPlant<'_>, form: &Form, gains: &Gains, speed: &Speed) -> Filters {
    let graph = augmented.graph();
    let state = |input: &Variable, k: usize| {
        let name = format!("filter of {}", derivative_name(&input.name, k));
        let symbol = graph.fresh(&name).node();
        Signal { name, symbol }
    };
    let gain = |(k, gain): (usize, &f64), follows: bool| match follows {
        true => speed.scaled(graph, *gain, (k + 1) as f64).node(),
        false => graph.constant(*gain).node(),
    };
    let pairs = augmented.inputs.iter().zip(&gains.K2);
    Filters {
        input: augmented.inputs.clone(),
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

/// K(y − h(x̂)) and, for (4.22), − Q̄_a K₂(u − C x̂_a).
fn innovations(
    copy: &PlantCopy<'_, '_>,
    form: &Form,
    gains: &Gains,
    speed: &Speed,
    filters: &Filters,
    at: &dyn Fn(&[Node]) -> Vec<Node>,
) -> Vec<Node> {
    let augmented = copy.augmented;
    let graph = augmented.graph();
    let y = &copy.measured;
    let x̂: HashMap<Node, Node> = augmented
        .symbols()
        .into_iter()
        .zip(copy.hats.iter().map(|hat| hat.symbol))
        .collect();
    let e: Vec<Expr<'_>> = augmented
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
fn solve(augmented: &AugmentedPlant<'_>, Q: &[Node], b: &[Node]) -> Solution {
    let graph = augmented.graph();
    let n = b.len();
    let scales: Vec<f64> = augmented.states.iter().map(scale).collect();
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

fn input_derivatives(augmented: &AugmentedPlant<'_>, form: &Form) -> Vec<InputDerivative> {
    let mut needed = vec![];
    for (input, U) in augmented.inputs.iter().zip(&form.U) {
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

/// Default ratio of the filter's slowest pole to that of the observer: that of the
/// paper's example.
const FILTER_SPEED: f64 = 10.0;

/// The numbers of the gain.
#[derive(Debug)]
pub(super) struct Gains {
    /// eigenvalues and K per output, empty where the output is not used
    pub λ: Vec<Vec<Pole>>,
    pub K: Vec<Vec<f64>>,
    /// per input: eigenvalues, K₂ and x̂_a(0); empty where no filter is needed
    pub filter_λ: Vec<Vec<Pole>>,
    pub K2: Vec<Vec<f64>>,
    pub filter_start: Vec<Vec<f64>>,
    /// per input: the filter's eigenvalues are set by the observer's slowest one, not by the study
    pub filter_follows: Vec<bool>,
    /// what Lemma 3.2 gave, per output that it was used for
    pub lemma: Vec<Lemma32>,
}

impl Gains {
    pub fn new(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        form: &Form,
    ) -> Result<Self, TuningError> {
        let (λ, lemma) = match settings.poles(&form.indices)? {
            Some(λ) => (λ, vec![]),
            None => by_lemma(settings, &form.indices)?,
        };
        let filters: Vec<usize> = match form.variant {
            Variant::Practical => form.U.iter().map(Vec::len).collect(),
            _ => vec![0; form.U.len()],
        };
        let needed = Needed::new(augmented, filters.clone());
        let filter_slowest = -FILTER_SPEED * slowest(&λ);
        let filter_given = settings.filter_poles(&needed)?;
        let filter_follows = filter_given.iter().map(Option::is_none).collect();
        let filter_λ: Vec<Vec<Pole>> = filter_given
            .into_iter()
            .zip(&filters)
            .map(|(given, &order)| given.unwrap_or_else(|| spaced(filter_slowest, order)))
            .collect();
        let start = |j: usize| {
            let mut start = vec![0.0; filters[j]];
            if let Some(u) = start.first_mut() {
                *u = augmented.inputs[j].start.unwrap_or(0.0);
            }
            start
        };
        let filter_start = settings.filter_initial(&needed)?.into_iter();
        let filter_start = filter_start
            .enumerate()
            .map(|(j, given)| given.unwrap_or_else(|| start(j)))
            .collect();
        let place = |λ: &Vec<Pole>| integrators::place_all(λ);
        Ok(Self {
            K: λ.iter().map(place).collect(),
            K2: filter_λ.iter().map(place).collect(),
            λ,
            filter_λ,
            filter_start,
            filter_follows,
            lemma,
        })
    }
}

fn by_lemma(
    settings: &Settings,
    μ: &[usize],
) -> Result<(Vec<Vec<Pole>>, Vec<Lemma32>), TuningError> {
    let found = settings.lemma(μ)?;
    let poles = |lemma: &Option<Lemma32>| {
        let poles = lemma.iter().flat_map(|lemma| &lemma.poles);
        poles.map(|&λ| Pole::Real(λ)).collect()
    };
    Ok((
        found.iter().map(poles).collect(),
        found.into_iter().flatten().collect(),
    ))
}

/// The smallest decay among the poles.
pub(super) fn slowest(λ: &[Vec<Pole>]) -> f64 {
    λ.iter()
        .flatten()
        .fold(f64::INFINITY, |m, λ| m.min(-λ.re()))
}

/// A − KC, a block per chain.
pub(super) fn closed_loop(K: &[Vec<f64>]) -> DMatrix<f64> {
    let n = K.iter().map(Vec::len).sum();
    let mut A = DMatrix::zeros(n, n);
    let mut start = 0;
    for K in K {
        for (k, gain) in K.iter().enumerate() {
            A[(start + k, start)] = -gain;
            if k + 1 < K.len() {
                A[(start + k, start + k + 1)] += 1.0;
            }
        }
        start += K.len();
    }
    A
}

/// Columns √m s_k e_k for the m numbers s_k > 0.
pub(super) fn spread(s: &[f64]) -> DMatrix<f64> {
    let rows: Vec<usize> = (0..s.len()).filter(|&k| s[k] > 0.0).collect();
    let root = root(rows.len() as f64);
    DMatrix::from_fn(s.len(), rows.len(), |k, j| match rows[j] == k {
        true => times(root, s[k]),
        false => 0.0,
    })
}

/// Characters of an entry of a matrix.
const WIDTH: usize = 60;

pub(super) fn notes(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    derivatives: &[InputDerivative],
) -> Vec<String> {
    let mut notes = vec![];
    if let [_, _, ..] = form.indices[..] {
        let outputs = augmented.outputs.iter().zip(&form.indices);
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
    pub augmented: &'a AugmentedPlant<'p>,
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
        let graph = self.augmented.graph();
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
        let outputs = self.augmented.outputs.iter().enumerate();
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
            let states = self.augmented.states.iter().map(|s| s.name.clone());
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
        let outputs = self.augmented.outputs.iter().zip(&self.gains.λ);
        for ((output, λ), K) in outputs
            .zip(&self.gains.K)
            .filter(|((_, λ), _)| !λ.is_empty())
        {
            let y = &output.variable.name;
            rows.push((format!("λ of {y}"), settings::list(λ)));
            rows.push((format!("K of {y}"), listed(K)));
        }
        let inputs = self.augmented.inputs.iter().zip(&self.gains.filter_λ);
        for ((input, λ), K2) in inputs
            .zip(&self.gains.K2)
            .filter(|((_, λ), _)| !λ.is_empty())
        {
            let u = &input.name;
            rows.push((format!("λ of the filter of {u}"), settings::list(λ)));
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
        let graph = self.augmented.graph();
        let Q = match self.form.variant {
            Variant::Bounded => "Q",
            _ => "Q̄",
        };
        let n = self.form.rows.len();
        for (&(i, k), entries) in self.form.rows.iter().zip(self.Q.chunks(n.max(1))) {
            let y = derivative_name(&self.augmented.outputs[i].variable.name, k);
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
        let graph = self.augmented.graph();
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
