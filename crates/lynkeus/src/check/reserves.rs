//! What limits of sensors and disturbances leave of what is known.
//!
//! Beyond its limits a sensor shows no more than the limit: what is known without the sensors whose limits the
//! box reaches stays known, the rest is where they are within them. A disturbance is an unknown input that nobody
//! estimates: what is known whatever it does stays known, the rest is up to the disturbance.

use lynkeus_expr::{Budget, MissingInput, Node};
use lynkeus_model::Plant;
use lynkeus_structure::detectability::{Detectability, Hidden, Observability};
use lynkeus_structure::{
    AugmentedPlant, Sensors, apart_whatever, determined, range_within, uncertain, uniformity,
};

use super::knowledge::{Assumption, Found, Knowledge, Known, Reserve};
use super::{CheckOptions, observability};
use crate::{Error, Study};
use lynkeus_experiment::prepare::calibrate;
use lynkeus_experiment::prepare::{Prepared, seen_by, sensors};
use lynkeus_experiment::words::explain;

/// Cells examined per end of an output's range.
const CELLS: usize = 1000;

/// The study's plant, to be seen by other sensors.
pub(super) struct View<'a> {
    pub prepared: &'a Prepared<'a>,
    /// with parameters as symbols
    pub symbolic: &'a Plant,
    pub options: &'a CheckOptions,
    pub time: Budget,
}

