//! Filters against formulas by hand.

use super::*;
use crate::{Blueprint, Estimator, Level, Method, Tolerances};
use lynkeus_expr::Graph;

/// x' = a x + w, y = x + v.
pub(super) fn scalar(a: f64, q: f64, r: f64) -> NoisyModel {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 1.0)],
        derivatives: vec![(x * a).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x.node(),
            noise: Level::Absolute(r.sqrt()),
            limits: None,
        }],
        process_noise: vec![q],
        initial_variance: vec![0.5],
        ranges: vec![Limits {
            low: -1e301,
            high: 1e301,
        }],
        confined: None,
        whens: Default::default(),
    })
    .unwrap()
}

pub(super) fn exact() -> EstimatorSettings {
    EstimatorSettings {
        method: Method::Adaptive(Tolerances {
            relative: 1e-12,
            absolute: 1e-14,
            ..Tolerances::default()
        }),
        ..EstimatorSettings::default()
    }
}

/// P⁻ = e^{2aΔ}P + q (e^{2aΔ} − 1)/(2a).
#[test]
fn the_variance_of_a_scalar_follows_its_formula() {
    let (a, q, r, step) = (-0.7, 0.3, 0.2, 0.4);
    for kind in [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
    ] {
        let mut filter =
            Blueprint::filter(scalar(a, q, r), FilterSettings::of(kind.clone()), exact())
                .estimator()
                .unwrap();
        let (mut x, mut p) = (1.0, 0.5);
        for k in 0..20 {
            let y = (k as f64).sin();
            if k > 0 {
                let grown = (2.0 * a * step).exp();
                x *= (a * step).exp();
                p = grown * p + q * (grown - 1.0) / (2.0 * a);
            }
            let gain = p / (p + r);
            x += gain * (y - x);
            p *= 1.0 - gain;
            filter.push(step * f64::from(k), &[y]).unwrap();
            assert!((filter.estimate()[0] - x).abs() < 1e-10, "{kind:?} {k}");
            assert!(
                (filter.deviations().unwrap()[0] - p.sqrt()).abs() < 1e-10,
                "{kind:?} {k}"
            );
        }
    }
}

/// S = P⁻ + R, K = P⁻/S, P⁺ = (1 − K)P⁻, −½(ln 2πS + ν²/S).
#[test]
fn a_record_has_what_the_correction_is_made_of() {
    let (p, r) = (0.5, 0.2);
    let settings = FilterSettings::of(FilterKind::Extended);
    let blueprint = Blueprint::filter(scalar(-0.7, 0.3, r), settings, exact());
    let mut filter = blueprint.estimator().unwrap();
    assert!(filter.record().is_none());
    filter.keep_record();
    filter.push(0.0, &[1.4]).unwrap();
    let record = filter.record().unwrap();
    let (s, off) = (p + r, 0.4);
    let near =
        |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    near(record.predicted[0], 1.0);
    near(record.innovation[0], off);
    near(record.innovation_covariance[0], s);
    near(record.gain[0], p / s);
    near(record.covariance[0], p - p * p / s);
    let whole = (std::f64::consts::TAU * s).ln();
    near(record.log_likelihood, -0.5 * (whole + off * off / s));
    filter.push(0.1, &[f64::NAN]).unwrap();
    let record = filter.record().unwrap();
    assert!(record.innovation[0].is_nan() && record.innovation_covariance[0].is_nan());
    assert_eq!((record.gain[0], record.log_likelihood), (0.0, 0.0));
    // it belongs to no sample that was refused
    assert!(filter.push(0.2, &[1e300]).is_err());
    assert!(filter.record().unwrap().log_likelihood == 0.0);
    assert!(filter.record().unwrap().covariance[0].is_nan());
}

/// Given everything, a constant's estimate is the same at every sample.
#[test]
fn the_smoother_of_a_constant_is_its_last_estimate() {
    let settings = FilterSettings {
        keep_history: true,
        ..FilterSettings::of(FilterKind::Extended)
    };
    let mut filter = Blueprint::filter(scalar(0.0, 0.0, 0.2), settings, exact())
        .estimator()
        .unwrap();
    for k in 0..10 {
        filter.push(f64::from(k), &[f64::from(k % 3)]).unwrap();
    }
    let (last, deviation) = (filter.estimate()[0], filter.deviations().unwrap()[0]);
    for smoothed in filter.smoothed(None, true).unwrap() {
        assert!((smoothed.estimate[0] - last).abs() < 1e-12);
        assert!((smoothed.deviations[0] - deviation).abs() < 1e-12);
    }
    let lagged = filter.smoothed(Some(3), false).unwrap();
    assert!((lagged[6].estimate[0] - last).abs() < 1e-12);
    assert!((lagged[0].estimate[0] - last).abs() > 1e-3);
    let all = filter.smoothed(Some(usize::MAX), false).unwrap();
    assert!((all[0].estimate[0] - last).abs() < 1e-12);
}

