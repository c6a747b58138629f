//! What a verdict costs: chains of growing length, and the published models where they lie
//! beside the project.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use divan::{Bencher, black_box};
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observability::{Question, analyse};

fn main() {
    divan::main();
}

fn options() -> LoadOptions {
    LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    }
}

fn asking(parameters: bool) -> Question {
    Question {
        parameters,
        ..Question::default()
    }
}

/// x_i' = a_i·x_{i+1} − b_i·x_i², y = x_1
fn chain(n: usize) -> Plant {
    let text = format!(
        "model Chain
           parameter Real a[{n}]; parameter Real b[{n}]; Real x[{n}]; output Real y = x[1];
         equation
           for i in 1:{} loop der(x[i]) = a[i]*x[i+1] - b[i]*x[i]^2; end for;
           der(x[{n}]) = -a[{n}]*x[{n}] - b[{n}]*x[1];
         end Chain;",
        n - 1
    );
    Plant::from_modelica(&text, "chain.mo", &options()).unwrap()
}

/// n unknown states.
#[divan::bench(args = [5, 10, 20, 50, 100], sample_count = 5)]
fn states(bencher: Bencher, n: usize) {
    let plant = chain(n);
    bencher.bench_local(|| analyse(black_box(&plant), &asking(false)).unwrap());
}

/// n unknown states and 2·n unknown parameters.
#[divan::bench(args = [5, 10, 20, 50, 100], sample_count = 3)]
fn states_and_parameters(bencher: Bencher, n: usize) {
    let plant = chain(n);
    bencher.bench_local(|| analyse(black_box(&plant), &asking(true)).unwrap());
}

fn published() -> Vec<(String, Plant)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/observability");
    let Ok(entries) = std::fs::read_dir(folder) else {
        return vec![];
    };
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let models = files.filter(|file| file.extension().is_some_and(|e| e == "mo"));
    let plant = |file: std::path::PathBuf| {
        let name = file.file_stem()?.to_string_lossy().into_owned();
        Some((name, Plant::load(&file, &options()).ok()?))
    };
    models.filter_map(plant).collect()
}

/// All the published models, one after the other.
#[divan::bench(sample_count = 10)]
fn published_all(bencher: Bencher) {
    let plants = published();
    bencher.bench_local(|| {
        for (_, plant) in &plants {
            black_box(analyse(plant, &asking(true)).unwrap());
        }
    });
}

/// The largest of them by unknowns.
#[divan::bench(sample_count = 10)]
fn published_largest(bencher: Bencher) {
    let plants = published();
    let largest = plants
        .iter()
        .max_by_key(|(_, plant)| plant.states.len() + plant.parameters.len());
    let Some((name, plant)) = largest else { return };
    eprintln!(
        "{name}: {} states, {} parameters",
        plant.states.len(),
        plant.parameters.len()
    );
    bencher.bench_local(|| analyse(black_box(plant), &asking(true)).unwrap());
}
