//! The connection to a server, in a thread of its own.

use std::collections::BTreeMap;
use std::pin::pin;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use futures_util::{TryStream, TryStreamExt};
use lynkeus::study::OpcuaSettings;
use opcua::client::transport::TcpConnector;
use opcua::client::{
    Client, ClientBuilder, DataChangeCallback, IdentityToken, Session, SessionConnectMode,
    SessionEventLoop, SessionPollResult,
};
use opcua::crypto::SecurityPolicy;
use opcua::types::{
    AttributeId, DataChangeFilter, DataChangeTrigger, DataTypeId, DataValue, DateTime,
    EndpointDescription, ExtensionObject, MessageSecurityMode, MonitoredItemCreateRequest,
    MonitoringMode, MonitoringParameters, NodeId, ReadValueId, StatusCode, TimestampsToReturn,
    Variant, WriteValue,
};
use tokio::sync::Notify;
use tokio::time::{sleep, timeout};

use crate::history::now;

/// The variable of the environment with the password, where the study has none.
const PASSWORD: &str = "LYNKEUS_OPCUA_PASSWORD";
/// How long it is waited before the next try, at first and at most.
const SOON: Duration = Duration::from_millis(500);
const AT_MOST: Duration = Duration::from_secs(30);
/// So long a server is asked to keep what changes for a client that is away.
const AWAY: Duration = Duration::from_secs(3600);
/// Changes of a node that the server keeps until it sends them.
const QUEUE: u32 = 10_000;
/// How long a server may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it is looked whether somebody asks to stop.
const LOOK: Duration = Duration::from_millis(50);
/// How long what was written last may take to arrive at the end.
const LAST: Duration = Duration::from_millis(300);
/// How long a server may take to say good-bye.
const GOOD_BYE: Duration = Duration::from_secs(1);
/// Ticks of OPC UA, of 100 ns, before 1970.
const TICKS_TO_1970: i64 = 116_444_736_000_000_000;

/// What a server is asked for.
pub(super) struct Asked {
    pub settings: OpcuaSettings,
    pub read: Vec<NodeId>,
    pub written: Vec<NodeId>,
}

/// A change of a node's value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// its place among the nodes that are read
    pub node: usize,
    /// none where the quality is not good
    pub value: Option<f64>,
    /// at the source, in nanoseconds since 1970
    pub at: i128,
}

/// What comes.
pub(super) enum News {
    Change(Change),
    /// a person should know it
    Note(String),
    /// something that was not used, or not taken
    Refused(String),
}

/// A value for a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Written {
    pub value: f64,
    /// in nanoseconds since 1970
    pub at: Option<i128>,
    pub is_good: bool,
}

/// The last value for each node, until it is written.
#[derive(Debug, Default)]
pub(super) struct Outgoing {
    waiting: Mutex<BTreeMap<usize, Written>>,
    news: Notify,
}

impl Outgoing {
    pub fn put(&self, node: usize, written: Written) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.insert(node, written);
        self.news.notify_one();
    }

    fn take(&self) -> BTreeMap<usize, Written> {
        std::mem::take(&mut self.waiting.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What could not be written waits again, but for nodes with something newer.
    fn put_back(&self, all: BTreeMap<usize, Written>) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        for (node, written) in all {
            waiting.entry(node).or_insert(written);
        }
        self.news.notify_one();
    }
}

/// What everything here may tell.
#[derive(Clone)]
struct Teller(SyncSender<News>);

impl Teller {
    fn note(&self, text: String) {
        // nobody listens at the end
        let _ = self.0.try_send(News::Note(text));
    }

    fn refused(&self, text: String) {
        let _ = self.0.try_send(News::Refused(text));
    }
}

/// Reads and writes until it is to stop.
///
/// # Errors
/// The server does not want the first connection, in words.
pub(super) fn run(
    asked: &Arc<Asked>,
    to: &SyncSender<News>,
    outgoing: &Arc<Outgoing>,
    stop: &AtomicBool,
) -> Result<(), String> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| error.to_string())?;
    runtime.block_on(follow(asked, &Teller(to.clone()), outgoing, stop))
}

/// Why there is no session.
enum Ended {
    /// there may be one later
    Lost(String),
    /// the server does not want it, or not so
    Unwanted(String),
}

