//! A study that is run many times: plant and observer are made once.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lynkeus_model::Plant;

use crate::course::filter::keep_compiled;
use crate::course::replay::Watch;
use crate::course::rig::Rig;
use crate::prepare::{Prepared, StudyDesign, is_certified_gain};
use crate::simulate;
use crate::{Error, Outcome, Study, Table, choose, estimate, prepare, prepare::systems};
use lynkeus_study::SimulateSettings;

/// Runs a study as [`simulate`](crate::simulate()) and [`estimate`](crate::estimate()) do, to the
/// bit, and keeps its plant and observer for further runs and for studies that
/// [differ in nothing that they depend on](Runner::serves). Threads may share it.
#[derive(Debug)]
pub struct Runner {
    study: Study,
    simulated: Kept<Rig>,
    replayed: Kept<StudyDesign>,
}

impl Runner {
    /// Nothing is made before it is needed.
    pub fn new(study: Study) -> Self {
        Self {
            study,
            simulated: Kept::default(),
            replayed: Kept::default(),
        }
    }

    /// Whether the plant and the observer of its study are those of another: the two may differ in seed,
    /// `initial` and `spread` of `[simulate]`, in `noise` of `[sensors]` unless the gain is chosen by
    /// it, and in what is done with results.
    #[must_use]
    pub fn serves(&self, other: &Study) -> bool {
        let own = &self.study;
        let (sensors, others) = (&own.sensors, &other.sensors);
        // a file may change
        own.plant_text.is_some()
            && own.plant_text == other.plant_text
            && (&own.file, &own.plant, &own.model) == (&other.file, &other.plant, &other.model)
            && (&own.parameters, own.tables) == (&other.parameters, other.tables)
            && (&sensors.measured, &sensors.unknown) == (&others.measured, &others.unknown)
            && (&sensors.disturbances, &sensors.limits) == (&others.disturbances, &others.limits)
            && (&sensors.input_noise, &sensors.correlation)
                == (&others.input_noise, &others.correlation)
            && own.process_noise == other.process_noise
            && own.observer.is_like(&other.observer)
            // a certified gain is chosen by the noise that it lets through
            && (sensors.noise == others.noise || !is_certified_gain(&own.observer.tuning))
            && (&own.narrower, &own.certify) == (&other.narrower, &other.certify)
            && own.estimate == other.estimate
            && own.simulate.as_ref().map(undrawn) == other.simulate.as_ref().map(undrawn)
    }

