//! Process noise, bounds of inputs' derivatives, names: what a study declares counts in what is claimed.

use serde_json::Value;

use super::{refused, says};
use crate::Folder;

/// der(a) = −0.5 a + v, v an unknown input or 0, y = a.
fn folder(equation: &str, rest: &str) -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        &format!(
            "model M
  input Real v(start = 0, min = -1, max = 1);
  Real a(start = 0, min = -1, max = 1.5);
  output Real y = a;
equation
  der(a) = {equation};
end M;"
        ),
    );
    let run = "[simulate]\nuntil = 40\noutput_step = 0.1\n";
    folder.write("study.toml", &format!("plant = \"m.mo\"\n{rest}\n{run}"));
    folder
}

fn certified(folder: &Folder) -> Value {
    folder.run(&["certify", "study.toml", "--json"]).json()
}

const FAMILIES: [&str; 3] = [
    "family = \"triangular\"\ntheta = 2",
    "family = \"state-affine\"\ntheta = 2",
    "family = \"block-triangular\"\ntheta = 2",
];

/// e' = −(0.5 + k) e − w with w of density q: the variance ends at q/(2(0.5 + k)).
#[test]
fn process_noise_leaves_a_bound_in_mean_square_and_no_other() {
    for observer in FAMILIES {
        let noise = "[sensors]\nnoise = { y = { uniform = 0.001 } }";
        let with = |density: f64| {
            let rest = format!("{noise}\n[process_noise]\na = {density}\n[observer]\n{observer}");
            certified(&folder("-0.5*a", &rest))
        };
        let moved = with(0.04);
        let certificate = &moved["certificate"];
        assert_eq!(
            certificate["verdict"], "proved",
            "{observer}: {certificate}"
        );
        assert!(certificate["rate"].as_f64().unwrap() > 0.0);
        let theorem = &certificate["theorem"];
        assert!(certificate["ultimate_bound"].is_null() && theorem["ultimate_bound"].is_null());
        let declared = &certificate["declared"]["counted"];
        assert!(
            declared
                .as_array()
                .unwrap()
                .contains(&"process noise".into()),
            "{declared}"
        );
        let bound = certificate["mean_square_bounds"]["a"].as_f64().unwrap();
        if let Some(k) = moved["gain"]["a"]["y"].as_f64() {
            let sd = (0.04 / (2.0 * (0.5 + k))).sqrt();
            assert!((sd..1.2 * sd).contains(&bound), "{observer}: {bound} {sd}");
        }
        // none is what it was
        let (none, still) = (
            with(0.0),
            certified(&folder(
                "-0.5*a",
                &format!("{noise}\n[observer]\n{observer}"),
            )),
        );
        let of = |report: &Value| report["certificate"]["ultimate_bound"].as_f64().unwrap();
        assert!(of(&none) > 0.0 && of(&none) == of(&still), "{observer}");
        assert!(none["certificate"]["mean_square_bound"].is_null());
    }
}

/// What a run shows of two states and an unknown input that wanders is within the bound.
#[test]
fn a_run_moved_by_noise_is_within_its_mean_square() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M
  Real a(start = 0, min = -5, max = 5);
  Real b(start = 0, min = -5, max = 5);
  output Real y = a;
equation
  der(a) = b - 0.3*a;
  der(b) = -b + 0.2*sin(b);
end M;",
    );
    for observer in [
        "family = \"triangular\"\ntheta = 3",
        "family = \"block-triangular\"\ntheta = 3\nk_poles = [[-1, -2]]",
    ] {
        folder.write(
            "study.toml",
            &format!("plant = \"m.mo\"\n[process_noise]\na = 0.01\nb = 0.02\n[observer]\n{observer}\n[simulate]\nuntil = 400\noutput_step = 0.02\n"),
        );
        let certificate = &certified(&folder)["certificate"];
        let run = folder.run(&["simulate", "study.toml", "--json"]).json();
        for name in ["a", "b"] {
            let bound = certificate["mean_square_bounds"][name].as_f64().unwrap();
            let seen = run["rms_error_last_half"][name].as_f64().unwrap();
            assert!(
                seen > 0.02 * bound && seen < bound,
                "{observer}: {name}: {seen} {bound}"
            );
        }
    }
}

#[test]
fn an_unknown_input_that_wanders_is_not_constant() {
    let rest = |noise: &str| {
        format!(
            "{noise}\n[sensors]\nunknown = [\"v\"]\n[observer]\nfamily = \"triangular\"\ntheta = 3"
        )
    };
    let constant = certified(&folder("-0.5*a + v", &rest("")));
    assert_eq!(constant["certificate"]["ultimate_bound"], 0.0);
    let moving = folder("-0.5*a + v", &rest("[process_noise]\nv = 0.1"));
    let wandering = certified(&moving);
    assert!(
        wandering["certificate"]["ultimate_bound"].is_null(),
        "{wandering}"
    );
    assert!(
        wandering["certificate"]["mean_square_bounds"]["v"]
            .as_f64()
            .unwrap()
            > 0.1
    );
    let told = moving.run(&["certify", "study.toml"]).out;
    says(
        &told,
        &["v wanders as [process_noise] says", "in mean square"],
    );
    assert!(!told.contains("v is taken as constant"), "{told}");
}

