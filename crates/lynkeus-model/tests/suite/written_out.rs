//! What models are made from besides equations: functions, algorithms, types, records, base
//! classes, imports, assertions, initial equations.

use lynkeus_model::{LoadOptions, Plant};

use crate::support::{plant, refused, slopes, values};

fn algebraic(plant: &Plant, name: &str, given: &[(&str, f64)]) -> f64 {
    let mut known = plant.algebraics.iter().chain(&plant.outputs);
    let variable = known.find(|variable| variable.name == name).unwrap();
    values(plant, &[variable.node], given)[0]
}

#[test]
fn functions_are_written_out() {
    let plant = plant(
        "package P
           function power \"x^n by squaring nothing\"
             input Real x; input Integer n = 3; output Real y;
           algorithm
             y := 1; for i in 1:n loop y := y*x; end for;
           end power;
           function both input Real x[:]; output Real least; output Real total; protected Real s;
           algorithm
             s := 0; least := x[1];
             for i in 1:size(x, 1) loop
               s := s + x[i];
               if x[i] < least then least := x[i]; end if;
             end for;
             total := s;
           end both;
           function clipped input Real x; input Real top; output Real y;
           algorithm
             if x > top then y := top; elseif x < -top then y := -top; else y := power(x, n = 1); end if;
           end clipped;
           model M Real x(start = 2); Real a; Real b; Real c;
           equation
             der(x) = power(x) + clipped(x, 1);
             (a, b) = both({x, 3, 2*x});
             (, c) = both({x, x});
           end M;
         end P;",
    );
    assert_eq!(slopes(&plant, &[("x", 2.0)]), [9.0]);
    assert_eq!(slopes(&plant, &[("x", -0.5)]), [-0.125 - 0.5]);
    assert_eq!(slopes(&plant, &[("x", -3.0)]), [-27.0 - 1.0]);
    for (x, least, total) in [(2.0, 2.0, 9.0), (-1.0, -2.0, 0.0), (5.0, 3.0, 18.0)] {
        assert_eq!(algebraic(&plant, "a", &[("x", x)]), least);
        assert_eq!(algebraic(&plant, "b", &[("x", x)]), total);
        assert_eq!(algebraic(&plant, "c", &[("x", x)]), 2.0 * x);
    }
}

#[test]
fn functions_that_cannot_be_written_out() {
    let text = |function: &str, call: &str| {
        format!("package P {function} model M Real x; equation der(x) = {call}; end M; end P;")
    };
    let fact = "function f input Real x; output Real y; algorithm y := x*f(x - 1); end f;";
    let ping = "function f input Real x; output Real y; algorithm y := g(x); end f;
                function g input Real x; output Real y; algorithm y := f(x); end g;";
    let none = "function f input Real x; output Real y; algorithm end f;";
    let half =
        "function f input Real x; output Real y; algorithm if x > 0 then y := x; end if; end f;";
    let open = "function f input Real x; output Real y; external \"C\" y = c(x); end f;";
    let loops = "function f input Real x; output Real y; algorithm y := x; while y > 1 loop y := y/2; end while; end f;";
    let late = "function f input Real x; output Real y; protected Real z; algorithm y := z; z := x; end f;";
    let other = "function f input Real x; output Real y; algorithm x := 2; z := x; end f;";
    let stop = "function f input Real x; output Real y; algorithm y := 1; if x > 0 then return; end if; y := 2; end f;";
    for (function, call, message) in [
        (fact, "f(x)", "function `P.f` calls itself"),
        (ping, "f(x)", "function `P.f` calls itself"),
        (
            none,
            "f(x)",
            "output `y` of function `P.f` is not given a value",
        ),
        (
            half,
            "f(x)",
            "output `y` of function `P.f` is not given a value",
        ),
        (open, "f(x)", "function `P.f` has no algorithm in this text"),
        (loops, "f(x)", "this `while` depends on variables"),
        (
            late,
            "f(x)",
            "`z` is read before it has a value in every case",
        ),
        (other, "f(x)", "`z` cannot be given a value here"),
        (
            stop,
            "f(x)",
            "`break` or `return` under a condition that depends on variables",
        ),
        (none, "f(x, 1)", "function `P.f` takes 1 arguments, found 2"),
        (none, "f()", "input `x` of function `P.f` is not given"),
        (none, "f(z = 1)", "function `P.f` has no input of this name"),
        (
            none,
            "f({x, x})",
            "`x` has the size a scalar, its value has [2]",
        ),
    ] {
        let found = refused(&text(function, call));
        assert_eq!(found.message, message, "{function} {call}");
        assert!(found.line >= 1 && found.column > 1);
    }
}

