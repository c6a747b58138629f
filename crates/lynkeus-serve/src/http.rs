//! A page, its events, the last estimates and counters, over HTTP: to look at, never to change anything.
//!
//! One request of a connection, a few fixed paths, `GET` alone but for a trial of another tuning, which is a copy:
//! there is nothing that leads to a file.

use std::io::{self, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use lynkeus::{Error, report_parts as parts, tune, visible};
use serde_json::json;

use crate::board::{Board, Heard, Shown};
use crate::sandbox;

/// Bytes of a request, at most.
const LONGEST: usize = 8 << 10;
const HEADERS: usize = 64;
/// Connections at once.
const CONNECTIONS: usize = 64;
/// How long a request, or a piece of an answer, may take.
const PATIENCE: Duration = Duration::from_secs(5);
/// Where nothing is told a listener hears so often that the service is there.
const BEAT: Duration = Duration::from_secs(10);

const SCRIPT: &str = include_str!("../assets/live.js");

/// What is asked for.
struct Request {
    path: String,
    query: Vec<(String, String)>,
    bearer: Option<String>,
    host: Option<String>,
    is_get: bool,
}

/// Who answers.
struct Server {
    board: Arc<Board>,
    token: Option<String>,
    open: AtomicUsize,
    /// whoever tries another tuning has it
    trial: Mutex<()>,
}

/// Answers at this address, from threads of its own, until the program ends; the address, with its port.
///
/// # Errors
/// The address is none, or taken; it can be reached from other machines, and there is no token.
pub fn listen(
    address: &str,
    token: Option<String>,
    board: Arc<Board>,
) -> Result<SocketAddr, Error> {
    let refuse = |why: String| Error::input(format!("`http` of [serve] = \"{address}\": {why}"));
    let parsed: SocketAddr = address
        .parse()
        .map_err(|_| refuse("expected an address and a port, such as 127.0.0.1:8080".to_owned()))?;
    if !parsed.ip().is_loopback() && token.is_none() {
        return Err(refuse("other machines can reach it".to_owned())
            .hint("add `token` to [serve], or listen at 127.0.0.1"));
    }
    let listener = TcpListener::bind(parsed).map_err(|error| refuse(error.to_string()))?;
    let own = listener
        .local_addr()
        .map_err(|error| refuse(error.to_string()))?;
    let server = Arc::new(Server {
        board,
        token,
        open: AtomicUsize::new(0),
        trial: Mutex::new(()),
    });
    thread::spawn(move || {
        for connection in listener.incoming().flatten() {
            let server = Arc::clone(&server);
            if server.open.fetch_add(1, Ordering::SeqCst) >= CONNECTIONS {
                server.open.fetch_sub(1, Ordering::SeqCst);
                continue;
            }
            let spawned = thread::Builder::new().spawn({
                let server = Arc::clone(&server);
                move || {
                    // who goes away in the middle is no concern of ours
                    let _ = server.answer(connection);
                    server.open.fetch_sub(1, Ordering::SeqCst);
                }
            });
            if spawned.is_err() {
                server.open.fetch_sub(1, Ordering::SeqCst);
            }
        }
    });
    Ok(own)
}

impl Server {
    fn answer(&self, mut to: TcpStream) -> io::Result<()> {
        to.set_read_timeout(Some(PATIENCE))?;
        to.set_write_timeout(Some(PATIENCE))?;
        let Some(request) = read(&mut to)? else {
            return send(&mut to, "400 Bad Request", "text/plain", "no request\n");
        };
        if !self.may(&request) {
            return send(
                &mut to,
                "401 Unauthorized",
                "text/plain",
                "a token is needed\n",
            );
        }
        let is_trial = request.path == "/try";
        if request.is_get == is_trial {
            return send(
                &mut to,
                "405 Method Not Allowed",
                "text/plain",
                if is_trial {
                    "POST alone\n"
                } else {
                    "GET alone\n"
                },
            );
        }
        let asset = request.asked("asset").unwrap_or_default();
        let place = self.board.names().iter().position(|name| name == asset);
        match request.path.as_str() {
            "/" => send(&mut to, "200 OK", "text/html; charset=utf-8", &self.page()),
            "/metrics" => send(
                &mut to,
                "200 OK",
                "text/plain; version=0.0.4; charset=utf-8",
                &self.board.metrics(),
            ),
            "/estimates" => {
                let only = request.asked("asset").map(|_| place.unwrap_or(usize::MAX));
                let body = self.board.estimates(only);
                send(&mut to, "200 OK", "application/json", &body)
            }
            "/proved" => match self.board.proved() {
                Some(text) => send(&mut to, "200 OK", "text/html; charset=utf-8", text),
                None => send(&mut to, "404 Not Found", "text/plain", "not known so far\n"),
            },
            "/try" => {
                let (status, body) = self.trial(&request, place);
                send(&mut to, status, "application/json", &body)
            }
            "/events" => match place {
                Some(place) => {
                    self.events(&mut to, place, request.asked("with") == Some("innovations"))
                }
                None => send(&mut to, "404 Not Found", "text/plain", "no such asset\n"),
            },
            _ => send(&mut to, "404 Not Found", "text/plain", "nothing is here\n"),
        }
    }

    /// Whether somebody may look.
    fn may(&self, request: &Request) -> bool {
        match &self.token {
            Some(token) => {
                let given = request.bearer.as_deref().or(request.asked("token"));
                given.is_some_and(|given| is_same(given.as_bytes(), token.as_bytes()))
            }
            // a name that leads here from elsewhere is none of ours
            None => request.host.as_deref().is_none_or(|host| {
                let name = match host.rsplit_once(':') {
                    Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
                    _ => host,
                };
                let name = name.trim_start_matches('[').trim_end_matches(']');
                name == "localhost" || name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
            }),
        }
    }

    fn page(&self) -> String {
        let stream = self.board.stream();
        let told = stream.estimates.iter().map(|told| {
            json!({
                "name": told.name, "header": told.header, "deviation": told.deviation,
                "unit": told.unit, "description": told.description,
                // an end that is infinite is none
                "range": [told.range.0, told.range.1],
            })
        });
        let sensors = stream.channels.iter().filter(|channel| channel.is_sensor);
        let data = json!({
            "time": stream.told_time,
            "assets": self.board.names(),
            "told": told.collect::<Vec<_>>(),
            "sensors": sensors.map(|sensor| &sensor.name).collect::<Vec<_>>(),
            "keys": tune::usual(stream.study()),
        });
        // no text of a study ends the element
        let data = data.to_string().replace('<', "\\u003c");
        let (style, plot_style, script) = (parts::STYLE, parts::PLOT_STYLE, SCRIPT);
        let (plot, license) = (parts::PLOT, parts::PLOT_LICENSE);
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Estimates</title>\n<style>\n{plot_style}\n{style}\n</style>\n</head>\n<body>\n<h1>Estimates</h1>\n<p class=\"lead\"><select id=\"asset\"></select> <span id=\"verdict\" class=\"verdict\">…</span> <span id=\"status\">connecting</span></p>\n<ul id=\"notes\"></ul>\n<div class=\"wide\"><table id=\"now\"></table></div>\n<div id=\"charts\"></div>\n<h2>Innovations</h2>\n<p>Reading less expectation, in its standard deviations: of a sound estimate 95 of 100 are within \u{b1} 2.</p>\n<div id=\"innovations\"></div>\n<h2>Another tuning</h2>\n<form id=\"trial\"><select id=\"key\"></select> <input id=\"value\" type=\"number\" step=\"any\" min=\"0\" value=\"2\"> <button>Try on the last rows</button> <span id=\"tried\"></span></form>\n<div id=\"trials\"></div>\n<h2>What is proved</h2>\n<div id=\"proved\">not known so far</div>\n<script type=\"application/json\" id=\"data\">{data}</script>\n<script>\n/*\n{license}*/\n{plot}\n</script>\n<script>\n{script}\n</script>\n</body>\n</html>\n"
        )
    }

    /// What another tuning would have told.
    fn trial(&self, request: &Request, asset: Option<usize>) -> (&'static str, String) {
        let refuse = |why: &str| ("400 Bad Request", format!("{}\n", json!({ "error": why })));
        let Some(asset) = asset else {
            return refuse("no such asset");
        };
        let value = request.asked("value").and_then(|value| value.parse().ok());
        let value = value.filter(|value: &f64| value.is_finite() && *value > 0.0);
        let (Some(key), Some(value)) = (request.asked("key"), value) else {
            return refuse("expected a `key` of [tune] and a `value` > 0");
        };
        // a design may take all there is of a processor
        let Ok(_own) = self.trial.try_lock() else {
            return (
                "503 Service Unavailable",
                "{\"error\":\"another trial is under way\"}\n".to_owned(),
            );
        };
        match sandbox::tried(self.board.stream(), self.board.rows(asset), (key, value)) {
            Ok(found) => ("200 OK", format!("{found}\n")),
            Err(error) => refuse(&visible::line(error.message())),
        }
    }

    /// Server-sent events: the lines that are kept, then each as it is told.
    fn events(&self, to: &mut TcpStream, asset: usize, with_innovations: bool) -> io::Result<()> {
        let Some(Heard { before, lines }) = self.board.listen(asset) else {
            return send(
                to,
                "503 Service Unavailable",
                "text/plain",
                "too many listen\n",
            );
        };
        let head = format!("HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n{COMMON}\r\n");
        let mut text = head + "retry: 2000\n\n";
        let event = |shown: Shown| {
            let Shown { line, innovations } = shown;
            match innovations.filter(|_| with_innovations) {
                Some(own) => format!("data: {line}\n\nevent: innovations\ndata: {own}\n\n"),
                None => format!("data: {line}\n\n"),
            }
        };
        for shown in before {
            text += &event(shown);
        }
        to.write_all(text.as_bytes())?;
        loop {
            match lines.recv_timeout(BEAT) {
                Ok(shown) => to.write_all(event(shown).as_bytes())?,
                Err(RecvTimeoutError::Timeout) => to.write_all(b":\n\n")?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    }
}

impl Request {
    /// What the query says under a name.
    fn asked(&self, name: &str) -> Option<&str> {
        let mut own = self.query.iter().filter(|(key, _)| key == name);
        own.next().map(|(_, value)| value.as_str())
    }
}

/// Reads the head of a request; none where it is none.
fn read(from: &mut TcpStream) -> io::Result<Option<Request>> {
    let began = Instant::now();
    let mut bytes = vec![];
    let mut room = [0; 1024];
    while !bytes.windows(4).any(|end| end == b"\r\n\r\n") {
        let count = from.read(&mut room)?;
        bytes.extend_from_slice(&room[..count]);
        if count == 0 || bytes.len() > LONGEST || began.elapsed() > PATIENCE {
            return Ok(None);
        }
    }
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut head = httparse::Request::new(&mut headers);
    if !head.parse(&bytes).is_ok_and(|status| status.is_complete()) {
        return Ok(None);
    }
    let header = |name: &str| {
        let mut own = head
            .headers
            .iter()
            .filter(|h| h.name.eq_ignore_ascii_case(name));
        own.next().and_then(|h| std::str::from_utf8(h.value).ok())
    };
    let bearer = header("authorization").and_then(|value| value.strip_prefix("Bearer "));
    let target = head.path.unwrap_or_default();
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let query = query.split('&').filter_map(|pair| pair.split_once('='));
    Ok(Some(Request {
        path: path.to_owned(),
        query: query
            .map(|(key, value)| (decoded(key), decoded(value)))
            .collect(),
        bearer: bearer.map(|token| token.trim().to_owned()),
        host: header("host").map(|host| host.trim().to_owned()),
        is_get: head.method == Some("GET"),
    }))
}

/// `%41` and `+` of a query.
fn decoded(text: &str) -> String {
    let mut bytes = vec![];
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let hex = |two: &[u8]| u8::from_str_radix(std::str::from_utf8(two).ok()?, 16).ok();
        let coded = after.get(..2).filter(|_| *first == b'%').and_then(hex);
        bytes.push(match (coded, *first) {
            (Some(byte), _) => byte,
            (None, b'+') => b' ',
            (None, other) => other,
        });
        rest = &after[if coded.is_some() { 2 } else { 0 }..];
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Nothing is loaded from elsewhere, kept, or shown within another page.
const COMMON: &str = "Cache-Control: no-store\r\nConnection: close\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nContent-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'\r\n";

fn send(to: &mut TcpStream, status: &str, kind: &str, body: &str) -> io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{COMMON}\r\n"
    );
    to.write_all(head.as_bytes())?;
    to.write_all(body.as_bytes())
}

/// Whether texts are equal, in a time that does not say where they differ.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    let differ = one
        .iter()
        .zip(other)
        .fold(0, |found, (a, b)| found | (a ^ b));
    one.len() == other.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_decoded() {
        assert_eq!(decoded("tank%2B1+a%"), "tank+1 a%");
        assert_eq!(decoded("%zz%C3%A4"), "%zzä");
        assert!(is_same(b"abc", b"abc") && !is_same(b"abc", b"abd") && !is_same(b"", b"a"));
    }
}
