//! Every refusal says where, what, and what to do.

use lynkeus_model::{LoadError, LoadOptions, Plant};

use crate::support::refused;

/// Declarations and equations of a model, with the expected place in its text.
fn one_line(declarations: &str, equations: &str) -> String {
    let text = format!(
        "model M\n  Real x[3]; Real z; input Real u; parameter Integer n = 3;\n  {declarations}\n\
         equation\n  {equations}\n  der(x) = zeros(3); der(z) = u;\nend M;\n"
    );
    refused(&text).one_line()
}

/// Lines of `declarations | equations | part of the refusal`.
fn check(cases: &str) {
    for case in cases.lines().filter(|line| !line.trim().is_empty()) {
        let mut parts = case.split('|').map(str::trim);
        let mut part = || parts.next().unwrap();
        let found = one_line(part(), part());
        assert!(found.contains(part()), "{case}\n{found}");
    }
}

#[test]
fn constructs_outside_the_subset() {
    check(
        r#"
         | connect(a, b); | :5:3: the model is not flat: it has `connect` (flatten it first: `omc -f
         | x[1] = delay(u, z); | :5:10: the time of `delay` changes: expected a number or a parameter (where a flow
         | x[1] = delay(u, -1); | :5:10: a delay of -1: expected a time >= 0
         | x[1] = delay(u); | `delay` takes 2 arguments, found 1
         | z = spatialDistribution(z, z); | `spatialDistribution` is not supported
         | assert(z > 0, "negative"; | expected `)` after the message of the `assert`
         | assert(1 > 2, "never"); | :5:3: this assertion does not hold: never
         | z := 1; | :5:5: expected `=`, found `:=` (`:=` assigns in algorithms
         | z == 1; | expected `=`, found `;`
         | (z, u) = f(x); | the text has no function `f` with several outputs
         | z = f(x); | unknown function `f` (the text holds no function of this name
         | z = ln(u); | the natural logarithm is `log`
         | z = srt(u); | did you mean `sqrt`?
         | z = x(1); | subscripts stand in `[…]`
        input Boolean b; |  | :3:17: a Boolean input is not supported (use a Real
        String s; |  | String variables are not supported
        Tank tank; |  | :3:3: unknown type `Tank` (components of other models
        Modelica.Units.SI.Mas m; |  | the library type `Modelica.Units.SI.Mas` is not known here
        extends Base; |  | :3:11: the model is not flat: `extends Base` of another file (flatten it
        import Modelica.Constants.{pi, e}; |  | an import of several names is not supported
        model Tank end Tank; Tank tank; |  | the model is not flat: `tank` is a component of class
        flow Real q; |  | the model is not flat: it has a connector variable
        replaceable Real q; |  | a replaceable element is not supported
        Real q if u > 0; |  | a conditional component is not supported
        der(z) = 1; |  | :3:3: expected a declaration, `equation` or `end`, found `der`
        z = 1; |  | (a declaration reads `Real x;`; equations follow after the word
        if z > 0 then |  | equations follow after the word `equation`
         | Real late; | declarations come before the word `equation`
         | parameter Real late; | declarations come before the word `equation`
         | initial algorithm if z > 0 then z := 1; end if; | an `initial algorithm` that does more than assign values (give the start
        "#,
    );
    assert!(
        refused("block B end B;")
            .one_line()
            .contains("the model has no state")
    );
    assert!(
        refused("model M extends N; end M;")
            .one_line()
            .contains("`extends N` of another file")
    );
}

#[test]
fn syntax() {
    check(
        r#"
         | z = 1 | :5:7: expected `;` after this (every declaration and every equation ends
        Real q |  | :3:8: expected `;` after this
         | z = 1 2; | :5:9: expected `;`, found `2`
         | z = (1; | :5:9: expected `)`, found `;`
         | z = 1 + ; | :5:11: expected an operand, found `;`
         | z = 2x; | :5:7: a number runs into a name
         | z = a < b < c; | expected one comparison, found `<` (join comparisons
         | z = 2^3^2; | expected one `^`
         | z = 1 + if u > 0 then 1 else 2; | put parentheses around an `if`
         | z = if u > 0 then 1; | expected `else`, found `;`
         | z = 99999999999999999999; | the Integer 99999999999999999999 is too large
         | z = 1e999; | the number 1e999 is too large
         | z = u && u; | unexpected character '&' (write `and`)
         | z = θ; | unexpected character 'θ' (names are ASCII
         | z = "text"; | a string here is not supported
         | z = smooth(order = 1, u); | expected an argument with its name, as before it, found `)`
         | z = smooth(1, u = u); | a named argument is not supported
         | for i loop z = 1; end for; | expected `in` and a range, found `loop`
         | for i in 1:2, i in 1:2 loop z = 1; end for; | iterator `i` is used twice
         | for i in 1:2 loop z = 1; end if; | expected `for`, found `if`
        Real q(statr = 1); |  | unknown attribute `statr` (the attributes are start, min
        Real q(start = 1, start = 2); | der(q) = 1; | this attribute is given twice
        Real time; |  | `time` is a word of the language
        Real z; |  | :3:8: `z` is declared twice (it is first declared on line 2)
        /* Real q; |  | :3:3: this comment has no end
        annotation(a(b); |  | this annotation has no end
        "#,
    );
    assert!(
        refused("model M end N;")
            .one_line()
            .contains("`end N` closes model `M`")
    );
    assert!(
        refused("model M Real x;")
            .one_line()
            .contains("expected `end M;`, found the end")
    );
    assert!(refused("").one_line().contains("the text holds no model"));
    assert!(
        refused("hello")
            .one_line()
            .contains("expected `model`, found `hello`")
    );
}

#[test]
fn names_and_sizes() {
    check(
        r#"
         | z = levle + zz; | unknown name `levle`
        Real level; | level = z; z = levle; | (did you mean `level`?)
         | z = pi; | unknown name `pi` (write `Modelica.Constants.pi`)
         | z = tank.level; | unknown name `tank.level` (components of other models
         | z = x[4]; | :5:9: subscript 4 of `x` is outside 1..3
         | z = x[n - 3]; | subscript 0 of `x` is outside 1..3
         | z = x[1, 2]; | 2 subscripts, but `x` has the size [3]
         | z = u[1]; | `u` is a scalar and takes no subscripts
         | z = x[n/2]; | a subscript must be an Integer or a range of Integers (`/` and
         | z = x[u]; | `u` is a variable, but a known value is needed here
         | z = x; | the sides differ in size: left is a scalar, right is [3]
        Real y[2] = x; |  | `y` has the size [2], its value has [3]
        Real y[n - 4]; |  | :3:10: a size must not be negative, this is -1
        Real y[n/1]; |  | a size must be an Integer, found a Real (`/` and `^` always
        Real y[z]; |  | `z` is a variable, but a known value is needed here
        Real y[:] = x; |  | the size of variable `y` must be given
        parameter Real p[:]; |  | the size `:` needs a value to be taken from
        Real y(start = {1, 2}) = 1; |  | the attribute has the size [2], its variable has
        Real y(min = 2, max = 1) = 1; |  | the range of `y` is empty: min 2 > max 1
        Real y(unit = 3) = 1; |  | expected a string
         | z = sum(x + u*{1, 2}); | the sizes differ: left is [3], right is [2]
         | z = sum(if u > 0 then x else 1); | the sizes differ: left is [3], right is a scalar
         | z = sum(x + 1); | `.+` and `.-` take a scalar with every element
         | z = sum(1/x); | division by an array (`./` divides by every element)
         | z = sum(x^2); | `.^` takes the power of every element
         | z = sum([1, 2; 3, 4]*x); | no product of sizes [2, 2] and [3]
         | z = sum({1, {2}}); | the elements differ in size: a scalar and [1]
         | z = sum([1, 2; 3]); | the sizes differ
         | z = sqrt(u, 2); | `sqrt` takes 1 argument, found 2
         | z = size(x, 2); | there is no dimension 2: the size is [3]
         | z = max(zeros(0)); | `max` of no elements
         | for i in 3 loop z = i; end for; | expected a range, found a scalar
         | z = sum(1:0:3); | the step of a range is zero
         | z = x[end + 1]; | subscript 4 of `x` is outside 1..3
         | z = end; | `end` stands only in subscripts
        "#,
    );
}

#[test]
fn types_and_numbers() {
    check(
        r#"
         | z = u > 1; | an equation between a Boolean and a number
         | z = 1 + (u > 1); | expected a number, found a Boolean
         | z = if u then 1 else 2; | expected a condition, found a number (compare it
         | z = 1/0; | division by zero
         | z = mod(3, 0); | division by zero
         | z = 9000000000000000000 + 9000000000000000000; | does not fit in 64 bits
         | z = -9000000000000000000*2; | does not fit in 64 bits
         | z = div(n, 0); | division by zero
         | der(u) = 1; | `der(u)`: `u` is not a Real variable
         | der(n) = 1; | `der(n)`: `n` is not a Real variable
         | der(z*u) = 1; | `der` of an expression with `u`, which has none (inputs
        Integer k; | der(k) = 1; | `der(k)`: `k` is not a Real variable
        parameter input Real w = 1; |  | `w` is both a parameter and an input
        parameter Real p; |  | parameter `p` has no value (write `p = …` here, or give
        parameter Real p(start = 1); |  | parameter `p` has no value
        parameter Real p = sqrt(-1); |  | the value of `p` is not a finite number
        parameter Real p = u; |  | `u` is a variable, but a known value is needed here
        parameter Real p = time; |  | `time` is a variable, but a known value
        parameter Integer p = 1.5; |  | `p` is an Integer, its value is a Real
        parameter Real p[2] = 1; |  | (use `fill(value, size)`)
         | if u > 0 then z = 1; end if; | the branches have 1 and 0 equations
        "#,
    );
}

#[test]
fn a_sign_behind_a_sign_or_a_power() {
    for (formula, found) in [
        ("2^-1", "expected an exponent without sign, found `-`"),
        ("x^+2", "expected an exponent without sign, found `+`"),
        ("x.^-2", "expected an exponent without sign, found `-`"),
        ("--3", "expected an operand after the sign, found `-`"),
        ("-+x", "expected an operand after the sign, found `+`"),
        ("x - --3", "expected an operand after the sign, found `-`"),
    ] {
        let text = format!("model M Real x; equation der(x) = {formula}; end M;");
        let message = refused(&text).to_string();
        assert!(message.contains(found), "{formula}: {message}");
        assert!(message.contains("put it in parentheses"), "{message}");
    }
    for formula in ["2^(-1)", "-(-3)", "-x^2", "x - (-3)"] {
        let text = format!("model M Real x; equation der(x) = {formula}; end M;");
        Plant::from_modelica(&text, "test.mo", &LoadOptions::default()).unwrap();
    }
}

#[test]
fn cycles_name_their_members() {
    check(
        r#"
        parameter Real a = b; parameter Real b = 2*c; parameter Real c = a; |  | :3:18: these declarations need each other: `a` → `b` → `c` → `a` (give one of
        parameter Real p = p + 1; |  | `p` → `p`
        parameter Integer a = size(b, 1); parameter Real b[a] = ones(a); |  | `a` → `b` → `a`
        "#,
    );
}

#[test]
fn rendering() {
    let text = "model Column\n  Real x[3];\nequation\n  der(x[1]) = x[20];\nend Column;\n";
    let found = refused(text);
    assert_eq!(
        found.to_string(),
        "error: subscript 20 of `x` is outside 1..3
 --> test.mo:4:17
  |
4 |   der(x[1]) = x[20];
  |                 ^^ this is 20"
    );
    assert!(!found.to_string().contains('\u{1b}'));
    let with_hint =
        refused("model M\n  Real level;\nequation\n  der(levle) = 1;\nend M;").to_string();
    assert!(
        with_hint.ends_with("help: did you mean `level`?"),
        "{with_hint}"
    );
}

#[test]
fn carriage_returns() {
    let found = refused("model M\r\n  Real x;\r\nequation\r\n  der(x) = y;\r\nend M;\r\n");
    assert_eq!((found.line, found.column), (4, 12));
    assert!(!found.to_string().contains('\r'));
    let found = refused("model M Real x; equation der(x) =\r\r\u{13}\r\r x; end M;");
    assert!(found.to_string().contains('^'));
}

#[test]
fn columns_count_characters() {
    let found = refused("model M\n  Real x \"größe\"; Real y = z;\nequation der(x) = 1; end M;");
    assert_eq!((found.line, found.column), (2, 28));
}

#[test]
fn files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.mo");
    let load = || Plant::load(&path, &LoadOptions::default());
    assert!(matches!(load().unwrap_err(), LoadError::Read { .. }));
    std::fs::write(&path, b"model M\n  Real x \"gr\xfc\xdfe\";\nend M;").unwrap();
    let error = load().unwrap_err();
    assert!(matches!(error, LoadError::NotUtf8 { line: 2, .. }));
    assert!(
        error
            .to_string()
            .ends_with("is not UTF-8 text; save the file as UTF-8")
    );
    std::fs::write(&path, "\u{feff}model M Real x; equation der(x) = y; end M;").unwrap();
    let error = load().unwrap_err();
    assert!(matches!(&error, LoadError::Refused(found) if found.file.ends_with("m.mo")));
    assert!(error.to_string().contains("unknown name `y`"));
    std::fs::File::create(&path)
        .unwrap()
        .set_len(1 << 30)
        .unwrap();
    assert!(matches!(load().unwrap_err(), LoadError::TooLarge { .. }));
}

#[test]
fn events_that_say_nothing_clear() {
    check(
        r#"
         | when time > 1 then z = 1; end when; | :5:22: `z` is a state: its value is no equation of a `when` (write `reinit(x, …)`)
        Real y; Boolean b; | y = z; when z > 1 then reinit(y, 0); b = true; end when; | :5:26: `reinit` of `y`, which is no state
         | reinit(z, 0); | :5:3: a `reinit` outside of a `when`
        Boolean b; | when z > 1 then when z > 2 then b = true; end when; end when; | :5:19: a `when` within a `when`
        Boolean b; | if z > 0 then when z > 2 then b = true; end when; else b = false; end if; | a `when` under a condition that varies
        Boolean b; | when z > 1 then b = true; end when; when z > 2 then b = false; end when; | :5:55: `b` is assigned in two `when`s (join them with `elsewhen`
        Real y; discrete Real d; | y = 2*z; when z > 1 then d = pre(y); end when; | `pre(y)`: `y` is not discrete
        Real y; Boolean b; | y = if edge(b) then 1 else 0; when z > 1 then b = true; end when; | `pre`, `edge` or `change` in an equation of something that is not discrete
        Boolean b; | when z > 1 then b = not pre(z > 1); end when; | `pre` takes a variable, not an expression
        Integer d; | when z > 1 then d = d + 1; end when; | the new value of `d` needs itself (what it was before the event is `pre(d)`)
        Integer d; | when sample(0, 0) then d = 1; end when; | `sample` every 0: expected a time above 0
        Integer d; | when sample(0, z) then d = 1; end when; | `z` is a variable, but a known value is needed here
        Integer d; | d = if sample(0, 1) then 1 else 0; | `sample` outside of a `when`
        Integer d; | when integer(z) == n then d = 1; end when; | changes where no relation does
        Integer d; | when z > 1 then d = 1; | expected `when`, found `M`
        Integer d = 3; | when z > 1 then d = 1; end when; | an equation where it is declared, and one in a `when`
         | when u > 1 then u = 0; end when; | the input `u` is assigned in a `when`
        Boolean b; | when z > 1 then assert(z < 2, "no"); b = true; end when; | an `assert` within a `when` is not supported
         | when z then reinit(z, 0); end when; | expected a condition, found a number
         | terminate("done"); | `terminate` is not supported
        discrete Real d; |  | lacks an equation
        "#,
    );
}
