//! Topics, and what a message under one says.

use lynkeus::Error;
use lynkeus::study::{MqttSettings, Name};
use lynkeus::table::Instant;

use crate::engine::Engine;
use crate::json;
use crate::row::{Field, Reader, Stamp};

/// In a topic it stands for the name of an asset.
const ASSET: &str = "{asset}";

/// What comes under a topic.
#[derive(Clone, Debug, PartialEq)]
enum Meaning {
    /// values of a column
    Column(String),
    /// whole rows
    Row,
}

/// Topics of one kind.
#[derive(Clone, Debug)]
struct Pattern {
    levels: Vec<String>,
    meaning: Meaning,
}

/// What a study reads, by topic.
#[derive(Debug)]
pub(super) struct Topics(Vec<Pattern>);

/// A message as a row, or a part of one.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub message: json::Message,
    /// it is no row of its own before there is a first one
    pub is_part: bool,
    /// nobody knows how old it is
    pub is_undated: bool,
}

impl Topics {
    /// Those of a study.
    ///
    /// # Errors
    /// There is none; a column that no message of the study has; wildcards; no place for the name of an asset, or one
    /// that is not needed.
    pub fn new(settings: &MqttSettings, reader: &Reader, has_assets: bool) -> Result<Self, Error> {
        let mut patterns = vec![];
        for (column, topic) in &settings.topics {
            if !reader.knows(&column.text) || column.text == reader.stream().time {
                let text = format!(
                    "\"{}\" in `topics` of mqtt: no row of this study has such a column",
                    column.text
                );
                let known = reader.columns().collect::<Vec<_>>().join(", ");
                return Err(
                    column.blame(Error::input(text).hint(format!("its columns are {known}")))
                );
            }
            let meaning = Meaning::Column(column.text.clone());
            patterns.push(pattern(topic, meaning, has_assets)?);
        }
        if let Some(rows) = &settings.rows {
            // a row may say itself whose it is
            let named = has_assets && rows.text.contains(ASSET);
            patterns.push(pattern(rows, Meaning::Row, named)?);
        }
        if patterns.is_empty() {
            let error = Error::input("mqtt in [serve] reads nothing");
            return Err(settings
                .url
                .blame(error.hint("add `topics = { column = \"topic\" }` or `rows = \"topic\"`")));
        }
        Ok(Self(patterns))
    }

    /// What a broker is asked for.
    pub fn filters(&self) -> Vec<String> {
        let level = |level: &String| match level.as_str() {
            ASSET => "+".to_owned(),
            other => other.to_owned(),
        };
        let filters = self.0.iter().map(|pattern| {
            let levels: Vec<String> = pattern.levels.iter().map(level).collect();
            levels.join("/")
        });
        let mut filters: Vec<String> = filters.collect();
        filters.sort();
        filters.dedup();
        filters
    }

    /// What is published must not come back as a row, which would be published again.
    ///
    /// # Errors
    /// It would.
    pub fn refuse_own(&self, own: &Name, engine: &Engine) -> Result<(), Error> {
        let name = engine.names().first().map_or("", String::as_str);
        let topic = told(own, name);
        let comes_back = |pattern: &Pattern| matched(&pattern.levels, &topic).is_some();
        match self.0.iter().any(comes_back) {
            false => Ok(()),
            true => {
                let text = format!(
                    "what is published under \"{}\" would come back as a row",
                    own.text
                );
                let hint = "publish under a topic that `topics` and `rows` have not";
                Err(own.blame(Error::input(text).hint(hint)))
            }
        }
    }

    /// What a payload under a topic says, which came at `came` (nanoseconds since 1970).
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(
        &self,
        topic: &str,
        payload: &[u8],
        came: i128,
        reader: &mut Reader,
    ) -> Result<Vec<Part>, String> {
        let text = std::str::from_utf8(payload).map_err(|_| "the payload is not UTF-8")?;
        let text = text.trim();
        let mut found = vec![];
        for pattern in &self.0 {
            let Some(asset) = matched(&pattern.levels, topic) else {
                continue;
            };
            let mut part = match &pattern.meaning {
                Meaning::Row => row(text, came, reader)?,
                Meaning::Column(name) => value(text, name, came, reader)?,
            };
            if asset.is_some() {
                part.message.asset = asset.map(str::to_owned);
            }
            found.push(part);
        }
        match found.is_empty() {
            true => Err("nobody asked for this topic".to_owned()),
            false => Ok(found),
        }
    }
}

