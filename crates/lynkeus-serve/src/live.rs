//! What the ways in share on which single values come: rows are made of them, and refusals are told now and then.

use std::collections::HashMap;

use crate::board::Board;
use crate::engine::{Arrival, Engine};
use crate::json::Message;
use crate::row::Stamp;

/// Refusals that are told one by one, and then only each such multiple.
const TOLD: u64 = 16;

/// Values before the first row of an asset, until there are enough for one.
#[derive(Debug, Default)]
pub(crate) struct Firsts(HashMap<usize, Held>);

/// By channel, the last value and when it was sampled.
type Held = Vec<Option<(f64, Stamp)>>;

impl Firsts {
    /// The row of a message that may be a part of one: none before there is enough for a first one. Assets that get
    /// theirs are added to `begun`.
    ///
    /// # Errors
    /// It is nobody's.
    pub fn row(
        &mut self,
        message: &Message,
        engine: &Engine,
        begun: &mut Vec<usize>,
    ) -> Result<Option<Arrival>, String> {
        let mut row = engine.arrival(message)?;
        if engine.has_begun(row.asset) {
            self.forget(row.asset);
        } else if !begun.contains(&row.asset) {
            match self.take(row.asset, message, engine) {
                Some((stamp, values)) => (row.stamp, row.values) = (stamp, values),
                None => return Ok(None),
            }
            begun.push(row.asset);
        }
        Ok(Some(row))
    }

    /// The first row of an asset, once there is enough for it: the newest time that a value has, the last values of
    /// known inputs, and of the sensors at whose first reading the estimate starts, and what else was read at that time.
    fn take(
        &mut self,
        asset: usize,
        message: &Message,
        engine: &Engine,
    ) -> Option<(Stamp, Vec<f64>)> {
        let stream = engine.stream(asset)?;
        let nothing = || vec![None; message.values.len()];
        let held = self.0.entry(asset).or_insert_with(nothing);
        for (own, value) in held.iter_mut().zip(&message.values) {
            let is_older =
                own.is_some_and(|(_, stamp): (f64, Stamp)| message.stamp.is_before(stamp));
            if value.is_finite() && !is_older {
                *own = Some((*value, message.stamp));
            }
        }
        let stamps = held.iter().flatten().map(|(_, stamp)| *stamp);
        let newest = stamps.reduce(|newest, stamp| match newest.is_before(stamp) {
            true => stamp,
            false => newest,
        })?;
        let channels = stream.channels.iter().enumerate();
        let values = held.iter().zip(channels).map(|(held, (place, channel))| {
            let is_held = !channel.is_sensor || stream.starts().contains(&place);
            let counts = |(_, stamp): &(f64, Stamp)| is_held || *stamp == newest;
            held.filter(counts).map_or(f64::NAN, |(value, _)| value)
        });
        let values: Vec<f64> = values.collect();
        if !stream.lacking(&values).is_empty() {
            return None;
        }
        Some((newest, values))
    }

    /// The asset has begun.
    fn forget(&mut self, asset: usize) {
        if !self.0.is_empty() {
            self.0.remove(&asset);
        }
    }
}

/// Why a message was not used; where there are many, now and then.
pub(crate) fn tell_refusal(
    (count, board): (u64, Option<&Board>),
    why: &str,
    tell: &mut dyn FnMut(&str),
) {
    if let Some(board) = board {
        board.refused();
    }
    if count <= TOLD {
        tell(why);
    } else if count.is_power_of_two() {
        tell(&format!("{why} ({count} such messages so far)"));
    }
}
