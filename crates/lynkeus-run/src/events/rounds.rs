//! One event, in rounds: what is due takes effect by what was before the round.

use lynkeus_expr::Reals;

use super::memory::{Memory, NONE};
use super::when::{Clauses, SAME, first_after};
use crate::error::state_text;
use crate::grid::Grid;
use crate::method::are_finite;
use crate::{Error, Result};

/// Most rounds of one event.
const ROUNDS: usize = 100;

/// The slopes of a jump.
#[derive(Clone, Debug, Default)]
pub struct JumpSlopes {
    /// ∂g/∂x, row by row
    pub(crate) by_state: Vec<f64>,
    /// ∂g/∂t
    pub(crate) by_time: Vec<f64>,
}

/// One event under way.
struct Rounds<'a> {
    clauses: &'a Clauses,
    /// what the system's code reads but for time and states; then those before, and timers
    inputs: Vec<f64>,
    x: &'a mut [f64],
    slopes: Option<&'a mut JumpSlopes>,
}

impl Clauses {
    /// Goes through the event at these inputs, of which the states are `x`: the condition that came to
    /// hold first, where the state may have jumped.
    pub(crate) fn happen(
        &self,
        inputs: &[f64],
        x: &mut [f64],
        memory: &mut Memory,
        slopes: Option<&mut JumpSlopes>,
    ) -> Result<Option<usize>> {
        let t = inputs[0];
        let mut inputs = inputs.to_vec();
        inputs.extend_from_slice(x);
        inputs.resize(inputs.len() + self.shape.timers.len(), 0.0);
        let mut rounds = Rounds {
            clauses: self,
            inputs,
            x,
            slopes,
        };
        rounds.begin();
        let start = rounds.x.to_vec();
        let is_first = !memory.is_started;
        if is_first {
            memory.begin(self, t);
            // what holds from the start on, equations of discrete variables included, is no event
            rounds.always(t, &rounds.kept())?;
            let now = rounds.x.to_vec();
            rounds.remember(&now);
            memory.truths = rounds.truths();
        }
        let mut first = None;
        let mut line = self.first_line();
        // what a round has changed is a change to the next one, too, which so sees an edge of it
        let (mut old, mut kept) = (rounds.x.to_vec(), rounds.kept());
        for round in 0..ROUNDS {
            let before = rounds.x.to_vec();
            let is_due = round == 0 && rounds.set_timers(memory, t, is_first);
            rounds.remember(&old);
            let slopes = rounds.kept();
            rounds.always(t, &kept)?;
            let truths = rounds.truths();
            let rises = |c: usize| truths[c] && !memory.truths[c];
            let rising: Vec<bool> = (0..truths.len()).map(rises).collect();
            memory.truths.clone_from(&truths);
            let mut place = 0;
            let mut done: Vec<usize> = vec![];
            for (k, clause) in self.shape.clauses.iter().enumerate() {
                let own = place..place + clause.conditions;
                place = own.end;
                let risen = own.clone().find(|&c| rising[c]);
                let Some(risen) = risen.filter(|_| !done.contains(&clause.group)) else {
                    continue;
                };
                done.push(clause.group);
                rounds.apply(k, t, &kept)?;
                line = clause.line;
                first.get_or_insert(risen);
            }
            if done.is_empty() && !is_due && before == *rounds.x && old == before {
                let has_moved = start != *rounds.x;
                return Ok(first.or(has_moved.then_some(NONE)));
            }
            rounds.clear_timers();
            (old, kept) = (before, slopes);
        }
        Err(Error::EndlessEvents {
            time: t,
            line,
            how: format!("its event leads to the next one, {ROUNDS} times at one instant"),
        })
    }
}

