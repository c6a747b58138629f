//! The Lipschitz constants of the theorems, for plant and estimate inside the box.
//!
//! In the coordinates z = Φ̄(x, x_a) of the output's derivatives (Φ(x) for (3.1)) plant and
//! observer are chains of integrators with a remainder in some rows, z' = A z + r. Along
//! the line from estimate to truth
//!
//! e_z = Q̃ e_x + Q̃_a e_a,   r(x, x_a) − r(x̂, x̂_a) = ã e_x + b̃ e_a
//!
//! with means of the Jacobians, so that e_x = Q̃⁻¹(e_z − Q̃_a e_a) and the remainder
//! is ãQ̃⁻¹ e_z + (b̃ − ãQ̃⁻¹Q̃_a) e_a. The box has to be convex in x, not in z.
//!
//! The last rows of the plant are y_i^(μ_i) = m̄_i(x, x_a) + Σ_j n̄_ij(x, x_a) w_j, w_j the first
//! derivative of u_j that x_a lacks. (4.1) knows w and has n̄(x̂, x_a)w itself. (4.22) has
//! ẑ' = Aẑ + Bm̄(ẑ, x̂_a) + K₁(y − h(x̂)) without w, whatever (4.23) says: there only m̄ is
//! compared, and n̄(x, x_a)w is left over as a force that does not vanish with the error.

use std::collections::HashMap;

use lynkeus_expr::{MissingInput, Node};
use lynkeus_proof::magnitude::{length, norm, plus, product, times};
use lynkeus_structure::output_map::{
    Rows, affine_form, along_column, jacobian_rows, lie_derivatives, output_derivatives,
};
use lynkeus_structure::{AugmentedPlant, Finding, Matrix, Region, regularity};

use super::form::{Form, matrix, regular, with_slopes};
use super::settings::Variant;
use crate::DesignError;
use crate::theorem::Enclosure;

/// Bounds on the box.
pub(super) struct Lipschitz {
    /// γ_Φ̄ and γ_Φ̄⁻¹ in both arguments
    pub map: f64,
    pub inverse: f64,
    /// per row of z: of what the input has no part in, in (e_z, e_a)
    pub drift: Vec<f64>,
    /// per row of z: of what multiplies an input, summed over the inputs; (3.1) only
    pub input: Vec<f64>,
    /// per row of z: Σ_j |n̄_ij w_j|, what drives the plant and (4.22) does not hold; zero else
    pub unseen: Vec<f64>,
    /// |Q̄| entry by entry
    pub Q: Vec<Vec<f64>>,
    /// |Q̃⁻¹|: |e_x| of state i is at most Σ_j `of_z`_ij |e_z,j| + `of_a`_i |e_a|
    pub of_z: Vec<Vec<f64>>,
    /// the lengths of the rows of |Q̃⁻¹Q̃_a|
    pub of_a: Vec<f64>,
    /// det Q̄ keeps its sign for inputs and slopes within bounds
    pub regular: Finding,
    /// the last rows have values and do not jump
    pub continuous: Finding,
    /// what has no bound
    pub open: Vec<String>,
    /// what z' holds beside the next row, with the inputs' part, where no filter's error counts
    pub remainder: Vec<Node>,
    /// the box, with the derivatives of the inputs
    pub region: Region,
}

