//! Some columns of the sensitivity, integrated along with the states.

use lynkeus_expr::Budget;
use lynkeus_run::{Dynamics, Error, Evaluation, Events, Integrator};

use super::super::Experiment;
use super::Tangent;

/// Some columns of S·diag(scales) on their way.
pub(super) struct Batch<'t> {
    /// the quantities whose columns these are
    pub columns: Vec<usize>,
    dynamics: Variation<'t>,
    sight: Evaluation,
    integrator: Integrator,
    /// states, then one column after the other, in units
    x: Vec<f64>,
    /// states as they are
    states: Vec<f64>,
    t: f64,
}

/// What a batch saw: per sample and sensor, the value, and ∂y/∂z(0)·diag(scales) for its columns.
pub(super) struct Piece {
    pub values: Vec<f64>,
    pub slopes: Vec<f64>,
    /// slopes had none of their terms cancelled
    pub gross: Vec<f64>,
    width: usize,
}

impl Piece {
    /// Row of `slopes` or `gross`.
    pub fn row<'a>(&self, of: &'a [f64], row: usize) -> impl Iterator<Item = f64> + use<'a> {
        let from = row * self.width;
        of[from..from + self.width].iter().copied()
    }
}

impl<'t> Batch<'t> {
    pub fn new(
        tangent: &'t Tangent,
        columns: Vec<usize>,
        experiment: &Experiment<'_>,
    ) -> Result<Self, Error> {
        let n = tangent.states;
        let mut x = vec![0.0; n * (1 + columns.len())];
        let start = tangent.flow.system().start().iter().zip(&tangent.units);
        x.iter_mut()
            .zip(start)
            .for_each(|(x, (start, unit))| *x = start / unit);
        let mut batch = Self {
            dynamics: Variation {
                tangent,
                columns: columns.clone(),
                flow: tangent.flow.system().evaluation(),
                slopes: vec![0.0; tangent.flow.jacobians().state.places().len()],
                states: vec![0.0; n],
                budget: tangent.budget.clone(),
            },
            columns,
            sight: tangent.sight.system().evaluation(),
            integrator: Integrator::new(experiment.method, x.len())?,
            x,
            states: vec![0.0; n],
            t: experiment.window.start,
        };
        batch.restart();
        Ok(batch)
    }

    /// Makes the present the start that sensitivities are about.
    pub fn restart(&mut self) {
        let tangent = self.dynamics.tangent;
        let n = tangent.states;
        self.x[n..].fill(0.0);
        let own = self.columns.iter().enumerate().filter(|(_, j)| **j < n);
        for (place, &j) in own {
            self.x[n + place * n + j] = tangent.scales[j] / tangent.units[j];
        }
    }

    /// A column of the sensitivity of the states.
    pub fn column(&self, place: usize) -> impl Iterator<Item = f64> + '_ {
        let tangent = self.dynamics.tangent;
        let n = tangent.states;
        let column = &self.x[n + place * n..n + (place + 1) * n];
        column.iter().zip(&tangent.units).map(|(x, unit)| x * unit)
    }

    /// Integrates from instant to instant and looks at each.
    pub fn run(&mut self, instants: &[f64]) -> Result<Piece, Error> {
        let mut piece = Piece {
            values: vec![],
            slopes: vec![],
            gross: vec![],
            width: self.columns.len(),
        };
        for &to in instants {
            if to > self.t {
                self.integrator
                    .advance(&mut self.dynamics, self.t, to, &mut self.x)?;
                self.t = to;
            }
            self.look(&mut piece)?;
        }
        Ok(piece)
    }

    fn look(&mut self, piece: &mut Piece) -> Result<(), Error> {
        let tangent = self.dynamics.tangent;
        let (states, columns) = self.x.split_at(tangent.states);
        tangent.in_own_units(states, &mut self.states);
        let states = &self.states;
        let mut seen = vec![0.0; self.sight.system().outputs().len()];
        self.sight.enter(self.t);
        self.sight.outputs(self.t, states, &mut seen);
        if seen.iter().any(|v| !v.is_finite()) {
            return Err(self.sight.not_finite(self.t, states));
        }
        let jacobian = &tangent.sight.jacobians().output;
        let sensors = jacobian.outputs().start;
        let (values, views) = seen.split_at(sensors);
        let first = piece.slopes.len();
        piece.values.extend(values);
        piece
            .slopes
            .resize(first + sensors * self.columns.len(), 0.0);
        piece
            .gross
            .resize(first + sensors * self.columns.len(), 0.0);
        for (&(c, i), &slope) in jacobian.places().iter().zip(views) {
            for (place, &j) in self.columns.iter().enumerate() {
                let (sensitivity, floor) = match i < tangent.states {
                    true => {
                        let unit = tangent.units[i];
                        (
                            columns[place * tangent.states + i] * unit,
                            tangent.floor * unit,
                        )
                    }
                    false if i == j => (tangent.scales[j], 0.0),
                    false => continue,
                };
                let at = first + c * self.columns.len() + place;
                piece.slopes[at] += slope * sensitivity;
                piece.gross[at] += slope.abs() * (sensitivity.abs() + floor);
            }
        }
        Ok(())
    }
}

/// States and sensitivities as one system.
struct Variation<'t> {
    tangent: &'t Tangent,
    columns: Vec<usize>,
    flow: Evaluation,
    /// entries of ∂f/∂z
    slopes: Vec<f64>,
    /// states as they are
    states: Vec<f64>,
    budget: Budget,
}

impl Dynamics for Variation<'_> {
    fn dimension(&self) -> usize {
        self.tangent.states * (1 + self.columns.len())
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        let n = self.tangent.states;
        let (states, columns) = x.split_at(n);
        let (d_states, d_columns) = dx.split_at_mut(n);
        let tangent = self.tangent;
        tangent.in_own_units(states, &mut self.states);
        self.flow.derivatives(t, &self.states, d_states);
        self.flow.outputs(t, &self.states, &mut self.slopes);
        let units = d_states.iter_mut().zip(&tangent.units);
        units.for_each(|(x, unit)| *x /= unit);
        d_columns.fill(0.0);
        let places = tangent.flow.jacobians().state.places();
        for (&(i, j), &slope) in places.iter().zip(&self.slopes) {
            let unit = tangent.units[i];
            for (place, &own) in self.columns.iter().enumerate() {
                let sensitivity = match j < n {
                    true => columns[place * n + j] * (tangent.units[j] / unit),
                    false if j == own => tangent.scales[j] / unit,
                    false => continue,
                };
                d_columns[place * n + i] += slope * sensitivity;
            }
        }
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn is_over(&mut self) -> bool {
        self.budget.spent().is_some()
    }

    fn names(&self) -> Vec<String> {
        let states = self.flow.names();
        let column = |j: &usize| {
            let with = |state: &String| format!("∂{state}/∂z[{}]", j + 1);
            states.iter().map(with).collect::<Vec<_>>()
        };
        let columns: Vec<String> = self.columns.iter().flat_map(column).collect();
        states.into_iter().chain(columns).collect()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        let tangent = self.tangent;
        tangent.in_own_units(&x[..tangent.states], &mut self.states);
        self.flow.not_finite(t, &self.states)
    }
}

/// Those of time: what jumps with the state is as the state says.
impl Events for Variation<'_> {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.flow.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.flow.enter(t);
    }
}
