//! From a study to its plant and its observer.

mod bias;
pub mod calibrate;
pub mod choice;
pub mod correction;
pub mod declared;
mod dials;
pub mod headers;
pub mod manifold;
pub(crate) mod mentioned;
pub mod modes;
pub(crate) mod spread;
pub mod systems;
pub mod whens;

use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::ops::{Deref, DerefMut};
use std::time::Duration;

use lynkeus_expr::{Budget, Spent};
use lynkeus_model::{Home, LoadError, LoadOptions, Plant, Variable};
pub use lynkeus_observers::is_certified_gain;
use lynkeus_observers::{Design, DesignError, Examination, Family, Tuning};
use lynkeus_structure::{AugmentedPlant, Dimension, Region, Sensors, SensorsError, range};
use lynkeus_words::Words;

use crate::prepare::choice::Choice;
use crate::prepare::declared::Declared;
use crate::prepare::mentioned::{refuse_strangers, refuse_unknown_states};
use crate::words::explain;
use crate::{Error, Study};
use lynkeus_study::Name;

/// The plant of a study, with the study's parameters.
///
/// # Errors
/// No plant, a file that cannot be read, a model that is refused, or a name in the study that the plant does not have.
pub fn plant(study: &Study) -> Result<Plant, Error> {
    let plant = load(study, None)?;
    refuse_unknown_states(study, &plant)?;
    let plant = match calibrate::are_asked(study, &plant) {
        true => calibrate::as_states(study, load(study, Some(BTreeSet::new()))?, true)?,
        false => plant,
    };
    let plant = bias::added(study, plant)?;
    let plant = manifold::placed(study, plant)?;
    refuse_strangers(study, &plant)?;
    Ok(plant)
}

/// That a study names what its plant has. Parameters may have no value yet.
///
/// # Errors
/// As [`plant`] and [`Prepared::new`].
pub fn refuse_misfits(study: &Study) -> Result<(), Error> {
    match plant(study) {
        Ok(plant) => Prepared::new(study, &plant).map(drop),
        Err(error) => match symbolic_plant(study, BTreeSet::new()) {
            Ok(_) => Ok(()),
            Err(_) => Err(error),
        },
    }
}

/// The plant with its parameters as symbols, also those without value, but for those that are to be `numbers`.
///
/// # Errors
/// As [`plant`].
pub fn symbolic_plant(study: &Study, numbers: BTreeSet<String>) -> Result<Plant, Error> {
    let plant = load(study, Some(numbers))?;
    refuse_unknown_states(study, &plant)?;
    let plant = match calibrate::are_asked(study, &plant) {
        true => calibrate::as_states(study, plant, false)?,
        false => plant,
    };
    let plant = bias::added(study, plant)?;
    let plant = manifold::placed(study, plant)?;
    refuse_strangers(study, &plant)?;
    Ok(plant)
}

/// With the parameters as numbers, or as symbols but for those that are to be numbers.
fn load(study: &Study, symbols_but: Option<BTreeSet<String>>) -> Result<Plant, Error> {
    let Some(path) = &study.plant else {
        let message = "the study names no plant: expected `plant = \"FILE.mo\"`";
        return Err(Error::input(message).at(&study.file));
    };
    let options = LoadOptions {
        model: study.model.clone(),
        parameters: study.parameters.clone(),
        symbolic_parameters: symbols_but.is_some(),
        numbers: symbols_but.unwrap_or_default(),
        tables: study.tables,
        delay_states: study.delay_states,
        budget: study.budget.clone(),
    };
    let plant = match &study.plant_text {
        Some(text) => {
            let name = path.display().to_string();
            Plant::from_text(text, &name, &options).map_err(LoadError::from)
        }
        None => {
            lynkeus_table::files::must_exist(path, "plant", &study.file)?;
            Plant::load(path, &options)
        }
    };
    if let Some(spent) = study.budget.marked() {
        return Err(Error::ended(spent).at(path.display()));
    }
    plant.map_err(|error| match error {
        LoadError::Refused(diagnostic) => explain(diagnostic),
        other => explain(other),
    })
}

/// Who measures what, as the study says.
pub fn sensors(study: &Study, plant: &Plant) -> Sensors {
    let measured = study.sensors.measured.as_deref().unwrap_or_default();
    Sensors {
        measured: Name::meant(measured, &plant.outputs),
        unknown: calibrate::unknown_inputs(study, plant),
        disturbances: Name::meant(&study.sensors.disturbances, &plant.inputs),
    }
}

