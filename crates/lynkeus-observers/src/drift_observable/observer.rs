//! The observers (3.1), (4.1) and (4.22) as expressions, with the numbers of their gains and
//! what the reader is told of them.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node, Tape};
use lynkeus_gain::integrators::{self, Lemma32, Pole};
use lynkeus_model::Variable;
use lynkeus_proof::magnitude::{root, times};
use lynkeus_structure::AugmentedPlant;
use nalgebra::{DMatrix, DVector};

use super::form::{Form, derivative_name};
use super::said::Said;
use super::settings::{Settings, Variant, spaced};
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed};
use crate::{
    ChainGain, Design, DesignError, InputDerivative, Monitor, Observer, ParameterValue, Reason,
    Signal, TuningError,
};

/// Below this rcond of Q̄, with rows and columns scaled, the flag is raised.
const ALARM: f64 = 1e-2;

/// The correction is multiplied by 1 − exp(−(rcond/WITHDRAWN)²): exactly 1 in `f64`
/// from 6·WITHDRAWN on, and small enough below for Q̄⁻¹, which grows like
/// 1/rcond, to pass a singularity in bounds.
const WITHDRAWN: f64 = 1e-4;

/// From here on the correction is not withdrawn at all.
const WHOLE: f64 = 6.0 * WITHDRAWN;

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    let graph = augmented.graph();
    let gains = Gains::new(augmented, settings, &form)?;
    let copy = PlantCopy::new(augmented, &settings.common);
    let speed = Speed::new(&copy, "pole_scale", 1.0, scale_of_poles(&gains));
    let filters = filters(augmented, &gains, &speed);
    // the plant and its map at x̂, and at x̂_a where (4.22) has it
    let pairs = form.U.iter().zip(&filters);
    let seen = pairs.flat_map(|(U, filter)| U.iter().zip(&filter.x_a).map(|(&u, x)| (u, x.symbol)));
    let seen: HashMap<Node, Node> = seen.collect();
    let at = |expressions: &[Node]| graph.substitute(&copy.at_estimate(expressions), &seen);
    let right = innovations(&copy, &form, &gains, &speed, &filters, &at);
    let Q = numbers(graph, &form.Q, &at);
    let solution = solve(augmented, &Q, &right);
    let f = at(&augmented.derivatives);
    let derivatives = f.iter().zip(&solution.x);
    let mut derivatives: Vec<Node> = derivatives
        .map(|(&f, &x)| (graph.expr(f) + graph.expr(x)).node())
        .collect();
    derivatives.extend(filters.iter().flat_map(|filter| filter.derivatives(graph)));
    let mut observer = copy.observer(derivatives)?.tuned_by([&speed]);
    let x_a = filters.into_iter().flat_map(|filter| filter.x_a);
    observer.states.extend(x_a.zip(gains.filter_start.concat()));
    let matrix = match form.variant {
        Variant::Bounded => "Q",
        Variant::Theoretical | Variant::Practical => "Q̄",
    };
    observer.monitors.push(Monitor {
        name: "rcond".into(),
        node: solution.rcond,
        alarm_below: ALARM,
        meaning: format!(
            "{matrix} is close to singular: the outputs and their derivatives hardly distinguish the states here, and the correction is large or withdrawn"
        ),
        matrix: Some(matrix),
    });
    if form.variant == Variant::Theoretical {
        observer.input_derivatives = input_derivatives(augmented, &form);
    }
    let mut parameters = parameters(augmented, &form, &gains);
    parameters.extend(matrices(augmented, &form, &gains, &observer, matrix, &Q)?);
    Ok(Design {
        notes: notes(augmented, &form, &observer.input_derivatives),
        gains: constant_gains(augmented, &form, &gains, &observer, &Q, solution.alone)?,
        parameters,
        observer,
        examination,
    })
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

/// The filter of an input, empty where there is none.
struct Filter<'g> {
    u: Expr<'g>,
    /// x̂_a
    x_a: Vec<Signal>,
    K2: Vec<Expr<'g>>,
}

