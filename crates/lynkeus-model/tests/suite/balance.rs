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
fn linear_loops() {
    // a voltage divider with a loop in every unknown: i = x/(R1 + R2)
    let plant = plant(&model(
        "parameter Real R1 = 2; parameter Real R2 = 3; Real x; Real v1; Real v2; Real i1; Real i2;",
        "der(x) = -i1; v1 = R1*i1; v2 = R2*i2; i1 = i2; x = v1 + v2;",
    ));
    let given = [("x", 10.0)];
    assert!((slopes(&plant, &given)[0] + 2.0).abs() < 1e-14);
    let nodes: Vec<_> = plant.algebraics.iter().map(|a| a.node).collect();
    for (found, expected) in values(&plant, &nodes, &given)
        .iter()
        .zip([4.0, 6.0, 2.0, 2.0])
    {
        assert!((found - expected).abs() < 1e-14, "{found}");
    }
}

#[test]
fn loops_with_symbolic_coefficients() {
    let plant = plant(&model(
        "Real x; Real y; Real a; Real b;",
        "der(x) = a; der(y) = b; x*a + 2*b = 1 + x; 3*a - y*b = 5;",
    ));
    // 2a + 2b = 3, 3a + b = 5 where x = 2, y = −1
    let found = slopes(&plant, &[("x", 2.0), ("y", -1.0)]);
    for (found, expected) in found.iter().zip([1.75, -0.25]) {
        assert!((found - expected).abs() < 1e-14, "{found}");
    }
}

#[test]
fn nonlinear_loops() {
    let plant = plant(&model(
        "Real x; Real a; Real b;",
        "der(x) = a;\na = b + x;\nb = 0.5*sin(a);",
    ));
    let a = slopes(&plant, &[("x", 0.7)])[0];
    assert!((a - 0.5 * a.sin() - 0.7).abs() < 1e-15, "{a}");
    let b = values(&plant, &[plant.algebraics[1].node], &[("x", 0.7)])[0];
    assert!((b - (a - 0.7)).abs() < 1e-15, "{b}");
}

#[test]
fn implicit_equations() {
    for (equations, x, expected) in [
        ("der(x) = y; y + exp(y) = x;", 1.0 + 1f64.exp(), 1.0),
        ("der(x) = y; exp(y) = x;", 2.0, 2f64.ln()),
        ("der(x)^3 + der(x) = x; y = x;", 10.0, 2.0),
        (
            "der(x) = y; x = tanh(y)*abs(y);",
            -0.5 * 0.5f64.tanh(),
            -0.5,
        ),
    ] {
        let plant = plant(&model("Real x; Real y;", equations));
        let found = slopes(&plant, &[("x", x)])[0];
        assert!((found - expected).abs() < 1e-14, "{equations}: {found}");
    }
}

#[test]
fn start_and_range_choose_the_root() {
    for (attributes, expected) in [
        ("start = 1", 2.0),
        ("start = -1", -2.0),
        ("min = 0", 2.0),
        ("max = 0", -2.0),
        ("start = 5, max = 0", -2.0),
    ] {
        let plant = plant(&model(
            &format!("Real x; Real y({attributes});"),
            "der(x) = y; y^2 = x;",
        ));
        assert_eq!(slopes(&plant, &[("x", 4.0)]), [expected], "{attributes}");
    }
}

/// A loop that is flat far from where its variable may be.
#[test]
fn whether_a_loop_is_singular_is_asked_where_its_variables_may_be() {
    for attributes in [
        "start = 400",
        "min = 350, max = 500",
        "max = 500, start = 450",
    ] {
        let plant = plant(&model(
            &format!("Real x; Real T({attributes});"),
            "der(x) = T; max(T - 300, 0)^2 = x;",
        ));
        let found = slopes(&plant, &[("x", 1e4)])[0];
        assert!((found - 400.0).abs() < 1e-9, "{attributes}: {found}");
    }
    let found = refused(&model("Real x; Real T;", "der(x) = T; min(T, -3)^2 = x;"));
    assert!(found.message.contains("do not determine `T`"), "{found}");
}

