//! Where a study is not in the box for which its observer is certified.

use lynkeus_model::Variable;
use lynkeus_observers::Design;
use lynkeus_structure::AugmentedPlant;
use serde::Serialize;

use crate::{Error, Outcome, Quantity, Series};
use lynkeus_experiment::judge::outside::{self, Outside, outside};
use lynkeus_experiment::prepare::Prepared;

/// Where the study's own plant and estimate are outside of the box.
#[derive(Clone, Debug, Default, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Strays {
    /// whether that is of the study's simulation; else only of the start
    pub simulated: bool,
    /// of the plant
    pub plant: Option<Outside>,
    /// of the estimate
    pub estimate: Option<Outside>,
    /// with `prolong`, the theorem asks nothing of where the estimate is
    #[serde(skip)]
    prolonged: bool,
    /// why the study's run could not be looked at
    #[serde(skip)]
    pub failure: Option<String>,
}

impl Strays {
    /// Looks where the study's run, if it has a `[simulate]`, leaves the box.
    pub(super) fn of(
        prepared: &Prepared<'_>,
        run: Option<&Result<Outcome, Error>>,
        place: &AugmentedPlant<'_>,
        design: &Design,
    ) -> Self {
        let found = Self::looked(run, place, design);
        Self {
            prolonged: prepared.study().observer.tuning.flag("prolong") == Ok(true),
            ..found
        }
    }

    fn looked(
        run: Option<&Result<Outcome, Error>>,
        place: &AugmentedPlant<'_>,
        design: &Design,
    ) -> Self {
        match run {
            None => Self::at_start(place, design),
            Some(Ok(run)) => Self {
                simulated: true,
                ..Self::along(&run.time, &run.quantities, place)
            },
            Some(Err(error)) => Self {
                failure: Some(error.to_string()),
                ..Self::at_start(place, design)
            },
        }
    }

    fn along(time: &Series, quantities: &[Quantity], place: &AugmentedPlant<'_>) -> Self {
        let sides = outside::sides(place);
        let itself = outside::time_itself(time);
        let of = |of| outside(time, quantities.iter().chain([&itself]), of, &sides);
        Self {
            plant: of(outside::PLANT),
            estimate: of(outside::ESTIMATE),
            ..Self::default()
        }
    }

    /// The start values that are given, of quantities whose estimate is a state of the observer.
    fn at_start(place: &AugmentedPlant<'_>, design: &Design) -> Self {
        let observer = &design.observer;
        let estimated = |variable: &Variable| {
            let mut estimates = observer.estimates.iter();
            let own = estimates.find(|e| e.variable.node == variable.node)?;
            let mut states = observer.states.iter();
            states.find(|(signal, _)| signal.symbol == own.node)
        };
        let variables = place.states.iter().chain(&place.inputs);
        let quantities: Vec<Quantity> = variables
            .map(|variable| Quantity {
                name: variable.name.clone(),
                truth: variable.start.map(|x| vec![x].into()),
                estimate: estimated(variable).map(|(_, start)| vec![*start].into()),
                ..Quantity::default()
            })
            .collect();
        Self::along(&vec![0.0].into(), &quantities, place)
    }

    /// What the reader of a certificate has to know; none where all that it asks for is in
    /// the box.
    pub fn words(&self, is_theorem: bool) -> Option<String> {
        let estimate = match is_theorem && self.prolonged {
            true => &None,
            false => &self.estimate,
        };
        let parts = [("plant", &self.plant), ("estimate", estimate)];
        let said = |(who, outside): &(&str, &Option<Outside>)| {
            let outside = outside.as_ref()?;
            Some(match self.simulated {
                true => format!("the simulated {who} is outside of it {}", outside.words()),
                false => format!("the {who} starts outside of it, {}", outside.starts()),
            })
        };
        let said: Vec<String> = parts.iter().filter_map(said).collect();
        (!said.is_empty()).then(|| said.join(", and "))
    }
}
