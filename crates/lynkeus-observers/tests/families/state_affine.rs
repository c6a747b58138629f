//! The family `state-affine` against the formulas of its paper.

use std::collections::BTreeMap;

use crate::common::{Run, assert_follows, design_with, plant, reference, refused, run, slope};
use lynkeus_expr::Tape;
use lynkeus_gain::UnitFactor;
use lynkeus_model::Plant;
use lynkeus_observers::{
    Design, DesignError, Initial, Tuning, Value, state_affine::STATE_AFFINE, triangular::TRIANGULAR,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing, Verdict};
use lynkeus_words::Words;

/// System (29).
const EXAMPLE: &str = "model Ltaief
  input Real u1(min = -1, max = 1); input Real u2(min = -1, max = 1); input Real u3(min = -5, max = 5);
  input Real e1(min = -0.1, max = 0.1);
  Real x1(min = 0.2, max = 4); Real x2(min = -2, max = 2); Real x3(min = -2, max = 2);
  output Real y = x1;
equation
  der(x1) = u1*x1*x2 + u2*x1^2*x3 + x1*u3;
  der(x2) = x3 - 10*x2 + u3 - x2^3 + e1;
  der(x3) = -x3 - 2*x1*x2 - 10*u1*x2;
end Ltaief;";

/// Inputs of section 5.
const INPUTS: [(&str, &str); 4] = [
    ("u1", "sin(11*pi*time)"),
    ("u2", "cos(11*pi*time)"),
    ("u3", "5*cos(2*pi*time)"),
    ("e1", "0.1*sin(0.1*pi*time)"),
];

fn tuning(θ: f64, starts: &[(&str, f64)]) -> Tuning {
    let values: BTreeMap<String, f64> = starts.iter().map(|(n, x)| (n.to_string(), *x)).collect();
    let initial = Initial {
        default: None,
        values,
    };
    Tuning {
        initial,
        ..Tuning::from([("theta", θ), ("S0", 1.0)])
    }
}

fn design(plant: &Plant, disturbances: &[&str], tuning: &Tuning) -> Design {
    let sensors = Sensors {
        disturbances: disturbances.iter().map(|s| s.to_string()).collect(),
        ..Sensors::default()
    };
    STATE_AFFINE
        .design(&AugmentedPlant::new(plant, &sensors).unwrap(), tuning)
        .unwrap()
}

fn example(θ: f64) -> (Plant, Design) {
    let plant = plant(EXAMPLE);
    let starts = [("x1", 1.0), ("x2", 2.0), ("x3", -2.0)];
    let design = design(&plant, &["e1"], &tuning(θ, &starts));
    (plant, design)
}

/// With `prolong` the right-hand side is F(u, σ(x̂))x̂ + φ(u, σ(x̂)) (A2), written out by hand; with `clamp`
/// σ limits the x̂ that F multiplies, too. In the box all three are one.
#[test]
fn prolonged_as_the_paper_asks() {
    let plant = plant(EXAMPLE);
    let starts = [("x1", 1.0), ("x2", 2.0), ("x3", -2.0)];
    let plain = tuning(10.0, &starts);
    let mut prolonged = plain.clone();
    prolonged
        .values
        .insert("prolong".to_owned(), Value::Flag(true));
    let clamped = Tuning {
        clamp: true,
        ..plain.clone()
    };
    let slopes = |tuning: &Tuning, x: [f64; 3]| {
        let design = design(&plant, &["e1"], tuning);
        let mut state: Vec<f64> = design.observer.states.iter().map(|(_, s)| *s).collect();
        state[..3].copy_from_slice(&x);
        // y = x̂₁, so that the correction is nothing
        slope(&plant, &design, &state, &[0.3, -0.7, 2.0], &[x[0]])
    };
    // at σ(x̂) = s, F times m
    let by_hand = |s: [f64; 3], m: [f64; 3]| {
        let [u1, u2, u3] = [0.3, -0.7, 2.0];
        [
            u1 * s[0] * m[1] + u2 * s[0].powi(2) * m[2] + s[0] * u3,
            s[2] - 10.0 * s[1] + u3 - s[1].powi(3),
            -s[2] - 2.0 * s[0] * s[1] - 10.0 * u1 * s[1],
        ]
    };
    let (x, s) = ([5.0, 3.5, -7.0], [4.0, 2.0, -2.0]);
    crate::common::assert_close(&slopes(&prolonged, x)[..3], &by_hand(s, x));
    crate::common::assert_close(&slopes(&clamped, x)[..3], &by_hand(s, s));
    let inside = [1.0, 0.5, -0.5];
    for tuning in [&plain, &prolonged, &clamped] {
        let found = slopes(tuning, inside);
        crate::common::assert_close(&found[..3], &by_hand(inside, inside));
    }
}

