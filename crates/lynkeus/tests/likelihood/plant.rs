//! Plants of random structure, with studies and logs.

use super::normal::Normal;
use super::number::{Number, Text};

/// What is measured, and how.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// of the state that it shows, and of the one that bends it
    states: [usize; 2],
    bend: usize,
    pub level: Level,
    /// the largest value that it can show
    pub limit: Option<f64>,
    /// it reports in one row of so many
    every: usize,
}

/// The kind of a sensor's noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    Deviation,
    Share,
    Uniform,
}

/// The parts of a derivative.
#[derive(Clone, Debug)]
struct Row {
    decay: usize,
    /// by which state, through which function
    drive: (usize, usize),
    input: f64,
}

/// A plant; θ are its parameters, then the noises, the densities and the starts that are found.
#[derive(Clone, Debug)]
pub struct Plant {
    rows: Vec<Row>,
    pub sensors: Vec<Sensor>,
    /// θ at which the study is
    pub values: Vec<f64>,
    pub parameters: usize,
    /// states with process noise
    pub noisy: Vec<usize>,
    /// whether the start of the first state is found
    pub has_start: bool,
    pub starts: Vec<f64>,
    pub log: Vec<Record>,
}

/// A row of a log.
#[derive(Clone, Debug)]
pub struct Record {
    pub t: f64,
    pub input: f64,
    /// none in gaps
    pub readings: Vec<Option<f64>>,
}

/// The variance of every start that is not found, and the longest step.
pub const VARIANCE: f64 = 0.04;
pub const STEP: f64 = 0.15;

const ROWS: usize = 30;

fn pick(random: &mut Normal, count: usize) -> usize {
    ((random.uniform() * count as f64) as usize).min(count - 1)
}

impl Plant {
    pub fn new(seed: u64) -> Self {
        let random = &mut Normal(seed);
        (0..8).for_each(|_| {
            random.uniform();
        });
        let n = 1 + pick(random, 4);
        let rows = (0..n).map(|_| Row {
            decay: pick(random, 4),
            drive: (pick(random, n), pick(random, 4)),
            input: random.uniform(),
        });
        let rows: Vec<Row> = rows.collect();
        let sensors = (0..1 + pick(random, 3)).map(|k| Sensor {
            states: [pick(random, n), pick(random, n)],
            bend: pick(random, 3),
            level: [Level::Deviation, Level::Share, Level::Uniform][pick(random, 3)],
            limit: None,
            every: if k == 0 { 1 } else { 1 + pick(random, 3) },
        });
        let sensors: Vec<Sensor> = sensors.collect();
        // where it acts on some states alone, what it makes of others in a step may be less than the error of the
        // step, which no positive covariance has: there the engine leaves it out
        let is_noisy = random.uniform() < 0.8;
        let noisy: Vec<usize> = (0..n).filter(|_| is_noisy).collect();
        let has_start = random.uniform() < 0.5;
        let parameters = 2 * n;
        let mut plant = Self {
            starts: (0..n).map(|_| 0.3 + random.uniform()).collect(),
            values: vec![],
            parameters,
            rows,
            sensors,
            noisy,
            has_start,
            log: vec![],
        };
        let mut truth: Vec<f64> = (0..parameters).map(|_| 0.4 + random.uniform()).collect();
        truth.extend(plant.sensors.iter().map(|_| 0.03 + 0.1 * random.uniform()));
        truth.extend(plant.noisy.iter().map(|_| 0.005 + 0.05 * random.uniform()));
        truth.extend(has_start.then_some(plant.starts[0]));
        plant.record(&truth, random);
        let off = truth.iter().map(|v| v * (0.9 + 0.2 * random.uniform()));
        plant.values = off.collect();
        plant
    }

    pub fn states(&self) -> usize {
        self.rows.len()
    }

    /// f
    pub fn derivatives<N: Number>(&self, t: &N, x: &[N], u: &N, p: &[N]) -> Vec<N> {
        let number = N::of;
        let one = |(i, row): (usize, &Row)| {
            let own = x[i].clone();
            let decay = match row.decay {
                0 => own,
                1 => own.clone() * (number(1.0) + number(0.2) * own.clone() * own),
                2 => own.tanh(),
                _ => own.clone() * (number(0.1) * own).exp(),
            };
            let by = x[row.drive.0].clone();
            let drive = match row.drive.1 {
                0 => by.sin(),
                1 => by.clone() / (number(1.0) + by.clone() * by),
                2 => (number(1.0) + by.clone() * by).sqrt() - number(1.0),
                _ => number(0.5) * (by + t.clone()).cos(),
            };
            number(row.input) * u.clone() - p[2 * i].clone() * decay
                + p[2 * i + 1].clone() * number(0.5) * drive
        };
        self.rows.iter().enumerate().map(one).collect()
    }

    /// h
    pub fn output<N: Number>(&self, sensor: usize, x: &[N]) -> N {
        let Sensor { states, bend, .. } = &self.sensors[sensor];
        let [own, other] = states.map(|state| x[state].clone());
        let bent = match bend {
            0 => other.sin(),
            1 => other.clone() * other,
            _ => (N::of(0.3) * other).exp(),
        };
        own + N::of(0.3) * bent + N::of(0.2)
    }

