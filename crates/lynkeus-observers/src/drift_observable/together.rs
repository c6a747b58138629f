//! Q and the slopes of the last rows as they come together: the theorems' Lyapunov function without their Lipschitz constants.
//!
//! With means over the segment from estimate to truth e_z' = (A − KC) e_z + ã e and e_z = Q̃ e. The Riccati inequality
//! knows of ãQ̃⁻¹ how large it is; here it is what it is at every point of the box ([`lynkeus_proof::decay::fastest_implicit`]).

use lynkeus_expr::{Budget, Node};
use lynkeus_proof::decay::{Field, ImplicitProof, Reach, fastest_implicit, prove_implicit};
use lynkeus_proof::ellipsoid::Ellipsoid;
use lynkeus_proof::magnitude::{times, total};
use lynkeus_structure::{AugmentedPlant, Matrix};
use nalgebra::DMatrix;

use super::form::{Form, matrix};
use super::lipschitz::Lipschitz;
use super::observer::scale;
use super::settings::Variant;
use crate::DesignError;
use crate::field::Joint;

/// The share of the time that is left in which a proof is sought.
const SEARCH: f64 = 0.5;

/// V = e_zᵀP⁻¹e_z that falls.
#[derive(Clone)]
pub(super) struct Falling {
    /// P and its rate
    pub P: Ellipsoid,
    /// what it says of e_x, where more is proved than by the Lipschitz constants of the map
    pub reach: Option<Reach>,
}

impl From<Ellipsoid> for Falling {
    fn from(P: Ellipsoid) -> Self {
        Self { P, reach: None }
    }
}

/// V for the closed loop A − KC: the fastest that is found to fall faster than at a rate, then some that fall at
/// shares of its rate, with the number of parts that the first one needed. None where nothing is found, and for (4.22),
/// whose filter has an error of its own.
pub(super) fn falling(
    augmented: &AugmentedPlant<'_>,
    (form, found): (&Form, &Lipschitz),
    A: &DMatrix<f64>,
    least: f64,
    shares: &[f64],
) -> Result<Option<(Vec<Falling>, usize)>, DesignError> {
    if form.variant == Variant::Practical && form.has_inputs() {
        return Ok(None);
    }
    let Some(joint) = joint(augmented, form, found, A)? else {
        return Ok(None);
    };
    let search = augmented.graph().budget().part(SEARCH);
    let sizes = sizes(augmented, &found.Q);
    Ok(joint.field(|field| {
        let (proof, parts) = fastest_implicit(field, &sizes, least, &search)?;
        let slower = |share: &f64| prove_implicit(field, &sizes, share * proof.rate, &search);
        let mut all = vec![of_proof(&proof, field, &search)?];
        let slower = shares.iter().filter_map(slower);
        all.extend(slower.filter_map(|(proof, _)| of_proof(&proof, field, &search)));
        Some((all, parts))
    }))
}

fn of_proof(proof: &ImplicitProof, field: &Field<'_>, budget: &Budget) -> Option<Falling> {
    let P = proof.ellipsoid()?;
    let reach = Reach::of(field, &P, budget);
    Some(Falling { P, reach })
}

/// [F R; −I Q] with F = A − KC and R the slopes of the remainder; none where these depend on too much.
fn joint(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    found: &Lipschitz,
    A: &DMatrix<f64>,
) -> Result<Option<Joint>, DesignError> {
    let (graph, n) = (augmented.graph(), form.rows.len());
    let Q = matrix(graph, &form.Q, (n, n));
    let R = Matrix::jacobian(graph, &found.remainder, &augmented.symbols());
    let zero = graph.constant(0.0).node();
    let entry = |place: usize| {
        let (i, j) = (place / (2 * n), place % (2 * n));
        let number = |x: f64| graph.constant(x).node();
        match (i < n, j < n) {
            (true, true) => number(A[(i, j)]),
            (true, false) => R.get(i, j - n).unwrap_or(zero),
            (false, true) => number(if i - n == j { -1.0 } else { 0.0 }),
            (false, false) => Q.get(i - n, j - n).unwrap_or(zero),
        }
    };
    let entries: Vec<Node> = (0..4 * n * n).map(entry).collect();
    Ok(Joint::of(graph, &entries, 2 * n, found.region.clone())?)
}

/// What counts as one of each derivative: what the ranges of the states make of it.
fn sizes(augmented: &AugmentedPlant<'_>, Q: &[Vec<f64>]) -> Vec<f64> {
    let widths: Vec<f64> = augmented.states.iter().map(scale).collect();
    let size = |row: &Vec<f64>| total(row.iter().zip(&widths).map(|(q, width)| times(*q, *width)));
    let usable = |size: &f64| size.is_finite() && *size > 0.0;
    let sizes = Q.iter().map(size);
    sizes
        .map(|found| Some(found).filter(usable).unwrap_or(1.0))
        .collect()
}
