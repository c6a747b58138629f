//! Packets of MQTT 3.1.1 and 5 with a quality of service of 0 or 1, as bytes.
//!
//! <https://docs.oasis-open.org/mqtt/mqtt/v3.1.1/mqtt-v3.1.1.html>,
//! <https://docs.oasis-open.org/mqtt/mqtt/v5.0/mqtt-v5.0.html>

use lynkeus::study::MqttVersion;

/// Bytes of a payload, at most.
pub(super) const LONGEST: usize = 64 << 10;
/// Bytes of a packet that is read whole: a payload, and what stands before it.
const WHOLE: usize = 2 * LONGEST + 64;
/// How long a broker keeps what was not delivered, in seconds: a week.
const SESSION: u32 = 7 * 86_400;
/// Messages that a broker may send before they are acknowledged.
const ON_THE_WAY: u16 = 1024;

/// How a client presents itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hello<'h> {
    pub client: &'h str,
    /// seconds without a packet
    pub keep_alive: u16,
    /// nothing is kept for it while it is away
    pub is_clean: bool,
    /// the topic and the text of what a broker says once the client is lost
    pub will: Option<(&'h str, &'h str)>,
    pub user: Option<&'h str>,
    pub password: Option<&'h str>,
}

/// A message for a topic.
#[derive(Clone, Debug)]
pub(super) struct Publish {
    pub topic: String,
    pub payload: String,
    pub retain: bool,
}

/// What a broker sends.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Packet {
    Welcome(Welcome),
    /// why a client is not wanted
    Unwanted(String),
    Message(Message),
    /// a message was taken; a code of 128 or more says that it was not
    Acknowledged {
        id: u16,
        code: u8,
    },
    /// for each topic, a code
    Subscribed(Vec<u8>),
    Pong,
    /// why a broker ends the connection
    Goodbye(String),
}

/// A client may stay.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Welcome {
    /// what was not delivered follows
    pub has_session: bool,
    /// messages that may be sent before they are acknowledged
    pub on_the_way: usize,
    /// whether it acknowledges any
    pub acknowledges: bool,
}

/// A message that comes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    pub topic: String,
    /// none where it is too long
    pub payload: Option<Vec<u8>>,
    /// to acknowledge it by
    pub id: Option<u16>,
    /// it is what the broker kept for those who subscribe
    pub is_retained: bool,
}

/// A packet and the bytes that it takes, of which not all may be there yet.
pub(super) type Found = (Packet, usize);

const fn level(version: MqttVersion) -> u8 {
    match version {
        MqttVersion::V3 => 4,
        MqttVersion::V5 => 5,
    }
}

/// A packet of these parts.
fn framed(head: u8, body: &[u8], to: &mut Vec<u8>) {
    to.push(head);
    count(body.len(), to);
    to.extend_from_slice(body);
}

/// A number of variable length.
fn count(mut number: usize, to: &mut Vec<u8>) {
    loop {
        let low = (number % 128) as u8;
        number /= 128;
        if number == 0 {
            return to.push(low);
        }
        to.push(low | 128);
    }
}

fn text(text: &str, to: &mut Vec<u8>) {
    // topics and names of a study are shorter than its file
    let bytes = &text.as_bytes()[..text.len().min(usize::from(u16::MAX))];
    to.extend_from_slice(&(bytes.len() as u16).to_be_bytes());
    to.extend_from_slice(bytes);
}

pub(super) fn connect(version: MqttVersion, hello: &Hello<'_>, to: &mut Vec<u8>) {
    let mut body = vec![];
    text("MQTT", &mut body);
    body.push(level(version));
    let flag = |is: bool, bit: u8| u8::from(is) << bit;
    // a will is retained, and sent at least once
    let will = flag(hello.will.is_some(), 2)
        | flag(hello.will.is_some(), 3)
        | flag(hello.will.is_some(), 5);
    body.push(
        flag(hello.user.is_some(), 7)
            | flag(hello.password.is_some(), 6)
            | flag(hello.is_clean, 1)
            | will,
    );
    body.extend_from_slice(&hello.keep_alive.to_be_bytes());
    if version == MqttVersion::V5 {
        let mut properties = vec![0x21];
        properties.extend_from_slice(&ON_THE_WAY.to_be_bytes());
        if !hello.is_clean {
            properties.push(0x11);
            properties.extend_from_slice(&SESSION.to_be_bytes());
        }
        count(properties.len(), &mut body);
        body.extend_from_slice(&properties);
    }
    text(hello.client, &mut body);
    if let Some((topic, said)) = hello.will {
        if version == MqttVersion::V5 {
            body.push(0);
        }
        text(topic, &mut body);
        text(said, &mut body);
    }
    for given in [hello.user, hello.password].into_iter().flatten() {
        text(given, &mut body);
    }
    framed(0x10, &body, to);
}

