//! Ours among the peers: what a user's study costs, whole runs of the library.

use std::io::Write as _;
use std::ops::ControlFlow;

use lynkeus::Study;
use lynkeus::run::{Backend, fuse_steps};
use lynkeus_native as native;
use serde_json::{Value, json};

use super::chain;
use super::clock::Clock;
use super::elementary;
use super::lanes;
use xtask::process::root;

const STUDY: &str = include_str!("../../peers/lee.toml");

/// Time of a Runge–Kutta run, of an adaptive one.
const STEPS: f64 = 2e6;
const SPANS: f64 = 1000.0;
/// The adaptive run that the others make, and where it ends: SciPy's DOP853 with `rtol = 3e-14`.
const SPAN: f64 = 20.0;
const END: [f64; 4] = [
    -1.6760961891465884,
    0.2759977606804534,
    -1.8648705788937479,
    -0.08462431160802764,
];

/// Prints what the other peers print.
pub fn print(what: &str) -> Result<(), String> {
    let found = match what {
        "interpreter" => study_alone(Backend::Interpreter)?,
        "native" => study_alone(Backend::Native)?,
        "fused" => {
            fuse_steps(true);
            study_alone(Backend::Native)?
        }
        "functions" => match native::widest() {
            8 => elementary::measure::<8>(),
            _ => elementary::measure::<4>(),
        },
        "functions-avx2" => elementary::measure::<4>(),
        "lanes" | "lanes-fused" => {
            fuse_steps(what == "lanes-fused");
            let run = |own: bool| lanes::run(own).map_err(|error| error.to_string());
            let [one, own] = [run(false)?, run(true)?];
            json!({
                "batch": one.step, "end of batch": [one.end],
                "own": own.step, "end of own": [own.end],
            })
        }
        "filters" => chain::filters().map_err(|error| error.to_string())?,
        _ => {
            let known = "interpreter, native, fused, lanes, lanes-fused, functions, functions-avx2 or filters";
            return Err(format!("expected {known}"));
        }
    };
    writeln!(std::io::stdout(), "{found}").map_err(|error| error.to_string())
}

fn study_alone(backend: Backend) -> Result<Value, String> {
    backend.choose();
    let fixed = "method = \"rk4\"\nstep = 1e-3";
    let step = seconds(&study(STEPS * 1e-3, 20.0, fixed)?)? / STEPS;
    let adaptive = "rtol = 1e-8\natol = 1e-8";
    let span = seconds(&study(SPANS * SPAN, 1.0, adaptive)?)? / SPANS;
    let error = error(&run(&study(SPAN, 1.0, adaptive)?)?)?;
    Ok(json!({ "step": step, "adaptive": span, "error": error }))
}

fn study(until: f64, output: f64, method: &str) -> Result<Study, String> {
    let plant = root().join("examples").join("lee").join("lee.mo");
    let text = STUDY
        .replace("{plant}", &plant.display().to_string().replace('\\', "/"))
        .replace("{until}", &until.to_string())
        .replace("{output}", &output.to_string())
        .replace("{method}", method);
    Study::parse(&text, "lee.toml").map_err(|error| error.to_string())
}

fn run(study: &Study) -> Result<lynkeus::Outcome, String> {
    lynkeus::simulate(study, &mut |_| ControlFlow::Continue(())).map_err(|e| e.to_string())
}

/// Of the second run: the first finds the pages of memory.
fn seconds(study: &Study) -> Result<f64, String> {
    run(study)?;
    let clock = Clock::start();
    run(study)?;
    Ok(clock.seconds())
}

/// The largest error of a true state or an estimate at the end, where they are equal.
fn error(outcome: &lynkeus::Outcome) -> Result<f64, String> {
    let columns = outcome.columns();
    let last = |name: &str| {
        let column = columns.iter().find(|(header, _)| header == name);
        let end = column.and_then(|(_, values)| values.last());
        end.ok_or(format!("no column {name}"))
    };
    let mut largest: f64 = 0.0;
    for (name, end) in ["x1", "x2", "x3", "x4"].iter().zip(END) {
        let estimate = format!("{name}_hat");
        largest = largest
            .max((last(name)? - end).abs())
            .max((last(&estimate)? - end).abs());
    }
    Ok(largest)
}
