//! The papers' figures, drawn again by the tool from the shipped studies: `target/figures/<paper>-<n>.svg`.
//!
//! What a figure shows of two simulations belongs together: starts and inputs are the same. A trajectory that was computed
//! apart from this project is shown where it is at hand.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use lynkeus::plot::{Figure, Kind, Panel, Scale};
use xtask::process::{cargo, root, run, target};

/// What a curve shows.
#[derive(Clone, Copy)]
enum Shown {
    /// a column of the table
    Column(&'static str),
    /// the estimate of a quantity less the quantity
    Error(&'static str),
}

/// A curve, or the points of a trajectory that was computed apart.
#[derive(Clone, Copy)]
struct Curve {
    /// a study below `examples`, or a table of reference trajectories
    source: &'static str,
    shown: Shown,
    kind: Kind,
}

/// The kinds of curves with their words.
const KINDS: [(Kind, &str); 4] = [
    (PLANT, "plant"),
    (ESTIMATE, "estimate"),
    (COMPARED, "compared with"),
    (APART, "computed apart"),
];
const PLANT: Kind = Kind::True;
const ESTIMATE: Kind = Kind::Estimated;
const COMPARED: Kind = Kind::Smoothed;
const APART: Kind = Kind::Measured;

/// One figure of a paper.
struct Published {
    file: String,
    title: String,
    curves: Vec<Curve>,
}

/// Draws every figure.
pub fn draw() -> Result<(), String> {
    run(&mut cargo(&["build", "--release", "-p", "lynkeus-cli"]))?;
    let folder = target().join("figures");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut tables = HashMap::new();
    for figure in figures() {
        let mut drawn = vec![];
        for curve in &figure.curves {
            let table = match tables.entry(curve.source) {
                std::collections::hash_map::Entry::Occupied(known) => known.into_mut(),
                std::collections::hash_map::Entry::Vacant(free) => {
                    free.insert(table(curve.source)?)
                }
            };
            let Some(table) = table else { continue };
            drawn.push((curve.kind, points(table, curve.shown)?));
        }
        let path = folder.join(format!("{}.svg", figure.file));
        let text = svg(figure.title, &drawn)?;
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        eprintln!("drew {}", path.display());
    }
    Ok(())
}

/// The figures of the five papers, by paper and number.
fn figures() -> Vec<Published> {
    let curve = |source, shown, kind| Curve {
        source,
        shown,
        kind,
    };
    let mut all = vec![];
    let mut add = |file: String, title: String, curves: Vec<Curve>| {
        all.push(Published {
            file,
            title,
            curves,
        });
    };
    for (i, x) in ["x1", "x2", "x3", "x4"].into_iter().enumerate() {
        add(
            format!("lee-{}", i + 1),
            format!(
                "Lee, Yee, Park, figure {}: error of {x} by (7), compared with (3)",
                i + 1
            ),
            vec![
                curve("lee/study.toml", Shown::Error(x), ESTIMATE),
                curve("lee/classical.toml", Shown::Error(x), COMPARED),
                curve("lee_observer7.csv", Shown::Error(x), APART),
                curve("lee_observer3.csv", Shown::Error(x), APART),
            ],
        );
    }
    let germani = [("x1", "x1_hat"), ("x2", "x2_hat"), ("x3", "x3_hat")];
    for (i, (x, hat)) in germani.into_iter().enumerate() {
        let practical = "germani-manes/practical.toml";
        add(
            format!("germani-manes-{}", i + 1),
            format!(
                "Germani, Manes, figure {}: {x} and its estimate by (4.22), compared with (4.1)",
                i + 1
            ),
            vec![
                curve(practical, Shown::Column(x), PLANT),
                curve(practical, Shown::Column(hat), ESTIMATE),
                curve(
                    "germani-manes/theoretical.toml",
                    Shown::Column(hat),
                    COMPARED,
                ),
                curve("germani_theoretical.csv", Shown::Column(hat), APART),
            ],
        );
    }
    for (x, hat) in [("x4", "x4_hat"), ("x5", "x5_hat"), ("v", "v_hat")] {
        let noisy = "farza/study-noise.toml";
        add(
            format!("farza-1-{x}"),
            format!("Farza et al., figure 1: {x} and its estimate, with noise"),
            vec![
                curve(noisy, Shown::Column(x), PLANT),
                curve(noisy, Shown::Column(hat), ESTIMATE),
                curve("farza_a1.csv", Shown::Column(hat), APART),
            ],
        );
    }
    for (x, hat) in [("x2", "x2_hat"), ("x3", "x3_hat")] {
        let noisy = "ltaief/study-noise.toml";
        add(
            format!("ltaief-2-{x}"),
            format!(
                "Ltaief et al., figure 2: {x} and its estimate, with noise (theta = 1), compared with theta = 10"
            ),
            vec![
                curve(noisy, Shown::Column(x), PLANT),
                curve(noisy, Shown::Column(hat), ESTIMATE),
                curve("ltaief/study.toml", Shown::Column(hat), COMPARED),
                curve("ltaief_theta10.csv", Shown::Column(hat), APART),
            ],
        );
    }
    let column = [
        (3, "column/study-peaking.toml", "theta = 4.8"),
        (4, "column/study-noise-sensitive.toml", "noisy, theta = 4.2"),
        (5, "column/study.toml", "theta = 3.5"),
        (6, "column/study-noise.toml", "noisy, theta = 3.5"),
    ];
    for (number, study, what) in column {
        for (name, x, hat) in [("x6", "x[6]", "x[6]_hat"), ("Zf", "Zf", "Zf_hat")] {
            let mut curves = vec![
                curve(study, Shown::Column(x), PLANT),
                curve(study, Shown::Column(hat), ESTIMATE),
            ];
            if number == 5 {
                let reference = if name == "x6" { "x6_hat" } else { "Zf_hat" };
                curves.push(curve(
                    "hammouri_theta3.5.csv",
                    Shown::Column(reference),
                    APART,
                ));
            }
            add(
                format!("hammouri-{number}-{name}"),
                format!("Hammouri, Targui, Armanet, figure {number}: {x} and its estimate, {what}"),
                curves,
            );
        }
    }
    all
}

/// Header and rows.
type Table = (Vec<String>, Vec<Vec<f64>>);

/// What a study simulates, or a trajectory that was computed apart; none where that is not at hand.
fn table(source: &str) -> Result<Option<Table>, String> {
    let text = match source.ends_with(".csv") {
        true => {
            let path = root().join("../shared/reference").join(source);
            match fs::read_to_string(&path) {
                Ok(text) => text,
                Err(_) => {
                    eprintln!("skipped: {source} is not at hand");
                    return Ok(None);
                }
            }
        }
        false => simulated(&root().join("examples").join(source))?,
    };
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default().split(',');
    let header = header
        .map(|name| name.trim_matches('"').to_owned())
        .collect();
    let row = |line: &str| {
        line.split(',')
            .map(|x| x.parse().unwrap_or(f64::NAN))
            .collect()
    };
    Ok(Some((header, lines.map(row).collect())))
}

fn simulated(study: &Path) -> Result<String, String> {
    let program: PathBuf = target().join("release").join("lynkeus");
    let mut tool = std::process::Command::new(program);
    let done = tool.arg("simulate").arg(study).arg("--quiet").output();
    let done = done.map_err(|error| format!("lynkeus: {error}"))?;
    match done.status.success() {
        true => String::from_utf8(done.stdout).map_err(|error| error.to_string()),
        false => Err(format!(
            "{}: {}",
            study.display(),
            String::from_utf8_lossy(&done.stderr)
        )),
    }
}

fn points((header, rows): &Table, shown: Shown) -> Result<Vec<(f64, f64)>, String> {
    let place = |name: &str| {
        let found = header.iter().position(|known| known == name);
        found.ok_or_else(|| format!("no column {name}; there are: {}", header.join(", ")))
    };
    // an error is the estimate less the truth
    let (shown, truth) = match shown {
        Shown::Column(name) => (place(name)?, None),
        Shown::Error(name) => (place(&format!("{name}_hat"))?, Some(place(name)?)),
    };
    let value = |row: &[f64]| row[shown] - truth.map_or(0.0, |truth| row[truth]);
    let finite = rows.iter().map(|row| (row[0], value(row)));
    Ok(finite
        .filter(|(t, y)| t.is_finite() && y.is_finite())
        .collect())
}

/// A picture whose axis reaches from the least to the largest value.
fn svg(title: String, curves: &[(Kind, Vec<(f64, f64)>)]) -> Result<String, String> {
    let values = || curves.iter().flat_map(|(_, points)| points).map(|p| p.1);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let curves = curves.iter().map(|(kind, points)| {
        let mut named = KINDS.iter().filter(|(known, _)| known == kind);
        let name = named.next().map_or("", |(_, name)| *name);
        lynkeus::plot::Curve::through(*kind, points.iter().copied()).named(name)
    });
    let panel = Panel {
        curves: curves.collect(),
        upwards: Scale::Within(low..high),
        ..Panel::default()
    };
    let figure = Figure {
        title,
        label: "time".to_owned(),
        panels: vec![panel],
        ..Figure::default()
    };
    figure.to_svg().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_is_of_a_study_that_ships() {
        for figure in figures() {
            for curve in &figure.curves {
                let is_reference = curve.source.ends_with(".csv");
                let path = root().join("examples").join(curve.source);
                assert!(is_reference || path.is_file(), "{}", path.display());
            }
        }
        assert_eq!(
            figures()
                .iter()
                .filter(|f| f.file.starts_with("lee-"))
                .count(),
            4
        );
    }

    #[test]
    fn errors_are_estimates_less_truths() {
        let header = ["t", "x", "x_hat"].map(str::to_owned).to_vec();
        let table = (header, vec![vec![0.0, 1.0, 3.0], vec![1.0, 2.0, f64::NAN]]);
        let found = points(&table, Shown::Error("x")).unwrap();
        assert_eq!(found, [(0.0, 2.0)]);
        assert!(points(&table, Shown::Column("y")).is_err());
    }
}
