//! `export --to fmu` of plants and of observers in continuous time. How they run is looked at with FMPy, in
//! `python/tests/test_fmu_equations.py`.

use std::path::Path;
use std::process::Command;

use lynkeus::expr::{Node, Tape, jacobian};
use lynkeus::model::{LoadOptions, Plant};

use crate::export::has;
use crate::fmu::{text, unpacked, variables};
use crate::{Folder, examples, skipped};

/// A state that is an output, one with nothing known, and an output of its own.
const VAT: &str = r#"
model Vat
  input Real q(unit = "l/min", min = 0, max = 5, start = 1) "Feed <raw>";
  output Real h(unit = "m", start = 2, min = 0, nominal = -2) "Level";
  Real v(start = 7, max = 3);
  output Real y;
equation
  der(h) = q - sqrt(h);
  der(v) = -3;
  y = v*time;
end Vat;
"#;

fn export(folder: &Folder, source: &str, name: &str, more: &[&str]) -> (String, String) {
    let to = format!("out{}", more.concat());
    let arguments = [&["export", source, "--to", "fmu", "-o", &to], more].concat();
    let made = folder.run(&arguments);
    assert_eq!(made.code, 0, "{}", made.err);
    let archive = folder.path.path().join(&to).join(format!("{name}.fmu"));
    let files = unpacked(&std::fs::read(archive).unwrap());
    for (file, content) in &files {
        if let Some(file) = file.strip_prefix("sources/") {
            folder.write(file, std::str::from_utf8(content).unwrap());
        }
    }
    (text(&files, "modelDescription.xml"), made.err)
}

#[test]
fn a_plant_says_what_it_is() {
    let folder = Folder::empty();
    folder.write("vat.mo", VAT);
    let three = [
        ("time", "causality=\"independent\""),
        (
            "q",
            "causality=\"input\" variability=\"continuous\" unit=\"l/min\" min=\"0.0\" max=\"5.0\" start=\"1.0\"",
        ),
        (
            "h",
            "causality=\"output\" variability=\"continuous\" initial=\"exact\" unit=\"m\" min=\"0.0\" nominal=\"2.0\" start=\"2.0\"",
        ),
        // a start outside of the range
        (
            "v",
            "causality=\"local\" variability=\"continuous\" initial=\"exact\" start=\"7.0\"",
        ),
        (
            "der(h)",
            "causality=\"local\" variability=\"continuous\" derivative=\"2\"",
        ),
        ("der(v)", "derivative=\"3\""),
        ("y", "causality=\"output\" variability=\"continuous\"/>"),
    ];
    let (description, notes) = export(&folder, "vat.mo", "vat_plant", &[]);
    assert!(description.contains("<Category name=\"logStatusDiscard\"/>"));
    assert!(notes.contains("in co-simulation steps of"), "{notes}");
    let found = variables(&description);
    assert_eq!(found.len(), three.len(), "{description}");
    for ((name, told), (wanted, part)) in found.iter().zip(three) {
        assert_eq!(name, wanted);
        assert!(told.contains(part), "{name}: {told}");
    }
    for part in [
        "<ModelExchange modelIdentifier=\"vat_plant\"",
        "<CoSimulation modelIdentifier=\"vat_plant\"",
        "description=\"Feed &lt;raw&gt;\"",
        "<Output valueReference=\"2\" dependencies=\"2\"/>",
        "<Output valueReference=\"6\" dependencies=\"0 3\"/>",
        "<ContinuousStateDerivative valueReference=\"4\" dependencies=\"1 2\"/>",
        "<ContinuousStateDerivative valueReference=\"5\" dependencies=\"\"/>",
        "<InitialUnknown valueReference=\"6\" dependencies=\"0 3\"/>",
    ] {
        assert!(description.contains(part), "{part}: {description}");
    }
    let (description, _) = export(&folder, "vat.mo", "vat_plant", &["--fmi", "2"]);
    for part in [
        "<ModelExchange modelIdentifier=\"vat_plant\"",
        "<CoSimulation modelIdentifier=\"vat_plant\"",
        "<Real derivative=\"3\"/>",
        "<Real unit=\"m\" min=\"0.0\" nominal=\"2.0\" start=\"2.0\"/>",
        "<Unknown index=\"7\" dependencies=\"1 4\"/>",
    ] {
        assert!(description.contains(part), "{part}: {description}");
    }
}

#[test]
fn a_study_gives_its_plant_starts_parameters_and_unit_of_time() {
    let folder = Folder::new();
    folder.change(
        "study.toml",
        "[simulate]\n",
        "[simulate]\ninitial = { upper = 6 }\n",
    );
    let of = |system| {
        export(
            &folder,
            "study.toml",
            &format!("twotanks_{system}"),
            &["--system", system],
        )
        .0
    };
    let (plant, observer) = (of("plant"), of("observer"));
    for part in [
        "<Unit name=\"s\">",
        "causality=\"independent\" variability=\"continuous\" unit=\"s\"/>",
        "name=\"upper\"",
        "start=\"6.0\"",
        "unit=\"V/s\"",
        "name=\"pump\"",
    ] {
        assert!(plant.contains(part), "{part}: {plant}");
    }
    let found = variables(&observer);
    let inputs = found
        .iter()
        .filter(|(_, told)| told.contains("causality=\"input\""));
    let inputs: Vec<&str> = inputs.map(|(name, _)| name.as_str()).collect();
    assert_eq!(inputs, ["level"], "the pump is estimated");
    assert!(observer.contains("name=\"pump_hat\""), "{observer}");
}