async fn follow(
    asked: &Arc<Asked>,
    teller: &Teller,
    outgoing: &Arc<Outgoing>,
    stop: &AtomicBool,
) -> Result<(), String> {
    let url = &asked.settings.url.text;
    let mut client = client(&asked.settings)?;
    let mut wait = SOON;
    let is_there = Arc::new(AtomicBool::new(false));
    while !stop.load(Ordering::Relaxed) {
        let done = session(&mut client, (asked, outgoing), teller, &is_there, stop).await;
        let why = match done {
            Ok(()) => return Ok(()),
            Err(Ended::Unwanted(why)) if !is_there.load(Ordering::Relaxed) => return Err(why),
            Err(Ended::Unwanted(why) | Ended::Lost(why)) => why,
        };
        teller.note(format!(
            "no connection to {url}: {why}; the next try is in {} s",
            wait.as_secs_f64()
        ));
        let mut left = wait;
        while left > Duration::ZERO && !stop.load(Ordering::Relaxed) {
            sleep(LOOK).await;
            left = left.saturating_sub(LOOK);
        }
        wait = (2 * wait).min(AT_MOST);
    }
    Ok(())
}

fn client(settings: &OpcuaSettings) -> Result<Client, String> {
    let is_secret = settings.security != "None";
    let builder = ClientBuilder::new()
        .application_name("Lynkeus")
        .application_uri("urn:lynkeus:serve")
        .product_uri("urn:lynkeus")
        .pki_dir(&settings.pki)
        .create_sample_keypair(is_secret)
        .trust_server_certs(false)
        .recreate_subscriptions(false)
        .session_retry_limit(-1)
        .session_retry_initial(SOON)
        .session_retry_max(AT_MOST)
        .session_timeout(u32::try_from(AWAY.as_millis()).unwrap_or(u32::MAX));
    builder.client().map_err(|why| why.join("; "))
}

/// What the server says, as it names it.
fn said(code: StatusCode) -> String {
    let name = code.sub_code();
    format!("{} ({})", name.description(), name.name())
}

/// Whether a server that answers so does not want this client, or not so.
fn is_refusal(code: StatusCode) -> bool {
    [
        StatusCode::BadIdentityTokenInvalid,
        StatusCode::BadIdentityTokenRejected,
        StatusCode::BadUserAccessDenied,
        StatusCode::BadSecurityChecksFailed,
        StatusCode::BadSecurityPolicyRejected,
        StatusCode::BadSecurityModeRejected,
        StatusCode::BadCertificateUntrusted,
        StatusCode::BadCertificateUriInvalid,
        StatusCode::BadServiceUnsupported,
    ]
    .contains(&code)
}

fn ended(code: StatusCode) -> Ended {
    match is_refusal(code) {
        true => Ended::Unwanted(said(code)),
        false => Ended::Lost(said(code)),
    }
}

/// A security policy by the name that the standard gives it; the library has hyphens.
fn policy(name: &str) -> SecurityPolicy {
    SecurityPolicy::from_str(&name.replace('_', "-")).unwrap_or(SecurityPolicy::None)
}

/// A session that begins once its events are asked for.
async fn connected(
    client: &mut Client,
    settings: &OpcuaSettings,
) -> Result<(Arc<Session>, SessionEventLoop<TcpConnector>), Ended> {
    let identity = match &settings.user {
        None => IdentityToken::Anonymous,
        Some(user) => {
            let own = settings.password.as_ref().map(|own| own.text.clone());
            let password = own.or_else(|| std::env::var(PASSWORD).ok());
            IdentityToken::new_user_name(user.text.clone(), password.unwrap_or_default())
        }
    };
    let mode = match settings.security {
        "None" => MessageSecurityMode::None,
        _ => MessageSecurityMode::SignAndEncrypt,
    };
    let policy = policy(settings.security);
    let url = settings.url.text.as_str();
    let endpoints = timeout(PATIENCE, client.get_server_endpoints_from_url(url)).await;
    let endpoints = endpoints.map_err(|_| Ended::Lost("nobody answers".to_owned()))?;
    let endpoints = endpoints.map_err(|error| ended(error.status()))?;
    let fits = |endpoint: &&EndpointDescription| {
        endpoint.security_mode == mode && endpoint.security_policy_uri.as_ref() == policy.to_uri()
    };
    let Some(found) = endpoints.iter().find(fits) else {
        let offered = endpoints.iter().map(|endpoint| {
            let policy = SecurityPolicy::from_uri(endpoint.security_policy_uri.as_ref());
            format!("{policy} ({})", endpoint.security_mode)
        });
        return Err(Ended::Unwanted(format!(
            "the server has no endpoint with `security = \"{}\"`; it has {}",
            settings.security,
            offered.collect::<Vec<_>>().join(", ")
        )));
    };
    // by the name that the user knows: a server may call itself by one that only its own network has
    let mut own = found.clone();
    own.endpoint_url = url.into();
    client
        .connect_to_endpoint_directly(own, identity)
        .map_err(|error| ended(error.status()))
}

