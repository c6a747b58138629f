//! The remedies against peaking side by side: the tables and the picture of `docs/peaking.md`.
//!
//! `cargo run --release --package lynkeus --example peaking -- docs/pictures/peaking.svg`, from the root
//! of the repository.

#![allow(clippy::print_stdout)]

use std::ops::ControlFlow;
use std::path::Path;

use lynkeus::plot::{Curve, Figure, Kind, Panel};
use lynkeus::{Error, Outcome, Study, simulate};

/// A plant with what is measured of every remedy.
struct Case {
    /// Everything but `[observer]` and the noise, which stand in for the marks.
    text: &'static str,
    noise: &'static str,
    /// The estimate to look at.
    shown: &'static str,
    /// The transient is looked at until then.
    transient: f64,
    /// Settled means an error below this.
    tolerance: f64,
    /// Where the scatter under noise is taken.
    scatter: (f64, f64),
    /// Names with their keys of `[observer]`.
    remedies: &'static [(&'static str, &'static str)],
}

const COLUMN: Case = Case {
    text: r#"plant = "examples/column/column.mo"
[sensors]
measured = ["top", "bottom"]
unknown = ["Zf"]
NOISE
[observer]
family = "triangular"
initial = { default = 0.5 }
OBSERVER
[simulate]
until = 20
output_step = 0.05
sample_step = 0.1
inputs = { L = 4.69, V = 5.94, Zf = 0.75 }
seed = 1
"#,
    noise: r#"noise = { top = "5%", bottom = "5%" }"#,
    shown: "Zf",
    transient: 20.0,
    tolerance: 0.05,
    scatter: (12.0, 20.0),
    remedies: &[
        ("standard", "theta = 4.8 PRINTED"),
        ("standard, θ = 3.5", "theta = 3.5 PRINTED"),
        ("`clamp`", "theta = 4.8 PRINTED clamp = true"),
        (
            "`innovation_limit = 0.02`",
            "theta = 4.8 PRINTED innovation_limit = 0.02",
        ),
        (
            "`transient`, at once",
            "theta = 4.8 PRINTED transient = { theta = 2.5, until = 3 }",
        ),
        (
            "`transient` with `fall`",
            "theta = 4.8 PRINTED transient = { theta = 2, until = 1, fall = 1.5 }",
        ),
        (
            "low-power and `clamp`, θ = 18",
            r#"theta = 18 form = "low-power" partials = true clamp = true"#,
        ),
    ],
};

/// r, δ and the S that the column's paper prints.
const PRINTED: &str = r"
delta = [1, 1.2727272727272727]
r = 1
S = [
  { diag = [1.5, 2, 4, 8, 10.5, 15.5, 17.5], off = [-0.5, -1.5, -2, -3, -4, -5] },
  { diag = [1.5, 2, 4, 8, 10.5, 15.5], off = [-0.5, -1.5, -2, -3, -4] },
]
";

