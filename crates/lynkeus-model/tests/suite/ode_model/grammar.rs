//! What is read, and what it means.

use lynkeus_model::{LoadOptions, Plant, model_names};

use super::{symbolic, taken, valued};
use crate::support::{slopes, values};

/// The value of a right side where x = 3, u = 5, a = 2, b = 7 and the time is 11.
fn value(expression: &str) -> f64 {
    let plant = taken(&format!("m = @ODEmodel(x'(t) = {expression}, y(t) = x(t))"));
    let given = [
        ("x", 3.0),
        ("u", 5.0),
        ("a", 2.0),
        ("b", 7.0),
        ("time", 11.0),
    ];
    slopes(&plant, &given)[0]
}

fn names(variables: &[lynkeus_model::Variable]) -> Vec<&str> {
    variables
        .iter()
        .map(|variable| variable.name.as_str())
        .collect()
}

fn parameters(plant: &Plant) -> Vec<&str> {
    let parameters = plant.parameters.iter();
    parameters
        .map(|parameter| parameter.variable.name.as_str())
        .collect()
}

#[test]
fn roles_follow_from_the_equations() {
    let plant = taken(
        "using StructuralIdentifiability

         ode = @ODEmodel(
             x1'(t) = -(a01 + a21) * x1(t) + a12 * x2(t) + u(t),   # comment
             x2'(t) = a21 * x1(t) - a12 * x2(t) - x2(t)/b,
             y(t) = x2(t)
         )
         println(assess_identifiability(ode; loglevel = Logging.Warn)) # \"",
    );
    assert_eq!(plant.name, "ode");
    assert_eq!(names(&plant.states), ["x1", "x2"]);
    assert_eq!(names(&plant.inputs), ["u"]);
    assert_eq!(names(&plant.outputs), ["y"]);
    assert_eq!(parameters(&plant), ["a01", "a21", "a12", "b"]);
    assert_eq!(plant.parameters[0].value, None);
    assert!(plant.algebraics.is_empty() && !plant.states[0].fixed);
}

#[test]
fn outputs_may_stand_before_states() {
    let plant = taken("m = @ODEmodel(y(t) = k*x(t) + v(t), x'(t) = w(t), )");
    assert_eq!(names(&plant.inputs), ["v", "w"]);
    let given = [("x", 3.0), ("k", 2.0), ("v", 1.0)];
    assert_eq!(values(&plant, &[plant.outputs[0].node], &given), [7.0]);
}

