//! Between standard input and output: each line that comes is answered, in order.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use lynkeus::Error;

use crate::board::Board;
use crate::engine::{Answer, Arrival, BATCH, Engine};
use crate::influx;
use crate::json;
use crate::row::{Reader, Stamp};

/// Bytes of a line, at most.
const LONGEST: usize = 64 << 10;
/// How often it is looked whether somebody asks to stop.
const LOOK: Duration = Duration::from_millis(50);

/// What messages are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// JSON, an object in a line
    Json,
    /// InfluxDB's line protocol
    Influx,
}

/// What comes in.
enum Incoming {
    Line(Vec<u8>),
    TooLong,
    Failed(io::Error),
}

/// A line, and where its answer comes from.
enum Asked {
    /// a row: its place among those of the batch, and how it is answered
    Row(usize, Asker),
    /// why it cannot be used, and the text where it is passed on
    Refused(String, String),
    /// it is nobody's business, and passed on
    Passed(String),
    /// a line without anything
    Nothing,
}

/// Who asks.
enum Asker {
    Json {
        asset: String,
    },
    Influx {
        series: String,
        fields: String,
        text: String,
    },
}

/// A service between an input and an output.
struct Service<'s> {
    engine: &'s mut Engine,
    reader: Reader,
    format: Format,
    /// whether messages say whose rows they are
    has_assets: bool,
    /// those who look
    board: Option<&'s Board>,
    /// lines so far
    count: u64,
    tell: &'s mut dyn FnMut(&str),
}

/// Answers each line of an input until it ends or somebody asks to stop; a board has what was told, and `tell` what a
/// person should know.
///
/// # Errors
/// The input cannot be read, or the output cannot be written but for a reader that went away.
pub fn serve(
    engine: &mut Engine,
    (reader, board): (Reader, Option<&Board>),
    format: Format,
    (input, output): (impl Read + Send + 'static, &mut dyn Write),
    is_over: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&str),
) -> Result<(), Error> {
    let (sender, receiver) = sync_channel(4 * BATCH);
    // it ends with the input, or with the program
    thread::spawn(move || lines(input, &sender));
    let mut service = Service {
        has_assets: engine.has_names(),
        engine,
        reader,
        format,
        board,
        count: 0,
        tell,
    };
    let done = service.run(&receiver, output, is_over);
    service.engine.close();
    done
}

/// Sends the lines of an input.
fn lines(input: impl Read, sender: &SyncSender<Incoming>) {
    let mut input = BufReader::with_capacity(1 << 16, input);
    loop {
        let mut line = vec![];
        let mut read = Read::by_ref(&mut input).take(LONGEST as u64 + 1);
        let found = match read.read_until(b'\n', &mut line) {
            Ok(0) => return,
            Err(error) => Incoming::Failed(error),
            Ok(_) if line.len() > LONGEST && line.last() != Some(&b'\n') => {
                match skip(&mut input) {
                    Ok(()) => Incoming::TooLong,
                    Err(error) => Incoming::Failed(error),
                }
            }
            Ok(_) => Incoming::Line(line),
        };
        let is_last = matches!(found, Incoming::Failed(_));
        if sender.send(found).is_err() || is_last {
            return;
        }
    }
}

/// The rest of a line.
fn skip(input: &mut impl BufRead) -> io::Result<()> {
    loop {
        let found = input.fill_buf()?;
        match found.iter().position(|b| *b == b'\n') {
            Some(end) => {
                input.consume(end + 1);
                return Ok(());
            }
            None if found.is_empty() => return Ok(()),
            None => {
                let all = found.len();
                input.consume(all);
            }
        }
    }
}

