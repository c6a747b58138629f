use super::*;

fn fields() -> Vec<Field> {
    let field = |name, kind, count| Field {
        name,
        kind,
        count,
        about: String::new(),
        start: vec![0.0],
    };
    vec![
        field("x", Type::Real, Some(2)),
        field("time", Type::Double, None),
        field("started", Type::Truth, None),
        field("became", Type::Int, Some(1)),
    ]
}

fn rust(draft: &str, precision: Precision) -> String {
    printed(draft, &fields(), precision).unwrap()
}

#[test]
fn pointers_are_slices_and_only_what_changes_is_mutable() {
    let draft = "static void put(real *z, const real *from)\n{\n    z[0] = from[0];\n}\n\nstatic real of(STATE *s, int i)\n{\n    real room[2];\n    put(room, s->x);\n    return room[0] + s->x[i];\n}\n\nstatic void set(STATE *s, real value)\n{\n    put(s->x, s->x);\n    s->x[1] = value;\n    s->started = 1;\n}\n\n/* Both. */\nstatic truth both(STATE *s, double t)\n{\n    (void)t;\n    set(s, s->x[0]);\n    if (s->started && of(s, 1) > R(0.0)) {\n        return 1;\n    }\n    return s->became[0] == TAKEN ? 1 : 0;\n}\n";
    let expected = "fn put(z: &mut [f64], from: &[f64]) {\n    z[0] = from[0];\n}\n\nfn of(s: &State, i: usize) -> f64 {\n    let mut room = [0.0; 2];\n    put(&mut room, &s.x);\n    room[0] + s.x[i]\n}\n\nfn set(s: &mut State, value: f64) {\n    put(&mut s.x, &s.x);\n    s.x[1] = value;\n    s.started = true;\n}\n\n/// Both.\nfn both(s: &mut State, _t: f64) -> bool {\n    let value = s.x[0];\n    set(s, value);\n    if s.started && of(s, 1) > 0.0 {\n        return true;\n    }\n    s.became[0] == TAKEN\n}\n";
    assert_eq!(rust(draft, Precision::F64), expected);
}

#[test]
fn loops_are_ranges_where_they_can_be() {
    let draft = "static void f(real *a, int n)\n{\n    int k = 0;\n    for (int i = 1; i < n; i++) {\n        a[i] = (real)i;\n    }\n    for (int i = 0; i <= n && k != n; i++) {\n        continue;\n    }\n    for (int i = n - 1; i >= 2; i--) {\n        a[i] /= -(-R(0.1));\n    }\n    for (; k + 4 <= n; k += 4) {\n        a[k] = INFINITY;\n    }\n    for (int i = n; i >= 0; i--) {\n        a[i] = (a[0] - (a[1] - a[2])) * R(2.0);\n    }\n}\n";
    let expected = "fn f(a: &mut [f32], n: usize) {\n    let mut k = 0;\n    for i in 1..n {\n        a[i] = i as f32;\n    }\n    for _ in 0..=n {\n        if k == n {\n            break;\n        }\n        continue;\n    }\n    for i in (2..n).rev() {\n        a[i] /= -(-0.1);\n    }\n    while k + 4 <= n {\n        a[k] = f32::INFINITY;\n        k += 4;\n    }\n    for i in (0..=n).rev() {\n        a[i] = (a[0] - (a[1] - a[2])) * 2.0;\n    }\n}\n";
    assert_eq!(rust(draft, Precision::F32), expected);
}

#[test]
fn times_are_double_and_casts_are_where_types_differ() {
    let draft = "static real f(double t, int n)\n{\n    const real h = (real)t / (real)n;\n    const truth late = (double)n < t;\n    return late ? sqrt(h) * R(1e300) : fabs(h);\n}\n";
    let single = "fn f(t: f64, n: usize) -> f32 {\n    let h = (t as f32) / (n as f32);\n    let late = (n as f64) < t;\n    if late { libm::sqrtf(h) * f32::INFINITY } else { f32::abs(h) }\n}\n";
    assert_eq!(rust(draft, Precision::F32), single);
    let double = rust(draft, Precision::F64);
    assert!(double.contains("let h = t / (n as f64);"), "{double}");
    assert!(double.contains("libm::sqrt(h) * 1e300"), "{double}");
}

#[test]
fn names_that_mean_something_else_get_others() {
    let draft = "static const real shares[1] = {R(0.5)};\nstatic real f(real fn, real SHARES, real None, real fn_)\n{\n    return fn * SHARES - None + fn_ * shares[0];\n}\n";
    let expected = "static SHARES: [f64; 1] = [0.5];\nfn f(fn__: f64, SHARES_: f64, None_: f64, fn_: f64) -> f64 {\n    fn__ * SHARES_ - None_ + fn_ * SHARES[0]\n}\n";
    assert_eq!(rust(draft, Precision::F64), expected);
}

#[test]
fn a_loop_that_cannot_be_written_is_refused() {
    let draft = "static void f(int n)\n{\n    for (int i = 0; i != n; i++) {\n        continue;\n    }\n}\n";
    let refusal = printed(draft, &fields(), Precision::F64).unwrap_err();
    assert!(
        refusal
            .to_string()
            .starts_with("Rust has no way to write a loop"),
        "{refusal}"
    );
}
