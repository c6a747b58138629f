//! `check`, `auto` and `--how-well` tell one story.

use serde_json::Value;

use crate::said::said;
use crate::{Folder, csv};

/// A reactor of which only temperatures are measured, in the shape of a stirred tank: what is not
/// seen of it decays near its start, and the sign of what it hangs on changes in the box.
const REACTOR: &str = "model Reactor
  input Real feed(start = 5, min = 3, max = 7);
  Real a(start = 2, min = 0.1, max = 5);
  Real b(start = 1, min = 0.1, max = 2);
  Real heat(start = 0, min = -50, max = 50);
  output Real y = heat;
equation
  der(a) = 4*(feed - a) - 2*a - 0.3*a^2;
  der(b) = -4*b + 2*a - 2*b;
  der(heat) = 3*a - 4*a^2 - 5*b - heat;
end Reactor;";

/// A digester in small: a substance that nobody sees and that only washes out, and one fed by what
/// nobody knows.
const DIGESTER: &str = "model Digester
  input Real D(min = 0.2, max = 1); input Real w(min = 0, max = 1);
  Real s(start = 1, min = 0, max = 4); Real dye(start = 1, min = 0, max = 4);
  Real waste(start = 1, min = 0, max = 40); Real sum(min = -100, max = 100);
  output Real y = s;
equation
  der(s) = 2*D - D*s;
  der(dye) = -D*dye;
  der(waste) = w - D*waste;
  der(sum) = waste - s;
end Digester;";

fn folder(model: &str, study: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("m.mo", model);
    folder.write("study.toml", &format!("plant = \"m.mo\"\n{study}"));
    folder
}

/// The quantities of `knowledge` under an assumption.
fn known(report: &Value, assumption: &str) -> Value {
    let all = report["knowledge"].as_array().unwrap();
    let found = all.iter().find(|k| k["unknown_inputs"] == assumption);
    found.unwrap_or_else(|| panic!("{report}"))["quantities"].clone()
}

#[test]
fn what_washes_out_decays_and_what_is_fed_does_not() {
    let folder = folder(DIGESTER, "[sensors]\nunknown = [\"w\"]\n");
    let ended = folder.run(&["check", "study.toml", "--json"]);
    let arbitrary = known(&ended.json(), "arbitrary");
    assert_eq!(arbitrary["s"]["known"], "everywhere");
    assert_eq!(arbitrary["dye"]["known"], "decays");
    assert_eq!(arbitrary["dye"]["proved"], true);
    assert!((arbitrary["dye"]["rate"].as_f64().unwrap() - 0.2).abs() < 1e-9);
    // at most 1 unknown, over the rate 0.2
    assert_eq!(arbitrary["waste"]["known"], "no");
    assert!((arbitrary["waste"]["bound"].as_f64().unwrap() - 5.0).abs() < 1e-9);
    assert_eq!(arbitrary["sum"]["known"], "no");
    assert_eq!(arbitrary["w"]["known"], "no");
    // a constant that no output shows is no better known
    let wandering = known(&ended.json(), "wandering");
    for name in ["waste", "sum", "w"] {
        assert_eq!(wandering[name]["known"], "no", "{name}: {wandering}");
    }
    said(&folder, "check-what-washes-out", &["check", "study.toml"]);
}

/// Where heat tells b by a, b' = −6b + 2a with a = −(5/13)·b at the start: −6 − 10/13.
#[test]
fn an_unknown_feed_leaves_an_error_that_decays_near_the_start() {
    let study = "[sensors]\nunknown = [\"feed\"]\n[process_noise]\nfeed = 0.1\n[observer]\nfamily = \"ekf\"\n[plot]\ntime_unit = \"h\"\n";
    let folder = folder(REACTOR, study);
    let ended = folder.run(&["check", "study.toml", "--json"]);
    let arbitrary = known(&ended.json(), "arbitrary");
    for name in ["a", "b", "feed"] {
        assert_eq!(arbitrary[name]["known"], "decays", "{name}: {arbitrary}");
        assert_eq!(arbitrary[name]["proved"], false);
        let rate = arbitrary[name]["rate"].as_f64().unwrap();
        assert!((rate - (6.0 + 10.0 / 13.0)).abs() < 1e-6, "{name}: {rate}");
    }
    let wandering = known(&ended.json(), "wandering");
    assert_eq!(wandering["a"]["known"], "almost everywhere");
    said(&folder, "check-an-unknown-feed", &["check", "study.toml"]);
    // in a part of the box it is proved
    folder.change(
        "study.toml",
        "[process_noise]",
        "[box]\na = [1.5, 3]\n[process_noise]",
    );
    let arbitrary = known(
        &folder.run(&["check", "study.toml", "--json"]).json(),
        "arbitrary",
    );
    assert_eq!(arbitrary["b"]["proved"], true, "{arbitrary}");
    let rate = arbitrary["b"]["rate"].as_f64().unwrap();
    assert!(rate > 6.0 && rate < 6.0 + 10.0 / 13.0, "{rate}");
}

