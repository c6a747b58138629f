use super::*;
use crate::{AugmentedPlant, Sensors};
use lynkeus_model::{LoadOptions, Plant};

/// What a rate rests on: a proof on the box, or the linearisation at a point.
const BOX: bool = true;
const POINT: bool = false;

struct Case {
    text: String,
    hidden: &'static [&'static str],
    directions: usize,
    unknown: Vec<String>,
}

/// A plant with a measured state, two more, a known and an unknown input.
fn case(equations: &str, hidden: &'static [&'static str], directions: usize) -> Case {
    Case {
        text: format!(
            "model P
              input Real u(min = 0, max = 1); input Real w(min = -1, max = 2);
              Real a(start = 0.2, min = -1, max = 1); Real b(start = 0.5, min = 0, max = 2); Real c(start = 0.1, min = -1, max = 1);
              output Real y = a;
            equation
              {equations}
            end P;"
        ),
        hidden,
        directions,
        unknown: vec!["w".to_owned()],
    }
}

impl Case {
    fn detectability(&self, name: &str) -> Option<Detectability> {
        self.hidden_errors(name).1
    }

    /// The names of the point, and the detectability.
    fn hidden_errors(&self, name: &str) -> (Vec<String>, Option<Detectability>) {
        let plant = Plant::from_modelica(&self.text, "p.mo", &LoadOptions::default()).unwrap();
        let sensors = Sensors {
            unknown: self.unknown.clone(),
            ..Sensors::default()
        };
        let augmented = AugmentedPlant::new(&plant, &sensors).unwrap();
        let observability =
            augmented
                .states
                .iter()
                .map(|s| match self.hidden.contains(&s.name.as_str()) {
                    true => Observability::Hidden,
                    false => Observability::Determined,
                });
        let question = Hidden {
            observability: observability.collect(),
            arbitrary: true,
            directions: self.directions,
            augmented: &augmented,
        };
        let found = question.hidden_errors().unwrap();
        let point = found.point.into_iter().map(|c| c.name).collect();
        (point, found.of[augmented.state_index(name).unwrap()])
    }

    fn known(mut self) -> Self {
        self.unknown.clear();
        self
    }
}