/// G of Farza's form reads a state that white noise moves: it turns at no bounded speed.
#[test]
fn no_theorem_follows_a_signal_that_white_noise_moves() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M
  input Real v(start = 0, min = -1, max = 1);
  Real a(start = 0, min = -1, max = 1);
  Real b(start = 0, min = -1, max = 1);
  output Real y1 = a;
  output Real y2 = b;
equation
  der(a) = -a + (2 + 0.1*a)*v;
  der(b) = -b + a;
end M;",
    );
    let verdict = |noise: &str| {
        folder.write("study.toml", &format!("plant = \"m.mo\"\n{noise}\n[sensors]\nunknown = [\"v\"]\n[observer]\nfamily = \"unknown-input\"\ntheta = [40, 10]\n"));
        certified(&folder)["certificate"]["theorem"]["verdict"].clone()
    };
    assert_eq!(verdict("[process_noise]\na = 0"), "proved");
    assert_eq!(verdict("[process_noise]\na = 0.01"), "undecided");
}

/// y' = b + u c: c is seen through b' alone, and Q̄ reads u and u'.
const SLOW: &str = "model Slow
  input Real u(start = 0, min = -0.2, max = 0.2);
  Real a(start = 0.1, min = -0.5, max = 0.5);
  Real b(start = 0.1, min = -0.5, max = 0.5);
  Real c(start = 0.1, min = -0.5, max = 0.5);
  output Real y = a;
equation
  der(a) = b + u*c;
  der(b) = c - 0.5*b;
  der(c) = -0.4*a - c;
end Slow;
";

#[test]
fn bounds_of_an_input_s_derivatives_count_in_check() {
    let folder = Folder::empty();
    folder.write("m.mo", SLOW);
    let checked = |rest: &str| {
        let observer = "[observer]\nfamily = \"drift-observable\"\nvariant = \"theoretical\"\npoles = [-3, -4, -5]";
        folder.write(
            "study.toml",
            &format!("plant = \"m.mo\"\n{observer}\n{rest}"),
        );
        let report = folder.run(&["check", "study.toml", "--json"]).json();
        let checks = report["families"][0]["checks"].as_array().unwrap().clone();
        let check = checks
            .into_iter()
            .find(|c| {
                c["name"].as_str().unwrap().contains('Q')
                    && c["name"].as_str().unwrap().contains('\u{304}')
            })
            .unwrap();
        (
            check,
            folder.run(&["certify", "study.toml", "--json"]).json(),
        )
    };
    let (free, _) = checked("");
    assert_eq!(free["verdict"], "refuted", "{free}");
    let (bounded, certified) = checked("[certify]\ninput_derivatives = { u = [0.1, 0.1] }");
    assert_eq!(bounded["verdict"], "proved", "{bounded}");
    says(
        bounded["detail"].as_str().unwrap(),
        &["|u'| ≤ 0.1", "input_derivatives"],
    );
    let (wide, _) = checked("[certify]\ninput_derivatives = { u = [40, 40] }");
    assert_eq!(wide["verdict"], "refuted", "{wide}");
    // Ū: for all |u|, |u'| up to it det Q̄ ≠ 0 is proved, and not much beyond
    let constants = certified["certificate"]["theorem"]["constants"]
        .as_array()
        .unwrap()
        .clone();
    let largest = constants.iter().find(|c| c["name"] == "\u{16a}").unwrap()["value"]
        .as_f64()
        .unwrap();
    assert!((0.3..1.0).contains(&largest), "{largest}");
    folder.write("m.mo", &SLOW.replace("0.2", &largest.to_string()));
    let (at, _) = checked(&format!(
        "[certify]\ninput_derivatives = {{ u = [{largest}, 0.1] }}"
    ));
    assert_eq!(at["verdict"], "proved", "{at}");
}

#[test]
fn bounds_of_an_input_s_derivative_count_in_lee_s_theorem() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model LM
  input Real u(min = -1, max = 1);
  Real a1(start = 0.2, min = -1, max = 1);
  Real a2(start = 0.1, min = -1, max = 1);
  output Real y1 = a1;
equation
  der(a1) = a2 + 0.1*a1*u;
  der(a2) = -a1 - a2*(1 + 0.1*u);
