//! Studies, and what is asked of them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lynkeus::precision::{self, Candidates};
use lynkeus::prepare::Prepared;
use lynkeus::{CheckOptions, Error};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::answer::{Answer, Of, Ran};
use crate::away::{Terms, away};
use crate::errors::exception;
use crate::estimator::Estimator;
use crate::functions::Functions;
use crate::log::Log;

/// A study with the texts that it was made from.
#[pyclass(frozen, module = "lynkeus._lynkeus")]
pub struct Study {
    study: lynkeus::Study,
    text: String,
}

/// The JSON Schema of study files.
#[pyfunction]
pub fn schema() -> String {
    lynkeus::schema().to_string()
}

/// The text of a file, told as `what` where it cannot be read.
fn text_of(path: &Path, what: &str) -> Result<Arc<str>, Error> {
    let text = std::fs::read_to_string(path);
    text.map(Arc::from).map_err(|e| {
        Error::input(format!(
            "cannot read the {what} file {}: {e}",
            path.display()
        ))
    })
}

#[pymethods]
impl Study {
    /// A study file, or a model for which it stands with every output measured; the plant's text
    /// comes along.
    #[staticmethod]
    #[pyo3(signature = (path, model=None))]
    fn load(py: Python<'_>, path: PathBuf, model: Option<String>) -> PyResult<Self> {
        let loaded = py.detach(|| {
            let mut study = lynkeus::Study::load_or_bare(&path, model)?;
            // told where the plant is asked for
            study.plant_text = match &study.plant {
                Some(plant) if plant.is_file() => Some(text_of(plant, "plant")?),
                _ => None,
            };
            let is_model = study.plant.as_deref() == Some(path.as_path());
            let text = match is_model {
                true => String::new(),
                false => text_of(&path, "study")?.to_string(),
            };
            Ok(Self { study, text })
        });
        loaded.map_err(|e| exception(&e))
    }

    /// A study's text; `file` names it in messages. `plant` is the name and the text of the
    /// model where that is no file.
    #[staticmethod]
    #[pyo3(signature = (text, file, plant=None, model=None))]
    fn parse(
        text: String,
        file: &str,
        plant: Option<(PathBuf, String)>,
        model: Option<String>,
    ) -> PyResult<Self> {
        let mut study = lynkeus::Study::parse(&text, file).map_err(|e| exception(&e))?;
        if let Some((name, text)) = plant {
            study.plant = Some(name);
            study.plant_text = Some(text.into());
        }
        study.model = model.or(study.model);
        Ok(Self { study, text })
    }

    #[getter]
    fn file(&self) -> &str {
        &self.study.file
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
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

    #[pyo3(signature = (parameters=false, about=vec![], time_limit=None))]
    fn check(
        &self,
        py: Python<'_>,
        parameters: bool,
        about: Vec<String>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let options = CheckOptions { parameters, about };
        let report = away(py, &self.study, &timed(time_limit), |study, _| {
            lynkeus::check(study, &options)
        });
        report.map(Answer::of)
    }

    #[pyo3(signature = (time_limit=None))]
    fn design(&self, py: Python<'_>, time_limit: Option<f64>) -> PyResult<Answer> {
        let report = away(py, &self.study, &timed(time_limit), |study, _| {
            lynkeus::design(study)
        });
        report.map(Answer::of)
    }

    #[pyo3(signature = (time_limit=None))]
    fn certify(&self, py: Python<'_>, time_limit: Option<f64>) -> PyResult<Answer> {
        let report = away(py, &self.study, &timed(time_limit), |study, _| {
            lynkeus::certify(study)
        });
        report.map(Answer::of)
    }

    #[pyo3(signature = (horizon=None, sensors=None, time_limit=None))]
    fn how_well(
        &self,
        py: Python<'_>,
        horizon: Option<f64>,
        sensors: Option<&str>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let sensors = match sensors {
            None => None,
            Some("outputs") => Some(Candidates::Outputs),
            Some("all") => Some(Candidates::All),
            Some(other) => {
                return Err(PyValueError::new_err(format!(
                    "sensors: expected \"outputs\" or \"all\", found \"{other}\""
                )));
            }
        };
        let options = precision::Options { horizon, sensors };
        let report = away(py, &self.study, &timed(time_limit), |study, _| {
            lynkeus::precision(study, &options)
        });
        report.map(Answer::of)
    }

    #[pyo3(signature = (progress=None, time_limit=None))]
    fn simulate(
        &self,
        py: Python<'_>,
        progress: Option<Bound<'_, PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let terms = Terms {
            time_limit,
            progress,
        };
        let outcome = away(py, &self.study, &terms, |study, watch| {
            lynkeus::simulate(study, watch)
        })?;
        Ok(self.ran(outcome, true))
    }

