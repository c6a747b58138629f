//! `delay` of a constant time.

use lynkeus_expr::Tape;
use lynkeus_model::{LoadOptions, Plant};

fn read(declarations: &str, equations: &str, options: &LoadOptions) -> Plant {
    let text = format!("model M\n{declarations}\nequation\n{equations}\nend M;");
    Plant::from_modelica(&text, "d.mo", options).unwrap()
}

fn names(plant: &Plant) -> Vec<&str> {
    plant
        .states
        .iter()
        .map(|state| state.name.as_str())
        .collect()
}

/// The gain and the phase from the input to the output at a frequency: both are linear.
fn response(plant: &Plant, frequency: f64) -> [f64; 2] {
    let states: Vec<_> = plant.states.iter().map(|state| state.node).collect();
    let n = states.len();
    let symbols = [&states[..], &[plant.inputs[0].node]].concat();
    let roots = [&plant.derivatives[..], &[plant.outputs[0].node]].concat();
    let tape = Tape::new(&plant.graph, &symbols, &roots).unwrap();
    let column = |k: usize| {
        let mut at = vec![0.0; n + 1];
        at[k] = 1.0;
        let mut out = vec![0.0; n + 1];
        tape.evaluator().eval(&at, &mut out);
        out
    };
    let columns: Vec<Vec<f64>> = (0..=n).map(column).collect();
    // (iω − A) x = b by Gauss: [real part, imaginary part] as 2n real equations
    let mut rows = vec![vec![0.0; 2 * n + 1]; 2 * n];
    for i in 0..n {
        for j in 0..n {
            rows[i][j] = -columns[j][i];
            rows[n + i][n + j] = -columns[j][i];
        }
        rows[i][n + i] -= frequency;
        rows[n + i][i] += frequency;
        rows[i][2 * n] = columns[n][i];
    }
    for k in 0..2 * n {
        let pivot = (k..2 * n).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs()));
        rows.swap(k, pivot.unwrap());
        let own = rows[k].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = if i == k { 0.0 } else { row[k] / own[k] };
            row.iter_mut()
                .zip(&own)
                .for_each(|(x, own)| *x -= factor * own);
        }
    }
    let x: Vec<f64> = (0..2 * n).map(|k| rows[k][2 * n] / rows[k][k]).collect();
    let output = |part: &[f64]| -> f64 { part.iter().zip(&columns).map(|(x, c)| x * c[n]).sum() };
    [output(&x[..n]), output(&x[n..])]
}

/// Beside exp(−iωτ): the error of Padé's approximant falls with the states and rises with the frequency.
#[test]
fn what_is_slow_comes_out_as_late_as_it_should() {
    for (states, frequency, error) in [
        (1, 0.01, 1e-4),
        (4, 1.0, 1e-5),
        (6, 3.0, 4e-6),
        (6, 6.0, 0.02),
        (10, 6.0, 3e-8),
    ] {
        let options = LoadOptions {
            delay_states: Some(states),
            ..LoadOptions::default()
        };
        let plant = read("input Real u; output Real y;", "y = delay(u, 2);", &options);
        assert_eq!(plant.states.len(), states);
        let [re, im] = response(&plant, frequency / 2.0);
        let off = (re - frequency.cos()).hypot(im + frequency.sin());
        assert!(
            off < error && off > error / 100.0,
            "{states} {frequency}: {off:e}"
        );
    }
}

#[test]
fn its_states_are_those_of_the_plant() {
    let options = LoadOptions::default();
    let declarations = "parameter Real tau = 2; Real x(start = 3, min = 0, max = 5, unit = \"K\"); Real v[2](start = {1, 2}); Real x_delay; Real a; output Real y; output Real w[2]; input Real u;";
    let equations = "der(x) = delay(u, tau, 5) - delay(x, tau); a = 2*x + 1; x_delay = delay(a, 1); der(v) = -v; y = delay(x, tau) + delay(4, 1) + delay(x, 0); w = delay(v, 0.5);";
    let plant = read(declarations, equations, &options);
    assert_eq!(plant.states.len(), 3 + 5 * 6);
    let all = names(&plant);
    for name in [
        "u_delay[1]",
        "x_delay_2[6]",
        "a_delay[1]",
        "v_delay[1]",
        "v_delay_2[3]",
    ] {
        assert!(all.contains(&name), "{name}: {all:?}");
    }
    let state = |name: &str| {
        plant
            .states
            .iter()
            .find(|state| state.name == name)
            .unwrap()
    };
    let first = state("x_delay_2[1]");
    assert_eq!((first.start, first.min, first.max), (Some(3.0), 0.0, 5.0));
    assert_eq!(first.unit.as_deref(), Some("K"));
    assert_eq!(state("x_delay_2[2]").start, Some(0.0));
    assert_eq!(state("a_delay[1]").start, Some(7.0));
    // nobody knows what u is at the start
    assert_eq!(state("u_delay[1]").start, None);
    assert_eq!(plant.delays.len(), 5);
    assert_eq!(plant.delays[0].text, "delay(u, tau, 5)");
    assert_eq!(plant.warnings.len(), 5);
    assert!(
        plant.warnings[0]
            .one_line()
            .contains("held by 6 states, `u_delay`")
    );
}

/// A time that is a parameter may stay a symbol.
#[test]
fn a_time_may_be_a_parameter_without_value() {
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let plant = read(
        "parameter Real tau; input Real u; output Real y;",
        "y = delay(u, tau);",
        &options,
    );
    let tau = plant.parameters[0].variable.node;
    assert!(plant.graph.symbols_of(&plant.derivatives).contains(&tau));
}
