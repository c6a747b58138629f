//! Studies, and what is asked of them.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use lynkeus::precision::{self, Candidates};
use lynkeus::prepare::Prepared;
use lynkeus::study::Whole;
use lynkeus::{
    CheckOptions, Error, ExportOptions, FitOptions, FmiVersion, Precision, Records, Runner,
    Runners, Subject, Target,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::answer::Answer;
use crate::away::{Terms, Watch, away};
use crate::errors::{exception, from_source};
use crate::estimator::Estimator;
use crate::functions::Functions;
use crate::likelihood::Likelihood;
use crate::log::{Given, Log};
use crate::sections;

/// A study with the texts that it was made from.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Study {
    study: lynkeus::Study,
    text: String,
    /// its own plant and observer, made when first run
    runner: Arc<Runner>,
    /// those of the studies that were made from the same one
    runners: Arc<Runners>,
}

/// That the text of a model can be read so far that its models are known.
#[pyfunction]
pub fn model_names(text: &str, name: &str) -> PyResult<Vec<String>> {
    lynkeus::model::model_names(text, name).map_err(from_source)
}

/// The JSON Schema of study files.
#[pyfunction]
pub fn schema() -> String {
    lynkeus::schema().to_string()
}

#[pymethods]
impl Study {
    /// A log in a file that is written as the study says, all of its columns.
    fn log(&self, py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<Log> {
        Log::whole(py, &self.study, path)
    }

    /// A study file, or a model for which it stands with every output measured; the plant's text
    /// comes along.
    #[staticmethod]
    #[pyo3(signature = (path, model=None))]
    fn load(py: Python<'_>, path: PathBuf, model: Option<String>) -> PyResult<Self> {
        let whole = py.detach(|| Whole::load(&path, model));
        let Whole { study, text } = whole.map_err(|e| exception(&e))?;
        Ok(Self::new(study, text, Arc::default()))
    }

    /// A study's text; `file` names it in messages. `plant` is the name of the model, and its text
    /// where that is no file. What `origin` and its other changes have prepared is used where it is
    /// the same.
    #[staticmethod]
    #[pyo3(signature = (text, file, plant=None, model=None, origin=None))]
    fn parse(
        py: Python<'_>,
        text: String,
        file: &str,
        plant: Option<(PathBuf, Option<String>)>,
        model: Option<String>,
        origin: Option<PyRef<'_, Self>>,
    ) -> PyResult<Self> {
        let parsed = py.detach(|| lynkeus::Study::parse(&text, file));
        let mut study = parsed.map_err(|e| exception(&e))?;
        if let Some((name, text)) = plant {
            study.plant = Some(name);
            study.plant_text = text.map(Into::into);
        }
        study.model = model.or(study.model);
        let runners = origin.map(|origin| Arc::clone(&origin.runners));
        Ok(Self::new(study, text, runners.unwrap_or_default()))
    }

    #[getter]
    fn file(&self) -> &str {
        &self.study.file
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// The text as dictionaries.
    fn sections<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        sections::of(py, &self.text)
    }

    /// The name and the text of the plant.
    #[getter]
    fn plant(&self) -> Option<(String, Option<&str>)> {
        let plant = self.study.plant.as_deref()?;
        let name = plant.display().to_string();
        Some((name, self.study.plant_text.as_deref()))
    }

    #[getter]
    fn model(&self) -> Option<&str> {
        self.study.model.as_deref()
    }

    #[pyo3(signature = (parameters=false, about=vec![], terms=None))]
    fn check(
        &self,
        py: Python<'_>,
        parameters: bool,
        about: Vec<String>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Answer> {
        let options = CheckOptions { parameters, about };
        let terms = terms.unwrap_or_default();
        let report = self.ask(py, &terms, |study, _| lynkeus::check(study, &options));
        report.map(Answer::of)
    }

    #[pyo3(signature = (terms=None))]
    fn design(&self, py: Python<'_>, terms: Option<Terms<'_>>) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let report = self.ask(py, &terms, |study, _| lynkeus::design(study));
        report.map(Answer::of)
    }

    #[pyo3(signature = (terms=None))]
    fn certify(&self, py: Python<'_>, terms: Option<Terms<'_>>) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let report = self.ask(py, &terms, |study, _| lynkeus::certify(study));
        report.map(Answer::of)
    }

    #[pyo3(signature = (horizon=None, sensors=None, terms=None))]
    fn how_well(
        &self,
        py: Python<'_>,
        horizon: Option<f64>,
        sensors: Option<&str>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Answer> {
        let sensors = match sensors {
            None => None,
            Some("outputs") => Some(Candidates::Outputs),
            Some("all") => Some(Candidates::All),
            Some(other) => return Err(unknown("sensors", "\"outputs\" or \"all\"", other)),
        };
        let options = precision::Options { horizon, sensors };
        let terms = terms.unwrap_or_default();
        let report = self.ask(py, &terms, |study, _| lynkeus::precision(study, &options));
        report.map(Answer::of)
    }

    #[pyo3(signature = (terms=None))]
    fn simulate(&self, py: Python<'_>, terms: Option<Terms<'_>>) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let outcome = self.ask(py, &terms, |study, watch| {
            self.runner.simulate(study, watch)
        })?;
        Ok(Answer::of(outcome))
    }