impl Service<'_> {
    fn run(
        &mut self,
        receiver: &Receiver<Incoming>,
        output: &mut dyn Write,
        is_over: &dyn Fn() -> bool,
    ) -> Result<(), Error> {
        while !is_over() {
            let first = match receiver.recv_timeout(LOOK) {
                Ok(first) => first,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            let others = std::iter::from_fn(|| receiver.try_recv().ok());
            let mut batch = vec![];
            for incoming in std::iter::once(first).chain(others.take(BATCH - 1)) {
                batch.push(match incoming {
                    Incoming::Line(line) => Ok(line),
                    Incoming::TooLong => Err(format!("the line is longer than {LONGEST} bytes")),
                    Incoming::Failed(error) => {
                        return Err(Error::input(format!("cannot read the input: {error}")));
                    }
                });
            }
            let answer = self.answer(batch);
            for text in self.engine.news() {
                (self.tell)(&text);
            }
            match output
                .write_all(answer.as_bytes())
                .and_then(|()| output.flush())
            {
                Err(e) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
                Err(e) => return Err(Error::input(format!("cannot write the output: {e}"))),
                Ok(()) => {}
            }
        }
        Ok(())
    }

    /// The answers to lines.
    fn answer(&mut self, batch: Vec<Result<Vec<u8>, String>>) -> String {
        let mut rows: Vec<Arrival> = vec![];
        let asked: Vec<Asked> = batch
            .into_iter()
            .map(|line| {
                let text = line.and_then(|line| {
                    let text = String::from_utf8(line);
                    text.map_err(|_| "the line is not UTF-8".to_owned())
                });
                match text {
                    Ok(text) => self.ask(text.trim(), &mut rows),
                    Err(why) => Asked::Refused(why, String::new()),
                }
            })
            .collect();
        let mut answers = self.engine.take(&rows);
        let mut to = String::new();
        for asked in asked {
            self.count += 1;
            match asked {
                Asked::Nothing => {}
                Asked::Passed(text) => {
                    to.push_str(&text);
                    to.push('\n');
                }
                Asked::Refused(why, text) => self.refuse(&why, &text, &mut to),
                Asked::Row(place, asker) => {
                    if let Some(answer) = answers.get_mut(place) {
                        if let (Some(board), Ok(lines)) = (self.board, &*answer) {
                            board.told(&rows[place], lines);
                        }
                        let answer = std::mem::replace(answer, Ok(vec![]));
                        self.write(answer, (rows[place].stamp, &asker), &mut to);
                    }
                }
            }
        }
        to
    }

    /// What a line asks.
    fn ask(&mut self, text: &str, rows: &mut Vec<Arrival>) -> Asked {
        if text.is_empty() || (self.format == Format::Influx && text.starts_with('#')) {
            return Asked::Nothing;
        }
        let read = match self.format {
            Format::Json => json::read(text, &mut self.reader).map(|message| {
                let asset = message.asset.clone().unwrap_or_default();
                (Some(message), Asker::Json { asset })
            }),
            Format::Influx => influx::read(text, &mut self.reader).map(|metric| {
                let influx::Metric {
                    series,
                    fields,
                    row,
                } = metric;
                let text = text.to_owned();
                (
                    row,
                    Asker::Influx {
                        series,
                        fields,
                        text,
                    },
                )
            }),
        };
        let passed = match self.format {
            Format::Json => String::new(),
            Format::Influx => text.to_owned(),
        };
        match read {
            Err(why) => Asked::Refused(why, passed),
            Ok((None, _)) => Asked::Passed(passed),
            Ok((Some(mut message), asker)) => {
                for stranger in self.reader.strange(std::mem::take(&mut message.strangers)) {
                    (self.tell)(&format!("\"{stranger}\" of a message is read by nobody"));
                }
                match self.engine.arrival(&message) {
                    Err(why) => Asked::Refused(why, passed),
                    Ok(arrival) => {
                        rows.push(arrival);
                        Asked::Row(rows.len() - 1, asker)
                    }
                }
            }
        }
    }

    fn write(&mut self, answer: Answer, (stamp, asker): (Stamp, &Asker), to: &mut String) {
        let lines = match answer {
            Ok(lines) => lines,
            Err(why) => {
                let text = match asker {
                    Asker::Json { .. } => "",
                    Asker::Influx { text, .. } => text,
                };
                return self.refuse(&why.to_string(), text, to);
            }
        };
        let stream = self.reader.stream();
        match asker {
            Asker::Json { asset } => {
                let asset = if self.has_assets { asset } else { "" };
                lines
                    .iter()
                    .for_each(|line| json::write(line, asset, stream, to));
            }
            Asker::Influx { series, fields, .. } => {
                for line in &lines {
                    // a correction has the series and the time of what it corrects, and no fields but its own
                    let fields = if line.stamp == stamp {
                        fields.as_str()
                    } else {
                        ""
                    };
                    influx::write(line, (series, fields), stream, to);
                }
            }
        }
    }

    /// Tells why a line was not used; a metric is passed on as it came.
    fn refuse(&mut self, why: &str, text: &str, to: &mut String) {
        if let Some(board) = self.board {
            board.refused();
        }
        match self.format {
            Format::Json => json::refuse(why, self.count, to),
            Format::Influx => {
                (self.tell)(&format!("line {}: {why}", self.count));
                if !text.is_empty() {
                    to.push_str(text);
                    to.push('\n');
                }
            }
        }
    }
}