fn pattern(topic: &Name, meaning: Meaning, has_assets: bool) -> Result<Pattern, Error> {
    let refuse =
        |why: &str| Err(topic.blame(Error::input(format!("the topic \"{}\" {why}", topic.text))));
    let levels: Vec<String> = topic.text.split('/').map(str::to_owned).collect();
    let named = levels.iter().filter(|level| *level == ASSET).count();
    let others = levels.iter().filter(|level| *level != ASSET);
    if others
        .clone()
        .any(|level| level.contains(['+', '#', '{', '}', '\0']))
    {
        return refuse("may have no \"+\", \"#\", \"{\" or \"}\", but for {asset} as a level");
    }
    match (has_assets, named) {
        (true, 1) | (false, 0) => Ok(Pattern { levels, meaning }),
        (true, _) => {
            refuse("has to have the level {asset} once: where the name of an asset stands")
        }
        (false, _) => refuse("has the level {asset}, and [serve] names no `assets`"),
    }
}

/// Whether a topic is one of a pattern; the name of the asset where there is one in it.
fn matched<'t>(levels: &[String], topic: &'t str) -> Option<Option<&'t str>> {
    let mut asset = None;
    let mut own = topic.split('/');
    for level in levels {
        let found = own.next()?;
        match level.as_str() {
            ASSET => asset = Some(found),
            other if other == found => {}
            _ => return None,
        }
    }
    own.next().is_none().then_some(asset)
}

/// A row as JSON; it came at its time where it has none.
fn row(text: &str, came: i128, reader: &mut Reader) -> Result<Part, String> {
    let came = arrival(came);
    let message = json::read_at(text, Some(came), reader)?;
    Ok(Part {
        is_part: false,
        is_undated: message.stamp == came,
        message,
    })
}

/// A number, or an object with a `value` and perhaps a time.
fn value(text: &str, name: &str, came: i128, reader: &mut Reader) -> Result<Part, String> {
    let (value, time) = match text.parse::<f64>() {
        Ok(number) => (Field::Number(number), Field::Nothing),
        Err(_) => json::value(text, &reader.stream().time)?,
    };
    let is_undated = time == Field::Nothing;
    let stamp = match is_undated {
        true => arrival(came),
        false => reader.stamp(time)?,
    };
    let get = |key: &str| match key == name {
        true => value.clone(),
        false => Field::Nothing,
    };
    Ok(Part {
        message: json::Message {
            asset: None,
            stamp,
            values: reader.values(&get)?,
            strangers: vec![],
        },
        is_part: true,
        is_undated,
    })
}

fn arrival(came: i128) -> Stamp {
    Stamp::Date(Instant::at(came, true))
}

/// A topic for what is told of an asset.
pub(super) fn told(pattern: &Name, asset: &str) -> String {
    pattern.text.replace(ASSET, asset)
}

/// Whether all assets have a topic of what is told of them.
///
/// # Errors
/// A name that a topic cannot have.
pub(super) fn checked(pattern: &Name, engine: &Engine) -> Result<(), Error> {
    if pattern.text.contains(['+', '#', '\0']) {
        let text = format!("the topic \"{}\" may have no \"+\" or \"#\"", pattern.text);
        return Err(pattern.blame(Error::input(text)));
    }
    let is_wrong = |name: &&String| name.contains(['/', '+', '#', '\0']);
    match engine.names().iter().find(is_wrong) {
        Some(name) if pattern.text.contains(ASSET) => {
            let text =
                format!("the asset \"{name}\" has no topic: a level has no \"/\", \"+\" or \"#\"");
            Err(pattern.blame(Error::input(text)))
        }
        _ => Ok(()),
    }
}