impl Rounds<'_> {
    fn begin(&mut self) {
        let n = self.x.len();
        if let Some(slopes) = &mut self.slopes {
            slopes.by_state = vec![0.0; n * n];
            (0..n).for_each(|i| slopes.by_state[i * n + i] = 1.0);
            slopes.by_time = vec![0.0; n];
        }
    }

    /// The first place of what is aside.
    fn aside(&self) -> usize {
        self.inputs.len() - self.x.len() - self.clauses.shape.timers.len()
    }

    /// The states before.
    fn remember(&mut self, before: &[f64]) {
        let aside = self.aside();
        self.inputs[aside..aside + before.len()].copy_from_slice(before);
    }

    fn set_timers(&mut self, memory: &mut Memory, t: f64, is_first: bool) -> bool {
        let first = self.inputs.len() - self.clauses.shape.timers.len();
        let mut is_due = false;
        for (k, timer) in self.clauses.shape.timers.iter().enumerate() {
            let is_now = match timer.is_initial {
                true => is_first,
                false => {
                    let grid = Grid::new(timer.start, timer.interval);
                    let due = grid.time(memory.timers[k]) <= t + SAME * t.abs();
                    if due {
                        memory.timers[k] = first_after(timer, t) + 1;
                    }
                    due
                }
            };
            self.inputs[first + k] = f64::from(u8::from(is_now));
            is_due |= is_now;
        }
        is_due
    }

    fn clear_timers(&mut self) {
        let first = self.inputs.len() - self.clauses.shape.timers.len();
        self.inputs[first..].fill(0.0);
    }

    fn now(&mut self) -> &[f64] {
        self.inputs[1..=self.x.len()].copy_from_slice(self.x);
        &self.inputs
    }

    fn truths(&mut self) -> Vec<bool> {
        let clauses = self.clauses;
        let values = clauses.conditions.eval_in(&Reals, self.now());
        values.iter().map(|value| *value != 0.0).collect()
    }

    /// The slopes of the states before the round.
    fn kept(&self) -> JumpSlopes {
        self.slopes.as_deref().cloned().unwrap_or_default()
    }

    /// The equations of discrete variables.
    fn always(&mut self, t: f64, kept: &JumpSlopes) -> Result<()> {
        let clauses = self.clauses;
        let all = clauses.shape.clauses.iter().enumerate();
        for (k, _) in all.filter(|(_, clause)| clause.conditions == 0) {
            self.apply(k, t, kept)?;
        }
        Ok(())
    }

    /// A clause takes effect.
    fn apply(&mut self, k: usize, t: f64, kept: &JumpSlopes) -> Result<()> {
        let clauses = self.clauses;
        let clause = &clauses.shape.clauses[k];
        let values = clauses.values[k].eval_in(&Reals, self.now());
        if !are_finite(&values) {
            return Err(Error::NotFinite {
                time: t,
                operation: format!("what the `when` of line {} gives", clause.line),
                state: state_text(&names(self.x.len()), self.x),
            });
        }
        if self.slopes.is_some() {
            self.carry(k, kept);
        }
        for (&place, value) in clause.changes.iter().zip(values) {
            self.x[place] = value;
        }
        Ok(())
    }

    fn carry(&mut self, k: usize, kept: &JumpSlopes) {
        let n = self.x.len();
        let clauses = self.clauses;
        let (tape, places) = &clauses.slopes[k];
        let entries = tape.eval_in(&Reals, self.now());
        let changes = &clauses.shape.clauses[k].changes;
        let Some(slopes) = &mut self.slopes else {
            return;
        };
        let mut rows = vec![vec![0.0; n]; changes.len()];
        let mut times = vec![0.0; changes.len()];
        for (entry, &(row, column)) in entries.iter().zip(places) {
            let from = match column {
                _ if column < n => Some((&**slopes, column)),
                _ if column < 2 * n => Some((kept, column - n)),
                _ => None,
            };
            let Some((from, j)) = from else {
                times[row] += entry;
                continue;
            };
            for (sum, part) in rows[row].iter_mut().zip(&from.by_state[j * n..(j + 1) * n]) {
                *sum += entry * part;
            }
            times[row] += entry * from.by_time[j];
        }
        for ((&place, row), time) in changes.iter().zip(rows).zip(times) {
            slopes.by_state[place * n..(place + 1) * n].copy_from_slice(&row);
            slopes.by_time[place] = time;
        }
    }
}

fn names(count: usize) -> Vec<String> {
    (1..=count).map(|i| format!("x[{i}]")).collect()
}

impl Clauses {
    /// How many states there are, before what a wrapper adds.
    pub(crate) fn states(&self) -> usize {
        self.states
    }

    /// Conditions for these inputs, where no timer is due and nothing was before.
    pub(crate) fn truths(&self, inputs: &[f64]) -> Result<Vec<bool>> {
        let mut x = inputs[1..=self.states].to_vec();
        let mut inputs = inputs.to_vec();
        inputs.extend_from_slice(&x);
        inputs.resize(inputs.len() + self.shape.timers.len(), 0.0);
        let t = inputs[0];
        let mut rounds = Rounds {
            clauses: self,
            inputs,
            x: &mut x,
            slopes: None,
        };
        rounds.always(t, &JumpSlopes::default())?;
        let now = rounds.x.to_vec();
        rounds.remember(&now);
        Ok(rounds.truths())
    }
}
