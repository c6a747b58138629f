//! A replay that is killed goes on where it was, and gives the same bytes.

use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use super::refused;
use crate::Folder;

const CHECKPOINT: &str = "run.checkpoint";
const JUDGED: &str = "run.checkpoint.judged";
const ARGUMENTS: [&str; 7] = [
    "estimate",
    "study.toml",
    "log.csv",
    "-o",
    "e.csv",
    "--checkpoint",
    CHECKPOINT,
];

/// Long enough to be killed a few times, while the machine does nothing else; then longer for one that was busy while
/// that was found out, and is not any more.
const LONG: [Duration; 4] = [
    Duration::from_secs(1),
    Duration::from_secs(4),
    Duration::from_secs(15),
    Duration::from_secs(45),
];

/// The two tanks with so many substeps that a run takes long, and what it gives in the end.
struct Slow {
    folder: Folder,
    whole: String,
    /// how long that took
    time: Duration,
}

/// The study as it is, found out once for all tests.
fn plain() -> Slow {
    static FOUND: LazyLock<(String, String, Duration)> = LazyLock::new(|| {
        let found = slow(LONG[0], |_| ());
        (found.folder.read("study.toml"), found.whole, found.time)
    });
    let (study, whole, time) = &*FOUND;
    let folder = Folder::new();
    folder.write("study.toml", study);
    Slow {
        folder,
        whole: whole.clone(),
        time: *time,
    }
}

fn slow(long: Duration, prepare: impl Fn(&Folder)) -> Slow {
    let folder = Folder::new();
    prepare(&folder);
    let mut substeps = 16;
    loop {
        let since = Instant::now();
        let whole = folder.run(&["estimate", "study.toml", "log.csv"]);
        assert_eq!(whole.code, 0, "{}", whole.err);
        let time = since.elapsed();
        if time > long {
            let whole = whole.out;
            return Slow {
                folder,
                whole,
                time,
            };
        }
        let factor = (1.5 * long.as_secs_f64() / since.elapsed().as_secs_f64()).clamp(2.0, 50.0);
        let more = (f64::from(substeps) * factor) as u32;
        let [from, to] = [substeps, more].map(|count| format!("substeps = {count} "));
        folder.change("study.toml", &from, &to);
        substeps = more;
    }
}