/// The plant as these sensors see it, on the study's box.
///
/// # Errors
/// Names among the sensors or in `[box]` that the plant does not have.
pub fn seen_by<'a>(
    study: &Study,
    plant: &'a Plant,
    sensors: &Sensors,
) -> Result<AugmentedPlant<'a>, Error> {
    let mut augmented = AugmentedPlant::new(plant, sensors).map_err(|error| blame(study, error))?;
    // the turn in which an angle is shown
    let is_turn = |name: &Name| {
        let mut states = plant.states.iter();
        let is_circle = |s: &Variable| matches!(s.home, Home::Circle { .. });
        states.any(|state| name.text == state.name && is_circle(state))
    };
    let narrower = study.narrower.iter();
    for (name, low, high) in narrower.filter(|(name, ..)| !is_turn(name)) {
        augmented
            .narrow(&name.text, *low, *high)
            .map_err(|error| name.blame(explain(error)))?;
    }
    tube(study, &mut augmented)?;
    Ok(augmented)
}

/// A study with its plant as the observer sees it, and what the families find in it: made
/// once, used by every command.
#[derive(Debug)]
pub struct Prepared<'a> {
    study: &'a Study,
    declared: Declared,
    augmented: AugmentedPlant<'a>,
    /// made when first asked for
    examinations: OnceCell<Vec<Examination>>,
    /// the same
    choice: OnceCell<Option<Choice>>,
    /// the first observer whose gain is certified, and its tuning: a search for each who asks would take long
    certified: OnceCell<(Tuning, Design)>,
}

/// The observer of a study.
#[derive(Clone, Debug)]
pub struct StudyDesign {
    design: Design,
    /// what its reader should know: what the family notes of it, how it was chosen, and where it starts
    pub notes: Vec<String>,
}

impl Deref for StudyDesign {
    type Target = Design;

    fn deref(&self) -> &Design {
        &self.design
    }
}

impl DerefMut for StudyDesign {
    fn deref_mut(&mut self) -> &mut Design {
        &mut self.design
    }
}

/// Sides of a smaller box: name, least and greatest value.
pub(crate) type Sides = [(String, f64, f64)];

impl<'a> Prepared<'a> {
    /// Applies the study's sensors, `[box]` and tube to its plant.
    ///
    /// # Errors
    /// Names among the sensors, in `[box]` or of anything else declared that the plant does not have.
    pub fn new(study: &'a Study, plant: &'a Plant) -> Result<Self, Error> {
        let mut augmented = seen_by(study, plant, &sensors(study, plant))?;
        let declared = Declared::new(study, plant)?;
        dials::refuse_ends(study, &declared, &augmented)?;
        let bounds = |input: &Variable| declared.input_derivatives.of(&input.name);
        augmented.input_derivatives = augmented
            .inputs
            .iter()
            .map(|u| bounds(u).cloned().unwrap_or_default())
            .collect();
        Ok(Self {
            study,
            declared,
            augmented,
            examinations: OnceCell::new(),
            choice: OnceCell::new(),
            certified: OnceCell::new(),
        })
    }

