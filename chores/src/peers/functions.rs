//! Elementary functions in lanes: the third table.

use std::fmt::Write as _;

use super::elementary::names;
use super::peer::{Peer, compiled, short};
use super::programs::Programs;
use super::steps::WIDE;

/// # Errors
/// A program that cannot be compiled.
pub(super) fn peers(programs: &Programs) -> Result<Vec<Peer>, String> {
    let in_c = |name: &str, flags: &[&str]| {
        let flags = [flags, &["-ffast-math", "-lmvec"]].concat();
        compiled("functions.c", name, &flags)
    };
    let one_by_one = ["-O2", "-fno-builtin", "-ffp-contract=off"];
    let all = [
        ("Lynkeus, widest", programs.ours("functions")),
        ("libmvec, widest", in_c("functions-wide", &WIDE)?),
        ("Lynkeus, AVX2", programs.ours("functions-avx2")),
        (
            "libmvec, AVX2",
            in_c("functions-avx2", &["-O3", "-mavx2", "-mfma"])?,
        ),
        (
            "C, one by one",
            compiled("functions.c", "functions", &one_by_one)?,
        ),
    ];
    let all = all.into_iter();
    Ok(all
        .map(|(name, command)| Peer::new(name, command))
        .collect())
}

/// A row a function, a column a peer.
pub(super) fn table(peers: &[Peer]) -> String {
    let mut table = "| a value, ns |".to_owned();
    for peer in peers {
        let _ = write!(table, " {} |", peer.name);
    }
    table += "\n|---|";
    table += &"---|".repeat(peers.len());
    for name in names() {
        let _ = write!(table, "\n| {name} |");
        for peer in peers {
            let cell = peer.figure(name).map(|seconds| short(seconds * 1e9));
            let _ = write!(table, " {} |", cell.unwrap_or_default());
        }
    }
    table + "\n"
}
