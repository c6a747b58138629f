//! Chains, their order, roles and signs, against formulas by hand.

use crate::common::{
    Guaranteed, assert_close, constant, design_with, hypothesis, plant, refused, run, slope,
};
use lynkeus_model::Plant;
use lynkeus_observers::{
    Certificate, Family, Tuning, Value, block_triangular::BLOCK_TRIANGULAR, triangular::TRIANGULAR,
};
use lynkeus_structure::{AugmentedPlant, Sensors, Standing, Verdict};
use lynkeus_words::Words;

fn numbers(x: &[f64]) -> Value {
    Value::List(x.iter().map(|&x| Value::Number(x)).collect())
}

fn names(x: &[&str]) -> Value {
    Value::List(x.iter().map(|x| Value::Text((*x).into())).collect())
}

fn with(θ: &[f64], keys: &[(&str, Value)]) -> Tuning {
    let mut tuning = Tuning::default();
    tuning.values.insert("theta".into(), numbers(θ));
    for (key, value) in keys {
        tuning.values.insert((*key).into(), value.clone());
    }
    tuning
}

fn classical() -> (&'static str, Value) {
    ("correction", Value::Text("classical".into()))
}

fn certificate(family: &'static dyn Family, plant: &Plant, tuning: Tuning) -> Certificate {
    let (drift, noise) = (
        vec![0.0; plant.states.len()],
        vec![0.0; plant.outputs.len()],
    );
    let study = Guaranteed {
        family,
        plant,
        unknown: &[],
        tuning,
        drift,
        noise,
    };
    study.certificate()
}

/// Chains of 3, 1 and 2 states. Two orders are possible; θ keeps the theorem's rule in the
/// order a, b, c only, so b is an estimate where c reads it.
#[test]
fn three_chains_of_three_one_and_two() {
    let plant = plant(
        "model Three input Real u; Real a1; Real a2; Real a3; Real b; Real c1; Real c2;
         output Real yc = c1; output Real ya = a1; output Real yb = b;
         equation
         der(a1) = a2 + b*u; der(a2) = a3 - a1*a2; der(a3) = sin(a1)*a3 + c1;
         der(b) = -b + a2*a3;
         der(c1) = c2 + a3; der(c2) = -c1*c2 + b + a2; end Three;",
    );
    let poles = Value::List(vec![
        numbers(&[-1.0, -4.0]),
        numbers(&[-1.0, -2.0, -3.0]),
        numbers(&[-2.0]),
    ]);
    let [a1, a2, a3, b, c1, c2, u] = [0.3, -0.8, 0.5, 1.1, -0.4, 0.9, 0.7f64];
    let [yc, ya, yb] = [-0.1, 0.6, 0.8];
    let expected = |θ: [f64; 3], b_seen: f64| {
        let [θc, θa, θb] = θ;
        let (ea, eb, ec) = (ya - a1, yb - b, yc - c1);
        [
            a2 + yb * u + 6.0 * θa * ea,
            a3 - a1 * a2 + 11.0 * θa * θa * ea,
            a1.sin() * a3 + yc + 6.0 * θa.powi(3) * ea,
            -b + a2 * a3 + 2.0 * θb * eb,
            c2 + a3 + 5.0 * θc * ec,
            -c1 * c2 + b_seen + a2 + 4.0 * θc * θc * ec,
        ]
    };
    let found = |θ: &[f64], keys: &[(&str, Value)]| {
        let mut all = vec![classical(), ("k_poles", poles.clone())];
        all.extend_from_slice(keys);
        let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &with(θ, &all)).unwrap();
        assert_eq!(
            design.examination.fit(),
            Standing::Undecided,
            "no box is declared"
        );
        let said = design.examination.summary.words().contains("2 orders");
        assert_eq!(
            said,
            keys.is_empty(),
            "{}",
            design.examination.summary.words()
        );
        slope(
            &plant,
            &design,
            &[a1, a2, a3, b, c1, c2],
            &[u],
            &[yc, ya, yb],
        )
    };
    let ruled = [3.0, 1.2, 2.0];
    assert_close(&found(&ruled, &[]), &expected(ruled, b));
    // no order keeps this rule: the first one, in which c comes before b
    let free = [1.0, 3.0, 1.0];
    assert_close(&found(&free, &[]), &expected(free, yb));
    // asked for
    let order = ("order", names(&["ya", "yc", "yb"]));
    assert_close(&found(&ruled, &[order]), &expected(ruled, yb));
}