/// Beyond its threshold each of these determines T; sin(T)² + cos(T)² does nowhere, whatever else
/// jumps.
#[test]
fn what_a_threshold_hides_is_not_called_singular_everywhere() {
    for (equation, place) in [
        ("max(T - 300, 0)^2 = x;", "where these start"),
        ("min(T, -3)^2 = x;", "where these start"),
        ("(if T > 1e5 then T else 0) = x;", "where these start"),
        (
            "sin(T)^2 + cos(T)^2 = x + (if x > 3 then 1 else 0);",
            "everywhere",
        ),
        (
            "sin(T)^2 + cos(T)^2 = x + (if T > 3 then 1 else 0);",
            "everywhere",
        ),
    ] {
        let found = refused(&model(
            "Real x; Real T;",
            &format!("der(x) = T; {equation}"),
        ));
        let expected = format!("do not determine `T`: they are singular {place}");
        assert!(found.message.contains(&expected), "{equation} {found}");
    }
}

#[test]
fn long_loops_are_torn() {
    let text = "model M parameter Integer n = 20000; Real a[n]; Real x; equation der(x) = a[1]; \
                for i in 1:n - 1 loop a[i] = 0.9999*sin(a[i + 1]) + x; end for; a[n] = 0.1*cos(a[1]); end M;";
    let plant = plant(text);
    assert!(slopes(&plant, &[("x", 0.1)])[0].is_finite());
}

#[test]
fn equations_that_determine_nothing_are_named() {
    let found = refused(&model(
        "Real x; Real a; Real b; Real c;",
        "der(x) = a + c;\na + b = x;\nc = sin(x);\n2*a + 2*b = c;",
    ));
    assert!(
        found.message.contains("do not determine `a`, `b`"),
        "{found}"
    );
    assert_eq!(found.line, 7);
    assert!(found.label.as_deref().unwrap().ends_with("lines 5 and 7"));
    assert!(found.hint.as_deref().unwrap().contains("index above 1"));
    // sin(a + b) and cos(a + b) say the same of the sum
    let found = refused(&model(
        "Real x; Real a; Real b;",
        "der(x) = a;\nsin(a + b) = x;\ncos(a + b) = x/2;",
    ));
    assert!(found.message.contains("do not determine"), "{found}");
}

#[test]
fn a_constraint_on_states_is_named() {
    let found = refused(&model(
        "Real x(start = 1); Real y; Real vx; Real vy; Real T;",
        "der(x) = vx;\nder(y) = vy;\nder(vx) = -T*x;\nder(vy) = -T*y - 9.81;\nx^2 + y^2 = 1;",
    ));
    assert_eq!(found.line, 8, "{found}");
    let hint = found.hint.unwrap();
    assert!(
        hint.contains("states `x`, `y` raises the index above 1"),
        "{hint}"
    );
}

#[test]
fn terms_that_cancel() {
    let found = refused(&model("Real x; Real y;", "x*0 = y*0;\nder(x) = 1;"));
    assert!(
        found.message.contains("do not determine `y`")
            || found.message.contains("cannot be solved for `y`"),
        "{found}"
    );
}

#[test]
fn a_model_without_states() {
    let found = refused(&model("Real y; input Real u;", "y = u;"));
    assert!(found.message.contains("no state"));
}

#[test]
fn states_that_follow_from_states_that_follow() {
    let plant = plant(&model(
        "Real w1(start = 1, fixed = true); Real w2; Real w3; Real a; Real b; Real s;",
        "der(w1) = -w1; w1 = 4*w2; w2 = 2*w3; der(w2) = a; der(w3) = b; der(s) = w3;",
    ));
    assert_eq!(slopes(&plant, &[("w1", 8.0)]), [-8.0, 1.0]);
}

/// What stands in no equation, but looks like a part of a solution.
#[test]
fn variables_are_replaced_whatever_else_is_said_of_them() {
    for aside in [
        "equation assert(y - 3 < 100, \"\");",
        "initial equation x = 0*(y - 3) + 1;",
    ] {
        let text = format!(
            "model M Real x; Real y; Real z; {aside} equation y = 2*x; 3 - z = y; der(x) = z; end M;"
        );
        assert_eq!(slopes(&plant(&text), &[("x", 1.0)]), [1.0], "{aside}");
    }
}
