//! Readings at an end of what a sensor can show.

use super::*;
use lynkeus_words::figures;

/// The readings at an end in the run of a seed alone, and all of them.
fn at_ends(study: &Study, seed: u64) -> (usize, usize) {
    let readings = &alone(study, seed).measurements[0].1;
    let ends = readings.iter().filter(|y| *y <= 0.2 || *y >= 1.1);
    (ends.count(), readings.len())
}

/// What is to be told of the runs 5 … 16, of each alone.
fn expected(study: &Study, taken: &str) -> String {
    let counts: Vec<(usize, usize)> = (5..17).map(|seed| at_ends(study, seed)).collect();
    let runs = counts.iter().filter(|(count, _)| *count > 0).count();
    let (ends, all) = counts
        .iter()
        .fold((0, 0), |sum, (ends, all)| (sum.0 + ends, sum.1 + all));
    assert!((1..12).contains(&runs), "the seeds show nothing: {runs}");
    let share = figures(100.0 * ends as f64 / all as f64, 2);
    format!(
        "at an end of the sensor's range: y in {runs} of 12 runs, {share} % of all its readings; {taken}"
    )
}

/// x = x₀ exp(−t/2) from x₀ ~ N(1, 0.3²) up to the time 2 meets 0.2 or 1.1 in some runs: alone, together,
/// in portions and by a filter the same is counted, and told once.
#[test]
fn readings_at_an_end_are_told_in_sum() {
    let folder = folder();
    let one_by_one = "spread = { x = 0.3 }";
    let together = "spread = { x = 0.3 }\nmethod = \"rk4\"\nstep = 0.05";
    for (simulate, has_limit) in [(one_by_one, false), (together, false), (together, true)] {
        let sensors = "noise = { y = 0.01 }\nlimits = { y = [0.2, 1.1] }";
        let mut study = super::study(&folder, sensors, simulate);
        study.simulate.as_mut().unwrap().until = 2.0;
        let expected = expected(&study, crate::judge::saturated::TAKEN);
        if has_limit {
            let hour = std::time::Duration::from_secs(3600);
            study.budget = lynkeus_expr::Budget::new(Some(hour), None);
        }
        let found = runs(&study, 12).unwrap();
        let told = found.notes.iter().filter(|n| n.contains("an end of"));
        assert_eq!(told.collect::<Vec<_>>(), [&expected], "{simulate}");
    }
}

#[test]
fn a_filter_takes_them_for_bounds() {
    let folder = folder();
    let sensors = "noise = { y = 0.01 }\nlimits = { y = [0.2, 1.1] }";
    let mut study = super::study(&folder, sensors, "spread = { x = 0.3 }\nsample_step = 0.2");
    study.simulate.as_mut().unwrap().until = 2.0;
    study.observer.tuning.values.clear();
    study.observer.family.as_mut().unwrap().text = "ekf".to_owned();
    let found = runs(&study, 12).unwrap();
    let expected = expected(&study, "this filter takes that for a bound");
    assert!(found.notes.contains(&expected), "{:?}", found.notes);
}

#[test]
fn nothing_is_told_where_no_reading_is_at_an_end() {
    let folder = folder();
    for limits in ["", "limits = { y = [-99, 99] }"] {
        let study = super::study(&folder, limits, "spread = { x = 0.3 }");
        let notes = runs(&study, 3).unwrap().notes;
        assert!(notes.iter().all(|n| !n.contains("an end of")), "{notes:?}");
    }
}
