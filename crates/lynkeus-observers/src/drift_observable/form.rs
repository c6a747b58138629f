//! The form of the paper in a plant: the map Φ̄ with its Jacobians, which derivative of which
//! output an input enters, and the conditions: Q and Q̄ are regular on the box.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Op, Spent};
use lynkeus_structure::output_map::{AffineForm, Degree, Rows};
use lynkeus_structure::{
    AugmentedPlant, Dimension, Matrix, Region, Verdict, output_map, regularity, short,
};

use super::settings::{Settings, Variant};
use crate::conditions::{lasts, lipschitz, names};
use crate::design::Found;
use crate::statement::{sufficient, undecided};
use crate::{Check, DesignError, Examination, Germani, Statement};

pub(super) const NAME: &str = "drift-observable";

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
    pub affine: AffineForm,
    /// L_f^k h_i: output by output, k = 0 … n − 1
    lie: Vec<Vec<Node>>,
    /// ∂L_f^k h_i/∂x
    pub gradients: Vec<Rows>,
    /// symbols of u_j', u_j'', … for each known input, n of them
    pub slopes: Vec<Vec<Node>>,
    /// the right-hand side is Lipschitz
    lipschitz: Check,
    settings: &'s Settings,
}

impl<'s> Map<'s> {
    /// Inside: what breaks the form.
    pub fn new(
        augmented: &AugmentedPlant<'_>,
        settings: &'s Settings,
        region: &Region,
    ) -> Result<Result<Self, Examination>, DesignError> {
        let affine = match output_map::affine_form(augmented)? {
            Ok(affine) => affine,
            Err(why) => return Ok(Err(unfit(why))),
        };
        affordable(augmented, &affine)?;
        let order = augmented.states.len().saturating_sub(1);
        let lie = output_map::lie_derivatives(augmented, &affine, order)?;
        let gradients = output_map::lie_gradients(augmented, &affine, order)?;
        lasts(augmented)?;
        Ok(Ok(Self {
            affine,
            gradients,
            lie,
            slopes: slopes(augmented),
            lipschitz: lipschitz(augmented, region)?,
            settings,
        }))
    }
}

/// The conditions, each by what it is about.
#[derive(Clone)]
pub struct Checks {
    /// Definition 2.2
    pub degree: Check,
    /// drift-observability: Q is regular
    pub regular: Check,
    /// Φ tells points far apart as well
    pub one_to_one: Check,
    /// ∂f/∂x is bounded
    pub lipschitz: Check,
    /// the map has values and does not jump
    pub continuous: Check,
    /// what the observer needs of the inputs, where the map reads them. Advisory: Q̄ is
    /// regular for small enough inputs whatever the box says (Theorem 2.4), and the observer
    /// watches it
    pub inputs: Option<Check>,
}

impl Checks {
    pub fn all(&self) -> Vec<Check> {
        let first = [
            &self.degree,
            &self.regular,
            &self.one_to_one,
            &self.lipschitz,
            &self.continuous,
        ];
        first.into_iter().chain(&self.inputs).cloned().collect()
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
    /// the derivative of each input that is one order further
    pub w: Vec<Node>,
    /// Q or, for (4.1) and (4.22), Q̄
    pub Q: Rows,
    /// Q̄_a, columns in the order of `U`; empty for (3.1)
    pub Q_a: Rows,
    pub checks: Checks,
}

impl Form {
    /// Whether the map reads inputs.
    pub fn reads_inputs(&self) -> bool {
        self.variant != Variant::Bounded && self.U.iter().any(|jet| !jet.is_empty())
    }