    #[pyo3(signature = (runs, progress=None, time_limit=None))]
    fn monte_carlo(
        &self,
        py: Python<'_>,
        runs: usize,
        progress: Option<Bound<'_, PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let terms = Terms {
            time_limit,
            progress,
        };
        let found = away(py, &self.study, &terms, |study, watch| {
            lynkeus::monte_carlo(study, runs, watch)
        })?;
        Ok(Answer::of(self.of(found)))
    }

    #[pyo3(signature = (log, progress=None, time_limit=None))]
    fn estimate(
        &self,
        py: Python<'_>,
        log: &Log,
        progress: Option<Bound<'_, PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let terms = Terms {
            time_limit,
            progress,
        };
        let outcome = away(py, &self.study, &terms, |study, watch| {
            lynkeus::estimate(study, &log.table, watch)
        })?;
        Ok(self.ran(outcome, false))
    }

    #[pyo3(signature = (log=None, progress=None, time_limit=None))]
    fn tune(
        &self,
        py: Python<'_>,
        log: Option<&Log>,
        progress: Option<Bound<'_, PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let terms = Terms {
            time_limit,
            progress,
        };
        let sweep = away(py, &self.study, &terms, |study, watch| {
            let sweep = lynkeus::tune(study, log.map(|log| &log.table), watch)?;
            match sweep.is_empty_handed() {
                true => Err(sweep.refusal().at(&study.file)),
                false => Ok(sweep),
            }
        });
        sweep.map(Answer::of)
    }

    #[pyo3(signature = (log=None, progress=None, time_limit=None))]
    fn compare(
        &self,
        py: Python<'_>,
        log: Option<&Log>,
        progress: Option<Bound<'_, PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<Answer> {
        let terms = Terms {
            time_limit,
            progress,
        };
        let found = away(py, &self.study, &terms, |study, watch| {
            lynkeus::compare(study, log.map(|log| &log.table), watch)
        })?;
        Ok(Answer::of(self.of(found)))
    }

    /// The plant as functions, with the study's parameters.
    fn functions(&self, py: Python<'_>) -> PyResult<Functions> {
        let plant = away(py, &self.study, &Terms::default(), |study, _| {
            lynkeus::prepare::plant(study)
        });
        Functions::of_plant(&plant?, self.study.simulate.as_ref())
    }

    /// The observer as functions.
    #[pyo3(signature = (time_limit=None))]
    fn observer(&self, py: Python<'_>, time_limit: Option<f64>) -> PyResult<Functions> {
        let made = away(py, &self.study, &timed(time_limit), |study, _| {
            let plant = lynkeus::prepare::plant(study)?;
            let design = Prepared::new(study, &plant)?.design()?;
            Ok((plant, design.observer))
        });
        let (plant, observer) = made?;
        Functions::of_observer(&plant, &observer)
    }

    /// `study` is what a copy or an unpickled estimator is made of again.
    fn estimator(&self, py: Python<'_>, study: Py<PyAny>) -> PyResult<Estimator> {
        let made = away(py, &self.study, &Terms::default(), |study, _| {
            lynkeus::estimator(study)
        });
        Ok(Estimator::of(py, made?, study))
    }
}

impl Study {
    fn ran(&self, outcome: lynkeus::Outcome, is_simulated: bool) -> Answer {
        Answer::of(Ran {
            outcome,
            study: self.study.clone(),
            is_simulated,
        })
    }

    fn of<T>(&self, found: T) -> Of<T> {
        Of {
            found,
            study: self.study.clone(),
        }
    }
}

fn timed<'py>(time_limit: Option<f64>) -> Terms<'py> {
    Terms {
        time_limit,
        progress: None,
    }
}
