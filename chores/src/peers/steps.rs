//! Steps of plant and observer of Lee's example: the first table.

use std::fmt::Write as _;

use super::peer::{Peer, compiled, short};
use super::programs::Programs;

/// What a compiler needs to know for the widest vectors of this machine: by itself it takes narrower ones.
pub(super) const WIDE: [&str; 3] = ["-O3", "-march=native", "-mprefer-vector-width=512"];

/// Columns of the table: the key of the JSON, what it says, and how many of its unit a second has.
const FIGURES: [(&str, &str, f64); 4] = [
    ("step", "one step, ns", 1e9),
    ("batch", "one step in a batch, ns", 1e9),
    ("own", "… with sin and exp of its own, ns", 1e9),
    ("adaptive", "[0, 20] at 1e-8, ms", 1e3),
];

/// The last column: the largest error of a state at the end of the adaptive run.
const ERROR: &str = "error";

/// # Errors
/// A program that cannot be compiled.
pub(super) fn peers(programs: &Programs) -> Result<Vec<Peer>, String> {
    let library = |name: &str| programs.script("peers.py", &[name]);
    let ours = |backend: &str| programs.ours(backend);
    let alone = |name: &str, flags: &[&str]| compiled("lee.c", name, flags);
    let lanes = |name: &str, flags: &[&str]| compiled("lanes.c", name, flags);
    let own = ["-DOWN", "-lmvec"];
    let all = [
        ("Lynkeus, machine code", ours("native")),
        ("Lynkeus, machine code, fused", ours("fused")),
        ("Lynkeus, interpreter", ours("interpreter")),
        ("Lynkeus, lanes", ours("lanes")),
        ("Lynkeus, lanes, fused", ours("lanes-fused")),
        ("C, -O2", alone("lee", &["-O2", "-ffp-contract=off"])?),
        (
            "C, -O3 -march=native",
            alone("lee-native", &["-O3", "-march=native", "-ffp-contract=off"])?,
        ),
        (
            "C, -O3 -march=native, fused",
            alone("lee-fused", &["-O3", "-march=native"])?,
        ),
        (
            "C, -O3 -march=native, fast-math",
            alone("lee-fast", &["-O3", "-march=native", "-ffast-math"])?,
        ),
        (
            "C in lanes, AVX2",
            lanes("lanes", &["-O3", "-mavx2", "-ffp-contract=off"])?,
        ),
        (
            "C in lanes, widest",
            lanes("lanes-wide", &[&WIDE[..], &["-ffp-contract=off"]].concat())?,
        ),
        (
            "C in lanes, widest, fast-math",
            lanes("lanes-fast", &[&WIDE[..], &["-ffast-math"]].concat())?,
        ),
        (
            "C in lanes, AVX2, fast-math, libmvec",
            lanes(
                "lanes-own",
                &[&["-O3", "-mavx2", "-ffast-math"], &own[..]].concat(),
            )?,
        ),
        (
            "C in lanes, widest, fast-math, libmvec",
            lanes(
                "lanes-own-wide",
                &[&WIDE[..], &["-ffast-math"], &own].concat(),
            )?,
        ),
        ("numba", library("numba")),
        ("JAX", library("jax")),
        ("CasADi (CVODES)", library("casadi")),
        ("diffrax (Dopri8)", library("diffrax")),
        ("SciPy (DOP853)", library("scipy")),
    ];
    let all = all.into_iter();
    Ok(all
        .map(|(name, command)| Peer::new(name, command))
        .collect())
}

pub(super) fn table(peers: &[Peer]) -> String {
    let mut head = "| |".to_owned();
    let mut rule = "|---|".to_owned();
    for title in FIGURES
        .map(|(_, title, _)| title)
        .iter()
        .chain(&["its error"])
    {
        let _ = write!(head, " {title} |");
        rule += "---|";
    }
    let lines: String = peers.iter().map(line).collect();
    format!("{head}\n{rule}\n{lines}")
}

fn line(peer: &Peer) -> String {
    let mut line = format!("| {} |", peer.name);
    for (key, _, per_second) in FIGURES {
        let cell = peer.figure(key).map(|seconds| short(seconds * per_second));
        let _ = write!(line, " {} |", cell.unwrap_or_default());
    }
    let error = peer.figure(ERROR).map(|error| format!("{error:.0e}"));
    line + &format!(" {} |\n", error.unwrap_or_default())
}
