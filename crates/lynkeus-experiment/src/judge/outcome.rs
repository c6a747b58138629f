//! What a simulation or a replay gives.

mod summary;

use lynkeus_expr::Spent;
use lynkeus_model::{Home, Plant};
use lynkeus_observers::{Design, Monitor, Signal};
use lynkeus_run::Error as RunError;
use lynkeus_run::filter::ParticleHealth;
use serde::Serialize;

use crate::answer::Origin;
use crate::course::corrections::Corrections;
use crate::course::doubt::Doubt;
use crate::course::taken::{AT_ONCE, delayed};
use crate::course::trace::Trace;
use crate::course::{Course, curved};
use crate::judge::accuracy::{self, Accuracy};
use crate::judge::assertions;
use crate::judge::frozen::Frozen;
use crate::judge::interval::Intervals;
use crate::judge::outside::{self, Outside, outside};
use crate::judge::{self, By, Evidence, Innovations, Judged, innovations};
use crate::prepare::declared::{Account, Declared, Kind};
use crate::prepare::headers::{Headers, log_time};
use crate::prepare::systems::hat;
use crate::prepare::{Prepared, StudyDesign};
use crate::words::in_words;
use crate::{Error, Quantity, Series, judge::expected, judge::saturated, prepare::headers};
use lynkeus_study::{EstimateSettings, Late, Name};

#[cfg(feature = "schema")]
pub use summary::RunReport;

/// The trust in an estimate over time, and whether it was ever lost.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Monitor")
)]
pub struct Watch {
    /// the first time at which it was below its alarm
    #[serde(rename = "alarm_at")]
    pub alarm: Option<f64>,
    /// the header of its column: the monitor's name unless the model has that name
    #[serde(rename = "column")]
    pub header: String,
    /// the monitor
    #[serde(skip)]
    pub monitor: Monitor,
    /// its values
    #[serde(skip)]
    pub values: Series,
}

/// Why a run ended before its last row.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Ended {
    /// in words
    pub message: String,
    /// the study
    #[serde(skip)]
    pub file: String,
    /// whether a limit of time or memory ended it, and nothing is wrong with what there is
    pub by_limit: bool,
    /// measured outputs of a log that the estimate followed, the one farthest from what was expected first
    #[serde(skip)]
    pub followed: Vec<String>,
}

/// Rows over time.
#[derive(Debug)]
pub struct Outcome {
    /// name of the plant
    pub plant: String,
    /// the observer that ran
    pub design: StudyDesign,
    /// times of the rows
    pub time: Series,
    /// header of their column: `t` unless the model has that name
    pub time_header: String,
    /// header of the column of times in a log
    log_time: String,
    /// how the study names the columns of one
    settings: EstimateSettings,
    /// whose readings it has late
    late: Kind<Late>,
    /// the study, for messages
    file: String,
    /// the unit of time, where the study has one
    pub time_unit: Option<String>,
    /// the quantities that its picture shows, where the study says so
    pub show: Option<Vec<Name>>,
    /// the true course of the plant is known
    pub is_simulated: bool,
    /// every state, input and measured output
    pub quantities: Vec<Quantity>,
    /// the measured outputs by name, noise included, where they are known
    pub measurements: Vec<(String, Series)>,
    /// the observer's monitors
    pub watches: Vec<Watch>,
    /// where the plant, as far as it is known, leaves the box of the study
    pub plant_outside: Option<Outside>,
    /// where the estimate leaves it
    pub estimate_outside: Option<Outside>,
    /// what speaks against the estimates, the heaviest first
    pub doubts: Vec<Doubt>,
    /// how the readings went together with what was expected of them, by measured output; none for
    /// an observer without deviations
    pub innovations: Vec<Innovations>,
    /// how the particles went, and how many there are; of a particle filter
    pub particles: Option<(usize, ParticleHealth)>,
    /// these row by row with their standard deviations, where they are asked for, under their headers; and how many
    /// particles count
    pub innovation_columns: Vec<(String, Series)>,
    /// what the corrections of a filter are made of, where [`Study::records`](lynkeus_study::Study::records) asks for all of it
    pub corrections: Option<Corrections>,
    /// what the log writes for zero where its times are dates
    pub origin: Option<Origin>,
    /// errors of the estimates whose true values are known
    pub accuracies: Vec<Accuracy>,
    /// sensors whose readings hang
    pub frozen: Vec<Frozen>,
    /// the log's sampling interval against what the observer stands; none where that is not known
    pub intervals: Option<Intervals>,
    /// why the run ended before its last row
    pub ended: Option<Ended>,
    /// which of the study's declarations the estimates count, their deviations if there are any
    pub declared: Account,
    /// what of the log contradicts itself, or counts nowhere
    pub warnings: Vec<String>,
    /// what the user should know
    pub notes: Vec<String>,
}

