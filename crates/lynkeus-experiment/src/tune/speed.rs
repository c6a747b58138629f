//! How fast an observer is along a run, and the steps that this allows.

use lynkeus_observers::{Monitor, Observer};
use lynkeus_run::{Events, System, spectral_radius};

/// |λ|·h up to which the classical Runge–Kutta method is stable, with a little air.
const STABLE: f64 = 2.7;

/// Rows at which the Jacobian is looked at.
const LOOKS: usize = 64;

/// The observer with its states as its monitors, in their order, so that a run can be looked
/// into afterwards; what says how far a matrix is from singular comes last.
pub(super) fn transparent(observer: &Observer) -> Observer {
    let mut observer = observer.clone();
    let margins = std::mem::take(&mut observer.monitors).into_iter();
    let states = observer.states.iter();
    observer.monitors = states
        .map(|(signal, _)| Monitor {
            name: signal.name.clone(),
            node: signal.symbol,
            alarm_below: f64::NEG_INFINITY,
            meaning: String::new(),
            matrix: None,
        })
        .chain(margins.filter(|monitor| monitor.matrix.is_some()))
        .collect();
    observer
}

/// Writes the observer's states and signals at a row and gives its time; none where they are not
/// known.
type Look<'a> = dyn FnMut(usize, &mut [f64], &mut [f64]) -> Option<f64> + 'a;

/// The longest step at which the classical Runge–Kutta method runs the observer stably at every
/// of so many rows looked at: 2.7 over the largest spectral radius of its Jacobian. None where
/// the Jacobian is not defined.
pub(super) fn longest_step(observer: &System, rows: usize, look: &mut Look<'_>) -> Option<f64> {
    let mut x = vec![0.0; observer.states().len()];
    let mut evaluation = observer.evaluation();
    let mut fastest: f64 = 0.0;
    let looks = LOOKS.min(rows);
    for place in 0..looks {
        let t = look(place * rows / looks, &mut x, evaluation.signals_mut())?;
        evaluation.enter(t);
        let radius = spectral_radius(&mut evaluation, t, &x);
        if !radius.is_finite() {
            return None;
        }
        fastest = fastest.max(radius);
    }
    (fastest > 0.0).then(|| STABLE / fastest)
}