/// Follows a session until it is to stop.
async fn session(
    client: &mut Client,
    (asked, outgoing): (&Arc<Asked>, &Arc<Outgoing>),
    teller: &Teller,
    is_there: &Arc<AtomicBool>,
    stop: &AtomicBool,
) -> Result<(), Ended> {
    let url = &asked.settings.url.text;
    let connecting = connected(client, &asked.settings);
    let Some(connected) = unless_stopped(connecting, stop).await else {
        return Ok(());
    };
    let (session, events) = connected?;
    let mut events = pin!(events.enter());
    let begin = || {
        tokio::spawn(work(
            Arc::clone(&session),
            Arc::clone(asked),
            teller.clone(),
            Arc::clone(outgoing),
            Arc::clone(is_there),
        ))
    };
    let mut work = begin();
    let mut has_begun = false;
    while !stop.load(Ordering::Relaxed) {
        tokio::select! {
            event = events.try_next() => match event {
                Ok(Some(SessionPollResult::Reconnected(mode))) => {
                    if has_begun && matches!(mode, SessionConnectMode::NewSession(_)) {
                        // it knows of no subscription
                        work.abort();
                        work = begin();
                    }
                    has_begun = true;
                    let rest = match (is_there.load(Ordering::Relaxed), mode) {
                        (false, _) => "",
                        (true, SessionConnectMode::ReactivatedSession(_)) => " again",
                        (true, SessionConnectMode::NewSession(_)) =>
                            " again, in a new session: what changed meanwhile is lost but for the last value",
                    };
                    teller.note(format!("{url} is connected{rest}"));
                }
                Ok(Some(SessionPollResult::ConnectionLost(code))) => {
                    teller.note(format!("no connection to {url}: {}; it is tried again", said(code)));
                }
                Ok(Some(SessionPollResult::ReconnectFailed(code))) if !has_begun => {
                    work.abort();
                    return Err(ended(code));
                }
                Ok(Some(_)) => {}
                Ok(None) => {
                    work.abort();
                    return Err(Ended::Lost("the session ended".to_owned()));
                }
                Err(code) => {
                    work.abort();
                    return Err(ended(code));
                }
            },
            done = &mut work => {
                let failed = |_| Ended::Lost("the session failed".to_owned());
                let why = done.unwrap_or_else(failed);
                part(&session, events.as_mut(), Duration::ZERO).await;
                return Err(why);
            }
            () = sleep(LOOK) => {}
        }
    }
    // what was written last may still be on its way
    part(&session, events.as_mut(), LAST).await;
    work.abort();
    Ok(())
}

/// What comes of some work; none where it is to stop before.
async fn unless_stopped<T>(work: impl Future<Output = T>, stop: &AtomicBool) -> Option<T> {
    let mut work = pin!(work);
    while !stop.load(Ordering::Relaxed) {
        tokio::select! {
            done = &mut work => return Some(done),
            () = sleep(LOOK) => {}
        }
    }
    None
}

/// Ends a session after a while; nothing is sent or read unless its events are followed.
async fn part(
    session: &Session,
    mut events: impl TryStream<Ok = SessionPollResult, Error = StatusCode> + Unpin,
    after: Duration,
) {
    let last = async {
        sleep(after).await;
        session.disconnect().await
    };
    let rest = async { while let Ok(Some(_)) = events.try_next().await {} };
    let _ = timeout(after + GOOD_BYE, async { tokio::join!(last, rest) }).await;
}

