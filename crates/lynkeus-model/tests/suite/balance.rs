//! Solving for derivatives, sorting algebraic variables, and what is said of the balance.
use crate::support::{plant, refused, slopes, values};

fn model(declarations: &str, equations: &str) -> String {
    format!("model M\n{declarations}\nequation\n{equations}\nend M;\n")
}

#[test]
fn factors_of_derivatives() {
    for equation in [
        "2*der(x) = 6*x;",
        "6*x = 2*der(x);",
        "0 = 6*x - 2*der(x);",
        "-der(x) = -3*x;",
        "der(x)/3 - x = 0;",
        "der(x) + der(x) = 6*x;",
        "3*x + 2*(x - der(x)) = der(x) - 4*x;",
        "der(x) - 3*x = 0;",
        "(x^2 + 1)*der(x) = 3*x*(1 + x^2);",
        "if x > 0 then 2*der(x) else der(x) = if x > 0 then 6*x else 0;",
    ] {
        let equation = equation.replace(
            "if x > 0 then 2*der(x) else der(x) =",
            "(if x > 0 then 2*der(x) else der(x)) =",
        );
        let plant = plant(&model("Real x;", &equation));
        assert_eq!(slopes(&plant, &[("x", 4.0)]), [12.0], "{equation}");
    }
}

#[test]
fn algebraic_variables_are_sorted() {
    let plant = plant(&model(
        "Real c; Real b; Real a; Real x; output Real y = c + x; input Real u;",
        "c = 2*b; 3*b = a + b; a - u = x; der(x) = c;",
    ));
    let names: Vec<&str> = plant.algebraics.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["c", "b", "a"]);
    let given = [("x", 1.0), ("u", 5.0)];
    assert_eq!(slopes(&plant, &given), [6.0]);
    assert_eq!(values(&plant, &[plant.outputs[0].node], &given), [7.0]);
}

#[test]
fn an_output_may_be_a_state() {
    let plant = plant(&model(
        "output Real x(min = 1); Real z = der(x);",
        "der(x) = -x;",
    ));
    assert_eq!((plant.states.len(), plant.outputs.len()), (1, 1));
    assert_eq!(plant.outputs[0].node, plant.states[0].node);
    assert_eq!(
        values(&plant, &[plant.algebraics[0].node], &[("x", 3.0)]),
        [-3.0]
    );
}

#[test]
fn mass_matrix() {
    let plant = plant(&model(
        "parameter Real M[2,2] = [2, 1; 1, 3]; Real v[2]; Real p; input Real u;",
        "M*der(v) = {u, 0}; der(p) = v[1];",
    ));
    let found = slopes(&plant, &[("u", 5.0), ("v[1]", 9.0)]);
    for (found, expected) in found.iter().zip([3.0, -1.0, 9.0]) {
        assert!((found - expected).abs() < 1e-12);
    }
}

#[test]
fn a_zero_entry_of_a_matrix_is_no_term() {
    let plant = plant(&model(
        "parameter Real A[2,2] = [0.0, 1; 0, 0]; Real x[2];",
        "der(x) = A*x;",
    ));
    assert_eq!(plant.derivatives[0], plant.states[1].node);
}

#[test]
fn missing_equations_name_the_variable() {
    let found = refused(&model("Real x; Real level;", "der(x) = -x;"));
    assert_eq!((found.line, found.column), (2, 14));
    assert_eq!(
        found.one_line(),
        "test.mo:2:14: variable `level` lacks an equation (no equation contains `level`: add one, \
         as `level = …` or `der(level) = …`, or declare it as a parameter or an input)"
    );
    let found = refused(&model("Real x; Real a; Real b;", "der(x) = a;\na + b = x;"));
    assert!(found.message.ends_with("lacks an equation"), "{found}");
    assert!(
        found
            .hint
            .unwrap()
            .contains("2 equations on lines 4 and 5 contain 3 unknowns: `der(x)`, `a`, `b`")
    );
}

#[test]
fn surplus_equations_name_the_line() {
    let cases = [
        (
            "Real x; Real y;",
            "der(x) = 1;\ny = x;\ny = 2*x;",
            6,
            "line 5 already determines `y`",
        ),
        ("Real x;", "der(x) = 1;\nx = 3;", 5, "`x` is a state"),
        (
            "Real x; input Real u;",
            "der(x) = u;\nu = 3;",
            5,
            "`u` is an input",
        ),
        (
            "Real x; input Real u;",
            "der(x) = u;\nx + u = 3;",
            5,
            "nothing that is still",
        ),
        (
            "Real x; Real y; Real z;",
            "der(x) = y;\ny = x;\ny = 2*x;",
            6,
            "variable `z` lacks",
        ),
    ];
    for (declarations, equations, line, hint) in cases {
        let found = refused(&model(declarations, equations));
        assert_eq!(found.message, "one equation too many", "{equations}");
        assert_eq!(found.line, line, "{found}");
        assert!(found.hint.as_deref().unwrap().contains(hint), "{found}");
    }
}

#[test]
fn loops_name_their_variables() {
    let found = refused(&model(
        "Real x; Real a; Real b;",
        "der(x) = a;\na = b + x;\nb = sin(a);",
    ));
    assert_eq!(found.message, "algebraic loop: `a`, `b` need each other");
    assert_eq!(found.line, 5);
    assert_eq!(
        found.label.unwrap(),
        "the equations of the loop are on lines 5 and 6"
    );
}

#[test]
fn nonlinear_equations() {
    for (equations, unknown) in [
        ("der(x) = y;\nexp(y) = x;", "`y`"),
        ("der(x)^2 = x;\ny = x;", "`der(x)`"),
        ("x*0 = y*0;\nder(x) = 1;", "`y`"),
    ] {
        let found = refused(&model("Real x; Real y;", equations));
        let expected = format!("cannot be solved for {unknown}: it is not linear in it");
        assert!(found.message.ends_with(&expected), "{found}");
    }
}

#[test]
fn a_model_without_states() {
    let found = refused(&model("Real y; input Real u;", "y = u;"));
    assert!(found.message.contains("no state"));
}
