//! The form of the paper in a plant: the map Φ̄ with its Jacobians, which derivative of which
//! output an input enters, and the conditions: Q and Q̄ are regular on the box.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Op, Spent};
use lynkeus_structure::output_map::{AffineForm, Degree, Rows};
use lynkeus_structure::{
    AugmentedPlant, Dimension, Finding, Matrix, Measurement, Region, Verdict, output_map, rank,
    regularity,
};

use super::said::Said;
use super::settings::{Settings, Variant};
use crate::conditions::{lasts, lipschitz, names};
use crate::design::Found;
use crate::paper::Settings as _;
use crate::statement::{sufficient, undecided};
use crate::{Check, DesignError, Examination, Germani, Reason, Statement};

/// Operations of the map that a second is enough for, with what is decided of them: measured on
/// chains of 20 to 100 states, generously.
const PER_SECOND: f64 = 400_000.0;

/// Bytes per operation, measured likewise.
const BYTES: f64 = 100.0;

/// Halvings, on a logarithmic scale, of the search for Ū.
const HALVINGS: usize = 14;

/// Ū beyond which inputs are taken for as large as one likes.
const ANY: f64 = 1e6;

/// What does not depend on how many derivatives of which output count.
pub(super) struct Map<'s> {
    affine: AffineForm,
    /// L_f^k h_i: output by output, k = 0 … n − 1
    lie: Vec<Vec<Node>>,
    /// ∂L_f^k h_i/∂x
    pub gradients: Vec<Rows>,
    /// symbols of u_j', u_j'', … for each known input, n of them
    slopes: Vec<Vec<Node>>,
    /// the right-hand side is Lipschitz
    lipschitz: Check,
    settings: &'s Settings,
}

impl<'s> Map<'s> {
    pub fn new(
        augmented: &AugmentedPlant<'_>,
        settings: &'s Settings,
        region: &Region,
    ) -> Result<Self, DesignError> {
        let affine = match output_map::affine_form(augmented)? {
            Ok(affine) => affine,
            Err(why) => return Err(unfit(Reason::from(why)).into()),
        };
        affordable(augmented, &affine)?;
        let order = augmented.states.len().saturating_sub(1);
        let lie = output_map::lie_derivatives(augmented, &affine, order)?;
        let gradients = output_map::lie_gradients(augmented, &affine, order)?;
        lasts(augmented)?;
        Ok(Self {
            affine,
            gradients,
            lie,
            slopes: slopes(augmented),
            lipschitz: lipschitz(augmented, region)?,
            settings,
        })
    }
}

/// The map of a plant with the facts about it.
pub struct Form {
    pub variant: Variant,
    /// (output, order of the derivative) of each row, chain by chain
    pub rows: Vec<(usize, usize)>,
    /// μ_i: how many derivatives of each output count, from order 0
    pub indices: Vec<usize>,
    /// symbols of u_j, u_j', … on which Φ̄ depends: n − r of them for one output
    pub U: Vec<Vec<Node>>,
    /// the same with one derivative more
    pub further: Vec<Vec<Node>>,
    /// Q or, for (4.1) and (4.22), Q̄
    pub Q: Rows,
    /// Q̄_a, columns in the order of `U`; empty for (3.1)
    pub Q_a: Rows,
}

impl Form {
    /// Whether Φ̄ reads inputs.
    pub fn has_inputs(&self) -> bool {
        self.U.iter().any(|jet| !jet.is_empty())
    }

    /// Whether the map reads inputs.
    pub fn reads_inputs(&self) -> bool {
        self.variant != Variant::Bounded && self.has_inputs()
    }