pub(super) fn subscribe(version: MqttVersion, filters: &[String], qos: u8, to: &mut Vec<u8>) {
    // the only one that is on its way
    let mut body = vec![0, 1];
    if version == MqttVersion::V5 {
        body.push(0);
    }
    for filter in filters {
        text(filter, &mut body);
        body.push(qos);
    }
    framed(0x82, &body, to);
}

/// A message, to be acknowledged where it has a number.
pub(super) fn publish(
    version: MqttVersion,
    message: &Publish,
    (id, is_repeated): (Option<u16>, bool),
    to: &mut Vec<u8>,
) {
    let mut body = vec![];
    text(&message.topic, &mut body);
    if let Some(id) = id {
        body.extend_from_slice(&id.to_be_bytes());
    }
    if version == MqttVersion::V5 {
        body.push(0);
    }
    body.extend_from_slice(message.payload.as_bytes());
    let head = 0x30 | u8::from(is_repeated) << 3 | u8::from(id.is_some()) << 1;
    framed(head | u8::from(message.retain), &body, to);
}

pub(super) fn acknowledge(id: u16, to: &mut Vec<u8>) {
    framed(0x40, &id.to_be_bytes(), to);
}

pub(super) fn ping(to: &mut Vec<u8>) {
    framed(0xc0, &[], to);
}

pub(super) fn disconnect(to: &mut Vec<u8>) {
    framed(0xe0, &[], to);
}

/// The first packet of some bytes; none where it is not whole so far.
///
/// # Errors
/// It is none that a broker sends.
pub(super) fn read(version: MqttVersion, bytes: &[u8]) -> Result<Option<Found>, String> {
    let mut from = Bytes(bytes);
    let Some(head) = from.byte() else {
        return Ok(None);
    };
    let length = match from.count() {
        Ok(Some(length)) => length,
        Ok(None) => return Ok(None),
        Err(()) => return Err(broken(head)),
    };
    let size = bytes.len() - from.0.len() + length;
    let is_message = head >> 4 == 3;
    if size > WHOLE && is_message {
        // its topic and its number are enough
        let part = from.0.len() >= length.min(LONGEST + 8);
        let message = part.then(|| message(version, head, from)).flatten();
        let long = message.map(|found| Message {
            payload: None,
            ..found
        });
        return Ok(long.map(|long| (Packet::Message(long), size)));
    }
    if size > WHOLE {
        return Err(broken(head));
    }
    let Some(body) = from.take(length) else {
        return Ok(None);
    };
    let packet = packet(version, head, Bytes(body)).ok_or_else(|| broken(head))?;
    Ok(Some((packet, size)))
}

fn broken(head: u8) -> String {
    format!("a packet (0x{head:02x}) that no broker sends")
}

fn packet(version: MqttVersion, head: u8, mut body: Bytes<'_>) -> Option<Packet> {
    let has_properties = version == MqttVersion::V5;
    match head >> 4 {
        2 => {
            let (flags, code) = (body.byte()?, body.byte()?);
            welcome(version, flags & 1 == 1, code, body)
        }
        3 => message(version, head, body).map(Packet::Message),
        4 => Some(Packet::Acknowledged {
            id: body.word()?,
            code: body.byte().unwrap_or(0),
        }),
        9 => {
            body.word()?;
            if has_properties {
                body.properties()?;
            }
            Some(Packet::Subscribed(body.0.to_vec()))
        }
        13 => Some(Packet::Pong),
        14 => {
            let code = body.byte().unwrap_or(0);
            Some(Packet::Goodbye(reason(code)))
        }
        _ => None,
    }
}

