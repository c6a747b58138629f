//! How fast an observer is along a run, and the steps that this allows.

use std::ops::ControlFlow;

use lynkeus_observers::{Monitor, Observer};
use lynkeus_run::{Dynamics, System, spectral_radius};

use crate::systems::Reported;

/// |λ|·h up to which the classical Runge–Kutta method is stable, with a little air.
const STABLE: f64 = 2.7;

/// Rows at which the Jacobian is looked at.
const LOOKS: usize = 64;

/// The observer with its states as its monitors, in their order, so that a run can be looked
/// into afterwards.
pub(super) fn transparent(observer: &Observer) -> Observer {
    let mut observer = observer.clone();
    let states = observer.states.iter();
    observer.monitors = states
        .map(|(signal, _)| Monitor {
            name: signal.name.clone(),
            node: signal.symbol,
            alarm_below: f64::NEG_INFINITY,
            meaning: String::new(),
        })
        .collect();
    observer
}

/// Writes the observer's signals at a row and its time; breaks off where there are none.
type Signals<'a> = dyn FnMut(usize, f64, &mut [f64]) -> ControlFlow<()> + 'a;

/// The longest step at which the classical Runge–Kutta method runs the observer stably at every
/// row looked at: 2.7 over the largest spectral radius of its Jacobian. `reported` is what the
/// [`transparent`] observer reported at the times of the rows; `signals` writes the
/// observer's signals at a row's time. None where the Jacobian is not defined.
pub(super) fn longest_step(
    observer: &System,
    times: &[f64],
    reported: Reported<'_>,
    signals: &mut Signals<'_>,
) -> Option<f64> {
    let count = observer.states().len();
    let columns: Option<Vec<&[f64]>> = (0..count).map(|i| reported.monitor(i)).collect();
    let columns = columns?;
    let mut evaluation = observer.evaluation();
    let mut fastest: f64 = 0.0;
    for look in 0..LOOKS.min(times.len()) {
        let row = look * times.len() / LOOKS.min(times.len());
        let t = *times.get(row)?;
        let x: Option<Vec<f64>> = columns.iter().map(|c| c.get(row).copied()).collect();
        if signals(row, t, evaluation.signals_mut()).is_break() {
            return None;
        }
        evaluation.enter(t);
        let radius = spectral_radius(&mut evaluation, t, &x?);
        if !radius.is_finite() {
            return None;
        }
        fastest = fastest.max(radius);
    }
    (fastest > 0.0).then(|| STABLE / fastest)
}
