//! Start values that the model declares as known.

use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observability::{Question, Verdict, analyse};

fn sensitivity(attributes: &str) -> Option<Verdict> {
    let text = format!(
        "model Decay
           parameter Real k; parameter Real c;
           Real x{attributes};
           output Real y = c*x;
         equation
           der(x) = -k*x;
         end Decay;"
    );
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let plant = Plant::from_modelica(&text, "decay.mo", &options).unwrap();
    let question = Question {
        parameters: true,
        ..Question::default()
    };
    analyse(&plant, &question).unwrap().verdict("c")
}

#[test]
fn a_known_start_reveals_the_sensitivity() {
    assert_eq!(sensitivity("(start = 2)"), Some(Verdict::Unobservable));
    let fixed = sensitivity("(start = 2, fixed = true)");
    assert_eq!(fixed, Some(Verdict::Observable));
}