fn welcome(
    version: MqttVersion,
    has_session: bool,
    code: u8,
    mut body: Bytes<'_>,
) -> Option<Packet> {
    if code != 0 {
        let why = match (version, code) {
            (MqttVersion::V3, 1) => "it does not speak MQTT 3.1.1".to_owned(),
            (MqttVersion::V3, 2) => "it does not accept the client's name".to_owned(),
            (MqttVersion::V3, 3) => "it is not available".to_owned(),
            (MqttVersion::V3, 4) => "the user or the password is wrong".to_owned(),
            (MqttVersion::V3, 5) => "the client is not authorized".to_owned(),
            _ => reason(code),
        };
        return Some(Packet::Unwanted(why));
    }
    let mut found = Welcome {
        has_session,
        on_the_way: usize::from(u16::MAX),
        acknowledges: true,
    };
    if version == MqttVersion::V5 {
        for (property, value) in body.properties()? {
            match property {
                0x21 => found.on_the_way = usize::try_from(value).ok()?.max(1),
                0x24 => found.acknowledges = value > 0,
                _ => {}
            }
        }
    }
    Some(Packet::Welcome(found))
}

fn message(version: MqttVersion, head: u8, mut body: Bytes<'_>) -> Option<Message> {
    let topic = body.text()?;
    let id = match head >> 1 & 3 {
        0 => None,
        1 => Some(body.word()?),
        // it was not asked for
        _ => return None,
    };
    if version == MqttVersion::V5 {
        body.properties()?;
    }
    Some(Message {
        topic: String::from_utf8(topic.to_vec()).ok()?,
        payload: (body.0.len() <= LONGEST).then(|| body.0.to_vec()),
        id,
        is_retained: head & 1 == 1,
    })
}

/// What a code of MQTT 5 says.
pub(super) fn reason(code: u8) -> String {
    let known = match code {
        0x00 => "it ends the connection",
        0x04 => "it ends the connection, and tells the last will",
        0x84 => "it does not speak this version of MQTT",
        0x85 => "it does not accept the client's name",
        0x86 => "the user or the password is wrong",
        0x87 => "the client is not authorized",
        0x88 | 0x8b => "it is not available",
        0x89 => "it is busy",
        0x8d => "it heard nothing for too long",
        0x8e => "another client has the same name",
        0x8f => "it does not accept the topic",
        0x97 => "a quota is exceeded",
        _ => return format!("it gives the reason 0x{code:02x}"),
    };
    known.to_owned()
}

/// Bytes that are read from their beginning.
#[derive(Clone, Copy)]
struct Bytes<'b>(&'b [u8]);

impl<'b> Bytes<'b> {
    fn take(&mut self, count: usize) -> Option<&'b [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }

    fn word(&mut self) -> Option<u16> {
        self.take(2).map(|two| u16::from_be_bytes([two[0], two[1]]))
    }

    /// A number of variable length; none where it is not whole.
    fn count(&mut self) -> Result<Option<usize>, ()> {
        let mut number = 0;
        for place in 0..4 {
            let Some(byte) = self.byte() else {
                return Ok(None);
            };
            number |= usize::from(byte & 127) << (7 * place);
            if byte < 128 {
                return Ok(Some(number));
            }
        }
        Err(())
    }

