//! Extended filters of one plant side by side, each with a log of its own.
//!
//! Eight filters, or four, as the processor has it, stand in the lanes of vector registers: a step and a correction are
//! one function each for all of them. Each has its own times, steps, inputs, readings and noises. What is out of
//! the ordinary at a sample of one of them (no value of the plant, a reading that a gate keeps out or that is at an
//! end of its sensor's range, an estimate outside its bounds) is left to a filter of its own, which goes on from where the lane was and
//! gives it back, so that results, counts and errors are those of an [`Estimator`](crate::Estimator).

mod apart;
mod code;
mod side;

use crate::filter::{FilterKind, Health, Innovation, Row};
use crate::{BetweenSamples, Blueprint, Error, Method, Step, Updates};
pub use apart::Apart;
use side::{Asset, Lanes, Side};

/// Up to so many filters of one plant, sample by sample, side by side.
///
/// Each is what an [`Estimator`](crate::Estimator) of its [`Blueprint`] is, to the bit where [`Fleet::is_exact`] says so, else
/// but for the rounding of elementary functions.
///
/// ```
/// use lynkeus_expr::Graph;
/// use lynkeus_run::filter::{FilterKind, FilterSettings, NoisyModel, NoisyPlant, Row, Sensor};
/// use lynkeus_run::{Blueprint, EstimatorSettings, Fleet, Level, Method, Step};
///
/// // x' = −x, measured with noise
/// let g = Graph::new();
/// let [time, x] = ["time", "x"].map(|name| g.symbol(name));
/// let model = NoisyModel::new(&NoisyPlant {
///     graph: &g,
///     time: time.node(),
///     states: vec![("x".into(), x.node(), 1.0)],
///     derivatives: vec![(-x).node()],
///     inputs: vec![],
///     sensors: vec![Sensor { name: "y".into(), output: x.node(), noise: Level::Absolute(0.1), limits: None }],
///     process_noise: vec![0.01],
///     initial_variance: vec![1.0],
///     ranges: vec![],
///     confined: None,
///     whens: Default::default(),
/// })?;
/// let run = EstimatorSettings { method: Method::Rk4(Step::Substeps(1)), ..EstimatorSettings::default() };
/// let filter = Blueprint::filter(model, FilterSettings::of(FilterKind::Extended), run);
///
/// let mut fleet = Fleet::new(&[filter.clone(), filter.clone()]).map_err(|apart| apart.to_string())?;
/// let mut alone = filter.estimator()?;
/// for k in 0..10 {
///     let t = 0.1 * f64::from(k);
///     let readings = [[(-t).exp()], [0.5 * (-t).exp()]];
///     let rows = readings.each_ref().map(|y| Some(Row { t, readings: y, inputs: &[] }));
///     assert!(fleet.push(&rows).is_empty());
///     alone.push(t, &readings[1])?;
/// }
/// assert!(fleet.estimate(1).eq(alone.estimate().iter().copied()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Fleet {
    side: Box<dyn Side>,
}

impl Fleet {
    /// How many filters stand side by side here, at most.
    #[must_use]
    pub fn width() -> usize {
        apart::width()
    }

    /// Filters of one [model](crate::filter::NoisyModel), or of clones of it that differ in their start, its variance, the densities of the
    /// process noise and the strength of the sensors' noises. What is made for one fleet of a model serves all.
    ///
    /// # Errors
    /// Why they do not run side by side.
    pub fn new(filters: &[Blueprint]) -> Result<Self, Apart> {
        let first = filters.first().ok_or(Apart::Count(0))?;
        if filters.len() > Self::width() {
            return Err(Apart::Count(filters.len()));
        }
        refuse(first)?;
        let side: Box<dyn Side> = match lynkeus_native::widest() {
            8 if filters.len() > 4 => Box::new(Lanes::<8>::new(filters)?),
            _ => Box::new(Lanes::<4>::new(filters)?),
        };
        Ok(Self { side })
    }

