//! Directional derivatives of functional mock-up units, against the Jacobian.

use std::path::Path;
use std::process::Command;

use lynkeus::expr::{Node, Tape, jacobian};
use lynkeus::model::{LoadOptions, Plant};

use crate::export::has;
use crate::fmu_calls::{compiled, ran, sources};
use crate::fmu_equations::{VAT, export};
use crate::{Folder, examples, skipped};

/// What `along` of the C gives for each input, state and time in turn.
fn columns(folder: &Path, name: &str, sizes: (usize, usize, usize), point: &[f64]) -> Vec<f64> {
    let (n, m, p) = sizes;
    let numbers: Vec<String> = point.iter().map(|v| format!("{v:?}")).collect();
    let bench = format!(
        "#include \"{name}.h\"\n#include <stdio.h>\nint main(void)\n{{\n    const double at[] = {{{}}};\n    double dx[{n} + 1], y[{p} + 1];\n    for (int k = 0; k < 1 + {n} + {m}; k++) {{\n        double v[1 + {n} + {m}] = {{0.0}};\n        v[k] = 1.0;\n        {name}_along(at[0], at + 1, at + 1 + {n}, v, dx, y);\n        for (int i = 0; i < {n}; i++) {{ printf(\"%.17g\\n\", dx[i]); }}\n        for (int i = 0; i < {p}; i++) {{ printf(\"%.17g\\n\", y[i]); }}\n    }}\n    return 0;\n}}\n",
        numbers.join(", ")
    );
    std::fs::write(folder.join("bench.c"), bench).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-O1", "-o", "bench", "bench.c"]);
    compiler
        .arg(format!("{name}.c"))
        .arg("-lm")
        .current_dir(folder);
    assert!(compiler.status().unwrap().success());
    let ran = Command::new(folder.join("bench")).output().unwrap();
    let told = String::from_utf8(ran.stdout).unwrap();
    told.lines().map(|line| line.parse().unwrap()).collect()
}

/// An empty vat: the slope of √h is infinite.
#[test]
fn a_direction_in_which_the_level_stays_asks_nothing_of_the_root() {
    if !has("cc") {
        return skipped("there is no C compiler");
    }
    let folder = Folder::empty();
    folder.write("vat.mo", VAT);
    export(&folder, "vat.mo", "vat_plant", &[]);
    // by time, h, v, q: der(h) = q - √h, der(v) = -3, y = v·t, at t = 2, h = 0, v = 5, q = 1
    let found = columns(
        folder.path.path(),
        "vat_plant",
        (2, 1, 1),
        &[2.0, 0.0, 5.0, 1.0],
    );
    let level = [f64::NEG_INFINITY, 0.0, 0.0];
    assert_eq!(
        found,
        [[0.0, 0.0, 5.0], level, [0.0, 0.0, 2.0], [1.0, 0.0, 0.0]].concat()
    );
}

#[test]
fn directional_derivatives_are_columns_of_the_jacobian() {
    if !has("cc") {
        return skipped("there is no C compiler");
    }
    for (example, file, name) in [
        ("two-tanks", "two_tanks.mo", "twotanks"),
        ("cstr", "cstr.mo", "cstr"),
        ("quadrotor", "quadrotor.mo", "quadrotor"),
        ("flattened", "bridge.mo", "electrical_bridge"),
        (
            "flattened",
            "double_pendulum.mo",
            "mechanics_doublependulum",
        ),
    ] {
        let folder = Folder::empty();
        folder.copy_models(example);
        let name = format!("{name}_plant");
        export(&folder, file, &name, &[]);
        let path = examples().join(example).join(file);
        let options = LoadOptions {
            symbolic_parameters: true,
            ..LoadOptions::default()
        };
        let plant = Plant::load(&path, &options).unwrap();
        let symbols: Vec<Node> = std::iter::once(plant.time)
            .chain(plant.states.iter().chain(&plant.inputs).map(|v| v.node))
            .collect();
        let is_state = |name: &str| plant.states.iter().any(|state| state.name == name);
        let own = plant.outputs.iter().filter(|o| !is_state(&o.name));
        let own: Vec<Node> = own.map(|o| o.node).collect();
        let outputs = [&plant.derivatives[..], &own].concat();
        let slopes = jacobian::forward(&plant.graph, &outputs, &symbols);
        let entries: Vec<Node> = slopes.entries.iter().map(|(.., node)| *node).collect();
        let read = plant.graph.symbols_of(&outputs);
        let parameters = plant.parameters.iter();
        let parameters = parameters.filter(|p| read.contains(&p.variable.node));
        let given = parameters.map(|p| (p.variable.node, p.value.unwrap()));
        let (given, values): (Vec<Node>, Vec<f64>) = given.unzip();
        let all = [&symbols[..], &given].concat();
        let tape = Tape::new(&plant.graph, &all, &entries).unwrap();
        let variables = plant.states.iter().chain(&plant.inputs);
        let place = |(k, v): (usize, &lynkeus::model::Variable)| {
            let middle = 0.5 * (v.min + v.max);
            let start = v
                .start
                .unwrap_or(if middle.is_finite() { middle } else { 0.3 });
            start + 0.01 * (k as f64 + 1.0)
        };
        let point: Vec<f64> = std::iter::once(0.4)
            .chain(variables.enumerate().map(place))
            .chain(values)
            .collect();
        let mut values = vec![0.0; entries.len()];
        tape.evaluator().eval(&point, &mut values);
        let mut expected = vec![0.0; outputs.len() * symbols.len()];
        for ((row, column, _), value) in slopes.entries.iter().zip(values) {
            expected[column * outputs.len() + row] = value;
        }
        let sizes = (plant.states.len(), plant.inputs.len(), own.len());
        let found = columns(folder.path.path(), &name, sizes, &point);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found - expected).abs() <= 1e-11 * expected.abs().max(1.0),
                "{file}: {found} {expected}"
            );
        }
    }
}

