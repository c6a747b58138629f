//! `export --to fmu` of plants and of observers in continuous time. How they run is looked at with FMPy, in
//! `python/tests/test_fmu_equations.py`.

use std::process::Command;

use crate::export::has;
use crate::fmu::{text, unpacked, variables};
use crate::{Folder, skipped};

/// A state that is an output, one with nothing known, and an output of its own.
pub(super) const VAT: &str = r#"
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

pub(super) fn export(folder: &Folder, source: &str, name: &str, more: &[&str]) -> (String, String) {
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

/// Two parameters that the equations read, one through another; one that is a start alone.
#[test]
fn parameters_of_the_equations_can_be_set() {
    let folder = Folder::empty();
    let model = VAT
        .replace("= -3", "= last")
        .replace("  input", "  parameter Real k(unit = \"m\", min = 0) = 3 \"Drain\";\n  parameter Real twice = 2*k;\n  parameter Real first = 7;\n  parameter Real last = -3;\n  input")
        .replace("start = 7", "start = first")
        .replace("sqrt(h)", "k*sqrt(h)")
        .replace("v*time", "twice*v*time");
    folder.write("vat.mo", &model);
    let (description, notes) = export(&folder, "vat.mo", "vat_plant", &[]);
    assert!(!notes.contains("parameters are numbers"), "{notes}");
    let found = variables(&description);
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        ["time", "q", "h", "v", "der(h)", "der(v)", "y", "k", "last"]
    );
    let told =
        "causality=\"parameter\" variability=\"tunable\" unit=\"m\" min=\"0.0\" start=\"3.0\"/>";
    assert!(found[7].1.contains(told), "{}", found[7].1);
    for part in [
        "name=\"k\" description=\"Drain\"",
        "<Output valueReference=\"6\" dependencies=\"0 3\"/>",
        "<ContinuousStateDerivative valueReference=\"4\" dependencies=\"1 2\"/>",
        "<InitialUnknown valueReference=\"4\" dependencies=\"1 2 7\"/>",
        "<InitialUnknown valueReference=\"5\" dependencies=\"8\"/>",
        "<InitialUnknown valueReference=\"6\" dependencies=\"0 3 7\"/>",
    ] {
        assert!(description.contains(part), "{part}: {description}");
    }
    // those of a study count; unknown ones are states
    folder.write(
        "vat.toml",
        "plant = \"vat.mo\"\n[parameters]\nlast = -4\n[sensors]\nmeasured = [\"h\"]\nunknown = [\"k\"]\n",
    );
    let more = ["--system", "plant", "--fmi", "2"];
    let (description, _) = export(&folder, "vat.toml", "vat_plant", &more);
    let found = variables(&description);
    let of = |name: &str| &found.iter().find(|(own, _)| own == name).unwrap().1;
    assert!(
        of("last").contains("<Real start=\"-4.0\"/>"),
        "{}",
        of("last")
    );
    assert!(of("k").contains("initial=\"exact\""), "{}", of("k"));
    assert!(
        description.contains("<Unknown index=\"7\" dependencies=\"10\"/>"),
        "{description}"
    );
    // when a model bends is not looked for while it runs
    folder.write(
        "bent.mo",
        &model.replace("twice*v*time", "twice*v*max(time, last)"),
    );
    let (description, notes) = export(&folder, "bent.mo", "vat_plant", &["--step", "0.1"]);
    assert!(
        notes.contains(
            "parameters are numbers: what happens at times and at events has to be known"
        ),
        "{notes}"
    );
    assert!(!description.contains("causality=\"parameter\""));
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
