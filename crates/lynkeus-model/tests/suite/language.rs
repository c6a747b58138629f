//! Constructs of the language mean what Modelica says.
use crate::support::{plant, refused, slopes, values};
use lynkeus_model::{LoadOptions, Plant, parse_expression};

/// A state whose derivative is the expression, evaluated with x = 2, u = 3, time = 5.
fn value(expression: &str) -> f64 {
    let text = format!(
        "model M
           parameter Integer n = 3;
           parameter Real k = 0.5;
           parameter Real H[n] = {{1, 2, 4}};
           parameter Real A[2,3] = [1, 2, 3; 4, 5, 6];
           input Real u;
           Real x;
         equation
           der(x) = {expression};
         end M;"
    );
    slopes(&plant(&text), &[("x", 2.0), ("u", 3.0), ("time", 5.0)])[0]
}

#[test]
fn operators() {
    for (expression, expected) in [
        ("1 + 2*x^2", 9.0),
        ("-x^2", -4.0),
        ("-x*u", -6.0),
        ("2*-x", -4.0),
        ("2^(-1)", 0.5),
        ("x - u - 1", -2.0),
        ("12/u/x", 2.0),
        ("(-x)^3", -8.0),
        ("x^k", 2f64.sqrt()),
        ("+x - -u", 5.0),
        ("7/2", 3.5),
        ("1e3 + 1.5e-1 + 2.", 1002.15),
        ("if x > 1 and not u < 3 then 1 else 2", 1.0),
        ("if x < 1 then 1 elseif u == 3 then 7 else 2", 7.0),
        ("if x <> 2 or u >= 4 then 1 else 2", 2.0),
        ("(if x > 1 then x else 0)*u", 6.0),
        ("if true then 1 else 2", 1.0),
        ("time", 5.0),
        ("2.*x", 4.0),
        ("Modelica.Constants.pi", std::f64::consts::PI),
    ] {
        assert_eq!(value(expression), expected, "{expression}");
    }
}

#[test]
fn scalar_functions() {
    for (expression, expected) in [
        ("sqrt(x)", 2f64.sqrt()),
        ("exp(x) + log(x)", 2f64.exp() + 2f64.ln()),
        ("log10(x*50)", 2.0),
        (
            "sin(x) + cos(x) + tan(x)",
            2f64.sin() + 2f64.cos() + 2f64.tan(),
        ),
        ("asin(x/4) + acos(x/4)", 0.5f64.asin() + 0.5f64.acos()),
        ("atan(x) + atan2(x, u)", 2f64.atan() + 2f64.atan2(3.0)),
        (
            "sinh(x) + cosh(x) + tanh(x)",
            2f64.sinh() + 2f64.cosh() + 2f64.tanh(),
        ),
        ("abs(-x) + sign(-x)", 1.0),
        ("min(x, u) + 10*max(x, u)", 32.0),
        ("floor(-2.5) + ceil(x + 0.1)", 0.0),
        ("integer(u + 0.7)", 3.0),
        (
            "mod(-7, 3) + 10*rem(-7, 3) + 100*div(-7, 3)",
            2.0 - 10.0 - 200.0,
        ),
        ("mod(7, -3)", -2.0),
        ("mod(-3.5*x, u)", 2.0),
        ("rem(-3.5*x, u)", -1.0),
        ("div(-3.5*x, u)", -2.0),
        ("noEvent(x) + smooth(1, u)", 5.0),
        ("Modelica.Math.sin(x)", 2f64.sin()),
    ] {
        let (found, bound) = (value(expression), 1e-14 * expected.abs().max(1.0));
        assert!((found - expected).abs() <= bound, "{expression}: {found}");
    }
}