#[test]
fn a_gate_keeps_outliers_out_and_gives_way_in_the_end() {
    for patience in [1, 3, PATIENCE] {
        gives_way_after(patience);
    }
}

fn gives_way_after(patience: usize) {
    let settings = FilterSettings {
        gate: Some(4.0),
        patience,
        ..FilterSettings::of(FilterKind::Extended)
    };
    let mut filter = Blueprint::filter(scalar(0.0, 0.0, 0.01), settings, exact())
        .estimator()
        .unwrap();
    for k in 0..5 {
        filter.push(f64::from(k), &[1.0]).unwrap();
    }
    let mut hanging = filter.clone();
    for k in 0..patience {
        filter
            .push(5.0 + k as f64, &[9.0 + 0.01 * k as f64])
            .unwrap();
        assert_eq!(filter.innovations()[0].reading, Reading::Rejected);
    }
    assert!((filter.estimate()[0] - 1.0).abs() < 1e-12);
    filter.push(15.0, &[9.0]).unwrap();
    assert!(filter.estimate()[0] > 1.5);
    let health = filter.health().sensors[0];
    let counted = (health.taken, health.rejected, health.missing);
    assert_eq!(counted, (6, patience, 0));
    // a sensor that shows the same number for ever has not seen a new level; one step may be one
    if patience < 3 {
        return;
    }
    for k in 5..60 {
        hanging.push(f64::from(k), &[9.0]).unwrap();
    }
    assert_eq!(hanging.health().sensors[0].rejected, 55);
}

/// y = x² about 0, P = 2, with weights 5 of the points ±√0.2 and −9 of the centre: P_yy = 2·5·1.8² − 9·2² = −3.6.
#[test]
fn a_reading_that_sigma_points_cannot_weigh_is_not_taken() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.0)],
        derivatives: vec![g.constant(0.0).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: (x * x).node(),
            noise: Level::Absolute(0.1),
            limits: None,
        }],
        process_noise: vec![0.0],
        initial_variance: vec![2.0],
        ranges: vec![],
        confined: None,
        whens: Default::default(),
    });
    let points = SigmaPoints {
        kappa: -0.9,
        ..SigmaPoints::default()
    };
    let settings = FilterSettings::of(FilterKind::Unscented(points));
    let mut filter = Blueprint::filter(model.unwrap(), settings, exact())
        .estimator()
        .unwrap();
    filter.push(0.0, &[1.0]).unwrap();
    let health = filter.health().sensors[0];
    assert_eq!((health.taken, health.rejected), (0, 1));
    assert_eq!(filter.innovations()[0].deviation, 0.0);
}

#[test]
fn what_cannot_be_is_refused() {
    let model = scalar(0.0, 1.0, 1.0);
    let new = |settings| Blueprint::filter(model.clone(), settings, exact()).estimator();
    let gate = FilterSettings {
        gate: Some(-1.0),
        ..FilterSettings::of(FilterKind::Extended)
    };
    assert!(new(gate).unwrap_err().to_string().contains("gate"));
    let points = SigmaPoints {
        kappa: -1.0,
        ..SigmaPoints::default()
    };
    let unscented = FilterSettings::of(FilterKind::Unscented(points));
    assert!(new(unscented).unwrap_err().to_string().contains("kappa"));
    let g = Graph::new();
    let nothing = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: g.symbol("time").node(),
        states: vec![],
        derivatives: vec![],
        inputs: vec![],
        sensors: vec![],
        process_noise: vec![],
        initial_variance: vec![],
        ranges: vec![],
        confined: None,
        whens: Default::default(),
    });
    assert!(nothing.unwrap_err().to_string().contains("states"));
    let mut filter = new(FilterSettings::of(FilterKind::Extended)).unwrap();
    filter.push(1.0, &[0.0]).unwrap();
    assert!(matches!(
        filter.push(0.5, &[0.0]),
        Err(Error::TimeBefore {
            reached: 1.0,
            time: 0.5
        })
    ));
    assert!(matches!(
        filter.push(f64::NAN, &[0.0]),
        Err(Error::NoNumber { .. })
    ));
    assert!(matches!(filter.push(2.0, &[]), Err(Error::Setting { .. })));
    assert!(matches!(
        filter.push(2.0, &[0.0, 1.0]),
        Err(Error::Setting { .. })
    ));
}

