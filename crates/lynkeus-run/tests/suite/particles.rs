//! Particle filters beside the exact Kalman filter on a linear plant, and beside a filter on a grid where what is known
//! has two humps.

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Particles, Reading, Sensor,
};
use lynkeus_run::{Blueprint, Estimator, EstimatorSettings, Level, Manifold, Method, Step};

/// Numbers in [-1, 1] from a counter, by a hash.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn anywhere(n: usize) -> Vec<Limits> {
    let all = Limits {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    vec![all; n]
}

fn particles(count: usize, seed: u64, looks_ahead: bool) -> FilterKind {
    FilterKind::Particles(Particles {
        count,
        seed,
        looks_ahead,
        ..Particles::default()
    })
}

fn estimator(model: &NoisyModel, kind: FilterKind, run: EstimatorSettings) -> Estimator {
    let filter = Blueprint::filter(model.clone(), FilterSettings::of(kind), run);
    let mut estimator = filter.estimator().unwrap();
    estimator.keep_record();
    estimator
}

/// A pendulum of small swing, pushed by u: its angle is measured, noise acts on its speed.
fn oscillator() -> NoisyModel {
    let g = Graph::new();
    let [time, x, v, u] = ["time", "x", "v", "u"].map(|name| g.symbol(name));
    NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.5), ("v".into(), v.node(), 0.0)],
        derivatives: vec![v.node(), (u - x * 2.0 - v * 0.3).node()],
        inputs: vec![("u".into(), u.node())],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x.node(),
            noise: Level::Absolute(0.2),
            limits: None,
        }],
        process_noise: vec![0.0, 0.3],
        initial_variance: vec![0.3, 0.2],
        ranges: anywhere(2),
        confined: None,
        whens: Default::default(),
    })
    .unwrap()
}

/// Rows (t, y, u) of some swing; every fifth reading is missing.
fn swing(count: usize) -> Vec<(f64, [f64; 2])> {
    let mut random = Random(5);
    let row = |k: usize| {
        let t = 0.25 * k as f64;
        let reading = (1.4 * t).cos() * 0.6 + 0.3 * random.next();
        let y = if k % 5 == 4 { f64::NAN } else { reading };
        (t, [y, (0.7 * t).sin()])
    };
    (0..count).map(row).collect()
}

/// Root mean square of (mean − Kalman's mean)/deviation over rows and states, of the deviations' ratios less 1, and the
/// difference of the likelihoods.
fn beside_kalman(count: usize, seed: u64, looks_ahead: bool) -> [f64; 3] {
    let run = EstimatorSettings::default();
    let model = oscillator();
    let mut own = estimator(&model, particles(count, seed, looks_ahead), run);
    let mut exact = estimator(&model, FilterKind::Extended, run);
    let (mut squares, mut spreads, mut chance, mut terms) = (0.0, 0.0, 0.0, 0.0);
    for (t, signals) in swing(60) {
        own.push(t, &signals).unwrap();
        exact.push(t, &signals).unwrap();
        let means = own.estimate().iter().zip(exact.estimate());
        let deviations = own.deviations().unwrap().iter();
        let pairs = deviations.zip(exact.deviations().unwrap());
        for ((mean, expected), (deviation, sd)) in means.zip(pairs) {
            squares += ((mean - expected) / sd).powi(2);
            spreads += (deviation / sd - 1.0).powi(2);
            terms += 1.0;
        }
        chance += own.record().unwrap().log_likelihood - exact.record().unwrap().log_likelihood;
        let pair = [&own, &exact].map(|e| e.innovations()[0]);
        assert_eq!(pair[0].reading, pair[1].reading);
    }
    let health = own.health();
    let told = health.particles.unwrap();
    assert!(told.resampled > 5 && told.starved == 0, "{told:?}");
    assert!(told.lowest > 0.01 * count as f64);
    let consistency = health.sensors[0].consistency().unwrap();
    let expected = exact.health().sensors[0].consistency().unwrap();
    let off = (consistency / expected - 1.0).abs();
    assert!(
        off < 3.0 / (count as f64).sqrt(),
        "{consistency} {expected}"
    );
    [
        (squares / terms).sqrt(),
        (spreads / terms).sqrt(),
        chance.abs(),
    ]
}

