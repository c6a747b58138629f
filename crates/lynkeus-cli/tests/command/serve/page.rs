//! Who looks: the page, its events, the last estimates and the counters, over HTTP.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use super::process::Serving;
use super::*;

/// A port that is free.
pub(super) fn port() -> u16 {
    TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

/// What a request is answered with, once the service listens.
fn asked(port: u16, request: &[u8]) -> String {
    let began = Instant::now();
    let mut to = loop {
        match TcpStream::connect(("127.0.0.1", port)) {
            Ok(to) => break to,
            Err(error) => assert!(began.elapsed() < Duration::from_secs(60), "{error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    to.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    // a request that is too long is not read to its end
    let _ = to.write_all(request);
    let mut answer = vec![];
    let _ = to.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(port: u16, path: &str, more: &str) -> String {
    asked(
        port,
        format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n{more}\r\n").as_bytes(),
    )
}

fn body(answer: &str) -> &str {
    answer.split_once("\r\n\r\n").unwrap().1
}

pub(super) fn folder_with(port: u16, more: &str) -> Folder {
    folder(
        "ekf",
        &format!("[estimate]\nsd = true\n[serve]\nhttp = \"127.0.0.1:{port}\"\n{more}"),
    )
}

#[test]
fn what_was_told_last_is_there_to_look_at() {
    let port = port();
    let folder = folder_with(port, "");
    let rows = rows(41, 6, false);
    let mut serving = Serving::new(&folder, "json", "");
    serving.send(&json(&rows[..5]));
    serving.send("{\"t\":oops}\n");
    let told: Vec<String> = (0..6).map(|_| serving.answer().unwrap()).collect();
    let page = get(port, "/", "");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    assert!(page.contains("default-src 'none'"));
    assert!(page.contains("\"header\":\"level_hat\""));
    // nothing is loaded from elsewhere
    for from in ["src=", "href=", "@import", "url("] {
        assert!(!body(&page).contains(from), "{from}");
    }
    let estimates: Value = serde_json::from_str(body(&get(port, "/estimates", ""))).unwrap();
    assert_eq!(
        estimates[""],
        serde_json::from_str::<Value>(&told[4]).unwrap()
    );
    let metrics = get(port, "/metrics", "");
    for line in [
        "lynkeus_rows_total 5",
        "lynkeus_refused_total 1",
        "lynkeus_credible 1",
    ] {
        assert!(metrics.lines().any(|found| found == line), "{metrics}");
    }
    let level = &estimates[""]["level_hat"];
    let own = format!("lynkeus_estimate{{quantity=\"level\"}} {level}");
    assert!(
        metrics.lines().any(|found| found == own),
        "{own}\n{metrics}"
    );
    // events: what was told, then what is told
    let mut events = TcpStream::connect(("127.0.0.1", port)).unwrap();
    events
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    events
        .write_all(b"GET /events?asset= HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .unwrap();
    let mut heard = String::new();
    let mut room = [0; 4096];
    let mut hear = |count: usize| {
        while heard.matches("data: ").count() < count || !heard.ends_with("\n\n") {
            let read = events.read(&mut room).unwrap();
            assert!(read > 0, "{heard}");
            heard += std::str::from_utf8(&room[..read]).unwrap();
        }
        heard.clone()
    };
    hear(5);
    serving.send(&rows[5].json());
    let line = serving.answer().unwrap();
    assert!(hear(6).ends_with(&format!("data: {line}\n\n")));
}

#[test]
fn a_wrong_token_gets_nothing() {
    let port = port();
    let folder = folder_with(port, "token = \"s3cret\"");
    let mut serving = Serving::new(&folder, "json", "");
    serving.send(&json(&rows(42, 1, false)));
    serving.answer().unwrap();
    for path in [
        "/",
        "/metrics",
        "/estimates",
        "/events?asset=",
        "/?token=s3cre",
        "/?token=s3crets",
        "/nothing",
    ] {
        let answer = get(port, path, "");
        assert!(answer.starts_with("HTTP/1.1 401 "), "{path}: {answer}");
        assert_eq!(body(&answer), "a token is needed\n");
    }
    assert!(get(port, "/estimates?token=s3cret", "").contains("level_hat"));
    assert!(
        get(port, "/metrics", "Authorization: Bearer s3cret\r\n").contains("lynkeus_credible 1")
    );
    drop(serving);
    let open = self::folder("ekf", "[serve]\nhttp = \"0.0.0.0:0\"");
    let ended = served(&open, "json", "");
    assert!(
        ended.code == 2 && ended.err.contains("other machines can reach it"),
        "{}",
        ended.err
    );
}

/// A trial is a copy: what the estimator tells is as it was.
#[test]
fn a_trial_of_another_tuning_changes_nothing() {
    let port = port();
    let folder = folder_with(port, "token = \"s3cret\"");
    let rows = rows(44, 30, true);
    let mut serving = Serving::new(&folder, "json", "");
    serving.send(&json(&rows[..20]));
    let mut told: Vec<Value> = (0..20)
        .map(|_| serde_json::from_str(&serving.answer().unwrap()).unwrap())
        .collect();
    let post = |query: &str| {
        let request =
            format!("POST /try?{query} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n");
        asked(port, request.as_bytes())
    };
    assert!(post("asset=&key=noise&value=2").starts_with("HTTP/1.1 401 "));
    assert!(
        get(port, "/try?token=s3cret&asset=&key=noise&value=2", "").starts_with("HTTP/1.1 405 ")
    );
    let found: Value =
        serde_json::from_str(body(&post("token=s3cret&asset=&key=noise&value=2"))).unwrap();
    // as a study with that noise gives it
    let other = folder_with(port, "");
    other.change("study.toml", "y = 0.1, a = 0.1", "y = 0.2, a = 0.2");
    for (folder, name) in [(&folder, "present"), (&other, "tried")] {
        let expected = estimated(folder, &rows[..20]);
        for (row, x) in rows
            .iter()
            .zip(found[name]["level_hat"].as_array().unwrap())
        {
            assert_eq!(
                expected[&row.t.to_bits()]["level_hat"],
                x.as_f64().unwrap().to_bits(),
                "{name}"
            );
        }
    }
    for wrong in [
        "asset=&key=noise",
        "asset=&key=noise&value=nan",
        "asset=b&key=noise&value=1",
        "asset=&key=..%2Fx&value=1",
        "asset=&key=theta&value=2",
    ] {
        let answer = post(&format!("token=s3cret&{wrong}"));
        assert!(answer.starts_with("HTTP/1.1 400 "), "{wrong}: {answer}");
    }
    serving.send(&json(&rows[20..]));
    told.extend(
        (20..30).map(|_| -> Value { serde_json::from_str(&serving.answer().unwrap()).unwrap() }),
    );
    assert!(last(&told) == estimated(&folder, &rows));
}

/// Sizes, names, bytes and paths that nobody should send.
#[test]
fn hostile_requests_change_nothing() {
    let port = port();
    let folder = folder_with(port, "");
    let mut serving = Serving::new(&folder, "json", "");
    let rows = rows(43, 20, true);
    let mut told = vec![];
    let mut random = Normal(43);
    for row in &rows {
        serving.send(&row.json());
        told.push(serde_json::from_str(&serving.answer().unwrap()).unwrap());
        for k in 0..50 {
            let number = (random.uniform() * 1e6) as usize;
            let request: Vec<u8> = match k % 10 {
                0 => b"GET /../../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(),
                1 => format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(number % 20_000)).into_bytes(),
                2 => format!("POST /estimates HTTP/1.1\r\nHost: localhost\r\nContent-Length: {number}\r\n\r\n").into_bytes(),
                3 => (0..number % 300).map(|_| (random.uniform() * 256.0) as u8).chain(*b"\r\n\r\n").collect(),
                4 => b"GET /estimates?asset=%ff%00%zz&asset HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(),
                5 => b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_vec(),
                6 => format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(number % 2000)).into_bytes(),
                7 => b"DELETE /events HTTP/9.9\r\nHost: localhost\r\n\r\n".to_vec(),
                8 => b"GET /events?asset=..%2F..%2Fetc HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec(),
                _ => b"\r\n\r\n".to_vec(),
            };
            let answer = asked(port, &request);
            assert!(!answer.contains("root:"), "{answer}");
            if [0, 2, 5, 8].contains(&(k % 10)) {
                let status: u16 = answer[9..12].parse().unwrap();
                assert!((400..500).contains(&status), "{answer}");
            }
        }
    }
    assert!(last(&told) == estimated(&folder, &rows));
    assert!(get(port, "/metrics", "").contains("lynkeus_rows_total 20\n"));
    assert_eq!(serving.end().code, 0);
}
