//! What a filter keeps for its smoother, and what that makes of it.

use super::root::Packed;
use super::smooth::{Smoothed, Step};
use super::{Engine, Filter, confine};

impl Filter {
    /// The estimate at each update given later ones, up to `lag` of them; none without history,
    /// and where a window reaches back less far than `lag`.
    pub fn smoothed(&self, lag: Option<usize>, deviations: bool) -> Option<Vec<Smoothed>> {
        let history = self.history.as_ref()?;
        let Engine::MovingHorizon(horizon) = &self.engine else {
            return Some(history.smoothed(&[], lag, deviations));
        };
        if lag.is_some_and(|lag| lag > horizon.length()) {
            return None;
        }
        let newest = horizon.steps(&self.sensing)?;
        let mut rows = history.smoothed(&newest, lag, deviations);
        if let Some(lag) = lag {
            // as it was known then: the rows kept are linearised about what was known later
            for (row, x) in rows
                .iter_mut()
                .zip(history.in_windows(self.belief.x.len(), lag))
            {
                row.estimate.copy_from_slice(x);
            }
        }
        for row in &mut rows {
            confine(&mut row.estimate, horizon.bounds());
        }
        Some(rows)
    }

    /// Keeps the last update for the smoother.
    pub fn remember(&mut self) {
        let corrections = self.sensing.take_corrections();
        let transition = self.pending.take();
        let Some(history) = &mut self.history else {
            return;
        };
        if let Engine::MovingHorizon(horizon) = &mut self.engine {
            let done = horizon.take_done();
            history.push_window(done.window);
            done.left.into_iter().for_each(|step| history.push(step));
            return;
        }
        history.push(Step {
            transition,
            x: self.belief.x.clone(),
            root: Packed::of(&self.belief.root),
            corrections,
        });
    }

    /// Whether the smoother needs the transition between two updates; a window finds its own.
    pub(super) fn keeps_transitions(&self) -> bool {
        self.history.is_some() && !matches!(self.engine, Engine::MovingHorizon(_))
    }
}