    /// With μ_i derivatives of output i, Σμ_i = n.
    pub(super) fn new(
        augmented: &AugmentedPlant<'_>,
        map: &Map<'_>,
        indices: &[usize],
        region: &Region,
    ) -> Result<Found<Self>, DesignError> {
        let degrees = degrees(augmented, map, indices, region)?;
        let orders = orders(augmented, indices, &degrees);
        let U = jets(augmented, map, &orders);
        let orders: Vec<usize> = orders.iter().map(|order| order + 1).collect();
        let each = indices.iter().enumerate();
        let rows: Vec<(usize, usize)> = each
            .flat_map(|(i, &μ)| (0..μ).map(move |k| (i, k)))
            .collect();
        let gradient = |&(i, k): &(usize, usize)| map.gradients[i][k].clone();
        let mut form = Self {
            variant: map.settings.variant.unwrap_or_else(|| Variant::suited(&U)),
            indices: indices.to_vec(),
            further: jets(augmented, map, &orders),
            U,
            Q: rows.iter().map(gradient).collect(),
            Q_a: vec![],
            rows,
        };
        lasts(augmented)?;
        let regular = regular(augmented, &form.Q, region)?;
        lasts(augmented)?;
        let mut Φ: Vec<Node> = form.rows.iter().map(|&(i, k)| map.lie[i][k]).collect();
        let one_to_one = one_to_one(augmented, &Φ, regular.is_proved(), region)?;
        lasts(augmented)?;
        if form.variant != Variant::Bounded {
            (Φ, form.Q, form.Q_a) = with_inputs(augmented, &form.rows, &form.U)?;
        }
        // the map is followed along the plant: as states, inputs and time move
        let slopes = map.settings.known_slopes(augmented, &form.U);
        let moving = with_slopes(augmented, &form.U, &slopes, region);
        let continuous = regularity(augmented.graph(), &Φ, &moving.symbols(), &moving)?;
        let mut checks = vec![
            known(augmented, indices, &degrees),
            Statement::from(Germani::Regular).with(regular),
            Statement::from(Germani::OneToOne).with(one_to_one),
            map.lipschitz.clone(),
            Statement::from(Germani::Continuous).with(continuous),
        ];
        if form.has_inputs() {
            checks.push(form.of_inputs(augmented, &slopes, region)?.advisory());
        }
        let every: Vec<usize> = (0..augmented.states.len()).collect();
        let (summary, chains) = (form.summary(augmented), vec![names(augmented, &every)]);
        let examination =
            Examination::new(augmented, region, Settings::FAMILY, summary, chains, checks)?;
        Ok(Found { form, examination })
    }

    fn summary(&self, augmented: &AugmentedPlant<'_>) -> Said {
        let y = |i: usize| &augmented.outputs[i].variable.name;
        let rows = self.rows.iter();
        let inputs = augmented.inputs.iter().zip(&self.U);
        Said::Form {
            variant: self.variant.word(),
            map: rows.map(|&(i, k)| derivative_name(y(i), k)).collect(),
            inputs: inputs
                .flat_map(|(input, jet)| (0..jet.len()).map(|k| derivative_name(&input.name, k)))
                .collect(),
            indices: self.indices.clone(),
            others: vec![],
        }
    }

    /// What the observer needs of the inputs where the map reads them; `slopes` bound |u'|, |u''|, …
    /// as far as they are declared. Advisory: Q̄ is regular for small enough inputs whatever the box
    /// says (Theorem 2.4), and the observer watches it.
    fn of_inputs(
        &self,
        augmented: &AugmentedPlant<'_>,
        slopes: &[Vec<f64>],
        region: &Region,
    ) -> Result<Check, DesignError> {
        if self.variant == Variant::Bounded {
            return Ok(undecided(Germani::SmallInput, Said::InputsNotCounted));
        }
        let (mut statement, mut bounds) = (Germani::UniformlyObservable, vec![]);
        // a singular point for a constant input is the better witness
        let still = self.still(augmented.graph());
        let mut found = regular(augmented, &at(augmented.graph(), &self.Q, &still), region)?;
        if !matches!(found.verdict, Verdict::Refuted(_)) && !still.is_empty() {
            let wider = with_slopes(augmented, &self.U, slopes, region);
            found = regular(augmented, &self.Q, &wider)?;
            bounds = self.declared(augmented, slopes);
            if !bounds.is_empty() {
                statement = Germani::RegularWithin;
            }
        }
        let said = Said::Inputs {
            reason: found.reason.clone(),
            bounds,
            is_proved: found.is_proved(),
        };
        Ok(Statement::from(statement).found(found.verdict, said))
    }

