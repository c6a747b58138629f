//! The family `block-triangular` against the formulas of its paper.

use crate::common::{assert_close, design_with, plant, refused, slope};
use lynkeus_observers::{Tuning, Value, block_triangular::BLOCK_TRIANGULAR};
use lynkeus_structure::Standing;
use lynkeus_words::Words;

/// System (14), states declared in another order than they are chained.
const EXAMPLE: &str = "model Lee
  input Real u(min = -2, max = 2);
  Real x4(min = -6, max = 6); Real x1(min = -6, max = 6); Real x3(min = -6, max = 6); Real x2(min = -6, max = 6);
  output Real y1 = x1; output Real y2 = x3;
equation
  der(x1) = x2 + 0.01*x1*u;
  der(x2) = -x1 + (1 - x1^2)*x2 + x3*u;
  der(x3) = x4 + 0.01*x2*x3*exp(u);
  der(x4) = -x3 + (1 - x3^2)*x4 + u;
end Lee;";

fn tuning(correction: &str) -> Tuning {
    let list = |x: [f64; 2]| Value::List(x.map(Value::Number).to_vec());
    let mut tuning = Tuning::default();
    tuning.values.insert("theta".into(), list([3.0, 9.0]));
    tuning
        .values
        .insert("k".into(), Value::List(vec![list([2.0, 1.0]); 2]));
    tuning
        .values
        .insert("correction".into(), Value::Text(correction.into()));
    tuning
}

/// M⁻¹(L + Δ⁻¹K) with M and L as printed below (14): M⁻¹ = [1 0; 1−x² 1].
fn printed(c: f64, x: f64, v: f64, θ: f64) -> [f64; 2] {
    let l = [c + 1.0 - x * x, -1.0 - 2.0 * x * v - c + c * x * x];
    let v = [l[0] + 2.0 * θ, l[1] + θ * θ];
    [v[0], (1.0 - x * x) * v[0] + v[1]]
}

#[test]
fn the_gains_of_the_example() {
    let plant = plant(EXAMPLE);
    let [x1, x2, x3, x4, u, y1, y2] = [0.4, -0.7, 1.2, 0.3, 1.5, 0.9, 0.8f64];
    let f = [
        x2 + 0.01 * x1 * u,
        -x1 + (1.0 - x1 * x1) * x2 + y2 * u,
        x4 + 0.01 * x2 * x3 * u.exp(),
        -x3 + (1.0 - x3 * x3) * x4 + u,
    ];
    let lee = [
        printed(0.01 * u, x1, x2, 3.0),
        printed(0.01 * x2 * u.exp(), x3, x4, 9.0),
    ];
    let classical = [[6.0, 9.0], [18.0, 81.0]];
    for (correction, g) in [("lee", lee), ("classical", classical)] {
        let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &tuning(correction)).unwrap();
        let expected = [
            f[3] + g[1][1] * (y2 - x3),
            f[0] + g[0][0] * (y1 - x1),
            f[2] + g[1][0] * (y2 - x3),
            f[1] + g[0][1] * (y1 - x1),
        ];
        let found = slope(&plant, &design, &[x4, x1, x3, x2], &[u], &[y1, y2]);
        assert_close(&found, &expected);
        assert_eq!(design.examination.chains, [["x1", "x2"], ["x3", "x4"]]);
        assert!(design.notes.is_empty(), "θ₁² = θ₂ is enough");
    }
}

/// Three chains of lengths 1, 2, 3; the later use the earlier, M̄ is not the
/// identity. With K = 0 and Δ⁻¹K = 0 out of the way, M⁻¹L places the error
/// Jacobian's own block at a chain of integrators: F − M⁻¹LC is nilpotent.
#[test]
fn the_correction_cancels_the_nonlinearity_for_any_length() {
    let plant = plant(
        "model Three Real a; Real b1; Real b2; Real c1; Real c2; Real c3;
         output Real ya = a; output Real yb = b1; output Real yc = c1;
         equation
         der(a) = -a + b1;
         der(b1) = b2 + 0.3*b1*a; der(b2) = sin(b1)*b2 + a;
         der(c1) = 2*c2 + c1^2; der(c2) = c3*(1 + 0.1*c1^2) + c2*b2; der(c3) = c1*c2*c3; end Three;",
    );
    let design = design_with(
        BLOCK_TRIANGULAR,
        &plant,
        &[],
        &Tuning::from([("theta", 1e-30)]),
    )
    .unwrap();
    assert!(
        design.examination.summary.words().contains("Remark 3"),
        "{}",
        design.examination.summary.words()
    );
    let at = [0.3, 0.5, -0.4, 0.7, 0.2, -0.6];
    let y = [0.3, 0.5, 0.7];
    // the block of c: columns by a central difference in c2, c3 and, for c1, in y and x̂ together
    let column = |i: usize| {
        let h = 1e-6;
        let moved = |h: f64| {
            let mut x = at;
            x[i] += h;
            slope(&plant, &design, &x, &[], &y)[3..].to_vec()
        };
        let (up, down) = (moved(h), moved(-h));
        [0, 1, 2].map(|k| (up[k] - down[k]) / (2.0 * h))
    };
    let J = [column(3), column(4), column(5)];
    let times = |a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]| -> [[f64; 3]; 3] {
        std::array::from_fn(|j| std::array::from_fn(|i| (0..3).map(|k| a[k][i] * b[j][k]).sum()))
    };
    let cube = times(&J, &times(&J, &J));
    assert!(cube.iter().flatten().all(|x| x.abs() < 1e-7), "{cube:?}");
}

#[test]
fn the_rule_for_theta_is_checked() {
    let plant = plant(EXAMPLE);
    let mut short = tuning("lee");
    let list = Value::List(vec![Value::Number(3.0), Value::Number(8.0)]);
    short.values.insert("theta".into(), list);
    let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &short).unwrap();
    assert!(
        design.notes[0].words().contains("9 = 3^2"),
        "{:?}",
        design.notes
    );
}

#[test]
fn an_equation_with_two_new_states_is_named() {
    let plant = plant(
        "model No Real a; Real b; Real c; output Real y = a;
         equation der(a) = b + c; der(b) = 0; der(c) = 0; end No;",
    );
    let examination = refused(BLOCK_TRIANGULAR, &plant, &Tuning::from([("theta", 1.0)]));
    assert_eq!(examination.fit(), Standing::Refuted);
    assert!(
        examination
            .summary
            .words()
            .contains("equation of a depends on b, c"),
        "{}",
        examination.summary.words()
    );
}

/// Poles −1, −1 are the paper's K = (2, 1); k and poles together are refused.
#[test]
fn poles_decide_k() {
    let plant = plant(EXAMPLE);
    let list = |x: [f64; 2]| Value::List(x.map(Value::Number).to_vec());
    let mut placed = tuning("lee");
    placed.values.remove("k");
    placed
        .values
        .insert("k_poles".into(), Value::List(vec![list([-1.0, -1.0]); 2]));
    let gains =
        |tuning: &Tuning| design_with(BLOCK_TRIANGULAR, &plant, &[], tuning).map(|d| d.gains);
    assert_eq!(gains(&placed).unwrap(), gains(&tuning("lee")).unwrap());
    placed
        .values
        .insert("k".into(), Value::List(vec![list([2.0, 1.0]); 2]));
    assert!(
        gains(&placed)
            .unwrap_err()
            .to_string()
            .starts_with("k_poles: ")
    );
}
