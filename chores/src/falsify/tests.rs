//! The falsifier finds what is false, lets stand what is true, and finds nothing in a
//! short search.

use nalgebra::DMatrix;

use super::case::{Asked, Case, Course, Input, Kind, Noise, Role, Side};
use super::chance::Counted;
use super::claims::Claim;
use super::facts::{Fact, Facts};
use super::generate;
use super::judge::{Desk, attack, judge, so_many_looks};
use super::pair::Pair;
use super::report::Options;
use crate::numbers::Numbers;
use lynkeus::expr::Interval;
use lynkeus::prepare::Prepared;
use lynkeus::structure::Standing;
use lynkeus::{ErrorTube, Study, Tube, Witness};

fn side(name: &str, low: f64, high: f64) -> Side {
    Side {
        name: name.into(),
        low,
        high,
    }
}

/// x1' = −x1 + x2, x2' = −x2 + the term, y = x1 + d.
fn case(term: &str) -> Case {
    let mut case = Case {
        kind: Kind::StateAffine,
        states: vec![side("x1", -2.0, 2.0), side("x2", -2.0, 2.0)],
        inputs: vec![Input {
            side: side("d", -0.1, 0.1),
            role: Role::Disturbance,
            declared: true,
        }],
        equations: vec![
            vec!["-x1".into(), "x2".into()],
            vec!["-x2".into(), term.into()],
        ],
        couplings: vec![],
        outputs: vec![vec!["x1".into(), "d".into()]],
        noise: vec![Noise::default()],
        process: vec![],
        slope: None,
        tube: None,
        course: None,
        observer: vec![],
    };
    case.key("family", "\"triangular\"");
    // the copy of the plant with next to no correction
    case.key("theta", "1e-6");
    case
}

