//! The papers' figures, drawn again by the tool from the shipped studies: `target/figures/<paper>-<n>.svg`.
//!
//! Grey is the plant or, of an error, zero; black the estimate, dashed the observer that the paper compares with. Rings
//! are a trajectory that was computed apart from this project, where it is at hand. What a figure shows of two
//! simulations belongs together: starts and inputs are the same.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use xtask::process::{cargo, root, run, target};

/// What a curve shows.
#[derive(Clone, Copy)]
enum Shown {
    /// a column of the table
    Column(&'static str),
    /// the estimate of a quantity less the quantity
    Error(&'static str),
}

/// A curve, or the rings of a trajectory that was computed apart.
#[derive(Clone, Copy)]
struct Curve {
    /// a study below `examples`, or a table of reference trajectories
    source: &'static str,
    shown: Shown,
    style: Style,
}

#[derive(Clone, Copy, PartialEq)]
enum Style {
    Grey,
    Solid,
    Dashed,
    Rings,
}

/// One figure of a paper.
struct Figure {
    file: String,
    title: String,
    curves: Vec<Curve>,
}

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 320.0;
const MARGIN: f64 = 48.0;

/// Draws every figure.
pub fn draw() -> Result<(), String> {
    run(&mut cargo(&["build", "--release", "--package", "lynkeus"]))?;
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
            drawn.push((curve.style, points(table, curve.shown)?));
        }
        let path = folder.join(format!("{}.svg", figure.file));
        let text = svg(&figure.title, &drawn);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        eprintln!("drew {}", path.display());
    }
    Ok(())
}

/// The figures of the five papers, by paper and number.
fn figures() -> Vec<Figure> {
    let curve = |source, shown, style| Curve {
        source,
        shown,
        style,
    };
    let mut all = vec![];
    let mut add = |file: String, title: String, curves: Vec<Curve>| {
        all.push(Figure {
            file,
            title,
            curves,
        });
    };
    for (i, x) in ["x1", "x2", "x3", "x4"].into_iter().enumerate() {
        add(
            format!("lee-{}", i + 1),
            format!(
                "Lee, Yee, Park, figure {}: error of {x}; (7) solid, (3) dashed",
                i + 1
            ),
            vec![
                curve("lee/study.toml", Shown::Error(x), Style::Solid),
                curve("lee/classical.toml", Shown::Error(x), Style::Dashed),
                curve("lee_observer7.csv", Shown::Error(x), Style::Rings),
                curve("lee_observer3.csv", Shown::Error(x), Style::Rings),
            ],
        );
    }
    let germani = [("x1", "x1_hat"), ("x2", "x2_hat"), ("x3", "x3_hat")];
    for (i, (x, hat)) in germani.into_iter().enumerate() {
        let practical = "germani-manes/practical.toml";
        add(
            format!("germani-manes-{}", i + 1),
            format!(
                "Germani, Manes, figure {}: {x} and its estimate by (4.22); (4.1) dashed",
                i + 1
            ),
            vec![
                curve(practical, Shown::Column(x), Style::Grey),
                curve(practical, Shown::Column(hat), Style::Solid),
                curve(
                    "germani-manes/theoretical.toml",
                    Shown::Column(hat),
                    Style::Dashed,
                ),
                curve("germani_theoretical.csv", Shown::Column(hat), Style::Rings),
            ],
        );
    }
    for (x, hat) in [("x4", "x4_hat"), ("x5", "x5_hat"), ("v", "v_hat")] {
        let noisy = "farza/study-noise.toml";
        add(
            format!("farza-1-{x}"),
            format!("Farza et al., figure 1: {x} and its estimate, with noise"),
            vec![
                curve(noisy, Shown::Column(x), Style::Grey),
                curve(noisy, Shown::Column(hat), Style::Solid),
                curve("farza_a1.csv", Shown::Column(hat), Style::Rings),
            ],
        );
    }
    for (x, hat) in [("x2", "x2_hat"), ("x3", "x3_hat")] {
        let noisy = "ltaief/study-noise.toml";
        add(
            format!("ltaief-2-{x}"),
            format!(
                "Ltaief et al., figure 2: {x} and its estimate, with noise (theta = 1); theta = 10 without noise dashed"
            ),
            vec![
                curve(noisy, Shown::Column(x), Style::Grey),
                curve(noisy, Shown::Column(hat), Style::Solid),
                curve("ltaief/study.toml", Shown::Column(hat), Style::Dashed),
                curve("ltaief_theta10.csv", Shown::Column(hat), Style::Rings),
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
                curve(study, Shown::Column(x), Style::Grey),
                curve(study, Shown::Column(hat), Style::Solid),
            ];
            if number == 5 {
                let reference = if name == "x6" { "x6_hat" } else { "Zf_hat" };
                curves.push(curve(
                    "hammouri_theta3.5.csv",
                    Shown::Column(reference),
                    Style::Rings,
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

/// A picture with axes from the least to the largest value.
fn svg(title: &str, curves: &[(Style, Vec<(f64, f64)>)]) -> String {
    let all = || curves.iter().flat_map(|(_, points)| points);
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    };
    let (from, to) = ends(&mut all().map(|p| p.0));
    let (low, high) = ends(&mut all().map(|p| p.1));
    let along =
        |t: f64| MARGIN + (t - from) / (to - from).max(f64::MIN_POSITIVE) * (WIDTH - 2.0 * MARGIN);
    let up = |y: f64| {
        HEIGHT - MARGIN - (y - low) / (high - low).max(f64::MIN_POSITIVE) * (HEIGHT - 2.0 * MARGIN)
    };
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n<text x=\"{MARGIN}\" y=\"20\">{title}</text>\n"
    );
    let (left, right, bottom, top) = (MARGIN, WIDTH - MARGIN, HEIGHT - MARGIN, MARGIN);
    // writing to a String does not fail
    let _ = writeln!(
        text,
        "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#888\"/>"
    );
    for (x, y, label) in [
        (left, bottom + 16.0, from),
        (right - 16.0, bottom + 16.0, to),
        (4.0, bottom, low),
        (4.0, top + 8.0, high),
    ] {
        let _ = writeln!(text, "<text x=\"{x}\" y=\"{y}\">{label:.3}</text>");
    }
    for (style, points) in curves {
        if *style == Style::Rings {
            for (t, y) in points {
                let _ = writeln!(
                    text,
                    "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"2.5\" fill=\"none\" stroke=\"#c33\"/>",
                    along(*t),
                    up(*y)
                );
            }
            continue;
        }
        let path: Vec<String> = points
            .iter()
            .map(|(t, y)| format!("{:.2},{:.2}", along(*t), up(*y)))
            .collect();
        let (colour, dashes) = match style {
            Style::Grey => ("#999", ""),
            Style::Dashed => ("black", " stroke-dasharray=\"5 3\""),
            _ => ("black", ""),
        };
        let _ = writeln!(
            text,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"{dashes}/>",
            path.join(" ")
        );
    }
    text + "</svg>\n"
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