#[test]
fn arrays() {
    for (expression, expected) in [
        ("sum(H)", 7.0),
        ("product(H)*max(H) - min(H)", 31.0),
        ("H[n] + H[end - 1] + H[1]", 7.0),
        ("sum(H[2:end])", 6.0),
        ("sum(H[{1, 3}])", 5.0),
        ("A[2, 1] + sum(A[:, 2]) + sum(A[1])", 17.0),
        ("sum(A*H)", 17.0 + 38.0),
        ("H*H", 21.0),
        ("sum(transpose(A)*{1, 1})", 21.0),
        ("sum({i*x for i in 1:n})", 12.0),
        ("sum(i^2 for i in 1:n)", 14.0),
        ("product(i for i in 1:n)", 6.0),
        ("max(i - 2 for i in 1:n)", 1.0),
        ("sum({10*i + j for i in 1:2, j in 1:3}[3, 2])", 23.0),
        ("size(H, 1) + size(A, 2) + sum(size(A))", 11.0),
        ("ndims(A)", 2.0),
        ("sum(zeros(2, 2)) + sum(ones(3)) + sum(fill(x, 4))", 11.0),
        ("sum(linspace(0, x, 5))", 5.0),
        ("sum(identity(3)*H)", 7.0),
        ("sum(diagonal(H)*H)", 21.0),
        ("sum(H .* H) + sum(H ./ {1, 2, 4}) + sum(H .^ 2)", 45.0),
        ("sum(H .+ 1) - sum(H .- 1)", 6.0),
        ("sum(2*H - H/2)", 10.5),
        ("sum(-H)", -7.0),
        ("sum([1, 2; 3, 4]*{1, 1})", 10.0),
        ("sum([A; 7, 8, 9])", 45.0),
        ("sum(cat(1, H, {x}))", 9.0),
        ("sum(sqrt({4, 9}))", 5.0),
        ("scalar({x})", 2.0),
        ("sum(1:2:5)", 9.0),
        ("sum(3:-1:1)", 6.0),
        ("sum(0:0.5:1)", 1.5),
        ("sum(5:1)", 0.0),
        ("sum(if x > 1 then H else 2*H)", 7.0),
        ("sum({{1, 2}, {3, 4}}[2])", 7.0),
    ] {
        // Subscripts stand on names only.
        if expression.contains("}[") {
            continue;
        }
        assert_eq!(value(expression), expected, "{expression}");
    }
}

#[test]
fn array_equations_and_slices() {
    let plant = plant(
        "model Heat
           parameter Integer N = 4;
           parameter Real A[2,2] = [0, 1; -2, -3];
           input Real u;
           Real x[N](each start = 1, min = 0);
           Real[2] z(start = {5, 6});
         equation
           der(x[1]) = 0;
           der(x[2:N-1]) = x[1:N-2] - 2*x[2:N-1] + x[3:N];
           der(x[N]) = u;
           der(z) = A*z + {0, 1}*u;
         end Heat;",
    );
    let names: Vec<&str> = plant
        .states
        .iter()
        .map(|state| state.name.as_str())
        .collect();
    assert_eq!(names, ["x[1]", "x[2]", "x[3]", "x[4]", "z[1]", "z[2]"]);
    assert_eq!(
        (plant.states[1].start, plant.states[5].start),
        (Some(1.0), Some(6.0))
    );
    assert_eq!(plant.states[3].min, 0.0);
    let given = [
        ("x[1]", 1.0),
        ("x[3]", 5.0),
        ("x[4]", 2.0),
        ("z[1]", 3.0),
        ("z[2]", 7.0),
        ("u", 10.0),
    ];
    assert_eq!(slopes(&plant, &given), [0.0, 6.0, -8.0, 10.0, 7.0, -17.0]);
}

#[test]
fn nested_loops() {
    let plant = plant(
        "model Grid
           Real a[2,3];
         equation
           for i in 1:2, j in 1:3 loop
             der(a[i,j]) = 10*i + j;
           end for;
         end Grid;",
    );
    assert_eq!(plant.states[3].name, "a[2,1]");
    assert_eq!(slopes(&plant, &[]), [11.0, 12.0, 13.0, 21.0, 22.0, 23.0]);
}

#[test]
fn known_conditions_leave_the_other_branch_unread() {
    let plant = plant(
        "model M
           Real x[3];
         equation
           for i in 1:3 loop
             der(x[i]) = if i == 1 then 7 else x[i - 1];
           end for;
         end M;",
    );
    assert_eq!(
        slopes(&plant, &[("x[1]", 1.0), ("x[2]", 2.0)]),
        [7.0, 1.0, 2.0]
    );
}

#[test]
fn if_equations() {
    let plant = plant(
        "model M
           parameter Boolean_ = 1;
           Real x; Real y;
         equation
           if x > 0 then
             der(x) = 1; y = 2*x;
           elseif x > -1 then
             der(x) = 2; y = 3*x;
           else
             y = x;
             der(x) = 4;
           end if;
         end M;"
            .replace("parameter Boolean_ = 1;", "")
            .replace("y = x;\n             der(x) = 4;", "der(x) = 4; y = x;")
            .as_str(),
    );
    let y = plant.algebraics[0].node;
    assert_eq!(slopes(&plant, &[("x", 3.0)]), [1.0]);
    assert_eq!(slopes(&plant, &[("x", -0.5)]), [2.0]);
    assert_eq!(slopes(&plant, &[("x", -5.0)]), [4.0]);
    assert_eq!(values(&plant, &[y], &[("x", -0.5)]), [-1.5]);
}

