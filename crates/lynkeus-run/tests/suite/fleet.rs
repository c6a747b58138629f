//! Extended filters side by side, beside each of them alone.

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Reading, Row, Sensor, SigmaPoints,
};
use lynkeus_run::{
    Apart, BetweenSamples, Blueprint, Estimator, EstimatorSettings, Fleet, Level, Method, Step,
    Updates,
};

struct Random(u64);

impl Random {
    /// In [−1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn is(&mut self, share: f64) -> bool {
        self.next() < 2.0 * share - 1.0
    }
}

/// What a plant and its filter have.
#[derive(Clone, Copy, Debug, Default)]
struct Kind {
    /// elementary functions, which lanes round in their own way
    functions: bool,
    gate: bool,
    limits: bool,
    share: bool,
    projects: bool,
    /// a plant without a value below zero, and what it is inside its ranges
    confined: bool,
    /// a start that is known exactly, of a state without noise
    certain: bool,
    /// states that drive those before them, and noise on the last alone
    far: bool,
}

/// A plant of random structure with a filter; `step` is how it is integrated.
fn filter(random: &mut Random, kind: Kind, step: Step) -> Blueprint {
    let g = Graph::new();
    let (n, m) = (
        1 + (random.next().abs() * 5.0) as usize,
        1 + usize::from(random.is(0.5)),
    );
    let [time, u] = ["time", "u"].map(|name| g.symbol(name));
    let x: Vec<Expr<'_>> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
    let flow = |x: &[Expr<'_>], seed: u64| -> Vec<_> {
        let mut random = Random(seed);
        (0..n)
            .map(|i| {
                let own = match kind.confined {
                    true => -(x[i].sqrt()) * (0.8 + random.next().abs()),
                    false => x[i] * (-0.5 - random.next().abs()),
                };
                let others = (0..n).filter(|j| *j != i).fold(own, |sum, j| {
                    let read = x[j] * (1.0 + random.next());
                    let curved = match kind.functions {
                        true => read.sin(),
                        false => read / (1.0 + read * read),
                    };
                    let weight = random.next();
                    if random.is(0.4) && !(kind.far && j > i) {
                        sum + curved * weight
                    } else {
                        sum
                    }
                });
                let far = (kind.far && i + 1 < n).then(|| x[i + 1]);
                let others = far.map_or(others, |next| others + next);
                (others + u * random.next()).node()
            })
            .collect()
    };
    let seed = random.0;
    let derivatives = flow(&x, seed);
    let inside: Vec<Expr<'_>> = x.iter().map(|x| x.max(g.constant(0.0))).collect();
    let confined = kind.confined.then(|| flow(&inside, seed));
    let sensors = (0..m).map(|k| {
        let mut seen = x[(k + 1) % n] * (1.0 + 0.3 * random.next());
        if random.is(0.5) {
            seen = seen + x[0] * x[n - 1] * 0.2;
        }
        Sensor {
            name: format!("y{k}"),
            output: (seen + time * 0.0).node(),
            noise: match (kind.share && k == 0, k) {
                (true, _) => Level::Relative(0.1),
                (_, 0) => Level::Absolute(0.05),
                _ => Level::Uniform(0.1),
            },
            limits: kind.limits.then_some(Limits {
                low: 0.1,
                high: 0.9,
            }),
        }
    });
    let sensors = sensors.collect();
    let noise = (0..n).map(|_| {
        if random.is(0.7) {
            random.next().abs()
        } else {
            0.0
        }
    });
    let mut noise: Vec<f64> = noise.collect();
    if kind.far {
        noise[..n - 1].fill(0.0);
        noise[n - 1] = 0.5;
    }
    let mut initial_variance = vec![0.3; n];
    if kind.certain {
        (noise[0], initial_variance[0]) = (0.0, 0.0);
    }
    let range = Limits {
        low: 0.0,
        high: 1.0,
    };
    let states = x.iter().enumerate();
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: states
            .map(|(i, x)| (format!("x{i}"), x.node(), 0.5))
            .collect(),
        derivatives,
        inputs: vec![("u".to_owned(), u.node())],
        sensors,
        process_noise: noise,
        initial_variance,
        ranges: vec![range; n],
        confined,
        whens: Default::default(),
    });
    let settings = FilterSettings {
        gate: kind.gate.then_some(2.0),
        projects: kind.projects,
        ..FilterSettings::of(FilterKind::Extended)
    };
    let run = EstimatorSettings {
        method: Method::Rk4(step),
        ..EstimatorSettings::default()
    };
    Blueprint::filter(model.unwrap(), settings, run)
}