fn with_pair<T>(
    case: &Case,
    name: &str,
    look: impl FnOnce(&mut Pair, &lynkeus::structure::AugmentedPlant<'_>) -> T,
) -> T {
    let folder =
        std::env::temp_dir().join(format!("lynkeus-falsify-{name}-{}", std::process::id()));
    let desk = Desk::new(&folder).unwrap();
    let study = Study::load(desk.write(case).unwrap()).unwrap();
    let plant = lynkeus::prepare::plant(&study).unwrap();
    let prepared = Prepared::new(&study, &plant).unwrap();
    let design = prepared.design().unwrap();
    let mut pair = Pair::new(&plant, prepared.augmented(), &design.observer).unwrap();
    let seen = look(&mut pair, prepared.augmented());
    std::fs::remove_dir_all(folder).unwrap();
    seen
}

fn claim(rate: f64, overshoot: f64, ultimate: f64) -> Claim {
    Claim {
        basis: "a claim".into(),
        rate,
        overshoot: Some(overshoot),
        ultimate: Some(ultimate),
        each: vec![],
        probable: None,
        lyapunov: None,
        sides: vec![],
    }
}

fn ratio(case: &Case, name: &str, claim: Claim) -> f64 {
    with_pair(case, name, |pair, augmented| {
        let claims = [claim];
        let mut attack = attack(case, augmented, pair, &claims);
        let (_, worst) = attack.search(&mut Numbers::new(5, 0), 60);
        worst.ratio
    })
}

/// The error obeys e' = [−1, 1; 0, −1] e: |e(t)| ≤ √(1 + t + t²)·e^(−t)|e(0)| at most,
/// below 1.5·e^(−0.8t)|e(0)|; nothing acts on it but d through gains of 1e-6.
#[test]
fn a_true_claim_stands_and_false_ones_fall() {
    let case = case("0");
    let found = [
        ("true", claim(0.7, 1.6, 1e-5)),
        ("rate", claim(1.2, 1.6, 1e-5)),
        ("overshoot", claim(0.99, 1.0, 1e-5)),
    ]
    .map(|(name, claim)| ratio(&case, name, claim));
    assert!(found[0] <= 1.0, "{found:?}");
    assert!(found[1] > 1.0 && found[2] > 1.0, "{found:?}");
}

/// V = |e|² falls at 2·rate with rate = 1/2: −1 ± ½ are the eigenvalues of the
/// symmetric part.
#[test]
fn a_function_that_does_not_fall_is_found_without_simulation() {
    let case = case("0.1*sin(x1)*0");
    let of = |rate: f64, name: &str| {
        let mut claim = claim(rate, 1.0, 1.0);
        claim.lyapunov = Some(DMatrix::identity(2, 2));
        with_pair(&case, name, |pair, augmented| {
            let claims = [claim];
            attack(&case, augmented, pair, &claims).secant(&mut Numbers::new(5, 0))
        })
    };
    assert_eq!(of(0.49, "falls"), None);
    assert!(of(0.52, "rises").is_some());
}

#[test]
fn what_a_plant_does_is_seen_by_its_values() {
    for (term, expected) in [
        ("sin(x1)", None),
        ("abs(x1 - 0.3)", None),
        ("tanh(20*x1)", None),
        ("0.01*sign(x1 - 0.371)", Some(Fact::Jumps)),
        ("0.1*atan2(x1, -1.0)", Some(Fact::Jumps)),
        ("mod(x2, 0.7)", Some(Fact::Jumps)),
        ("log(x1 + 1.5)", Some(Fact::Undefined)),
        ("(x2 + 1)^1.5", Some(Fact::Undefined)),
    ] {
        let found = with_pair(&case(term), "facts", |pair, _| {
            let mut facts = Facts {
                pair,
                states: vec![[-2.0, 2.0]; 2],
                inputs: vec![[0.0, 0.0]],
            };
            facts.against(&mut Numbers::new(3, 0), &[(0, 1)])
        });
        assert_eq!(found.map(|f| f.0), expected, "{term}");
    }
    let found = with_pair(&case("0"), "signs", |pair, _| {
        let mut facts = Facts {
            pair,
            states: vec![[-2.0, 2.0]; 2],
            inputs: vec![[0.0, 0.0]],
        };
        [(0, 1), (1, 0)].map(|pair| facts.against(&mut Numbers::new(3, 0), &[pair]))
    });
    // x2 moves x1' up everywhere, x1 does not move x2'
    assert_eq!(found, [None, None]);
}

/// What is seen of runs of a pendulum with a push, beside its tube with other numbers in it.
fn seen(name: &str, change: impl FnOnce(&mut Tube)) -> (f64, Option<String>) {
    let mut case = case("-sin(3*x1) + d");
    case.tube = Some(Asked {
        start: vec![side("x1", 0.4, 0.7), side("x2", -0.1, 0.1)],
        until: 3.0,
    });
    let folder = std::env::temp_dir().join(format!("lynkeus-{name}-{}", std::process::id()));
    let desk = Desk::new(&folder).unwrap();
    let study = Study::load(desk.write(&case).unwrap()).unwrap();
    let plant = lynkeus::prepare::plant(&study).unwrap();
    let mut tube = lynkeus::certify(&study).unwrap().tube.unwrap();
    change(&mut tube);
    let mut attack = super::tube::Attack::new(&case, &tube, &plant).unwrap();
    let found = (
        attack.search(&mut Numbers::new(5, 0), 60).ratio,
        attack.misled(),
    );
    std::fs::remove_dir_all(folder).unwrap();
    found
}

/// Half of a range, about its middle.
fn narrower(range: &mut Interval) {
    let (middle, half) = (range.midpoint(), 0.25 * range.width());
    *range = Interval::new(middle - half, middle + half).unwrap();
}

#[test]
fn runs_leave_a_tube_that_is_too_narrow() {
    let (ratio, misled) = seen("tube", |tube| assert_eq!(tube.verdict, Standing::Proved));
    assert!(
        ratio <= 1.0 && ratio > 0.9 && misled.is_none(),
        "{ratio} {misled:?}"
    );
    let one_row = |tube: &mut Tube| tube.rows[60].2.iter_mut().for_each(narrower);
    let end = |tube: &mut Tube| tube.end.iter_mut().for_each(|(_, range)| narrower(range));
    let late = |tube: &mut Tube| tube.rows.drain(150..).for_each(drop);
    assert!(seen("row", one_row).0 > 1.0);
    assert!(seen("end", end).0 > 1.0);
    assert!(seen("late", late).0 > 1.0);
}

#[test]
fn a_witness_that_shows_nothing_is_found() {
    let with = |state: &str, time: f64, value: [f64; 2], x1: f64| {
        let at = [("x1", x1), ("x2", 0.0), ("d", 0.1)];
        let witness = Witness {
            at: at.map(|(name, x)| (name.to_owned(), x)).into(),
            state: state.into(),
            time,
            value,
        };
        seen("witness", |tube| tube.witness = Some(witness)).1
    };
    // not outside, not there, from elsewhere
    for (value, x1) in [([-1.0, 1.0], 0.5), ([2.1, 2.2], 0.5), ([-1.0, 1.0], 0.9)] {
        assert!(with("x1", 1.0, value, x1).is_some(), "{value:?}");
    }
}

/// A pendulum with a filter.
fn pendulum() -> Case {
    let mut case = case("-sin(x1) + d");
    case.kind = Kind::Filter;
    case.outputs = vec![vec!["x1".into()]];
    case.noise[0] = Noise {
        size: 0.004,
        is_uniform: true,
    };
    case.process = vec![("x1".into(), 0.0), ("x2".into(), 0.02)];
    case.tube = Some(Asked {
        start: vec![side("x1", 0.4, 0.44), side("x2", -0.02, 0.02)],
        until: 1.5,
    });
    case.course = Some(Course {
        every: 0.15,
        known: vec![],
        is_predicted: false,
    });
    case.observer.clear();
    case.key("family", "\"ekf\"");
    case.key("initial", "{ x1 = 0.42, x2 = 0 }");
    case.key("initial_variance", "{ x1 = 0.001, x2 = 0.001 }");
    case
}

/// What is seen of runs of a case's filter or observer, beside the tube of its error with other numbers in it.
fn followed(case: &Case, name: &str, change: impl FnOnce(&mut ErrorTube)) -> f64 {
    let folder = std::env::temp_dir().join(format!("lynkeus-{name}-{}", std::process::id()));
    let desk = Desk::new(&folder).unwrap();
    let study = Study::load(desk.write(case).unwrap()).unwrap();
    let plant = lynkeus::prepare::plant(&study).unwrap();
    let prepared = Prepared::new(&study, &plant).unwrap();
    let mut tube = lynkeus::certify(&study).unwrap().error_tube.unwrap();
    assert_eq!(tube.verdict, Standing::Proved);
    change(&mut tube);
    let mut attack =
        super::error::Attack::new(case, &study, prepared.augmented(), &tube, false).unwrap();
    let worst = attack.search(&mut Numbers::new(5, 0), 6);
    std::fs::remove_dir_all(folder).unwrap();
    assert!(worst.is_whole || worst.ratio > 1.0);
    worst.ratio
}

/// A tenth less of a range, about its middle.
fn tenth_less(range: &mut Interval) {
    let (middle, half) = (range.midpoint(), 0.45 * range.width());
    *range = Interval::new(middle - half, middle + half).unwrap();
}

#[test]
fn runs_of_a_filter_leave_a_tube_that_is_too_narrow() {
    let ratio = followed(&pendulum(), "filter", |_| {});
    assert!(ratio <= 1.0 && ratio > 0.97, "{ratio}");
    let end = |tube: &mut ErrorTube| {
        let noisy = tube.noisy.as_mut().unwrap();
        noisy.error_end.iter_mut().for_each(tenth_less);
    };
    let rows = |tube: &mut ErrorTube| {
        let noisy = tube.noisy.as_mut().unwrap();
        let rows = noisy.rows[135..165].iter_mut();
        rows.for_each(|row| row.2[..2].iter_mut().for_each(narrower));
    };
    let deviation = |tube: &mut ErrorTube| {
        let noisy = tube.noisy.as_mut().unwrap();
        for range in &mut noisy.deviation_end {
            *range = Interval::new(1.0005 * range.hi(), 1.01 * range.hi()).unwrap();
        }
    };
    let found = [
        followed(&pendulum(), "end", end),
        followed(&pendulum(), "rows", rows),
        followed(&pendulum(), "sd", deviation),
    ];
    assert!(found.iter().all(|ratio| *ratio > 1.0), "{found:?}");
}

#[test]
fn runs_of_an_observer_leave_a_tube_that_is_too_narrow() {
    let mut case = case("-sin(x1) + d");
    case.kind = Kind::Triangular;
    case.outputs = vec![vec!["x1".into()]];
    case.noise[0] = Noise {
        size: 0.004,
        is_uniform: true,
    };
    case.tube = Some(Asked {
        start: vec![side("x1", 0.4, 0.44), side("x2", -0.02, 0.02)],
        until: 1.5,
    });
    case.observer.clear();
    case.key("family", "\"triangular\"");
    case.key("theta", "3");
    case.key("initial", "{ x1 = 0.42, x2 = 0.1 }");
    let narrow = |tube: &mut ErrorTube| {
        let noisy = tube.noisy.as_mut().unwrap();
        // a tube has some room for what varies between samples, which counts step by step
        for _ in 0..3 {
            noisy.error_end.iter_mut().for_each(tenth_less);
        }
    };
    for is_predicted in [false, true] {
        case.course = Some(Course {
            every: 0.05,
            known: vec![],
            is_predicted,
        });
        let found = followed(&case, "observer", |_| {});
        assert!(found <= 1.0 && found > 0.95, "{is_predicted}: {found}");
        let found = followed(&case, "narrow", narrow);
        assert!(found > 1.0, "{is_predicted}: {found}");
    }
}

#[test]
fn a_limit_of_looks_ends_a_tube_where_it_ended_before() {
    let folder = std::env::temp_dir().join(format!("lynkeus-looks-{}", std::process::id()));
    let desk = Desk::new(&folder).unwrap();
    let study = Study::load(desk.write(&pendulum()).unwrap()).unwrap();
    let reached = |looks: usize| {
        let mut study = study.clone();
        study.budget = so_many_looks(looks);
        let tube = lynkeus::certify(&study).unwrap().error_tube.unwrap();
        tube.noisy.unwrap().reached
    };
    let found = [100, 100, 120, 300].map(reached);
    std::fs::remove_dir_all(folder).unwrap();
    assert!(found[0] > 0.0 && found[0] == found[1], "{found:?}");
    assert!(found[1] < found[2] && found[2] < found[3], "{found:?}");
    assert_eq!(found[3], 1.5);
}

/// e' = −(0.5 + k) e + k ν: the error is normal, and as large as the bound says but for the mean of a tail instead of its
/// quantile, 2.892 instead of 2.576 standard deviations.
#[test]
fn too_many_runs_beyond_a_bound_are_counted() {
    let mut case = case("0");
    case.states = vec![side("x1", -1.0, 1.0)];
    case.equations = vec![vec!["-0.5*x1".into()]];
    case.outputs = vec![vec!["x1".into()]];
    case.inputs.clear();
    case.noise[0].size = 0.02;
    case.key("theta", "2");
    let count = |share: f64| {
        with_pair(&case, "chance", |pair, augmented| {
            let study = std::env::temp_dir().join(format!(
                "lynkeus-falsify-chance-{}/study.toml",
                std::process::id()
            ));
            let report = lynkeus::certify(&Study::load(study).unwrap()).unwrap();
            let mut bounds = report.certificate.probable.unwrap();
            bounds.norm *= share;
            bounds.states.iter_mut().for_each(|b| b.value *= share);
            let rate = report.certificate.rate.unwrap();
            let mut attack = attack(&case, augmented, pair, &[]);
            super::chance::count(&mut attack, &bounds, rate, &[], &mut Numbers::new(5, 0))
        })
    };
    assert!(matches!(count(1.0), Some(Counted { evidence: None })));
    assert!(matches!(count(0.8), Some(Counted { evidence: Some(_) })));
}

/// A gain that is proved for the input of `[simulate]` alone was attacked with all that the model declares.
#[test]
fn a_certificate_for_the_simulated_inputs_is_attacked_with_them() {
    let mut numbers = Numbers::new(3201, 11_986);
    let case = generate::case(&mut numbers, Kind::Designed);
    let folder = std::env::temp_dir().join(format!("lynkeus-meant-{}", std::process::id()));
    let options = Options::read(&[]).unwrap();
    let judged = Desk::new(&folder)
        .map_err(|e| e.to_string())
        .and_then(|desk| judge(&case, &desk, &mut numbers, options.effort(11_986, 0), true));
    let _ = std::fs::remove_dir_all(&folder);
    let judged = judged.unwrap();
    assert!(judged.counts.proved > 0);
    assert!(judged.violations.is_empty(), "{:#?}", judged.violations);
}

/// The same search as `cargo xtask falsify`, short.
#[test]
fn a_short_search_finds_no_false_claim() {
    let folder = std::env::temp_dir().join(format!("lynkeus-falsify-{}", std::process::id()));
    let options = Options {
        folder: folder.clone(),
        plants: Some(PLANTS),
        count: usize::MAX,
        ..Options::read(&[]).unwrap()
    };
    let report = super::search(&options).unwrap();
    let total = report.tally.total();
    assert!(
        report.found.is_empty(),
        "kept under {}:\n{}",
        folder.display(),
        report.text()
    );
    // a search that proves, follows and refutes nothing would find nothing either
    assert!(total.proved as u64 > PLANTS / 4, "{total:?}");
    assert!(2 * total.followed > total.proved, "{total:?}");
    assert!(total.sampled > 0, "{total:?}");
    assert!(
        total.stay as u64 > PLANTS / 20 && total.stay < total.tubes,
        "{total:?}"
    );
    assert!(total.refutations as u64 > PLANTS / 30, "{total:?}");
    assert!(total.bounded > 0 && total.probable > 0, "{total:?}");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Eight of each place in the round of kinds: less than a minute.
const PLANTS: u64 = 88;