pub(super) fn bounds(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    slopes: &[Vec<f64>],
    region: &Region,
) -> Result<Lipschitz, DesignError> {
    let (graph, n) = (augmented.graph(), form.rows.len());
    let region = with_slopes(augmented, &form.further, slopes, region);
    let box_ = Enclosure::new(augmented, &region);
    let x_a: Vec<Node> = match form.variant {
        Variant::Practical => form.U.concat(),
        _ => vec![],
    };
    let Q = matrix(graph, &form.Q, (n, n));
    let Q_a = matrix(graph, &form.Q_a, (n, x_a.len()));
    let Remainder { rows, inputs, w } = Remainder::new(augmented, form)?;
    let still: HashMap<Node, Node> = w.iter().map(|&w| (w, graph.constant(0.0).node())).collect();
    let drift = graph.substitute(&rows, &still);
    let every: Vec<Node> = inputs.iter().flatten().chain(&drift).copied().collect();
    let continuous = regularity(graph, &every, &region.symbols(), &region)?;
    let found = box_.inverse(&Q)?;
    let unknown = || vec![vec![f64::INFINITY; n]; n];
    let of_z = found.as_ref().map_or_else(unknown, |found| found.bounds());
    let (Q_size, Q_a_size) = (box_.magnitudes(&Q)?, box_.magnitudes(&Q_a)?);
    let beside = |A: &[Vec<f64>], B: &[Vec<f64>]| -> Vec<Vec<f64>> {
        A.iter().zip(B).map(|(a, b)| [&a[..], b].concat()).collect()
    };
    let γ = |r: &[Node]| -> Result<Vec<f64>, MissingInput> {
        let x = Matrix::jacobian(graph, r, &augmented.symbols());
        let a = box_.magnitudes(&Matrix::jacobian(graph, r, &x_a))?;
        let z = match &found {
            Some(inverse) => box_.divided(&x, inverse)?,
            None => product(&box_.magnitudes(&x)?, &of_z),
        };
        let a = a.iter().zip(product(&z, &Q_a_size));
        let a: Vec<Vec<f64>> = a
            .map(|(a, through)| a.iter().zip(through).map(|(a, t)| a + t).collect())
            .collect();
        Ok(beside(&z, &a).iter().map(|row| length(row)).collect())
    };
    let mut input = vec![0.0; n];
    for column in &inputs {
        for (sum, γ) in input.iter_mut().zip(γ(column)?) {
            *sum += γ;
        }
    }
    let of_a = product(&of_z, &Q_a_size);
    Ok(Lipschitz {
        map: norm(&beside(&Q_size, &Q_a_size)),
        inverse: norm(&beside(&of_z, &of_a)),
        drift: γ(&drift)?,
        input,
        unseen: forced(&jacobian_rows(graph, &rows, &w), &w, &box_)?,
        of_a: of_a.iter().map(|row| length(row)).collect(),
        of_z,
        Q: Q_size,
        regular: regular(augmented, &form.Q, &region)?,
        continuous,
        open: box_.open(),
        remainder: driven(augmented, &drift, &inputs),
        region,
    })
}

/// r + Σ_j H_j u_j for (3.1), whose H_j the columns are; r for the others.
fn driven(augmented: &AugmentedPlant<'_>, drift: &[Node], columns: &[Vec<Node>]) -> Vec<Node> {
    let graph = augmented.graph();
    let row = |(k, &r): (usize, &Node)| {
        let pairs = columns.iter().zip(&augmented.inputs);
        let terms = pairs.map(|(H, u)| graph.expr(H[k]) * graph.expr(u.node));
        terms.fold(graph.expr(r), |sum, term| sum + term).node()
    };
    drift.iter().enumerate().map(row).collect()
}

/// What z' holds beside the next row, row by row of z.
struct Remainder {
    /// without the inputs for (3.1)
    rows: Vec<Node>,
    /// (3.1): the factor of each input
    inputs: Vec<Vec<Node>>,
    /// (4.22): the first derivative of each input that its filter lacks
    w: Vec<Node>,
}

impl Remainder {
    fn new(augmented: &AugmentedPlant<'_>, form: &Form) -> Result<Self, MissingInput> {
        let graph = augmented.graph();
        let zero = graph.constant(0.0).node();
        let order = form.indices.iter().copied().max().unwrap_or(0);
        let (mut inputs, mut w) = (vec![], vec![]);
        let affine = match form.variant {
            Variant::Bounded => affine_form(augmented)?.ok(),
            _ => None,
        };
        let y = match &affine {
            Some(affine) => {
                let L_g = |row: &Vec<_>, g| along_column(graph, row, g).unwrap_or(zero);
                let columns = affine.input_columns.iter();
                inputs = columns
                    .map(|g| form.Q.iter().map(|row| L_g(row, g)).collect())
                    .collect();
                lie_derivatives(augmented, affine, order)?
            }
            None => output_derivatives(augmented, &form.further, order)?,
        };
        if form.variant == Variant::Practical {
            let further = form.U.iter().zip(&form.further);
            let further = further.filter(|(jet, _)| !jet.is_empty());
            w = further
                .filter_map(|(_, further)| further.last().copied())
                .collect();
        }
        let last = |&(i, k): &(usize, usize)| match k + 1 == form.indices[i] {
            true => y[i][k + 1],
            false => zero,
        };
        Ok(Self {
            rows: form.rows.iter().map(last).collect(),
            inputs,
            w,
        })
    }
}

/// Bounds of |n̄ w| row by row. y^(μ) is affine in w, so that n̄ reads none of it.
fn forced(n̄: &Rows, w: &[Node], box_: &Enclosure<'_>) -> Result<Vec<f64>, MissingInput> {
    let row = |row: &Vec<Option<Node>>| {
        let mut sum = 0.0;
        for (factor, &w) in row.iter().zip(w) {
            let Some(factor) = factor else { continue };
            let (low, high) = box_.side(w);
            let bound = times(box_.magnitude(*factor)?, low.abs().max(high.abs()));
            sum = plus(sum, bound);
        }
        Ok(sum)
    };
    n̄.iter().map(row).collect()
}