fn grid(until: f64, step: f64) -> Vec<f64> {
    let rows = (until / step).round() as usize;
    (0..=rows).map(|k| k as f64 * step).collect()
}

type Matrix = Vec<Vec<f64>>;

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(x, r)| x * r[j]).sum();
    let row = |row| (0..b[0].len()).map(|j| entry(row, j)).collect();
    a.iter().map(row).collect()
}

fn transposed(a: &Matrix) -> Matrix {
    let column = |j: usize| a.iter().map(|row| row[j]).collect();
    (0..a[0].len()).map(column).collect()
}

fn sum(terms: &[Matrix]) -> Matrix {
    let entry = |i: usize, j: usize| terms.iter().map(|m| m[i][j]).sum();
    let row = |i: usize| (0..terms[0][0].len()).map(|j| entry(i, j)).collect();
    (0..terms[0].len()).map(row).collect()
}

fn scaled(s: f64, a: &Matrix) -> Matrix {
    let row = |row: &Vec<f64>| row.iter().map(|x| s * x).collect();
    a.iter().map(row).collect()
}

/// (D, U) from the observer's states behind x̂, or their derivatives: `one` on
/// the diagonal of U.
fn factors(z: &[f64], n: usize, one: f64) -> (Vec<f64>, Matrix) {
    let mut rest = z[2 * n..].iter();
    let mut U = vec![vec![0.0; n]; n];
    for (i, row) in U.iter_mut().enumerate() {
        row[i] = one;
        row[i + 1..]
            .iter_mut()
            .for_each(|x| *x = *rest.next().unwrap());
    }
    (z[n..2 * n].to_vec(), U)
}

fn diagonal(d: &[f64]) -> Matrix {
    let entry = |i: usize, j: usize| if i == j { d[i] } else { 0.0 };
    let row = |i: usize| (0..d.len()).map(|j| entry(i, j)).collect();
    (0..d.len()).map(row).collect()
}

/// From the order of the factors to that of the observer's states.
fn declared(design: &Design, S: &Matrix) -> Matrix {
    let names: Vec<String> = design
        .observer
        .states
        .iter()
        .map(|(s, _)| s.name.clone())
        .collect();
    let place = |i: usize| {
        let name = format!("ln d({})", names[i]);
        names.iter().position(|n| *n == name).unwrap() - S.len()
    };
    let row = |i: usize| (0..S.len()).map(|j| S[place(i)][place(j)]).collect();
    (0..S.len()).map(row).collect()
}

/// S = UᵀDU
fn matrix(design: &Design, z: &[f64]) -> Matrix {
    let (δ, U) = factors(z, design.observer.estimates.len(), 1.0);
    let D = diagonal(&δ.iter().map(|x| x.exp()).collect::<Vec<_>>());
    declared(design, &product(&transposed(&U), &product(&D, &U)))
}

/// S' from the derivatives of the factors.
fn matrix_slope(design: &Design, z: &[f64], slope: &[f64]) -> Matrix {
    let n = design.observer.estimates.len();
    let ((δ, U), (dδ, dU)) = (factors(z, n, 1.0), factors(slope, n, 0.0));
    let D: Vec<f64> = δ.iter().map(|x| x.exp()).collect();
    let dD: Vec<f64> = D.iter().zip(dδ).map(|(d, r)| d * r).collect();
    let half = product(&transposed(&dU), &product(&diagonal(&D), &U));
    let middle = product(&transposed(&U), &product(&diagonal(&dD), &U));
    declared(design, &sum(&[half.clone(), transposed(&half), middle]))
}

fn assert_near(found: &Matrix, expected: &Matrix) {
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        let scale = expected.abs().max(1.0);
        assert!(
            (found - expected).abs() < 1e-11 * scale,
            "{found} against {expected}"
        );
    }
}

