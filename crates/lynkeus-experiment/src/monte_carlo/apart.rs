//! Runs one by one, each on the processor that is free.

use std::sync::OnceLock;

use lynkeus_expr::Spent;
use lynkeus_model::Plant;
use lynkeus_run::Column;

use super::ends::{Clipped, Sensor};
use super::runs::{Again, Failure, Followed, Track, Whole};
use super::statistics::of_runs;
use super::together::{Figures, Screened};
use crate::course::curved;
use crate::course::plant::Ran;
use crate::course::rig::Rig;
use crate::crew::{self, Watch};
use crate::prepare::Prepared;
use crate::simulate;
use crate::words::in_words;
use crate::{Error, Series, Study};

/// What one run gave.
#[derive(Debug)]
pub(super) struct Single {
    pub seed: u64,
    /// none where a limit ended the run
    pub result: Result<Option<Whole>, Error>,
}

/// What all runs share.
pub(super) struct Job<'a> {
    pub study: &'a Study,
    pub followed: &'a [Followed],
    pub sensors: &'a [Sensor],
    /// the rows of every run that reaches its end
    pub time: OnceLock<Vec<f64>>,
}

impl Single {
    /// Why its estimate is not credible, where it is not.
    pub fn doubt(self) -> Option<Failure> {
        let reason = self.result.ok()??.doubt?;
        let seed = self.seed;
        Some(Failure { seed, reason })
    }
}

impl Job<'_> {
    /// The runs of these seeds, on all processors.
    pub fn singles(
        &self,
        plant: &Plant,
        rig: &Rig,
        seeds: &[u64],
        watch: &mut Watch<'_>,
    ) -> Result<Vec<Single>, Error> {
        // what the design made comes with every clone of the plant
        let shared = (plant.clone(), rig.clone());
        crew::every(
            seeds.len(),
            &shared,
            &|(plant, rig), k, watch| Ok(self.single(plant, rig, seeds[k], watch)),
            watch,
        )
    }

    fn single(&self, plant: &Plant, rig: &Rig, seed: u64, watch: &mut Watch<'_>) -> Single {
        let result = self.run(plant, rig, seed, watch);
        Single { seed, result }
    }

    fn run(
        &self,
        plant: &Plant,
        rig: &Rig,
        seed: u64,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Whole>, Error> {
        let study = self.study;
        if study.budget.spent().is_some() {
            return Ok(None);
        }
        let own = Prepared::new(study, plant)?;
        let ran = match rig.run(&own, seed, watch) {
            // a run that was ended says nothing of the study
            Err(_) if study.budget.marked().is_some() => return Ok(None),
            ran => ran?,
        };
        if ran.course.limit.is_some() {
            return Ok(None);
        }
        if let Some(ended) = &ran.course.ended {
            return Err(Error::refused(in_words(ended)).at(&study.file));
        }
        if ran.run.time.last() != Some(rig.simulation.until) {
            return Ok(None);
        }
        self.time.get_or_init(|| ran.run.time.to_vec());
        let tracks = self.followed.iter().map(|f| match &f.rotation {
            None => Track {
                truth: ran.run.column(f.truth).map_or(vec![], |x| x.to_vec()),
                estimate: ran.course.estimates[f.estimate].to_vec(),
                coverage: None,
            },
            // a rotation is known by how far it is off
            Some((_, columns)) => {
                let angles = off(&ran, f.estimate, columns);
                Track {
                    truth: vec![0.0; angles.len()],
                    estimate: angles,
                    coverage: None,
                }
            }
        });
        let mut tracks: Vec<Track> = tracks.collect();
        let at_ends = self.sensors.iter().map(|s| s.count(&ran.run)).collect();
        // as `simulate` judges this run alone
        let alone = simulate::outcome(&own, rig.design.clone(), &ran.run, ran.course)?;
        let estimates = &alone.design.observer.estimates;
        for (track, followed) in tracks.iter_mut().zip(self.followed) {
            let own = &estimates[followed.estimate].variable.name;
            let whole = followed.rotation.as_ref().map(|(name, _)| name);
            let name = whole.unwrap_or(own);
            let mut own = alone.accuracies.iter();
            let own = own.find(|a| a.quantity == *name);
            track.coverage = own.and_then(|a| a.coverage);
        }
        let doubt = alone.refusal().map(|refusal| refusal.to_string());
        Ok(Some(Whole {
            tracks,
            at_ends,
            doubt,
        }))
    }

    /// The figures of runs that went on together, with those that are not credible alone.
    pub fn screened(
        &self,
        plant: &Plant,
        rig: &Rig,
        done: Screened,
        watch: &mut Watch<'_>,
    ) -> Result<Figures, Error> {
        let judged = self.singles(plant, rig, &done.suspects, watch)?;
        let doubtful = judged.into_iter().filter_map(Single::doubt).collect();
        Ok(Figures {
            doubtful,
            ..done.figures
        })
    }

    /// The figures of runs of which everything is kept.
    pub fn gathered(self, singles: Vec<Single>, again: Again) -> Result<Figures, Error> {
        let (mut seeds, mut runs) = (vec![], vec![]);
        let (mut failures, mut doubtful) = (vec![], vec![]);
        let mut first = None;
        for single in singles {
            let seed = single.seed;
            match single.result {
                Ok(None) => {}
                Ok(Some(mut whole)) => {
                    seeds.push(seed);
                    let doubt = whole.doubt.take();
                    doubtful.extend(doubt.map(|reason| Failure { seed, reason }));
                    runs.push(whole);
                }
                Err(error) => {
                    let reason = error.to_string();
                    failures.push(Failure { seed, reason });
                    first = first.or(Some(error));
                }
            }
        }
        let ended = |spent| Err(Error::ended(spent).at(&self.study.file));
        match (self.study.budget.marked(), first) {
            (Some(Spent::Cancelled), _) => return ended(Spent::Cancelled),
            (_, Some(first)) if seeds.is_empty() => return Err(first),
            (Some(spent), None) if seeds.is_empty() => return ended(spent),
            _ => {}
        }
        let found = (0..self.followed.len()).map(|place| of_runs(&runs, place));
        Ok(Figures {
            found: found.collect(),
            clipped: Clipped::of_all(&runs, self.sensors.len()),
            seeds,
            failures,
            doubtful,
            time: self.time.into_inner().unwrap_or_default(),
            again,
        })
    }
}

