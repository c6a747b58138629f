//! Inputs that a generator makes, and columns of their derivatives, on logs: Germani and Manes, Remark 4.2.

use crate::{Ended, Folder, csv};

/// r = 1, n = 4: (4.1) reads u, u' and u''; det Q̄ = 1.
pub(crate) const CHAIN: &str = "model Chain
  input Real u(min = -3, max = 3);
  Real x1(start = 1, min = -5, max = 5);
  Real x2(start = 0, min = -5, max = 5);
  Real x3(start = 0.5, min = -5, max = 5);
  Real x4(start = 0, min = -5, max = 5);
  output Real y = x1;
equation
  der(x1) = x2 + 0.3*x1*u;
  der(x2) = x3;
  der(x3) = x4;
  der(x4) = -x1 - 2*x2 - 3*x3 - 2*x4;
end Chain;
";

pub(crate) const OBSERVER: &str = "plant = \"m.mo\"
[observer]
family = \"drift-observable\"
variant = \"theoretical\"
poles = [-2, -2.5, -3, -3.5]
initial = { default = 0 }
";

/// Poles −2, −3, −4 and gain 1, from u = 0 to the command 1.
pub(crate) const STEP: &str = "1 - 6*exp(-2*time) + 8*exp(-3*time) - 3*exp(-4*time)";

/// A log of the chain under an input, with further columns of time, every `step` until `until`.
pub(crate) fn logged(
    folder: &Folder,
    input: &str,
    (step, until): (f64, f64),
    further: &[(&str, &dyn Fn(f64) -> f64)],
) {
    folder.write("m.mo", CHAIN);
    let run = format!(
        "[simulate]\nuntil = {until}\noutput_step = {step}\ninputs = {{ u = \"{input}\" }}\n"
    );
    folder.write("run.toml", &format!("{OBSERVER}{run}"));
    let made = folder.run(&[
        "simulate", "run.toml", "--log", "log.csv", "-q", "-o", "run.csv",
    ]);
    assert_eq!(made.code, 0, "{}", made.err);
    let text = folder.read("log.csv");
    let mut lines = text.lines();
    let names: Vec<&str> = further.iter().map(|(name, _)| *name).collect();
    let mut log = format!("{},{}\n", lines.next().unwrap(), names.join(","));
    for line in lines {
        let t: f64 = line.split(',').next().unwrap().parse().unwrap();
        let cells: Vec<String> = further.iter().map(|(_, of)| of(t).to_string()).collect();
        log += &format!("{line},{}\n", cells.join(","));
    }
    folder.write("log.csv", &log);
}

fn estimated(folder: &Folder, keys: &str) -> Ended {
    folder.write("s.toml", &format!("{OBSERVER}[estimate]\n{keys}\n"));
    folder.run(&["estimate", "s.toml", "log.csv", "-o", "e.csv"])
}

/// The estimates, row by row.
fn estimates(folder: &Folder, keys: &str) -> Vec<Vec<f64>> {
    let ended = estimated(folder, keys);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&folder.read("e.csv"));
    let places: Vec<usize> = (0..header.len())
        .filter(|i| header[*i].ends_with("_hat"))
        .collect();
    assert_eq!(places.len(), 4, "{header:?}");
    let row = |row: Vec<f64>| places.iter().map(|i| row[*i]).collect();
    rows.into_iter().map(row).collect()
}

fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
}

/// Straight lines are what a log with `"linear"` holds exactly: columns of u' and u'' and an expression
/// of time give the same estimates, and no column of u is read then.
#[test]
fn an_expression_gives_what_columns_of_slopes_give() {
    let folder = Folder::empty();
    let slope: (&str, &dyn Fn(f64) -> f64) = ("du", &|_| 0.2);
    logged(
        &folder,
        "-1 + 0.2*time",
        (0.02, 6.0),
        &[slope, ("ddu", &|_| 0.0)],
    );
    let linear = "between_samples = \"linear\"\n";
    let columns = estimates(
        &folder,
        &format!("{linear}input_derivatives = {{ u = [\"du\", \"ddu\"] }}"),
    );
    let generator = "generator = { u = \"-1 + 0.2*time\" }";
    let made = estimates(&folder, &format!("{linear}{generator}"));
    let off = difference(&columns, &made);
    assert!(off < 1e-8, "{off:e}");
    let log = folder.read("log.csv").replacen("t,y,u,", "t,y,unread,", 1);
    folder.write("log.csv", &log);
    assert_eq!(estimates(&folder, &format!("{linear}{generator}")), made);
}

/// The states of the filter are u, u' and u'' of its step response, whatever their columns would hold.
#[test]
fn a_filter_gives_what_its_response_gives() {
    let folder = Folder::empty();
    logged(&folder, STEP, (0.02, 6.0), &[("u_command", &|_| 1.0)]);
    let by_time = estimates(&folder, &format!("generator = {{ u = \"{STEP}\" }}"));
    let filter = "generator = { u = { poles = [-2, -3, -4] } }";
    let by_filter = estimates(&folder, filter);
    let off = difference(&by_time, &by_filter);
    assert!(off < 1e-8, "{off:e}");
    // a filter that starts elsewhere is another one
    let started = filter.replace("] }", "], initial = [0.5, 1] }");
    let off = difference(&by_time, &estimates(&folder, &started));
    assert!(off > 1e-3, "{off:e}");
    // a pair of poles, and a command of another name
    let log = folder.read("log.csv").replacen("u_command", "r", 1);
    folder.write("log.csv", &log);
    let pair = "generator = { u = { poles = [-2, { re = -3.5, im = 0 }], command = \"r\" } }";
    let twice = "generator = { u = { poles = [-3.5, -2, -3.5], command = \"r\" } }";
    let off = difference(&estimates(&folder, pair), &estimates(&folder, twice));
    assert!(off < 1e-8, "{off:e}");
}