    /// The bounds of the derivatives that Q̄ reads.
    fn declared(&self, augmented: &AugmentedPlant<'_>, slopes: &[Vec<f64>]) -> Vec<(String, f64)> {
        let jets = augmented.inputs.iter().zip(&self.U).zip(slopes);
        let each = jets.flat_map(|((input, jet), bounds)| {
            let read = bounds.iter().take(jet.len().saturating_sub(1));
            let each = read.enumerate();
            each.map(|(k, bound)| (derivative_name(&input.name, k + 1), *bound))
        });
        each.collect()
    }

    /// Ū of Theorem 2.4: the largest radius, to a few thousandths of its size, for which Q̄ is proved regular on
    /// the box of the states for all |u|, |u'|, … ≤ Ū; none where even the smallest inputs leave it undecided.
    pub fn largest_inputs(
        &self,
        augmented: &AugmentedPlant<'_>,
        region: &Region,
    ) -> Result<Option<f64>, DesignError> {
        let holds = |radius: f64| -> Result<bool, DesignError> {
            let mut region = region.clone();
            let is_input = |symbol: Node| augmented.inputs.iter().any(|u| u.node == symbol);
            let sides = region.dimensions.iter_mut();
            for side in sides.filter(|side| is_input(side.symbol)) {
                (side.min, side.max) = (-radius, radius);
            }
            let jets = self.U.iter();
            let slopes: Vec<Vec<f64>> = jets.map(|jet| vec![radius; jet.len()]).collect();
            let region = with_slopes(augmented, &self.U, &slopes, &region);
            Ok(regular(augmented, &self.Q, &region)?.is_proved())
        };
        let (mut low, mut high) = (1e-6, ANY);
        if !holds(low)? {
            return Ok(None);
        }
        if holds(high)? {
            return Ok(Some(f64::INFINITY));
        }
        for _ in 0..HALVINGS {
            let middle = f64::sqrt(low * high);
            match holds(middle)? {
                true => low = middle,
                false => high = middle,
            }
        }
        Ok(Some(low))
    }

    /// u', u'', … ↦ 0
    fn still(&self, graph: &Graph) -> HashMap<Node, Node> {
        let zero = graph.constant(0.0).node();
        let slopes = self.U.iter().flat_map(|jet| jet.iter().skip(1));
        slopes.map(|&symbol| (symbol, zero)).collect()
    }
}

/// A matrix at other values of its symbols.
fn at(graph: &Graph, Q: &Rows, images: &HashMap<Node, Node>) -> Rows {
    let entry = |e: &Option<Node>| Some(graph.substitute(&[(*e)?], images)[0]);
    let row = |row: &Vec<Option<Node>>| row.iter().map(entry).collect();
    Q.iter().map(row).collect()
}

pub(super) fn unfit(summary: impl Into<Reason>) -> Examination {
    Examination::unfit(Settings::FAMILY, summary, vec![])
}

/// Φ̄, and Q̄ and Q̄_a of (4.20).
fn with_inputs(
    augmented: &AugmentedPlant<'_>,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> Result<(Vec<Node>, Rows, Rows), DesignError> {
    let graph = augmented.graph();
    let order = rows.iter().map(|r| r.1).max().unwrap_or(0);
    let y = output_map::output_derivatives(augmented, U, order)?;
    lasts(augmented)?;
    let Φ̄: Vec<Node> = rows.iter().map(|&(i, k)| y[i][k]).collect();
    let Q̄ = output_map::jacobian_rows(graph, &Φ̄, &augmented.symbols());
    let Q̄_a = output_map::jacobian_rows(graph, &Φ̄, &U.concat());
    Ok((Φ̄, Q̄, Q̄_a))
}

