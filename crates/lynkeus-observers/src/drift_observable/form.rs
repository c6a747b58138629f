//! The form of the paper in a plant: the map Φ̄ with its Jacobians, and the conditions on it.

use crate::statement::Statement;
use crate::{Check, Germani};
use lynkeus_expr::Node;
use lynkeus_structure::output_map::{self, AffineForm, Rows};
use lynkeus_structure::{Extended, Region, Regularity};

use super::conditions::{self, Inputs};
use super::settings::Settings;
use super::variant::Variant;
use super::{NAME, degrees, derivative_name, size};
use crate::conditions::{lasts, lipschitz, names};
use crate::family;
use crate::stages::Found;
use crate::{DesignError, Examination};

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
        extended: &Extended<'_>,
        settings: &'s Settings,
        region: &Region,
    ) -> Result<Result<Self, Examination>, DesignError> {
        let affine = match output_map::affine_form(extended)? {
            Ok(affine) => affine,
            Err(why) => return Ok(Err(unfit(why))),
        };
        size::affordable(extended, &affine)?;
        let order = extended.states.len().saturating_sub(1);
        let lie = output_map::lie_derivatives(extended, &affine, order)?;
        let gradients = output_map::lie_gradients(extended, &affine, order)?;
        lasts(extended)?;
        Ok(Ok(Self {
            affine,
            gradients,
            lie,
            slopes: degrees::slopes(extended),
            lipschitz: lipschitz(extended, region)?,
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
        extended: &Extended<'_>,
        map: &Map<'_>,
        indices: Vec<usize>,
        region: &Region,
    ) -> Result<Found<Self>, DesignError> {
        let degrees = degrees::degrees(extended, map, &indices, region)?;
        let U = degrees::input_symbols(extended, map, &indices, &degrees);
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
        lasts(extended)?;
        let regular = conditions::regular(extended, Germani::Regular, &Q, region)?;
        lasts(extended)?;
        let Φ: Vec<Node> = rows.iter().map(|&(i, k)| map.lie[i][k]).collect();
        let one_to_one = conditions::one_to_one(extended, &Φ, &regular, region)?;
        lasts(extended)?;
        let (Φ, Q, Q_a) = match variant {
            Variant::Bounded => (Φ, Q, vec![]),
            _ => with_inputs(extended, &rows, &U)?,
        };
        // the map is followed along the plant: as states, inputs and time move
        let slopes = map.settings.known_slopes(extended, &U);
        let moving = degrees::with_slopes(extended, &U, &slopes, region);
        let continuous = Regularity::of(extended.graph(), &Φ, &moving.symbols(), &moving)?;
        let reads = U.iter().any(|jet| !jet.is_empty());
        let inputs = Inputs {
            extended,
            U: &U,
            slopes: &slopes,
            Q̄: &Q,
            region,
        };
        let checks = Checks {
            degree: degrees::known(extended, &indices, &degrees),
            regular,
            one_to_one,
            lipschitz: map.lipschitz.clone(),
            continuous: Statement::from(Germani::Continuous).with(continuous.finding()),
            inputs: match reads {
                true => Some(inputs.check(variant)?.advisory()),
                false => None,
            },
        };
        let every: Vec<usize> = (0..extended.states.len()).collect();
        let found = family::Form {
            summary: summary(extended, variant, &rows, &U),
            chains: vec![names(extended, &every)],
        };
        let examination = Examination::new(extended, region, NAME, found, checks.all())?;
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
    extended: &Extended<'_>,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> Result<(Vec<Node>, Rows, Rows), DesignError> {
    let graph = extended.graph();
    let order = rows.iter().map(|r| r.1).max().unwrap_or(0);
    let y = output_map::output_derivatives(extended, U, order)?;
    lasts(extended)?;
    let Φ̄: Vec<Node> = rows.iter().map(|&(i, k)| y[i][k]).collect();
    let Q̄ = output_map::jacobian_rows(graph, &Φ̄, &extended.symbols());
    let Q̄_a = output_map::jacobian_rows(graph, &Φ̄, &U.concat());
    Ok((Φ̄, Q̄, Q̄_a))
}

fn summary(
    extended: &Extended<'_>,
    variant: Variant,
    rows: &[(usize, usize)],
    U: &[Vec<Node>],
) -> String {
    let y = |&(i, k): &(usize, usize)| derivative_name(&extended.outputs[i].variable.name, k);
    let map: Vec<String> = rows.iter().map(y).collect();
    let u = extended
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
