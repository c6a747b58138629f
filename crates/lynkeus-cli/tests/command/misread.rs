//! Known inputs that are read with errors, sensors whose noises go together: `input_noise` and `correlation` of
//! `[sensors]`.

use crate::{Folder, csv};

/// A kettle, its heater and two thermometers.
const PLANT: &str = "model Kettle
  input Real heat(min = 0, max = 4, start = 2);
  Real water(min = 0, max = 100, start = 20);
  Real body(min = 0, max = 100, start = 20);
  output Real lid = water;
  output Real wall = body;
equation
  der(water) = 0.5*(body - water);
  der(body) = heat - 0.3*(body - water) - 0.02*(body - 20);
end Kettle;
";

pub(crate) fn kettle(family: &str, more: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("kettle.mo", PLANT);
    folder.write(
        "s.toml",
        &format!(
            "plant = \"kettle.mo\"
[sensors]
noise = {{ lid = 0.2, wall = 0.3 }}
input_noise = {{ heat = 0.4 }}
correlation = {{ lid = {{ wall = 0.7 }} }}
[observer]
family = \"{family}\"
{more}
[simulate]
until = 40
output_step = 0.5
inputs = {{ heat = \"2 + sin(time/3)\" }}
method = \"rk4\"
step = 0.25
[estimate]
sd = true
method = \"rk4\"
step = 0.25
"
        ),
    );
    folder
}

fn column(folder: &Folder, file: &str, name: &str) -> Vec<f64> {
    let (header, rows) = csv(&folder.read(file));
    let place = header.iter().position(|h| h == name).unwrap();
    rows.iter().map(|row| row[place]).collect()
}

const FILTERS: [(&str, &str); 3] = [
    ("ekf", "initial_variance = { default = 0 }"),
    ("ukf", "initial_variance = { default = 0 }"),
    ("mhe", "initial_variance = { default = 0 }\nhorizon = 5"),
];

/// Over many runs errors are as large as is claimed; a filter that is not told how wrong its input is claims too
/// little.
#[test]
fn errors_are_as_large_as_is_claimed() {
    for (family, more) in FILTERS {
        let runs = if family == "mhe" { "10" } else { "40" };
        let folder = kettle(family, more);
        let found = folder.run(&["simulate", "s.toml", "--runs", runs, "--json"]);
        assert_eq!(found.code, 0, "{family}: {}", found.err);
        for name in ["water", "body"] {
            let size = found.json()["quantities"][name]["rms_in_sd"]
                .as_f64()
                .unwrap();
            assert!((0.8..1.25).contains(&size), "{family} {name}: {size}");
        }
    }
    let folder = kettle("ekf", "initial_variance = { default = 0 }");
    let log = folder.run(&[
        "simulate", "s.toml", "--log", "log.csv", "-o", "true.csv", "-q",
    ]);
    assert_eq!(log.code, 0, "{}", log.err);
    let last = |study: &str| {
        folder.write("own.toml", study);
        let run = folder.run(&["estimate", "own.toml", "log.csv", "-o", "own.csv"]);
        let (header, rows) = csv(&folder.read("own.csv"));
        let place = header.iter().position(|h| h == "body_sd").unwrap();
        (rows.last().unwrap()[place], run)
    };
    let study = folder.read("s.toml");
    let (whole, told) = last(&study);
    assert_eq!(told.code, 0, "{}", told.err);
    let trusting = study.replace(
        "input_noise = { heat = 0.4 }\n",
        "[process_noise]\nbody = 0\n",
    );
    let trusting = trusting.replace("correlation = { lid = { wall = 0.7 } }\n", "");
    assert!(last(&trusting).0 < 0.3 * whole);
    // what is read is in the log, what is true in the table
    let column = |file: &str, name: &str| column(&folder, file, name);
    let [read, truth] = ["log.csv", "true.csv"].map(|file| column(file, "heat"));
    let squares = read.iter().zip(&truth).map(|(a, b)| (a - b).powi(2));
    let deviation = (squares.sum::<f64>() / read.len() as f64).sqrt();
    assert!((0.3..0.5).contains(&deviation), "{deviation}");
    let [lid, water] = [("log.csv", "lid"), ("true.csv", "water")].map(|(f, n)| column(f, n));
    let [wall, body] = [("log.csv", "wall"), ("true.csv", "body")].map(|(f, n)| column(f, n));
    let noise = |read: &[f64], truth: &[f64]| -> Vec<f64> {
        read.iter().zip(truth).map(|(a, b)| a - b).collect()
    };
    let both = crate::references::correlation(&noise(&lid, &water), &noise(&wall, &body));
    assert!((0.5..0.85).contains(&both), "{both}");
}

/// What is foretold is what the filter says on a log, and the same whatever the sensors do together is not.
#[test]
fn how_well_counts_both() {
    let folder = kettle("ekf", "");
    let foretold = |folder: &Folder| {
        let run = folder.run(&["check", "s.toml", "--how-well", "--json"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let json = run.json();
        json["how_well"]["standard_error"]["body"]
            .as_f64()
            .or_else(|| json["standard_error"]["body"].as_f64())
            .unwrap_or_else(|| panic!("{}", run.out))
    };
    let said = folder.run(&["check", "s.toml", "--how-well"]);
    assert!(
        said.out
            .contains("`input_noise` and `correlation` are counted"),
        "{}",
        said.out
    );
    let both = foretold(&folder);
    folder.change("s.toml", "correlation = { lid = { wall = 0.7 } }\n", "");
    let alone = foretold(&folder);
    folder.change("s.toml", "heat = 0.4", "heat = 0.1");
    let exact = foretold(&folder);
    assert!(
        exact < alone && (both - alone).abs() > 1e-3,
        "{exact} {alone} {both}"
    );
}

/// A family with a theorem counts the errors of its inputs in `sd`, and says that it does not what sensors have in
/// common.
#[test]
fn deviations_of_a_family_count_errors_of_inputs() {
    let folder = kettle("triangular", "theta = 1");
    let only = "measured = [\"lid\"]\nnoise = { lid = 0.2, wall = 0.3 }";
    folder.change("s.toml", "noise = { lid = 0.2, wall = 0.3 }", only);
    let mut squares = [vec![], vec![]];
    for seed in ["1", "2", "3", "4", "5", "6", "7", "8"] {
        let run = folder.run(&[
            "simulate", "s.toml", "--seed", seed, "--log", "log.csv", "-o", "true.csv", "-q",
        ]);
        assert!(run.code <= 1, "{}", run.err);
        let run = folder.run(&["estimate", "s.toml", "log.csv", "-o", "own.csv"]);
        assert_eq!(run.code, 0, "{}", run.err);
        assert!(run.err.contains("correlated noise ("), "{}", run.err);
        for (name, squares) in ["water", "body"].into_iter().zip(&mut squares) {
            let truth = column(&folder, "true.csv", name);
            let found = column(&folder, "own.csv", &format!("{name}_hat"));
            let deviations = column(&folder, "own.csv", &format!("{name}_sd"));
            let all = found.iter().zip(&truth).zip(&deviations).skip(40);
            squares.extend(all.map(|((x, truth), sd)| ((x - truth) / sd).powi(2)));
        }
    }
    for squares in squares {
        let size = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((0.75..1.3).contains(&size), "{size}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let cases: [(&str, &str, &[&str]); 7] = [
        (
            "heat = 0.4",
            "heet = 0.4",
            &[
                "`input_noise` of [sensors]: no known input is called \"heet\"",
                "heat",
            ],
        ),
        (
            "heat = 0.4",
            "heat = -0.4",
            &["s.toml:4", "a standard deviation >= 0"],
        ),
        (
            "wall = 0.7",
            "wal = 0.7",
            &[
                "`correlation` of [sensors]: no output is called \"wal\"",
                "wall",
            ],
        ),
        (
            "wall = 0.7",
            "wall = 1.0",
            &["s.toml:5", "a correlation between -1 and 1"],
        ),
        (
            "{ lid = { wall = 0.7 } }",
            "{ lid = { wall = 0.7 }, wall = { lid = 0.1 } }",
            &["each pair of two outputs once"],
        ),
        (
            "wall = 0.3",
            "wall = { uniform = 0.3 }",
            &["the noise of wall is uniform"],
        ),
        (", wall = 0.3", "", &["wall has no `noise`"]),
    ];
    for (text, other, said) in cases {
        let folder = kettle("ekf", "");
        folder.change("s.toml", text, other);
        let run = folder.run(&["simulate", "s.toml"]);
        assert_eq!(run.code, 2, "{other}: {}", run.err);
        for said in said {
            assert!(run.err.contains(said), "{other}: {}", run.err);
        }
    }
    let folder = kettle("ekf", "");
    folder.change(
        "kettle.mo",
        "output Real wall = body;",
        "output Real wall = body; output Real rim = body;",
    );
    folder.change("s.toml", "wall = 0.3", "wall = 0.3, rim = 0.1");
    folder.change(
        "s.toml",
        "{ lid = { wall = 0.7 } }",
        "{ lid = { wall = 0.9, rim = 0.9 }, wall = { rim = -0.9 } }",
    );
    let run = folder.run(&["simulate", "s.toml"]);
    assert_eq!(run.code, 2);
    assert!(
        run.err.contains("smallest eigenvalue is -0.8"),
        "{}",
        run.err
    );
}

/// The deviation of a noise is found although it goes with another's and the input is wrong.
#[test]
fn a_fit_counts_them() {
    let folder = kettle("ekf", "initial_variance = { default = 0 }");
    folder.change("s.toml", "until = 40", "until = 400");
    let log = folder.run(&["simulate", "s.toml", "--log", "log.csv", "-q"]);
    assert!(log.code <= 1, "{}", log.err);
    let study = folder.read("s.toml") + "[fit]\nnoise = [\"lid\", \"wall\"]\n";
    folder.write("s.toml", &study);
    let run = folder.run(&["fit", "s.toml", "log.csv", "--json"]);
    assert_eq!(run.code, 0, "{}", run.err);
    for (name, expected) in [("lid", 0.2), ("wall", 0.3)] {
        let found = run.json()["noise"][name]["value"].as_f64().unwrap();
        assert!((found / expected - 1.0).abs() < 0.12, "{name}: {found}");
    }
}
