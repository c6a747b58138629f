//! What an integrator sees of a system.

use std::sync::Arc;

use crate::error::state_text;
use crate::events::{Cause, Clauses, Guards, Memory, Seen};
use crate::{Error, Result, Slopes};

/// A right-hand side x' = f(t, x), with its [`Events`].
///
/// A derivative that is NaN or infinite is a statement ("f is not defined
/// here"), never a value: integrators shorten the step or stop.
pub trait Dynamics {
    /// Number of states.
    fn dimension(&self) -> usize;

    /// Writes f(t, x) to `dx`; both slices have [`Dynamics::dimension`] entries.
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]);

    /// Writes ∂f/∂x at (t, x), where f knows its own derivatives; false where it does not, and
    /// whoever needs them takes differences.
    fn slopes(&mut self, _t: f64, _x: &[f64], _slopes: &mut Slopes) -> bool {
        false
    }

    /// Takes `x` to `next` over steps of the classical Runge–Kutta method, the time and the length of each, where
    /// that is known as one function; false where it is not, and nothing is done.
    fn steps(&mut self, _steps: &[[f64; 2]], _x: &[f64], _next: &mut [f64]) -> bool {
        false
    }

    /// The instants and surfaces at which f is not smooth; none where it is smooth everywhere.
    fn events(&mut self) -> Option<&mut dyn Events> {
        None
    }

    /// The clauses by which the state jumps; none where it never does. Where there are some, the
    /// methods below belong to them. States that a wrapper adds may follow those of the clauses.
    fn clauses(&self) -> Option<Arc<Clauses>> {
        None
    }

    /// Writes what the relations of the clauses are at (t, x).
    fn watch(&mut self, _t: f64, _x: &[f64], _seen: &mut Vec<Seen>) {}

    /// How fast the quantities of the relations change at (t, x) as the state moves with `dx`.
    fn rates(&mut self, _t: f64, _x: &[f64], _dx: &[f64]) -> Vec<f64> {
        vec![]
    }

    /// Which conditions of the clauses hold at (t, x).
    ///
    /// # Errors
    /// [`Error::NotFinite`].
    fn truths(&mut self, _t: f64, _x: &[f64]) -> Result<Vec<bool>> {
        Ok(vec![])
    }

    /// Lets the clauses that are due take effect at (t, x): the condition that came to hold first, where
    /// one did; a number that is none's, where only discrete variables have changed.
    ///
    /// # Errors
    /// [`Error::EndlessEvents`], [`Error::NotFinite`].
    fn happen(&mut self, _t: f64, _x: &mut [f64], _memory: &mut Memory) -> Result<Option<usize>> {
        Ok(None)
    }

    /// After an event at (t, x), the state is now `jumped`, the derivatives were and are `rates`: what
    /// follows deviations of the state takes them along.
    ///
    /// # Errors
    /// [`Error::Grazing`].
    fn settle(
        &mut self,
        _at: (f64, &[f64]),
        _jumped: &mut [f64],
        _rates: [&[f64]; 2],
        _cause: Option<Cause>,
        _line: usize,
    ) -> Result<()> {
        Ok(())
    }

    /// Asked at every step: true ends the run with [`Error::Cancelled`].
    fn is_over(&mut self) -> bool {
        false
    }

    /// The names of the states, for messages.
    fn names(&self) -> Vec<String> {
        (1..=self.dimension()).map(|i| format!("x[{i}]")).collect()
    }

    /// The error for a derivative that is not finite at (t, x).
    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        Error::NotFinite {
            time: t,
            operation: "the derivative is not finite".to_owned(),
            state: state_text(&self.names(), x),
        }
    }
}

/// The events of a right-hand side f: instants and surfaces at which it jumps or bends.
pub trait Events {
    /// Appends every instant strictly inside (`from`, `to`) at which f jumps or
    /// has a kink because of time, in any order.
    ///
    /// # Errors
    /// [`Error::TooManySwitches`] where there is no bounded number of them,
    /// [`Error::UnresolvedSwitches`] where rounding errors hide them.
    fn instants(&mut self, _from: f64, _to: f64, _times: &mut Vec<f64>) -> Result<()> {
        Ok(())
    }

    /// Freezes what depends on time by jumps (relations, `floor`, `sign`) at its
    /// value at `t`, so that f is smooth on a whole segment, ends included.
    fn enter(&mut self, _t: f64) {}

    /// The functions of the surfaces on which f jumps with the state, and of where it bends, as code,
    /// so that they can be enclosed over a step. Where there are some, the methods below belong to
    /// them.
    fn guards(&self) -> Option<Arc<Guards>> {
        None
    }

    /// Writes the event indicators: the functions that vanish on the surfaces at (t, x), one per
    /// surface. States that a wrapper adds may follow those of f in `x`.
    fn indicators(&mut self, _t: f64, _x: &[f64], _values: &mut [f64]) {}

    /// Holds f, from here on, as it is on one side of each surface: where its function is
    /// positive for 1, negative for −1; both surfaces of a `floor` tell its value. With none f is
    /// what the state says again.
    fn hold(&mut self, _sides: Option<&[f64]>) {}

    /// Writes what the code of the guards reads beside time and states at `t`, and how fast each of it
    /// changes: until the next stop everything is a straight line.
    fn beside(&mut self, _t: f64, _values: &mut Vec<[f64; 2]>) {}
}

/// A closure (t, x, dx) as dynamics, for plain functions.
#[derive(Clone, Debug)]
pub struct Function<F> {
    dimension: usize,
    f: F,
}

impl<F: FnMut(f64, &[f64], &mut [f64])> Function<F> {
    /// `f` writes the derivative of `dimension` states to its last argument.
    pub fn new(dimension: usize, f: F) -> Self {
        Self { dimension, f }
    }
}

impl<F: FnMut(f64, &[f64], &mut [f64])> Dynamics for Function<F> {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        (self.f)(t, x, dx);
    }
}