    #[pyo3(signature = (log, terms=None))]
    fn open_run(&self, py: Python<'_>, log: Given, terms: Option<Terms<'_>>) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let run = self.ask(py, &terms, |study, watch| {
            lynkeus::open_run(study, &*log.table(study)?, watch)
        })?;
        Ok(Answer::of(run))
    }

    #[pyo3(signature = (runs, terms=None))]
    fn monte_carlo(
        &self,
        py: Python<'_>,
        runs: usize,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let found = self.ask(py, &terms, |study, watch| {
            lynkeus::monte_carlo(study, runs, watch)
        })?;
        Ok(Answer::of(found))
    }

    /// That it names what its plant has.
    fn refuse_misfits(&self, py: Python<'_>) -> PyResult<()> {
        self.ask(py, &Terms::default(), |study, _| {
            lynkeus::prepare::refuse_misfits(study)
        })
    }

    #[pyo3(signature = (log, terms=None, record=false))]
    fn estimate(
        &self,
        py: Python<'_>,
        log: Given,
        terms: Option<Terms<'_>>,
        record: bool,
    ) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let outcome = self.ask(py, &terms, |study, watch| {
            let study = &lynkeus::Study {
                records: match record {
                    true => Records::All,
                    false => Records::Nothing,
                },
                ..study.clone()
            };
            self.runner.estimate(study, &*log.table(study)?, watch)
        })?;
        Ok(Answer::of(outcome))
    }

    /// How many logs are best estimated together.
    fn side_by_side(&self) -> usize {
        lynkeus::side_by_side(&self.study)
    }

    /// What [`Study::estimate`] gives for each of some logs, or raises.
    #[pyo3(signature = (logs, terms=None))]
    fn estimate_together<'py>(
        &self,
        py: Python<'py>,
        logs: Vec<Given>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let terms = terms.unwrap_or_default();
        let found = self.ask(py, &terms, |study, watch| {
            let tables: Vec<_> = logs.iter().map(|log| log.table(study)).collect();
            let read: Vec<&lynkeus::table::Table> =
                tables.iter().flatten().map(|table| &**table).collect();
            let found = self.runner.estimate_together(study, &read, watch)?;
            let mut found = found.into_iter();
            let each = tables.into_iter().map(|table| {
                table?;
                // one for each that was read
                found
                    .next()
                    .unwrap_or_else(|| Err(Error::input("no result")))
            });
            Ok(each.collect::<Vec<_>>())
        })?;
        let each = found.into_iter().map(|outcome| match outcome {
            Ok(outcome) => Bound::new(py, Answer::of(outcome)).map(Bound::into_any),
            Err(error) => Ok(exception(&error).into_value(py).into_bound(py).into_any()),
        });
        each.collect()
    }

    #[pyo3(signature = (log=None, terms=None))]
    fn tune(
        &self,
        py: Python<'_>,
        log: Option<Given>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let sweep = self.ask(py, &terms, |study, watch| {
            let table = log.as_ref().map(|log| log.table(study)).transpose()?;
            let sweep = lynkeus::tune(study, table.as_deref(), watch)?;
            match sweep.is_empty_handed() {
                true => Err(sweep.refusal().at(&study.file)),
                false => Ok(sweep),
            }
        });
        sweep.map(Answer::of)
    }

    /// The fit, and the study's text with the values found, where nothing speaks against these.
    #[pyo3(signature = (logs, profiles=false, next_experiment=false, terms=None))]
    fn fit(
        &self,
        py: Python<'_>,
        logs: Vec<Given>,
        profiles: bool,
        next_experiment: bool,
        terms: Option<Terms<'_>>,
    ) -> PyResult<(Answer, Option<String>)> {
        let options = FitOptions {
            profiles,
            next_experiment,
        };
        let terms = terms.unwrap_or_default();
        let (fit, text) = self.ask(py, &terms, |study, watch| {
            let tables = tables(&logs, study)?;
            let fit = lynkeus::fit(study, &tables, options, watch)?;
            let text = match lynkeus::Answer::is_positive(&fit) {
                true => Some(fit.rewritten(&self.text)?.0),
                false => None,
            };
            Ok((fit, text))
        })?;
        Ok((Answer::of(fit), text))
    }

    /// What `fit` makes least.
    #[pyo3(signature = (logs, terms=None))]
    fn likelihood(
        &self,
        py: Python<'_>,
        logs: Vec<Given>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Likelihood> {
        let terms = terms.unwrap_or_default();
        self.ask(py, &terms, |study, _| {
            let tables = tables(&logs, study)?;
            let function = lynkeus::likelihood(study, &tables)?;
            Ok(Likelihood::new(function, tables))
        })
    }

    #[pyo3(signature = (log=None, terms=None))]
    fn compare(
        &self,
        py: Python<'_>,
        log: Option<Given>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<Answer> {
        let terms = terms.unwrap_or_default();
        let found = self.ask(py, &terms, |study, watch| {
            let table = log.as_ref().map(|log| log.table(study)).transpose()?;
            lynkeus::compare(study, table.as_deref(), watch)
        })?;
        Ok(Answer::of(found))
    }

    /// The plant as functions, with the study's parameters.
    fn functions(&self, py: Python<'_>) -> PyResult<Functions> {
        self.ask(py, &Terms::default(), |study, _| {
            let plant = lynkeus::prepare::plant(study)?;
            Functions::of_plant(&plant, study.simulate.as_ref())
        })
    }

    /// The observer as functions.
    #[pyo3(signature = (terms=None))]
    fn observer(&self, py: Python<'_>, terms: Option<Terms<'_>>) -> PyResult<Functions> {
        let terms = terms.unwrap_or_default();
        self.ask(py, &terms, |study, _| {
            let plant = lynkeus::prepare::plant(study)?;
            let design = Prepared::new(study, &plant)?.design()?;
            Functions::of_observer(&plant, &design)
        })
    }

    /// Names and contents of files, and what the user should know.
    #[pyo3(signature = (to, precision, fmi, step=None, tunable=false, system=None, terms=None))]
    #[allow(
        clippy::too_many_arguments,
        reason = "the options of a call from Python"
    )]
    fn export<'py>(
        &self,
        py: Python<'py>,
        to: &str,
        precision: &str,
        fmi: &str,
        step: Option<f64>,
        tunable: bool,
        system: Option<&str>,
        terms: Option<Terms<'_>>,
    ) -> PyResult<(Vec<Written<'py>>, Vec<String>)> {
        let options = ExportOptions {
            to: target(to, fmi)?,
            subject: system.map(subject).transpose()?,
            precision: match precision {
                "f64" => Precision::F64,
                "f32" => Precision::F32,
                other => return Err(unknown("precision", "\"f64\" or \"f32\"", other)),
            },
            step,
            tunable,
        };
        let terms = terms.unwrap_or_default();
        let made = self.ask(py, &terms, |study, _| lynkeus::export(study, &options))?;
        let files = made.files.into_iter();
        let files = files.map(|file| (file.name, PyBytes::new(py, &file.bytes)));
        Ok((files.collect(), made.notes))
    }

    /// `study` is what a copy or an unpickled estimator is made of again.
    fn estimator(&self, py: Python<'_>, study: Py<PyAny>, wait: f64) -> PyResult<Estimator> {
        let made = self.ask(py, &Terms::default(), |study, _| {
            lynkeus::late_estimator(study, wait)
        });
        Ok(Estimator::of(py, made?, study))
    }
}