    /// The study.
    pub fn study(&self) -> &'a Study {
        self.study
    }

    /// What the study declares.
    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    /// The plant.
    pub fn plant(&self) -> &'a Plant {
        self.augmented.plant
    }

    /// The plant as the observer sees it.
    pub fn augmented(&self) -> &AugmentedPlant<'a> {
        &self.augmented
    }

    /// The same plant with another study, which differs in nothing else that was prepared than the numbers
    /// that it declares.
    ///
    /// # Errors
    /// Declared names that the plant does not have.
    pub fn with_study<'b>(&self, study: &'b Study) -> Result<Prepared<'b>, Error>
    where
        'a: 'b,
    {
        Ok(Prepared {
            study,
            declared: Declared::new(study, self.plant())?,
            augmented: self.augmented.clone(),
            examinations: OnceCell::new(),
            choice: OnceCell::new(),
            certified: OnceCell::new(),
        })
    }

    /// The same with another way of running what was designed: families are not asked again.
    ///
    /// # Errors
    /// As [`Prepared::with_study`].
    pub fn run_by<'b>(&self, study: &'b Study) -> Result<Prepared<'b>, Error>
    where
        'a: 'b,
    {
        Ok(Prepared {
            examinations: self.examinations.clone(),
            choice: self.choice.clone(),
            ..self.with_study(study)?
        })
    }

    /// What every family that the study allows finds in the plant.
    ///
    /// # Errors
    /// Keys of `[observer]` that cannot be used.
    pub fn examinations(&self) -> Result<&[Examination], Error> {
        if let Some(known) = self.examinations.get() {
            return Ok(known);
        }
        let mut families: Vec<_> = self.study.observer.families().collect();
        if !self.plant().whens.is_empty() {
            families.retain(|family| family.follows_jumps());
            if families.is_empty() {
                return Err(whens::no_family(self.study, self.plant()));
            }
        }
        let mut found = vec![];
        for (done, family) in families.iter().enumerate() {
            found.push(self.examined(*family, families.len() - done)?);
        }
        Ok(self.examinations.get_or_init(|| found))
    }

    /// What one family finds, of `left` that are still to come, in its share of the time.
    fn examined(&self, family: &'static dyn Family, left: usize) -> Result<Examination, Error> {
        let graph = self.augmented.graph();
        let whole = graph.budget();
        // the rest of the work needs a share as well
        graph.set_budget(share(&whole, 1.0 / (left + 1) as f64));
        let found = family.examine(&self.augmented, &self.study.observer.tuning);
        graph.set_budget(whole);
        found.map_err(|error| self.refusal(error))
    }

    /// The observer of the study.
    ///
    /// # Errors
    /// No family fits ([`ErrorKind::Refused`](crate::ErrorKind)), or a key of
    /// `[observer]` cannot be used.
    pub fn design(&self) -> Result<StudyDesign, Error> {
        self.design_with(&self.study.observer.tuning)
    }

    /// Where the decision is kept once it is made.
    pub(crate) fn chosen(&self) -> &OnceCell<Option<Choice>> {
        &self.choice
    }

    /// The tuning of the study, with what is proposed.
    ///
    /// # Errors
    /// As [`Prepared::choice`].
    pub fn tuning(&self) -> Result<Tuning, Error> {
        let given = &self.study.observer.tuning;
        let choice = self.choice()?;
        Ok(choice.map_or_else(|| given.clone(), |choice| choice.completed(given)))
    }

    /// The same with another tuning.
    pub fn design_with(&self, tuning: &Tuning) -> Result<StudyDesign, Error> {
        let examinations = self.examinations()?;
        let Some(choice) = self.choice()? else {
            return Err(none_fits(self.study, examinations));
        };
        // where nothing is left, another observer than the study's would be made in its place
        if let (Some(_), Some(spent)) = (choice.ended, self.study.budget.spent()) {
            return Err(limited(self.study, spent));
        }
        let design = self.made(choice, tuning)?;
        let mut notes: Vec<String> = design.notes.iter().map(Words::words).collect();
        notes.extend(choice.notes());
        Ok(StudyDesign { design, notes })
    }

    fn made(&self, choice: &Choice, tuning: &Tuning) -> Result<Design, Error> {
        if let Some(design) = &choice.design
            && *tuning == self.study.observer.tuning
            && !is_certified_gain(tuning)
        {
            return Ok(design.clone());
        }
        if let Some((_, design)) = self.certified.get().filter(|(of, _)| of == tuning) {
            return Ok(design.clone());
        }
        let mut tuned = choice.completed(tuning);
        // a certified gain holds for the known inputs as the study simulates them
        let simulated = match is_certified_gain(tuning) {
            true => {
                let place = self.narrowed(&self.simulated_inputs()?)?;
                tuned.noise = declared::deviations(&self.declared, &place)?;
                Some(place)
            }
            false => None,
        };
        let place = simulated.as_ref().unwrap_or(&self.augmented);
        let design = choice.family.design(place, &tuned);
        let design = design.map_err(|error| self.refusal(error))?;
        if simulated.is_some() {
            self.certified
                .get_or_init(|| (tuning.clone(), design.clone()));
        }
        Ok(design)
    }

    /// The plant on a smaller box.
    ///
    /// # Errors
    /// Sides that the box does not have, or that have nothing in common with it.
    pub fn narrowed(&self, sides: &Sides) -> Result<AugmentedPlant<'a>, Error> {
        let mut narrowed = self.augmented.clone();
        for (name, low, high) in sides {
            let narrow = narrowed.narrow(name, *low, *high);
            narrow.map_err(|error| explain(error).at(&self.study.file))?;
        }
        Ok(narrowed)
    }

    /// Ranges of the known inputs over the simulated time where these are narrower than
    /// the declared ones; a range in `[box]` is the user's own choice and stays.
    pub fn simulated_inputs(&self) -> Result<Vec<(String, f64, f64)>, Error> {
        let Some(settings) = &self.study.simulate else {
            return Ok(vec![]);
        };
        let plant = self.plant();
        let (start, until) = (settings.start, settings.until);
        let region = Region {
            dimensions: vec![Dimension::new("time", plant.time, start, until)],
        };
        let mut narrower = vec![];
        let is_chosen = |name: &str| self.study.narrower.iter().any(|(n, ..)| n.text == name);
        let inputs = self.augmented.inputs.iter();
        for input in inputs.filter(|input| !is_chosen(&input.name)) {
            let node = systems::input_expression(self.study, plant, settings, input)?;
            let values = range(&plant.graph, node, &region).map_err(explain)?;
            let (low, high) = (
                values.enclosure.lo().max(input.min),
                values.enclosure.hi().min(input.max),
            );
            if low <= high && (low > input.min || high < input.max) {
                narrower.push((input.name.clone(), low, high));
            }
        }
        Ok(narrower)
    }

    /// What a family refuses, at its place in the study.
    pub fn refusal(&self, error: DesignError) -> Error {
        let study = self.study;
        match &error {
            DesignError::Tuning(tuning) => study.observer.blame(tuning, &study.file),
            DesignError::Refused(_) => Error::refused(error.words())
                .caused_by(error)
                .at(&study.file),
            DesignError::NoGain { key, .. } => study.observer.place(key, &study.file, &error),
            DesignError::MissingInput(_) => explain(error).at(&study.file),
            DesignError::Spent(spent) => Error::ended(*spent).at(&study.file),
        }
    }
}

