//! Calls among operations that do not wait for them. A processor begins what stands behind a long chain when it has room for it, some
//! hundred operations ahead: calls that only other outputs need stand between those of the chain, where few values are
//! under way, since a call empties the registers.

use crate::record::{Id, Program, Value};

/// Most places at which there are calls.
const PLACES: usize = 4;

fn is_leaf(value: Value) -> bool {
    matches!(value, Value::Input(_) | Value::Constant(_))
}

/// What nothing needs but outputs that are made by calls; none where no output is made without.
pub(crate) fn aside(program: &Program, is_call: &impl Fn(Value) -> bool) -> Vec<bool> {
    let count = program.values.len();
    let (mut calls, mut needed) = (vec![false; count], [vec![false; count], vec![false; count]]);
    for (i, &value) in program.values.iter().enumerate() {
        calls[i] = is_call(value) || matches!(value, Value::Entry(..));
        program.each_argument(value, |argument| calls[i] |= calls[argument as usize]);
    }
    for &output in &program.outputs {
        let by_calls = calls[output as usize];
        needed[usize::from(by_calls)][output as usize] = true;
    }
    let is_alone = |output: &Id| !calls[*output as usize] && !is_leaf(program.values[*output as usize]);
    if !program.outputs.iter().any(is_alone) {
        return vec![false; count];
    }
    for needed in &mut needed {
        for (i, &value) in program.values.iter().enumerate().rev() {
            if needed[i] {
                program.each_argument(value, |argument| needed[argument as usize] = true);
            }
        }
    }
    let [alone, by_calls] = needed;
    let pairs = alone.into_iter().zip(by_calls).zip(&program.values);
    pairs
        .map(|((alone, by_calls), &value)| by_calls && !alone && !is_leaf(value))
        .collect()
}

/// The operations `order`, and between them those aside, cut behind each call.
pub(crate) fn woven(
    program: &Program,
    order: &[Id],
    aside: &[Id],
    is_call: &impl Fn(Value) -> bool,
) -> Vec<Id> {
    let is_end = |id: &Id| is_call(program.values[*id as usize]);
    let pieces: Vec<&[Id]> = aside.split_inclusive(is_end).collect();
    let first = order.iter().take_while(|id| is_leaf(program.values[**id as usize])).count();
    let live = live(program, order);
    let mut placed = vec![usize::MAX; program.values.len()];
    for (place, &id) in order.iter().enumerate() {
        placed[id as usize] = place;
    }
    let places = pieces.len().min(PLACES);
    let (mut result, mut done) = (vec![], 0);
    for (k, piece) in pieces.iter().enumerate() {
        let window = |place: usize| first + (order.len() - first) * place / places;
        let place = k * places / pieces.len();
        let quietest = (window(place)..window(place + 1)).min_by_key(|&at| live[at]);
        let mut at = quietest.unwrap_or(order.len()).max(done);
        for &id in *piece {
            program.each_argument(program.values[id as usize], |argument| {
                let place = placed[argument as usize];
                if place != usize::MAX {
                    at = at.max(place + 1);
                }
            });
        }
        result.extend_from_slice(&order[done..at]);
        result.extend_from_slice(piece);
        done = at;
    }
    result.extend_from_slice(&order[done..]);
    result
}

/// How many values wait for a use before each operation.
fn live(program: &Program, order: &[Id]) -> Vec<i32> {
    let mut last = vec![0; program.values.len()];
    for (place, &id) in order.iter().enumerate() {
        program.each_argument(program.values[id as usize], |argument| {
            last[argument as usize] = place;
        });
    }
    let mut change = vec![0; order.len() + 2];
    for (place, &id) in order.iter().enumerate() {
        if last[id as usize] > place && !is_leaf(program.values[id as usize]) {
            change[place + 1] += 1;
            change[last[id as usize] + 1] -= 1;
        }
    }
    let mut live = 0;
    let all = change.into_iter().map(|change| {
        live += change;
        live
    });
    all.collect()
}