#[test]
fn on_a_linear_plant_the_error_falls_with_the_root_of_the_number() {
    for looks_ahead in [false, true] {
        let mean = |count: usize| {
            let runs = (0..8).map(|seed| beside_kalman(count, seed, looks_ahead));
            runs.fold([0.0; 3], |sum, run| {
                std::array::from_fn(|i| sum[i] + run[i] / 8.0)
            })
        };
        let (few, many) = (mean(250), mean(16_000));
        for (i, (few, many)) in few.iter().zip(many).enumerate() {
            let ratio = few / many;
            // 8 of 64 times as many
            assert!(
                (4.0..16.0).contains(&ratio),
                "{looks_ahead} {i}: {few} {many}"
            );
        }
        assert!(
            many[0] < 0.025 && many[1] < 0.02 && many[2] < 0.15,
            "{many:?}"
        );
    }
}

/// x' = x − x³ + w, of which a function of x is shown.
struct Well {
    output: fn(Expr<'_>) -> Expr<'_>,
    shown: fn(f64) -> f64,
    noise: Level,
    limits: Option<Limits>,
}

const Q: f64 = 0.4;
const FROM: f64 = 0.1;
const VARIANCE: f64 = 0.5;
const INTERVAL: f64 = 0.25;

impl Well {
    fn model(&self) -> NoisyModel {
        let g = Graph::new();
        let [time, x] = ["time", "x"].map(|name| g.symbol(name));
        NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: vec![("x".into(), x.node(), FROM)],
            derivatives: vec![(x - x * x * x).node()],
            inputs: vec![],
            sensors: vec![Sensor {
                name: "y".into(),
                output: (self.output)(x).node(),
                noise: self.noise,
                limits: self.limits,
            }],
            process_noise: vec![Q],
            initial_variance: vec![VARIANCE],
            ranges: anywhere(1),
            confined: None,
            whens: Default::default(),
        })
        .unwrap()
    }

    /// How likely y is at x, without the censoring's tables: by the error function's own series.
    fn chance(&self, y: f64, x: f64) -> f64 {
        let h = (self.shown)(x);
        let above = |end: f64| match self.noise {
            Level::Uniform(a) => ((h + a - end) / (2.0 * a)).clamp(0.0, 1.0),
            noise => 0.5 * erfc((end - h) / noise.variance(h).sqrt() / 2.0_f64.sqrt()),
        };
        match self.limits {
            Some(limits) if y >= limits.high => return above(limits.high),
            Some(limits) if y <= limits.low => return 1.0 - above(limits.low),
            _ => {}
        }
        match self.noise {
            // the share of the cell that it leaves, where h is x
            Level::Uniform(a) => {
                let (low, high) = (h - 0.5 * CELL, h + 0.5 * CELL);
                let inside = (y + a).min(high) - (y - a).max(low);
                inside.max(0.0) / CELL / (2.0 * a)
            }
            // no share of nothing
            noise => normal(y - h, noise.variance(h).max(1e-6)),
        }
    }
}