#[test]
fn an_input_at_rest_hides_what_it_excites() {
    let model = "model M input Real u(min = -1, max = 1); Real a(min = -1, max = 1); Real b(min = -1, max = 1);
      output Real y = a; equation der(a) = u*b; der(b) = -b; end M;";
    let folder = folder(model, "");
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    let found = known(&report, "none");
    assert_eq!(found["a"]["known"], "everywhere");
    assert_eq!(found["b"]["known"], "while excited");
    assert_eq!(found["b"]["hidden_by"]["input"], "u");
}

/// y' = u·b + v·c with b ~ e^−t and c ~ e^−2t tells both for every constant u and v; with
/// u = eᵗ, v = e²ᵗ, in their ranges for a while, it is the constant b₀ + c₀.
#[test]
fn what_constant_inputs_show_moving_ones_may_hide() {
    let model = |v: &str| {
        format!(
            "model M input Real u(min = 1, max = 2); {v} Real a(min = -1, max = 1); Real b(min = -1, max = 1);
      Real c(min = -1, max = 1); output Real y = a; equation der(a) = u*b + v*c; der(b) = -b; der(c) = -2*c; end M;"
        )
    };
    let moving = folder(&model("input Real v(min = 1, max = 2);"), "");
    let report = moving.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(report["uniform"]["verdict"], "proved");
    let found = known(&report, "none");
    assert_eq!(found["a"]["known"], "everywhere");
    for name in ["b", "c"] {
        let word = &found[name]["known"];
        assert_eq!(word, "everywhere while inputs are constant", "{name}");
    }
    said(&moving, "check-moving-inputs", &["check", "study.toml"]);
    // without inputs there is nothing that could move
    let model = model("parameter Real v = 1;")
        .replace("input Real u(min = 1, max = 2);", "parameter Real u = 1;");
    let still = folder(&model, "");
    let report = still.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(known(&report, "none")["c"]["known"], "everywhere");
}

/// A cart: position measured, and a chain that the triangular family takes.
const CART: &str = "model Cart
  input Real u(start = 0, min = -1, max = 1);
  Real x(start = 0.5, min = -5, max = 5); Real v(start = 0, min = -5, max = 5);
  output Real y = x;
equation
  der(x) = v;
  der(v) = u - 0.5*v - x;
end Cart;";

const RUN: &str = "[sensors]\nnoise = { y = 0.02 }\n[simulate]\nuntil = 20\noutput_step = 0.05\ninputs = { u = \"sin(time)\" }\n";

