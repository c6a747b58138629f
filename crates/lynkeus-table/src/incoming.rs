//! Bytes of a file or a pipe under a budget: who waits for them can stop waiting.

use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use lynkeus_expr::{Budget, Spent};

use crate::files;
use lynkeus_answer::Error;

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 16;

/// Blocks that wait to be looked at.
const AHEAD: usize = 4;

/// Between two looks at the budget while nothing comes.
const LOOK: Duration = Duration::from_millis(20);

/// An input that ends with an error as soon as its budget is spent.
pub struct Incoming {
    from: Source,
    budget: Budget,
    /// what came last of a stream, and how much of it is used
    block: Vec<u8>,
    at: usize,
}

enum Source {
    /// it does not wait
    File(BufReader<Box<dyn Read>>),
    /// read by a thread of its own, which may wait for ever
    Stream(Receiver<io::Result<Vec<u8>>>),
}

impl Incoming {
    /// A file, or a pipe with a name; `what` says in messages what it is for.
    ///
    /// # Errors
    /// There is no such file, or it is a folder.
    pub fn open(path: &Path, what: &'static str, budget: &Budget) -> Result<Self, Error> {
        if !files::is_stream(path) || *budget == Budget::default() {
            return Ok(Self::file(files::open(path, what)?, budget));
        }
        // a pipe without a writer already waits where it is opened
        let path = path.to_owned();
        Ok(Self::stream(
            move || files::open(&path, what).map_err(|e| io::Error::other(e.message().to_owned())),
            budget,
        ))
    }

    /// Standard input.
    #[must_use]
    pub fn standard(budget: &Budget) -> Self {
        match *budget == Budget::default() {
            true => Self::file(io::stdin(), budget),
            false => Self::stream(|| Ok(io::stdin()), budget),
        }
    }

    fn file(input: impl Read + 'static, budget: &Budget) -> Self {
        Self::of(
            Source::File(BufReader::with_capacity(BLOCK, Box::new(input))),
            budget,
        )
    }

    fn stream<R: Read + 'static>(
        open: impl Fn() -> io::Result<R> + Send + Clone + 'static,
        budget: &Budget,
    ) -> Self {
        let (sender, receiver) = sync_channel(AHEAD);
        let again = open.clone();
        let reader = thread::Builder::new().name("input".to_owned());
        let from = match reader.spawn(move || send(open, &sender)) {
            Ok(_) => Source::Stream(receiver),
            // without a thread to spare it is waited for
            Err(_) => match again() {
                Ok(input) => Source::File(BufReader::with_capacity(BLOCK, Box::new(input))),
                Err(error) => Source::File(BufReader::new(Box::new(Failed(Some(error))))),
            },
        };
        Self::of(from, budget)
    }

    fn of(from: Source, budget: &Budget) -> Self {
        Self {
            from,
            budget: budget.clone(),
            block: vec![],
            at: 0,
        }
    }

    /// All of it as text, without a mark of its bytes' order; `name` is what messages call it.
    ///
    /// # Errors
    /// It cannot be read, is no UTF-8, or the budget is spent.
    pub fn text(mut self, name: &str) -> Result<String, Error> {
        let mut text = String::new();
        let read = self.read_to_string(&mut text);
        read.map_err(|e| unread(&e, &format!("cannot read {name}"), name))?;
        Ok(match text.strip_prefix('\u{feff}') {
            Some(rest) => rest.to_owned(),
            None => text,
        })
    }

    fn look(&self) -> io::Result<()> {
        match self.budget.spent() {
            Some(spent) => Err(io::Error::other(spent)),
            None => Ok(()),
        }
    }

    /// Waits for the next block of a stream; an empty one at its end.
    fn wait(&mut self) -> io::Result<()> {
        let Source::Stream(blocks) = &self.from else {
            return Ok(());
        };
        let next = loop {
            self.look()?;
            match blocks.recv_timeout(LOOK) {
                Ok(next) => break next?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break vec![],
            }
        };
        (self.block, self.at) = (next, 0);
        Ok(())
    }
}

/// Reads to the end, or until nobody listens any more.
fn send<R: Read>(open: impl Fn() -> io::Result<R>, to: &SyncSender<io::Result<Vec<u8>>>) {
    let mut input = match open() {
        Ok(input) => input,
        Err(error) => {
            // nobody may be listening
            let _ = to.send(Err(error));
            return;
        }
    };
    loop {
        let mut block = vec![0; BLOCK];
        let read = match input.read(&mut block) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            read => read,
        };
        let is_last = !matches!(read, Ok(1..));
        let block = read.map(|length| {
            block.truncate(length);
            block
        });
        if to.send(block).is_err() || is_last {
            return;
        }
    }
}

/// An input that could not be opened.
struct Failed(Option<io::Error>);

impl Read for Failed {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.0.take().map_or(Ok(0), Err)
    }
}

impl BufRead for Incoming {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match &self.from {
            Source::File(file) if file.buffer().is_empty() => self.look()?,
            Source::Stream(_) if self.at >= self.block.len() => self.wait()?,
            _ => {}
        }
        match &mut self.from {
            Source::File(file) => file.fill_buf(),
            Source::Stream(_) => Ok(self.block.get(self.at..).unwrap_or_default()),
        }
    }

    fn consume(&mut self, amount: usize) {
        match &mut self.from {
            Source::File(file) => file.consume(amount),
            Source::Stream(_) => self.at += amount,
        }
    }
}

impl Read for Incoming {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut ready = self.fill_buf()?;
        let read = ready.read(into)?;
        self.consume(read);
        Ok(read)
    }
}

/// Why an input is not read: a limit, or `message` with the reason.
pub fn unread(error: &io::Error, message: &str, place: &str) -> Error {
    let spent = error
        .get_ref()
        .and_then(|inner| inner.downcast_ref::<Spent>());
    match spent {
        Some(spent) => ended(*spent, place),
        None => Error::input(format!("{message}: {error}")).at(place),
    }
}

/// What ended the reading of an input.
pub fn ended(spent: Spent, place: &str) -> Error {
    Error::ended(spent)
        .at(place)
        .hint("it was being read: allow more, or give less of it")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something that never comes is not waited for.
    #[test]
    fn a_silent_stream_ends_with_its_budget() {
        let budget = Budget::new(Some(Duration::from_millis(60)), None);
        let (reader, writer) = io::pipe().unwrap();
        let reader = std::sync::Arc::new(reader);
        let silent = Incoming::stream(move || reader.try_clone(), &budget);
        let error = silent.text("standard input").unwrap_err();
        assert_eq!(error.kind(), lynkeus_answer::ErrorKind::Ended);
        assert!(error.to_string().contains("0.06 s"), "{error}");
        drop(writer);
    }

    #[test]
    fn blocks_come_whole_and_a_failure_is_told() {
        let budget = Budget::new(Some(Duration::from_secs(60)), None);
        let text = "0123456789\n".repeat(3 * BLOCK / 11);
        let sent = text.clone();
        let whole = Incoming::stream(move || Ok(io::Cursor::new(sent.clone())), &budget);
        assert_eq!(whole.text("it").unwrap(), text);
        let failing = || Err::<io::Empty, _>(io::Error::other("the line is cut"));
        let error = Incoming::stream(failing, &budget).text("it").unwrap_err();
        assert!(error.to_string().contains("the line is cut"), "{error}");
        let gone = Path::new("/nowhere/at/all");
        let error = Incoming::open(gone, "log", &budget).err().unwrap();
        assert!(error.to_string().starts_with("no log file"), "{error}");
    }
}