fn normal(off: f64, variance: f64) -> f64 {
    (-0.5 * off * off / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
}

/// 1 − erf by Simpson's rule.
fn erfc(z: f64) -> f64 {
    let (steps, z) = (400, z.clamp(-6.0, 6.0));
    let h = z / f64::from(steps);
    let f = |k: i32| (-(f64::from(k) * h).powi(2)).exp();
    let inner: f64 = (1..steps)
        .map(|k| f(k) * if k % 2 == 1 { 4.0 } else { 2.0 })
        .sum();
    1.0 - (f(0) + inner + f(steps)) * h / 3.0 * 2.0 / std::f64::consts::PI.sqrt()
}

/// What is known of x on a grid.
struct Grid {
    places: Vec<f64>,
    mass: Vec<f64>,
    kernel: Vec<Vec<f64>>,
}

const CELL: f64 = 0.02;
const SHORT: usize = 25;

impl Grid {
    fn new() -> Self {
        let places: Vec<f64> = (-160..=160).map(|k| f64::from(k) * CELL).collect();
        let step = INTERVAL / SHORT as f64;
        let row = |x: &f64| -> Vec<f64> {
            // a step of Heun's method
            let f = |x: f64| x - x.powi(3);
            let ahead = x + step * f(*x);
            let to = x + 0.5 * step * (f(*x) + f(ahead));
            // what the flow makes of noise in the middle of the step
            let variance = Q * step * (1.0 + step * (1.0 - 3.0 * x * x)).max(0.5);
            places
                .iter()
                .map(|y| normal(y - to, variance) * CELL)
                .collect()
        };
        let mut own = Self {
            mass: places.iter().map(|x| normal(x - FROM, VARIANCE)).collect(),
            kernel: places.iter().map(row).collect(),
            places,
        };
        own.normalise();
        own
    }

    fn normalise(&mut self) -> f64 {
        let sum: f64 = self.mass.iter().sum();
        self.mass.iter_mut().for_each(|m| *m /= sum);
        sum
    }

    fn advance(&mut self) {
        for _ in 0..SHORT {
            let mut next = vec![0.0; self.mass.len()];
            for (mass, row) in self.mass.iter().zip(&self.kernel) {
                next.iter_mut().zip(row).for_each(|(n, k)| *n += mass * k);
            }
            self.mass = next;
            self.normalise();
        }
    }

    /// log p(y)
    fn take(&mut self, chance: impl Fn(f64) -> f64) -> f64 {
        for (mass, x) in self.mass.iter_mut().zip(&self.places) {
            *mass *= chance(*x);
        }
        self.normalise().ln()
    }

    /// How likely x is at most at the middle between two places.
    fn below(&self, place: usize) -> f64 {
        self.mass[..=place].iter().sum()
    }
}

/// The largest difference of the two distributions over all rows, and that of the sums of the likelihoods.
fn beside_grid(well: &Well, readings: &[f64], kind: FilterKind) -> [f64; 2] {
    let mut own = estimator(&well.model(), kind, EstimatorSettings::default());
    let mut grid = Grid::new();
    let (mut largest, mut chance) = (0.0_f64, 0.0);
    for (k, y) in readings.iter().enumerate() {
        if k > 0 {
            grid.advance();
        }
        let expected = match y.is_finite() {
            true => grid.take(|x| well.chance(*y, x)),
            false => 0.0,
        };
        own.push(INTERVAL * k as f64, &[*y]).unwrap();
        chance += own.record().unwrap().log_likelihood - expected;
        let (x, weights) = own.particles().unwrap();
        for place in (0..grid.places.len() - 1).step_by(4) {
            let end = grid.places[place] + 0.5 * CELL;
            let inside = x.iter().zip(weights).filter(|(x, _)| **x <= end);
            let share = inside.map(|(_, w)| w).sum::<f64>();
            largest = largest.max((share - grid.below(place)).abs());
        }
    }
    [largest, chance]
}

fn square(x: Expr<'_>) -> Expr<'_> {
    x * x
}

fn itself(x: Expr<'_>) -> Expr<'_> {
    x
}

/// What the plant may show: it sits in one of two wells, and goes to the other once.
fn well_readings(shown: impl Fn(f64) -> f64, size: f64) -> Vec<f64> {
    let mut random = Random(9);
    let x = |k: usize| if k < 12 { 0.9 } else { -1.05 };
    (0..24)
        .map(|k| match k % 7 {
            6 => f64::NAN,
            _ => shown(x(k)) + size * random.next(),
        })
        .collect()
}

/// y = x² says nothing of the sign: two humps, of which a Kalman filter has none.
#[test]
fn two_humps_are_those_of_a_grid() {
    let well = Well {
        output: square,
        shown: |x| x * x,
        noise: Level::Absolute(0.2),
        limits: None,
    };
    let readings = well_readings(well.shown, 0.2);
    for looks_ahead in [false, true] {
        let [off, chance] = beside_grid(&well, &readings, particles(100_000, 1, looks_ahead));
        // the weight of each hump wanders as the particles are drawn anew, further where much noise is left to weigh
        // after them
        let most = if looks_ahead { 0.05 } else { 0.02 };
        assert!(
            off < most && chance.abs() < 0.1,
            "{looks_ahead} {off} {chance}"
        );
    }
    let [off, _] = beside_grid(&well, &readings, particles(1000, 1, false));
    assert!((0.01..0.25).contains(&off), "{off}");
    // the same readings by a filter that has one hump alone
    let mut extended = estimator(
        &well.model(),
        FilterKind::Extended,
        EstimatorSettings::default(),
    );
    let mut own = estimator(
        &well.model(),
        particles(1000, 1, false),
        EstimatorSettings::default(),
    );
    let mut better = 0.0;
    for (k, y) in readings.iter().enumerate() {
        let t = INTERVAL * k as f64;
        own.push(t, &[*y]).unwrap();
        extended.push(t, &[*y]).unwrap();
        let [one, other] = [&own, &extended].map(|e| e.record().unwrap().log_likelihood);
        better += one - other;
    }
    assert!(better > 3.0, "{better}");
}

/// Noises of every kind, and a sensor that cannot show everything.
#[test]
fn readings_of_every_kind_count_as_they_are_declared() {
    let limits = Limits {
        low: -0.95,
        high: 0.8,
    };
    for (noise, limits) in [
        (Level::Uniform(0.3), None),
        (Level::Relative(0.3), None),
        (Level::Absolute(0.3), Some(limits)),
        (Level::Uniform(0.4), Some(limits)),
    ] {
        let well = Well {
            output: itself,
            shown: |x| x,
            noise,
            limits,
        };
        // slow enough for noises that have an end
        let mut random = Random(4);
        let swing = |k: usize| (0.3 * k as f64).cos();
        let reading = |k: usize| match noise {
            // near 0 a share of the value is narrower than the grid's cells
            Level::Relative(_) => (0.8 + 0.2 * swing(k)) * (1.0 + 0.25 * random.next()),
            _ => 0.9 * swing(k) + 0.25 * random.next(),
        };
        let mut readings: Vec<f64> = (0..24).map(reading).collect();
        readings[7] = f64::NAN;
        if let Some(limits) = limits {
            readings
                .iter_mut()
                .filter(|y| y.is_finite())
                .for_each(|y| *y = limits.shown(*y));
        }
        for looks_ahead in [false, true] {
            let [off, chance] = beside_grid(&well, &readings, particles(100_000, 2, looks_ahead));
            // a density that ends in the middle of the grid's cells is known to a share of one
            assert!(
                off < 0.03 && chance.abs() < 0.2,
                "{noise:?} {limits:?} {looks_ahead}: {off} {chance}"
            );
        }
    }
}

/// A reading that nothing explains moves no particle, is counted, and costs the likelihood.
#[test]
fn what_no_particle_explains_is_told() {
    let well = Well {
        output: itself,
        shown: |x| x,
        noise: Level::Uniform(0.3),
        limits: None,
    };
    let mut own = estimator(
        &well.model(),
        particles(500, 0, false),
        EstimatorSettings::default(),
    );
    own.push(0.0, &[0.4]).unwrap();
    own.predict(0.25).unwrap();
    let before = own.estimate().to_vec();
    own.update(&[40.0]).unwrap();
    assert_eq!(own.estimate(), before);
    assert_eq!(own.record().unwrap().log_likelihood, -708.0);
    let told = own.health().particles.unwrap();
    assert_eq!((told.updates, told.starved), (2, 1));
    assert!(own.particles().unwrap().1.iter().all(|w| w.is_finite()));
}

/// Where noise takes particles out of where the plant has a value they go on inside the declared range; without one
/// they count no more.
#[test]
fn a_particle_without_a_value_counts_no_more() {
    let model = |confined: bool| {
        let g = Graph::new();
        let [time, x] = ["time", "x"].map(|name| g.symbol(name));
        let inside = x.max(g.constant(0.0));
        NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: vec![("x".into(), x.node(), 0.2)],
            derivatives: vec![(-x.sqrt()).node()],
            inputs: vec![],
            sensors: vec![Sensor {
                name: "y".into(),
                output: x.node(),
                noise: Level::Absolute(0.1),
                limits: None,
            }],
            process_noise: vec![0.05],
            initial_variance: vec![0.01],
            ranges: vec![Limits {
                low: 0.0,
                high: 1.0,
            }],
            confined: confined.then(|| vec![(-inside.sqrt()).node()]),
            whens: Default::default(),
        })
        .unwrap()
    };
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(4)),
        ..EstimatorSettings::default()
    };
    let mut kept = estimator(&model(true), particles(2000, 0, false), run);
    let mut lost = estimator(&model(false), particles(2000, 0, false), run);
    for k in 0..20 {
        let t = 0.05 * f64::from(k);
        kept.push(t, &[0.1]).unwrap();
        lost.push(t, &[0.1]).unwrap();
        assert!(kept.estimate()[0].is_finite() && lost.estimate()[0] > 0.0);
    }
    assert!(kept.health().particles.unwrap().put_back > 10);
    assert_eq!(lost.health().particles.unwrap().put_back, 0);
    assert!(kept.particles().unwrap().0.iter().all(|x| x.is_finite()));
}

