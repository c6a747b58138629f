//! Node-RED, from npm, reads and shows an estimate by the flow of the documentation.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::broker::{Broker, Client};
use super::page::port;
use super::process::Serving;
use super::*;
use crate::skipped;

const PAGE: &str = include_str!("../../../../../docs/serve.md");
const NODE_RED: &str = "node-red@4.1.15";
const LIMIT: Duration = Duration::from_secs(60);

/// The flow that the documentation shows.
fn flow() -> &'static str {
    let (_, rest) = PAGE.split_once("## Node-RED").unwrap();
    let (_, rest) = rest.split_once("```json\n").unwrap();
    rest.split_once("```").unwrap().0
}

/// What is there at a path; none where nobody answers.
fn got(port: u16, path: &str) -> Option<Value> {
    let mut to = TcpStream::connect(("127.0.0.1", port)).ok()?;
    let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    to.write_all(request.as_bytes()).ok()?;
    let mut answer = String::new();
    to.read_to_string(&mut answer).ok()?;
    let (_, body) = answer.split_once("\r\n\r\n")?;
    serde_json::from_str(body).ok()
}

/// Ends with what it is part of.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[ignore = "installs Node-RED from npm"]
fn node_red_shows_an_estimate() {
    let Some(broker) = Broker::new("") else {
        return;
    };
    let folder = folder(
        "ekf",
        &format!(
            "[estimate]\nsd = true\n[serve.mqtt]\nurl = \"mqtt://localhost:{}\"\nrows = \"plant/tank/rows\"\npublish = \"plant/tank/estimates\"",
            broker.port
        ),
    );
    let mut install = Command::new("npm");
    let install = install
        .args([
            "install",
            "--no-audit",
            "--no-fund",
            "--prefix",
            ".",
            NODE_RED,
        ])
        .current_dir(folder.path.path())
        .stdout(Stdio::null());
    if !install.status().is_ok_and(|status| status.success()) {
        skipped("npm cannot install Node-RED");
        return;
    }
    let port = port();
    let text = flow()
        .replace("1883", &broker.port.to_string())
        .replace("upper_", "level_");
    folder.write("flows.json", &text);
    let node_red = Command::new("node_modules/.bin/node-red")
        .args(["-u", ".", "-p", &port.to_string(), "flows.json"])
        .current_dir(folder.path.path())
        .stdout(Stdio::null())
        .spawn();
    let _node_red = Ends(node_red.unwrap());
    let rows = rows(73, 20, false);
    let expected = estimated(&folder, &rows);
    let mut client = Client::new(&folder, broker.port, "plant/tank/estimates", None);
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    let began = Instant::now();
    while got(port, "/tank").is_none() {
        assert!(began.elapsed() < LIMIT, "Node-RED does not answer");
        thread::sleep(Duration::from_millis(100));
    }
    // it may still be on its way to the broker
    thread::sleep(Duration::from_secs(2));
    for row in &rows {
        client.publish("plant/tank/rows", row.json().trim());
    }
    let last = rows.last().unwrap().t;
    let shown = loop {
        match got(port, "/tank") {
            Some(line) if line["t"] == last => break line,
            other => assert!(began.elapsed() < 2 * LIMIT, "{other:?}"),
        }
        thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(told(&shown), expected[&last.to_bits()]);
    serving.stop();
}
