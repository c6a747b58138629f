//! The page of a service in a browser without a window.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::json;

use super::page::{folder_with, port};
use super::process::Serving;
use super::*;
use crate::report::browser::{DRIVER, browser};

/// A browser that is asked.
struct Browser {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// None where there is no browser.
    fn new(folder: &Folder) -> Option<Self> {
        let browser = browser()?;
        let profile = tempfile::tempdir().unwrap();
        folder.write("driver.mjs", DRIVER);
        folder.write("live.mjs", include_str!("live.mjs"));
        let mut child = Command::new("node")
            .args(["live.mjs", browser])
            .arg(profile.path())
            .current_dir(folder.path.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        Some(Self {
            input: child.stdin.take().unwrap(),
            output: BufReader::new(child.stdout.take().unwrap()),
            child,
            _profile: profile,
        })
    }

    fn ask(&mut self, what: &Value) -> Value {
        writeln!(self.input, "{what}").unwrap();
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).unwrap();
        assert!(answer["failed"].is_null(), "{what}: {}", answer["failed"]);
        answer["found"].clone()
    }

    fn open(&mut self, url: &str) {
        self.ask(&json!({ "open": url }));
    }

    fn value(&mut self, expression: &str) -> Value {
        self.ask(&json!({ "value": expression }))
    }

    fn until(&mut self, expression: &str) -> Value {
        self.ask(&json!({ "until": expression }))
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Points of a chart that have the colour of the estimate, by chart.
const PAINTED: &str = "charts.map((plot) => {
    const { width, height } = plot.ctx.canvas;
    const pixels = plot.ctx.getImageData(0, 0, width, height).data;
    const wanted = [1, 3, 5].map((k) => parseInt(css('--estimate').slice(k, k + 2), 16));
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
        count += pixels[i + 3] > 128 && wanted.every((v, k) => Math.abs(pixels[i + k] - v) < 8);
    }
    return count;
})";

/// It renders, follows, comes back after a restart of the service, and asks nobody else for anything.
#[test]
fn the_page_follows_in_a_browser() {
    let port = port();
    let folder = folder_with(
        port,
        "token = \"s3cret\"\nstate = \"tank.state\"\nwait = 10",
    );
    let Some(mut browser) = Browser::new(&folder) else {
        return;
    };
    let rows = rows(71, 60, false);
    let mut serving = Serving::new(&folder, "json", "");
    let send = |serving: &mut Serving, rows: &[Row]| {
        serving.send(&json(rows));
        rows.iter().for_each(|_| drop(serving.answer().unwrap()));
    };
    send(&mut serving, &rows[..40]);
    let at = |row: &Row| {
        format!(
            "document.getElementById('status').textContent === 'row at ' + {:?}",
            row.t
        )
    };
    browser.open(&format!("http://127.0.0.1:{port}/?token=s3cret"));
    browser.until(&at(&rows[39]));
    let painted = browser.value(PAINTED);
    let painted: Vec<u64> = painted
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_u64().unwrap())
        .collect();
    assert!(
        painted.len() >= 2 && painted[..2].iter().all(|count| *count > 50),
        "{painted:?}"
    );
    assert_eq!(browser.value("rows.length"), 40);
    assert_eq!(browser.value("byId('verdict').textContent"), "credible");
    assert_eq!(browser.value("innovations.length"), 2);
    let judged = browser.value("Array.from(innovations[0].data[3])");
    let judged = judged
        .as_array()
        .unwrap()
        .iter()
        .filter(|x| x.is_number())
        .count();
    assert_eq!(judged, 40);
    let now = browser.value("byId('now').textContent");
    assert!(now.as_str().unwrap().contains("inside"), "{now}");
    // another tuning, on a copy: the same rows and the same estimates where it is the same
    for (key, value, words) in [
        ("noise", "1", "credible in 40 of 40 rows"),
        ("noise", "-1", "expected"),
        ("poles", "2", "poles"),
    ] {
        browser.value(&format!("(byId('key').append(new Option('{key}', '{key}')), byId('key').value = '{key}', byId('value').value = '{value}', byId('tried').textContent = '…', byId('trial').requestSubmit ? void attempt(new Event('submit')) : 0)"));
        let said = browser.until("byId('tried').textContent !== '…' && byId('tried').textContent");
        assert!(
            said.as_str().unwrap().contains(words),
            "{key} {value}: {said}"
        );
        if value == "1" {
            let same = "JSON.stringify(Array.from(trials[0].data[3])) === JSON.stringify(Array.from(trials[0].data[4]))";
            assert_eq!(browser.value(same), true);
        }
    }
    browser.until("byId('proved').textContent.length > 20");
    // what is told is what is drawn
    send(&mut serving, &rows[40..50]);
    browser.until(&at(&rows[49]));
    let drawn = browser.value("Array.from(charts[0].data[charts[0].data.length - 1])");
    let expected = estimated(&folder, &rows[..50]);
    let expected: Vec<f64> = rows[..50]
        .iter()
        .map(|row| f64::from_bits(expected[&row.t.to_bits()]["level_hat"]))
        .collect();
    assert_eq!(drawn, json!(expected));
    // after a restart it comes back by itself
    serving.kill();
    browser.until("byId('status').textContent === 'no connection; trying again'");
    // where something else answers meanwhile, such as a proxy, too
    let proxy = std::net::TcpListener::bind(("127.0.0.1", port)).unwrap();
    let (mut asked, _) = proxy.accept().unwrap();
    let answer = b"HTTP/1.1 502 Bad Gateway\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    asked.write_all(answer).unwrap();
    browser.until("source.readyState === EventSource.CLOSED");
    drop((asked, proxy));
    let mut serving = Serving::new(&folder, "json", "");
    send(&mut serving, &rows[50..]);
    browser.until(&at(&rows[59]));
    let seen = browser.ask(&json!({ "seen": true }));
    let own = format!("http://127.0.0.1:{port}/");
    let requests = seen["requests"].as_array().unwrap();
    let is_own = |url: &Value| url.as_str().unwrap().starts_with(&own);
    assert!(
        requests.len() >= 2 && requests.iter().all(is_own),
        "{requests:?}"
    );
    // but for the connection that was lost, and the two trials that were refused
    let complaints = seen["complaints"].as_array().unwrap();
    let has = |text: &Value, words: &str| text.as_str().unwrap().contains(words);
    let others = complaints
        .iter()
        .filter(|text| !has(text, "net::ERR_") && !has(text, "502"));
    let others: Vec<&Value> = others.collect();
    assert!(
        others.len() == 2 && others.iter().all(|text| has(text, "400")),
        "{others:?}"
    );
    if let Some(shots) = std::env::var_os("LYNKEUS_SHOTS") {
        for (name, width, scheme) in [("live", 1280, "light"), ("live-phone", 390, "dark")] {
            let file = std::path::Path::new(&shots).join(format!("{name}.png"));
            browser.ask(&json!({ "shot": file, "width": width, "scheme": scheme }));
        }
    }
    // a wrong token sees nothing
    browser.open(&format!("http://127.0.0.1:{port}/?token=s3cre"));
    assert_eq!(
        browser.value("document.body.textContent"),
        "a token is needed\n"
    );
}