/// Subscribes, then writes what there is to write; ends where the server does not want that.
async fn work(
    session: Arc<Session>,
    asked: Arc<Asked>,
    teller: Teller,
    outgoing: Arc<Outgoing>,
    is_there: Arc<AtomicBool>,
) -> Ended {
    session.wait_for_connection().await;
    let mut kinds = match kinds(&session, &asked.written).await {
        Ok(kinds) => kinds,
        Err(why) => return why,
    };
    if let Err(why) = subscribe(&session, &asked, &teller).await {
        return why;
    }
    // what the server does not want from here on, it may want later
    is_there.store(true, Ordering::Relaxed);
    let mut refused: Vec<Option<StatusCode>> = vec![None; asked.written.len()];
    loop {
        outgoing.news.notified().await;
        let mut all = outgoing.take();
        all.retain(|node, written| written.is_good || kinds[*node].has_quality);
        if all.is_empty() {
            continue;
        }
        let values: Vec<WriteValue> = all
            .iter()
            .map(|(node, written)| WriteValue {
                node_id: asked.written[*node].clone(),
                attribute_id: AttributeId::Value as u32,
                value: kinds[*node].value(written),
                ..Default::default()
            })
            .collect();
        let Ok(codes) = session.write(&values).await else {
            // until there is a connection
            outgoing.put_back(all);
            sleep(SOON).await;
            continue;
        };
        let mut again = BTreeMap::new();
        for ((node, written), code) in all.into_iter().zip(codes) {
            let name = &asked.written[node];
            if code == StatusCode::BadWriteNotSupported && kinds[node].has_quality {
                kinds[node].has_quality = false;
                teller.note(format!(
                    "{name} takes no quality and no time: what is not credible is not written there"
                ));
                again.insert(node, written);
            } else if code.is_bad() && refused[node] != Some(code) {
                teller.refused(format!("{name} is not written: {}", said(code)));
            }
            refused[node] = code.is_bad().then_some(code);
        }
        if !again.is_empty() {
            outgoing.put_back(again);
        }
    }
}

/// What a node that is written takes.
#[derive(Clone, Copy, Debug)]
struct Kind {
    holds: Holds,
    has_quality: bool,
}

#[derive(Clone, Copy, Debug)]
enum Holds {
    Double,
    Float,
    Boolean,
}

impl Kind {
    fn value(self, written: &Written) -> DataValue {
        let value = match self.holds {
            Holds::Double => Variant::Double(written.value),
            // the nearest one
            Holds::Float => Variant::Float(written.value as f32),
            Holds::Boolean => Variant::Boolean(written.value != 0.0),
        };
        let status = match written.is_good {
            true => StatusCode::Good,
            false => StatusCode::Bad,
        };
        let ticks = written
            .at
            .and_then(|at| i64::try_from(at.div_euclid(100)).ok());
        let ticks = ticks.and_then(|ticks| ticks.checked_add(TICKS_TO_1970));
        DataValue {
            value: Some(value),
            status: self.has_quality.then_some(status),
            source_timestamp: ticks
                .filter(|ticks| *ticks > 0 && self.has_quality)
                .map(DateTime::from),
            ..Default::default()
        }
    }
}

/// What the nodes that are written take, by their type.
async fn kinds(session: &Session, nodes: &[NodeId]) -> Result<Vec<Kind>, Ended> {
    if nodes.is_empty() {
        return Ok(vec![]);
    }
    let all = nodes.iter().cloned();
    let all: Vec<_> = all
        .map(|node| ReadValueId::new(node, AttributeId::DataType))
        .collect();
    let read = session.read(&all, TimestampsToReturn::Neither, 0.0).await;
    let values = read.map_err(|error| ended(error.status()))?;
    let kinds = nodes.iter().zip(values).map(|(node, value)| {
        let code = value.status.unwrap_or(StatusCode::Good);
        let Some(Variant::NodeId(kind)) = value.value.filter(|_| code.is_good()) else {
            return Err(Ended::Unwanted(format!("the node {node}: {}", said(code))));
        };
        let holds = match kind.as_data_type_id() {
            Ok(DataTypeId::Double) => Holds::Double,
            Ok(DataTypeId::Float) => Holds::Float,
            Ok(DataTypeId::Boolean) => Holds::Boolean,
            _ => {
                return Err(Ended::Unwanted(format!(
                    "the node {node} holds values of type {kind}: expected a Double, a Float or a Boolean"
                )));
            }
        };
        Ok(Kind {
            holds,
            has_quality: true,
        })
    });
    kinds.collect()
}

