//! `generator` of `[estimate]`: what makes a known input.

use lynkeus_observers::Pole;

use super::keys::{GENERATOR, PAIR};
use super::section::Entry;
use super::simulate::{Expression, expression};
use lynkeus_answer::Error;

/// What makes a known input, and so gives its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub enum Generator {
    /// An expression of time.
    Time(Expression),
    /// A filter of gain one, from a command that is logged.
    Prefilter {
        /// Its poles.
        poles: Vec<Pole>,
        /// u, u', … where it starts; `None` for the input's start value.
        initial: Option<Vec<f64>>,
        /// The header of the command; `None` is `<input>_command`.
        command: Option<String>,
    },
}

pub(super) fn read(entry: Entry<'_>) -> Result<Generator, Error> {
    if !entry.is_table() {
        return Ok(Generator::Time(expression(entry)?));
    }
    let missing = entry.wrong("an expression of time, or a filter { poles = […] }");
    let mut section = entry.section("generator of [estimate]", &GENERATOR)?;
    let poles = section.take("poles").ok_or(missing)?;
    Ok(Generator::Prefilter {
        poles: one_or_more(poles, pole)?,
        initial: section.optional("initial", |e| one_or_more(e, Entry::number))?,
        command: section.optional("command", Entry::name)?.map(|n| n.text),
    })
}

fn one_or_more<'a, T>(
    entry: Entry<'a>,
    read: impl Fn(Entry<'a>) -> Result<T, Error>,
) -> Result<Vec<T>, Error> {
    match entry.is_list() {
        true => entry.list()?.into_iter().map(read).collect(),
        false => Ok(vec![read(entry)?]),
    }
}

/// A negative number, or a conjugate pair with a negative real part.
fn pole(entry: Entry<'_>) -> Result<Pole, Error> {
    if !entry.is_table() {
        return Ok(Pole::Real(negative(entry)?));
    }
    let missing = entry.wrong("a conjugate pair { re = number < 0, im = number }");
    let mut section = entry.section("a pole", &PAIR)?;
    match (section.take("re"), section.take("im")) {
        (Some(re), Some(im)) => Ok(Pole::Pair {
            re: negative(re)?,
            im: im.number()?,
        }),
        _ => Err(missing),
    }
}

fn negative(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a number < 0: the filter is stable");
    entry.number().ok().filter(|x| *x < 0.0).ok_or(refusal)
}