/// Columns of the exact u' and u'' on lines between rows come to the filter as the rows come closer: its own
/// states are what they stand for.
#[test]
fn columns_come_to_the_filter_as_rows_come_closer() {
    let folder = Folder::empty();
    let [du, ddu] = [1, 2].map(|order| {
        move |t: f64| {
            let of = |a: f64, pole: f64| a * pole.powi(order) * (pole * t).exp();
            of(-6.0, -2.0) + of(8.0, -3.0) + of(-3.0, -4.0)
        }
    });
    let off = [0.02, 0.01].map(|step| {
        let further: [(&str, &dyn Fn(f64) -> f64); 3] =
            [("du", &du), ("ddu", &ddu), ("u_command", &|_| 1.0)];
        logged(&folder, STEP, (step, 4.0), &further);
        let linear = "between_samples = \"linear\"\n";
        let columns = format!("{linear}input_derivatives = {{ u = [\"du\", \"ddu\"] }}");
        let filter = format!("{linear}generator = {{ u = {{ poles = [-2, -3, -4] }} }}");
        difference(&estimates(&folder, &columns), &estimates(&folder, &filter))
    });
    assert!(
        off[0] < 1e-3 && (off[0] / off[1] - 4.0).abs() < 0.3,
        "{off:?}"
    );
}

#[test]
fn a_generator_that_gives_too_little_is_refused() {
    let folder = Folder::empty();
    logged(&folder, "0.5", (0.05, 2.0), &[("u_command", &|_| 1.0)]);
    let cases = [
        (
            "generator = { u = { poles = [-2, -3] } }",
            &["with 2 poles gives 2", "expected 3 poles or more"][..],
        ),
        (
            "generator = { u = { poles = [-2, 3, -4] } }",
            &["entry 2", "a number < 0"],
        ),
        (
            "generator = { u = { poles = { re = -1 } } }",
            &["{ re = number < 0, im = number }"],
        ),
        (
            "generator = { u = { initial = 1 } }",
            &["a filter { poles = […] }"],
        ),
        (
            "generator = { v = \"time\" }",
            &["generator of [estimate]", "no known input is called \"v\""],
        ),
        ("generator = { u = \"sin(x1)\" }", &["x1"]),
        (
            "generator = { u = 1 }\ninput_derivatives = { u = \"du\" }",
            &["keep one of the two"],
        ),
        (
            "generator = { u = { poles = [-2, -3, -4], command = \"r\" } }",
            &["\"r\""],
        ),
        (
            "",
            &[
                "input_derivatives = { u = ",
                "generator = { u = ",
                "practical",
            ],
        ),
    ];
    for (keys, words) in cases {
        let ended = estimated(&folder, keys);
        assert_eq!(ended.code, 2, "{keys}: {}", ended.err);
        for word in words {
            assert!(
                ended.err.contains(word),
                "{keys}: no {word:?} in {}",
                ended.err
            );
        }
    }
}

/// `tune` judges (4.1) on a log with columns of the slopes, or a generator, and finds the same in both.
#[test]
fn tune_reads_slopes_of_inputs() {
    let folder = Folder::empty();
    let slope: (&str, &dyn Fn(f64) -> f64) = ("du", &|_| 0.2);
    logged(
        &folder,
        "-1 + 0.2*time",
        (0.02, 6.0),
        &[slope, ("ddu", &|_| 0.0)],
    );
    let tuned = |keys: &str| {
        let text = OBSERVER.replace("poles = [-2, -2.5, -3, -3.5]", "poles = -2");
        let sweep = "[tune]\nkeys = { poles = [-2, -4] }\nblocks = 4\n";
        folder.write(
            "s.toml",
            &format!("{text}[estimate]\nbetween_samples = \"linear\"\n{keys}\n{sweep}"),
        );
        folder.run(&["tune", "s.toml", "--log", "log.csv", "--json"])
    };
    let errors = [
        "input_derivatives = { u = [\"du\", \"ddu\"] }",
        "generator = { u = \"-1 + 0.2*time\" }",
    ]
    .map(|keys| {
        let ended = tuned(keys);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let json = ended.json();
        let rows = json["rows"].as_array().unwrap().clone();
        assert_eq!(rows.len(), 2, "{json}");
        rows.iter()
            .map(|row| row["held_out_error"].as_f64().unwrap())
            .collect::<Vec<f64>>()
    });
    for (a, b) in errors[0].iter().zip(&errors[1]) {
        assert!(*a > 0.0 && (a - b).abs() < 1e-3 * a, "{errors:?}");
    }
    let refused = tuned("");
    assert_eq!(refused.code, 2);
    assert!(
        refused.err.contains("input_derivatives = { u = "),
        "{}",
        refused.err
    );
}
