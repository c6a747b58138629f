//! What a study declares beside its plant's equations: read here once, name by name, and nowhere else.
//!
//! A claim (a bound, a deviation, a verdict) takes [`Declared`] apart field by field, without `..`, into what
//! it counts and what it leaves aside ([`Account`]). So a new kind of declaration does not compile until every
//! claim has said which of the two it is.

mod account;
mod correlation;

use std::collections::BTreeMap;

use lynkeus_model::{Home, Plant, Variable};
use lynkeus_run::filter::Limits;
use lynkeus_structure::{AugmentedPlant, range};

use crate::words::explain;
use crate::{Error, Study, near, prepare::calibrate, prepare::systems};
pub use account::Account;
use lynkeus_study::{Late, Name, Noise, Screen};

/// One kind of declaration: what is said of single quantities, by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Kind<T> {
    /// what it is, in words
    name: &'static str,
    said: BTreeMap<String, T>,
    /// whether any of it is more than nothing: a density of 0 is none
    acts: bool,
}

/// What a study declares.
#[derive(Clone, Debug, PartialEq)]
pub struct Declared {
    /// `min` and `max` of the model, `[box]`: states and inputs that have an end
    pub ranges: Kind<()>,
    /// standard deviations, shares or bounds, by output
    pub noise: Kind<Noise>,
    /// how wrong the readings of known inputs are
    pub input_noise: Kind<Noise>,
    /// correlations of the noises of two outputs, by the first of them
    pub correlation: Kind<Vec<(String, f64)>>,
    /// what a sensor can show, by output
    pub limits: Kind<Limits>,
    /// the time between two samples of the study's simulation, by output
    pub samples: Kind<f64>,
    /// spectral densities, by state and unknown input
    pub process_noise: Kind<f64>,
    /// inputs that the observer takes as zero
    pub disturbances: Kind<()>,
    /// bounds of |v'|, by unknown input
    pub slew: Kind<f64>,
    /// bounds of |u'|, |u''|, …, by known input
    pub input_derivatives: Kind<Vec<f64>>,
    /// which cells of a log are no readings, by output
    pub screens: Kind<Vec<Screen>>,
    /// readings that come later than their samples are taken, by output
    pub late: Kind<Late>,
    /// states and outputs that are angles or rotations
    pub manifold: Kind<()>,
}

impl Declared {
    /// What the study says of the plant; an array's name stands for its elements, and an element's own name
    /// comes before it.
    ///
    /// # Errors
    /// A name that stands for nothing of the kind.
    pub fn new(study: &Study, plant: &Plant) -> Result<Self, Error> {
        let sensors = &study.sensors;
        let named = |variables: &[Variable]| -> Vec<String> {
            variables.iter().map(|v| v.name.clone()).collect()
        };
        let unknown = calibrate::unknown_inputs(study, plant);
        let (outputs, inputs) = (named(&plant.outputs), named(&plant.inputs));
        let is_disturbance = |name: &String| sensors.disturbances.iter().any(|d| d.is_or_has(name));
        let known = inputs
            .iter()
            .filter(|name| !unknown.contains(name) && !is_disturbance(name));
        let known: Vec<String> = known.cloned().collect();
        let estimated = [named(&plant.states), unknown.clone()].concat();
        let step = study
            .simulate
            .as_ref()
            .and_then(|settings| systems::sampled_every(study, settings));
        let limits = |(name, low, high): &(Name, f64, f64)| {
            (
                name.clone(),
                Limits {
                    low: *low,
                    high: *high,
                },
            )
        };
        let limits: Vec<(Name, Limits)> = sensors.limits.iter().map(limits).collect();
        let noise = Kind::read(
            "noise",
            "`noise` of [sensors]",
            "output",
            &sensors.noise,
            &outputs,
        )?
        .acting(|noise: &Noise| noise.size() > 0.0);
        let size = |name: &str| noise.of(name).copied();
        let correlated = correlation::read(&sensors.correlation, &size, &outputs)?;
        Ok(Self {
            ranges: ranges(study, plant),
            correlation: Kind::new("correlated noise", correlated)
                .acting(|pairs: &Vec<(String, f64)>| pairs.iter().any(|pair| pair.1 != 0.0)),
            noise,
            input_noise: Kind::read(
                "input noise",
                "`input_noise` of [sensors]",
                "known input",
                &sensors.input_noise,
                &known,
            )?
            .acting(|noise| noise.size() > 0.0),
            limits: Kind::read(
                "limits",
                "`limits` of [sensors]",
                "output",
                &limits,
                &outputs,
            )?,
            samples: Kind::new(
                "samples",
                step.into_iter()
                    .flat_map(|step| outputs.iter().map(move |name| (name.clone(), step))),
            ),
            process_noise: Kind::read(
                "process noise",
                "[process_noise]",
                "estimated quantity",
                &study.process_noise,
                &estimated,
            )?
            .acting(|density| *density > 0.0),
            disturbances: Kind::new(
                "disturbances",
                inputs
                    .iter()
                    .filter(|name| is_disturbance(name))
                    .map(|name| (name.clone(), ())),
            ),
            slew: Kind::read(
                "slew",
                "`slew` of [certify]",
                "unknown input",
                &study.certify.slew,
                &unknown,
            )?,
            input_derivatives: Kind::read(
                "input derivatives",
                "`input_derivatives` of [certify]",
                "known input",
                &study.certify.input_derivatives,
                &known,
            )?,
            screens: screens(&sensors.screens, &outputs)?,
            late: late(&sensors.late, &outputs)?,
            manifold: curved(plant),
        })
    }
}

