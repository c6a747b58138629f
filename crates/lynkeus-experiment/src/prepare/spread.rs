//! Starts and parameters that differ from run to run: `spread` of `[simulate]`.

use lynkeus_model::{Home, Plant};
use lynkeus_run::manifold::turned;
use lynkeus_run::{System, deviate};

use crate::prepare::manifold::firsts;

use crate::{Error, Study};
use lynkeus_study::{Name, SimulateSettings};

/// What a run draws by its seed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    /// starts of states by name, with their standard deviations
    starts: Vec<(String, f64)>,
    /// attitudes by the names of their four numbers, with the standard deviation of the rotation about each axis
    attitudes: Vec<([String; 4], f64)>,
    parameters: Vec<Uncertain>,
}

/// A parameter whose value is not the model's.
#[derive(Clone, Debug)]
struct Uncertain {
    name: String,
    value: f64,
    deviation: f64,
}

impl Spread {
    /// What the study asks for.
    ///
    /// # Errors
    /// A name that is neither a state nor a parameter of the plant.
    pub fn new(plant: &Plant, settings: &SimulateSettings) -> Result<Self, Error> {
        let mut found = Self::default();
        for (name, deviation) in &settings.spread {
            let states = || plant.states.iter().filter(|s| name.is_or_has(&s.name));
            let starts = states().filter(|s| !matches!(s.home, Home::Rotation { .. }));
            let starts: Vec<_> = starts.map(|s| (s.name.clone(), *deviation)).collect();
            let attitudes = firsts(&plant.states).filter(|(_, array)| name.text == *array);
            let attitudes = attitudes.map(|(place, _)| {
                let name = |i: usize| plant.states[place + i].name.clone();
                (std::array::from_fn(name), *deviation)
            });
            found.attitudes.extend(attitudes);
            let parameters = plant.parameters.iter().filter_map(|p| {
                let own = name.is_or_has(&p.variable.name);
                own.then_some(Uncertain {
                    name: p.variable.name.clone(),
                    value: p.value?,
                    deviation: *deviation,
                })
            });
            let parameters: Vec<_> = parameters.collect();
            if states().next().is_none() && parameters.is_empty() {
                return Err(unknown(plant, name));
            }
            found.starts.extend(starts);
            found.parameters.extend(parameters);
        }
        Ok(found)
    }

    /// Whether anything is drawn that is not zero.
    pub fn is_random(&self) -> bool {
        let parameters = self.parameters.iter().map(|p| p.deviation);
        let attitudes = self.attitudes.iter().map(|a| a.1);
        let starts = self.starts.iter().map(|s| s.1);
        let mut all = starts.chain(attitudes).chain(parameters);
        all.any(|deviation| deviation > 0.0)
    }

    /// The start of the run of a seed.
    pub fn start(&self, plant: &System, seed: u64) -> Vec<f64> {
        let mut start = plant.start().to_vec();
        for (name, deviation) in &self.starts {
            let place = plant.states().iter().position(|state| state == name);
            if let Some(x) = place.and_then(|i| start.get_mut(i)) {
                *x += deviation * deviate(seed, name);
            }
        }
        for (names, deviation) in &self.attitudes {
            let place = plant.states().iter().position(|state| *state == names[0]);
            let Some(own) = place.and_then(|i| start.get_mut(i..i + 4)) else {
                continue;
            };
            let q = std::array::from_fn(|i| own[i]);
            let [_, x, y, z] = names.each_ref();
            let vector = [x, y, z].map(|name| deviation * deviate(seed, name));
            own.copy_from_slice(&turned(q, vector));
        }
        start
    }

    /// Whether runs have parameters of their own.
    pub fn has_parameters(&self) -> bool {
        !self.parameters.is_empty()
    }

    /// The study with the parameters of the run of a seed.
    pub fn study(&self, study: &Study, seed: u64) -> Study {
        let mut drawn = study.clone();
        for Uncertain {
            name,
            value,
            deviation,
        } in &self.parameters
        {
            let value = value + deviation * deviate(seed, name);
            drawn.parameters.insert(name.clone(), value);
        }
        drawn
    }
}

fn unknown(plant: &Plant, name: &Name) -> Error {
    let parameters = plant.parameters.iter().map(|p| p.variable.name.as_str());
    let names = plant.states.iter().map(|s| s.name.as_str());
    let refusal = Error::input(format!(
        "`spread` of [simulate]: the plant '{}' has no state and no parameter named \"{name}\"",
        plant.name
    ));
    name.blame(refusal.hint(crate::near::suggest(&name.text, names.chain(parameters))))
}
