//! Observer (14) from a form.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Node};
use lynkeus_gain::integrators;
use lynkeus_structure::{Extended, Matrix};

use super::NAME;
use super::bound::{self, Choice};
use super::form::Form;
use super::matrices::Matrices;
use super::settings::{Settings, Thetas};
use crate::estimate::{Copy, limited};
use crate::matrices::Start;
use crate::tunable::Speed;
use crate::{Design, DesignError, Examination};

pub(super) fn design(
    extended: &Extended<'_>,
    settings: &Settings,
    form: &Form<'_, '_>,
    examination: Examination,
) -> Result<Design, DesignError> {
    let chosen = match settings.thetas.clone()? {
        Some(thetas) => Choice::given(thetas),
        None => bound::thetas(form)?,
    };
    let copy = Copy::new(extended, &settings.common);
    let thetas = chosen.thetas;
    let speeds = Speeds::new(&copy, &thetas);
    let derivatives = derivatives(form, &copy, settings, &speeds);
    let start = Start::new(&copy)?;
    let matrices = Matrices::new(form, thetas);
    Ok(Design {
        observer: copy
            .observer(NAME, derivatives)?
            .tuned_by([&speeds.θ1, &speeds.θ2]),
        gains: matrices.gains(&start)?,
        parameters: matrices.parameters(&start)?,
        notes: chosen.notes,
        examination,
    })
}

/// θ₁ and θ₂ of the observer.
struct Speeds {
    θ1: Speed,
    θ2: Speed,
}

impl Speeds {
    fn new(copy: &Copy<'_, '_>, thetas: &Thetas) -> Self {
        let speed = |place: usize, value: f64, of: &str| {
            Speed::new(
                copy,
                format!("theta[{place}]"),
                value,
                format!("θ{place}, of {of}"),
            )
        };
        Self {
            θ1: speed(
                1,
                thetas.θ1,
                "the unknown inputs and of the outputs that show them",
            ),
            θ2: speed(2, thetas.θ2, "the other states"),
        }
    }
}

/// The right-hand side of (14), in the order of the extended states.
fn derivatives(
    form: &Form<'_, '_>,
    copy: &Copy<'_, '_>,
    settings: &Settings,
    Speeds { θ1, θ2 }: &Speeds,
) -> Vec<Node> {
    let extended = form.extended;
    let (graph, n) = (extended.graph(), extended.plant_states());
    let v: Vec<Node> = extended.symbols().split_off(n);
    let v̂ = column(graph, &copy.at_estimate(&v));
    // s: the measured signals in place of the states they show
    let measured: HashMap<Node, Node> = (0..extended.outputs.len())
        .filter_map(|i| copy.measured_state(i))
        .map(|(state, y)| (extended.states[state].node, y))
        .collect();
    let factors = &form.layers.factors;
    let at_s = factors.map(|node| graph.substitute(&[node], &measured)[0]);
    let e1 = column(graph, &innovations(copy, &form.first));
    let e2 = column(graph, &innovations(copy, &form.second));
    let drift = copy.at_estimate(&form.layers.drift);
    let input = at_s.times(&v̂);
    let mut total: Vec<Expr<'_>> = (0..n)
        .map(|i| graph.expr(drift[i]) + graph.expr(input.node(i, 0)))
        .collect();

    let twice = |θ: &Speed| θ.scaled(graph, 2.0 * θ.value(), 1.0);
    for (row, &state) in form.x11().iter().enumerate() {
        total[state] = total[state] - twice(θ1) * graph.expr(e1.node(row, 0));
    }
    // D (9) at s; G at s makes left inverses and products at s
    let at_measured = Form {
        layers: lynkeus_structure::Layers {
            factors: at_s,
            ..form.layers.clone()
        },
        ..form.clone()
    };
    let D_e1: Vec<Matrix<'_>> = (1..=form.q())
        .map(|k| at_measured.γ_times(k, &e1))
        .collect();
    let Λ2 = at_tilde(&at_measured, copy, settings, &measured, &D_e1);
    let K = integrators::Chain::new(form.q()).gain;
    for k in 1..=form.q() {
        let correction = Λ2[k - 1].left_divide(&e2);
        let gain = θ2.value().powi(k as i32) * K[k - 1];
        let gain = θ2.scaled(graph, gain, k as f64);
        for (row, &state) in form.block(k).iter().enumerate() {
            total[state] = total[state]
                - gain * graph.expr(correction.node(row, 0))
                - twice(θ1) * graph.expr(D_e1[k - 1].node(row, 0));
        }
    }
    let v_correction = at_measured.G11().left_divide(&e1);
    let squared = θ1.scaled(graph, -(θ1.value() * θ1.value()), 2.0);
    total.extend((0..v.len()).map(|j| squared * graph.expr(v_correction.node(j, 0))));
    total.into_iter().map(Expr::node).collect()
}

fn column<'g>(graph: &'g lynkeus_expr::Graph, entries: &[Node]) -> Matrix<'g> {
    Matrix::from_fn(graph, (entries.len(), 1), |i, _| Some(entries[i]))
}

/// x̂ − y for some measured outputs. The form has only outputs that show a state.
fn innovations(copy: &Copy<'_, '_>, outputs: &[usize]) -> Vec<Node> {
    let innovations = outputs.iter().filter_map(|&i| copy.innovation(i));
    innovations.collect()
}

/// Λ₂ at x₁¹ = y₁ and X̃² = X̂² − D (x̂₁¹ − y₁).
fn at_tilde<'p>(
    form: &Form<'_, 'p>,
    copy: &Copy<'_, '_>,
    settings: &Settings,
    measured: &HashMap<Node, Node>,
    D_e1: &[Matrix<'_>],
) -> Vec<Matrix<'p>> {
    let extended = form.extended;
    let graph = extended.graph();
    let mut seen = HashMap::new();
    for state in form.x11() {
        let x = extended.states[state].node;
        seen.insert(x, measured.get(&x).copied().unwrap_or(x));
    }
    for k in 1..=form.q() {
        for (row, &state) in form.block(k).iter().enumerate() {
            let hat = graph.expr(copy.hats[state].symbol);
            let tilde = (hat - graph.expr(D_e1[k - 1].node(row, 0))).node();
            let variable = &extended.states[state];
            let image = match settings.common.clamp {
                true => limited(graph, tilde, variable),
                false => tilde,
            };
            seen.insert(variable.node, image);
        }
    }
    let blocks = form.Λ2().into_iter();
    blocks
        .map(|block| block.map(|node| graph.substitute(&[node], &seen)[0]))
        .collect()
}
