//! Between nodes of an OPC UA server: changes of values come as rows or parts of rows, estimates are written.
//!
//! The time of a row is the source's, a value counts whose quality is good. What is written has the time of its row, and
//! the quality `bad` where the estimate is not credible. The session and its subscription outlast a lost connection:
//! what changed meanwhile is in the server's queues, and comes in its order. The protocol is `async-opcua`'s, in a thread
//! of its own ([`client`]); rows are made and taken here.

mod client;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use lynkeus::Error;
use lynkeus::stream::Stream;
use lynkeus::study::{Name, OpcuaSettings};
use opcua::types::NodeId;

use crate::asset::Line;
use crate::board::Board;
use crate::engine::{Arrival, BATCH, Engine, Refusal};
use crate::json::Message;
use crate::live::{Firsts, tell_refusal};
use crate::row::{Field, Reader, Stamp};
use client::{Change, News, Outgoing, Written};

/// In a node it stands for the name of an asset.
const ASSET: &str = "{asset}";
/// How often it is looked whether somebody asks to stop.
const LOOK: Duration = Duration::from_millis(50);
/// After this a row that could not be kept is tried again.
const AGAIN: Duration = Duration::from_secs(1);
/// Changes that wait to be taken; the connection waits for room.
const MOST: usize = 1 << 16;
/// The name of the answer whether an estimate is credible.
const CREDIBLE: &str = "credible";

/// What a node that is read is for.
#[derive(Clone, Debug)]
struct Source {
    asset: usize,
    column: String,
}

/// What a node that is written shows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shown {
    Estimate(usize),
    Deviation(usize),
    Credible,
}

struct Service<'s> {
    engine: &'s mut Engine,
    reader: Reader,
    board: Option<&'s Board>,
    /// what each node that is read is for: one node may be several things
    sources: Vec<Vec<Source>>,
    /// by asset: what is shown where
    shown: Vec<Vec<(Shown, usize)>>,
    firsts: Firsts,
    /// by asset, the newest row that was written
    newest: HashMap<usize, Stamp>,
    outgoing: Arc<Outgoing>,
    refused: u64,
    tell: &'s mut dyn FnMut(&str),
}

/// Takes what changes in the nodes of a study and writes what it gives, until somebody asks to stop; a board has what
/// was told, and `tell` what a person should know.
///
/// # Errors
/// The settings are none, or the server does not want the first connection. One that is not there, or goes, is tried
/// again.
pub fn serve(
    engine: &mut Engine,
    (reader, board): (Reader, Option<&Board>),
    settings: &OpcuaSettings,
    is_over: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&str),
) -> Result<(), Error> {
    let (read, sources) = sources(settings, &reader, engine)?;
    let (written, shown) = shown(settings, engine)?;
    let outgoing = Arc::new(Outgoing::default());
    let stop = Arc::new(AtomicBool::new(false));
    let (to, news) = sync_channel(MOST);
    let asked = Arc::new(client::Asked {
        settings: settings.clone(),
        read,
        written,
    });
    let worker = {
        let (outgoing, stop) = (Arc::clone(&outgoing), Arc::clone(&stop));
        thread::spawn(move || client::run(&asked, &to, &outgoing, &stop))
    };
    let mut service = Service {
        engine,
        reader,
        board,
        sources,
        shown,
        firsts: Firsts::default(),
        newest: HashMap::new(),
        outgoing,
        refused: 0,
        tell,
    };
    service.run(&news, is_over);
    stop.store(true, Ordering::Relaxed);
    // the worker may wait for room
    drop(news);
    service.engine.close();
    let done = worker
        .join()
        .unwrap_or_else(|_| Err("the connection failed; start the service again".to_owned()));
    done.map_err(|why| {
        let text = format!("{}: {why}", settings.url.text);
        settings.url.blame(Error::input(text))
    })
}

