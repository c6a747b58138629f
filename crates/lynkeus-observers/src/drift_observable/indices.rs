//! Which derivatives of which outputs: the indices.
//!
//! Those of Krener and Respondek are taken where all is proved with them. Else others
//! are examined, on the box of the states and the declared ranges of the inputs, so that a
//! certificate on a smaller range of the inputs is about the same observer.
//!
//! Why the derivatives of the outputs do not determine the state is decided in exact arithmetic:
//! floating point loses a digit with each derivative.

use lynkeus_expr::Spent;
use lynkeus_model::{Plant, Variable};
use lynkeus_observability::{Answer, Question, analyse};
use lynkeus_structure::output_map::Codistribution;
use lynkeus_structure::{AugmentedPlant, Region, Standing, Verdict};

use super::form::{Form, Map, unfit};
use super::settings::{Asked, POLES, Settings};
use crate::conditions::lasts;
use crate::design::{Found, Searched};
use crate::{DesignError, Examination, TuningError, fit_word};

/// Further index vectors that are examined.
const EXAMINED: usize = 6;

/// Further index vectors that are told.
const TOLD: usize = 4;

/// The form of the plant on `region`, or why there is none.
pub(super) fn form(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    region: &Region,
) -> Searched<Form> {
    let map = match Map::new(augmented, settings, region)? {
        Ok(map) => map,
        Err(examination) => return Ok(Err(examination)),
    };
    let lengths = match settings.asked.clone() {
        Asked::Indices(indices) => return Ok(Ok(Form::new(augmented, &map, indices, region)?)),
        Asked::Lengths(lengths) => lengths,
    };
    lasts(augmented)?;
    let mut rows = Codistribution::new(augmented, &map.gradients)?;
    lasts(augmented)?;
    let first = rows.krener_respondek();
    if first.iter().sum::<usize>() < augmented.states.len() {
        return Ok(Err(blind(augmented)?));
    }
    let mut search = Search {
        augmented,
        map: &map,
        region: declared(augmented, region),
        rows,
        others: vec![],
    };
    let found = search.best(&first, &lengths)?;
    let mut chosen = match search.region == *region {
        true => found,
        false => Form::new(augmented, &map, found.form.indices, region)?,
    };
    let summary = chosen.examination.summary.clone().text();
    chosen.examination.summary = (summary + &told(&chosen.form.indices, &search.others)).into();
    Ok(Ok(chosen))
}

/// The region with the inputs' declared ranges.
fn declared(augmented: &AugmentedPlant<'_>, region: &Region) -> Region {
    let mut region = region.clone();
    for side in &mut region.dimensions {
        let mut inputs = augmented.plant.inputs.iter();
        let known = augmented.inputs.iter().any(|i| i.node == side.symbol);
        if let Some(input) = inputs.find(|i| known && i.node == side.symbol) {
            (side.min, side.max) = (input.min, input.max);
        }
    }
    region
}

/// An index vector that was not chosen.
struct Other {
    indices: Vec<usize>,
    known: Known,
}

/// What is known of it.
enum Known {
    /// every condition was looked at
    Examined(Standing),
    /// det Q has both signs at points of the box
    Singular,
    /// nothing
    Open,
}

struct Search<'a, 'p> {
    augmented: &'a AugmentedPlant<'p>,
    map: &'a Map<'a>,
    region: Region,
    rows: Codistribution,
    /// those that were not chosen
    others: Vec<Other>,
}

impl Search<'_, '_> {
    /// The first of the candidates with which most is proved.
    fn best(
        &mut self,
        first: &[usize],
        lengths: &[Option<usize>],
    ) -> Result<Found<Form>, DesignError> {
        let mut candidates = vec![first.to_vec()];
        if first.len() > 1 {
            candidates.extend(self.rows.alternatives(first));
        }
        let fits = |μ: &Vec<usize>| {
            μ.iter()
                .zip(lengths)
                .all(|(μ, l)| l.is_none_or(|l| l == *μ))
        };
        let impossible = listed(&candidates);
        candidates.retain(fits);
        let Some((first, rest)) = candidates.split_first() else {
            let expected =
                format!("lists of lengths that make up a map of the state: {impossible}");
            let found = "lists of other lengths";
            return Err(TuningError::new(POLES.name, expected, found).into());
        };
        let mut form = self.examined(first)?;
        let mut examined = 0;
        for indices in rest {
            let open = form.examination.fit() != Standing::Proved && examined < EXAMINED;
            let known = match open {
                false => Known::Open,
                true if self.rows.changes_sign(indices) => Known::Singular,
                true => {
                    examined += 1;
                    let next = self.examined(indices)?;
                    let (kept, left) = match rank(&next) < rank(&form) {
                        true => (next, form),
                        false => (form, next),
                    };
                    form = kept;
                    self.others.push(Other {
                        indices: left.form.indices,
                        known: Known::Examined(left.examination.fit()),
                    });
                    continue;
                }
            };
            self.others.push(Other {
                indices: indices.clone(),
                known,
            });
        }
        Ok(form)
    }

