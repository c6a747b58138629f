//! `export`: what compilers make of it gives what `estimate` gives.

mod corners;
mod credible;
mod events;
mod glitch;
mod hidden;
mod hybrid;
pub(super) mod javascript;
mod late;
mod manifold;
mod misread;
mod names;
mod rust;
mod slopes;
mod structured;

use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};

use lynkeus::{Study, Table};

use crate::normal::Normal;
use crate::random::{pick, plant};
use crate::{Folder, examples, skipped};

/// Examples of every family, whose observers need no log.
const OBSERVERS: [(&str, &str); 14] = [
    ("two-tanks", "study.toml"),
    ("two-tanks", "smoothed.toml"),
    ("lee", "study.toml"),
    ("lee", "classical.toml"),
    ("ltaief", "study.toml"),
    ("predator-prey", "study.toml"),
    ("farza", "study-noise.toml"),
    ("cstr", "study.toml"),
    ("van-der-pol-pair", "study.toml"),
    ("quadrotor", "study.toml"),
    ("flexible-joint", "study.toml"),
    ("bioreactor", "study.toml"),
    ("germani-manes", "practical.toml"),
    ("column", "study-noise.toml"),
];

/// Filters of random plants among which every kind of option occurs: family, noise, limits, gate, sigma points, steps, `sd`;
/// the last one makes a millionfold of rounding errors.
const FILTERS: [u64; 7] = [13, 21, 35, 41, 79, 399, AMPLIFIES];
const AMPLIFIES: u64 = 141;

pub(super) fn has(command: &str) -> bool {
    let mut asked = Command::new(command);
    let asked = asked.arg("--version").stdout(Stdio::null());
    let asked = asked.stderr(Stdio::null()).status();
    asked.is_ok_and(|status| status.success())
}

/// The study without a section.
pub(super) fn without(study: &str, section: &str) -> String {
    let mut is_inside = false;
    let lines = study.lines().filter(|line| {
        if line.starts_with('[') {
            is_inside = line.starts_with(section);
        }
        !is_inside
    });
    lines.map(|line| format!("{line}\n")).collect()
}

