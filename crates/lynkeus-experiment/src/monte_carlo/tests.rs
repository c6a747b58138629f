use std::ops::ControlFlow;

use lynkeus_run::deviate;

use super::*;
use crate::simulate;

mod ends;
mod limits;

/// x' = −p x with x measured: the triangular observer of one state is z' = −p z + θ (y − z).
const PLANT: &str = "model Decay
  parameter Real p = 0.5;
  Real x(start = 1, min = -10, max = 10);
  output Real y = x;
equation
  der(x) = -p*x;
end Decay;";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("decay.mo"), PLANT).unwrap();
    folder
}

fn study(folder: &tempfile::TempDir, sensors: &str, simulate: &str) -> Study {
    let text = format!(
        "plant = \"decay.mo\"\n[sensors]\n{sensors}\n[observer]\nfamily = \"triangular\"\ntheta = 2\nS = [{{ diag = [1], off = [] }}]\n[simulate]\nuntil = 4\noutput_step = 0.1\nseed = 5\n{simulate}"
    );
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    Study::load(&path).unwrap()
}

fn runs(study: &Study, count: usize) -> Result<MonteCarlo, Error> {
    monte_carlo(study, count, &mut |_| ControlFlow::Continue(()))
}

fn alone(study: &Study, seed: u64) -> crate::Outcome {
    let mut study = study.clone();
    study.simulate.as_mut().unwrap().seed = seed;
    simulate(&study, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Every figure of a run is that of the run alone, and the statistics those of a plain loop.
#[test]
fn a_run_alone_is_the_same_and_a_loop_gives_the_same_figures() {
    let folder = folder();
    let spread = "spread = { x = 0.3, p = 0.05 }";
    same_as_alone(&study(&folder, "noise = { y = 0.1 }", spread));
}

/// Runs with fixed steps go on together.
#[test]
fn runs_that_go_on_together_are_the_same_alone() {
    let folder = folder();
    for step in ["step = 0.03", "substeps = 3"] {
        let simulate =
            format!("spread = {{ x = 0.3 }}\nsample_step = 0.07\nmethod = \"rk4\"\n{step}");
        same_as_alone(&study(&folder, "noise = { y = 0.1 }", &simulate));
    }
}

#[test]
fn runs_that_go_on_together_are_refused_before_they_fill_the_memory() {
    let folder = folder();
    let limited = Study {
        budget: lynkeus_expr::Budget::new(
            None,
            Some(lynkeus_expr::Memory {
                limit: 64 << 20,
                used: || 0,
                before: 0,
            }),
        ),
        ..study(
            &folder,
            "noise = { y = 0.1 }",
            "method = \"rk4\"\nstep = 0.05",
        )
    };
    assert!(runs(&limited, 100).is_ok());
    let text = runs(&limited, 1_000_000_000).unwrap_err().to_string();
    assert!(text.contains("1000000000 runs of 41 rows take"), "{text}");
    // more than any machine has
    let free = Study {
        budget: lynkeus_expr::Budget::default(),
        ..limited
    };
    let text = runs(&free, 1 << 50).unwrap_err().to_string();
    assert!(text.contains("no memory for so many"), "{text}");
}

/// x' = x³/10 ends at 5/x₀², which is before the end of the run where x₀ is above 1.118.
#[test]
fn runs_that_go_on_together_and_do_not_reach_their_end_are_in_no_figure() {
    let folder = folder();
    let simulate = "spread = { x = 0.3 }\nmethod = \"rk4\"\nstep = 0.01";
    let study = study(&folder, "noise = { y = 0.1 }", simulate);
    let growing = PLANT.replace("-p*x", "x^3/10");
    std::fs::write(folder.path().join("decay.mo"), growing).unwrap();
    let mut told = vec![];
    let found = monte_carlo(&study, 12, &mut |done| {
        told.push(done);
        ControlFlow::Continue(())
    });
    let found = found.unwrap();
    // the others are done once more
    assert!(told.is_sorted() && told.last() == Some(&1.0), "{told:?}");
    let failed: Vec<u64> = found.failures.iter().map(|f| f.seed).collect();
    let escaping = (5..17).filter(|seed| 1.0 + 0.3 * deviate(*seed, "x") > 5_f64.sqrt() / 2.0);
    let escaping: Vec<u64> = escaping.collect();
    assert!(
        !escaping.is_empty() && escaping.len() < 12,
        "the seeds show nothing"
    );
    assert_eq!(failed, escaping);
    for (seed, rms) in found.seeds.iter().zip(&found.quantities[0].rms) {
        let outcome = alone(&study, *seed);
        assert_eq!(outcome.quantities[0].settled_error(), Some(*rms));
    }
    assert!(found.refusal().is_some());
}

/// Lanes have a sine of their own: what is said to repeat a run does so.
#[test]
fn what_is_said_to_repeat_a_run_does() {
    let folder = folder();
    let simulate = "spread = { x = 0.3 }\nmethod = \"rk4\"\nstep = 0.03";
    let study = study(&folder, "noise = { y = 0.1 }", simulate);
    let rational = runs(&study, 9).unwrap();
    assert_eq!(rational.again, Again::Alone);
    assert!(rational.to_string().contains("; --seed repeats one alone"));
    let sine = PLANT.replace("-p*x", "-p*sin(x)");
    std::fs::write(folder.path().join("decay.mo"), sine).unwrap();
    let found = runs(&study, 9).unwrap();
    assert_eq!(found.again, Again::InABatch);
    assert!(found.to_string().contains("; --runs 1 --seed repeats one"));
    for (seed, rms) in found.seeds.iter().zip(&found.quantities[0].rms) {
        let mut study = study.clone();
        study.simulate.as_mut().unwrap().seed = *seed;
        assert_eq!(runs(&study, 1).unwrap().quantities[0].rms, [*rms]);
        let alone = alone(&study, *seed).quantities[0].settled_error().unwrap();
        assert!((alone - rms).abs() < 1e-12 * rms, "{alone} {rms}");
    }
    let adaptive = self::study(&folder, "noise = { y = 0.1 }", "");
    assert_eq!(runs(&adaptive, 2).unwrap().again, Again::Alone);
}

fn same_as_alone(study: &Study) {
    let found = runs(study, 7).unwrap();
    assert_eq!(found.seeds, [5, 6, 7, 8, 9, 10, 11]);
    assert_eq!(found.quantities.len(), 1);
    let x = &found.quantities[0];
    let outcomes: Vec<crate::Outcome> = found.seeds.iter().map(|s| alone(study, *s)).collect();
    for (outcome, rms) in outcomes.iter().zip(&x.rms) {
        assert_eq!(outcome.time.to_vec(), found.time);
        assert_eq!(outcome.quantities[0].settled_error(), Some(*rms));
    }
    for row in 0..found.time.len() {
        let truth = |o: &crate::Outcome| o.quantities[0].truth.as_ref().unwrap().get(row).unwrap();
        let error = |o: &crate::Outcome| {
            o.quantities[0].estimate.as_ref().unwrap().get(row).unwrap() - truth(o)
        };
        let mean = outcomes.iter().map(truth).sum::<f64>() / 7.0;
        assert_eq!(mean, x.truth.mean[row]);
        let worst = outcomes.iter().map(|o| error(o).abs()).fold(0.0, f64::max);
        assert_eq!(worst, x.error_worst[row]);
        let mut errors: Vec<f64> = outcomes.iter().map(error).collect();
        errors.sort_by(f64::total_cmp);
        // 0.95·6 = 5.7
        let high = errors[5] + 0.7 * (errors[6] - errors[5]);
        assert!((high - x.error.high[row]).abs() < 1e-12);
    }
    let worst = x.rms.iter().copied().fold(0.0, f64::max);
    assert_eq!(x.rms[x.worst_run], worst);
    assert_eq!(x.settled().worst, worst);
    let worst = &outcomes[x.worst_run];
    let course = (0..found.time.len()).map(|row| {
        let q = &worst.quantities[0];
        let at = |values: &Option<crate::Series>| values.as_ref().unwrap().get(row).unwrap();
        at(&q.estimate) - at(&q.truth)
    });
    assert_eq!(x.worst_course, course.collect::<Vec<f64>>());
}

/// Under noise that is held for Δ the error e' = −(p + θ) e + θ v is the recursion
/// e⁺ = a e + (1 − a) θ/(p + θ) v with a = exp(−(p + θ) Δ), of variance ((1 − a)/(1 + a)) (θ σ/(p + θ))².
#[test]
fn the_error_scatters_as_it_must() {
    let folder = folder();
    let study = study(&folder, "noise = { y = 0.1 }", "");
    let count = 2000;
    let found = runs(&study, count).unwrap();
    let x = &found.quantities[0];
    let a = (-2.5_f64 * 0.1).exp();
    let deviation = ((1.0 - a) / (1.0 + a)).sqrt() * 2.0 * 0.1 / 2.5;
    let last = found.time.len() - 1;
    // the 5 % and 95 % quantiles of a normal value; their standard error is 2.11 σ/√n
    let error = 4.0 * 2.11 * deviation / (count as f64).sqrt();
    for (edge, side) in [(&x.error.low, -1.0), (&x.error.high, 1.0)] {
        let expected = side * 1.644_854 * deviation;
        assert!(
            (edge[last] - expected).abs() < error,
            "{} {expected}",
            edge[last]
        );
    }
    assert!(x.error.mean[last].abs() < 4.0 * deviation / (count as f64).sqrt());
    // the truth does not scatter at all
    assert!(x.truth.high[last] - x.truth.low[last] < 1e-12);
}

/// x(t) = x₀ exp(−p t) with the start and the parameter that were drawn.
#[test]
fn starts_and_parameters_are_drawn_by_name() {
    let folder = folder();
    let study = study(&folder, "", "spread = { x = 0.3, p = 0.05 }");
    let settings = study.simulate.as_ref().unwrap();
    assert_eq!(settings.spread.len(), 2);
    for seed in 5..9 {
        let start = 1.0 + 0.3 * deviate(seed, "x");
        let rate = 0.5 + 0.05 * deviate(seed, "p");
        let outcome = alone(&study, seed);
        let truth = outcome.quantities[0].truth.as_ref().unwrap();
        for (t, x) in outcome.time.iter().zip(truth) {
            let expected = start * (-rate * t).exp();
            assert!((x - expected).abs() < 1e-7, "{seed} {t}: {x} {expected}");
        }
        // the observer starts at the model's start
        assert_eq!(
            outcome.quantities[0].estimate.as_ref().unwrap().first(),
            Some(1.0)
        );
    }
}

#[test]
fn an_unknown_name_a_negative_deviation_and_too_many_runs_are_refused() {
    let folder = folder();
    let wrong = study(&folder, "", "spread = { xx = 0.3 }");
    let text = runs(&wrong, 2).unwrap_err().to_string();
    assert!(
        text.contains("no state and no parameter named \"xx\""),
        "{text}"
    );
    assert!(
        text.contains("did you mean \"x\"?") && text.contains(":12:"),
        "{text}"
    );
    let one = study(&folder, "", "");
    assert!(runs(&one, 0).is_err());
    let told = |study: &Study| runs(study, 2).unwrap().notes.join("\n");
    assert!(told(&one).contains("nothing differs from run to run"));
    let spread = self::study(&folder, "", "spread = { x = 0.1 }");
    assert!(!told(&spread).contains("nothing differs"));
    let limited = Study {
        budget: lynkeus_expr::Budget::new(
            None,
            Some(lynkeus_expr::Memory {
                limit: 1 << 20,
                used: || 0,
                before: 0,
            }),
        ),
        ..one
    };
    // 41 rows of 16 bytes in each
    assert!(runs(&limited, 3).is_ok());
    let text = runs(&limited, 1599).unwrap_err().to_string();
    assert!(
        text.contains("output_step") && text.contains("1599 runs × 41 rows × 1 quantities"),
        "{text}"
    );
    let text = "[simulate]\nuntil = 1\nspread = { x = -1 }";
    let text = Study::parse(text, "s.toml").unwrap_err().to_string();
    assert!(
        text.contains("a standard deviation, a number >= 0"),
        "{text}"
    );
}

/// x' = −p x³ with p < 0 ends at the time 1/(2 |p| x₀²): p ~ N(0.5, 1) is below −1/8, for which that
/// is before the end of the run, in a good quarter of the runs.
#[test]
fn runs_that_do_not_reach_their_end_are_counted() {
    let folder = folder();
    let study = study(&folder, "", "spread = { p = 1 }");
    std::fs::write(
        folder.path().join("decay.mo"),
        PLANT.replace("-p*x", "-p*x^3"),
    )
    .unwrap();
    let found = runs(&study, 12).unwrap();
    let failed: Vec<u64> = found.failures.iter().map(|f| f.seed).collect();
    let escaping = (5..17).filter(|seed| 0.5 + deviate(*seed, "p") < -0.125);
    let escaping: Vec<u64> = escaping.collect();
    assert!(!escaping.is_empty(), "the seeds show nothing");
    assert_eq!(failed, escaping);
    assert_eq!(failed.len() + found.seeds.len(), 12);
    let refusal = found.refusal().unwrap().to_string();
    assert!(
        refusal.contains(&format!("seed {}", failed[0])),
        "{refusal}"
    );
    assert!(found.to_string().contains("not in these figures"));
    assert_eq!(found.entries()["failed"]["count"], failed.len());
}

/// y = x, x' = k·v: the observer, which has k = 1, settles at k times the true v = 1. Beyond 1.2, a tenth of
/// the range [−1, 1] outside of it, that is not credible.
#[test]
fn estimates_that_are_not_credible_are_told() {
    let folder = folder();
    let model = "model Cart parameter Real k = 1; Real x(start = 0, min = -99, max = 99); Real v(start = 1, min = -1, max = 1);
      output Real y = x; equation der(x) = k*v; der(v) = 0; end Cart;";
    std::fs::write(folder.path().join("decay.mo"), model).unwrap();
    let mut study = study(&folder, "", "spread = { k = 0.3 }");
    study.observer.tuning.values.remove("S");
    let speed = lynkeus_observers::Value::Number(20.0);
    study.observer.tuning.values.insert("theta".into(), speed);
    let found = runs(&study, 20).unwrap();
    assert_eq!((found.seeds.len(), found.failures.len()), (20, 0));
    let beyond = (5..25).filter(|seed| 1.0 + 0.3 * deviate(*seed, "k") > 1.2);
    let beyond: Vec<u64> = beyond.collect();
    assert!(!beyond.is_empty(), "the seeds show nothing");
    let told: Vec<u64> = found.doubtful.iter().map(|run| run.seed).collect();
    assert_eq!(told, beyond);
    for seed in 5..25 {
        let is_credible = alone(&study, seed).is_credible();
        assert_eq!(is_credible, !beyond.contains(&seed), "{seed}");
    }
    let refusal = found.refusal().unwrap().to_string();
    let words = format!(
        "{} of 20 runs have estimates that are not credible",
        told.len()
    );
    assert!(refusal.contains(&words), "{refusal}");
    assert!(
        found
            .to_string()
            .contains("in these figures, but not credible: seeds")
    );
    assert_eq!(found.entries()["not_credible"]["count"], told.len());
}

/// The rate of a noisy position, in widths of a range that it is thousands of times too noisy for: with fixed
/// steps all runs go on together, and each is judged as alone.
#[test]
fn runs_that_go_on_together_are_judged_one_by_one() {
    let folder = folder();
    let model = "model Cart Real x(start = 0, min = -99, max = 99); Real v(start = 0, min = -1e-3, max = 1e-3);
      output Real y = x; equation der(x) = v; der(v) = 0; end Cart;";
    std::fs::write(folder.path().join("decay.mo"), model).unwrap();
    let mut study = study(
        &folder,
        "noise = { y = 0.1 }",
        "method = \"rk4\"\nstep = 0.02",
    );
    study.observer.tuning.values.remove("S");
    let found = runs(&study, 30).unwrap();
    let told: Vec<u64> = found.doubtful.iter().map(|run| run.seed).collect();
    let expected: Vec<u64> = (5..35)
        .filter(|seed| !alone(&study, *seed).is_credible())
        .collect();
    assert!(!told.is_empty() && told.len() < 30, "{told:?}");
    assert_eq!(told, expected);
}
