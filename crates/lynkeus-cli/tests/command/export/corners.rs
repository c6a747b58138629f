//! Exports of what is unusual: operations, times, names of files, filters that stand still.

use std::process::{Command, Stdio};

use super::{compiled, difference, estimated, has, replayed};
use crate::normal::Normal;
use crate::random::pick;
use crate::{Folder, skipped};

/// What stands on the right of the derivatives, besides what keeps them bounded.
const TERMS: [&str; 10] = [
    "0.3*abs(a - b)",
    "0.2*max(a, u)",
    "0.2*min(b, 0.3*c)",
    "(if a > 0.2 then 0.1 else -0.1)",
    "0.1*max(b, 0.1)^2.5",
    "0.2*atan2(a, 1 + b^2)",
    "0.1*sign(c)",
    "0.1*(1 + a^2)^(-3)",
    "0.2*sqrt(abs(c) + 1)",
    "0.1*z",
];

/// A filter with three states, an algebraic loop that is linear, and two sensors at two rates.
fn study(random: &mut Normal, folder: &Folder) {
    let mut term = || *pick(random, &TERMS);
    let model = format!(
        "model Wide
  Real a(start = 0.4); Real b(start = -0.2); Real c(start = 0.1); Real z;
  input Real u(start = 0);
  output Real p = a + 0.1*b^3; output Real q = b*c + c;
equation
  der(a) = -a + {} + {};
  der(b) = -0.7*b + {} + u;
  der(c) = -0.4*c + {} - {};
  (3 + a^2)*z = b + z*0.5;
end Wide;\n",
        term(),
        term(),
        term(),
        term(),
        term()
    );
    folder.write("m.mo", &model);
    let family = *pick(random, &["ekf", "ukf"]);
    let step = *pick(random, &["step = 0.03", "substeps = 3"]);
    folder.write(
        "s.toml",
        &format!(
            "plant = \"m.mo\"
[sensors]
noise = {{ p = 0.05, q = 0.1 }}
[process_noise]
a = 0.01
b = 0.02
c = 0.01
[observer]
family = \"{family}\"
[estimate]
method = \"rk4\"
{step}
sd = true\n"
        ),
    );
    let mut t = *pick(random, &[0.0, -3.0, 1.7e9]);
    let mut log = String::from("t,p,q,u\n");
    for row in 0..50 {
        let p = 0.4 + 0.2 * (0.1 * f64::from(row)).sin() + 0.05 * random.next();
        let slow = if row % 3 == 0 {
            format!("{:.5}", 0.1 * random.next())
        } else {
            String::new()
        };
        log += &format!("{t:.3},{p:.5},{slow},{:.4}\n", 0.3 * random.next());
        t += 0.1 + 0.05 * random.uniform();
    }
    folder.write("log.csv", &log);
}

/// Exports s.toml to C, compiles that, and tells how far it is from `estimate` on log.csv.
fn off(folder: &Folder, options: &[&str]) -> f64 {
    let path = folder.path.path();
    let mut arguments = vec!["export", "s.toml", "--to", "c", "-o", "c", "--force"];
    arguments.extend(options);
    let made = folder.run(&arguments);
    assert_eq!(made.code, 0, "{}", made.err);
    compiled(path, &["-fsanitize=address,undefined"]);
    let expected = estimated(path).unwrap();
    difference(&expected, &replayed(path, &[]), &folder.read("s.toml"))
}

#[test]
fn operations_that_bend_and_jump_are_those_of_estimate() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    for seed in 0..6 {
        let folder = Folder::empty();
        study(&mut Normal(9100 + seed), &folder);
        let off = off(&folder, &[]);
        assert!(
            off <= 1e-12,
            "seed {seed}: {off:e}\n{}",
            folder.read("m.mo")
        );
    }
}

#[test]
fn float_differs_from_double_by_its_digits() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    study(&mut Normal(9203), &folder);
    let off = off(&folder, &["--precision", "f32"]);
    assert!((1e-9..1e-4).contains(&off), "{off:e}");
}

#[test]
fn what_stands_still_needs_one_step() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    let model = "model Still Real x(start = 1); output Real y = sqrt(x^2 + x^4); equation der(x) = 0; end Still;";
    folder.write("m.mo", model);
    folder.write("log.csv", "t,y\n0,1.2\n1,1.3\n2.5,\n3,1.1\n");
    let study = "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nprocess_noise = { x = 0.01 }\nobserver = { family = \"ekf\" }\n";
    folder.write("s.toml", study);
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert!(
        made.err.contains("one step from each sample"),
        "{}",
        made.err
    );
    compiled(folder.path.path(), &[]);
    folder.write(
        "s.toml",
        &(study.to_owned() + "estimate = { method = \"rk4\", substeps = 1 }\n"),
    );
    assert!(off(&folder, &[]) <= 1e-12);
}

/// Sigma points ask for values alone: at 0 this output has no slope.
#[test]
fn an_unscented_filter_needs_no_slopes() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    folder.write("m.mo", "model Range Real p(start = 0); Real q(start = 0); output Real y = sqrt(p^2 + q^2); equation der(p) = 1 - p; der(q) = 0.5 - q; end Range;");
    folder.write("s.toml", "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nprocess_noise = { p = 0.01, q = 0.01 }\nobserver = { family = \"ukf\", initial_variance = { default = 0 } }\nestimate = { method = \"rk4\", step = 0.05, sd = true }\n");
    folder.write("log.csv", "t,y\n0,0.1\n0.5,0.4\n1,0.7\n1.5,0.8\n");
    let off = off(&folder, &[]);
    assert!(off <= 1e-12, "{off:e}");
}

