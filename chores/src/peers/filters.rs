//! A sample of an extended Kalman filter: the second table.

use std::fmt::Write as _;

use super::log::{EKF, in_c, ours, write_log};
use super::peer::{Peer, compiled, short};
use super::programs::Programs;

/// Numbers of states.
const CELLS: [usize; 3] = [4, 8, 25];

/// Rows of a log that is read and written as text, and of one that is not.
const TEXT_ROWS: u64 = 200_000;
const ROWS: &str = "10000";

/// Beginnings of the keys of what ends alike: P by Φ and W, or by an equation of its own.
pub(super) const WAYS: [&str; 2] = ["by transition", "by covariance"];

/// By so much of its value do the two differ where a step of Runge and Kutta is as long as here.
pub(super) const BETWEEN_WAYS: f64 = 2e-5;

const OURS: &str = "Lynkeus";
const OURS_AS_TEXT: &str = "Lynkeus, CSV to CSV";
const C_AS_TEXT: &str = "C as text";

/// How C is compiled.
const FLAGS: [(&str, &[&str]); 3] = [
    ("-O2", &["-O2", "-ffp-contract=off"]),
    (
        "-O3 -march=native",
        &["-O3", "-march=native", "-ffp-contract=off"],
    ),
    (
        "-O3 -march=native, fast-math",
        &["-O3", "-march=native", "-ffast-math"],
    ),
];

/// A row of the table: its title, whose figure and which.
struct Row {
    title: String,
    peer: &'static str,
    key: &'static str,
    /// samples that a figure is of
    samples: u64,
}

impl Row {
    fn new(title: &str, peer: &'static str, key: &'static str) -> Self {
        Self {
            title: title.to_owned(),
            peer,
            key,
            samples: 1,
        }
    }

    fn line(&self, peers: &[Peer]) -> String {
        let mut line = format!("| {} |", self.title);
        for n in CELLS {
            let key = format!("{} {n}", self.key);
            let mut own = peers.iter().filter(|peer| peer.name == self.peer);
            let figure = own.find_map(|peer| peer.figure(&key));
            let cell = figure.map(|seconds| short(seconds / self.samples as f64 * 1e6));
            let _ = write!(line, " {} |", cell.unwrap_or_default());
        }
        line + "\n"
    }
}

/// # Errors
/// A program that cannot be compiled, or a log that cannot be written.
pub(super) fn peers(programs: &Programs) -> Result<Vec<Peer>, String> {
    let mut peers = vec![Peer::new(OURS, programs.ours("filters"))];
    for (place, (name, flags)) in FLAGS.iter().enumerate() {
        for n in CELLS {
            let define = format!("-DN={n}");
            let flags = [*flags, &[&define]].concat();
            let mut command = compiled("ekf.c", &format!("ekf-{place}-{n}"), &flags)?;
            command.push(ROWS.to_owned());
            peers.push(Peer::new(name, command).with_suffix(n));
        }
    }
    let log = write_log(programs, TEXT_ROWS)?;
    for n in CELLS {
        let place = |whose: &str| programs.folder.join(format!("{whose}-{n}.csv"));
        let [own, other] = ["chain-ours", "chain-c"].map(place);
        let commands = [
            (
                OURS_AS_TEXT,
                ours(programs, n, EKF, (&log, &own))?,
                own,
                WAYS[0],
            ),
            (C_AS_TEXT, in_c(n, (&log, &other))?, other, WAYS[1]),
        ];
        for (name, command, table, way) in commands {
            let peer = Peer::new(name, programs.measured(&command)).with_suffix(n);
            peers.push(peer.with_table(format!("{way}, as text {n}"), table));
        }
    }
    for library in ["numba", "filterpy", "jax"] {
        let command = programs.script("filters.py", &[library]);
        peers.push(Peer::new(library, command));
    }
    Ok(peers)
}

fn rows() -> Vec<Row> {
    let as_text = |title: &str, peer| Row {
        samples: TEXT_ROWS,
        ..Row::new(title, peer, "processor")
    };
    let in_c = |what: &'static str, key| {
        let row =
            move |(name, _): &(&'static str, _)| Row::new(&format!("C, {what}, {name}"), name, key);
        FLAGS.iter().map(row)
    };
    let mut rows = vec![Row::new("Lynkeus", OURS, "sample")];
    rows.extend(in_c("a root of P", "root"));
    rows.extend(in_c("P itself", "plain"));
    rows.extend([
        Row::new("numba, P itself", "numba", "sample"),
        Row::new("FilterPy (NumPy)", "filterpy", "sample"),
        as_text("Lynkeus, CSV to CSV", OURS_AS_TEXT),
        as_text("C, P itself, CSV to CSV", C_AS_TEXT),
        Row::new("1,000 filters: Lynkeus, one after the other", OURS, "fleet"),
        Row::new(
            "1,000 filters: … in the first 50 rows of each",
            OURS,
            "fleet at first",
        ),
        Row::new(
            "1,000 filters: Lynkeus, side by side in lanes",
            OURS,
            "fleet in lanes",
        ),
        Row::new("1,000 filters: JAX, `vmap`", "jax", "fleet"),
        Row::new(
            "1,000 filters: JAX, `vmap`, F's bands written out",
            "jax",
            "fleet by bands",
        ),
    ]);
    rows
}

pub(super) fn table(peers: &[Peer]) -> String {
    let titles = CELLS.map(|n| format!(" n = {n}, µs |")).concat();
    let lines: String = rows().iter().map(|row| row.line(peers)).collect();
    format!("| a sample of a filter |{titles}\n|---|---|---|---|\n{lines}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row whose figures nobody measures would stay empty.
    #[test]
    fn every_row_has_a_peer() {
        let of_c = FLAGS.iter().map(|(name, _)| *name);
        let others = [OURS, OURS_AS_TEXT, C_AS_TEXT, "numba", "filterpy", "jax"];
        let names: Vec<&str> = of_c.chain(others).collect();
        for row in rows() {
            assert!(names.contains(&row.peer), "{}", row.title);
        }
    }
}
