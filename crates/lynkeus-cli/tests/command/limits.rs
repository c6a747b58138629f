//! `--time-limit` and `--memory-limit` hold on models that are too large.

use std::time::{Duration, Instant};

use super::{Ended, Folder, examples};

/// Seconds that each command may take.
const LIMIT: u64 = 2;
/// What a slow machine needs beside twice the limit, for a build that is not optimised.
const SLACK: Duration = Duration::from_secs(2);

/// A chain of n states with a sine in every equation.
pub fn chain(n: usize) -> String {
    format!(
        "model M input Real u(start=0,min=-1,max=1); Real x[{n}](each start=0.5,each min=-2,each max=2);
  output Real y=x[1];
equation
  for i in 1:{n}-1 loop der(x[i]) = x[i+1] - x[i] + 0.1*sin(x[i]); end for;
  der(x[{n}]) = -x[{n}] + u;
end M;"
    )
}

/// Every state in every equation, through fractions.
pub fn dense(n: usize) -> String {
    format!(
        "model M Real x[{n}](each start=0.5,each min=-2,each max=2); output Real y=x[1];
equation
  for i in 1:{n} loop der(x[i]) = -x[i] + sum(sin(i*j)*x[j]/(1+x[j]^2) for j in 1:{n})/{n}; end for;
end M;"
    )
}

/// A column of n trays, measured at both ends.
pub fn column(n: usize) -> String {
    format!(
        "model M parameter Real a=1.6;
  input Real L(start=4,min=3,max=6); input Real V(start=5,min=4,max=8);
  Real x[{n}](each start=0.5,each min=0,each max=1); Real y[{n}];
  output Real top=x[1]; output Real bottom=x[{n}];
equation
  for i in 1:{n} loop y[i]=a*x[i]/(1+(a-1)*x[i]); end for;
  der(x[1])=V*(y[2]-x[1]);
  for i in 2:{n}-1 loop der(x[i])=L*(x[i-1]-x[i])+V*(y[i+1]-y[i]); end for;
  der(x[{n}])=L*(x[{n}-1]-x[{n}])+V*(x[{n}]-y[{n}]);
end M;"
    )
}

/// A mass matrix of n coupled derivatives.
pub fn masses(n: usize) -> String {
    format!(
        "model M Real x[{n}]; output Real y=x[1];
equation
  for i in 1:{n} loop sum((if i==j then 101 else 1)*der(x[j]) for j in 1:{n})=-x[i]; end for;
end M;"
    )
}

/// n algebraic variables, each after the one before it.
pub fn ladder(n: usize) -> String {
    format!(
        "model M Real x(start=1); Real z[{n}]; output Real y=x;
equation
  der(x)=-x+z[{n}]; z[1]=0.1*x;
  for i in 2:{n} loop z[i]=0.9*z[i-1]+0.01*x; end for;
end M;"
    )
}

/// What a command says under limits, within twice its time.
fn limited(folder: &Folder, arguments: &[&str]) -> Ended {
    let limit = LIMIT.to_string();
    let limits = ["--time-limit", &limit, "--memory-limit", "200"];
    let begun = Instant::now();
    let ended = folder.run(&[arguments, &limits[..]].concat());
    let taken = begun.elapsed();
    let allowed = Duration::from_secs(2 * LIMIT) + SLACK;
    assert!(
        taken < allowed,
        "{arguments:?} took {taken:?}\n{}",
        ended.err
    );
    ended
}

#[test]
fn an_examination_of_a_large_plant_ends_with_what_was_found() {
    let models = [
        chain(80),
        dense(40),
        column(100),
        masses(64),
        ladder(30_000),
    ];
    for (number, model) in models.iter().enumerate() {
        let folder = Folder::empty();
        folder.write("m.mo", model);
        let ended = limited(&folder, &["check", "m.mo"]);
        let told = format!("model {number}: {}{}", ended.out, ended.err);
        assert!([0, 1, 3].contains(&ended.code), "{told}");
        // a report of every family, or one line that says why there is none
        let families = ["triangular", "block-triangular", "drift-observable"];
        let whole = families.iter().all(|family| ended.out.contains(family));
        assert!(whole || ended.err.contains("of 2 s ended it"), "{told}");
        assert!(!told.contains("panicked"), "{told}");
    }
}

