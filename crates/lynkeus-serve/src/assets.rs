//! Many plants of one study: their names, and the parameters that differ.

use std::collections::{BTreeMap, HashMap};
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::thread;

use lynkeus::stream::Stream;
use lynkeus::{Error, Study};

/// The names of assets are in this column.
const NAME: &str = "asset";

/// An asset by its name, and its study.
pub type Named = (String, Arc<Stream>);

/// Values of parameters, by their bits.
type Values = Vec<u64>;

/// The assets of a study: those of the table that its `[serve]` names, or one without a name.
///
/// # Errors
/// As [`Stream::new`]; a table that cannot be read, a name that is empty or there twice, a cell that is no number.
pub fn assets(study: &Study) -> Result<Vec<Named>, Error> {
    match &study.serve.assets {
        None => Ok(vec![(String::new(), Arc::new(Stream::new(study)?))]),
        Some(path) => read(study, path),
    }
}

fn read(study: &Study, path: &Path) -> Result<Vec<Named>, Error> {
    let unreadable = |error: csv::Error| {
        Error::input(format!("cannot read the assets: {error}")).at(path.display())
    };
    let mut table = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(unreadable)?;
    let header = table.headers().map_err(unreadable)?.clone();
    let Some(place) = header.iter().position(|name| name == NAME) else {
        return Err(Error::input(format!(
            "expected a column \"{NAME}\" with the names of the assets"
        ))
        .at(path.display()));
    };
    let mut rows: Vec<(String, Values, u64)> = vec![];
    let mut known: HashMap<String, u64> = HashMap::new();
    for record in table.records() {
        let record = record.map_err(unreadable)?;
        let line = record.position().map_or(0, csv::Position::line);
        let refuse = |text: String| Error::input(text).at(format!("{}:{line}", path.display()));
        let name = record.get(place).unwrap_or_default();
        if name.is_empty() {
            return Err(refuse("an asset needs a name".to_owned()));
        }
        if let Some(first) = known.insert(name.to_owned(), line) {
            return Err(refuse(format!(
                "the asset \"{name}\" is there in line {first} already"
            )));
        }
        let mut values = vec![];
        for (column, cell) in header
            .iter()
            .zip(&record)
            .enumerate()
            .filter(|(i, _)| *i != place)
            .map(|(_, c)| c)
        {
            let number = cell.parse().ok().filter(|x: &f64| x.is_finite());
            let wrong = || {
                refuse(format!(
                    "{column} of \"{name}\": expected a number, found \"{cell}\""
                ))
            };
            values.push(number.ok_or_else(wrong)?.to_bits());
        }
        rows.push((name.to_owned(), values, line));
    }
    if rows.is_empty() {
        return Err(Error::input("expected an asset in each line, found none").at(path.display()));
    }
    let parameters = header.iter().enumerate().filter(|(i, _)| *i != place);
    let parameters: Vec<&str> = parameters.map(|(_, name)| name).collect();
    let mut kinds: BTreeMap<Values, (u64, Option<Arc<Stream>>)> = BTreeMap::new();
    for (_, values, line) in &rows {
        kinds.entry(values.clone()).or_insert((*line, None));
    }
    design(study, &parameters, &mut kinds).map_err(|(line, error)| {
        let place = format!("{}:{line}", path.display());
        match error.place() {
            Some(_) => error,
            None => error.at(place),
        }
    })?;
    let of = |(name, values, _): (String, Values, u64)| {
        let stream = kinds.get(&values).and_then(|(_, stream)| stream.clone())?;
        Some((name, stream))
    };
    Ok(rows.into_iter().filter_map(of).collect())
}

/// Makes the estimator of each set of parameters, on all processors.
fn design(
    study: &Study,
    parameters: &[&str],
    kinds: &mut BTreeMap<Values, (u64, Option<Arc<Stream>>)>,
) -> Result<(), (u64, Error)> {
    let mut all: Vec<_> = kinds.iter_mut().collect();
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let size = all.len().div_ceil(threads).max(1);
    thread::scope(|scope| {
        let workers = all.chunks_mut(size).map(|part| {
            scope.spawn(move || {
                for (values, (line, stream)) in part {
                    let mut own = study.clone();
                    let named = parameters.iter().zip(values.iter());
                    let named = named.map(|(name, x)| ((*name).to_owned(), f64::from_bits(*x)));
                    own.parameters.extend(named);
                    *stream = Some(Arc::new(Stream::new(&own).map_err(|error| (*line, error))?));
                }
                Ok(())
            })
        });
        let workers: Vec<_> = workers.collect();
        workers.into_iter().try_for_each(|worker| {
            let failed = |_| Err((0, Error::input("the design of an asset failed")));
            worker.join().unwrap_or_else(failed)
        })
    })
}
