//! Whether the plant stays in the box, from a set of starts.

use serde_json::Value;

use super::{refused, says};
use crate::Folder;

const OSCILLATOR: &str = "model Oscillator
  Real x(start = 1.4, min = -3, max = 3);
  Real y(start = 2.4, min = -2.75, max = 2.75);
  input Real push(min = -0.01, max = 0.01);
  output Real z = x;
equation
  der(x) = y;
  der(y) = (1 - x^2)*y - x + push;
end Oscillator;
";

fn folder(certify: &str, more: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", OSCILLATOR);
    let study = format!(
        "plant = \"plant.mo\"\n[sensors]\nmeasured = [\"z\"]\n{more}\n[observer]\nfamily = \"triangular\"\ntheta = 8\n[certify]\n{certify}\n"
    );
    folder.write("study.toml", &study);
    folder
}

fn tube(folder: &Folder) -> Value {
    let ended = folder.run(&["certify", "study.toml", "--json"]);
    ended.json()["certificate"]["tube"].clone()
}

#[track_caller]
fn range(found: &Value) -> [f64; 2] {
    [0, 1].map(|end| found[end].as_f64().unwrap())
}

#[test]
fn the_plant_stays_in_the_box() {
    let folder = folder("start = { x = [1.35, 1.45], y = 2.4 }\nuntil = 3", "");
    let ended = folder.run(&["certify", "study.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    says(
        &ended.out,
        &[
            "; the plant stays in the box from these starts until 3 (proved)",
            "the plant stays in the box until 3: proved",
            "from x in [1.35, 1.45], y = 2.4 at 0",
            "however these vary: push in [-0.01, 0.01]",
        ],
    );
    let tube = tube(&folder);
    assert_eq!(tube["verdict"], "proved");
    assert!(tube["witness"].is_null() && tube["obstacle"].is_null());
    // from the middle without a push, by Runge and Kutta with steps of 1e-4
    let [low, high] = range(&tube["end"]["x"]);
    assert!(
        low < -0.41669 && -0.41668 < high && high - low < 0.3,
        "{tube}"
    );
    let rows = tube["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 200);
    for row in rows {
        let [low, high] = range(&row["range"]["y"]);
        assert!(-2.75 <= low && low < high && high <= 2.75);
    }
}

/// A run that leaves is found, and the exit code says so.
#[test]
fn the_plant_leaves_the_box() {
    let folder = folder("start = { x = 0.2, y = [2.6, 2.7] }\nuntil = 3", "");
    let ended = folder.run(&["certify", "study.toml"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    says(
        &ended.out,
        &["; the plant leaves the box from some of these starts"],
    );
    let tube = tube(&folder);
    assert_eq!(
        (&tube["verdict"], &tube["witness"]["state"]),
        (&"refuted".into(), &"y".into())
    );
    assert!(range(&tube["witness"]["value"])[0] > 2.75, "{tube}");
}

/// A constant that nobody knows is not an input that varies.
#[test]
fn a_constant_reaches_less_than_an_input() {
    let certify = "start = { x = [1.35, 1.45], y = 2.4 }\nuntil = 3";
    let known = tube(&folder(certify, ""));
    let constant = tube(&folder(certify, "unknown = [\"push\"]"));
    assert_eq!(range(&constant["constants"]["push"]), [-0.01, 0.01]);
    let width = |tube: &Value| {
        let [low, high] = range(&tube["end"]["x"]);
        high - low
    };
    assert!(width(&constant) < width(&known), "{constant} {known}");
}

#[test]
fn what_is_not_understood() {
    let wrong = folder("start = { pusch = 1 }\nuntil = 3", "");
    refused(
        &wrong.run(&["certify", "study.toml"]),
        2,
        &["no state and no constant unknown input named \"pusch\"; it has x, y"],
    );
    let open = folder("start = { x = 1 }", "");
    refused(
        &open.run(&["certify", "study.toml"]),
        2,
        &["`start` of [certify] needs `until`"],
    );
}

/// What holds a delay is not all of it, and a tube follows no jump: neither is proved to stay, or to leave.
#[test]
fn what_a_tube_does_not_follow_is_undecided() {
    for (equations, why) in [
        (
            "der(x) = delay(u, 0.5) - x;",
            "which are not all of the delay",
        ),
        (
            "der(x) = u - x; when x > 0.9 then reinit(x, 0); end when;",
            "jump at events",
        ),
    ] {
        let folder = Folder::empty();
        let model = format!(
            "model P input Real u(min = 0, max = 1); Real x(start = 0.5, min = -1, max = 3); output Real y = x; equation {equations} end P;"
        );
        folder.write("p.mo", &model);
        let study = "plant = \"p.mo\"\n[sensors]\nnoise = { y = 0.1 }\n[observer]\nfamily = \"ekf\"\n[certify]\nstart = { x = [0.2, 0.8] }\nuntil = 3\n";
        folder.write("study.toml", study);
        let found = tube(&folder);
        assert_eq!(found["verdict"], "undecided", "{found}");
        let obstacle = found["obstacle"].as_str().unwrap();
        assert!(obstacle.contains(why), "{obstacle}");
        assert_eq!(found["reached"], 0.0, "{found}");
        assert!(found["rows"].as_array().unwrap().is_empty(), "{found}");
    }
}
