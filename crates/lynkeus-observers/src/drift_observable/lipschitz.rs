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
use lynkeus_structure::{AugmentedPlant, Matrix, Region, output_map, regularity};

use super::form::{Form, derivative_name, regular};
use super::settings::Variant;
use crate::theorem::Enclosure;
use crate::{Check, DesignError, Germani, Statement};

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
    /// what the error of each state is made of
    pub states: Vec<Share>,
    /// det Q̄ keeps its sign for inputs and slopes within bounds
    pub regular: Check,
    /// the last rows have values and do not jump
    pub continuous: Check,
    /// what has no bound
    pub open: Vec<String>,
}

/// |e_x| of one state is at most Σ_j z_j |e_z,j| + through |e_a|.
pub(super) struct Share {
    /// its row of |Q̃⁻¹|
    pub z: Vec<f64>,
    /// the length of its row of |Q̃⁻¹Q̃_a|
    pub through: f64,
}

pub(super) fn bounds(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    slopes: &[Option<Vec<f64>>],
    region: &Region,
) -> Result<Lipschitz, DesignError> {
    let graph = augmented.graph();
    let mut box_ = Enclosure::new(augmented, region);
    let U = further(augmented, form, slopes, &mut box_);
    let n = form.rows.len();
    let of_rows = |rows: &output_map::Rows, columns: usize| {
        Matrix::from_fn(graph, (n, columns), |i, j| {
            rows.get(i).and_then(|row| *row.get(j)?)
        })
    };
    let columns = form.Q_a.first().map_or(0, Vec::len);
    let (Q, Q_a) = (of_rows(&form.Q, n), of_rows(&form.Q_a, columns));
    let x_a: Vec<Node> = match form.variant {
        Variant::Practical => form.U.concat(),
        _ => vec![],
    };
    let Q_a = if x_a.is_empty() {
        of_rows(&vec![], 0)
    } else {
        Q_a
    };
    let Remainders {
        drift,
        input,
        unseen,
        w,
    } = remainders(augmented, form, &U)?;
    let rows: Vec<Node> = input.iter().flatten().chain(&drift).copied().collect();
    let sides = box_.region();
    let continuous = regularity(graph, &rows, &sides.symbols(), sides)?;
    let found = box_.inverse(&Q)?;
    let unknown = || vec![vec![f64::INFINITY; n]; n];
    let size = found.as_ref().map_or_else(unknown, |found| found.bounds());
    let (Q_size, Q_a_size) = (box_.magnitudes(&Q)?, box_.magnitudes(&Q_a)?);
    let mixed = |left: &[Vec<f64>]| product(left, &Q_a_size);
    let of_remainder = |r: &[Node]| -> Result<Vec<f64>, MissingInput> {
        let x = Matrix::jacobian(graph, r, &augmented.symbols());
        let a = box_.magnitudes(&Matrix::jacobian(graph, r, &x_a))?;
        let z = match &found {
            Some(inverse) => box_.divided(&x, inverse)?,
            None => product(&box_.magnitudes(&x)?, &size),
        };
        let through = mixed(&z);
        let row = |i: usize| {
            let a = a[i].iter().zip(&through[i]).map(|(a, t)| a + t);
            length(&z[i].iter().copied().chain(a).collect::<Vec<_>>())
        };
        Ok((0..r.len()).map(row).collect())
    };
    let mut input_rows = vec![0.0; n];
    for column in &input {
        for (sum, γ) in input_rows.iter_mut().zip(of_remainder(column)?) {
            *sum += γ;
        }
    }
    let beside = |A: &[Vec<f64>], B: &[Vec<f64>]| -> Vec<Vec<f64>> {
        A.iter().zip(B).map(|(a, b)| [&a[..], b].concat()).collect()
    };
    let size_a = mixed(&size);
    let states = size.iter().zip(&size_a);
    Ok(Lipschitz {
        map: norm(&beside(&Q_size, &Q_a_size)),
        inverse: norm(&beside(&size, &size_a)),
        drift: of_remainder(&drift)?,
        input: input_rows,
        unseen: forced(&unseen, &w, &box_)?,
        states: states
            .map(|(z, a)| Share {
                z: z.clone(),
                through: length(a),
            })
            .collect(),
        Q: Q_size,
        regular: regular(augmented, Germani::RegularWithin, &form.Q, box_.region())?,
        continuous: Statement::from(Germani::ContinuousRows).with(continuous),
        open: box_.open(),
    })
}

