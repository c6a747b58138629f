//! What is refused, where, and with which hint.

use lynkeus_model::{LoadOptions, Plant};

use super::{refused, symbolic, valued};

/// Every case is a model's inside, and behind `⟶` the column, the message and the hint.
fn check(cases: &str) {
    for case in cases.lines().map(str::trim).filter(|case| !case.is_empty()) {
        let (inside, expected) = case.split_once(" ⟶ ").unwrap();
        let found = refused(&format!("@ODEmodel({inside})")).one_line();
        let column = |text: &str| Some(text.split_once(": ")?.1.to_owned());
        let place: usize = found.split(':').nth(2).unwrap().parse().unwrap();
        // Columns count from the inside of the model.
        assert_eq!(
            format!("{} {}", place - 10, column(&found).unwrap()),
            expected,
            "{inside}"
        );
    }
}

#[test]
fn equations() {
    check(
        "
        x(t)' = 1 ⟶ 5 expected `=`, found `'` (a derivative reads `x'(t)`)
        x''(t) = 1 ⟶ 1 derivatives of higher order are not supported (add a state for the velocity: `x'(t) = v(t)` and `v'(t) = …`)
        x' = 1 ⟶ 4 expected `(t)` behind `x'`, found `=` (write `x'(t) = …` for a state, `x(t) = …` for an output)
        y = 1 ⟶ 3 expected `(t)` behind `y`, found `=` (write `y'(t) = …` for a state, `y(t) = …` for an output)
        x(t + 1) = x(t) ⟶ 5 expected `x(t)`, found `+` (functions have the argument `t` alone: no delays, no discrete time)
        x'(s) = 1 ⟶ 4 expected `x(t)`, found `s` (functions have the argument `t` alone: no delays, no discrete time)
        1 = x(t) ⟶ 1 expected an equation or `)`, found `1` (equations read `x'(t) = …` for a state, `y(t) = …` for an output)
        x'(t) = 1, x'(t) = 2 ⟶ 12 `x` has two equations (remove one of the two)
        y(t) = 1, y(t) = 2 ⟶ 11 `y` has two equations (remove one of the two)
        x'(t) = 1, x(t) = 2 ⟶ 12 `x` is both a state and an output (give the output a name of its own, as in `y_x(t) = x(t)`)
        exp'(t) = 1 ⟶ 1 `exp` cannot be the name of a variable (choose another name)
        t'(t) = 1 ⟶ 1 `t` cannot be the name of a variable (choose another name)
        time'(t) = 1 ⟶ 1 `time` cannot be the name of a variable (the time is `t`; choose another name for anything else)
        x'(t) = 1 y(t) = 2 ⟶ 11 expected an operator, `,` or `)`, found `y`
        x'(t) = a = b ⟶ 11 expected an operator, `,` or `)`, found `=` (an equation has one `=`)
        x'(t) = 1; y(t) = 2 ⟶ 10 unexpected character ';' (separate equations by commas)
        x'(t) = 1,, ⟶ 11 expected an equation or `)`, found `,` (equations read `x'(t) = …` for a state, `y(t) = …` for an output)
        ",
    );
}

#[test]
fn right_sides() {
    check(
        "
        x'(t) = x'(t) ⟶ 9 a derivative on a right side is not supported (write what `x'(t)` is equal to, from its own equation)
        y(t) = 1, x'(t) = y(t) ⟶ 19 the output `y` stands on a right side (write what `y(t)` is equal to, in states, inputs and parameters)
        x'(t) = x ⟶ 9 `x` stands with and without `(t)` (write `x(t)` everywhere for a function of time, `x` for a parameter)
        x'(t) = u + u(t) ⟶ 13 `u` stands with and without `(t)` (write `u(t)` everywhere for a function of time, `u` for a parameter)
        x'(t) = x(t - tau) ⟶ 13 expected `x(t)`, found `-` (functions have the argument `t` alone: no delays, no discrete time)
        x'(t) = sine(x(t)) ⟶ 9 unknown function `sine` (did you mean `sin` or `sinh` or `asin`?)
        x'(t) = a(b) ⟶ 9 unknown function `a` (functions of time read `a(t)`, products `a*(…)`; there are exp log log10 sqrt sin cos tan asin acos atan sinh cosh tanh abs sign min max)
        x'(t) = exp(1, 2) ⟶ 9 `exp` takes 1 argument, found 2
        x'(t) = exp() ⟶ 9 `exp` takes 1 argument, found 0
        x'(t) = 1/0 ⟶ 9 division by zero
        x'(t) = (1 ⟶ 12 expected an operator, `,` or `)`, found the end of the text (close the model of line 1 with `)`)
        x'(t) = (1 2) ⟶ 12 expected `)`, found `2`
        x'(t) = ⟶ 8 expected an operand, found `)`
        x'(t) = 1 + ⟶ 12 expected an operand, found `)`
        x'(t) = 1 == a ⟶ 11 expected an operator, `,` or `)`, found `=` (an equation has one `=`)
        x'(t) = x(t) < 1 ⟶ 14 unexpected character '<' (conditions are not supported in this notation)
        x'(t) = a[1] ⟶ 10 unexpected character '[' (arrays are not supported: write every element as a function of its own)
        x'(t) = 2 .* a ⟶ 11 unexpected character '.' (operators on arrays are not supported: write the operator without `.`)
        x'(t) = if a b end ⟶ 9 `if` is not supported in a model (a model holds equations such as `x'(t) = …` only)
        x'(t) = \"a\" ⟶ 9 a string here is not supported (use numbers)
        x'(t) = (1, 2) ⟶ 11 expected `)`, found `,`
        x'(t) = x(t)' ⟶ 13 expected an operator, `,` or `)`, found `'` (a derivative reads `x'(t)`)
        x'(t) = 1f0 ⟶ 9 this form of number is not supported (numbers read `12`, `1_000`, `1//2`, `0.5` or `1.0e-3`)
        x'(t) = 1e999 ⟶ 9 the number 1e999 is too large
        x'(t) = time ⟶ 9 `time` cannot be the name of a variable (the time is `t`; choose another name for anything else)
        x'(t) = t(t) ⟶ 9 `t` is the time, not a function of it
        ",
    );
}