fn filters<'g>(augmented: &AugmentedPlant<'g>, gains: &Gains, speed: &Speed) -> Vec<Filter<'g>> {
    let graph = augmented.graph();
    let one = |(j, input): (usize, &Variable)| {
        let K2 = &gains.K2[j];
        let state = |k: usize| {
            let name = format!("filter of {}", derivative_name(&input.name, k));
            let symbol = graph.fresh(&name).node();
            Signal { name, symbol }
        };
        let gain = |(k, &gain): (usize, &f64)| match gains.filter_follows[j] {
            true => speed.scaled(graph, gain, (k + 1) as f64),
            false => graph.constant(gain),
        };
        Filter {
            u: graph.expr(input.node),
            x_a: (0..K2.len()).map(state).collect(),
            K2: K2.iter().enumerate().map(gain).collect(),
        }
    };
    augmented.inputs.iter().enumerate().map(one).collect()
}

impl<'g> Filter<'g> {
    /// K₂(u − C x̂_a)
    fn correction(&self, graph: &'g Graph) -> Vec<Expr<'g>> {
        let each = |&gain: &Expr<'g>| gain * (self.u - graph.expr(self.x_a[0].symbol));
        self.K2.iter().map(each).collect()
    }

    /// x̂_a' = A x̂_a + K₂(u − C x̂_a)
    fn derivatives(&self, graph: &'g Graph) -> Vec<Node> {
        let next = self.x_a.iter().skip(1).map(|x| Some(graph.expr(x.symbol)));
        let pairs = self.correction(graph).into_iter().zip(next.chain([None]));
        let sum = |(correction, next): (Expr<'g>, Option<Expr<'g>>)| match next {
            Some(next) => (next + correction).node(),
            None => correction.node(),
        };
        pairs.map(sum).collect()
    }
}

/// K(y − h(x̂)) and, for (4.22), − Q̄_a K₂(u − C x̂_a).
fn innovations(
    copy: &PlantCopy<'_, '_>,
    form: &Form,
    gains: &Gains,
    speed: &Speed,
    filters: &[Filter<'_>],
    at: &dyn Fn(&[Node]) -> Vec<Node>,
) -> Vec<Node> {
    let augmented = copy.augmented;
    let graph = augmented.graph();
    let hats = copy.hats.iter().map(|hat| hat.symbol);
    let x̂: HashMap<Node, Node> = augmented.symbols().into_iter().zip(hats).collect();
    let outputs = augmented.outputs.iter().zip(&copy.measured);
    let e: Vec<Expr<'_>> = outputs
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
    // an entry per column of Q̄_a; none without a filter
    let e_a: Vec<Expr<'_>> = filters
        .iter()
        .flat_map(|filter| filter.correction(graph))
        .collect();
    let Q_a = numbers(graph, &form.Q_a, at);
    let row = |(place, &(i, k)): (usize, &(usize, usize))| {
        let gain = speed.scaled(graph, gains.K[i][k], (k + 1) as f64);
        let mut sum = gain * e[i];
        let entries = form.Q_a.get(place).into_iter().flatten().enumerate();
        for ((column, entry), &e) in entries.zip(&e_a) {
            if entry.is_some() {
                sum = sum - graph.expr(Q_a[place * e_a.len() + column]) * e;
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
struct Solution {
    x: Vec<Node>,
    rcond: Node,
    /// the same number as an expression that does not read the right-hand side
    alone: Node,
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
    let share = 1.0 - (-ratio.powi(2)).exp();
    let x = solution.x.iter().zip(&scales);
    Solution {
        x: x.map(|(&x, &scale)| (graph.expr(x) * scale * share).node())
            .collect(),
        rcond: solution.rcond,
        alone,
    }
}

/// A typical size of a state's variation.
pub(super) fn scale(state: &Variable) -> f64 {
    let width = state.max - state.min;
    match (width.is_finite() && width > 0.0, state.nominal) {
        (true, _) => width,
        (false, Some(nominal)) if nominal != 0.0 => nominal.abs(),
        _ => 1.0,
    }
}

fn input_derivatives(augmented: &AugmentedPlant<'_>, form: &Form) -> Vec<InputDerivative> {
    let jets = augmented.inputs.iter().zip(&form.U);
    let each = jets.flat_map(|(input, U)| {
        let needed = U.iter().enumerate().skip(1);
        needed.map(|(order, &symbol)| InputDerivative {
            input: input.name.clone(),
            order,
            signal: Signal {
                name: derivative_name(&input.name, order),
                symbol,
            },
        })
    });
    each.collect()
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
        let orders: Vec<usize> = match form.variant {
            Variant::Practical => form.U.iter().map(Vec::len).collect(),
            _ => vec![0; form.U.len()],
        };
        let filter_slowest = -FILTER_SPEED * slowest(&λ);
        let filter_given = settings.filter_poles(&orders)?;
        let filter_follows = filter_given.iter().map(Option::is_none).collect();
        let filter_λ: Vec<Vec<Pole>> = filter_given
            .into_iter()
            .zip(&orders)
            .map(|(given, &order)| given.unwrap_or_else(|| spaced(filter_slowest, order)))
            .collect();
        let start = |(input, &order): (&Variable, &usize)| {
            let zeros = std::iter::repeat(0.0);
            let start = [input.start.unwrap_or(0.0)].into_iter().chain(zeros);
            start.take(order).collect()
        };
        let starts = augmented.inputs.iter().zip(&orders).map(start);
        let given = settings.filter_initial(&orders)?.into_iter();
        let place = |λ: &Vec<Pole>| integrators::place_all(λ);
        Ok(Self {
            K: λ.iter().map(place).collect(),
            K2: filter_λ.iter().map(place).collect(),
            λ,
            filter_λ,
            filter_start: given
                .zip(starts)
                .map(|(given, start)| given.unwrap_or(start))
                .collect(),
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

fn notes(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    derivatives: &[InputDerivative],
) -> Vec<Reason> {
    let mut notes = vec![];
    if form.indices.len() > 1 {
        let names = augmented.outputs.iter().map(|o| o.variable.name.clone());
        notes.push(Said::Indices(names.zip(form.indices.clone()).collect()));
    }
    if !derivatives.is_empty() {
        let names = derivatives.iter().map(|d| d.signal.name.clone());
        notes.push(Said::ExactDerivatives(names.collect()));
    }
    if form.variant == Variant::Bounded && form.has_inputs() {
        notes.push(Said::SmallInputsOnly);
    }
    notes.into_iter().map(Reason::from).collect()
}

/// Q⁻¹K where Q is a matrix of numbers: then the observer is f − Q⁻¹K (ŷ − y). None where
/// Q follows the estimate, or where a filter takes part.
fn constant_gains(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    gains: &Gains,
    observer: &Observer,
    Q: &[Node],
    rcond: Node,
) -> Result<Vec<ChainGain>, DesignError> {
    let graph = augmented.graph();
    let numbers: Option<Vec<f64>> = Q.iter().map(|&q| graph.constant_value(q)).collect();
    let filtered = gains.K2.iter().any(|K2| !K2.is_empty());
    let (Some(numbers), false) = (numbers, filtered) else {
        return Ok(vec![]);
    };
    let whole = at_start(graph, observer, &[rcond])?.is_some_and(|rcond| rcond[0] >= WHOLE);
    let found = whole.then(|| corrections(augmented, form, gains, &numbers));
    Ok(found.flatten().unwrap_or_default())
}

/// Q⁻¹K column by column: what a unit of y − ŷ adds to each state's derivative.
fn corrections(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    gains: &Gains,
    Q: &[f64],
) -> Option<Vec<ChainGain>> {
    let n = form.rows.len();
    let Q = DMatrix::from_row_slice(n, n, Q).lu();
    let outputs = augmented.outputs.iter().enumerate();
    let used = outputs.filter(|(i, _)| form.indices[*i] > 0);
    used.map(|(i, output)| {
        let K = |&(row_of, k): &(usize, usize)| match row_of == i {
            true => gains.K[i][k],
            false => 0.0,
        };
        let column = DVector::from_iterator(n, form.rows.iter().map(K));
        let gain = Q.solve(&column)?;
        if !gain.iter().all(|k| k.is_finite()) {
            return None;
        }
        let states = augmented.states.iter().map(|s| s.name.clone());
        Some(ChainGain {
            output: output.variable.name.clone(),
            entries: states.zip(gain.iter().copied()).collect(),
        })
    })
    .collect()
}

/// The poles and what they give.
fn parameters(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    gains: &Gains,
) -> Vec<(String, ParameterValue)> {
    let mut rows = vec![(
        "variant".to_owned(),
        vec![form.variant.word().to_owned()].into(),
    )];
    let mut add = |names: [String; 2], λ: &[Pole], K: &Vec<f64>| {
        if !λ.is_empty() {
            let [of_λ, of_K] = names;
            let poles: Vec<String> = λ.iter().map(Pole::to_string).collect();
            rows.push((of_λ, poles.into()));
            rows.push((of_K, K.clone().into()));
        }
    };
    let outputs = augmented.outputs.iter().zip(&gains.λ).zip(&gains.K);
    for ((output, λ), K) in outputs {
        let y = &output.variable.name;
        add([format!("λ of {y}"), format!("K of {y}")], λ, K);
    }
    let inputs = augmented.inputs.iter().zip(&gains.filter_λ).zip(&gains.K2);
    for ((input, λ), K2) in inputs {
        let u = &input.name;
        let names = ["λ", "K2"].map(|what| format!("{what} of the filter of {u}"));
        add(names, λ, K2);
    }
    for found in &gains.lemma {
        rows.push(("σ of Lemma 3.2".to_owned(), found.σ.into()));
        rows.push(("√cn(P)".to_owned(), found.peaking.into()));
    }
    rows
}

/// The matrix of the paper as an expression of the estimate and at its start.
fn matrices(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    gains: &Gains,
    observer: &Observer,
    name: &str,
    Q: &[Node],
) -> Result<Vec<(String, ParameterValue)>, DesignError> {
    let graph = augmented.graph();
    let mut rows = vec![];
    for (&(i, k), entries) in form.rows.iter().zip(Q.chunks(form.rows.len().max(1))) {
        let y = derivative_name(&augmented.outputs[i].variable.name, k);
        let entries: Vec<String> = entries.iter().map(|&q| graph.render(q, WIDTH)).collect();
        rows.push((format!("{name}, row {y}"), entries.into()));
    }
    let start = at_start(graph, observer, Q)?;
    let found = start.and_then(|start| corrections(augmented, form, gains, &start));
    for gain in found.unwrap_or_default() {
        let column: Vec<f64> = gain.entries.iter().map(|e| e.1).collect();
        rows.push((
            format!("{name}⁻¹K of {} at the start", gain.output),
            column.into(),
        ));
    }
    Ok(rows)
}

/// The values where the observer starts; none where they depend on more than its states.
fn at_start(
    graph: &Graph,
    observer: &Observer,
    nodes: &[Node],
) -> Result<Option<Vec<f64>>, DesignError> {
    let (symbols, start): (Vec<Node>, Vec<f64>) = observer
        .states
        .iter()
        .map(|(signal, start)| (signal.symbol, *start))
        .unzip();
    if graph.symbols_of(nodes).iter().any(|s| !symbols.contains(s)) {
        return Ok(None);
    }
    let mut values = vec![0.0; nodes.len()];
    Tape::new(graph, &symbols, nodes)?
        .evaluator()
        .eval(&start, &mut values);
    Ok(values.iter().all(|v| v.is_finite()).then_some(values))
}