/// u, u', …, one order further than the observer reads, each with its bounds.
fn further(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    slopes: &[Option<Vec<f64>>],
    box_: &mut Enclosure<'_>,
) -> Vec<Vec<Node>> {
    let mut U = vec![];
    let jets = form.U.iter().zip(&form.w);
    for ((input, (jet, &w)), given) in augmented.inputs.iter().zip(jets).zip(slopes) {
        let mut symbols = vec![input.node];
        for k in 1..=jet.len() {
            let symbol = jet.get(k).copied().unwrap_or(w);
            let bound = given.as_ref().and_then(|b| b.get(k - 1).copied());
            let bound = bound.unwrap_or(f64::INFINITY);
            box_.add(derivative_name(&input.name, k), symbol, -bound, bound);
            symbols.push(symbol);
        }
        U.push(symbols);
    }
    U
}

/// What z' holds beside the next row, row by row of z.
struct Remainders {
    /// without the inputs for (3.1), without w for (4.22)
    drift: Vec<Node>,
    /// (3.1): the factor of each input
    input: Vec<Vec<Node>>,
    /// (4.22): n̄, a column per entry of w
    unseen: Vec<Vec<Option<Node>>>,
    /// the symbols of w
    w: Vec<Node>,
}

fn remainders(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    U: &[Vec<Node>],
) -> Result<Remainders, MissingInput> {
    let graph = augmented.graph();
    let zero = graph.constant(0.0).node();
    let order = form.indices.iter().copied().max().unwrap_or(0);
    let bounded = match form.variant {
        Variant::Bounded => output_map::affine_form(augmented)?.ok(),
        _ => None,
    };
    let y = match &bounded {
        Some(affine) => output_map::lie_derivatives(augmented, affine, order)?,
        None => output_map::output_derivatives(augmented, U, order)?,
    };
    let last = |&(i, k): &(usize, usize)| match k + 1 == form.indices[i] {
        true => y[i][k + 1],
        false => zero,
    };
    let drift: Vec<Node> = form.rows.iter().map(last).collect();
    let w = match form.variant {
        Variant::Practical => unseen_derivatives(form, U),
        _ => vec![],
    };
    let still: HashMap<Node, Node> = w.iter().map(|&w| (w, zero)).collect();
    Ok(Remainders {
        unseen: output_map::jacobian_rows(graph, &drift, &w),
        w,
        drift: graph.substitute(&drift, &still),
        input: bounded.map_or_else(Vec::new, |affine| {
            let columns = affine.input_columns.iter();
            columns.map(|g| along(augmented, form, g)).collect()
        }),
    })
}

/// L_g of every row of the map.
fn along(augmented: &AugmentedPlant<'_>, form: &Form, g: &[Option<Node>]) -> Vec<Node> {
    let graph = augmented.graph();
    let of_row = |row: &Vec<Option<Node>>| {
        let pairs = row.iter().zip(g);
        let terms = pairs.filter_map(|(q, g)| Some(graph.expr((*q)?) * graph.expr((*g)?)));
        terms
            .reduce(|a, b| a + b)
            .map_or_else(|| graph.constant(0.0).node(), |sum| sum.node())
    };
    form.Q.iter().map(of_row).collect()
}

/// The first derivative of each input that its filter lacks.
fn unseen_derivatives(form: &Form, U: &[Vec<Node>]) -> Vec<Node> {
    let pairs = form.U.iter().zip(U).filter(|(jet, _)| !jet.is_empty());
    pairs
        .filter_map(|(jet, further)| further.get(jet.len()).copied())
        .collect()
}

/// Bounds of |n̄ w| row by row. y^(μ) is affine in w, so that n̄ reads none of it.
fn forced(
    unseen: &[Vec<Option<Node>>],
    w: &[Node],
    box_: &Enclosure<'_>,
) -> Result<Vec<f64>, MissingInput> {
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
    unseen.iter().map(row).collect()
}