/// What one part of an examination may take where the study's time has no limit.
const PART: Duration = Duration::from_secs(10);

/// A share of the time that is left; where the time has no limit, ten seconds.
pub fn share(whole: &Budget, share: f64) -> Budget {
    match whole.left() {
        Some(_) => whole.part(share),
        None => whole.within(PART),
    }
}

/// Limits the states to a tube around their start values.
fn tube(study: &Study, augmented: &mut AugmentedPlant<'_>) -> Result<(), Error> {
    let Some(radius) = study.certify.tube else {
        return Ok(());
    };
    for state in augmented.states.clone() {
        let Some(start) = state.start else {
            let message = format!(
                "`tube` of [certify]: the state '{}' has no start value",
                state.name
            );
            return Err(Error::input(message).at(&study.file));
        };
        let narrowed = augmented.narrow(&state.name, start - radius, start + radius);
        narrowed.map_err(|error| explain(error).at(&study.file))?;
    }
    Ok(())
}

/// The place in the study of a name that does not fit.
fn blame(study: &Study, error: SensorsError) -> Error {
    let name = match &error {
        SensorsError::NoSuchName { name, .. } | SensorsError::Twice { name, .. } => name,
        _ => {
            return explain(error).at(&study.file);
        }
    };
    let sensors = &study.sensors;
    let lists = [
        sensors.measured.as_deref().unwrap_or_default(),
        &sensors.unknown,
        &sensors.disturbances,
    ];
    let found = lists.into_iter().flatten().rfind(|n| n.is_or_has(name));
    let refusal = explain(error);
    match found {
        Some(found) => found.blame(refusal),
        None => refusal.at(&study.file),
    }
}

/// A limit came before the decision on the family.
fn limited(study: &Study, spent: Spent) -> Error {
    Error::ended(spent)
        .at(&study.file)
        .hint("`--time-limit` and `--memory-limit` move the limits, and `family` in [observer] names the family")
}

fn none_fits(study: &Study, examinations: &[Examination]) -> Error {
    let mut ended = examinations.iter().filter_map(Examination::spent);
    if let Some(spent) = ended.find(|spent| spent.is_limit()) {
        return limited(study, spent);
    }
    let reasons: Vec<String> = examinations
        .iter()
        .map(|e| DesignError::Refused(Box::new(e.clone())).words())
        .collect();
    Error::refused(reasons.join("\n"))
        .at(&study.file)
        .hint("`lynkeus check` shows every condition")
}
