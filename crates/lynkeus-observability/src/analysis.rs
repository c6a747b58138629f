//! The analysis.

use lynkeus_expr::{Budget, Node};
use lynkeus_model::Plant;

use crate::branches::{Branches, Choices, Reference};
use crate::expansion::{Affine, Columns, Start};
use crate::hidden::{Hidden, beside, joined, steady_from, symmetries};
use crate::model::{Model, Refused, measured};
use crate::search::Search;
use crate::series::Stop;
use crate::{Answer, Asked, Partial, Quantity, Question, QuestionError, Verdict, hull, lie};
use lynkeus_expr::modular::Modular;

/// Seed of the first point.
const FIRST: u64 = 1;
/// Seed of the second point, which confirms symmetries that the first suggests.
const SECOND: u64 = 4711;
const CHOICES: &str = "the model makes choices (if, abs, min, max, sign, floor …)";
const SINGULAR: &str = "its series is not defined at any of the random points tried: a division by zero, or roots of negative numbers";
/// Products of coefficients, with a sensitivity each, that a search from a special start may
/// cost; and the most orders it may have.
const WORK: usize = 100_000_000;
const ORDERS: usize = 1000;

/// Decides what can be known.
///
/// # Errors
/// [`QuestionError`].
pub fn analyse(plant: &Plant, question: &Question) -> Result<Answer, QuestionError> {
    let outputs = measured(plant, question)?;
    let choices = Choices::of(plant, &outputs);
    let own = in_branch(plant, question, None, &[])?;
    if choices.is_empty() {
        return Ok(own);
    }
    match choices.branches(plant) {
        Some(branches) => combined(plant, question, own, &choices, &branches),
        None => Ok(own),
    }
}

/// The answers of all branches in one.
fn combined(
    plant: &Plant,
    question: &Question,
    own: Answer,
    choices: &Choices,
    branches: &Branches,
) -> Result<Answer, QuestionError> {
    let is_hidden = |answer: &Answer| {
        let mut all = answer
            .quantities
            .iter()
            .map(|(asked, _)| asked)
            .chain(&answer.about);
        all.any(|asked| asked.verdict == Verdict::Unobservable)
    };
    let mut answers = vec![];
    let mut guarded = vec![];
    for (k, branch) in branches.found.iter().enumerate() {
        let reference = Some(&branch.reference).filter(|_| k > 0);
        let answer = match k {
            0 => own.clone(),
            _ => in_branch(plant, question, reference, &[])?,
        };
        // what is seen without the guards is seen with them
        guarded.push(match is_hidden(&answer) {
            true => Some(in_branch(plant, question, reference, &choices.guards)?),
            false => None,
        });
        answers.push(answer);
    }
    let mut found = own;
    let (quantities, about) = (found.quantities.len(), found.about.len());
    let mut doubted = vec![];
    for place in 0..quantities + about {
        let at = |answer: &Answer| match place.checked_sub(quantities) {
            None => answer.quantities[place].0.clone(),
            Some(place) => answer.about[place].clone(),
        };
        let own = at(&found);
        let seen: Vec<bool> = answers
            .iter()
            .map(|answer| at(answer).verdict == Verdict::Observable)
            .collect();
        let is_hidden = || {
            guarded.iter().all(|answer| {
                let verdict = answer.as_ref().map(|answer| at(answer).verdict);
                verdict == Some(Verdict::Unobservable)
            })
        };
        let verdict = match seen.contains(&true) {
            true => Verdict::Observable,
            // in branches that were left out it may be seen, unless no path leads to it
            false if is_hidden() && (branches.left_out == 0.0 || !choices.feel(&own.name)) => {
                Verdict::Unobservable
            }
            false => Verdict::Undecided,
        };
        if own.verdict == Verdict::Unobservable && verdict == Verdict::Undecided {
            doubted.push(own.name.clone());
        }
        match place.checked_sub(quantities) {
            None => found.quantities[place].0.verdict = verdict,
            Some(place) => found.about[place].verdict = verdict,
        }
        if let Some(first) = seen.iter().position(|seen| !seen)
            && verdict == Verdict::Observable
        {
            let hides = seen.iter().zip(&branches.found).filter(|(seen, _)| !**seen);
            found.partial.push(Partial {
                name: own.name,
                share: hides.map(|(_, branch)| branch.share).sum(),
                at: named(plant, choices, &branches.found[first].reference),
            });
        }
    }
    // what is told of the model's own branch goes for all
    let is_changed = answers[0].quantities.iter().zip(&found.quantities);
    if is_changed
        .into_iter()
        .any(|(was, is)| was.0.verdict != is.0.verdict)
        && let Some(answer) = guarded.into_iter().next()
    {
        found.symmetries = answer.map_or(vec![], |answer| answer.symmetries);
    }
    found.notes.retain(|note| !note.starts_with(CHOICES));
    found.notes.push(format!(
        "{CHOICES}: {} found at points of the box, each analysed{}",
        match branches.found.len() {
            1 => "one branch was".to_owned(),
            count => format!("{count} branches were"),
        },
        match branches.left_out > 0.0 {
            true => ", and further ones were not",
            false => "",
        }
    ));
    if !doubted.is_empty() {
        found.notes.push(format!(
            "within each branch the outputs do not tell {}; the moments at which the branch changes may",
            doubted.join(", ")
        ));
    }
    Ok(found)
}