/// A node by its name, that of an asset in its place.
fn node(name: &Name, asset: &str, has_assets: bool) -> Result<NodeId, Error> {
    let refuse = |why: &str| {
        let text = format!("the node \"{}\" {why}", name.text);
        Err(name.blame(Error::input(text)))
    };
    match (has_assets, name.text.contains(ASSET)) {
        (true, false) => return refuse("has no {asset}: where the name of an asset stands"),
        (false, true) => return refuse("has {asset}, and [serve] names no `assets`"),
        _ => {}
    }
    match name.text.replace(ASSET, asset).parse() {
        Ok(node) => Ok(node),
        Err(_) => refuse("is none: expected \"ns=2;s=Tank.Level\" or \"ns=2;i=1001\""),
    }
}

/// Adds a node to a list if it is not in it, and says its place there.
fn place(node: NodeId, nodes: &mut Vec<NodeId>, places: &mut HashMap<NodeId, usize>) -> usize {
    *places.entry(node).or_insert_with_key(|node| {
        nodes.push(node.clone());
        nodes.len() - 1
    })
}

/// The nodes that are read, and what each is for.
fn sources(
    settings: &OpcuaSettings,
    reader: &Reader,
    engine: &Engine,
) -> Result<(Vec<NodeId>, Vec<Vec<Source>>), Error> {
    let (mut nodes, mut places) = (vec![], HashMap::new());
    let mut sources: Vec<Vec<Source>> = vec![];
    for (column, name) in &settings.nodes {
        if !reader.knows(&column.text) || column.text == reader.stream().time {
            let text = format!(
                "\"{}\" in `nodes` of opcua: no row of this study has such a column",
                column.text
            );
            let known = reader.columns().collect::<Vec<_>>().join(", ");
            let error = Error::input(text).hint(format!("its columns are {known}"));
            return Err(column.blame(error));
        }
        for (asset, own) in engine.names().iter().enumerate() {
            let node = node(name, own, engine.has_names())?;
            let place = place(node, &mut nodes, &mut places);
            if place == sources.len() {
                sources.push(vec![]);
            }
            sources[place].push(Source {
                asset,
                column: column.text.clone(),
            });
        }
    }
    Ok((nodes, sources))
}

/// The nodes that are written, and by asset what is shown in which of them.
type Displays = (Vec<NodeId>, Vec<Vec<(Shown, usize)>>);

fn shown(settings: &OpcuaSettings, engine: &Engine) -> Result<Displays, Error> {
    let (mut nodes, mut places) = (vec![], HashMap::new());
    let mut shown = vec![vec![]; engine.names().len()];
    let Some(stream) = engine.stream(0) else {
        return Ok((nodes, shown));
    };
    let known = displays(stream);
    for (name, target) in &settings.write {
        let Some((_, what)) = known.iter().find(|(own, _)| *own == name.text) else {
            let text = format!(
                "\"{}\" in `write` of opcua: no answer of this study has it",
                name.text
            );
            let names: Vec<&str> = known.iter().map(|(own, _)| *own).collect();
            let error = Error::input(text).hint(format!("answers have {}", names.join(", ")));
            return Err(name.blame(error));
        };
        for (own, shown) in engine.names().iter().zip(&mut shown) {
            let node = node(target, own, engine.has_names())?;
            shown.push((*what, place(node, &mut nodes, &mut places)));
        }
    }
    Ok((nodes, shown))
}

/// What an answer has, by its names.
fn displays(stream: &Stream) -> Vec<(&str, Shown)> {
    let mut known = vec![];
    for (i, told) in stream.estimates.iter().enumerate() {
        known.push((told.header.as_str(), Shown::Estimate(i)));
        if let Some(deviation) = &told.deviation {
            known.push((deviation.as_str(), Shown::Deviation(i)));
        }
    }
    let first = stream.estimates.len();
    for (i, monitor) in stream.monitors.iter().enumerate() {
        known.push((monitor.header.as_str(), Shown::Estimate(first + i)));
    }
    known.push((CREDIBLE, Shown::Credible));
    known
}