/// The same with numbers of its own.
fn another(random: &mut Random, filter: &Blueprint) -> Blueprint {
    let mut other = filter.clone();
    let Updates::Filter { model, .. } = &mut other.updates else {
        unreachable!("a filter");
    };
    let g = Graph::new();
    let symbol = g.symbol("any").node();
    let mut number = |number: &f64| number * (1.0 + 0.5 * random.next());
    let process_noise = model.process_noise.iter().map(&mut number).collect();
    let initial_variance = model.initial_variance.iter().map(&mut number).collect();
    let sensors = model.sensors.iter().map(|sensor| Sensor {
        noise: match sensor.noise {
            Level::Absolute(size) => Level::Absolute(number(&size)),
            Level::Relative(size) => Level::Relative(number(&size)),
            Level::Uniform(size) => Level::Uniform(number(&size)),
        },
        ..sensor.clone()
    });
    let sensors = sensors.collect();
    let flow = model.flow.system();
    let states = flow.states().iter().zip(flow.start());
    let states = states.map(|(name, x)| (name.clone(), symbol, number(x)));
    **model = model
        .with_numbers(&NoisyPlant {
            graph: &g,
            time: symbol,
            states: states.collect(),
            derivatives: vec![],
            inputs: vec![],
            sensors,
            process_noise,
            initial_variance,
            ranges: model.ranges.clone(),
            confined: None,
            whens: Default::default(),
        })
        .unwrap();
    other
}

/// A row: time, readings, input.
type Entry = (f64, Vec<f64>, f64);

/// A log with gaps, uneven times, and sometimes what is no row.
fn log(random: &mut Random, sensors: usize, rows: usize) -> Vec<Entry> {
    let mut t = random.next();
    let mut log = vec![];
    for k in 0..rows {
        let readings = (0..sensors).map(|_| match random.is(0.8) {
            true => 0.5 + 0.6 * random.next(),
            false => f64::NAN,
        });
        let readings = readings.collect();
        let is_lost = k > 0 && random.is(0.1);
        let u = if is_lost { f64::NAN } else { random.next() };
        log.push((t, readings, u));
        t += match random.next() {
            // at the same time, and before it
            s if s < -0.97 => 0.0,
            s if s < -0.95 => -0.1,
            s if s < 0.0 => 0.1,
            s => 0.1 + 0.3 * s,
        };
    }
    log
}

/// What is found of one filter: its numbers, readings, counts and errors.
fn compare(fleet: &Fleet, place: usize, alone: &Estimator, is_exact: bool, case: &str) {
    let mine: Vec<f64> = fleet
        .estimate(place)
        .chain(fleet.deviations(place))
        .collect();
    let theirs = [alone.estimate(), alone.deviations().unwrap()].concat();
    let is_near = |a: f64, b: f64| match is_exact {
        true => a == b || a.is_nan() && b.is_nan(),
        false => (a - b).abs() <= 1e-9 * (1.0 + b.abs()),
    };
    let all = mine.iter().zip(&theirs);
    assert!(
        all.clone().all(|(a, b)| is_near(*a, *b)),
        "{case}: {mine:?}, {theirs:?}"
    );
    assert_eq!(fleet.time(place), alone.time(), "{case}");
    for (a, b) in fleet.innovations(place).zip(alone.innovations()) {
        assert_eq!(a.reading, b.reading, "{case}");
        let numbers = [
            (a.value, b.value),
            (a.deviation, b.deviation),
            (a.settled, b.settled),
            (a.predicted, b.predicted),
        ];
        assert!(
            numbers.iter().all(|(a, b)| is_near(*a, *b)),
            "{case}: {a:?}, {b:?}"
        );
    }
    match is_exact {
        true => assert_eq!(fleet.health(place), alone.health(), "{case}"),
        false => assert_eq!(
            fleet.health(place).sensors[0].taken,
            alone.health().sensors[0].taken
        ),
    }
}

/// Filters through logs of different lengths, side by side and each alone, every row compared; how many of what happened.
fn run(seed: u64, kind: Kind, step: Step) -> [usize; 5] {
    let mut random = Random(seed);
    let first = filter(&mut random, kind, step);
    let count = 1 + (random.next().abs() * Fleet::width() as f64) as usize;
    let mut filters = vec![first.clone()];
    filters.extend((1..count).map(|_| another(&mut random, &first)));
    let mut fleet = Fleet::new(&filters).unwrap();
    // some plants of the kind have none
    assert!(fleet.is_exact() || kind.functions);
    let is_exact = fleet.is_exact();
    let mut alone: Vec<Estimator> = filters.iter().map(|f| f.estimator().unwrap()).collect();
    let sensors = alone[0].sensors();
    let logs: Vec<Vec<Entry>> = (0..count)
        .map(|_| {
            let rows = 20 + (random.next().abs() * 40.0) as usize;
            log(&mut random, sensors, rows)
        })
        .collect();
    let mut happened = [0; 5];
    for k in 0..60 {
        let inputs: Vec<Option<[f64; 1]>> = logs.iter().map(|log| Some([log.get(k)?.2])).collect();
        let rows: Vec<Option<Row<'_>>> = logs
            .iter()
            .zip(&inputs)
            .map(|(log, inputs)| {
                let (t, readings, _) = log.get(k)?;
                let (t, inputs) = (*t, inputs.as_ref()?);
                Some(Row {
                    t,
                    readings,
                    inputs,
                })
            })
            .collect();
        let mut failed = fleet.push(&rows);
        failed.sort_by_key(|failed| failed.0);
        let mut failed = failed.into_iter().peekable();
        for (place, row) in rows.iter().enumerate() {
            let Some(row) = row else { continue };
            let case = format!("{seed} {kind:?} {step:?}, row {k} of {place}");
            let signals = [row.readings, row.inputs].concat();
            let theirs = alone[place].push(row.t, &signals).map(drop);
            let mine = failed
                .next_if(|failed| failed.0 == place)
                .map(|failed| failed.1);
            match (theirs, mine) {
                (Ok(()), None) => happened[0] += 1,
                (Err(theirs), Some(mine)) if is_exact => {
                    assert_eq!(mine.to_string(), theirs.to_string(), "{case}");
                    happened[1] += 1;
                }
                (Err(_), Some(_)) => {}
                (theirs, mine) => panic!("{case}: {theirs:?}, {mine:?}"),
            }
            compare(&fleet, place, &alone[place], is_exact, &case);
        }
    }
    for place in 0..count {
        let health = fleet.health(place);
        happened[2] += health.sensors.iter().map(|s| s.rejected).sum::<usize>();
        happened[3] += health.confined + health.projected;
        happened[4] += fleet
            .innovations(place)
            .filter(|i| i.reading == Reading::Missing)
            .count();
    }
    happened
}

