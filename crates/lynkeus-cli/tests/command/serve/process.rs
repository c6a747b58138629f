//! A service under way: no test waits for it for ever.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
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
    errors: Option<thread::JoinHandle<String>>,
}

impl Serving {
    /// Begins with `study.toml`; `before` is what a shell does first.
    pub fn new(folder: &Folder, format: &str, before: &str) -> Self {
        let program = env!("CARGO_BIN_EXE_lynkeus");
        let mut child = Command::new("sh")
            .args([
                "-c",
                &format!("{before} exec {program} serve study.toml --stdio {format}"),
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
        let mut error = child.stderr.take().unwrap();
        let errors = thread::spawn(move || {
            let mut text = String::new();
            let _ = error.read_to_string(&mut text);
            text
        });
        Self {
            input: child.stdin.take(),
            child,
            answers,
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
        let err = self.errors.take().unwrap().join().unwrap();
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