fn start(folder: &Folder) -> Child {
    Command::new(env!("CARGO_BIN_EXE_lynkeus"))
        .args(ARGUMENTS)
        .current_dir(&folder.path)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Of the checkpoint, and of that of the run which judges the first.
fn size(folder: &Folder) -> u64 {
    let path = |name: &str| folder.path.path().join(name);
    let files = [path(CHECKPOINT), path(JUDGED)];
    let sizes = files.map(|file| std::fs::metadata(file).map_or(0, |data| data.len()));
    sizes.iter().sum()
}

/// Starts a run and kills it `later` after its checkpoint has grown; false where it ended first.
fn killed(folder: &Folder, later: Duration) -> bool {
    let before = size(folder);
    let mut child = start(folder);
    while size(folder) <= before {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(later);
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Kills a run at several moments; what it ends with is what an uninterrupted one gives.
#[track_caller]
fn goes_on(prepare: impl Fn(&Folder)) {
    let was_killed = LONG.into_iter().any(|long| went_on(&slow(long, &prepare)));
    assert!(was_killed, "too fast to be killed with something kept");
}

/// False where it ended before it was killed as often as wanted, or had kept nothing by then.
#[track_caller]
fn went_on(Slow { folder, whole, .. }: &Slow) -> bool {
    for later in [0, 37, 210, 90] {
        if !killed(folder, Duration::from_millis(later)) {
            return false;
        }
    }
    if folder.files().contains(&"e.csv".to_owned()) {
        // killed between its result and the end
        return false;
    }
    // a kill in the middle of a record
    let torn = [
        std::fs::read(folder.path.path().join(CHECKPOINT)).unwrap(),
        vec![9; 21],
    ]
    .concat();
    std::fs::write(folder.path.path().join(CHECKPOINT), torn).unwrap();
    let ended = folder.run(&ARGUMENTS);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(folder.read("e.csv") == *whole, "another result");
    for file in [CHECKPOINT, JUDGED] {
        assert!(!folder.files().contains(&file.to_owned()), "{file}");
    }
    ended.err.contains("went on after row")
}

const FILTER: &str =
    "[process_noise]\npump = 0.001\n[observer]\nfamily = \"mhe\"\nhorizon = 3\n[ignored]";

#[test]
fn a_killed_replay_of_an_observer_goes_on() {
    goes_on(|_| ());
}

#[test]
fn a_killed_replay_with_standard_deviations_goes_on() {
    let held = (
        "between_samples = \"linear\"",
        "sd = true\nbetween_samples = \"predict\"",
    );
    let wander = ("[observer]", "[process_noise]\npump = 0.25\n[observer]");
    goes_on(|folder| {
        folder.change("study.toml", held.0, held.1);
        folder.change("study.toml", wander.0, wander.1);
    });
}

#[test]
fn a_killed_replay_of_a_moving_horizon_goes_on() {
    goes_on(|folder| {
        let study = folder.read("study.toml");
        let from = study.find("[observer]").unwrap();
        let to = study.find("[simulate]").unwrap();
        let filter = FILTER.replace("[ignored]", "\n");
        folder.write(
            "study.toml",
            &format!("{}{filter}{}", &study[..from], &study[to..]),
        );
    });
}

#[test]
fn a_checkpoint_of_something_else_is_refused_and_stays() {
    let Slow { folder, .. } = plain();
    assert!(killed(&folder, Duration::from_millis(30)));
    let study = folder.read("study.toml");
    folder.change("study.toml", "theta = 0.09", "theta = 0.08");
    refused(&folder, &ARGUMENTS, &["run.checkpoint", "of another study"]);
    folder.write("study.toml", &study);
    folder.change("log.csv", "4,5.15621265697", "4,5.15621265698");
    refused(&folder, &ARGUMENTS, &["run.checkpoint", "of another log"]);
    folder.write(CHECKPOINT, "my notes, which are longer than a head\n");
    refused(&folder, &ARGUMENTS, &["run.checkpoint", "is no checkpoint"]);
    folder.write(CHECKPOINT, "notes\n");
    refused(&folder, &ARGUMENTS, &["run.checkpoint", "is no checkpoint"]);
    let same = [
        "estimate",
        "study.toml",
        "log.csv",
        "--checkpoint",
        "log.csv",
    ];
    refused(&folder, &same, &["would replace the log"]);
}

#[test]
fn a_smoother_has_no_checkpoint() {
    let folder = Folder::new();
    folder.change("study.toml", "[estimate]", "[estimate]\nsmooth = true");
    refused(&folder, &ARGUMENTS, &["`smooth`", "no checkpoint"]);
}

/// What a limit of time ends goes on another time.
#[test]
fn a_run_that_a_limit_ended_goes_on() {
    let Slow {
        folder,
        whole,
        time,
    } = plain();
    let mut limit = 0.3 * time.as_secs_f64();
    let mut rows = vec![];
    loop {
        let seconds = limit.to_string();
        let limited = [&ARGUMENTS[..], &["--time-limit", &seconds]].concat();
        if folder.run(&limited).code == 3 {
            rows.push(folder.read("e.csv").lines().count());
            if rows.ends_with(&[rows[rows.len() - 1]; 2]) {
                // too busy a machine to come to another record in that time
                limit *= 2.0;
            }
            assert!(rows.len() < 100, "{rows:?}");
        } else if rows.is_empty() {
            // the time was that of a busier machine
            limit /= 2.0;
            assert!(limit > 0.01, "too fast to be ended");
        } else {
            break;
        }
    }
    assert!(rows.windows(2).all(|w| w[0] <= w[1]), "{rows:?}");
    assert!(folder.read("e.csv") == whole);
}
