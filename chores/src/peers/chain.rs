//! Ours among the filters: extended Kalman filters of a chain of cells (`ekf.c`), one step of Runge and Kutta
//! between samples, within one process.

use lynkeus::expr::Graph;
use lynkeus::run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Row, Sensor,
};
use lynkeus::run::{
    Blueprint, Error, Estimator, EstimatorSettings, Fleet as Together, Level, Method, Step,
};
use serde_json::{Map, Value, json};

use super::clock::Clock;

const CELLS: [usize; 3] = [4, 8, 25];
const STEP: f64 = 0.1;
const INPUT: f64 = 0.7;
/// Rows before the figures: P has filled, and there is machine code.
const ROWS: usize = 10_000;
/// Windows of at least so many seconds are timed, of which the least counts: processor time is counted in steps of
/// some milliseconds.
const WINDOWS: usize = 5;
const WINDOW_SECONDS: f64 = 0.2;
const FLEET: usize = 1_000;
/// Rows of a window that all filters go through.
const FLEET_ROWS: usize = 50;
/// So long at least the windows after the first are timed together, in seconds: processor time is counted in steps of
/// some milliseconds.
const FLEET_SECONDS: f64 = 0.5;
/// Between the readings of two filters of the fleet.
const PHASE: f64 = 0.01;

type Fault = Box<dyn std::error::Error>;

/// Seconds of a sample, alone and in a fleet, and where the filters end.
pub(super) fn filters() -> Result<Value, Fault> {
    let mut found = Map::new();
    for n in CELLS {
        let blueprint = filter(n)?;
        let start = blueprint.estimator()?;
        let mut alone = start.clone();
        run(&mut alone, &readings(ROWS, 0.0), 0)?;
        found.insert(format!("by transition {n}"), json!(end(&alone)));
        // what the clones that follow have is at its start again, and has its code
        let mut ready = alone.clone();
        found.insert(format!("sample {n}"), json!(sample(&mut alone)?));
        ready.restore(&start.snapshot())?;
        let fleet = measure_fleet(vec![ready; FLEET], one_by_one)?;
        found.insert(format!("fleet {n}"), json!(fleet.later));
        found.insert(format!("fleet at first {n}"), json!(fleet.first));
        found.insert(format!("by transition, fleet {n}"), json!(fleet.ends));
        let together = measure_together(&blueprint)?;
        if together.ends != fleet.ends {
            let ends = (together.ends, fleet.ends);
            return Err(format!("side by side is not one by one: {ends:?}").into());
        }
        found.insert(format!("fleet in lanes {n}"), json!(together.later));
    }
    Ok(Value::Object(found))
}

/// x_i' = φ(x_{i−1}) − φ(x_i), φ(x) = 2.5 x/(1 + 1.5 x), fed by a signal.
fn filter(n: usize) -> Result<Blueprint, Error> {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x[{i}]"))).collect();
    let flow: Vec<_> = x.iter().map(|&x| x * 2.5 / (1.0 + x * 1.5)).collect();
    let dx = (0..n).map(|i| (if i == 0 { u } else { flow[i - 1] } - flow[i]).node());
    let states = x.iter().map(|x| (format!("{x:?}"), x.node(), 0.5));
    let range = Limits {
        low: 0.0,
        high: 10.0,
    };
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: states.collect(),
        derivatives: dx.collect(),
        inputs: vec![("u".to_owned(), u.node())],
        sensors: vec![Sensor {
            name: "y".to_owned(),
            output: x[n - 1].node(),
            noise: Level::Absolute(0.02),
            limits: None,
        }],
        process_noise: vec![1e-6; n],
        initial_variance: vec![1e-4; n],
        ranges: vec![range; n],
        confined: None,
        whens: Default::default(),
    })?;
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(1)),
        ..EstimatorSettings::default()
    };
    let settings = FilterSettings::of(FilterKind::Extended);
    Ok(Blueprint::filter(model, settings, run))
}

fn readings(rows: usize, phase: f64) -> Vec<f64> {
    let reading = |k| 0.5 + 0.1 * (STEP * k as f64 + phase).sin();
    (0..rows).map(reading).collect()
}

/// The filter over rows, the first of which has that number.
fn run(filter: &mut Estimator, readings: &[f64], first: usize) -> Result<(), Error> {
    for (k, y) in readings.iter().enumerate() {
        filter.push(STEP * (first + k) as f64, &[*y, INPUT])?;
    }
    Ok(())
}

