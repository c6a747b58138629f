//! Small systems that once were judged wrongly, or well might be.

use lynkeus_expr::Interval;
use lynkeus_observers::{Assumptions, Certificate, Claim as Sought};
use lynkeus_structure::Standing;
use nalgebra::DMatrix;

use crate::judge::{self, Sides};
use crate::pair::{self, Pair};

/// The certificate of a copy of the plant with gains −K on the outputs' errors.
fn certified(text: &str, K: &[f64], look: impl Fn(&mut Pair, &Certificate)) -> Standing {
    let plant = pair::plant(text);
    let augmented = pair::augmented(&plant);
    let K = DMatrix::from_row_slice(plant.states.len(), plant.outputs.len(), K);
    let observer = pair::observer(&augmented, &K);
    let certificate = crate::certificate(&augmented, &observer, [&[], &[]], Sought::Fastest);
    look(&mut Pair::new(&augmented, &observer), &certificate);
    certificate.verdict()
}

/// The equation has the same slope −5 + u at both ends of the input, but 4 + u between.
#[test]
fn a_step_of_an_input_is_not_covered_by_the_ends_of_its_range() {
    for step in [
        "if u > 1 and u < 1.001 then 9 else 0",
        "9*floor(max(0, min(u, 2 - u)))",
    ] {
        let text = format!(
            "model P input Real u(min = 0, max = 3); Real x(min = -1, max = 1); output Real y = x;
             equation der(x) = -5*x + u*x + ({step})*x; end P;"
        );
        let verdict = certified(&text, &[0.0], |_, _| ());
        assert_ne!(verdict, Standing::Proved, "{step}");
    }
}

/// On [0, 1] the equation is x' = −x/2; at 0 itself |x| has no slope.
#[test]
fn a_kink_at_the_edge_of_the_box_refutes_nothing() {
    for term in ["abs(x)", "max(x, -x)"] {
        let text = format!(
            "model P Real x(min = 0, max = 1); output Real y = x;
             equation der(x) = 0.5*x - {term}; end P;"
        );
        let verdict = certified(&text, &[0.0], |_, _| ());
        assert_ne!(verdict, Standing::Refuted, "{term}");
    }
}

/// A kink inside the box has a range of slopes like any other term.
#[test]
fn a_kink_inside_the_box_is_no_obstacle() {
    let text = "model P Real x(min = -1, max = 1); Real z(min = -1, max = 1); output Real y = x;
         equation der(x) = -x + z; der(z) = -2*z - abs(z); end P;";
    let verdict = certified(text, &[0.0, 0.0], |_, _| ());
    assert_eq!(verdict, Standing::Proved);
}

/// The error of x' = (3 sin t − 1) x decays like exp(−t − 3 cos t), though its Jacobian is
/// positive for a part of every period.
#[test]
fn an_instant_refutes_nothing() {
    for rate in ["3*sin(time) - 1", "if mod(time, 2) < 0.9 then 1 else -1"] {
        let text = format!(
            "model P Real x(min = -1, max = 1); output Real y = x;
             equation der(x) = ({rate})*x; end P;"
        );
        assert_eq!(certified(&text, &[0.0], |_, _| ()), Standing::Undecided);
    }
}

/// e' = e whatever the plant does, at any time.
#[test]
fn a_linear_error_that_grows_is_refuted_without_a_time() {
    let text = "model P Real x(min = -1, max = 1); output Real y = x;
         equation der(x) = x + time; end P;";
    let verdict = certified(text, &[0.0], |_, certificate| {
        let text = format!("{:?}", certificate.hypotheses);
        assert!(text.contains("Refuted") && !text.contains("time"), "{text}");
    });
    assert_eq!(verdict, Standing::Refuted);
}

/// A is u − K. Inside the box e(t) = e(0)·(x(t) + shift)/(x(0) + shift)·exp(−Kt), which decays as
/// long as x stays between the bounds of the box, and with u at its worst x leaves it; where x can
/// rest with that u, the error grows.
#[test]
fn a_worst_input_refutes_only_where_the_plant_can_stay() {
    for (slope, shift, K, expected) in [
        ("u", "10", 0.05, Standing::Undecided),
        ("u", "10", 0.1, Standing::Undecided),
        ("sin(u)", "1.5", 0.05, Standing::Undecided),
        // rests at x = 0 with every input
        ("u", "0", 0.05, Standing::Refuted),
    ] {
        let text = format!(
            "model P input Real u(min = -1, max = 1); Real x(min = -1, max = 1); output Real y = x;
             equation der(x) = {slope}*(x + {shift}); end P;"
        );
        let verdict = certified(&text, &[K], |pair, certificate| {
            if certificate.verdict() == Standing::Refuted {
                judge::witness(pair, certificate, &Sides::new(certificate, 1));
            }
        });
        assert_eq!(verdict, expected, "{slope} {shift} {K}");
    }
}

/// The largest eigenvalue of the error's Jacobian is about b² − 1 where b is large: that
/// refutes where the plant can rest there, at b = √3, and nothing where it only passes.
#[test]
fn an_unstable_jacobian_refutes_where_the_plant_can_rest() {
    for (fall, expected) in [("b", Standing::Refuted), ("0", Standing::Undecided)] {
        let text = format!(
            "model P Real a(min = -3, max = 3); Real b(min = 0.5, max = 2); output Real y = a;
             equation der(a) = b - a; der(b) = b^3/3 - {fall}; end P;"
        );
        let verdict = certified(&text, &[0.3, 0.01], |pair, certificate| {
            if certificate.verdict() == Standing::Refuted {
                judge::witness(pair, certificate, &Sides::new(certificate, 2));
            }
        });
        assert_eq!(verdict, expected, "{fall}");
    }
}

