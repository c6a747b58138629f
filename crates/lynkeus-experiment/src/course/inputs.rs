//! Where an observer that runs on samples has its known inputs, and derivatives of them, from.

use lynkeus_observers::{Design, Generator, InputDerivative, Signal};

use crate::course::columns::{Log, held};
use crate::near::suggest;
use crate::prepare::Prepared;
use crate::prepare::headers::{command, header};
use crate::{Error, Series, Study, prepare::systems};
use lynkeus_study::{self, Name};

/// What a known input of an observer reads.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// the plant's input of this place
    Input(usize),
    /// a column of this header
    Column(String),
}

/// Whether these are the plant's inputs, no more and no less, all in the log.
pub(crate) fn are_logged(prepared: &Prepared<'_>, sources: &[Source]) -> bool {
    let own = (0..prepared.augmented().inputs.len()).map(Source::Input);
    prepared.study().estimate.generator.is_empty() && sources.iter().cloned().eq(own)
}

/// Lets an observer have derivatives of inputs from where the study says; returns what each of its
/// inputs reads.
///
/// # Errors
/// A derivative of which the study says nothing; a generator that does not give it.
pub(crate) fn supplied(prepared: &Prepared<'_>, design: &mut Design) -> Result<Vec<Source>, Error> {
    let sources = generated(prepared, design)?;
    refuse_derivatives(prepared.study(), design, |needed| {
        column(prepared.study(), needed).is_none()
    })?;
    Ok(with_derivatives(prepared.study(), design, sources))
}

/// The same for a device: a derivative of which the study says nothing is a signal under its own name.
///
/// # Errors
/// A generator that does not give what is read.
pub fn on_device(prepared: &Prepared<'_>, design: &mut Design) -> Result<(), Error> {
    let sources = generated(prepared, design)?;
    with_derivatives(prepared.study(), design, sources);
    Ok(())
}

/// Derivatives of inputs as further inputs, called like their columns.
fn with_derivatives(study: &Study, design: &mut Design, mut sources: Vec<Source>) -> Vec<Source> {
    let needed = std::mem::take(&mut design.observer.input_derivatives);
    for derivative in needed {
        let own = column(study, &derivative).cloned();
        let name = own.unwrap_or(derivative.signal.name);
        sources.push(Source::Column(name.clone()));
        let symbol = derivative.signal.symbol;
        design.observer.inputs.push(Signal { name, symbol });
    }
    sources
}

/// Lets inputs of which derivatives are read come from their generators.
fn generated(prepared: &Prepared<'_>, design: &mut Design) -> Result<Vec<Source>, Error> {
    let settings = &prepared.study().estimate;
    refuse_strays(prepared)?;
    let mut sources: Vec<Source> = (0..design.observer.inputs.len())
        .map(Source::Input)
        .collect();
    let observer = &mut design.observer;
    for (name, given) in &settings.generator {
        let mut needed = observer.input_derivatives.iter();
        let place = observer.inputs.iter().position(|u| u.name == name.text);
        let (Some(place), true) = (place, needed.any(|d| d.input == name.text)) else {
            continue;
        };
        let generator = generator(prepared, name, given)?;
        observer
            .generate(prepared.augmented().graph(), &name.text, &generator)
            .map_err(|error| name.blame(Error::input(error.to_string())))?;
        match generator {
            Generator::Time(_) => drop(sources.remove(place)),
            Generator::Prefilter { command, .. } => sources[place] = Source::Column(command),
        }
    }
    Ok(sources)
}

/// A generator as the study gives it.
fn generator(
    prepared: &Prepared<'_>,
    name: &Name,
    given: &lynkeus_study::Generator,
) -> Result<Generator, Error> {
    match given {
        lynkeus_study::Generator::Time(u) => {
            Ok(Generator::Time(systems::expression(prepared.plant(), u)?))
        }
        lynkeus_study::Generator::Prefilter { poles, initial, .. } => {
            let mut inputs = prepared.augmented().inputs.iter();
            let start = inputs.find(|u| u.name == name.text).and_then(|u| u.start);
            let initial = initial.clone();
            Ok(Generator::Prefilter {
                poles: poles.clone(),
                start: initial.unwrap_or_else(|| start.into_iter().collect()),
                command: command(name, given).unwrap_or_default(),
            })
        }
    }
}
/// The header under which the study has a derivative.
fn column<'s>(study: &'s Study, needed: &InputDerivative) -> Option<&'s String> {
    let given = study.estimate.input_derivatives.iter();
    let mut own = given.filter(|(name, _)| name.text == needed.input);
    own.next()?.1.get(needed.order - 1)
}

/// Columns of derivatives, or generators, of what is no known input.
pub(crate) fn refuse_strays(prepared: &Prepared<'_>) -> Result<(), Error> {
    let settings = &prepared.study().estimate;
    let inputs = &prepared.augmented().inputs;
    let columns = settings.input_derivatives.iter();
    let columns = columns.map(|(name, _)| ("input_derivatives", name));
    let generators = settings.generator.iter();
    let mut given = columns.chain(generators.map(|(name, _)| ("generator", name)));
    let stray = given.find(|(_, name)| !inputs.iter().any(|input| input.name == name.text));
    let Some((key, name)) = stray else {
        return Ok(());
    };
    let names = inputs.iter().map(|input| input.name.as_str());
    let message = format!("{key} of [estimate]: no known input is called \"{name}\"");
    Err(name.blame(Error::input(message).hint(suggest(&name.text, names))))
}

/// Samples have no derivatives of the inputs, unless the study says where they stand.
pub(crate) fn refuse_derivatives(
    study: &Study,
    design: &Design,
    lacks: impl Fn(&InputDerivative) -> bool,
) -> Result<(), Error> {
    let mut needed = design.observer.input_derivatives.iter();
    let Some(needed) = needed.find(|needed| lacks(needed)) else {
        return Ok(());
    };
    let u = &needed.input;
    Err(Error::input(format!(
        "this observer reads {}, the derivative of order {} of the input \"{u}\", and nothing says where it stands",
        needed.signal.name, needed.order
    ))
    .at(&study.file)
    .hint(format!(
        "for a log, name its columns: input_derivatives = {{ {u} = [\"…\"] }} under [estimate], one per order (they are never differences of samples); or say what makes the input: generator = {{ {u} = {{ poles = […] }} }}, a filter from the column {u}_command, or an expression of time; or set variant = \"practical\" in [observer], which estimates it"
    )))
}

impl Log<'_> {
    /// The inputs as an observer reads them.
    ///
    /// # Errors
    /// Columns that the log does not have, or not as numbers.
    pub fn inputs(
        &self,
        prepared: &Prepared<'_>,
        sources: &[Source],
    ) -> Result<Vec<Series>, Error> {
        let settings = &prepared.study().estimate;
        let known = &prepared.augmented().inputs;
        let own = sources.iter().map(|source| {
            let header = match source {
                Source::Input(place) => header(settings, &known[*place].name),
                Source::Column(header) => header,
            };
            let column = held(&self.table, settings, header)?;
            Ok(self.held(&column))
        });
        own.collect()
    }
}