#[test]
fn algorithms_give_equations() {
    let plant = plant(
        "model M input Real u; Real x; Real a; Real v[3];
         algorithm
           a := u; a := a*a + x;
           for i in 1:3 loop v[i] := i*a; end for;
           if x > 1 then v[2] := 0; end if;
         equation
           der(x) = sum(v);
         end M;",
    );
    assert_eq!(slopes(&plant, &[("x", 1.0), ("u", 2.0)]), [30.0]);
    assert_eq!(slopes(&plant, &[("x", 2.0), ("u", 2.0)]), [24.0]);
    let found = refused(
        "model M Real x; Real a; equation der(x) = a; algorithm if x > 0 then a := 1; end if; end M;",
    );
    assert_eq!(
        found.message,
        "`a` is read before it has a value in every case"
    );
}

#[test]
fn types_bases_and_imports() {
    let plant = plant(
        "package P
           import Modelica.Constants.pi;
           constant Real g = 9.81;
           type Angle = Real(unit = \"rad\", min = -3);
           type Small = Angle(max = 0.5);
           partial model Swing parameter Real l = 1; Small phi(start = 0.1); Real w(start = 0);
             equation der(phi) = w; end Swing;
           model Pendulum \"hangs\"
             import SI = Modelica.Units.SI;
             extends Swing(l = 2, phi(start = 0.2, max = 1));
             SI.Mass m = 3; Modelica.Units.SI.Temperature T(max = 400) = 300;
           equation der(w) = -g/l*sin(phi)*pi; end Pendulum;
         end P;",
    );
    assert_eq!(plant.name, "P.Pendulum");
    let phi = &plant.states[0];
    assert_eq!(
        (phi.unit.as_deref(), phi.min, phi.max),
        (Some("rad"), -3.0, 1.0)
    );
    assert_eq!(phi.start, Some(0.2));
    let slope = slopes(&plant, &[("phi", 0.3), ("w", 1.5)]);
    assert_eq!(slope[0], 1.5);
    let expected = -9.81 / 2.0 * 0.3f64.sin() * std::f64::consts::PI;
    assert!((slope[1] - expected).abs() < 1e-14);
    let mass = plant.algebraics.iter().find(|v| v.name == "m").unwrap();
    assert_eq!((mass.unit.as_deref(), mass.min), (Some("kg"), 0.0));
    let found = refused("package P model M extends M; Real x; equation der(x) = 1; end M; end P;");
    assert_eq!(found.message, "`P.M` is made from itself");
}

#[test]
fn records_are_their_members() {
    let plant = plant(
        "package P
           record Point Real x; Real y; end Point;
           record Line Point a; Point b; Real w[2]; end Line;
           function swap input Point p; output Point q; algorithm q := Point(p.y, p.x); end swap;
           function mean input Line l; output Real m; algorithm m := (l.a.x + l.b.x)/2; end mean;
           model M
             parameter Point p(x = 2, y = 3); Point q; Point r; Line l(w = {1, 2}); Point s[2]; Real m;
             Real z(start = 1);
           equation
             q = swap(p); r = Point(z, 2*z); l.a.y = z; l.b = r; l.a.x = 5;
             s[1] = q; s[2] = Point(x = z, y = 0);
             m = mean(l); der(z) = q.x + 10*q.y + 100*s[2].x;
           end M;
         end P;",
    );
    // q = (3, 2)
    assert_eq!(slopes(&plant, &[("z", 4.0)]), [3.0 + 20.0 + 400.0]);
    assert_eq!(algebraic(&plant, "m", &[("z", 4.0)]), 4.5);
    assert_eq!(plant.parameters.len(), 2);
    assert_eq!(plant.parameters[0].variable.name, "p.x");
}

/// A record of a function is what it is declared with, unless something else is given to it.
#[test]
fn records_of_functions_have_the_values_they_are_declared_with() {
    let text = |call: &str| {
        format!(
            "package P
               record R Real a; Real b; end R;
               function f input Real u; input R r = R(u, 2*u); output Real v;
                 protected R s = R(r.b, 10); R t;
                 algorithm t := r; t.a := 100; v := s.a + s.b*r.a + t.a; end f;
               function g input R r; output Real v = r.a; algorithm end g;
               model M Real z; equation der(z) = {call}; end M;
             end P;"
        )
    };
    // 2u + 10u + 100, and 4 + 10·3 + 100
    let by_default = plant(&text("f(z)"));
    assert_eq!(slopes(&by_default, &[("z", 3.0)]), [136.0]);
    let given = plant(&text("f(z, R(3, 4))"));
    assert_eq!(slopes(&given, &[("z", 3.0)]), [134.0]);
    for (call, message) in [
        ("g()", "input `r` of function `P.g` is not given"),
        ("g(3)", "`r` takes a record, found a number"),
    ] {
        assert_eq!(refused(&text(call)).message, message);
    }
}

#[test]
fn names_in_quotes_and_with_dots_are_one() {
    let plant = plant(
        "//! base 0.1.0
         package 'M'
           model 'M'
             parameter Real 'r.R' = 2; Real 'c.v'(start = 1.0, fixed = true); Real r.i; Real 'x[1]'; Real 'x[2]';
             input Real u; input Real 'r.u' = u; parameter Boolean 'on' = true; Boolean 'high'; parameter String s = \"n\";
           equation
             'r'.'R'*r.i = 'c.v'; der(c.v) = -'r.i' + (if high and on then sum(x) else 0) + r.u;
             'x[1]' = 1; x[2] = 'x[1]' + 1; high = c.v > 3;
             annotation(experiment(StopTime = 1.0));
           end 'M';
         end 'M';",
    );
    let twice =
        refused("model M Real 'c[1]'; Real c[2]; equation der(c) = {1, 2}; 'c[1]' = 1; end M;");
    assert_eq!(twice.message, "`c[1]` is declared twice");
    assert_eq!(plant.name, "M");
    assert_eq!(plant.states[0].name, "c.v");
    assert_eq!(plant.inputs.len(), 1);
    assert_eq!(slopes(&plant, &[("c.v", 2.0), ("u", 0.5)]), [-0.5]);
    assert_eq!(slopes(&plant, &[("c.v", 4.0), ("u", 0.5)]), [1.5]);
}

#[test]
fn initial_equations_set_starts() {
    let text =
        "model M parameter Real T0 = 90; Real T(start = 1); Real y; Real z(start = 5); Real w;
         initial equation
           T = T0; 2*y = 8; der(w) = 0;
         equation
           der(T) = -T; der(z) = 1; y = z + 1; der(w) = z;
         end M;";
    let plant = plant(text);
    let start = |name: &str| {
        let state = plant.states.iter().find(|s| s.name == name).unwrap();
        (state.start, state.fixed)
    };
    assert_eq!(start("T"), (Some(90.0), true));
    assert_eq!(start("z"), (Some(3.0), true));
    assert_eq!(start("w"), (None, false));
    assert_eq!(plant.warnings.len(), 1);
    let warning = plant.warnings[0].to_string();
    assert!(
        warning.starts_with("warning: an initial equation of a derivative"),
        "{warning}"
    );
    let options = LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    };
    let symbolic = Plant::from_modelica(text, "m.mo", &options).unwrap();
    assert_eq!(symbolic.states[0].start, Some(90.0));
    assert_eq!(
        symbolic.states[0].start_node,
        Some(symbolic.parameters[0].variable.node)
    );
}

