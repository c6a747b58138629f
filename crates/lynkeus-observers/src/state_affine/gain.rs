//! The matrices of observer (7)–(8), for the reader of a design. Its gain
//! θ Δ_θ⁻¹ S⁻¹(t) Cᵀ(u) is no constant, so it is given at the start.

use lynkeus_gain::UnitFactor;
use lynkeus_structure::{Matrix, Superdiagonal};

use super::settings::Numbers;
use crate::DesignError;
use crate::estimate::Copy;
use crate::matrices::{Start, expressions, numbers};

pub(super) fn parameters(
    copy: &Copy<'_, '_>,
    form: &Superdiagonal,
    order: &[usize],
    given: &Numbers,
    alarm: f64,
) -> Result<Vec<(String, String)>, DesignError> {
    let extended = copy.extended;
    let start = Start::new(copy)?;
    let n = order.len();
    let place = |state: usize| order.iter().position(|&i| i == state);
    let factor = |k: usize, rows: usize, row: &dyn Fn(usize) -> Option<usize>| {
        Matrix::from_fn(extended.graph(), (rows, n), |i, j| {
            let factor = form.factors.get(k)?;
            let is_here = |&&(r, c, _): &&(usize, usize, _)| {
                row(factor.rows[r]) == Some(i) && place(factor.columns[c]) == Some(j)
            };
            factor.entries.iter().find(is_here).map(|entry| entry.2)
        })
    };
    let C = factor(0, extended.outputs.len(), &Some);
    let F = (1..form.factors.len())
        .map(|k| factor(k, n, &place))
        .reduce(|all, next| all.plus(&next));
    let gain = gain(&start.values(&C)?, form, given);
    let names: Vec<&str> = order
        .iter()
        .map(|&i| extended.states[i].name.as_str())
        .collect();
    let mut found: Vec<(String, String)> = vec![
        ("θ".into(), given.θ.to_string()),
        ("blocks".into(), form.describe(extended)),
        ("alarm".into(), format!("excitation below {alarm:.3e}")),
        ("rows".into(), names.join(", ")),
        ("C(u)".into(), expressions(&C)),
    ];
    if let Some(F) = F {
        found.push(("F(u, x)".into(), expressions(&F)));
    }
    found.push(("S(0)".into(), numbers(&product(&given.S0))));
    found.push(("θΔ⁻¹S⁻¹Cᵀ at the start".into(), numbers(&gain)));
    Ok(found)
}

/// S = UᵀDU
fn product(S: &UnitFactor) -> Vec<Vec<f64>> {
    let n = S.diagonal.len();
    let entry = |i: usize, j: usize| {
        let terms = (0..=i.min(j)).map(|k| U(S, k, i) * S.diagonal[k] * U(S, k, j));
        terms.sum()
    };
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

/// An entry of U, j ≥ k.
fn U(S: &UnitFactor, k: usize, j: usize) -> f64 {
    match j == k {
        true => 1.0,
        false => S.upper[k][j - k - 1],
    }
}

/// θ Δ_θ⁻¹ S(0)⁻¹ Cᵀ: by Uᵀv = Cᵀ and then Uz = D⁻¹v, as the observer has it.
fn gain(C: &[Vec<f64>], form: &Superdiagonal, given: &Numbers) -> Vec<Vec<f64>> {
    let (S, θ) = (&given.S0, given.θ);
    let n = S.diagonal.len();
    let column = |c: &Vec<f64>| {
        let mut v = c.clone();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| U(S, k, i) * v[k]).sum();
            v[i] -= known;
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| U(S, i, k) * v[k]).sum();
            v[i] = v[i] / S.diagonal[i] - known;
        }
        v
    };
    let columns: Vec<Vec<f64>> = C.iter().map(column).collect();
    let blocks = form.blocks().enumerate();
    let powers = blocks.flat_map(|(k, block)| block.iter().map(move |_| θ.powi(k as i32 + 1)));
    powers
        .enumerate()
        .map(|(i, power)| columns.iter().map(|z| power * z[i]).collect())
        .collect()
}
