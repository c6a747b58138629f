//! Limits hold on large and hostile models, for every command that examines or proves.

use std::fs::File;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::Folder;
use super::limits::{chain, column, dense, ladder, masses};

/// Seconds and MiB that a command is allowed.
const TIME: u64 = 2;
const MEMORY: u64 = 200;
/// What starting the program takes, and a build that is not optimised.
const SLACK: Duration = Duration::from_secs(2);
/// A command that ends later than this has hung, however busy the machine is.
const HUNG: Duration = Duration::from_secs(120);
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

/// Where what a command says is kept.
const SAID: &str = "said.txt";

/// How a command ended, after how long, and the most memory that it used.
#[derive(Debug)]
struct Use {
    code: Option<i32>,
    /// that passed
    time: Duration,
    /// of processors; on a busy machine less than what passed, and with threads more
    busy: Duration,
    /// MiB; zero where the system does not tell
    memory: u64,
}

impl Use {
    /// How long it took by itself: what other work takes of the machine does not count.
    fn own(&self) -> Duration {
        self.time.min(self.busy)
    }
}

fn watched(folder: &Folder, arguments: &[&str]) -> Use {
    let said = File::create(folder.path.path().join(SAID)).unwrap();
    let begun = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(arguments)
        .current_dir(folder.path.path())
        .stdout(said)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (mut memory, mut busy) = (0, Duration::ZERO);
    loop {
        memory = memory.max(peak(&child));
        busy = processor_time(&child).unwrap_or(busy);
        if let Some(status) = child.try_wait().unwrap() {
            let time = begun.elapsed();
            return Use {
                code: status.code(),
                time,
                busy: if busy.is_zero() { time } else { busy },
                memory,
            };
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The time for which a process under way has had processors so far, where the system tells.
fn processor_time(child: &Child) -> Option<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).ok()?;
    let (_, after_name) = stat.rsplit_once(')')?;
    // in user mode and in the kernel, in hundredths of a second
    let both = after_name.split_whitespace().skip(11).take(2);
    let ticks: u64 = both.map(|n| n.parse::<u64>().ok()).sum::<Option<u64>>()?;
    Some(Duration::from_millis(10 * ticks))
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
    let (time, memory) = (TIME.to_string(), MEMORY.to_string());
    let limits = ["--time-limit", &time, "--memory-limit", &memory];
    for command in ["check", "design", "certify"] {
        let used = watched(&folder, &[&[command, "m.toml"], &limits[..]].concat());
        let (code, memory, seconds) = (used.code, used.memory, used.time.as_secs_f64());
        let row = format!("| {name} | {command} | {code:?} | {seconds:.1} | {memory} |");
        // seen with --nocapture
        let _ = writeln!(std::io::stderr(), "{row}");
        let told = format!("{command} on {name}: {used:?}");
        assert!(code.is_some_and(|code| code <= 3), "{told}");
        assert!(used.own() < Duration::from_secs(2 * TIME) + SLACK, "{told}");
        assert!(used.time < HUNG, "{told}");
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
    let used = watched(&folder, &["check", "m.mo"]);
    let out = folder.read(SAID);
    assert!(used.own() < Duration::from_secs(10), "{used:?}");
    assert!(used.code == Some(0) && used.time < HUNG, "{used:?}");
    assert!(out.contains("(1000 in all)"), "{out}");
    assert!(!out.contains("states undecided"), "{out}");
    let large = "\ndrift-observable: undecided\n  undecided: too large for the time";
    assert!(out.contains(large), "{out}");
}