#[test]
fn assertions_are_conditions_over_the_states() {
    let plant = plant(
        "model M parameter Real k = 1; Real x; Real y;
         equation
           der(x) = -k*x; y = 2*x;
           assert(y < 3, \"y is large: \" + String(y)); assert(k > 0, \"k\");
           if x > 1 then assert(y > 2.5, \"inside\", AssertionLevel.warning); end if;
         end M;",
    );
    assert_eq!(plant.assertions.len(), 2);
    let holds =
        |place: usize, x: f64| values(&plant, &[plant.assertions[place].condition], &[("x", x)])[0];
    assert_eq!((holds(0, 1.0), holds(0, 2.0)), (1.0, 0.0));
    assert_eq!(
        (holds(1, 0.0), holds(1, 1.1), holds(1, 2.0)),
        (1.0, 0.0, 1.0)
    );
    assert_eq!(plant.assertions[0].message, "y is large: ");
    assert_eq!(plant.assertions[0].line, 4);
    assert!(plant.assertions[1].is_warning && !plant.assertions[0].is_warning);
    let at_start = crate::support::plant(
        "model M Real x(start = 2); equation der(x) = -x; assert(x < 1, \"x\"); assert(x > 1, \"\"); end M;",
    );
    let told = &at_start.warnings[0];
    assert_eq!(told.message, "this assertion fails at the start: x");
    assert_eq!(at_start.warnings.len(), 1);
    let found = refused(
        "model M parameter Real k = 1; Real x; equation der(x) = k; assert(k < 0, \"no\"); end M;",
    );
    assert_eq!(found.message, "this assertion does not hold: no");
}

#[test]
fn assertions_count_where_their_branch_is_taken() {
    let text = |slope: &str| {
        format!(
            "package A function f input Real x; output Real y; algorithm assert(x > 1, \"low\"); y := x; end f;
             model M Real x(start = -1); Real a;
             algorithm a := 1; if x > 5 then a := 2; elseif x > 4 then a := f(x - 4.5); end if;
             equation der(x) = {slope}; end M; end A;"
        )
    };
    for slope in [
        "a + (if x > 2 then 1 elseif x > 0 then f(x) else 2)",
        "a + (if x <= 0 then 2 elseif x > 2 then 1 else f(x))",
    ] {
        let plant = plant(&text(slope));
        assert_eq!(plant.warnings.len(), 0, "{slope}");
        assert_eq!(plant.assertions.len(), 2);
        let conditions: Vec<_> = plant.assertions.iter().map(|a| a.condition).collect();
        for (x, holds) in [
            (-1.0, [1.0, 1.0]),
            (0.5, [0.0, 1.0]),
            (1.5, [1.0, 1.0]),
            (4.2, [1.0, 0.0]),
            (6.0, [1.0, 1.0]),
        ] {
            let mut found = values(&plant, &conditions, &[("x", x)]);
            found.sort_by(f64::total_cmp);
            let mut holds = holds.to_vec();
            holds.sort_by(f64::total_cmp);
            assert_eq!(found, holds, "{slope} at {x}");
        }
    }
}

#[test]
fn sizes_of_variables_without_a_value_yet() {
    let plant = plant(
        "package P
           function f input Real x[:]; output Real y[size(x, 1)];
           algorithm for i in 1:size(y, 1) loop y[i] := i*x[i]; end for; end f;
           model M Real x; Real v[3]; equation v = f({x, 2, 3}); der(x) = sum(v); end M;
         end P;",
    );
    assert_eq!(slopes(&plant, &[("x", 1.0)]), [1.0 + 4.0 + 9.0]);
}

#[test]
fn derivatives_of_expressions() {
    let plant = plant(
        "model M Real y(start = 1); Real T(start = 2); input Real w;
         equation der(y) = w; der(y*T + sin(time)) = 3; end M;",
    );
    // y T' + y' T + cos t = 3
    let slope = slopes(&plant, &[("y", 2.0), ("T", 5.0), ("w", 0.5)]);
    assert_eq!(slope, [0.5, (3.0 - 0.5 * 5.0 - 1.0) / 2.0]);
}

#[test]
fn linear_loops_are_solved() {
    let plant = plant(
        "model M input Real u; parameter Real R[3] = {1, 2, 3}; Real x; Real i[3]; Real v;
         equation
           u - v = R[1]*i[1]; v = R[2]*i[2]; v - x = R[3]*i[3]; i[1] = i[2] + i[3]; der(x) = i[3];
         end M;",
    );
    // v (1/1 + 1/2 + 1/3) = u + x/3
    let (u, x) = (6.0, 1.5);
    let v: f64 = (u + x / 3.0) / (1.0 + 0.5 + 1.0 / 3.0);
    let slope = slopes(&plant, &[("u", u), ("x", x)]);
    assert!((slope[0] - (v - x) / 3.0).abs() < 1e-14, "{slope:?}");
    let found = refused(
        "model M Real x; Real a; Real b; equation der(x) = a; a + b = x; 2*a + 2*b = 3*x; end M;",
    );
    assert!(
        found
            .message
            .starts_with("these equations do not determine"),
        "{found}"
    );
}

#[test]
fn states_that_follow_from_others() {
    // two rotors on one shaft, a spring whose twist is a state of its own
    let plant = plant(
        "model M parameter Real J1 = 2; parameter Real J2 = 3; input Real tau;
           Real phi1(start = 0, fixed = true); Real w1(start = 0, fixed = true); Real phi2; Real w2; Real cut;
           Real rel; Real wrel;
         equation
           w1 = der(phi1); w2 = der(phi2); J1*der(w1) = tau - cut; J2*der(w2) = cut - 4*rel - wrel;
           phi1 = phi2; rel = phi2 - 1; wrel = der(rel);
         end M;",
    );
    assert_eq!(
        plant
            .states
            .iter()
            .map(|s| s.name.as_str())
            .collect::<Vec<_>>(),
        ["phi1", "w1"]
    );
    let slope = slopes(&plant, &[("phi1", 0.5), ("w1", 2.0), ("tau", 7.0)]);
    assert_eq!(slope[0], 2.0);
    assert!((slope[1] - (7.0 - 4.0 * (-0.5) - 2.0) / 5.0).abs() < 1e-14);
    let bound = refused("model M input Real u; Real x; Real f; equation der(x) = f; x = u; end M;");
    assert_eq!(bound.message, "this equation binds states to the input `u`");
}