    fn examined(&self, indices: &[usize]) -> Result<Found<Form>, DesignError> {
        Form::new(self.augmented, self.map, indices.to_vec(), &self.region)
    }
}

/// Smaller for what is closer to a proof.
fn rank(form: &Found<Form>) -> (Standing, usize, usize) {
    let count = |test: fn(&Verdict) -> bool| {
        let checks = form.examination.checks.iter();
        checks.filter(|c| test(&c.verdict)).count()
    };
    (
        form.examination.fit(),
        count(|v| matches!(v, Verdict::Refuted(_))),
        count(|v| matches!(v, Verdict::Undecided(_))),
    )
}

fn listed(all: &[Vec<usize>]) -> String {
    let shown: Vec<String> = all.iter().take(TOLD).map(|μ| format!("{μ:?}")).collect();
    shown.join(", ")
}

/// The chosen indices and the others, for the summary; nothing where there is no choice.
fn told(chosen: &[usize], others: &[Other]) -> String {
    if others.is_empty() {
        return String::new();
    }
    let one = |other: &Other| {
        let known = match other.known {
            Known::Examined(Standing::Proved) => "fits, too",
            Known::Examined(fit) => fit_word(fit),
            Known::Singular => "det Q changes its sign",
            Known::Open => "not examined",
        };
        format!("{:?} {known}", other.indices)
    };
    let mut shown: Vec<String> = others.iter().take(TOLD).map(one).collect();
    if others.len() > TOLD {
        shown.push(format!("{} more", others.len() - TOLD));
    }
    format!("; indices {chosen:?} (others: {})", shown.join(", "))
}

/// The share of the time for the names of what is not seen.
const WORDS: f64 = 0.5;

/// What hides the state, where that is so.
///
/// # Errors
/// Only rounding hides it, or a limit ended the search for it.
pub(super) fn blind(augmented: &AugmentedPlant<'_>) -> Result<Examination, DesignError> {
    lasts(augmented)?;
    let names = |of: &[Variable]| of.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    let drift = answer(augmented, names(&augmented.inputs))?;
    if drift.is_complete() {
        return Err(DesignError::Spent(Spent::Digits));
    }
    let mut hidden = hidden(&drift);
    if hidden.is_empty() {
        lasts(augmented)?;
        return Err(DesignError::Spent(Spent::Digits));
    }
    if !augmented.inputs.is_empty() {
        hidden = self::hidden(&answer(augmented, vec![])?);
    }
    let advice = match hidden.is_empty() {
        true => "the rest shows only where the inputs are not zero; write the model around an operating point, u = u0 + du with the input du".to_owned(),
        false => format!("no measured output feels {}; measure more", hidden.join(", ")),
    };
    Ok(unfit(format!(
        "with u = 0 the outputs and their derivatives determine {} of {} combinations of states: {advice}",
        drift.rank,
        augmented.states.len()
    )))
}

/// States that no derivative of an output tells.
fn hidden(answer: &Answer) -> Vec<String> {
    let quantities = answer.quantities.iter();
    let hidden = quantities
        .filter(|(asked, _)| asked.verdict == lynkeus_observability::Verdict::Unobservable);
    hidden.map(|(asked, _)| asked.name.clone()).collect()
}

/// What can be known of the augmented states, with these inputs at zero.
fn answer(augmented: &AugmentedPlant<'_>, zero: Vec<String>) -> Result<Answer, DesignError> {
    let question = Question {
        disturbances: zero,
        budget: augmented.graph().budget().part(WORDS),
        ..Question::default()
    };
    let answer = analyse(&plant(augmented), &question);
    // the names are the plant's own
    answer.map_err(|_| DesignError::Spent(Spent::Digits))
}

/// The augmented plant as a plant of its own: unknown inputs are states, starts are not known.
fn plant(augmented: &AugmentedPlant<'_>) -> Plant {
    let state = |state: &Variable| Variable {
        fixed: false,
        start_node: None,
        ..state.clone()
    };
    Plant {
        states: augmented.states.iter().map(state).collect(),
        derivatives: augmented.derivatives.clone(),
        inputs: augmented.inputs.clone(),
        outputs: augmented
            .outputs
            .iter()
            .map(|o| o.variable.clone())
            .collect(),
        ..augmented.plant.clone()
    }
}
