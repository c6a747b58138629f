//! What a proof for sensors that are read continuously is worth for those of a study: samples that
//! are far apart, steps that are long, readings at an end of a sensor's range.

use crate::Folder;

/// An oscillator of amplitude 3, its position measured.
fn oscillator(sensors: &str, theta: f64, rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M\n  Real x(start = 3, min = -5, max = 5);\n  Real v(start = 0, min = -5, max = 5);\n  output Real y = x;\n\
         equation\n  der(x) = v;\n  der(v) = -x;\nend M;\n",
    );
    folder.write("study.toml", &study("triangular", sensors, theta, rest));
    folder
}

fn study(family: &str, sensors: &str, theta: f64, rest: &str) -> String {
    let theta = match family {
        "triangular" => format!("theta = {theta}\n"),
        _ => String::new(),
    };
    format!(
        "plant = \"m.mo\"\n[sensors]\nnoise = {{ y = {{ uniform = 0.001 }} }}\n{sensors}\n[observer]\nfamily = \"{family}\"\n{theta}\
         initial = {{ x = 2.9, v = 0.1 }}\n{rest}\n"
    )
}

fn first(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// With its samples 0.5 apart the observer of θ = 20 runs away between them, or after the steps
/// that holding makes; 0.02 apart it does neither.
#[test]
fn proved_is_never_said_alone_of_samples_that_are_too_far_apart() {
    for between in ["predict", "hold"] {
        let of = |step: f64| {
            let rest = format!(
                "[simulate]\nuntil = 20\noutput_step = {step}\n[estimate]\nbetween_samples = \"{between}\""
            );
            oscillator("", 20.0, &rest)
        };
        let folder = of(0.5);
        let ended = folder.run(&["certify", "study.toml"]);
        let line = first(&ended.out);
        assert!(
            line.contains(": triangular observer, proved, but not for these samples: with sensors read continuously, "),
            "{line}"
        );
        assert!(line.contains("the samples are 0.5 apart, and "), "{line}");
        let json = folder.run(&["certify", "study.toml", "--json"]).json();
        assert_eq!(json["certificate"]["verdict"], "proved");
        let sampling = &json["certificate"]["sampling"];
        assert_eq!(sampling["beyond"], true, "{sampling}");
        // no log was given
        assert_eq!(sampling["simulation"], 0.5);
        assert!(sampling.get("log").is_none(), "{sampling}");
        let export = folder.run(&["export", "study.toml", "--to", "html", "-o", "page"]);
        let page = folder.read("page/m.html");
        assert!(
            page.contains("proved, but not for these samples</span>"),
            "{}",
            export.err
        );
        let fine = of(0.02);
        let ended = fine.run(&["certify", "study.toml"]);
        let line = first(&ended.out);
        assert!(
            line.contains("observer, proved: with sensors read continuously, the error decays at "),
            "{line}"
        );
        assert!(!line.contains("the samples are"), "{line}");
        assert!(
            line.contains("; also for samples up to 0.07")
                && line.contains(" apart, predicted between them"),
            "{line}"
        );
    }
}

/// Of all sequences of up to four gaps, each one of six shares of 0.105, none lets the error grow; 0.11 and twice 0.022 in
/// turn do, with a spectral radius of 1.03 (SciPy). Every sequence of samples is proved up to two thirds of that.
#[test]
fn samples_are_proved_to_two_thirds_of_what_breaks_them() {
    let of = |step: f64| {
        let rest = format!(
            "[simulate]\nuntil = 20\noutput_step = {step}\n[estimate]\nbetween_samples = \"predict\""
        );
        let json = oscillator("", 20.0, &rest)
            .run(&["certify", "study.toml", "--json"])
            .json();
        json["certificate"].clone()
    };
    let certificate = of(0.05);
    let sampled = &certificate["sampled"];
    let number = |entry: &serde_json::Value| entry.as_f64().unwrap();
    let longest = number(&sampled["longest"]["interval"]);
    let broken = number(&sampled["broken"]);
    assert!((0.105..0.11).contains(&broken), "{sampled}");
    assert!((0.62 * broken..broken).contains(&longest), "{sampled}");
    let rate = number(&certificate["rate"]);
    let at = &sampled["at"];
    assert_eq!(at["interval"], 0.05);
    assert!(
        (0.1 * rate..rate).contains(&number(&at["rate"])),
        "{sampled}"
    );
    // readings err by 0.001
    let bound = number(&at["ultimate_bounds"]["x"]);
    assert!((1e-3..0.02).contains(&bound), "{sampled}");
    assert!(
        number(&sampled["held"]["ultimate_bounds"]["x"]) > bound,
        "{sampled}"
    );
    assert!(
        certificate["declared"]["counted"]
            .as_array()
            .unwrap()
            .contains(&"samples".into())
    );
    let coarse = of(0.5);
    assert!(coarse["sampled"]["at"].is_null(), "{coarse}");
    assert!(
        coarse["declared"]["left_aside"]["samples"].is_string(),
        "{coarse}"
    );
}

/// In exported code, too; and steps that the method does not stand are told, with the certificate.
#[test]
fn an_export_says_for_which_steps_nothing_is_proved() {
    let folder = oscillator("", 20.0, "[simulate]\nuntil = 1\noutput_step = 0.02");
    for (step, is_told) in [("0.5", true), ("0.01", false)] {
        let ended = folder.run(&[
            "export",
            "study.toml",
            "--to",
            "c",
            "--step",
            step,
            "-o",
            step,
        ]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let header = folder.read(&format!("{step}/m.h"));
        assert!(
            header.contains("proved: with sensors read continuously, "),
            "{header}"
        );
        assert_eq!(
            header.contains("not for these steps: they are 0.5 at most"),
            is_told
        );
        assert_eq!(
            ended.err.contains("not for these steps"),
            is_told,
            "{}",
            ended.err
        );
    }
}

/// y is in [−5, 5] on the box, and an error of 0.001 more.
#[test]
fn a_sensor_at_an_end_of_its_range_is_proved_nothing_of() {
    for (limits, verdict) in [
        ("[-1, 1]", "undecided"),
        ("[-5, 5]", "undecided"),
        ("[-5.1, 5.1]", "proved"),
    ] {
        let folder = oscillator(&format!("limits = {{ y = {limits} }}"), 5.0, "");
        let json = folder.run(&["certify", "study.toml", "--json"]).json();
        let certificate = &json["certificate"];
        assert_eq!(certificate["verdict"], verdict, "{limits}");
        assert_eq!(certificate["rate"].is_null(), verdict == "undecided");
        let hypotheses = certificate["hypotheses"].to_string();
        assert!(
            hypotheses.contains("no reading is beyond its sensor's range"),
            "{hypotheses}"
        );
    }
}

/// Simulated readings are clipped, and both runs of an observer that takes them as they stand say so.
#[test]
fn readings_at_an_end_are_told() {
    let limits = "limits = { y = [-1, 1] }";
    let run = "[simulate]\nuntil = 20\noutput_step = 0.05";
    let folder = oscillator(limits, 5.0, run);
    let told = "y is at an end of its sensor's range in ";
    let simulated = folder.run(&["simulate", "study.toml", "-o", "run.csv"]);
    assert!(simulated.err.contains(told), "{}", simulated.err);
    let rows = (0..=400).map(|k| 0.05 * f64::from(k));
    let rows = rows.map(|t| format!("{t},{}\n", (3.0 * t.cos()).clamp(-1.0, 1.0)));
    folder.write("log.csv", &format!("t,y\n{}", rows.collect::<String>()));
    let estimated = folder.run(&["estimate", "study.toml", "log.csv", "-o", "estimates.csv"]);
    assert!(estimated.err.contains(told), "{}", estimated.err);
    // a filter takes them for bounds
    folder.write("study.toml", &study("ekf", limits, 5.0, run));
    for arguments in [
        &["simulate", "study.toml", "-o", "run.csv"][..],
        &["estimate", "study.toml", "log.csv", "-o", "estimates.csv"],
    ] {
        let ended = folder.run(arguments);
        assert!(!ended.err.contains(told), "{}", ended.err);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    // within its range nothing is told
    let wide = study("triangular", "limits = { y = [-4, 4] }", 5.0, run);
    folder.write("study.toml", &wide);
    let ended = folder.run(&["simulate", "study.toml", "-o", "run.csv"]);
    assert!(!ended.err.contains(told), "{}", ended.err);
    folder.write("study.toml", &wide.replace("limits = { y", "limits = { q"));
    let ended = folder.run(&["simulate", "study.toml", "-o", "run.csv"]);
    assert_eq!(ended.code, 2);
    let refusal = "no output is called \"q\"";
    assert!(ended.err.contains(refusal), "{}", ended.err);
}