end LM;",
    );
    let certified = |rest: &str| {
        folder.write(
            "study.toml",
            &format!(
                "plant = \"m.mo\"\n[observer]\nfamily = \"block-triangular\"\ntheta = [60]\n{rest}"
            ),
        );
        folder.run(&["certify", "study.toml", "--json"]).json()["certificate"]["theorem"].clone()
    };
    let free = certified("");
    assert_eq!(free["verdict"], "undecided");
    assert!(free["rate"].is_null());
    let slow = certified("[certify]\ninput_derivatives = { u = [0.1] }");
    assert_eq!(slow["verdict"], "proved", "{slow}");
    let fast = certified("[certify]\ninput_derivatives = { u = [2] }");
    assert!(
        slow["rate"].as_f64() >= fast["rate"].as_f64(),
        "{slow} {fast}"
    );
}

/// A name that means nothing is refused by every command, in the same words; an array's stands for its elements.
#[test]
fn check_refuses_what_estimate_refuses() {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M
  Real x[2](start = {1, 1}, min = {-5, -5}, max = {5, 5});
  output Real y[2] = x;
equation
  der(x[1]) = -x[1];
  der(x[2]) = -2*x[2];
end M;",
    );
    folder.write("log.csv", "t,y[1],y[2]\n0,1,1\n1,0.4,0.1\n2,0.1,0.02\n");
    let both = |rest: &str| {
        folder.write("study.toml", &format!("plant = \"m.mo\"\n{rest}"));
        let check = folder.run(&["check", "study.toml"]);
        (
            check,
            folder.run(&["estimate", "study.toml", "log.csv", "-o", "o.csv"]),
        )
    };
    for (rest, words) in [
        (
            "[sensors]\nnoise = { z = 0.1 }",
            "no output is called \"z\"",
        ),
        (
            "[sensors]\nlimits = { z = [0, 1] }",
            "no output is called \"z\"",
        ),
        (
            "[process_noise]\nz = 0.1",
            "no estimated quantity is called \"z\"",
        ),
        (
            "[certify]\nslew = { z = 0.1 }",
            "no unknown input is called \"z\"",
        ),
        (
            "[certify]\ninput_derivatives = { z = 0.1 }",
            "no known input is called \"z\"",
        ),
        (
            "[observer]\nfamily = \"ekf\"\ninitial = { z = 1 }",
            "initial",
        ),
        (
            "[observer]\nfamily = \"ekf\"\ninitial_variance = { z = 1 }",
            "initial_variance",
        ),
        ("[observer]\nfamily = \"triangular\"\ntheta = -1", "theta"),
        (
            "[observer]\nfamily = \"triangular\"\ntheta = 1\n[estimate]\nsmooth = true",
            "need a filter",
        ),
        (
            "[observer]\nfamily = \"mhe\"\nhorizon = 3\n[estimate]\nlag = 5",
            "lag",
        ),
        ("[observer]\nfamily = \"ukf\"\nkappa = -9", "sigma points"),
        (
            "[estimate]\ncolumns = { z = \"c\" }",
            "no output, input or state named",
        ),
    ] {
        let (check, estimate) = both(rest);
        refused(&check, 2, &[words]);
        refused(&estimate, 2, &[words]);
        assert_eq!(
            check.err.lines().next(),
            estimate.err.lines().next(),
            "{rest}"
        );
    }
    let arrays = "[sensors]\nmeasured = [\"y\"]\nnoise = { y = 0.1, \"y[2]\" = 0.2 }\n[process_noise]\nx = 0.01\n[observer]\nfamily = \"ekf\"";
    let (check, estimate) = both(arrays);
    assert_eq!(
        (check.code, estimate.code),
        (0, 0),
        "{}{}",
        check.err,
        estimate.err
    );
    assert!(!estimate.out.contains("scatter"), "{}", estimate.out);
}

/// a' = (u − 10) a − …: on all that is declared of u the error decays at θ − 1.9 = 0.1, with the study's own at θ + 9.
#[test]
fn the_study_s_own_inputs_are_the_answer_where_they_make_much_of_a_difference() {
    for (theta, own) in [(2.0, true), (4.0, false)] {
        let folder = Folder::empty();
        let model = "model M
  input Real u(start = 1, min = -1, max = 11.9);
  Real a(start = 0.2, min = -1, max = 1.5);
  output Real y = a;
equation
  der(a) = (u - 10)*a;
end M;";
        folder.write("m.mo", model);
        let study = format!(
            "plant = \"m.mo\"\n[observer]\nfamily = \"triangular\"\ntheta = {theta}\n[simulate]\nuntil = 4\noutput_step = 0.1\ninputs = {{ u = 1 }}\n"
        );
        folder.write("study.toml", &study);
        let found = certified(&folder);
        let rate = found["certificate"]["rate"].as_f64().unwrap();
        let expected = if own { theta + 9.0 } else { theta - 1.9 };
        assert!((rate / expected - 1.0).abs() < 0.03, "{rate}, {expected}");
        let text = folder.run(&["certify", "study.toml"]).out;
        let said = "for the inputs of [simulate], u = 1; on their declared ranges: proved, at 0.";
        assert_eq!(text.contains(said), own, "{text}");
    }
}