#[test]
fn precedence_is_that_of_julia() {
    for (expression, expected) in [
        ("2 - 3 - 4", -5.0),
        ("2 / 4 / 4", 0.125),
        ("1/2//3", 1.5),
        ("12//2*3", 18.0),
        ("2*12//4//3", 2.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^-x(t)^2", 2f64.powi(-9)),
        ("- -a", 2.0),
        ("-a*+b", -14.0),
        ("a - -b", 9.0),
        ("(a + b)*x(t)", 27.0),
        ("2x(t)", 6.0),
        ("1/2a", 0.25),
        ("2x(t)^2", 18.0),
        ("2(a + b)", 18.0),
        ("2^2a", 16.0),
        ("-2a^2", -8.0),
    ] {
        assert_eq!(value(expression), expected, "{expression}");
    }
}

#[test]
fn numbers() {
    for (number, expected) in [
        ("1//2", 0.5),
        ("1.0e-3", 1e-3),
        ("1_000", 1000.0),
        (".5", 0.5),
        ("2.", 2.0),
        ("1e2", 100.0),
        ("100000000000000000000", 1e20),
    ] {
        assert_eq!(value(number), expected, "{number}");
    }
}

#[test]
fn functions_and_time() {
    for (expression, expected) in [
        ("exp(x(t))", 3f64.exp()),
        ("log(b)", 7f64.ln()),
        ("sqrt(x(t)^2 + 7)", 4.0),
        ("sin(t) + cos(2t)", 11f64.sin() + 22f64.cos()),
        ("tanh(u(t))", 5f64.tanh()),
        ("max(a, x(t)) + min(a, b)", 5.0),
        ("abs(a - b)", 5.0),
        ("t", 11.0),
    ] {
        let found = value(expression);
        assert!((found - expected).abs() < 1e-14, "{expression}: {found}");
    }
}

#[test]
fn unicode_names_and_comments() {
    let plant = taken(
        "# @ODEmodel(
         #= a #= nested =# @ODEmodel( =#
         s = \"@ODEmodel(\"
         my_model = StructuralIdentifiability.@ODEmodel(
           x₁'(t) = λ #= decay =# - β*x₁(t)
                  + ẋ̂(t),   # y(t) = 2,
           y₁(t) = x₁(t) # - V'
         )",
    );
    assert_eq!(plant.name, "my_model");
    assert_eq!(names(&plant.states), ["x₁"]);
    assert_eq!(names(&plant.inputs), ["ẋ̂"]);
    assert_eq!(parameters(&plant), ["λ", "β"]);
}

#[test]
fn lines_may_separate_equations() {
    let plant = taken("m = @ODEmodel(\n x'(t) = a\n + b\n z'(t) = x(t)\n y(t) = z(t)\n)");
    assert_eq!(names(&plant.states), ["x", "z"]);
    assert_eq!(slopes(&plant, &[("a", 1.0), ("b", 2.0)]), [3.0, 0.0]);
}

#[test]
fn several_models_in_a_text() {
    let text = "first = @ODEmodel(x'(t) = 1)\nsecond = @ODEmodel(z'(t) = [1])
                third = @ODEmodel(w'(t) = 3)";
    assert_eq!(
        model_names(text, "m.jl").unwrap(),
        ["first", "second", "third"]
    );
    let load = |model: Option<&str>| {
        let model = model.map(str::to_owned);
        let options = LoadOptions {
            model,
            ..symbolic()
        };
        Plant::from_ode_model(text, "m.jl", &options)
    };
    assert_eq!(load(Some("first")).unwrap().states[0].name, "x");
    assert_eq!(load(Some("third")).unwrap().states[0].name, "w");
    assert_eq!(
        load(None).unwrap_err().one_line(),
        "m.jl:2:10: the text holds 3 models; say which one to take \
         (its models are first, second, third)"
    );
    assert_eq!(
        load(Some("thrid")).unwrap_err().one_line(),
        "m.jl:1:9: the text holds no model `thrid` (did you mean `third`?)"
    );
}

#[test]
fn a_model_without_a_name_is_called_as_the_file() {
    let text = "println(@ODEmodel(x'(t) = 1))";
    let plant = Plant::from_ode_model(text, "folder/decay.jl", &symbolic()).unwrap();
    assert_eq!(plant.name, "decay");
    let names = model_names(&format!("{text}{text}"), "decay.jl").unwrap();
    assert_eq!(names, ["decay", "decay"]);
    let modelica = "model A end A; model B end B;";
    assert_eq!(model_names(modelica, "both.mo").unwrap(), ["A", "B"]);
}

#[test]
fn the_end_of_the_file_name_decides() {
    let folder = tempfile::tempdir().unwrap();
    let julia = folder.path().join("decay.jl");
    std::fs::write(&julia, "ode = @ODEmodel(x'(t) = -x(t))").unwrap();
    let plant = Plant::load(&julia, &LoadOptions::default()).unwrap();
    assert_eq!(plant.name, "ode");
    let modelica = folder.path().join("decay.mo");
    std::fs::write(
        &modelica,
        "model Decay Real x; equation der(x) = -x; end Decay;",
    )
    .unwrap();
    let plant = Plant::load(&modelica, &LoadOptions::default()).unwrap();
    assert_eq!(plant.name, "Decay");
}

#[test]
fn values_of_parameters() {
    let text = "m = @ODEmodel(x'(t) = -k*x(t) + c)";
    let plant = Plant::from_ode_model(text, "m.jl", &valued(&[("k", 2.0), ("c", 1.0)])).unwrap();
    assert_eq!(plant.parameters[0].value, Some(2.0));
    // The values are in the equations: the symbols, which are 0 here, are not.
    assert_eq!(slopes(&plant, &[("x", 3.0)]), [-5.0]);

    let mut options = valued(&[("c", 1.0)]);
    options.symbolic_parameters = true;
    let plant = Plant::from_ode_model(text, "m.jl", &options).unwrap();
    let known: Vec<_> = plant.parameters.iter().map(|p| p.value).collect();
    assert_eq!(known, [None, Some(1.0)]);
    assert_eq!(slopes(&plant, &[("x", 3.0), ("k", 1.0), ("c", 4.0)]), [1.0]);
}