/// r_ij of output i with respect to input j, for indices μ.
fn degrees(
    augmented: &AugmentedPlant<'_>,
    map: &Map<'_>,
    μ: &[usize],
    region: &Region,
) -> Result<Vec<Vec<Degree>>, DesignError> {
    let of = |gradients: &[Rows], region: &Region| -> Result<Vec<Vec<Degree>>, DesignError> {
        let mut all = vec![];
        for (rows, &μ) in gradients.iter().zip(μ) {
            let rows = &rows[..μ];
            let of_input = |j| output_map::relative_degree(augmented, rows, &map.affine, j, region);
            let row: Result<Vec<Degree>, _> = (0..augmented.inputs.len()).map(of_input).collect();
            all.push(row?);
        }
        Ok(all)
    };
    let found = of(&map.gradients, region)?;
    let early = found
        .iter()
        .zip(μ)
        .any(|(row, &μ)| row.iter().any(|d| d.r < μ));
    if augmented.inputs.len() < 2 || !early {
        return Ok(found);
    }
    // an input that enters early may bring another one along
    let order = μ.iter().copied().max().unwrap_or(0);
    let orders = vec![order; augmented.inputs.len()];
    let U = jets(augmented, map, &orders);
    let y = output_map::output_derivatives(augmented, &U, order.saturating_sub(1))?;
    let x = augmented.symbols();
    let gradients: Vec<Rows> = y
        .iter()
        .map(|y| output_map::jacobian_rows(augmented.graph(), y, &x))
        .collect();
    of(
        &gradients,
        &with_slopes(augmented, &U, &augmented.input_derivatives, region),
    )
}

/// How many of u_j, u_j', … Φ̄ depends on: for one output n − r.
fn orders(
    augmented: &AugmentedPlant<'_>,
    indices: &[usize],
    degrees: &[Vec<Degree>],
) -> Vec<usize> {
    let needed = |j: usize| {
        let pairs = indices.iter().zip(degrees);
        let orders = pairs.map(|(μ, d)| μ.saturating_sub(d[j].r));
        orders.max().unwrap_or(0)
    };
    (0..augmented.inputs.len()).map(needed).collect()
}

/// The symbols of u_j, u_j', …, so many of each input.
fn jets(augmented: &AugmentedPlant<'_>, map: &Map<'_>, orders: &[usize]) -> Vec<Vec<Node>> {
    let whole = augmented.inputs.iter().zip(&map.slopes);
    let whole = whole.map(|(input, slopes)| std::iter::once(input.node).chain(slopes.clone()));
    whole
        .zip(orders)
        .map(|(jet, &order)| jet.take(order).collect())
        .collect()
}

/// Symbols of u_j', u_j'', …, as many as there are states, for each known input.
fn slopes(augmented: &AugmentedPlant<'_>) -> Vec<Vec<Node>> {
    let graph = augmented.graph();
    let symbol = |name: &str, k: usize| graph.fresh(format!("derivative {k} of {name}")).node();
    let orders = 1..=augmented.states.len();
    let one =
        |input: &lynkeus_model::Variable| orders.clone().map(|k| symbol(&input.name, k)).collect();
    augmented.inputs.iter().map(one).collect()
}

/// The box with u', u'', … within their bounds, which are those of each input's own list, and free
/// beyond its end.
pub(super) fn with_slopes(
    augmented: &AugmentedPlant<'_>,
    U: &[Vec<Node>],
    bounds: &[Vec<f64>],
    region: &Region,
) -> Region {
    let mut region = region.clone();
    for ((input, jet), bounds) in augmented.inputs.iter().zip(U).zip(bounds) {
        let further = jet.iter().enumerate().skip(1).map(|(k, &symbol)| {
            let bound = bounds.get(k - 1).copied().unwrap_or(f64::INFINITY);
            Dimension::new(derivative_name(&input.name, k), symbol, -bound, bound)
        });
        region.dimensions.extend(further);
    }
    region
}

