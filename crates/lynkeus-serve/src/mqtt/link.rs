//! A connection to a broker.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use lynkeus::study::{MqttSettings, MqttVersion};

use super::packet::{self, Packet};
#[cfg(feature = "tls")]
use super::tls;

/// How long a connection, or a piece of what is sent, may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long it is waited for what comes, before anything else is looked at.
const LOOK: Duration = Duration::from_millis(50);
/// Seconds without a packet after which a broker gives a client up, at one and a half times.
pub(super) const KEEP_ALIVE: u16 = 30;
/// A packet is sent at least so often.
const BEAT: Duration = Duration::from_secs(15);
/// Bytes that are read at once.
const ROOM: usize = 64 << 10;

/// Where a broker is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub host: String,
    pub port: u16,
    pub is_secret: bool,
}

/// What is sent goes this way.
enum Wire {
    Plain(TcpStream),
    #[cfg(feature = "tls")]
    Secret(Box<tls::Stream>),
}

/// An open connection.
pub(super) struct Link {
    wire: Wire,
    version: MqttVersion,
    /// read, and not yet a whole packet
    read: Vec<u8>,
    /// bytes that are still to come of a packet that is too long
    skip: usize,
    /// not yet sent
    pub to: Vec<u8>,
    sent: Instant,
    heard: Instant,
}

impl Place {
    /// Of `mqtt://host`, `mqtts://host`, with or without a port.
    ///
    /// # Errors
    /// What is expected.
    pub fn read(url: &str) -> Result<Self, String> {
        let expected =
            || format!("expected \"mqtt://HOST:PORT\" or \"mqtts://HOST:PORT\", found \"{url}\"");
        let (scheme, rest) = url.split_once("://").ok_or_else(expected)?;
        let (is_secret, usual) = match scheme {
            "mqtt" | "tcp" => (false, 1883),
            "mqtts" | "ssl" | "tls" => (true, 8883),
            _ => return Err(expected()),
        };
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        if rest.contains('@') {
            return Err("the user and the password have keys of their own".to_owned());
        }
        let (host, port) = match rest.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().map_err(|_| expected())?)
            }
            _ => (rest, usual),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let is_name = !host.is_empty() && !host.contains(['/', ' ', '?', '#']);
        is_name
            .then(|| Self {
                host: host.to_owned(),
                port,
                is_secret,
            })
            .ok_or_else(expected)
    }
}

impl Link {
    /// Connects.
    ///
    /// # Errors
    /// Nobody is there, or nobody who can be trusted.
    pub fn open(settings: &MqttSettings, place: &Place) -> Result<Self, String> {
        let socket = reached(place).map_err(|error| error.to_string())?;
        let prepared = socket
            .set_nodelay(true)
            .and_then(|()| socket.set_write_timeout(Some(PATIENCE)))
            .and_then(|()| socket.set_read_timeout(Some(PATIENCE)));
        prepared.map_err(|error| error.to_string())?;
        let wire = match place.is_secret {
            false => Wire::Plain(socket),
            #[cfg(feature = "tls")]
            true => Wire::Secret(Box::new(tls::stream(settings, &place.host, socket)?)),
            #[cfg(not(feature = "tls"))]
            true => return Err("this program was built without TLS".to_owned()),
        };
        wire.socket()
            .set_read_timeout(Some(LOOK))
            .map_err(|error| error.to_string())?;
        Ok(Self {
            wire,
            version: settings.version,
            read: vec![],
            skip: 0,
            to: vec![],
            sent: Instant::now(),
            heard: Instant::now(),
        })
    }

    /// The packets that came, none where there were none for a moment.
    ///
    /// # Errors
    /// The connection is lost.
    pub fn receive(&mut self) -> Result<Vec<Packet>, String> {
        let mut room = [0; ROOM];
        let count = match self.wire.read(&mut room) {
            Ok(0) => return Err("the broker ended the connection".to_owned()),
            Ok(count) => count,
            Err(error) if is_a_pause(&error) => return self.beat().map(|()| vec![]),
            Err(error) => return Err(error.to_string()),
        };
        self.heard = Instant::now();
        // a broker counts what it gets, however much it sends
        if self.sent.elapsed() > BEAT {
            packet::ping(&mut self.to);
            self.flush()?;
        }
        let skipped = count.min(self.skip);
        self.skip -= skipped;
        self.read.extend_from_slice(&room[skipped..count]);
        let mut packets = vec![];
        let mut done = 0;
        while let Some((packet, size)) = packet::read(self.version, &self.read[done..])? {
            packets.push(packet);
            done += size;
            if done > self.read.len() {
                self.skip = done - self.read.len();
                done = self.read.len();
            }
        }
        self.read.drain(..done);
        Ok(packets)
    }