/// The states and outputs that are no real numbers.
fn curved(plant: &Plant) -> Kind<()> {
    let variables = plant.states.iter().chain(&plant.outputs);
    let curved = variables.filter(|v| v.home != Home::Line);
    Kind::new("angles and rotations", curved.map(|v| (v.name.clone(), ())))
}

/// All that is said of an output; of one kind what its own name says comes before what an array's does.
fn screens(given: &[(Name, Screen)], outputs: &[String]) -> Result<Kind<Vec<Screen>>, Error> {
    let mut said: BTreeMap<String, Vec<Screen>> = BTreeMap::new();
    let kinds = [
        ("plausible", "`plausible` of [sensors]"),
        ("repeats", "`repeats` of [sensors]"),
        ("frozen", "`frozen` of [sensors]"),
    ];
    for (place, (name, key)) in kinds.into_iter().enumerate() {
        let is_own = |screen: &Screen| match screen {
            Screen::Plausible(..) => place == 0,
            Screen::Repeats => place == 1,
            Screen::Frozen(_) => place == 2,
        };
        let own = given.iter().filter(|(_, screen)| is_own(screen));
        let own: Vec<(Name, Screen)> = own.cloned().collect();
        let own = Kind::read(name, key, "output", &own, outputs)?;
        for (output, screen) in own.said {
            said.entry(output).or_default().push(screen);
        }
    }
    Ok(Kind::new("cells that are no readings", said))
}

/// Whose readings are late; a delay of 0 is none.
fn late(given: &[(Name, Late)], outputs: &[String]) -> Result<Kind<Late>, Error> {
    for key in ["delay", "taken_at"] {
        let own = given.iter().filter(|(_, late)| late.key() == key);
        let own: Vec<(Name, Late)> = own.cloned().collect();
        Kind::read(
            "delays",
            &format!("`{key}` of [sensors]"),
            "output",
            &own,
            outputs,
        )?;
    }
    let all = Kind::read("delays", "[sensors]", "output", given, outputs)?;
    let all = all.said.into_iter();
    Ok(Kind::new(
        "delays",
        all.filter(|(_, late)| *late != Late::By(0.0)),
    ))
}

/// The states and inputs of which the model or `[box]` declares an end.
fn ranges(study: &Study, plant: &Plant) -> Kind<()> {
    let is_bounded = |v: &&Variable| v.min.is_finite() || v.max.is_finite();
    let is_narrowed = |v: &&Variable| {
        study
            .narrower
            .iter()
            .any(|(name, ..)| name.is_or_has(&v.name))
    };
    let variables = plant.states.iter().chain(&plant.inputs);
    let ended = variables.filter(|v| is_bounded(v) || is_narrowed(v));
    Kind::new("ranges", ended.map(|v| (v.name.clone(), ())))
}

impl<T: Clone> Kind<T> {
    /// What `key` says of each of `known`, which are called `kind`.
    fn read(
        name: &'static str,
        key: &str,
        kind: &str,
        given: &[(Name, T)],
        known: &[String],
    ) -> Result<Self, Error> {
        let is_meant = |name: &Name| known.iter().any(|k| name.is_or_has(k));
        if let Some((name, _)) = given.iter().find(|(name, _)| !is_meant(name)) {
            let message = format!("{key}: no {kind} is called \"{name}\"");
            let hint = near::suggest(&name.text, known.iter().map(String::as_str));
            return Err(name.blame(Error::input(message).hint(hint)));
        }
        let of = |k: &String| Some((k.clone(), Name::best(given, k)?.clone()));
        Ok(Self::new(name, known.iter().filter_map(of)))
    }
}

impl<T> Kind<T> {
    fn new(name: &'static str, said: impl IntoIterator<Item = (String, T)>) -> Self {
        let said: BTreeMap<String, T> = said.into_iter().collect();
        let acts = !said.is_empty();
        Self { name, said, acts }
    }

    /// With what makes it more than nothing.
    fn acting(self, is_something: impl Fn(&T) -> bool) -> Self {
        let acts = self.said.values().any(is_something);
        Self { acts, ..self }
    }

    /// What is said of a quantity.
    pub fn of(&self, quantity: &str) -> Option<&T> {
        self.said.get(quantity)
    }

    /// Whether any of it is more than nothing.
    pub fn acts(&self) -> bool {
        self.acts
    }

    /// Whether anything of this kind is declared.
    pub fn is_declared(&self) -> bool {
        !self.said.is_empty()
    }

    /// The quantities with what is said of them.
    pub fn iter(&self) -> impl Iterator<Item = (&String, &T)> {
        self.said.iter()
    }
}

/// The declared noise as standard deviations, by output; that of a share is one of the largest value
/// on the box, which may be infinite.
pub(crate) fn deviations(
    declared: &Declared,
    augmented: &AugmentedPlant<'_>,
) -> Result<BTreeMap<String, f64>, Error> {
    let mut found = BTreeMap::new();
    for output in &augmented.outputs {
        let name = &output.variable.name;
        let Some(noise) = declared.noise.of(name) else {
            continue;
        };
        let deviation = match *noise {
            Noise::Absolute(deviation) => deviation,
            Noise::Uniform(bound) => bound / 3.0_f64.sqrt(),
            Noise::Relative(share) => {
                let values = range(augmented.graph(), output.variable.node, &augmented.region());
                share * values.map_err(explain)?.enclosure.magnitude()
            }
        };
        found.insert(name.clone(), deviation);
    }
    Ok(found)
}
