//! An event under way in an integration: why it came, and what it does to deviations.

use super::memory::{Memory, NONE};
use super::rounds::JumpSlopes;
use super::when::Cause;
use crate::{Dynamics, Error, Result};

/// γ̇ is nothing against what it is made of.
const GRAZING: f64 = 1e-9;

/// The event at `t`, in an interval of some length: `flipped` are the relations that changed. Whether the state has
/// jumped. What is at the end of an interval, where a row is, comes behind it: at the start of the next one.
pub(crate) fn occur(
    f: &mut dyn Dynamics,
    memory: &mut Memory,
    (t, length): (f64, f64),
    x: &mut [f64],
    flipped: &[usize],
) -> Result<bool> {
    let Some(clauses) = f.clauses() else {
        return Ok(false);
    };
    if !flipped.is_empty() && memory.is_at_end(t) {
        let mut now = vec![];
        f.watch(t, x, &mut now);
        memory.keep(flipped, &now);
        return Ok(false);
    }
    let old = x.to_vec();
    let mut before = vec![0.0; x.len()];
    f.derivatives(t, x, &mut before);
    let mut causes = flipped.to_vec();
    let mut late = vec![0.0; clauses.relations];
    let left = std::mem::take(&mut memory.left);
    if !left.is_empty() {
        let rates = f.rates(t, x, &before);
        let mut now = vec![];
        f.watch(t, x, &mut now);
        for (r, held) in left {
            // what a correction has taken back did not happen
            let seen = now.get(r).filter(|seen| seen.holds == held);
            if let (Some(seen), false) = (seen, causes.contains(&r)) {
                late[r] = (seen.value / rates[r]).clamp(0.0, length);
                causes.push(r);
            }
        }
    }
    // what somebody else has changed since the end of the last interval, which is looked at once
    let n = clauses.states;
    let last = std::mem::take(&mut memory.last);
    if memory.is_started && last.len() == n && last != x[..n] {
        let rates = f.rates(t, x, &before);
        let (mut was, mut now) = (vec![], vec![]);
        let mut there = x.to_vec();
        there[..n].copy_from_slice(&last);
        f.watch(t, &there, &mut was);
        f.watch(t, x, &mut now);
        let pairs = was.iter().zip(&now);
        let flips: Vec<bool> = pairs.map(|(a, b)| a.holds != b.holds).collect();
        let outward = now.iter().zip(&rates).map(|(seen, rate)| match seen.holds {
            true => *rate < 0.0,
            false => *rate > 0.0,
        });
        let outward: Vec<bool> = outward.collect();
        for (r, rate) in rates
            .iter()
            .enumerate()
            .filter(|(r, _)| flips[*r] && !outward[*r])
        {
            late[r] = (now[r].value / rate).clamp(0.0, length);
            causes.push(r);
        }
        let truths = f.truths(t, x)?;
        memory.rebase(&truths, &clauses.shape.needs, &outward, &flips);
    }
    // what the state causes by itself may be more than is allowed; the clock asks nobody
    if !causes.is_empty() && memory.is_spent() && !memory.is_due(&clauses, t) {
        return Ok(false);
    }
    let Some(condition) = f.happen(t, x, memory)? else {
        return Ok(false);
    };
    if !causes.is_empty() {
        memory.note();
    }
    let needs = clauses.shape.needs.get(condition);
    let mut own = causes
        .iter()
        .filter(|r| needs.is_none_or(|needs| needs.contains(r)));
    let relation = own.next().copied();
    memory.hurried(&clauses, t, condition, relation)?;
    let cause = relation.map(|relation| Cause {
        relation,
        rate: f.rates(t, &old, &before)[relation],
        late: late[relation],
    });
    f.restart(t, x);
    let mut after = vec![0.0; x.len()];
    f.derivatives(t, x, &mut after);
    let line = match condition {
        NONE => clauses.first_line(),
        condition => clauses.line_of(condition),
    };
    f.settle((t, &old), x, [&before, &after], cause, line)?;
    Ok(true)
}

/// What an event does to deviations: the saltation matrix, row by row, and how far the state has to be moved
/// for an event that is late. The rates before and after the event are those of the states.
///
/// # Errors
/// [`Error::Grazing`] where the time of the event is not told by the state.
pub(crate) fn saltation(
    slopes: &JumpSlopes,
    gradient: &[f64],
    [before, after]: [&[f64]; 2],
    cause: Option<Cause>,
    (t, line): (f64, usize),
) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = slopes.by_time.len();
    let mut matrix = slopes.by_state.clone();
    let mut moved = vec![0.0; n];
    let Some(cause) = cause else {
        return Ok((matrix, moved));
    };
    let off = |i: usize| {
        let row = &slopes.by_state[i * n..(i + 1) * n];
        let carried: f64 = row.iter().zip(before).map(|(g, f)| g * f).sum();
        after[i] - carried - slopes.by_time[i]
    };
    let off: Vec<f64> = (0..n).map(off).collect();
    if off.iter().all(|off| *off == 0.0) {
        return Ok((matrix, moved));
    }
    let made: f64 = gradient
        .iter()
        .zip(before)
        .map(|(c, f)| (c * f).abs())
        .sum();
    if cause.rate.abs() <= GRAZING * made || cause.rate == 0.0 {
        let touches = gradient.iter().any(|c| *c != 0.0);
        if touches {
            return Err(Error::Grazing { time: t, line });
        }
        return Ok((matrix, moved));
    }
    for i in 0..n {
        for (entry, c) in matrix[i * n..(i + 1) * n].iter_mut().zip(gradient) {
            *entry += off[i] * c / cause.rate;
        }
        moved[i] = off[i] * cause.late;
    }
    Ok((matrix, moved))
}
