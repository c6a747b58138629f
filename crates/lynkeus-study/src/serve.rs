//! `[serve]`: how a study's estimator runs beside a plant.

use std::path::{Path, PathBuf};

use super::Name;
use super::keys::{INTERVALS, MQTT, OPCUA, SERVE};
use super::section::Entry;
use lynkeus_answer::Error;

/// How a study's estimator runs beside a plant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServeSettings {
    /// So long a row that is older than another is waited for, in units of the plant's time.
    pub wait: f64,
    /// The file in which it keeps where it is.
    pub state: Option<PathBuf>,
    /// The files of what was told, one for each day: `%Y`, `%m` and `%d` are its date.
    pub history: Option<PathBuf>,
    /// How many days of it are kept; `None`: all.
    pub keep_days: Option<u64>,
    /// The table of the assets, where there are several.
    pub assets: Option<PathBuf>,
    /// The address of the page, with a port.
    pub http: Option<Name>,
    /// What those who look have to say.
    pub token: Option<Name>,
    /// The broker from which rows come, and to which estimates go.
    pub mqtt: Option<MqttSettings>,
    /// The server of OPC UA whose nodes are read and written.
    pub opcua: Option<OpcuaSettings>,
}

/// A server of OPC UA, and what is read and written there.
#[derive(Clone, Debug, PartialEq)]
pub struct OpcuaSettings {
    /// Where it is: `opc.tcp://host:port`.
    pub url: Name,
    /// By column of a row, the node of its values.
    pub nodes: Vec<(Name, Name)>,
    /// By name in an answer, the node that gets it.
    pub write: Vec<(Name, Name)>,
    /// Seconds between what the server sends.
    pub interval: f64,
    /// Who this is.
    pub user: Option<Name>,
    /// What the server asks for beside it.
    pub password: Option<Name>,
    /// The name of the security policy.
    pub security: &'static str,
    /// The folder of the certificates.
    pub pki: PathBuf,
}

/// A broker, and what is read and published there.
#[derive(Clone, Debug, PartialEq)]
pub struct MqttSettings {
    /// Where it is: `mqtt://host:port`, `mqtts://host:port`.
    pub url: Name,
    /// What is spoken.
    pub version: MqttVersion,
    /// Who this is.
    pub user: Option<Name>,
    /// What the broker asks for beside it.
    pub password: Option<Name>,
    /// Certificates of those who vouch for the broker; `None`: whom the system trusts.
    pub ca: Option<PathBuf>,
    /// The certificate of this client.
    pub cert: Option<PathBuf>,
    /// The private key of that.
    pub key: Option<PathBuf>,
    /// The name of this client.
    pub client: Option<Name>,
    /// By column of a row, the topic of its values.
    pub topics: Vec<(Name, Name)>,
    /// The topic of whole rows.
    pub rows: Option<Name>,
    /// The topic of the estimates.
    pub publish: Option<Name>,
    /// The topic that says whether the service is there.
    pub status: Option<Name>,
    /// Whether messages are acknowledged (1) or not (0).
    pub qos: u8,
    /// Whether the broker keeps the last estimate for those who subscribe.
    pub retain: bool,
}

/// A version of MQTT.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MqttVersion {
    /// 3.1.1
    #[default]
    V3,
    /// 5
    V5,
}

