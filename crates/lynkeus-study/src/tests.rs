use proptest::prelude::*;

use super::*;

const WHOLE: &str = r#"
plant = "column.mo"
model = "Column"
[parameters]
alpha = 1.65
[sensors]
measured = ["top", "bottom"]
unknown = ["Zf"]
disturbances = ["e1"]
noise = { top = { uniform = 0.05 }, bottom = "5%" }
[observer]
family = "triangular"
theta = 3.5
delta = [1, 1.2727]
r = 1
S = [{ diag = [1.5, 2], off = [-0.5] }, { diag = [1], off = [] }]
chains = [["x[1]", "x[2]"], ["x[3]"]]
partials = true
initial = { default = 0.5, "x[1]" = 0.9 }
clamp = true
[simulate]
until = 120
output_step = 0.1
inputs = { L = 4.69, Zf = "if time < 20 then 0.75 else 0.38" }
initial = { "x[2]" = 0.25 }
method = "rk4"
step = 0.01
seed = 7
spread = { alpha = 0.02, "x[2]" = 0 }
[estimate]
between_samples = "linear"
time = "time"
columns = { top = "AI-101" }
[plot]
show = ["Zf", "x[2]"]
"#;

#[test]
fn every_key_arrives() {
    let study = Study::parse(WHOLE, "study.toml").unwrap();
    assert_eq!(study.parameters["alpha"], 1.65);
    assert_eq!(study.sensors.noise[0].1, Noise::Uniform(0.05));
    assert_eq!(study.sensors.noise[1].1, Noise::Relative(0.05));
    let tuning = &study.observer.tuning;
    assert_eq!(tuning.numbers("theta").unwrap(), Some(vec![3.5]));
    assert_eq!(tuning.initial.default, Some(0.5));
    assert_eq!(tuning.initial.values["x[1]"], 0.9);
    let S = tuning.values["S"].to_string();
    let given = "[{ diag = [1.5, 2], off = [-0.5] }, { diag = [1], off = [] }]";
    assert_eq!(S, given);
    assert!(tuning.clamp && tuning.flag("partials").unwrap());
    let simulate = study.simulate.unwrap();
    assert_eq!(simulate.method, Method::Rk4(Rk4Step::Length(0.01)));
    assert_eq!(simulate.inputs[0].1.source.text, "4.69");
    assert_eq!(simulate.seed, 7);
    assert_eq!(simulate.spread[0], ("alpha".into(), 0.02));
    assert_eq!(simulate.spread[1].1, 0.0);
    assert_eq!(study.estimate.log.columns[0].1.text, "AI-101");
    assert_eq!(study.show.unwrap()[0].text, "Zf");
}

fn refusal(text: &str) -> String {
    Study::parse(text, "s.toml").unwrap_err().to_string()
}

#[test]
fn unknown_keys_are_placed_and_the_near_word_offered() {
    assert_eq!(
        refusal("plant = \"a.mo\"\n[observer]\n  tehta = 3\n"),
        "s.toml:3:3: unknown key \"tehta\" in [observer]; did you mean \"theta\"?"
    );
    assert!(refusal("[sensor]\n").contains("did you mean \"sensors\"?"));
    assert!(refusal("[plot]\nfoo = 1\n").contains("choose from: show"));
}

#[test]
fn wrong_values_say_what_was_expected_and_found() {
    let cases = [
        (
            "plant = 3",
            "s.toml:1:9: `plant` of the study must be a text in quotes, found 3",
        ),
        (
            "plant = \"p.mo\"\n[plot]\ntime_unit = \"\"",
            "s.toml:3:13: `time_unit` of [plot] must be a text that is not empty, found the text \"\"",
        ),
        (
            "[observer]\ntheta = [1, inf]",
            "s.toml:2:13: entry 2 of `theta` of [observer] must be a finite number, found inf",
        ),
        ("[observer]\nclamp = 1", "must be true or false, found 1"),
        (
            "[observer]\nfamily = \"kalman\"",
            "must be \"auto\" or one of triangular, ",
        ),
        (
            "[observer]\nfamily = \"triangular\"\nk = [[1]]",
            "belongs to the family block-triangular, not to triangular; triangular takes theta, ",
        ),
        (
            "[observer]\nk = [[1]]\npartials = true",
            "no family takes all of the keys k, partials",
        ),
        (
            "[sensors]\nnoise = { y = -1 }",
            "\"y\" in `noise` of [sensors] must be a standard deviation >= 0",
        ),
        ("[sensors]\nnoise = { y = \"5\" }", "found the text \"5\""),
        (
            "[sensors]\nnoise = { y = { uniform = -0.1 } }",
            "must be a bound >= 0, in the unit of the output, found -0.1",
        ),
        (
            "[sensors]\nnoise = { y = { unifrom = 0.1 } }",
            "unknown key \"unifrom\" in noise of [sensors]; did you mean \"uniform\"?",
        ),
        (
            "[sensors]\nnoise = { y = {} }",
            "such as { uniform = 0.05 }",
        ),
        ("[sensors]\nmeasured = []", "at least one output"),
        (
            "[parameters]\nk = nan",
            "must be a finite number, found nan",
        ),
        ("[simulate]\nseed = 1", "needs the key `until`"),
        (
            "[simulate]\nuntil = -1",
            "must be a time after the start, 0",
        ),
        (
            "[simulate]\nuntil = 1\nseed = -1",
            "whole number of at least 0, found -1",
        ),
        (
            "[simulate]\nuntil = 1\ninputs = { u = true }",
            "Modelica expression of time in quotes, found true",
        ),
        (
            "[estimate]\nbetween_samples = \"cubic\"",
            "must be one of \"hold\", \"predict\", \"linear\"",
        ),
        ("a = ", "s.toml:1:"),
    ];
    for (text, expected) in cases {
        let found = refusal(text);
        assert!(
            found.contains(expected),
            "{text:?}\n  gave {found}\n  not  {expected}"
        );
        assert!(!found.contains('\n'), "one line: {found}");
    }
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "[ a-z=\\[\\]{}\",.0-9\n]{0,200}") {
        let _ = Study::parse(&text, "s.toml");
    }
}