fn rate(detectability: Option<Detectability>, on: bool) -> f64 {
    match detectability {
        Some(Detectability::Decays { rate, is_proved }) if is_proved == on => rate,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_state_that_nothing_reads_decays_on_the_box() {
    let found = case(
        "der(a) = -a; der(b) = -(1 + u)*b; der(c) = b - 3*c;",
        &["b", "c"],
        2,
    )
    .known();
    assert!((rate(found.detectability("b"), BOX) - 1.0).abs() < 1e-9);
    // behind b: any rate below 1
    assert!((rate(found.detectability("c"), BOX) - 0.99).abs() < 1e-9);
}

/// b³ − b has the slope 3b² − 1, positive for large b: near b = 0, where it rests, it decays with 1.
#[test]
fn what_decays_in_a_part_of_the_box_is_linearised_where_it_rests() {
    let found = case(
        "der(a) = -a; der(b) = b^3 - b; der(c) = u - c;",
        &["b", "c"],
        2,
    )
    .known();
    assert!((rate(found.detectability("b"), POINT) - 1.0).abs() < 1e-9);
    assert!((rate(found.detectability("c"), BOX) - 1.0).abs() < 1e-9);
}

/// a = e^−t, so that of an error in b' = −a²b the share e^(−1/2) stays; where a rests all of it does. What reads a state that
/// never rests has no rate either, and what reads no state has one wherever it is.
#[test]
fn a_slope_that_moves_tells_no_rate() {
    let of = |equations: &str, hidden: &'static [&'static str]| {
        case(equations, hidden, hidden.len())
            .known()
            .detectability("b")
    };
    let fading = "der(a) = -a; der(b) = -b*a^2; der(c) = -c;";
    assert_eq!(of(fading, &["b", "c"]), Some(Detectability::Stays));
    let growing = "der(a) = 1 + a^2; der(b) = b*a; der(c) = -c;";
    assert_eq!(of(growing, &["b", "c"]), Some(Detectability::Undecided));
    let behind = "der(a) = 1 + c^2; der(c) = -a*c; der(b) = -b*c + 0.1*b^3;";
    assert_eq!(of(behind, &["b"]), Some(Detectability::Undecided));
    let steady = "der(a) = 1 + a^2; der(b) = a - b; der(c) = -c;";
    assert!((rate(of(steady, &["b", "c"]), BOX) - 1.0).abs() < 1e-9);
}

#[test]
fn what_an_unknown_input_feeds_does_not_decay() {
    let found = case(
        "der(a) = -a; der(b) = -2*b + w; der(c) = u - c;",
        &["b", "c", "w"],
        3,
    );
    // |w − w̃| ≤ 3, over the rate 2
    let Some(Detectability::Bounded {
        bound,
        is_kept: true,
    }) = found.detectability("b")
    else {
        panic!("{:?}", found.detectability("b"))
    };
    assert!((bound - 1.5).abs() < 1e-9, "{bound}");
    assert_eq!(found.detectability("w"), Some(Detectability::Moved));
    assert!((rate(found.detectability("c"), BOX) - 1.0).abs() < 1e-9);
    // integrated, and so without a bound
    let found = case(
        "der(a) = -a; der(b) = w; der(c) = b - c;",
        &["b", "c", "w"],
        3,
    );
    assert_eq!(found.detectability("c"), Some(Detectability::Moved));
}

/// a' = b − 2c + u leaves b = 2c, and c' = b − 4c = −2c whatever w does to b.
#[test]
fn an_unknown_input_that_the_outputs_pin_down_does_not_matter() {
    let found = case(
        "der(a) = b - 2*c + u; der(b) = w - b; der(c) = b - 4*c;",
        &["b", "c", "w"],
        1,
    );
    assert!((rate(found.detectability("c"), BOX) - 2.0).abs() < 1e-9);
    assert!((rate(found.detectability("b"), BOX) - 2.0).abs() < 1e-9);
    assert!((rate(found.detectability("w"), POINT) - 2.0).abs() < 1e-9);
    // b = −c/2 now leaves c' = −c/2 + 4c: it grows
    let found = case(
        "der(a) = b + 0.5*c + u; der(b) = w - b; der(c) = b + 4*c;",
        &["b", "c", "w"],
        1,
    );
    assert!(
        matches!(found.detectability("c"), Some(Detectability::Grows { rate }) if (rate - 3.5).abs() < 1e-9)
    );
}

/// An epidemic: of S and b only b·S is seen, and S' = −b·S·I is the same for all of them.
#[test]
fn what_scales_together_stays() {
    let found = case(
        "der(a) = -0.1*a + w*b*a; der(b) = -w*b*a; der(c) = -c;",
        &["b", "w", "c"],
        2,
    );
    assert_eq!(found.detectability("b"), Some(Detectability::Stays));
    assert_eq!(found.detectability("w"), Some(Detectability::Stays));
    assert!((rate(found.detectability("c"), BOX) - 1.0).abs() < 1e-9);
}

/// Two integrators in a row: a double eigenvalue at zero. The error grows with time itself, so that it neither
/// decays nor stays.
#[test]
fn a_double_integrator_neither_decays_nor_stays() {
    let found = case(
        "der(a) = -a; der(b) = 3*c - 7*b; der(c) = 7*c - 49/3*b;",
        &["b", "c"],
        2,
    )
    .known();
    assert_eq!(found.detectability("b"), Some(Detectability::Undecided));
}

/// The unknown input stands in the equation of a known state: w = −b there, so that b' = −3b.
#[test]
fn an_unknown_input_is_found_where_it_acts_on_something_known() {
    let found = case(
        "der(a) = b + w; der(b) = -2*b + w; der(c) = -c;",
        &["b", "w", "c"],
        2,
    );
    assert!((rate(found.detectability("b"), BOX) - 3.0).abs() < 1e-9);
    assert!((rate(found.detectability("w"), BOX) - 3.0).abs() < 1e-9);
}

#[test]
fn marginal_and_coupled_modes_are_told_apart() {
    // an oscillator that nothing damps
    let found = case("der(a) = -a; der(b) = c; der(c) = -b;", &["b", "c"], 2).known();
    assert_eq!(found.detectability("b"), Some(Detectability::Stays));
    // damped: eigenvalues −1 ± 2i
    let found = case(
        "der(a) = -a; der(b) = -b + 2*c; der(c) = -2*b - c;",
        &["b", "c"],
        2,
    )
    .known();
    let proved = rate(found.detectability("b"), BOX);
    assert!(proved > 0.95 && proved <= 1.0, "{proved}");
    // b + c alone is seen: b − c decays with 1, each of them too
    let found = case("der(a) = b + c; der(b) = -b; der(c) = -c;", &["b", "c"], 1).known();
    assert!((rate(found.detectability("b"), BOX) - 1.0).abs() < 1e-9);
}

/// A plant whose linearisation hides more than the plant does is not judged there.
#[test]
fn a_linearisation_that_hides_something_else_is_no_answer() {
    // at b = 0 the slope of b² vanishes, but elsewhere b is seen
    let mut found = case("der(a) = b^2; der(b) = -b; der(c) = c*c*c - u;", &["c"], 1).known();
    found.text = found.text.replace("b(start = 0.5", "b(start = 0");
    // judged where b shows, and c³ = u
    assert!(matches!(
        found.detectability("c"),
        Some(Detectability::Grows { .. })
    ));
}

/// Of b·c only the product shows; frozen at a point both do, as they move at rates of their own, and there is
/// nothing left to move without a trace, beside the unknown input that acts on nothing.
#[test]
fn what_a_frozen_point_sees_is_told_of_no_point() {
    let product = || {
        case(
            "der(a) = -a + b*c; der(b) = 0.1*b; der(c) = -2*c;",
            &["b", "c", "w"],
            2,
        )
    };
    // b and 1/c scale together, so that an error in b grows as b does
    let is_right = |detectability| match detectability {
        Some(Detectability::Grows { rate }) => (rate - 0.1_f64).abs() < 1e-9,
        detectability => matches!(
            detectability,
            Some(Detectability::Undecided | Detectability::Moved)
        ),
    };
    for name in ["b", "w"] {
        assert!(is_right(product().detectability(name)), "{name}");
    }
    assert!(is_right(product().known().detectability("b")));
    // c alone is proved to decay
    assert!((rate(product().known().detectability("c"), BOX) - 2.0).abs() < 1e-9);
}

/// b follows from a', and b' is all that shows of two unknown inputs: one moves with the other. The states that
/// can move without a trace are none, which rounding must not hide.
#[test]
fn two_unknown_inputs_in_one_equation_move_each_other() {
    let mut found = case(
        "der(a) = -2*b^2 - 2 + 0.1*b; der(b) = 0.5*w^2 + 0.5*u + 2*u^2; der(c) = a - c;",
        &["c", "u", "w"],
        2,
    );
    found.unknown.push("u".to_owned());
    for name in ["u", "w"] {
        assert_eq!(
            found.detectability(name),
            Some(Detectability::Moved),
            "{name}"
        );
    }
    assert!((rate(found.detectability("c"), BOX) - 1.0).abs() < 1e-9);
    // nor rounding make the search for them endless
    let alone = Case {
        text: "model M input Real w0(start=1,min=-2,max=2); input Real w1(start=0.5,min=-2,max=2);
          Real x0(start=0.5,min=-2,max=2); Real x1(start=1,min=-2,max=2); output Real y0 = x0; output Real y1 = x0;
          equation der(x0) = -2*x1^2-2+0.1*x1; der(x1) = 0.5*w1^2+0.5*w0+2*w0*w0; end M;"
            .to_owned(),
        hidden: &["w0", "w1"],
        directions: 1,
        unknown: vec!["w0".to_owned(), "w1".to_owned()],
    };
    assert_eq!(alone.detectability("w0"), Some(Detectability::Moved));
}

/// Beside a rate of 10⁶ one of 1 is no rounding: ∂(c + 0.3c²)/∂c at c = 0.
#[test]
fn a_slow_mode_beside_a_fast_one_is_no_rounding() {
    let hidden = &["b", "c"];
    let of = |equations: &str, name: &str| case(equations, hidden, 2).known().detectability(name);
    for name in ["b", "c"] {
        let growing = "der(a) = -a; der(b) = -1e6*b + c; der(c) = c + 0.3*c^2 + b;";
        let detectability = of(growing, name);
        assert!(
            matches!(detectability, Some(Detectability::Grows { rate }) if (rate - 1.000001).abs() < 1e-6),
            "{name}: {detectability:?}"
        );
        let decaying =
            "der(a) = -a; der(b) = -1e6*b + c; der(c) = -c + 0.3*c^2 - 3*c^3 + b + 1.5*c*b;";
        let detectability = of(decaying, name);
        let at_the_point = |rate: f64| (rate - 1.0).abs() < 1e-5;
        assert!(
            matches!(detectability, Some(Detectability::Decays { rate, .. }) if at_the_point(rate)),
            "{name}: {detectability:?}"
        );
    }
    // hardly damped: a slope of −0.025 at b = 0, half of it in the real part, beside 10⁴ turns
    let ringing = "der(a) = -a; der(b) = 1e4*c - 0.025*b + 0.025*b^3; der(c) = -1e4*b;";
    assert!((rate(of(ringing, "c"), POINT) - 0.0125).abs() < 1e-6);
    // a coupling of 10⁻⁹ beside the rate still carries what grows
    let weak = of("der(a) = -a; der(b) = -1e6*b + 1e-3*c; der(c) = c;", "b");
    assert!(
        !matches!(
            weak,
            Some(Detectability::Decays { .. } | Detectability::Stays)
        ),
        "{weak:?}"
    );
}

/// Of an error in b' = −b·e^−t the share e^−1 stays for ever.
#[test]
fn what_reads_the_time_is_not_told_of_one_instant() {
    let of =
        |equations: &str, name: &str| case(equations, &["b", "c"], 2).known().hidden_errors(name);
    let fading = "der(a) = -a; der(b) = -b*exp(-time); der(c) = -c + c^3;";
    assert_eq!(of(fading, "b").1, Some(Detectability::Undecided));
    // beside it
    let (point, detectability) = of(fading, "c");
    assert!((rate(detectability, POINT) - 1.0).abs() < 1e-9);
    assert_eq!(point[0], "time", "{point:?}");
    // behind it
    let behind = "der(a) = -a; der(b) = -b/(1 + time); der(c) = -c + c^3 + b;";
    assert_eq!(of(behind, "c").1, Some(Detectability::Undecided));
    // coupled by what is seen, in an equation or in an output
    let seen = "der(a) = b + c; der(b) = -b*exp(-time) - b^3; der(c) = -c + c^3;";
    let mut sum = case(seen, &["b", "c"], 1).known();
    assert_eq!(sum.detectability("c"), Some(Detectability::Undecided));
    sum.text = sum.text.replace("y = a;", "y = a; output Real z = b + c;");
    assert_eq!(sum.detectability("c"), Some(Detectability::Undecided));
    // proved for every instant
    let proved = "der(a) = -a; der(b) = -b*(2 + sin(time)); der(c) = -c + c^3;";
    assert!((rate(of(proved, "b").1, BOX) - 1.0).abs() < 1e-9);
    // what time moves never rests
    let moved = "der(a) = -a; der(b) = -b^3; der(c) = -c + c^3 + sin(time);";
    assert_eq!(of(moved, "c").1, Some(Detectability::Undecided));
}

/// However weakly it reads them, what reads what grows, or an unknown input, is not said to decay; nor is what a
/// fast part elsewhere dwarfs said to stay.
#[test]
fn small_couplings_and_slow_modes_are_not_rounded_away() {
    let behind = case(
        "der(a) = -a; der(b) = -1e6*b + 1e-8*c; der(c) = c + 0.1*c^2;",
        &["b", "c"],
        2,
    )
    .known();
    assert_eq!(behind.detectability("b"), Some(Detectability::Undecided));
    let driven = case(
        "der(a) = -a; der(b) = -b/3600 + w/1e9; der(c) = -c;",
        &["b", "c", "w"],
        3,
    );
    let detectability = driven.detectability("b");
    assert!(
        !matches!(detectability, Some(Detectability::Decays { .. })),
        "{detectability:?}"
    );
    for rate in ["1e-3", "-1e-3"] {
        let slow = format!("der(a) = -1e12*a; der(b) = {rate}*b + 0.001*b^3; der(c) = -c;");
        let slow = case(&slow, &["b", "c"], 2);
        let detectability = slow.known().detectability("b");
        assert_ne!(detectability, Some(Detectability::Stays), "{rate}");
    }
}
