//! A service under way: no test waits for it for ever.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Ended, Folder};

/// Nothing takes so long.
const LIMIT: Duration = Duration::from_secs(120);

/// A service that answers.
pub(super) struct Serving {
    child: Child,
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    /// what was said on standard error so far
    said: Arc<Mutex<String>>,
    errors: Option<thread::JoinHandle<()>>,
}

impl Serving {
    /// Begins with `study.toml` on standard input; `before` is what a shell does first.
    pub fn new(folder: &Folder, format: &str, before: &str) -> Self {
        Self::begin(folder, &["--stdio", format], before)
    }

    /// Begins with `study.toml` and options.
    pub fn begin(folder: &Folder, options: &[&str], before: &str) -> Self {
        let options = options.join(" ");
        let program = env!("CARGO_BIN_EXE_lynkeus");
        let mut child = Command::new("sh")
            .args([
                "-c",
                &format!("{before} exec {program} serve study.toml {options}"),
            ])
            .current_dir(folder.path.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, answers) = channel();
        let output = BufReader::new(child.stdout.take().unwrap());
        thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        let error = BufReader::new(child.stderr.take().unwrap());
        let said = Arc::new(Mutex::new(String::new()));
        let to = Arc::clone(&said);
        let errors = thread::spawn(move || {
            for line in error.lines().map_while(Result::ok) {
                *to.lock().unwrap() += &(line + "\n");
            }
        });
        Self {
            input: child.stdin.take(),
            child,
            answers,
            said,
            errors: Some(errors),
        }
    }

    /// Sends lines; false where nobody reads them any more.
    pub fn send(&mut self, text: &str) -> bool {
        let input = self.input.as_mut().unwrap();
        input
            .write_all(text.as_bytes())
            .and_then(|()| input.flush())
            .is_ok()
    }

    /// The next answer; none where there will be no more.
    pub fn answer(&mut self) -> Option<String> {
        match self.answers.recv_timeout(LIMIT) {
            Ok(line) => Some(line),
            Err(RecvTimeoutError::Disconnected) => None,
            Err(RecvTimeoutError::Timeout) => panic!("no answer"),
        }
    }

    /// Waits until standard error says something.
    pub fn wait_for(&self, words: &str) {
        let began = Instant::now();
        while !self.said.lock().unwrap().contains(words) {
            let said = || self.said.lock().unwrap().clone();
            assert!(began.elapsed() < LIMIT, "{words} is not said: {}", said());
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Asks it to end, and waits.
    pub fn stop(self) -> Ended {
        let id = self.child.id().to_string();
        let asked = Command::new("kill").args(["-TERM", &id]).status();
        assert!(asked.unwrap().success());
        self.end()
    }

    /// Ends it as a power cut would.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Ends its input, and waits.
    pub fn end(mut self) -> Ended {
        drop(self.input.take());
        let began = Instant::now();
        let code = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status.code().unwrap_or(-1);
            }
            assert!(began.elapsed() < LIMIT, "it does not end");
            thread::sleep(Duration::from_millis(5));
        };
        let mut out = String::new();
        while let Some(line) = self.answer() {
            out += &line;
            out.push('\n');
        }
        self.errors.take().unwrap().join().unwrap();
        let err = self.said.lock().unwrap().clone();
        Ended { code, out, err }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What is answered to all of an input.
pub(super) fn served(folder: &Folder, format: &str, input: &str) -> Ended {
    served_after(folder, format, "", input)
}

/// The same after what a shell does first.
pub(super) fn served_after(folder: &Folder, format: &str, before: &str, input: &str) -> Ended {
    let mut serving = Serving::new(folder, format, before);
    let mut to = serving.input.take().unwrap();
    let input = input.to_owned();
    // answers are read meanwhile
    thread::spawn(move || {
        let _ = to.write_all(input.as_bytes());
    });
    serving.end()
}
