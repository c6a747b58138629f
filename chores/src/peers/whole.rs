//! Whole processes: the clock, processor time and peak memory.

use std::fmt::Write as _;

use super::machine;
use super::peer::{Peer, measure};
use super::programs::Programs;

/// The table of some commands, in turn: of each figure the least over the rounds.
///
/// # Errors
/// A command that fails.
pub(super) fn table<const N: usize>(
    programs: &Programs,
    title: &str,
    commands: [(&str, Vec<String>); N],
    rounds: u64,
) -> Result<String, String> {
    let head = machine::described(&programs.python);
    let peer = |(name, command): (&str, Vec<String>)| Peer::new(name, programs.measured(&command));
    let mut peers = commands.map(peer);
    measure(&mut peers, rounds)?;
    let mut table =
        format!("{head}\n| {title} | clock, s | processor, s | peak, MB |\n|---|---|---|---|\n");
    for peer in &peers {
        let figure = |key| peer.figure(key).unwrap_or(f64::NAN);
        let [clock, processor, peak] = ["clock", "processor", "peak"].map(figure);
        let name = &peer.name;
        let _ = writeln!(
            table,
            "| {name} | {clock:.1} | {processor:.1} | {peak:.0} |"
        );
    }
    Ok(table)
}
