//! A fit in pictures, and in the page of a report.

use crate::fit::{ALL, fitted, folder};

#[test]
fn profiles_are_drawn() {
    let folder = folder(&format!("{ALL}\nprocess_noise = [\"x\"]"));
    let plain = fitted(&folder, &["--plot", "plain.svg"]);
    let profiles = fitted(&folder, &["--profiles", "--plot", "profiles.svg"]);
    let [plain_picture, picture] = ["plain.svg", "profiles.svg"].map(|file| folder.read(file));
    let caption = "rise of \u{2212}log L, by its value";
    assert!(plain_picture.contains("y: autocorrelation") && !plain_picture.contains(caption));
    for name in ["k", "g", "noise.y", "process_noise.x"] {
        assert!(picture.contains(&format!("{name}: {caption}")), "{name}");
    }
    assert_eq!(picture.matches("bound of the interval, 1.92").count(), 3);
    assert_eq!(picture.matches("bound of the interval, 1.35").count(), 1);
    assert_eq!(plain["nll"], profiles["nll"]);
}

/// A page on a log has what `fit` tells, where the study asks for something.
#[test]
fn a_report_tells_the_fit() {
    let folder = folder(ALL);
    let page = |study: &str, log: &[&str]| {
        let ended = folder.run(&[&["report", study], log, &["-o", "page.html", "-q"]].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        folder.read("page.html")
    };
    let section = "<section id=\"fit\">";
    let told = page("study.toml", &["log.csv"]);
    let own = told
        .split(section)
        .nth(1)
        .unwrap()
        .split("</section>")
        .next();
    let own = own.unwrap();
    assert!(
        own.contains("3 values fitted to 200 readings of log.csv"),
        "{own}"
    );
    assert!(
        own.contains("<svg") && own.contains("y: autocorrelation"),
        "{own}"
    );
    let place = folder.path.path().display().to_string();
    assert!(!own.contains(place.trim_end_matches('/')), "{own}");
    // what the log does not tell is told there
    let study = folder.read("study.toml");
    folder.write(
        "idle.toml",
        &study.replace("[\"k\", \"g\"]", "[\"k\", \"idle\"]"),
    );
    let untold = page("idle.toml", &["log.csv"]);
    assert!(untold.contains("the logs do not determine idle; leave one"));
    folder.write("plain.toml", study.split("[fit]").next().unwrap());
    assert!(!page("plain.toml", &["log.csv"]).contains(section));
    folder.write(
        "simulated.toml",
        &format!("{study}\n[simulate]\nuntil = 10\n"),
    );
    assert!(!page("simulated.toml", &[]).contains(section));
}
