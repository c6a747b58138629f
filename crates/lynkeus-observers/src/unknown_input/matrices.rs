//! The matrices of observer (14), for the reader of a design.

use lynkeus_expr::MissingInput;
use lynkeus_gain::integrators::Chain;
use lynkeus_structure::Matrix;

use super::form::Form;
use super::settings::Thetas;
use crate::ChainGain;
use crate::conditions::names;
use crate::matrices::{Start, expressions, is_constant, numbers};

/// What multiplies the innovations.
pub(super) struct Matrices<'f, 'e, 'p> {
    form: &'f Form<'e, 'p>,
    θ: Thetas,
    /// (G₁¹)⁺
    left: Matrix<'p>,
    /// the blocks of D (9)
    D: Vec<Matrix<'p>>,
    /// the blocks of Λ₂ (13)
    Λ2: Vec<Matrix<'p>>,
}

impl<'f, 'e, 'p> Matrices<'f, 'e, 'p> {
    pub fn new(form: &'f Form<'e, 'p>, θ: Thetas) -> Self {
        let unit = Matrix::identity(form.extended.graph(), form.first.len());
        Self {
            form,
            θ,
            left: form.G11().left_divide(&unit),
            D: (1..=form.q()).map(|k| form.γ_times(k, &unit)).collect(),
            Λ2: form.Λ2(),
        }
    }

    /// Λ₂⁺, block k from 0.
    fn Λ2_left(&self, k: usize) -> Matrix<'p> {
        let P = &self.Λ2[k];
        P.left_divide(&Matrix::identity(P.graph(), P.rows))
    }

    /// K of x̂' = f(x̂, u) − K(ŷ − y), where (14) is of that form with numbers for K: G, Λ₂
    /// and the slopes of the outputs are numbers.
    pub fn gains(&self, start: &Start<'_>) -> Result<Vec<ChainGain>, MissingInput> {
        let (form, Thetas { θ1, θ2 }) = (self.form, self.θ);
        let Some(slopes) = self.slopes() else {
            return Ok(vec![]);
        };
        let numbers = [&form.layers.factors].into_iter().chain(&self.Λ2);
        if !numbers.into_iter().all(is_constant) {
            return Ok(vec![]);
        }
        let C = Chain::new(form.q()).gain;
        let mut K = vec![vec![0.0; form.extended.outputs.len()]; form.extended.states.len()];
        let mut add = |states: &[usize], outputs: &[usize], block: Vec<Vec<f64>>, factor: f64| {
            for (&state, row) in states.iter().zip(block) {
                for (&output, entry) in outputs.iter().zip(row) {
                    K[state][output] += factor * entry / slopes[output];
                }
            }
        };
        let one = Matrix::identity(form.extended.graph(), form.first.len());
        add(&form.x11(), &form.first, start.values(&one)?, 2.0 * θ1);
        let unknown: Vec<usize> =
            (form.extended.plant_states()..form.extended.states.len()).collect();
        add(&unknown, &form.first, start.values(&self.left)?, θ1 * θ1);
        for (k, c) in C.iter().enumerate().take(form.q()) {
            let states = form.block(k + 1);
            add(&states, &form.first, start.values(&self.D[k])?, 2.0 * θ1);
            let left = start.values(&self.Λ2_left(k))?;
            add(&states, &form.second, left, θ2.powi(k as i32 + 1) * c);
        }
        let state = |i: usize| form.extended.states[i].name.clone();
        let output = |j: usize| ChainGain {
            output: form.extended.outputs[j].variable.name.clone(),
            entries: (0..K.len())
                .filter(|&i| K[i][j] != 0.0)
                .map(|i| (state(i), K[i][j]))
                .collect(),
        };
        Ok((0..slopes.len()).map(output).collect())
    }

    /// The outputs' slopes in the states that they show, where they are numbers.
    fn slopes(&self) -> Option<Vec<f64>> {
        let graph = self.form.extended.graph();
        let mut outputs = self.form.extended.outputs.iter();
        let slope = |(_, slope, _): (usize, _, _)| graph.constant_value(slope);
        outputs.try_fold(vec![], |mut found, output| {
            found.push(output.state.and_then(slope)?);
            Some(found)
        })
    }

    /// Everything that (14) multiplies the innovations with.
    pub fn parameters(&self, start: &Start<'_>) -> Result<Vec<(String, String)>, MissingInput> {
        let (form, Thetas { θ1, θ2 }) = (self.form, self.θ);
        let extended = form.extended;
        let joined = |states: &[usize]| names(extended, states).join(", ");
        let outputs: Vec<&str> = form
            .first
            .iter()
            .map(|&i| extended.outputs[i].variable.name.as_str())
            .collect();
        let mut found: Vec<(String, String)> = vec![
            ("θ1".into(), θ1.to_string()),
            ("θ2".into(), θ2.to_string()),
            ("partition".into(), outputs.join(", ")),
            ("x₁¹".into(), joined(&form.x11())),
        ];
        for k in 1..=form.q() {
            found.push((format!("X² {k}"), joined(&form.block(k))));
        }
        let gain = |n: usize| numbers(&[Chain::new(n).gain]);
        found.push(("S₁⁻¹C₁ᵀ".into(), gain(2)));
        found.push(("S₂⁻¹C₂ᵀ".into(), gain(form.q())));
        found.push(("G₁¹".into(), expressions(&form.G11())));
        found.push(("(G₁¹)⁺ at the start".into(), start.shown(&self.left)?));
        for k in 0..form.q() {
            let name = |what: &str| format!("{what} {}", k + 1);
            let G = form.factors(&form.block(k + 1));
            found.push((name("G²"), expressions(&G)));
            found.push((name("D at the start,"), start.shown(&self.D[k])?));
        }
        for k in 1..form.q() {
            let name = |what: &str| format!("{what} {}", k + 1);
            found.push((name("Λ₂"), expressions(&self.Λ2[k])));
            let left = self.Λ2_left(k);
            found.push((name("Λ₂⁺ at the start,"), start.shown(&left)?));
        }
        Ok(found)
    }
}