#[test]
fn each_is_what_it_is_alone() {
    let kinds = [
        Kind::default(),
        Kind {
            functions: true,
            ..Kind::default()
        },
        Kind {
            gate: true,
            ..Kind::default()
        },
        Kind {
            limits: true,
            ..Kind::default()
        },
        Kind {
            share: true,
            ..Kind::default()
        },
        Kind {
            projects: true,
            ..Kind::default()
        },
        Kind {
            confined: true,
            ..Kind::default()
        },
        Kind {
            certain: true,
            ..Kind::default()
        },
        Kind {
            far: true,
            ..Kind::default()
        },
        Kind {
            gate: true,
            limits: true,
            share: true,
            projects: true,
            ..Kind::default()
        },
    ];
    let mut happened = [0; 5];
    for trial in 0..if cfg!(debug_assertions) { 100 } else { 300 } {
        let kind = kinds[trial % kinds.len()];
        let step =
            [Step::Substeps(1), Step::AtMost(0.15), Step::Substeps(3)][trial / kinds.len() % 3];
        let found = run(trial as u64, kind, step);
        happened
            .iter_mut()
            .zip(found)
            .for_each(|(all, own)| *all += own);
    }
    let [rows, errors, rejected, confined, missing] = happened;
    assert!(rows > 5_000 && errors > 50, "{happened:?}");
    assert!(
        rejected > 50 && confined > 50 && missing > 5,
        "{happened:?}"
    );
}

/// Whatever is not done side by side is refused with its reason.
#[test]
fn what_is_not_done_side_by_side_is_refused() {
    let mut random = Random(3);
    let plain = filter(&mut random, Kind::default(), Step::Substeps(1));
    let other = filter(&mut random, Kind::default(), Step::Substeps(1));
    let changed = |change: &dyn Fn(&mut FilterSettings, &mut EstimatorSettings)| {
        let mut filter = plain.clone();
        let run = &mut filter.run;
        if let Updates::Filter { settings, .. } = &mut filter.updates {
            change(settings, run);
        }
        Fleet::new(&[filter]).unwrap_err()
    };
    let unscented = FilterKind::Unscented(SigmaPoints::default());
    assert_eq!(changed(&|s, _| s.kind = unscented.clone()), Apart::Kind);
    assert_eq!(changed(&|s, _| s.keep_history = true), Apart::History);
    assert_eq!(changed(&|s, _| s.foresees = true), Apart::Foreseen);
    assert_eq!(
        changed(&|_, run| run.method = Method::default()),
        Apart::Step
    );
    assert_eq!(
        changed(&|_, run| run.method = Method::Rk4(Step::Auto)),
        Apart::Step
    );
    assert_eq!(
        changed(&|_, run| run.between = BetweenSamples::Linear),
        Apart::Line
    );
    assert!(matches!(
        changed(&|s, _| s.gate = Some(-1.0)),
        Apart::Fault(_)
    ));
    assert_eq!(Fleet::new(&[]).unwrap_err(), Apart::Count(0));
    let many = vec![plain.clone(); Fleet::width() + 1];
    assert_eq!(Fleet::new(&many).unwrap_err(), Apart::Count(many.len()));
    assert_eq!(
        Fleet::new(&[plain.clone(), other]).unwrap_err(),
        Apart::Different
    );
    let mut exact = plain.clone();
    if let Updates::Filter { model, .. } = &mut exact.updates {
        model.sensors[0].noise = Level::Absolute(0.0);
    }
    let found = Fleet::new(&[plain, exact]).unwrap_err();
    assert_eq!(found, Apart::Noiseless("y0".to_owned()));
    assert_eq!(found.to_string(), "sensor y0 has no noise");
}