impl Outcome {
    /// The columns of the CSV: `t`; true states and inputs where they were
    /// simulated; `<name>_hat` for everything estimated; monitors. No two have the same
    /// header: what the model calls so itself keeps its name, and the others give way.
    pub fn columns(&self) -> Vec<(String, Series)> {
        type Of = fn(&Quantity) -> Option<(&String, &Series)>;
        let truth: Of = |q| Some((&q.name, q.truth.as_ref()?));
        let others: [Of; 4] = [
            |q| Some((&q.estimate_header, q.estimate.as_ref()?)),
            Quantity::deviation_column,
            |q| Some((&q.smoothed_header, q.smoothed.as_ref()?)),
            Quantity::smoothed_deviation_column,
        ];
        let told = self.is_simulated.then_some(truth).into_iter().chain(others);
        let named = told.flat_map(|of| self.quantities.iter().filter_map(of));
        let innovations = self.innovation_columns.iter();
        let watches = self.watches.iter().map(|w| (&w.header, &w.values));
        std::iter::once((&self.time_header, &self.time))
            .chain(named)
            .chain(innovations.map(|(header, values)| (header, values)))
            .chain(watches)
            .map(|(header, values)| (header.clone(), values.clone()))
            .collect()
    }

    /// What a logger would have seen: time, the measured outputs and the inputs, under the
    /// headers under which [`estimate()`](crate::estimate()) looks for them.
    ///
    /// # Errors
    /// The study's `[estimate]` gives two of them the same header.
    pub fn log(&self) -> Result<Vec<(String, Series)>, Error> {
        let inputs = self.quantities.iter().filter(|q| q.is_input);
        let inputs =
            inputs.filter_map(|q| Some((&q.name, q.measured.as_ref().or(q.truth.as_ref())?)));
        let measured = self.measurements.iter().map(|(n, values)| (n, values));
        let mut columns = vec![(self.log_time.clone(), self.time.clone())];
        let mut stamps: Vec<&str> = vec![];
        for (name, values) in measured.chain(inputs) {
            let header = headers::header(&self.settings, name).to_owned();
            let values = &match self.late.of(name) {
                Some(Late::By(delay)) => self.delayed(name, values, *delay)?,
                Some(Late::TakenAt(column)) => {
                    stamps.push(&column.text);
                    values.clone()
                }
                None => values.clone(),
            };
            if columns.iter().any(|(known, _)| *known == header) {
                return Err(Error::input(format!(
                    "the log would have two columns \"{header}\", and \"{name}\" is one of them"
                ))
                .hint("give each a header of its own: `time` and `columns` of [estimate]")
                .at(&self.file));
            }
            columns.push((header, values.clone()));
        }
        // what is simulated is told at once
        for column in stamps {
            if columns.iter().all(|(known, _)| known != column) {
                columns.push((column.to_owned(), self.time.clone()));
            }
        }
        Ok(columns)
    }

    /// What a sensor shows that is late.
    fn delayed(&self, name: &str, values: &Series, delay: f64) -> Result<Series, Error> {
        delayed(&self.time, values, delay).ok_or_else(|| {
            Error::input(format!(
                "the simulated log has no row {delay} after another, and {name} is as late: expected a delay of some whole rows"
            ))
            .hint("set `sample_step` (of a filter) or `output_step` of [simulate] to a part of the delay")
            .at(&self.file)
        })
    }