/// The logarithm's slope 1/h is finite where the logarithm has no value, and a seed of 0 asks nothing of the
/// slope of a power: no value, no slope.
const NO_VALUE: &str = r#"
enum { DISCARD = 2, H = 1, LOG = 4, POWER = 5 };

static int told_for(void *m, double h, unsigned unknown, double seed, double *slope)
{
    const unsigned known = H;
    put(m, &h);
    return slopes(m, unknown, known, seed, slope);
}

int main(void)
{
    double slope = 7.0;
    int status;
    void *m = made_ready();
    status = told_for(m, 4.0, LOG, 1.0, &slope);
    printf("%d %g\n", status, slope);
    printf("%d\n", told_for(m, -1.0, LOG, 1.0, &slope));
    printf("%d\n", told_for(m, -1.0, LOG, 0.0, &slope));
    status = told_for(m, 4.0, POWER, 1.0, &slope);
    printf("%d %g\n", status, slope);
    printf("%d\n", told_for(m, -1.0, POWER, 0.0, &slope));
    return 0;
}
"#;

const TWO_SLOPES: &str = r#"
static const callbacks calls = {NULL, calloc, free, NULL, NULL};
static void *made_ready(void)
{
    void *m = fmi2Instantiate("vat", fmi2ModelExchange, token, "", &calls, 0, 0);
    fmi2SetupExperiment(m, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(m);
    fmi2ExitInitializationMode(m);
    return m;
}
static void put(void *m, const double *x) { fmi2SetContinuousStates(m, x, 1); }
static int slopes(void *m, unsigned unknown, unsigned known, double seed, double *slope)
{
    return fmi2GetDirectionalDerivative(m, &unknown, 1, &known, 1, &seed, slope);
}
"#;

const THREE_SLOPES: &str = r#"
static void *made_ready(void)
{
    void *m = fmi3InstantiateModelExchange("vat", token, "", 0, 0, NULL, NULL);
    fmi3EnterInitializationMode(m, 0, 0.0, 0.0, 0, 0.0);
    fmi3ExitInitializationMode(m);
    return m;
}
static void put(void *m, const double *x) { fmi3SetContinuousStates(m, x, 1); }
static int slopes(void *m, unsigned unknown, unsigned known, double seed, double *slope)
{
    return fmi3GetDirectionalDerivative(m, &unknown, 1, &known, 1, &seed, 1, slope, 1);
}
"#;

#[test]
fn what_has_no_value_has_no_slope() {
    if !has("cc") {
        return skipped("there is no C compiler");
    }
    let model = "model Vat
  Real h(start = 4);
  output Real x = h;
  output Real y = log(h), z = h^1.5;
equation
  der(h) = -h;
end Vat;
";
    let folder = Folder::empty();
    for (version, own) in [("2", TWO_SLOPES), ("3", THREE_SLOPES)] {
        let to = sources(&folder, "Vat", model, version);
        let path = folder.path.path().join(to);
        let bench = format!("#include <stdio.h>\n#include \"fmi{version}.c\"\n{own}{NO_VALUE}");
        std::fs::write(path.join("bench.c"), bench).unwrap();
        compiled(&path, &["bench.c", "vat_plant.c", "-lm", "-o", "bench"]);
        assert_eq!(ran(&path), "0 0.25\n2\n2\n0 3\n2\n", "{version}");
    }
}
