//! Late readings that are put in their place, beside the rows in the order of their times.

use lynkeus_expr::Graph;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Particles, Sensor, SigmaPoints,
};
use lynkeus_run::{Blueprint, Error, Estimator, EstimatorSettings, Late, Level};

/// Numbers from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }
}

/// A pendulum that is pushed by u: its angle and its speed are measured.
fn filter(kind: FilterKind) -> Estimator {
    let g = Graph::new();
    let [time, x, v, u] = ["time", "x", "v", "u"].map(|name| g.symbol(name));
    let sensor = |name: &str, output| Sensor {
        name: name.into(),
        output,
        noise: Level::Absolute(0.1),
        limits: None,
    };
    let plant = NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.2), ("v".into(), v.node(), 0.0)],
        derivatives: vec![v.node(), (u - x.sin() - v * v * v * 0.3).node()],
        inputs: vec![("u".into(), u.node())],
        sensors: vec![sensor("x", x.node()), sensor("v", v.node())],
        process_noise: vec![0.0, 0.02],
        initial_variance: vec![0.1; 2],
        ranges: vec![
            Limits {
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
            };
            2
        ],
        confined: None,
        whens: Default::default(),
    };
    let model = NoisyModel::new(&plant).unwrap();
    let blueprint = Blueprint::filter(
        model,
        FilterSettings::of(kind),
        EstimatorSettings::default(),
    );
    blueprint.estimator().unwrap()
}

fn kinds() -> [FilterKind; 4] {
    let particles = Particles {
        count: 40,
        ..Particles::default()
    };
    [
        FilterKind::Particles(particles),
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        FilterKind::MovingHorizon(5),
    ]
}

type Row = (f64, [f64; 3]);

