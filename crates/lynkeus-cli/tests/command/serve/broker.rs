//! A broker that no one here wrote, and a client of it: mosquitto where it is installed, else amqtt of Python.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use super::page::port;
use crate::{Folder, skipped};

/// Nothing takes so long.
const LIMIT: Duration = Duration::from_secs(60);

/// The Python of the cross-checks; it has paho and amqtt.
fn python() -> Option<PathBuf> {
    let python = std::env::var_os("LYNKEUS_PYTHON").map(PathBuf::from);
    if python.is_none() {
        skipped("LYNKEUS_PYTHON names no Python with paho-mqtt");
    }
    python
}

/// Whether the broker is one that keeps what it has on the disk, sends again what nobody acknowledged, and speaks
/// every version.
pub(super) fn has_mosquitto() -> bool {
    let known = is_mosquitto();
    if !known {
        skipped("no mosquitto");
    }
    known
}

fn is_mosquitto() -> bool {
    let mut asked = Command::new("mosquitto");
    let asked = asked.arg("-h").stdout(Stdio::null()).stderr(Stdio::null());
    // its help ends with 3 in older versions
    asked.status().is_ok()
}

/// A broker under way.
pub(super) struct Broker {
    child: Child,
    pub port: u16,
    folder: tempfile::TempDir,
    /// lines of mosquitto's configuration
    more: String,
}

impl Broker {
    /// Begins; `more` is for mosquitto. None where there is no broker.
    pub fn new(more: &str) -> Option<Self> {
        python()?;
        let folder = tempfile::tempdir().unwrap();
        let port = port();
        let more = more.to_owned();
        let child = begun(&folder, port, &more)?;
        Some(Self {
            child,
            port,
            folder,
            more,
        })
    }

    /// Ends it, so that it writes down what it has, and begins it again.
    pub fn restart(&mut self) {
        let id = self.child.id().to_string();
        let ended = Command::new("kill").args(["-TERM", &id]).status();
        assert!(ended.unwrap().success());
        self.child.wait().unwrap();
        self.child = begun(&self.folder, self.port, &self.more).unwrap();
    }
}

fn begun(folder: &tempfile::TempDir, port: u16, more: &str) -> Option<Child> {
    let file = folder.path().join("broker.conf");
    let mut command = if is_mosquitto() {
        let path = folder.path().display();
        let access = if more.contains("listener") {
            ""
        } else {
            "listener PORT 127.0.0.1\nallow_anonymous true\n"
        };
        let text = format!(
            "{access}{more}\npersistence true\npersistence_location {path}/\nautosave_interval 1\nmax_queued_messages 0\nuser root\n"
        );
        std::fs::write(&file, text.replace("PORT", &port.to_string())).unwrap();
        let mut command = Command::new("mosquitto");
        command.arg("-c").arg(&file);
        command
    } else {
        let text = format!(
            "listeners:\n  default:\n    type: tcp\n    bind: 127.0.0.1:{port}\nplugins:\n  amqtt.plugins.authentication.AnonymousAuthPlugin:\n    allow_anonymous: true\n"
        );
        std::fs::write(&file, text).unwrap();
        let code = "import sys; from amqtt.scripts.broker_script import main; main()";
        let mut command = Command::new(python()?);
        command.args(["-c", code, "-c"]).arg(&file);
        command
    };
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    let child = quiet.spawn().unwrap();
    let began = Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < LIMIT, "the broker does not begin");
        thread::sleep(Duration::from_millis(20));
    }
    Some(child)
}

impl Drop for Broker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A client that publishes and hears.
pub(super) struct Client {
    child: Child,
    input: Option<ChildStdin>,
    heard: Receiver<String>,
    /// heard while something else was waited for
    before: VecDeque<String>,
}

impl Client {
    /// One that hears a topic.
    pub fn new(folder: &Folder, port: u16, topic: &str, ca: Option<&str>) -> Self {
        folder.write("client.py", include_str!("client.py"));
        let mut child = Command::new(python().unwrap())
            .args(["client.py", &port.to_string(), topic])
            .args(ca)
            .current_dir(folder.path.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, heard) = channel();
        let output = BufReader::new(child.stdout.take().unwrap());
        thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        let mut client = Self {
            input: child.stdin.take(),
            child,
            heard,
            before: VecDeque::new(),
        };
        client.is_back();
        client
    }

    /// Publishes a payload; the broker may not have it yet.
    pub fn publish(&mut self, topic: &str, payload: &str) {
        self.send(&format!("{topic} - {payload}\n"));
    }

    /// Publishes a payload that the broker keeps.
    pub fn retain(&mut self, topic: &str, payload: &str) {
        self.send(&format!("{topic} r {payload}\n"));
    }

    /// Waits until the broker has all that was published.
    pub fn sent(&mut self) {
        self.send("?\n");
        self.wait_for("there");
    }

    /// Waits until it is connected again.
    pub fn is_back(&mut self) {
        self.wait_for("ready");
    }

    /// Waits for a line of its own; what it hears meanwhile is kept.
    fn wait_for(&mut self, words: &str) {
        while let Ok(line) = self.heard.recv_timeout(LIMIT) {
            match line == words {
                true => return,
                false => self.before.push_back(line),
            }
        }
        panic!("the client does not say \"{words}\"");
    }

    fn send(&mut self, line: &str) {
        self.input
            .as_mut()
            .unwrap()
            .write_all(line.as_bytes())
            .unwrap();
    }

    /// The next message; none where there was none for long.
    pub fn hear(&mut self) -> Option<String> {
        let before = self.before.pop_front();
        before.or_else(|| self.heard.recv_timeout(LIMIT).ok())
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