/// An angle whose start is unknown on the whole circle, shown by a dial: the mean is across the end of the turn.
#[test]
fn angles_are_compared_around_the_circle() {
    let g = Graph::new();
    let [time, a, w] = ["time", "a", "w"].map(|name| g.symbol(name));
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("a".into(), a.node(), 0.0), ("w".into(), w.node(), 0.5)],
        derivatives: vec![w.node(), g.constant(0.0).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: a.node(),
            noise: Level::Absolute(0.1),
            limits: None,
        }],
        process_noise: vec![1e-3, 1e-3],
        initial_variance: vec![4.0, 0.1],
        ranges: anywhere(2),
        confined: None,
        whens: Default::default(),
    });
    let model = model.unwrap().on(Manifold {
        circles: vec![0],
        dials: vec![0],
        ..Manifold::default()
    });
    let run = EstimatorSettings::default();
    let mut own = estimator(&model, particles(20_000, 0, false), run);
    for k in 0..200 {
        let t = 0.1 * f64::from(k);
        let angle = 3.0 + 0.5 * t;
        own.push(t, &[(angle).sin().atan2(angle.cos())]).unwrap();
        if k > 40 {
            let off = (own.estimate()[0] - angle).sin().abs();
            assert!(off < 0.08, "{k}: {off}");
            assert!(own.innovations()[0].value.abs() < 0.2);
            assert!(own.deviations().unwrap()[0] < 0.08);
        }
    }
}