    /// Says that it is there, and hears whether the broker is.
    fn beat(&mut self) -> Result<(), String> {
        let silence = self.heard.elapsed();
        if silence > Duration::from_secs(u64::from(KEEP_ALIVE)) {
            return Err(format!(
                "the broker said nothing for {} s",
                silence.as_secs()
            ));
        }
        if self.sent.elapsed() > BEAT || silence > BEAT && self.sent.elapsed() > BEAT / 4 {
            packet::ping(&mut self.to);
        }
        self.flush()
    }

    /// Sends what was written.
    ///
    /// # Errors
    /// The connection is lost.
    pub fn flush(&mut self) -> Result<(), String> {
        if self.to.is_empty() {
            return Ok(());
        }
        let done = self
            .wire
            .write_all(&self.to)
            .and_then(|()| self.wire.flush());
        self.to.clear();
        self.sent = Instant::now();
        done.map_err(|error| match is_a_pause(&error) {
            true => "the broker does not read".to_owned(),
            false => error.to_string(),
        })
    }
}

/// Nothing came for now.
fn is_a_pause(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

/// The first address of a name at which somebody answers.
fn reached(place: &Place) -> io::Result<TcpStream> {
    let mut last = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in (place.host.as_str(), place.port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(socket) => return Ok(socket),
            Err(error) => last = error,
        }
    }
    Err(last)
}

impl Wire {
    fn socket(&self) -> &TcpStream {
        match self {
            Self::Plain(socket) => socket,
            #[cfg(feature = "tls")]
            Self::Secret(stream) => &stream.sock,
        }
    }
}

impl Read for Wire {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(socket) => socket.read(to),
            #[cfg(feature = "tls")]
            Self::Secret(stream) => stream.read(to),
        }
    }
}

impl Write for Wire {
    fn write(&mut self, from: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(socket) => socket.write(from),
            #[cfg(feature = "tls")]
            Self::Secret(stream) => stream.write(from),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(socket) => socket.flush(),
            #[cfg(feature = "tls")]
            Self::Secret(stream) => stream.flush(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_has_a_name_and_a_port() {
        let place = |url: &str| Place::read(url).map(|p| (p.host, p.port, p.is_secret));
        assert_eq!(place("mqtt://broker"), Ok(("broker".into(), 1883, false)));
        assert_eq!(
            place("mqtts://10.0.0.1/"),
            Ok(("10.0.0.1".into(), 8883, true))
        );
        assert_eq!(place("mqtt://[::1]:99"), Ok(("::1".into(), 99, false)));
        assert_eq!(place("mqtt://[::1]"), Ok(("::1".into(), 1883, false)));
        for wrong in [
            "broker:1883",
            "http://a",
            "mqtt://",
            "mqtt://a:b",
            "mqtt://u:p@a",
            "mqtt://a/b",
        ] {
            assert!(place(wrong).is_err(), "{wrong}");
        }
    }

    /// Where messages come without a pause and nothing is published, a broker would give the client up.
    #[test]
    fn it_gives_a_sign_of_life_while_messages_come() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut link = Link {
            wire: Wire::Plain(TcpStream::connect(listener.local_addr().unwrap()).unwrap()),
            version: MqttVersion::V3,
            read: vec![],
            skip: 0,
            to: vec![],
            sent: Instant::now().checked_sub(2 * BEAT).unwrap(),
            heard: Instant::now(),
        };
        let (mut broker, _) = listener.accept().unwrap();
        let mut read = || {
            broker.write_all(b"\x30\x04\0\x01ta").unwrap();
            let mut ping = [0; 2];
            let packets = link.receive().unwrap();
            assert!(matches!(packets[..], [Packet::Message(_)]), "{packets:?}");
            broker.set_nonblocking(true).unwrap();
            let sent = broker.read(&mut ping).ok().map(|_| ping);
            broker.set_nonblocking(false).unwrap();
            sent
        };
        assert_eq!(read(), Some([0xc0, 0]));
        assert_eq!(read(), None);
    }
}