/// x̂, then its deviations.
fn end(filter: &Estimator) -> Vec<f64> {
    let deviations = filter.deviations().unwrap_or_default();
    [filter.estimate(), deviations].concat()
}

/// Seconds of a sample of a filter that has come so far.
fn sample(filter: &mut Estimator) -> Result<f64, Error> {
    let mut least = f64::INFINITY;
    let mut first = ROWS;
    for _ in 0..WINDOWS {
        let (begun, clock) = (first, Clock::start());
        while clock.seconds() < WINDOW_SECONDS {
            run(filter, &readings(ROWS, STEP * first as f64), first)?;
            first += ROWS;
        }
        least = least.min(clock.seconds() / (first - begun) as f64);
    }
    Ok(least)
}

/// Seconds of a sample of one of many filters, and where the first and the last are after the first window.
struct Fleet {
    /// in the first window, in which each looks at its step once, and in a later one
    first: f64,
    later: f64,
    ends: Vec<f64>,
}

/// Filters at their start, with readings of their own, by something that takes all of them over the rows of a window,
/// the first of which has that number.
fn measure_fleet<F: Ends>(
    mut filters: Vec<F>,
    advance: impl Fn(&mut [F], &[Vec<f64>], usize) -> Result<(), Error>,
) -> Result<Fleet, Error> {
    let mut fleet = Fleet {
        first: 0.0,
        later: 0.0,
        ends: vec![],
    };
    let mut seconds = 0.0;
    for window in 0.. {
        let first = window * FLEET_ROWS;
        let phases = (0..FLEET).map(|m| STEP * first as f64 + PHASE * m as f64);
        let readings: Vec<Vec<f64>> = phases.map(|phase| readings(FLEET_ROWS, phase)).collect();
        let clock = Clock::start();
        advance(&mut filters, &readings, first)?;
        if window == 0 {
            fleet.first = clock.seconds() / (FLEET * FLEET_ROWS) as f64;
            let [first, last] = [filters.first(), filters.last()];
            let ends = [first.map(Ends::first), last.map(Ends::last)];
            fleet.ends = ends.into_iter().flatten().flatten().collect();
            continue;
        }
        seconds += clock.seconds();
        if seconds > FLEET_SECONDS {
            fleet.later = seconds / (window * FLEET * FLEET_ROWS) as f64;
            break;
        }
    }
    Ok(fleet)
}

/// Where the first and the last of one or some filters are.
trait Ends {
    fn first(&self) -> Vec<f64>;
    fn last(&self) -> Vec<f64>;
}

impl Ends for Estimator {
    fn first(&self) -> Vec<f64> {
        end(self)
    }

    fn last(&self) -> Vec<f64> {
        end(self)
    }
}

impl Ends for Together {
    fn first(&self) -> Vec<f64> {
        self.estimate(0).chain(self.deviations(0)).collect()
    }

    fn last(&self) -> Vec<f64> {
        let last = self.len() - 1;
        self.estimate(last).chain(self.deviations(last)).collect()
    }
}

/// The same filters side by side, as many as there are lanes.
fn measure_together(filter: &Blueprint) -> Result<Fleet, Fault> {
    let of = |count: usize| Together::new(&vec![filter.clone(); count]);
    let width = Together::width();
    let mut all = vec![of(width)?; FLEET / width];
    if !FLEET.is_multiple_of(width) {
        all.push(of(FLEET % width)?);
    }
    Ok(measure_fleet(all, in_lanes)?)
}

fn in_lanes(fleets: &mut [Together], readings: &[Vec<f64>], first: usize) -> Result<(), Error> {
    let width = Together::width();
    for (fleet, readings) in fleets.iter_mut().zip(readings.chunks(width)) {
        let mut rows = vec![None; readings.len()];
        for k in 0..FLEET_ROWS {
            for (row, readings) in rows.iter_mut().zip(readings) {
                *row = Some(Row {
                    t: STEP * (first + k) as f64,
                    readings: &readings[k..=k],
                    inputs: &[INPUT],
                });
            }
            if let Some((_, error)) = fleet.push(&rows).into_iter().next() {
                return Err(error);
            }
        }
    }
    Ok(())
}

fn one_by_one(filters: &mut [Estimator], readings: &[Vec<f64>], first: usize) -> Result<(), Error> {
    let mut all = filters.iter_mut().zip(readings);
    all.try_for_each(|(filter, readings)| run(filter, readings, first))
}