impl View<'_> {
    /// Weakens what is known under an assumption to what limits and disturbances leave of it.
    pub fn reserve(&self, knowledge: &mut Knowledge) -> Result<(), Error> {
        let own = sensors(self.study(), self.prepared.plant());
        if !own.disturbances.is_empty() {
            self.disturbed(knowledge, own)?;
        }
        let limited = self.limited()?;
        if !limited.is_empty() {
            self.within(limited, knowledge)?;
        }
        Ok(())
    }

    fn study(&self) -> &Study {
        self.prepared.study()
    }

    /// The plants, with numbers and with symbols, whose unknown inputs are as `assumption` says, and those of them
    /// that are signals.
    fn plants(&self, assumption: Assumption) -> (Plant, Plant, Vec<String>) {
        let unknown = sensors(self.study(), self.prepared.plant()).unknown;
        let plants = [self.prepared.plant(), self.symbolic].map(Clone::clone);
        match assumption {
            Assumption::Wandering { .. } => {
                let [numbers, symbols] =
                    plants.map(|plant| calibrate::constant_inputs(plant, &unknown));
                (numbers, symbols, vec![])
            }
            _ => {
                let [numbers, symbols] = plants;
                (numbers, symbols, unknown)
            }
        }
    }

    /// Measured outputs whose limits the box reaches.
    fn limited(&self) -> Result<Vec<String>, Error> {
        let limits = &self.prepared.declared().limits;
        if !limits.is_declared() {
            return Ok(vec![]);
        }
        let mut found = vec![];
        // with disturbances, which move readings as well
        let plant = self.prepared.plant();
        let all = Sensors {
            disturbances: vec![],
            ..sensors(self.study(), plant)
        };
        let augmented = seen_by(self.study(), plant, &all)?;
        for output in &augmented.outputs {
            let Some(limits) = limits.of(&output.variable.name) else {
                continue;
            };
            let (node, region) = (output.variable.node, augmented.region());
            let range = range_within(augmented.graph(), node, &region, CELLS);
            let range = range.map_err(explain)?.enclosure;
            let inside =
                range.is_defined() && range.lo() >= limits.low && range.hi() <= limits.high;
            if !inside {
                found.push(output.variable.name.clone());
            }
        }
        Ok(found)
    }

    fn within(&self, limited: Vec<String>, knowledge: &mut Knowledge) -> Result<(), Error> {
        let own = sensors(self.study(), self.prepared.plant());
        let outputs = &self.prepared.augmented().outputs;
        let names = outputs.iter().map(|o| o.variable.name.clone());
        let measured: Vec<String> = names.filter(|name| !limited.contains(name)).collect();
        let rest = match measured.is_empty() {
            true => self.unseen(&own, knowledge.assumption)?,
            false => {
                let left = Sensors { measured, ..own };
                let mut rest = self.known(left.clone(), knowledge.assumption)?;
                // both at once: what is left may rest on a disturbance that is zero
                if !left.disturbances.is_empty() {
                    self.disturbed(&mut rest, left)?;
                }
                rest
            }
        };
        for (name, known) in &mut knowledge.quantities {
            let left = rest.of(name);
            let is_left = left.is_some_and(|left| left == known || *left == Known::Everywhere);
            if is_left {
                continue;
            }
            if let Known::Hidden(detectability) = known {
                // an error that decays may do so only once others are known
                *detectability = match left {
                    Some(Known::Hidden(left)) => *left,
                    _ => Detectability::Undecided,
                };
            } else if known.is_seen() {
                *known = Known::Reserved {
                    known: Box::new(known.clone()),
                    reserve: Reserve::Limits(limited.clone()),
                };
            }
        }
        Ok(())
    }

    /// What becomes of every quantity without sensors.
    fn unseen(&self, own: &Sensors, assumption: Assumption) -> Result<Knowledge, Error> {
        let mut augmented = seen_by(self.study(), self.prepared.plant(), own)?;
        augmented.outputs.clear();
        let states = &augmented.states;
        let hidden = Hidden {
            augmented: &augmented,
            observability: vec![Observability::Hidden; states.len()],
            arbitrary: assumption == Assumption::Arbitrary,
            directions: states.len(),
        };
        let hidden_errors = hidden.hidden_errors().map_err(explain)?;
        let names = states.iter().map(|state| state.name.clone());
        let of = |detectability: Option<Detectability>| {
            Known::Hidden(detectability.unwrap_or(Detectability::Undecided))
        };
        Ok(Knowledge {
            assumption,
            unknown: vec![],
            quantities: names.zip(hidden_errors.of.into_iter().map(of)).collect(),
            point: hidden_errors.point,
            turns: vec![],
        })
    }

    /// What these sensors tell.
    fn known(&self, sensors: Sensors, assumption: Assumption) -> Result<Knowledge, Error> {
        let augmented = seen_by(self.study(), self.prepared.plant(), &sensors)?;
        let (_, symbols, signals) = self.plants(assumption);
        let asked = Sensors {
            unknown: signals,
            ..sensors
        };
        let mut answer = self.answer(&symbols, &asked)?;
        let mut work = || -> Result<Knowledge, MissingInput> {
            let known = determined(&augmented)?;
            let uniform = uniformity(&augmented, &known)?;
            let found = Found {
                uniform: uniform.as_ref(),
                determined: &known,
            };
            found.settle(&augmented, assumption, &mut answer);
            Knowledge::new(&augmented, assumption, &answer, &found)
        };
        work().map_err(explain)
    }

    fn answer(
        &self,
        plant: &Plant,
        sensors: &Sensors,
    ) -> Result<lynkeus_observability::Answer, Error> {
        observability::answer(
            self.study(),
            plant,
            self.options,
            sensors,
            self.time.clone(),
        )
    }

    /// Weakens what the sensors of `own` tell.
    fn disturbed(&self, knowledge: &mut Knowledge, own: Sensors) -> Result<(), Error> {
        let (numbers, symbols, mut signals) = self.plants(knowledge.assumption);
        let names = own.disturbances.clone();
        let firm = match knowledge.assumption {
            Assumption::Arbitrary => None,
            _ => Some(self.firm(&numbers, &own)?),
        };
        signals.extend(names.iter().cloned());
        let asked = Sensors {
            unknown: signals,
            disturbances: vec![],
            ..own
        };
        let augmented = seen_by(self.study(), &numbers, &asked)?;
        let mut answer = self.answer(&symbols, &asked)?;
        let mut work = || -> Result<(Knowledge, Vec<Option<f64>>), MissingInput> {
            let mut known = determined(&augmented)?;
            let found = Found {
                uniform: None,
                determined: &known,
            };
            found.settle(&augmented, Assumption::Arbitrary, &mut answer);
            let left = Knowledge::new(&augmented, Assumption::Arbitrary, &answer, &found)?;
            for (name, firm) in firm.iter().flatten() {
                if let Some(place) = augmented.state_index(name) {
                    known[place] |= firm;
                }
            }
            let sizes = uncertain(&augmented, &known, &sizes(&augmented, &names))?;
            Ok((left, sizes))
        };
        let (left, sizes) = work().map_err(explain)?;
        let constant = !augmented.inputs.is_empty();
        for (name, known) in &mut knowledge.quantities {
            let is_firm = firm
                .iter()
                .flatten()
                .any(|(firm, is_firm)| firm == name && *is_firm);
            let there = match left.of(name) {
                Some(Known::AlmostEverywhere) if is_firm && constant => &Known::WhileConstant,
                Some(Known::AlmostEverywhere) if is_firm => &Known::Everywhere,
                Some(there) => there,
                None => continue,
            };
            *known = match (known.is_seen(), there.is_seen()) {
                (true, true) => known.weaker(there).clone(),
                (false, _) => there.clone(),
                (true, false) => Known::Reserved {
                    known: Box::new(known.clone()),
                    reserve: Reserve::Disturbances {
                        names: names.clone(),
                        bound: augmented.state_index(name).and_then(|place| sizes[place]),
                    },
                },
            };
        }
        let is_linearised = |(_, known): &(String, Known)| matches!(known, Known::Hidden(_));
        if knowledge.quantities.iter().any(is_linearised) {
            knowledge.point = left.point;
        }
        Ok(())
    }

    /// Per state whether the derivatives that no disturbance reaches tell it on the whole box.
    fn firm(&self, plant: &Plant, own: &Sensors) -> Result<Vec<(String, bool)>, Error> {
        let among = |name: &String| own.disturbances.contains(name);
        let known = Sensors {
            measured: own.measured.clone(),
            ..Sensors::default()
        };
        let augmented = seen_by(self.study(), plant, &known)?;
        let inputs = augmented.inputs.iter().filter(|input| among(&input.name));
        let signals: Vec<Node> = inputs.map(|input| input.node).collect();
        let unknown = vec![false; augmented.states.len()];
        let firm = apart_whatever(&augmented, &signals, &unknown).map_err(explain)?;
        let names = augmented.states.iter().map(|s| s.name.clone());
        Ok(names.zip(firm).collect())
    }
}

/// Places and sizes of the disturbances among the states.
fn sizes(augmented: &AugmentedPlant<'_>, names: &[String]) -> Vec<(usize, f64)> {
    let of = |name: &String| {
        let place = augmented.state_index(name)?;
        let side = &augmented.states[place];
        Some((place, side.min.abs().max(side.max.abs())))
    };
    names.iter().filter_map(of).collect()
}