/// Asks for all changes of the nodes that are read.
async fn subscribe(session: &Session, asked: &Arc<Asked>, teller: &Teller) -> Result<(), Ended> {
    let interval = Duration::from_secs_f64(asked.settings.interval);
    let beats = (AWAY.as_secs_f64() / interval.as_secs_f64()).ceil();
    // three times the beats between signs of life, at least
    let lifetime = beats.clamp(30.0, 1e6) as u32;
    let mut told = Told::new(Arc::clone(asked), teller.clone());
    let callback = DataChangeCallback::new(move |value, item| {
        let node = item.client_handle().saturating_sub(1) as usize;
        told.hear(node, &value);
    });
    let id = session
        .create_subscription(interval, lifetime, 10, 0, 0, true, callback)
        .await
        .map_err(|error| ended(error.status()))?;
    // a reading that is as it was is a reading
    let filter = DataChangeFilter {
        trigger: DataChangeTrigger::StatusValueTimestamp,
        deadband_type: 0,
        deadband_value: 0.0,
    };
    let items = asked.read.iter().enumerate().map(|(place, node)| {
        MonitoredItemCreateRequest::new(
            ReadValueId::new_value(node.clone()),
            MonitoringMode::Reporting,
            MonitoringParameters {
                // none has the number 0
                client_handle: place as u32 + 1,
                // as often as the server looks
                sampling_interval: 0.0,
                filter: ExtensionObject::from_message(filter.clone()),
                queue_size: QUEUE,
                discard_oldest: true,
            },
        )
    });
    let items: Vec<_> = items.collect();
    let created = session
        .create_monitored_items(id, TimestampsToReturn::Both, items)
        .await
        .map_err(|error| ended(error.status()))?;
    for (node, created) in asked.read.iter().zip(created) {
        let code = created.result.status_code;
        if code.is_bad() {
            return Err(Ended::Unwanted(format!("the node {node}: {}", said(code))));
        }
    }
    Ok(())
}

/// Makes changes of what a server says.
struct Told {
    asked: Arc<Asked>,
    teller: Teller,
    /// by node, whether its last value had another quality than good
    is_bad: Vec<bool>,
}

impl Told {
    fn new(asked: Arc<Asked>, teller: Teller) -> Self {
        Self {
            is_bad: vec![false; asked.read.len()],
            asked,
            teller,
        }
    }

    fn hear(&mut self, node: usize, said_value: &DataValue) {
        let Some(name) = self.asked.read.get(node) else {
            return;
        };
        let code = said_value.status.unwrap_or(StatusCode::Good);
        if code.overflow() {
            self.teller.refused(format!(
                "{name}: the server's queue was too short, changes before this one are lost"
            ));
        }
        let number = match &said_value.value {
            Some(Variant::Boolean(is_true)) => Some(f64::from(u8::from(*is_true))),
            Some(value) => value.as_f64(),
            None => None,
        };
        let value = number.filter(|x| x.is_finite() && code.is_good());
        match (value.is_none(), self.is_bad[node]) {
            (true, false) if !code.is_good() => {
                let text = format!("{name} is no reading for now: {}", said(code));
                self.teller.note(text);
            }
            (true, false) => self.teller.note(format!("{name} holds no number")),
            (false, true) => self.teller.note(format!("{name} is a reading again")),
            _ => {}
        }
        self.is_bad[node] = value.is_none();
        let stamps = [said_value.source_timestamp, said_value.server_timestamp];
        let stamp = stamps.into_iter().flatten().find(|stamp| !stamp.is_null());
        let at = stamp.map(|stamp| i128::from(stamp.ticks() - TICKS_TO_1970) * 100);
        // where there is no room the connection waits; nobody listens at the end
        let _ = self.teller.0.send(News::Change(Change {
            node,
            value,
            at: at.unwrap_or_else(now),
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_policies_of_a_study_are_known() {
        for name in [
            "None",
            "Basic256Sha256",
            "Aes128_Sha256_RsaOaep",
            "Aes256_Sha256_RsaPss",
        ] {
            let uri = policy(name).to_uri();
            assert_eq!(uri.rsplit('#').next(), Some(name));
        }
    }
}