/// The angles between true and estimated rotations.
fn off(ran: &Ran, first: usize, columns: &[Column; 4]) -> Vec<f64> {
    let estimates = ran.course.estimates.get(first..first + 4);
    let truth: Vec<&Series> = columns.iter().filter_map(|c| ran.run.column(*c)).collect();
    let estimates: Vec<&Series> = estimates.unwrap_or_default().iter().collect();
    match (estimates.try_into(), truth.try_into()) {
        (Ok(estimates), Ok(truth)) => curved::angles(&estimates, &truth).to_vec(),
        _ => vec![],
    }
}

/// Refuses what would not fit into the memory that the study may take.
pub(super) fn room(study: &Study, rig: &Rig, runs: usize, quantities: usize) -> Result<(), Error> {
    let run = &rig.simulation;
    let rows = ((run.until - run.start) / run.output_step).ceil() + 1.0;
    let of_run = rows * quantities as f64 * size_of::<[f64; 2]>() as f64;
    // a run is counted, and watched, whatever it gives
    let bytes = runs as f64 * (of_run + 2.0 * size_of::<Single>() as f64);
    let room = study.budget.room().unwrap_or(usize::MAX);
    if bytes <= room as f64 {
        return Ok(());
    }
    let mib = |bytes: f64| (bytes / f64::from(1 << 20)).ceil();
    let message = format!(
        "{runs} runs × {rows} rows × {quantities} quantities take {} MiB, and {} MiB are left",
        mib(bytes),
        mib(room as f64)
    );
    // a filter's rows are its samples
    let is_sampled = rig.design.observer.filter.is_some() && run.noise.sample_step.is_some();
    let step = match is_sampled {
        true => "sample_step",
        false => "output_step",
    };
    Err(Error::input(message).at(&study.file).hint(format!(
        "a longer `{step}` of [simulate], fewer runs, or a greater limit of memory"
    )))
}