#[test]
fn an_order_that_is_none_is_refused() {
    let plant = plant(
        "model Two Real a; Real b; output Real y = a; output Real z = b;
         equation der(a) = -a; der(b) = a - b; end Two;",
    );
    for wrong in [names(&["y"]), names(&["y", "y"]), names(&["y", "q"])] {
        let tuning = with(&[1.0], &[("order", wrong)]);
        let error = design_with(BLOCK_TRIANGULAR, &plant, &[], &tuning).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("order: expected every measured output once")
        );
    }
}

/// Blocks of 3, 2, 2 and outputs with slopes that depend on an input. Each F is constant:
/// M = diag(1, −2, −6), diag(1, 4), I and L = 0, (0, −4), (0, −1) by the five steps.
#[test]
fn blocks_of_three_two_and_two_behind_moving_outputs() {
    let plant = plant(
        "model Blocks input Real u(min=0, max=1);
         Real a1; Real a2; Real a3; Real b1; Real b2; Real c1; Real c2;
         output Real ya = (2 + u)*a1; output Real yb = b1; output Real yc = (1 + u^2)*c1 + u;
         equation
         der(a1) = -2*a2; der(a2) = 3*a3; der(a3) = 0;
         der(b1) = 4*b2 + a3; der(b2) = -b1;
         der(c1) = c2; der(c2) = -c1 + b2; end Blocks;",
    );
    let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &with(&[2.0, 8.0, 64.0], &[])).unwrap();
    let x = [0.3, -0.8, 0.5, 1.1, -0.4, 0.9, 0.7];
    let (u, [ya, yb, yc]) = (0.6, [0.7, 0.8, -0.2]);
    let (ea, eb, ec) = (ya / 2.6 - x[0], yb - x[3], (yc - 0.6) / 1.36 - x[5]);
    let expected = [
        -2.0 * x[1] + 6.0 * ea,
        3.0 * x[2] + 12.0 / -2.0 * ea,
        8.0 / -6.0 * ea,
        4.0 * x[4] + x[2] + 16.0 * eb,
        -x[3] + (64.0 - 4.0) / 4.0 * eb,
        x[6] + 128.0 * ec,
        -x[5] + x[4] + (4096.0 - 1.0) * ec,
    ];
    assert_close(&slope(&plant, &design, &x, &[u], &[ya, yb, yc]), &expected);
    // a gain on ŷ − y is constant for b alone; the others name the paper's matrices
    assert_eq!(design.gains.len(), 1);
    assert_eq!(
        design.gains[0].entries,
        [("b1".to_owned(), 16.0), ("b2".to_owned(), 15.0)]
    );
    let parameter = |name: &str| {
        design
            .parameters
            .iter()
            .find(|p| p.0 == name)
            .unwrap()
            .1
            .words()
    };
    assert_eq!(parameter("M1"), "(1, 0, 0), (0, -2, 0), (0, 0, -6)");
    assert!(parameter("gain of ya on a1").contains('u'), "{design:?}");
}