    fn text(&mut self) -> Option<&'b [u8]> {
        let length = self.word()?;
        self.take(usize::from(length))
    }

    /// The properties of MQTT 5 that are numbers.
    fn properties(&mut self) -> Option<Vec<(u8, u32)>> {
        let length = self.count().ok()??;
        let mut own = Bytes(self.take(length)?);
        let mut found = vec![];
        while let Some(property) = own.byte() {
            let value = match property {
                0x01 | 0x17 | 0x19 | 0x24 | 0x25 | 0x28 | 0x29 | 0x2a => u32::from(own.byte()?),
                0x13 | 0x21..=0x23 => u32::from(own.word()?),
                0x02 | 0x11 | 0x18 | 0x27 => u32::from(own.word()?) << 16 | u32::from(own.word()?),
                0x0b => u32::try_from(own.count().ok()??).ok()?,
                0x26 => {
                    own.text()?;
                    own.text()?;
                    continue;
                }
                0x03 | 0x08 | 0x09 | 0x12 | 0x15 | 0x16 | 0x1a | 0x1c | 0x1f => {
                    own.text()?;
                    continue;
                }
                _ => return None,
            };
            found.push((property, value));
        }
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the standards, and packets as mosquitto 2.0 sends them.
    #[test]
    fn packets_are_those_of_the_standard() {
        let mut bytes = vec![];
        for number in [
            0,
            127,
            128,
            16_383,
            16_384,
            2_097_151,
            2_097_152,
            268_435_455,
        ] {
            bytes.clear();
            count(number, &mut bytes);
            assert_eq!(Bytes(&bytes).count(), Ok(Some(number)));
        }
        assert_eq!(bytes, [0xff, 0xff, 0xff, 0x7f]);
        bytes.clear();
        let hello = Hello {
            client: "me",
            keep_alive: 30,
            is_clean: false,
            will: Some(("s", "off")),
            user: Some("u"),
            password: Some("pw"),
        };
        connect(MqttVersion::V3, &hello, &mut bytes);
        let expected = b"\x10\x1d\0\x04MQTT\x04\xec\0\x1e\0\x02me\0\x01s\0\x03off\0\x01u\0\x02pw";
        assert_eq!(bytes, expected);
        bytes.clear();
        subscribe(MqttVersion::V3, &["a/+".into()], 1, &mut bytes);
        assert_eq!(bytes, b"\x82\x08\0\x01\0\x03a/+\x01");
        bytes.clear();
        let message = Publish {
            topic: "a/b".into(),
            payload: "1.5".into(),
            retain: true,
        };
        publish(MqttVersion::V3, &message, (Some(10), true), &mut bytes);
        assert_eq!(bytes, b"\x3b\x0a\0\x03a/b\0\x0a1.5");
        bytes.clear();
        publish(MqttVersion::V5, &message, (None, false), &mut bytes);
        assert_eq!(bytes, b"\x31\x09\0\x03a/b\x001.5");
        let read3 = |bytes: &[u8]| read(MqttVersion::V3, bytes).unwrap().map(|f| f.0);
        assert_eq!(
            read3(b"\x40\x02\x12\x34"),
            Some(Packet::Acknowledged {
                id: 0x1234,
                code: 0
            })
        );
        assert_eq!(read3(b"\xd0\0"), Some(Packet::Pong));
        assert_eq!(
            read3(b"\x90\x04\0\x01\x01\x80"),
            Some(Packet::Subscribed(vec![1, 0x80]))
        );
        assert!(matches!(
            read3(b"\x20\x02\0\x05"),
            Some(Packet::Unwanted(_))
        ));
        let welcome = b"\x20\x09\x01\0\x06\x22\0\x0a\x21\0\x14";
        let found = read(MqttVersion::V5, welcome).unwrap().unwrap();
        let expected = Welcome {
            has_session: true,
            on_the_way: 20,
            acknowledges: true,
        };
        assert_eq!(found, (Packet::Welcome(expected), welcome.len()));
        assert!(read(MqttVersion::V3, b"\xf0\0").is_err());
        assert!(read(MqttVersion::V3, b"\x30\xff\xff\xff\xff\x01").is_err());
    }

    /// What a broker passes on is read to the bit however it is cut, and what is too long by its topic and number.
    #[test]
    fn a_message_is_read_once_it_is_whole() {
        let message = Publish {
            topic: "plant/level".into(),
            payload: "x".repeat(300),
            retain: false,
        };
        for version in [MqttVersion::V3, MqttVersion::V5] {
            let mut bytes = vec![];
            publish(version, &message, (Some(7), false), &mut bytes);
            for end in 0..bytes.len() {
                assert_eq!(read(version, &bytes[..end]), Ok(None));
            }
            bytes.push(0xd0);
            let (packet, size) = read(version, &bytes).unwrap().unwrap();
            assert_eq!(size, bytes.len() - 1);
            let expected = Message {
                topic: "plant/level".into(),
                payload: Some(vec![b'x'; 300]),
                id: Some(7),
                is_retained: false,
            };
            assert_eq!(packet, Packet::Message(expected.clone()));
            let long = Publish {
                payload: "x".repeat(1_000_000),
                ..message.clone()
            };
            let mut bytes = vec![];
            publish(version, &long, (Some(7), false), &mut bytes);
            let (packet, size) = read(version, &bytes[..100_000]).unwrap().unwrap();
            assert_eq!(size, bytes.len());
            let expected = Message {
                payload: None,
                ..expected
            };
            assert_eq!(packet, Packet::Message(expected));
        }
    }
}