/// Rows in the order of their times; a reading may be missing, an input but the first, too.
fn rows(random: &mut Random, count: usize) -> Vec<Row> {
    let mut t = 0.0;
    let rows = (0..count).map(|k| {
        t += 0.1 + 0.2 * random.next();
        let mut maybe = |share: f64| match random.next() < share {
            true => random.next() - 0.5,
            false => f64::NAN,
        };
        (
            t,
            [
                maybe(0.6),
                maybe(0.6),
                maybe(if k < 20 { 1.0 } else { 0.7 }),
            ],
        )
    });
    rows.collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

fn same(late: &Late, sorted: &Estimator, what: &str) {
    assert_eq!(late.time(), sorted.time(), "{what}");
    assert_eq!(bits(late.estimate()), bits(sorted.estimate()), "{what}");
    assert_eq!(
        late.deviations().map(bits),
        sorted.deviations().map(bits),
        "{what}"
    );
    assert_eq!(late.health(), sorted.health(), "{what}");
}

/// However rows are shuffled within the time that is waited for, and wherever it is saved and gone on with.
#[test]
fn rows_in_any_order_equal_those_in_order_to_the_bit() {
    for (seed, kind) in (0..30).zip(kinds().into_iter().cycle()) {
        let mut random = Random(seed);
        let in_order = rows(&mut random, 150);
        // each may come up to 2 later than another
        let mut shuffled: Vec<(f64, Row)> = in_order
            .iter()
            .map(|row| (row.0 + 2.0 * random.next(), *row))
            .collect();
        shuffled.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sorted = filter(kind.clone());
        let mut expected = vec![];
        for (t, signals) in &in_order {
            expected.push((*t, sorted.push(*t, signals).unwrap().to_vec()));
        }
        let mut late = Late::new(filter(kind.clone()), &[], 2.0).unwrap();
        let mut told: Vec<(f64, Vec<f64>)> = vec![];
        let saved = random.below(150);
        for (place, (_, (t, signals))) in shuffled.iter().enumerate() {
            late.push(*t, signals).unwrap();
            for revised in late.revised() {
                told.retain(|(t, _)| *t != revised.t);
                told.push((revised.t, revised.estimate.clone()));
            }
            let newest = late.time().unwrap();
            told.retain(|(t, _)| *t != newest);
            told.push((newest, late.estimate().to_vec()));
            if place == saved {
                let mut other = Late::new(filter(kind.clone()), &[], 2.0).unwrap();
                other.restore(&late.snapshot()).unwrap();
                assert_eq!(other.snapshot(), late.snapshot());
                late = other;
            }
        }
        same(&late, &sorted, &format!("{seed} {kind:?}"));
        assert_eq!(late.too_late(), 0);
        assert_eq!(told.len(), 150);
        for (t, estimate) in told {
            let own = expected.iter().find(|row| row.0 == t).unwrap();
            assert_eq!(bits(&own.1), bits(&estimate), "{seed} {kind:?} at {t}");
        }
    }
}

/// Each reading of the second sensor comes three rows after its sample, those of the first half a row.
#[test]
fn delays_of_sensors_are_undone() {
    for (seed, kind) in (0..6).zip(kinds().into_iter().cycle()) {
        let mut random = Random(seed);
        let mut sorted: Vec<Row> = vec![];
        let mut late = Late::new(filter(kind.clone()), &[0.05, 0.3], 0.0).unwrap();
        assert_eq!(late.wait(), 0.3);
        for k in 0..100 {
            let t = 0.1 * f64::from(k);
            let [x, v, u] = [random.next(), random.next(), random.next()];
            let v = if k % 4 == 0 { v } else { f64::NAN };
            late.push(t, &[x, v, u]).unwrap();
            // by rows: the times of the samples are those of rows but for roundings
            sorted.push((t - 0.05, [x, f64::NAN, f64::NAN]));
            sorted.push((t, [f64::NAN, f64::NAN, u]));
            let shift = |t: f64, at: f64| (t - at).abs() < 1e-9;
            if v.is_finite() {
                match sorted.iter_mut().find(|row| shift(row.0, t - 0.3)) {
                    Some(row) => row.1[1] = v,
                    None => sorted.push((t - 0.3, [f64::NAN, v, f64::NAN])),
                }
            }
        }
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let first = sorted.iter().map(|row| row.1[2]).find(|u| u.is_finite());
        sorted[0].1[2] = first.unwrap();
        let mut expected = filter(kind);
        for (t, signals) in &sorted {
            expected.push(*t, signals).unwrap();
        }
        same(&late, &expected, &format!("{seed}"));
    }
}

#[test]
fn a_row_that_cannot_be_used_changes_nothing() {
    let mut random = Random(5);
    for kind in kinds() {
        let mut late = Late::new(filter(kind), &[], 1.0).unwrap();
        for (t, signals) in rows(&mut random, 60) {
            late.push(t, &signals).unwrap();
        }
        let now = late.time().unwrap();
        let before = late.snapshot();
        assert!(late.push(now - 0.5, &[1e300, 1e300, 0.0]).is_err());
        assert!(late.push(f64::NAN, &[0.0; 3]).is_err());
        assert!(late.push(now, &[0.0]).is_err());
        assert!(late.predict(now - 0.1).is_err());
        assert_eq!(late.snapshot(), before);
        assert!(late.revised().is_empty());
        let estimate = late.estimate().to_vec();
        let error = late.push(now - 1.5, &[0.0; 3]).unwrap_err();
        assert!(matches!(error, Error::TooLate { oldest, .. } if oldest == now - 1.0));
        assert_eq!((late.too_late(), late.estimate()), (1, &estimate[..]));
        // what is kept does not grow
        assert!(before.len() < 30_000, "{}", before.len());
        late.push(now - 0.999, &[0.0; 3]).unwrap();
        assert!(!late.revised().is_empty());
        assert!(late.restore(&before[..40]).is_err());
        late.restore(&before).unwrap();
        assert_eq!(late.too_late(), 0);
    }
}

/// A prediction is a row without readings, and stays one when what came before it changes.
#[test]
fn predictions_are_gone_over_again() {
    for kind in kinds() {
        let mut late = Late::new(filter(kind.clone()), &[], 1.0).unwrap();
        let mut sorted = filter(kind);
        late.push(0.0, &[0.1, f64::NAN, 0.5]).unwrap();
        late.predict(0.4).unwrap();
        late.push(0.2, &[0.3, f64::NAN, f64::NAN]).unwrap();
        late.push(0.6, &[f64::NAN, 0.1, 0.2]).unwrap();
        late.push(0.6, &[0.0, f64::NAN, f64::NAN]).unwrap();
        sorted.push(0.0, &[0.1, f64::NAN, 0.5]).unwrap();
        sorted.push(0.2, &[0.3, f64::NAN, f64::NAN]).unwrap();
        sorted.predict(0.4).unwrap();
        sorted.push(0.6, &[0.0, 0.1, 0.2]).unwrap();
        same(&late, &sorted, "predicted");
    }
}

#[test]
fn what_is_no_delay_is_refused() {
    let new = |delays: &[f64], wait| Late::new(filter(FilterKind::Extended), delays, wait).err();
    assert!(new(&[0.0, 1.0], 0.0).is_none());
    for (delays, wait) in [
        (&[1.0][..], 0.0),
        (&[0.0, -1.0], 0.0),
        (&[0.0, f64::NAN], 0.0),
        (&[], -1.0),
        (&[], f64::NAN),
    ] {
        assert!(
            matches!(new(delays, wait), Some(Error::Setting { .. })),
            "{delays:?} {wait}"
        );
    }
    let mut begun = filter(FilterKind::Extended);
    begun.push(0.0, &[0.0; 3]).unwrap();
    assert!(Late::new(begun, &[], 1.0).is_err());
}

/// Another filter goes on where one stands: with the same numbers it gives the same, whatever comes late.
#[test]
fn what_is_taken_over_goes_on_as_before() {
    for (seed, kind) in (300..).zip(kinds()) {
        for (before, wait) in [(2.0, 2.0), (0.0, 0.0), (2.0, 0.0), (0.0, 2.0)] {
            let mut random = Random(seed);
            let rows = rows(&mut random, 60);
            let (early, late) = rows.split_at(30);
            let mut old = Late::new(filter(kind.clone()), &[], before).unwrap();
            for (t, signals) in early {
                old.push(*t, signals).unwrap();
            }
            let handover = old.handover();
            assert_eq!(handover.rows.is_empty(), before == 0.0);
            let mut new = Late::new(filter(kind.clone()), &[], wait).unwrap();
            new.take_over(&handover).unwrap();
            let what = format!("{kind:?}, {before}, {wait}");
            let agree = |new: &Late, old: &[f64]| {
                // a window begins anew with what is believed, and particles with other random numbers
                let most = match kind {
                    FilterKind::MovingHorizon(_) => 1e-3,
                    FilterKind::Particles(_) => 0.1,
                    _ => 1e-9,
                };
                let pairs = new.estimate().iter().zip(old);
                let off = pairs.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                assert!(off < most, "{what}: {off}");
            };
            agree(&new, old.estimate());
            assert_eq!(new.time(), old.time());
            if wait > 0.0 && before > 0.0 {
                // between two rows from before
                let t = (early[28].0 + early[29].0) / 2.0;
                for filter in [&mut old, &mut new] {
                    filter.push(t, &[0.1, 0.2, f64::NAN]).unwrap();
                }
                agree(&new, old.estimate());
            } else if wait > 0.0 {
                // from before what was taken over there is nothing to go back to
                let error = new.push(early[28].0, &[0.1, 0.2, 0.0]).unwrap_err();
                assert!(matches!(error, Error::TooLate { .. }), "{error}");
            }
            for (t, signals) in late {
                old.push(*t, signals).unwrap();
                new.push(*t, signals).unwrap();
            }
            agree(&new, old.estimate());
            assert!(new.take_over(&handover).is_err(), "it has begun");
        }
    }
}

/// One that has nothing but what was read goes over it from the start.
#[test]
fn a_young_one_is_gone_over_from_its_start() {
    let mut random = Random(9);
    let rows = rows(&mut random, 8);
    let mut old = Late::new(filter(FilterKind::Extended), &[], 100.0).unwrap();
    for (t, signals) in &rows {
        old.push(*t, signals).unwrap();
    }
    let mut new = Late::new(filter(FilterKind::Extended), &[], 100.0).unwrap();
    let handover = old.handover();
    assert_eq!(handover.standing, None);
    new.take_over(&handover).unwrap();
    same(&new, &old, "from the start");
}

#[test]
fn other_kinds_of_filters_take_over_what_they_can() {
    let mut random = Random(10);
    let rows = rows(&mut random, 20);
    let begun = |kind: FilterKind| {
        let mut filter = filter(kind);
        for (t, signals) in &rows {
            filter.push(*t, signals).unwrap();
        }
        filter.standing().unwrap()
    };
    let [particles, extended, unscented, horizon] = kinds();
    let standing = begun(extended.clone());
    for kind in [unscented, horizon, extended.clone()] {
        let mut other = filter(kind);
        other.resume(&standing).unwrap();
        assert_eq!(
            bits(other.estimate()),
            bits(&standing.states.iter().map(|s| s.1).collect::<Vec<_>>())
        );
    }
    for (kind, standing) in [(particles.clone(), standing), (extended, begun(particles))] {
        let mut other = filter(kind);
        let error = other.resume(&standing).unwrap_err();
        assert!(error.to_string().contains("particles"), "{error}");
        assert_eq!(other.time(), None);
    }
}