#[test]
fn whole_texts() {
    for (text, expected) in [
        (
            "",
            "1:1: the text holds no `@ODEmodel` (a model reads `name = @ODEmodel(x'(t) = …, y(t) = …)`)",
        ),
        (
            "x = @ODEmodel()",
            "1:5: the model has no equations (write `x'(t) = …` for states and `y(t) = …` for outputs)",
        ),
        (
            "x = @ODEmodel begin\nend",
            "1:5: expected `(` directly behind `@ODEmodel` (a model reads `@ODEmodel(x'(t) = …, y(t) = …)`)",
        ),
        (
            "@ODEmodel(x'(t) = 1",
            "1:20: expected an operator, `,` or `)`, found the end of the text (close the model of line 1 with `)`)",
        ),
        (
            "@ODEmodel(x'(t) = 1,",
            "1:21: expected an equation or `)`, found the end of the text (close the model of line 1 with `)`)",
        ),
        (
            "#= @ODEmodel(",
            "1:1: this comment has no end (close it with `=#`)",
        ),
        (
            "a = \" @ODEmodel(",
            "1:5: this string has no end (close it with `\"`)",
        ),
    ] {
        assert_eq!(
            refused(text).one_line(),
            format!("test.jl:{expected}"),
            "{text}"
        );
    }
}

#[test]
fn two_models_of_one_name() {
    let text = "m = @ODEmodel(x'(t) = 1)\nm = @ODEmodel(x'(t) = 2)";
    let model = Some("m".to_owned());
    let options = LoadOptions {
        model,
        ..symbolic()
    };
    assert_eq!(
        Plant::from_ode_model(text, "m.jl", &options)
            .unwrap_err()
            .one_line(),
        "m.jl:2:5: two models are called `m` \
         (give each a name of its own: `name = @ODEmodel(…)`)"
    );
}

#[test]
fn values_of_parameters() {
    let text = "m = @ODEmodel(x'(t) = -k*x(t) + rate)";
    let refused = |given: &[(&str, f64)]| {
        let refused = Plant::from_ode_model(text, "m.jl", &valued(given));
        refused.unwrap_err().one_line()
    };
    assert_eq!(
        refused(&[("k", 1.0)]),
        "m.jl:1:33: parameter `rate` has no value (this notation has no values: give them on loading)"
    );
    assert_eq!(
        refused(&[("k", 1.0), ("raet", 1.0)]),
        "m.jl:1:5: the model has no parameter `raet` (did you mean `rate`?)"
    );
    assert_eq!(
        refused(&[("k", f64::NAN), ("rate", 1.0)]),
        "m.jl:1:24: parameter `k` is given the value NaN (give a finite number)"
    );
}

#[test]
fn rendering() {
    let text = "# two tanks\nm = @ODEmodel(\n  β'(t) = -k*β(t),\n  β'(t) = 1\n)\n";
    let expected = "error: `β` has two equations
 --> test.jl:4:3
  |
4 |   β'(t) = 1
  |   ^ the other equation is on line 3
  |
help: remove one of the two";
    assert_eq!(refused(text).to_string(), expected);
}
