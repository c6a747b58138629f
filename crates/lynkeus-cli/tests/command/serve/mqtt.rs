//! Rows from topics of a broker, and estimates to one: they equal what `estimate` makes of the same rows.

use super::broker::{Broker, Client, has_mosquitto};
use super::process::Serving;
use super::*;

/// A study whose rows come by topic.
fn folder_at(port: u16, more: &str, serve: &str) -> Folder {
    folder(
        "ekf",
        &format!(
            "[estimate]\nsd = true\n[serve]\nstate = \"tank.state\"\n{serve}\n[serve.mqtt]\nurl = \"mqtt://localhost:{port}\"\nclient = \"tank-{port}\"\ntopics = {{ y = \"plant/y\", a = \"plant/a\", u = \"plant/u\" }}\nrows = \"plant/rows\"\npublish = \"plant/estimates\"\n{more}"
        ),
    )
}

/// The messages that a row is: topic and payload.
fn messages(row: &Row) -> Vec<(&'static str, String)> {
    let all = [
        ("plant/u", Some(row.u)),
        ("plant/y", row.y),
        ("plant/a", row.a),
    ];
    let t = row.t;
    let one = |(topic, x): (&'static str, Option<f64>)| {
        Some((topic, format!("{{\"value\":{:?},\"t\":{t:?}}}", x?)))
    };
    all.into_iter().filter_map(one).collect()
}

/// Hears until what was told last of each row is what is expected; the lines.
fn heard_until(client: &mut Client, expected: &BTreeMap<u64, Told>) -> Vec<Value> {
    let mut lines: Vec<Value> = vec![];
    let mut found: BTreeMap<u64, Told> = BTreeMap::new();
    while found != *expected {
        let lacking = || {
            let lacks =
                |(t, told): (&u64, &Told)| (found.get(t) != Some(told)).then(|| f64::from_bits(*t));
            expected.iter().filter_map(lacks).collect::<Vec<f64>>()
        };
        let Some(text) = client.hear() else {
            panic!(
                "nothing more is heard, and the rows at {:?} are not right",
                lacking()
            );
        };
        let line: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
        found.insert(line["t"].as_f64().unwrap().to_bits(), told(&line));
        lines.push(line);
    }
    lines
}

