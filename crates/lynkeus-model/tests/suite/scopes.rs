//! What names lead to: those of packages, functions, records and base classes are not those of
//! the model.

use crate::support::{plant, refused, slopes};

/// der(x) of model `M` at x = 1, in a package with the declarations before it.
fn slope(declarations: &str, model: &str) -> f64 {
    let text = format!("package A {declarations} model M Real x; {model} end M; end A;");
    slopes(&plant(&text), &[("x", 1.0)])[0]
}

#[test]
fn a_function_reads_the_constants_of_its_package() {
    let package = "package P constant Real k = 3;
                     function f input Real x; output Real y; algorithm y := k*x; end f; end P;";
    let found = slope(
        package,
        "parameter Real k = 5; equation der(x) = P.f(x) + 10*k;",
    );
    assert_eq!(found, 53.0);
    assert_eq!(slope(package, "equation der(x) = P.f(x) + P.k;"), 6.0);
    // nor does it read what the model declares
    let found = refused(
        "package A package P
           function f input Real x; output Real y; algorithm y := k*x; end f; end P;
         model M parameter Real k = 5; Real x; equation der(x) = P.f(x) + k; end M; end A;",
    );
    assert_eq!(found.message, "`k` is not a variable of this function");
    // but the constants of a model around it
    let inside = "constant Real k = 4;
                  function f input Real x; output Real y; algorithm y := k*x; end f;
                  equation der(x) = f(x) + k;";
    assert_eq!(slope("constant Real k = 3;", inside), 8.0);
}

#[test]
fn the_nearest_package_of_a_name_is_meant() {
    let packages = "package P constant Real c = 2; end P;
                    package B package P constant Real c = 7; end P;
                      function f output Real y; algorithm y := P.c; end f; end B;";
    assert_eq!(slope(packages, "equation der(x) = P.c + 10*B.P.c;"), 72.0);
    assert_eq!(slope(packages, "equation der(x) = P.c + 10*B.f();"), 72.0);
    let imports = "import Q = A.B.P; import A.P.c; equation der(x) = Q.c + 10*c;";
    assert_eq!(slope(packages, imports), 27.0);
}

#[test]
fn constants_are_made_from_those_of_their_package() {
    let packages =
        "package P constant Real a = 2; constant Real b = 2*a; constant Real v[2] = {a, b};
                      record R Real x; Real y; end R; constant R r = R(b, y = a); end P;";
    let model = "parameter Real a = 10; parameter Real p = P.b + a;
                 equation der(x) = P.b + a + p + P.v[2] + 100*P.r.x;";
    assert_eq!(slope(packages, model), 4.0 + 10.0 + 14.0 + 4.0 + 400.0);
}

#[test]
fn modifications_of_several_bases_add_up() {
    let plant = plant(
        "package A partial model Zero Real x(start = 0, min = -9); parameter Real k = 1; end Zero;
           partial model One extends Zero(x(start = 3, max = 8), k = 2); end One;
           model Two extends One(x(min = 0)); equation der(x) = k; end Two; end A;",
    );
    let x = &plant.states[0];
    assert_eq!((x.start, x.min, x.max), (Some(3.0), 0.0, 8.0));
    assert_eq!(slopes(&plant, &[("x", 1.0), ("k", 2.0)]), [2.0]);
}

#[test]
fn defaults_of_records_are_made_from_their_members() {
    let record = "record R Real a; Real b = 2*a; Real c = 3; end R;
                  function f input R r; output Real y; algorithm y := r.a + 10*r.b + 100*r.c; end f;";
    let model =
        |call: &str| format!("parameter Real a = 7; equation der(x) = f(R({call})) + 1000*a;");
    assert_eq!(slope(record, &model("3")), 7363.0);
    assert_eq!(slope(record, &model("a = 1, c = x")), 7121.0);
    assert_eq!(slope(record, &model("b = 5, a = 1")), 7351.0);
    // of variables they would be those of the model
    let declared = |names: &str| {
        let text = format!(
            "package A record R Real a; Real b = 2*a; end R;
             model M parameter Real a = 7; parameter R r({names}); Real x; equation der(x) = r.b + a; end M; end A;"
        );
        lynkeus_model::Plant::from_modelica(&text, "m.mo", &Default::default())
    };
    let found = declared("a = 1").err().map(|e| e.message);
    assert_eq!(
        found.as_deref(),
        Some("the default of `b` in `A.R` needs `a`")
    );
    let found = declared("a = 1, b = 2*a").unwrap();
    assert_eq!(slopes(&found, &[("x", 1.0)]), [21.0]);
}

