//! Between topics of an MQTT broker: messages come as rows or parts of rows, estimates are published.
//!
//! A message is acknowledged once its row is in the state and the broker has the estimates that it gave, so that whatever
//! ends in between, it comes again; a row that comes again changes nothing. What was published and not acknowledged is
//! published once more. One thread does all of it, between packets.

mod link;
mod outbox;
mod packet;
#[cfg(feature = "tls")]
mod tls;
mod topics;

use std::collections::VecDeque;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use lynkeus::Error;
use lynkeus::study::{MqttSettings, MqttVersion};

use crate::asset::Line;
use crate::board::Board;
use crate::engine::{Arrival, BATCH, Engine, Refusal};
use crate::history::now;
use crate::json;
use crate::live::{Firsts, tell_refusal};
use crate::row::Reader;
use link::{KEEP_ALIVE, Link, Place};
use outbox::Outbox;
use packet::{Hello, Packet, Publish, Welcome};
use topics::{Part, Topics};

/// What a broker says of a service, under `status`.
const ON: &str = "online";
const OFF: &str = "offline";
/// The variable of the environment with the password, where the study has none.
const PASSWORD: &str = "LYNKEUS_MQTT_PASSWORD";
/// How long it is waited before the next try, at first and at most.
const SOON: Duration = Duration::from_millis(500);
const AT_MOST: Duration = Duration::from_secs(30);
/// A connection that lasts so long is none of a series of tries.
const LASTING: Duration = Duration::from_secs(60);
/// How long a broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it is looked whether somebody asks to stop.
const LOOK: Duration = Duration::from_millis(50);
/// How long what was told last may take to arrive at the end: soon after, a signal ends the program.
const LAST: Duration = Duration::from_millis(300);
/// After this a row that could not be kept is tried again.
const AGAIN: Duration = Duration::from_secs(1);
/// Messages that wait to be taken; more are left out where the broker keeps none.
const MOST: usize = 1 << 16;

/// A message that waits to be taken.
struct Inbound {
    topic: String,
    payload: Option<Vec<u8>>,
    id: Option<u16>,
    is_retained: bool,
    /// nanoseconds since 1970
    came: i128,
    /// it could not be kept so far, which was said
    is_kept_back: bool,
}

/// Why there is no connection.
enum Failed {
    /// there may be one later
    Now(String),
    /// the broker does not want it
    Unwanted(String),
}

struct Service<'s> {
    engine: &'s mut Engine,
    reader: Reader,
    board: Option<&'s Board>,
    settings: &'s MqttSettings,
    place: Place,
    client: String,
    topics: Topics,
    firsts: Firsts,
    inbox: VecDeque<Inbound>,
    outbox: Outbox,
    /// before this nothing is taken
    pause: Option<Instant>,
    refused: u64,
    tell: &'s mut dyn FnMut(&str),
}

/// Takes what comes under the topics of a study and publishes what it gives, until somebody asks to stop; a board has
/// what was told, and `tell` what a person should know.
///
/// # Errors
/// The settings are none, or the broker does not want the first connection. One that is not there, or goes, is tried
/// again.
pub fn serve(
    engine: &mut Engine,
    (reader, board): (Reader, Option<&Board>),
    settings: &MqttSettings,
    is_over: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&str),
) -> Result<(), Error> {
    let url = &settings.url;
    let refuse = |why: String| url.blame(Error::input(format!("`url` of mqtt: {why}")));
    let place = Place::read(&url.text).map_err(refuse)?;
    if place.is_secret && cfg!(not(feature = "tls")) {
        return Err(refuse("this program was built without TLS".to_owned()));
    }
    if let Some(pattern) = &settings.publish {
        topics::checked(pattern, engine)?;
    }
    let has_assets = engine.has_names();
    let topics = Topics::new(settings, &reader, has_assets)?;
    for own in settings.publish.iter().chain(&settings.status) {
        topics.refuse_own(own, engine)?;
    }
    let mut service = Service {
        topics,
        client: client(settings, &reader),
        engine,
        reader,
        board,
        settings,
        place,
        firsts: Firsts::default(),
        inbox: VecDeque::new(),
        outbox: Outbox::new(settings.version, settings.qos),
        pause: None,
        refused: 0,
        tell,
    };
    let done = service.run(is_over);
    service.engine.close();
    done
}