const ARM: Case = Case {
    text: r#"plant = "examples/flexible-joint/flexible_joint.mo"
[sensors]
measured = ["angle"]
NOISE
[observer]
family = "triangular"
partials = true
initial = { default = 0 }
OBSERVER
[simulate]
until = 4
output_step = 0.002
sample_step = 0.002
inputs = { torque = "3*sin(2*time)" }
seed = 1
"#,
    noise: "noise = { angle = 0.001 }",
    shown: "motor_rate",
    transient: 4.0,
    tolerance: 0.1,
    scatter: (2.5, 4.0),
    remedies: &[
        ("standard, θ = 60", "theta = 60"),
        ("`clamp`", "theta = 60 clamp = true"),
        (
            "`innovation_limit = 0.2`",
            "theta = 60 innovation_limit = 0.2",
        ),
        (
            "`transient` with `fall`",
            "theta = 60 transient = { theta = 12, until = 0.1, fall = 0.1 }",
        ),
        ("low-power, θ = 90", r#"theta = 90 form = "low-power""#),
        (
            "low-power and `clamp`, θ = 90",
            r#"theta = 90 form = "low-power" clamp = true"#,
        ),
        (
            "the same and `transient`",
            r#"theta = 90 form = "low-power" clamp = true transient = { theta = 20, until = 0.1, fall = 0.1 }"#,
        ),
    ],
};

fn main() -> Result<(), Error> {
    let mut panels = vec![];
    for case in [COLUMN, ARM] {
        println!("| | smallest | largest | settled after | scatter |\n|---|---|---|---|---|");
        for (name, keys) in case.remedies {
            let quiet = run(&case, keys, "")?;
            let noisy = run(&case, keys, case.noise)?;
            println!("{}", row(&case, name, &quiet, &noisy));
            if case.shown == COLUMN.shown {
                panels.push(panel(name, &case, &quiet));
            }
        }
        println!();
    }
    let figure = Figure {
        title: "The feed of the column, estimated: remedies against peaking".to_owned(),
        label: "time (min)".to_owned(),
        panels,
        ..Figure::default()
    };
    match std::env::args().nth(1) {
        Some(path) => save(Path::new(&path), &figure.to_svg()?),
        None => Ok(()),
    }
}

fn save(path: &Path, svg: &str) -> Result<(), Error> {
    std::fs::write(path, svg).map_err(|error| Error::input(format!("{}: {error}", path.display())))
}

fn run(case: &Case, keys: &str, noise: &str) -> Result<Outcome, Error> {
    // one key per line; tables keep theirs on one
    let mut lines = keys.replace(" PRINTED", PRINTED);
    for key in ["clamp", "innovation_limit", "transient", "form", "partials"] {
        lines = lines.replace(&format!(" {key} ="), &format!("\n{key} ="));
    }
    let text = case
        .text
        .replace("NOISE", noise)
        .replace("OBSERVER", &lines);
    simulate(&Study::parse(&text, "a remedy")?, &mut |_| {
        ControlFlow::Continue(())
    })
}

/// True and estimated values of the quantity shown, with their times.
fn shown<'o>(case: &Case, outcome: &'o Outcome) -> impl Iterator<Item = (f64, f64, f64)> + 'o {
    let quantity = outcome.quantities.iter().find(|q| q.name == case.shown);
    let curves = quantity.and_then(|q| Some((q.truth.as_ref()?, q.estimate.as_ref()?)));
    let rows = curves
        .into_iter()
        .flat_map(|(truth, hat)| truth.iter().zip(hat));
    outcome
        .time
        .iter()
        .zip(rows)
        .map(|(t, (x, hat))| (t, x, hat))
}

fn row(case: &Case, name: &str, quiet: &Outcome, noisy: &Outcome) -> String {
    let (mut smallest, mut largest, mut settled) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for (t, x, hat) in shown(case, quiet).take_while(|row| row.0 < case.transient) {
        (smallest, largest) = (hat.min(smallest), hat.max(largest));
        if (hat - x).abs() > case.tolerance {
            settled = t;
        }
    }
    let late = shown(case, noisy).filter(|row| row.0 >= case.scatter.0 && row.0 < case.scatter.1);
    let errors: Vec<f64> = late.map(|(_, x, hat)| hat - x).collect();
    let count = errors.len().max(1) as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let scatter = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count).sqrt();
    format!("| {name} | {smallest:.2} | {largest:.2} | {settled:.2} | {scatter:.3} |")
}

fn panel(name: &str, case: &Case, outcome: &Outcome) -> Panel {
    let rows: Vec<(f64, f64, f64)> = shown(case, outcome).collect();
    let time: Vec<f64> = rows.iter().map(|row| row.0).collect();
    let curve = |kind: Kind, values: Vec<f64>| Curve::new(kind, time.clone(), values);
    let truth = rows.iter().map(|row| row.1).collect();
    let estimate = rows.iter().map(|row| row.2).collect();
    Panel {
        caption: name.replace('`', ""),
        curves: vec![curve(Kind::True, truth), curve(Kind::Estimated, estimate)],
        ..Panel::default()
    }
}
