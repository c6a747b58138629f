//! The shipped models, and models of the literature where they are at hand.

use std::path::{Path, PathBuf};
use std::time::Duration;

use lynkeus_model::{LoadOptions, Plant};

use crate::support::{slopes, within};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn load(path: &str, options: &LoadOptions) -> Plant {
    match Plant::load(&root().join(path), options) {
        Ok(plant) => plant,
        Err(refused) => panic!("{refused}"),
    }
}

#[test]
fn two_tanks() {
    let plant = load("examples/two-tanks/two_tanks.mo", &LoadOptions::default());
    let (upper, lower, pump) = (3.0f64, 5.0f64, 2.0);
    let found = slopes(
        &plant,
        &[("upper", upper), ("lower", lower), ("pump", pump)],
    );
    let expected = [
        -0.03951 * upper.sqrt() + 0.03037 * pump,
        0.07283 * upper.sqrt() - 0.06651 * lower.sqrt(),
    ];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-16);
    }
    assert_eq!(plant.inputs[0].unit.as_deref(), Some("V"));
    assert_eq!(plant.outputs[0].name, "level");
}

#[test]
fn the_column_is_at_rest_at_its_start() {
    let plant = load("examples/column/column.mo", &LoadOptions::default());
    assert_eq!(plant.states.len(), 12);
    let mut given: Vec<(&str, f64)> = plant
        .states
        .iter()
        .map(|state| (state.name.as_str(), state.start.unwrap()))
        .collect();
    given.extend(
        plant
            .inputs
            .iter()
            .map(|input| (input.name.as_str(), input.start.unwrap())),
    );
    for slope in slopes(&plant, &given) {
        assert!(slope.abs() < 1e-5, "{slope}");
    }
}

/// A column of any length, as its file would be written.
fn column(trays: usize) -> String {
    format!(
        "model Column
           parameter Integer N = {trays}; parameter Integer f = div(2*N, 3);
           parameter Real H[N] = {{if i == 1 or i == N then 5.5 else 0.55 for i in 1:N}};
           parameter Real alpha = 1.65; parameter Real F = 1.65;
           input Real L; input Real V; input Real Zf;
           Real x[N](each start = 0.5, each min = 0, each max = 1); Real y[N];
           output Real top = x[1]; output Real bottom = x[N];
         equation
           for i in 1:N loop
             y[i] = alpha*x[i]/(1 + (alpha - 1)*x[i]);
           end for;
           H[1]*der(x[1]) = V*(y[2] - x[1]);
           for i in 2:f - 1 loop
             H[i]*der(x[i]) = L*(x[i - 1] - x[i]) + V*(y[i + 1] - y[i]);
           end for;
           H[f]*der(x[f]) = F*(Zf - x[f]) + L*(x[f - 1] - x[f]) + V*(y[f + 1] - y[f]);
           for i in f + 1:N - 1 loop
             H[i]*der(x[i]) = (F + L)*(x[i - 1] - x[i]) + V*(y[i + 1] - y[i]);
           end for;
           H[N]*der(x[N]) = (F + L)*(x[N - 1] - x[N]) + V*(x[N] - y[N]);
         end Column;"
    )
}

#[test]
fn a_column_of_a_thousand_trays() {
    let text = column(1000);
    // A generous bound: only a cost that grows with the square would exceed it.
    let plant = within(Duration::from_millis(1500), || {
        Plant::from_modelica(&text, "column.mo", &LoadOptions::default()).unwrap()
    });
    assert_eq!(plant.derivatives.len(), 1000);
}

#[test]
fn models_of_the_literature() {
    let folder = root().join("../shared/observability");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        // past the capture of passing tests, so that a skip is seen
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: {} is not here\n", folder.display()),
        );
        return;
    };
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let mut count = 0;
    for path in entries.map(|entry| entry.unwrap().path()) {
        if path.extension().is_some_and(|extension| extension == "mo") {
            let plant = Plant::load(&path, &options).unwrap_or_else(|error| panic!("{error}"));
            assert!(!plant.states.is_empty() && !plant.outputs.is_empty());
            assert!(
                plant
                    .parameters
                    .iter()
                    .all(|parameter| parameter.value.is_none())
            );
            count += 1;
        }
    }
    assert!(count > 0);
}