/// θ left out: the same value in the report, in the run's summary and in what is to be pasted.
#[test]
fn a_speed_is_proposed_and_told_everywhere() {
    let folder = folder(CART, RUN);
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(report["recommended"], "triangular");
    let theta = report["choice"]["proposed"]["value"].as_f64().unwrap();
    assert!(theta > 0.1 && theta < 20.0, "{theta}");
    let again = folder.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(again["choice"], report["choice"]);
    let run = folder.run(&["simulate", "study.toml", "--json", "-o", "a.csv"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(run.json()["family"], "triangular");
    let words = format!("theta = {theta} is proposed: the knee of 13 values in simulation");
    assert!(run.err.contains(&words), "{}", run.err);
    // pasted, it is the same observer and nothing is proposed
    let observer = report["next"]["observer"].as_str().unwrap();
    assert!(
        observer.starts_with("[observer]\nfamily = \"triangular\"\n"),
        "{observer}"
    );
    folder.write(
        "pasted.toml",
        &format!("plant = \"m.mo\"\n{RUN}\n{observer}"),
    );
    let pasted = folder.run(&["simulate", "pasted.toml", "-o", "b.csv"]);
    assert_eq!(pasted.code, 0, "{}", pasted.err);
    assert!(!pasted.err.contains("is proposed"), "{}", pasted.err);
    assert_eq!(folder.read("a.csv"), folder.read("b.csv"));
    // the gain and what is proved of it, too
    for command in ["design", "certify"] {
        let [own, named] = ["study.toml", "pasted.toml"].map(|study| {
            let ended = folder.run(&[command, study, "--json"]);
            assert_eq!(ended.code, 0, "{command} {study}: {}", ended.err);
            let mut found = ended.json();
            found["notes"] = Value::Null;
            found
        });
        assert_eq!(own, named, "{command}");
    }
    // and a sweep is around it
    let ended = folder.run(&["tune", "study.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let sweep = ended.json();
    assert_eq!(sweep["rows"][10]["keys"]["theta"], theta, "{sweep}");
    let ended = folder.run(&["tune", "study.toml", "--write", "-q"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let written = folder.read("study.toml");
    assert!(
        written.starts_with(&format!("plant = \"m.mo\"\n{RUN}")),
        "{written}"
    );
    assert!(written.contains("\n[observer]\ntheta = "), "{written}");
    folder.write("study.toml", &format!("plant = \"m.mo\"\n{RUN}"));
    // a family asked for by name gets the same
    folder.write(
        "named.toml",
        &format!("plant = \"m.mo\"\n{RUN}\n[observer]\nfamily = \"triangular\"\n"),
    );
    let named = folder.run(&["simulate", "named.toml", "-o", "c.csv"]);
    assert_eq!(folder.read("a.csv"), folder.read("c.csv"), "{}", named.err);
}

/// What is to be pasted holds what the study says of every family, too.
#[test]
fn what_is_pasted_keeps_the_start() {
    let own = "[observer]\nclamp = true\ninitial = { v = 1.5, default = 0.25 }\n";
    let folder = folder(CART, &format!("{RUN}{own}"));
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    let observer = report["next"]["observer"].as_str().unwrap();
    folder.write(
        "pasted.toml",
        &format!("plant = \"m.mo\"\n{RUN}\n{observer}"),
    );
    for (study, table) in [("study.toml", "a.csv"), ("pasted.toml", "b.csv")] {
        let run = folder.run(&["simulate", study, "-o", table]);
        assert_eq!(run.code, 0, "{}", run.err);
    }
    assert_eq!(folder.read("a.csv"), folder.read("b.csv"), "{observer}");
}

/// A family whose θ is a list is proposed a list, and what `check` prints can be pasted.
#[test]
fn a_list_of_speeds_is_proposed_where_the_family_takes_one() {
    let folder = Folder::empty();
    folder.copy_models("farza");
    let study = "plant = \"farza.mo\"\n[sensors]\nmeasured = [\"y1\", \"y2\", \"y3\"]\nunknown = [\"v\"]\n[observer]\nfamily = \"unknown-input\"\ninitial = { x1 = 1, x2 = 1, x3 = 1, x4 = 0, x5 = 0, v = -1 }\n[simulate]\nuntil = 10\noutput_step = 0.02\ninputs = { v = \"5*sin(5*time)\" }\n";
    folder.write("study.toml", study);
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    let proposed = &report["choice"]["proposed"];
    assert_eq!(proposed["key"], "theta");
    let value: Vec<f64> = serde_json::from_value(proposed["value"].clone()).unwrap();
    assert!(value.len() == 2 && value[0] > value[1], "{value:?}");
    let text = folder.run(&["check", "study.toml"]).out;
    let line = format!("theta = [{}, {}]", value[0], value[1]);
    assert!(text.contains(&line), "{line} is missing:\n{text}");
    let ended = folder.run(&["simulate", "study.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(
        ended.err.contains(&format!("{line} is proposed")),
        "{}",
        ended.err
    );
    // pasted, it is the same observer, and nothing is proposed
    folder.change("study.toml", "initial", &format!("{line}\ninitial"));
    let pasted = folder.run(&["simulate", "study.toml"]);
    assert_eq!((pasted.code, pasted.out), (0, ended.out), "{}", pasted.err);
    assert!(!pasted.err.contains("is proposed"), "{}", pasted.err);
}

/// `tune` begins where `check` ends: around the speed that is proposed, on its own side of zero.
#[test]
fn a_study_without_a_speed_is_tuned_around_the_proposal() {
    let summed = CART.replace("y = x;", "y = x + 0.2*v;");
    for (model, key) in [(CART, "theta"), (summed.as_str(), "poles")] {
        let folder = folder(model, &format!("{RUN}[observer]\nclamp = false\n"));
        let report = folder.run(&["check", "study.toml", "--json"]).json();
        let value = report["choice"]["proposed"]["value"].as_f64().unwrap();
        let ended = folder.run(&["tune", "study.toml", "-o", "t.csv", "--write"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let words = format!("{key} = {value} is proposed");
        assert!(ended.err.contains(&words), "{}", ended.err);
        let table = folder.read("t.csv");
        let mut cells = table.lines().filter_map(|line| line.split(',').next());
        assert_eq!(cells.next(), Some(key));
        let shares: Vec<f64> = cells.map(|x| x.parse::<f64>().unwrap() / value).collect();
        assert!(shares.len() == 21 && shares.iter().all(|x| (0.249..4.01).contains(x)));
        assert!(folder.read("study.toml").contains(&format!("{key} = ")));
    }
}

/// What `check` proposes for a bare model runs.
#[test]
fn the_study_for_a_bare_model_runs() {
    let folder = folder(CART, "");
    let report = folder.run(&["check", "m.mo", "--json"]).json();
    let study = report["next"]["study"].as_str().unwrap();
    folder.write("new.toml", study);
    let run = folder.run(&["simulate", "new.toml", "-o", "a.csv"]);
    assert_eq!(run.code, 0, "{}\n{study}", run.err);
    let text = folder.run(&["check", "m.mo"]).out;
    assert!(
        text.contains(study) && text.contains("lynkeus simulate study.toml"),
        "{text}"
    );
    // poles as well as a θ
    folder.write("m.mo", &CART.replace("y = x;", "y = x + 0.2*v;"));
    let report = folder.run(&["check", "m.mo", "--json"]).json();
    let study = report["next"]["study"].as_str().unwrap();
    assert!(study.contains("poles = -"), "{study}");
    folder.write("new.toml", study);
    let run = folder.run(&["simulate", "new.toml", "-o", "a.csv"]);
    assert_eq!(run.code, 0, "{}\n{study}", run.err);
}

/// A key of the filters leaves the families with a theorem out, by name; it is no refusal.
#[test]
fn a_family_without_a_key_is_named() {
    let gated = folder(CART, &format!("{RUN}[observer]\ngate = 5\n"));
    said(&gated, "check-gated", &["check", "study.toml"]);
}

/// y = x + 0.2v fits no chain: the slowest pole is proposed like θ where it can be tried. Where it
/// cannot it is named as missing, and the next family is taken.
#[test]
fn poles_are_proposed_where_they_can_be_tried() {
    let summed = CART.replace("y = x;", "y = x + 0.2*v;");
    let tried = folder(&summed, RUN);
    let report = tried.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(report["recommended"], "drift-observable", "{report}");
    let proposed = &report["choice"]["proposed"];
    assert_eq!(proposed["key"], "poles");
    let pole = proposed["value"].as_f64().unwrap();
    assert!(-20.0 < pole && pole < -0.1, "{pole}");
    let run = tried.run(&["simulate", "study.toml", "--json", "-o", "a.csv"]);
    assert_eq!(run.json()["family"], "drift-observable");
    let words = format!("poles = {pole} is proposed: the knee of 13 values in simulation");
    assert!(run.err.contains(&words), "{}", run.err);
    let observer = report["next"]["observer"].as_str().unwrap();
    tried.write(
        "pasted.toml",
        &format!("plant = \"m.mo\"\n{RUN}\n{observer}"),
    );
    let pasted = tried.run(&["simulate", "pasted.toml", "-o", "b.csv"]);
    assert_eq!(pasted.code, 0, "{}", pasted.err);
    assert_eq!(tried.read("a.csv"), tried.read("b.csv"));
    // a value ten times as fast does worse: it passes more noise
    let rms = |table: &str| {
        let (header, rows) = csv(&tried.read(table));
        let at = |name: &str| header.iter().position(|h| h == name).unwrap();
        let (hat, truth) = (at("v_hat"), at("v"));
        let late = rows.iter().skip(rows.len() / 2);
        late.map(|row| (row[hat] - row[truth]).powi(2)).sum::<f64>()
    };
    let faster = format!("poles = {}", 10.0 * pole);
    tried.change("pasted.toml", &format!("poles = {pole}"), &faster);
    tried.run(&["simulate", "pasted.toml", "-o", "c.csv"]);
    assert!(rms("c.csv") > 2.0 * rms("a.csv"));

    let untried = folder(&summed, "[sensors]\nnoise = { y = 0.02 }\n");
    let report = untried.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(report["recommended"], "ekf", "{report}");
    let passed = report["choice"]["passed_over"].to_string();
    for words in [
        "drift-observable fits, but it needs `poles`",
        "with [simulate] one is proposed",
    ] {
        assert!(passed.contains(words), "{passed}");
    }
}

/// A tail that nothing corrects and that decays in 1000 s is no observer for a run of 4 s.
#[test]
fn what_is_too_slow_for_the_run_is_not_taken() {
    let model = CART.replace(
        "Real x(",
        "Real t(start = 1, min = -5, max = 5); output Real z = t; Real x(",
    );
    let model = model.replace("der(x) = v;", "der(t) = -0.001*t; der(x) = v;");
    let slow = "[sensors]\nmeasured = [\"y\", \"z\"]\n[observer]\ntheta = [3, 0.001]\n[simulate]\nuntil = 4\noutput_step = 0.05\n";
    let folder = folder(&model, slow);
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    let passed = report["choice"]["passed_over"].to_string();
    assert!(passed.contains("too slow for a run of 4"), "{passed}");
    assert_eq!(
        folder
            .run(&["simulate", "study.toml", "--json", "-o", "a.csv"])
            .json()["family"],
        report["recommended"]
    );
    folder.change("study.toml", "0.001]", "3]");
    let report = folder.run(&["check", "study.toml", "--json"]).json();
    assert_eq!(report["recommended"], "triangular");
}

/// The last standard deviations of a filter's run.
fn last_sd(folder: &Folder, names: &[&str]) -> Vec<f64> {
    let ended = folder.run(&["simulate", "study.toml", "-o", "run.csv"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let (header, rows) = csv(&folder.read("run.csv"));
    let at = |name: &&str| {
        header
            .iter()
            .position(|h| *h == format!("{name}_sd"))
            .unwrap()
    };
    names
        .iter()
        .map(|name| rows.last().unwrap()[at(name)])
        .collect()
}

/// `--how-well` counts `[process_noise]` as the filter does, and without says what it is beside it.
#[test]
fn standard_errors_are_those_of_the_filter() {
    let names = ["x", "v", "d"];
    for (noise, counted) in [
        ("[process_noise]\nx = 0\nv = 0.01\nd = 0.02\n", true),
        ("[process_noise]\nx = 0\nv = 0\nd = 0\n", true),
        ("", false),
    ] {
        let model = CART
            .replace(
                "input Real u",
                "input Real d(min = -1, max = 1); input Real u",
            )
            .replace("u - 0.5*v", "u + d - 0.5*v");
        let run = RUN
            .replace("u = \"sin(time)\"", "u = \"sin(time)\", d = \"0.3\"")
            .replace("[sensors]", "[sensors]\nunknown = [\"d\"]");
        let folder = folder(
            &model,
            &format!("{run}{noise}[observer]\nfamily = \"ekf\"\n[estimate]\nsd = true\n"),
        );
        let report = folder
            .run(&["check", "study.toml", "--how-well", "--json"])
            .json();
        assert_eq!(report["counts_process_noise"], counted);
        let key = if counted {
            "standard_error"
        } else {
            "filter_sd"
        };
        for (name, sd) in names.iter().zip(last_sd(&folder, &names)) {
            let found = report[key][*name].as_f64().unwrap();
            assert!(
                (found / sd - 1.0).abs() < 0.02,
                "{noise}{name}: {found} and {sd}"
            );
            // an exact model is never harder to see
            let exact = report["standard_error_exact_model"][*name]
                .as_f64()
                .unwrap();
            assert!(exact <= found * 1.001, "{name}: {exact} and {found}");
        }
        let text = folder.run(&["check", "study.toml", "--how-well"]).out;
        let words = if counted {
            "[process_noise] is counted"
        } else {
            "the model is taken as exact"
        };
        assert!(text.contains(words), "{text}");
    }
}

/// A state that forgets with e^−200 over the run: its error is nothing, not 1e-88.
#[test]
fn what_is_forgotten_altogether_is_known_exactly() {
    let model = CART
        .replace("Real x(", "Real q(start = 1, min = -1, max = 1); Real x(")
        .replace("der(x) = v;", "der(q) = -10*q; der(x) = v;");
    let folder = folder(&model, RUN);
    let ended = folder.run(&["check", "study.toml", "--how-well", "--json"]);
    assert_eq!(ended.json()["standard_error"]["q"], 0.0);
    let text = folder.run(&["check", "study.toml", "--how-well"]).out;
    assert!(
        text.contains("0: known exactly") && !text.contains("e-8"),
        "{text}"
    );
}
