//! Rows from nodes of an OPC UA server that no one here wrote, and estimates to others of its nodes.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use lynkeus::table;

use super::page::port;
use super::process::Serving;
use super::*;
use crate::skipped;

/// Nothing takes so long.
const LIMIT: Duration = Duration::from_secs(60);
/// Seconds since 1970 at which the plant's time is 0.
const BEGIN: i128 = 1_767_225_600;
/// The nodes of the server.
const NODES: [&str; 6] = ["y", "a", "u", "level", "f:level_sd", "b:credible"];

/// A server under way.
struct Server {
    child: Child,
    input: ChildStdin,
    said: Receiver<String>,
}

impl Server {
    /// Begins; none where there is no Python with asyncua.
    fn new(folder: &Folder, port: u16) -> Option<Self> {
        let Some(python) = std::env::var_os("LYNKEUS_OPCUA_PYTHON").map(PathBuf::from) else {
            skipped("LYNKEUS_OPCUA_PYTHON names no Python with asyncua");
            return None;
        };
        folder.write("server.py", include_str!("opcua_server.py"));
        let mut child = Command::new(python)
            .args(["server.py", &port.to_string()])
            .args(NODES)
            .current_dir(folder.path.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (sender, said) = channel();
        let output = BufReader::new(child.stdout.take().unwrap());
        thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        let input = child.stdin.take().unwrap();
        let server = Self { child, input, said };
        assert_eq!(server.said.recv_timeout(LIMIT).as_deref(), Ok("ready"));
        Some(server)
    }

    fn say(&mut self, line: &str) {
        self.input.write_all(line.as_bytes()).unwrap();
        self.input.write_all(b"\n").unwrap();
    }

    /// A value at a time of the plant, with a status.
    fn set(&mut self, (node, value, t): (&str, f64, f64), status: &str) {
        self.say(&format!(
            "set {node} {value:?} {:?} {status}",
            BEGIN as f64 + t
        ));
    }

    /// The server has all that was set.
    fn has_all(&mut self) {
        self.say("?");
        assert_eq!(self.said.recv_timeout(LIMIT).as_deref(), Ok("there"));
    }

    /// What a node holds: value, status, seconds at the source.
    fn get(&mut self, node: &str) -> Vec<String> {
        self.say(&format!("get {node}"));
        let line = self.said.recv_timeout(LIMIT).unwrap();
        line.split(' ').map(str::to_owned).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn folder_at(port: u16) -> Folder {
    folder(
        "ekf",
        &format!(
            "[log]\ntime_unit = \"s\"\n[estimate]\nsd = true\n[serve]\nwait = 30\nstate = \"tank.state\"\nhistory = \"tank-%Y-%m-%d.csv\"\n[serve.opcua]\nurl = \"opc.tcp://127.0.0.1:{port}/plant/\"\ninterval = 0.05\nnodes = {{ y = \"ns=2;s=y\", a = \"ns=2;s=a\", u = \"ns=2;s=u\" }}\nwrite = {{ level_hat = \"ns=2;s=level\", level_sd = \"ns=2;s=level_sd\", credible = \"ns=2;s=credible\" }}"
        ),
    )
}

/// The changes that a row is: node, value, time.
fn changes(row: &Row) -> Vec<(&'static str, f64, f64)> {
    let all = [("u", Some(row.u)), ("y", row.y), ("a", row.a)];
    let one = |(node, x): (&'static str, Option<f64>)| Some((node, x?, row.t));
    all.into_iter().filter_map(one).collect()
}

fn date(t: f64) -> String {
    let nanoseconds = BEGIN * 1_000_000_000 + (t * 1e9).round() as i128;
    table::Instant::at(nanoseconds, true).to_string()
}

/// What `estimate` makes of rows with dates: by date, the estimates and deviations as they are written.
fn expected(folder: &Folder, rows: &[Row]) -> BTreeMap<String, Vec<u64>> {
    let text = csv(rows);
    let dated = text.lines().skip(1).map(|line| {
        let (t, rest) = line.split_once(',').unwrap();
        format!("{},{rest}\n", date(t.parse().unwrap()))
    });
    folder.write(
        "log.csv",
        &format!("t,y,a,u\n{}", dated.collect::<String>()),
    );
    let study = Study::load(folder.path.path().join("study.toml")).unwrap();
    let log = lynkeus::log(&study, folder.path.path().join("log.csv")).unwrap();
    let outcome = lynkeus::estimate(&study, &log, &mut |_| ControlFlow::Continue(())).unwrap();
    let told = outcome
        .quantities
        .iter()
        .filter_map(|quantity| Some([quantity.estimate.as_ref()?, quantity.deviation.as_ref()?]));
    let columns: Vec<Vec<f64>> = told.flatten().map(|x| x.iter().collect()).collect();
    let row = |k: usize| columns.iter().map(|x| x[k].to_bits()).collect();
    let all = rows.iter().enumerate();
    all.map(|(k, own)| (date(own.t), row(k))).collect()
}

/// The last that a history says of each row.
fn history(folder: &Folder) -> BTreeMap<String, Vec<u64>> {
    let mut found = BTreeMap::new();
    let files = folder.files();
    for file in files.iter().filter(|name| name.starts_with("tank-")) {
        let text = folder.read(file);
        // a line that is being written has no end yet
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        for line in whole.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let numbers = cells[1..cells.len() - 2].iter();
            let bits = numbers.map(|cell| cell.parse::<f64>().unwrap().to_bits());
            found.insert(cells[0].to_owned(), bits.collect());
        }
    }
    found
}

/// Waits until something is so.
fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < LIMIT, "{what}");
        thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn what_changes_gives_what_estimate_gives() {
    let port = port();
    let folder = folder_at(port);
    let Some(mut server) = Server::new(&folder, port) else {
        return;
    };
    let rows = rows(71, 60, true);
    let expected = expected(&folder, &rows);
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    // the first row is there before others come earlier than it
    for change in changes(&rows[0]) {
        server.set(change, "0");
    }
    wait_until("no first row", || history(&folder).len() == 1);
    // in another order, some twice, and a value that is none
    let mut random = Normal(71);
    let mut rest: Vec<(f64, (&str, f64, f64))> = vec![];
    for (place, change) in rows[1..].iter().flat_map(changes).enumerate() {
        let key = |random: &mut Normal| place as f64 + 8.0 * random.uniform();
        if random.uniform() < 0.2 {
            rest.push((key(&mut random), change));
        }
        rest.push((key(&mut random), change));
    }
    rest.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (k, (_, change)) in rest.into_iter().enumerate() {
        server.set(change, "0");
        if k == 30 {
            // a bad and an uncertain one
            server.set(("y", 77.0, change.2 + 0.125), "0x80000000");
            server.set(("a", 77.0, change.2 + 0.125), "0x40000000");
        }
    }
    server.has_all();
    wait_until("the history is not what is expected", || {
        history(&folder) == expected
    });
    // the newest row stands in the nodes, with its time and a good quality
    let last = rows.last().unwrap().t;
    let level = f64::from_bits(expected[&date(last)][0]);
    let text = format!("{:?}", BEGIN as f64 + last);
    wait_until("the estimate is not written", || {
        let found = server.get("level");
        found[0].parse::<f64>().unwrap().to_bits() == level.to_bits()
            && found[1..] == ["0".to_owned(), text.clone()]
    });
    assert_eq!(server.get("credible")[..2], ["True", "0"]);
    let sd = f64::from_bits(expected[&date(last)][1]) as f32;
    assert_eq!(server.get("level_sd")[0].parse::<f64>().unwrap() as f32, sd);
    let ended = serving.stop();
    for word in ["y is no reading for now", "y is a reading again"] {
        assert!(ended.err.contains(word), "{word}: {}", ended.err);
    }
}

#[test]
fn a_server_that_begins_again_is_followed_and_what_is_not_credible_is_bad() {
    let port = port();
    let folder = folder_at(port);
    let Some(mut server) = Server::new(&folder, port) else {
        return;
    };
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    let rows = rows(72, 40, false);
    for change in rows[..20].iter().flat_map(changes) {
        server.set(change, "0");
    }
    server.has_all();
    wait_until("rows are lacking", || history(&folder).len() == 20);
    drop(server);
    serving.wait_for("no connection to");
    let mut server = Server::new(&folder, port).unwrap();
    serving.wait_for("is connected again");
    // all that it has is the last value, until it is subscribed to again
    thread::sleep(Duration::from_millis(500));
    for change in rows[20..].iter().flat_map(changes) {
        server.set(change, "0");
    }
    server.has_all();
    let expected = expected(&folder, &rows);
    wait_until("rows are lacking", || history(&folder) == expected);
    // the sensor says what the plant cannot do
    let last = rows.last().unwrap().t;
    for k in 1..=80 {
        let wrong = 2.0 + 3.0 * f64::from(k % 2);
        server.set(("y", wrong, last + f64::from(k)), "0");
    }
    wait_until("it stays credible", || server.get("credible")[0] == "False");
    wait_until("its quality stays good", || {
        server.get("level")[1] == 0x8000_0000_u32.to_string()
    });
    serving.stop();
}

#[test]
fn what_no_server_has_is_refused() {
    let port = port();
    for (from, to, words) in [
        ("ns=2;s=y", "y", "expected \"ns=2;s=Tank.Level\""),
        (
            "{ y = \"ns",
            "{ z = \"ns",
            "no row of this study has such a column",
        ),
        ("level_hat", "lvl_hat", "no answer of this study has it"),
        ("ns=2;s=a\"", "ns=2;s={asset}\"", "names no `assets`"),
        (
            "interval = 0.05",
            "interval = 0",
            "a number in [1e-2, 3600]",
        ),
        (
            "interval = 0.05",
            "security = \"none\"",
            "\"Basic256Sha256\"",
        ),
    ] {
        let folder = folder_at(port);
        let study = folder.read("study.toml");
        assert!(study.contains(from));
        folder.write("study.toml", &study.replacen(from, to, 1));
        let ended = folder.run(&["serve", "study.toml"]);
        assert_eq!(ended.code, 2, "{to}: {}", ended.err);
        assert!(ended.err.contains(words), "{to}: {}", ended.err);
    }
    let folder = folder_at(port);
    let Some(_server) = Server::new(&folder, port) else {
        return;
    };
    for (from, to, words) in [
        ("ns=2;s=y", "ns=2;s=nobody", "BadNodeIdUnknown"),
        ("ns=2;s=level\"", "ns=2;s=nobody\"", "BadNodeIdUnknown"),
        (
            "interval = 0.05",
            "security = \"Basic256Sha256\"",
            "it has None (None)",
        ),
    ] {
        let study = folder.read("study.toml");
        folder.write("study.toml", &study.replacen(from, to, 1));
        let ended = folder.run(&["serve", "study.toml"]);
        folder.write("study.toml", &study);
        assert_eq!(ended.code, 2, "{to}: {}", ended.err);
        assert!(ended.err.contains(words), "{to}: {}", ended.err);
    }
}

/// Kills at any moment: what the state has goes on, and what the source sends again counts once.
fn killed(kills: usize, seed: u64) {
    let port = port();
    let folder = folder_at(port);
    let Some(mut server) = Server::new(&folder, port) else {
        return;
    };
    let rows = rows(seed, 4 * (kills + 1), true);
    let expected = expected(&folder, &rows);
    let mut random = Normal(seed);
    // the estimate at a row is right where all rows up to it were taken; from there on the source sends again, and the row
    // before, whose input counts from it on
    let is_wrong = |found: &BTreeMap<String, Vec<u64>>, row: &Row| {
        let at = date(row.t);
        found.get(&at) != expected.get(&at)
    };
    let left = |folder: &Folder, end: usize| {
        let found = history(folder);
        let first = rows[..end].iter().position(|row| is_wrong(&found, row));
        first.map_or(&[][..], |first| &rows[first.saturating_sub(1)..end])
    };
    let mut end = 4;
    for round in 0..kills {
        let mut serving = Serving::begin(&folder, &[], "");
        serving.wait_for("is connected");
        if round == 0 {
            for change in changes(&rows[0]) {
                server.set(change, "0");
            }
            wait_until("no first row", || history(&folder).len() == 1);
        }
        // new values come once the others are there: a server that sends the newest first must not send it too early
        if left(&folder, end).is_empty() {
            end = (end + 4).min(rows.len());
        }
        for change in left(&folder, end).iter().flat_map(changes) {
            server.set(change, "0");
        }
        let wait = 300.0 * random.uniform();
        thread::sleep(Duration::from_millis(wait as u64));
        serving.kill();
        server.has_all();
    }
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    wait_until("the history is not what is expected", || {
        if left(&folder, end).is_empty() {
            end = (end + 20).min(rows.len());
        }
        for change in left(&folder, end).iter().flat_map(changes) {
            server.set(change, "0");
        }
        server.has_all();
        thread::sleep(Duration::from_millis(500));
        history(&folder) == expected
    });
    serving.stop();
    let text: String = folder
        .files()
        .iter()
        .filter(|name| name.starts_with("tank-"))
        .map(|name| folder.read(name))
        .collect();
    let told = text
        .lines()
        .filter(|line| line.starts_with('2'))
        .map(|line| {
            let (rest, revision) = line.rsplit_once(',').unwrap();
            format!("{} {revision}", rest.split(',').next().unwrap())
        });
    let mut told: Vec<String> = told.collect();
    let count = told.len();
    told.sort();
    told.dedup();
    assert_eq!(count, told.len());
}

#[test]
fn a_kill_takes_nothing_twice() {
    killed(3, 73);
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_kills_take_nothing_twice() {
    killed(200, 74);
}