    /// With μ_i derivatives of output i, Σμ_i = n.
    pub(super) fn new(
        augmented: &AugmentedPlant<'_>,
        map: &Map<'_>,
        indices: Vec<usize>,
        region: &Region,
    ) -> Result<Found<Self>, DesignError> {
        let degrees = degrees(augmented, map, &indices, region)?;
        let U = input_symbols(augmented, map, &indices, &degrees);
        let variant = map.settings.variant.unwrap_or_else(|| Variant::suited(&U));
        let rows: Vec<(usize, usize)> = indices
            .iter()
            .enumerate()
            .flat_map(|(i, &μ)| (0..μ).map(move |k| (i, k)))
            .collect();
        let Q: Rows = rows
            .iter()
            .map(|&(i, k)| map.gradients[i][k].clone())
            .collect();
        lasts(augmented)?;
        let regular = regular(augmented, Germani::Regular, &Q, region)?;
        lasts(augmented)?;
        let Φ: Vec<Node> = rows.iter().map(|&(i, k)| map.lie[i][k]).collect();
        let one_to_one = one_to_one(augmented, &Φ, &regular, region)?;
        lasts(augmented)?;
        let (Φ, Q, Q_a) = match variant {
            Variant::Bounded => (Φ, Q, vec![]),
            _ => with_inputs(augmented, &rows, &U)?,
        };
        // the map is followed along the plant: as states, inputs and time move
        let slopes = map.settings.known_slopes(augmented, &U);
        let moving = with_slopes(augmented, &U, &slopes, region);
        let continuous = regularity(augmented.graph(), &Φ, &moving.symbols(), &moving)?;
        let reads = U.iter().any(|jet| !jet.is_empty());
        let inputs = Inputs {
            augmented,
            U: &U,
            slopes: &slopes,
            Q̄: &Q,
            region,
        };
        let checks = Checks {
            degree: known(augmented, &indices, &degrees),
            regular,
            one_to_one,
            lipschitz: map.lipschitz.clone(),
            continuous: Statement::from(Germani::Continuous).with(continuous),
            inputs: match reads {
                true => Some(inputs.check(variant)?.advisory()),
                false => None,
            },
        };
        let every: Vec<usize> = (0..augmented.states.len()).collect();
        let summary = summary(augmented, variant, &rows, &U);
        let chains = vec![names(augmented, &every)];
        let examination = Examination::new(augmented, region, NAME, summary, chains, checks.all())?;
        let next = map.slopes.iter().zip(&U);
        let form = Self {
            variant,
            rows,
            indices,
            w: next
                .filter_map(|(slopes, U)| slopes.get(U.len().saturating_sub(1)).copied())
                .collect(),
            U,
            Q,
            Q_a,
            checks,
        };
        Ok(Found { form, examination })
    }
}

pub(super) fn unfit(summary: String) -> Examination {
    Examination::unfit(NAME, summary, vec![])
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

fn summary(
    augmented: &AugmentedPlant<'_>,
    variant: Variant,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> String {
    let y = |&(i, k): &(usize, usize)| derivative_name(&augmented.outputs[i].variable.name, k);
    let map: Vec<String> = rows.iter().map(y).collect();
    let u = augmented
        .inputs
        .iter()
        .zip(U)
        .flat_map(|(input, jet)| (0..jet.len()).map(|k| derivative_name(&input.name, k)));
    let u: Vec<String> = u.collect();
    let inputs = match u.is_empty() {
        true => "free of the inputs (r = n)".to_owned(),
        false => format!("which read {}", u.join(", ")),
    };
    format!(
        "the state from {}, {inputs}; variant {}",
        map.join(", "),
        variant.word()
    )
}

/// r_ij of output i with respect to input j, for indices μ.
pub(super) fn degrees(
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

/// u_j, u_j', …, as many as Φ̄ depends on: for one output n − r.
pub(super) fn input_symbols(
    augmented: &AugmentedPlant<'_>,
    map: &Map<'_>,
    indices: &[usize],
    degrees: &[Vec<Degree>],
) -> Vec<Vec<Node>> {
    let needed = |j: usize| {
        let pairs = indices.iter().zip(degrees);
        let orders = pairs.map(|(μ, d)| μ.saturating_sub(d[j].r));
        orders.max().unwrap_or(0)
    };
    let orders: Vec<usize> = (0..augmented.inputs.len()).map(needed).collect();
    jets(augmented, map, &orders)
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
pub(super) fn slopes(augmented: &AugmentedPlant<'_>) -> Vec<Vec<Node>> {
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
            Dimension {
                name: derivative_name(&input.name, k),
                symbol,
                min: -bound,
                max: bound,
                integer: false,
            }
        });
        region.dimensions.extend(further);
    }
    region
}

/// Definition 2.2, with the zeros proved or not.
pub(super) fn known(
    augmented: &AugmentedPlant<'_>,
    indices: &[usize],
    degrees: &[Vec<Degree>],
) -> Check {
    let mut found = vec![];
    let mut proved = true;
    for (i, row) in degrees.iter().enumerate().filter(|(i, _)| indices[*i] > 0) {
        let y = &augmented.outputs[i].variable.name;
        for degree in row {
            proved &= degree.proved;
            found.push(format!("{y}: r = {}, {}", degree.r, degree.detail));
        }
    }
    if found.is_empty() {
        found.push("no known input".to_owned());
    }
    if !proved {
        found.push("zeros before r are found at points, not proved".to_owned());
    }
    sufficient(Germani::Degree, proved, found.join("; "))
}

/// Refuses a map that the budget is not enough for.
///
/// # Errors
/// How many operations it would have.
pub(super) fn affordable(
    augmented: &AugmentedPlant<'_>,
    form: &AffineForm,
) -> Result<(), DesignError> {
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

/// Whether a square matrix is regular on the whole region.
pub(super) fn regular(
    augmented: &AugmentedPlant<'_>,
    statement: Germani,
    Q: &Rows,
    region: &Region,
) -> Result<Check, DesignError> {
    let n = Q.len();
    let Q = Matrix::from_fn(augmented.graph(), (n, n), |i, j| {
        Q.get(i).and_then(|row| *row.get(j)?)
    });
    Ok(Statement::from(statement).with(lynkeus_structure::rank::regular(&Q, region)?))
}

/// Whether Φ, whose Jacobian was found `regular` or not, is one-to-one on the whole region.
pub(super) fn one_to_one(
    augmented: &AugmentedPlant<'_>,
    Φ: &[Node],
    regular: &Check,
    region: &Region,
) -> Result<Check, DesignError> {
    let states = augmented.symbols();
    let map = lynkeus_structure::one_to_one::Map {
        graph: augmented.graph(),
        functions: Φ,
        states: &states,
        region,
    };
    let found = map.one_to_one(&vec![false; states.len()], regular.is_proved())?;
    Ok(Statement::from(Germani::OneToOne).with(found.finding))
}

/// The map where it reads inputs.
pub(super) struct Inputs<'a, 'p> {
    pub augmented: &'a AugmentedPlant<'p>,
    pub U: &'a [Vec<Node>],
    /// bounds of |u'|, |u''|, … per input, as far as they are declared
    pub slopes: &'a [Vec<f64>],
    pub Q̄: &'a Rows,
    pub region: &'a Region,
}

impl Inputs<'_, '_> {
    /// What the observer needs of the input where r < n.
    pub fn check(&self, variant: Variant) -> Result<Check, DesignError> {
        if variant == Variant::Bounded {
            return Ok(undecided(
                Germani::SmallInput,
                "the input appears before the n-th derivative of the output and (3.1) takes no account of it: it converges for u_M ≤ β λ_min(P) only; variant = \"theoretical\" or \"practical\" does not need that",
            ));
        }
        let name = || Germani::UniformlyObservable;
        // a singular point for a constant input is the better witness
        let still = self.still();
        let mut check = regular(self.augmented, name(), &self.at_rest(&still), self.region)?;
        if !matches!(check.verdict, Verdict::Refuted(_)) && !still.is_empty() {
            let wider = with_slopes(self.augmented, self.U, self.slopes, self.region);
            let declared = self.declared();
            let statement = match declared.is_empty() {
                true => name(),
                false => Germani::RegularWithin,
            };
            check = regular(self.augmented, statement, self.Q̄, &wider)?;
            if !declared.is_empty() {
                check.reason = format!(
                    "{}; for {declared}, as `input_derivatives` bounds them",
                    check.reason.text()
                )
                .into();
            }
        }
        if !check.is_proved() {
            check.reason = (check.reason.text() + "; small and slow inputs keep it regular (Theorem 2.4), the column rcond and its flag tell").into();
        }
        Ok(check)
    }

    /// The bounds of the derivatives that Q̄ reads, in words.
    fn declared(&self) -> String {
        let jets = self.augmented.inputs.iter().zip(self.U).zip(self.slopes);
        let each = jets.flat_map(|((input, jet), bounds)| {
            let read = jet.len().saturating_sub(1);
            let each = bounds.iter().take(read).enumerate();
            each.map(|(k, bound)| {
                format!(
                    "|{}| ≤ {}",
                    derivative_name(&input.name, k + 1),
                    short(*bound)
                )
            })
        });
        each.collect::<Vec<_>>().join(", ")
    }

    /// Ū of Theorem 2.4: the largest radius, to a few thousandths of its size, for which Q̄ is proved regular on
    /// the box of the states for all |u|, |u'|, … ≤ Ū; none where even the smallest inputs leave it undecided.
    pub fn largest(&self) -> Result<Option<f64>, DesignError> {
        let holds = |radius: f64| -> Result<bool, DesignError> {
            let mut region = self.region.clone();
            let is_input = |symbol: Node| self.augmented.inputs.iter().any(|u| u.node == symbol);
            for side in region
                .dimensions
                .iter_mut()
                .filter(|side| is_input(side.symbol))
            {
                (side.min, side.max) = (-radius, radius);
            }
            let orders = self.U.iter().map(|jet| vec![radius; jet.len()]);
            let region = with_slopes(self.augmented, self.U, &orders.collect::<Vec<_>>(), &region);
            Ok(regular(self.augmented, Germani::RegularWithin, self.Q̄, &region)?.is_proved())
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
    fn still(&self) -> HashMap<Node, Node> {
        let zero = self.augmented.graph().constant(0.0).node();
        let slopes = self.U.iter().flat_map(|jet| jet.iter().skip(1));
        slopes.map(|&symbol| (symbol, zero)).collect()
    }

    /// Q̄ for constant inputs.
    fn at_rest(&self, still: &HashMap<Node, Node>) -> Rows {
        let graph = self.augmented.graph();
        let constant = |row: &Vec<Option<Node>>| {
            let entry = |e: &Option<Node>| Some(graph.substitute(&[(*e)?], still)[0]);
            row.iter().map(entry).collect()
        };
        self.Q̄.iter().map(constant).collect()
    }
}

/// y, y', y'', y^(3), …
pub(super) fn derivative_name(name: &str, order: usize) -> String {
    match order {
        0..=2 => format!("{name}{}", "'".repeat(order)),
        _ => format!("{name}^({order})"),
    }
}
