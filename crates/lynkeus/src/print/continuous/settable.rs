//! Which parameters of a plant can be symbols, to be set while it runs.

use std::collections::BTreeSet;

use lynkeus_model::{Plant, Variable};

use crate::{Error, Study};
use lynkeus_experiment::prepare;

/// How many parameters are looked for that cannot be symbols, before all are numbers.
const MOST: usize = 8;

/// Names that are told one by one.
const NAMED: usize = 8;

/// What is made of a plant with as many parameters as possible as symbols.
pub(super) struct Settled<T> {
    pub made: T,
    /// which are numbers, and why
    pub notes: Vec<String>,
}

/// Makes something of the plant of a study, `valued` where all parameters are numbers: with all of them as
/// symbols, else without those that, as symbols, change what the plant is or cannot be made.
///
/// # Errors
/// What cannot be made of numbers either.
pub(super) fn settled<T>(
    study: &Study,
    valued: &Plant,
    make: impl Fn(&Plant) -> Result<T, Error>,
) -> Result<Settled<T>, Error> {
    let search = Search {
        study,
        valued,
        make: &make,
        names: valued
            .parameters
            .iter()
            .map(|p| p.variable.name.as_str())
            .collect(),
    };
    let mut notes = vec![];
    let mut numbers = BTreeSet::new();
    let mut sound = 0;
    let mut why = match search.tried(&numbers) {
        Ok(tried) => return Ok(tried.settled(notes)),
        Err(why) => why,
    };
    let plain = make(valued)?;
    while notes.len() < MOST {
        search.unspent()?;
        let Culprit { place, why: single } = search.culprit(&numbers, sound, why.clone())?;
        let Some(name) = search.names.get(place) else {
            break;
        };
        notes.push(format!(
            "{name} is a number, not to be set: as a symbol it meets this: {}",
            single.message()
        ));
        numbers.insert((*name).to_owned());
        sound = place + 1;
        why = match search.tried(&numbers) {
            Ok(tried) => return Ok(tried.settled(notes)),
            Err(why) => why,
        };
    }
    Ok(Settled {
        made: plain,
        notes: vec![format!("parameters are numbers: {}", why.message())],
    })
}

/// What was made of a plant, and the parameters that are points of its tables.
struct Tried<T> {
    made: T,
    points: BTreeSet<String>,
}

impl<T> Tried<T> {
    fn settled(self, mut notes: Vec<String>) -> Settled<T> {
        if !self.points.is_empty() {
            let named: Vec<&str> = self.points.iter().map(String::as_str).take(NAMED).collect();
            let more = match self.points.len() - named.len() {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            notes.push(format!(
                "points of tables are numbers, not to be set, so that they increase: {}{more}",
                named.join(", ")
            ));
        }
        Settled {
            made: self.made,
            notes,
        }
    }
}

/// A parameter that cannot be a symbol beside those before it.
struct Culprit {
    place: usize,
    why: Error,
}

struct Search<'a, T> {
    study: &'a Study,
    valued: &'a Plant,
    make: &'a dyn Fn(&Plant) -> Result<T, Error>,
    /// of the parameters
    names: Vec<&'a str>,
}

impl<T> Search<'_, T> {
    /// With all parameters as symbols but these and the points of tables.
    ///
    /// # Errors
    /// Why that is not possible.
    fn tried(&self, numbers: &BTreeSet<String>) -> Result<Tried<T>, Error> {
        let mut points = BTreeSet::new();
        loop {
            let but = numbers.union(&points).cloned().collect();
            let mut plant = prepare::symbolic_plant(self.study, but)?;
            let found = plant.parameters.iter().map(|p| &p.variable);
            let found = found.filter(|p| plant.table_points.contains(&p.node));
            let found: Vec<String> = found.map(|p| p.name.clone()).collect();
            if found.is_empty() {
                self.same(&mut plant)?;
                let made = (self.make)(&plant)?;
                return Ok(Tried { made, points });
            }
            points.extend(found);
        }
    }

    /// Symbols may not change what the plant is. Where its states start is known from the numbers.
    fn same(&self, plant: &mut Plant) -> Result<(), Error> {
        let names = |variables: &[Variable]| -> Vec<String> {
            variables.iter().map(|v| v.name.clone()).collect()
        };
        let all = |plant: &Plant| [&plant.states, &plant.inputs, &plant.outputs].map(|v| names(v));
        let (own, known) = (all(plant), all(self.valued));
        if own == known {
            for (state, known) in plant.states.iter_mut().zip(&self.valued.states) {
                state.start = known.start;
            }
            return Ok(());
        }
        let without = |some: &[String], others: &[String]| {
            let left = some.iter().filter(|name| !others.contains(name));
            left.cloned().collect::<Vec<_>>().join(", ")
        };
        let (more, less) = (without(&own[0], &known[0]), without(&known[0], &own[0]));
        Err(Error::refused(match (more.is_empty(), less.is_empty()) {
            (true, true) => "variables come in another order".to_owned(),
            (true, false) => format!("{less} would be no state"),
            (false, true) => format!("{more} would be a state"),
            (false, false) => format!("{more} would be a state instead of {less}"),
        }))
    }

    /// # Errors
    /// Time or memory ended, which is no parameter's fault.
    fn unspent(&self) -> Result<(), Error> {
        match self.study.budget.marked() {
            Some(spent) => Err(Error::ended(spent).at(&self.study.file)),
            None => Ok(()),
        }
    }

    /// By halves: the first parameter that cannot be a symbol, where the first `sound` can and all cannot.
    ///
    /// # Errors
    /// Time or memory ended.
    fn culprit(
        &self,
        numbers: &BTreeSet<String>,
        sound: usize,
        why: Error,
    ) -> Result<Culprit, Error> {
        let (mut low, mut high, mut why) = (sound, self.names.len(), why);
        while high - low > 1 {
            let middle = low.midpoint(high);
            let after = self.names[middle..].iter().map(|name| (*name).to_owned());
            match self.tried(&numbers.iter().cloned().chain(after).collect()) {
                Ok(_) => low = middle,
                Err(error) => (high, why) = (middle, error),
            }
            self.unspent()?;
        }
        Ok(Culprit { place: low, why })
    }
}