    /// The answer "no" where an estimate is not credible, by its [doubts](Self::doubts), or the run
    /// ended early.
    pub fn refusal(&self) -> Option<Error> {
        if let Some(ended) = &self.ended {
            let rows = self.time.len();
            let kept = format!("(the {rows} rows before are written)");
            if ended.by_limit {
                let refusal = Error::refused(format!("{} {kept}", ended.message)).as_ended();
                return Some(refusal.at(&ended.file).hint("allow more time or memory"));
            }
            let message = match ended.followed.is_empty() {
                true => format!("{} {kept}", ended.message),
                false => format!(
                    "the estimate is not credible: {}; it followed the readings of {} {kept}",
                    ended.message,
                    ended.followed.join(", ")
                ),
            };
            return Some(Error::refused(message).at(&ended.file));
        }
        judge::refusal(&self.doubts)
    }

    /// Whether nothing speaks against the estimates.
    pub fn is_credible(&self) -> bool {
        self.refusal().is_none()
    }
}

/// A run before its columns have headers.
pub(crate) struct Raw<'r> {
    pub prepared: &'r Prepared<'r>,
    pub design: StudyDesign,
    /// times of the rows
    pub time: Series,
    /// what stands for zero where they are dates
    pub origin: Option<Origin>,
    pub course: Course,
    pub quantities: Vec<Quantity>,
    pub measurements: Vec<(String, Series)>,
    /// whether the readings are a log's, and not of a plant whose truth is known
    pub replayed: bool,
    pub frozen: Vec<Frozen>,
    pub intervals: Option<Intervals>,
    pub notes: Vec<String>,
}

