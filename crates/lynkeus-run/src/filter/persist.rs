//! What a filter's future depends on.

use super::{Belief, Engine, Filter};
use crate::snapshot::{Damaged, Persist, Walk};

impl Persist for Filter {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        match &mut self.engine {
            Engine::Extended(engine) => engine.walk(walk)?,
            Engine::Unscented(engine) => engine.walk(walk)?,
            Engine::MovingHorizon(horizon) => horizon.walk(walk)?,
        }
        if let Some(spare) = &mut self.spare {
            spare.flow.walk(walk)?;
        }
        self.belief.walk(walk)?;
        self.sensing.walk(walk)?;
        walk.numbers(&mut self.inputs)?;
        walk.numbers(&mut self.deviations)?;
        self.bound.walk(walk)?;
        let n = self.belief.x.len();
        walk.optional(&mut self.pending, |walk, pending| pending.walk(walk, n))
    }
}

impl Persist for Belief {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(&mut self.x)?;
        self.root.walk(walk)
    }
}

impl Filter {
    /// What the smoother keeps.
    pub fn walk_history(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        let n = self.belief.x.len();
        match &mut self.history {
            Some(history) => history.walk(walk, n),
            None => Ok(()),
        }
    }
}