impl Study {
    fn new(study: lynkeus::Study, text: String, runners: Arc<Runners>) -> Self {
        Self {
            runner: runners.of(&study),
            study,
            text,
            runners,
        }
    }

    /// Does something with the study, away from the interpreter.
    fn ask<T: Send>(
        &self,
        py: Python<'_>,
        terms: &Terms<'_>,
        work: impl FnOnce(&lynkeus::Study, &mut Watch<'_>) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        away(py, terms, |budget, watch| {
            let study = lynkeus::Study {
                budget,
                ..self.study.clone()
            };
            work(&study, watch)
        })
    }
}

/// What the study asks for of each log.
fn tables(logs: &[Given], study: &lynkeus::Study) -> Result<Vec<lynkeus::Table>, Error> {
    let tables = logs.iter().map(|log| log.table(study).map(Cow::into_owned));
    tables.collect()
}

/// A file's name and content.
type Written<'py> = (String, Bound<'py, PyBytes>);

fn subject(system: &str) -> PyResult<Subject> {
    match system {
        "estimator" => Ok(Subject::Estimator),
        "plant" => Ok(Subject::Plant),
        "observer" => Ok(Subject::Observer),
        other => Err(unknown(
            "system",
            "\"estimator\", \"plant\" or \"observer\"",
            other,
        )),
    }
}

fn target(to: &str, fmi: &str) -> PyResult<Target> {
    let Some(target) = Target::named(to) else {
        let words: Vec<String> = Target::ALL
            .iter()
            .map(|t| format!("\"{}\"", t.word()))
            .collect();
        let (last, others) = words
            .split_last()
            .map_or(("", &words[..]), |(l, o)| (l.as_str(), o));
        let expected = format!("{} or {last}", others.join(", "));
        return Err(unknown("to", &expected, to));
    };
    Ok(match (target, fmi) {
        (Target::Fmu(_), "3") => Target::Fmu(FmiVersion::Three),
        (Target::Fmu(_), "2") => Target::Fmu(FmiVersion::Two),
        (Target::Fmu(_), other) => return Err(unknown("fmi", "\"3\" or \"2\"", other)),
        (target, _) => target,
    })
}

fn unknown(argument: &str, expected: &str, found: &str) -> PyErr {
    exception(&Error::input(format!(
        "{argument}: expected {expected}, found \"{found}\""
    )))
}