/// Eight chains whose only order is the reverse of the sensors'.
#[test]
fn more_than_seven_outputs_are_arranged() {
    let n = 9;
    let mut text = String::from("model Many ");
    let mut equations = String::new();
    for i in 1..=n {
        text += &format!("Real x{i}; Real z{i}; ");
        // the later sensor's hidden state is known before
        let read = if i < n {
            format!("z{}", i + 1)
        } else {
            "0".into()
        };
        equations += &format!("der(x{i}) = z{i} + {read}; der(z{i}) = -x{i}; ");
    }
    for i in 1..=n {
        text += &format!("output Real y{i} = x{i}; ");
    }
    let plant = plant(&format!("{text} equation {equations} end Many;"));
    let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &with(&[1.0], &[])).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    assert!(
        design
            .examination
            .summary
            .words()
            .starts_with("(x9 → z9), then (x8 → z8)")
    );
}

const NEGATIVE: &str = "model Neg input Real u(min=-1,max=1);
  Real a(min=-2,max=2,start=0.5); Real b(min=-2,max=2,start=0.1); output Real y = a;
  equation der(a) = -2*b + 0.1*a*u; der(b) = 2*a - b + u; end Neg;";

/// The low-power form divides by −2: it fits. Observer (7) has no such form.
#[test]
fn the_low_power_form_knows_the_sign() {
    let plant = plant(NEGATIVE);
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let form = ("form", Value::Text("low-power".into()));
    let fit = |keys: &[(&str, Value)]| {
        BLOCK_TRIANGULAR
            .examine(&augmented, &with(&[5.0], keys))
            .unwrap()
            .fit()
    };
    assert_eq!(fit(std::slice::from_ref(&form)), Standing::Refuted);
    assert_eq!(fit(&[form, classical()]), Standing::Proved);
}

/// s² + 2s − 2 has the zero √3 − 1: the classical K does not know the sign.
#[test]
fn the_classical_gain_of_a_negative_partial_is_refuted() {
    let plant = plant(NEGATIVE);
    let found = refused(BLOCK_TRIANGULAR, &plant, &with(&[5.0], &[classical()]));
    let check = found.refuted().unwrap();
    let Verdict::Refuted(witness) = &check.verdict else {
        panic!("{check:?}")
    };
    assert!((witness.points[0].value - (3f64.sqrt() - 1.0)).abs() < 1e-12);
    assert!(
        check.reason.words().contains("0.732051") && check.reason.words().contains("k = [2, -0.5]"),
        "{check:?}"
    );
}

/// With the K that the refusal names the observer converges as its certificate says.
#[test]
fn a_gain_with_the_sign_of_the_partial_is_proved() {
    let plant = plant(NEGATIVE);
    let k = ("k", Value::List(vec![numbers(&[2.0, -0.5])]));
    let tuning = with(&[20.0], &[classical(), k]);
    let design = design_with(BLOCK_TRIANGULAR, &plant, &[], &tuning).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
    assert_eq!(
        design.gains[0].entries,
        [("a".to_owned(), 40.0), ("b".to_owned(), -200.0)]
    );
    let found = certificate(BLOCK_TRIANGULAR, &plant, tuning);
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
    keeps(&plant, &design, &found, &[-0.4, 0.6]);
}

/// For three states a positive partial can be too large: s³ + 3s² + 3s + 10 is unstable.
#[test]
fn a_positive_partial_that_is_too_large_is_refuted() {
    let text = |a: f64| {
        format!(
            "model Large Real a; Real b; Real c; output Real y = a;
             equation der(a) = b; der(b) = {a}*c; der(c) = -a; end Large;"
        )
    };
    let large = plant(&text(10.0));
    let found = refused(BLOCK_TRIANGULAR, &large, &with(&[5.0], &[classical()]));
    assert!(
        found
            .refuted()
            .unwrap()
            .statement
            .words()
            .starts_with("A(a) − KC is stable")
    );
    let fine = plant(&text(8.0));
    let design = design_with(BLOCK_TRIANGULAR, &fine, &[], &with(&[5.0], &[classical()])).unwrap();
    assert_eq!(design.examination.fit(), Standing::Proved);
}

