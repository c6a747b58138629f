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

/// Assets with the same values.
struct Kind {
    /// where they stand first
    line: u64,
    stream: Option<Arc<Stream>>,
}

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
    let Table { parameters, rows } = table(path)?;
    let mut kinds: BTreeMap<Values, Kind> = BTreeMap::new();
    for row in &rows {
        let (line, stream) = (row.line, None);
        let values = row.values.clone();
        kinds.entry(values).or_insert(Kind { line, stream });
    }
    design(study, &parameters, &mut kinds).map_err(|(line, error)| match error.place() {
        Some(_) => error,
        None => error.at(format!("{}:{line}", path.display())),
    })?;
    let of = |row: Row| {
        let stream = kinds.get(&row.values)?.stream.clone()?;
        Some((row.name, stream))
    };
    Ok(rows.into_iter().filter_map(of).collect())
}

/// The table of the assets.
struct Table {
    parameters: Vec<String>,
    rows: Vec<Row>,
}

struct Row {
    name: String,
    values: Values,
    line: u64,
}

fn table(path: &Path) -> Result<Table, Error> {
    let unreadable = |error: csv::Error| {
        Error::input(format!("cannot read the assets: {error}")).at(path.display())
    };
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.trim(csv::Trim::All).from_path(path);
    let mut reader = reader.map_err(unreadable)?;
    let header = reader.headers().map_err(unreadable)?.clone();
    let Some(place) = header.iter().position(|name| name == NAME) else {
        let message = format!("expected a column \"{NAME}\" with the names of the assets");
        return Err(Error::input(message).at(path.display()));
    };
    let mut rows: Vec<Row> = vec![];
    let mut known: HashMap<String, u64> = HashMap::new();
    for record in reader.records() {
        let record = record.map_err(unreadable)?;
        let line = record.position().map_or(0, csv::Position::line);
        let refuse = |text: String| Error::input(text).at(format!("{}:{line}", path.display()));
        let name = record.get(place).unwrap_or_default().to_owned();
        if name.is_empty() {
            return Err(refuse("an asset needs a name".to_owned()));
        }
        if let Some(first) = known.insert(name.clone(), line) {
            let text = format!("the asset \"{name}\" is there in line {first} already");
            return Err(refuse(text));
        }
        let mut values = vec![];
        let cells = header.iter().zip(&record).enumerate();
        for (_, (column, cell)) in cells.filter(|(i, _)| *i != place) {
            let number = cell.parse().ok().filter(|x: &f64| x.is_finite());
            let wrong = || format!("{column} of \"{name}\": expected a number, found \"{cell}\"");
            values.push(number.ok_or_else(|| refuse(wrong()))?.to_bits());
        }
        rows.push(Row { name, values, line });
    }
    if rows.is_empty() {
        let message = "expected an asset in each line, found none";
        return Err(Error::input(message).at(path.display()));
    }
    let parameters = header.iter().enumerate().filter(|(i, _)| *i != place);
    Ok(Table {
        parameters: parameters.map(|(_, name)| name.to_owned()).collect(),
        rows,
    })
}

/// Makes the estimator of each set of parameters, on all processors.
fn design(
    study: &Study,
    parameters: &[String],
    kinds: &mut BTreeMap<Values, Kind>,
) -> Result<(), (u64, Error)> {
    let mut all: Vec<_> = kinds.iter_mut().collect();
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let size = all.len().div_ceil(threads).max(1);
    thread::scope(|scope| {
        let workers = all.chunks_mut(size).map(|part| {
            scope.spawn(move || {
                for (values, kind) in part {
                    let mut own = study.clone();
                    let named = parameters.iter().zip(values.iter());
                    let named = named.map(|(name, x)| (name.clone(), f64::from_bits(*x)));
                    own.parameters.extend(named);
                    let made = Stream::new(&own).map_err(|error| (kind.line, error))?;
                    kind.stream = Some(Arc::new(made));
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