/// x' = −√x, read below zero: where the plant has no value the filter goes on inside the range.
#[test]
fn an_estimate_without_a_value_of_the_plant_is_put_back() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    let plant = |confined: Option<Vec<_>>| NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 1.0)],
        derivatives: vec![(-x.sqrt()).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x.node(),
            noise: Level::Absolute(0.1),
            limits: None,
        }],
        process_noise: vec![0.01],
        initial_variance: vec![1.0],
        ranges: vec![Limits {
            low: 0.01,
            high: 2.0,
        }],
        confined,
        whens: Default::default(),
    };
    let inside = vec![(-x.max(g.constant(0.01)).sqrt()).node()];
    let run = |confined| {
        let model = NoisyModel::new(&plant(confined)).unwrap();
        let settings = FilterSettings::of(FilterKind::Extended);
        let mut filter = Blueprint::filter(model.clone(), settings, exact())
            .estimator()
            .unwrap();
        let result = (0..20).try_for_each(|k| filter.push(0.1 * f64::from(k), &[-0.5]).map(drop));
        (result, filter.health().confined)
    };
    assert!(matches!(
        run(None).0,
        Err(Error::NotFinite { .. } | Error::StepUnderflow { .. })
    ));
    let (result, confined) = run(Some(inside));
    assert!(result.is_ok() && confined > 5, "{result:?} {confined}");
}

/// A snapshot has what the smoother keeps; ways with stops give the same transitions.
#[test]
fn smoothing_goes_on_after_a_restore_and_over_predictions() {
    for kind in [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        FilterKind::MovingHorizon(4),
    ] {
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let model = scalar(-0.3, 0.2, 0.1);
        let new = || {
            Blueprint::filter(model.clone(), settings.clone(), exact())
                .estimator()
                .unwrap()
        };
        let (mut whole, mut stopped, mut restored) = (new(), new(), new());
        for k in 0..12 {
            let (t, y) = (0.5 * f64::from(k), f64::from(k).sin());
            whole.push(t, &[y]).unwrap();
            if k > 0 {
                stopped.predict(t - 0.3).unwrap();
                stopped.predict(t).unwrap();
                stopped.update(&[y]).unwrap();
            } else {
                stopped.push(t, &[y]).unwrap();
            }
            if k == 6 {
                restored.restore(&whole.snapshot()).unwrap();
            } else if k > 6 {
                restored.push(t, &[y]).unwrap();
            }
        }
        let smoothed = |estimator: &Estimator| estimator.smoothed(None, true).unwrap();
        assert_eq!(smoothed(&restored), smoothed(&whole));
        for (a, b) in smoothed(&stopped).iter().zip(smoothed(&whole)) {
            assert!((a.estimate[0] - b.estimate[0]).abs() < 1e-9);
            assert!((a.deviations[0] - b.deviations[0]).abs() < 1e-9);
        }
        assert_eq!(smoothed(&stopped).len(), 12);
    }
}

/// An update that fails after its readings have corrected leaves nothing behind for the smoother.
#[test]
fn smoothing_knows_nothing_of_updates_that_failed() {
    for kind in [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        FilterKind::MovingHorizon(3),
    ] {
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let new = || {
            Blueprint::filter(scalar(-0.3, 0.2, 0.1), settings.clone(), exact())
                .estimator()
                .unwrap()
        };
        let (mut whole, mut troubled) = (new(), new());
        for k in 0..8 {
            let (t, y) = (0.5 * f64::from(k), f64::from(k).sin());
            whole.push(t, &[y]).unwrap();
            if k % 3 == 1 {
                let error = troubled.push(t, &[1e300]).unwrap_err();
                assert!(matches!(error, Error::Diverged { .. }), "{error}");
            }
            troubled.push(t, &[y]).unwrap();
        }
        let smoothed = |estimator: &Estimator| estimator.smoothed(None, true).unwrap();
        assert_eq!(smoothed(&troubled), smoothed(&whole));
    }
}