    /// [`simulate`](crate::simulate()) for a study that it [serves](Runner::serves).
    ///
    /// # Errors
    /// As there.
    pub fn simulate(
        &self,
        study: &Study,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Outcome, Error> {
        systems::settings(study)?;
        let (plant, rig) = match self.simulated.copy(study) {
            Some((plant, rig)) => {
                let rig = rig.redrawn(study, &plant)?;
                (plant, rig)
            }
            None => {
                let plant = prepare::plant(study)?;
                let prepared = Prepared::new(study, &plant)?;
                let rig = Rig::new(&prepared)?;
                self.simulated.keep(&prepared, &rig);
                drop(prepared);
                (plant, rig)
            }
        };
        simulate::simulated_by(&Prepared::new(study, &plant)?, rig, watch)
    }

    /// [`estimate`](crate::estimate()) for a study that it [serves](Runner::serves).
    ///
    /// # Errors
    /// As there.
    pub fn estimate(
        &self,
        study: &Study,
        table: &Table,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Outcome, Error> {
        let (plant, design) = self.replay(study)?;
        estimate::looked_at(
            &Prepared::new(study, &plant)?,
            design,
            table,
            Watch::only(watch),
        )
    }

    /// The same for several logs: where a filter allows it, side by side. How many pay off together says
    /// [`side_by_side`](crate::side_by_side).
    ///
    /// # Errors
    /// As [`Runner::estimate`] of the study; those of each log stand in its place.
    pub fn estimate_together(
        &self,
        study: &Study,
        tables: &[&Table],
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<Result<Outcome, Error>>, Error> {
        let (plant, design) = self.replay(study)?;
        let prepared = Prepared::new(study, &plant)?;
        Ok(estimate::together(&prepared, &design, tables, watch))
    }

    /// The plant with the observer that replays logs.
    fn replay(&self, study: &Study) -> Result<(Plant, StudyDesign), Error> {
        if let Some(kept) = self.replayed.copy(study) {
            return Ok(kept);
        }
        let plant = prepare::plant(study)?;
        let prepared = Prepared::new(study, &plant)?;
        let design = prepared.design()?;
        keep_compiled(prepared.augmented().graph());
        self.replayed.keep(&prepared, &design);
        drop(prepared);
        Ok((plant, design))
    }
}

/// The settings without what no observer depends on.
fn undrawn(settings: &SimulateSettings) -> SimulateSettings {
    SimulateSettings {
        seed: 0,
        initial: vec![],
        spread: vec![],
        ..settings.clone()
    }
}

/// A plant with what was made of it. A graph is not to be shared by threads: each run has a copy.
#[derive(Debug)]
struct Kept<T>(Mutex<Option<(Plant, T)>>);

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T: Clone> Kept<T> {
    fn lock(&self) -> MutexGuard<'_, Option<(Plant, T)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A copy, under the budget of a study.
    fn copy(&self, study: &Study) -> Option<(Plant, T)> {
        let copy = self.lock().clone()?;
        copy.0.graph.set_budget(study.budget.clone());
        Some(copy)
    }

    /// Keeps what was made, where that would be the same every time: neither limits nor
    /// simulations had a say in it.
    fn keep(&self, prepared: &Prepared<'_>, made: &T) {
        let budget = &prepared.study().budget;
        // before anything more is asked of the graph
        let copy = (prepared.plant().clone(), made.clone());
        let is_whole = budget.left().is_none() && budget.marked().is_none();
        if is_whole && choose::is_fixed(prepared) {
            *self.lock() = Some(copy);
        }
    }
}

/// Runners of the studies that were asked for last: changes of one that do not change its
/// observer share theirs.
#[derive(Debug, Default)]
pub struct Runners(Mutex<VecDeque<Arc<Runner>>>);

/// So many are kept: a plant with its graph may take room.
const LAST: usize = 4;

impl Runners {
    /// The runner that serves a study.
    pub fn of(&self, study: &Study) -> Arc<Runner> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = known.iter().position(|runner| runner.serves(study));
        let found = place.and_then(|place| known.remove(place));
        let runner = found.unwrap_or_else(|| Arc::new(Runner::new(study.clone())));
        known.push_front(Arc::clone(&runner));
        known.truncate(LAST);
        runner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TANK: &str = "model Tank\n  input Real inflow(min = 0, max = 5);\n  \
        Real level(start = 4, min = 0.1, max = 10);\n  output Real y = level;\nequation\n  \
        der(level) = inflow - 0.5*sqrt(level);\nend Tank;";

    /// The tank with sections of its own.
    fn tank(observer: &str, noise: f64, run: &str) -> Study {
        let text = format!(
            "plant = \"tank.mo\"\nprocess_noise = {{ inflow = 0.01, level = 1e-6 }}\n\
             observer = {{ {observer} }}\nsensors = {{ unknown = [\"inflow\"], noise = {{ y = {noise} }} }}\n\
             [simulate]\nuntil = 10\noutput_step = 0.5\ninputs = {{ inflow = 1.2 }}\n{run}"
        );
        let mut study = Study::parse(&text, "tank.toml").unwrap();
        study.plant_text = Some(Arc::from(TANK));
        study
    }

    const FAMILIES: [&str; 5] = [
        "theta = 1.0",
        "family = \"triangular\", theta = 1.0, initial = { default = 3 }",
        "family = \"ekf\"",
        "family = \"triangular\"", // θ is proposed by simulations, of the study's seed
        "",
    ];

    fn told(outcome: Result<Outcome, Error>) -> String {
        let outcome = outcome.unwrap();
        let columns = outcome.columns().into_iter();
        let columns = columns.map(|(name, values)| (name, values.to_vec()));
        format!("{:?} {}", columns.collect::<Vec<_>>(), outcome.entries())
    }

    fn go(_: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    #[test]
    fn runs_are_those_of_the_study_alone() {
        for observer in FAMILIES {
            let runner = Runner::new(tank(observer, 0.05, "seed = 1"));
            let runs = [
                "seed = 1",
                "seed = 2",
                "initial = { level = 5 }",
                "spread = { level = 1 }",
                "seed = 1",
            ];
            for (noise, run) in [0.05, 0.05, 0.02, 0.0, 0.05].into_iter().zip(runs) {
                let study = tank(observer, noise, run);
                assert!(runner.serves(&study));
                let alone = crate::simulate(&study, &mut go);
                assert_eq!(
                    told(runner.simulate(&study, &mut go)),
                    told(alone),
                    "{observer} {run}"
                );
            }
        }
    }

    #[test]
    fn replays_are_those_of_the_study_alone() {
        for observer in FAMILIES {
            let study = tank(observer, 0.05, "");
            let runner = Runner::new(study.clone());
            for seed in 1..4 {
                let run =
                    crate::simulate(&tank(observer, 0.05, &format!("seed = {seed}")), &mut go)
                        .unwrap();
                let log = run.log().unwrap().into_iter();
                let log =
                    Table::from_columns(log.map(|(name, x)| (name, x.to_vec())).collect()).unwrap();
                let alone = crate::estimate(&study, &log, &mut go);
                assert_eq!(
                    told(runner.estimate(&study, &log, &mut go)),
                    told(alone),
                    "{observer} {seed}"
                );
            }
        }
    }

    /// Filters with fixed steps go side by side; a log that ends early or cannot be read has its own answer.
    #[test]
    fn logs_together_give_what_each_gives_alone() {
        let fixed = "[estimate]\nmethod = \"rk4\"\nstep = 0.3\nsd = true\ninnovations = true";
        let studies = [
            (tank("family = \"ekf\", gate = 3.0", 0.05, fixed), true),
            (tank("family = \"ekf\"", 0.05, ""), false),
            (tank("theta = 1.0", 0.05, fixed), false),
        ];
        let log = |k: u32, name: &str| {
            let column =
                |f: &dyn Fn(f64) -> f64| (0..300 + 10 * k).map(|i| f(f64::from(i))).collect();
            let y = |i: f64| match i {
                _ if i % 7.0 == 3.0 => f64::NAN,
                _ if k == 2 && i > 100.0 => 1e300,
                _ => 4.0 + (0.01 * i * f64::from(1 + k)).sin(),
            };
            let columns = [
                ("t", column(&|i| 0.2 * i + 0.01 * (i * i % 5.0))),
                (name, column(&y)),
            ];
            Table::from_columns(columns.map(|(name, x)| (name.to_owned(), x)).into()).unwrap()
        };
        let tables = [
            log(0, "y"),
            log(1, "y"),
            log(2, "y"),
            log(3, "z"),
            log(4, "y"),
        ];
        let tables: Vec<&Table> = tables.iter().collect();
        let all = |found: Result<Outcome, Error>| match found {
            Ok(outcome) => told(Ok(outcome)),
            Err(error) => format!("{error:?}"),
        };
        for (study, is_together) in studies {
            let runner = Runner::new(study.clone());
            let found = runner.estimate_together(&study, &tables, &mut go).unwrap();
            let found: Vec<String> = found.into_iter().map(all).collect();
            let alone = tables
                .iter()
                .map(|table| all(crate::estimate(&study, table, &mut go)));
            assert_eq!(found, alone.collect::<Vec<_>>());
            let (plant, design) = runner.replay(&study).unwrap();
            let prepared = Prepared::new(&study, &plant).unwrap();
            let in_lanes = estimate::in_lanes(&prepared, &design, &tables, &mut go);
            assert_eq!(in_lanes.is_some(), is_together);
        }
    }

    #[test]
    fn a_proposal_of_simulations_is_not_kept() {
        for (observer, is_kept) in FAMILIES.into_iter().zip([true, true, true, false, false]) {
            let study = tank(observer, 0.05, "");
            let runner = Runner::new(study.clone());
            runner.simulate(&study, &mut go).unwrap();
            assert_eq!(runner.simulated.lock().is_some(), is_kept, "{observer}");
        }
    }

    #[test]
    fn another_observer_or_plant_has_a_runner_of_its_own() {
        let study = tank("theta = 1.0", 0.05, "");
        let runners = Runners::default();
        let first = runners.of(&study);
        let same = |other: &Study| Arc::ptr_eq(&first, &runners.of(other));
        assert!(same(&tank("theta = 1.0", 0.01, "seed = 7")));
        assert!(!same(&tank("theta = 2.0", 0.05, "")));
        let certified = "family = \"triangular\", gain = \"lmi\"";
        let certified = [0.05, 0.01].map(|noise| tank(certified, noise, ""));
        assert!(!Runner::new(certified[0].clone()).serves(&certified[1]));
        assert!(!same(&tank("theta = 1.0", 0.05, "start = 1")));
        let with = |change: fn(&mut Study)| {
            let mut other = study.clone();
            change(&mut other);
            other
        };
        let others = [
            with(|s| s.plant_text = Some(Arc::from(TANK.replace("0.5", "0.6")))),
            with(|s| s.sensors.unknown.clear()),
            with(|s| s.process_noise.clear()),
            with(|s| s.narrower.push(("level".into(), 1.0, 5.0))),
            with(|s| s.estimate.deviations = true),
            with(|s| s.parameters = [("k".to_owned(), 1.0)].into()),
            with(|s| s.plant_text = None),
        ];
        for other in others {
            assert!(!first.serves(&other), "{other:?}");
        }
        // those that were asked for last are known
        assert!(same(&study));
        for theta in 3..9 {
            runners.of(&tank(&format!("theta = {theta}.0"), 0.05, ""));
        }
        assert!(!same(&study));
    }
}