/// k = [[-2, 1]] has the double eigenvalue +1.
#[test]
fn an_unstable_k_is_refused_with_its_eigenvalues() {
    let plant =
        plant("model I Real a; Real b; output Real y = a; equation der(a) = b; der(b) = 0; end I;");
    for keys in [vec![], vec![classical()]] {
        let mut all = vec![("k", Value::List(vec![numbers(&[-2.0, 2.0])]))];
        all.extend(keys);
        let found = refused(BLOCK_TRIANGULAR, &plant, &with(&[1.0], &all));
        let detail = &found.refuted().unwrap().reason.words();
        assert!(
            detail.contains("1 ± 1i") && detail.contains("k_poles"),
            "{detail}"
        );
    }
}

/// An S whose gain does not stabilise a chain of integrators is called proved only where
/// the plant's own damping carries it: s² + (4θ/3 + 1)s + 4θ/3 − 2θ²/3.
#[test]
fn an_s_that_rests_on_damping_is_told() {
    let plant = plant(
        "model I Real a; Real b; output Real y = a; equation der(a) = b; der(b) = -b; end I;",
    );
    let table = |off: f64| {
        let pairs = [("diag", numbers(&[1.0, 1.0])), ("off", numbers(&[off]))];
        let pairs = pairs.map(|(key, value)| (key.to_owned(), value));
        ("S", Value::List(vec![Value::Table(pairs.into())]))
    };
    // S⁻¹Cᵀ = (1, −off)/(1 − off²)
    let fit = |θ: f64, off: f64| {
        let tuning = with(&[θ], &[table(off)]);
        design_with(TRIANGULAR, &plant, &[], &tuning)
            .unwrap()
            .examination
    };
    assert_eq!(fit(10.0, -0.5).fit(), Standing::Proved);
    let carried = fit(1.0, 0.5);
    assert_eq!(carried.fit(), Standing::Proved);
    assert!(
        carried
            .summary
            .words()
            .contains("is not stable for (a → b)")
    );
    let wrong = fit(10.0, 0.5);
    assert_eq!(wrong.fit(), Standing::Undecided);
    let check = wrong.checks.last().unwrap();
    // s² + 4s/3 − 2/3
    assert!(
        check
            .reason
            .words()
            .contains("eigenvalues 0.387426, -1.72076"),
        "{}",
        check.reason.words()
    );
}

/// The eigenvalues of a long chain are not computed: what Routh's table leaves open is undecided.
/// With S the identity K = (1, 0, …), so that 0 is a zero of the polynomial.
#[test]
fn a_long_chain_is_not_called_damped() {
    let told = |n: usize| {
        let text = format!(
            "model L Real x[{n}]; output Real y = x[1]; equation
             for i in 1:{n}-1 loop der(x[i]) = x[i+1]; end for; der(x[{n}]) = -x[{n}]; end L;"
        );
        let pairs = [
            ("diag", numbers(&vec![1.0; n])),
            ("off", numbers(&vec![0.0; n - 1])),
        ];
        let pairs = pairs.map(|(key, value)| (key.to_owned(), value));
        let tuning = with(
            &[1.0],
            &[("S", Value::List(vec![Value::Table(pairs.into())]))],
        );
        let examination = design_with(TRIANGULAR, &plant(&text), &[], &tuning)
            .unwrap()
            .examination;
        assert_eq!(examination.fit(), Standing::Undecided);
        examination.checks.last().unwrap().reason.words().clone()
    };
    let short = told(20);
    assert!(short.contains("→ x[20]), eigenvalues 0"), "{short}");
    let long = told(201);
    assert!(
        long.contains("is not stable for (x[1] → … → x[201]); only")
            && long.contains("201 states, more than 200"),
        "{long}"
    );
}