/// By this a broker knows it again.
fn client(settings: &MqttSettings, reader: &Reader) -> String {
    match &settings.client {
        Some(name) => name.text.clone(),
        None => {
            let stem = Path::new(reader.stream().file()).file_stem();
            let stem = stem.map_or("study".into(), |stem| stem.to_string_lossy());
            format!("lynkeus-{stem}")
        }
    }
}

/// What the study says, or the environment, so that it need not be in a file that others read.
fn password(settings: &MqttSettings) -> Option<String> {
    match &settings.password {
        Some(password) => Some(password.text.clone()),
        None => std::env::var(PASSWORD).ok(),
    }
}

impl Service<'_> {
    fn run(&mut self, is_over: &dyn Fn() -> bool) -> Result<(), Error> {
        // the last ones may have been told to nobody
        let recent = self.engine.recent();
        for (asset, line) in &recent {
            self.publish(*asset, line);
        }
        let mut wait = SOON;
        let mut was_there = false;
        while !is_over() {
            let began = Instant::now();
            let why = match self.connect(is_over) {
                Ok(Some(mut link)) => {
                    let again = if was_there { " again" } else { "" };
                    (self.tell)(&format!("{} is connected{again}", self.settings.url.text));
                    was_there = true;
                    match self.follow(&mut link, is_over) {
                        Ok(()) => return Ok(()),
                        Err(why) => why,
                    }
                }
                Ok(None) => return Ok(()),
                Err(Failed::Unwanted(why)) if !was_there => {
                    let text = format!("{}: {why}", self.settings.url.text);
                    return Err(self.settings.url.blame(Error::input(text)));
                }
                Err(Failed::Now(why) | Failed::Unwanted(why)) => why,
            };
            if began.elapsed() > LASTING {
                wait = SOON;
            }
            (self.tell)(&format!(
                "no connection to {}: {why}; the next try is in {} s",
                self.settings.url.text,
                wait.as_secs_f64()
            ));
            let next = Instant::now() + wait;
            while Instant::now() < next && !is_over() {
                thread::sleep(LOOK);
            }
            wait = (2 * wait).min(AT_MOST);
        }
        Ok(())
    }

    /// A connection that the broker accepts, with all topics; none where somebody asked to stop.
    fn connect(&mut self, is_over: &dyn Fn() -> bool) -> Result<Option<Link>, Failed> {
        let settings = self.settings;
        let mut link = Link::open(settings, &self.place).map_err(Failed::Now)?;
        let text =
            |name: &'_ Option<lynkeus::study::Name>| name.as_ref().map(|name| name.text.clone());
        let (user, password, status) = (
            text(&settings.user),
            password(settings),
            text(&settings.status),
        );
        let hello = Hello {
            client: &self.client,
            keep_alive: KEEP_ALIVE,
            // without a state it begins anew, and what it missed with it
            is_clean: !self.engine.is_kept(),
            will: status.as_deref().map(|topic| (topic, OFF)),
            user: user.as_deref(),
            password: password.as_deref(),
        };
        packet::connect(settings.version, &hello, &mut link.to);
        let mut rest = VecDeque::new();
        match self.answer(&mut link, &mut rest, is_over)? {
            None => return Ok(None),
            Some(Packet::Welcome(welcome)) => self.begin(&welcome, &mut link),
            Some(Packet::Unwanted(why)) => return Err(Failed::Unwanted(why)),
            Some(_) => return Err(Failed::Now("the broker answers something else".to_owned())),
        }
        let filters = self.topics.filters();
        packet::subscribe(settings.version, &filters, settings.qos, &mut link.to);
        match self.answer(&mut link, &mut rest, is_over)? {
            None => return Ok(None),
            Some(Packet::Subscribed(codes)) => self.are_subscribed(&filters, &codes)?,
            Some(_) => return Err(Failed::Now("the broker answers something else".to_owned())),
        }
        for packet in rest {
            self.hear(packet).map_err(Failed::Now)?;
        }
        if let Some(topic) = status {
            let message = Publish {
                topic,
                payload: ON.to_owned(),
                retain: true,
            };
            packet::publish(settings.version, &message, (None, false), &mut link.to);
        }
        link.flush().map_err(Failed::Now)?;
        Ok(Some(link))
    }

    /// The next packet that answers something; the others are heard, and those after it are the rest.
    fn answer(
        &mut self,
        link: &mut Link,
        rest: &mut VecDeque<Packet>,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Option<Packet>, Failed> {
        let began = Instant::now();
        while !is_over() {
            while let Some(packet) = rest.pop_front() {
                match packet {
                    Packet::Welcome(_) | Packet::Subscribed(_) | Packet::Unwanted(_) => {
                        return Ok(Some(packet));
                    }
                    other => self.hear(other).map_err(Failed::Now)?,
                }
            }
            if began.elapsed() > PATIENCE {
                return Err(Failed::Now("the broker does not answer".to_owned()));
            }
            link.flush().map_err(Failed::Now)?;
            rest.extend(link.receive().map_err(Failed::Now)?);
        }
        Ok(None)
    }

    fn are_subscribed(&self, filters: &[String], codes: &[u8]) -> Result<(), Failed> {
        let mut refused = filters.iter().zip(codes).filter(|(_, code)| **code >= 128);
        let Some((filter, code)) = refused.next() else {
            return Ok(());
        };
        let why = match self.settings.version {
            MqttVersion::V3 => "the client is not authorized".to_owned(),
            MqttVersion::V5 => packet::reason(*code),
        };
        Err(Failed::Unwanted(format!("\"{filter}\" is refused: {why}")))
    }

    fn begin(&mut self, welcome: &Welcome, link: &mut Link) {
        if welcome.has_session {
            // they will come again
            self.inbox.retain(|message| message.id.is_none());
        } else {
            // nobody waits for their acknowledgement any more
            self.inbox.iter_mut().for_each(|message| message.id = None);
        }
        self.outbox.begin(welcome, &mut link.to);
    }

    /// Goes on until somebody asks to stop.
    fn follow(&mut self, link: &mut Link, is_over: &dyn Fn() -> bool) -> Result<(), String> {
        while !is_over() {
            let is_paused = self.pause.is_some_and(|until| Instant::now() < until);
            let takes = !self.inbox.is_empty() && !self.outbox.is_full() && !is_paused;
            if takes {
                self.take();
                for text in self.engine.news() {
                    (self.tell)(&text);
                }
            }
            self.outbox.write(&mut link.to);
            link.flush()?;
            if !takes {
                for packet in link.receive()? {
                    self.hear(packet)?;
                }
            }
        }
        self.leave(link)
    }

    /// Says good-bye once all that was told has arrived.
    fn leave(&mut self, link: &mut Link) -> Result<(), String> {
        let began = Instant::now();
        loop {
            self.outbox.write(&mut link.to);
            link.flush()?;
            if self.outbox.is_done() || began.elapsed() > LAST {
                break;
            }
            for packet in link.receive()? {
                self.hear(packet)?;
            }
        }
        if let Some(topic) = &self.settings.status {
            let message = Publish {
                topic: topic.text.clone(),
                payload: OFF.to_owned(),
                retain: true,
            };
            packet::publish(self.settings.version, &message, (None, false), &mut link.to);
        }
        packet::disconnect(&mut link.to);
        link.flush()
    }

    fn hear(&mut self, packet: Packet) -> Result<(), String> {
        match packet {
            Packet::Message(message) => {
                let packet::Message {
                    topic,
                    payload,
                    id,
                    is_retained,
                } = message;
                if id.is_none() && self.inbox.len() >= MOST {
                    self.refuse("more messages come than can be taken");
                    return Ok(());
                }
                self.inbox.push_back(Inbound {
                    topic,
                    payload,
                    id,
                    is_retained,
                    came: now(),
                    is_kept_back: false,
                });
            }
            Packet::Acknowledged { id, code } => {
                if code >= 128 {
                    self.refuse(&format!(
                        "the broker does not take an estimate: {}",
                        packet::reason(code)
                    ));
                }
                self.outbox.is_there(id);
            }
            Packet::Goodbye(why) => return Err(why),
            Packet::Welcome(_) | Packet::Unwanted(_) | Packet::Subscribed(_) | Packet::Pong => {}
        }
        Ok(())
    }

    /// Takes what waits.
    fn take(&mut self) {
        self.pause = None;
        let count = self.inbox.len().min(BATCH);
        let messages: Vec<Inbound> = self.inbox.drain(..count).collect();
        let mut rows: Vec<Arrival> = vec![];
        // by message, its rows are those up to here
        let mut ends = vec![];
        let mut begun = vec![];
        for message in &messages {
            match self.arrivals(message, &mut begun) {
                Ok(own) => rows.extend(own),
                Err(why) => self.refuse(&format!("{}: {why}", message.topic)),
            }
            ends.push(rows.len());
        }
        let mut answers = self.engine.take(&rows).into_iter().zip(&rows);
        let mut first = 0;
        let mut kept_back = VecDeque::new();
        for (mut message, end) in messages.into_iter().zip(ends) {
            let mut is_kept = true;
            for (answer, row) in answers.by_ref().take(end - first) {
                match answer {
                    Ok(lines) => {
                        if let Some(board) = self.board {
                            board.told(row, &lines);
                        }
                        for line in &lines {
                            publish(
                                &mut self.outbox,
                                self.settings,
                                self.engine,
                                row.asset,
                                line,
                            );
                        }
                    }
                    Err(Refusal::Unusable(why)) => {
                        let topic = message.topic.clone();
                        self.refused += 1;
                        tell_refusal(
                            (self.refused, self.board),
                            &format!("{topic}: {why}"),
                            self.tell,
                        );
                    }
                    Err(Refusal::NotKept(why)) => {
                        is_kept = false;
                        if !std::mem::replace(&mut message.is_kept_back, true) {
                            self.refused += 1;
                            tell_refusal((self.refused, self.board), &why, self.tell);
                        }
                    }
                }
            }
            first = end;
            match (is_kept, message.id) {
                (true, Some(id)) => self.outbox.owe(id),
                (true, None) => {}
                (false, _) => kept_back.push_back(message),
            }
        }
        if !kept_back.is_empty() {
            // in their order, before those that came after them
            kept_back.append(&mut self.inbox);
            self.inbox = kept_back;
            self.pause = Some(Instant::now() + AGAIN);
        }
    }

    /// The rows that a message is; those of `begun` have a first one.
    fn arrivals(&mut self, from: &Inbound, begun: &mut Vec<usize>) -> Result<Vec<Arrival>, String> {
        let payload = from
            .payload
            .as_ref()
            .ok_or_else(|| format!("the payload is longer than {} bytes", packet::LONGEST))?;
        if payload.is_empty() {
            // so a broker forgets what it kept
            return Ok(vec![]);
        }
        let parts = self
            .topics
            .read(&from.topic, payload, from.came, &mut self.reader)?;
        let mut rows = vec![];
        for part in parts {
            let Part {
                mut message,
                is_part,
                is_undated,
            } = part;
            for stranger in self.reader.strange(std::mem::take(&mut message.strangers)) {
                (self.tell)(&format!("\"{stranger}\" of a message is read by nobody"));
            }
            if from.is_retained && is_undated {
                // nobody knows when it was read; what somebody set holds
                let channels = &self.reader.stream().channels;
                for (value, channel) in message.values.iter_mut().zip(channels) {
                    if channel.is_sensor {
                        *value = f64::NAN;
                    }
                }
            }
            if message.values.iter().all(|value| value.is_nan()) && is_part {
                continue;
            }
            rows.extend(self.firsts.row(&message, self.engine, begun)?);
        }
        Ok(rows)
    }

    fn publish(&mut self, asset: usize, line: &Line) {
        publish(&mut self.outbox, self.settings, self.engine, asset, line);
    }

    fn refuse(&mut self, why: &str) {
        self.refused += 1;
        tell_refusal((self.refused, self.board), why, self.tell);
    }
}

/// What is told of a row, for those who subscribe.
fn publish(
    outbox: &mut Outbox,
    settings: &MqttSettings,
    engine: &Engine,
    asset: usize,
    line: &Line,
) {
    let (Some(pattern), Some(stream)) = (&settings.publish, engine.stream(asset)) else {
        return;
    };
    let name = engine.names().get(asset).map_or("", String::as_str);
    let mut payload = String::new();
    json::write(line, name, stream, &mut payload);
    payload.truncate(payload.trim_end().len());
    outbox.push(Publish {
        topic: topics::told(pattern, name),
        payload,
        retain: settings.retain,
    });
}