/// The values of what the choices read, by name.
fn named(plant: &Plant, choices: &Choices, reference: &Reference) -> Vec<(String, f64)> {
    let read = plant.graph.symbols_of(&choices.guards);
    let variables = plant.states.iter().chain(&plant.inputs);
    let read = variables.filter(|v| read.contains(&v.node));
    read.map(|v| (v.name.clone(), reference[&v.node])).collect()
}

/// Decides what can be known in one branch.
///
/// `reference` is a point in it, the model's own values where there is none; what `guards` choices is
/// measured beside the outputs.
fn in_branch(
    plant: &Plant,
    question: &Question,
    reference: Option<&Reference>,
    guards: &[Node],
) -> Result<Answer, QuestionError> {
    let model = match Model::new(plant, question, reference, guards)? {
        Ok(model) => model,
        Err(Refused { named, reason }) => return Ok(undecided(&named, question, &reason)),
    };
    let analysis = Analysis {
        model: &model,
        budget: &question.budget,
    };
    let reason = |stop: Stop| match stop {
        Stop::Point(_) => SINGULAR.to_owned(),
        stop => format!("the limit of {} struck at once", stop.word()),
    };
    Ok(match analysis.ground() {
        Ok(ground) => analysis.answer(&ground, question),
        Err(stop) => undecided(&model.named, question, &reason(stop)),
    })
}

fn undecided(named: &[(String, Quantity)], question: &Question, reason: &str) -> Answer {
    let asked = |name: &String| Asked {
        name: name.clone(),
        verdict: Verdict::Undecided,
    };
    Answer {
        quantities: named
            .iter()
            .map(|(name, kind)| (asked(name), *kind))
            .collect(),
        about: question.about.iter().map(asked).collect(),
        partial: vec![],
        symmetries: vec![],
        order: 0,
        rank: 0,
        unknowns: named.len(),
        notes: vec![format!("undecided: {reason}")],
    }
}

/// A start, and what it is worth.
struct Ground {
    start: Start,
    /// around known starts an invariant set in which other points may show more; none where the start is as good
    /// as any other: a rank that does not grow once never grows
    set: Option<Affine>,
    /// time starts at zero
    at_zero: bool,
}

/// What the search has found.
struct Found<'a> {
    search: Search<'a>,
    stop: Option<Stop>,
    hidden: Vec<Hidden>,
}

impl Found<'_> {
    fn verdict(&self, row: &[Modular]) -> Verdict {
        match () {
            () if self.search.sees(row) => Verdict::Observable,
            () if self.hidden.iter().any(|hidden| hidden.moves(row)) => Verdict::Unobservable,
            () => Verdict::Undecided,
        }
    }
}

struct Analysis<'a> {
    model: &'a Model,
    budget: &'a Budget,
}

impl<'a> Analysis<'a> {
    fn find(&self, start: Start) -> Result<Start, Stop> {
        hull::find(self.model, start, self.budget)
    }