/// Messages in another order, none of them more than `far` rows away, and some twice.
fn disturbed(
    messages: Vec<(&'static str, String)>,
    far: usize,
    random: &mut Normal,
) -> Vec<(&'static str, String)> {
    let mut keyed: Vec<(f64, (&'static str, String))> = vec![];
    for (place, message) in messages.into_iter().enumerate() {
        let key = |random: &mut Normal| place as f64 + far as f64 * random.uniform();
        if random.uniform() < 0.2 {
            keyed.push((key(random), message.clone()));
        }
        keyed.push((key(random), message));
    }
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    keyed.into_iter().map(|(_, message)| message).collect()
}

#[test]
fn what_comes_by_topic_gives_what_estimate_gives() {
    for (version, seed) in [("3.1.1", 61), ("5", 62)] {
        let Some(broker) = Broker::new("") else {
            return;
        };
        if version == "5" && !has_mosquitto() {
            // amqtt speaks 3.1.1 alone
            return;
        }
        let folder = folder_at(
            broker.port,
            &format!("version = \"{version}\"\nstatus = \"plant/status\""),
            "wait = 30",
        );
        let rows = rows(seed, 60, true);
        let expected = estimated(&folder, &rows);
        let mut client = Client::new(&folder, broker.port, "plant/estimates", None);
        let mut status = Client::new(&folder, broker.port, "plant/status", None);
        let serving = Serving::begin(&folder, &[], "");
        assert_eq!(status.hear().as_deref(), Some("online"));
        // the first row is there before others come earlier than it
        let mut random = Normal(seed);
        let rest = rows[1..].iter().flat_map(messages).collect();
        let rest = disturbed(rest, 8, &mut random);
        for (topic, payload) in messages(&rows[0]).into_iter().chain(rest) {
            client.publish(topic, &payload);
        }
        let lines = heard_until(&mut client, &expected);
        assert!(lines.iter().any(|line| line["revision"] != 0));
        // whole rows, once more: nothing changes
        for row in &rows[50..] {
            client.publish("plant/rows", row.json().trim());
        }
        let mut left: Vec<f64> = rows[50..].iter().map(|row| row.t).collect();
        while !left.is_empty() {
            let line: Value = serde_json::from_str(&client.hear().unwrap()).unwrap();
            let t = line["t"].as_f64().unwrap();
            assert_eq!(expected[&t.to_bits()], told(&line));
            left.retain(|own| *own != t);
        }
        serving.stop();
        assert_eq!(status.hear().as_deref(), Some("offline"));
    }
}

/// What was published is acknowledged after it is kept, so that a kill loses nothing and takes nothing twice.
fn killed(kills: usize, seed: u64) {
    if !has_mosquitto() {
        return;
    }
    let Some(broker) = Broker::new("") else {
        return;
    };
    let folder = folder_at(
        broker.port,
        "",
        "wait = 30\nhistory = \"tank-%Y-%m-%d.csv\"",
    );
    let rows = rows(seed, 20 * (kills + 1), true);
    let expected = estimated(&folder, &rows);
    let mut client = Client::new(&folder, broker.port, "plant/estimates", None);
    let mut random = Normal(seed);
    for (round, part) in rows.chunks(20).enumerate() {
        let mut serving = Serving::begin(&folder, &[], "");
        if round == 0 {
            serving.wait_for("is connected");
            client.publish("plant/rows", rows[0].json().trim());
            assert!(client.hear().is_some());
        }
        for (topic, payload) in part.iter().flat_map(messages) {
            client.publish(topic, &payload);
        }
        let wait = 200.0 * random.uniform();
        std::thread::sleep(std::time::Duration::from_millis(wait as u64));
        serving.kill();
    }
    let serving = Serving::begin(&folder, &[], "");
    heard_until(&mut client, &expected);
    serving.stop();
    // each line of the history is there once
    let mut lines: Vec<String> = vec![];
    for file in folder
        .files()
        .iter()
        .filter(|name| name.starts_with("tank-"))
    {
        let text = folder.read(file);
        let own = text.lines().skip(1).map(|line| {
            let (rest, revision) = line.rsplit_once(',').unwrap();
            format!("{} {revision}", rest.split(',').next().unwrap())
        });
        lines.extend(own);
    }
    let count = lines.len();
    assert!(count >= rows.len());
    lines.sort();
    lines.dedup();
    assert_eq!(count, lines.len());
}

#[test]
fn a_kill_loses_no_message_and_takes_none_twice() {
    killed(4, 63);
}

#[test]
#[ignore = "takes minutes"]
fn two_hundred_kills_lose_no_message_and_take_none_twice() {
    killed(200, 64);
}

#[test]
fn a_broker_that_begins_again_loses_nothing() {
    if !has_mosquitto() {
        return;
    }
    let Some(mut broker) = Broker::new("") else {
        return;
    };
    let folder = folder_at(broker.port, "version = \"5\"", "wait = 30");
    let rows = rows(65, 60, true);
    let expected = estimated(&folder, &rows);
    let mut client = Client::new(&folder, broker.port, "plant/estimates", None);
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    client.publish("plant/rows", rows[0].json().trim());
    for part in rows.chunks(20) {
        for (topic, payload) in part.iter().flat_map(messages) {
            client.publish(topic, &payload);
        }
        client.sent();
        broker.restart();
        client.is_back();
    }
    heard_until(&mut client, &expected);
    let ended = serving.stop();
    assert!(
        ended.err.contains("no connection to mqtt://localhost"),
        "{}",
        ended.err
    );
    assert!(ended.err.contains("again"), "{}", ended.err);
}

/// A bare number has the time at which it came; what a broker kept is no reading.
#[test]
fn a_bare_number_is_of_the_time_at_which_it_comes() {
    let Some(broker) = Broker::new("") else {
        return;
    };
    let folder = folder_at(broker.port, "", "");
    let mut client = Client::new(&folder, broker.port, "plant/estimates", None);
    client.retain("plant/u", "0.5");
    client.retain("plant/y", "99");
    client.sent();
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    let mut times = vec![];
    for level in ["2.0", "2.1", " 2.2 "] {
        client.publish("plant/y", level);
        let mut line: Value = serde_json::from_str(&client.hear().unwrap()).unwrap();
        while times.is_empty() && line["level_hat"] == 2.0 && line["level_sd"].as_f64() > Some(0.9)
        {
            // the row of the input alone
            line = serde_json::from_str(&client.hear().unwrap()).unwrap();
        }
        let level = line["level_hat"].as_f64().unwrap();
        assert!((1.9..2.3).contains(&level), "{line}");
        times.push(line["t"].as_str().unwrap().to_owned());
    }
    assert!(
        times.is_sorted() && times.iter().all(|t| t.ends_with('Z')),
        "{times:?}"
    );
    serving.stop();
}

/// Each asset by its level of a topic.
#[test]
fn a_level_of_a_topic_is_the_name_of_an_asset() {
    let Some(broker) = Broker::new("") else {
        return;
    };
    let folder = folder(
        "ekf",
        &format!(
            "[estimate]\nsd = true\n[serve]\nassets = \"assets.csv\"\n[serve.mqtt]\nurl = \"mqtt://localhost:{}\"\nrows = \"site/{{asset}}/rows\"\npublish = \"site/{{asset}}/estimates\"",
            broker.port
        ),
    );
    folder.write("assets.csv", "asset\none\ntwo\n");
    let mut client = Client::new(&folder, broker.port, "site/+/estimates", None);
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    let rows = rows(66, 10, true);
    let alone = self::folder("ekf", "[estimate]\nsd = true");
    let expected = estimated(&alone, &rows);
    for row in &rows {
        for asset in ["one", "two", "three"] {
            client.publish(&format!("site/{asset}/rows"), row.json().trim());
        }
    }
    let mut found: BTreeMap<String, BTreeMap<u64, Told>> = BTreeMap::new();
    for _ in 0..20 {
        let line: Value = serde_json::from_str(&client.hear().unwrap()).unwrap();
        let own = found
            .entry(line["asset"].as_str().unwrap().to_owned())
            .or_default();
        own.insert(line["t"].as_f64().unwrap().to_bits(), told(&line));
    }
    assert_eq!(found.len(), 2);
    assert!(found.values().all(|own| *own == expected));
    let ended = serving.stop();
    assert!(
        ended.err.contains("no asset is called \"three\""),
        "{}",
        ended.err
    );
}

/// A fleet on two machines: each has its part of the topics and of the table, and a restart of one is nothing to the other.
#[test]
fn two_services_divide_a_fleet_by_its_topics() {
    let Some(broker) = Broker::new("") else {
        return;
    };
    let part = |name: &str, assets: &str| {
        let folder = folder(
            "ekf",
            &format!(
                "[estimate]\nsd = true\n[serve]\nassets = \"assets.csv\"\nstate = \"all.state\"\n[serve.mqtt]\nurl = \"mqtt://localhost:{0}\"\nclient = \"{name}-{0}\"\nrows = \"{name}/{{asset}}/rows\"\npublish = \"estimates/{{asset}}\"",
                broker.port
            ),
        );
        folder.write("assets.csv", &format!("asset\n{assets}"));
        folder
    };
    let (west, east) = (part("west", "w1\nw2\n"), part("east", "e1\n"));
    let mut client = Client::new(&west, broker.port, "estimates/+", None);
    let mut first = Serving::begin(&west, &[], "");
    let second = Serving::begin(&east, &[], "");
    first.wait_for("is connected");
    second.wait_for("is connected");
    let assets = ["west/w1", "west/w2", "east/e1"];
    let all: Vec<Vec<Row>> = (0..3).map(|seed| rows(80 + seed, 20, true)).collect();
    let mut found: BTreeMap<String, BTreeMap<u64, Told>> = BTreeMap::new();
    let mut next = 0;
    for half in [0..10, 10..20] {
        for (k, (asset, rows)) in half.flat_map(|k| assets.iter().zip(&all).map(move |x| (k, x))) {
            client.publish(&format!("{asset}/rows"), rows[k].json().trim());
        }
        next += 30;
        while found.values().map(BTreeMap::len).sum::<usize>() < next {
            let line: Value = serde_json::from_str(&client.hear().unwrap()).unwrap();
            let own = found.entry(line["asset"].as_str().unwrap().to_owned());
            let t = line["t"].as_f64().unwrap().to_bits();
            own.or_default().insert(t, told(&line));
        }
        if next == 30 {
            first.kill();
            first = Serving::begin(&west, &[], "");
            first.wait_for("is connected");
        }
    }
    let alone = folder("ekf", "[estimate]\nsd = true");
    for (asset, rows) in assets.iter().zip(&all) {
        let name = asset.split('/').next_back().unwrap();
        assert!(found[name] == estimated(&alone, rows), "{asset}");
    }
    assert!(!first.stop().err.contains("no asset"));
    assert!(!second.stop().err.contains("no asset"));
}

/// Sizes, names, bytes and topics that nobody should send.
#[test]
fn a_thousand_hostile_messages_change_nothing() {
    let Some(broker) = Broker::new("") else {
        return;
    };
    let folder = folder_at(broker.port, "", "");
    let rows = rows(67, 20, true);
    let expected = estimated(&folder, &rows);
    let mut client = Client::new(&folder, broker.port, "plant/estimates", None);
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    let mut random = Normal(67);
    for row in &rows {
        client.publish("plant/rows", row.json().trim());
        for k in 0..50 {
            let number = (random.uniform() * 1e5) as usize;
            let (topic, payload) = match k % 10 {
                0 => ("plant/y", "NaN".to_owned()),
                1 => ("plant/y", "9".repeat(400)),
                2 => ("plant/y", "x".repeat(60_000 + number)),
                3 => ("plant/rows", "[".repeat(number % 5000)),
                4 => ("plant/rows", format!("{{\"t\":{number},\"y\":\"1\"}}")),
                5 => ("plant/y", "{\"value\":[],\"t\":1}".to_owned()),
                6 => ("plant/a", format!("{{\"value\":{number},\"t\":-5}}")),
                7 => ("plant/../y", "1".to_owned()),
                8 => ("plant/u", "\u{1b}[2J\u{0}".to_owned()),
                _ => ("plant/y", "{\"value\":1,\"t\":\"yesterday\"}".to_owned()),
            };
            client.publish(topic, &payload);
        }
    }
    let lines = heard_until(&mut client, &expected);
    assert_eq!(lines.len(), rows.len());
    let ended = serving.stop();
    assert!(!ended.err.contains('\u{1b}'), "{}", ended.err);
    assert!(ended.err.contains("such messages so far"), "{}", ended.err);
}

#[test]
fn a_broker_that_does_not_want_us_is_said() {
    if !has_mosquitto() {
        return;
    }
    let passwords = tempfile::tempdir().unwrap();
    let file = passwords.path().join("passwords");
    let made = std::process::Command::new("mosquitto_passwd")
        .args(["-b", "-c"])
        .arg(&file)
        .args(["plant", "right"])
        .status();
    assert!(made.unwrap().success());
    let more = format!(
        "listener PORT 127.0.0.1\nallow_anonymous false\npassword_file {}",
        file.display()
    );
    let Some(broker) = Broker::new(&more) else {
        return;
    };
    for version in ["3.1.1", "5"] {
        let folder = folder_at(
            broker.port,
            &format!("version = \"{version}\"\nuser = \"plant\"\npassword = \"wrong\""),
            "",
        );
        let ended = folder.run(&["serve", "study.toml"]);
        assert_eq!(ended.code, 2, "{}", ended.err);
        assert!(
            ended.err.contains("not authorized") || ended.err.contains("password is wrong"),
            "{}",
            ended.err
        );
        folder.change("study.toml", "wrong", "right");
        let serving = Serving::begin(&folder, &[], "");
        serving.wait_for("is connected");
        serving.stop();
    }
}

/// The certificate of a broker is looked at.
#[test]
fn what_is_encrypted_is_trusted_by_a_certificate() {
    let has_openssl = std::process::Command::new("openssl")
        .arg("version")
        .output();
    if !has_mosquitto() || has_openssl.is_err() {
        return;
    }
    let certificates = tempfile::tempdir().unwrap();
    let made = std::process::Command::new("sh")
        .args(["-c", include_str!("certificates.sh")])
        .current_dir(certificates.path())
        .output()
        .unwrap();
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    let path = |name: &str| certificates.path().join(name).display().to_string();
    let more = format!(
        "listener PORT 127.0.0.1\nallow_anonymous true\ncafile {}\ncertfile {}\nkeyfile {}",
        path("ca.pem"),
        path("broker.pem"),
        path("broker.key")
    );
    let Some(broker) = Broker::new(&more) else {
        return;
    };
    let folder = folder_at(broker.port, &format!("ca = '{}'", path("ca.pem")), "");
    folder.change("study.toml", "mqtt://", "mqtts://");
    let rows = rows(68, 10, true);
    let expected = estimated(&folder, &rows);
    let ca = path("ca.pem");
    let mut client = Client::new(&folder, broker.port, "plant/estimates", Some(&ca));
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("is connected");
    for row in &rows {
        client.publish("plant/rows", row.json().trim());
    }
    heard_until(&mut client, &expected);
    serving.stop();
    // somebody else vouches for the broker
    folder.change("study.toml", "ca.pem", "other.pem");
    let serving = Serving::begin(&folder, &[], "");
    serving.wait_for("certificate");
    let ended = serving.stop();
    assert!(!ended.err.contains("is connected"), "{}", ended.err);
}

#[test]
fn settings_of_a_broker_that_are_none_are_refused() {
    for (more, words) in [
        (
            "url = \"localhost:1883\"\nrows = \"r\"",
            "expected \"mqtt://HOST:PORT\"",
        ),
        ("url = \"mqtt://localhost\"", "reads nothing"),
        ("rows = \"r\"", "needs `url`"),
        (
            "url = \"mqtt://localhost\"\ntopics = { levle = \"x\" }",
            "its columns are y, a, u",
        ),
        (
            "url = \"mqtt://localhost\"\ntopics = { y = \"plant/#\" }",
            "may have no",
        ),
        (
            "url = \"mqtt://localhost\"\ntopics = { y = \"plant/{asset}/y\" }",
            "names no `assets`",
        ),
        (
            "url = \"mqtt://localhost\"\nrows = \"r\"\nqos = 2",
            "0 or 1",
        ),
        (
            "url = \"mqtt://localhost\"\nrows = \"r\"\npublish = \"r\"",
            "what is published under \"r\" would come back as a row",
        ),
        (
            "url = \"mqtt://localhost\"\nrows = \"r\"\n[serve.opcua]\nurl = \"opc.tcp://localhost\"\nnodes = { y = \"i=1\" }\ninterval = 5000",
            "must be a number in [1e-2, 3600], found 5000",
        ),
        (
            "url = \"mqtt://localhost\"\nrows = \"r\"\nversion = \"4\"",
            "\"3.1.1\", \"5\"",
        ),
        (
            "url = \"mqtt://localhost\"\nrows = \"r\"\ncert = \"a.pem\"",
            "both `cert` and `key`",
        ),
    ] {
        let folder = folder("ekf", &format!("[serve.mqtt]\n{more}"));
        let ended = folder.run(&["serve", "study.toml"]);
        assert_eq!(ended.code, 2, "{more}: {}", ended.err);
        assert!(ended.err.contains(words), "{more}: {}", ended.err);
    }
    let ended = folder("ekf", "").run(&["serve", "study.toml"]);
    assert!(
        ended.code == 2 && ended.err.contains("no rows would come"),
        "{}",
        ended.err
    );
}
