//! Limits hold on large and hostile models, for every command that examines or proves.

use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::Folder;
use super::limits::{chain, column, dense, ladder, masses};

/// Seconds and MiB that a command is allowed.
const TIME: u64 = 2;
const MEMORY: u64 = 200;
/// What starting the program on a busy machine takes, and a build that is not optimised.
const SLACK: Duration = Duration::from_secs(2);
/// The program itself, MiB.
const PROGRAM: u64 = 20;

/// Models of one kind, by their size.
struct Kind {
    name: &'static str,
    model: fn(usize) -> String,
    sizes: &'static [usize],
}

const KINDS: [Kind; 7] = [
    kind("chain", chain, &[80, 160, 300]),
    kind("dense", dense, &[20, 40, 60]),
    kind("column", column, &[50, 100, 200]),
    kind("masses", masses, &[25, 50, 64]),
    kind("ladder", ladder, &[10_000, 30_000]),
    kind("band", band, &[100, 1000, 5000]),
    kind("products", products, &[6, 9, 12]),
];

const fn kind(name: &'static str, model: fn(usize) -> String, sizes: &'static [usize]) -> Kind {
    Kind { name, model, sizes }
}

/// A band of n states, each acting on its neighbours.
pub fn band(n: usize) -> String {
    format!(
        "model M Real x[{n}](each start=0.1,each min=-1,each max=1); output Real y=x[1];
equation
  der(x[1])=x[2]-x[1];
  for i in 2:{n}-1 loop der(x[i])=x[i+1]-2*x[i]+x[i-1]^2; end for;
  der(x[{n}])=-x[{n}];
end M;"
    )
}

/// The product of all states in every equation, within functions within functions.
fn products(n: usize) -> String {
    let all: Vec<String> = (1..=n).map(|i| format!("x[{i}]")).collect();
    let all = all.join("*");
    format!(
        "model M Real x[{n}](each start=0.1,each min=-1,each max=1); output Real y=x[1];
equation
  for i in 1:{n}-1 loop der(x[i])=exp(sin({all}))-tanh(x[i]+x[i+1])+cosh(x[i])^3; end for;
  der(x[{n}])=-x[{n}]*cosh({all});
end M;"
    )
}

/// How a command ended, after how long, and the most memory that it used.
struct Use {
    code: Option<i32>,
    time: Duration,
    /// MiB; zero where the system does not tell
    memory: u64,
}

fn watched(folder: &Folder, command: &str) -> Use {
    let (time, memory) = (TIME.to_string(), MEMORY.to_string());
    let limits = ["--time-limit", &time, "--memory-limit", &memory];
    let begun = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args([&[command, "m.toml"], &limits[..]].concat())
        .current_dir(folder.path.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut memory = 0;
    loop {
        memory = memory.max(peak(&child));
        if let Some(status) = child.try_wait().unwrap() {
            let (code, time) = (status.code(), begun.elapsed());
            return Use { code, time, memory };
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The most memory that a process has used so far, MiB.
fn peak(child: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id()));
    let status = status.unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let number = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    number.unwrap_or_default() / 1024
}

/// Every command on a model, a row each.
fn holds(name: &str, model: &str) {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("m.toml", "plant = \"m.mo\"\n[simulate]\nuntil = 1\n");
    for command in ["check", "design", "certify"] {
        let Use { code, time, memory } = watched(&folder, command);
        let seconds = time.as_secs_f64();
        let row = format!("| {name} | {command} | {code:?} | {seconds:.1} | {memory} |");
        // seen with --nocapture
        let _ = writeln!(std::io::stderr(), "{row}");
        let told = format!("{command} on {name}: {code:?}, {time:?}, {memory} MiB");
        assert!(code.is_some_and(|code| code <= 3), "{told}");
        assert!(time < Duration::from_secs(2 * TIME) + SLACK, "{told}");
        assert!(memory < MEMORY * 3 / 2 + PROGRAM, "{told}");
    }
}

#[test]
fn limits_hold_on_the_smallest_of_each_kind() {
    for kind in KINDS {
        let size = kind.sizes[0];
        holds(&format!("{} {size}", kind.name), &(kind.model)(size));
    }
}

/// Minutes: `cargo test --release -p lynkeus --test command hostile -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes"]
fn limits_hold_on_all() {
    for kind in KINDS {
        for &size in kind.sizes {
            holds(&format!("{} {size}", kind.name), &(kind.model)(size));
        }
    }
}

/// What a chain of many states shows follows equation by equation; a family that is too large
/// says so before it begins.
#[test]
fn a_thousand_states_are_examined_in_seconds() {
    let folder = Folder::empty();
    folder.write("m.mo", &band(1000));
    let begun = Instant::now();
    let ended = folder.run(&["check", "m.mo"]);
    assert!(
        begun.elapsed() < Duration::from_secs(10),
        "{:?}",
        begun.elapsed()
    );
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.out.contains("(1000 in all)"), "{}", ended.out);
    assert!(!ended.out.contains("states undecided"), "{}", ended.out);
    let large = "\ndrift-observable: undecided\n  undecided: too large for the time";
    assert!(ended.out.contains(large), "{}", ended.out);
}