    /// Whether each filter is what it is alone to the bit (of zeros the sign may differ): no function is
    /// used that lanes round in their own way.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.side.is_exact()
    }

    /// Number of filters.
    #[must_use]
    pub fn len(&self) -> usize {
        self.side.assets().len()
    }

    /// True of no filters: never.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Names of what is estimated.
    #[must_use]
    pub fn names(&self) -> &[String] {
        self.side.names()
    }

    /// Takes each filter to its next row, as [`Estimator::push`](crate::Estimator::push); where there is none, or fewer rows
    /// than filters, it stays. Those that failed are told by their places; they stay, too.
    ///
    /// # Panics
    /// With more rows than filters.
    pub fn push(&mut self, rows: &[Option<Row<'_>>]) -> Vec<(usize, Error)> {
        assert!(rows.len() <= self.len(), "at most one row per filter");
        self.side.push(rows)
    }

    /// The time of a filter's last row.
    #[must_use]
    pub fn time(&self, filter: usize) -> Option<f64> {
        self.asset(filter).time
    }

    /// The estimate of a filter.
    pub fn estimate(&self, filter: usize) -> impl Iterator<Item = f64> + '_ {
        self.side.numbers(filter, self.side.places().x.clone())
    }

    /// Its standard deviations.
    pub fn deviations(&self, filter: usize) -> impl Iterator<Item = f64> + '_ {
        self.side
            .numbers(filter, self.side.places().deviations.clone())
    }

    /// What became of a filter's last readings, one per sensor.
    pub fn innovations(&self, filter: usize) -> impl Iterator<Item = Innovation> + Clone + '_ {
        let readings = self.asset(filter).readings.iter().enumerate();
        readings.map(move |(sensor, reading)| self.side.innovation(filter, sensor, *reading))
    }

    /// How readings and estimate of a filter went together so far.
    #[must_use]
    pub fn health(&self, filter: usize) -> &Health {
        &self.asset(filter).beside.health
    }

    fn asset(&self, filter: usize) -> &Asset {
        &self.side.assets()[filter]
    }
}

/// What a filter asks for that is not done side by side.
fn refuse(filter: &Blueprint) -> Result<(), Apart> {
    let Updates::Filter { model, settings } = &filter.updates else {
        return Err(Apart::Kind);
    };
    if settings.kind != FilterKind::Extended {
        return Err(Apart::Kind);
    }
    if !matches!(
        filter.run.method,
        Method::Rk4(Step::AtMost(_) | Step::Substeps(_))
    ) {
        return Err(Apart::Step);
    }
    if filter.run.between != BetweenSamples::Hold {
        return Err(Apart::Line);
    }
    if !model.manifold.is_flat() {
        return Err(Apart::Manifold);
    }
    if settings.iterations > 1 {
        return Err(Apart::Iterated);
    }
    if model.drawn > 0 {
        return Err(Apart::Drawn);
    }
    if settings.keep_history {
        return Err(Apart::History);
    }
    if settings.foresees {
        return Err(Apart::Foreseen);
    }
    let systems = [&model.flow, &model.output_map];
    if systems.iter().any(|part| part.system().has_instants()) {
        return Err(Apart::Instants);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{FilterSettings, NoisyModel, NoisyPlant, Sensor};
    use crate::{EstimatorSettings, Level};
    use lynkeus_expr::Graph;

    /// What is ordinary is done in lanes: no filter of its own is made before there is something else.
    #[test]
    fn only_what_is_out_of_the_ordinary_is_done_alone() {
        let g = Graph::new();
        let [time, x, v, u] = ["time", "x", "v", "u"].map(|name| g.symbol(name));
        let states = [("x", x), ("v", v)].map(|(name, x)| (name.to_owned(), x.node(), 0.1));
        let model = NoisyModel::new(&NoisyPlant {
            graph: &g,
            time: time.node(),
            states: states.to_vec(),
            derivatives: vec![v.node(), (u - x * x * x - v).node()],
            inputs: vec![("u".to_owned(), u.node())],
            sensors: vec![Sensor {
                name: "y".to_owned(),
                output: x.node(),
                noise: Level::Absolute(0.1),
                limits: None,
            }],
            process_noise: vec![0.0, 0.1],
            initial_variance: vec![1.0; 2],
            ranges: vec![],
            confined: None,
            whens: Default::default(),
        });
        let settings = FilterSettings {
            gate: Some(5.0),
            ..FilterSettings::of(FilterKind::Extended)
        };
        let run = EstimatorSettings {
            method: Method::Rk4(Step::AtMost(0.1)),
            ..EstimatorSettings::default()
        };
        let filter = Blueprint::filter(model.unwrap(), settings, run);
        for width in 1..=Fleet::width() {
            let mut fleet = Fleet::new(&vec![filter.clone(); width]).unwrap();
            let mut push = |k: u32, y: f64| {
                let row = Row {
                    t: 0.07 * f64::from(k * k % 7 + 3 * k),
                    readings: &[y],
                    inputs: &[0.2],
                };
                assert!(fleet.push(&vec![Some(row); width]).is_empty());
                fleet.side.alone()
            };
            for k in 0..50 {
                let y = if k % 3 == 1 { f64::NAN } else { 0.2 };
                assert_eq!(push(k, y), 0, "row {k}");
            }
            assert_eq!(push(50, 9.0), width);
        }
    }
}
