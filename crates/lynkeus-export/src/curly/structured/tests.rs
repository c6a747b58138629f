//! What a small draft becomes.

use super::print::{Instance, Printer};
use crate::curly::c::Precision;
use crate::curly::machine::Field;
use crate::curly::syntax::{Program, Type, parsed};

/// The functions of a draft, the last one for arrays of two.
fn printed(draft: &str, precision: Precision) -> String {
    let items = parsed(draft).unwrap();
    let fields = [Field {
        name: "x",
        kind: Type::Real,
        count: Some(2),
        about: String::new(),
        start: vec![0.0; 2],
    }];
    let program = Program::of(&items, &fields);
    let sizes = [("STATES".to_owned(), 2)];
    let mut printer = Printer::new(&items, &program, (&fields, &sizes), (precision, "p"));
    let instance = Instance {
        function: "last".to_owned(),
        sizes: vec![2],
        fields: vec![],
    };
    printer.instance(instance).unwrap();
    printer.text
}

#[test]
fn what_c_does_under_a_condition_is_done_under_one() {
    let draft = "static int last(const real *a, int n)\n{\n    int k = 0;\n    while (k < n && fabs(a[k]) > R(1.0)) {\n        k++;\n    }\n    const real b = R(2.0) * (n > 0 ? sqrt(a[0]) : R(-1.0));\n    return b > R(0.0) || k == n ? k : -1;\n}\n";
    let text = printed(draft, Precision::F64);
    let expected = "\
    k := 0;
    WHILE TRUE DO
        holds := k < n;
        IF holds THEN
            holds := ABS(a[k]) > 1.0;
        END_IF;
        IF NOT holds THEN
            EXIT;
        END_IF;
        k := k + 1;
    END_WHILE;
    IF n > 0 THEN
        chosen := SQRT(a[0]);
    ELSE
        chosen := -1.0;
    END_IF;
    b := 2.0 * chosen;
    IF b > 0.0 OR k = n THEN
        p_last := k;
    ELSE
        p_last := -1;
    END_IF;
END_FUNCTION
";
    assert!(text.contains(expected), "{text}");
    assert!(
        text.contains("    VAR_IN_OUT\n        a : p_reals_2;\n    END_VAR\n"),
        "{text}"
    );
}

#[test]
fn a_loop_that_goes_on_early_does_the_rest_otherwise() {
    let draft = "static void last(real *a)\n{\n    for (int i = STATES - 1; i >= 0; i--) {\n        if (!(a[i] > R(0.0))) {\n            continue;\n        }\n        a[i] -= R(-1.0);\n    }\n}\n";
    let text = printed(draft, Precision::F32);
    let expected = "\
    FOR i := 1 TO 0 BY -1 DO
        IF NOT (NOT (a[i] > 0.0)) THEN
            a[i] := a[i] - (-1.0);
        END_IF;
    END_FOR;
    p_last := TRUE;
";
    assert!(text.contains(expected), "{text}");
}

#[test]
fn there_is_a_function_for_each_size_and_each_function_that_is_given() {
    let draft = "static real sum(const real *a, int n)\n{\n    real s = R(0.0);\n    for (int i = 0; i < n; i++) {\n        s += a[i];\n    }\n    return s;\n}\n\ntypedef void (*field)(const real *x);\n\nstatic void flow(const real *x)\n{\n    (void)x;\n}\n\nstatic void go(field f, real *z)\n{\n    f(z);\n}\n\nstatic real last(real *a)\n{\n    real b[3];\n    b[0] = sum(a, STATES);\n    go(flow, a);\n    return sum(b, 3) / sum(a, STATES);\n}\n";
    let text = printed(draft, Precision::F64);
    assert_eq!(text.matches("FUNCTION p_sum : LREAL").count(), 1);
    assert_eq!(text.matches("FUNCTION p_sum_2 : LREAL").count(), 1);
    assert!(text.contains("b[0] := p_sum(a := a, n := 2);"), "{text}");
    assert!(
        text.contains("p_last := p_sum_2(a := b, n := 3) / p_sum(a := a, n := 2);"),
        "{text}"
    );
    assert!(
        text.contains("done := p_flow(x := z);") && text.contains("done := p_go(z := a);"),
        "{text}"
    );
}
