//! Pages in a browser without a window.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::{data, example, page};
use crate::export::has;
use crate::{Folder, skipped};

/// How a browser is asked.
pub(crate) const DRIVER: &str = include_str!("driver.mjs");

/// The browser to look at pages with, by Node.
pub(crate) fn browser() -> Option<&'static str> {
    let known = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let found = known.into_iter().find(|browser| has(browser));
    let found = found.filter(|_| has("node"));
    if found.is_none() {
        skipped("no browser (chromium) or no node");
    }
    found
}

/// What a browser makes of the page of a folder; none where there is none.
pub(super) fn browsed(folder: &Folder) -> Option<Value> {
    let browser = browser()?;
    let profile = tempfile::tempdir().unwrap();
    folder.write("driver.mjs", DRIVER);
    folder.write("browser.mjs", include_str!("browser.mjs"));
    let mut node = Command::new("node");
    node.args(["browser.mjs", browser])
        .arg(profile.path())
        .arg("r.html");
    let ended = node
        .current_dir(folder.path.path())
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    let seen: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert!(seen["failed"].is_null(), "{}", seen["failed"]);
    Some(seen)
}

/// A page that renders, complains of nothing, asks for nothing and fits a phone.
pub(super) fn sound(seen: &Value) {
    assert_eq!(
        seen["complaints"].as_array().unwrap().len(),
        0,
        "{}",
        seen["complaints"]
    );
    let requests = seen["requests"].as_array().unwrap();
    assert_eq!(requests.len(), 1, "{requests:?}");
    assert!(Path::new(requests[0].as_str().unwrap()).ends_with("r.html"));
    let painted = seen["painted"].as_array().unwrap();
    let is_drawn = |count: &Value| count.as_u64().unwrap() > 50;
    assert!(
        !painted.is_empty() && painted.iter().all(is_drawn),
        "{painted:?}"
    );
    assert_eq!(seen["all"], true);
    let last = seen["last"].as_array().unwrap();
    assert!(last.iter().all(|label| *label == "estimate"), "{last:?}");
    assert_eq!(seen["zoomed"], true);
    assert!(seen["width"].as_u64().unwrap() <= 390, "{}", seen["width"]);
}

/// The largest difference of curves, in units of their largest values.
fn apart(a: &Value, b: &Value) -> f64 {
    let curves = |all: &Value| -> Vec<Vec<f64>> {
        let curve = |c: &Value| {
            c.as_array()
                .unwrap()
                .iter()
                .map(|x| x.as_f64().unwrap())
                .collect()
        };
        all.as_array().unwrap().iter().map(curve).collect()
    };
    let of = |(a, b): (Vec<f64>, Vec<f64>)| {
        assert_eq!(a.len(), b.len());
        let size = a.iter().fold(1e-300, |m: f64, x| m.max(x.abs()));
        a.iter()
            .zip(&b)
            .fold(0.0, |m: f64, (x, y)| m.max((x - y).abs() / size))
    };
    curves(a)
        .into_iter()
        .zip(curves(b))
        .map(of)
        .fold(0.0, f64::max)
}

#[test]
fn in_a_browser_the_sliders_move_the_curves() {
    for file in ["study.toml", "smoothed.toml"] {
        let folder = example("two-tanks", file);
        let data = data(&page(&folder, &["study.toml"]));
        let Some(seen) = browsed(&folder) else { return };
        sound(&seen);
        let quantities = data["quantities"].as_array().unwrap();
        let own: Value = quantities.iter().map(|q| q["estimate"].clone()).collect();
        assert_eq!(seen["names"].as_array().unwrap().len(), 3);
        assert!(apart(&own, &seen["first"]) <= 1e-12, "{file}");
        assert!(apart(&own, &seen["slow"]) > 0.01, "{file}");
        assert!(apart(&own, &seen["noisy"]) > 0.01, "{file}");
        assert!(apart(&own, &seen["back"]) <= 1e-12, "{file}");
    }
}