    fn search<'s>(&self, start: &'s Start, columns: Columns) -> Search<'s>
    where
        'a: 's,
    {
        Search::new(self.model, start, columns, self.budget)
    }

    /// A start, with the invariant set around it.
    fn ground(&self) -> Result<Ground, Stop> {
        let start = Start::new(self.model, FIRST);
        let around = |at_zero| hull::invariant(self.model, at_zero, self.budget);
        if self.model.known_starts().next().is_none() {
            return Ok(Ground {
                start: self.find(start)?,
                set: None,
                at_zero: false,
            });
        }
        let set = around(false)?;
        if set.directions.is_empty() {
            return Ok(Ground {
                start: self.find(start)?,
                set: None,
                at_zero: false,
            });
        }
        if self.model.time().is_some() {
            // known starts are those at time zero
            match self.find(start.clone().at_zero(true)) {
                Ok(start) => {
                    return Ok(Ground {
                        start,
                        set: Some(around(true)?),
                        at_zero: true,
                    });
                }
                Err(Stop::Point(_)) => {}
                Err(stop) => return Err(stop),
            }
        }
        Ok(Ground {
            start: self.find(start)?,
            set: Some(set),
            at_zero: false,
        })
    }

    fn answer(&self, ground: &Ground, question: &Question) -> Answer {
        let found = self.found(ground);
        let quantities = self.model.named.iter().enumerate();
        let quantities = quantities.map(|(column, (name, kind))| {
            let verdict = found.verdict(&found.search.columns().unit(column));
            let name = name.clone();
            (Asked { name, verdict }, *kind)
        });
        let gradients = found.search.about();
        let about = question.about.iter().enumerate().map(|(i, name)| Asked {
            name: name.clone(),
            verdict: match gradients.get(i) {
                Some(row) => found.verdict(row),
                None => Verdict::Undecided,
            },
        });
        let (order, named) = (found.search.order(), self.model.named.len());
        Answer {
            quantities: quantities.collect(),
            about: about.collect(),
            partial: vec![],
            symmetries: self.symmetries(ground, &found),
            order: order + found.search.succession().order,
            rank: found.search.rank(),
            unknowns: named + self.model.unknown_inputs * order,
            notes: self.notes(&found),
        }
    }

    fn found<'s>(&self, ground: &'s Ground) -> Found<'s>
    where
        'a: 's,
    {
        let columns = Columns::new(self.model, self.last_order(ground));
        let mut search = self.search(&ground.start, columns);
        let ended = match &ground.set {
            None => search.run_out().map(|()| vec![Hidden::all(&search)]),
            Some(set) if self.model.unknown_inputs == 0 => self.beside(ground, set, &mut search),
            Some(set) => self.steady(ground, set, &mut search),
        };
        let (stop, hidden) = match ended {
            Ok(hidden) => (None, hidden),
            Err(stop) => (Some(stop), vec![]),
        };
        Found {
            search,
            stop,
            hidden,
        }
    }

    /// Orders after which nothing more is looked for.
    fn last_order(&self, ground: &Ground) -> usize {
        let depth = self.model.depth;
        match (&ground.set, self.model.unknown_inputs) {
            (None, _) => depth,
            (Some(_), 0) => {
                let width = self.model.named.len() + 1;
                let affordable = (2 * WORK / (self.model.program.len() + 1) / width).isqrt();
                affordable.min(ORDERS).max(3 * depth + 24)
            }
            (Some(_), _) => 2 * depth + 6,
        }
    }

    /// A generic point of the set around the known starts.
    fn elsewhere(&self, ground: &Ground, set: &Affine) -> Result<Option<Start>, Stop> {
        let start = Start::new(self.model, FIRST).at_zero(ground.at_zero);
        match self.find(start.within(self.model, set)) {
            Ok(start) => Ok(Some(start)),
            Err(Stop::Point(_)) => Ok(None),
            Err(stop) => Err(stop),
        }
    }

    fn beside(
        &self,
        ground: &Ground,
        set: &Affine,
        search: &mut Search<'_>,
    ) -> Result<Vec<Hidden>, Stop> {
        let last = self.last_order(ground);
        let depth = self.model.depth;
        let elsewhere = self.elsewhere(ground, set);
        let Ok(Some(elsewhere)) = elsewhere else {
            search.until(None, last)?;
            return elsewhere.map(|_| vec![]);
        };
        let mut generic = self.search(&elsewhere, Columns::new(self.model, depth));
        let bounded = generic.until(None, depth);
        let most = bounded.is_ok().then(|| generic.rank());
        // what usually is enough, then the symmetries, then as far as it is worth
        search.until(most, last.min(3 * depth + 24))?;
        bounded?;
        if search.rank() >= generic.rank() {
            return Ok(vec![Hidden::all(search)]);
        }
        let fields = self.fields(ground, set)?;
        let proved = joined(search, beside(search, &generic), &fields);
        if search.is_complete() || proved.iter().any(|hidden| hidden.among.is_none()) {
            return Ok(proved);
        }
        search.until(most, last)?;
        Ok(match search.rank() >= generic.rank() {
            true => vec![Hidden::all(search)],
            false => joined(search, beside(search, &generic), &fields),
        })
    }

    /// Directions along which verified symmetries move the unknowns at the start.
    fn fields(&self, ground: &Ground, set: &Affine) -> Result<Vec<Vec<Modular>>, Stop> {
        let setting = lie::Setting {
            model: self.model,
            set,
            at_zero: ground.at_zero,
            budget: self.budget,
        };
        lie::directions(&setting, &ground.start)
    }

    fn steady(
        &self,
        ground: &Ground,
        set: &Affine,
        search: &mut Search<'_>,
    ) -> Result<Vec<Hidden>, Stop> {
        let last = self.last_order(ground);
        search.until(None, last)?;
        let elsewhere = self.elsewhere(ground, set)?;
        let Some(elsewhere) = elsewhere.filter(|_| !search.is_complete()) else {
            return Ok(vec![]);
        };
        let starts = (&ground.start, &elsewhere);
        let steady = steady_from(self.model, starts, set, last, self.budget)?;
        Ok(match steady {
            Some(_) => vec![Hidden::all(search)],
            None => joined(search, vec![], &self.fields(ground, set)?),
        })
    }

    /// What hides the unobservable, confirmed at a second start.
    fn symmetries(&self, ground: &Ground, found: &Found<'_>) -> Vec<crate::Symmetry> {
        let search = &found.search;
        if found
            .hidden
            .iter()
            .all(|hidden| hidden.directions.is_empty())
        {
            return vec![];
        }
        let start = Start::new(self.model, SECOND).at_zero(ground.at_zero);
        let start = self.find(start);
        let mut second = start.as_ref().ok().map(|start| {
            let columns = Columns::new(self.model, search.order());
            self.search(start, columns)
        });
        let reached = second.as_mut().is_some_and(|second| {
            let ended = second.until(None, search.order());
            ended.is_ok() && second.rank() == search.rank()
        });
        let twin = second.filter(|_| reached);
        let hidden = found.hidden.iter();
        hidden
            .flat_map(|hidden| symmetries(self.model, hidden, search.point(), twin.as_ref()))
            .collect()
    }

    fn notes(&self, found: &Found<'_>) -> Vec<String> {
        let mut notes = vec![self.method()];
        let choices = self.model.program.choices;
        if choices > 0 {
            notes.push(format!("{CHOICES}: the branch at its own values is analysed, and what another branch or the moment of the change would show is not"));
        }
        let (order, named) = (found.search.order(), self.model.named.len());
        let open = |column: usize| {
            found.verdict(&found.search.columns().unit(column)) == Verdict::Undecided
        };
        if let Some(stop) = found.stop {
            let what = stop.word();
            notes.push(format!("the limit of {what} struck after {order} derivatives of the outputs: what is called observable is so, the rest is undecided"));
        } else if (0..named).any(open) {
            notes.push(format!("start values are given: {order} derivatives of the outputs were taken, and what is undecided may show in a later one, or never"));
        }
        notes
    }

    fn method(&self) -> String {
        let functions = &self.model.program.functions;
        match functions.is_empty() {
            true => "exact arithmetic in a prime field at a random point: \"observable\" is certain, \"unobservable\" is wrong with a probability below 1e-12".to_owned(),
            false => format!(
                "exact arithmetic in a prime field at a random point; {} enter through their differential equations, with values drawn at random that keep the usual identities; beyond these, composed functions are taken as generic, and \"observable\" rests on that",
                functions.join(", ")
            ),
        }
    }
}