#[test]
fn one_of_several_models_is_named() {
    let folder = Folder::empty();
    folder.write("two.mo", &(VAT.to_owned() + &VAT.replace("Vat", "Tub")));
    let made = folder.run(&["export", "two.mo", "--to", "fmu", "-o", "out"]);
    assert_eq!(made.code, 2, "{}", made.err);
    let (description, _) = export(&folder, "two.mo", "tub_plant", &["--model", "Tub"]);
    assert!(description.contains("modelName=\"Tub_plant\""));
}

#[test]
fn what_is_not_offered_is_refused() {
    let folder = Folder::new();
    folder.write("vat.mo", VAT);
    folder.write(
        "jump.mo",
        &VAT.replace("= -3", "= if time < 5 then -3 else 0"),
    );
    folder.write(
        "loop.mo",
        &VAT.replace("  Real v(", "  Real z(start = 1, min = 0);\n  Real v(")
            .replace("= -3;", "= -z;\n  z + exp(z) = 3 + h;"),
    );
    let filter = folder.read("study.toml");
    let sections = filter
        .split("\n[")
        .filter(|section| !section.starts_with("observer"));
    let sections: Vec<&str> = sections.collect();
    folder.write(
        "filter.toml",
        &(sections.join("\n[") + "\n[observer]\nfamily = \"ekf\"\n"),
    );
    for (arguments, code, expected) in [
        (&["vat.mo", "--to", "c"][..], 2, "expected --to fmu"),
        (
            &["vat.mo", "--to", "fmu", "--precision", "f32"],
            2,
            "expected f64",
        ),
        (&["vat.mo", "--to", "fmu", "--step", "0"], 2, "--step"),
        (&["jump.mo", "--to", "fmu"], 1, "jumps with time"),
        (&["loop.mo", "--to", "fmu"], 1, "the algebraic loop for z"),
        (
            &["filter.toml", "--to", "fmu", "--system", "observer"],
            1,
            "jumps when a sensor reports",
        ),
    ] {
        let made = folder.run(&[&["export"], arguments, &["-o", "out"]].concat());
        assert_eq!(made.code, code, "{arguments:?}: {}", made.err);
        assert!(made.err.contains(expected), "{arguments:?}: {}", made.err);
        assert!(!folder.path.path().join("out").exists());
    }
}

/// Neither inputs nor outputs, and a rate that does not depend on the state.
#[test]
fn compilers_take_equations_without_a_warning() {
    let compilers: Vec<&str> = ["gcc", "clang"].into_iter().filter(|c| has(c)).collect();
    if compilers.is_empty() {
        return skipped("neither gcc nor clang is there");
    }
    let folder = Folder::empty();
    folder.write("vat.mo", VAT);
    folder.write(
        "bare.mo",
        "model Bare\n  Real x(start = 1);\nequation\n  der(x) = 2;\nend Bare;\n",
    );
    for (source, name) in [("vat.mo", "vat_plant"), ("bare.mo", "bare_plant")] {
        for version in ["2", "3"] {
            let (_, notes) = export(&folder, source, name, &["--fmi", version, "--force"]);
            assert!(!notes.contains("sources only"), "{notes}");
            for compiler in &compilers {
                let options = "-std=c99 -O1 -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror -shared -fPIC -o made.so";
                let mut command = Command::new(compiler);
                command.args(options.split(' '));
                command.args([format!("{name}.c"), format!("fmi{version}.c")]);
                let ended = command.arg("-lm").current_dir(folder.path.path()).output();
                let ended = ended.unwrap();
                let told = String::from_utf8_lossy(&ended.stderr);
                assert!(ended.status.success(), "{compiler}: {told}");
            }
        }
    }
}

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

/// Steps for the level a hundredth off, not for the root's infinite slope at 0.
#[test]
fn steps_at_a_roots_zero_are_no_shorter_than_a_hundredth_off() {
    let folder = Folder::empty();
    folder.write(
        "empty.mo",
        &VAT.replace("start = 2, min = 0,", "start = 0, min = 0,"),
    );
    // of size 2: the secant √0.02/0.02 is 7.07, half of its inverse 0.0707
    let (_, notes) = export(&folder, "empty.mo", "vat_plant", &[]);
    assert!(
        notes.contains("in co-simulation steps of 0.05 at most"),
        "{notes}"
    );
    assert!(
        notes.contains("at the start a slope is infinite"),
        "{notes}"
    );
    folder.write(
        "empty.toml",
        "plant = \"empty.mo\"\n[sensors]\nmeasured = [\"h\"]\nnoise = { h = 0.1 }\n[process_noise]\nh = 1e-3\n[observer]\nfamily = \"ekf\"\ninitial = { h = 0 }\n",
    );
    let made = folder.run(&["export", "empty.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    assert!(
        made.err.contains("note: steps of 0.05 at most"),
        "{}",
        made.err
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
        let plant = Plant::load(&path, &LoadOptions::default()).unwrap();
        let symbols: Vec<Node> = std::iter::once(plant.time)
            .chain(plant.states.iter().chain(&plant.inputs).map(|v| v.node))
            .collect();
        let is_state = |name: &str| plant.states.iter().any(|state| state.name == name);
        let own = plant.outputs.iter().filter(|o| !is_state(&o.name));
        let own: Vec<Node> = own.map(|o| o.node).collect();
        let outputs = [&plant.derivatives[..], &own].concat();
        let slopes = jacobian::forward(&plant.graph, &outputs, &symbols);
        let entries: Vec<Node> = slopes.entries.iter().map(|(.., node)| *node).collect();
        let tape = Tape::new(&plant.graph, &symbols, &entries).unwrap();
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