impl ServeSettings {
    /// Files of a study are named from its folder.
    pub(super) fn beside(&mut self, folder: &Path) {
        let paths = [&mut self.state, &mut self.history, &mut self.assets];
        let mqtt = self.mqtt.iter_mut();
        let mqtt = mqtt.flat_map(|mqtt| [&mut mqtt.ca, &mut mqtt.cert, &mut mqtt.key]);
        for path in paths.into_iter().chain(mqtt).flatten() {
            *path = folder.join(&*path);
        }
        if let Some(opcua) = &mut self.opcua {
            opcua.pki = folder.join(&opcua.pki);
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<ServeSettings, Error> {
    let mut section = entry.section("[serve]", &SERVE)?;
    Ok(ServeSettings {
        wait: section.optional("wait", waited)?.unwrap_or(0.0),
        state: section.optional("state", path)?,
        history: section.optional("history", history)?,
        keep_days: section.optional("keep_days", |e| e.whole(1))?,
        assets: section.optional("assets", path)?,
        http: section.optional("http", Entry::name)?,
        token: section.optional("token", Entry::name)?,
        mqtt: section.optional("mqtt", mqtt)?,
        opcua: section.optional("opcua", opcua)?,
    })
}

fn opcua(entry: Entry<'_>) -> Result<OpcuaSettings, Error> {
    let no_url = entry.refuse_key("needs `url`, such as \"opc.tcp://localhost:4840\"");
    let no_nodes =
        entry.refuse_key("needs `nodes`, such as `nodes = { level = \"ns=2;s=Tank.Level\" }`");
    let mut section = entry.section("opcua in [serve]", &OPCUA)?;
    let policies = [
        "None",
        "Basic256Sha256",
        "Aes128_Sha256_RsaOaep",
        "Aes256_Sha256_RsaPss",
    ]
    .map(|name| (name, name));
    let nodes = section.optional("nodes", names)?.unwrap_or_default();
    if nodes.is_empty() {
        return Err(no_nodes);
    }
    Ok(OpcuaSettings {
        url: section.optional("url", Entry::name)?.ok_or(no_url)?,
        nodes,
        write: section.optional("write", names)?.unwrap_or_default(),
        interval: section
            .optional("interval", |e| e.within(&INTERVALS))?
            .unwrap_or(0.5),
        user: section.optional("user", Entry::name)?,
        password: section.optional("password", Entry::name)?,
        security: section
            .optional("security", |e| e.choice(&policies))?
            .unwrap_or("None"),
        pki: section.optional("pki", path)?.unwrap_or("pki".into()),
    })
}

/// A table of names by names.
fn names(entry: Entry<'_>) -> Result<Vec<(Name, Name)>, Error> {
    let pairs = entry.pairs()?.into_iter();
    pairs.map(|(key, text)| Ok((key, text.name()?))).collect()
}

fn mqtt(entry: Entry<'_>) -> Result<MqttSettings, Error> {
    let refusal = entry.refuse_key("needs `url`, such as \"mqtt://localhost:1883\"");
    let halves = entry.refuse_key("needs both `cert` and `key`, or neither");
    let mut section = entry.section("mqtt in [serve]", &MQTT)?;
    let versions = [("3.1.1", MqttVersion::V3), ("5", MqttVersion::V5)];
    let version = section.optional("version", |e| e.choice(&versions))?;
    let topics = section.optional("topics", names)?;
    let settings = MqttSettings {
        url: section.optional("url", Entry::name)?.ok_or(refusal)?,
        version: version.unwrap_or_default(),
        user: section.optional("user", Entry::name)?,
        password: section.optional("password", Entry::name)?,
        ca: section.optional("ca", path)?,
        cert: section.optional("cert", path)?,
        key: section.optional("key", path)?,
        client: section.optional("client", Entry::name)?,
        topics: topics.unwrap_or_default(),
        rows: section.optional("rows", Entry::name)?,
        publish: section.optional("publish", Entry::name)?,
        status: section.optional("status", Entry::name)?,
        qos: section.optional("qos", quality)?.unwrap_or(1),
        retain: section.optional("retain", Entry::boolean)?.unwrap_or(false),
    };
    match settings.cert.is_some() == settings.key.is_some() {
        true => Ok(settings),
        false => Err(halves),
    }
}

/// A quality of service.
fn quality(entry: Entry<'_>) -> Result<u8, Error> {
    let refusal =
        entry.wrong("0 or 1 (a row that comes twice counts once, so that 2 gives nothing more)");
    match entry.whole(0) {
        Ok(0) => Ok(0),
        Ok(1) => Ok(1),
        _ => Err(refusal),
    }
}

/// A time to wait.
fn waited(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a time >= 0, in units of the plant's time");
    entry.number().ok().filter(|t| *t >= 0.0).ok_or(refusal)
}

fn path(entry: Entry<'_>) -> Result<PathBuf, Error> {
    Ok(PathBuf::from(entry.name()?.text))
}

/// The path of a file for each day.
fn history(entry: Entry<'_>) -> Result<PathBuf, Error> {
    let refusal =
        entry.wrong("the path of a CSV or Parquet file with %Y, %m and %d: \"tank-%Y-%m-%d.csv\"");
    let name = entry.name()?.text;
    let is_whole = ["%Y", "%m", "%d"].iter().all(|part| name.contains(part));
    let is_known = name.ends_with(".csv") || name.ends_with(".parquet");
    (is_whole && is_known)
        .then(|| PathBuf::from(name))
        .ok_or(refusal)
}