/// Two runs of a seed are one, another seed is another, and the gate keeps readings out as that of every filter.
#[test]
fn a_seed_says_every_digit() {
    let model = oscillator();
    let run = EstimatorSettings::default();
    let go = |seed: u64| {
        let mut own = estimator(&model, particles(700, seed, false), run);
        for (t, signals) in swing(20) {
            own.push(t, &signals).unwrap();
        }
        own.estimate().to_vec()
    };
    assert_eq!(go(3), go(3));
    assert_ne!(go(3), go(4));
    let gated = FilterSettings {
        gate: Some(4.0),
        ..FilterSettings::of(particles(700, 0, false))
    };
    let filter = Blueprint::filter(model.clone(), gated, run);
    let mut own = filter.estimator().unwrap();
    own.push(0.0, &[0.5, 0.0]).unwrap();
    own.push(0.25, &[9.0, 0.0]).unwrap();
    assert_eq!(own.innovations()[0].reading, Reading::Rejected);
}

#[test]
fn what_particles_cannot_do_is_refused() {
    let refused = |model: &NoisyModel, settings: FilterSettings| {
        let filter = Blueprint::filter(model.clone(), settings, EstimatorSettings::default());
        filter.estimator().unwrap_err().to_string()
    };
    let model = oscillator();
    let plain = FilterSettings::of(particles(100, 0, false));
    let told = refused(
        &model,
        FilterSettings {
            keep_history: true,
            ..plain.clone()
        },
    );
    assert!(told.contains("smoother"), "{told}");
    let told = refused(
        &model,
        FilterSettings {
            projects: true,
            ..plain.clone()
        },
    );
    assert!(told.contains("bounds"), "{told}");
    let told = refused(&model, FilterSettings::of(particles(1, 0, false)));
    assert!(told.contains("particles"), "{told}");
    let well = Well {
        output: itself,
        shown: |x| x,
        noise: Level::Absolute(0.0),
        limits: None,
    };
    let told = refused(&well.model(), plain);
    assert!(told.contains("noise of 'y'"), "{told}");
}