impl Service<'_> {
    fn run(&mut self, news: &Receiver<News>, is_over: &dyn Fn() -> bool) {
        while !is_over() {
            match news.recv_timeout(LOOK) {
                Ok(first) => {
                    let mut changes = vec![];
                    for news in std::iter::once(first).chain(news.try_iter().take(BATCH - 1)) {
                        match news {
                            News::Change(change) => changes.push(change),
                            News::Note(text) => (self.tell)(&text),
                            News::Refused(why) => self.refuse(&why),
                        }
                    }
                    self.take(&changes, is_over);
                    for text in self.engine.news() {
                        (self.tell)(&text);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                // it says why where it is joined
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Takes rows of some changes, and writes what they give.
    fn take(&mut self, changes: &[Change], is_over: &dyn Fn() -> bool) {
        let mut rows = self.rows(changes);
        // what is tried again was counted before
        let mut is_again = false;
        while !rows.is_empty() && !is_over() {
            let answers = self.engine.take(&rows);
            let mut kept_back = vec![];
            for (answer, row) in answers.into_iter().zip(rows) {
                match answer {
                    Ok(lines) => {
                        if let Some(board) = self.board {
                            board.told(&row, &lines);
                        }
                        self.show(row.asset, &lines);
                    }
                    Err(Refusal::NotKept(why)) => {
                        if !is_again {
                            self.refuse(&format!("not taken: {why}; it is tried again"));
                        }
                        kept_back.push(row);
                    }
                    Err(Refusal::Unusable(why)) => {
                        self.refuse(&format!("the row of {}: {why}", row.stamp));
                    }
                }
            }
            if !kept_back.is_empty() {
                let until = Instant::now() + AGAIN;
                while Instant::now() < until && !is_over() {
                    thread::sleep(LOOK);
                }
            }
            rows = kept_back;
            is_again = true;
        }
    }

    /// Changes of one time of an asset are a row, earlier ones first: a server sends them node by node.
    fn rows(&mut self, changes: &[Change]) -> Vec<Arrival> {
        let mut by_time: BTreeMap<(i128, usize), HashMap<&str, f64>> = BTreeMap::new();
        for change in changes {
            for source in self.sources.get(change.node).into_iter().flatten() {
                let row = by_time.entry((change.at, source.asset)).or_default();
                row.insert(&source.column, change.value.unwrap_or(f64::NAN));
            }
        }
        let mut rows = vec![];
        let mut begun = vec![];
        let mut refusals = vec![];
        for ((at, asset), values) in by_time {
            let get = |key: &str| match values.get(key) {
                Some(value) if value.is_finite() => Field::Number(*value),
                _ => Field::Nothing,
            };
            let name = self.engine.names().get(asset).cloned();
            let row = self.reader.values(&get).and_then(|values| {
                let message = Message {
                    asset: name.filter(|name| !name.is_empty()),
                    stamp: Stamp::Date(lynkeus::table::Instant::at(at, true)),
                    values,
                    strangers: vec![],
                };
                if message.values.iter().all(|value| value.is_nan()) {
                    return Ok(None);
                }
                self.firsts.row(&message, self.engine, &mut begun)
            });
            match row {
                Ok(row) => rows.extend(row),
                Err(why) => refusals.push(why),
            }
        }
        refusals.iter().for_each(|why| self.refuse(why));
        rows
    }

    /// Writes the newest of some lines of an asset; what it corrects was written before.
    fn show(&mut self, asset: usize, lines: &[Line]) {
        let Some(shown) = self.shown.get(asset).filter(|shown| !shown.is_empty()) else {
            return;
        };
        for line in lines.iter().filter(|line| !line.is_repeated) {
            let newest = self.newest.entry(asset).or_insert(line.stamp);
            if line.stamp.is_before(*newest) {
                continue;
            }
            *newest = line.stamp;
            let at = match line.stamp {
                Stamp::Date(instant) => Some(instant.nanoseconds()),
                Stamp::Number(_) => None,
            };
            for (what, node) in shown {
                let value = match what {
                    Shown::Estimate(i) => line.estimate.get(*i).copied(),
                    Shown::Deviation(i) => line.deviations.get(*i).copied(),
                    Shown::Credible => Some(f64::from(u8::from(line.is_credible))),
                };
                let Some(value) = value else { continue };
                self.outgoing.put(
                    *node,
                    Written {
                        value,
                        at,
                        is_good: line.is_credible || *what == Shown::Credible,
                    },
                );
            }
        }
    }

    fn refuse(&mut self, why: &str) {
        self.refused += 1;
        tell_refusal((self.refused, self.board), why, self.tell);
    }
}