/// Either chain can lead. The exponents decide where they are given: δ₂/δ₁ = 2 lies in
/// (1, 3) for z first, not in (3, 5) for y first.
#[test]
fn the_roles_of_two_chains_can_be_swapped() {
    let plant = plant(
        "model Two Real a(min=-1,max=1); Real b(min=-1,max=1); Real c(min=-1,max=1);
         output Real y = a; output Real z = c;
         equation der(a) = b; der(b) = -a + c; der(c) = -c + a*b; end Two;",
    );
    let designed =
        |keys: &[(&str, Value)]| design_with(TRIANGULAR, &plant, &[], &with(&[4.0], keys)).unwrap();
    let leading = |name: &str| ("leading", Value::Text(name.into()));
    assert_eq!(designed(&[leading("y")]).parameters[1].1.words(), "1, 4");
    assert_eq!(
        designed(&[leading("z")]).parameters[1].1.words(),
        "0.6666666667, 1"
    );
    let given = ("delta", numbers(&[1.0, 2.0]));
    assert!(designed(std::slice::from_ref(&given)).notes.is_empty());
    assert!(
        designed(&[given.clone(), leading("y")]).notes[0]
            .words()
            .contains("window")
    );
    let found = certificate(TRIANGULAR, &plant, with(&[30.0], &[given]));
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
}

/// f − K (ŷ − y) with the printed K is the observer, where partials divide the gain.
#[test]
fn the_printed_gain_is_the_one_that_acts() {
    let constant = plant(
        "model C Real a; Real b; Real c; output Real y = -4*a;
         equation der(a) = 2*b; der(b) = 6*c; der(c) = 0; end C;",
    );
    let divided = ("partials", Value::Flag(true));
    let design = design_with(
        TRIANGULAR,
        &constant,
        &[],
        &with(&[3.0], std::slice::from_ref(&divided)),
    )
    .unwrap();
    let printed: Vec<f64> = design.gains[0].entries.iter().map(|e| e.1).collect();
    let acting: Vec<f64> = slope(&constant, &design, &[0.0; 3], &[], &[1.0]);
    assert_close(&printed, &acting);
    // a gain that moves is printed as what it is
    let moving = plant(
        "model M Real a(start=1); Real b(min=1,max=2,start=1.5); output Real y = a;
         equation der(a) = b^2; der(b) = 0; end M;",
    );
    let design = design_with(TRIANGULAR, &moving, &[], &with(&[3.0], &[divided])).unwrap();
    assert!(design.gains.is_empty());
    let row = design
        .parameters
        .iter()
        .find(|p| p.0 == "gain of y on b")
        .unwrap();
    // θ²·1.53846…/(2·1.5) at the start
    let words = row.1.words();
    let value = words.rsplit("; ").next().unwrap();
    let number: f64 = value.trim_end_matches(" at the start").parse().unwrap();
    assert!((number - 9.0 * GAIN_2 / 3.0).abs() < 1e-9, "{row:?}");
}

/// Second entry of Lemma 1's S⁻¹Cᵀ for two states with a = 1: s = −1.3/4, s₂₂ = 3s²,
/// −s/det S = 1/(2|s|).
const GAIN_2: f64 = 1.0 / (2.0 * 0.325);