/// E. N. Lorenz's model of 40 places on a circle of latitude, all of them measured with deviation 1.
fn lorenz(start: &[f64]) -> NoisyModel {
    let g = Graph::new();
    let x: Vec<Expr<'_>> = (0..PLACES).map(|i| g.symbol(&format!("x{i}"))).collect();
    let at = |i: usize| x[i % PLACES];
    let rate = |i: usize| {
        (at(i + 1) - at(i + PLACES - 2)) * at(i + PLACES - 1) - at(i) + g.constant(FORCING)
    };
    let states = x.iter().zip(start).enumerate();
    NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: g.symbol("time").node(),
        states: states
            .map(|(i, (x, start))| (format!("x{i}"), x.node(), *start))
            .collect(),
        derivatives: (0..PLACES).map(|i| rate(i).node()).collect(),
        inputs: vec![],
        sensors: (x.iter().enumerate())
            .map(|(i, x)| Sensor {
                name: format!("y{i}"),
                output: x.node(),
                noise: Level::Absolute(1.0),
                limits: None,
            })
            .collect(),
        process_noise: vec![0.0; PLACES],
        initial_variance: vec![1.0; PLACES],
        ranges: anywhere(PLACES),
        confined: None,
        whens: Default::default(),
    })
    .unwrap()
}

const PLACES: usize = 40;
const FORCING: f64 = 8.0;
const APART: f64 = 0.05;

/// A step of Runge and Kutta, written down here.
fn weather(x: &[f64]) -> Vec<f64> {
    let rates = |x: &[f64]| -> Vec<f64> {
        let at = |i: usize| x[i % PLACES];
        let rate = |i| (at(i + 1) - at(i + PLACES - 2)) * at(i + PLACES - 1) - at(i) + FORCING;
        (0..PLACES).map(rate).collect()
    };
    let beside =
        |k: &[f64], h: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + h * k).collect() };
    let first = rates(x);
    let second = rates(&beside(&first, 0.5 * APART));
    let third = rates(&beside(&second, 0.5 * APART));
    let fourth = rates(&beside(&third, APART));
    let step = |i: usize| first[i] + 2.0 * (second[i] + third[i]) + fourth[i];
    (0..PLACES).map(|i| x[i] + APART / 6.0 * step(i)).collect()
}