impl Raw<'_> {
    /// The outcome: headers, alarms, and what is to be said of it.
    ///
    /// # Errors
    /// The disk that keeps a long run was full, or failed.
    pub fn finish(self) -> Result<Outcome, Error> {
        let Self {
            prepared,
            design,
            time,
            origin,
            mut course,
            mut quantities,
            mut measurements,
            replayed,
            frozen,
            intervals,
            mut notes,
        } = self;
        let plant = prepared.plant();
        curved::place(plant, replayed, &mut quantities, &mut measurements);
        notes.append(&mut course.notes);
        notes.extend(frozen.iter().map(Frozen::words));
        notes.extend(intervals.as_ref().and_then(Intervals::words));
        notes.extend(saturated::told(prepared, &design, &measurements));
        let innovations = innovations(&design, &course, &mut notes);
        let mut headers = Headers::beside(plant);
        let time_header = headers.time();
        for quantity in quantities.iter_mut().filter(|q| q.estimate.is_some()) {
            let what = format!("the estimate of {}", quantity.name);
            quantity.estimate_header = headers.free(&hat(&quantity.name), &what);
            if let Some(rotation) = &mut quantity.rotation {
                rotation.give_headers(&mut headers);
            }
            let is_own = !matches!(quantity.home, Home::Rotation { .. });
            if is_own && quantity.deviation.is_some() {
                let wanted = format!("{}_sd", quantity.name);
                quantity.deviation_header =
                    headers.free(&wanted, &format!("the deviation of {what}"));
            }
            if quantity.smoothed.is_some() {
                let wanted = format!("{}_smooth", quantity.name);
                quantity.smoothed_header =
                    headers.free(&wanted, &format!("{what} given later rows"));
            }
            if is_own && quantity.smoothed_deviation.is_some() {
                let wanted = format!("{}_smooth_sd", quantity.name);
                let what = format!("the deviation of {what} given later rows");
                quantity.smoothed_deviation_header = headers.free(&wanted, &what);
            }
        }
        let innovation_columns = innovation_columns(&design, &mut course, &mut headers);
        let watches = watches(&design, &mut course.monitors, &time, &mut headers);
        show_measurements(plant, &measurements, &mut quantities);
        expected::give(prepared.augmented(), &time, &mut quantities);
        curved::place_expected(&mut quantities);
        let sides = outside::sides(prepared.augmented());
        let accuracies = accuracy::accuracies(&time, &quantities, &sides);
        notes.extend(accuracy::told(&accuracies));
        notes.extend(assertions::told(plant, &time, &quantities));
        let itself = outside::time_itself(&time);
        let all = || quantities.iter().chain([&itself]);
        let plant_outside = outside(&time, all(), outside::PLANT, &sides);
        let estimate_outside = outside(&time, all(), outside::ESTIMATE, &sides);
        notes.extend(headers.notes);
        notes.extend(alarms(&watches));
        let left = [("plant", &plant_outside), ("estimate", &estimate_outside)];
        notes.extend(left.iter().filter_map(|(who, outside)| {
            let words = outside.as_ref()?.words();
            Some(format!(
                "the {who} is outside of the declared box {words}: nothing is proved there"
            ))
        }));
        let sight = Sight {
            prepared,
            design: &design,
            time: &time,
            quantities: &quantities,
            deviations: course.deviations.as_deref().unwrap_or_default(),
            innovations: &innovations,
            frozen: &frozen,
            replayed,
        };
        // what is told stands beside its readings, too: a start may explain what an error system sees
        // for a whole log, and a density that was guessed everything
        let is_excused = prepared.study().estimate.follows_errors() && sight.wander_is_guessed();
        let bare = match replayed && design.observer.filter.is_none() {
            true => judge::residuals(
                prepared.declared(),
                plant,
                &time,
                &quantities,
                &measurements,
                !is_excused,
            ),
            false => vec![],
        };
        let mut doubts = sight.doubts(&bare);
        doubts.splice(0..0, std::mem::take(&mut course.doubts));
        let ended = course.ended.as_ref().map(|e| Doubt::ended(in_words(e)));
        doubts.splice(0..0, ended);
        let told = doubts.iter().filter(|d| d.is_told());
        notes.extend(told.map(|d| d.text.clone()));
        // nothing of this counts where a number was lost
        course.check()?;
        time.check()?;
        let is_weighed =
            design.observer.filter.is_some() || quantities.iter().any(|q| q.deviation.is_some());
        let declared = account(prepared.declared(), &design, is_weighed, replayed);
        // of a gain that is chosen without the noises nobody takes them for counted
        let is_claimed = is_weighed || prepared.declared().disturbances.is_declared();
        notes.extend(declared.told().filter(|_| is_claimed));
        let study = prepared.study();
        Ok(Outcome {
            plant: plant.name.clone(),
            file: study.file.clone(),
            declared,
            log_time: log_time(plant, &study.estimate),
            settings: study.estimate.clone(),
            late: prepared.declared().late.clone(),
            time_unit: study.time_unit.clone(),
            show: study.show.clone(),
            is_simulated: !replayed,
            doubts,
            ended: course.ended.map(|error| Ended {
                message: match course.limit {
                    Some(spent) => not_whole(spent, &error),
                    None => in_words(&error),
                },
                file: study.file.clone(),
                by_limit: course.limit.is_some(),
                followed: match replayed {
                    true => followed(&design, &innovations),
                    false => vec![],
                },
            }),
            innovations,
            innovation_columns,
            particles: course.particles,
            corrections: course.corrections,
            origin,
            accuracies,
            frozen,
            intervals,
            time,
            time_header,
            design,
            quantities,
            measurements,
            watches,
            plant_outside,
            estimate_outside,
            warnings: course.warnings,
            notes,
        })
    }
}

/// Measured outputs, the one whose readings were farthest from what was expected first.
fn followed(design: &Design, innovations: &[Innovations]) -> Vec<String> {
    let mut named: Vec<(f64, &str)> = vec![];
    for signal in &design.observer.measured {
        let own = innovations.iter().find(|i| i.output == signal.name);
        let largest = own.map_or(0.0, |i| i.trace.whole().largest);
        named.push((largest, &signal.name));
    }
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    named.into_iter().map(|(_, name)| name.to_owned()).collect()
}