#[test]
fn what_a_limit_ended_is_undecided_and_no_refusal() {
    let folder = Folder::empty();
    folder.write("m.mo", &dense(40));
    let ended = limited(&folder, &["check", "m.mo"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let family = "\ndrift-observable: undecided\n  undecided: too large for the time and memory allowed: some ";
    assert!(ended.out.contains(family), "{}", ended.out);
    assert!(
        !ended.out.contains("no observer of this version"),
        "{}",
        ended.out
    );
}

#[test]
fn a_design_that_takes_too_long_is_undecided() {
    let folder = Folder::empty();
    folder.write("m.mo", &column(50));
    let study = "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ngain = \"lmi\"\nrate = 0.1\n[simulate]\nuntil = 2\n";
    folder.write("s.toml", study);
    for command in ["design", "certify", "simulate"] {
        let ended = limited(&folder, &[command, "s.toml"]);
        assert_eq!(ended.code, 3, "{command}: {}", ended.err);
        assert!(
            ended.err.contains("undecided: the limit of 2 s ended it"),
            "{}",
            ended.err
        );
    }
}

#[test]
fn memory_that_ends_is_a_verdict() {
    let folder = Folder::empty();
    folder.write("m.mo", &dense(40));
    let ended = folder.run(&["check", "m.mo", "--memory-limit", "30"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended
            .out
            .contains("undecided: too large for the time and memory allowed"),
        "{}",
        ended.out
    );
}

#[test]
fn a_run_that_is_ended_tells_its_rows() {
    let folder = Folder::new();
    folder.change("study.toml", "output_step = 4", "output_step = 1e-3");
    let arguments = [
        "simulate",
        "study.toml",
        "-o",
        "rows.csv",
        "--time-limit",
        "1",
    ];
    let ended = folder.run(&arguments);
    if ended.code == 0 {
        // a machine that does it all within a second
        return;
    }
    assert_eq!(ended.code, 3, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the run is not whole: the limit of 1 s ended it"),
        "{}",
        ended.err
    );
    assert!(folder.read("rows.csv").lines().count() > 2);
}

/// No limit was asked for and none would help: a refusal, not a run that was cut short.
#[test]
fn digits_that_are_missing_are_no_limit() {
    let folder = Folder::empty();
    let cells = "model H Real x[30](each start=0.5, each min=-1, each max=1); output Real y=x[1];
equation
  der(x[1])=x[2]-x[1];
  for i in 2:29 loop der(x[i])=x[i+1]-2*x[i]+x[i-1]; end for;
  der(x[30])=x[29]-x[30]^3;
end H;";
    folder.write("h.mo", cells);
    let study = "plant=\"h.mo\"\n[observer]\nfamily=\"drift-observable\"\nalpha=1\ngamma=1\n[simulate]\nuntil=1\n";
    folder.write("h.toml", study);
    let ended = folder.run(&["simulate", "h.toml", "-o", "o.csv"]);
    assert_eq!(ended.code, 1, "{}", ended.err);
    let told = "whether the family 'drift-observable' fits is undecided: rounding hides it";
    assert!(ended.err.contains(told), "{}", ended.err);
    assert!(!ended.err.contains("--time-limit"), "{}", ended.err);
}

/// The rows that a filter made by then are written, as those of any observer.
#[test]
fn a_filter_that_a_limit_ends_keeps_its_rows() {
    let folder = Folder::empty();
    let model = "model M Real x(start = 1, min = -2, max = 2); Real v(start = 0, min = -2, max = 2); output Real y = x;
      equation der(x) = v; der(v) = -sin(x); end M;";
    folder.write("m.mo", model);
    let study = "plant = \"m.mo\"\n[sensors]\nnoise = { y = 0.01 }\n[observer]\nfamily = \"mhe\"\nhorizon = 40\n[simulate]\nuntil = 2000\noutput_step = 0.1\n";
    folder.write("s.toml", study);
    let ended = limited(&folder, &["simulate", "s.toml", "-o", "o.csv"]);
    assert_eq!(ended.code, 3, "{}", ended.err);
    assert!(
        ended
            .err
            .contains("the run is not whole: the limit of 2 s ended it"),
        "{}",
        ended.err
    );
    let (header, rows) = crate::csv(&folder.read("o.csv"));
    assert_eq!(header, ["t", "x", "v", "x_hat", "v_hat"]);
    assert!(rows.len() > 1 && rows.len() < 20_001, "{}", rows.len());
    assert!(rows.iter().all(|row| row.iter().all(|x| x.is_finite())));
    // where not even the plant's run is whole there is nothing to write
    folder.change(
        "s.toml",
        "until = 2000\noutput_step = 0.1",
        "until = 1e7\noutput_step = 1",
    );
    let ended = limited(&folder, &["simulate", "s.toml", "-o", "p.csv"]);
    assert_eq!(ended.code, 3, "{}", ended.err);
    assert!(!folder.files().contains(&"p.csv".to_owned()));
}

/// Where a limit ends the work on a family, no other is taken in its place without a word.
#[test]
fn a_limit_takes_no_other_observer_in_silence() {
    let folder = Folder::empty();
    for file in ["quadrotor.mo", "study.toml"] {
        let text = std::fs::read_to_string(examples().join("quadrotor").join(file)).unwrap();
        folder.write(file, &text);
    }
    let text = folder.read("study.toml");
    let start = text.find("[observer]").unwrap();
    let end = start
        + text[start + 1..]
            .find("\n[")
            .map_or(text.len() - start, |at| at + 2);
    let open = format!(
        "{}[process_noise]\nwind = 0.1\n\n[observer]\nfamily = \"auto\"\n\n{}",
        &text[..start],
        &text[end..]
    );
    folder.write("study.toml", &open);
    let family = |ended: &Ended| {
        ended.json()["family"]
            .as_str()
            .unwrap_or_default()
            .to_owned()
    };
    let free = family(&folder.run(&["design", "study.toml", "--json"]));
    assert_ne!(free, "ekf");
    for limit in [
        ["--memory-limit", "1"],
        ["--time-limit", "0.004"],
        ["--time-limit", "0.02"],
        ["--time-limit", "0.1"],
    ] {
        let design = folder.run(&[&["design", "study.toml"][..], &limit].concat());
        let told = format!("{}{}", design.out, design.err);
        let same = design.code == 0 && told.contains(&format!("{free} observer"));
        assert!(
            design.code == 3 || same || told.contains("depends on a limit"),
            "{limit:?}: {told}"
        );
        let export = folder.run(
            &[
                &["export", "study.toml", "--to", "c", "-o", "c", "--force"][..],
                &limit,
            ]
            .concat(),
        );
        let header = folder.path.path().join("c").join("quadrotor.h");
        let header = std::fs::read_to_string(header).unwrap_or_default();
        assert!(
            export.code == 3
                || header.contains(&format!("{free} observer"))
                || export.err.contains("depends on a limit"),
            "{limit:?}: {}",
            export.err
        );
        let certify = folder.run(&[&["certify", "study.toml"][..], &limit].concat());
        let said = format!("{}{}", certify.out, certify.err);
        assert!(
            certify.code == 3
                || said.contains(&format!("{free} observer"))
                || said.contains("depends on a limit"),
            "{limit:?}: {said}"
        );
        let check = folder.run(&[&["check", "study.toml"][..], &limit].concat());
        assert!(
            !check.out.contains("no family with a theorem fits"),
            "{}",
            check.out
        );
    }
}