/// Blocks (a, b) → (c) → (d, e), two outputs with C(u), states in any order: the
/// derivative of UᵀDU is the right-hand side of (8), and S times the correction
/// of (7), taken out of x̂', is Cᵀ(Cx̂ − y).
#[test]
fn equations_7_and_8_at_a_point() {
    let plant = plant(
        "model Blocks input Real u; Real d; Real b; Real e; Real a; Real c;
         output Real y1 = a + u*b + 3; output Real y2 = 2*b;
         equation
         der(d) = -d; der(e) = d*e;
         der(a) = u*c + sin(a); der(b) = (a^2 + 1)*c - b;
         der(c) = a*c*d + (2 + u)*e + c^2; end Blocks;",
    );
    let θ = 1.7;
    let design = design(&plant, &[], &tuning(θ, &[]));
    assert_eq!(
        design.examination.chains,
        [vec!["b", "a"], vec!["c"], vec!["d", "e"]]
    );
    let n = 5;
    let (u, y) = (0.8, [3.1, 0.4]);
    let [d, b, e, a, c] = [0.3, -0.6, 0.9, 0.5, 1.2f64];
    let mut z = vec![d, b, e, a, c];
    z.extend([0.2, -0.4, 0.1, -0.9, 0.6]);
    z.extend([0.3, -0.2, 0.7, 0.1, 0.5, -0.8, 0.4, 0.6, -0.3, 0.2]);
    let found = slope(&plant, &design, &z, &[u], &y);
    // columns d, b, e, a, c
    let C = vec![vec![0.0, u, 0.0, 1.0, 0.0], vec![0.0, 2.0, 0.0, 0.0, 0.0]];
    let mut F = vec![vec![0.0; n]; n];
    (F[1][4], F[3][4], F[4][0], F[4][2]) = (a * a + 1.0, u, a * c, 2.0 + u);
    let S = matrix(&design, &z);
    let SF = product(&S, &F);
    let CC = product(&transposed(&C), &C);
    let right = sum(&[S.clone(), SF.clone(), transposed(&SF), scaled(-1.0, &CC)]);
    assert_near(&matrix_slope(&design, &z, &found), &scaled(-θ, &right));
    let f = [
        -d,
        (a * a + 1.0) * c - b,
        d * e,
        u * c + a.sin(),
        a * c * d + (2.0 + u) * e + c * c,
    ];
    let powers = [3, 1, 3, 1, 2].map(|k| θ.powi(k));
    let correction: Matrix = (0..n)
        .map(|i| vec![(f[i] - found[i]) / powers[i]])
        .collect();
    let innovation = vec![vec![a + u * b + 3.0 - y[0]], vec![2.0 * b - y[1]]];
    let expected = product(&transposed(&C), &innovation);
    assert_near(&product(&S, &correction), &expected);
}

/// (22) without its nonlinear terms: V' = −θV − θ‖Cx̄‖² for V = x̄ᵀSx̄, x̄ = Δ_θx̃.
#[test]
fn the_lyapunov_function_decays_as_in_equation_22() {
    let plant = plant(
        "model Linear input Real u; Real a; Real b; Real c; output Real y = a;
         equation der(a) = u*b + (1 - u)*c; der(b) = 0; der(c) = 0; end Linear;",
    );
    let θ = 3.0;
    let design = design(&plant, &[], &tuning(θ, &[]));
    let error = [0.7, -1.1, 0.4];
    let z = [&error[..], &[0.3, -1.0, 0.5, 0.6, -0.4, 0.9]].concat();
    let found = slope(&plant, &design, &z, &[0.3], &[0.0]);
    let Δ = [1.0, 1.0 / θ, 1.0 / θ];
    let column = |x: &[f64]| -> Matrix { x.iter().zip(Δ).map(|(x, δ)| vec![x * δ]).collect() };
    let (x, dx) = (column(&error), column(&found[..3]));
    let (S, dS) = (matrix(&design, &z), matrix_slope(&design, &z, &found));
    let form = |x: &Matrix, S: &Matrix, y: &Matrix| product(&transposed(x), &product(S, y))[0][0];
    let V = form(&x, &S, &x);
    let dV = form(&x, &dS, &x) + 2.0 * form(&x, &S, &dx);
    assert!((dV + θ * V + θ * error[0].powi(2)).abs() < 1e-12);
}