/// What estimates count: a filter by its gain, a family with a theorem by its deviations if they are asked for.
fn account(declared: &Declared, design: &Design, is_weighed: bool, replayed: bool) -> Account {
    let Declared {
        ranges,
        noise,
        limits,
        samples,
        process_noise,
        disturbances,
        slew,
        input_derivatives,
        screens,
        late,
        manifold,
        input_noise,
        correlation,
    } = declared;
    let is_filter = design.observer.filter.is_some();
    let unweighed = "the gain is chosen without it: `sd` of [estimate] counts it, and `certify`";
    let promised = "a promise of what the inputs do: `certify` counts it";
    Account::default()
        .counts(screens)
        .counts_if(replayed, late, AT_ONCE)
        .counts(manifold)
        .counts(ranges)
        .counts(samples)
        .counts_if(is_weighed, noise, unweighed)
        .counts_if(is_weighed, process_noise, unweighed)
        .counts_if(is_weighed, input_noise, unweighed)
        .counts_if(
            is_filter,
            correlation,
            "gain and `sd` take the noises of sensors for independent: a filter counts it",
        )
        .counts_if(is_filter, limits, saturated::TAKEN)
        .leaves(
            disturbances,
            "taken as zero: neither estimate nor deviation counts what they do",
        )
        .leaves(slew, promised)
        .leaves(input_derivatives, promised)
}

/// The innovations row by row, each followed by its standard deviation; then how many particles count.
fn innovation_columns(
    design: &Design,
    course: &mut Course,
    headers: &mut Headers,
) -> Vec<(String, Series)> {
    let sensors = design.observer.measured.iter();
    let named = sensors.flat_map(|s| ["innovation", "innovation_sd"].map(|what| (&s.name, what)));
    let columns = std::mem::take(&mut course.innovations);
    let named = named.zip(columns).map(|((name, what), values)| {
        let header = headers.free(&format!("{name}_{what}"), &format!("the {what} of {name}"));
        (header, values)
    });
    let mut named: Vec<_> = named.collect();
    for values in std::mem::take(&mut course.effective) {
        let header = headers.free("ess", "the effective number of particles");
        named.push((header, values));
    }
    named
}

/// What a judge sees of a run.
struct Sight<'s> {
    prepared: &'s Prepared<'s>,
    design: &'s Design,
    time: &'s Series,
    quantities: &'s [Quantity],
    /// by estimate, where they are not told
    deviations: &'s [Series],
    innovations: &'s [Innovations],
    frozen: &'s [Frozen],
    replayed: bool,
}

impl Sight<'_> {
    /// Whether an unknown input is estimated of which nothing declares how fast it wanders.
    fn wander_is_guessed(&self) -> bool {
        let augmented = self.prepared.augmented();
        let declared = &self.prepared.declared().process_noise;
        let mut unknown = augmented.states.iter().skip(augmented.plant_states());
        unknown.any(|u| declared.of(&u.name).is_none())
    }

    /// What speaks against the estimates; `bare` are readings beside those of an observer with a theorem.
    fn doubts(&self, bare: &[(String, Trace)]) -> Vec<Doubt> {
        let is_filter = self.design.observer.filter.is_some();
        let noise = &self.prepared.study().sensors.noise;
        let is_declared = |name: &str| noise.iter().any(|(n, _)| n.is_or_has(name));
        // a noise that was guessed from the log says nothing of an observer with a theorem
        let followed = self.innovations.iter();
        let followed = followed.filter(|i| is_filter || is_declared(&i.output));
        let is_guessed = !is_filter && self.wander_is_guessed();
        let followed = followed.flat_map(|i| {
            let by = |by: By, trace| Judged {
                name: &i.output,
                trace,
                late: Some(&i.late),
                by,
                is_declared: is_declared(&i.output) && !is_guessed,
            };
            match is_filter {
                true => vec![by(By::Filter, &i.trace)],
                false => vec![by(By::ErrorSystem, &i.trace), by(By::Settled, &i.settled)],
            }
        });
        let bare = bare.iter().map(|(name, trace)| Judged {
            name,
            trace,
            late: None,
            by: By::Noise,
            // a reading that an estimate follows is closer to it than its noise
            is_declared: false,
        });
        let sensors = followed.chain(bare);
        let (augmented, plant) = (self.prepared.augmented(), self.prepared.plant());
        let declared = augmented.states.iter().chain(&plant.states);
        let estimates = self.design.observer.estimates.iter();
        let kept = estimates.zip(self.deviations);
        let kept = kept.map(|(e, sd)| (e.variable.name.as_str(), sd));
        let told = self.quantities.iter();
        let told = told.filter_map(|q| Some((q.name.as_str(), q.deviation.as_ref()?)));
        judge::doubts(&Evidence {
            time: self.time,
            quantities: self.quantities,
            settings: &self.prepared.study().estimate,
            declared: declared.chain(&plant.inputs).collect(),
            deviations: told.chain(kept).collect(),
            sensors: sensors.collect(),
            frozen: self.frozen,
            is_filter,
            replayed: self.replayed,
        })
    }
}