#[test]
fn an_argument_is_given_once() {
    let text = |call: &str| {
        format!(
            "package A function f input Real a; input Real b = 2; output Real y; algorithm y := a + 10*b; end f;
             record R Real a; Real b = 2; end R;
             function g input R r; output Real y; algorithm y := r.a + 10*r.b; end g;
             model M Real x; equation der(x) = {call}; end M; end A;"
        )
    };
    for call in ["f(1)", "f(1, b = 2)", "f(b = 2, a = 1)", "g(R(1))"] {
        assert_eq!(slopes(&plant(&text(call)), &[("x", 1.0)]), [21.0], "{call}");
    }
    for (call, message) in [
        ("f(1, a = 2)", "input `a` of function `A.f` is given twice"),
        (
            "f(a = 1, a = 2)",
            "input `a` of function `A.f` is given twice",
        ),
        (
            "g(R(1, 2, b = 3))",
            "member `b` of record `A.R` is given twice",
        ),
        ("g(R(1, c = 3))", "record `A.R` has no member of this name"),
        ("g(R(1, 2, 3))", "record `A.R` takes 2 arguments, found 3"),
    ] {
        assert_eq!(refused(&text(call)).message, message, "{call}");
    }
}

#[test]
fn a_type_may_begin_like_a_derivative() {
    let types = "type derating = Real(unit = \"1\");";
    let model = "derating d = 2; derating dx; equation der(x) = dx; dx = d*x;";
    assert_eq!(slope(types, model), 2.0);
}

#[test]
fn elements_declared_by_themselves_are_made_from_each_other() {
    let model =
        "parameter Real p[1] = 3; parameter Real p[2] = p[3] + p[1]; parameter Real p[3] = 2*p[1];
                 parameter Real c[1,2] = p[ 2 ]; parameter Integer i = 2; parameter Real c[1,1] = 1;
                 equation der(x) = p[i] + 100*sum(c);";
    assert_eq!(slope("", model), 9.0 + 1000.0);
    let found = refused(
        "model M parameter Real p[1] = p[2]; parameter Real p[2] = p[1]; Real x; equation der(x) = p[1]; end M;",
    );
    assert!(
        found
            .message
            .starts_with("these declarations need each other: `p[1]` → `p[2]`")
    );
}

/// Names that a package shares with the model, and that only the model means.
#[test]
fn constants_that_nobody_means_need_no_value() {
    let package = "package P constant Real k; constant Real m = f(2); constant Foreign q = 1;
                     function f input Real x; output Real y; external \"C\"; end f; end P;";
    let model = "parameter Real k = 5; Real m = 2; Real q = 1; equation der(x) = k + m + q;";
    assert_eq!(slope(package, model), 8.0);
    let text = format!(
        "package A {package} model M parameter Real k = 5; parameter Real l = 2*k; parameter Real m = 1;
         Real x; equation der(x) = k + l + m; end M; end A;"
    );
    let options = lynkeus_model::LoadOptions {
        symbolic_parameters: true,
        ..Default::default()
    };
    let plant = lynkeus_model::Plant::from_modelica(&text, "m.mo", &options).unwrap();
    let parameters = plant.parameters.iter().map(|p| p.variable.name.as_str());
    assert_eq!(parameters.collect::<Vec<_>>(), ["k", "m"]);
    let used = |name: &str| {
        refused(&format!(
            "package A {package} model M Real x; equation der(x) = {name}; end M; end A;"
        ))
    };
    assert_eq!(used("P.k").message, "parameter `A.P.k` has no value");
    assert_eq!(
        used("P.m").message,
        "function `A.P.f` has no algorithm in this text"
    );
    assert_eq!(used("P.q").message, "unknown type `Foreign`");
}