/// Definition 2.2, with the zeros proved or not.
fn known(augmented: &AugmentedPlant<'_>, indices: &[usize], degrees: &[Vec<Degree>]) -> Check {
    let used = degrees.iter().zip(&augmented.outputs).zip(indices);
    let used = used.filter(|(_, μ)| **μ > 0);
    let name = |output: &Measurement| output.variable.name.clone();
    let found: Vec<(String, Degree)> = used
        .flat_map(|((row, output), _)| row.iter().map(|r| (name(output), r.clone())))
        .collect();
    let are_proved = found.iter().all(|(_, degree)| degree.proved);
    sufficient(
        Germani::Degree,
        are_proved,
        Said::Degrees { found, are_proved },
    )
}

/// Refuses a map that the budget is not enough for.
///
/// # Errors
/// How many operations it would have.
fn affordable(augmented: &AugmentedPlant<'_>, form: &AffineForm) -> Result<(), DesignError> {
    let budget = augmented.graph().budget();
    let operations = operations(augmented, form);
    let time = budget.left().map(|left| left.as_secs_f64() * PER_SECOND);
    let room = budget.room().map(|room| room as f64 / BYTES);
    match time.into_iter().chain(room).all(|most| operations <= most) {
        true => Ok(()),
        false => Err(DesignError::Spent(Spent::Size(operations as u64))),
    }
}

/// Of n derivatives of the outputs with their slopes by n states: the k-th coefficient of a
/// product of series has k products.
fn operations(augmented: &AugmentedPlant<'_>, form: &AffineForm) -> f64 {
    let n = augmented.states.len() as f64;
    let graph = augmented.graph();
    let outputs = augmented.outputs.iter().map(|o| o.variable.node);
    let roots: Vec<Node> = form.drift.iter().copied().chain(outputs).collect();
    let cost = |node: &Node| match graph.op(*node) {
        Op::Constant(_) | Op::Symbol(_) => 0.0,
        op if is_linear(graph, op) => n,
        _ => 0.5 * n * n,
    };
    n * graph.reachable(&roots).iter().map(cost).sum::<f64>()
}

/// Whether a coefficient of the result costs the same at every order.
fn is_linear(graph: &Graph, op: Op) -> bool {
    let is_number = |node: Node| matches!(graph.op(node), Op::Constant(_));
    match op {
        Op::Unary(lynkeus_expr::Unary::Neg, _) => true,
        Op::Binary(Binary::Add | Binary::Sub, ..) => true,
        Op::Binary(Binary::Mul, a, b) => is_number(a) || is_number(b),
        Op::Binary(Binary::Div, _, b) => is_number(b),
        _ => false,
    }
}

/// The entries of a matrix of this size; those that its rows lack are zero.
pub(super) fn matrix<'g>(graph: &'g Graph, rows: &Rows, size: (usize, usize)) -> Matrix<'g> {
    Matrix::from_fn(graph, size, |i, j| {
        rows.get(i).and_then(|row| *row.get(j)?)
    })
}

/// Whether a square matrix is regular on the whole region.
pub(super) fn regular(
    augmented: &AugmentedPlant<'_>,
    Q: &Rows,
    region: &Region,
) -> Result<Finding, DesignError> {
    let Q = matrix(augmented.graph(), Q, (Q.len(), Q.len()));
    Ok(rank::regular(&Q, region)?)
}

/// Whether Φ is one-to-one on the whole region.
fn one_to_one(
    augmented: &AugmentedPlant<'_>,
    Φ: &[Node],
    is_regular: bool,
    region: &Region,
) -> Result<Finding, DesignError> {
    let states = augmented.symbols();
    let map = lynkeus_structure::one_to_one::Map {
        graph: augmented.graph(),
        functions: Φ,
        states: &states,
        region,
    };
    let found = map.one_to_one(&vec![false; states.len()], is_regular)?;
    Ok(found.finding)
}

/// y, y', y'', y^(3), …
pub(super) fn derivative_name(name: &str, order: usize) -> String {
    match order {
        0..=2 => format!("{name}{}", "'".repeat(order)),
        _ => format!("{name}^({order})"),
    }
}