/// At rest on an edge of the box half of the errors are outside.
#[test]
fn a_rest_on_the_edge_refutes_nothing() {
    let text = "model P Real x(min = 0, max = 1); output Real y = x;
         equation der(x) = x*(1 - x)*(1 - x)/(1 + x); end P;";
    assert_ne!(certified(text, &[0.5], |_, _| ()), Standing::Refuted);
}

/// At 0 alone the written derivative is +0.5; on either side of it the slope is −0.5.
#[test]
fn a_rest_where_the_derivative_jumps_refutes_nothing() {
    for term in ["x*sign(x)*sign(x)", "abs(x)*sign(x)"] {
        let text = format!(
            "model P Real x(min = -1, max = 1); output Real y = x;
             equation der(x) = 0.5*x - {term}; end P;"
        );
        assert_ne!(
            certified(&text, &[0.0], |_, _| ()),
            Standing::Refuted,
            "{term}"
        );
    }
}

/// A jump that a state makes has no slope, whichever way it jumps.
#[test]
fn jumps_are_never_proved() {
    for jump in [
        "-sign(x)",
        "(if x > 0.3 then -1 else 0)",
        "-floor(3*x)",
        "atan2(x, -0.1)",
        "-atan(1/x)",
        "-x/abs(x)",
        "-tanh(1/(x - 0.2))",
    ] {
        let text = format!(
            "model P Real x(min = -1, max = 1); output Real y = x;
             equation der(x) = -4*x + {jump}; end P;"
        );
        let verdict = certified(&text, &[1.0], |_, _| ());
        assert_ne!(verdict, Standing::Proved, "{jump}");
    }
}

/// Beyond an end of its sensor's range y no longer corrects: e = −K·0 there, and neither a decay nor a
/// growth of the observer that reads all of y says anything.
#[test]
fn a_sensor_that_may_be_at_an_end_leaves_everything_undecided() {
    for (slope, K) in [("-1", 1.0), ("1", 0.5), ("1", 3.0)] {
        let text = format!(
            "model P Real x(min = -1, max = 1); output Real y = 2*x + 1; equation der(x) = ({slope})*x; end P;"
        );
        let plant = pair::plant(&text);
        let augmented = pair::augmented(&plant);
        let observer = pair::observer(&augmented, &DMatrix::from_element(1, 1, K / 2.0));
        let verdict = |limits: Option<Interval>, noise: f64| {
            let assumptions = Assumptions::new(&augmented, augmented.region())
                .unwrap()
                .with_noise(vec![noise])
                .with_limits(&augmented, &[limits])
                .unwrap();
            lynkeus_observers::certify(&augmented, &observer, &assumptions, Sought::Fastest)
                .unwrap()
                .verdict()
        };
        let free = verdict(None, 0.0);
        assert_ne!(free, Standing::Undecided, "{slope} {K}");
        let range = |low, high| Some(Interval::new(low, high).unwrap());
        // y is in [−1, 3]
        assert_eq!(verdict(range(-1.0, 3.0), 0.0), free);
        assert_eq!(verdict(range(-1.2, 3.2), 0.1), free);
        for (limits, noise) in [
            (range(-1.0, 2.9), 0.0),
            (range(-0.9, 3.0), 0.0),
            (range(-1.2, 3.2), 0.3),
            (range(-1.2, 3.2), f64::INFINITY),
            (range(4.0, 5.0), 0.0),
        ] {
            assert_eq!(verdict(limits, noise), Standing::Undecided, "{limits:?}");
        }
    }
}

/// States in units of very different size, in any order: the decay is proved, and the
/// constant is finite and no smaller than what the diagonal of P shows.
#[test]
fn a_proof_stands_in_any_units() {
    let states = ["c", "d", "a", "b"];
    let of = |name| match name {
        "a" => 1e9,
        "b" => 1e-8,
        "c" => 1.0,
        _ => 1e3,
    };
    for first in 0..4 {
        let order = |i: usize| states[(first + i) % 4];
        let side = |i: usize| format!("Real {}(min = 0, max = {:e});", order(i), of(order(i)));
        let text = format!(
            "model P {} output Real y = a;
             equation der(a) = -2*a + 1e17*b; der(b) = -2*b + 1e-8*sin(c);
             der(c) = -2*c + 1e-3*d; der(d) = -3*d + 1e-5*sin(1e-9*a); end P;",
            (0..4).map(side).collect::<String>()
        );
        let K: Vec<f64> = (0..4).map(|i| f64::from(order(i) == "a")).collect();
        let verdict = certified(&text, &K, |_, certificate| {
            let Some(P) = &certificate.lyapunov else {
                return;
            };
            let least = (P.diagonal().max() / P.diagonal().min()).sqrt();
            let constant = certificate.constants.iter().find(|c| c.name == "√cond(P)");
            let constant = constant.unwrap().value;
            assert!(
                least <= constant && constant < 100.0 * least,
                "{constant} {least}"
            );
        });
        assert_eq!(verdict, Standing::Proved, "first {}", order(0));
    }
}
