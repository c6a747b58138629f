//! Where a simulation stops.

use std::collections::VecDeque;

use crate::grid::Grid;
use crate::{Error, Simulation, process_draws};

/// Most cells of a trajectory (8 bytes each).
const MOST_CELLS: f64 = 4e8;

/// What a simulation does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    /// the next noise sample is drawn
    Draw,
    /// what moves the states is drawn anew, between two samples
    Stir,
    /// time goes on
    Advance { from: f64, to: f64 },
    /// a row is recorded
    Row(f64),
}

/// The rows and samples of a simulation, in order.
#[derive(Clone, Debug)]
pub(crate) struct Itinerary {
    grid: Grid,
    start: f64,
    until: f64,
    intervals: usize,
    sample_step: f64,
    /// draws of process noise from one sample to the next
    draws: usize,
    is_exact: bool,
    /// draws so far, those of samples and those in between
    drawn: usize,
    /// the next row
    row: usize,
    /// the time of the last stop
    reached: f64,
    planned: VecDeque<Stop>,
}

impl Itinerary {
    /// Of a simulation; without noise nothing but the first sample is drawn.
    ///
    /// # Errors
    /// [`Error::Setting`] for times and steps that cannot be.
    pub fn new(simulation: &Simulation) -> Result<Self, Error> {
        let intervals = intervals(simulation)?;
        let sample_step = sample_step(simulation)?;
        Ok(Self {
            grid: Grid::new(simulation.start, simulation.output_step),
            start: simulation.start,
            until: simulation.until,
            intervals,
            sample_step,
            draws: draws(simulation)?,
            is_exact: false,
            drawn: 0,
            row: 0,
            reached: simulation.start,
            planned: VecDeque::new(),
        })
    }

    /// Without samples between the rows.
    pub fn exact(mut self, is_exact: bool) -> Self {
        self.is_exact = is_exact;
        self
    }

    /// The time for which process noise is held.
    pub fn hold(&self) -> f64 {
        self.sample_step / self.draws as f64
    }

    /// Number of intervals between rows.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Time of row k.
    pub fn time(&self, k: usize) -> f64 {
        if k == self.intervals {
            self.until
        } else {
            self.grid.time(k)
        }
    }

    /// Plans up to the next draw or row; a draw due at a row is made there.
    fn plan(&mut self) {
        let Some(before) = self.row.checked_sub(1) else {
            self.draw();
            return self.arrive(self.start);
        };
        let (from, to) = (self.time(before), self.time(self.row));
        // a draw and a row at the same time may differ by rounding
        let same = 1e-9 * (to - from).min(self.hold());
        let due = self.start + self.due();
        if self.is_exact || due > to + same {
            self.advance(to);
            return self.arrive(to);
        }
        self.advance(if due > to - same { to } else { due });
        self.draw();
    }

    /// How long after the start the next draw is.
    fn due(&self) -> f64 {
        let (samples, rest) = (self.drawn / self.draws, self.drawn % self.draws);
        (samples as f64 + rest as f64 / self.draws as f64) * self.sample_step
    }

    fn draw(&mut self) {
        let is_sample = self.drawn.is_multiple_of(self.draws);
        let stop = if is_sample { Stop::Draw } else { Stop::Stir };
        self.planned.push_back(stop);
        self.drawn += 1;
    }

    fn arrive(&mut self, t: f64) {
        self.planned.push_back(Stop::Row(t));
        self.row += 1;
    }

    fn advance(&mut self, to: f64) {
        let from = self.reached;
        if to > from {
            self.planned.push_back(Stop::Advance { from, to });
            self.reached = to;
        }
    }
}

impl Iterator for Itinerary {
    type Item = Stop;

    fn next(&mut self) -> Option<Stop> {
        if self.planned.is_empty() && self.row <= self.intervals {
            self.plan();
        }
        self.planned.pop_front()
    }
}

/// Number of intervals between rows.
fn intervals(simulation: &Simulation) -> Result<usize, Error> {
    let Simulation {
        start,
        until,
        output_step,
        ..
    } = simulation;
    if !start.is_finite() {
        return Err(Error::setting("start", "a finite time", start));
    }
    if !(until.is_finite() && until > start) {
        let expected = format!("a finite time after the start {start}");
        return Err(Error::setting("until", expected, until));
    }
    if !(*output_step > 0.0 && output_step.is_finite()) {
        return Err(Error::setting(
            "output_step",
            "a finite time above 0",
            output_step,
        ));
    }
    let intervals = ((until - start) / output_step * (1.0 - 1e-12))
        .ceil()
        .max(1.0);
    let cells = intervals * (1 + simulation.plant.states().len()) as f64;
    if cells > MOST_CELLS {
        let expected = format!("a step that makes fewer than {MOST_CELLS:e} values");
        let found = format!("{output_step}, which makes {cells:e}");
        return Err(Error::setting("output_step", expected, found));
    }
    Ok(intervals as usize)
}

/// Draws of process noise from one sample to the next.
fn draws(simulation: &Simulation) -> Result<usize, Error> {
    match simulation.noise.process_draws {
        Some(0) => Err(Error::setting("process_draws", "at least 1 per sample", 0)),
        Some(draws) => Ok(draws),
        None => Ok(process_draws(simulation).per_sample),
    }
}

fn sample_step(simulation: &Simulation) -> Result<f64, Error> {
    let sample_step = simulation
        .noise
        .sample_step
        .unwrap_or(simulation.output_step);
    if !(sample_step > 0.0 && sample_step.is_finite()) {
        let expected = "a finite time above 0";
        return Err(Error::setting("sample_step", expected, sample_step));
    }
    let samples = (simulation.until - simulation.start) / sample_step;
    if samples > MOST_CELLS {
        let expected = format!("a step that makes fewer than {MOST_CELLS:e} samples");
        return Err(Error::setting("sample_step", expected, sample_step));
    }
    Ok(sample_step)
}