/// Every column of the independent trajectory, S included.
#[test]
fn the_reference_is_reproduced() {
    let Some((_, expected)) = reference("ltaief_theta10.csv") else {
        return;
    };
    let (plant, design) = example(10.0);
    let times: Vec<f64> = expected.iter().map(|row| row[0]).collect();
    let Run { rows, monitors } = run(&plant, &design, &INPUTS, &[1.0, 0.5, 0.5], &times, 1e-3);
    let row = |row: &Vec<f64>| {
        let S = matrix(&design, &row[4..]);
        [&row[..7], &S.concat()].concat()
    };
    let found: Vec<Vec<f64>> = rows.iter().map(row).collect();
    assert_follows(&found, &expected);
    assert!(monitors[0] > design.observer.monitors[0].alarm_below);
    // the smallest eigenvalue on the way, from the reference's own integration: 0.00854
    assert!(
        (monitors[0] / 0.00854 - 1.0).abs() < 0.02,
        "{}",
        monitors[0]
    );
}

/// |x̂1 − x1| after the transient: 0.0037 for θ = 2, 0.0001 for θ = 40.
#[test]
fn the_steady_error_shrinks_with_θ() {
    let steady = |θ: f64| {
        let (plant, design) = example(θ);
        let found = run(
            &plant,
            &design,
            &INPUTS,
            &[1.0, 0.5, 0.5],
            &grid(10.0, 0.01),
            1e-3,
        );
        let late = found.rows.iter().filter(|row| row[0] >= 5.0);
        late.fold(0.0, |m: f64, row| m.max((row[4] - row[1]).abs()))
    };
    let (slow, fast) = (steady(2.0), steady(40.0));
    assert!((slow - 0.0037).abs() < 5e-5, "{slow}");
    assert!((fast - 0.00011).abs() < 5e-6, "{fast}");
}

/// u = (1, 0) for good: F_1 = (x1, 0), nothing shows x3 any more. The monitor falls
/// below its alarm, the last d decays to where it is held, and nothing overflows.
#[test]
fn frozen_inputs_raise_the_alarm() {
    let (plant, design) = example(10.0);
    let inputs = [("u1", "1"), ("u2", "0"), INPUTS[2], INPUTS[3]];
    let found = run(
        &plant,
        &design,
        &inputs,
        &[1.0, 0.5, 0.5],
        &grid(80.0, 1.0),
        2e-3,
    );
    let alarm = design.observer.monitors[0].alarm_below;
    assert!(found.monitors[0] < alarm, "{} ≥ {alarm}", found.monitors[0]);
    assert!(found.rows.iter().flatten().all(|x| x.is_finite()));
    let names = design.observer.states.iter().map(|(s, _)| &s.name);
    let place = names.into_iter().position(|n| n == "ln d(x3)").unwrap();
    let least = found.rows.last().unwrap()[4 + place];
    assert!((least - 1e-100f64.ln()).abs() < 1e-6, "ln d(x3) = {least}");
}

