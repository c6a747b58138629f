//! The analysis of one branch.

use lynkeus_expr::Node;
use lynkeus_model::Plant;

use crate::branches::Reference;
use crate::expansion::{Affine, Columns, Start};
use crate::hidden::{Hidden, beside, is_steady, joined, symmetries};
use crate::model::Model;
use crate::search::Search;
use crate::series::Stop;
use crate::{Answer, Asked, Note, Quantity, Question, Verdict, hull, lie};
use lynkeus_expr::modular::Modular;

/// Seed of the first point.
const FIRST: u64 = 1;
/// Seed of the second point, which confirms symmetries that the first suggests.
const SECOND: u64 = 4711;
/// Products of coefficients, with a sensitivity each, that a search from a special start may
/// cost; and the most orders it may have.
const WORK: usize = 100_000_000;
const ORDERS: usize = 1000;

/// Decides what can be known in one branch.
///
/// `reference` is a point in it, the model's own values where there is none.
pub(crate) fn in_branch(
    plant: &Plant,
    question: &Question,
    roots: (&[Node], &[Node]),
    reference: Option<&Reference>,
) -> Answer {
    let model = match Model::new(plant, question, roots, reference) {
        Ok(model) => model,
        Err((named, note)) => return undecided(&named, question, note),
    };
    let note = match Analysis::new(&model) {
        Ok(analysis) => return analysis.answer(question),
        Err(Stop::Point(_)) => Note::Singular,
        Err(stop) => Note::StruckAtOnce(stop.word()),
    };
    undecided(&model.named, question, note)
}

fn undecided(named: &[(String, Quantity)], question: &Question, note: Note) -> Answer {
    let asked = |name: &String| Asked {
        name: name.clone(),
        verdict: Verdict::Undecided,
    };
    let quantities = named.iter().map(|(name, kind)| (asked(name), *kind));
    Answer {
        quantities: quantities.collect(),
        about: question.about.iter().map(asked).collect(),
        partial: vec![],
        symmetries: vec![],
        order: 0,
        rank: 0,
        unknowns: named.len(),
        notes: vec![note],
    }
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

/// A model with a start, and what that is worth.
struct Analysis<'a> {
    model: &'a Model,
    start: Start,
    /// around known starts an invariant set in which other points may show more; none where the start is as good
    /// as any other: a rank that does not grow once never grows
    set: Option<Affine>,
}

impl<'a> Analysis<'a> {
    fn new(model: &'a Model) -> Result<Self, Stop> {
        let start = Start::new(model, FIRST);
        let at = |start: Start, set: Option<Affine>| {
            let start = hull::find(model, start)?;
            Ok(Self { model, start, set })
        };
        if model.known_starts().next().is_none() {
            return at(start, None);
        }
        let set = hull::invariant(model, false)?;
        if set.is_empty() {
            return at(start, None);
        }
        if model.time().is_some() {
            // known starts are those at time zero
            match at(start.clone().at_zero(true), None) {
                Ok(found) => {
                    let set = Some(hull::invariant(model, true)?);
                    return Ok(Self { set, ..found });
                }
                Err(Stop::Point(_)) => {}
                Err(stop) => return Err(stop),
            }
        }
        at(start, Some(set))
    }

    fn answer(&self, question: &Question) -> Answer {
        let found = self.found();
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
            symmetries: self.symmetries(&found),
            order: found.search.outputs_order(),
            rank: found.search.rank(),
            unknowns: named + self.model.unknown_inputs * order,
            notes: self.notes(&found),
        }
    }

    fn found(&self) -> Found<'_> {
        let columns = Columns::new(self.model, self.last_order());
        let mut search = Search::new(self.model, &self.start, columns);
        let ended = match &self.set {
            None => search.run_out().map(|()| vec![Hidden::all(&search)]),
            Some(set) if self.model.unknown_inputs == 0 => self.beside(set, &mut search),
            Some(set) => self.steady(set, &mut search),
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
    fn last_order(&self) -> usize {
        let depth = self.model.depth;
        match (&self.set, self.model.unknown_inputs) {
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
    fn elsewhere(&self, set: &Affine) -> Result<Option<Start>, Stop> {
        let start = Start::new(self.model, FIRST).at_zero(self.start.at_zero);
        match hull::find(self.model, start.within(self.model, set)) {
            Ok(start) => Ok(Some(start)),
            Err(Stop::Point(_)) => Ok(None),
            Err(stop) => Err(stop),
        }
    }

    fn beside(&self, set: &Affine, search: &mut Search<'_>) -> Result<Vec<Hidden>, Stop> {
        let last = self.last_order();
        let depth = self.model.depth;
        let elsewhere = self.elsewhere(set);
        let Ok(Some(elsewhere)) = elsewhere else {
            search.until(None, last)?;
            return elsewhere.map(|_| vec![]);
        };
        let mut generic = Search::new(self.model, &elsewhere, Columns::new(self.model, depth));
        let bounded = generic.until(None, depth);
        let most = bounded.is_ok().then(|| generic.rank());
        // what usually is enough, then the symmetries, then as far as it is worth
        search.until(most, last.min(3 * depth + 24))?;
        bounded?;
        if search.rank() >= generic.rank() {
            return Ok(vec![Hidden::all(search)]);
        }
        let fields = lie::directions(self.model, set, &self.start)?;
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

    fn steady(&self, set: &Affine, search: &mut Search<'_>) -> Result<Vec<Hidden>, Stop> {
        let last = self.last_order();
        search.until(None, last)?;
        let elsewhere = self.elsewhere(set)?;
        let Some(elsewhere) = elsewhere.filter(|_| !search.is_complete()) else {
            return Ok(vec![]);
        };
        let starts = (&self.start, &elsewhere);
        Ok(match is_steady(self.model, starts, set, last)? {
            true => vec![Hidden::all(search)],
            false => {
                let fields = lie::directions(self.model, set, &self.start)?;
                joined(search, vec![], &fields)
            }
        })
    }

    /// What hides the unobservable, confirmed at a second start.
    fn symmetries(&self, found: &Found<'_>) -> Vec<crate::Symmetry> {
        let search = &found.search;
        let mut hidden = found.hidden.iter();
        if hidden.all(|hidden| hidden.directions.is_empty()) {
            return vec![];
        }
        let start = Start::new(self.model, SECOND).at_zero(self.start.at_zero);
        let start = hull::find(self.model, start);
        let mut second = start.as_ref().ok().map(|start| {
            let columns = Columns::new(self.model, search.order());
            Search::new(self.model, start, columns)
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

    fn notes(&self, found: &Found<'_>) -> Vec<Note> {
        let program = &self.model.program;
        let mut notes = vec![match program.functions.is_empty() {
            true => Note::Exact,
            false => Note::Generic(program.functions.clone()),
        }];
        if program.choices > 0 {
            notes.push(Note::OwnBranch);
        }
        let (order, named) = (found.search.order(), self.model.named.len());
        let open = |column: usize| {
            found.verdict(&found.search.columns().unit(column)) == Verdict::Undecided
        };
        if let Some(stop) = found.stop {
            notes.push(Note::Struck(stop.word(), order));
        } else if (0..named).any(open) {
            notes.push(Note::Derivatives(order));
        }
        notes
    }
}
