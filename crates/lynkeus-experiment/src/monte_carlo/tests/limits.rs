//! What a limit of time leaves of many runs.

use super::*;

/// x' = x³/10, of which some runs end early, and a rate that is too noisy to be credible: the runs that
/// go on in portions give the same as all at once.
#[test]
fn a_limit_of_time_that_does_not_strike_changes_nothing() {
    let folder = folder();
    let cubic = PLANT.replace("-p*x", "x^3/10");
    let cart = "model Cart Real x(start = 0, min = -99, max = 99); Real v(start = 0, min = -1e-3, max = 1e-3);
      output Real y = x; equation der(x) = v; der(v) = 0; end Cart;";
    for (model, count) in [(cubic.as_str(), 30), (cart, 100)] {
        std::fs::write(folder.path().join("decay.mo"), model).unwrap();
        let simulate = "spread = { x = 0.3 }\nmethod = \"rk4\"\nstep = 0.02";
        let mut study = super::study(&folder, "noise = { y = 0.1 }", simulate);
        study.observer.tuning.values.remove("S");
        let free = runs(&study, count).unwrap();
        study.budget = limited(3600.0);
        let found = runs(&study, count).unwrap();
        assert!(!(free.failures.is_empty() && free.doubtful.is_empty()));
        assert_eq!(found.seeds, free.seeds);
        assert_eq!(found.failures, free.failures);
        assert_eq!(found.doubtful, free.doubtful);
        assert_eq!((found.again, &found.time), (free.again, &free.time));
        for (found, free) in found.quantities.iter().zip(&free.quantities) {
            assert_eq!(found.rms, free.rms);
            assert_eq!((&found.truth, &found.error), (&free.truth, &free.error));
            assert_eq!(found.error_worst, free.error_worst);
            assert_eq!(found.worst_course, free.worst_course);
        }
    }
}

fn limited(seconds: f64) -> lynkeus_expr::Budget {
    let time = std::time::Duration::from_secs_f64(seconds);
    lynkeus_expr::Budget::new(Some(time), None)
}

/// Ten million runs of 4000 steps are not done in two seconds; those that are count, and are the same alone.
#[test]
fn a_limit_of_time_leaves_the_runs_that_are_done() {
    let folder = folder();
    let simulate = "method = \"rk4\"\nstep = 1e-4";
    let mut study = super::study(&folder, "noise = { y = 0.1 }", simulate);
    study.simulate.as_mut().unwrap().until = 0.4;
    let asked = 10_000_000;
    study.budget = limited(2.0);
    let found = runs(&study, asked).unwrap();
    let done = found.seeds.len();
    assert!((8..asked).contains(&done), "{done}");
    assert_eq!(found.seeds, (5..5 + done as u64).collect::<Vec<u64>>());
    let words = format!("{done} of {asked} runs: the limit of 2 s ended it");
    assert_eq!(found.limit.as_ref(), Some(&words));
    assert_eq!(found.refusal().unwrap().kind(), crate::ErrorKind::Ended);
    study.budget = lynkeus_expr::Budget::default();
    for run in [0, done / 2, done - 1] {
        let outcome = alone(&study, found.seeds[run]);
        let rms = found.quantities[0].rms[run];
        assert_eq!(outcome.quantities[0].settled_error(), Some(rms));
    }
}

/// A million steps from row to row: a limit, or who watches, is not asked at the rows alone.
#[test]
fn a_limit_of_time_ends_runs_between_two_rows() {
    let folder = folder();
    let simulate = "method = \"rk4\"\nsubsteps = 1000000";
    let mut study = super::study(&folder, "noise = { y = 0.1 }", simulate);
    study.simulate.as_mut().unwrap().until = 4000.0;
    study.budget = limited(0.5);
    let begun = std::time::Instant::now();
    let error = runs(&study, 8).unwrap_err().to_string();
    let words = "s.toml: undecided: the limit of 0.5 s ended it";
    assert!(error.contains(words), "{error}");
    assert!(
        begun.elapsed().as_secs_f64() < 20.0,
        "{:?}",
        begun.elapsed()
    );
}

/// What is wrong with all of them is told with the study's name, as for one run.
#[test]
fn too_many_steps_are_refused_by_the_name_of_the_study() {
    let folder = folder();
    let simulate = "method = \"rk4\"\nstep = 1e-8";
    let study = super::study(&folder, "noise = { y = 0.1 }", simulate);
    let error = runs(&study, 8).unwrap_err().to_string();
    assert!(error.contains("s.toml: step: expected at least"), "{error}");
}