/// ℓ ≤ λ_min(S) ≤ n^{1/128} ℓ for a matrix with known eigenvalues.
#[test]
fn the_monitor_is_a_sharp_lower_bound() {
    let (plant, design) = example(10.0);
    let observer = &design.observer;
    let symbols: Vec<_> = observer.states.iter().map(|(s, _)| s.symbol).collect();
    let tape = Tape::new(&plant.graph, &symbols, &[observer.monitors[0].node]).unwrap();
    // orthonormal columns
    let Q: Matrix = [[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]
        .iter()
        .map(|row| row.iter().map(|x| x / 3.0).collect())
        .collect();
    for λ in [
        [1.0, 1.0, 1.0],
        [1e-9, 2.0, 3e3],
        [0.5, 0.5, 7.0],
        [1e-90, 1e-90, 1.0],
    ] {
        let S = match λ[2] / λ[0] < 1e15 {
            true => product(&Q, &product(&diagonal(&λ), &transposed(&Q))),
            false => diagonal(&λ),
        };
        let symmetric = scaled(0.5, &sum(&[S.clone(), transposed(&S)]));
        let factor = UnitFactor::new(&symmetric).unwrap();
        let mut z = vec![0.0; 3];
        z.extend(factor.diagonal.iter().map(|d| d.ln()));
        z.extend(factor.upper.concat());
        let mut bound = [0.0];
        tape.evaluator().eval(&z, &mut bound);
        let ratio = λ[0] / bound[0];
        // S itself carries rounding of the size of its largest entry
        let slack = 1e-10 + 1e-15 * λ[2] / λ[0].max(1e-12);
        assert!(
            ratio > 1.0 - slack && ratio < 3f64.powf(1.0 / 128.0) + slack,
            "{ratio}"
        );
    }
}

/// Renamed, reordered: the same estimates, also from a matrix S(0).
#[test]
fn names_and_order_of_states_do_not_matter() {
    let other = EXAMPLE
        .replace(
            "Real x1(min = 0.2, max = 4); Real x2(min = -2, max = 2); Real x3(min = -2, max = 2);",
            "Real x3(min = -2, max = 2); Real x1(min = 0.2, max = 4); Real x2(min = -2, max = 2);",
        )
        .replace("x1", "level")
        .replace("x2", "zeta")
        .replace("x3", "alpha");
    let rows = |text: &str, names: [&str; 3], order: [usize; 3]| {
        let plant = plant(text);
        let start = [1.0, 2.0, -2.0];
        let mut tuning = tuning(10.0, &[(names[0], 1.0), (names[1], 2.0), (names[2], -2.0)]);
        let S0 = [[2.0, 0.3, -0.1], [0.3, 1.0, 0.4], [-0.1, 0.4, 1.5]];
        let row = |&i: &usize| Value::List(order.map(|j| Value::Number(S0[i][j])).to_vec());
        let S0 = Value::List(order.iter().map(row).collect());
        tuning.values.insert("S0".into(), S0);
        let design = design(&plant, &["e1"], &tuning);
        assert_eq!(
            design.examination.chains,
            [vec![names[0]], {
                let mut block = vec![names[1], names[2]];
                block.sort_by_key(|n| plant.states.iter().position(|s| s.name == *n));
                block
            }]
        );
        let x0 = order.map(|i| [1.0, 0.5, 0.5][i]);
        let found = run(&plant, &design, &INPUTS, &x0, &grid(2.0, 0.1), 2e-3);
        let back = |i: usize| order.iter().position(|&j| j == i).unwrap();
        assert_eq!(found.rows[0][4 + back(1)], start[1]);
        let estimates = |row: &Vec<f64>| [0, 1, 2].map(|i| row[4 + back(i)]);
        found.rows.iter().map(estimates).collect::<Vec<_>>()
    };
    let first = rows(EXAMPLE, ["x1", "x2", "x3"], [0, 1, 2]);
    let second = rows(&other, ["level", "zeta", "alpha"], [2, 0, 1]);
    for (first, second) in first.iter().flatten().zip(second.iter().flatten()) {
        assert!((first - second).abs() < 1e-9, "{first} against {second}");
    }
}

/// The counter-example to constant gains, u ∈ {−1, +1}: no triangular observer, but
/// F_1 = u has full rank.
#[test]
fn a_coupling_of_either_sign_fits() {
    let plant = plant(
        "model CounterExample input Integer s(min = 0, max = 1); Real u; Real x1; Real x2; output Real y = x1;
         equation u = 2*s - 1; der(x1) = u*x2; der(x2) = 0; end CounterExample;",
    );
    refused(TRIANGULAR, &plant, &Tuning::from([("theta", 1.0)]));
    let design = design(&plant, &[], &Tuning::from([("theta", 2.0)]));
    assert_eq!(design.examination.fit(), Standing::Proved);
    let inputs = [("s", "if sin(3*time) > 0 then 1 else 0")];
    let found = run(
        &plant,
        &design,
        &inputs,
        &[1.0, -2.0],
        &grid(12.0, 1.0),
        1e-3,
    );
    let last = found.rows.last().unwrap();
    assert!(
        (last[3] - 1.0 - (last[1] - 1.0)).abs() < 1e-4 && (last[4] + 2.0).abs() < 1e-3,
        "{last:?}"
    );
}

#[test]
fn what_the_input_must_excite_is_undecided_and_says_so() {
    let (_, design) = example(1.0);
    let examination = &design.examination;
    assert_eq!(examination.fit(), Standing::Undecided);
    assert!(
        examination.summary.words().starts_with("(x1) → (x2, x3)"),
        "{}",
        examination.summary.words()
    );
    assert!(
        examination.checks[1].reason.words().contains("F_1 is 1×2"),
        "{}",
        examination.checks[1].reason.words()
    );
    assert!(
        design.notes.is_empty(),
        "ε acts on the last block: {:?}",
        design.notes
    );
}

#[test]
fn plants_of_another_form_are_refused() {
    let square = plant(
        "model P Real a; Real b; output Real y = a; equation der(a) = b^2; der(b) = 1; end P;",
    );
    let examination = refused(STATE_AFFINE, &square, &Tuning::from([("theta", 1.0)]));
    assert!(
        examination
            .summary
            .words()
            .contains("equation of a is not affine in b"),
        "{}",
        examination.summary.words()
    );
    let same = plant(
        "model P Real a; Real b; Real c; output Real y = a; equation der(a) = b + c; der(b) = -b; der(c) = b; end P;",
    );
    let examination = refused(STATE_AFFINE, &same, &Tuning::from([("theta", 1.0)]));
    let check = examination.refuted().unwrap();
    assert!(
        matches!(check.verdict, Verdict::Refuted(_)) && check.statement.words().contains("(b, c)"),
        "{check:?}"
    );
}

#[test]
fn uncertainty_outside_of_the_last_block_is_noted() {
    let plant = plant(&EXAMPLE.replace("x1*u3;", "x1*u3 + e1;"));
    let design = design(&plant, &["e1"], &Tuning::from([("theta", 1.0)]));
    assert!(
        design.notes[0]
            .words()
            .contains("acts on x1, outside of the last block (x2, x3)"),
        "{:?}",
        design.notes
    );
}

#[test]
fn keys_that_cannot_be_used_are_named() {
    let plant = plant(EXAMPLE);
    let text = |tuning: &Tuning| match design_with(STATE_AFFINE, &plant, &[], tuning) {
        Err(DesignError::Tuning(error)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    assert!(text(&Tuning::default()).starts_with("theta: "));
    assert!(text(&Tuning::from([("theta", 0.0)])).contains("expected a positive number"));
    assert!(text(&Tuning::from([("theta", 1.0), ("S0", -1.0)])).starts_with("S0: "));
    assert!(text(&Tuning::from([("theta", 1.0), ("alarm", 0.0)])).starts_with("alarm: "));
    let with = |rows: &[&[f64]]| {
        let row = |row: &&[f64]| Value::List(row.iter().map(|&x| Value::Number(x)).collect());
        let mut tuning = Tuning::from([("theta", 1.0)]);
        tuning
            .values
            .insert("S0".into(), Value::List(rows.iter().map(row).collect()));
        text(&tuning)
    };
    assert!(
        with(&[&[1.0, 0.0], &[0.0, 1.0]])
            .contains("3×3 matrix as a list of rows, one per estimated quantity, found 2 rows")
    );
    assert!(with(&[&[1.0], &[1.0], &[1.0]]).contains("row 1 has 1 entries"));
    assert!(
        with(&[&[1.0, 2.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]])
            .contains("entry (1, 2) differs")
    );
    assert!(
        with(&[&[1.0, 2.0, 0.0], &[2.0, 1.0, 0.0], &[0.0, 0.0, 1.0]])
            .contains("not positive definite")
    );
    assert!(text(&tuning(1.0, &[("x4", 1.0)])).contains("x1, x2, x3"));
}

/// The gain at the start, θΔ⁻¹S(0)⁻¹Cᵀ, for S(0) = [2, 0.5; 0.5, 1] and C = (3, 0), θ = 4:
/// 4·3·(1, −0.5)/1.75 with the second row times θ.
#[test]
fn the_gain_is_shown_at_the_start() {
    let plant = plant(
        "model Cart Real place; Real speed; input Real u(start = 0.5); output Real y = 3*place;
         equation der(place) = (1 + u)*speed; der(speed) = -place; end Cart;",
    );
    let mut tuning = tuning(4.0, &[]);
    let row = |a: f64, b: f64| Value::List(vec![Value::Number(a), Value::Number(b)]);
    let S0 = Value::List(vec![row(2.0, 0.5), row(0.5, 1.0)]);
    tuning.values.insert("S0".into(), S0);
    let design = design(&plant, &[], &tuning);
    assert!(design.gains.is_empty());
    let value = |name: &str| {
        let found = design.parameters.iter().find(|(n, _)| n == name);
        found.unwrap_or_else(|| panic!("{name}")).1.words()
    };
    assert_eq!(value("C(u)"), "[[3, 0]]");
    assert_eq!(value("F(u, x)"), "[[0, u + 1], [0, 0]]");
    assert_eq!(value("S(0)"), "[[2, 0.5], [0.5, 1]]");
    assert_eq!(value("θΔ⁻¹S⁻¹Cᵀ at the start"), "[[6.85714], [-13.7143]]");
}