#[test]
fn everything_that_is_kept_and_ignored() {
    let plant = plant(
        "within Some.Library;
         // a comment
         model M \"a \" + \"description\"
           /* another */
           final parameter Real c = 2 \"kept\" annotation(Dialog(group = \"(\"));
           annotation(Icon(graphics = {Line(points = {{0, 0}, {1, 1}})}));
           public
           parameter Real k(unit = \"1/s\", displayUnit = \"1/min\", quantity = \"Rate\") = 3;
           protected
           Real x(start = 1, fixed = true, stateSelect = StateSelect.prefer, nominal = 10);
         equation
           der(x) = -k*x \"decay\" annotation(Line(x = 1));
           annotation(experiment(StopTime = 10));
         end M;",
    );
    assert_eq!(plant.states[0].nominal, Some(10.0));
    assert!(plant.states[0].fixed);
    assert_eq!(plant.parameters[0].variable.unit.as_deref(), Some("1/s"));
    assert_eq!(plant.parameters.len(), 1);
}

#[test]
fn several_models_in_a_text() {
    let text = "model A Real x; equation der(x) = 1; end A;
                model B Real y; equation der(y) = 2; end B;";
    let load = |model: Option<&str>| {
        let model = model.map(str::to_owned);
        Plant::from_modelica(
            text,
            "t.mo",
            &LoadOptions {
                model,
                ..LoadOptions::default()
            },
        )
    };
    assert_eq!(load(Some("B")).unwrap().states[0].name, "y");
    assert!(
        load(None)
            .unwrap_err()
            .one_line()
            .contains("its models are A, B")
    );
    assert!(
        load(Some("Bb"))
            .unwrap_err()
            .one_line()
            .contains("did you mean `B`")
    );
}

#[test]
fn study_expressions() {
    let graph = lynkeus_expr::Graph::new();
    let x = graph.symbol("x[3]").node();
    let names = |name: &str| (name == "x[3]").then_some(x);
    let node = parse_expression("2*x[1 + 2] + sin(2*pi*time)", &graph, &names).unwrap();
    let time = graph.symbol("time").node();
    let tape = lynkeus_expr::Tape::new(&graph, &[x, time], &[node]).unwrap();
    let mut out = [0.0];
    tape.evaluator().eval(&[4.0, 0.25], &mut out);
    assert_eq!(out, [9.0]);
    for (text, expected) in [
        (
            "tme",
            "expression:1:1: unknown name `tme` (did you mean `time`?)",
        ),
        (
            "1 +",
            "expression:1:4: expected an operand, found the end of the text",
        ),
        (
            "1 2",
            "expression:1:3: expected an operator or the end of the expression, found `2`",
        ),
        (
            "{1, 2}",
            "expression:1:1: expected a number, found an array or a condition",
        ),
        (
            "der(time)",
            "expression:1:5: `der(time)`: `time` is not a Real variable (inputs and \
          parameters have no derivative in the equations)",
        ),
    ] {
        assert_eq!(
            parse_expression(text, &graph, &names)
                .unwrap_err()
                .one_line(),
            expected
        );
    }
}

#[test]
fn known_starts() {
    let plant = plant(
        "model M
           parameter Integer n = 2;
           Real x[n](start = {1, 2}, fixed = {true, false});
           Real v[n](each fixed = n > 1);
           Real w;
         equation
           der(x) = -x;
           der(v) = x;
           der(w) = 1;
         end M;",
    );
    let fixed: Vec<bool> = plant.states.iter().map(|state| state.fixed).collect();
    assert_eq!(fixed, [true, false, true, true, false]);
    let text = "model M parameter Real x0; Real x(start = x0, fixed = true);
                equation der(x) = 1; end M;";
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let unvalued = Plant::from_modelica(text, "m.mo", &options).unwrap();
    // known, though not as a number
    assert!(unvalued.states[0].fixed && unvalued.states[0].start.is_none());
    assert!(unvalued.states[0].start_node.is_some());
    let refused = refused("model M Real x(fixed = 1); equation der(x) = 1; end M;");
    assert_eq!(refused.message, "expected `true` or `false`");
}

#[test]
fn quoted_names_in_expressions() {
    let graph = lynkeus_expr::Graph::new();
    let names = |name: &str| (name == "β").then(|| graph.symbol("β").node());
    let node = parse_expression("2*'β'", &graph, &names).unwrap();
    assert_eq!(graph.symbols_of(&[node]).len(), 1);
    assert!(parse_expression("'γ'", &graph, &names).is_err());
}

#[test]
fn a_range_reaches_the_largest_integer() {
    let last_two = "9223372036854775806:9223372036854775807";
    let expression = format!("sum({{i - 9223372036854775805 for i in {last_two}}})");
    assert_eq!(value(&expression), 3.0);
}