/// An example with a log of its own simulation, in which some cells are missing.
fn example(random: &mut Normal, folder: &Folder, place: usize) {
    let (name, file) = OBSERVERS[place];
    folder.copy_models(name);
    let study = std::fs::read_to_string(examples().join(name).join(file)).unwrap();
    let study = without(&study, "[estimate]");
    folder.write("s.toml", &study);
    let seed = format!("{}", (random.uniform() * 1e6) as u64);
    let made = folder.run(&[
        "simulate",
        "s.toml",
        "--log",
        "whole.csv",
        "-o",
        "run.csv",
        "--seed",
        &seed,
    ]);
    assert!(made.code < 2, "{name}: {}", made.err);
    let whole = folder.read("whole.csv");
    let share = *pick(random, &[0.0, 0.1, 0.3]);
    let rows = whole.lines().take(160).enumerate().map(|(row, line)| {
        let cells = line.split(',').enumerate().map(|(column, cell)| {
            let is_lost = row > 1 && column > 0 && random.uniform() < share;
            if is_lost { "" } else { cell }.to_owned()
        });
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    let log: String = rows.collect();
    folder.write("log.csv", &log);
    let has_noise = study.contains("\nnoise");
    let sd = has_noise && random.uniform() < 0.4;
    let between = *pick(random, &["hold", "predict"]);
    let step = pick(random, &["substeps = 3", "substeps = 8"]);
    let estimate = format!(
        "\n[estimate]\nmethod = \"rk4\"\n{step}\nbetween_samples = \"{between}\"\nsd = {sd}\n"
    );
    let wandering = if sd {
        densities(&study, 0.01)
    } else {
        String::new()
    };
    folder.write("s.toml", &(study + &wandering + &estimate));
}

/// Densities of a study's unknown inputs, without which an exported deviation would be none.
pub(super) fn densities(study: &str, density: f64) -> String {
    let unknown = study
        .lines()
        .find_map(|line| line.strip_prefix("unknown = ["));
    let names = unknown.map_or("", |rest| rest.split(']').next().unwrap());
    let names = names.split(',').map(|name| name.trim().trim_matches('"'));
    let lines = names.filter(|name| !name.is_empty() && !study.contains("[process_noise]"));
    let lines: String = lines
        .map(|name| format!("\"{name}\" = {density}\n"))
        .collect();
    match lines.is_empty() {
        true => lines,
        false => format!("\n[process_noise]\n{lines}"),
    }
}

/// A filter of a random plant on a random log.
fn filter(random: &mut Normal, folder: &Folder) {
    let (model, unknown) = plant(random);
    folder.write("m.mo", &model);
    let number = |random: &mut Normal, low: f64, high: f64| low + (high - low) * random.uniform();
    let family = *pick(random, &["ekf", "ekf", "ukf"]);
    let noise = match pick(random, &[0, 1, 2]) {
        0 => format!("{:.3}", number(random, 0.01, 0.3)),
        1 => "\"5%\"".to_owned(),
        _ => "{ uniform = 0.2 }".to_owned(),
    };
    let mut study = format!(
        "plant = \"m.mo\"\n[sensors]\nmeasured = [\"y\"]\nunknown = {unknown:?}\nnoise = {{ y = {noise} }}\n"
    );
    if random.uniform() < 0.4 {
        // out of reach, or in the midst of the readings
        study += *pick(
            random,
            &[
                "limits = { y = [-1.5, 1.5] }\n",
                "limits = { y = [-0.3, 0.4] }\n",
            ],
        );
    }
    study += "[process_noise]\n";
    for name in ["x0", "x1", "x2", "x3"]
        .iter()
        .map(|n| (*n).to_owned())
        .chain(unknown)
    {
        if model.contains(&format!("Real {name}(")) {
            study += &format!("{name} = {:.4}\n", number(random, 0.0, 0.05));
        }
    }
    study += &format!("[observer]\nfamily = \"{family}\"\n");
    if random.uniform() < 0.5 {
        study += &format!("gate = {}\n", pick(random, &[2, 3, 5]));
        study += &format!("gate_patience = {}\n", pick(random, &[1, 4, 10]));
    }
    if family == "ukf" && random.uniform() < 0.5 {
        study += *pick(
            random,
            &["alpha = 0.5\nbeta = 2\n", "kappa = 1\n", "alpha = 0.1\n"],
        );
    }
    let step = pick(random, &["step = 0.02", "step = 0.05", "substeps = 4"]);
    let sd = random.uniform() < 0.7;
    study += &format!("[estimate]\nmethod = \"rk4\"\n{step}\nsd = {sd}\n");
    folder.write("s.toml", &study);
    let inputs: Vec<String> = (0..2).map(|i| format!("u{i}")).collect();
    let inputs: Vec<&String> = inputs
        .iter()
        .filter(|u| model.contains(&format!("Real {u}(")))
        .collect();
    let mut log = String::from("t,y");
    for input in &inputs {
        log += &format!(",{input}");
    }
    log.push('\n');
    let mut t = 0.0_f64;
    for row in 0..60 {
        let y = match random.uniform() < 0.15 {
            true => String::new(),
            false => format!("{:.6}", 0.5 * (0.3 * t).sin() + 0.1 * random.next()),
        };
        log += &format!("{t:.4},{y}");
        for _ in &inputs {
            let u = match row > 0 && random.uniform() < 0.2 {
                true => String::new(),
                false => format!("{:.4}", 0.3 * random.next()),
            };
            log += &format!(",{u}");
        }
        log.push('\n');
        t += 0.05 + 0.1 * random.uniform();
    }
    folder.write("log.csv", &log);
}

/// Header, rows, and whether the run reached its end.
pub(super) type Run = (Vec<String>, Vec<Vec<f64>>, bool);

/// Of the study s.toml and the log log.csv.
pub(super) fn estimated(folder: &Path) -> Result<Run, lynkeus::Error> {
    estimated_of(folder, "log.csv")
}

fn estimated_of(folder: &Path, log: &str) -> Result<Run, lynkeus::Error> {
    let study = Study::load(folder.join("s.toml"))?;
    let log = Table::load(folder.join(log))?;
    let outcome = lynkeus::estimate(&study, &log, &mut |_| ControlFlow::Continue(()))?;
    let columns = outcome.columns();
    let header = columns.iter().map(|(name, _)| name.clone()).collect();
    let columns: Vec<Vec<f64>> = columns.iter().map(|(_, c)| c.iter().collect()).collect();
    let rows = (0..columns[0].len()).map(|row| columns.iter().map(|c| c[row]).collect());
    Ok((header, rows.collect(), outcome.ended.is_none()))
}

pub(super) fn compiled(folder: &Path, options: &[&str]) {
    compiled_by("gcc", folder, options);
}

fn compiled_by(compiler: &str, folder: &Path, options: &[&str]) {
    let code = folder.join("c");
    let mut compiler = Command::new(compiler);
    // what is watched while it runs takes twice as long to compile when it is optimised, too
    let is_watched = options.iter().any(|o| o.starts_with("-fsanitize"));
    compiler.args([
        "-std=c99",
        if is_watched { "-O0" } else { "-O2" },
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
    ]);
    compiler
        .args(["-ffp-contract=off", "-o", "replay"])
        .args(options);
    for file in std::fs::read_dir(&code).unwrap() {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|e| e == "c") {
            compiler.arg(path.file_name().unwrap());
        }
    }
    let ended = compiler.arg("-lm").current_dir(&code).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{}\n{told}", code.display());
}

pub(super) fn replayed(folder: &Path, arguments: &[&str]) -> Run {
    let log = std::fs::File::open(folder.join("log.csv")).unwrap();
    let mut command = Command::new(folder.join("c/replay"));
    let ended = command.args(arguments).stdin(log).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(
        !told.contains("runtime error") && !told.contains("Sanitizer"),
        "{told}"
    );
    let (header, rows) = crate::csv(&String::from_utf8(ended.stdout).unwrap());
    (header, rows, ended.status.success())
}

/// Whether a row, time first, is still of the size of the first one.
fn is_tame(row: &[f64], first: &[f64]) -> bool {
    let mut pairs = row.iter().zip(first).skip(1);
    pairs.all(|(x, start)| x.abs() <= 100.0 * (1.0 + start.abs()))
}

/// The largest difference of two runs, each column in units of its largest value.
pub(super) fn difference(a: &Run, b: &Run, study: &str) -> f64 {
    assert_eq!(a.0, b.0);
    let length = |run: &Run| (run.1.len(), run.2);
    assert_eq!(
        length(a),
        length(b),
        "rows, and whether all of them: {study}"
    );
    apart(a, b).last().copied().unwrap_or(0.0)
}

/// The same up to each row that both have.
fn apart(a: &Run, b: &Run) -> Vec<f64> {
    let size = |column: usize| {
        let column = a.1.iter().map(|row| row[column].abs());
        column.fold(1e-300, f64::max)
    };
    let sizes: Vec<f64> = (0..a.0.len()).map(size).collect();
    let mut worst = 0.0_f64;
    let row = |(x, y): (&Vec<f64>, &Vec<f64>)| {
        for ((x, y), size) in x.iter().zip(y).zip(&sizes) {
            let is_same = x == y || (x.is_nan() && y.is_nan());
            let off = if is_same { 0.0 } else { (x - y).abs() / size };
            // a number and none are as far apart as can be
            worst = worst.max(if off.is_nan() { f64::INFINITY } else { off });
        }
        worst
    };
    a.1.iter().zip(&b.1).map(row).collect()
}

/// The log with every reading and input a few units of its last digit off, up or down.
fn moved(random: &mut Normal, log: &str) -> String {
    let (header, rows) = log.split_once('\n').unwrap();
    let mut text = format!("{header}\n");
    for row in rows.lines() {
        let cells = row.split(',').enumerate().map(|(column, cell)| {
            let sign = if random.uniform() < 0.5 { 1.0 } else { -1.0 };
            match cell.parse::<f64>() {
                Ok(x) if column > 0 => format!("{:e}", x * (1.0 + sign * 1e-15)),
                _ => cell.to_owned(),
            }
        });
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// A study that was exported as C, and its estimates.
struct Looked {
    seed: u64,
    folder: Folder,
    expected: Run,
}

impl Looked {
    /// Compares what a language other than C has made of the study.
    fn compare(&self, found: Run, language: &str, calls_functions: bool) {
        if let Err(off) = self.compared(found, calls_functions) {
            let study = self.folder.read("s.toml");
            panic!("seed {}, {language}: {off}\n{study}", self.seed);
        }
    }

    /// Where a language calls functions that no standard defines to the last digit, these differ from the C library's: the plant
    /// carries that on, and a filter that runs away multiplies it.
    fn compared(&self, mut found: Run, calls_functions: bool) -> Result<(), String> {
        let mut expected = self.expected.clone();
        let mut limit = 1e-12;
        if calls_functions {
            limit = 1e-9;
            let first = expected.1[0].clone();
            let tame = expected.1.iter().take_while(|row| is_tame(row, &first));
            let tame = tame.count();
            for run in [&mut expected, &mut found] {
                run.1.truncate(tame);
                run.2 = true;
            }
        }
        let off = difference(&expected, &found, &self.folder.read("s.toml"));
        match off <= limit {
            true => Ok(()),
            false if calls_functions => self.rows_compared(&expected, &found),
            false => Err(format!("{off:e}")),
        }
    }

    /// Some studies make a millionfold of the last digit: a plant that is unstable for a while beside a filter that does not see
    /// it. There each row is held against how far the study's own estimates move up to it with the last digits of the log.
    /// Of two hundred studies none was off by more than 1.2 times what three moved logs make.
    fn rows_compared(&self, expected: &Run, found: &Run) -> Result<(), String> {
        let log = self.folder.read("log.csv");
        let mut random = Normal(self.seed);
        let mut reach = vec![0.0_f64; expected.1.len()];
        for _ in 0..4 {
            self.folder.write("moved.csv", &moved(&mut random, &log));
            let run = estimated_of(self.folder.path.path(), "moved.csv");
            // a run that ends says nothing of what follows
            let apart = apart(expected, &run.map_err(|e| e.to_string())?).into_iter();
            let apart = apart.chain(std::iter::repeat(f64::INFINITY));
            for (reach, apart) in reach.iter_mut().zip(apart) {
                *reach = reach.max(apart);
            }
        }
        let off = apart(expected, found);
        let mut rows = off.iter().zip(&reach).enumerate();
        match rows.find(|(_, (off, reach))| **off > 1e-9 + 10.0 * **reach) {
            None => Ok(()),
            Some((row, (off, reach))) => Err(format!(
                "{off:e} up to row {row}, where the last digits of the log make {reach:e}"
            )),
        }
    }
}

/// Every example, and filters.
#[test]
fn c_and_others_give_what_estimate_gives() {
    let examples = (0..OBSERVERS.len() as u64).map(|place| 2 * place);
    agree(&examples.chain(FILTERS).collect::<Vec<_>>());
}

#[test]
#[ignore = "takes minutes"]
fn c_and_others_give_what_estimate_gives_of_two_hundred_studies() {
    agree(&(0..200).collect::<Vec<_>>());
}

/// C and the others in turn on studies: examples by even seeds, filters by odd ones.
fn agree(seeds: &[u64]) {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let looked = seeds.iter().filter_map(|&seed| {
        let mut random = Normal(1000 + seed);
        let folder = Folder::empty();
        match seed % 2 {
            0 => example(&mut random, &folder, (seed / 2) as usize % OBSERVERS.len()),
            _ => filter(&mut random, &folder),
        }
        look(seed, folder)
    });
    let kept: Vec<Looked> = looked.collect();
    let looked_at = kept.len();
    assert!(
        2 * looked_at >= seeds.len(),
        "{looked_at} of {}",
        seeds.len()
    );
    rust::check(&kept);
}

/// Languages beside C, each in turn: all of them take every study where [`ALL`] is set, as `cargo xtask test --all`
/// does.
#[derive(Clone, Copy)]
enum Other {
    JavaScript,
    StructuredText,
    Rust,
}

const ALL: &str = "LYNKEUS_ALL_TESTS";

impl Other {
    fn takes(self, seed: u64) -> bool {
        std::env::var_os(ALL).is_some() || seed % 3 == self as u64
    }
}

/// The languages but Rust on a study; none where it cannot be estimated.
fn look(seed: u64, folder: Folder) -> Option<Looked> {
    let path = folder.path.path();
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    let expected = estimated(path);
    if made.code != 0 {
        // what cannot be estimated is refused by both, in a sentence
        assert!(expected.is_err(), "seed {seed}: {}", made.err);
        return None;
    }
    match seed % 4 {
        1 | 2 => compiled(path, &["-fsanitize=address,undefined"]),
        3 if has("clang") => compiled_by("clang", path, &[]),
        _ => compiled(path, &[]),
    }
    let study = folder.read("s.toml");
    let expected = expected.unwrap();
    let off = difference(&expected, &replayed(path, &[]), &study);
    assert!(off <= 1e-12, "seed {seed}: {off:e}\n{study}");
    let looked = Looked {
        seed,
        folder,
        expected,
    };
    if Other::JavaScript.takes(seed) {
        match has("node") {
            true => javascript::check(&looked),
            false => skipped("node is not there"),
        }
    }
    if Other::StructuredText.takes(seed) {
        structured::check(&looked);
    }
    Some(looked)
}

/// The factor of the noise's covariance begins at the noise, wherever its state stands.
#[test]
fn noise_that_acts_far_away_is_carried_as_estimate_does() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let kinds = [("ekf", 1), ("ekf", 3), ("ukf", 1)];
    let looked = kinds
        .into_iter()
        .zip(0..)
        .map(|((family, substeps), seed)| {
            let folder = Folder::empty();
            folder.write(
                "m.mo",
                "model Chain
  Real a(start = 0.3, min = -5, max = 5); Real b(start = 0.1, min = -5, max = 5);
  Real c(start = 0, min = -5, max = 5); input Real u; output Real y = a;
equation
  der(a) = b - 0.1*a*a; der(b) = c - 0.3*b; der(c) = u - 0.5*c;
end Chain;\n",
            );
            let study = format!(
                "plant = \"m.mo\"\n[sensors]\nnoise = {{ y = 0.02 }}\n[process_noise]\nc = 0.7\n\
             [observer]\nfamily = \"{family}\"\n\
             [estimate]\nmethod = \"rk4\"\nsubsteps = {substeps}\nsd = true\n"
            );
            folder.write("s.toml", &study);
            let rows = (0..60).map(|k| {
                let t = 0.15 * f64::from(k);
                format!(
                    "{t:.2},{:.4},{:.4}\n",
                    0.3 + 0.2 * t.sin(),
                    0.5 * (2.0 * t).cos()
                )
            });
            folder.write("log.csv", &format!("t,y,u\n{}", rows.collect::<String>()));
            let looked = look(seed, folder).unwrap();
            let code = looked.folder.read("c/chain.c");
            assert!(code.contains("noise_order[3] = {2, 1, 0};"), "{code}");
            looked
        });
    rust::check(&looked.collect::<Vec<_>>());
}

#[test]
fn what_cannot_run_elsewhere_is_refused_and_nothing_is_written() {
    let folder = Folder::empty();
    let study = |observer: &str| {
        format!(
            "plant = \"m.mo\"\nsensors = {{ noise = {{ y = 0.1 }} }}\nprocess_noise = {{ x = 0.01 }}\nobserver = {{ family = \"{observer}\" }}\n"
        )
    };
    let model = |equations: &str| {
        format!(
            "model M\n  Real x(start = 1);\n  Real z(start = 0.5);\n  output Real y = x;\nequation\n  {equations}\nend M;\n"
        )
    };
    let plain = model("der(x) = -z; z = x;");
    let cases = [
        ("mhe", plain.clone(), "moving horizon"),
        (
            "ekf",
            model("der(x) = -z; z + 0.1*exp(z) = x;"),
            "algebraic loop for z",
        ),
        (
            "ekf",
            model("der(x) = -z; z = if time < 5 then x else 1;"),
            "jumps with time",
        ),
    ];
    for (observer, model, word) in cases {
        folder.write("m.mo", &model);
        folder.write("s.toml", &study(observer));
        let refused = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
        assert_eq!(refused.code, 1, "{}", refused.err);
        assert!(refused.err.contains(word), "{}", refused.err);
        assert!(!folder.path.path().join("c").exists());
    }
    folder.write("m.mo", &plain);
    folder.write("s.toml", &study("ekf"));
    let asked = ["export", "s.toml", "--to", "c", "-o", "c"];
    let made = folder.run(&asked);
    assert_eq!(made.code, 0, "{}", made.err);
    assert!(
        made.err
            .contains("which the fastest mode at the start needs"),
        "{}",
        made.err
    );
    let first = folder.read("c/m.c");
    let again = folder.run(&asked);
    assert_eq!(again.code, 2);
    assert!(again.err.contains("--force"), "{}", again.err);
    let forced = folder.run(&["export", "s.toml", "--to", "c", "-o", "c", "--force"]);
    assert_eq!(forced.code, 0, "{}", forced.err);
    assert_eq!(
        folder.read("c/m.c"),
        first,
        "the text is the same every time"
    );
}