    /// Runs the plant and writes down what its sensors show.
    fn record(&mut self, truth: &[f64], random: &mut Normal) {
        let mut x = self.starts.clone();
        let (mut t, mut u) = (0.0, 0.0);
        let mut shown: Vec<Vec<f64>> = vec![vec![]; self.sensors.len()];
        for k in 0..ROWS {
            if k > 0 {
                let span = 0.02 + 0.35 * random.uniform();
                for i in 0..50 {
                    let at = t + span * f64::from(i) / 50.0;
                    let dx = self.derivatives(&at, &x, &u, truth);
                    for (x, dx) in x.iter_mut().zip(dx) {
                        *x += span / 50.0 * dx;
                    }
                }
                t += span;
            }
            u = random.uniform() - 0.5;
            let readings = self.sensors.iter().enumerate().map(|(i, sensor)| {
                let h = self.output(i, &x);
                let noise = truth[self.parameters + i] * random.next();
                let y = match sensor.level {
                    Level::Share => h * (1.0 + noise),
                    _ => h + noise,
                };
                shown[i].push(y);
                (k % sensor.every == 0 && random.uniform() < 0.7).then_some(y)
            });
            let readings = readings.collect();
            self.log.push(Record {
                t,
                input: u,
                readings,
            });
        }
        for (i, mut shown) in shown.into_iter().enumerate() {
            // what is beyond seven tenths of the readings is at the end of the range
            if random.uniform() < 0.35 {
                shown.sort_by(f64::total_cmp);
                let limit = shown[7 * ROWS / 10];
                self.sensors[i].limit = Some(limit);
                for record in &mut self.log {
                    record.readings[i] = record.readings[i].map(|y| y.min(limit));
                }
            }
        }
    }

    /// The model.
    pub fn modelica(&self) -> String {
        let named = |name: &str, count: usize| -> Vec<Text> {
            (1..=count).map(|i| Text(format!("{name}{i}"))).collect()
        };
        let (p, x) = (named("p", self.parameters), named("x", self.states()));
        let lines = |all: Vec<String>| all.concat();
        let parameters = self.values.iter().zip(&p);
        let states = self.starts.iter().zip(&x);
        let outputs = (0..self.sensors.len())
            .map(|i| format!("output Real y{} = {};\n", i + 1, self.output(i, &x).0));
        let derivatives = self.derivatives(&Text("time".into()), &x, &Text("u".into()), &p);
        format!(
            "model Plant\n{}input Real u;\n{}{}equation\n{}end Plant;\n",
            lines(
                parameters
                    .map(|(v, p)| format!(
                        "parameter Real {}(min = 0.001, max = 50) = {v:?};\n",
                        p.0
                    ))
                    .collect()
            ),
            lines(
                states
                    .map(|(v, x)| format!("Real {}(start = {v:?}, min = -40, max = 40);\n", x.0))
                    .collect()
            ),
            lines(outputs.collect()),
            lines(
                derivatives
                    .iter()
                    .zip(&x)
                    .map(|(dx, x)| format!("der({}) = {};\n", x.0, dx.0))
                    .collect()
            ),
        )
    }

    /// The study; every third parameter is searched as a logarithm.
    pub fn study(&self) -> String {
        let values = &self.values[self.parameters..];
        let (noises, rest) = values.split_at(self.sensors.len());
        let noises = noises.iter().zip(&self.sensors).enumerate();
        let noise = noises.map(|(i, (value, sensor))| match sensor.level {
            Level::Deviation => format!("y{} = {value:?}", i + 1),
            Level::Share => format!("y{} = \"{:?}%\"", i + 1, 100.0 * value),
            Level::Uniform => format!("y{} = {{ uniform = {value:?} }}", i + 1),
        });
        let limits = self.sensors.iter().enumerate();
        let limits = limits
            .filter_map(|(i, sensor)| Some(format!("y{} = [-100, {:?}]", i + 1, sensor.limit?)));
        let densities = self.noisy.iter().zip(rest);
        let densities = densities.map(|(state, q)| format!("x{} = {q:?}", state + 1));
        let list = |all: Vec<String>| all.join(", ");
        let parameters = |every: usize| {
            let all = (1..=self.parameters).step_by(every);
            list(all.map(|i| format!("\"p{i}\"")).collect())
        };
        let start = match self.has_start {
            true => format!("initial = {{ x1 = {:?} }}", self.values.last().unwrap()),
            false => String::new(),
        };
        let found = match self.has_start {
            true => "initial = [\"x1\"]",
            false => "",
        };
        let process_noise = match self.noisy.is_empty() {
            true => "",
            false => "process_noise = true",
        };
        format!(
            "[sensors]\nnoise = {{ {} }}\nlimits = {{ {} }}\n[process_noise]\n{}\n\
             [observer]\nfamily = \"ekf\"\ninitial_variance = {{ default = {VARIANCE} }}\n{start}\n\
             [estimate]\nmethod = \"rk4\"\nstep = {STEP}\n\
             [fit]\nparameters = [{}]\nlog = [{}]\nnoise = true\n{process_noise}\n{found}\n",
            list(noise.collect()),
            list(limits.collect()),
            densities.collect::<Vec<_>>().join("\n"),
            parameters(1),
            parameters(3),
        )
    }

    /// The log as a file has it.
    pub fn csv(&self) -> String {
        let names = (1..=self.sensors.len()).map(|i| format!(",y{i}"));
        let mut text = format!("t,u{}\n", names.collect::<String>());
        for record in &self.log {
            let readings = record.readings.iter();
            let cells = readings.map(|y| y.map_or(",".to_owned(), |y| format!(",{y:?}")));
            text += &format!(
                "{:?},{:?}{}\n",
                record.t,
                record.input,
                cells.collect::<String>()
            );
        }
        text
    }
}