#[test]
fn bends_with_time_are_told() {
    let folder = Folder::empty();
    folder.write("m.mo", "model Bend Real x(start = 1); output Real y = x; equation der(x) = -x + max(time, 1.37); end Bend;");
    folder.write("s.toml", "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nprocess_noise = { x = 0.01 }\nobserver = { family = \"ekf\" }\nestimate = { method = \"rk4\", step = 0.1 }\n");
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert!(
        made.code == 0 && made.err.contains("bends with time"),
        "{}",
        made.err
    );
}

/// Models called as files and targets are, with states called as functions and constants are, and
/// descriptions that speak of functions.
#[test]
fn names_of_files_and_functions_build() {
    let study = "plant = \"m.mo\"\nsensors = { noise = { y = 0.1 } }\nprocess_noise = { sinf = 0.01, M_PI = 0.01, HUGE_VAL = 0.01, unix = 0.01, Math = 0.01, TUNING = 0.01 }\nobserver = { family = \"ekf\" }\nestimate = { method = \"rk4\", step = 0.1 }\n";
    for name in ["M", "Replay", "Math", "Install", "Fmi3"] {
        let folder = Folder::empty();
        folder.write(
            "m.mo",
            &format!(
                "model {name}
  Real sinf(start = 1) \"the larger sign of real power R(T), NAN at TIME\";
  Real M_PI(start = 1); Real HUGE_VAL(start = 0); Real unix(start = 0); Real Math(start = 0); Real TUNING(start = 0.1);
  output Real y = sinf + M_PI + 0.1*TUNING;
equation
  der(sinf) = -sin(sinf) + HUGE_VAL; der(M_PI) = -M_PI + unix; der(HUGE_VAL) = -HUGE_VAL + Math;
  der(unix) = -unix; der(TUNING) = -2*TUNING; der(Math) = -Math^3;
end {name};"
            ),
        );
        folder.write("s.toml", study);
        folder.write("log.csv", "t,y\n0,2\n0.5,1.8\n1,1.5\n");
        let path = folder.path.path();
        if has("gcc") {
            let off = off(&folder, &[]);
            assert!(off <= 1e-12, "{name}: {off:e}");
            let header = std::fs::read_dir(path.join("c")).unwrap();
            let headers = header.map(|file| file.unwrap().file_name().into_string().unwrap());
            let header = headers
                .into_iter()
                .find(|file| file.ends_with(".h"))
                .unwrap();
            let text = folder.read(&format!("c/{header}"));
            assert!(
                text.contains("the larger sign of real power R(T), NAN at TIME"),
                "{text}"
            );
        }
        if !has("cmake") {
            skipped("cmake is not there");
            continue;
        }
        for step in [["-S", "c", "-B", "b"].as_slice(), &["--build", "b"]] {
            let mut cmake = Command::new("cmake");
            let cmake = cmake.args(step).current_dir(path).stdin(Stdio::null());
            let ended = cmake.output().unwrap();
            let told = String::from_utf8_lossy(&ended.stderr);
            assert!(ended.status.success(), "{name}: {told}");
        }
    }
}

#[test]
fn the_bench_takes_whole_cells_only() {
    if !has("gcc") {
        return skipped("gcc is not there");
    }
    let folder = Folder::empty();
    study(&mut Normal(9100), &folder);
    assert!(off(&folder, &[]) <= 1e-12);
    let good = folder.read("log.csv");
    for wrong in ["2026-11-22T01:02:03", "5 V", "0x"] {
        let log = good.lines().take(2).collect::<Vec<_>>().join("\n");
        folder.write("wrong.csv", &format!("{log}\n{wrong},1,1,1\n"));
        let log = std::fs::File::open(folder.path.path().join("wrong.csv")).unwrap();
        let mut bench = Command::new(folder.path.path().join("c/replay"));
        let ended = bench.stdin(log).output().unwrap();
        let told = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{told}");
        assert!(
            told.contains("row 3: expected a number") && told.contains(wrong),
            "{told}"
        );
    }
}

#[test]
fn the_head_says_what_is_guaranteed_and_where() {
    let folder = Folder::empty();
    folder.write("m.mo", "model Pair Real x(start = 1, min = -2, max = 2); Real v(start = 0, min = -3, max = 3); output Real y = x; equation der(x) = v; der(v) = -x - v; end Pair;");
    folder.write("s.toml", "plant = \"m.mo\"\nobserver = { family = \"triangular\", theta = 3 }\nestimate = { method = \"rk4\", step = 0.01 }\n");
    let made = folder.run(&["export", "s.toml", "--to", "c", "-o", "c"]);
    assert_eq!(made.code, 0, "{}", made.err);
    let header = folder.read("c/pair.h");
    for told in ["proved", "box: x in [-2, 2], v in [-3, 3]"] {
        assert!(header.contains(told), "{told}: {header}");
    }
}

/// A rate of 1e-50 is 0 in `float`: told in every language that has it, once, and of `double` never.
#[test]
fn numbers_that_float_has_not_are_told() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M Real x(start = 1, min = -9, max = 9); output Real y = x; equation der(x) = -1e-50*x; end M;",
    );
    folder.write(
        "s.toml",
        "plant = \"m.mo\"\nobserver = { theta = 2 }\nestimate = { method = \"rk4\", step = 0.1 }\n",
    );
    let told = "`float` makes 0 or an infinity of 1e-50";
    for to in ["c", "rust", "fmu"] {
        for (precision, count) in [("f32", 1), ("f64", 0)] {
            let name = format!("{to}-{precision}");
            let arguments = ["export", "s.toml", "--to", to, "--precision", precision];
            let ended = folder.run(&[&arguments[..], &["-o", &name]].concat());
            assert_eq!(ended.code, 0, "{}", ended.err);
            assert_eq!(
                ended.err.matches(told).count(),
                count,
                "{name}: {}",
                ended.err
            );
        }
    }
}
