//! How the variables of a functional mock-up unit are called, and what they are before anybody sets them.

use crate::Folder;
use crate::fmu::{text, unpacked, variables};

const TWIN: &str = r"
model Twin
  Real x(start = 1, min = -5, max = 5);
  Real x_hat(start = 2, min = -5, max = 5);
  Real x_start(start = 3, min = -5, max = 5);
  output Real y = x;
equation
  der(x) = x_hat - x;
  der(x_hat) = x_start - x_hat;
  der(x_start) = -x_start;
end Twin;
";

const INPUTS: &str =
    "  input Real a(min = 2, max = 9), b(min = -5, max = -1), c(min = -1, max = 9);
  input Real d(start = 3), e(start = 4), f(min = 1, max = 3);
  Real x(";

const TWIN_STUDY: &str = r#"
plant = "twin.mo"
[sensors]
measured = ["y"]
noise = { y = 0.1 }
[process_noise]
x = 1e-3
[observer]
family = "FAMILY"
[estimate]
method = "rk4"
substeps = 2
[simulate]
until = 5
"#;

/// A state that is called like the estimate of another one, and one like its start.
#[test]
fn names_that_are_taken_give_way_and_are_told() {
    let folder = Folder::empty();
    folder.write("twin.mo", TWIN);
    folder.write("twin.toml", &TWIN_STUDY.replace("FAMILY", "triangular"));
    folder.write("filter.toml", &TWIN_STUDY.replace("FAMILY", "ekf"));
    let names = |arguments: &[&str], file: &str| {
        let to = format!("out{}", arguments.concat());
        let arguments = [&["export"], arguments, &["--to", "fmu", "-o", &to]].concat();
        let made = folder.run(&arguments);
        assert_eq!(made.code, 0, "{}", made.err);
        let archive = folder.path.path().join(&to).join(file);
        let files = unpacked(&std::fs::read(archive).unwrap());
        let description = text(&files, "modelDescription.xml");
        let names: Vec<String> = variables(&description)
            .into_iter()
            .map(|(n, _)| n)
            .collect();
        let mut once = names.clone();
        once.sort();
        once.dedup();
        assert_eq!(once.len(), names.len(), "{names:?}");
        (names, made.err)
    };
    let estimate =
        "the variable of the estimate of x is called x_hat_2: another one is called x_hat";
    let start = "the variable of the start of x is called x_start_2: another one is called x_start";
    for study in ["twin.toml", "filter.toml"] {
        let (found, told) = names(&[study], "twin.fmu");
        for name in ["x_hat_2", "x_hat_hat", "x_start_2", "x_hat_start"] {
            assert!(found.contains(&name.to_owned()), "{name}: {found:?}");
        }
        assert!(told.contains(estimate) && told.contains(start), "{told}");
    }
    let (found, told) = names(&["twin.toml", "--system", "observer"], "twin_observer.fmu");
    let expected = ["x_hat_2", "x_hat_hat", "x_start_hat", "der(x_hat_2)"];
    assert!(
        expected
            .iter()
            .all(|name| found.contains(&(*name).to_owned())),
        "{found:?}"
    );
    assert!(told.contains(estimate), "{told}");
    let (found, told) = names(&["twin.toml", "--system", "plant"], "twin_plant.fmu");
    let expected = [
        "time",
        "x",
        "x_hat",
        "x_start",
        "der(x)",
        "der(x_hat)",
        "der(x_start)",
        "y",
    ];
    assert_eq!(found, expected);
    assert!(!told.contains("is called"), "{told}");
}

/// What inputs are that nobody sets.
#[test]
fn an_input_starts_as_the_study_or_the_model_says_else_next_to_zero() {
    let folder = Folder::empty();
    folder.write(
        "twin.mo",
        &TWIN
            .replace("  Real x(", INPUTS)
            .replace("= x_hat -", "= a+b+c+d+e+f + x_hat -"),
    );
    let study = TWIN_STUDY.replace("FAMILY", "triangular");
    folder.write(
        "twin.toml",
        &(study + "inputs = { e = \"3 + 4\", f = \"2 + sin(time)\" }\n"),
    );
    for (arguments, expected) in [
        (&["twin.mo"][..], [2.0, -1.0, 0.0, 3.0, 4.0, 1.0]),
        (&["twin.toml"], [2.0, -1.0, 0.0, 3.0, 7.0, 1.0]),
        (
            &["twin.toml", "--system", "plant"],
            [2.0, -1.0, 0.0, 3.0, 7.0, 1.0],
        ),
        (
            &["twin.toml", "--system", "observer"],
            [2.0, -1.0, 0.0, 3.0, 7.0, 1.0],
        ),
    ] {
        let to = format!("out{}", arguments.concat());
        let made = folder.run(&[&["export"], arguments, &["--to", "fmu", "-o", &to]].concat());
        assert_eq!(made.code, 0, "{}", made.err);
        let written = std::fs::read_dir(folder.path.path().join(&to))
            .unwrap()
            .next()
            .unwrap();
        let files = unpacked(&std::fs::read(written.unwrap().path()).unwrap());
        let told = variables(&text(&files, "modelDescription.xml"));
        for (name, start) in ["a", "b", "c", "d", "e", "f"].iter().zip(expected) {
            let (_, told) = told.iter().find(|(own, _)| own == name).unwrap();
            assert!(
                told.contains(&format!("start=\"{start:?}\"")),
                "{arguments:?} {name}: {told}"
            );
        }
    }
}
