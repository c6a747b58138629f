//! A sigma point on its way: the flow alone, through the events that it meets.

use std::sync::Arc;

use crate::events::{Cause, Clauses, JumpSlopes, Memory, Seen};
use crate::{Dynamics, Error, Evaluation, Events, Result, Slopes};

/// A flow whose state is moved where an event is late: a point may be drawn beyond a surface that it
/// was to meet, and has then jumped where it would have met it.
pub(super) struct Point<'a> {
    driven: &'a mut Evaluation,
    jump: JumpSlopes,
}

impl<'a> Point<'a> {
    pub fn new(driven: &'a mut Evaluation) -> Self {
        Self {
            driven,
            jump: JumpSlopes::default(),
        }
    }
}

impl Dynamics for Point<'_> {
    fn dimension(&self) -> usize {
        self.driven.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.driven.derivatives(t, x, dx);
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.driven.slopes(t, x, slopes)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.driven.events()
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.driven.clauses()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        self.driven.watch(t, x, seen);
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        self.driven.rates(t, x, dx)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>> {
        self.driven.truths(t, x)
    }

    fn happen(&mut self, t: f64, x: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        self.driven.jump(t, x, memory, Some(&mut self.jump))
    }

    fn settle(
        &mut self,
        (t, x): (f64, &[f64]),
        jumped: &mut [f64],
        rates: [&[f64]; 2],
        cause: Option<Cause>,
        line: usize,
    ) -> Result<()> {
        let jump = &self.jump;
        // a surface that is touched decides of deviations, and a point has none
        if let Ok((_, moved)) = self.driven.saltation((t, x), jump, rates, cause, line) {
            jumped
                .iter_mut()
                .zip(moved)
                .for_each(|(x, moved)| *x += moved);
        }
        Ok(())
    }

    fn names(&self) -> Vec<String> {
        self.driven.names()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.driven.not_finite(t, x)
    }
}