/// The observer's monitors as they went.
fn watches(
    design: &Design,
    monitors: &mut [Series],
    time: &Series,
    headers: &mut Headers,
) -> Vec<Watch> {
    let watch = |(i, monitor): (usize, &Monitor)| {
        let values = monitors.get_mut(i).map(std::mem::take).unwrap_or_default();
        let low = values.iter().position(|x| x < monitor.alarm_below);
        let what = format!("the monitor {}", monitor.name);
        Watch {
            alarm: low.and_then(|row| time.get(row)),
            header: headers.free(&monitor.name, &what),
            monitor: monitor.clone(),
            values,
        }
    };
    design
        .observer
        .monitors
        .iter()
        .enumerate()
        .map(watch)
        .collect()
}

/// Alarms in words.
fn alarms(watches: &[Watch]) -> Vec<String> {
    let raised = watches.iter().filter_map(|w| Some((w, w.alarm?)));
    raised
        .map(|(w, t)| {
            let Monitor {
                alarm_below,
                meaning,
                ..
            } = &w.monitor;
            let name = &w.header;
            format!("{meaning}: {name} fell below {alarm_below} first at t = {t}")
        })
        .collect()
}

/// That a limit ended a run, in words.
pub(crate) fn not_whole(spent: Spent, error: &RunError) -> String {
    match error {
        RunError::Cancelled { time } => format!("the run is not whole: {spent} at t = {time}"),
        _ => format!("the run is not whole: {spent}"),
    }
}

/// The measured outputs of which `values` knows the values.
pub(crate) fn measurements(
    design: &Design,
    values: impl Fn(&Signal) -> Option<Series>,
) -> Vec<(String, Series)> {
    let measured = design.observer.measured.iter();
    measured
        .filter_map(|signal| Some((signal.name.clone(), values(signal)?)))
        .collect()
}

/// Puts each measurement beside the state it shows; one that shows none becomes
/// a quantity of its own.
fn show_measurements(
    plant: &Plant,
    measurements: &[(String, Series)],
    quantities: &mut Vec<Quantity>,
) {
    for (name, values) in measurements {
        let Some(output) = plant.outputs.iter().find(|o| o.name == *name) else {
            continue;
        };
        let state = plant.states.iter().find(|s| s.node == output.node);
        let shown = state.and_then(|s| quantities.iter_mut().find(|q| q.name == s.name));
        match shown {
            Some(quantity) => {
                quantity.measured = Some(values.clone());
                quantity.sensor = (quantity.name != *name).then(|| name.clone());
            }
            None => quantities.push(Quantity {
                name: output.name.clone(),
                unit: output.unit.clone(),
                description: output.description.clone(),
                measured: Some(values.clone()),
                home: output.home,
                ..Quantity::default()
            }),
        }
    }
}