/// The run stays below λ₁ e^{−σt} |e(0)|.
fn keeps(plant: &Plant, design: &lynkeus_observers::Design, found: &Certificate, x0: &[f64]) {
    let n = x0.len();
    let (σ, λ1) = (found.rate.unwrap(), constant(found, "λ1"));
    let rows: Vec<f64> = (0..=60).map(|k| f64::from(k) * 6.0 / σ / 60.0).collect();
    let inputs: &[(&str, &str)] = if plant.inputs.is_empty() {
        &[]
    } else {
        &[("u", "sin(time)")]
    };
    let run = run(plant, design, inputs, x0, &rows, 2e-4);
    let error = |row: &[f64]| {
        (1..=n)
            .map(|i| (row[i] - row[n + i]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let start = error(&run.rows[0]);
    for row in &run.rows {
        let bound = λ1 * (-σ * row[0]).exp() * start;
        assert!(
            error(row) <= bound * (1.0 + 1e-6) + 1e-9,
            "{row:?} above {bound}"
        );
    }
    assert!(error(run.rows.last().unwrap()) < 1e-2 * start);
}

fn damped(sign: &str) -> Plant {
    plant(&format!(
        "model D Real a(min=-1,max=1,start=0.5); Real b(min=-1,max=1,start=-0.2); output Real y = a;
         equation der(a) = {sign}(b + b^3/3); der(b) = -0.5*b - 0.1*b^3 {sign}(-0.3*a); end D;"
    ))
}

/// 100 times the box away: f̃ = f(Px̂) + √2·(b̂ − Pb̂), the partial being in [1, 2].
#[test]
fn prolongation_from_far_outside_of_the_box() {
    for (family, sign) in [
        (TRIANGULAR, "+"),
        (TRIANGULAR, "-"),
        (BLOCK_TRIANGULAR, "+"),
    ] {
        let plant = damped(sign);
        let keys = match family.name() {
            "triangular" => vec![("prolong", Value::Flag(true))],
            _ => vec![("prolong", Value::Flag(true)), classical()],
        };
        let mut tuning = with(&[40.0], &keys);
        tuning.initial.values.insert("a".into(), 100.0);
        tuning.initial.values.insert("b".into(), -100.0);
        let design = design_with(family, &plant, &[], &tuning).unwrap();
        let s = if sign == "-" { -1.0 } else { 1.0 };
        let far = slope(&plant, &design, &[0.4, -100.0], &[], &[0.4]);
        let edge = s * -(1.0 + 1.0 / 3.0) + s * 2f64.sqrt() * -99.0;
        assert!((far[0] - edge).abs() < 1e-5 * edge.abs(), "{far:?} {edge}");
        let found = certificate(family, &plant, tuning);
        assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
        assert!(
            found
                .notes
                .iter()
                .any(|n| n.words().contains("every start of the estimate"))
        );
        keeps(&plant, &design, &found, &[0.5, -0.2]);
    }
}

#[test]
fn what_cannot_be_prolonged_is_said() {
    let open = plant(
        "model O Real a; Real b; output Real y = a;
         equation der(a) = b + b^3; der(b) = 0; end O;",
    );
    let tuning = with(
        &[1.0],
        &[
            ("prolong", Value::Flag(true)),
            ("partials", Value::Flag(true)),
        ],
    );
    let text = design_with(TRIANGULAR, &open, &[], &tuning)
        .unwrap_err()
        .to_string();
    assert!(
        text.starts_with("prolong: expected ∂f(a)/∂b with known bounds"),
        "{text}"
    );
    let low = with(
        &[1.0],
        &[
            ("prolong", Value::Flag(true)),
            ("form", Value::Text("low-power".into())),
        ],
    );
    let text = design_with(TRIANGULAR, &damped("+"), &[], &low)
        .unwrap_err()
        .to_string();
    assert!(
        text.starts_with("prolong: expected no prolongation with form"),
        "{text}"
    );
}

/// Twenty states with partials in [0.95, 1.05] or so: Lemma 1 is proved without visiting
/// 2¹⁹ vertices.
#[test]
fn lemma_1_for_twenty_states() {
    let n = 20;
    let (mut states, mut equations) = (String::new(), String::new());
    for i in 1..=n {
        states += &format!("Real x{i}(min=-1,max=1); ");
        let next = if i < n {
            format!("x{0} + 0.05*sin(x{0})", i + 1)
        } else {
            "0".into()
        };
        equations += &format!("der(x{i}) = {next}; ");
    }
    let plant = plant(&format!(
        "model L {states} output Real y = x1; equation {equations} end L;"
    ));
    let found = certificate(TRIANGULAR, &plant, with(&[1.0], &[]));
    let lemma = hypothesis(&found, "Lemma 1");
    assert_eq!(lemma.verdict, Verdict::Proved, "{lemma:?}");
    assert_eq!(found.verdict(), Standing::Proved, "{found:#?}");
}