/// The root mean square error of the estimates, on average over so many updates after the first 400, and the mean of the
/// deviations.
fn error_of_weather(count: usize, inflation: f64, updates: usize, seed: u64) -> [f64; 2] {
    let mut normal = crate::coverage::Normal(seed);
    let mut truth: Vec<f64> = (0..PLACES)
        .map(|i| FORCING + 0.01 * (i as f64).sin())
        .collect();
    for _ in 0..1000 {
        truth = weather(&truth);
    }
    let start: Vec<f64> = truth.iter().map(|x| x + normal.next()).collect();
    let kind = FilterKind::Particles(Particles {
        count,
        seed,
        inflation: Some(inflation),
        ..Particles::default()
    });
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(1)),
        ..EstimatorSettings::default()
    };
    let mut filter = estimator(&lorenz(&start), kind, run);
    let (mut errors, mut spreads) = (0.0, 0.0);
    for k in 0..400 + updates {
        let readings: Vec<f64> = truth.iter().map(|x| x + normal.next()).collect();
        let estimate = filter.push(APART * k as f64, &readings).unwrap();
        let squares = estimate.iter().zip(&truth).map(|(e, x)| (e - x).powi(2));
        let error = (squares.sum::<f64>() / PLACES as f64).sqrt();
        let deviations = filter.deviations().unwrap();
        let spread = (deviations.iter().map(|d| d * d).sum::<f64>() / PLACES as f64).sqrt();
        if k >= 400 {
            (errors, spreads) = (errors + error, spreads + spread);
        }
        truth = weather(&truth);
    }
    [errors, spreads].map(|sum| sum / updates as f64)
}

/// 28 members follow 40 chaotic states: DAPPER prints 0.18 for its square-root filters of this size and inflation.
#[test]
fn an_ensemble_follows_the_weather() {
    let [error, spread] = error_of_weather(28, 1.02, 400, 1);
    assert!(
        error < 0.24 && (0.7..1.5).contains(&(spread / error)),
        "{error} {spread}"
    );
}

/// `cargo test -p lynkeus-run --test suite ensemble_of_dapper -- --ignored --nocapture`: the table of docs/particle.md.
#[test]
#[ignore = "minutes"]
fn the_table_of_ensembles_of_dapper() {
    for (count, inflation) in [(24, 1.02), (24, 1.04), (28, 1.02), (40, 1.01), (100, 1.01)] {
        let all = (0..3).map(|seed| error_of_weather(count, inflation, 10_000, seed));
        let all: Vec<[f64; 2]> = all.collect();
        println!("N = {count}, inflation {inflation}: {all:.3?}");
    }
}

/// An ensemble of 2,000 is Kalman's filter up to what so many leave to chance.
#[test]
fn a_large_ensemble_is_kalmans_filter() {
    let run = EstimatorSettings::default();
    let model = oscillator();
    let kind = FilterKind::Particles(Particles {
        count: 2000,
        seed: 3,
        inflation: Some(1.0),
        ..Particles::default()
    });
    let mut own = estimator(&model, kind, run);
    let mut exact = estimator(&model, FilterKind::Extended, run);
    for (t, signals) in swing(60) {
        own.push(t, &signals).unwrap();
        exact.push(t, &signals).unwrap();
        let deviations = own.deviations().unwrap().iter();
        let pairs = deviations.zip(exact.deviations().unwrap());
        let means = own.estimate().iter().zip(exact.estimate());
        for ((mean, expected), (deviation, sd)) in means.zip(pairs) {
            assert!(
                (mean - expected).abs() < 0.12 * sd,
                "{t}: {mean} {expected} {sd}"
            );
            assert!((deviation / sd - 1.0).abs() < 0.08, "{t}: {deviation} {sd}");
        }
        let chance = own.record().unwrap().log_likelihood - exact.record().unwrap().log_likelihood;
        assert!(chance.abs() < 0.2, "{t}: {chance}");
    }
}
